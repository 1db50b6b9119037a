"""Schools of children: where they go, who takes the small ones there and fetches them, and their days.

What is fixed between getting up and lying down is written here: lessons, lunch at school, waiting to be fetched.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from vico.community.day import MIDNIGHT, Block, Day, in_fives
from vico.community.model import ActivityTag, ItemType
from vico.community.people import (
    ALONE_FROM,
    ESCORT_FROM,
    Duty,
    Household,
    Lessons,
    ResidentDraft,
    School,
    childhood,
    schools,
)
from vico.community.place_index import PlaceIndex, kind_of, staffed_spans
from vico.world.model import Place
from vico.world.opening_hours import Span

#: Monday to Friday there is school.
SCHOOL_DAYS = range(5)
_LEAST = 150  # minutes that lessons last
_EARLIEST = 7 * 60 + 30  # minute of the day when lessons begin
_LATEST = 17 * 60  # minute of the day when lessons end
# How long one stays when one takes a child to school or fetches it, and how long before the lessons that is, minutes.
_AT_THE_GATE = 5
_LAST_FETCH = 17 * 60 + 10  # minute of the day until which all small children are fetched
_SEEING_IN = 10  # minutes that one sees them in at home then
# When those who learn at home do, minutes of the day.
_HOME_LESSONS = (9 * 60, 14 * 60 + 30)
_CURFEW_AGES = (10, 13, 17)  # years
_OUT = (18 * 60, 19 * 60, 21 * 60)  # minutes of the day until which children go out alone, by age
_BACK = (19 * 60 + 15, 20 * 60, 21 * 60 + 30)  # ... when they are back from meetings
# How long work beside children is at least, minutes.
_PART_TIME = 4 * 60
# When a parent who is alone with small children is back for the evening.
_ALONE_WITH = 19 * 60


def school_places(index: PlaceIndex) -> list[tuple[School, list[Place]]]:
    """Return the places that there are for each kind of school, those open for long enough on the day."""
    found = []
    for school in schools():
        places = [p for p in index.places() if kind_of(p) in school.kinds and lesson_span(index, p) is not None]
        found.append((school, places))
    return found


def lesson_span(index: PlaceIndex, place: Place) -> Span | None:
    """Return the opening hours that lessons fit in, minutes; None on a day on which the school is closed."""
    spans = [(max(a, _EARLIEST), min(b, _LATEST)) for a, b in index.hours(place) if a <= 10 * 60]
    return max((s for s in spans if s[1] - s[0] >= _LEAST), key=lambda s: s[1] - s[0], default=None)


def assign_schools(rng: np.random.Generator, index: PlaceIndex, households: Sequence[Household]) -> None:
    """Send every child to the nearest school for its age; where there is none, it learns at home."""
    offers = school_places(index)
    begins: dict[str, int] = {}
    for household in households:
        for child in household.children:
            _to_school(rng, index, child, offers, begins)
            child.out_until, child.home_by = (int(np.interp(child.age, _CURFEW_AGES, at)) for at in (_OUT, _BACK))
            if child.age < ALONE_FROM:
                child.out_until = 0
        adults = household.adults
        if len(adults) == 1 and any(child.age < ESCORT_FROM for child in household.children):
            adults[0].home_by = adults[0].out_until = _ALONE_WITH


def _to_school(
    rng: np.random.Generator,
    index: PlaceIndex,
    child: ResidentDraft,
    offers: Sequence[tuple[School, Sequence[Place]]],
    begins: dict[str, int],
) -> None:
    fitting = [(school, places) for school, places in offers if school.ages[0] <= child.age <= school.ages[1]]
    school, places = next(((school, places) for school, places in fitting if places), (None, ()))
    near = sorted(places, key=lambda p: (index.metres(child.home, p.id), p.id))
    place = next((p for p in near if index.minutes(child.home, p.id) is not None), None)
    if school is None or place is None:
        learn_at_home(index, child)
        return
    child.occupation, child.workplace = school.title, place.id
    span = lesson_span(index, place)
    assert span is not None
    # All of a school begin at the same time.
    if place.id not in begins:
        begins[place.id] = max(school.starts[int(rng.integers(len(school.starts)))], span[0] + 2 * _AT_THE_GATE)
    start = begins[place.id]
    end = min(start + school.minutes, span[1])
    if index.weekday in SCHOOL_DAYS:
        child.lessons = Lessons(school, place.id, start, end)
        child.shift = start - 5 * int(rng.integers(1, 3)), end


def learn_at_home(index: PlaceIndex, child: ResidentDraft) -> None:
    """Plan lessons at home."""
    child.occupation, child.workplace, child.shift = childhood().home_school.title, None, None
    child.lessons = Lessons(None, None, *_HOME_LESSONS) if index.weekday in SCHOOL_DAYS else None


def lessons_on(index: PlaceIndex, child: ResidentDraft) -> Lessons | None:
    """Return a child's lessons on another day than the one they were planned for; None on a day without."""
    lessons = child.lessons
    if lessons is None or index.weekday not in SCHOOL_DAYS:
        return None
    if lessons.place is None:
        return lessons
    span = lesson_span(index, index.place_by_id[lessons.place])
    if span is None:
        return None
    start = max(lessons.start, span[0] + 2 * _AT_THE_GATE)
    return Lessons(lessons.school, lessons.place, start, max(min(lessons.end, span[1]), start + _LEAST - 30))


