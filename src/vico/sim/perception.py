"""Perception by sight lines: entities in view of each other, the same with and without pictures.

In view is what is near, before the eyes, and not behind a building or in another room. A grid tells how high buildings
stand (`OpaqueGrid`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from vico.io.compiled import compiled
from vico.sim.bodies.arrays import KINDS, Bodies
from vico.world.walkable import fill_polygon
from vico.world.world import World

__all__ = [
    "OUTDOORS",
    "SIGHT",
    "AllInView",
    "InView",
    "OpaqueGrid",
    "SeenBody",
    "Viewpoints",
    "in_view",
    "is_clear",
    "opaque_grid",
]
_CELL = 0.5


@dataclass(frozen=True)
class OpaqueGrid:
    """Tops of buildings over a square world.

    Attributes
    ----------
    level
        Which of `tops` the building over each cell's centre has, the highest where there are several, uint16 or uint32,
        shape ``(n, n)``, indexed ``[iy, ix]``. A city has a hundred million cells: half the memory of heights.
    tops
        Heights, metres, float32, ascending; the first is -inf, where there is no building.
    half
        Half the side of the square, metres.
    cell
        Side of a cell, metres.
    """

    level: NDArray[np.unsignedinteger]
    tops: NDArray[np.float32]
    half: float
    cell: float = _CELL


_GRIDS: WeakKeyDictionary[World, OpaqueGrid] = WeakKeyDictionary()


def opaque_grid(world: World) -> OpaqueGrid:
    """Return the tops of a world's buildings; found once a world."""
    if world not in _GRIDS:
        n = math.ceil(2 * world.half / _CELL)
        highest = np.array([building.base + building.height for building in world.buildings], np.float32)
        tops = np.concatenate([np.array([-np.inf], np.float32), np.unique(highest)])
        level = np.zeros((n, n), np.uint16 if len(tops) <= np.iinfo(np.uint16).max else np.uint32)
        of_building = np.searchsorted(tops, highest)
        # The highest are written last.
        for k in np.argsort(of_building, kind="stable").tolist():
            rings = [np.asarray(ring, np.float64) for ring in world.buildings[k].footprint]
            starts = np.cumsum([0, *map(len, rings)])
            x, y = np.ascontiguousarray(np.concatenate(rings).T)
            fill_polygon(level, x, y, starts, float(world.half), _CELL, level.dtype.type(of_building[k]))
        _GRIDS[world] = OpaqueGrid(level, tops, world.half)
    return _GRIDS[world]


#: The space of all that is in no room and no bus.
OUTDOORS = -1

#: Bodies farther away than this are never noticed, metres.
SIGHT = 40.0

# Half the angle of view, as the pictures have it: a quarter turn in all.
_HALF_ANGLE = math.pi / 4
# What is looked at is near the top of a body: heads, roofs of cars.
_LOOKED_AT = 0.9
# Cells are numbered from here down, 2 ** 20 along a side.
_HALF_KEYS = 2**19
# A sight line is not stopped this near its ends, metres: who leans on a wall still sees along it.
_FREE_END = 0.6


@dataclass(frozen=True)
class SeenBody:
    """A body in view.

    Attributes
    ----------
    entity
        As in segmentation images.
    kind, name
        What it is, and what it is called.
    agent
        The agent's name; "" where nobody plays it.
    position
        Where it stands, ENU metres.
    distance
        Metres over the ground from who sees it.
    """

    entity: int
    kind: str
    name: str
    agent: str
    position: tuple[float, float, float]
    distance: float


