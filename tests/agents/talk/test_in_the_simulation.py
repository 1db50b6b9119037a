"""Residents are asked in a run, and answer those near them."""

from __future__ import annotations

from typing import Any

import pytest

import toy_city
from vico.agents.schedule import ScheduleFollower, followers_of
from vico.agents.talk.talker import PATIENCE
from vico.agents.talk.understanding import claims_in
from vico.sim.config import SimConfig
from vico.sim.simulation import Simulation
from vico.world.public import PublicMap


class Street:
    """A run in which assistant_0 may speak."""

    def __init__(self, start: int, *, at: tuple[float, float]) -> None:
        self.sim = Simulation(toy_city.world(), toy_city.community(), SimConfig(start=start, observe=(), assistants=1))
        self.sim.scenario.place_agent("assistant_0", at)
        public = PublicMap.from_world(self.sim.world)
        self.residents: dict[str, ScheduleFollower] = followers_of(toy_city.community(), public)
        self.observations, self.infos = self.sim.observe()

    def step(self, text: str = "") -> list[tuple[str, str]]:
        """Return what the assistant hears."""
        actions: dict[str, Any] = {
            name: resident.act(self.observations[name], self.infos[name]) for name, resident in self.residents.items()
        }
        if text:
            actions["assistant_0"] = {"type": "communicate", "text": text}
        result = self.sim.step(actions)
        self.observations, self.infos = result.observations, result.infos
        return [(one["speaker"], one["text"]) for one in self.observations["assistant_0"]["events"]]

    def ask(self, text: str) -> list[tuple[str, str]]:
        heard = [one for one in self.step(text) if one[0] != "assistant_0"]
        return [*heard, *(one for _ in range(2) for one in self.step() if one[0] != "assistant_0")]


CLEO_IS_OUT = 8 * 3600 - 20


def test_a_resident_in_the_street_answers_who_stands_near() -> None:
    street = Street(CLEO_IS_OUT, at=(2.0, 1.0))
    street.step()
    ((speaker, text),) = street.ask("Excuse me, where is the Hat Shop?")
    assert speaker == "resident_2"
    (claim,) = claims_in(text)
    assert (claim.kind, claim.place) == ("place", "Hat Shop")
    ((_, text),) = street.ask("Cleo, what are your plans for today?")
    assert "on my way" in text or claims_in(text)[0].place == "South Green"


def test_a_question_to_somebody_else_is_left_to_them() -> None:
    street = Street(CLEO_IS_OUT, at=(2.0, 1.0))
    street.step()
    assert street.ask("Bo, where is the Hat Shop?") == []


def test_who_asks_on_and_on_is_left_standing() -> None:
    street = Street(CLEO_IS_OUT, at=(2.0, 1.0))
    street.step()
    answers = [answer for _ in range(PATIENCE + 3) for answer in street.ask("Cleo, who are you?")]
    assert len(answers) <= PATIENCE + 1
    assert "Sorry, I have to go on now." in answers[-1][1] or len(answers) < PATIENCE


@pytest.mark.parametrize("count", [300])
def test_what_was_done_is_told(count: int) -> None:
    """Ada walks from the café to the shop at 08:00 and is asked there, by a friend who stands beside her."""
    street = Street(8 * 3600 - 20, at=(20.0, -20.0))
    for _ in range(count):
        street.step()
    ada, bo = street.residents["resident_0"], street.residents["resident_1"]
    assert [one.place for one in ada.memory.visits] == [toy_city.CAFE, toy_city.SHOP]
    assert ada.memory.visits[0].until is not None
    seen = bo.memory.seen("resident_0")
    assert seen is not None
    assert seen.place in (toy_city.SHOP, toy_city.CAFE, "")
    # Nobody remembers somebody who was never in view of them.
    assert bo.memory.seen("assistant_0") is None or street.infos["resident_1"]["in_view"] is not None
