"""What makes drones fall, and what then: they keep apart in the air, right themselves, and are set upright again."""

from typing import Any

import numpy as np
import pytest

from robot_field import ENGINES, HALF, field, people
from vico.sim.bodies.arrays import Bodies
from vico.sim.robots import RobotMode, RobotPopulation, RobotScene, RobotStatus
from vico.sim.robots.hardware import EXCHANGE
from vico.sim.robots.path_planning import CEILING
from vico.sim.robots.quadrotor import Flight, FlightPhase
from vico.world.heights import HeightField

#: A house of 4.5 m: middle, extents.
HOUSE = (12.0, 0.0, 6.0, 12.0)
#: Rad/s of rotors that throw a drone over to the right: those on the left.
OVER = (0.0, 900.0, 900.0, 0.0)


@pytest.fixture(scope="module", params=ENGINES)
def scenes(request: Any) -> dict[int, RobotScene]:
    world = field(HOUSE)
    return {count: RobotScene(world, ["drone"] * count, packs=False, physics=request.param) for count in (1, 2)}


def drones(scenes: dict[int, RobotScene], *places: tuple[float, float, float]) -> RobotPopulation:
    scene = scenes[len(places)]
    return RobotPopulation(scene.world, ["drone"] * len(places), places, packs=False, scene=scene)


def run(robots: RobotPopulation, seconds: float, bodies: Bodies | None = None) -> list[tuple[int, str]]:
    """Events of the time."""
    for _ in range(round(seconds * 10)):
        robots.advance(0.1, bodies if bodies is not None else Bodies.none())
    return [(event.robot, event.kind) for event in robots.events()]


def place(robots: RobotPopulation, robot: int = 0) -> np.ndarray:
    return robots.engine.base(robot).position.copy()


def flight(robots: RobotPopulation) -> Flight:
    found = robots.run.flights[0]
    assert found is not None
    return found


def throw_over(robots: RobotPopulation) -> None:
    """Have a drone tumble on the ground."""
    robots.command(0, OVER)
    assert run(robots, 2.5) == [(0, "fallen")]


def test_drones_that_meet_head_on_pass_each_other_and_both_arrive(scenes: dict[int, RobotScene]) -> None:
    robots = drones(scenes, (-20, -12, 0), (20, -12, np.pi))
    for robot, x in enumerate((-20, 20)):
        robots.fly_to(robot, [x, -12, 8])
    run(robots, 8.0)
    for robot, x in enumerate((20, -20)):
        robots.fly_to(robot, [x, -12, 8])
    least, seen = np.inf, []
    for _ in range(200):
        seen += run(robots, 0.1)
        least = min(least, float(np.linalg.norm(place(robots, 0) - place(robots, 1))))
    assert least > 1.2
    assert sorted(seen) == [(0, "arrived"), (1, "arrived")]


def test_drones_one_above_the_other_do_not_climb_over_each_other(scenes: dict[int, RobotScene]) -> None:
    robots = drones(scenes, (-20, -12, 0), (-10, -12, 0))
    robots.fly_to(0, [-15, -12, 5])
    robots.fly_to(1, [-15, -12, 8])
    for _ in range(250):
        run(robots, 0.1)
        assert np.linalg.norm(place(robots, 0) - place(robots, 1)) > 1.2
        assert max(place(robots, 0)[2], place(robots, 1)[2]) < 13.0


def test_one_that_is_blown_out_of_the_world_comes_back(scenes: dict[int, RobotScene]) -> None:
    robots = drones(scenes, (0, -30, 0))
    robots.fly_to(0, [0, -37, 30])
    run(robots, 18.0)
    robots.set_wind(0.0, -19.0)
    run(robots, 12.0)
    assert place(robots)[1] < -HALF
    robots.set_wind(0.0, -3.0)
    assert run(robots, 15.0) == []
    assert place(robots)[1] > -HALF
    assert place(robots)[2] < CEILING


def test_one_that_is_off_its_way_comes_back_to_it_before_it_goes_on(scenes: dict[int, RobotScene]) -> None:
    robots = drones(scenes, (-30, -20, 0))
    robots.fly_to(0, [-30, -20, 10])
    run(robots, 8.0)
    robots.fly_to(0, [30, -20, 10])
    run(robots, 4.0)
    robots.set_wind(0.0, 14.0)
    furthest = 0.0
    for _ in range(80):
        run(robots, 0.1)
        furthest = max(furthest, abs(float(place(robots)[1]) + 20.0))
    # Where it only flew on along it, 6 m.
    assert furthest < 3.0


def test_one_that_is_thrown_over_in_the_air_turns_upright_again(scenes: dict[int, RobotScene]) -> None:
    robots = drones(scenes, (0, 0, 0))
    robots.fly_to(0, [0, 0, 30])
    run(robots, 16.0)
    robots.command(0, OVER)
    while robots.engine.base(0).rotation[2, 2] > -0.3:
        run(robots, 0.1)
    robots.fly_to(0, [0, 0, 30])
    assert run(robots, 8.0) == [(0, "arrived")]
    assert place(robots)[2] == pytest.approx(30.0, abs=0.5)


