"""The words communities are made of, read from data files: trades, ways of life, hobbies, groups, names, sentences.

``vico/data/community`` holds the files, and ``$VICO_DATA/community`` those of a user; ``docs/adding_people.md`` says
how to add an entry, or to write them in another language. ``inclinations.toml`` says how what matters to people shows
in their days.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Literal, TypeVar

from pydantic import Field

from vico.community.model import ActivityTag
from vico.errors import SchemaError
from vico.io.data_files import DataRecord, cached_data, data_files, read_record
from vico.world.model import Category

Ages = tuple[int, int]
Score = Annotated[float, Field(ge=-1.0, le=1.0)]
Status = Literal["worker", "freelancer", "student", "retired", "guest", "pupil"]
Shift = Literal["office", "bank", "school", "health", "hotel", "sport", "evening", "kitchen", "early", "shop", "day"]
ADULTS: tuple[Status, ...] = ("worker", "freelancer", "student", "retired", "guest")


class Job(DataRecord):
    """A trade.

    Attributes
    ----------
    title
        As in "is a ...".
    kinds
        Kinds of places that employ it.
    task
        What one sees them do there: the activity of their working hours, "... at PLACE".
    shift
        Which pattern the hours follow; see `vico.community.work`.
    weight
        How common, besides the number of places.
    ages
        Youngest and oldest, years.
    pay
        0..1, decides cash in hand.
    root
        How they came to it: completes "PRONOUN ...".
    """

    title: str
    kinds: tuple[str, ...] = ()
    task: str
    shift: Shift
    weight: Annotated[float, Field(gt=0.0)] = 1.0
    ages: Ages
    pay: Annotated[float, Field(ge=0.0, le=1.0)]
    root: str


class FallbackJob(Job):
    """A trade for places of a category whose kind no trade names."""

    category: Category


class _Trades(DataRecord):
    kind_sets: dict[str, tuple[str, ...]] = Field(default_factory=dict)
    trade: tuple[Job, ...] = ()
    fallback: tuple[FallbackJob, ...] = ()


class Freelancer(DataRecord):
    """A trade that needs no place of its own.

    Attributes
    ----------
    at_desk, at_cafe
        What they do at home and at a cafe.
    root
        Completes "PRONOUN ...".
    pay
        0..1, decides cash in hand.
    """

    title: str
    at_desk: str
    at_cafe: str
    root: str
    pay: Annotated[float, Field(ge=0.0, le=1.0)]


class FormerTrade(DataRecord):
    """Former trade of a retired person: `title` completes "a retired ...", `told` completes "PRONOUN ..."."""

    title: str
    told: str


class Visitor(DataRecord):
    """Why a guest is in town: `purpose` completes "a guest who ...", `activity` fills the working day."""

    title: str
    purpose: str
    activity: str


class WaysOfLife(DataRecord):
    """People without a place of work, and the subjects of students."""

    subjects: tuple[str, ...] = ()
    freelancer: tuple[Freelancer, ...] = ()
    retired: tuple[FormerTrade, ...] = ()
    guest: tuple[Visitor, ...] = ()


class Value(DataRecord):
    """One of Schwartz's ten basic values.

    Attributes
    ----------
    leans
        How the big five lean towards it, -1..1 by trait.
    says
        Each completes "PRONOUN ..." in a biography.
    """

    name: str
    leans: dict[str, Score]
    says: tuple[str, ...]


class TraitWords(DataRecord):
    """Words for high and for low scores of one of the big five."""

    high: tuple[str, ...]
    low: tuple[str, ...]


class Claim(DataRecord):
    """Claim of words for somebody about their days: `measure` of `vico.community.day.DayMeasures` in bounds."""

    says: tuple[str, ...]
    measure: Literal[
        "out", "work", "company", "alone", "exercise", "meals_out", "dinners_out", "meals_home", "rides", "visiting",
        "rises", "retires",
    ]  # fmt: skip
    least: float | None = None
    most: float | None = None


class Way(DataRecord):
    """Something that is said of how somebody lives, if their days agree.

    Attributes
    ----------
    text
        Completes "Night owl; ...".
    values, hobbies
        Who it is said of first: those with one of these values or hobbies.
    trait, least, most
        Or those whose score of one of the big five lies within these bounds.
    statuses
        Ways of life it is for.
    """

    text: str
    values: tuple[str, ...] = ()
    hobbies: tuple[str, ...] = ()
    trait: str | None = None
    least: float = 0.0
    most: float = 1.0
    statuses: tuple[Status, ...] = ADULTS


class Character(DataRecord):
    """Values of people, and the words for their traits."""

    value: tuple[Value, ...] = ()
    claim: tuple[Claim, ...] = ()
    way: tuple[Way, ...] = ()
    traits: dict[str, TraitWords] = Field(default_factory=dict)


class Hobby(DataRecord):
    """Something people do for its own sake.

    Attributes
    ----------
    name
        As in "likes NAME".
    at_home
        Activity at home; empty if it can't be done there.
    out, kinds
        Activity elsewhere ("... at PLACE") and the kinds of places for it; empty if it is done at home only.
    traits, values
        Which people tend to have it.
    ages
        Youngest and oldest, years.
    active
        Keeps them fit.
    tag
        What going out for it is about; ``exercise`` where it keeps them fit and ``leisure`` elsewhere, unless given.
    """

    name: str
    at_home: str = ""
    out: str = ""
    kinds: tuple[str, ...] = ()
    traits: tuple[str, ...] = ()
    values: tuple[str, ...] = ()
    ages: Ages = (16, 90)
    weight: Annotated[float, Field(gt=0.0)] = 1.0
    active: bool = False
    tag: ActivityTag | None = None

    @property
    def about(self) -> ActivityTag:
        """Tag of an outing for it."""
        return self.tag or (ActivityTag.EXERCISE if self.active else ActivityTag.LEISURE)


class Circle(DataRecord):
    """A kind of group.

    Attributes
    ----------
    name
        As it is written; the meeting place's name is added where two groups would share it.
    activity
        What they do when they meet: the activity in schedules, "... at PLACE".
    description
        One or two sentences, the first about what they do.
    kinds
        Kinds of places where they can meet.
    times, minutes
        When a meeting may start, HH:MM, and how long it takes.
    hobbies, values
        Who is drawn to it.
    statuses
        Ways of life it is for; adults' unless given.
    ages
        Youngest and oldest, years.
    small_children
        Whether it is for those who go nowhere alone, and for who looks after them.
    slot
        Part of the day.
    meal
        Whether meeting is a meal.
    tag
        What meeting is about: ``group``, or ``exercise`` and ``leisure`` for those who run and walk about together.
    meets
        On which days besides the first, at the same time: that day of the week, every working day, or every day.
    """

    name: str
    activity: str
    description: str
    kinds: tuple[str, ...]
    slot: Literal["morning", "lunch", "afternoon", "evening"]
    times: tuple[Annotated[str, Field(pattern=r"^([01]\d|2[0-3]):[0-5]\d$")], ...]
    minutes: Annotated[int, Field(gt=0)]
    hobbies: tuple[str, ...] = ()
    values: tuple[str, ...] = ()
    statuses: tuple[Status, ...] = ADULTS
    ages: Ages = (16, 90)
    small_children: bool = False
    meal: bool = False
    tag: ActivityTag = ActivityTag.GROUP
    meets: Literal["weekly", "working_days", "daily"] = "weekly"

    @property
    def starts(self) -> tuple[int, ...]:
        """Return when a meeting may start, minutes of the day."""
        return tuple(int(t[:2]) * 60 + int(t[3:]) for t in self.times)


class Leisure(DataRecord):
    """Hobbies, the groups that grow from them, and sets of kinds of places that both name."""

    kind_sets: dict[str, tuple[str, ...]] = Field(default_factory=dict)
    hobby: tuple[Hobby, ...] = ()
    group: tuple[Circle, ...] = ()
    neighbours: Circle | None = None
    playmates: Circle | None = None


class Names(DataRecord):
    """First and last names of people who don't exist."""

    female: tuple[str, ...] = ()
    male: tuple[str, ...] = ()
    last: tuple[str, ...] = ()


