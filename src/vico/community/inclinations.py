"""How what matters to people shows in their days: data of ``inclinations.toml`` and of a user's own files."""

from __future__ import annotations

from pathlib import Path
from typing import TypeVar

from vico.community.catalogue import Ages, kind_sets
from vico.errors import SchemaError
from vico.io.data_files import DataRecord, cached_data, data_files, read_record

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
        inclination=tuple(_spelled(path, one) for path, file in files for one in file.inclination),
        friends=tuple(_spelled(path, one) for path, file in files for one in file.friends),
        help=tuple(one for _, file in files for one in file.help),
        together=tuple(_spelled(path, one) for path, file in files for one in file.together),
    )


def _spelled(path: Path, entry: E) -> E:
    kinds: list[str] = []
    sets = kind_sets()
    for kind in entry.kinds:
        if kind.startswith("@") and kind[1:] not in sets:
            raise SchemaError(f"{path}: kinds: no set is called {kind!r}; there are {', '.join(sorted(sets))}")
        kinds += sets[kind[1:]] if kind.startswith("@") else [kind]
    return entry.model_copy(update={"kinds": tuple(kinds)})
