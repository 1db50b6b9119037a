"""The commute's judge: lateness, travel time, walking and money, second by second; and what is legal."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from commute_day import toy_task
from vico.challenges.commute.challenge import CommuteInfo, LegalAgent, refusal
from vico.challenges.commute.evaluate import DayJudge
from vico.runner.loop import Step

AGENT = "assistant_0"


@dataclass
class Purse:
    money_left: float = 50.0
    due: float = 0.0

    def money(self, name: str) -> float:
        return self.money_left

    def bicycle_price(self, name: str) -> float:
        return self.due


@dataclass
class Result:
    observations: dict[str, Any]


@dataclass
class Day:
    """Plays a day by hand: where the agent is, second by second."""

    judge: DayJudge
    time: float = 32_400.0
    number: int = 0
    purse: Purse = field(default_factory=Purse)

    def seen(self, x: float, vehicle: str = "", status: str = "ok") -> dict[str, Any]:
        state = {"time": self.time, "vehicle": vehicle, "action_status": status}
        return {AGENT: {"pose": np.array([x, 0.0, 0.0, 1.0, 0.0, 0.0]), "state": state}}

    def go(self, x: float, vehicle: str = "", *, seconds: int = 1, **how: Any) -> None:
        """Be at a point after so many seconds."""
        for _ in range(seconds):
            self.time += 1.0
            self.number += 1
            result: Any = Result(self.seen(x, vehicle, **how))
            self.judge.on_step(Step(self.number, {}, {}, result))

    def walk(self, start: float, end: float) -> None:
        for x in np.arange(start + 1.0, end + 0.5, 1.0):
            self.go(float(x))

    def release(self) -> None:
        self.time = float(self.judge.logs[-1].item.end)
        self.judge.release(self.time)


@pytest.fixture
def day() -> Day:
    purse = Purse()
    made = Day(DayJudge(toy_task(), AGENT, purse, [(100.0, 0.0)]), purse=purse)
    made.judge.begin(made.seen(0.0))
    return made


def test_a_walk_in_time(day: Day) -> None:
    day.go(0.0, seconds=60)  # waiting before one leaves does not count
    day.walk(0.0, 297.0)
    log = day.judge.logs[0]
    # 6 m from the start is the first point farther than 5 m; 297 m is 3 m from the place: 291 s between.
    assert (log.left, log.arrived) == (32_466.0, 32_757.0)
    assert log.travel == 291.0
    assert log.walked == pytest.approx(297.0)
    assert not log.late
    assert day.judge.stays


@pytest.mark.parametrize(("waits", "late"), [(183, False), (184, True)])
def test_late_is_who_is_not_there_at_the_start(day: Day, waits: int, late: bool) -> None:
    # Due at 32,880, 480 s after the start; 297 steps bring one there.
    day.go(0.0, seconds=waits)
    day.walk(0.0, 297.0)
    assert day.judge.logs[0].late is late


def test_who_does_not_arrive_goes_on_from_there_to_the_next(day: Day) -> None:
    day.walk(0.0, 100.0)
    day.go(100.0, seconds=1100)  # until 33,600, when the appointment ends
    first, second = day.judge.logs
    assert first.arrived is None
    assert first.ended == 33_600.0
    assert first.travel == 33_600.0 - 32_406.0
    assert first.waits == 1100
    assert first.late
    assert second.released == 33_600.0
    assert not day.judge.stays


def test_an_agent_that_never_leaves_is_charged_for_all_of_it(day: Day) -> None:
    day.go(0.0, seconds=1200)
    assert day.judge.logs[0].travel == 1200.0


def test_a_bicycle_may_be_kept_on_the_way_but_not_at_the_end(day: Day) -> None:
    day.go(0.0, "bike")
    day.go(298.0, "bike")
    assert day.judge.stays
    assert day.judge.logs[0].walked == 0.0
    day.release()
    day.judge.begin(day.seen(298.0, "bike"))
    day.go(599.0, "bike")
    assert not day.judge.over
    day.purse.money_left -= 24.2
    day.go(599.0)
    assert day.judge.over
    assert day.judge.logs[1].arrived == 33_602.0
    assert day.judge.logs[1].spent == pytest.approx(24.2)
    assert day.judge.logs[1].astray == 1


def test_the_rent_of_a_long_ride_is_not_taken_for_a_bicycle_left_astray(day: Day) -> None:
    day.time = 27_300.0
    day.go(0.0, "bike")
    day.time = 32_400.0
    day.go(298.0, "bike")
    day.release()
    day.judge.begin(day.seen(298.0, "bike"))
    day.go(590.0, "bike")
    day.purse.money_left -= 21.2  # 106 minutes, and brought back
    day.go(599.0)
    assert day.judge.logs[1].spent == pytest.approx(21.2)
    assert day.judge.logs[1].astray == 0


def test_a_bicycle_that_is_ridden_when_the_day_is_over_is_paid_for(day: Day) -> None:
    day.go(298.0)
    day.release()
    day.judge.begin(day.seen(298.0))
    day.purse.due = 24.4
    day.go(400.0, "bike", seconds=1300)
    log = day.judge.logs[1]
    assert day.judge.over
    assert log.late
    assert log.spent == 24.4
    assert log.astray == 1


def test_a_bus_at_the_place_is_not_there(day: Day) -> None:
    day.go(299.0, "bus")
    assert not day.judge.stays
    day.go(299.0)
    assert day.judge.stays


@pytest.mark.parametrize(
    ("action", "vehicle", "legal"),
    [
        ({"type": "move_forward", "distance": 1.0}, "", True),
        ({"type": "move_forward", "distance": 1.1}, "", False),
        ({"type": "move_forward", "distance": 3.0}, "bike", True),
        ({"type": "enter_bus"}, "", True),
        ({"type": "wait"}, "", True),
        ({"type": "enter", "place": "p1"}, "", False),
        ({"type": "communicate", "text": "taxi!"}, "", False),
        ({"type": "sleep"}, "", False),
    ],
)
def test_what_is_legal(action: dict[str, Any], vehicle: str, legal: bool) -> None:
    assert (refusal(action, vehicle) is None) is legal


class Runs:
    """Tries to run, and notes what it is told."""

    def __init__(self) -> None:
        self.told: list[tuple[str, str]] = []
        self.info: dict[str, Any] = {}

    def act(self, observation: dict[str, Any], info: dict[str, Any]) -> dict[str, Any]:
        self.told.append((observation["state"]["action_status"], observation["state"].get("action_code", "")))
        self.info = info
        return {"type": "move_forward", "distance": 2.5}

    def state(self) -> dict[str, Any]:
        return {}

    def restore(self, state: dict[str, Any]) -> None:
        pass


def test_what_is_not_legal_is_refused_counted_and_said() -> None:
    inner = Runs()
    agent = LegalAgent(inner, CommuteInfo(toy_task().instructions()))
    observation = {"pose": np.zeros(6), "state": {"vehicle": "", "action_status": "ok"}}
    assert agent.act(observation, {}) == {"type": "wait"}
    assert agent.act(observation, {}) == {"type": "wait"}
    assert agent.refused == {"move_forward": 2}
    assert inner.told == [("ok", ""), ("refused", "out_of_range")]
    assert observation["state"]["action_status"] == "ok"
    assert (inner.info["commute"]["place"], inner.info["commute"]["last"]) == ("p1", False)