class Pastime(DataRecord):
    """Something to do at home, and between which hours of the day."""

    text: str
    hours: tuple[int, int]


class Pastimes(DataRecord):
    """Pastimes of everybody, and of some."""

    chores: tuple[Pastime, ...] = ()
    young: tuple[Pastime, ...] = ()
    old: tuple[Pastime, ...] = ()
    guest: tuple[Pastime, ...] = ()


class GuestMeals(DataRecord):
    """Kinds of places where guests of a hotel eat."""

    breakfast: str
    lunch: str
    dinner: str


class AtHome(DataRecord):
    """Routines at home: one of each list is somebody's way; `brief` is what there is time for in minutes."""

    brief: str = "Change and set out again"

    morning: tuple[str, ...]
    breakfast: tuple[str, ...]
    lunch: tuple[str, ...]
    dinner: tuple[str, ...]
    wind_down: tuple[str, ...]
    guest_meals: GuestMeals
    pastimes: Pastimes


class OutingKinds(DataRecord):
    """Kinds of places for meals, for groceries and for sights, best first."""

    lunch: tuple[str, ...]
    dinner: tuple[str, ...]
    groceries: tuple[str, ...]
    sights: tuple[str, ...]


class Errands(DataRecord):
    """Purposes of going to a kind of place, and the kinds of places of other outings."""

    errands: dict[str, str]
    kinds: OutingKinds


