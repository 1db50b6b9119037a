"""The people as they stand while a model writes them, and the days that fit what it proposed.

What is accepted is kept beside the day that each has without the model. Stays that somebody proposes become a day that
can be walked: our router says how long ways take, not the model.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from vico.clock import clock_of, seconds_of_day
from vico.community.day import CHAT
from vico.community.llm.prompting import Cast, renamer
from vico.community.model import LAST, ActivityTag, CommunityFinding, Group, ItemType, Resident, ScheduleItem, tag_of
from vico.community.people import GROWN_UP, is_pupil
from vico.community.place_index import PlaceIndex, staffed_spans
from vico.community.validator import check_resident
from vico.english import with_article
from vico.rules import walk_speed

MIDNIGHT = 24 * 60
# A stay is not cut below this, nor below half its length, to make time for a way, minutes.
_LEAST = 10
# What is left of a stay that another one covers, if it is shorter, is dropped, minutes.
_FRAGMENT = 5
# Who has longer than this to spare on a way spends it at home, if home is not too far, minutes.
_WAIT = 25


@dataclass(frozen=True)
class Stay:
    """Something to do at a place.

    Attributes
    ----------
    start, end
        Minutes of the day.
    fixed
        Whether its times stand: meetings, lessons.
    planned
        Start and end as they were proposed, if it is known.
    """

    start: int
    end: int
    type: ItemType
    activity: str
    place: str
    tag: ActivityTag | None = None
    fixed: bool = False
    planned: tuple[int, int] | None = None

    @property
    def minutes(self) -> int:
        """Return how long it takes."""
        return self.end - self.start

    @property
    def shift_minutes(self) -> int:
        """By how many minutes its start or end was moved."""
        return 0 if self.planned is None else max(abs(self.start - self.planned[0]), abs(self.end - self.planned[1]))


@dataclass(frozen=True)
class FittedDay:
    """A day whose ways take as long as they do.

    Attributes
    ----------
    items
        The schedule; empty if the stays can't be fitted.
    findings
        Why not, a sentence each.
    moved
        By how many minutes a start or an end was moved at most.
    """

    items: list[ScheduleItem]
    findings: list[str]
    moved: int = 0


def stays_of(schedule: Sequence[ScheduleItem]) -> list[Stay]:
    """Return the stays of a schedule, without the ways between them; seconds are rounded down to minutes."""
    return [
        Stay(minute_of(item.start), minute_of(item.end), item.type, item.activity, item.place, item.tag)
        for item in schedule
        if item.type is not ItemType.COMMUTE and item.place is not None
    ]


def minute_of(clock: str) -> int:
    """Return the minute of the day that ``HH:MM:SS`` lies in; the day's last second is its end, 1440."""
    return MIDNIGHT if clock == LAST else seconds_of_day(clock) // 60


def overlaid(movable: Sequence[Stay], fixed: Sequence[Stay] = ()) -> list[Stay]:
    """Return stays that don't overlap: who starts later interrupts who is there, and what is fixed interrupts all."""
    stays = [*sorted(movable, key=lambda stay: (stay.start, -stay.end)), *fixed]
    owner = np.full(MIDNIGHT, -1, np.int64)
    for k, stay in enumerate(stays):
        owner[max(0, stay.start) : min(MIDNIGHT, stay.end)] = k
    edges = [0, *(np.flatnonzero(np.diff(owner)) + 1).tolist(), MIDNIGHT]
    found = []
    for start, end in pairwise(edges):
        if owner[start] < 0:
            continue
        stay = stays[int(owner[start])]
        whole = (start, end) == (stay.start, stay.end)
        if whole or stay.fixed or end - start >= _FRAGMENT:
            found.append(stay if whole else replace(stay, start=start, end=end))
    return found


