"""Residents in the making: households with ages and names, characters, and what the data say of children.

A `ResidentDraft` is what is known of somebody before their day is written. Names are of people who do not exist: first
and last names of a data file, put together so that none comes twice.

Children are 5 to 17 years old; nobody younger lives in a community. ``vico/data/community/children.toml`` says of their
schools, days and words, and files ``children*.toml`` of a user's own: schools are added, all else is replaced.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from pydantic import Field

from vico.community.catalogue import Ages, Hobby, Job, Pastime, basic_values, hobbies, names, trait_words
from vico.community.model import Personality
from vico.errors import SchemaError
from vico.io.data_files import DataRecord, cached_data, data_files, read_record
from vico.rules import walk_speed

#: Ages of the youngest resident, and of the youngest grown-up one, years.
YOUNGEST, GROWN_UP = 5, 18
#: Younger children do not go to school on their own, and go nowhere alone, years.
ALONE_FROM = 10
#: Who takes a younger brother or sister to school is at least so old, years.
ESCORT_FROM = 11
#: What children carry in their pockets.
POCKET_MONEY = (2, 60)
_GUIDE = "docs/adding_people.md"

_Clock = Annotated[str, Field(pattern=r"^([01]\d|2[0-3]):[0-5]\d$")]


class School(DataRecord):
    """A kind of school.

    Attributes
    ----------
    title
        Occupation of who goes there.
    ages
        Youngest and oldest, years.
    kinds
        Kinds of places that are such schools.
    begins, minutes
        When lessons may begin, HH:MM, and how long they take.
    morning, afternoon, club
        Activities of the lessons, and after them while a child waits to be fetched.
    told
        Each completes "NAME, AGE, ..."; {place} is the school.
    """

    title: str
    ages: Ages
    kinds: tuple[str, ...]
    begins: tuple[_Clock, ...]
    minutes: Annotated[int, Field(ge=120, le=540)]
    morning: str
    afternoon: str
    club: str
    told: tuple[str, ...]

    @property
    def starts(self) -> tuple[int, ...]:
        """Return when lessons may begin, minutes of the day."""
        return tuple(int(t[:2]) * 60 + int(t[3:]) for t in self.begins)


class HomeSchool(DataRecord):
    """Lessons of those who have no school within reach."""

    title: str
    morning: str
    afternoon: str
    told: tuple[str, ...]


class DayOff(DataRecord):
    """A day without school."""

    activity: str


class Escorts(DataRecord):
    """Words for taking small children to school and fetching them; {names} are theirs.

    Attributes
    ----------
    at_home
        What they do themselves when they come home.
    ready, dress
        Before one goes out with them: what one does, and what they do.
    """

    bring: str
    fetch: str
    bring_home: str
    at_home: str
    ready: str
    dress: str


class ChildrenAtHome(DataRecord):
    """Pastimes of children at home; `at_school` is lunch there."""

    morning: tuple[str, ...]
    breakfast: tuple[str, ...]
    lunch: tuple[str, ...]
    at_school: tuple[str, ...]
    dinner: tuple[str, ...]
    wind_down: tuple[str, ...]


class ChildrensPastimes(DataRecord):
    """Pastimes of the small, and of those of `ALONE_FROM` years and more."""

    small: tuple[Pastime, ...]
    big: tuple[Pastime, ...]


class ChildrensSentences(DataRecord):
    """Sentences of biographies, as `vico.community.catalogue.BiographySentences`; `ways` make up a lifestyle."""

    group: tuple[str, ...]
    hobbies: tuple[str, ...]
    ways: tuple[str, ...]


class _Words(DataRecord):
    home_school: HomeSchool
    day_off: DayOff
    escort: Escorts
    at_home: ChildrenAtHome
    pastimes: ChildrensPastimes
    biography: ChildrensSentences
    says: Mapping[str, tuple[str, ...]]


class _File(DataRecord):
    adults_only: tuple[str, ...] = ()
    school: tuple[School, ...] = ()
    home_school: HomeSchool | None = None
    day_off: DayOff | None = None
    escort: Escorts | None = None
    at_home: ChildrenAtHome | None = None
    pastimes: ChildrensPastimes | None = None
    biography: ChildrensSentences | None = None
    says: Mapping[str, tuple[str, ...]] | None = None


@cached_data
def _files() -> tuple[_File, ...]:
    return tuple(read_record(path, _File, guide=_GUIDE) for path in data_files("community", "children"))


@cached_data
def schools() -> tuple[School, ...]:
    """Return all kinds of schools, in the order of the files.

    Raises
    ------
    SchemaError
        If a school is for nobody between `YOUNGEST` and `GROWN_UP`.
    """
    found = tuple(school for file in _files() for school in file.school)
    for school in found:
        if not YOUNGEST <= school.ages[0] <= school.ages[1] < GROWN_UP:
            raise SchemaError(f"children: ages of {school.title!r} are not within {YOUNGEST}..{GROWN_UP - 1}")
    return found


@cached_data
def adults_only() -> frozenset[str]:
    """Return the kinds of places where no child goes."""
    return frozenset(kind for file in _files() for kind in file.adults_only)


@cached_data
def childhood() -> _Words:
    """Return the words of children's days and lives; of each table the last file's."""
    merged: dict[str, object] = {}
    for file in _files():
        merged |= {name: getattr(file, name) for name in _Words.model_fields if getattr(file, name) is not None}
    return _Words.model_validate(merged)


def is_pupil(occupation: str) -> bool:
    """Whether an occupation is a child's: one of the schools', or to be taught at home."""
    return occupation in {school.title for school in schools()} | {childhood().home_school.title}


@dataclass(frozen=True)
class Lessons:
    """A child's school: of which kind, at which place (None: at home), from when until when, minutes of the day."""

    school: School | None
    place: str | None
    start: int
    end: int


