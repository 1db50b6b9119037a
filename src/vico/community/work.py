"""Homes, workplaces and working hours: where everybody belongs, drawn from the places that there are.

Trades say in which kinds of places people work. How many people a place can employ is data of
``vico/data/community/staff.toml`` and of a user's own files.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from vico.community.catalogue import Job, fallback_trades, trades, ways_of_life
from vico.community.day import MIDNIGHT
from vico.community.people import Household, ResidentDraft
from vico.community.place_index import PlaceIndex, kind_of, staffed_stretches
from vico.community.schooling import Care, hours_between_school_runs
from vico.errors import EmptyInputError
from vico.io.data_files import DataRecord, cached_data, data_files, read_record
from vico.world.model import Category, Place
from vico.world.opening_hours import Span


def jobs_at(place: Place) -> list[Job]:
    """Return the trades that a place employs; empty for places where nobody works."""
    kind = kind_of(place)
    if kind in _kinds():
        return [job for job in trades() if kind in job.kinds]
    fallback = fallback_trades()
    return [fallback[place.category]] if place.category in fallback else []


def job_of(occupation: str) -> Job | None:
    """Return the trade that an occupation names, e.g. ``barista`` or ``senior barista``; None if it is none we know."""
    words = occupation.lower()
    found = [job for title, job in _by_title().items() if words == title or words.endswith(" " + title)]
    return max(found, key=lambda job: len(job.title), default=None)


def works_at(occupation: str, place: Place) -> bool:
    """Whether somebody of this occupation may work at a place; an unknown occupation may work where anybody does."""
    job = job_of(occupation)
    if job is None:
        return place.category not in (Category.TRANSIT,)
    return job in jobs_at(place)


@cached_data
def _by_title() -> dict[str, Job]:
    return {job.title.lower(): job for job in (*trades(), *fallback_trades().values())}


@cached_data
def _kinds() -> frozenset[str]:
    return frozenset(kind for job in trades() for kind in job.kinds)


_GUIDE = "docs/adding_people.md"
# Who works alone cannot have a day off.
_LEAST = 2


class _Staff(DataRecord):
    square_metres: Annotated[float, Field(gt=0.0)]
    kinds: tuple[str, ...]


class _StaffFile(DataRecord):
    otherwise: Annotated[float, Field(gt=0.0)] | None = None
    unknown: Annotated[int, Field(ge=1)] | None = None
    open: Annotated[int, Field(ge=1)] | None = None
    staff: tuple[_Staff, ...] = ()


@dataclass(frozen=True)
class StaffRules:
    """Square metres for each member of staff by kind or category of place; how many in places without rooms."""

    by_kind: Mapping[str, float]
    otherwise: float
    unknown: int
    open: int


@cached_data
def staff_rules() -> StaffRules:
    """Return how many people places employ; a kind has the entry that named it last.

    Raises
    ------
    SchemaError
        If a file can't be used.
    """
    files = [read_record(path, _StaffFile, guide=_GUIDE) for path in data_files("community", "staff")]
    return StaffRules(
        by_kind={kind: entry.square_metres for file in files for entry in file.staff for kind in entry.kinds},
        otherwise=[file.otherwise for file in files if file.otherwise is not None][-1],
        unknown=[file.unknown for file in files if file.unknown is not None][-1],
        open=[file.open for file in files if file.open is not None][-1],
    )


def staff_capacity(index: PlaceIndex, place: Place) -> int:
    """Return how many people a place can employ, all shifts together."""
    rules = staff_rules()
    if not place.rooms:
        return rules.unknown if place.building is not None else rules.open
    metres = rules.by_kind.get(kind_of(place)) or rules.by_kind.get(place.category.value, rules.otherwise)
    return max(_LEAST, round(index.floor_area(place) / metres))


_CROWDED = 0.5  # share of the beds from which on homes are chosen that leave few free
_FILLED = 0.9  # share of the beds that can be filled with households
#: Where students study. `workplace` of a student is one of these.
STUDY_KINDS = frozenset({"university", "college", "research_institute", "library", "music_school"})

# What any place with an open door offers: minutes before opening and after closing that staff are there, at most.
_BEFORE, _AFTER = 45, 30
_LATEST = 23 * 60 + 30
_COMMUTE = 2000.0  # metres as the crow flies that people go to work or to lectures
_LAST = 10  # minutes at home before midnight
# Days of work in a week; trades that work from Monday to Friday only; and the other two days.
_WORKING_DAYS = 5
_OPEN_ENDED = ("office", "bank", "school", "health", "day")  # patterns of trades that one may stay longer at
_OVERTIME = 200  # minutes that the most ambitious of all would stay longer than others
# Share of those who work the first part of a long day.
_FIRST = 0.55
_OFFICE_DAYS, _WEEKEND = ("office", "bank", "school"), (5, 6)
# How often a parent looks for work that leaves time for the children.
_TRIES = 8


def assign_homes(rng: np.random.Generator, index: PlaceIndex, households: Sequence[Household]) -> None:
    """Give each household a home: guests a room, all others a dwelling, with a bed for each.

    Large households choose first. They take the emptiest homes, at times a neighbour's; where most beds are needed,
    those with the fewest to spare, and rooms for guests when the dwellings are full. In worlds without rooms, whose
    beds nobody knows, all find a place.

    Raises
    ------
    EmptyInputError
        If there are too few beds.
    """
    dwellings, rooms = index.homes()
    beds = Counter({p.id: index.beds(p) for p in (*dwellings, *rooms)})
    people = sum(len(household.members) for household in households)
    crowded = people > _CROWDED * sum(beds.values()) > 0
    taken: Counter[str] = Counter()
    for household in sorted(households, key=lambda one: -len(one.members)):
        options = (rooms or dwellings) if household.kind == "guest" else (dwellings or rooms)
        if household.kind == "flatmates" and household.members[0].status == "student":
            options = [p for p in options if kind_of(p) == "dormitory"] or options
        size = len(household.members)
        free = Counter({p.id: beds[p.id] - taken[p.id] for p in (*dwellings, *rooms)})
        fitting = [p for p in options if free[p.id] >= size] or [p for p in (*dwellings, *rooms) if free[p.id] >= size]
        if not fitting and beds.total():
            raise _too_few_beds(index, people, beds.total())
        options = fitting or options
        if crowded:
            spare = min(free[p.id] for p in options)
            options = [p for p in options if free[p.id] == spare]
        fewest = min(taken[p.id] for p in options)
        neighbours = [p for p in options if 0 < taken[p.id] < 4]
        if neighbours and rng.random() < 0.15:
            options = neighbours
        else:
            options = [p for p in options if taken[p.id] == fewest]
        home = options[int(rng.integers(len(options)))]
        household.home = home.id
        taken[home.id] += len(household.members)
        for member in household.members:
            member.home = home.id


def check_beds(index: PlaceIndex, people: int) -> None:
    """Check that there are beds for some people, where it is known how many there are.

    Raises
    ------
    EmptyInputError
        If there are too few.
    """
    beds = sum(index.beds(place) for homes in index.homes() for place in homes)
    if 0 < beds < people:
        raise _too_few_beds(index, people, beds)


def _too_few_beds(index: PlaceIndex, people: int, beds: int) -> EmptyInputError:
    return EmptyInputError(
        f"community: world {index.world.manifest.name!r} has {beds} beds, too few for {people} residents in households "
        f"that live under one roof each; ask for at most {int(_FILLED * beds)} residents, or build a world with a "
        "larger --radius"
    )


def employers(index: PlaceIndex) -> list[Place]:
    """Places where people work on the day: somebody's trade, and not closed."""
    return [p for p in index.places() if p.category is not Category.TRANSIT and jobs_at(p) and workdays(index.hours(p))]


