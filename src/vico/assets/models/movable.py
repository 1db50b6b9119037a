"""Things people carry: small, recognisable, in plain colours; origin at the middle of the underside, z up."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

from vico.assets.models.files import DATA, GUIDE, read_entries
from vico.assets.models.parts import Scope, surfaces_of
from vico.assets.models.schema import MovableEntry, MovableFile
from vico.assets.shapes import Colour
from vico.errors import InputError, SchemaError
from vico.world.mesh import Surface

FILE = DATA / "movable.toml"


@dataclass(frozen=True)
class MovableKind:
    """A kind of thing.

    Attributes
    ----------
    kind
        Its name: "backpack".
    size
        Extent along x, y, z at rest, metres.
    sentence
        What it is, for instructions: "a {colour} backpack".
    """

    kind: str
    size: tuple[float, float, float]
    sentence: str

    def described(self, colour: str) -> str:
        """Return what it is, with its colour and the right article."""
        return self.sentence.format(colour=colour).replace("a orange", "an orange")


@cache
def _file() -> MovableFile:
    return read_entries(FILE, MovableFile)


@cache
def movable_kinds() -> dict[str, MovableKind]:
    """Return every kind of thing, by its name."""
    return {kind: MovableKind(kind, entry.size, entry.sentence) for kind, entry in _file().object.items()}


def movable_colours() -> dict[str, Colour]:
    """Return the colours in which each thing comes, sRGB, by name."""
    return _file().paints


def movable_prototype(kind: str, colour: str) -> str:
    """Return the name of the prototype of a thing, e.g. ``good/backpack/red``."""
    return f"good/{kind}/{colour}"


def movable_surfaces(kind: str, colour: str) -> list[Surface]:
    """Make the model of a thing.

    Raises
    ------
    InputError
        If the kind or the colour is not in the catalogue.
    """
    file = _file()
    if kind not in file.object:
        raise InputError(f"goods: no thing called {kind!r}; there are {', '.join(file.object)}")
    if colour not in file.paints:
        raise InputError(f"goods: no colour called {colour!r}; there are {', '.join(file.paints)}")
    return _painted(file.object[kind], file, colour, f"{FILE}: object.{kind}")


def _painted(entry: MovableEntry, file: MovableFile, colour: str, where: str) -> list[Surface]:
    r, g, b = file.paints[colour]
    shades: dict[str, Colour] = {
        "paint": (r, g, b),
        "paint_dark": (r * 2 // 3, g * 2 // 3, b * 2 // 3),
        "paint_light": (min(r + 60, 255), min(g + 60, 255), min(b + 60, 255)),
    }
    try:
        return surfaces_of(entry.parts, Scope({**file.colours, **shades}, {}))
    except InputError as error:
        raise SchemaError(f"{where}: {error}; {GUIDE}") from None
