"""The people as they stand while a model writes them: what is accepted, and the day each has without the model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from vico.community.childhood import GROWN_UP, is_pupil
from vico.community.findings import CommunityFinding
from vico.community.llm.cast import Cast
from vico.community.llm.fitting import MIDNIGHT, DayFitter, FittedDay, Stay, minute_of, overlaid, stays_of
from vico.community.llm.prose import renamer
from vico.community.model import ActivityTag, Group, ItemType, Resident, ScheduleItem
from vico.community.place_index import PlaceIndex
from vico.community.tags import tag_of
from vico.community.validator import check_resident
from vico.english import with_article

# Somebody whose working hours nobody has said works so long, from this time on if the place is open, minutes.
_WORKING_DAY, _USUAL_START, _EARLIEST = 8 * 60, 9 * 60, 6 * 60
# A working day of so many minutes has a break of so many.
_LONG_DAY, _BREAK = 6 * 60, 30


class Lives:
    """Who everybody is by now.

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
        """Let these people, of one household, be who they are from now on."""
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
        items = [self._tagged(item, person, groups) for item in fitted.items]
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

    def _tagged(self, item: ScheduleItem, person: Resident, groups: Sequence[Group]) -> ScheduleItem:
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
    start, end = working_hours(index, person.workplace)
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


def working_hours(index: PlaceIndex, place: str) -> tuple[int, int]:
    """Return from when until when somebody may work at a place, minutes of the day: eight hours at most."""
    spans = [(max(a, _EARLIEST), min(b, MIDNIGHT)) for a, b in index.hours(index.place_by_id[place])]
    start, end = max(spans, key=lambda span: (span[1] - span[0], -span[0]), default=(_USUAL_START, 17 * 60))
    begin = min(max(start, _USUAL_START), max(start, end - _WORKING_DAY))
    return begin, min(end, begin + _WORKING_DAY)
