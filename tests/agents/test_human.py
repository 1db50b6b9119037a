"""A person at the keys: what keys become, when they are let go, and how outcomes come back."""

from __future__ import annotations

import math
from typing import Any

import pytest

from vico.agents.human import LET_GO, HeldInput, HumanAgent, Mailbox, drive, fly, walk
from vico.errors import InputError


def seen(yaw: float = 0.0, **state: Any) -> dict[str, Any]:
    """Return an observation of somebody who looks along a yaw."""
    usual = {"vehicle": "", "action_status": "ok", "action_code": "", "action_reason": ""}
    return {"pose": [0.0, 0.0, 0.0, math.cos(yaw), math.sin(yaw), 0.0], "state": usual | state}


def held(*keys: str, yaw: float | None = None, seq: int = 0, **axes: float) -> HeldInput:
    return HeldInput(seq, frozenset(keys), yaw, None, axes)


def test_the_arrow_ahead_walks_straight_and_with_the_run_key_runs() -> None:
    assert walk(held("forward"), seen()) == {"type": "move_forward", "distance": 1.0, "turn": 0.0}
    assert walk(held("forward", "run"), seen())["distance"] == 2.5
    assert walk(held("forward"), seen(vehicle="bike"))["distance"] == 3.0


def test_arrows_to_the_sides_turn_while_walking_or_standing() -> None:
    assert walk(held("turn_left"), seen()) == {"type": "turn_left", "degrees": 120.0}
    assert walk(held("forward", "turn_right"), seen()) == {"type": "move_forward", "distance": 1.0, "turn": -120.0}


def test_with_the_mouse_the_body_turns_to_where_one_looks_before_it_walks_there() -> None:
    action = walk(held("forward", yaw=math.pi / 2), seen())
    assert action["type"] == "move_forward"
    assert action["distance"] == 0.0
    assert action["turn"] == 360.0
    action = walk(held("forward", yaw=math.radians(10)), seen())
    assert action["distance"] == 1.0
    assert action["turn"] == pytest.approx(100.0)


def test_stepping_left_is_seen_from_the_gaze() -> None:
    assert walk(held("left", yaw=0.0), seen(yaw=math.pi / 2)) == pytest.approx(
        {"type": "move_forward", "distance": 1.0, "turn": 0.0}
    )


def test_a_passenger_of_a_bus_looks_about_and_does_not_walk() -> None:
    assert walk(held("forward"), seen(vehicle="bus")) == {"type": "wait"}
    assert walk(held("forward", yaw=1.0), seen(vehicle="bus"))["type"] == "turn_left"


def test_half_a_stick_is_half_the_speed_and_an_idle_one_nothing() -> None:
    assert walk(held(y=0.5), seen())["distance"] == 0.5
    assert walk(held(y=0.05), seen()) == {"type": "wait"}


def test_robots_are_driven_and_flown_by_velocities() -> None:
    assert drive(held("forward", "turn_left"), seen())["vector"] == [1.0, 0.0, 1.2]
    assert fly(held("forward", "up", "run"), seen())["vector"] == [6.0, 0.0, 2.0, 0.0]


def test_keys_are_let_go_when_nothing_is_heard() -> None:
    now = [0.0]
    mailbox = Mailbox(clock=lambda: now[0])
    mailbox.hold(held("forward"))
    now[0] = LET_GO
    assert mailbox.take()[0].keys == {"forward"}
    now[0] = LET_GO + 0.01
    assert mailbox.take()[0].idle


def test_an_older_message_changes_nothing() -> None:
    mailbox = Mailbox(clock=lambda: 0.0)
    mailbox.hold(held("forward", seq=5))
    mailbox.hold(held("back", seq=4))
    assert mailbox.take()[0].keys == {"forward"}
    assert mailbox.taken == 5


def test_what_is_asked_for_is_done_once_and_its_outcome_told_after_the_step() -> None:
    agent = HumanAgent(Mailbox(clock=lambda: 0.0))
    told = agent.mailbox.do({"type": "pick", "hand": 1, "object": 7})
    assert agent.act(seen(), {})["type"] == "pick"
    assert not told.done()
    outcome = {"action_status": "refused", "action_code": "too_far", "action_reason": "pick: too far away"}
    assert agent.act(seen(**outcome), {}) == {"type": "wait"}
    assert told.result() == {"ok": False, "status": "refused", "code": "too_far", "error": "pick: too far away"}


def test_when_the_run_ends_whoever_waits_is_told() -> None:
    agent = HumanAgent(Mailbox())
    first, second = (agent.mailbox.do({"type": "wait"}) for _ in range(2))
    agent.act(seen(), {})
    agent.close("the run has ended")
    for told in (first, second, agent.mailbox.do({"type": "wait"})):
        with pytest.raises(InputError, match="ended"):
            told.result(0)
