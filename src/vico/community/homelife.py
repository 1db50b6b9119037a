"""What people do at home, and how the gaps of a day are filled: nobody's day has holes."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from vico.community.day import MIDNIGHT, Block, Day
from vico.community.model import ItemType
from vico.community.people import Sketch

#: Shorter stays at home than this aren't worth the way, minutes.
_WORTH_IT = 20

_MORNING = (
    "Get up, wash and dress",
    "Shower and get dressed",
    "Get up, stretch and dress",
    "Wash, dress and air the rooms",
)
_BREAKFAST = (
    "Have porridge and coffee", "Have bread, cheese and tea", "Have a bowl of muesli", "Have eggs on toast and coffee",
    "Have yoghurt with berries", "Have breakfast over the radio news", "Have coffee and a roll",
)  # fmt: skip
_LUNCH = (
    "Have soup and bread",
    "Have leftovers for lunch",
    "Have a salad and an omelette",
    "Have a sandwich for lunch",
)
_DINNER = (
    "Cook and eat pasta", "Cook and eat a vegetable curry", "Make and eat fish with potatoes",
    "Make and eat a big salad",
    "Cook and eat a lentil stew", "Make and eat dumplings", "Cook and eat risotto", "Make and eat a gratin",
)  # fmt: skip
# Activity, and the hours of the day in which it is done.
Pastime = tuple[str, int, int]
_CHORES: tuple[Pastime, ...] = (
    ("Do the laundry and tidy up", 7, 21), ("Clean the kitchen", 7, 22), ("Pay bills and answer mail", 7, 21),
    ("Call an old friend", 10, 21), ("Listen to the radio", 4, 24), ("Iron and listen to a podcast", 7, 22),
    ("Read the newspaper", 5, 12), ("Sort out the wardrobe", 9, 20), ("Vacuum and dust the shelves", 9, 20),
    ("Watch a documentary", 17, 24), ("Put the feet up with music on", 12, 24), ("Call the family", 10, 21),
    ("Look through holiday plans", 15, 24), ("Mend a shirt", 9, 22), ("Water the plants and sit by the window", 5, 20),
    ("Read the news over another coffee", 6, 11), ("Plan the week's meals", 8, 20), ("Watch the evening news", 18, 23),
    ("Sit on the balcony with a book", 9, 21), ("Cook ahead for the week", 9, 20), ("Clean the windows", 9, 18),
)  # fmt: skip
_YOUNG: tuple[Pastime, ...] = (
    ("Chat with friends online", 14, 24), ("Watch a series", 17, 24), ("Scroll through the news", 6, 12),
    ("Listen to a new album", 8, 24), ("Make a playlist", 10, 23),
)  # fmt: skip
_OLD: tuple[Pastime, ...] = (
    ("Take a nap", 13, 16), ("Leaf through photo albums", 10, 20), ("Listen to a concert on the radio", 14, 22),
    ("Sort old letters", 9, 18), ("Solve a number puzzle", 7, 20), ("Write down a recipe from memory", 9, 18),
)  # fmt: skip
_GUEST: tuple[Pastime, ...] = (
    ("Answer mail in the room", 7, 22), ("Rest in the room", 12, 22), ("Read about the city", 7, 24),
    ("Call home", 9, 22), ("Wash out a shirt", 7, 22), ("Read in the lobby", 7, 22), ("Pack and repack the bag", 8, 22),
)  # fmt: skip
_WIND_DOWN = (
    "Read in bed", "Take a bath and get ready for bed", "Tidy up and get ready for bed",
    "Have tea and get ready for bed",
    "Write a diary and get ready for bed", "Lay out tomorrow's clothes and get ready for bed",
)  # fmt: skip


class Homelife:
    """Somebody's ways at home; gives activities, none twice a day while there are others.

    Attributes
    ----------
    dinner_at
        When their household eats in the evening, minutes.
    """

    def __init__(self, rng: np.random.Generator, sketch: Sketch) -> None:
        self._rng = rng
        self.dinner_at = 18 * 60 + 30
        guest = sketch.status == "guest"
        hobbies: list[Pastime] = [(h.at_home, 8, 23) for h in sketch.hobbies if h.at_home]
        extra = _GUEST if guest else _OLD if sketch.age >= 66 else _YOUNG if sketch.age <= 35 else ()
        common = [] if guest else [_CHORES[int(k)] for k in rng.permutation(len(_CHORES))]
        more = [extra[int(k)] for k in rng.permutation(len(extra))]
        # What they like comes first, shuffled with a little of the rest.
        first = [*hobbies, *more[:2], *common[:1]]
        self._leisure = [first[int(k)] for k in rng.permutation(len(first))] + more[2:] + common[1:]
        self.morning = self._one(_MORNING)
        self.breakfast = "Have breakfast in the breakfast room" if guest else self._one(_BREAKFAST)
        self.lunch = "Have a sandwich in the room" if guest else self._one(_LUNCH)
        self.dinner = "Have a light supper" if guest else self._one(_DINNER)
        self.wind_down = self._one(_WIND_DOWN)

    def _one(self, options: tuple[str, ...]) -> str:
        return options[int(self._rng.integers(len(options)))]

    def leisure(self, start: int, end: int) -> str:
        """Something to do at home from `start` to `end`, minutes; the first that suits the hour and isn't used up."""
        for k, (text, low, high) in enumerate(self._leisure):
            if low * 60 <= start and (end <= high * 60 or start + 30 <= high * 60):
                # To the end of the line: it comes again only when all else has.
                self._leisure.append(self._leisure.pop(k))
                return text
        return "Rest"

    def length(self, low: int, high: int) -> int:
        """A length of time, multiple of five minutes."""
        return 5 * int(self._rng.integers(low // 5, high // 5 + 1))


def fill_day(day: Day, life: Homelife) -> None:
    """Fill the gaps of a day: home where it is worth the way, else a longer stay; then meals and pastimes at home."""
    stays: list[tuple[int, int]] = []
    for before, after in pairwise(list(day.blocks)):
        walk = day.walk(before.place, after.place)
        assert walk is not None
        if after.start - before.end == walk:
            continue
        # As the crow flies is the least it can take: no need to ask for routes that can't be worth it.
        least = (day.ground.metres(before.place, day.home) + day.ground.metres(day.home, after.place)) / 60
        if day.home not in (before.place, after.place) and after.start - before.end - least < _WORTH_IT:
            _stay_longer(day, before, after, after.start - before.end - walk)
            continue
        out, back = day.walk(before.place, day.home), day.walk(day.home, after.place)
        assert out is not None
        assert back is not None
        start, end = before.end + out, after.start - back
        # From home or to home there is no detour: even five minutes are spent there.
        if end - start >= (5 if 0 in (out, back) else _WORTH_IT) or (0 in (out, back) and end > start):
            stays.append((start, end))
        else:
            _stay_longer(day, before, after, after.start - before.end - walk)
    for start, end in stays:
        _at_home(day, life, start, end)
    day.blocks.sort(key=lambda b: b.start)


def _stay_longer(day: Day, before: Block, after: Block, minutes: int) -> None:
    """Spend minutes that are too few to go home for where one is, or, if that closes, where one goes."""
    ground = day.ground
    closes = any(
        a <= before.start and before.end + minutes <= b for a, b in ground.hours(ground.place_by_id[before.place])
    )
    opened = any(
        a <= after.start - minutes and after.end <= b for a, b in ground.hours(ground.place_by_id[after.place])
    )
    if before.tag == "work" or closes or not opened:
        text = {"work": "Finish up and put things away", "group": "Stay on and chat"}.get(before.tag)
        if before.tag == "group" or (text and minutes >= 10):
            assert text is not None
            day.blocks.append(Block(before.end, before.end + minutes, ItemType.MAIN, text, before.place, "stay"))
        else:
            before.end += minutes
    else:
        day.blocks.append(
            Block(
                after.start - minutes, after.start, ItemType.MAIN, "Arrive early and look around", after.place, "stay"
            )
        )


def _at_home(day: Day, life: Homelife, start: int, end: int) -> None:
    """Fill a stay at home with getting up, meals, and things to do."""
    morning = any(b.tag == "sleep" and b.end == start for b in day.blocks)
    evening = any(b.start == end and (b.tag == "sleep" or b.end == MIDNIGHT) for b in day.blocks)
    fixed: list[Block] = []

    def put(s: int, minutes: int, type: ItemType, text: str, tag: str) -> None:
        fixed.append(Block(s, s + minutes, type, text, day.home, tag))

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
    for at, early, late, text, tag in (
        (12 * 60 + 10, 11 * 60 + 15, 14 * 60 + 15, life.lunch, "lunch"),
        (life.dinner_at, 17 * 60, 21 * 60 + 45, life.dinner, "dinner"),
    ):
        low, high = max(cursor, early), min(limit, late)
        if high - low >= 20 and not _has(day, early - 45, late):
            minutes = min(life.length(30, 45), high - low)
            s = min(max(low, at), high - minutes)
            # No slivers beside a meal.
            s = low if s - low < 10 else s
            put(s, minutes, ItemType.MEAL, text, tag)
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
            day.blocks.append(Block(a, b, ItemType.MAIN, life.leisure(a, b), day.home, "home"))
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
