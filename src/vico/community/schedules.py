"""Everybody's day: sleep, work, meetings, meals and outings, then home life in what is left."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from vico.community.catalogue import errands, kind_sets, ways_of_life
from vico.community.day import MIDNIGHT, Block, Day
from vico.community.groups import Meeting, meetings_by_member
from vico.community.homelife import Homelife, fill_day
from vico.community.model import ActivityTag, ItemType, ScheduleItem
from vico.community.people import Household, ResidentDraft
from vico.community.place_index import PlaceIndex, kind_of
from vico.world.model import Category, Place

# Roles of blocks that are meals.
_MEALS = ("breakfast", "lunch", "dinner")

Companions = Sequence[tuple[ResidentDraft, Day]]


@dataclass(frozen=True)
class Outing:
    """Something to go out for.

    Attributes
    ----------
    activity
        What it is, in words; may hang on the place.
    kinds
        Kinds of places for it, best first.
    minutes
        Least and most it takes.
    role, tag
        As in `Block`.
    """

    activity: str | Callable[[Place], str]
    kinds: Iterable[str]
    minutes: tuple[int, int]
    role: str = "outing"
    tag: ActivityTag | None = None


class DayWriter:
    """Writes the days of a community, so that people who do something together do it at the same time.

    Parameters
    ----------
    rng
        Decides what is left open.
    index
        Places, walks and hours.
    """

    def __init__(self, rng: np.random.Generator, index: PlaceIndex) -> None:
        self._rng = rng
        self._index = index
        self._visits: Counter[str] = Counter()
        self._kinds, self._errands, self._outings_to = kind_sets(), errands().errands, errands().kinds
        public = [c for c in Category if c not in (Category.ACCOMMODATION, Category.TRANSIT)]
        self._by_kind: dict[str, list[Place]] = {}
        for place in index.places(public):
            self._by_kind.setdefault(kind_of(place), []).append(place)

    def write(
        self, households: Sequence[Household], groups: Sequence[Meeting]
    ) -> tuple[dict[str, list[ScheduleItem]], dict[str, list[str]]]:
        """Write everybody's schedule.

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
        for household in households:
            self._together([(m, days[m.id]) for m in household.members], household.kind)
        for draft in people:
            self._outings(draft, days[draft.id])
        lives = {s.id: Homelife(self._rng, s) for s in people}
        for household in households:
            # People under one roof eat at the same time, when both are in.
            dinner = 5 * int(self._rng.integers(210, 236))
            for member in household.members:
                lives[member.id].dinner_at = dinner
                fill_day(days[member.id], lives[member.id])
            _eat_together([(m, days[m.id]) for m in household.members])
        frequented = {i: list(dict.fromkeys(b.place for b in day.blocks)) for i, day in days.items()}
        return {i: day.items() for i, day in days.items()}, frequented

    # What is fixed: sleep, work with its break, groups.

    def _frame(self, draft: ResidentDraft, groups: Sequence[Meeting]) -> Day:
        rng, day = self._rng, Day(self._index, draft.home, draft.workplace)
        lunch_group = None
        for group in groups:
            kind = ItemType.MEAL if group.circle.meal else ItemType.MAIN
            text = f"{group.circle.name}: {_lower(group.circle.activity)}"
            self._put(day, Block(group.start, group.end, kind, text, group.place.id, "group", group.circle.tag))
            if draft.shift and draft.shift[0] < group.start and group.end < draft.shift[1]:
                lunch_group = day.blocks[-1]
        if draft.shift is not None:
            self._work(draft, day, lunch_group)
        first, last = day.blocks[0], day.blocks[-1]
        lead = day.walk(draft.home, first.place) or 0
        if draft.status == "retired":
            natural, sleep = 360 + 90 * (1 - draft.early), 470
        elif draft.status == "student":
            natural, sleep = 430 + 90 * (1 - draft.early), 480
        elif draft.shift is not None and draft.shift[0] >= 12 * 60:
            natural, sleep = 450 + 110 * (1 - draft.early), 480
        else:
            natural, sleep = 380 + 120 * (1 - draft.early), 455
        prepare = 5 * int(rng.integers(9, 16))
        wake = int(min(natural, first.start - lead - prepare) // 5 * 5)
        bed = _round(wake + MIDNIGHT - sleep - float(rng.integers(0, 45)))
        home = (day.walk(last.place, draft.home) or 0) + last.end
        bed = max(bed, _round(home + 40 + float(rng.integers(0, 25))))
        if bed >= MIDNIGHT - 10:
            # Up past midnight: the end of such an evening is also how the day began.
            over = max(10, bed - MIDNIGHT)
            wake = max(wake, min(over + 360, first.start - lead - 35)) // 5 * 5
            self._put(day, Block(0, over, ItemType.MAIN, "Wind down after a long evening", draft.home, "home"))
            self._put(day, Block(over, wake, ItemType.SLEEP, "Sleep", draft.home, "sleep"))
            self._put(
                day, Block(MIDNIGHT - 5, MIDNIGHT, ItemType.MAIN, "Lie in bed and read a page", draft.home, "home")
            )
        else:
            self._put(day, Block(0, wake, ItemType.SLEEP, "Sleep", draft.home, "sleep"))
            self._put(day, Block(bed, MIDNIGHT, ItemType.SLEEP, "Sleep", draft.home, "sleep"))
        return day

    def _put(self, day: Day, block: Block) -> None:
        if not day.add(block):
            raise ValueError(f"{block} does not fit between {day.blocks}")
        self._visits[block.place] += 1

    def _work(self, draft: ResidentDraft, day: Day, lunch_group: Block | None) -> None:
        rng, index, place = self._rng, self._index, draft.workplace
        assert draft.shift is not None
        assert place is not None
        start, end = draft.shift
        tag = ActivityTag.STUDY if draft.status == "student" else ActivityTag.WORK
        if draft.status == "student":
            first, second = f"Attend lectures in {draft.subject}", f"Work on {draft.subject} exercises"
            if kind_of(index.place_by_id[place]) == "library":
                first, second = f"Study {draft.subject}", f"Write on a {draft.subject} paper"
        else:
            assert draft.job is not None
            first = second = draft.job.task
            if draft.job.shift in ("office", "bank"):
                first = f"Answer the morning's mail, then {_lower(first)}"
            elif (
                index.place_by_id[place].category != Category.OFFICE
                and start < min(index.hours(index.place_by_id[place]))[0]
            ):
                first = f"Open up, then {_lower(first)}"
        if lunch_group is not None:
            there, back = day.walk(place, lunch_group.place), day.walk(lunch_group.place, place)
            assert there is not None
            assert back is not None
            out, again = lunch_group.start - there, lunch_group.end + back
            self._put(day, Block(start, out, ItemType.MAIN, first, place, "work", tag))
            self._put(day, Block(again, end, ItemType.MAIN, second, place, "work", tag))
            return
        if end - start < 5 * 60:
            self._put(day, Block(start, end, ItemType.MAIN, first, place, "work", tag))
            return
        late = start >= 12 * 60
        middle = (start + end) / 2 + 20
        noon = _round(
            np.clip(middle, 17 * 60, 19 * 60) if late else np.clip(rng.normal(12 * 60 + 10, 20), 11 * 60, 13 * 60)
        )
        noon = int(np.clip(noon, start + 90, end - 120))
        at_home_there = draft.job is not None and draft.job.shift in ("kitchen", "early", "health", "school", "hotel")
        if not late and (draft.status == "student" or not at_home_there) and rng.random() < 0.6:
            for eatery in self._near(place, self._outings_to.lunch, within=260.0):
                there, back = day.walk(place, eatery.id), day.walk(eatery.id, place)
                sit = 5 * int(rng.integers(5, 9))
                if there is None or back is None or there > 5 or eatery.id == place:
                    continue
                s = noon + there
                if any(a <= s and s + sit <= b for a, b in index.hours(eatery)):
                    text = "Have a quick lunch" if kind_of(eatery) == "fast_food" else "Have lunch"
                    self._put(day, Block(start, noon, ItemType.MAIN, first, place, "work", tag))
                    self._put(day, Block(s, s + sit, ItemType.MEAL, text, eatery.id, "lunch"))
                    self._put(day, Block(s + sit + back, end, ItemType.MAIN, second, place, "work", tag))
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
        self._put(day, Block(start, noon, ItemType.MAIN, first, place, "work", tag))
        self._put(day, Block(noon, noon + pause, ItemType.MEAL, text, place, "dinner" if late else "lunch"))
        self._put(day, Block(noon + pause, end, ItemType.MAIN, second, place, "work", tag))

    # What people choose: outings together, then alone.

    def _near(self, anchor: str, kinds: Iterable[str], within: float = 700.0) -> list[Place]:
        """Return at most six places of some kinds, drawn by nearness to `anchor` and by how few were there today."""
        found = [p for k in dict.fromkeys(kinds) for p in self._by_kind.get(k, ()) if p.id != anchor]
        metres = np.array([self._index.metres(anchor, p.id) for p in found])
        keep = [k for k in range(len(found)) if metres[k] <= within]
        if not keep:
            return []
        sizes = Counter(kind_of(found[k]) for k in keep)
        weights = np.array(
            [
                np.exp(-metres[k] / 220) * 0.5 ** self._visits[found[k].id] / sizes[kind_of(found[k])] ** 0.5
                for k in keep
            ]
        )
        picks = self._rng.choice(len(keep), min(6, len(keep)), replace=False, p=weights / weights.sum())
        return [found[keep[int(k)]] for k in picks]

    def _together(self, members: Companions, kind: str) -> None:
        """Let those who share a home do something together, if their days allow."""
        if len(members) < 2 or kind == "guest":
            return
        rng = self._rng
        (a, first), (b, _) = members[0], members[1]
        plans: list[tuple[str, ItemType, tuple[str, ...], int, tuple[int, int], str]] = []
        if kind == "couple" and a.status == b.status == "retired":
            plans.append(
                (
                    "Take a walk",
                    ItemType.MAIN,
                    self._kinds["green"],
                    5 * int(rng.integers(7, 13)),
                    (540, 1020),
                    "outing",
                )
            )
        if kind == "couple" and rng.random() < 0.5:
            plans.append(
                (
                    "Have dinner",
                    ItemType.MEAL,
                    self._outings_to.dinner[:2],
                    5 * int(rng.integers(11, 17)),
                    (1050, 1290),
                    "dinner",
                )
            )
        if kind in ("flatmates", "siblings") and rng.random() < 0.5:
            plans.append(("Have a drink", ItemType.MAIN, ("pub", "bar", "cafe"), 60, (1050, 1320), "outing"))
        if kind == "parent" and rng.random() < 0.7:
            plans.append(("Have dinner", ItemType.MEAL, self._outings_to.dinner[:2], 60, (1050, 1260), "dinner"))
        for text, item, kinds, minutes, window, role in plans:
            if role == "dinner" and any(_dines(day) for _, day in members[:2]):
                continue
            for place in self._near(a.home, kinds)[:4]:
                spans = self._index.hours(place)
                common = set(first.starts(place.id, minutes, window, spans))
                for _, other in members[1:2]:
                    common &= set(other.starts(place.id, minutes, window, spans))
                if not common:
                    continue
                start = sorted(common)[int(rng.integers(len(common)))]
                if all(day.fits(start, start + minutes, place.id) for _, day in members[:2]):
                    for me, day in members[:2]:
                        partner = b if me is a else a
                        self._put(
                            day, Block(start, start + minutes, item, f"{text} with {partner.first}", place.id, role)
                        )
                    break

    def _go(
        self, day: Day, outing: Outing, window: tuple[int, int], *, anchor: str | None = None, soon: bool = False
    ) -> bool:
        """Add an outing where it fits in the window, minutes; `soon`: as early as possible."""
        low, high = outing.minutes
        for place in self._near(anchor or day.home, outing.kinds)[:4]:
            if place.id in {b.place for b in day.blocks}:
                continue
            length = 5 * int(self._rng.integers(low // 5, high // 5 + 1))
            starts = day.starts(place.id, length, window, self._index.hours(place))
            if starts:
                start = starts[0] if soon else starts[int(self._rng.integers(len(starts)))]
                words = outing.activity if isinstance(outing.activity, str) else outing.activity(place)
                kind = ItemType.MEAL if outing.role in _MEALS else ItemType.MAIN
                if day.add(Block(start, start + length, kind, words, place.id, outing.role, outing.tag)):
                    self._visits[place.id] += 1
                    return True
        return False

    def _outings(self, draft: ResidentDraft, day: Day) -> None:
        rng = self._rng
        wake = next(b for b in day.blocks if b.role == "sleep").end
        leave = min((b.start for b in day.blocks if b.role in ("work", "group")), default=11 * 60)
        work = draft.workplace or day.home
        done = draft.shift[1] if draft.shift and draft.shift[0] < 12 * 60 else 15 * 60
        breakfasts_in_company = any(b.type is ItemType.MEAL and b.start < 12 * 60 for b in day.blocks)
        if rng.random() < (0.6 if draft.status == "guest" else 0.3) and not breakfasts_in_company:
            self._go(
                day,
                Outing("Have breakfast", self._kinds["cafes"][:3], (20, 30), role="breakfast"),
                (wake + 20, min(leave, wake + 150)),
                anchor=work,
            )
        elif leave >= 9 * 60 + 10 and wake <= 7 * 60 + 50 and rng.random() < 0.9:
            self._before_the_day(day, (max(wake + 30, 7 * 60 + 55), min(leave, 8 * 60 + 55)))
        {"retired": self._retired, "freelancer": self._freelancer, "guest": self._guest}.get(
            draft.status, self._after_work
        )(draft, day, wake, done)

    def _before_the_day(self, day: Day, window: tuple[int, int]) -> None:
        """Let those who have an hour in the morning go out for bread or air."""
        if self._rng.random() < 0.5 and self._go(
            day,
            Outing(
                "Fetch fresh bread", ("bakery", "convenience", "supermarket", "kiosk"), (5, 10), tag=ActivityTag.SHOP
            ),
            window,
            soon=True,
        ):
            return
        self._go(day, Outing("Take a turn in the fresh air", self._kinds["green"], (15, 25)), window, soon=True)

    def _hobby(self, draft: ResidentDraft, day: Day, window: tuple[int, int]) -> bool:
        for k in self._rng.permutation(len(draft.hobbies)):
            hobby = draft.hobbies[int(k)]
            if not hobby.out:
                continue
            minutes = (115, 130) if "cinema" in hobby.kinds or "theatre" in hobby.kinds else (45, 85)
            if self._go(day, Outing(hobby.out, hobby.kinds, minutes, tag=hobby.about), window):
                return True
        return False

    def _errand(self, day: Day, window: tuple[int, int], *, soon: bool = False) -> bool:
        kinds = list(self._errands)
        chosen = [kinds[int(k)] for k in self._rng.choice(len(kinds), 4, replace=False)]
        return any(
            self._go(
                day,
                Outing(
                    self._errands[kind], (kind,), (30, 45) if kind == "hairdresser" else (10, 20), tag=ActivityTag.SHOP
                ),
                window,
                soon=soon,
            )
            for kind in chosen
        )

    def _after_work(self, draft: ResidentDraft, day: Day, wake: int, done: int) -> None:
        rng, work = self._rng, draft.workplace or day.home
        late = draft.shift is not None and draft.shift[0] >= 12 * 60
        free = (wake + 60, draft.shift[0]) if late and draft.shift else (done, 21 * 60 + 30)
        if rng.random() < 0.6:
            self._hobby(draft, day, free)
        if rng.random() < 0.45:
            self._go(
                day,
                Outing("Buy groceries", self._outings_to.groceries, (10, 25), tag=ActivityTag.SHOP),
                free,
                anchor=work,
                soon=True,
            )
        elif rng.random() < 0.5:
            self._errand(day, free, soon=True)
        if not late and not _dines(day) and rng.random() < 0.2:
            self._go(
                day,
                Outing("Have dinner", self._outings_to.dinner, (40, 60), role="dinner"),
                (17 * 60 + 15, 20 * 60 + 30),
            )

    def _retired(self, draft: ResidentDraft, day: Day, wake: int, done: int) -> None:
        rng = self._rng
        if rng.random() < 0.75:
            early = max(wake + 50, 7 * 60 + 50)
            self._go(
                day, Outing("Take the morning walk", self._kinds["green"], (25, 40)), (early, 9 * 60 + 15), soon=True
            )
        if rng.random() < 0.7:
            self._go(
                day,
                Outing("Do the day's shopping", self._outings_to.groceries, (20, 35), tag=ActivityTag.SHOP),
                (8 * 60 + 30, 12 * 60),
            )
        if rng.random() < 0.4:
            self._go(
                day, Outing("Have lunch", self._outings_to.lunch[:1], (45, 60), role="lunch"), (11 * 60 + 30, 14 * 60)
            )
        self._hobby(draft, day, (13 * 60, 17 * 60 + 30))
        if rng.random() < 0.6:
            self._errand(day, (9 * 60 + 30, 16 * 60))

    def _freelancer(self, draft: ResidentDraft, day: Day, wake: int, done: int) -> None:
        rng = self._rng
        desk, cafe = next((f.at_desk, f.at_cafe) for f in ways_of_life().freelancer if f.title == draft.occupation)
        self._go(
            day,
            Outing(cafe, (*self._kinds["cafes"], "library", "coworking_space"), (75, 110), role="work"),
            (9 * 60 + 30, 16 * 60),
        )
        start = _round(wake + 75 + float(rng.integers(0, 40)))
        for window in ((start, 12 * 60 + 15), (13 * 60, 17 * 60 + 30)):
            for minutes in (150, 120, 90, 60):
                starts = day.starts(day.home, minutes, window, [(0, MIDNIGHT)])
                block = Block(starts[0], starts[0] + minutes, ItemType.MAIN, desk, day.home, "work") if starts else None
                if block is not None and day.add(block):
                    break
        if rng.random() < 0.5:
            self._go(day, Outing("Have lunch", self._outings_to.lunch, (30, 45), role="lunch"), (11 * 60 + 30, 14 * 60))
        if rng.random() < 0.6:
            self._hobby(draft, day, (16 * 60, 21 * 60 + 30))
        if rng.random() < 0.6:
            self._go(
                day,
                Outing("Buy groceries", self._outings_to.groceries, (15, 25), tag=ActivityTag.SHOP),
                (15 * 60, 20 * 60),
            )
        else:
            self._errand(day, (9 * 60, 18 * 60))

    def _guest(self, draft: ResidentDraft, day: Day, wake: int, done: int) -> None:
        rng = self._rng
        desk = next(g.activity for g in ways_of_life().guest if g.title == draft.occupation)
        starts = day.starts(day.home, 90, (wake + 60, 12 * 60), [(0, MIDNIGHT)]) or day.starts(
            day.home, 60, (14 * 60, 19 * 60), [(0, MIDNIGHT)]
        )
        if starts:
            length = 90 if starts[0] < 12 * 60 else 60
            day.add(Block(starts[0], starts[0] + length, ItemType.MAIN, desk, day.home, "work"))
        self._go(day, Outing("Have lunch", self._outings_to.lunch[:1], (40, 60), role="lunch"), (11 * 60 + 30, 14 * 60))
        if not _dines(day):
            self._go(
                day, Outing("Have dinner", self._outings_to.dinner[:1], (55, 75), role="dinner"), (18 * 60, 21 * 60)
            )
        for _ in range(2 + int(rng.integers(2))):
            self._go(day, Outing(_sight, self._outings_to.sights, (30, 75), tag=ActivityTag.VISIT), (9 * 60, 18 * 60))
        self._errand(day, (10 * 60, 18 * 60))


def _sight(place: Place) -> str:
    if kind_of(place) in kind_sets()["green"]:
        return "Sit in the open and look around"
    return {"place_of_worship": "Look at the building and sit quietly", "marketplace": "Look over the stalls"}.get(
        kind_of(place), "Look at the exhibition"
    )


def _dines(day: Day) -> bool:
    """Whether dinner is settled."""
    return any(b.type is ItemType.MEAL and b.start >= 17 * 60 for b in day.blocks)


def _eat_together(members: Companions) -> None:
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


def _lower(text: str) -> str:
    """Start in lower case, but leave abbreviations."""
    return text if text[:2].isupper() else text[0].lower() + text[1:]


def _round(minutes: float) -> int:
    return round(float(minutes) / 5) * 5
