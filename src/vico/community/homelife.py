"""What people do at home, and how the gaps of a day are filled: nobody's day has holes."""

from __future__ import annotations

from collections.abc import Collection
from itertools import pairwise

import numpy as np

from vico.community.catalogue import Pastime, at_home
from vico.community.childhood import ALONE_FROM, childhood
from vico.community.day import MIDNIGHT, Block, Day
from vico.community.inclinations import inclinations
from vico.community.model import ActivityTag, ItemType
from vico.community.people import ResidentDraft

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
