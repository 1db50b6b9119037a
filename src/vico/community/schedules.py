"""Everybody's day: sleep, work, meetings, meals and outings, then home life in what is left."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from vico.community.catalogue import errands
from vico.community.childhood import adults_only
from vico.community.company import Company, Party
from vico.community.day import MIDNIGHT, Block, Day, in_fives
from vico.community.groups import Meeting, meetings_by_member
from vico.community.homelife import Homelife, fill_day
from vico.community.model import ActivityTag, ItemType, Relation, ScheduleItem
from vico.community.outings import Outings
from vico.community.people import Household, ResidentDraft
from vico.community.place_index import PlaceIndex, kind_of
from vico.community.school_days import SchoolDays
from vico.english import uncapitalized
from vico.world.model import Category
from vico.world.opening_hours import Span

# Places that close for so long, minutes, do so for a midday break; staff go home if they have so long there.
_CLOSED, _HOME_FOR_LUNCH = 30, 40
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
            text = f"{group.circle.name}: {uncapitalized(group.circle.activity)}"
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
                first = f"Answer the morning's mail, then {uncapitalized(first)}"
            elif (
                index.place_by_id[place].category != Category.OFFICE
                and start < min(index.hours(index.place_by_id[place]))[0]
            ):
                first = f"Open up, then {uncapitalized(first)}"
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
