"""What stands for a thing people carry in physics: its mass, and a few convex solids, as its entry says."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.assets.models.movable import movable_entry
from vico.assets.models.schema import SolidBox, SolidCylinder, SolidPart
from vico.quaternions import quaternion_of

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
        return quaternion_of(self.rotation)

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
