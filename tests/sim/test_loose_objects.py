"""Things that physics moves: they fall, are pushed, come to rest, and leave physics when no robot is near."""

from dataclasses import replace

import numpy as np
import pytest

from robot_field import field
from vico.assets.shapes import box
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.sim.physics.surroundings import ENTER, LEAVE
from vico.world.world import World

CRATE = (0.4, 0.4, 0.3)


def simulation(world: World | None = None, **config: object) -> Simulation:
    """A Husky somewhere in a field, and nobody else."""
    return Simulation(world or field(), None, replace(SimConfig(robots=("husky",), seed=2, observe=()), **config))


def ahead(sim: Simulation, metres: float, aside: float = 0.0, height: float = 0.0) -> np.ndarray:
    """A point ahead of the robot, over level ground at 0."""
    base = sim.state.robots.engine.base(0)
    c, s = np.cos(base.yaw), np.sin(base.yaw)
    return np.array([base.position[0] + metres * c - aside * s, base.position[1] + metres * s + aside * c, height])


def add(sim: Simulation, where: np.ndarray, size: tuple[float, float, float] = CRATE, name: str = "crate") -> int:
    """Add a thing at a point, in the air or not; return its index."""
    heading = sim.state.robots.engine.base(0).yaw
    shape = [box(size, (0, 0, size[2] / 2))]
    entity = sim.scenario.add_object(name, "crate", shape, (where[0], where[1], 0.0), size=size, yaw=heading)
    k = sim.state.objects.index(entity)
    sim.state.objects.position[k] = where
    return k


def test_a_husky_pushes_a_crate_and_the_state_says_where_it_is() -> None:
    sim = simulation()
    k = add(sim, ahead(sim, 1.2))
    start = sim.state.objects.position[k].copy()
    sim.state.robots.command(0, np.full(4, 4.0))
    for _ in range(5):
        sim.step({})
    objects, base = sim.state.objects, sim.state.robots.engine.base(0)
    moved = objects.position[k] - start
    assert np.linalg.norm(moved[:2]) > 1.0
    assert abs(moved[2]) < 0.03
    gap = np.linalg.norm(objects.position[k, :2] - base.position[:2]) - 0.495 - 0.2
    assert -0.02 < gap < 0.05
    assert sim.state.objects.bodies().position[0, :2] == pytest.approx(objects.position[k, :2], abs=0.02)


def test_a_thing_let_go_in_the_air_falls_far_from_any_robot_and_leaves_physics() -> None:
    sim = simulation()
    k = add(sim, ahead(sim, 12.0, height=1.5))
    sim.advance(0.5)
    falling = float(sim.state.objects.position[k, 2])
    # g t^2 / 2, from the first sub-step on.
    assert falling == pytest.approx(1.5 - 9.81 * 0.5**2 / 2, abs=0.05)
    sim.advance(2.5)
    assert sim.state.objects.position[k, 2] == pytest.approx(0.0, abs=0.005)
    assert not sim.state.robots.engine.objects().present.any()


def test_a_thing_dropped_off_balance_lies_on_its_side() -> None:
    world = field()
    sim = simulation(world)
    k = add(sim, ahead(sim, 6.0, height=1.0), (0.2, 0.2, 0.8))
    turn = np.array([[np.cos(0.9), 0, np.sin(0.9)], [0, 1, 0], [-np.sin(0.9), 0, np.cos(0.9)]])
    sim.state.objects.set_rotation(k, turn)
    sim.advance(4.0)
    objects = sim.state.objects
    assert abs(objects.rotation(k)[2, 2]) < 0.05
    body = objects.bodies_of(np.array([k]))
    assert body.position[0, 2] == pytest.approx(0.0, abs=0.01)
    assert body.height[0] == pytest.approx(0.2, abs=0.02)


def test_a_thing_that_is_moved_within_a_sub_step_stays_where_it_was_put() -> None:
    sim = simulation()
    k = add(sim, ahead(sim, 1.5, aside=1.0))
    sim.advance(0.05)
    assert sim.state.robots.engine.objects().present.any()
    put = ahead(sim, 2.0, aside=-1.0)
    sim.state.objects.position[k] = put
    sim.advance(0.45)
    assert sim.state.objects.position[k] == pytest.approx(put, abs=0.01)


def test_a_thing_that_lies_and_has_no_robot_near_it_is_left_alone() -> None:
    sim = simulation()
    k = add(sim, ahead(sim, ENTER + 1.0))
    before = sim.state.objects.position[k].copy()
    sim.advance(1.0)
    assert np.array_equal(sim.state.objects.position[k], before)
    assert not sim.state.robots.engine.objects().present.any()


