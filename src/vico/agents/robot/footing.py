"""How a thing is to be turned where it is put down: so that it lies on what holds it up, and does not jut out."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from vico.agents.robot.body import ArmBody, Stance
from vico.agents.robot.held import Held
from vico.agents.robot.reaching import TURNS, Reach, reach_spot, room_around
from vico.agents.robot.sight import height_at
from vico.exact import apply_matrix
from vico.geometry import distances

Array = NDArray[np.float64]

# Things are let go of so high above what they are put on, metres.
_ABOVE = 0.01
# Cells of what is below a thing, metres; what is so much higher or lower than the spot is no ground for it.
_CELL, _LEVEL = 0.03, 0.03
# So much less of a thing held up than at best is as good; less than that is no sight of what is below it.
_AS_GOOD, _SEES = 0.08, 0.3
# Sides that differ by less, as a share, are alike.
_SQUARE = 0.85


def reach_footing(
    body: ArmBody, points: Array, now: Array, stance: Stance, spot: Array, held: Held, *, beside: Array | None = None
) -> Reach | None:
    """Return ways that put a held thing down on what was seen at a spot, turned as it is held up best; None if none.

    Parameters
    ----------
    points
        Of all but the thing, in the base's frame, metres, shape ``(n, 3)``.
    now
        Angles of the arm, rad.
    stance
        Where the base is.
    spot
        For the middle of the thing's underside, ENU metres; its height counts where none is seen.
    beside
        Unit vector to the side from which it is reached: the longer side lies across to that; None for any way.
    """
    at = stance.inside(spot)
    at[2] = height_at(points, at)
    turns = turns_held_up(held, points, at)
    if beside is not None:
        ahead = apply_matrix(beside, stance.rotation[:2, :2].T)
        turns.insert(0, turns_along(held, math.atan2(float(ahead[1]), float(ahead[0])) + math.pi / 2))
    at[2] += _ABOVE
    room = room_around(body, points)
    found = (reach_spot(body, room, now, at, held, group) for group in turns)
    return next((reach for reach in found if reach is not None), None)


def turns_along(held: Held, along: float) -> list[float]:
    """Return turns with which the longer side lies along a heading in the base's frame, rad, small ones first."""
    found = [_wrapped(along - held.heading + k * math.pi) for k in (0, 1)]
    if held.half[0] > _SQUARE * held.half[1]:
        found += [_wrapped(turn + math.pi / 2) for turn in found]
    return sorted(found, key=abs)


def turns_held_up(held: Held, points: Array, spot: Array) -> list[list[float]]:
    """Return turns of a thing about the vertical by how much of it lies on what was seen, in groups, the best first.

    Parameters
    ----------
    points
        Of all but the thing, in the base's frame, metres, shape ``(n, 3)``.
    spot
        For the middle of its underside, in that frame, metres, shape ``(3,)``.
    """
    # Across to the way there: so it juts out least over the edge of a table.
    across = turns_along(held, math.atan2(float(spot[1]), float(spot[0])) + math.pi / 2)
    turns = [*TURNS, *across]
    near = points[distances(points[:, :2], spot[:2]) < float(np.hypot(*held.half)) + _CELL]
    shares = [_held_up(held, near, spot, turn) for turn in turns]
    best = max(shares)
    if best < _SEES:
        return [across, list(TURNS)]
    good = [turn for turn, share in zip(turns, shares, strict=True) if share >= best - _AS_GOOD]
    rest = sorted(zip(shares, turns, strict=True), key=lambda one: (-one[0], abs(one[1])))
    return [good, [turn for _, turn in rest if turn not in good]]


def _held_up(held: Held, points: Array, spot: Array, turn: float) -> float:
    """Return the share of the cells below a turned thing in which something was seen that is as high as the spot."""
    c, s = math.cos(held.heading + turn), math.sin(held.heading + turn)
    inside = apply_matrix(points[:, :2] - spot[:2], np.array([[-s, c], [c, s]]))
    counts = np.maximum(np.ceil(2.0 * held.half / _CELL).astype(int), 1)
    cells = np.floor((inside / held.half + 1.0) / 2.0 * counts).astype(int)
    below = np.all((cells >= 0) & (cells < counts), axis=1)
    level = below & (np.abs(points[:, 2] - spot[2]) < _LEVEL)
    seen = np.zeros(tuple(counts.tolist()), np.bool_)
    seen[tuple(cells[level].T)] = True
    return float(seen.mean())


def _wrapped(turn: float) -> float:
    return (turn + math.pi) % (2.0 * math.pi) - math.pi
