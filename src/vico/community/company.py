"""What people do together besides their groups: those who share a home, friends, and who helps whom."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from vico.community.catalogue import errands, kind_sets
from vico.community.childhood import ALONE_FROM
from vico.community.day import Block, Day
from vico.community.inclinations import inclinations
from vico.community.model import ActivityTag, ItemType, Relation, RelationKind
from vico.community.outings import Outings, dines
from vico.community.people import ResidentDraft
from vico.community.place_index import PlaceIndex

#: Somebody and their day.
Party = tuple[ResidentDraft, Day]

# Between these minutes of the day one goes out with the family on a day off.
_FAMILY_HOURS = (9 * 60 + 30, 18 * 60)
# How often friends are asked before one gives up, and how many meet somebody for whom once is enough.
_ASKED, _PLANS = 4, 3
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
        """Let those who share a home do something together, if their days allow."""
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
        """Let parents go out with their children on a day off, or when the small ones have no other company."""
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
        """Let friends meet: the outgoing more often.

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
        """Let people who care for others help somebody they know, at that one's home."""
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
