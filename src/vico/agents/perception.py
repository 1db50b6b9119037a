"""From images to places: which things are in view, and where they are."""

from __future__ import annotations

import heapq
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.exact import apply_matrix
from vico.io.compiled import compiled
from vico.pixels import shown_in

#: Fewer pixels than this are not taken for a sighting.
SIGHT = 4


@dataclass(frozen=True)
class Sighting:
    """A thing in view.

    Attributes
    ----------
    pixels
        How many show it.
    position
        Mean of its visible surface, ENU metres, shape ``(3,)``.
    box
        First column and row, last column and row in which the picture shows it.
    """

    entity: int
    kind: str
    name: str
    pixels: int
    position: NDArray[np.float64]
    box: tuple[int, ...] = (0, 0, 0, 0)

    def state(self) -> dict[str, Any]:
        """Return it as plain data; ``Sighting(**state)`` is the same again."""
        return {
            "entity": self.entity,
            "kind": self.kind,
            "name": self.name,
            "pixels": self.pixels,
            "position": self.position.copy(),
            "box": list(self.box),
        }


def points_from_depth(
    depth: NDArray[np.float32], intrinsics: NDArray[np.float64], extrinsics: NDArray[np.float64], *, step: int = 1
) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Lift a depth image into the world.

    Parameters
    ----------
    depth
        Metres along the optical axis, 0 where nothing was hit, shape ``(h, w)``.
    intrinsics, extrinsics
        3x3 camera matrix; 4x4 world to camera (x right, y down, z forward).
    step
        Use every `step`-th row and column.

    Returns
    -------
    points, pixels
        ENU metres, shape ``(n, 3)``; flat indices into the full image, shape ``(n,)``.
    """
    height, width = depth.shape
    v, u = np.mgrid[0:height:step, 0:width:step]
    z = depth[::step, ::step].astype(np.float64)
    hit = z > 0
    u, v, z = u[hit], v[hit], z[hit]
    x = (u + 0.5 - intrinsics[0, 2]) / intrinsics[0, 0] * z
    y = (v + 0.5 - intrinsics[1, 2]) / intrinsics[1, 1] * z
    rotation, shift = extrinsics[:3, :3], extrinsics[:3, 3]
    camera = np.column_stack([x, y, z])
    return apply_matrix(camera - shift, rotation.T), v * width + u


def sightings(observation: Mapping[str, Any], entities: Mapping[int, Mapping[str, str]]) -> list[Sighting]:
    """Everything with a name in view, nearest first.

    Parameters
    ----------
    observation
        With images.
    entities
        What the numbers of the segmentation stand for.
    """
    shown = shown_in(observation)
    found = []
    eye = np.asarray(observation["pose"], np.float64)[:3]
    away = np.linalg.norm(shown.position - eye, axis=1)
    for k in np.lexsort((shown.entity, away)).tolist():
        entity, pixels = int(shown.entity[k]), int(shown.pixels[k])
        about = entities.get(entity, {})
        if pixels >= SIGHT and shown.hits[k] and about.get("name"):
            box = tuple(shown.box[k].tolist())
            found.append(Sighting(entity, about["kind"], about["name"], pixels, shown.position[k], box))
    return found


class DepthGrid:
    """What a walker knows of a room: cells where depth images showed something to bump into.

    Cells never seen count as free: the walls come into view as one walks. Things are taken to stay where they were
    seen; a cell is cleared again only by `forget`.

    Parameters
    ----------
    middle
        Point around which the grid lies, ENU metres.
    side, cell
        Extent and spacing, metres.
    """

    def __init__(self, middle: ArrayLike, *, side: float = 40.0, cell: float = 0.2) -> None:
        self.n = round(side / cell)
        self.cell = cell
        self.corner = np.asarray(middle, np.float64)[:2] - side / 2
        # How often pictures showed something; made with the first, for whoever is told of rooms looks at none.
        self._hits: NDArray[np.int32] | None = None
        # A bit a cell, for thousands keep such a grid each.
        self._bits = np.packbits(np.zeros(self.n * self.n, np.bool_))
        # What a body of some radius keeps from, by radius, until something new is known; bits, too.
        self._blocked: dict[float, NDArray[np.uint8]] = {}

    @property
    def nbytes(self) -> int:
        """Bytes of what is kept."""
        hits = 0 if self._hits is None else self._hits.nbytes
        return hits + self._bits.nbytes + sum(blocked.nbytes for blocked in self._blocked.values())

    def _cells(self, bits: NDArray[np.uint8]) -> NDArray[np.bool_]:
        return np.unpackbits(bits, count=self.n * self.n).view(np.bool_).reshape(self.n, self.n)

    def state(self) -> dict[str, Any]:
        """Return the cells that hold something, as arrays; few do, so they are listed."""
        hits = np.zeros(0, np.int32) if self._hits is None else self._hits.ravel()
        (hit,) = np.nonzero(hits)
        return {
            "corner": self.corner.copy(),
            "hit": hit.astype(np.int32),
            "hits": hits[hit],
            "bumps": self._bits.copy(),
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Hold what another grid of the same size held."""
        self.corner = np.array(state["corner"], np.float64)
        self._hits, self._blocked = None, {}
        if len(state["hit"]):
            self._hits = np.zeros((self.n, self.n), np.int32)
            self._hits.ravel()[state["hit"]] = state["hits"]
        self._bits = np.array(state["bumps"], np.uint8)

    def see(self, observation: Mapping[str, Any], *, floor: float, ignore: ArrayLike = ()) -> None:
        """Add what a depth image shows between ankle and head height.

        Parameters
        ----------
        floor
            Height of the floor, metres.
        ignore
            Entities that are not in the way (what one is going to pick up).
        """
        points, pixels = points_from_depth(
            observation["depth"], observation["intrinsics"], observation["extrinsics"], step=4
        )
        skip = np.isin(np.asarray(observation["segmentation"]).ravel()[pixels], np.asarray(ignore))
        keep = (points[:, 2] > floor + 0.15) & (points[:, 2] < floor + 1.8) & ~skip
        cells = ((points[keep, :2] - self.corner) / self.cell).astype(np.int64)
        cells = cells[((cells >= 0) & (cells < self.n)).all(axis=1)]
        if self._hits is None:
            self._hits = np.zeros((self.n, self.n), np.int32)
        np.add.at(self._hits, (cells[:, 1], cells[:, 0]), 1)
        self._blocked.clear()

    def bump(self, xy: ArrayLike) -> None:
        """Remember that something stopped a step at a point."""
        ix, iy = ((np.asarray(xy, np.float64)[:2] - self.corner) / self.cell).astype(np.int64)
        if 0 <= ix < self.n and 0 <= iy < self.n:
            bumps = self._cells(self._bits)
            bumps[iy, ix] = True
            self._bits = np.packbits(bumps)
            self._blocked.clear()

    def route(self, start: ArrayLike, goal: ArrayLike, *, near: float, radius: float = 0.3) -> NDArray[np.float64]:
        """Find a way that keeps `radius` metres from what was seen, to within `near` metres of the goal.

        Returns
        -------
        ndarray
            Points after the start, shape ``(k, 2)``; empty where there is no way, or none is needed.
        """
        a = np.asarray(start, np.float64)[:2]
        b = np.asarray(goal, np.float64)[:2]
        if radius not in self._blocked:
            self._blocked[radius] = np.packbits(self._grown(radius))
        blocked = self._cells(self._blocked[radius])
        first = tuple(((a - self.corner) / self.cell).astype(int))
        aim = (b - self.corner) / self.cell
        reach = near / self.cell
        return self.corner + (_a_star(blocked, first, aim, reach) + 0.5) * self.cell

    def _grown(self, radius: float) -> NDArray[np.bool_]:
        bumps = self._cells(self._bits)
        solid = bumps if self._hits is None else (self._hits >= 3) | bumps
        grown = solid.copy()
        reach = math.ceil(radius / self.cell)
        for dy in range(-reach, reach + 1):
            for dx in range(-reach, reach + 1):
                if 0 < dx * dx + dy * dy <= (radius / self.cell) ** 2:
                    grown |= np.roll(solid, (dy, dx), axis=(0, 1))
        return grown


