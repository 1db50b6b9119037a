"""Children of 5 to 17: what the data say of their schools, their days and their words.

``vico/data/community/children.toml`` holds it, and files ``children*.toml`` of a user's own: schools are added, all
else is replaced. Nobody younger lives in a community.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from pydantic import Field

from vico.community.catalogue import Ages, Pastime
from vico.errors import SchemaError
from vico.io.data_files import DataRecord, cached_data, data_files, read_record

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
        """When lessons may begin, minutes of the day."""
        return tuple(int(t[:2]) * 60 + int(t[3:]) for t in self.begins)


class HomeSchool(DataRecord):
    """How those learn who have no school within reach."""

    title: str
    morning: str
    afternoon: str
    told: tuple[str, ...]


class DayOff(DataRecord):
    """A day without school."""

    activity: str


class Escorts(DataRecord):
    """What it is called to take small children to school, and to fetch them; {names} are theirs.

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
    """What children do at home; `at_school` is lunch there."""

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
