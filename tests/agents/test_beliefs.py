"""Where people may be: by habit, after a look in vain, after they were seen, and after what somebody says."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from vico.agents.assistant.errands import Book
from vico.agents.assistant.estimates import OTHER, OUTDOORS, Habits, read_habits
from vico.agents.assistant.rollouts import Beliefs
from vico.agents.assistant.skills import AssistantSkills, ObservationView
from vico.agents.perception import RememberedSighting
from vico.errors import SchemaError
from vico.io.data_files import VARIABLE
from vico.world.model import Category
from vico.world.public import PublicMap

NOON = 12 * 3600.0
MAP = cast(PublicMap, SimpleNamespace(place_by_id={
    "office": SimpleNamespace(category=Category.OFFICE), "cafe": SimpleNamespace(category=Category.FOOD),
}))  # fmt: skip


def region(place: str | None) -> dict[str, Any]:
    return {"kind": "place" if place else "outdoor", "name": str(place), "place": place, "centre": (0.0, 0.0, 0.0),
            "radius": 8.0, "surface": None}  # fmt: skip


def book(category: str = "carry", places: tuple[str | None, ...] = ("office", "cafe", None)) -> Book:
    return Book([{
        "index": 0, "category": category, "text": "", "person": {"agent": "r", "name": "Ida Roth", "looks": ""},
        "objects": ["red book"], "sources": [region(place) for place in places], "destination": region("cafe"),
    }])  # fmt: skip


def at(time: float) -> ObservationView:
    return ObservationView({"state": {"time": time}}, {})


class Seen:
    """Skills of somebody who saw Ida in a room, or did not."""

    def __init__(self, room: str = "", time: float = 0.0) -> None:
        self.places = {"room": "cafe"}
        thing = RememberedSighting(7, "resident", "Ida Roth", np.zeros(3), room, time, 400) if room else None
        self.seen = SimpleNamespace(last_seen=lambda name: thing if name == "Ida Roth" else None)


def beliefs_of(one: Book) -> Beliefs:
    beliefs = Beliefs(one, MAP, read_habits())
    beliefs.notice(at(NOON), cast(AssistantSkills, Seen()))
    return beliefs


def test_in_office_hours_people_are_at_offices() -> None:
    beliefs = beliefs_of(book())
    morning, night = beliefs.chances(0, 10 * 3600.0), beliefs.chances(0, 20 * 3600.0)
    assert morning[0] > 3 * max(morning[1:])
    assert night[1] > night[0]
    assert 0.9 < sum(beliefs.chances(0, NOON)) <= 1.0


def test_a_look_in_vain_lowers_a_chance_for_a_while() -> None:
    one = book()
    beliefs = beliefs_of(one)
    before = beliefs.chances(0, NOON)
    one.looked[0][0] = 1
    beliefs.notice(at(NOON + 60.0), cast(AssistantSkills, Seen()))
    after, later = beliefs.chances(0, NOON + 60.0), beliefs.chances(0, NOON + 1800.0)
    assert after[0] < 0.5 * before[0]
    assert after[1] > before[1]
    assert after[0] / after[1] < later[0] / later[1] < before[0] / before[1]


def test_things_stay_where_they_are() -> None:
    one = book("delivery", ("office", "cafe"))
    beliefs = beliefs_of(one)
    assert beliefs.chances(0, NOON) == pytest.approx([0.485, 0.485])
    one.looked[0][0] = 1
    beliefs.notice(at(NOON), cast(AssistantSkills, Seen()))
    once = beliefs.chances(0, NOON)
    assert once == beliefs.chances(0, NOON + 3600.0)
    one.looked[0][0] = 2
    beliefs.notice(at(NOON), cast(AssistantSkills, Seen()))
    assert beliefs.chances(0, NOON)[0] < once[0] < once[1]


def test_where_somebody_was_seen_or_is_said_to_be_is_likelier() -> None:
    one = book()
    beliefs = beliefs_of(one)
    before = beliefs.chances(0, NOON)
    said = beliefs_of(one)
    said.hear(0, "cafe", NOON, "usual")
    sure = beliefs_of(one)
    sure.hear(0, "cafe", NOON, "see")
    beliefs.notice(at(NOON), cast(AssistantSkills, Seen("room", NOON)))
    seen = beliefs.chances(0, NOON)
    assert before[1] < said.chances(0, NOON)[1] < sure.chances(0, NOON)[1] < seen[1]
    later = beliefs_of(one).chances(0, NOON + 3600.0)[1] / before[1]
    assert seen[1] * later > beliefs.chances(0, NOON + 3600.0)[1] > before[1] * later
    sure.hear(0, "nowhere", NOON, "see")  # no region of the subtask: nothing comes of it
    assert len(sure.chances(0, NOON)) == 3


def test_in_time_people_are_elsewhere() -> None:
    beliefs = beliefs_of(book())
    assert sum(beliefs.chances(0, NOON)) > sum(beliefs.chances(0, NOON + 1400.0)) > 0.6


def test_they_go_on_where_they_were_saved() -> None:
    one = book()
    beliefs = beliefs_of(one)
    one.looked[0][2] = 1
    beliefs.notice(at(NOON + 5.0), cast(AssistantSkills, Seen("room", NOON)))
    beliefs.hear(0, "office", NOON, "told")
    again = Beliefs(one, MAP, read_habits())
    again.restore(beliefs.state())
    assert again.chances(0, NOON + 300.0) == beliefs.chances(0, NOON + 300.0)
    assert again.state() == beliefs.state()


def test_habits_name_every_kind_of_place_or_what_stands_for_it() -> None:
    habits = read_habits()
    assert habits.share("office", 10.5) > 0.5 > habits.share("office", 3.0)
    assert habits.share("transit", 12.0) == habits.share(OTHER, 12.0)
    assert habits.share(OUTDOORS, 36.0) == habits.share(OUTDOORS, 12.0)


def test_habits_without_what_stands_for_others_are_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Any) -> None:
    folder = tmp_path / "agents/assistant"
    folder.mkdir(parents=True)
    (folder / "habits.toml").write_text(f'about = "x"\n[places]\noffice = {[0.1] * 24}\n')
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    with pytest.raises(SchemaError, match=r"habits\.toml: places: entertainment, outdoors must be there"):
        read_habits()


def test_a_day_has_24_hours() -> None:
    with pytest.raises(ValueError, match="at least 24"):
        Habits(about="x", places={OTHER: [0.5] * 23})