def _a_star(
    blocked: NDArray[np.bool_], start: tuple[int, ...], aim: NDArray[np.float64], reach: float
) -> NDArray[np.int64]:
    """Cells ``(x, y)`` from start (left out) to the first one within reach of the aim, shape ``(k, 2)``."""
    n = blocked.shape[0]
    x, y = int(start[0]), int(start[1])
    if not (0 <= x < n and 0 <= y < n):
        return np.zeros((0, 2), np.int64)
    return np.asarray(_search(blocked, x, y, float(aim[0]), float(aim[1]), reach), np.int64).reshape(-1, 2)


@compiled
def _search(blocked, start_x, start_y, aim_x, aim_y, reach):  # type: ignore[no-untyped-def]
    """Run A* on a grid; ties are broken by position."""
    n = blocked.shape[0]
    cost = np.full((n, n), np.inf)
    parent = np.empty((n, n), np.int64)
    closed = np.zeros((n, n), np.bool_)
    cost[start_y, start_x] = 0.0
    queue = [(0.0, start_x, start_y)]
    while len(queue) > 0:
        _, x, y = heapq.heappop(queue)
        if closed[y, x]:
            continue
        closed[y, x] = True
        if _distance(x + 0.5 - aim_x, y + 0.5 - aim_y) <= max(reach, 0.7):
            return _way_back(parent, x, y, start_x, start_y)
        for dy in range(-1, 2):
            for dx in range(-1, 2):
                i, j = x + dx, y + dy
                if not (0 <= i < n and 0 <= j < n) or closed[j, i]:
                    continue
                # A start that touches what is around it may still be left.
                if blocked[j, i] and not blocked[y, x]:
                    continue
                new = cost[y, x] + _distance(dx, dy) * (4.0 if blocked[j, i] else 1.0)
                if new < cost[j, i]:
                    cost[j, i] = new
                    parent[j, i] = y * n + x
                    guess = max(_distance(i + 0.5 - aim_x, j + 0.5 - aim_y) - reach, 0.0)
                    heapq.heappush(queue, (new + guess, i, j))
    return np.zeros((0, 2), np.int64)


@compiled(inline="always")
def _distance(dx, dy):  # type: ignore[no-untyped-def]
    return math.sqrt(dx * dx + dy * dy)


@compiled
def _way_back(parent, x, y, start_x, start_y):  # type: ignore[no-untyped-def]
    """Return the cells from after the start to ``(x, y)``."""
    n = parent.shape[0]
    count, i, j = 0, x, y
    while i != start_x or j != start_y:
        count += 1
        before = parent[j, i]
        i, j = before % n, before // n
    cells = np.empty((count, 2), np.int64)
    i, j = x, y
    for k in range(count - 1, -1, -1):
        cells[k, 0], cells[k, 1] = i, j
        before = parent[j, i]
        i, j = before % n, before // n
    return cells
