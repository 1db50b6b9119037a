"""Every action: what it does, and what is refused with which reason."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import toy_city
from vico.assets.shapes import box
from vico.sim.actions import ACTIONS, Command, Refusal, actions_markdown, check
from vico.sim.bodies.state_arrays import Posture
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation

RESIDENTS = ("resident_0", "resident_1")


@pytest.fixture
def sim() -> Simulation:
    """The toy city a while before 08:00: two residents in the café, one on the way, and an assistant."""
    return Simulation(
        toy_city.world(), toy_city.community(), SimConfig(start=7 * 3600 + 58 * 60, assistants=1, observe=())
    )


def act(sim: Simulation, name: str, **action: Any) -> dict[str, Any]:
    """Do one action, and return the agent's state afterwards."""
    result = sim.step({name: action})
    state: dict[str, Any] = result.observations[name]["state"]
    return state


def outdoors(sim: Simulation, name: str, x: float, y: float, yaw: float = 0.0) -> None:
    """Stand somebody outdoors."""
    sim.scenario.place_agent(name, (x, y), yaw=yaw)


anything = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20) | st.binary(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=10), inner, max_size=4),
    max_leaves=8,
)
fields = sorted({name for action in ACTIONS.values() for name in action.fields})
nearly = st.fixed_dictionaries(
    {"type": st.sampled_from(list(ACTIONS))}, optional={name: anything | st.just(1) | st.just("x") for name in fields}
)
SHARED = Simulation(toy_city.world(), toy_city.community(), SimConfig(assistants=1, observe=()))


@settings(max_examples=300, deadline=None)
@given(anything | nearly)
def test_any_action_whatsoever_is_either_a_command_or_refused_with_a_reason(action: object) -> None:
    verdict = check(action, 0, SHARED.state)
    assert isinstance(verdict, Command) or (isinstance(verdict, Refusal) and verdict.code and len(verdict.reason) > 5)


@settings(max_examples=100, deadline=None)
@given(st.lists(nearly, min_size=3, max_size=3))
def test_no_action_that_is_allowed_breaks_a_step(actions: list[dict[str, Any]]) -> None:
    SHARED.step(dict(zip(SHARED.agents, actions, strict=False)))
    assert np.isfinite(SHARED.state.people.position).all()


def test_a_refused_action_costs_a_step_and_says_why(sim: Simulation) -> None:
    before = sim.state.second
    state = act(sim, "assistant_0", type="fly")
    assert (state["action_status"], state["action_code"], state["time"]) == ("refused", "unknown_type", before + 1)
    assert "move_forward" in state["action_reason"]


@pytest.mark.parametrize(
    ("distance", "status"), [(2.5, "ok"), (2.6, "refused"), (-1.0, "refused"), (float("nan"), "refused")]
)
def test_a_step_is_at_most_two_and_a_half_metres(sim: Simulation, distance: float, status: str) -> None:
    outdoors(sim, "assistant_0", 0.0, -15.0)
    assert act(sim, "assistant_0", type="move_forward", distance=distance)["action_status"] == status


def test_walking_a_metre_moves_one_metre_along_the_gaze(sim: Simulation) -> None:
    outdoors(sim, "assistant_0", 0.0, -15.0, yaw=np.pi / 2)
    act(sim, "assistant_0", type="move_forward", distance=1.0)
    assert sim.state.people.position[3, :2] == pytest.approx([0.0, -14.0], abs=1e-9)


def test_turning_left_by_ninety_degrees_turns_east_to_north(sim: Simulation) -> None:
    outdoors(sim, "assistant_0", 0.0, -15.0)
    act(sim, "assistant_0", type="turn_left", degrees=90)
    assert sim.state.people.yaw[3] == pytest.approx(np.pi / 2)


def test_looking_at_a_point_faces_it_and_tilts_the_view(sim: Simulation) -> None:
    outdoors(sim, "assistant_0", 0.0, -15.0)
    result = sim.step({"assistant_0": {"type": "look_at", "target": [-3.0, -15.0, 0.0]}})
    facing = result.observations["assistant_0"]["pose"][3:]
    assert facing[0] < -0.8
    assert facing[2] < -0.4


def test_a_place_is_entered_from_two_metres_and_not_from_further(sim: Simulation) -> None:
    outdoors(sim, "assistant_0", -5.0, 2.0)
    assert act(sim, "assistant_0", type="enter", place=toy_city.CAFE)["action_status"] == "refused"
    act(sim, "assistant_0", type="turn_left", degrees=90)
    act(sim, "assistant_0", type="move_forward", distance=1.2)
    for _ in range(2):
        act(sim, "assistant_0", type="enter", place=toy_city.CAFE)  # goes up to the door, and through
    state = [act(sim, "assistant_0", type="wait") for _ in range(2)][-1]
    assert (state["action_status"], state["place"], state["building"]) == ("ok", toy_city.CAFE, "b1")


