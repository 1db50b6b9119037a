"""Avatars in motion: feet on the ground, nothing tunnels, nobody overlaps."""

from __future__ import annotations

import numpy as np
import pytest

import toy_city
from vico.sim.animation.motions import CLIPS
from vico.sim.bodies.avatars import clearances
from vico.sim.bodies.state_arrays import RADIUS, Vehicle
from vico.sim.config import SimConfig
from vico.sim.loop.checks import overlaps_of
from vico.sim.loop.simulation import Simulation


@pytest.fixture
def sim() -> Simulation:
    """Four assistants in the toy city."""
    return Simulation(toy_city.world(), None, SimConfig(assistants=4, observe=()))


def run_at(sim: Simulation, name: str, distance: float, steps: int) -> list[str]:
    """Walk on for some steps; return the statuses."""
    action = {name: {"type": "move_forward", "distance": distance}}
    return [sim.step(action).observations[name]["state"]["action_status"] for _ in range(steps)]


@pytest.mark.parametrize("distance", [0.3, 1.0, 2.5])
def test_a_wall_stops_a_walk_just_before_it(sim: Simulation, distance: float) -> None:
    sim.scenario.place_agent("assistant_0", (0.0, 0.0), yaw=np.pi / 2)
    statuses = run_at(sim, "assistant_0", distance, 20)
    south = toy_city.HOUSE[1]
    assert statuses[-1] == "collision"
    assert south - RADIUS - 0.6 < sim.state.people.position[0, 1] <= south - RADIUS


def test_nobody_runs_through_somebody(sim: Simulation) -> None:
    sim.scenario.place_agent("assistant_0", (-10.0, -15.0))
    sim.scenario.place_agent("assistant_1", (-6.0, -15.0))
    run_at(sim, "assistant_0", 2.5, 4)
    gap = sim.state.people.position[1, 0] - sim.state.people.position[0, 0]
    assert 2 * RADIUS <= gap < 2 * RADIUS + 0.01
    assert sim.state.people.contact[0] == sim.state.people.entity[1]


def test_two_who_walk_at_each_other_both_stop_and_say_so(sim: Simulation) -> None:
    sim.scenario.place_agent("assistant_0", (-1.5, -15.0))
    sim.scenario.place_agent("assistant_1", (1.5, -15.0), yaw=np.pi)
    ahead = {"type": "move_forward", "distance": 1.0}
    for _ in range(3):
        result = sim.step({"assistant_0": ahead, "assistant_1": ahead})
    reasons = [result.observations[f"assistant_{i}"]["state"]["action_reason"] for i in (0, 1)]
    assert reasons == ["stopped by assistant"] * 2