def workdays(spans: Sequence[Span]) -> list[list[Span]]:
    """Return the stretches of a place's hours that make a working day: four hours or more between six and midnight."""
    return [
        stretch
        for stretch in staffed_stretches(spans)
        if min(max(end for _, end in stretch), 24 * 60) - max(stretch[0][0], 6 * 60) >= 4 * 60
    ]


def study_places(index: PlaceIndex) -> list[Place]:
    """Places where students study, open on the day."""
    found = [
        p
        for p in index.places()
        if kind_of(p) in STUDY_KINDS and any(start <= 11 * 60 and end >= 16 * 60 for start, end in index.hours(p))
    ]
    return [p for p in found if kind_of(p) != "library"] or found


def assign_work(
    rng: np.random.Generator, index: PlaceIndex, drafts: Sequence[ResidentDraft], cares: Sequence[Care] = ()
) -> None:
    """Give every adult an occupation, and a workplace and hours to those who have one.

    Parameters
    ----------
    cares
        Who has to take children to school and to fetch them: their hours lie between.
    """
    ways = ways_of_life()
    study = study_places(index)
    market = _JobMarket(rng, index)
    held = market.held
    caring = {care.carer.id: care for care in cares}
    for draft in drafts:
        if draft.status == "worker" and not market.hire(draft, caring.get(draft.id)):
            draft.status = "freelancer"
        if draft.status in ("worker", "pupil"):
            continue
        if draft.status == "student":
            near = within_reach(index, draft.home, study)
            place = near[int(rng.integers(len(near)))]
            options = ["music"] if kind_of(place) == "music_school" else list(ways.subjects)
            draft.subject = _rare(rng, options, held)
            draft.occupation = f"student of {draft.subject}"
            draft.workplace = place.id
            start = int(rng.choice([8 * 60 + 15, 8 * 60 + 30, 9 * 60 + 15, 10 * 60 + 15]))
            opens = min(s for s, e in index.hours(place) if e >= 16 * 60)
            start = max(start, 5 * math.ceil(opens / 5))
            closes = max(e for s, e in index.hours(place) if e >= 16 * 60)
            end = start + 5 * int(rng.integers(60, 73)) + _five(_OVERTIME * draft.drive / 2)
            draft.shift = (start, max(start + 240, min(end, closes)))
        elif draft.status == "freelancer":
            draft.occupation = _rare(rng, [f.title for f in ways.freelancer], held)
        elif draft.status == "retired":
            draft.subject = _rare(rng, [r.title for r in ways.retired], held)
            draft.occupation = f"retired {draft.subject}"
        else:
            draft.occupation = _rare(rng, [g.title for g in ways.guest], held)


