"""Things on decks: they go where the robot goes, tilt as it tilts, and each has a place of its own."""

import numpy as np
import pytest

from robot_field import field
from vico.assets.shapes import box
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.world.heights import HeightField

SIZE = (0.28, 0.28, 0.2)


def hill() -> HeightField:
    """Ground that rises by 12 % towards the east."""
    axis = np.linspace(-40.0, 40.0, 81)
    return HeightField(np.tile(0.12 * axis, (81, 1)), 40.0)


def simulation(height: HeightField | None = None, things: int = 1) -> tuple[Simulation, list[int], int]:
    """A Husky with an assistant beside it, and things at the assistant's feet."""
    sim = Simulation(field(height=height), None, SimConfig(assistants=1, robots=("husky",), seed=2, observe=()))
    robot = sim.state.robots.bodies()
    x, y, z = robot.position[0]
    side = np.array([-np.sin(robot.yaw[0]), np.cos(robot.yaw[0])])
    sim.scenario.place_agent("assistant_0", (x + 0.95 * side[0], y + 0.95 * side[1], z))
    shape = [box(SIZE, (0, 0, SIZE[2] / 2))]
    where = sim.state.people.position[0]
    ids = [sim.scenario.add_object(f"parcel {k}", "parcel", shape, where, size=SIZE) for k in range(things)]
    return sim, ids, int(robot.entity[0])


def put_on(sim: Simulation, thing: int, deck: int) -> dict:
    """Have the assistant pick a thing up and put it on a deck; the state it is told."""
    sim.step({"assistant_0": {"type": "pick", "hand": 0, "object": thing}})
    result = sim.step({"assistant_0": {"type": "put", "hand": 0, "target": deck}})
    return result.observations["assistant_0"]["state"]


def in_robots_frame(sim: Simulation, thing: int) -> np.ndarray:
    base = sim.state.robots.engine.base(0)
    return base.rotation.T @ (sim.state.objects.position[sim.state.objects.index(thing)] - base.position)


@pytest.mark.parametrize("height", [None, hill()], ids=["level", "hill"])
def test_what_lies_on_a_deck_moves_turns_and_tilts_with_the_robot(height: HeightField | None) -> None:
    sim, (thing,), deck = simulation(height)
    assert put_on(sim, thing, deck)["action_status"] == "ok"
    k, robots, objects = sim.state.objects.index(thing), sim.state.robots, sim.state.objects
    place, start, yaw = in_robots_frame(sim, thing), objects.position[k].copy(), float(robots.bodies().yaw[0])
    turn = float(objects.yaw[k]) - yaw
    robots.drive(0, (0.6, 0.0, 0.4))
    for _ in range(6):
        sim.step({})
        assert in_robots_frame(sim, thing) == pytest.approx(place, abs=1e-9)
        turned = float(objects.yaw[k] - robots.bodies().yaw[0] - turn)
        assert np.cos(turned) > 0.999
    assert np.linalg.norm(objects.position[k] - start) > 1.0
    up = robots.engine.base(0).rotation[:, 2]
    assert objects.rotation(k)[:, 2] == pytest.approx(up, abs=1e-9)


def test_things_on_a_deck_lie_beside_each_other_until_it_is_full() -> None:
    sim, things, deck = simulation(things=6)
    told = [put_on(sim, thing, deck) for thing in things]
    good = [state["action_status"] == "ok" for state in told]
    assert good == [True] * 4 + [False] * 2  # 0.63 m x 0.62 m of deck, 0.28 m x 0.28 m a thing
    assert told[-1]["action_code"] == "no_free_spot"
    assert "no room" in told[-1]["action_reason"]
    spots = np.array([in_robots_frame(sim, thing)[:2] for thing in things[:4]])
    apart = np.abs(spots[:, None] - spots[None]).max(axis=2)
    assert apart[np.triu_indices(4, 1)].min() >= 0.28 - 1e-9


def test_a_thing_taken_off_a_deck_frees_its_place() -> None:
    sim, things, deck = simulation(things=5)
    for thing in things[:4]:
        put_on(sim, thing, deck)
    assert put_on(sim, things[4], deck)["action_status"] == "refused"
    sim.step({"assistant_0": {"type": "put", "hand": 0}})
    taken = sim.step({"assistant_0": {"type": "pick", "hand": 0, "object": things[1]}})
    assert taken.observations["assistant_0"]["state"]["action_status"] == "ok"
    sim.step({"assistant_0": {"type": "put", "hand": 0}})
    assert put_on(sim, things[1], deck)["action_status"] == "ok"


def test_a_thing_larger_than_the_deck_is_refused() -> None:
    sim, (thing,), deck = simulation()
    sim.state.objects.size[0] = (0.8, 0.8, 0.2)
    state = put_on(sim, thing, deck)
    assert state["action_status"] == "refused"
    assert "larger than the deck" in state["action_reason"]


def test_a_robot_without_a_deck_takes_nothing() -> None:
    sim = Simulation(field(), None, SimConfig(assistants=1, robots=("go2",), seed=2, observe=()))
    where = sim.state.people.position[0]
    thing = sim.scenario.add_object("parcel", "parcel", [box(SIZE, (0, 0, 0.1))], where, size=SIZE)
    state = put_on(sim, thing, int(sim.state.robots.entities[0]))
    assert (state["action_status"], state["action_code"]) == ("refused", "unknown_target")


def test_a_laden_deck_is_restored_from_a_snapshot() -> None:
    sim, (thing,), deck = simulation()
    put_on(sim, thing, deck)
    saved = sim.snapshot()
    sim.state.robots.drive(0, (0.6, 0.0, 0.4))
    hashes = [sim.step({}).hash for _ in range(3)]
    sim.restore(saved)
    sim.state.robots.drive(0, (0.6, 0.0, 0.4))
    assert [sim.step({}).hash for _ in range(3)] == hashes
