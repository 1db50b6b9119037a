"""Getting a bicycle out of a narrow place: turns and short rides, searched for on the public map.

A bicycle with its rider is longer than wide and does not go backwards, so in a passage it can't be turned about where
it stands. Out of it leads a few turns and metres straight on, found by breadth-first search over where the bicycle is
and which way it points.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator, Sequence
from itertools import pairwise

from vico.agents.base import Action
from vico.rules import BIKE_SPEED
from vico.world.model import Point2
from vico.world.walkable import WalkableMap

#: Where walls are no nearer than this, metres, a bicycle is turned about with ease.
WIDE = 0.9
# Room to walls that a bicycle needs, metres, at these points along it.
_BESIDE = 0.28
_ALONG = (-0.6, -0.4, -0.2, 0.0, 0.2, 0.4, 0.6)
# Steps of the search: degrees of a turn and metres of a ride, and how fine places are told apart.
_DEGREES, _METRES, _CELL = 15, 0.5, 0.25
_ROUND = 360 // _DEGREES
_MOST_NODES = 1500
# Where one gets on: on the spot or a step or two aside, as the rules of mounting have it.
_MOUNTED = [(0.0, 0.0)] + [
    (r * math.cos(k * math.pi / 4), r * math.sin(k * math.pi / 4)) for r in (0.9, 1.8) for k in range(8)
]

# x, y and the direction: steps of `_DEGREES` from where the bicycle points at first.
_Pose = tuple[float, float, int]


def way_out(walkable: WalkableMap, position: Sequence[float], heading: float) -> list[Action] | None:
    """Return the fewest actions that bring a bicycle to where it is turned about with ease.

    Parameters
    ----------
    position
        Of the rider, ENU metres.
    heading
        Counter-clockwise from east, radians.

    Returns
    -------
    list of dict or None
        Empty where it is wide already; None if no way out was found.
    """
    x, y = float(position[0]), float(position[1])
    found = _search(walkable, [(x, y, 0)], heading)
    if found is None:
        return None
    actions: list[Action] = []
    for (ax, ay, before), (bx, by, after) in pairwise(found):
        if before == after:
            # Whole steps: by rounding alone the longest would be a little more than is allowed.
            steps = round(math.hypot(bx - ax, by - ay) / _METRES)
            actions.append({"type": "move_forward", "distance": steps * _METRES})
        else:
            turn = ((after - before) * _DEGREES + 180) % 360 - 180
            actions.append({"type": "turn_left" if turn > 0 else "turn_right", "degrees": float(abs(turn))})
    return actions


def leads_out(walkable: WalkableMap, station: Point2) -> bool:
    """Return whether a bicycle that one gets on at a station can be ridden to where there is room to turn it."""
    poses = [
        (station[0] + east, station[1] + north, turned)
        for east, north in _MOUNTED
        for turned in range(0, _ROUND, 45 // _DEGREES)
    ]
    return _search(walkable, [pose for pose in poses if _fits(walkable, pose, 0.0)], 0.0) is not None


def _search(walkable: WalkableMap, starts: Sequence[_Pose], heading: float) -> list[_Pose] | None:
    """Return the poses from a start to where it is wide, with the fewest actions; None if there are none."""
    before: dict[tuple[int, int, int], _Pose | None] = {}
    queue: deque[_Pose] = deque()
    for pose in starts:
        if _key(pose) not in before:
            before[_key(pose)] = None
            queue.append(pose)
    for _ in range(_MOST_NODES):
        if not queue:
            return None
        pose = queue.popleft()
        if walkable.clearance_of(pose[0], pose[1]) >= WIDE:
            return _back(before, pose)
        for onward in _onward(walkable, pose, heading):
            if _key(onward) not in before:
                before[_key(onward)] = pose
                queue.append(onward)
    return None


def _onward(walkable: WalkableMap, pose: _Pose, heading: float) -> Iterator[_Pose]:
    """Yield where one action leads: straight on, or turned to either side as far as nothing is in the way."""
    x, y, turned = pose
    angle = heading + math.radians(turned * _DEGREES)
    for k in range(1, int(BIKE_SPEED / _METRES) + 1):
        ahead = (x + k * _METRES * math.cos(angle), y + k * _METRES * math.sin(angle), turned)
        if not _fits(walkable, ahead, heading):
            break
        yield ahead
    for side in (1, -1):
        for k in range(1, _ROUND // 2 + 1):
            about = (x, y, (turned + side * k) % _ROUND)
            if not _fits(walkable, about, heading):
                break
            yield about


def _fits(walkable: WalkableMap, pose: _Pose, heading: float) -> bool:
    x, y, turned = pose
    angle = heading + math.radians(turned * _DEGREES)
    c, s = math.cos(angle), math.sin(angle)
    return all(walkable.clearance_of(x + along * c, y + along * s) >= _BESIDE for along in _ALONG)


def _key(pose: _Pose) -> tuple[int, int, int]:
    return round(pose[0] / _CELL), round(pose[1] / _CELL), pose[2]


def _back(before: dict[tuple[int, int, int], _Pose | None], pose: _Pose) -> list[_Pose]:
    found = [pose]
    while (parent := before[_key(found[-1])]) is not None:
        found.append(parent)
    return found[::-1]
