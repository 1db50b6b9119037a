"""A way in words: along which streets, how far, and where to turn, from the public map alone."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from vico.agents.talk.sentences import Sentences
from vico.world.public import PublicMap, PublicPlace

# A way is looked at every so many metres; what is shorter than the second belongs to the leg before it.
_SAMPLE, _SHORTEST = 4.0, 16.0
# A turn is told from the way so many metres before and after it, and from so many degrees on.
_BEFORE, _TURN, _ROUND = 12.0, 35.0, 150.0
# Most legs that are told of: nobody remembers more.
MOST_LEGS = 6


@dataclass(frozen=True)
class Leg:
    """A part of a way along one street.

    Attributes
    ----------
    street
        Its name; empty where it has none.
    metres
        How far.
    begins, ends
        Unit vectors that one walks along at its beginning and end, east and north.
    """

    street: str
    metres: float
    begins: tuple[float, float]
    ends: tuple[float, float]


def rounded(metres: float) -> int:
    """Return a distance as one says it: to 10 m, from 300 m on to 50 m."""
    step = 10 if metres < 300 else 50
    return max(step, round(metres / step) * step)


def legs_of(path: NDArray[np.float64], public_map: PublicMap) -> list[Leg]:
    """Split a way where it leaves a street.

    Parameters
    ----------
    path
        ENU metres, shape ``(n, 2)``, at least two points.
    """
    reached = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    total = float(reached[-1])
    at = np.linspace(0.0, total, max(2, math.ceil(total / _SAMPLE) + 1))
    points = np.column_stack([np.interp(at, reached, path[:, k]) for k in range(2)])
    streets = public_map.street_index.streets_at(points)
    cuts = _cuts(streets, at)
    found = []
    for first, last in zip(cuts, [*cuts[1:], len(at) - 1], strict=True):
        middle = streets[first + 1 : last] or streets[first : last + 1]
        most = max(sorted(set(middle)), key=middle.count)
        found.append(
            Leg(most, float(at[last] - at[first]), _course(points, at, first, 1), _course(points, at, last, -1))
        )
    return found


def _cuts(streets: list[str], at: NDArray[np.float64]) -> list[int]:
    """Return where legs begin: where a street lasts long enough to be told of."""
    runs: list[tuple[int, int]] = []
    for k, street in enumerate(streets):
        if runs and streets[runs[-1][0]] == street:
            runs[-1] = runs[-1][0], k
        else:
            runs.append((k, k))
    long = [run for run in runs if at[min(run[1] + 1, len(at) - 1)] - at[run[0]] >= _SHORTEST]
    cuts = [0]
    before = streets[long[0][0]] if long else ""
    for first, _ in long[1:]:
        if streets[first] != before:
            cuts.append(first)
            before = streets[first]
    return cuts


def _course(points: NDArray[np.float64], at: NDArray[np.float64], k: int, sign: int) -> tuple[float, float]:
    """Return the direction one walks in just after (1) or before (-1) a point of the way."""
    there = float(np.clip(at[k] + sign * _BEFORE, 0.0, at[-1]))
    other = np.array([np.interp(there, at, points[:, axis]) for axis in range(2)])
    ahead = (other - points[k]) * sign
    length = float(np.linalg.norm(ahead)) or 1.0
    return float(ahead[0] / length), float(ahead[1] / length)


def turn_between(before: tuple[float, float], after: tuple[float, float]) -> str:
    """Return how one turns from a direction into another: left, right, straight or back."""
    cross = before[0] * after[1] - before[1] * after[0]
    angle = math.degrees(math.atan2(cross, before[0] * after[0] + before[1] * after[1]))
    if abs(angle) >= _ROUND:
        return "back"
    if abs(angle) < _TURN:
        return "straight"
    return "left" if angle > 0 else "right"


def way_in_words(
    public_map: PublicMap, start: tuple[float, float], place: PublicPlace, sentences: Sentences
) -> tuple[str, float] | None:
    """Tell the way on foot to a place.

    Parameters
    ----------
    start
        ENU metres.

    Returns
    -------
    tuple or None
        The steps in words, and metres in all; None if there is no way.
    """
    path = public_map.router.path(start, place.position[:2])
    if path is None:
        return None
    points = np.asarray(path, np.float64).reshape(-1, 2)
    metres = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    if len(points) < 2 or metres < 1.0:
        return sentences.steps["door_ahead"].removeprefix("and "), metres
    legs = legs_of(points, public_map)
    first = legs[0]
    said = [sentences.step("start", direction=sentences.direction(*first.begins), **_of(first, sentences))]
    told = legs[:MOST_LEGS]
    said += [
        sentences.step(turn_between(before.ends, leg.begins), **_of(leg, sentences)) for before, leg in pairwise(told)
    ]
    whole = len(legs) == len(told)
    said.append(sentences.steps[_door(place, points[-1], legs[-1].ends) if whole else "further"])
    return ", ".join(said), metres


def _of(leg: Leg, sentences: Sentences) -> dict[str, str | int]:
    return {"street": leg.street or sentences.unnamed, "metres": rounded(leg.metres)}


def _door(place: PublicPlace, end: NDArray[np.float64], course: tuple[float, float]) -> str:
    """Return on which side the door is for who comes along a way."""
    if place.entrance is None:
        return "door_ahead"
    to = place.entrance[0] - float(end[0]), place.entrance[1] - float(end[1])
    if math.hypot(*to) < 0.1:
        return "door_ahead"
    side = turn_between(course, to)
    return f"door_{side}" if side in ("left", "right") else "door_ahead"


__all__ = ["MOST_LEGS", "Leg", "legs_of", "rounded", "turn_between", "way_in_words"]
