"""From images to places: which things are in view, and where they are."""

from __future__ import annotations

import heapq
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

#: Fewer pixels than this are not taken for a sighting.
SIGHT = 4


@dataclass(frozen=True)
class Sighting:
    """A thing in view.

    Attributes
    ----------
    position
        Mean of its visible surface, ENU metres, shape ``(3,)``.
    """

    entity: int
    kind: str
    name: str
    pixels: int
    position: NDArray[np.float64]


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
    return (camera - shift) @ rotation, v * width + u


def sightings(observation: Mapping[str, Any], entities: Mapping[int, Mapping[str, str]]) -> list[Sighting]:
    """Everything with a name in view, nearest first.

    Parameters
    ----------
    observation
        With images.
    entities
        What the numbers of the segmentation stand for.
    """
    segmentation = np.asarray(observation["segmentation"])
    numbers, counts = np.unique(segmentation, return_counts=True)
    found = []
    wanted = [
        (int(number), int(count))
        for number, count in zip(numbers, counts, strict=True)
        if number and count >= SIGHT and entities.get(int(number), {}).get("name")
    ]
    if not wanted:
        return []
    points, pixels = points_from_depth(observation["depth"], observation["intrinsics"], observation["extrinsics"])
    owner = segmentation.ravel()[pixels]
    for number, count in wanted:
        mine = points[owner == number]
        if len(mine):
            about = entities[number]
            found.append(Sighting(number, about["kind"], about["name"], count, mine.mean(axis=0)))
    eye = np.asarray(observation["pose"])[:3]
    return sorted(found, key=lambda s: (float(np.linalg.norm(s.position - eye)), s.entity))


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
        self._hits = np.zeros((self.n, self.n), np.int32)
        self._bumps = np.zeros((self.n, self.n), np.bool_)

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
        np.add.at(self._hits, (cells[:, 1], cells[:, 0]), 1)

    def bump(self, xy: ArrayLike) -> None:
        """Remember that something stopped a step at a point."""
        ix, iy = ((np.asarray(xy, np.float64)[:2] - self.corner) / self.cell).astype(np.int64)
        if 0 <= ix < self.n and 0 <= iy < self.n:
            self._bumps[iy, ix] = True

    def route(self, start: ArrayLike, goal: ArrayLike, *, near: float, radius: float = 0.3) -> NDArray[np.float64]:
        """Find a way that keeps `radius` metres from what was seen, to within `near` metres of the goal.

        Returns
        -------
        ndarray
            Points after the start, shape ``(k, 2)``; empty where there is no way, or none is needed.
        """
        a = np.asarray(start, np.float64)[:2]
        b = np.asarray(goal, np.float64)[:2]
        blocked = self._grown(radius)
        first = tuple(((a - self.corner) / self.cell).astype(int))
        aim = (b - self.corner) / self.cell
        reach = near / self.cell
        best = _a_star(blocked, first, aim, reach)
        return np.array([self.corner + (np.array(c) + 0.5) * self.cell for c in best]).reshape(-1, 2)

    def _grown(self, radius: float) -> NDArray[np.bool_]:
        solid = (self._hits >= 3) | self._bumps
        grown = solid.copy()
        reach = math.ceil(radius / self.cell)
        for dy in range(-reach, reach + 1):
            for dx in range(-reach, reach + 1):
                if 0 < dx * dx + dy * dy <= (radius / self.cell) ** 2:
                    grown |= np.roll(solid, (dy, dx), axis=(0, 1))
        return grown


def _a_star(
    blocked: NDArray[np.bool_], start: tuple[int, ...], aim: NDArray[np.float64], reach: float
) -> list[tuple[int, int]]:
    """Cells from start (left out) to the first one within reach of the aim; ties are broken by position."""
    n = blocked.shape[0]
    origin = (int(start[0]), int(start[1]))
    if not (0 <= origin[0] < n and 0 <= origin[1] < n):
        return []
    cost = {origin: 0.0}
    parent: dict[tuple[int, int], tuple[int, int]] = {}
    queue = [(0.0, origin)]
    closed: set[tuple[int, int]] = set()
    while queue:
        _, cell = heapq.heappop(queue)
        if cell in closed:
            continue
        closed.add(cell)
        if math.hypot(cell[0] + 0.5 - aim[0], cell[1] + 0.5 - aim[1]) <= max(reach, 0.7):
            way = []
            while cell != origin:
                way.append(cell)
                cell = parent[cell]
            return way[::-1]
        for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)):
            x, y = cell[0] + dx, cell[1] + dy
            # A start that touches what is around it may still be left.
            if not (0 <= x < n and 0 <= y < n) or (blocked[y, x] and not blocked[cell[1], cell[0]]):
                continue
            new = cost[cell] + math.hypot(dx, dy) * (4.0 if blocked[y, x] else 1.0)
            if new < cost.get((x, y), math.inf):
                cost[(x, y)] = new
                parent[(x, y)] = cell
                guess = max(math.hypot(x + 0.5 - aim[0], y + 0.5 - aim[1]) - reach, 0.0)
                heapq.heappush(queue, (new + guess, (x, y)))
    return []
