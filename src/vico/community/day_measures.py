"""What people's days come to in numbers, and whether the words for their character agree with them."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from vico.clock import DAY, seconds_of_day
from vico.community.catalogue import Claim, claims
from vico.community.findings import CommunityFinding
from vico.community.model import ActivityTag, Community, ItemType, Mode, Resident, ScheduleItem

# Whereabouts are looked at every so many seconds, in the middle of each stretch.
_STEP = 300
_DINNER = "17:00:00"
_NOT_LEISURE = (ActivityTag.WORK, ActivityTag.STUDY, ActivityTag.SLEEP, ActivityTag.COMMUTE)


@dataclass(frozen=True)
class DayMeasures:
    """What somebody's days come to, means over the days.

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
    pairs, at_home = _acquainted(community)
    together = [_together(community.residents, schedules, pairs, at_home) for schedules in days]
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
        said = [*resident.personality.traits, *_parts(resident.lifestyle)]
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


def _parts(lifestyle: str) -> list[str]:
    """Return the phrases of a lifestyle: "Night owl; stays fit and likes a tidy flat."."""
    rhythm, _, ways = lifestyle.rstrip(".").partition("; ")
    return [rhythm, *ways.replace(" and ", ", ").split(", ")]


def _of_day(resident: Resident, items: Sequence[ScheduleItem], homes: Collection[str]) -> dict[str, float]:
    sleep = [item for item in items if item.type is ItemType.SLEEP]
    meals = [item for item in items if item.type is ItemType.MEAL]
    away = [item for item in items if item.place not in (None, resident.home)]
    return {
        "out": sum(_hours(i) for i in away if i.tag not in _NOT_LEISURE),
        "work": sum(_hours(i) for i in items if i.tag in (ActivityTag.WORK, ActivityTag.STUDY)),
        "exercise": sum(_hours(i) for i in items if i.tag is ActivityTag.EXERCISE or _on_own_legs(i)),
        "meals_out": sum(i.place != resident.home for i in meals),
        "dinners_out": sum(i.place != resident.home and i.start >= _DINNER for i in meals),
        "meals_home": sum(i.place == resident.home for i in meals),
        "rides": sum(i.mode not in (None, Mode.WALK) for i in items),
        "visiting": sum(_hours(i) for i in away if i.place in homes and i.tag not in _NOT_LEISURE),
        "rises": min(seconds_of_day(i.end) for i in sleep) / 3600 if sleep else 0.0,
        "retires": _retires(sleep),
    }


def _retires(sleep: Sequence[ScheduleItem]) -> float:
    last = max((item for item in sleep if item.start > "12:00:00"), key=lambda item: item.start, default=None)
    return 24.0 if last is None else seconds_of_day(last.start) / 3600


def _on_own_legs(item: ScheduleItem) -> bool:
    return item.type is ItemType.COMMUTE and item.mode in (None, Mode.WALK, Mode.BIKE)


def _hours(item: ScheduleItem) -> float:
    return (seconds_of_day(item.end) - seconds_of_day(item.start)) / 3600


def _acquainted(community: Community) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return the pairs of people who know each other, as rows of two numbers, and whether they share a home."""
    row = {r.id: k for k, r in enumerate(community.residents)}
    pairs = {tuple(sorted((row[a], row[b]))) for a, b in (r.between for r in community.relations)}
    homes: dict[str, list[int]] = {}
    for resident in community.residents:
        homes.setdefault(resident.household or resident.id, []).append(row[resident.id])
    for members in [*([row[m] for m in group.members] for group in community.groups), *homes.values()]:
        pairs |= {tuple(sorted(pair)) for pair in combinations(members, 2)}
    known = np.array(sorted(pairs), np.int64).reshape(-1, 2)
    house = np.array(_numbers([r.household or r.id for r in community.residents]), np.int64)
    return known, house[known[:, 0]] == house[known[:, 1]]


def _numbers(names: Sequence[str]) -> list[int]:
    number: dict[str, int] = {}
    return [number.setdefault(name, len(number)) for name in names]


def _together(
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