def care_on(index: PlaceIndex, household: Household, carer: ResidentDraft) -> Care:
    """Plan who takes children where on another day; their carer has what time for work that leaves.

    Parameters
    ----------
    household, carer
        As they are on that day.
    """
    care = Care(household, carer)
    while not _plan_stops(index, care):
        for child in care.small:
            if child.workplace == care.stops[-1]:
                child.lessons = child.shift = None
    if carer.shift is None or carer.workplace is None or not care.stops:
        carer.shift = None  # with children at home nobody goes to work
    else:
        carer.shift = hours_between_school_runs(index, care, carer.workplace, carer.shift)
    carer.out_until = 0
    settle_care(index, care)
    return care


def hours_between_school_runs(
    index: PlaceIndex, care: Care, workplace: str, shift: tuple[int, int]
) -> tuple[int, int] | None:
    """Return what of working hours at a place lies between bringing and fetching children; None for too little."""
    free, until = care.free
    there, back = index.minutes(care.stops[-1], workplace), index.minutes(workplace, care.stops[0])
    if there is None or back is None:
        return None
    start, end = max(shift[0], 5 * math.ceil((free + there) / 5)), min(shift[1], (until - back) // 5 * 5)
    return (start, end) if end - start >= _PART_TIME else None


@dataclass
class Care:
    """Care of a grown-up for the small children of a household on a school day.

    Attributes
    ----------
    household, carer
        Whose children, and who looks after them.
    stops
        Schools, in the order in which the carer comes by.
    bring, latest
        When they are there in the morning, and at the latest in the afternoon, minutes of the day.
    """

    household: Household
    carer: ResidentDraft
    stops: list[str] = field(default_factory=list)
    bring: list[int] = field(default_factory=list)
    latest: list[int] = field(default_factory=list)

    @property
    def small(self) -> list[ResidentDraft]:
        """The children who go nowhere alone."""
        return [child for child in self.household.children if child.age < ALONE_FROM]

    @property
    def at_home(self) -> bool:
        """Whether somebody has to be at home in working hours."""
        return any(child.lessons is not None and child.lessons.place is None for child in self.small)

    @property
    def free(self) -> tuple[int, int]:
        """From when, at the last stop, until when, at the first one, the carer may be at work, minutes of the day."""
        return self.bring[-1] + _AT_THE_GATE, self.latest[0]


def plan_care(rng: np.random.Generator, index: PlaceIndex, households: Sequence[Household]) -> list[Care]:
    """Find a carer for every household with small children, and when they have to be at which school."""
    found = []
    for household in households:
        care = Care(household, household.members[0])
        if not care.small:
            continue
        adults = household.adults
        free = [adult for adult in adults if adult.status != "worker"] or adults
        care.carer = free[int(rng.integers(len(free)))]
        while not _plan_stops(index, care):
            # Two schools too far apart: the child of the farther one learns at home.
            last = care.stops[-1]
            for child in care.small:
                if child.workplace == last:
                    learn_at_home(index, child)
        if care.at_home:
            care.carer.status = "freelancer"
        found.append(care)
    return found


def _plan_stops(index: PlaceIndex, care: Care) -> bool:
    """Set when the carer comes to which school; False if that can't be done."""
    lessons = [child.lessons for child in care.small if child.lessons is not None and child.lessons.place is not None]
    begin = {one.place: one.start for one in lessons if one.place is not None}
    care.stops = sorted(begin, key=lambda place: (begin[place], place))
    if not care.stops:
        return True
    # Parents find somebody at a school when it says, else for somewhat longer than its usual hours.
    schools = [index.place_by_id[stop] for stop in care.stops]
    given = [index.given_hours(school) for school in schools]
    hours = [
        staffed_spans(index.hours(school)) if spans is None else spans
        for school, spans in zip(schools, given, strict=True)
    ]
    walks = [index.minutes(a, b) for a, b in zip(care.stops, care.stops[1:], strict=False)]
    if None in walks:
        return False
    ways = [_AT_THE_GATE + (walk or 0) for walk in walks]
    bring = [begin[stop] - _AT_THE_GATE for stop in care.stops]
    latest = [min(max(b for _, b in spans) - _AT_THE_GATE, _LAST_FETCH) for spans in hours]
    for k in range(len(ways) - 1, -1, -1):
        bring[k] = min(bring[k], bring[k + 1] - ways[k])
        latest[k] = min(latest[k], latest[k + 1] - ways[k])
    care.bring, care.latest = bring, latest
    opens = [min(a for a, _ in spans) for spans in hours]
    ends = [max(one.end for one in lessons if one.place == stop) for stop in care.stops]
    return all(a <= b for a, b in zip(opens, bring, strict=True)) and all(
        a <= b for a, b in zip(ends, latest, strict=True)
    )


def settle_care(index: PlaceIndex, care: Care) -> None:
    """Write down, once the carer's working hours are known, when who takes and fetches the small children."""
    if not care.stops:
        return
    words, carer, small = childhood().escort, care.carer, care.small
    pupils = {stop: [child for child in small if child.workplace == stop] for stop in care.stops}
    ready = 0
    if carer.shift is not None and carer.workplace is not None:
        ready = carer.shift[1] + (index.minutes(carer.workplace, care.stops[0]) or 0)
    fetch: list[int] = []
    for k, stop in enumerate(care.stops):
        if k:
            ready = fetch[-1] + _AT_THE_GATE + (index.minutes(care.stops[k - 1], stop) or 0)
        fetch.append(max(ready, *(child.lessons.end for child in pupils[stop] if child.lessons is not None)))
    morning, afternoon = [], []
    for stop, arrive, leave in zip(care.stops, care.bring, fetch, strict=True):
        names = " and ".join(child.first for child in pupils[stop])
        morning.append(Duty(arrive, arrive + _AT_THE_GATE, words.bring.format(names=names), stop))
        afternoon.append(Duty(leave, leave + _AT_THE_GATE, words.fetch.format(names=names), stop))
        for child in pupils[stop]:
            child.shift = arrive, leave + _AT_THE_GATE
    home = fetch[-1] + _AT_THE_GATE + (index.minutes(care.stops[-1], carer.home) or 0)
    names = " and ".join(child.first for child in small if child.shift is not None)
    seeing_in = Duty(home, home + _SEEING_IN, words.bring_home.format(names=names), carer.home)
    carer.duties = [*morning, *afternoon, seeing_in]
    # Who is dropped later, or fetched sooner, comes along to the others' schools.
    snack = Duty(home, home + _SEEING_IN, words.at_home, carer.home)
    for k, stop in enumerate(care.stops):
        for child in pupils[stop]:
            child.duties = [*morning[:k], *afternoon[k + 1 :], snack]
    for child in care.household.children:
        if child not in small and child.shift is not None and child.workplace in care.stops:
            # Older brothers and sisters at the same school come along in the morning.
            child.shift = care.bring[care.stops.index(child.workplace)], child.shift[1]
    # Alone the carer goes out only while the children are at school.
    carer.out_until = fetch[0]


# Sleep that children need by age, minutes (American Academy of Sleep Medicine, 2016, middle of the ranges).
_SLEEP_AGES, _SLEEP = (5, 9, 13, 17), (650, 610, 560, 510)
# When they wake by themselves, minutes of the day, by age.
_WAKE = (405, 410, 425, 450)
_NOON = 11 * 60 + 50  # minute of the day around which lunch is
_LUNCH = 30  # minutes that it takes
# Stretches of lessons at home, minutes of the day.
_HOME_SCHOOL_HOURS = ((9 * 60, 12 * 60), (13 * 60, 16 * 60))


class SchoolDays:
    """Writes children's days at school, or at home where there is none.

    Parameters
    ----------
    rng
        Decides what is left open.
    put
        Puts a block into a day in which it fits.
    """

    def __init__(self, rng: np.random.Generator, index: PlaceIndex, put: Callable[[Day, Block], None]) -> None:
        self._rng, self._index, self._put = rng, index, put

    @staticmethod
    def sleep(rng: np.random.Generator, draft: ResidentDraft) -> tuple[float, float]:
        """Return when a child wakes by itself, minute of the day, and how long it sleeps, minutes."""
        natural = float(np.interp(draft.age, _SLEEP_AGES, _WAKE)) + 40 * (1 - draft.early)
        return natural, float(np.interp(draft.age, _SLEEP_AGES, _SLEEP))

    def write(self, draft: ResidentDraft, day: Day) -> None:
        """Put a child's school day in; there may be none."""
        lessons = draft.lessons
        if lessons is None:
            return
        if lessons.place is None:
            self._at_home(day)
        elif draft.shift is not None:
            self._at_school(draft, day, lessons)

    def _at_school(self, draft: ResidentDraft, day: Day, lessons: Lessons) -> None:
        assert lessons.school is not None
        assert lessons.place is not None
        assert draft.shift is not None
        rng, school, (start, end) = self._rng, lessons.school, draft.shift
        words = childhood()
        over = min(end, max(lessons.end, lessons.start + 60))
        noon = int(np.clip(in_fives(_NOON + float(rng.integers(-2, 5)) * 5), start + 60, over - _LUNCH))
        study = ActivityTag.STUDY
        lunch = words.at_home.at_school[int(rng.integers(len(words.at_home.at_school)))]
        blocks = [Block(start, noon, ItemType.MAIN, school.morning, lessons.place, "work", study)]
        blocks.append(Block(noon, noon + _LUNCH, ItemType.MEAL, lunch, lessons.place, "lunch"))
        if over - noon - _LUNCH >= 10:
            blocks.append(Block(noon + _LUNCH, over, ItemType.MAIN, school.afternoon, lessons.place, "work", study))
        else:
            blocks[-1].end = over
        if end > over:
            blocks.append(Block(over, end, ItemType.MAIN, school.club, lessons.place, "work", ActivityTag.LEISURE))
        for block in blocks:
            self._put(day, block)

    def _at_home(self, day: Day) -> None:
        words = childhood().home_school
        for window, text in zip(_HOME_SCHOOL_HOURS, (words.morning, words.afternoon), strict=True):
            for minutes in (150, 120, 90, 60):
                starts = day.starts(day.home, minutes, window, [(0, MIDNIGHT)])
                if starts:
                    block = Block(
                        starts[0], starts[0] + minutes, ItemType.MAIN, text, day.home, "work", ActivityTag.STUDY
                    )
                    if day.add(block):
                        break
