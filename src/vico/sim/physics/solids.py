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


@compiled
def _mark(cells, half, outlines, directions, reach):  # type: ignore[no-untyped-def]
    """Mark cells whose middle is within `reach` of an outline, given by how far it goes in each direction."""
    count = len(cells)
    for outline in outlines:
        # The first, fifth, ninth and thirteenth direction are east, north, west and south.
        first_column = max(int((-outline[8] - reach + half) / _CELL), 0)
        last_column = min(int((outline[0] + reach + half) / _CELL), count - 1)
        first_row = max(int((-outline[12] - reach + half) / _CELL), 0)
        last_row = min(int((outline[4] + reach + half) / _CELL), count - 1)
        for row in range(first_row, last_row + 1):
            y = (row + 0.5) * _CELL - half
            for column in range(first_column, last_column + 1):
                if cells[row, column]:
                    continue
                x = (column + 0.5) * _CELL - half
                inside = True
                for d in range(len(directions)):
                    if directions[d, 0] * x + directions[d, 1] * y > outline[d] + reach:
                        inside = False
                        break
                cells[row, column] = inside


@compiled
def find_near(cells, half, slack, seconds, state, near):  # type: ignore[no-untyped-def]
    """Say of each robot whether it could touch something solid within some seconds.

    Parameters
    ----------
    slack
        Metres a robot may move before it reaches further than `cells` say.
    state
        Positions and speeds as the engine orders them, and where in them each robot's base begins, shape ``(n, 2)``.
    near
        Written, bool, shape ``(n,)``.
    """
    positions, speeds, first = state
    for k in range(len(first)):
        x, y = positions[first[k, 0]], positions[first[k, 0] + 1]
        speed = math.hypot(speeds[first[k, 1]], speeds[first[k, 1] + 1])
        column, row = math.floor((x + half) / _CELL), math.floor((y + half) / _CELL)
        if 0 <= row < len(cells) and 0 <= column < len(cells) and 2.0 * speed * seconds < slack:
            near[k] = cells[int(row), int(column)]
        else:
            near[k] = True


class SolidCells:
    """A square grid of what is near solids.

    Parameters
    ----------
    scene
        What never moves.
    reach
        Metres from its base within which all of a robot is.

    Attributes
    ----------
    cells
        Whether a robot whose base is in a cell may touch a solid, bool, shape ``(n, n)``, row = y.
    half
        Half the side of the grid, metres.
    """

    #: Metres a robot may move before it is asked again.
    SLACK = 0.1

    def __init__(self, scene: StaticScene, reach: float) -> None:
        self.half = float(scene.height.half)
        count = math.ceil(2 * self.half / _CELL)
        self.cells = np.zeros((count, count), np.bool_)
        whole = reach + self.SLACK + _CELL * math.sqrt(0.5)
        if math.isfinite(whole):
            _mark(self.cells, self.half, _outlines(scene), _DIRECTIONS, whole)
        else:
            self.cells[:] = True


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
