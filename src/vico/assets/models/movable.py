"""Movable objects that people carry: shape and colours, how they are held, and what stands for them in physics.

Objects are small and recognisable, in plain colours, with the origin at the middle of the underside, z up. Physics
knows an object by its mass and a few convex solids, as its entry says.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.assets.models.library import GUIDE
from vico.assets.models.parts import Scope, surfaces_of
from vico.assets.models.schema import Grip, MovableEntry, MovableFile, SolidBox, SolidCylinder, SolidPart
from vico.assets.shapes import Colour
from vico.errors import InputError, SchemaError
from vico.geometry import quaternion_from_matrix
from vico.io.data_files import cached_data, data_files, read_record
from vico.world.mesh import Surface


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
    tasks
        Challenges whose tasks may be about it: assistant, robot.
    """

    kind: str
    size: tuple[float, float, float]
    sentence: str
    tasks: tuple[str, ...] = ()

    def described(self, colour: str) -> str:
        """Return what it is, with its colour and the right article."""
        return self.sentence.format(colour=colour).replace("a orange", "an orange")


@dataclass(frozen=True)
class _Painted:
    """An entry, the file it stands in, and that file's own colours."""

    entry: MovableEntry
    path: Path
    colours: Mapping[str, Colour]


@cached_data
def _files() -> list[tuple[Path, MovableFile]]:
    return [(path, read_record(path, MovableFile, guide=GUIDE)) for path in data_files("assets/models", "movable")]


@cached_data
def _entries() -> dict[str, _Painted]:
    return {kind: _Painted(entry, path, file.colours) for path, file in _files() for kind, entry in file.object.items()}


@cached_data
def movable_kinds() -> dict[str, MovableKind]:
    """Return every kind of thing, ours and the user's, by its name."""
    return {
        kind: MovableKind(kind, it.entry.size, it.entry.sentence, it.entry.tasks) for kind, it in _entries().items()
    }


def kinds_for(challenge: str) -> dict[str, MovableKind]:
    """Return the kinds that a challenge's tasks may be about, by name."""
    return {name: kind for name, kind in movable_kinds().items() if challenge in kind.tasks}


@cached_data
def movable_colours() -> dict[str, Colour]:
    """Return the colours in which each thing comes, sRGB, by name."""
    return {name: paint for _, file in _files() for name, paint in file.paints.items()}


def movable_prototype(kind: str, colour: str) -> str:
    """Return the name of the prototype of a thing, e.g. ``good/backpack/red``."""
    return f"good/{kind}/{colour}"


def movable_entry(prototype: str) -> MovableEntry | None:
    """Return what the catalogue says of a prototype; None of one that is not made from it."""
    found = _entries().get(prototype.split("/")[1]) if prototype.startswith("good/") else None
    return None if found is None else found.entry


#: Smaller ones are carried in a hand, ones as wide and as deep as the second before the chest, metres.
_HAND_GRIP, _ARMS_GRIP = 0.22, 0.26


def movable_grip(prototype: str, size: ArrayLike) -> Grip:
    """Return how a thing is carried: as its entry says, else by its extents, metres, shape ``(3,)``."""
    entry = movable_entry(prototype)
    if entry is not None and entry.grip is not None:
        return entry.grip
    small, middle, large = sorted(np.asarray(size, np.float64).tolist())
    if large <= _HAND_GRIP or (middle <= 0.5 * _HAND_GRIP and large <= 2 * _HAND_GRIP):
        return "hand"
    return "arms" if middle >= _ARMS_GRIP and small >= 0.5 * _ARMS_GRIP else "handle"


def movable_surfaces(kind: str, colour: str) -> list[Surface]:
    """Make the model of a thing.

    Raises
    ------
    InputError
        If the kind or the colour is not in the catalogue.
    """
    entries, paints = _entries(), movable_colours()
    if kind not in entries:
        raise InputError(f"goods: no thing called {kind!r}; there are {', '.join(entries)}")
    if colour not in paints:
        raise InputError(f"goods: no colour called {colour!r}; there are {', '.join(paints)}")
    it = entries[kind]
    try:
        return surfaces_of(it.entry.parts, Scope({**it.colours, **_shades(paints[colour])}, {}))
    except InputError as error:
        raise SchemaError(f"{it.path}: object.{kind}: {error}; see {GUIDE}") from None


def _shades(paint: Colour) -> dict[str, Colour]:
    r, g, b = paint
    return {
        "paint": (r, g, b),
        "paint_dark": (r * 2 // 3, g * 2 // 3, b * 2 // 3),
        "paint_light": (min(r + 60, 255), min(g + 60, 255), min(b + 60, 255)),
    }


Array = NDArray[np.float64]


class Solid(NamedTuple):
    """A convex solid of a thing.

    Attributes
    ----------
    shape
        box, cylinder (along its z) or ball.
    half
        Half its extents along its own axes, metres, shape ``(3,)``.
    middle
        In the thing's frame, whose origin is the middle of its underside, metres, shape ``(3,)``.
    rotation
        To the thing's frame, shape ``(3, 3)``.
    """

    shape: str
    half: Array
    middle: Array
    rotation: Array

    @property
    def quaternion(self) -> Array:
        """The rotation as w, x, y, z."""
        return quaternion_from_matrix(self.rotation)

    @property
    def volume(self) -> float:
        """Cubic metres."""
        box = 8.0 * float(np.prod(self.half))
        return box * {"box": 1.0, "cylinder": math.pi / 4, "ball": math.pi / 6}[self.shape]


def movable_mass(prototype: str) -> float | None:
    """Return what a thing weighs as its entry says, kilograms; None where none says so."""
    entry = movable_entry(prototype)
    return None if entry is None else entry.mass


def movable_solids(prototype: str) -> list[Solid]:
    """Return the solids that stand for a thing, as its entry says; none where the box of its size does."""
    entry = movable_entry(prototype)
    return [] if entry is None else [_solid(part) for part in entry.solid]


def _solid(part: SolidPart) -> Solid:
    p, y = math.radians(part.pitch), math.radians(part.yaw)
    about_y = np.array([[math.cos(p), 0.0, math.sin(p)], [0.0, 1.0, 0.0], [-math.sin(p), 0.0, math.cos(p)]])
    about_z = np.array([[math.cos(y), -math.sin(y), 0.0], [math.sin(y), math.cos(y), 0.0], [0.0, 0.0, 1.0]])
    rotation, at = about_z @ about_y, np.array(part.at, np.float64)
    if isinstance(part, SolidBox):
        return Solid("box", np.array(part.size) / 2, at, rotation)
    if isinstance(part, SolidCylinder):
        half = np.array([part.radius, part.radius, part.length / 2])
        return Solid("cylinder", half, at + rotation[:, 2] * part.length / 2, rotation)
    return Solid("ball", np.full(3, part.radius), at, rotation)
