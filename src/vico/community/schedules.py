"""Everybody's schedules, of one day and of several: who works, learns and meets on which day, and what they do.

A day is written in this order: sleep, work, meetings, meals and outings, then home life in what is left.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import date, timedelta
from itertools import pairwise

import numpy as np

from vico.community.catalogue import errands
from vico.community.day import MIDNIGHT, Block, Day, Homelife, fill_day, in_fives
from vico.community.groups import Meeting, can_come, come_to_play, meetings_by_member
from vico.community.model import WEEKDAYS, ActivityTag, ItemType, Relation, ScheduleItem
from vico.community.outings import Company, Outings, Party
from vico.community.people import Household, ResidentDraft, adults_only
from vico.community.place_index import PlaceIndex, kind_of
from vico.community.schooling import SCHOOL_DAYS, Care, SchoolDays, care_on, lessons_on
from vico.community.work import shift_on
from vico.english import uncapitalize
from vico.errors import InputError
from vico.world.model import Category
from vico.world.opening_hours import Span

_CLOSED = 30  # minutes of closing that are a midday break
_HOME_FOR_LUNCH = 40  # minutes at home for which staff go there
# How much longer one sleeps on a day off, minutes, unless one rises early anyway.
_LIE_IN = 70


class DayWriter:
    """Writes the days of a community, so that people who do something together do it at the same time.

    Parameters
    ----------
    rng
        Decides what is left open.
    index
        Places, walks and hours.
    up_late
        Until when each was up last night, minutes past midnight, 0 for those who were asleep; without it the day begins
        as such a day ends.

    Attributes
    ----------
    late
        The same of the night after, by resident id.
    """

    def __init__(self, rng: np.random.Generator, index: PlaceIndex, up_late: Mapping[str, int] | None = None) -> None:
        self._up_late = up_late
        self.late: dict[str, int] = {}
        self._rng = rng
        self._index = index
        self._outings = Outings(rng, index)
        self._school = SchoolDays(rng, index, self._outings.put)

    def write(
        self, households: Sequence[Household], groups: Sequence[Meeting], relations: Sequence[Relation] = ()
    ) -> tuple[dict[str, list[ScheduleItem]], dict[str, list[str]]]:
        """Write everybody's schedule.

        Parameters
        ----------
        relations
            Who may meet whom, or help.

        Returns
        -------
        schedules, frequented
            By resident id: the day, and the places they go to besides home and work.
        """
        days: dict[str, Day] = {}
        people = [s for h in households for s in h.members]
        joined = meetings_by_member(groups)
        for draft in people:
            days[draft.id] = self._frame(draft, joined.get(draft.id, []))
        company = Company(self._rng, self._index, self._outings)
        for household in households:
            company.household([(m, days[m.id]) for m in household.members], household.kind)
        parties = {draft.id: (draft, days[draft.id]) for draft in people}
        company.help(parties, relations)
        company.friends(parties, relations)
        for draft in people:
            self._outings.plan_alone(draft, days[draft.id])
        lives = {s.id: Homelife(self._rng, s, days[s.id].done) for s in people}
        for household in households:
            # People under one roof eat at the same time, when both are in.
            early, late = (207, 222) if household.children else (210, 236)
            dinner = 5 * int(self._rng.integers(early, late))
            for member in household.members:
                lives[member.id].dinner_at = dinner
                fill_day(days[member.id], lives[member.id])
            _eat_together([(m, days[m.id]) for m in household.members])
        frequented = {i: list(dict.fromkeys(b.place for b in day.blocks)) for i, day in days.items()}
        return {i: day.items() for i, day in days.items()}, frequented

    def _frame(self, draft: ResidentDraft, groups: Sequence[Meeting]) -> Day:
        """Return a day with what is fixed: sleep, work with its break, groups."""
        rng, day = self._rng, Day(self._index, draft.home, draft.workplace, pace=draft.pace)
        day.out_until = draft.out_until
        if draft.child:
            day.barred = adults_only()
        lunch_group = None
        for group in groups:
            kind = ItemType.MEAL if group.circle.meal else ItemType.MAIN
            text = f"{group.circle.name}: {uncapitalize(group.circle.activity)}"
            self._outings.put(day, Block(group.start, group.end, kind, text, group.place.id, "group", group.circle.tag))
            if draft.shift and draft.shift[0] < group.start and group.end < draft.shift[1]:
                lunch_group = day.blocks[-1]
        for duty in draft.duties:
            role = "home" if duty.place == draft.home else "duty"
            self._outings.put(
                day, Block(duty.start, duty.end, ItemType.MAIN, duty.activity, duty.place, role, ActivityTag.VISIT)
            )
        if draft.child:
            self._school.write(draft, day)
        elif draft.shift is not None:
            self._work(draft, day, lunch_group)
        if draft.child:
            natural, sleep = SchoolDays.sleep(rng, draft)
        elif draft.status == "retired":
            natural, sleep = 360 + 90 * (1 - draft.early), 470
        elif draft.status == "student":
            natural, sleep = 430 + 90 * (1 - draft.early), 480
        elif draft.shift is not None and draft.shift[0] >= 12 * 60:
            natural, sleep = 450 + 110 * (1 - draft.early), 480
        else:
            natural, sleep = 380 + 120 * (1 - draft.early), 455
        lie_in = _LIE_IN * (1 - 0.5 * draft.early) if draft.day_off else 0.0
        self._nights(draft, day, (int(natural), int(lie_in)), int(sleep))
        return day

    def _nights(self, draft: ResidentDraft, day: Day, wakes: tuple[int, int], sleep: int) -> None:
        """Put sleep at both ends of a day, so that who has to be somewhere is up in time.

        Parameters
        ----------
        wakes
            When they wake by themselves, minute of the day, and how much longer they sleep today.
        sleep
            How long they sleep, minutes.
        """
        rng = self._rng
        leave, home = MIDNIGHT, 0
        if day.blocks:
            first, last = day.blocks[0], day.blocks[-1]
            leave = first.start - (day.walk(draft.home, first.place) or 0)
            home = (day.walk(last.place, draft.home) or 0) + last.end
        prepare = 5 * int(rng.integers(9, 16))
        wake = int(min(sum(wakes), leave - prepare) // 5 * 5)
        bed = in_fives(min(wake, wakes[0]) + MIDNIGHT - sleep - float(rng.integers(0, 45)))
        bed = max(bed, in_fives(home + 40 + float(rng.integers(0, 25))))
        over = max(10, bed - MIDNIGHT) if bed >= MIDNIGHT - 10 else 0
        # Up past midnight: the end of such an evening is also how the day began, unless it is known how it did.
        began = over if self._up_late is None else self._up_late[draft.id]
        self.late[draft.id] = over
        if began:
            wake = max(wake, min(began + 360, leave - 35)) // 5 * 5
            self._outings.put(day, Block(0, began, ItemType.MAIN, "Wind down after a long evening", draft.home, "home"))
        self._outings.put(day, Block(began, wake, ItemType.SLEEP, "Sleep", draft.home, "sleep"))
        if over:
            self._outings.put(
                day, Block(MIDNIGHT - 5, MIDNIGHT, ItemType.MAIN, "Lie in bed and read a page", draft.home, "home")
            )
        else:
            self._outings.put(day, Block(bed, MIDNIGHT, ItemType.SLEEP, "Sleep", draft.home, "sleep"))

    def _work(self, draft: ResidentDraft, day: Day, lunch_group: Block | None) -> None:
        rng, index, place = self._rng, self._index, draft.workplace
        assert draft.shift is not None
        assert place is not None
        start, end = draft.shift
        first, second, tag = self._tasks(draft, place, start)
        if lunch_group is not None:
            there, back = day.walk(place, lunch_group.place), day.walk(lunch_group.place, place)
            assert there is not None
            assert back is not None
            out, again = lunch_group.start - there, lunch_group.end + back
            self._outings.put(day, Block(start, out, ItemType.MAIN, first, place, "work", tag))
            self._outings.put(day, Block(again, end, ItemType.MAIN, second, place, "work", tag))
            return
        closed = _midday_closing(index.hours(index.place_by_id[place]), start, end)
        if closed is not None:
            self._over_midday(day, (start, end), closed, (first, tag))
            return
        if end - start < 5 * 60:
            self._outings.put(day, Block(start, end, ItemType.MAIN, first, place, "work", tag))
            return
        late = start >= 12 * 60
        middle = (start + end) / 2 + 20
        noon = in_fives(
            np.clip(middle, 17 * 60, 19 * 60) if late else np.clip(rng.normal(12 * 60 + 10, 20), 11 * 60, 13 * 60)
        )
        noon = int(np.clip(noon, start + 90, end - 120))
        at_home_there = draft.job is not None and draft.job.shift in ("kitchen", "early", "health", "school", "hotel")
        if not late and (draft.status == "student" or not at_home_there) and rng.random() < 0.6:
            for eatery in self._outings.near(place, errands().kinds.lunch, within=260.0):
                there, back = day.walk(place, eatery.id), day.walk(eatery.id, place)
                sit = 5 * int(rng.integers(5, 9))
                if there is None or back is None or there > 5 or eatery.id == place:
                    continue
                s = noon + there
                if any(a <= s and s + sit <= b for a, b in index.hours(eatery)):
                    text = "Have a quick lunch" if kind_of(eatery) == "fast_food" else "Have lunch"
                    self._outings.put(day, Block(start, noon, ItemType.MAIN, first, place, "work", tag))
                    self._outings.put(day, Block(s, s + sit, ItemType.MEAL, text, eatery.id, "lunch"))
                    self._outings.put(day, Block(s + sit + back, end, ItemType.MAIN, second, place, "work", tag))
                    return
        pause = 5 * int(rng.integers(5, 9))
        if late:
            text = "Eat with the other staff"
        elif draft.job is not None and draft.job.shift == "kitchen":
            text = "Eat a plate from the kitchen"
        else:
            text = str(
                rng.choice(
                    ["Eat a packed lunch", "Eat lunch in the break room", "Have soup and bread in the break room"]
                )
            )
            if draft.status == "student":
                text = "Eat a packed lunch"
        self._outings.put(day, Block(start, noon, ItemType.MAIN, first, place, "work", tag))
        self._outings.put(day, Block(noon, noon + pause, ItemType.MEAL, text, place, "dinner" if late else "lunch"))
        self._outings.put(day, Block(noon + pause, end, ItemType.MAIN, second, place, "work", tag))

    def _tasks(self, draft: ResidentDraft, place: str, start: int) -> tuple[str, str, ActivityTag]:
        """Return what somebody does in the first and in the second part of their working hours, and its tag."""
        index = self._index
        tag = ActivityTag.STUDY if draft.status == "student" else ActivityTag.WORK
        if draft.status == "student":
            first, second = f"Attend lectures in {draft.subject}", f"Work on {draft.subject} exercises"
            if kind_of(index.place_by_id[place]) == "library":
                first, second = f"Study {draft.subject}", f"Write on a {draft.subject} paper"
        else:
            assert draft.job is not None
            first = second = draft.job.task
            if draft.job.shift in ("office", "bank"):
                first = f"Answer the morning's mail, then {uncapitalize(first)}"
            elif (
                index.place_by_id[place].category != Category.OFFICE
                and start < min(index.hours(index.place_by_id[place]))[0]
            ):
                first = f"Open up, then {uncapitalize(first)}"
        return first, second, tag

    def _over_midday(self, day: Day, shift: Span, closed: Span, work: tuple[str, ActivityTag]) -> None:
        """Put working hours in with a break while the place is closed: at home where that is worth the way."""
        (start, end), (closes, opens), (text, tag), place = shift, closed, work, day.workplace
        assert place is not None
        self._outings.put(day, Block(start, closes, ItemType.MAIN, text, place, "work", tag))
        way = day.walk(place, day.home)
        if way is None or opens - closes - 2 * way < _HOME_FOR_LUNCH:
            words = "Eat a packed lunch and rest while it is closed"
            self._outings.put(day, Block(closes, opens, ItemType.MEAL, words, place, "lunch"))
        self._outings.put(day, Block(opens, end, ItemType.MAIN, text, place, "work", tag))


def _midday_closing(spans: Sequence[Span], start: int, end: int) -> Span | None:
    """Return when a place is closed within working hours, minutes, if it is for a while."""
    for (_, closes), (opens, _) in pairwise(sorted(spans)):
        if start + 60 <= closes and opens + 60 <= end and opens - closes >= _CLOSED:
            return closes, opens
    return None


def _eat_together(members: Sequence[Party]) -> None:
    """Name the others in meals that people under one roof have at home at the same time."""
    for me, day in members:
        for block in day.blocks:
            if block.type is not ItemType.MEAL or block.place != day.home:
                continue
            others = [
                other.first
                for other, theirs in members
                if other is not me
                and any(
                    b.type is ItemType.MEAL
                    and b.place == block.place
                    and min(b.end, block.end) - max(b.start, block.start) >= 10
                    for b in theirs.blocks
                )
            ]
            if others:
                block.activity += f" with {' and '.join(others)}"


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
        replace(household, members=[_draft_on(index, planned.index, member, streams) for member in household.members])
        for household in planned.households
    ]
    cares = [
        care_on(index, household, carer)
        for household in households
        for carer in household.members
        if carer.id in carers
    ]
    return DayDrafts(index, households, cares)


def _draft_on(index: PlaceIndex, planned: PlaceIndex, draft: ResidentDraft, streams: Streams) -> ResidentDraft:
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
    small = {child.id for care in day.cares for child in care.small}
    for meeting in meetings:
        if not _takes_place(day.index, meeting, later):
            continue
        again = replace(meeting, members=[])
        # Small children and their carers come together or not at all.
        if meeting.circle.small_children or any(member.id in small for member in meeting.members):
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