@dataclass(frozen=True)
class Duty:
    """Something that somebody has promised to do at a place, minutes of the day."""

    start: int
    end: int
    activity: str
    place: str


@dataclass
class ResidentDraft:
    """A resident in the making.

    Attributes
    ----------
    status
        worker, freelancer, student, retired, guest or pupil.
    household
        Index of their household.
    job
        Their trade, for those who work at a place.
    occupation
        Title, as it is written.
    subject
        What a student studies; what a retired person, a freelancer or a guest is known for.
    shift
        Working hours of the day, or those at school, minutes; None for those who have none.
    lessons
        A pupil's school; None on a day without.
    duties
        What they do for the children of their household, in the order of the day.
    out_until, home_by
        Until when they go out alone, and when they are back from meetings, minutes of the day.
    first_shift
        Whether they work the first part of a long day rather than the last.
    days_off
        Days of the week on which they don't work though their place is open, 0 Monday .. 6 Sunday.
    """

    id: str
    gender: str
    age: int
    status: str
    household: int
    first: str = ""
    last: str = ""
    personality: Personality | None = None
    values: list[str] = field(default_factory=list)
    hobbies: list[Hobby] = field(default_factory=list)
    early: float = 0.5
    job: Job | None = None
    occupation: str = ""
    subject: str = ""
    home: str = ""
    workplace: str | None = None
    shift: tuple[int, int] | None = None
    lessons: Lessons | None = None
    duties: list[Duty] = field(default_factory=list)
    out_until: int = 24 * 60
    home_by: int = 24 * 60
    first_shift: bool = True
    days_off: frozenset[int] = frozenset()

    @property
    def child(self) -> bool:
        """Whether they are not grown up."""
        return self.age < GROWN_UP

    @property
    def day_off(self) -> bool:
        """Whether they neither work nor learn on the day though on others they do."""
        return self.shift is None and self.lessons is None and self.status in ("worker", "student", "pupil")

    @property
    def drive(self) -> float:
        """Return how much they work beyond what others do, about -0.6 to 0.7, 0 for most."""
        ambition = 0.3 * ("achievement" in self.values) + 0.1 * ("power" in self.values)
        return self.character.conscientiousness - 0.6 + ambition

    @property
    def character(self) -> Personality:
        """Their personality, once drawn."""
        assert self.personality is not None
        return self.personality

    @property
    def pace(self) -> float:
        """Return how fast they walk, m/s."""
        return walk_speed(self.age)

    @property
    def she(self) -> str:
        """She or he."""
        return "she" if self.gender == "female" else "he"

    @property
    def her(self) -> str:
        """Possessive: her or his."""
        return "her" if self.gender == "female" else "his"


