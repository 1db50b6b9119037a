"""Outings: alone where they fit into a day, and together with those at home and with friends.

Groups are apart (`vico.community.groups`); helping somebody at their home is here.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from vico.community.catalogue import errands, inclinations, kind_sets, ways_of_life
from vico.community.day import MIDNIGHT, Block, Day, in_fives
from vico.community.model import ActivityTag, ItemType, Relation, RelationKind
from vico.community.people import ALONE_FROM, ResidentDraft
from vico.community.place_index import PlaceIndex, kind_of
from vico.community.schooling import SCHOOL_DAYS
from vico.world.model import Category, Place

# Roles of blocks that are meals.
_MEALS = ("breakfast", "lunch", "dinner")
# How often one goes out for the sake of one's first, second and third value.
_OFTEN = (0.5, 0.3, 0.2)
# Where children spend their pocket money.
_SWEETS = ("kiosk", "convenience", "ice_cream", "bakery", "confectionery", "newsagent", "supermarket")


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


class Outings:
    """Chooses outings, and knows how many went where: a place draws fewer when many are there already.

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

    def put(self, day: Day, block: Block) -> None:
        """Put a block into a day in which it fits."""
        if not day.add(block):
            raise ValueError(f"{block} does not fit between {day.blocks}")
        self._visits[block.place] += 1

    def near(self, anchor: str, kinds: Iterable[str], within: float = 700.0) -> list[Place]:
        """Return at most six places of some kinds, drawn by nearness to `anchor` and by how few were there today."""
        found = [p for k in dict.fromkeys(kinds) for p in self._by_kind.get(k, ()) if p.id != anchor]
        metres = np.array([self._index.metres(anchor, p.id) for p in found])
        keep = [k for k in range(len(found)) if metres[k] <= within]
        if not keep:
            return []
        sizes = Counter(kind_of(found[k]) for k in keep)
        weights = np.array(
            [
                math.exp(-metres[k] / 220) * 0.5 ** self._visits[found[k].id] / sizes[kind_of(found[k])] ** 0.5
                for k in keep
            ]
        )
        picks = self._rng.choice(len(keep), min(6, len(keep)), replace=False, p=weights / weights.sum())
        return [found[keep[int(k)]] for k in picks]

    def go(
        self, day: Day, outing: Outing, window: tuple[int, int], *, anchor: str | None = None, soon: bool = False
    ) -> bool:
        """Add an outing where it fits in the window, minutes; `soon`: as early as possible."""
        low, high = outing.minutes
        window = window[0], min(window[1], day.out_until)
        kinds = [kind for kind in outing.kinds if kind not in day.barred]
        for place in self.near(anchor or day.home, kinds)[:4] if window[1] - window[0] >= low else ():
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

    def plan_alone(self, draft: ResidentDraft, day: Day) -> None:
        """Plan outings before, beside and after what is fixed in a day, as suits somebody's way of life."""
        rng = self._rng
        if draft.child:
            self._pupil(draft, day)
            return
        wake = next(b for b in day.blocks if b.role == "sleep").end
        leave = min((b.start for b in day.blocks if b.role in ("work", "group", "duty")), default=11 * 60)
        work = draft.workplace or day.home
        done = draft.shift[1] if draft.shift and draft.shift[0] < 12 * 60 else 15 * 60
        breakfasts_in_company = any(b.type is ItemType.MEAL and b.start < 12 * 60 for b in day.blocks)
        if rng.random() < (0.6 if draft.status == "guest" else 0.3) and not (breakfasts_in_company or draft.duties):
            self.go(
                day,
                Outing("Have breakfast", self._kinds["cafes"][:3], (20, 30), role="breakfast"),
                (wake + 20, min(leave, wake + 150)),
                anchor=work,
            )
        elif leave >= 9 * 60 + 10 and wake <= 7 * 60 + 50 and rng.random() < 0.9:
            self._before_the_day(day, (max(wake + 30, 7 * 60 + 55), min(leave, 8 * 60 + 55)))
        weekend = self._index.weekday not in SCHOOL_DAYS
        if draft.day_off or (weekend and draft.status == "freelancer"):
            self._day_off(draft, day, wake)
        else:
            ways = {"retired": self._plan_retired_day, "freelancer": self._freelancer, "guest": self._guest}
            ways.get(draft.status, self._after_work)(draft, day, wake, done)
        self._incline(draft, day, (wake + 60, 21 * 60 + 30))

    def _before_the_day(self, day: Day, window: tuple[int, int]) -> None:
        """Plan a way for bread or air where there is an hour in the morning."""
        if self._rng.random() < 0.5 and self.go(
            day,
            Outing(
                "Fetch fresh bread", ("bakery", "convenience", "supermarket", "kiosk"), (5, 10), tag=ActivityTag.SHOP
            ),
            window,
            soon=True,
        ):
            return
        self.go(day, Outing("Take a turn in the fresh air", self._kinds["green"], (15, 25)), window, soon=True)

    def _hobby(self, draft: ResidentDraft, day: Day, window: tuple[int, int]) -> bool:
        for k in self._rng.permutation(len(draft.hobbies)):
            hobby = draft.hobbies[int(k)]
            if not hobby.out or hobby.out in day.done:
                continue
            minutes = (115, 130) if "cinema" in hobby.kinds or "theatre" in hobby.kinds else (45, 85)
            if self.go(day, Outing(hobby.out, hobby.kinds, minutes, tag=hobby.about), window):
                day.done.add(hobby.out)
                return True
        return False

    def _incline(self, draft: ResidentDraft, day: Day, window: tuple[int, int]) -> None:
        """Plan an outing for one of somebody's values, the first value most."""
        for value, often in zip(draft.values, _OFTEN, strict=False):
            ways = [one for one in inclinations().inclination if one.value == value and one.kinds]
            ways = [one for one in ways if one.ages[0] <= draft.age <= one.ages[1]]
            if not ways or self._rng.random() > often:
                continue
            way = ways[int(self._rng.integers(len(ways)))]
            hours = max(window[0], 60 * way.hours[0]), min(window[1], 60 * way.hours[1])
            self.go(day, Outing(way.activity, way.kinds, way.minutes, tag=ActivityTag.LEISURE), hours)

    def _day_off(self, draft: ResidentDraft, day: Day, wake: int) -> None:
        """Plan a day off: shopping, hobbies, air, sights, a meal out."""
        rng, mind = self._rng, draft.character
        if rng.random() < 0.6:
            shopping = Outing("Do the week's shopping", self._outings_to.groceries, (25, 50), tag=ActivityTag.SHOP)
            self.go(day, shopping, (max(wake + 50, 9 * 60), 18 * 60))
        self._hobby(draft, day, (max(wake + 60, 9 * 60 + 30), 14 * 60))
        if rng.random() < 0.25 + 0.5 * mind.openness:
            sights = Outing(_sight, self._outings_to.sights, (40, 90), tag=ActivityTag.VISIT)
            self.go(day, sights, (11 * 60, 18 * 60))
        if rng.random() < 0.5:
            self.go(day, Outing("Take a long walk", self._kinds["green"], (40, 75)), (10 * 60, 19 * 60))
        if not dines(day) and rng.random() < _eats_out(draft, 0.35):
            dinner = Outing("Have dinner", self._outings_to.dinner, (50, 80), role="dinner")
            self.go(day, dinner, (17 * 60 + 15, 21 * 60))
        if rng.random() < mind.extraversion:
            self._hobby(draft, day, (15 * 60, 22 * 60))

    def _errand(self, day: Day, window: tuple[int, int], *, soon: bool = False) -> bool:
        kinds = list(self._errands)
        chosen = [kinds[int(k)] for k in self._rng.choice(len(kinds), 4, replace=False)]
        return any(
            self.go(
                day,
                Outing(
                    self._errands[kind], (kind,), (30, 45) if kind == "hairdresser" else (10, 20), tag=ActivityTag.SHOP
                ),
                window,
                soon=soon,
            )
            for kind in chosen
        )

    def _pupil(self, draft: ResidentDraft, day: Day) -> None:
        """Plan outings after school of children who may go out alone."""
        free = draft.lessons is None
        done = draft.shift[1] if draft.shift else 10 * 60 if free else 15 * 60
        if self._rng.random() < (0.85 if free else 0.3 + 0.5 * draft.character.extraversion):
            self._hobby(draft, day, (done, 20 * 60))
        if free and self._rng.random() < 0.6:
            self.go(day, Outing("Be out and about", (*self._kinds["green"], "playground"), (40, 75)), (done, 18 * 60))
        self._incline(draft, day, (done, 19 * 60))
        if self._rng.random() < 0.2:
            sweets = Outing("Buy sweets", _SWEETS, (5, 10), tag=ActivityTag.SHOP)
            self.go(day, sweets, (done, 19 * 60), anchor=draft.workplace, soon=True)

    def _after_work(self, draft: ResidentDraft, day: Day, wake: int, done: int) -> None:
        rng, work = self._rng, draft.workplace or day.home
        late = draft.shift is not None and draft.shift[0] >= 12 * 60
        free = (wake + 60, draft.shift[0]) if late and draft.shift else (done, 21 * 60 + 30)
        if rng.random() < 0.35 + 0.5 * draft.character.extraversion:
            self._hobby(draft, day, free)
        if rng.random() < 0.45:
            self.go(
                day,
                Outing("Buy groceries", self._outings_to.groceries, (10, 25), tag=ActivityTag.SHOP),
                free,
                anchor=work,
                soon=True,
            )
        elif rng.random() < 0.5:
            self._errand(day, free, soon=True)
        if not late and not dines(day) and rng.random() < _eats_out(draft, 0.2):
            self.go(
                day,
                Outing("Have dinner", self._outings_to.dinner, (40, 60), role="dinner"),
                (17 * 60 + 15, 20 * 60 + 30),
            )

    def _plan_retired_day(self, draft: ResidentDraft, day: Day, wake: int, done: int) -> None:
        rng = self._rng
        if rng.random() < 0.75:
            early = max(wake + 50, 7 * 60 + 50)
            self.go(
                day, Outing("Take the morning walk", self._kinds["green"], (25, 40)), (early, 9 * 60 + 15), soon=True
            )
        if rng.random() < 0.7:
            self.go(
                day,
                Outing("Do the day's shopping", self._outings_to.groceries, (20, 35), tag=ActivityTag.SHOP),
                (8 * 60 + 30, 12 * 60),
            )
        if rng.random() < 0.4:
            self.go(
                day, Outing("Have lunch", self._outings_to.lunch[:1], (45, 60), role="lunch"), (11 * 60 + 30, 14 * 60)
            )
        self._hobby(draft, day, (13 * 60, 17 * 60 + 30))
        if rng.random() < 0.6:
            self._errand(day, (9 * 60 + 30, 16 * 60))

    def _freelancer(self, draft: ResidentDraft, day: Day, wake: int, done: int) -> None:
        rng = self._rng
        desk, cafe = next((f.at_desk, f.at_cafe) for f in ways_of_life().freelancer if f.title == draft.occupation)
        self.go(
            day,
            Outing(cafe, (*self._kinds["cafes"], "library", "coworking_space"), (75, 110), role="work"),
            (9 * 60 + 30, 16 * 60),
        )
        start = in_fives(wake + 75 + float(rng.integers(0, 40)))
        for window in ((start, 12 * 60 + 15), (13 * 60, 17 * 60 + 30)):
            for minutes in (150, 120, 90, 60):
                starts = day.starts(day.home, minutes, window, [(0, MIDNIGHT)])
                block = Block(starts[0], starts[0] + minutes, ItemType.MAIN, desk, day.home, "work") if starts else None
                if block is not None and day.add(block):
                    break
        if draft.drive > 0.25:
            starts = day.starts(day.home, 60, (17 * 60 + 30, 21 * 60), [(0, MIDNIGHT)])
            if starts:
                day.add(Block(starts[0], starts[0] + 60, ItemType.MAIN, desk, day.home, "work"))
        if rng.random() < _eats_out(draft, 0.5):
            self.go(day, Outing("Have lunch", self._outings_to.lunch, (30, 45), role="lunch"), (11 * 60 + 30, 14 * 60))
        if rng.random() < 0.35 + 0.5 * draft.character.extraversion:
            self._hobby(draft, day, (16 * 60, 21 * 60 + 30))
        if rng.random() < 0.6:
            self.go(
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
        self.go(day, Outing("Have lunch", self._outings_to.lunch[:1], (40, 60), role="lunch"), (11 * 60 + 30, 14 * 60))
        if not dines(day):
            self.go(
                day, Outing("Have dinner", self._outings_to.dinner[:1], (55, 75), role="dinner"), (18 * 60, 21 * 60)
            )
        for _ in range(2 + int(rng.integers(2))):
            self.go(day, Outing(_sight, self._outings_to.sights, (30, 75), tag=ActivityTag.VISIT), (9 * 60, 18 * 60))
        self._errand(day, (10 * 60, 18 * 60))


def _eats_out(draft: ResidentDraft, often: float) -> float:
    """Return the chance that somebody eats out: `often`, more for who enjoys life, less for who counts pennies."""
    return float(np.clip(often + 0.3 * ("hedonism" in draft.values) - 0.2 * ("security" in draft.values), 0.02, 0.9))


def _sight(place: Place) -> str:
    if kind_of(place) in kind_sets()["green"]:
        return "Sit in the open and look around"
    return {"place_of_worship": "Look at the building and sit quietly", "marketplace": "Look over the stalls"}.get(
        kind_of(place), "Look at the exhibition"
    )


def dines(day: Day) -> bool:
    """Whether dinner is settled."""
    return any(b.type is ItemType.MEAL and b.start >= 17 * 60 for b in day.blocks)


#: Somebody and their day.
Party = tuple[ResidentDraft, Day]

# Between these minutes of the day one goes out with the family on a day off.
_FAMILY_HOURS = (9 * 60 + 30, 18 * 60)
_ASKED = 4  # times that friends are asked before one gives up
_PLANS = 3  # plans that are tried of those that suit
# Whoever is less outgoing than this meets one friend a day at most, and others two.
_RESERVED = 0.4
# People of these ages are helped most.
_OLD = 68


@dataclass(frozen=True)
class _Plan:
    """Something to do together: in words, where, how long, and between which minutes of the day."""

    activity: str
    kinds: tuple[str, ...]
    minutes: tuple[int, int]
    window: tuple[int, int]
    role: str = "company"
    meal: bool = False
    tag: ActivityTag | None = None


class Company:
    """Finds times and places at which several can be together, and puts them into their days.

    Parameters
    ----------
    rng
        Decides what is left open.
    outings
        Chooses places.
    """

    def __init__(self, rng: np.random.Generator, index: PlaceIndex, outings: Outings) -> None:
        self._rng, self._index, self._outings = rng, index, outings

    def household(self, members: Sequence[Party], kind: str) -> None:
        """Plan something together for those who share a home, if their days allow."""
        if len(members) < 2 or kind == "guest":
            return
        if kind == "family":
            self._family(members)
            return
        for plan in self._household_plans(members, kind):
            if plan.role == "dinner" and any(dines(day) for _, day in members[:2]):
                continue
            self._meet(members[:2], plan)

    def _household_plans(self, members: Sequence[Party], kind: str) -> list[_Plan]:
        rng, eat = self._rng, errands().kinds.dinner[:2]
        a, b = members[0][0], members[1][0]
        green, bars = kind_sets()["green"], ("pub", "bar", "cafe")
        off = a.day_off and b.day_off
        plans = []
        if kind == "couple" and (off or a.status == b.status == "retired"):
            plans.append(_Plan("Take a walk", green, (35, 60), (540, 1020)))
        # Who enjoys life eats out more often, who counts the pennies less.
        pleased = 0.15 * sum(("hedonism" in one.values) - ("security" in one.values) for one in (a, b))
        if kind == "couple" and rng.random() < 0.4 + pleased:
            plans.append(_Plan("Have dinner", eat, (55, 80), (1050, 1290), "dinner", meal=True))
        if kind in ("flatmates", "siblings") and rng.random() < _sociable(a, 0.1) + _sociable(b, 0.1):
            plans.append(_Plan("Have a drink", bars, (60, 60), (1050, 1320)))
        if kind == "parent" and rng.random() < 0.7:
            plans.append(_Plan("Have dinner", eat, (60, 60), (1050, 1260), "dinner", meal=True))
        return plans

    def _family(self, members: Sequence[Party]) -> None:
        """Plan outings of parents with children on a day off, or when the small ones have no other company."""
        small = [party for party in members if party[0].age < ALONE_FROM]
        off = all(draft.lessons is None for draft, _ in members if draft.child)
        busy = any(block.role == "group" for _, day in small for block in day.blocks)
        if (not off and busy) or (not off and not small):
            return
        # Small children go where somebody who looks after them goes: their carer knows when they are to be fetched.
        adults = [party for party in members if not party[0].child]
        carers = [party for party in adults if party[1].out_until == 0 or party[0].duties] or adults[:1]
        plans = [one for one in inclinations().together if small or not one.small_children]
        for k in self._rng.permutation(len(plans)).tolist()[:_PLANS]:
            plan = _Plan(plans[k].activity, plans[k].kinds, plans[k].minutes, _FAMILY_HOURS, tag=ActivityTag.LEISURE)
            core = [carers[0], *small] if small else [adults[0], *(p for p in members if p[0].child)]
            others = [party for party in members if all(party[0] is not one for one, _ in core)]
            if self._meet([*core, *others], plan, family=True) or self._meet(core, plan, family=True):
                return

    def friends(self, people: Mapping[str, Party], relations: Sequence[Relation]) -> None:
        """Plan meetings of friends: the outgoing meet more often.

        Parameters
        ----------
        people
            By id.
        """
        rng = self._rng
        ties: dict[str, list[tuple[float, str]]] = {}
        for relation in relations:
            if relation.kind is RelationKind.FRIEND:
                for me, other in (relation.between, relation.between[::-1]):
                    ties.setdefault(me, []).append((relation.strength, other))
        met: Counter[str] = Counter()
        for me, (draft, day) in people.items():
            often = 0.25 if draft.day_off or draft.status == "retired" else 0.1
            if draft.age < ALONE_FROM or met[me] >= _most(draft) or rng.random() > _sociable(draft, often):
                continue
            known = ties.get(me, [])
            heat = {other: rng.exponential() / strength for strength, other in known}
            for other in sorted(heat, key=lambda one: heat[one])[:_ASKED]:
                friend, theirs = people[other]
                if friend.age < ALONE_FROM or met[other] >= _most(friend) or rng.random() > _sociable(friend, 0.4):
                    continue
                both = [(draft, day), (friend, theirs)]
                if any(self._meet(both, plan) for plan in self._friends_plans(draft, friend)):
                    met.update((me, other))
                    break

    def _friends_plans(self, a: ResidentDraft, b: ResidentDraft) -> list[_Plan]:
        """Return some of what two friends could meet for: hobbies they share first."""
        hobbies = [hobby for hobby in a.hobbies if hobby.out and hobby.name in {other.name for other in b.hobbies}]
        young, old = sorted((a.age, b.age))
        plans = [one for one in inclinations().friends if one.ages[0] <= young and old <= one.ages[1]]
        shared = [_Plan(h.out, h.kinds, (45, 85), (9 * 60, 22 * 60), tag=h.about) for h in hobbies]
        order = self._rng.permutation(len(plans)).tolist()
        other = [
            _Plan(
                one.activity,
                one.kinds,
                one.minutes,
                (60 * one.hours[0], 60 * one.hours[1]),
                "dinner" if one.meal else "company",
                meal=one.meal,
            )
            for one in (plans[k] for k in order)
        ]
        return [*shared[:1], *other][:_PLANS]

    def help(self, people: Mapping[str, Party], relations: Sequence[Relation]) -> None:
        """Plan help of people who care for others for somebody they know, at that one's home."""
        rng, ways = self._rng, inclinations().help
        known: dict[str, list[str]] = {}
        for relation in relations:
            if relation.kind in (RelationKind.FRIEND, RelationKind.NEIGHBOUR):
                for me, other in (relation.between, relation.between[::-1]):
                    known.setdefault(me, []).append(other)
        helped: set[str] = set()
        for me, (draft, day) in people.items():
            if draft.child or draft.status == "guest" or rng.random() > _helpful(draft):
                continue
            need = {
                other: rng.exponential() / (4.0 if people[other][0].age >= _OLD else 1.0)
                for other in known.get(me, [])
                if not people[other][0].child and people[other][0].status != "guest" and other not in helped
            }
            for other in sorted(need, key=lambda one: need[one])[:_ASKED]:
                way = ways[int(rng.integers(len(ways)))]
                if self._visit((draft, day), people[other], (way.activity, way.host), way.minutes):
                    helped.add(other)
                    break

    def _visit(self, guest: Party, host: Party, words: tuple[str, str], minutes: tuple[int, int]) -> bool:
        (me, day), (them, theirs) = guest, host
        length = self._length(minutes)
        common = set(day.starts(theirs.home, length, (9 * 60, 20 * 60), _ALL_DAY))
        common &= set(theirs.starts(theirs.home, length, (9 * 60, 20 * 60), _ALL_DAY))
        common = {start for start in common if start + length <= min(day.out_until, me.home_by)}
        if not common or day.home == theirs.home:
            return False
        start = sorted(common)[int(self._rng.integers(len(common)))]
        end = start + length
        if not (day.fits(start, end, theirs.home) and theirs.fits(start, end, theirs.home)):
            return False
        mine, host_words = words[0].format(name=them.first), words[1].format(name=me.first)
        for whose, text, role in ((day, mine, "company"), (theirs, host_words, "home")):
            self._outings.put(whose, Block(start, end, ItemType.MAIN, text, theirs.home, role, ActivityTag.VISIT))
        return True

    def _length(self, minutes: tuple[int, int]) -> int:
        return 5 * int(self._rng.integers(minutes[0] // 5, minutes[1] // 5 + 1))

    def _meet(self, parties: Sequence[Party], plan: _Plan, *, family: bool = False) -> bool:
        """Put a plan into the days of all, at a place near the home of the first; False if there is no time for it.

        Parameters
        ----------
        family
            Whether those who go nowhere alone come along with the others.
        """
        rng, length = self._rng, self._length(plan.minutes)
        barred = {kind for _, day in parties for kind in day.barred}
        kinds = [kind for kind in plan.kinds if kind not in barred]
        back = min((min(d.out_until, p.home_by) for p, d in parties), default=0) if not family else plan.window[1]
        window = plan.window[0], min(plan.window[1], back)
        if window[1] - window[0] < length or not kinds:
            return False
        for place in self._outings.near(parties[0][1].home, kinds)[:_PLANS]:
            spans = self._index.hours(place)
            common = set.intersection(*(set(day.starts(place.id, length, window, spans)) for _, day in parties))
            if not common or any(place.id in (day.home, day.workplace) for _, day in parties):
                continue
            start = sorted(common)[int(rng.integers(len(common)))]
            if not all(day.fits(start, start + length, place.id) for _, day in parties):
                continue
            kind = ItemType.MEAL if plan.meal else ItemType.MAIN
            for me, day in parties:
                names = " and ".join(one.first for one, _ in parties if one is not me)
                text = f"{plan.activity} with {names}"
                day.done.add(plan.activity)
                self._outings.put(day, Block(start, start + length, kind, text, place.id, plan.role, plan.tag))
            return True
        return False


_ALL_DAY = [(0, 24 * 60)]


def _most(draft: ResidentDraft) -> int:
    return 1 if draft.character.extraversion < _RESERVED else 2


def _sociable(draft: ResidentDraft, often: float) -> float:
    """Return the chance that somebody seeks company: `often` for one of middling extraversion."""
    return float(np.clip(often + 1.6 * (draft.character.extraversion - 0.5), 0.02, 0.9))


def _helpful(draft: ResidentDraft) -> float:
    """Return the chance that somebody helps somebody on a day."""
    rank = draft.values.index("benevolence") if "benevolence" in draft.values else 3
    return float(np.clip((0.55, 0.4, 0.3, 0.02)[rank] + 0.25 * (draft.character.agreeableness - 0.5), 0.0, 0.8))