class InView:
    """What one agent has in view: bodies, nearest first, and the room it is in.

    Attributes
    ----------
    distance
        To each body, metres over the ground, ascending, shape ``(n,)``.
    room
        Floor of the room as ``x, y, yaw, half length, half width``, ENU metres and radians, shape ``(5,)``; an endless
        one outdoors.
    furniture
        Solid things in the room in the same form, shape ``(k, 5)``.
    """

    def __init__(
        self,
        bodies: Bodies,
        chosen: NDArray[np.int64],
        distance: NDArray[np.float64],
        entities: Mapping[int, Mapping[str, str]],
    ) -> None:
        self._bodies, self._chosen, self._entities = bodies, chosen, entities
        self.distance = distance
        self.room = np.array([0.0, 0.0, 0.0, np.inf, np.inf])
        self.furniture = np.zeros((0, 5))

    def __len__(self) -> int:
        return len(self._chosen)

    def __iter__(self) -> Iterator[SeenBody]:
        return self.within(math.inf)

    def within(self, reach: float) -> Iterator[SeenBody]:
        """Yield what is no farther away than `reach` metres, nearest first."""
        for k, far in zip(self._chosen.tolist(), self.distance.tolist(), strict=True):
            if far > reach:
                return
            yield self._body_in_view(k, far)

    def agents_within(self, reach: float) -> Iterator[str]:
        """Yield the names of the agents that are no farther away than `reach` metres, nearest first."""
        for k, far in zip(self._chosen.tolist(), self.distance.tolist(), strict=True):
            if far > reach:
                return
            agent = self._entities.get(self._bodies.entity.item(k), {}).get("agent", "")
            if agent:
                yield agent

    def nearest(self, kinds: tuple[str, ...]) -> float:
        """Return how far the nearest body of some kinds is, metres; infinite if none is in view."""
        wanted = _is_of(kinds)[self._bodies.kind[self._chosen]]
        first = int(wanted.argmax()) if len(wanted) else 0
        return float(self.distance[first]) if len(wanted) and wanted[first] else math.inf

    def _body_in_view(self, k: int, distance: float) -> SeenBody:
        entity = int(self._bodies.entity[k])
        about = self._entities.get(entity, {})
        x, y, z = self._bodies.position[k].tolist()
        kind = KINDS[int(self._bodies.kind[k])]
        return SeenBody(entity, kind, about.get("name", ""), about.get("agent", ""), (x, y, z), distance)


@cache
def _is_of(kinds: tuple[str, ...]) -> NDArray[np.bool_]:
    """Return, by kind of body, whether it is one of these."""
    return np.isin(KINDS, kinds)


@dataclass(frozen=True)
class AllInView:
    """What several agents have in view, in the order of their `Eyes`.

    Attributes
    ----------
    agents
        How many look.
    bodies
        Everybody and everything that might have been seen.
    entities
        Name and agent of each body by entity.
    viewer, body, distance
        Who has what in view, and how far away it is, metres: rows of the eyes, ascending, and of `bodies`, nearest
        first for each; shape ``(pairs,)``.
    """

    agents: int
    bodies: Bodies
    entities: Mapping[int, Mapping[str, str]]
    viewer: NDArray[np.int64]
    body: NDArray[np.int64]
    distance: NDArray[np.float64]

    @cached_property
    def _first(self) -> list[int]:
        """Where each agent's pairs begin, and the last one's end."""
        first: list[int] = np.searchsorted(self.viewer, np.arange(self.agents + 1)).tolist()
        return first

    def of(self, k: int) -> InView:
        """Return what the agent with the `k`-th eyes has in view."""
        a, b = self._first[k], self._first[k + 1]
        return InView(self.bodies, self.body[a:b], self.distance[a:b], self.entities)


@dataclass(frozen=True)
class Viewpoints:
    """Where agents look from.

    Attributes
    ----------
    position
        Eyes, ENU metres, shape ``(n, 3)``.
    yaw
        Radians, shape ``(n,)``.
    entity
        Of the agent's own body, shape ``(n,)``.
    space
        Where each is: `OUTDOORS`, else a number of its room or bus; what is in another space is out of view, shape
        ``(n,)``.
    """

    position: NDArray[np.float64]
    yaw: NDArray[np.float64]
    entity: NDArray[np.int32]
    space: NDArray[np.int64]


def in_view(
    eyes: Viewpoints,
    bodies: Bodies,
    spaces: NDArray[np.int64],
    opaque: OpaqueGrid,
    entities: Mapping[int, Mapping[str, str]],
    *,
    sight: float | NDArray[np.float64] = SIGHT,
) -> AllInView:
    """Return what each agent has in view.

    Parameters
    ----------
    bodies, spaces
        Everybody and everything that may be seen, and where each is, as `Eyes.space`; shape ``(m,)``.
    opaque
        What hides things outdoors.
    entities
        Name and agent of each body by entity.
    sight
        How far off bodies are noticed outdoors, metres, one for all or one each; at most `SIGHT`.
    """
    looked_at = bodies.position + np.column_stack([np.zeros((len(bodies), 2)), _LOOKED_AT * bodies.height])
    # By the space each point is in, outdoors by its cell: only those of near ones see each other.
    cells = np.floor(looked_at[:, :2] / SIGHT).astype(np.int64)
    keys = np.where(spaces == OUTDOORS, _cell_key(cells[:, 0], cells[:, 1]), spaces)
    by_key = np.argsort(keys, kind="stable")
    who, what, far = _pairs(
        np.column_stack([eyes.position, np.cos(eyes.yaw), np.sin(eyes.yaw)]),
        np.column_stack([eyes.entity, eyes.space]).astype(np.int64),
        np.column_stack([looked_at, np.broadcast_to(sight, len(bodies))]),
        np.column_stack([bodies.entity, spaces]).astype(np.int64),
        _Limits(SIGHT, math.cos(_HALF_ANGLE), _FREE_END, float(opaque.half), float(opaque.cell)),
        (opaque.level, opaque.tops),
        keys[by_key],
        by_key,
    )
    order = np.lexsort((bodies.entity[what], far, who))
    return AllInView(len(eyes.entity), bodies, entities, who[order], what[order], far[order])