@dataclass
class Household:
    """People who share a home, and what they are to each other."""

    kind: str
    members: list[ResidentDraft]
    home: str = ""

    @property
    def adults(self) -> list[ResidentDraft]:
        """Those who are grown up."""
        return [member for member in self.members if not member.child]

    @property
    def children(self) -> list[ResidentDraft]:
        """Those who are not, the oldest first."""
        return [member for member in self.members if member.child]


def draw_character(rng: np.random.Generator, draft: ResidentDraft, uses: dict[str, int]) -> None:
    """Give somebody a personality, values and hobbies that go together.

    Parameters
    ----------
    uses
        How often each hobby has been given so far; common ones become less likely. Updated.
    """
    five = np.clip(rng.normal(0.55, 0.19, 5), 0.05, 0.95)
    names = ("openness", "conscientiousness", "extraversion", "agreeableness", "neuroticism")
    diligent, nervous = names.index("conscientiousness"), names.index("neuroticism")
    # The conscientious are made by the years.
    older = 0.08 if draft.age > 45 else -0.10 if draft.child else 0.0
    five[diligent] = np.clip(five[diligent] + older, 0.05, 0.95)
    five[nervous] = max(0.05, five[nervous] - 0.1)
    scores = {name: round(float(v), 2) for name, v in zip(names, five, strict=True)}
    # The words for the two or three traits that stand out most from the middle.
    order = sorted(names, key=lambda name: (-abs(scores[name] - 0.5), name))
    traits = []
    for name in order[: 2 + int(rng.integers(2))]:
        words = trait_words()[name].high if scores[name] >= 0.5 else trait_words()[name].low
        traits.append(words[int(rng.integers(len(words)))])
    draft.personality = Personality(**scores, traits=traits)
    values, pastimes = basic_values(), hobbies()
    weights = np.array(
        [max(0.15, 0.5 + sum(w * (scores[t] - 0.5) * 3 for t, w in value.leans.items())) for value in values]
    )
    picks = rng.choice(len(values), 3, replace=False, p=weights / weights.sum())
    draft.values = [values[int(k)].name for k in picks]
    low_age, high_age = np.array([h.ages for h in pastimes]).T
    fits = np.array([h.weight for h in pastimes]) * (low_age <= draft.age) * (draft.age <= high_age)
    for k, hobby in enumerate(pastimes):
        fits[k] *= 0.35 ** uses.get(hobby.name, 0)
        fits[k] *= max(0.1, 1 + sum((scores[t] - 0.5) * 2.5 for t in hobby.traits))
        fits[k] *= 1.8 if set(hobby.values) & set(draft.values) else 1.0
    picks = rng.choice(len(pastimes), 2 + int(rng.random() < 0.55), replace=False, p=fits / fits.sum())
    draft.hobbies = [pastimes[int(k)] for k in picks]
    for hobby in draft.hobbies:
        uses[hobby.name] = uses.get(hobby.name, 0) + 1
    lark = 0.35 + 0.4 * (scores["conscientiousness"] - 0.5) + (draft.age - 40) / 90
    draft.early = float(np.clip(rng.normal(lark + 0.15, 0.18), 0, 1))