def test_an_open_place_cannot_be_entered(sim: Simulation) -> None:
    state = act(sim, "assistant_0", type="enter", place=toy_city.PARK)
    assert "in the open" in state["action_reason"]
    assert state["action_code"] == "no_door"


def test_linked_rooms_are_walked_into_from_within_a_metre_of_the_door(sim: Simulation) -> None:
    refused = act(sim, "resident_0", type="enter", place="r_back")
    assert refused["action_status"] == "refused"
    sim.state.people.position[0] = (-3.8, 11.0, toy_city.FLOOR)
    state = act(sim, "resident_0", type="enter", place="r_back")
    assert (state["action_status"], state["room"]) == ("ok", "r_back")


def test_leaving_a_building_ends_in_front_of_its_door_looking_away(sim: Simulation) -> None:
    act(sim, "resident_0", type="exit")
    state = [act(sim, "resident_0", type="wait") for _ in range(4)][-1]
    assert (state["room"], state["place"]) == ("", "")
    assert sim.state.people.position[0, :2] == pytest.approx([-5.0, 4.0], abs=0.6)
    assert sim.state.people.yaw[0] == pytest.approx(-np.pi / 2)


def test_from_a_room_without_a_door_outdoors_nobody_can_exit(sim: Simulation) -> None:
    sim.state.people.position[0] = (-3.8, 11.0, toy_city.FLOOR)
    act(sim, "resident_0", type="enter", place="r_back")
    assert "no door" in act(sim, "resident_0", type="exit")["action_reason"]


def parcel(sim: Simulation, x: float, y: float, room: str = "") -> int:
    """Put a parcel somewhere."""
    z = toy_city.FLOOR if room else float(sim.world.height((x, y)))
    return sim.scenario.add_object(
        "parcel", "parcel", [box((0.3, 0.2, 0.2), (0, 0, 0.1), colour=(180, 140, 90))], (x, y, z), room=room
    )


def test_things_are_picked_up_within_a_metre_and_a_half(sim: Simulation) -> None:
    outdoors(sim, "assistant_0", 0.0, -15.0)
    near = parcel(sim, 1.4, -15.0)
    far = parcel(sim, 1.6, -15.0)
    assert "reach" in act(sim, "assistant_0", type="pick", hand=0, object=far)["action_reason"]
    assert act(sim, "assistant_0", type="pick", hand=0, object=near)["held"] == [near, 0]


def test_a_hand_holds_one_thing(sim: Simulation) -> None:
    outdoors(sim, "assistant_0", 0.0, -15.0)
    first, second = parcel(sim, 0.5, -15.0), parcel(sim, 0.6, -15.0)
    act(sim, "assistant_0", type="pick", hand=1, object=first)
    assert "holds" in act(sim, "assistant_0", type="pick", hand=1, object=second)["action_reason"]


def test_what_is_held_goes_along_and_indoors(sim: Simulation) -> None:
    outdoors(sim, "assistant_0", -5.0, 3.6, yaw=np.pi / 2)
    thing = parcel(sim, -5.5, 3.6)
    act(sim, "assistant_0", type="pick", hand=0, object=thing)
    for _ in range(4):
        act(sim, "assistant_0", type="enter", place=toy_city.CAFE)
    assert sim.ground_truth.object_room("parcel") == "r_cafe"
    assert sim.ground_truth.object_position("parcel")[2] == pytest.approx(toy_city.FLOOR, abs=1.5)


def test_a_thing_is_put_on_a_table_within_reach(sim: Simulation) -> None:
    thing = parcel(sim, -6.0, 9.0, "r_cafe")
    act(sim, "resident_0", type="pick", hand=0, object=thing)
    table = sim.world.rooms[0].containers[0]
    assert "reach" in act(sim, "resident_0", type="put", hand=0, target=table.entity)["action_reason"]
    sim.state.people.position[0, :2] = (-6.0, 11.9)
    assert act(sim, "resident_0", type="put", hand=0, target=table.entity)["held"] == [0, 0]
    assert sim.ground_truth.object_position("parcel")[2] == pytest.approx(toy_city.FLOOR + 0.75)


def test_a_thing_put_at_the_edge_of_a_table_rests_on_it_whole(sim: Simulation) -> None:
    thing = parcel(sim, -6.0, 9.0, "r_cafe")
    act(sim, "resident_0", type="pick", hand=0, object=thing)
    table = sim.world.rooms[0].containers[0]
    edge = table.centre[1] - table.size[1] / 2
    sim.state.people.position[0, :2] = (table.centre[0], edge - 0.5)
    point = (table.centre[0], edge + 0.01, table.centre[2])
    assert act(sim, "resident_0", type="put", hand=0, target=point)["action_status"] == "ok"
    x, y, z = sim.ground_truth.object_position("parcel")
    assert (x, z) == pytest.approx((table.centre[0], table.centre[2]))
    long, wide, _ = sim.state.objects.size[sim.state.objects.index(thing)]
    assert y - edge == pytest.approx(np.hypot(long, wide) / 2)


