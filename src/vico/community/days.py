"""Several days of a community: who works, learns and meets on which, and the schedules of each day."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import date, timedelta

import numpy as np

from vico.community.groups import Meeting, can_come
from vico.community.model import WEEKDAYS, Relation, ScheduleItem
from vico.community.people import Household, ResidentDraft
from vico.community.place_index import PlaceIndex
from vico.community.playmates import come_to_play
from vico.community.schedules import DayWriter
from vico.community.schooling import SCHOOL_DAYS, Care, care_on, lessons_on
from vico.community.work import shift_on
from vico.errors import InputError

#: A Monday; a community's day is in the week from it on, unless it is given.
FIRST_DAY = date(2025, 6, 2)
#: Jobs and schools are planned for this day of the week where a community's first day is none of work, 0 Monday.
_MIDWEEK = 2
# How long before lessons children are there, minutes.
_BEFORE_LESSONS = 10

Streams = Callable[[str], np.random.Generator]


def planning_date(day: date) -> date:
    """Return the date that jobs and schools are planned for: the first day, or a working day of its week."""
    return day if day.weekday() in SCHOOL_DAYS else day + timedelta(days=_MIDWEEK - day.weekday())


def date_of(text: str, dates: Sequence[date] | None = None) -> date:
    """Return the date that somebody means: one like ``2025-06-07``, or the first of some that is a ``saturday``.

    Parameters
    ----------
    dates
        Where days of the week are looked for; the week from `FIRST_DAY` unless given.

    Raises
    ------
    InputError
        If `text` is neither a date nor a day of the week, or none of `dates` is that day of the week.
    """
    names = [name.lower() for name in WEEKDAYS]
    if text.lower() in names:
        options = [FIRST_DAY + timedelta(days=k) for k in range(7)] if dates is None else dates
        found = next((one for one in options if one.weekday() == names.index(text.lower())), None)
        if found is None:
            there = ", ".join(f"{one} ({WEEKDAYS[one.weekday()]})" for one in options)
            raise InputError(f"community: no {text} among {there}; build it with more --days")
        return found
    try:
        return date.fromisoformat(text)
    except ValueError:
        raise InputError(f"--day {text!r} is no day; write 2025-06-07 or {names[5]}") from None


@dataclass(frozen=True)
class DayDrafts:
    """Everybody as they are on one day: with its working hours, lessons and duties.

    Attributes
    ----------
    index
        Places with the hours of that day of the week.
    """

    index: PlaceIndex
    households: list[Household]
    cares: list[Care]

    @property
    def people(self) -> list[ResidentDraft]:
        """Everybody, in the order of the households."""
        return [member for household in self.households for member in household.members]


@dataclass(frozen=True)
class DaySchedules:
    """A day of everybody.

    Attributes
    ----------
    items, frequented
        By resident id: the schedule on foot, and the places they go to besides home and work.
    meetings
        Groups as they meet, with those who come.
    """

    date: date
    index: PlaceIndex
    items: dict[str, list[ScheduleItem]]
    frequented: dict[str, list[str]]
    meetings: list[Meeting] = field(default_factory=list)


def drafts_on(index: PlaceIndex, planned: DayDrafts, streams: Streams) -> DayDrafts:
    """Return everybody as they are on a day, with drafts of its own: meetings give carers duties.

    Parameters
    ----------
    planned
        Everybody on the day of the week that jobs and schools were planned for.
    streams
        Gives random streams by name; the same day of the week has the same hours in every week.
    """
    carers = {care.carer.id for care in planned.cares}
    households = [
        replace(household, members=[_on(index, planned.index, member, streams) for member in household.members])
        for household in planned.households
    ]
    cares = [
        care_on(index, household, carer)
        for household in households
        for carer in household.members
        if carer.id in carers
    ]
    return DayDrafts(index, households, cares)


def _on(index: PlaceIndex, planned: PlaceIndex, draft: ResidentDraft, streams: Streams) -> ResidentDraft:
    if draft.child:
        lessons = lessons_on(index, draft)
        at_school = lessons is not None and lessons.place is not None
        shift = (lessons.start - _BEFORE_LESSONS, lessons.end) if lessons is not None and at_school else None
        return replace(draft, lessons=lessons, shift=shift, duties=[])
    shift = shift_on(streams(f"hours/{draft.id}/{index.weekday}"), index, planned, draft)
    return replace(draft, shift=shift, duties=[])


def meetings_on(day: DayDrafts, meetings: Sequence[Meeting], later: int) -> list[Meeting]:
    """Return the groups that meet on a further day, with those who can come: two at least.

    Parameters
    ----------
    meetings
        As on the first day.
    later
        Days since then.
    """
    here = {draft.id: draft for draft in day.people}
    found: list[Meeting] = []
    joined: dict[str, list[Meeting]] = {}
    for meeting in meetings:
        if not _takes_place(day.index, meeting, later):
            continue
        again = replace(meeting, members=[])
        if meeting.circle.small_children or _families(meeting, day.cares):
            come_to_play(day.index, day.cares, meeting, again)
        else:
            again.members = [
                here[member.id]
                for member in meeting.members
                if can_come(day.index, here[member.id], again, joined.get(member.id, []))
            ]
        if len(again.members) >= 2:
            found.append(again)
            for member in again.members:
                joined.setdefault(member.id, []).append(again)
    return found


def _families(meeting: Meeting, cares: Sequence[Care]) -> bool:
    """Whether small children belong to a group: they and their carers come together or not at all."""
    small = {child.id for care in cares for child in care.small}
    return any(member.id in small for member in meeting.members)


def _takes_place(index: PlaceIndex, meeting: Meeting, later: int) -> bool:
    meets = meeting.circle.meets
    due = meets == "daily" or (index.weekday in SCHOOL_DAYS if meets == "working_days" else later % 7 == 0)
    return due and any(a <= meeting.start and meeting.end <= b for a, b in index.hours(meeting.place))


def write_days(
    planned: DayDrafts,
    first: DayDrafts,
    meetings: Sequence[Meeting],
    relations: Sequence[Relation],
    dates: Sequence[date],
    streams: Streams,
) -> list[DaySchedules]:
    """Write everybody's schedules of several days, one after another.

    Parameters
    ----------
    planned, first
        Everybody on the day that jobs were planned for, and on the first day.
    meetings
        Of the first day.
    relations
        Who may meet whom, or help.
    dates
        In order, the first day first.
    streams
        Gives random streams by name.
    """
    found: list[DaySchedules] = []
    up_late: Mapping[str, int] | None = None
    for later, when in enumerate(dates):
        day, met = first, list(meetings)
        if later:
            day = drafts_on(planned.index.on(when), planned, streams)
            met = meetings_on(day, meetings, (when - dates[0]).days)
        writer = DayWriter(streams("days" if not later else f"days/{later}"), day.index, up_late)
        items, frequented = writer.write(day.households, met, relations)
        found.append(DaySchedules(when, day.index, items, frequented, met))
        up_late = writer.late
    return found
