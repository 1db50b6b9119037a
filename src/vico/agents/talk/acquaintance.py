"""Whom a resident knows, and what of them: the days of friends, colleagues' working hours, neighbours' homes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from vico.clock import seconds_of_day
from vico.english import split_name

# What one knows of somebody's day, by what ties one to them.
_WHOLE_DAY, _WORK, _WHERE_THEY_LIVE = ("family", "friend"), ("colleague",), ("family", "friend", "neighbour")


@dataclass(frozen=True)
class Habit:
    """Where somebody usually is for a part of the day.

    Attributes
    ----------
    start, end
        Seconds of the day.
    place
        Id; on the way, of where they go.
    travels
        Whether they are on the way.
    """

    start: float
    end: float
    place: str
    travels: bool = False


@dataclass(frozen=True)
class Acquaintance:
    """Somebody a resident knows.

    Attributes
    ----------
    agent, name
        Name of the agent, and of the person.
    kind, note
        What ties them (friend, colleague, ...), and that in words.
    age
        Years.
    home
        Id of the place; empty if one doesn't know it.
    habits
        What one knows of their usual day.
    gender
        ``female`` or ``male``; empty if one doesn't know.
    household
        Id, the same for those who live together; empty if nobody said.
    """

    agent: str
    name: str
    kind: str
    note: str
    age: int = 35
    home: str = ""
    habits: tuple[Habit, ...] = ()
    gender: str = ""
    household: str = ""

    @property
    def first_name(self) -> str:
        """What one calls them."""
        return split_name(self.name)[1]

    def usual_at(self, second: float) -> Habit | None:
        """Return where they usually are at a second of the day, as far as one knows."""
        return next((habit for habit in reversed(self.habits) if habit.start <= second < habit.end), None)


def acquaintance_of(resident: Any, kind: str, note: str, *, day: tuple[Habit, ...] | None = None) -> Acquaintance:
    """Return what somebody knows of a resident to whom they are tied.

    Parameters
    ----------
    resident
        As `vico.community.model.Resident`; what it lacks is not known.
    kind
        As `vico.community.model.RelationKind`.
    day
        What `day_of` returns of the resident's schedule, where it was asked before.
    """
    habits: tuple[Habit, ...] = ()
    if kind in _WHOLE_DAY or kind in _WORK:
        habits = day_of(getattr(resident, "schedule", ())) if day is None else day
    if kind not in _WHOLE_DAY:
        work = getattr(resident, "workplace", None)
        habits = tuple(one for one in habits if one.place == work and not one.travels)
    home = str(getattr(resident, "home", "") or "") if kind in _WHERE_THEY_LIVE else ""
    gender, household = (str(getattr(resident, field, None) or "") for field in ("gender", "household"))
    return Acquaintance(resident.id, resident.name, kind, note, resident.age, home, habits, gender, household)


def acquaintances_of(residents: Mapping[str, Any], relations: Iterable[Any]) -> dict[str, list[Acquaintance]]:
    """Return whom each resident knows, by agent's name.

    Parameters
    ----------
    residents
        By agent's name.
    relations
        As `vico.community.model.Relation`; ties to people who are not among the residents are left out.
    """
    known: dict[str, list[Acquaintance]] = {name: [] for name in residents}
    # All who know a day know the same one.
    days = {name: day_of(getattr(resident, "schedule", ())) for name, resident in residents.items()}
    for relation in relations:
        first, second = relation.between
        for me, other in ((first, second), (second, first)):
            if me in residents and other in residents:
                kind, note = str(relation.kind), relation.note
                known[me].append(acquaintance_of(residents[other], kind, note, day=days[other]))
    return known


def day_of(schedule: Sequence[Any]) -> tuple[Habit, ...]:
    """Return where a schedule has somebody, and when; ways lead to where they are next."""
    found: list[Habit] = []
    for k, item in enumerate(schedule):
        travels = item.place is None
        place = item.place or next((later.place for later in schedule[k + 1 :] if later.place), None)
        if place is not None:
            found.append(Habit(seconds_of_day(item.start), seconds_of_day(item.end), place, travels))
    return tuple(found)


__all__ = ["Acquaintance", "Habit", "acquaintance_of", "acquaintances_of", "day_of"]
