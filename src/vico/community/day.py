"""One person's day: a time line of things to do at places, how its gaps are filled, and what it comes to in numbers.

The walks between places always fit, and nobody's day has holes: what is left is spent at home. Words for people's
character have to agree with the measures of their days.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np
from numpy.typing import NDArray

from vico.clock import DAY, clock_of, seconds_of_day
from vico.community.catalogue import Claim, Pastime, at_home, claims, inclinations
from vico.community.model import ActivityTag, Community, CommunityFinding, ItemType, Mode, Resident, ScheduleItem
from vico.community.people import ALONE_FROM, ResidentDraft, childhood
from vico.community.place_index import PlaceIndex, staffed_spans
from vico.rules import WALK_SPEED
from vico.world.opening_hours import Span

MIDNIGHT = 24 * 60


def in_fives(minutes: float) -> int:
    """Return the nearest multiple of five minutes."""
    return round(float(minutes) / 5) * 5


@dataclass
class Block:
    """Something to do at a place, from `start` to `end`, minutes of the day.

    Attributes
    ----------
    role
        What it is to the planner: sleep, work, lunch, group, outing, home, ...
    tag
        What it is about, where the role does not say.
    """

    start: int
    end: int
    type: ItemType
    activity: str
    place: str
    role: str
    tag: ActivityTag | None = None


class Day:
    """A time line of blocks that don't overlap, each reachable in time from the one before.

    Parameters
    ----------
    index
        Gives the walks.
    home, workplace
        Place ids; `workplace` is None for those who have none.
    pace
        How fast they walk, m/s.

    Attributes
    ----------
    out_until
        Until when they go out alone, minutes.
    barred
        Kinds of places that are not for them.
    done
        Activities that they go out for: once a day is enough.
    """

    def __init__(self, index: PlaceIndex, home: str, workplace: str | None = None, *, pace: float = WALK_SPEED) -> None:
        self.index = index
        self.pace = pace
        self.out_until = MIDNIGHT
        self.barred: frozenset[str] = frozenset()
        self.home = home
        self.workplace = workplace
        self.blocks: list[Block] = []
        self.done: set[str] = set()

    def walk(self, a: str, b: str) -> int | None:
        """Return the minutes to allow for the walk between two places; None if there is no way."""
        return self.index.minutes(a, b, self.pace)

    def open_spans(self, place: str) -> list[Span]:
        """Return from when until when one may be at a place, minutes: at home always, at work as staff may."""
        if place == self.home:
            return [(0, MIDNIGHT)]
        hours = self.index.hours(self.index.place_by_id[place])
        return staffed_spans(hours) if place == self.workplace else hours

    def fits(self, start: int, end: int, place: str) -> bool:
        """Whether something from `start` to `end` at `place` fits between what is there."""
        before = after = None
        for block in self.blocks:
            if block.end <= start:
                before = block
            elif block.start >= end:
                after = block
                break
            else:
                return False
        if before is not None:
            there = self.walk(before.place, place)
            if there is None or before.end + there > start:
                return False
        if after is not None:
            back = self.walk(place, after.place)
            if back is None or end + back > after.start:
                return False
        return 0 <= start < end <= MIDNIGHT

    def add(self, block: Block) -> bool:
        """Put a block in, if it fits."""
        if not self.fits(block.start, block.end, block.place):
            return False
        self.blocks.append(block)
        self.blocks.sort(key=lambda b: b.start)
        return True

    def starts(self, place: str, minutes: int, window: Span, spans: Sequence[Span], *, step: int = 5) -> list[int]:
        """Return the starts within `window` at which `minutes` at `place` fit in the day and its opening hours.

        Walks are estimated here; `add` asks for the routes.
        """
        found: list[int] = []
        for before, after in zip([None, *self.blocks], [*self.blocks, None], strict=True):
            low, high = window
            if before is not None:
                if before.end >= high:
                    break
                low = max(low, before.end + self.index.estimate(before.place, place, self.pace))
            if after is not None:
                if min(high, after.start) - low < minutes:
                    continue
                high = min(high, after.start - self.index.estimate(place, after.place, self.pace))
            first = -(-low // step) * step
            found += [
                s for s in range(first, high - minutes + 1, step) if any(a <= s and s + minutes <= b for a, b in spans)
            ]
        return found

    def items(self) -> list[ScheduleItem]:
        """Return the schedule, walks put in. The blocks must leave no time but for the walks."""
        items: list[ScheduleItem] = []
        for before, block in zip([None, *self.blocks], self.blocks, strict=False):
            place = self.index.place_by_id[block.place]
            if before is not None and before.end < block.start:
                items.append(
                    ScheduleItem(
                        type=ItemType.COMMUTE,
                        tag=ActivityTag.COMMUTE,
                        start=clock_of(before.end * 60),
                        end=clock_of(block.start * 60),
                        activity="Walk home" if block.place == self.home else f"Walk to {place.name}",
                        place=None,
                        building=None,
                    )
                )
            items.append(
                ScheduleItem(
                    type=block.type,
                    tag=block.tag or self._tag(block),
                    start=clock_of(block.start * 60),
                    end=clock_of(block.end * 60),
                    activity=block.activity,
                    place=block.place,
                    building=place.building,
                )
            )
        return items

    def _tag(self, block: Block) -> ActivityTag:
        """Return what a block is about by its role in the plan."""
        if block.type is ItemType.MEAL:
            return ActivityTag.MEAL_HOME if block.place == self.home else ActivityTag.MEAL_OUT
        tags = {"sleep": ActivityTag.SLEEP, "work": ActivityTag.WORK, "group": ActivityTag.GROUP}
        return tags.get(block.role, ActivityTag.LEISURE)


#: Shorter stays at home than this aren't worth the way, minutes.
_WORTH_IT = 20
# In less time at home than this nothing is begun, minutes.
_BRIEF = 10
#: A stay of less after a meeting is spent on the way, minutes.
CHAT = 5
# More time than this is not walked in, minutes.
_DAWDLE = 8
#: Between which hours of the day hobbies are pursued at home.
_HOBBY_HOURS = (8, 23)


class Homelife:
    """Somebody's ways at home; gives activities, none twice a day while there are others.

    Parameters
    ----------
    done
        What they went out for today: those hobbies come last.

    Attributes
    ----------
    dinner_at
        When their household eats in the evening, minutes.
    """

    def __init__(self, rng: np.random.Generator, draft: ResidentDraft, done: Collection[str] = ()) -> None:
        self._rng = rng
        self._done = done
        self.dinner_at = 18 * 60 + 30
        if draft.child:
            self._as_child(draft)
            return
        guest = draft.status == "guest"
        ways = at_home()
        pastimes = ways.pastimes
        hobbies = self._hobbies(draft)
        hobbies += _inclinations(draft)
        extra = (
            pastimes.guest if guest else pastimes.old if draft.age >= 66 else pastimes.young if draft.age <= 35 else ()
        )
        common = [] if guest else [pastimes.chores[int(k)] for k in rng.permutation(len(pastimes.chores))]
        more = [extra[int(k)] for k in rng.permutation(len(extra))]
        # What they like comes first, shuffled with a little of the rest.
        first = [*hobbies, *more[:2], *common[:1]]
        self._leisure = [first[int(k)] for k in rng.permutation(len(first))] + more[2:] + common[1:]
        self.morning = self._one(ways.morning)
        self.breakfast = ways.guest_meals.breakfast if guest else self._one(ways.breakfast)
        self.lunch = ways.guest_meals.lunch if guest else self._one(ways.lunch)
        self.dinner = ways.guest_meals.dinner if guest else self._one(ways.dinner)
        self.wind_down = self._one(ways.wind_down)

    def _as_child(self, draft: ResidentDraft) -> None:
        ways = childhood()
        pastimes = ways.pastimes.small if draft.age < ALONE_FROM else ways.pastimes.big
        hobbies = self._hobbies(draft)
        hobbies += _inclinations(draft)
        others = [pastimes[int(k)] for k in self._rng.permutation(len(pastimes))]
        first = [*hobbies, *others[:2]]
        self._leisure = [first[int(k)] for k in self._rng.permutation(len(first))] + others[2:]
        home = ways.at_home
        self.morning, self.breakfast = self._one(home.morning), self._one(home.breakfast)
        self.lunch, self.dinner = self._one(home.lunch), self._one(home.dinner)
        self.wind_down = self._one(home.wind_down)

    def _hobbies(self, draft: ResidentDraft) -> list[Pastime]:
        likes = [h for h in draft.hobbies if h.at_home and h.out not in self._done]
        return [Pastime(text=h.at_home, hours=_HOBBY_HOURS) for h in likes]

    def _one(self, options: tuple[str, ...]) -> str:
        return options[int(self._rng.integers(len(options)))]

    def leisure(self, start: int, end: int) -> str:
        """Something to do at home from `start` to `end`, minutes; the first that suits the hour and isn't used up."""
        for k, pastime in enumerate(self._leisure):
            low, high = pastime.hours
            if low * 60 <= start and (end <= high * 60 or start + 30 <= high * 60):
                # To the end of the line: it comes again only when all else has.
                self._leisure.append(self._leisure.pop(k))
                return pastime.text
        return "Rest"

    def length(self, low: int, high: int) -> int:
        """Draw a length of time, multiple of five minutes."""
        return 5 * int(self._rng.integers(low // 5, high // 5 + 1))


def _inclinations(draft: ResidentDraft) -> list[Pastime]:
    """Return what somebody does at home for the sake of what matters to them."""
    ways = [one for one in inclinations().inclination if one.value in draft.values and not one.kinds]
    return [Pastime(text=w.activity, hours=w.hours) for w in ways if w.ages[0] <= draft.age <= w.ages[1]]


def fill_day(day: Day, life: Homelife) -> None:
    """Fill the gaps of a day: home where it is worth the way, else a longer stay; then meals and pastimes at home."""
    stays: list[tuple[int, int]] = []
    for before, after in pairwise(list(day.blocks)):
        walk = day.walk(before.place, after.place)
        assert walk is not None
        spare = after.start - before.end - walk
        if spare == 0:
            continue
        stay, come = _elsewhere(day, before, after, spare)
        at_home = day.home in (before.place, after.place)
        # As the crow flies is the least it can take: no need to ask for routes that can't be worth it.
        least = (day.index.metres(before.place, day.home) + day.index.metres(day.home, after.place)) / 60
        if not at_home and after.start - before.end - least < _WORTH_IT and spare - stay - come <= _DAWDLE:
            _stay_longer(day, before, after, (stay, come))
            continue
        out, back = day.walk(before.place, day.home), day.walk(day.home, after.place)
        assert out is not None
        assert back is not None
        start, end = before.end + out, after.start - back
        # From home or to home there is no detour: even minutes are spent there, and where nothing else is open.
        worth = 1 if at_home else _WORTH_IT if spare - stay - come <= _DAWDLE else 5
        if end - start >= worth:
            stays.append((start, end))
        else:
            _stay_longer(day, before, after, (stay, come))
    for start, end in stays:
        _at_home(day, life, start, end)
    day.blocks.sort(key=lambda b: b.start)


def _elsewhere(day: Day, before: Block, after: Block, minutes: int) -> tuple[int, int]:
    """Return how many of some minutes can be spent where one is, and where one goes, as long as these are open."""
    stay = max((end - before.end for start, end in day.open_spans(before.place) if start <= before.start), default=0)
    come = max((after.start - start for start, end in day.open_spans(after.place) if after.end <= end), default=0)
    if stay >= minutes:
        return minutes, 0
    if come >= minutes:
        return 0, minutes
    return max(0, stay), min(max(0, come), minutes - max(0, stay))


def _stay_longer(day: Day, before: Block, after: Block, minutes: tuple[int, int]) -> None:
    """Stay some minutes longer where one is, and come some earlier to where one goes; the rest is walked in."""
    stay, come = minutes
    if stay:
        _stay_on(day, before, stay)
    if come:
        text = "Wait and look around"
        start = after.start - come
        day.blocks.append(Block(start, after.start, ItemType.MAIN, text, after.place, "stay", ActivityTag.VISIT))


def _stay_on(day: Day, block: Block, minutes: int) -> None:
    """Stay some minutes longer."""
    text = {"work": "Finish up and put things away", "group": "Chat a little longer"}.get(block.role)
    if block.role == "group" and minutes < CHAT:
        return
    if text is None or (block.role == "work" and minutes < 10):
        block.end += minutes
        return
    tag = ActivityTag.GROUP if block.role == "group" else block.tag or ActivityTag.WORK
    day.blocks.append(Block(block.end, block.end + minutes, ItemType.MAIN, text, block.place, "stay", tag))


def _at_home(day: Day, life: Homelife, start: int, end: int) -> None:
    """Fill a stay at home with getting up, meals, and things to do."""
    morning = any(b.role == "sleep" and b.end == start for b in day.blocks)
    evening = any(b.start == end and (b.role == "sleep" or b.end == MIDNIGHT) for b in day.blocks)
    fixed: list[Block] = []

    def put(s: int, minutes: int, type: ItemType, text: str, role: str) -> None:
        fixed.append(Block(s, s + minutes, type, text, day.home, role))

    cursor, limit = start, end
    if morning and end - start >= 25:
        put(start, min(life.length(15, 25), (end - start) // 10 * 5), ItemType.MAIN, life.morning, "home")
        cursor = fixed[-1].end
    if not _has(day, 4 * 60, 11 * 60) and (morning or start < 9 * 60) and limit - cursor >= 10:
        put(cursor, min(life.length(20, 30), limit - cursor), ItemType.MEAL, life.breakfast, "breakfast")
        cursor = fixed[-1].end
    if evening and limit - cursor >= 30:
        minutes = life.length(20, 40)
        limit -= min(minutes, (limit - cursor) // 2 // 5 * 5)
        put(limit, end - limit, ItemType.MAIN, life.wind_down, "home")
    for at, early, late, text, role in (
        (12 * 60 + 10, 11 * 60 + 15, 14 * 60 + 15, life.lunch, "lunch"),
        (life.dinner_at, 17 * 60, 21 * 60 + 45, life.dinner, "dinner"),
    ):
        low, high = max(cursor, early), min(limit, late)
        if high - low >= 20 and not _has(day, early - 45, late):
            minutes = min(life.length(30, 45), high - low)
            s = min(max(low, at), high - minutes)
            # No slivers beside a meal.
            s = low if s - low < 10 else s
            put(s, minutes, ItemType.MEAL, text, role)
    fixed.sort(key=lambda b: b.start)
    edges = [start, *(t for b in fixed for t in (b.start, b.end)), end]
    for s, e in zip(edges[::2], edges[1::2], strict=True):
        if e - s < 10 and fixed:
            _stretch(fixed, s, e)
            continue
        if e <= s:
            continue
        pieces = max(1, round((e - s) / 75))
        cuts = [s, *(s + 5 * round((e - s) * k / pieces / 5) for k in range(1, pieces)), e]
        for a, b in pairwise(cuts):
            text = at_home().brief if b - a < _BRIEF else life.leisure(a, b)
            day.blocks.append(Block(a, b, ItemType.MAIN, text, day.home, "home"))
    day.blocks.extend(fixed)


def _stretch(fixed: list[Block], start: int, end: int) -> None:
    """Give a sliver of time to the block beside it."""
    for block in fixed:
        if block.end == start:
            block.end = end
            return
        if block.start == end:
            block.start = start
            return


def _has(day: Day, low: int, high: int) -> bool:
    return any(b.type is ItemType.MEAL and low <= b.start < high for b in day.blocks)


# Whereabouts are looked at every so many seconds, in the middle of each stretch.
_STEP = 300
_DINNER = "17:00:00"
_NOT_LEISURE = (ActivityTag.WORK, ActivityTag.STUDY, ActivityTag.SLEEP, ActivityTag.COMMUTE)


@dataclass(frozen=True)
class DayMeasures:
    """Measures of somebody's days, means over the days.

    Attributes
    ----------
    out
        Hours away from home but for work, lessons and ways.
    work
        Hours of work and lessons.
    company
        Waking hours, but for work and lessons, at one place with somebody they know; at home only with visitors.
    alone
        Waking hours, but for work, lessons and ways, at a place where nobody they know is.
    exercise
        Hours of exercise, on the way by foot or by bicycle, and of walks: tags ``exercise`` and ``commute``.
    meals_out, dinners_out, meals_home
        Meals away from home, those of the evening, and meals at home.
    rides
        Ways by bus, tram or bicycle.
    visiting
        Hours at homes of others.
    rises, retires
        Hour of the day at which they rise, and lie down; 24 for those who are up at midnight.
    """

    out: float
    work: float
    company: float
    alone: float
    exercise: float
    meals_out: float
    dinners_out: float
    meals_home: float
    rides: float
    visiting: float
    rises: float
    retires: float

    def holds(self, claim: Claim) -> bool:
        """Whether what a claim says is so."""
        value = float(getattr(self, claim.measure))
        return (claim.least is None or value >= claim.least) and (claim.most is None or value <= claim.most)


def day_measures(community: Community) -> dict[str, DayMeasures]:
    """Measure the days of everybody, by resident id."""
    days = [{r.id: r.schedule for r in community.residents}, *(day.schedules for day in community.further_days)]
    pairs, at_home = _acquaintances(community)
    together = [_hours_in_company(community.residents, schedules, pairs, at_home) for schedules in days]
    homes = {resident.home for resident in community.residents}
    found = {}
    for k, resident in enumerate(community.residents):
        each = [_of_day(resident, schedules[resident.id], homes) for schedules in days]
        hours = {name: float(np.mean([one[name] for one in each])) for name in each[0]}
        company, alone = np.mean([(known[k], by_self[k]) for known, by_self in together], axis=0).tolist()
        found[resident.id] = DayMeasures(company=company, alone=alone, **hours)
    return found


def character_findings(community: Community) -> list[CommunityFinding]:
    """Find words for people's character that their days contradict: a "homebody" who is out all evening.

    Looks for the words of ``claims`` in ``character.toml`` among traits and in the lifestyle.
    """
    measures = day_measures(community)
    found = []
    for resident in community.residents:
        # A lifestyle has phrases: "Night owl; stays fit and likes a tidy flat."
        rhythm, _, ways = resident.lifestyle.rstrip(".").partition("; ")
        said = [*resident.personality.traits, rhythm, *ways.replace(" and ", ", ").split(", ")]
        for claim in claims():
            for words in said:
                if words in claim.says and not measures[resident.id].holds(claim):
                    value = getattr(measures[resident.id], claim.measure)
                    what = f"{resident.name} is said to be or to live so: {words!r}, but {claim.measure} is {value:.2f}"
                    found.append(CommunityFinding(f"{resident.id}.lifestyle", what, "write what their days show"))
    return found


def agrees(words: str, measures: DayMeasures) -> bool:
    """Whether somebody's days agree with a word or phrase for them; they do where nothing is claimed."""
    return all(measures.holds(claim) for claim in claims() if words in claim.says)


def _of_day(resident: Resident, items: Sequence[ScheduleItem], homes: Collection[str]) -> dict[str, float]:
    sleep = [item for item in items if item.type is ItemType.SLEEP]
    meals = [item for item in items if item.type is ItemType.MEAL]
    away = [item for item in items if item.place not in (None, resident.home)]
    last = max((item for item in sleep if item.start > "12:00:00"), key=lambda item: item.start, default=None)
    return {
        "out": sum(_hours(i) for i in away if i.tag not in _NOT_LEISURE),
        "work": sum(_hours(i) for i in items if i.tag in (ActivityTag.WORK, ActivityTag.STUDY)),
        "exercise": sum(
            _hours(i)
            for i in items
            if i.tag is ActivityTag.EXERCISE or (i.type is ItemType.COMMUTE and i.mode in (None, Mode.WALK, Mode.BIKE))
        ),
        "meals_out": sum(i.place != resident.home for i in meals),
        "dinners_out": sum(i.place != resident.home and i.start >= _DINNER for i in meals),
        "meals_home": sum(i.place == resident.home for i in meals),
        "rides": sum(i.mode not in (None, Mode.WALK) for i in items),
        "visiting": sum(_hours(i) for i in away if i.place in homes and i.tag not in _NOT_LEISURE),
        "rises": min(seconds_of_day(i.end) for i in sleep) / 3600 if sleep else 0.0,
        "retires": 24.0 if last is None else seconds_of_day(last.start) / 3600,
    }


def _hours(item: ScheduleItem) -> float:
    return (seconds_of_day(item.end) - seconds_of_day(item.start)) / 3600


def _acquaintances(community: Community) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return the pairs of people who know each other, as rows of two numbers, and whether they share a home."""
    row = {r.id: k for k, r in enumerate(community.residents)}
    pairs = {tuple(sorted((row[a], row[b]))) for a, b in (r.between for r in community.relations)}
    homes: dict[str, list[int]] = {}
    for resident in community.residents:
        homes.setdefault(resident.household or resident.id, []).append(row[resident.id])
    for members in [*([row[m] for m in group.members] for group in community.groups), *homes.values()]:
        pairs |= {tuple(sorted(pair)) for pair in combinations(members, 2)}
    known = np.array(sorted(pairs), np.int64).reshape(-1, 2)
    number: dict[str, int] = {}
    houses = [number.setdefault(r.household or r.id, len(number)) for r in community.residents]
    house = np.array(houses, np.int64)
    return known, house[known[:, 0]] == house[known[:, 1]]


def _hours_in_company(
    residents: Sequence[Resident],
    schedules: Mapping[str, Sequence[ScheduleItem]],
    pairs: NDArray[np.int64],
    share_home: NDArray[np.bool_],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the hours that each is in company, and alone, on one day; shape ``(people,)`` each."""
    number: dict[str, int] = {}
    steps = DAY // _STEP
    where = np.full((len(residents), steps), -1, np.int64)
    at_home = np.zeros((len(residents), steps), bool)
    for k, resident in enumerate(residents):
        for item in schedules[resident.id]:
            if item.place is None or item.tag in _NOT_LEISURE:
                continue
            first = (seconds_of_day(item.start) + _STEP // 2) // _STEP
            last = (seconds_of_day(item.end) + _STEP // 2) // _STEP
            where[k, first:last] = number.setdefault(item.place, len(number))
            at_home[k, first:last] = item.place == resident.home
    a, b = pairs.T
    both_in = at_home[a] & at_home[b]
    # Two households of one house are each in a flat of their own.
    meet = (where[a] == where[b]) & (where[a] >= 0) & (share_home[:, None] | ~both_in)
    known = np.zeros_like(at_home)
    np.logical_or.at(known, a, meet)
    np.logical_or.at(known, b, meet)
    outside = meet & ~both_in
    company = np.zeros_like(at_home)
    np.logical_or.at(company, a, outside)
    np.logical_or.at(company, b, outside)
    alone = (where >= 0) & ~known
    hours = _STEP / 3600
    return company.sum(axis=1) * hours, alone.sum(axis=1) * hours
