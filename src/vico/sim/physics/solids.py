"""Where something solid stands: cells of the ground from which a robot could reach it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.exact import apply_matrix
from vico.io.compiled import compiled
from vico.sim.physics.records import StaticScene

#: Side of a cell, metres.
_CELL = 0.5
#: Directions in which the outline of a solid is measured: what lies between them counts to it.
_DIRECTIONS = np.stack([np.cos(np.arange(16) * np.pi / 8), np.sin(np.arange(16) * np.pi / 8)], axis=1)


#: Metres a robot, or a link of one, may move before it is asked again.
SLACK = 0.1
_HALF_DIAGONAL = _CELL * math.sqrt(0.5)
# What a distance kept with 4 bytes may be wrong by, metres.
_ROUNDING = 1e-3


@compiled
def _measure(cells, corner, outlines, directions, reach):  # type: ignore[no-untyped-def]
    """Write how far each cell's middle is from the nearest outline, and how high the highest within `reach` goes.

    The first cell begins at `corner`. Outlines are given by how far they go in each direction, and their tops.
    """
    away, tops = cells
    count = len(away)
    west, south = corner
    for k in range(len(outlines[0])):
        outline, top = outlines[0][k], outlines[1][k]
        # The first, fifth, ninth and thirteenth direction are east, north, west and south.
        first_column = max(int((-outline[8] - reach - west) / _CELL), 0)
        last_column = min(int((outline[0] + reach - west) / _CELL), count - 1)
        first_row = max(int((-outline[12] - reach - south) / _CELL), 0)
        last_row = min(int((outline[4] + reach - south) / _CELL), count - 1)
        for row in range(first_row, last_row + 1):
            y = (row + 0.5) * _CELL + south
            for column in range(first_column, last_column + 1):
                x = (column + 0.5) * _CELL + west
                outside = 0.0
                for d in range(len(directions)):
                    outside = max(outside, directions[d, 0] * x + directions[d, 1] * y - outline[d])
                    if outside > reach:
                        break
                if outside <= reach:
                    away[row, column] = min(away[row, column], outside)
                    tops[row, column] = max(tops[row, column], top)


@compiled
def is_clear(cells, point, radius):  # type: ignore[no-untyped-def]
    """Return whether nothing solid is within some metres of a point, `radius` no more than the cells are made for.

    Of points that no square holds it is not known: False.
    """
    number, away, tops, half, side = cells
    east, north = point[0] + half, point[1] + half
    across, up = math.floor(east / side), math.floor(north / side)
    if not (0 <= up < len(number) and 0 <= across < len(number)):
        return False
    k = number[int(up), int(across)]
    if k < 0:
        return False
    last = away.shape[1] - 1
    r, c = min(int((north - up * side) / _CELL), last), min(int((east - across * side) / _CELL), last)
    return away[k, r, c] > radius + _HALF_DIAGONAL + _ROUNDING or point[2] - radius > tops[k, r, c]


@compiled
def find_near(cells, reach, seconds, state, near):  # type: ignore[no-untyped-def]
    """Say of each robot whether it could touch something solid within some seconds.

    Parameters
    ----------
    cells
        As `SolidCells.cells`.
    reach
        Metres from a robot's base within which all of it is, shape ``(n,)``.
    state
        Positions and speeds as the engine orders them, and where in them each robot's base begins, shape ``(n, 2)``.
    near
        Written, bool, shape ``(n,)``.
    """
    positions, speeds, first = state
    for k in range(len(first)):
        q, v = first[k, 0], first[k, 1]
        speed = math.sqrt(speeds[v] ** 2 + speeds[v + 1] ** 2 + speeds[v + 2] ** 2)
        near[k] = True
        if 2.0 * speed * seconds < SLACK:
            point = positions[q], positions[q + 1], positions[q + 2]
            near[k] = not is_clear(cells, point, reach[k] + SLACK)


class SolidCells:
    """Square grids of how far solids are, and how high: one for each of a scene's squares.

    Parameters
    ----------
    scene
        What never moves.
    reaches
        Metres from its base within which all of each robot is, shape ``(robots,)``.

    Attributes
    ----------
    number
        Which of the squares each place of the ground is in, from the south-west; -1 in none; int32, shape ``(m, m)``.
    away
        Metres from a cell's middle to the outline of the nearest solid, at least; inf where that is further than any
        robot in the cell could reach; float32, shape ``(squares, n, n)``, row = y.
    tops
        Height to which those solids go that a robot in the cell could reach, metres; -inf for none; like `away`.
    half
        Half the side of the ground, metres.
    side
        Of a square, metres.
    reaches
        As given.
    """

    def __init__(self, scene: StaticScene, reaches: NDArray[np.float64]) -> None:
        self.half = float(scene.height.half)
        self.reaches = reaches
        corners, self.side = scene.squares, scene.side
        if corners is None:
            corners, self.side = np.full((1, 2), -self.half), 2 * self.half
        along = max(round(2 * self.half / self.side), 1)
        self.number = np.full((along, along), -1, np.int32)
        column, row = np.round((corners + self.half) / self.side).astype(np.int64).T
        self.number[row, column] = np.arange(len(corners))
        count = math.ceil(self.side / _CELL)
        self.away = np.full((len(corners), count, count), np.inf, np.float32)
        self.tops = np.full((len(corners), count, count), -np.inf, np.float32)
        finite = reaches[np.isfinite(reaches)]
        if len(finite):
            whole = float(finite.max()) + SLACK + _HALF_DIAGONAL
            solids = _outlines(scene), _tops(scene)
            for k, (west, south) in enumerate(corners.tolist()):
                _measure((self.away[k], self.tops[k]), (west, south), solids, _DIRECTIONS, whole)
        if len(finite) < len(reaches):  # something of it may be anywhere
            self.mark_all()

    @property
    def cells(self) -> tuple[NDArray[np.int32], NDArray[np.float32], NDArray[np.float32], float, float]:
        """The squares as compiled code takes them."""
        return self.number, self.away, self.tops, self.half, self.side

    def mark_all(self) -> None:
        """Have something solid be near everywhere."""
        self.away[:], self.tops[:] = 0.0, np.inf


def _tops(scene: StaticScene) -> NDArray[np.float64]:
    """Height of each solid's top, metres, in the order of `_outlines`."""
    hulls = [float(points[:, 2].max()) for points in scene.hulls]
    boxes, pillars = scene.boxes[:, 2] + scene.boxes[:, 6], scene.pillars[:, 2] + scene.pillars[:, 4]
    return np.concatenate([np.array(hulls), boxes, pillars]) + _ROUNDING


def _outlines(scene: StaticScene) -> NDArray[np.float64]:
    """How far each solid goes in each direction, metres, shape ``(n, 16)``."""
    found: list[NDArray[Any]] = [apply_matrix(points[:, :2], _DIRECTIONS).max(axis=0)[None] for points in scene.hulls]
    x, y, _, yaw, a, b, _ = scene.boxes.T
    middle = apply_matrix(np.stack([x, y], axis=1), _DIRECTIONS)
    c, s = np.cos(yaw), np.sin(yaw)
    forward = apply_matrix(np.stack([c, s], axis=1), _DIRECTIONS)
    sideways = apply_matrix(np.stack([-s, c], axis=1), _DIRECTIONS)
    found.append(middle + np.abs(forward) * a[:, None] + np.abs(sideways) * b[:, None])
    found.append(apply_matrix(scene.pillars[:, :2], _DIRECTIONS) + scene.pillars[:, 3:4])
    return np.concatenate([np.zeros((0, len(_DIRECTIONS))), *found])
