"""What people have in their hands: umbrellas by rule, large and small things, cups at the mouth; and whom they face."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

import toy_city
from vico.assets.models.movable import movable_kinds, movable_surfaces
from vico.assets.people import J
from vico.render import Cameras, render
from vico.sim.animation import Hold
from vico.sim.bodies.state_arrays import FIRST_UMBRELLA
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.sim.pictures.hands import Holders, carried_at
from vico.sim.pictures.scene import SceneRenderer


def _sim(weather: str = "clear", assistants: int = 2) -> Simulation:
    sim = Simulation(toy_city.world(), None, SimConfig(assistants=assistants, observe=(), start=43200, weather=weather))
    for k in range(assistants):
        sim.scenario.place_agent(f"assistant_{k}", (-20.0 + 2.0 * k, -15.0))
    return sim


def _give(sim: Simulation, kind: str, hand: int, agent: str = "assistant_0") -> None:
    people = sim.state.people
    at = people.position[people.names.index(agent)] + np.array([0.0, 0.8 - 1.6 * hand, 0.0])
    name, size = f"{kind} {hand} of {agent}", movable_kinds()[kind].size
    thing = sim.scenario.add_object(name, f"good/{kind}/red", movable_surfaces(kind, "red"), at, size=size)
    assert _act(sim, agent, type="pick", hand=hand, object=thing)["action_status"] == "ok"


def _act(sim: Simulation, agent: str = "assistant_0", **action: Any) -> dict[str, Any]:
    state: dict[str, Any] = sim.step({agent: action}).observations[agent]["state"]
    return state


def _drawn(sim: Simulation) -> tuple[Holders, NDArray[np.float64]]:
    """Return everybody as they are drawn, and where their joints are, body frame."""
    scene = SceneRenderer(sim)
    return scene.holders(sim.state), scene.motions(sim.state)[1]


def test_umbrellas_are_up_in_the_rain_outdoors_on_foot_with_a_hand_free() -> None:
    sim = _sim("rain")
    people = sim.state.people
    people.umbrella[:], people.umbrella_habit[:] = (True, False), 0.1
    _act(sim, type="wait")
    assert people.hold.tolist() == [Hold.UMBRELLA_RIGHT, Hold.NOTHING]
    _give(sim, "shopping bag", 1)
    _act(sim, type="wait")
    _act(sim, type="move_forward", distance=0.5)
    assert people.hold[0] == Hold.UMBRELLA_LEFT
    before = sim.snapshot()
    _act(sim, type="move_forward", distance=2.0)
    _act(sim, type="move_forward", distance=2.0)
    assert people.hold[0] == Hold.NOTHING  # nobody runs with it
    ran = sim.state_hash()
    sim.restore(before)
    for _ in range(2):
        _act(sim, type="move_forward", distance=2.0)
    assert sim.state_hash() == ran
    sim.restore(before)
    _give(sim, "toolbox", 0)
    _act(sim, type="wait")
    assert people.hold[0] == Hold.NOTHING
    dry = _sim()
    dry.state.people.umbrella[:] = True
    _act(dry, type="wait")
    assert not dry.state.people.hold.any()


def test_an_umbrella_is_seen_above_the_head_as_a_thing_of_its_own() -> None:
    sim = _sim("rain", assistants=1)
    sim.state.people.umbrella[:], sim.state.people.umbrella_habit[:] = True, 0.0
    _act(sim, type="wait")
    scene = SceneRenderer(sim)
    scene.render_cameras(
        sim.state, Cameras(np.array([[0.0, 0.0, 50.0]]), np.array([[1.0, 0.0, 0.0]]), width=8, height=8)
    )
    x, y, z = sim.state.people.position[0]
    above = Cameras(np.array([[x, y, z + 4.0]]), np.array([[0.0, 0.001, -1.0]]), width=64, height=64)
    seen = render(scene.scene, above, rgb=False, depth=False).segmentation[0]
    assert seen[32, 32] == FIRST_UMBRELLA
    assert sim.entity(FIRST_UMBRELLA)["kind"] == "umbrella"
    beside = Cameras(np.array([[x + 4.0, y, z + 1.0]]), np.array([[-1.0, 0.0, 0.0]]), width=64, height=64)
    seen = render(scene.scene, beside, rgb=False, depth=False).segmentation[0]
    rows = [np.flatnonzero((seen == entity).any(axis=1)).min() for entity in (FIRST_UMBRELLA, 1_010_000)]
    assert rows[0] < rows[1]


def test_large_things_are_carried_before_the_chest_bags_at_the_side() -> None:
    sim = _sim()
    _give(sim, "parcel", 1)
    _give(sim, "shopping bag", 0, "assistant_1")
    for _ in range(2):
        sim.step({"assistant_0": {"type": "move_forward", "distance": 0.8}})
    assert sim.state.people.hold.tolist() == [Hold.BEFORE_CHEST, Hold.NOTHING]
    who, joints = _drawn(sim)
    palms = who.palms(np.arange(2))
    parcel, bag = (carried_at(k, k, sim.state, who) for k in range(2))
    size = sim.state.objects.size
    # Both palms at the box's sides, at half its height, before the belly.
    assert np.abs(np.abs(palms[0, :, 1] - parcel[1]) - size[0, 1] / 2).max() < 0.08
    assert np.abs(palms[0, :, 2] - parcel[2] - 0.4 * size[0, 2]).max() < 0.1
    assert parcel[0] - size[0, 0] / 2 > joints[0, J["pelvis"], 0] + 0.02
    # The bag's handle in the left fist.
    assert np.linalg.norm(palms[1, 0] - (bag + np.array([0.0, 0.0, size[1, 2]]))) < 0.03
    assert bag[1] > 0.15


def test_a_cup_is_at_the_mouth_when_it_is_highest_and_needs_a_free_hand() -> None:
    sim = _sim(assistants=1)
    sim.act({"assistant_0": {"type": "drink"}})
    sim.advance(1.0)
    who, joints = _drawn(sim)
    assert abs(float(who.phase[0]) - 0.5) < 0.06
    mouth = joints[0, J["head"]] + np.array([0.09, 0.0, 0.02])
    assert np.linalg.norm(who.palms(np.array([0]))[0, 1] - mouth) < 0.16
    # The sip is brought to its end in the next second.
    sim.act({})
    sim.advance(0.8)
    assert int(sim.state.people.clip[0]) == int(who.clip[0])
    sim.advance(0.2)
    _act(sim, type="wait")
    assert int(sim.state.people.clip[0]) != int(who.clip[0])
    for hand in range(2):
        _give(sim, "shopping bag", hand)
    assert _act(sim, type="drink")["action_code"] == "hand_full"


def test_who_speaks_turns_to_the_nearest_listener() -> None:
    sim = _sim()
    people = sim.state.people
    people.yaw[:] = np.pi / 2
    sim.step({"assistant_0": {"type": "communicate", "text": "Hello!"}})
    assert abs(float(people.yaw[0])) < 0.05  # assistant_1 stands to the east
    assert abs(float(people.yaw[1]) - np.pi / 2) < 1e-9  # nobody turns somebody else's camera
