"""Which bodies each agent has in view: near, before its eyes, and not behind a building or in another room."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vico.io.compiled import compiled
from vico.sim.bodies import KINDS, Bodies
from vico.sim.perception.opaque import OpaqueGrid

#: The space of all that is in no room and no bus.
OUTDOORS = -1

#: Bodies farther away than this are not noticed, metres.
SIGHT = 40.0

# Half the angle of view, as the pictures have it: a quarter turn in all.
_HALF_ANGLE = math.pi / 4
# What is looked at is near the top of a body: heads, roofs of cars.
_LOOKED_AT = 0.9
# A sight line is not stopped this near its ends, metres: who leans on a wall still sees along it.
_FREE_END = 0.6


@dataclass(frozen=True)
class Seen:
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

    def __iter__(self) -> Iterator[Seen]:
        return self.within(math.inf)

    def within(self, reach: float) -> Iterator[Seen]:
        """Yield what is no farther away than `reach` metres, nearest first."""
        for k, far in zip(self._chosen.tolist(), self.distance.tolist(), strict=True):
            if far > reach:
                return
            yield self._seen(k, far)

    def nearest(self, kinds: tuple[str, ...]) -> float:
        """Return how far the nearest body of some kinds is, metres; infinite if none is in view."""
        wanted = np.isin(self._bodies.kind[self._chosen], [KINDS.index(kind) for kind in kinds])
        return float(self.distance[wanted][0]) if wanted.any() else math.inf

    def _seen(self, k: int, distance: float) -> Seen:
        entity = int(self._bodies.entity[k])
        about = self._entities.get(entity, {})
        x, y, z = self._bodies.position[k].tolist()
        kind = KINDS[int(self._bodies.kind[k])]
        return Seen(entity, kind, about.get("name", ""), about.get("agent", ""), (x, y, z), distance)


@dataclass(frozen=True)
class Eyes:
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
    eyes: Eyes,
    bodies: Bodies,
    spaces: NDArray[np.int64],
    opaque: OpaqueGrid,
    entities: Mapping[int, Mapping[str, str]],
) -> list[InView]:
    """Return what each agent has in view.

    Parameters
    ----------
    bodies, spaces
        Everybody and everything that may be seen, and where each is, as `Eyes.space`; shape ``(m,)``.
    opaque
        What hides things outdoors.
    entities
        Name and agent of each body by entity.
    """
    looked_at = bodies.position + np.column_stack([np.zeros((len(bodies), 2)), _LOOKED_AT * bodies.height])
    who, what, far = _pairs(
        np.column_stack([eyes.position, np.cos(eyes.yaw), np.sin(eyes.yaw)]),
        np.column_stack([eyes.entity, eyes.space]).astype(np.int64),
        looked_at,
        np.column_stack([bodies.entity, spaces]).astype(np.int64),
        np.array([SIGHT, math.cos(_HALF_ANGLE), _FREE_END, opaque.half, opaque.cell]),
        opaque.top,
    )
    order = np.lexsort((bodies.entity[what], far, who))
    bounds = np.searchsorted(who[order], np.arange(len(eyes.yaw) + 1))
    return [
        InView(bodies, what[order[a:b]], far[order[a:b]], entities)
        for a, b in zip(bounds[:-1].tolist(), bounds[1:].tolist(), strict=True)
    ]


@compiled
def _pairs(eyes, mine, targets, theirs, limits, top):  # type: ignore[no-untyped-def]
    """Return who has what in view, and how far away it is; indices of agents and bodies, metres.

    `eyes` holds position and gaze (a unit vector over the ground), `mine` and `theirs` entity and space.
    """
    sight, cosine, free_end, half, cell = limits
    who, what, far = [0 for _ in range(0)], [0 for _ in range(0)], [0.0 for _ in range(0)]
    for i in range(len(eyes)):
        for j in range(len(targets)):
            if theirs[j, 1] != mine[i, 1] or theirs[j, 0] == mine[i, 0]:
                continue
            dx, dy = targets[j, 0] - eyes[i, 0], targets[j, 1] - eyes[i, 1]
            away = math.sqrt(dx * dx + dy * dy)
            if away > sight or dx * eyes[i, 3] + dy * eyes[i, 4] < cosine * away:
                continue
            if mine[i, 1] >= 0 or _is_clear(eyes[i], targets[j], away, free_end, half, cell, top):
                who.append(i)
                what.append(j)
                far.append(away)
    return np.array(who, np.int64), np.array(what, np.int64), np.array(far, np.float64)


@compiled
def _is_clear(eye, target, away, free_end, half, cell, top):  # type: ignore[no-untyped-def]
    """Return whether no building stands as high as the line between two points, looked at every half cell."""
    n = top.shape[0]
    steps = int(away / (0.5 * cell))
    for k in range(1, steps):
        share = k / steps
        if share * away < free_end or (1.0 - share) * away < free_end:
            continue
        ix = int((eye[0] + (target[0] - eye[0]) * share + half) / cell)
        iy = int((eye[1] + (target[1] - eye[1]) * share + half) / cell)
        if 0 <= ix < n and 0 <= iy < n and top[iy, ix] > eye[2] + (target[2] - eye[2]) * share:
            return False
    return True
