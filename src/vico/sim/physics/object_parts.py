"""What free rigid objects are made of: a fixed number of convex parts each, of which some are in use."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.errors import InputError
from vico.exact import apply_matrix
from vico.quaternions import matrix_of
from vico.sim.physics.records import BALL, BOX, CYLINDER, PARTS, RigidObject, RigidPart

Array = NDArray[np.float64]

_IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])
_IS_CYLINDER, _IS_BALL = (np.array([shape == one for shape in PARTS]) for one in (CYLINDER, BALL))
# Half the extent of parts that are not in use, metres: what a model holds has to be of some size.
_NOTHING = 1e-3
# Share of its box that a shape fills.
_FILLS = {BOX: 1.0, CYLINDER: np.pi / 4, BALL: np.pi / 6}


class PartRows(NamedTuple):
    """Parts of objects as numbers.

    Attributes
    ----------
    rows
        Half extents (zeros: not in use), middle in the object's frame, metres, and turn w, x, y, z, of each of
        `PARTS`; shape ``(..., parts, 10)``.
    """

    rows: Array

    @property
    def used(self) -> NDArray[np.bool_]:
        """Which are in use, shape ``(..., parts)``."""
        return np.asarray(self.rows[..., 0] > 0.0)

    @property
    def half(self) -> Array:
        """Half extents, metres, next to nothing of those that are not in use, shape ``(..., parts, 3)``."""
        return np.where(self.used[..., None], self.rows[..., :3], _NOTHING)

    @property
    def position(self) -> Array:
        """Middles in the object's frame, metres, shape ``(..., parts, 3)``."""
        return np.asarray(self.rows[..., 3:6])

    @property
    def quaternion(self) -> Array:
        """Turns in the object's frame, shape ``(..., parts, 4)``."""
        return np.where(self.used[..., None], self.rows[..., 6:], _IDENTITY)

    @property
    def sizes(self) -> Array:
        """What a model calls their sizes: of cylinders radius and half length, of balls the radius."""
        found = self.half.copy()
        found[..., _IS_CYLINDER, 1] = found[..., _IS_CYLINDER, 2]
        found[..., _IS_CYLINDER, 2] = 0.0
        found[..., _IS_BALL, 1:] = 0.0
        return found

    @property
    def radii(self) -> Array:
        """Of balls that hold them, metres, shape ``(..., parts)``."""
        squares = self.half * self.half
        squares[..., _IS_CYLINDER, 1] = 0.0
        squares[..., _IS_BALL, 1:] = 0.0
        return np.asarray(np.sqrt(squares.sum(axis=-1)))

    def bounds(self) -> tuple[Array, Array]:
        """Middles of the boxes round whole objects, and half their extents, metres, shape ``(n, 3)`` each."""
        reach = np.einsum("...ij,...j->...i", np.abs(matrix_of(self.quaternion)), self.half)
        low = np.where(self.used[..., None], self.position - reach, np.inf).min(axis=-2)
        high = np.where(self.used[..., None], self.position + reach, -np.inf).max(axis=-2)
        return (low + high) / 2, (high - low) / 2

    def inertia(self, mass: float) -> Array:
        """Moments of one object about its axes, kg m2, shape ``(3,)``, its mass spread evenly over its parts."""
        shares = np.where(self.used, np.prod(self.half, axis=-1), 0.0) * [_FILLS[shape] for shape in PARTS]
        found = np.zeros(3)
        for k in np.flatnonzero(self.used).tolist():
            part, squares = mass * float(shares[k] / shares.sum()), self.half[k] ** 2
            own = part * _moments(PARTS[k], squares)
            turn, away = matrix_of(self.quaternion[k]), self.position[k] ** 2
            found += apply_matrix(own, turn * turn) + part * (away.sum() - away)
        return found


def _moments(shape: str, squares: Array) -> Array:
    """Moments of a shape of one kilogram about its own axes, m2."""
    a, b, c = squares.tolist()
    if shape == CYLINDER:
        return np.array([a / 4 + c / 3, b / 4 + c / 3, a / 2])
    return np.array([b + c, a + c, a + b]) / (5.0 if shape == BALL else 3.0)


def box_parts(half: Array) -> PartRows:
    """Return the parts of a plain box."""
    rows = np.zeros((len(PARTS), 10))
    rows[PARTS.index(BOX)] = [*half, 0.0, 0.0, 0.0, *_IDENTITY]
    return PartRows(rows)


def parts_of(thing: RigidObject) -> PartRows:
    """Return the parts of an object.

    Raises
    ------
    InputError
        If extents or mass are not positive, or there is no room for so many parts of a shape.
    """
    size = np.asarray(thing.size, np.float64)
    if size.shape != (3,) or not (np.isfinite(size).all() and size.min() > 0.0 and thing.mass > 0.0):
        raise InputError(
            f"physics: an object needs three positive extents and a mass, not {size.tolist()}, {thing.mass} kg"
        )
    return _rows_of(thing.parts) if thing.parts else box_parts(size / 2)


def _rows_of(parts: Sequence[RigidPart]) -> PartRows:
    rows = np.zeros((len(PARTS), 10))
    for part in parts:
        free = [k for k, shape in enumerate(PARTS) if shape == part.shape and not rows[k, 0]]
        if not free:
            room = ", ".join(f"{PARTS.count(shape)} {shape}" for shape in dict.fromkeys(PARTS))
            raise InputError(f"physics: an object has no room for another {part.shape}; there is room for {room}")
        rows[free[0]] = [*part.half, *part.position, *part.quaternion]
    return PartRows(rows)