class DayFitter:
    """Fits the days of one resident.

    Parameters
    ----------
    index
        Ways and hours.
    resident
        Whose home, workplace and age count.
    """

    def __init__(self, index: PlaceIndex, resident: Resident) -> None:
        self._index = index
        self._home, self._work = resident.home, resident.workplace
        self._pace = walk_speed(resident.age)

    def fit(self, movable: Sequence[Stay], fixed: Sequence[Stay] = (), *, drop: bool = False) -> FittedDay:
        """Fit stays into a day from 00:00:00 to 23:59:59, ways put in.

        What is fixed keeps its times. Other stays begin later or end sooner where the way to the next place takes
        longer than there is time for, by half their length at most; time to spare is spent where one is, or at home.

        Parameters
        ----------
        movable
            Stays that may be moved; who starts later interrupts who is there.
        fixed
            Stays whose times stand, in their order.
        drop
            Leave out what does not fit, but for sleep and what is fixed, instead of saying why it does not.
        """
        if clashes := [
            f"{a.activity!r} and {b.activity!r} are at the same time" for a, b in pairwise(fixed) if b.start < a.end
        ]:
            return FittedDay([], clashes)
        stays = [replace(stay, planned=(stay.start, stay.end)) for stay in overlaid(movable, fixed)]
        if not stays:
            return FittedDay([], ["there is nothing in the day but ways"])
        if stays[0].start > 0 and stays[0].place == self._home and not stays[0].fixed:
            stays[0] = replace(stays[0], start=0)
        elif stays[0].start > 0:
            stays.insert(0, Stay(0, _LEAST, ItemType.SLEEP, "Sleep", self._home, ActivityTag.SLEEP))
        line = [stays[0]]
        whole = {(stay.start, stay.end) for stay in movable}
        findings: list[str] = []
        for stay in stays[1:]:
            # What another stay has left of one may be too short to be worth the way there.
            fragment = stay.minutes < 2 * _LEAST and (stay.start, stay.end) not in whole
            finding = self._join(line, stay)
            if not finding or ((drop or fragment) and _may_go(stay)):
                continue
            while drop and finding and len(line) > 1 and _may_go(line[-1]):
                line.pop()
                finding = self._join(line, stay)
            if finding:
                findings.append(finding)
                line.append(stay)
        if line[-1].end < MIDNIGHT:
            finding = self._end(line)
            findings += [finding] if finding else []
        if findings:
            return FittedDay([], findings)
        return FittedDay(self._items(line), [], max(stay.shift_minutes for stay in line))

    def _end(self, line: list[Stay]) -> str:
        """Spend what is left of the day where one is, or at home."""
        if self.may_stay(line[-1].place, line[-1].start, MIDNIGHT) and not line[-1].fixed:
            line[-1] = replace(line[-1], end=MIDNIGHT)
            return ""
        return self._join(line, _at_home(self._home, line[-1].end + _LEAST, MIDNIGHT))

    def _join(self, line: list[Stay], stay: Stay) -> str:
        """Put a stay at the end of the line, with the time that the way there takes; say why if that can't be."""
        last = line[-1]
        gap = stay.start - last.end
        if last.place == stay.place:
            line.append(self._fill(line, stay, 0) if gap > 0 else stay)
            return ""
        way = self._index.minutes(last.place, stay.place, self._pace)
        if way is None:
            return f"there is no way from {self._name(last.place)} to {self._name(stay.place)}"
        if gap < way:
            return self._shorten(line, stay, way - gap, way)
        line.append(self._fill(line, stay, way) if gap > way else stay)
        return ""

    def _shorten(self, line: list[Stay], stay: Stay, short: int, way: int) -> str:
        last = line[-1]
        sooner = min(short, _room(last))
        later = min(short - sooner, _room(stay))
        if sooner + later < short:
            return (
                f"the way from {self._name(last.place)} to {self._name(stay.place)} takes {way} min, but there are "
                f"{max(0, way - short)} min between {last.activity!r} and {stay.activity!r}"
            )
        line[-1] = replace(last, end=last.end - sooner)
        line.append(replace(stay, start=stay.start + later))
        return ""

    def _fill(self, line: list[Stay], stay: Stay, way: int) -> Stay:
        """Spend the time before a stay, but for the way there; return the stay, which may begin sooner."""
        last = line[-1]
        leave = stay.start - way
        if way and _end_is_set(last) and leave - last.end < CHAT:
            return stay  # as in the procedural author's days, the way takes these minutes longer
        if leave - last.end > _WAIT and (at_home := self._between(last, stay)) is not None:
            line.append(at_home)
            return stay
        if self.may_stay(last.place, last.start, leave):
            if _end_is_set(last):
                line.append(Stay(last.end, leave, ItemType.MAIN, "Stay on for a while", last.place, last.tag))
            else:
                line[-1] = replace(last, end=leave)
            return stay
        if not stay.fixed and self.may_stay(stay.place, last.end + way, stay.end):
            return replace(stay, start=last.end + way)
        if (at_home := self._between(last, stay)) is not None:
            line.append(at_home)
        return stay

    def _between(self, last: Stay, stay: Stay) -> Stay | None:
        """Return the time that one can be at home between two stays; None if that is not worth the way."""
        if self._home in (last.place, stay.place):
            return None
        there = self._index.minutes(last.place, self._home, self._pace)
        back = self._index.minutes(self._home, stay.place, self._pace)
        if there is None or back is None:
            return None
        at_home = _at_home(self._home, last.end + there, stay.start - back)
        return at_home if at_home.minutes >= _LEAST else None

    def may_stay(self, place: str, start: int, end: int) -> bool:
        """Whether one may be at a place from one minute until another, as far as it says when it is open."""
        spans = self._index.given_hours(self._index.place_by_id[place])
        if spans is None or place == self._home:
            return True
        return any(a <= start and end <= b for a, b in (staffed_spans(spans) if place == self._work else spans))

    def _name(self, place: str) -> str:
        return self._index.place_by_id[place].name

    def _items(self, line: Sequence[Stay]) -> list[ScheduleItem]:
        items: list[ScheduleItem] = []
        for k, stay in enumerate(line):
            place = self._index.place_by_id[stay.place]
            if k and line[k - 1].end < stay.start:
                words = "Walk home" if stay.place == self._home else f"Walk to {place.name}"
                items.append(
                    ScheduleItem(
                        type=ItemType.COMMUTE, tag=ActivityTag.COMMUTE, start=clock_of(line[k - 1].end * 60),
                        end=clock_of(stay.start * 60), activity=words, place=None, building=None,
                    )
                )  # fmt: skip
            items.append(
                ScheduleItem(
                    type=stay.type, tag=stay.tag, start=clock_of(stay.start * 60), end=clock_of(stay.end * 60),
                    activity=stay.activity, place=stay.place, building=place.building,
                )
            )  # fmt: skip
        return items