class NameBook:
    """Gives names, none twice; first names repeat only when all have been given.

    Parameters
    ----------
    rng
        Decides the order.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        known = names()
        self._first = {
            "female": [known.female[k] for k in rng.permutation(len(known.female))],
            "male": [known.male[k] for k in rng.permutation(len(known.male))],
        }
        self._last = [known.last[k] for k in rng.permutation(len(known.last))]
        self._given = {"female": 0, "male": 0}
        self._families = 0
        self._used: set[str] = set()
        self._initials: dict[str, int] = {}

    def family(self) -> str:
        """Return a last name for a new family."""
        name = self._last[self._families % len(self._last)]
        self._families += 1
        return name

    def full(self, gender: str, last: str) -> str:
        """Return a full name nobody has yet, with one of the least used initials: people are easily told apart."""
        pool, given = self._first[gender], self._given[gender]
        start = given % len(pool)
        if start == 0:
            self._initials.clear()
        best = min(
            (k for k in range(start, len(pool)) if f"{pool[k]} {last}" not in self._used and pool[k][:2] != last[:2]),
            key=lambda k: (self._initials.get(pool[k][0], 0), k),
            default=None,
        )
        if best is None:
            self._given[gender] += len(pool) - start
            return self.full(gender, self.family())
        pool[start], pool[best] = pool[best], pool[start]
        self._given[gender] += 1
        first = pool[start]
        self._initials[first[0]] = self._initials.get(first[0], 0) + 1
        name = f"{first} {last}"
        self._used.add(name)
        return name


# Kind, weight, and the status of each member; w worker, f freelancer, s student, r retired, g guest, c child.
_HOUSEHOLDS: tuple[tuple[str, float, str], ...] = (
    ("single", 4.0, "w"),
    ("single", 1.3, "f"),
    ("single", 1.2, "r"),
    ("single", 0.6, "s"),
    ("couple", 1.9, "ww"),
    ("couple", 1.3, "wf"),
    ("couple", 1.1, "rr"),
    ("couple", 0.3, "wr"),
    ("flatmates", 1.0, "ss"),
    ("flatmates", 0.6, "ssw"),
    ("flatmates", 1.0, "ww"),
    ("parent", 0.9, "ws"),
    ("parent", 0.3, "ww"),
    ("siblings", 0.7, "ww"),
    ("guest", 1.0, "g"),
    ("family", 2.2, "wwc"),
    ("family", 2.6, "wwcc"),
    ("family", 0.8, "wwccc"),
    ("family", 1.0, "wfc"),
    ("family", 1.2, "wfcc"),
    ("family", 1.1, "wc"),
    ("family", 0.7, "wcc"),
    ("family", 0.3, "fc"),
    ("family", 0.1, "ffcc"),
)
_STATUS = {"w": "worker", "f": "freelancer", "s": "student", "r": "retired", "g": "guest", "c": "pupil"}
# Of a town's residents from five years on; those of 5 to 17 are about a seventh in older countries, a fifth elsewhere.
_SHARES = {"w": 0.48, "f": 0.10, "s": 0.10, "r": 0.13, "g": 0.04, "c": 0.15}
# Years between brothers and sisters, and from a parent to the eldest child: least, most usual, most.
_BETWEEN, _FIRST_CHILD = (1, 2, 6), (20, 29, 42)


def draw_households(
    rng: np.random.Generator, count: int, *, students: bool, guests: bool, workers: bool, largest: int = 5
) -> list[Household]:
    """Draw households for `count` people whose ways of life come in believable shares.

    Parameters
    ----------
    students, guests, workers
        Whether the world has somewhere to study, to stay for a while, and to work.
    largest
        Most members of a household: the beds of the largest home.
    """
    shares = dict(_SHARES)
    for letter, possible in (("s", students), ("g", guests), ("w", workers)):
        if not possible:
            shares[letter] = 0.0
    total = sum(shares.values())
    quota = {k: v / total * count for k, v in shares.items()}
    found: list[Household] = []
    people = 0
    while people < count:
        weights = np.zeros(len(_HOUSEHOLDS))
        for k, (_, weight, members) in enumerate(_HOUSEHOLDS):
            if people + len(members) > count or len(members) > largest or any(shares[m] == 0 for m in members):
                continue
            room = min(quota[m] - (members.count(m) - 1) for m in members)
            weights[k] = weight * (max(room, 0.02) if room < 1 else room**0.5)
        choice = int(rng.choice(len(_HOUSEHOLDS), p=weights / weights.sum()))
        kind, _, members = _HOUSEHOLDS[choice]
        drafts = _members(rng, kind, members, len(found), people)
        for m in members:
            quota[m] -= 1
        people += len(members)
        found.append(Household(kind, drafts))
    _name(rng, found)
    return found


def _age(rng: np.random.Generator, status: str, kind: str) -> int:
    spans = {
        "worker": (22, 34, 64),
        "freelancer": (25, 36, 62),
        "student": (18, 21, 27),
        "retired": (64, 70, 90),
        "guest": (26, 40, 60),
    }
    low, mode, high = (23, 27, 34) if kind == "flatmates" and status == "worker" else spans[status]
    return round(float(rng.triangular(low, mode, high)))


def _members(rng: np.random.Generator, kind: str, members: str, household: int, first: int) -> list[ResidentDraft]:
    statuses = [_STATUS[m] for m in members]
    ages = [0 if status == "pupil" else _age(rng, status, kind) for status in statuses]
    genders = [("female", "male")[int(rng.integers(2))] for _ in members]
    if kind == "family":
        ages = _ages_of_family(rng, statuses.index("pupil"), statuses.count("pupil"))
        if statuses[1] != "pupil" and rng.random() < 0.9:
            genders[1] = "male" if genders[0] == "female" else "female"
    elif kind == "couple":
        low, high = (63, 90) if statuses[1] == "retired" else (22, 64)
        if statuses == ["worker", "retired"]:
            ages[0], low = int(rng.integers(57, 65)), 63
        ages[1] = int(np.clip(ages[0] + round(float(rng.normal(0, 3))), low, high))
        if rng.random() < 0.85:
            genders[1] = "male" if genders[0] == "female" else "female"
    elif kind == "parent":
        child = int(rng.integers(18, 25)) if statuses[1] == "student" else int(rng.integers(21, 27))
        ages = [child + int(rng.integers(24, 36)), child]
    elif kind == "siblings":
        ages[0] = int(rng.integers(23, 45))
        ages[1] = ages[0] + int(rng.integers(2, 6))
    elif kind == "flatmates" and "student" in statuses:
        ages = [int(rng.integers(19, 26)) if s == "student" else int(rng.integers(22, 28)) for s in statuses]
    return [
        ResidentDraft(f"resident_{first + k}", gender, age, status, household)
        for k, (gender, age, status) in enumerate(zip(genders, ages, statuses, strict=True))
    ]


def _ages_of_family(rng: np.random.Generator, parents: int, children: int) -> list[int]:
    """Return the ages of parents and of their children, the eldest first."""
    eldest = int(rng.integers(YOUNGEST + 2 * (children - 1), GROWN_UP))
    ages = [eldest]
    for k in range(1, children):
        gap = round(float(rng.triangular(*_BETWEEN)))
        # The younger ones need a year each.
        ages.append(max(ages[-1] - gap, YOUNGEST + children - 1 - k))
    first = eldest + round(float(rng.triangular(*_FIRST_CHILD)))
    second = int(np.clip(first + round(float(rng.normal(0, 3))), eldest + _FIRST_CHILD[0] - 2, 64))
    return [min(first, 60), second][:parents] + ages


def _name(rng: np.random.Generator, households: Sequence[Household]) -> None:
    book = NameBook(rng)
    for household in households:
        family = book.family()
        shared = household.kind in ("parent", "siblings")
        if household.kind in ("couple", "family"):
            shared = bool(rng.random() < 0.5)
        for k, draft in enumerate(household.members):
            # Children are called as their first parent is.
            full = book.full(draft.gender, family if shared or k == 0 or draft.child else book.family())
            draft.first, draft.last = full.split(" ", 1)