def test_two_things_on_a_table_do_not_lie_in_each_other(sim: Simulation) -> None:
    table = sim.world.rooms[0].containers[0]
    for k in range(2):
        sim.scenario.add_object(f"mug {k}", "mug", [], (-6.0, 9.0, toy_city.FLOOR), room="r_cafe", size=(0.2, 0.2, 0.2))
    sim.state.people.position[0, :2] = (-6.0, 10.4)
    for hand, entity in enumerate(sim.state.objects.entity.tolist()):
        act(sim, "resident_0", type="pick", hand=hand, object=entity)
    sim.state.people.position[0, :2] = (-6.0, 11.9)
    for hand in (0, 1):
        act(sim, "resident_0", type="put", hand=hand, target=table.entity)
    gap = np.linalg.norm(sim.ground_truth.object_position("mug 0") - sim.ground_truth.object_position("mug 1"))
    assert gap >= 0.28


def test_without_a_target_a_thing_is_put_on_the_ground_ahead(sim: Simulation) -> None:
    outdoors(sim, "assistant_0", 0.0, -15.0)
    thing = parcel(sim, 0.5, -15.0)
    act(sim, "assistant_0", type="pick", hand=0, object=thing)
    act(sim, "assistant_0", type="put", hand=0)
    x, y, z = sim.ground_truth.object_position("parcel")
    assert (x, y) == pytest.approx((0.55, -15.0), abs=0.01)
    assert z == pytest.approx(0.55 * toy_city.SLOPE, abs=1e-3)


def test_a_thing_is_handed_to_somebody_within_reach(sim: Simulation) -> None:
    outdoors(sim, "assistant_0", 0.0, -15.0)
    outdoors(sim, "resident_2", 1.2, -15.0)
    thing = parcel(sim, 0.5, -15.0)
    act(sim, "assistant_0", type="pick", hand=0, object=thing)
    result = sim.step({"assistant_0": {"type": "hand_over", "hand": 0, "agent": "resident_2"}})
    assert result.observations["resident_2"]["state"]["held"] == [thing, 0]
    assert sim.ground_truth.object_holder("parcel") == "resident_2"


def test_words_reach_those_within_range_in_the_same_space_only(sim: Simulation) -> None:
    outdoors(sim, "assistant_0", -5.0, 0.0)
    outdoors(sim, "resident_2", -5.0, -7.0)
    result = sim.step({"assistant_0": {"type": "communicate", "text": "Hello!", "range": 10}})
    heard = {name: [m["text"] for m in o["events"]] for name, o in result.observations.items()}
    assert heard == {"resident_0": [], "resident_1": [], "resident_2": ["Hello!"], "assistant_0": []}


def test_nobody_can_be_heard_beyond_ten_metres(sim: Simulation) -> None:
    assert "range" in act(sim, "assistant_0", type="communicate", text="Hello", range=11)["action_reason"]


def test_who_sleeps_has_to_wake_before_walking(sim: Simulation) -> None:
    sim.state.people.posture[0] = Posture.LYING
    assert "asleep" in act(sim, "resident_0", type="move_forward", distance=1)["action_reason"]
    act(sim, "resident_0", type="wake")
    assert act(sim, "resident_0", type="turn_right", degrees=90)["action_status"] == "ok"


def test_without_transit_nobody_boards(sim: Simulation) -> None:
    assert "transit" in act(sim, "assistant_0", type="enter_bus")["action_reason"]


def test_avatars_do_not_take_motor_commands(sim: Simulation) -> None:
    assert "robots" in act(sim, "assistant_0", type="control", vector=[1.0, 2.0])["action_reason"]


def test_codes_tell_apart_what_stopped_somebody(sim: Simulation) -> None:
    outdoors(sim, "assistant_0", -5.0, 2.0, yaw=np.pi / 2)
    for _ in range(3):
        state = act(sim, "assistant_0", type="move_forward", distance=2.5)
    assert (state["action_status"], state["action_code"]) == ("collision", "hit_solid")
    assert act(sim, "assistant_0", type="wait")["action_code"] == ""


def test_a_snapshot_keeps_the_code_of_a_refusal(sim: Simulation) -> None:
    act(sim, "assistant_0", type="stand")
    saved = sim.snapshot()
    act(sim, "assistant_0", type="wait")
    sim.restore(saved)
    assert sim.observe()[1]["assistant_0"]["action_code"] == "not_seated"


def test_the_documentation_lists_every_action_as_the_table_has_it() -> None:
    page = (Path(__file__).parents[2] / "docs" / "first_agent.md").read_text(encoding="utf-8")
    assert actions_markdown() in page