def test_a_crowd_that_walks_about_at_random_never_overlaps(sim: Simulation) -> None:
    for i in range(4):
        sim.scenario.place_agent(f"assistant_{i}", (i % 2 * 1.5, -15.0 + i // 2 * 1.5))
    chance = np.random.default_rng(0)
    for _ in range(300):
        turn = {"type": "turn_left", "degrees": float(chance.uniform(0, 360))}
        step = {"type": "move_forward", "distance": float(chance.uniform(0, 2.5))}
        sim.step({f"assistant_{i}": turn if chance.random() < 0.5 else step for i in range(4)})
        assert overlaps_of(sim.state) == []
        walls = sim.world.walkable.clearance_at(sim.state.people.position[:, :2])
        assert walls.min() >= RADIUS


def test_feet_stay_on_sloping_ground(sim: Simulation) -> None:
    sim.scenario.place_agent("assistant_0", (-20.0, -15.0))
    run_at(sim, "assistant_0", 2.5, 10)
    x, y, z = sim.state.people.position[0]
    assert x > 0.0
    assert z == pytest.approx(float(sim.world.height((x, y))))


def test_furniture_and_walls_of_a_room_stop_people(sim: Simulation) -> None:
    sim.scenario.place_agent("assistant_0", (-5.0, 3.9), yaw=np.pi / 2)
    for _ in range(4):
        sim.step({"assistant_0": {"type": "enter", "place": toy_city.CAFE}})
    run_at(sim, "assistant_0", 1.0, 8)
    room = int(sim.state.people.room[0])
    gap = sim.state.indoor.gap(room, sim.state.people.position[0, :2])
    assert RADIUS <= gap < RADIUS + 0.05


def test_the_edge_of_the_map_holds_people_in(sim: Simulation) -> None:
    sim.scenario.place_agent("assistant_0", (30.0, -15.0))
    statuses = run_at(sim, "assistant_0", 2.5, 8)
    assert statuses[-1] == "collision"
    assert sim.state.people.position[0, 0] < toy_city.HALF


def test_running_shows_as_running_and_standing_as_idle(sim: Simulation) -> None:

    sim.scenario.place_agent("assistant_0", (-20.0, -15.0))
    run_at(sim, "assistant_0", 2.5, 1)
    running = CLIPS[sim.state.people.clip[0]]
    sim.step({})
    assert (running, CLIPS[sim.state.people.clip[0]]) == ("run", "idle")


@pytest.mark.parametrize("ahead", [0.0, 0.3, 0.6, 0.85])
def test_a_cyclist_never_turns_or_rides_into_somebody_beside_the_bicycle(sim: Simulation, ahead: float) -> None:
    sim.scenario.place_agent("assistant_0", (0.0, -15.0))
    sim.scenario.place_agent("assistant_1", (ahead, -14.45))
    for i in (2, 3):
        sim.scenario.place_agent(f"assistant_{i}", (-20.0 + 3 * i, -15.0))
    sim.state.people.vehicle[0] = Vehicle.BIKE
    for turn in ("turn_left", "turn_right", "turn_left"):
        sim.step({"assistant_0": {"type": turn, "degrees": 80.0}})
        assert overlaps_of(sim.state) == []
        sim.step({"assistant_0": {"type": "move_forward", "distance": 0.4}})
        assert overlaps_of(sim.state) == []


def test_people_stop_a_little_before_a_robot_that_physics_may_move() -> None:
    sim = Simulation(toy_city.world(), None, SimConfig(assistants=1, robots=("husky",), observe=()))
    assert sim.state.robots is not None
    x, y, _ = sim.state.robots.bodies().position[0]
    sim.scenario.place_agent("assistant_0", (x + 1.6, y), yaw=np.pi)
    for _ in range(3):
        result = sim.step({"assistant_0": {"type": "move_forward", "distance": 1.0}})
    assert "stopped by robot" in result.observations["assistant_0"]["state"]["action_reason"]
    gap = clearances(sim.state.people.position[0], sim.state.robots.bodies())[0] - RADIUS
    assert 0.025 < gap < 0.05


def test_the_state_knows_which_motion_came_before_and_how_it_ended(sim: Simulation) -> None:
    sim.scenario.place_agent("assistant_0", (-20.0, -15.0))
    run_at(sim, "assistant_0", 1.0, 2)
    p = sim.state.people
    assert CLIPS[p.clip[0]] == "walk"
    ended = float(p.phase[0])
    sim.advance(0.2)
    assert (CLIPS[p.clip[0]], CLIPS[p.clip_before[0]]) == ("idle", "walk")
    assert p.phase_before[0] == ended
    assert p.pace_before[0] == pytest.approx(1.0, abs=0.1)
    assert p.clip_time[0] == pytest.approx(0.2)


def test_strides_change_with_the_pace_and_not_with_what_is_left_of_the_way(sim: Simulation) -> None:
    sim.scenario.place_agent("assistant_0", (-20.0, -15.0))
    paces = []
    for distance in (1.0, 1.0, 0.5):
        run_at(sim, "assistant_0", distance, 1)
        paces.append(round(float(sim.state.people.pace[0]), 2))
    assert paces == [1.0, 1.0, 0.5]