def is_clear(one: NDArray[np.float64], other: NDArray[np.float64], opaque: OpaqueGrid) -> bool:
    """Return whether no building stands between two points outdoors, ENU metres, shape ``(3,)`` each."""
    away = math.hypot(other[0] - one[0], other[1] - one[1])
    return bool(_is_clear(one, other, away, _FREE_END, opaque.half, opaque.cell, (opaque.level, opaque.tops)))


@compiled
def _cell_key(column, row):
    """Return the key of a cell as wide as one sees; below those of all spaces indoors."""
    return -1 - (((column + _HALF_KEYS) << 20) | (row + _HALF_KEYS))


class _Limits(NamedTuple):
    """What limits sight.

    Attributes
    ----------
    farthest
        Metres that anybody sees.
    cosine
        Of half the angle of view.
    free_end
        Metres at either end of a line of sight on which nothing hides.
    half, cell
        Of the grid of buildings, see `OpaqueGrid`.
    """

    farthest: float
    cosine: float
    free_end: float
    half: float
    cell: float


# Columns of `eyes` after the position: the gaze over the ground; of `targets`, metres from which each is noticed.
_GAZE_X = 3
_GAZE_Y = 4
_NOTICED = 3


@compiled
def _pairs(eyes, mine, targets, theirs, limits, heights, keys, order):
    """Return who has what in view, and how far away it is; indices of agents and bodies, metres.

    `eyes` holds position and gaze (a unit vector over the ground), `mine` and `theirs` entity and space; `keys` are the
    targets' spaces and cells in ascending order, `order` whose each is.
    """
    sight = limits.farthest
    who, what, far = [0 for _ in range(0)], [0 for _ in range(0)], [0.0 for _ in range(0)]
    for i in range(len(eyes)):
        outdoors = mine[i, 1] < 0
        reach = 1 if outdoors else 0
        column, row = math.floor(eyes[i, 0] / sight), math.floor(eyes[i, 1] / sight)
        for dx in range(-reach, reach + 1):
            for dy in range(-reach, reach + 1):
                key = _cell_key(column + dx, row + dy) if outdoors else mine[i, 1]
                for at in range(np.searchsorted(keys, key), np.searchsorted(keys, key, side="right")):
                    j = order[at]
                    if theirs[j, 0] == mine[i, 0]:
                        continue
                    away = _distance_in_view(eyes[i], targets[j], outdoors, limits, heights)
                    if away >= 0.0:
                        who.append(i)
                        what.append(j)
                        far.append(away)
    return np.array(who, np.int64), np.array(what, np.int64), np.array(far, np.float64)


@compiled
def _distance_in_view(eye, target, outdoors, limits, heights):
    """Return how far away a point in the same space is, metres; -1 if it is out of view."""
    dx, dy = target[0] - eye[0], target[1] - eye[1]
    away = math.sqrt(dx * dx + dy * dy)
    if away > (target[_NOTICED] if outdoors else limits.farthest):
        return -1.0
    if dx * eye[_GAZE_X] + dy * eye[_GAZE_Y] < limits.cosine * away:
        return -1.0
    if outdoors and not _is_clear(eye, target, away, limits.free_end, limits.half, limits.cell, heights):
        return -1.0
    return away


@compiled
def _is_clear(eye, target, away, free_end, half, cell, heights):
    """Return whether no building stands as high as the line between two points, looked at every half cell."""
    level, tops = heights
    n = level.shape[0]
    steps = int(away / (0.5 * cell))
    for k in range(1, steps):
        share = k / steps
        if share * away < free_end or (1.0 - share) * away < free_end:
            continue
        ix = int((eye[0] + (target[0] - eye[0]) * share + half) / cell)
        iy = int((eye[1] + (target[1] - eye[1]) * share + half) / cell)
        if 0 <= ix < n and 0 <= iy < n and tops[level[iy, ix]] > eye[2] + (target[2] - eye[2]) * share:
            return False
    return True