class BiographySentences(DataRecord):
    """Sentences of biographies, with names in braces; see the file."""

    character: tuple[str, ...]
    group: tuple[str, ...]
    hobbies: tuple[str, ...]


R = TypeVar("R", bound=DataRecord)


@cached_data
def trades() -> tuple[Job, ...]:
    """Return all trades, in the order of the files."""
    return tuple(
        _with_kinds(job, file.kind_sets, path) for path, file in _read("trades", _Trades) for job in file.trade
    )


@cached_data
def fallback_trades() -> Mapping[Category, Job]:
    """Return who works in a category of places when no trade names the kind of the place."""
    return {job.category: job for _, file in _read("trades", _Trades) for job in file.fallback}


@cached_data
def ways_of_life() -> WaysOfLife:
    """Return freelancers, students' subjects, the retired and guests."""
    files = [file for _, file in _read("ways_of_life", WaysOfLife)]
    return WaysOfLife(
        subjects=tuple(x for f in files for x in f.subjects),
        freelancer=tuple(x for f in files for x in f.freelancer),
        retired=tuple(x for f in files for x in f.retired),
        guest=tuple(x for f in files for x in f.guest),
    )


@cached_data
def basic_values() -> tuple[Value, ...]:
    """Return the basic values."""
    return tuple(value for _, file in _read("character", Character) for value in file.value)


@cached_data
def claims() -> tuple[Claim, ...]:
    """Return what words for people say of their days."""
    return tuple(claim for _, file in _read("character", Character) for claim in file.claim)


@cached_data
def ways() -> tuple[Way, ...]:
    """Return what is said of how people live."""
    return tuple(way for _, file in _read("character", Character) for way in file.way)


@cached_data
def trait_words() -> Mapping[str, TraitWords]:
    """Return the words for high and low scores, by trait."""
    return {name: words for _, file in _read("character", Character) for name, words in file.traits.items()}


@cached_data
def hobbies() -> tuple[Hobby, ...]:
    """Return all hobbies, in the order of the files."""
    sets = kind_sets()
    return tuple(_with_kinds(h, sets, path) for path, file in _read("leisure", Leisure) for h in file.hobby)


@cached_data
def circles() -> tuple[Circle, ...]:
    """Return all kinds of groups, in the order of the files."""
    sets = kind_sets()
    return tuple(_with_kinds(c, sets, path) for path, file in _read("leisure", Leisure) for c in file.group)


@cached_data
def neighbours_circle() -> Circle:
    """Return the group of last resort, for which any place with room will do."""
    return [file.neighbours for _, file in _read("leisure", Leisure) if file.neighbours is not None][-1]


@cached_data
def playmates_circle() -> Circle:
    """Return the group of last resort of small children, at the home of one of them."""
    return [file.playmates for _, file in _read("leisure", Leisure) if file.playmates is not None][-1]


@cached_data
def kind_sets() -> Mapping[str, tuple[str, ...]]:
    """Return the sets of kinds of places that hobbies and groups name, by name."""
    return {name: kinds for _, file in _read("leisure", Leisure) for name, kinds in file.kind_sets.items()}