def test_one_that_fell_is_set_upright_on_free_level_ground_and_flies_again(scenes: dict[int, RobotScene]) -> None:
    robots = drones(scenes, (0, 0, 0))
    throw_over(robots)
    where = place(robots)
    around = [(float(where[0]) + 0.8 * x, float(where[1]) + 0.8 * y) for x in (-1, 0, 1) for y in (-1, 0, 1)]
    crowd = people(*around)
    assert run(robots, 16.0, crowd) == []
    assert run(robots, 5.0, crowd) == [(0, "recovered")]
    assert (np.hypot(*(crowd.position[:, :2] - place(robots)[:2]).T) > 0.25 + 0.3 + 0.4).all()
    assert np.linalg.norm(place(robots) - where) < 4.0
    assert robots.status[0] == RobotStatus.IDLE
    assert robots.mode[0] == RobotMode.IDLE
    robots.fly_to(0, [0, 0, 5])
    assert run(robots, 9.0) == [(0, "arrived")]


def test_one_that_fell_goes_on_bit_for_bit_from_a_snapshot(scenes: dict[int, RobotScene]) -> None:
    robots = drones(scenes, (0, 0, 0))
    throw_over(robots)
    run(robots, 18.0)
    saved = robots.arrays()
    assert run(robots, 4.0) == [(0, "recovered")]
    expected = robots.arrays()
    robots.restore(saved)
    assert run(robots, 4.0) == [(0, "recovered")]
    found = robots.arrays()
    assert all(np.array_equal(found[name], expected[name]) for name in expected)


def test_one_that_leans_does_not_take_off_and_where_nothing_is_level_it_is_told_to_be_lost() -> None:
    axis = np.linspace(-HALF, HALF, 81)
    steep = HeightField(np.broadcast_to(0.7 * axis, (81, 81)).astype(np.float32), HALF)
    robots = RobotPopulation(field(height=steep), ["drone"], [[0, 0, 0]], packs=False)
    assert (0, "fallen") in run(robots, 3.0)
    assert run(robots, 32.0) == [(0, "lost")]
    assert robots.status[0] == RobotStatus.FALLEN


def test_with_an_empty_battery_it_drops_and_gets_a_full_one_and_flies_again(scenes: dict[int, RobotScene]) -> None:
    robots = drones(scenes, (0, 0, 0))
    robots.fly_to(0, [0, 0, 4])
    run(robots, 6.0)
    flight(robots).arrays.charge[:] = 0.0
    seen = run(robots, 25.0)
    assert seen[0] == (0, "battery_empty")
    assert place(robots)[2] < 0.5
    assert robots.engine.base(0).rotation[2, 2] > 0.95
    robots.run.arrays.uncharged[0] = EXCHANGE - 1.0
    assert run(robots, 2.0) == [(0, "recharged")]
    robots.fly_to(0, [0, 0, 4])
    assert run(robots, 8.0) == [(0, "arrived")]


def test_with_a_low_battery_it_lands_far_away_if_need_be_and_again_when_it_was_sent_elsewhere() -> None:
    axis = np.linspace(-HALF, HALF, 161)
    slope = np.broadcast_to(0.4 * np.minimum(axis, 22.0), (161, 161))  # level from x = 22 m on
    world = field(height=HeightField(slope.astype(np.float32), HALF))
    robots = RobotPopulation(world, ["drone"], [[30, 0, 0]], packs=False)
    robots.fly_to(0, [-14, 0, 8])
    run(robots, 14.0)
    flight(robots).arrays.charge[:] = 0.1
    assert run(robots, 1.0) == [(0, "battery_low")]
    robots.fly_to(0, [-18, 0, 8])
    assert run(robots, 45.0) == [(0, "arrived"), (0, "landed")]
    assert place(robots)[0] > 22.0
    assert flight(robots).arrays.phase[0] == FlightPhase.LANDED


def test_on_errands_it_lands_in_a_gale_and_takes_off_when_that_is_over(helsinki: Any) -> None:
    robots = RobotPopulation(helsinki, ["drone"], seed=3, errands=True, packs=False)
    run(robots, 5.0)
    assert flight(robots).arrays.phase[0] == FlightPhase.FLYING
    robots.set_wind(11.0, 0.0)
    seen: list[tuple[int, str]] = []
    for _ in range(120):
        seen += run(robots, 1.0)
        if (0, "landed") in seen:
            break
    assert seen[-1] == (0, "landed")
    assert run(robots, 20.0) == []
    robots.set_wind(3.0, 0.0)
    run(robots, 8.0)
    assert flight(robots).arrays.phase[0] == FlightPhase.FLYING


def test_one_that_was_blown_off_a_roof_while_it_landed_tries_again(scenes: dict[int, RobotScene]) -> None:
    robots = drones(scenes, (0, 0, 0))
    robots.fly_to(0, [7.5, 2, 2.5])
    assert run(robots, 12.0) == [(0, "arrived")]
    # Beside the wall, below the spot on which it was about to land.
    robots.run.set_mode(0, RobotMode.ROUTE)
    flight(robots).ways[0] = np.array([[11.0, 2.0, 4.5]])
    flight(robots).arrays.phase[0] = FlightPhase.LANDING
    assert run(robots, 30.0) == [(0, "landed")]
    assert place(robots) == pytest.approx([11, 2, 4.5 + robots.models[0].stand], abs=0.3)
