"""Residents are asked in a run, and answer those near them."""

from __future__ import annotations

from typing import Any

import toy_city
from vico.agents.schedule import ScheduleFollower, followers_of
from vico.agents.talk.answers import PATIENCE
from vico.agents.talk.sentences import claims_in
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
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


# Cleo walks south from (-4, 2) then.
CLEO_IS_OUT, BESIDE_HER_WAY = 8 * 3600 - 20, (-1.5, -2.0)


def test_a_resident_in_the_street_answers_who_stands_near() -> None:
    street = Street(CLEO_IS_OUT, at=BESIDE_HER_WAY)
    street.step()
    ((speaker, text),) = street.ask("Excuse me, where is the Hat Shop?")
    assert speaker == "resident_2"
    (claim,) = claims_in(text)
    assert (claim.kind, claim.place) == ("place", "Hat Shop")
    ((_, text),) = street.ask("Cleo, what are your plans for today?")
    assert claims_in(text)[0].place == "South Green"


def test_a_question_to_somebody_else_is_left_to_them() -> None:
    street = Street(CLEO_IS_OUT, at=BESIDE_HER_WAY)
    street.step()
    assert street.ask("Bo, where is the Hat Shop?") == []


def test_who_asks_on_and_on_is_left_standing() -> None:
    street = Street(CLEO_IS_OUT, at=BESIDE_HER_WAY)
    street.step()
    answers = [text for _ in range(PATIENCE + 3) for _, text in street.ask("Cleo, who are you?")]
    assert answers == ["My name is Cleo Ek, and I am a baker."] * PATIENCE + ["Sorry, I have to go on now."]


def test_a_day_is_remembered_as_it_was() -> None:
    """Ada and Bo walk from the café to the shop at 08:00."""
    street = Street(8 * 3600 - 20, at=(20.0, -20.0))
    for _ in range(150):
        street.step()
    ada, bo = street.residents["resident_0"], street.residents["resident_1"]
    assert [one.place for one in ada.memory.visits] == [toy_city.CAFE, toy_city.SHOP]
    first, second = ada.memory.visits
    assert first.until is not None
    assert 8 * 3600 <= first.until < second.since < 8 * 3600 + 130
    seen = bo.memory.last_seen("resident_0")
    assert seen is not None
    assert seen.time >= 8 * 3600
    assert ada.memory.last_seen("assistant_0") is None, "it stands far away, behind them"