@cached_data
def names() -> Names:
    """Return first and last names."""
    files = [file for _, file in _read("names", Names)]
    return Names(
        female=tuple(x for f in files for x in f.female),
        male=tuple(x for f in files for x in f.male),
        last=tuple(x for f in files for x in f.last),
    )


@cached_data
def at_home() -> AtHome:
    """Return what people do at home; a user's file replaces the package's."""
    return _last("at_home", AtHome)


@cached_data
def errands() -> Errands:
    """Return errands and outings; a user's file replaces the package's."""
    return _last("errands", Errands)


@cached_data
def biography_sentences() -> BiographySentences:
    """Return the sentences of biographies; a user's file replaces the package's."""
    return _last("biography", BiographySentences)


def _read(kind: str, record: type[R]) -> list[tuple[Path, R]]:
    return [(path, read_record(path, record)) for path in data_files("community", kind)]


def _last(kind: str, record: type[R]) -> R:
    return _read(kind, record)[-1][1]


K = TypeVar("K", Job, Hobby, Circle)


def _with_kinds(entry: K, sets: Mapping[str, Sequence[str]], path: Path) -> K:
    """Put the members of sets in the place of their names ("@cafes")."""
    kinds: list[str] = []
    for kind in entry.kinds:
        if not kind.startswith("@"):
            kinds.append(kind)
        elif kind[1:] in sets:
            kinds += sets[kind[1:]]
        else:
            raise SchemaError(
                f"{path}: kinds: no set is called {kind!r}; there are {', '.join(sorted(sets)) or 'none'}"
            )
    return entry.model_copy(update={"kinds": tuple(kinds)})


_GUIDE = "docs/adding_people.md"


class Inclination(DataRecord):
    """Something that people do for the sake of a value.

    Attributes
    ----------
    value
        One of the basic values of ``character.toml``.
    kinds
        Kinds of places for it; without any it is done at home.
    minutes
        Least and most it takes; at home it takes what time there is.
    hours
        Hours of the day between which it is done.
    """

    value: str
    activity: str
    kinds: tuple[str, ...] = ()
    minutes: tuple[int, int] = (30, 60)
    hours: tuple[int, int]
    ages: Ages = (5, 90)


class FriendsPlan(DataRecord):
    """Something that friends meet for; `meal`: it is a meal."""

    activity: str
    kinds: tuple[str, ...]
    minutes: tuple[int, int]
    hours: tuple[int, int]
    ages: Ages = (10, 90)
    meal: bool = False


class Help(DataRecord):
    """Something done for others at their home; {name} is the other, in the words of the helper and of the host."""

    activity: str
    host: str
    minutes: tuple[int, int]


class Together(DataRecord):
    """Something those who share a home do together; `small_children`: only those with small children."""

    activity: str
    kinds: tuple[str, ...]
    minutes: tuple[int, int]
    small_children: bool = False


class Inclinations(DataRecord):
    """All of a file."""

    inclination: tuple[Inclination, ...] = ()
    friends: tuple[FriendsPlan, ...] = ()
    help: tuple[Help, ...] = ()
    together: tuple[Together, ...] = ()


E = TypeVar("E", Inclination, FriendsPlan, Together)


@cached_data
def inclinations() -> Inclinations:
    """Return what all files say, sets of kinds in the place of their names.

    Raises
    ------
    SchemaError
        If a file can't be used.
    """
    files = [(path, read_record(path, Inclinations, guide=_GUIDE)) for path in data_files("community", "inclinations")]
    return Inclinations(
        inclination=tuple(_expand_kind_sets(path, one) for path, file in files for one in file.inclination),
        friends=tuple(_expand_kind_sets(path, one) for path, file in files for one in file.friends),
        help=tuple(one for _, file in files for one in file.help),
        together=tuple(_expand_kind_sets(path, one) for path, file in files for one in file.together),
    )


def _expand_kind_sets(path: Path, entry: E) -> E:
    kinds: list[str] = []
    sets = kind_sets()
    for kind in entry.kinds:
        if kind.startswith("@") and kind[1:] not in sets:
            raise SchemaError(f"{path}: kinds: no set is called {kind!r}; there are {', '.join(sorted(sets))}")
        kinds += sets[kind[1:]] if kind.startswith("@") else [kind]
    return entry.model_copy(update={"kinds": tuple(kinds)})