def _rare(rng: np.random.Generator, options: Sequence[str], held: Counter[str]) -> str:
    fewest = min(held[o] for o in options)
    options = [o for o in options if held[o] == fewest]
    chosen = options[int(rng.integers(len(options)))]
    held[chosen] += 1
    return chosen


class _JobMarket:
    """Jobs that the world has, and how many hold which.

    Parameters
    ----------
    rng
        Decides who gets what.

    Attributes
    ----------
    held
        How many have which occupation.
    """

    def __init__(self, rng: np.random.Generator, index: PlaceIndex) -> None:
        self._rng, self._index = rng, index
        self._offers: dict[str, list[Place]] = {}
        offered: dict[str, Job] = {}
        for place in employers(index):
            for job in jobs_at(place):
                self._offers.setdefault(job.title, []).append(place)
                offered[job.title] = job
        known = [job.title for job in trades()]
        titles = [title for title in [*known, *sorted(set(offered) - set(known))] if title in offered]
        self._jobs = [offered[title] for title in titles]
        self._staff: Counter[str] = Counter()
        self._off: dict[str, Counter[int]] = {}
        self._firsts: Counter[str] = Counter()
        self._coin = True
        self._late = 0
        self.held: Counter[str] = Counter()

    def hire(self, draft: ResidentDraft, care: Care | None) -> bool:
        """Find somebody a job; False, and nothing changed, where none leaves time for the children."""
        for _ in range(1 if care is None else _TRIES):
            job = self._job(draft, by_day=care is not None)
            if job is None:
                return False
            place = self._place(draft, job)
            shift = self._hours(draft, job, place)
            if care is not None and care.stops:
                left = hours_between_school_runs(self._index, care, place.id, shift)
                if left is None:
                    continue
                shift = left
            self._take(draft, job, place, shift)
            draft.days_off = self._days_off(job, place)
            return True
        return False

    def _days_off(self, job: Job, place: Place) -> frozenset[int]:
        """Return the days of the week somebody has off: the weekend, or of a place that is open then any two.

        None is the day that jobs are planned for, and few of a place have the same.
        """
        if job.shift in _OFFICE_DAYS:
            return frozenset(_WEEKEND)
        open_on = [day for day in range(7) if workdays(self._index.in_same_week(day).hours(place))]
        free: list[int] = []
        options = [day for day in open_on if day != self._index.weekday]
        for _ in range(len(open_on) - _WORKING_DAYS):
            off = self._off.setdefault(place.id, Counter())
            fewest = min(off[day] for day in options)
            rarest = [day for day in options if off[day] == fewest]
            free.append(rarest[int(self._rng.integers(len(rarest)))])
            options.remove(free[-1])
            off[free[-1]] += 1
        return frozenset(free)

    def _take(self, draft: ResidentDraft, job: Job, place: Place, shift: tuple[int, int]) -> None:
        draft.job, draft.occupation, draft.workplace, draft.shift = job, job.title, place.id, shift
        draft.first_shift = self._next_is_first(place)
        self._firsts[place.id] += 1 if draft.first_shift else -1
        if self._staff[place.id] + 1 >= staff_capacity(self._index, place):
            for offers in self._offers.values():
                if place in offers:
                    offers.remove(place)
        self.held[job.title] += 1
        self._staff[place.id] += 1
        self._late += shift[1] > 21 * 60

    def _next_is_first(self, place: Place) -> bool:
        """Whether the next to be hired works the first part of a long day: the other one than most of the staff."""
        balance = self._firsts[place.id]
        return balance < 0 or (balance == 0 and self._coin)

    def _job(self, draft: ResidentDraft, *, by_day: bool) -> Job | None:
        """Draw a trade; None where every place has all the staff it has room for."""
        self._coin = bool(self._rng.random() < _FIRST)
        weights = np.zeros(len(self._jobs))
        for k, job in enumerate(self._jobs):
            low, high = job.ages
            # Half the weight of a trade is its share of the places; the square root keeps the many shops from
            # crowding out.
            weights[k] = job.weight * len(self._offers[job.title]) ** 0.5 * 0.07 ** self.held[job.title]
            weights[k] *= 1.0 if low <= draft.age <= high else 1e-6
            weights[k] *= (1e-6 if by_day else 0.25**self._late) if job.shift == "evening" else 1.0
            weights[k] *= 1.4 if job.shift in ("office", "bank", "school", "health") else 1.0
        if not weights.any():
            return None
        return self._jobs[int(self._rng.choice(len(self._jobs), p=weights / weights.sum()))]

    def _place(self, draft: ResidentDraft, job: Job) -> Place:
        offers = within_reach(self._index, draft.home, self._offers[job.title])
        places = [p for p in offers if p.id != draft.home] or offers
        # Some work where somebody of the community works already: that makes colleagues.
        staff = self._staff
        w = np.array([0.02 if staff[p.id] > 2 else 1 + 0.9 * len(places) * (staff[p.id] > 0) for p in places])
        return places[int(self._rng.choice(len(places), p=w / w.sum()))]

    def _hours(self, draft: ResidentDraft, job: Job, place: Place) -> tuple[int, int]:
        return _working_hours(self._rng, self._index, draft, job, place, first=self._next_is_first(place))


