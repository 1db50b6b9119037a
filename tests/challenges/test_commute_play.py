"""Whole days in the full simulation."""

from __future__ import annotations

from pathlib import Path

import pytest

from vico.challenges.commute import COMMUTE
from vico.challenges.commute.evaluate import CAUSES
from vico.challenges.records import EpisodeRecord, Job
from vico.errors import InputError
from vico.world.world import World


def job_of(world: World, method: str, **setting: float) -> Job:
    assert world.path is not None
    return Job("commute", "commute", method, {"hours": 2.0, **setting}, world.path, seed=1)


def test_the_challenge_describes_itself() -> None:
    assert COMMUTE.name == "commute"
    assert list(COMMUTE.methods) == ["rule", "mcts", "llm", "ppo", "a2c", "ours"]
    assert [m.key for m in COMMUTE.metrics("commute")] == ["late_rate", "travel_time", "price", "walk_distance"]
    assert len(set(COMMUTE.causes("commute"))) == len(CAUSES)


@pytest.mark.parametrize(("setting", "said"), [({"assistants": 2.0}, "no setting"), ({"hours": 99.0}, "99 hours")])
def test_bad_settings_are_refused(corner: World, setting: dict[str, float], said: str) -> None:
    with pytest.raises(InputError, match=said):
        COMMUTE.task(job_of(corner, "rule", **setting))


@pytest.mark.slow
def test_ours_travels_less_than_who_walks_and_the_same_each_time(helsinki_city: World, tmp_path: Path) -> None:
    played: dict[str, EpisodeRecord] = {}
    for name, method in (("rule", "rule"), ("ours", "ours"), ("again", "ours")):
        recording = tmp_path / "run" if name == "again" else None
        played[name] = COMMUTE.play(job_of(helsinki_city, method), recording=recording)
    rule, ours = played["rule"].metrics, played["ours"].metrics
    assert rule["price"] == 0.0
    assert rule["walk_distance"] > 1.0
    assert ours["travel_time"] < rule["travel_time"]
    assert ours["walk_distance"] < rule["walk_distance"]
    assert ours["late_rate"] <= rule["late_rate"]
    assert not any(p.cause == "bike_astray" for p in played["ours"].parts)
    assert played["again"].state_hash == played["ours"].state_hash
    assert (tmp_path / "run" / "run.json").is_file()


class Stubborn:
    """Stands, talks, and crashes now and then."""

    def __init__(self) -> None:
        self.steps = 0

    def act(self, observation: object, info: object) -> dict[str, object]:
        self.steps += 1
        if self.steps % 5 == 0:
            raise RuntimeError("no")
        return {"type": "communicate", "text": "taxi!"}


@pytest.mark.slow
def test_an_agent_from_elsewhere_that_does_nothing_right_is_late_everywhere(helsinki_city: World) -> None:
    record = COMMUTE.play(job_of(helsinki_city, f"{Path(__file__)}:Stubborn"))
    assert record.metrics["late_rate"] == 100.0
    assert record.metrics["walk_distance"] < 0.02
    assert record.fault_counts["crashed"] > 0
    assert record.fault_counts["illegal"] > record.fault_counts["crashed"]
    assert record.metrics["travel_time"] > 60.0
