"""Robots' ways lead round ground that events close, and round what is parked in them."""

import numpy as np
import pytest

from robot_field import HALF, field
from vico.sim.bodies.arrays import CAR, Bodies
from vico.sim.config import SimConfig
from vico.sim.environment.agenda import EventEffects
from vico.sim.loop.simulation import Simulation
from vico.sim.robots import RobotPopulation, RobotScene, RobotStatus
from vico.sim.robots.trips import outdoor_path
from vico.world.heights import HeightField
from vico.world.walkable import ROADWAY
from vico.world.world import World

CLOSED = ((8.0, 0.0, 4.0),)


@pytest.fixture
def husky() -> RobotPopulation:
    """One that stands at the origin."""
    return RobotPopulation(field(), ["husky"], [[0, 0, 0]], packs=False)


def run(robots: RobotPopulation, seconds: float, bodies: Bodies | None = None) -> tuple[list[str], np.ndarray]:
    """Return what happened, and where it was ten times a second."""
    events, places = [], []
    for _ in range(round(seconds * 10)):
        robots.advance(0.1, bodies if bodies is not None else Bodies.none())
        events += [event.kind for event in robots.events()]
        places.append(robots.run.position(0)[:2].copy())
    return events, np.array(places)


def test_a_way_leads_round_closed_ground_and_none_into_it(husky: RobotPopulation) -> None:
    husky.set_closed_ground(CLOSED)
    assert not husky.has_way(0, [8.0, 1.0])
    assert husky.go_to(0, [15.0, 0.0])
    events, places = run(husky, 30.0)
    assert events == ["arrived"]
    assert np.hypot(*(places - [8.0, 0.0]).T).min() > 3.5


def test_ways_lead_round_ground_that_is_too_steep() -> None:
    n, cell = 81, 2 * HALF / 80
    x, y = np.meshgrid(np.arange(n) * cell - HALF, np.arange(n) * cell - HALF)
    # A bank 1 m high that rises by a quarter of its length, but for a ramp in the north.
    slope = np.where(y > 12.0, 0.1, 0.25)
    hill = HeightField(np.clip((x - 5.0) * slope, 0.0, 1.0).astype(np.float32), HALF)
    robots = RobotPopulation(field(height=hill), ["manipulator", "husky"], [[0, 0, 0], [0, -6, 0]], packs=False)
    straight, round_it = (outdoor_path(robots.run, robot, np.array([19.0, -3.0])) for robot in (1, 0))
    assert straight is not None
    assert round_it is not None
    assert straight[:, 1].max() < 0.0
    assert round_it[:, 1].max() > 12.0


def test_ground_that_is_closed_on_the_way_changes_the_way_and_is_kept_in_a_snapshot(husky: RobotPopulation) -> None:
    assert husky.go_to(0, [15.0, 0.0])
    run(husky, 2.0)
    husky.set_closed_ground(CLOSED)
    saved = {name: array.copy() for name, array in husky.arrays().items()}
    expected = run(husky, 2.0)[1]
    husky.set_closed_ground(())
    husky.restore(saved)
    husky.set_closed_ground(CLOSED)  # as every sub-step says it again: no news
    assert np.array_equal(run(husky, 2.0)[1], expected)
    events, places = run(husky, 25.0)
    assert events == ["arrived"]
    assert np.hypot(*(places - [8.0, 0.0]).T).min() > 3.5


def test_a_goal_that_is_closed_meanwhile_is_given_up(husky: RobotPopulation) -> None:
    assert husky.go_to(0, [8.0, 1.0])
    run(husky, 1.0)
    husky.set_closed_ground(CLOSED)
    assert run(husky, 0.1)[0] == ["blocked"]
    husky.set_closed_ground(())
    assert husky.go_to(0, [8.0, 1.0])
    assert husky.status[0] == RobotStatus.MOVING


def test_who_stands_on_closed_ground_may_leave_it(husky: RobotPopulation) -> None:
    husky.set_closed_ground(((0.0, 0.0, 9.0),))
    assert husky.go_to(0, [12.0, 0.0])
    assert run(husky, 20.0)[0] == ["arrived"]


def test_it_goes_round_a_car_parked_across_its_way(husky: RobotPopulation) -> None:
    car = Bodies(
        np.array([77], np.int32),
        np.array([CAR], np.int8),
        np.array([[6.0, 0.5, 0.0]]),
        np.array([np.pi / 2]),
        np.array([2.2]),
        np.array([0.9]),
        np.array([1.5]),
        np.zeros((1, 2)),
    )
    assert husky.go_to(0, [12.0, 0.0])
    events, _ = run(husky, 45.0, car)
    assert events == ["arrived"]


def test_a_run_tells_robots_what_its_events_close_and_refuses_ways_there(monkeypatch: pytest.MonkeyPatch) -> None:
    sim = Simulation(field((0, 10, 6, 6)), None, SimConfig(robots=("husky",), observe=(), seed=1))
    monkeypatch.setattr(sim.state.environment.agenda, "_effects", EventEffects({}, ground=CLOSED))
    sim.step({})
    codes = []
    for target in ([8.0, 1.0, 0.0], [-45.0, 60.0, 0.0], [14.0, 0.0, 0.0]):
        told = sim.step({"robot_0": {"type": "go_to", "target": target}}).observations["robot_0"]["state"]
        codes.append(told["action_code"])
    assert codes == ["closed", "blocked", ""]
    robots = sim.state.robots
    assert isinstance(robots, RobotPopulation)
    assert robots.run.closed_ground == CLOSED


def steepest(world: World, way: np.ndarray) -> float:
    """Return by how much the ground rises or falls within 0.1 m on a way, at most, metres."""
    length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(way, axis=0).T))])
    places = np.arange(0.0, length[-1], 0.02)
    heights = world.height(np.column_stack([np.interp(places, length, column) for column in way.T]))
    return float(np.abs(heights[5:] - heights[:-5]).max())


def test_ways_of_a_robot_lead_round_kerbs_that_are_too_high_for_it(helsinki: World) -> None:
    scene = RobotScene(helsinki, ["manipulator", "husky"], packs=False)
    row, column = np.nonzero(helsinki.walkable.connected & ~scene.narrow(0))
    spots = helsinki.walkable.centre_of(np.column_stack([column, row])[:: len(row) // 40])
    found = {0: [], 1: []}
    for robot, ways in found.items():
        for a, b in zip(spots[:20], spots[20:], strict=False):
            way = scene.router.path(a, b, blocked=scene.narrow(robot))
            if way is not None:
                ways.append(steepest(helsinki, way))
    assert len(found[0]) > 10
    assert max(found[0]) < 0.07
    assert max(found[1]) > 0.09  # others take them
    is_roadway = helsinki.walkable.cls == ROADWAY
    assert (is_roadway & ~scene.narrow(0)).any()
