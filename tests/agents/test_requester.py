"""Residents who want help with carrying: whom they listen to, when they hand things over, and that they go home."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import toy_city
from vico.agents.base import Agent
from vico.agents.requester import CALL_DISTANCE, HAND_OVER_DISTANCE, WAITS_FOR, Requester
from vico.agents.schedule import followers_of
from vico.agents.talk.acquaintance import is_called
from vico.challenges.assistant import tasks
from vico.io.plain_data import decode, encode
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.world.public import PublicMap

CLEO, HELPER = "resident_2", "assistant_0"
WAIT: dict[str, Any] = {"type": "wait"}


class Meeting:
    """Cleo, who is under way to the park with things in hand, and a helper."""

    def __init__(self, *, things: int = 1) -> None:
        community = toy_city.community()
        self.sim = Simulation(toy_city.world(), community, SimConfig(start=8 * 3600 - 20, observe=(), assistants=1))
        box = toy_city.quad(
            [[-0.1, -0.1, 0.1], [0.1, -0.1, 0.1], [0.1, 0.1, 0.1], [-0.1, 0.1, 0.1]], (200, 20, 20), 0, "b"
        )
        for k in range(things):
            self.sim.scenario.hand_object(f"box {k}", "box", [box], CLEO, size=np.array([0.2, 0.2, 0.2]))
        self.things = [f"box {k}" for k in range(things)]
        self.map = PublicMap.from_world(self.sim.world)
        self.agents: dict[str, Agent] = dict(followers_of(community, self.map, seed=1))
        self.agents[CLEO] = self.requester()
        self.observations, self.infos = self.sim.observe()
        self.actions: dict[str, Any] = {}

    def requester(self) -> Requester:
        community = toy_city.community()
        day = followers_of(community, self.map, seed=1)[CLEO]
        return Requester(day, community.resident_by_id[CLEO], self.map, seed=1)

    def step(self, helper: dict[str, Any] | None = None) -> dict[str, Any]:
        """Let everybody act; return Cleo's action."""
        self.actions = {
            name: agent.act(self.observations[name], self.infos[name]) for name, agent in self.agents.items()
        }
        result = self.sim.step(self.actions | {HELPER: helper or dict(WAIT)})
        self.observations, self.infos = result.observations, result.infos
        return dict(self.actions[CLEO])

    def stand(self, metres: float) -> None:
        """Have the helper stand so far from Cleo, to the south of her."""
        x, y, _ = self.sim.ground_truth.agent_position(CLEO)
        self.sim.scenario.place_agent(HELPER, (x, y - metres))
        self.observations, self.infos = self.sim.observe()

    def say(self, text: str) -> None:
        self.step({"type": "communicate", "text": text})

    def apart(self) -> float:
        truth = self.sim.ground_truth
        return math.dist(truth.agent_position(CLEO)[:2], truth.agent_position(HELPER)[:2])

    @property
    def holders(self) -> list[str | None]:
        return [self.sim.ground_truth.object_holder(name) for name in self.things]


@pytest.mark.parametrize(
    ("text", "called"),
    [("Hello Cleo!", True), ("cleo, wait", True), ("CLEO?", True), ("It is (Cleo).", True), ("Hello Ek", False),
     ("Hello you", False), ("Excuse me, have you seen Cleo Ek?", False), ("Cleo, have you seen Ida Roth?", True),
     ("Cleopatra", False), ("Macleo is here", False), ("Anne-Cleo", False), ("", False)],
)  # fmt: skip
def test_a_first_name_is_a_word(text: str, called: bool) -> None:
    assert is_called("Cleo Ek", text) is called


@pytest.mark.parametrize(("name", "text"), [("Zoë Ek", "ZOË!"), ("Anne-Marie Ek", "hello anne-marie"), ("B. Ek", "b.")])
def test_names_may_have_signs(name: str, text: str) -> None:
    assert is_called(name, text)


def test_the_numbers_of_the_challenge_are_theirs() -> None:
    assert (tasks.CALL_DISTANCE, tasks.HAND_OVER_DISTANCE) == (CALL_DISTANCE, HAND_OVER_DISTANCE)
    assert tasks.WAITS_FOR == WAITS_FOR


def test_nobody_stops_for_who_does_not_say_their_name() -> None:
    meeting = Meeting()
    meeting.stand(1.2)
    meeting.say("Hello! May I carry that?")
    meeting.say("Hello Bo! May I carry that?")
    actions = [meeting.step() for _ in range(20)]
    assert meeting.holders == [CLEO]
    assert "hand_over" not in {action["type"] for action in actions}
    assert "move_forward" in {action["type"] for action in actions}


def test_nobody_stops_for_who_is_too_far() -> None:
    meeting = Meeting()
    meeting.stand(CALL_DISTANCE + 2.0)
    meeting.say("Hello Cleo!")
    actions = [meeting.step() for _ in range(3)]
    assert "communicate" not in {action["type"] for action in actions}


def test_who_is_called_stops_answers_and_hands_over_from_near() -> None:
    meeting = Meeting()
    meeting.stand(3.0)
    meeting.say("Hello Cleo! May I take it?")
    answer = meeting.step()
    assert (answer["type"], meeting.holders) == ("communicate", [CLEO])
    here = meeting.sim.ground_truth.agent_position(CLEO)
    assert all(meeting.step()["type"] in ("look_at", "wait") for _ in range(5))  # too far to hand it over
    assert math.dist(here, meeting.sim.ground_truth.agent_position(CLEO)) < 0.1
    meeting.stand(HAND_OVER_DISTANCE - 0.2)
    assert meeting.step()["type"] == "hand_over"
    assert meeting.holders == [HELPER]
    assert meeting.step()["type"] == "communicate"  # thanks, and goes home
    for _ in range(60):
        meeting.step()
    assert meeting.sim.ground_truth.agent_place(CLEO) == toy_city.CAFE


def test_both_things_are_handed_over() -> None:
    meeting = Meeting(things=2)
    meeting.stand(1.2)
    meeting.say("Cleo?")
    types = [meeting.step()["type"] for _ in range(4)]
    assert types == ["communicate", "hand_over", "hand_over", "communicate"]
    assert meeting.holders == [HELPER, HELPER]


def test_who_waits_in_vain_goes_on_with_the_day() -> None:
    meeting = Meeting()
    meeting.stand(5.0)
    meeting.say("Hello Cleo!")
    types = [meeting.step()["type"] for _ in range(int(WAITS_FOR) + 12)]
    assert "move_forward" not in types[1:58]
    assert "move_forward" in types[60:]
    assert meeting.holders == [CLEO]


@pytest.mark.parametrize("at", [0, 2, 6, 9, 25], ids=["before", "called", "waiting", "handed over", "on the way home"])
def test_one_that_is_restored_goes_on_the_same(at: int) -> None:
    meeting = Meeting()
    meeting.stand(3.0)
    twin: Requester | None = None
    for number in range(60):
        if number == at:
            twin = meeting.requester()
            twin.restore(decode(encode(meeting.agents[CLEO].state())))
        if number == 8:
            meeting.stand(1.2)
        if twin is not None:
            # The twin is asked first: what it answers may not depend on the other one's being asked.
            expected = twin.act(meeting.observations[CLEO], meeting.infos[CLEO])
        action = meeting.step({"type": "communicate", "text": "Cleo!"} if number == 1 else None)
        if twin is not None:
            assert expected == action, number
    assert meeting.holders == [HELPER]
