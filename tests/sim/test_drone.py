"""The drone: it flies where it is sent, over and round houses and people, in gusts, and lands."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from robot_field import ENGINES, field, people
from vico.assets.robots import robot_model
from vico.errors import InputError
from vico.sim.bodies.arrays import Bodies
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.sim.robots import RobotMode, RobotPopulation, RobotScene, RobotStatus
from vico.sim.robots.path_planning import CEILING, OVER, Airspace
from vico.sim.robots.quadrotor import FlightPhase, air_at, gusts_of
from vico.world.walkable import CROSSING, ROADWAY
from vico.world.world import World

#: A house: middle, extents; its flat roof is 4.5 m high, as walls of `field` are.
HOUSE = (12.0, 0.0, 6.0, 12.0)
ROOF = 4.5
#: Kilograms, m/s2, newtons for each (rad/s)^2: PX4's model of the X500.
MASS, GRAVITY, THRUST = 2.064, 9.81, 8.54858e-6


@pytest.fixture(scope="module", params=ENGINES)
def scenes(request: Any) -> dict[int, RobotScene]:
    world = field(HOUSE)
    return {count: RobotScene(world, ["drone"] * count, packs=False, physics=request.param) for count in (1, 2)}


@pytest.fixture
def robots(scenes: dict[int, RobotScene]) -> RobotPopulation:
    return one(scenes)


def one(scenes: dict[int, RobotScene], seed: int = 0) -> RobotPopulation:
    return RobotPopulation(scenes[1].world, ["drone"], [[0, 0, 0]], packs=False, scene=scenes[1], seed=seed)


def run(robots: RobotPopulation, seconds: float, bodies: Bodies | None = None) -> list[str]:
    """Events of the time."""
    for _ in range(round(seconds * 10)):
        robots.advance(0.1, bodies if bodies is not None else Bodies.none())
    return [event.kind for event in robots.events()]


def place(robots: RobotPopulation, robot: int = 0) -> np.ndarray:
    return robots.engine.base(robot).position.copy()


def flown(robots: RobotPopulation, seconds: float) -> np.ndarray:
    """Where it was every tenth of a second."""
    found = []
    for _ in range(round(seconds * 10)):
        robots.advance(0.1, Bodies.none())
        found.append(place(robots))
    return np.array(found)


def test_it_stays_on_the_ground_until_it_is_sent_and_then_hovers_with_its_weight_in_thrust(
    robots: RobotPopulation,
) -> None:
    run(robots, 1.0)
    assert place(robots)[2] == pytest.approx(robots.models[0].stand, abs=0.01)
    assert not robots.observation(0)["rotor_speed"].any()
    robots.fly_to(0, [0, 0, 5])
    assert run(robots, 7.0) == ["arrived"]
    assert place(robots) == pytest.approx([0, 0, 5], abs=0.05)
    hover = np.sqrt(MASS * GRAVITY / 4 / THRUST)
    assert robots.observation(0)["rotor_speed"] == pytest.approx(hover, rel=0.01)
    assert 0.99 < robots.observation(0)["battery"][0] < 1.0
    assert robots.frames.fine == 0


def test_a_house_between_is_flown_over_or_round_and_never_touched(robots: RobotPopulation) -> None:
    robots.fly_to(0, [24, 0, 2])
    way = flown(robots, 22.0)
    assert [event.kind for event in robots.events()] == ["arrived"]
    assert way[-1] == pytest.approx([24, 0, 2], abs=0.3)
    aside = np.maximum(np.abs(way[:, 0] - HOUSE[0]) - HOUSE[2] / 2, np.abs(way[:, 1]) - HOUSE[3] / 2)
    above = way[:, 2] - ROOF
    assert np.all((aside > 1.0) | (above > 1.5))
    assert above.max() < OVER + 1.0


def test_a_high_target_is_reached_straight_and_a_long_wall_is_flown_over(scenes: dict[int, RobotScene]) -> None:
    space = scenes[1].airspace
    start, high = np.array([0.0, 0.0, 8.0]), np.array([24.0, 0.0, 9.0])
    assert np.array_equal(space.route(start, high), high[None])
    wall = RobotScene(field((12, 0, 1, 78)), ["drone"], packs=False).airspace
    over = wall.route(np.array([0.0, 0.0, 1.0]), np.array([24.0, 0.0, 1.0]))
    assert over[:, 2].max() == pytest.approx(ROOF + OVER)


@pytest.mark.parametrize(
    ("target", "reason"),
    [
        ([12, 0, 3], "what is there, which reaches 4.5 m"),
        ([0, 0, 0.5], "less than 0.8 m above"),
        ([60, 0, 10], "outside of the world"),
        ([0, 0, CEILING + 5], "higher than 120 m"),
    ],
)
def test_points_nobody_can_fly_to_are_refused(robots: RobotPopulation, target: list[float], reason: str) -> None:
    assert reason in robots.flight_refusal(0, target)
    with pytest.raises(InputError, match="fly_to: "):
        robots.fly_to(0, target)
    assert robots.mode[0] == RobotMode.IDLE


def test_it_lands_on_a_flat_roof_and_not_on_its_edge(robots: RobotPopulation) -> None:
    assert not robots.can_land(0, [9.2, 0])
    with pytest.raises(InputError, match="not even enough"):
        robots.land(0, [9.2, 0])
    robots.land(0, [11, 2])
    assert run(robots, 22.0) == ["landed"]
    assert place(robots) == pytest.approx([11, 2, ROOF + robots.models[0].stand], abs=0.15)
    assert not robots.observation(0)["rotor_speed"].any()
    assert robots.bodies().position[0, 2] == pytest.approx(ROOF, abs=0.02)


def test_it_waits_above_somebody_who_stands_where_it_lands(robots: RobotPopulation) -> None:
    robots.fly_to(0, [0, 0, 6])
    run(robots, 6.0)
    person = people((0.5, 0.0))
    robots.land(0)
    assert run(robots, 10.0, person) == []
    assert robots.status[0] == RobotStatus.WAITING
    assert place(robots)[2] - robots.models[0].stand > 1.75 + 0.5
    assert run(robots, 12.0) == ["landed"]


def test_whoever_comes_up_to_it_is_given_room(robots: RobotPopulation) -> None:
    robots.fly_to(0, [0, 0, 1.5])
    run(robots, 4.0)
    for k in range(60):
        robots.advance(0.1, people((-6.0 + 0.14 * k, 0.0), velocity=(1.4, 0.0)))
        away = abs(-6.0 + 0.14 * k - place(robots)[0])
        assert away > 0.7 or place(robots)[2] - robots.models[0].stand > 1.8


def test_it_holds_its_place_in_gusts(robots: RobotPopulation) -> None:
    robots.set_wind(8.0, 0.0)
    robots.fly_to(0, [0, 0, 10])
    run(robots, 8.0)
    away = np.linalg.norm(flown(robots, 10.0) - [0, 0, 10], axis=1)
    assert 0.02 < away.max() < 0.8
    assert robots.engine.base(0).rotation[2, 2] < 0.995  # it leans into the wind


def test_gusts_are_those_of_the_seed_and_blow_with_the_mean_wind_on_average() -> None:
    def felt(seed: int) -> np.ndarray:
        gusts, out, found = gusts_of(seed), np.empty(3), []
        for second in range(2000):
            air_at(gusts, np.array([6.0, 0.0]), np.zeros(3), 10.0, float(second), out)
            found.append(out.copy())
        return np.array(found)

    first = felt(1)
    assert np.array_equal(first, felt(1))
    assert not np.array_equal(first, felt(2))
    assert first.mean(axis=0) == pytest.approx([6.0, 0.0, 0.0], abs=0.3)
    assert first.std(axis=0) == pytest.approx([1.2, 1.2, 0.6], rel=0.35)


def test_a_velocity_is_followed_along_its_heading_and_up(robots: RobotPopulation) -> None:
    robots.command(0, [2.0, 0.0, 1.0, 0.0], "velocity")
    run(robots, 3.0)
    assert robots.engine.base(0).velocity == pytest.approx([2.0, 0.0, 1.0], abs=0.3)
    robots.command(0, [0.0, 1.0, 0.0, 0.5], "velocity")
    before = robots.engine.base(0).yaw
    run(robots, 2.0)
    assert robots.engine.base(0).yaw - before == pytest.approx(1.0, abs=0.15)
    robots.stop(0)
    run(robots, 4.0)
    assert np.abs(robots.engine.base(0).velocity).max() < 0.1


def test_it_flies_neither_out_of_the_world_nor_too_high(robots: RobotPopulation) -> None:
    robots.command(0, [0.0, 8.0, 3.0, 0.0], "velocity")
    way = flown(robots, 14.0)
    assert way[:, 1].max() < 40.0
    assert way[-1, 1] == pytest.approx(38.0, abs=0.5)


def test_rotor_speeds_lift_it_and_uneven_ones_throw_it_over(robots: RobotPopulation) -> None:
    hover = np.sqrt(MASS * GRAVITY / 4 / THRUST)
    robots.command(0, np.full(4, 1.05 * hover))
    assert run(robots, 1.5) == []
    assert place(robots)[2] > 0.6
    robots.command(0, [0.0, 900.0, 900.0, 0.0])  # the left ones: it rolls to the right
    assert run(robots, 3.0) == ["fallen"]
    assert robots.observation(0)["fallen"] == [1]
    assert run(robots, 1.0) == []
    assert robots.observation(0)["rotor_speed"] == pytest.approx(0.0, abs=1.0)


def test_it_keeps_above_whom_it_follows(robots: RobotPopulation) -> None:
    leader = people((0.0, 0.0))
    robots.follow_body(0, int(leader.entity[0]))
    for k in range(150):
        robots.advance(0.1, people((-0.1 * k, 4.0), velocity=(-1.0, 0.0)))
    away = place(robots) - [-15.0, 4.0, 1.75]
    assert 2.5 < np.hypot(*away[:2]) < 9.0
    assert 3.5 < away[2] < 7.0


def test_with_a_low_battery_it_lands(robots: RobotPopulation) -> None:
    robots.fly_to(0, [-10, 0, 5])
    run(robots, 4.0)
    flight = robots.run.flights[0]
    assert flight is not None
    flight.arrays.charge[:] = 0.1
    assert run(robots, 14.0) == ["battery_low", "landed"]
    assert flight.arrays.phase[0] == FlightPhase.LANDED


def test_two_drones_fly_as_each_would_alone_and_are_restored_bit_for_bit(scenes: dict[int, RobotScene]) -> None:
    alone, both = (
        one(scenes),
        RobotPopulation(scenes[2].world, ["drone"] * 2, [[0, 0, 0], [0, -20, 1]], packs=False, scene=scenes[2]),
    )
    for robots in (alone, both):
        robots.set_wind(3.0, -2.0)
        robots.fly_to(0, [-6, 5, 4])
    both.command(1, [1.0, 0.0, 1.0, 0.2], "velocity")
    run(alone, 2.0)
    run(both, 2.0)
    assert np.array_equal(place(alone), place(both))
    saved = both.arrays()
    run(both, 1.0)
    expected = both.arrays()
    both.restore(saved)
    run(both, 1.0)
    found = both.arrays()
    assert all(np.array_equal(found[name], expected[name]) for name in expected)


def test_its_camera_looks_down_a_little_whatever_it_tilts(robots: RobotPopulation) -> None:
    robots.command(0, [6.0, 0.0, 2.0, 0.0], "velocity")
    run(robots, 1.0)
    camera = robots.cameras()[0]
    assert np.degrees(np.arcsin(camera[5])) == pytest.approx(-25.0)
    assert np.linalg.norm(camera[:3] - place(robots)) < 0.2


def test_propellers_turn_while_it_flies(robots: RobotPopulation) -> None:
    before = robots.draw().transforms
    run(robots, 0.5)
    assert np.abs(robots.draw().transforms - before)[:, :3, :3].max() < 0.01
    robots.fly_to(0, [0, 0, 3])
    run(robots, 1.0)
    drawn = robots.draw()
    blades = drawn.transforms[1:5, :3, :3]
    assert not np.allclose(blades, blades[0], atol=0.01)
    assert np.allclose(blades @ blades.transpose(0, 2, 1), np.eye(3), atol=1e-5)


def test_agents_send_it_and_those_that_do_not_fly_are_told_so() -> None:
    sim = Simulation(field(HOUSE), None, SimConfig(robots=("drone", "husky"), observe=(), seed=1))
    fly = {"type": "fly_to", "target": [0.0, 10.0, 8.0]}
    told = sim.step({"robot_0": fly, "robot_1": fly}).observations
    assert told["robot_0"]["state"]["action_status"] == "ok"
    assert told["robot_1"]["state"]["action_code"] == "not_able"
    told = sim.step(
        {"robot_0": {"type": "fly_to", "target": [12.0, 0.0, 2.0]}, "robot_1": {"type": "land"}}
    ).observations
    assert told["robot_0"]["state"]["action_code"] == "blocked"
    assert told["robot_1"]["state"]["action_code"] == "not_able"
    sim.step({"robot_0": {"type": "go_to", "target": [0.0, 20.0, 0.0]}})
    assert told["robot_0"]["sensors"]["battery"].shape == (1,)
    assert sim.state.robots.engine.base(0).position[2] > 0.5


def test_a_model_with_rotors_has_no_other_motors() -> None:
    with pytest.raises(InputError, match="has no other motors"):
        replace(robot_model("drone"), servos=("rotor", "rotor", "rotor", "force"))


def test_on_a_street_it_lands_beside_the_roadway_to_recharge(helsinki: World) -> None:
    space, walkable = Airspace(helsinki), helsinki.walkable
    row, column = np.nonzero((walkable.cls == ROADWAY) & (walkable.clearance > 1.0))
    for point in walkable.centre_of(np.column_stack([column, row])[:: len(row) // 20]):
        spot = space.flat_near(point)
        assert spot is not None
        x, y = walkable.cell_of(spot)
        assert walkable.cls[y, x] not in (ROADWAY, CROSSING)
        assert space.is_flat(spot)