def test_a_thing_leaves_physics_when_the_robot_has_gone() -> None:
    sim = simulation()
    k = add(sim, ahead(sim, 1.5, aside=1.0))
    sim.advance(0.1)
    assert sim.state.robots.engine.objects().present.sum() == 1
    sim.state.robots.command(0, np.full(4, -5.0))
    sim.advance(7.0)
    robot = sim.state.robots.engine.base(0).position
    assert np.linalg.norm(sim.state.objects.position[k] - robot) > LEAVE
    assert not sim.state.robots.engine.objects().present.any()
    assert sim.state.robots.frames.fine > 0


def test_a_thing_that_is_picked_up_is_no_longer_in_physics() -> None:
    sim = simulation(assistants=1)
    k = add(sim, ahead(sim, 1.2, aside=0.8))
    sim.scenario.place_agent("assistant_0", tuple(ahead(sim, 2.2, aside=0.8)))
    sim.step({})
    assert sim.state.robots.engine.objects().present.any()
    told = sim.step({"assistant_0": {"type": "pick", "hand": 0, "object": int(sim.state.objects.entity[k])}})
    assert told.observations["assistant_0"]["state"]["action_status"] == "ok"
    assert sim.state.objects.holder[k] != 0
    assert not sim.state.robots.engine.objects().present.any()


def test_things_in_one_place_are_not_blown_apart() -> None:
    sim = simulation()
    rows = [add(sim, ahead(sim, 1.5), name=f"crate {i}") for i in range(4)]
    before = sim.state.objects.position[rows].copy()
    sim.advance(2.0)
    assert np.abs(sim.state.objects.position[rows] - before).max() < 0.05


def test_of_more_things_than_there_is_room_for_the_nearest_are_moved_and_the_rest_are_counted() -> None:
    sim = simulation()
    for i in range(30):
        add(sim, ahead(sim, 1.0 + 0.15 * (i // 6), aside=0.15 * (i % 6) - 0.4), (0.1, 0.1, 0.1), f"crate {i}")
    sim.advance(0.2)
    record = sim.state.robots.physics_record()
    assert sim.state.robots.engine.objects().present.sum() == 24
    assert record["left_out_at_most"]["objects"] == 6
    assert record["engine"] == "mujoco"
    assert record["frames"]["fine"]["frames"] + record["frames"]["coarse"]["frames"] > 0


def test_a_run_with_things_in_motion_is_restored_bit_for_bit() -> None:
    def setup() -> Simulation:
        sim = simulation()
        add(sim, ahead(sim, 1.2))
        add(sim, ahead(sim, 5.0, height=4.0), name="falling")
        sim.state.robots.command(0, np.full(4, 4.0))
        return sim

    first, second = setup(), setup()
    first.advance(0.73)
    saved = first.snapshot()
    second.restore(saved)
    for sim in (first, second):
        sim.advance(2.27)
    assert first.state_hash() == second.state_hash()
    first.restore(saved)
    first.advance(2.27)
    assert first.state_hash() == second.state_hash()


def test_however_time_is_cut_the_same_happens() -> None:
    hashes = []
    for cuts in ([1.0, 1.0], [0.01] * 200, [0.13, 0.87, 0.5, 0.5]):
        sim = simulation()
        add(sim, ahead(sim, 1.2))
        sim.state.robots.drive(0, (0.8, 0.0, 0.1))
        for seconds in cuts:
            sim.advance(seconds)
        hashes.append(sim.state_hash())
    assert len(set(hashes)) == 1


def test_a_thing_on_another_stays_on_it_in_physics_even_if_it_alone_is_near_enough() -> None:
    sim = simulation(assistants=1, errands=False)
    point = ahead(sim, ENTER + 0.05)
    crate = add(sim, point)
    top = ahead(sim, ENTER - 0.04, height=CRATE[2] + 1e-4)
    box_on_it = add(sim, top, (0.1, 0.1, 0.1), name="box")
    sim.advance(1.0)
    assert sim.state.robots.engine.objects().present.sum() == 2
    assert np.abs(sim.state.objects.position[box_on_it] - top).max() < 0.005
    assert np.abs(sim.state.objects.position[crate] - point).max() < 0.005
    # Far from robots nothing of it is in physics, and nothing falls.
    far = add(sim, ahead(sim, 9.0), name="far crate")
    up = add(sim, ahead(sim, 9.0, height=CRATE[2] + 1e-4), (0.1, 0.1, 0.1), name="cup")
    sim.advance(0.5)
    assert sim.state.objects.position[up, 2] - sim.state.objects.position[far, 2] == CRATE[2] + 1e-4