def _room(stay: Stay) -> int:
    """By how many minutes a stay may be cut."""
    return 0 if stay.fixed else max(0, min(stay.minutes - _LEAST, stay.minutes // 2))


def _end_is_set(stay: Stay) -> bool:
    """Whether the end of a stay is not one's own to choose: it stands, or others meet there."""
    return stay.fixed or stay.tag is ActivityTag.GROUP


def _may_go(stay: Stay) -> bool:
    """Whether a day is still a day without a stay."""
    return not stay.fixed and stay.type is not ItemType.SLEEP


def _at_home(home: str, start: int, end: int) -> Stay:
    return Stay(start, end, ItemType.MAIN, "Spend time at home", home, ActivityTag.LEISURE)


# Working hours that nobody has said.
_WORKING_DAY = 8 * 60  # minutes
_USUAL_START = 9 * 60  # minute of the day, if the place is open
_EARLIEST = 6 * 60  # minute of the day
_LONG_DAY = 6 * 60  # minutes of work from which on a day has a break
_BREAK = 30  # minutes


class Lives:
    """All residents as they are by now.

    Parameters
    ----------
    cast
        Who they were before the model wrote anything.

    Attributes
    ----------
    people
        Residents by id, with the procedural author's schedules.
    """

    def __init__(self, cast: Cast) -> None:
        self.cast = cast
        self.people: dict[str, Resident] = {r.id: r for r in cast.base.residents}
        self._plain: dict[str, list[Stay]] = {}

    def accept(self, people: Sequence[Resident]) -> None:
        """Replace the people of one household."""
        for person in people:
            self.people[person.id] = person
            self._plain.pop(person.id, None)

    def plain_stays(self, resident: str) -> list[Stay]:
        """Return somebody's stays without the model: the procedural author's, at the workplace they have now."""
        if resident not in self._plain:
            before = self.cast.base.resident_by_id[resident]
            self._plain[resident] = stays_with_work(
                self.cast.index, before, self.people[resident], self.renames(before)
            )
        return self._plain[resident]

    def renames(self, before: Resident) -> Callable[[str], str]:
        """Return what writes the names that a household has now for those it had."""
        household = [r for r in self.cast.base.residents if r.household == before.household]
        return renamer([(r.first_name, self.people[r.id].first_name) for r in household])

    def lessons(self, resident: str) -> list[Stay]:
        """Return what a child's day is built around: its school, or its lessons at home."""
        person = self.people[resident]
        if person.age >= GROWN_UP:
            return []
        return [
            replace(stay, fixed=True)
            for stay in self.plain_stays(resident)
            if stay.place == person.workplace or (stay.tag is ActivityTag.STUDY and stay.place == person.home)
        ]

    def meetings(self, resident: str, groups: Sequence[Group]) -> list[Stay]:
        """Return the meetings of groups as stays of somebody, whose times stand; as their day has them, if it does."""
        planned = {(stay.place, stay.start, stay.end): stay for stay in self.plain_stays(resident)}
        found = []
        for group in groups:
            start, end = minute_of(group.start), minute_of(group.end)
            words = f"{group.name}: {group.activity}"
            new = Stay(start, end, ItemType.MAIN, words, group.place, ActivityTag.GROUP)
            found.append(replace(planned.get((group.place, start, end), new), fixed=True))
        return found

    def day(
        self,
        person: Resident,
        movable: Sequence[Stay],
        groups: Sequence[Group],
        *,
        others: Sequence[Stay] = (),
        drop: bool = False,
    ) -> FittedDay:
        """Fit a day around the meetings of groups and other fixed stays, and hold it to the validator.

        Parameters
        ----------
        movable
            What is proposed.
        groups
            Whose meetings it has to hold.
        others
            Further stays whose times stand.
        drop
            Leave out what does not fit.
        """
        fixed = sorted([*self.meetings(person.id, groups), *others], key=lambda stay: stay.start)
        fitted = DayFitter(self.cast.index, person).fit(movable, fixed, drop=drop)
        if fitted.findings:
            return fitted
        items = [self._with_tag(item, person, groups) for item in fitted.items]
        known = dict.fromkeys([*person.known_places, *(i.place for i in items if i.place), *(g.place for g in groups)])
        whole = person.model_copy(update={"schedule": items, "known_places": list(known)})
        found = self.findings(whole, "schedule")
        return FittedDay(items, [f"{one.where}: {one.what}; {one.mend}" for one in found], fitted.moved)

    def findings(self, person: Resident, *fields: str) -> list[CommunityFinding]:
        """Return what the validator finds in some fields of somebody."""
        found = check_resident(person, self.cast.base, self.cast.index)
        starts = tuple(f"{person.id}.{name}" for name in fields)
        return [one for one in found if one.where.startswith(starts)]

    def plain_day(self, resident: str, groups: Sequence[Group]) -> FittedDay:
        """Return the day that somebody has without the model, with the meetings of groups in it."""
        lessons = self.lessons(resident)
        return self.day(self.people[resident], self.plain_stays(resident), groups, others=lessons, drop=True)

    def _with_tag(self, item: ScheduleItem, person: Resident, groups: Sequence[Group]) -> ScheduleItem:
        if item.tag is not None:
            return item
        tag = tag_of(item, person, groups, self.cast.index.place_by_id)
        if tag is ActivityTag.WORK and (is_pupil(person.occupation) or person.occupation.startswith("student")):
            tag = ActivityTag.STUDY
        return item.model_copy(update={"tag": tag})


def stays_with_work(index: PlaceIndex, before: Resident, now: Resident, renamed: Callable[[str], str]) -> list[Stay]:
    """Return the stays of a day after a change of workplace and of names in the household."""
    stays = [replace(stay, activity=renamed(stay.activity)) for stay in stays_of(before.schedule)]
    if now.workplace == before.workplace:
        return stays
    working = (ActivityTag.WORK, ActivityTag.STUDY)
    stays = [
        s for s in stays if s.tag not in working and (s.place != before.workplace or s.place == now.home)
    ]  # fmt: skip
    return stays if now.workplace is None else overlaid(stays, _work(index, now))


def _work(index: PlaceIndex, person: Resident) -> list[Stay]:
    """Return working hours at a new workplace, with a break."""
    assert person.workplace is not None
    # Eight hours at most of the longest stretch in which the place is open.
    spans = [(max(a, _EARLIEST), min(b, MIDNIGHT)) for a, b in index.hours(index.place_by_id[person.workplace])]
    opens, closes = max(spans, key=lambda span: (span[1] - span[0], -span[0]), default=(_USUAL_START, 17 * 60))
    start = min(max(opens, _USUAL_START), max(opens, closes - _WORKING_DAY))
    end = min(closes, start + _WORKING_DAY)
    place = index.place_by_id[person.workplace]
    student = person.occupation.startswith("student")
    tag = ActivityTag.STUDY if student else ActivityTag.WORK
    words = f"Study at {place.name}" if student else f"Work as {with_article(person.occupation)}"
    if end - start < _LONG_DAY:
        return [Stay(start, end, ItemType.MAIN, words, place.id, tag)]
    noon = (start + end) // 2 // 5 * 5
    return [
        Stay(start, noon, ItemType.MAIN, words, place.id, tag),
        Stay(noon, noon + _BREAK, ItemType.MEAL, "Have a lunch break", place.id, ActivityTag.MEAL_OUT),
        Stay(noon + _BREAK, end, ItemType.MAIN, words, place.id, tag),
    ]
