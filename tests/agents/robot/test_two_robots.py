"""Two robots that bring a thing: what they say to each other, when they look, what they do where it goes wrong."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from vico.agents.requester import Depositor
from vico.agents.robot import METHODS, make_robots
from vico.agents.robot.arm_interface import ErrandStage
from vico.agents.robot.body import Drive
from vico.agents.robot.carrier import Scout, call_message, parse_call, parse_position, parse_sighting, sighting_message
from vico.agents.robot.grasps import HeldObject
from vico.agents.robot.heuristic import Manipulator
from vico.assets.robots import robot_model
from vico.challenges.robot_tasks import team_of
from vico.io.plain_data import decode, encode

PERIOD, THING = 0.1, 77
TEAM = team_of(robot_model("manipulator"), robot_model("husky"))
INTRINSICS = np.array([[64.0, 0.0, 64.0], [0.0, 64.0, 64.0], [0.0, 0.0, 1.0]])
#: World to a camera 1 m up that looks east.
EXTRINSICS = np.array([[0.0, -1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 1.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])


def told(category: str = "deliver") -> dict[str, Any]:
    spot = {"kind": "outdoor", "name": "here", "place": None, "radius": 6.0}
    return {
        "category": category,
        "object": "red box",
        "person": {"agent": "resident_3", "name": "Ada Example", "looks": ""},
        "source": spot | {"centre": [20.0, 0.0, 0.0]},
        "destination": spot | {"centre": [60.0, 0.0, 0.0]},
        "period": PERIOD,
    }


def observation(
    at: tuple[float, float] = (0.0, 0.0), *, sees: bool | None = None, grip: float = 0.0, heard: str = "", who: str = ""
) -> dict[str, Any]:
    """What a robot that stands and looks east is told; `sees` a thing 3 m ahead, or not; None: without a picture."""
    found: dict[str, Any] = {
        "sensors": {
            "base_pose": np.array([*at, 0.1, 1.0, 0.0, 0.0, 0.0]),
            "base_velocity": np.zeros(3),
            "contacts": np.full(2, grip),
            "joint_position": np.zeros(9),
        },
        "state": {"action_status": "ok", "action_reason": "", "held": [0, 0], "time": 0.0},
        "events": [{"speaker": who, "text": heard, "position": [*at, 0.0]}] if heard else [],
    }
    if sees is not None:
        pose = EXTRINSICS.copy()
        pose[:3, 3] = -pose[:3, :3] @ np.array([*at, 1.0])
        entity = np.zeros((128, 128), np.int32)
        entity[82:90, 60:68] = THING if sees else 0
        found |= {"depth": np.full((128, 128), 3.0, np.float32), "segmentation": entity}
        found |= {"extrinsics": pose, "intrinsics": INTRINSICS}
    return found


def info(*, sees: bool) -> dict[str, Any]:
    return {"entities": {THING: {"kind": "object", "name": "red box"}} if sees else {}}


def kept(agent: Any, fresh: Any) -> Any:
    """Return a fresh agent that remembers what another one does, after it was written down."""
    fresh.restore(decode(encode(agent.state())))
    return fresh


def test_what_they_say_is_understood() -> None:
    assert parse_sighting(sighting_message(np.array([1.25, -3.0, 0.1]))) == pytest.approx([1.25, -3.0, 0.1])
    assert parse_call(call_message(1.25, -3.0)) == (1.25, -3.0)
    for hears in (parse_sighting, parse_call, parse_position):
        assert hears("I see it at the corner.") is None


def test_a_scout_says_where_it_sees_the_thing_and_the_arm_goes_there() -> None:
    scout = Scout(told(), "robot_0")
    said = [scout.act(observation((15.0, 2.0), sees=True), info(sees=True)) for _ in range(8)]
    where = parse_sighting(next(action["text"] for action in said if action["type"] == "communicate"))
    assert where is not None
    assert where[:2] == pytest.approx([18.0, 2.0], abs=0.1)
    assert sum(action["type"] == "communicate" for action in said) == 1  # not twice in a second
    arm = Manipulator(told(), TEAM, carrier="robot_1", uses_deck=False)
    arm.act(observation(), info(sees=False))
    action = arm.act(observation(heard=sighting_message(np.array([24.0, 5.0, 0.0])), who="robot_1"), info(sees=False))
    assert action["type"] == "go_to"
    assert action["target"][:2] == [24.0, 5.0]
    again = kept(arm, Manipulator(told(), TEAM, carrier="robot_1", uses_deck=False))
    assert again.state().keys() == arm.state().keys()
    assert again.act(observation(), info(sees=False)) == arm.act(observation(), info(sees=False))


def test_a_scout_stands_once_the_thing_is_held_and_goes_with_a_person() -> None:
    scout = Scout(told(), "robot_0")
    assert scout.act(observation(heard="I have it.", who="robot_0"), info(sees=False)) == {"type": "stop"}
    assert not scout.wants_picture
    along = Scout(told("carry"), "robot_0")
    assert along.act(observation(), info(sees=False)) == {"type": "stop"}
    followed = along.act(observation(heard="I have it.", who="robot_0"), info(sees=False))
    assert followed == {"type": "follow", "agent": "resident_3"}
    assert kept(along, Scout(told("carry"), "robot_0")).act(observation(), info(sees=False)) == {"type": "wait"}


def test_what_slips_out_of_the_jaw_is_looked_for_where_that_was() -> None:
    arm = Manipulator(told(), TEAM, carrier="robot_1", uses_deck=False)
    arm.stage = ErrandStage.BRING
    arm.worker.held = HeldObject(np.zeros((1, 3)), 0.1, 0.1, 0.05, np.eye(3), np.zeros(2), np.full(2, 0.05), 0.0)
    for _ in range(10):
        arm.act(observation((40.0, 0.0), grip=30.0), info(sees=False))
    assert arm.stage is ErrandStage.BRING
    for _ in range(10):
        arm.act(observation((41.0, 0.0)), info(sees=False))
    assert arm.stage is ErrandStage.SEARCH
    assert arm.worker.held is None
    for _ in range(6):
        arm.act(observation((41.0, 0.0), sees=True), info(sees=True))
    assert arm.stage is ErrandStage.PICK


def test_pictures_are_wanted_where_they_are_looked_at() -> None:
    arm = Manipulator(told(), TEAM, carrier="robot_1")
    wanted = []
    for _ in range(10):
        sees = False if arm.wants_picture else None
        wanted.append(sees is not None)
        arm.act(observation(sees=sees), info(sees=False))
    assert 1 <= sum(wanted) <= 3
    assert arm.stage is ErrandStage.GO
    assert not Manipulator(told("carry"), TEAM, carrier="robot_1").wants_picture


def test_who_is_to_keep_off_stops_and_who_is_not_goes_as_far_as_it_can() -> None:
    for stops in (True, False):
        drive = Drive(period=PERIOD)
        drive.begin(np.array([10.0, 0.0]), near=3.0, stops=stops)
        assert drive.act(observation())["type"] == "go_to"
        near = observation((8.0, 0.0))
        near["sensors"]["base_velocity"][0] = 0.5
        assert drive.act(near)["type"] == ("stop" if stops else "wait")
        assert drive.arrived is stops


def test_who_has_no_room_ahead_to_put_something_down_turns() -> None:
    class Somebody:
        name, home, id, age = "Ada Example", "p_home", "resident_3", 40

    person = Depositor(Somebody(), None, pace=0.6, waits=60.0)  # type: ignore[arg-type]
    calls = observation(heard="Ada, we are here to carry it for you.", who="robot_0") | {"pose": np.zeros(6)}
    calls["state"]["held"] = [0, THING]
    did = [person.act(calls, {})["type"]]
    calls = calls | {"events": [], "state": calls["state"] | {"action_status": "refused"}}
    did += [person.act(calls, {})["type"] for _ in range(3)]
    assert did == ["put", "turn_left", "put", "turn_left"]


def test_every_method_has_its_two_robots() -> None:
    for method in METHODS:
        robots = make_robots(method, told(), None, TEAM, seed=0)  # type: ignore[arg-type]
        assert set(robots) == {"robot_0", "robot_1"}
        assert isinstance(robots["robot_1"], Scout) is (method == "ours")