def _working_hours(
    rng: np.random.Generator, index: PlaceIndex, draft: ResidentDraft, job: Job, place: Place, *, first: bool
) -> tuple[int, int]:
    stretches = workdays(index.hours(place))
    stretch = stretches[int(rng.integers(len(stretches))) if len(stretches) > 1 else 0]
    start, end = _shift(rng, job.shift, stretch, first=first, more=_five(_OVERTIME * draft.drive))
    if end > 22 * 60:  # home before midnight, however far
        end = min(end, 23 * 60 + 40 - (index.minutes(place.id, draft.home) or 0)) // 5 * 5
    slow = index.minutes(place.id, draft.home, draft.pace) or 0
    return start, min(end, (MIDNIGHT - _LAST - slow) // 5 * 5)


def within_reach(index: PlaceIndex, home: str, places: Sequence[Place]) -> Sequence[Place]:
    """Return the places that somebody walks to every day from a home; the nearest one where all are farther away."""
    far = index.metres_to(home, places)
    near = [places[k] for k in np.flatnonzero(far <= _COMMUTE).tolist()]
    return near or [places[int(far.argmin())]]


def shift_on(
    rng: np.random.Generator, index: PlaceIndex, planned: PlaceIndex, draft: ResidentDraft
) -> tuple[int, int] | None:
    """Return the working hours of somebody on a day, minutes; None if they have it off or their place is closed.

    Parameters
    ----------
    index, planned
        Of that day, and of the day that their working hours were planned for.
    """
    if draft.workplace is None or draft.shift is None or index.weekday in draft.days_off:
        return None
    place = index.place_by_id[draft.workplace]
    hours = index.hours(place)
    if draft.status == "student":
        start, end = draft.shift
        fits = index.weekday not in _WEEKEND and any(a <= start and end <= b + _AFTER for a, b in hours)
        return draft.shift if fits else None
    if hours == planned.hours(place):
        return draft.shift
    if not workdays(hours) or draft.job is None:
        return None
    return _working_hours(rng, index, draft, draft.job, place, first=draft.first_shift)


def _five(minutes: float) -> int:
    return round(minutes / 5) * 5


def _shift(
    rng: np.random.Generator, pattern: str, spans: Sequence[Span], *, first: bool, more: int = 0
) -> tuple[int, int]:
    """Working hours that fit the pattern of the trade and a stretch of the place's hours, minutes.

    Parameters
    ----------
    first
        Whether they are the first part of a long day.
    more
        How much longer somebody stays than others, where nobody waits for them to leave.
    """
    opens = max(min(start for start, _ in spans), 6 * 60)
    closes = min(max(end for _, end in spans), 24 * 60)
    low, high = max(5 * 60 + 30, opens - _BEFORE), min(_LATEST, closes + _AFTER)
    length = _five(float(rng.integers(455, 505)))
    if pattern in ("office", "bank"):
        start = int(rng.choice([480, 495, 510, 525, 540, 555], p=[0.1, 0.2, 0.33, 0.15, 0.17, 0.05]))
        length += 10
    elif pattern == "school":
        start, length = int(rng.choice([465, 470, 480, 485])), _five(float(rng.integers(430, 490)))
    elif pattern == "health":
        start = int(rng.choice([435, 450, 465, 480, 540]))
    elif pattern == "hotel":
        start = int(rng.choice([405, 420])) if first else int(rng.choice([870, 885]))
    elif pattern == "sport":
        start = max(opens - 15, 390) if first else 810
    elif pattern == "evening":
        start = min(closes + 10, _LATEST) - length
    elif pattern == "kitchen":
        start = opens - 45 if first and opens <= 12 * 60 else min(closes + 15, _LATEST) - length
        start = max(start, 8 * 60)
    elif pattern == "early":
        start = opens - int(rng.choice([20, 30])) if first else min(closes + 10, 22 * 60) - length
    else:  # shop, day
        start = opens - int(rng.choice([10, 15, 20])) if first else min(closes + 10, 21 * 60) - length
    if pattern in _OPEN_ENDED:
        length += more
    if opens > start + 300:  # opens in the evening only
        start = low
    start = _five(max(low, min(start, high - min(length, high - low))))
    if start < low:
        start += 5
    return start, min(start + length, high // 5 * 5)
