"""Perception from pictures: points from depth, entities in view, and the memory of sightings.

`DepthGrid` is a grid of obstacles with A* on it. `SightingMemory` also remembers which rooms were looked at, and
forgets what is no longer where it was.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.agents.base import AgentState, heading
from vico.agents.navigation.voxels import MOVING
from vico.exact import apply_matrix
from vico.io.compiled import compiled
from vico.observation_arrays import entity_pixels

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
    shown = entity_pixels(observation)
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
            self._blocked[radius] = np.packbits(self._grow_obstacles(radius))
        blocked = self._cells(self._blocked[radius])
        first = tuple(((a - self.corner) / self.cell).astype(int))
        aim = (b - self.corner) / self.cell
        reach = near / self.cell
        return self.corner + (_a_star(blocked, first, aim, reach) + 0.5) * self.cell

    def _grow_obstacles(self, radius: float) -> NDArray[np.bool_]:
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
    return np.asarray(_search_grid(blocked, x, y, float(aim[0]), float(aim[1]), reach), np.int64).reshape(-1, 2)


@compiled
def _search_grid(blocked, start_x, start_y, aim_x, aim_y, reach):
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
        if _cell_distance(x + 0.5 - aim_x, y + 0.5 - aim_y) <= max(reach, 0.7):
            return _backtrack(parent, x, y, start_x, start_y)
        for dy in range(-1, 2):
            for dx in range(-1, 2):
                i, j = x + dx, y + dy
                if not (0 <= i < n and 0 <= j < n) or closed[j, i]:
                    continue
                # A start that touches what is around it may still be left.
                if blocked[j, i] and not blocked[y, x]:
                    continue
                new = cost[y, x] + _cell_distance(dx, dy) * (4.0 if blocked[j, i] else 1.0)
                if new < cost[j, i]:
                    cost[j, i] = new
                    parent[j, i] = y * n + x
                    guess = max(_cell_distance(i + 0.5 - aim_x, j + 0.5 - aim_y) - reach, 0.0)
                    heapq.heappush(queue, (new + guess, i, j))
    return np.zeros((0, 2), np.int64)


@compiled(inline="always")
def _cell_distance(dx, dy):
    return math.sqrt(dx * dx + dy * dy)


@compiled
def _backtrack(parent, x, y, start_x, start_y):
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


#: With so many pixels, and after so many seconds for what moves, confidence has come to, or fallen to, 63 % and 37 %.
SURE_PIXELS, STALE_AFTER = 20.0, 60.0
#: Directions that a look around in a room is counted in, and how far a picture reaches to either side, radians.
VIEW_DIRECTIONS, _HALF_DIRECTION = 8, math.radians(45.001)
#: Most things that are remembered; what was seen longest ago is forgotten first.
MAX_SIGHTINGS = 512
# Seen within so many metres of where it was, it lies there still.
_SAME_PLACE = 0.5
_SEEN_BEHIND = 0.35  # metres behind a thing's place that is seen: the thing is gone
_NEVER_GONE = 0.4  # metres before the camera within which nothing is missed


@dataclass(frozen=True)
class RememberedSighting:
    """Something that was seen.

    Attributes
    ----------
    position
        Where, ENU metres, shape ``(3,)``.
    room
        Id of the room one was in; empty outdoors.
    time
        Second of the day at which it was last seen.
    pixels
        How many showed it, at most, while it lay there.
    """

    entity: int
    kind: str
    name: str
    position: NDArray[np.float64]
    room: str
    time: float
    pixels: int

    def confidence(self, now: float) -> float:
        """How sure one may be, 0 to 1, that it is such a thing and there: by pixels, and by time for what moves."""
        sure = 1.0 - math.exp(-self.pixels / SURE_PIXELS)
        return sure * math.exp(-(now - self.time) / STALE_AFTER) if self.kind in MOVING else sure


class SightingMemory:
    """Remembers things with names, until they are seen to be gone, and from which rooms' corners one looked."""

    def __init__(self) -> None:
        self._rooms: dict[str, dict[int, RememberedSighting]] = {}
        # In which room each thing is known, the one that was seen longest ago first.
        self._room_of: dict[int, str] = {}
        self._looks: dict[str, int] = {}

    def notice(self, observation: Mapping[str, Any], things: Iterable[Sighting]) -> list[RememberedSighting]:
        """Take in a picture; return what is not where it was seen before, which is forgotten.

        Parameters
        ----------
        observation
            With pictures.
        things
            What they show, as `vico.agents.perception.sightings` found it.
        """
        state = observation["state"]
        room, now = str(state["room"] or ""), float(state["time"])
        if room:
            self._looks[room] = self._looks.get(room, 0) | _direction_bits(heading(observation))
        for thing in things:
            before = self._pop(thing.entity)
            pixels = thing.pixels
            if before is not None and math.dist(before.position, thing.position) < _SAME_PLACE:
                pixels = max(pixels, before.pixels)
            self._put(RememberedSighting(thing.entity, thing.kind, thing.name, thing.position, room, now, pixels))
        hidden = [thing for thing in self._rooms.get(room, {}).values() if thing.time != now]
        missing = [thing for thing, gone in zip(hidden, _which_are_gone(hidden, observation), strict=True) if gone]
        missing += [seen for entity in state["held"] if entity and (seen := self._thing(int(entity))) is not None]
        for gone in missing:
            self.forget(gone.entity)
        while len(self._room_of) > MAX_SIGHTINGS:
            self.forget(next(iter(self._room_of)))
        return missing

    def _thing(self, entity: int) -> RememberedSighting | None:
        return self._rooms[self._room_of[entity]].get(entity) if entity in self._room_of else None

    def _pop(self, entity: int) -> RememberedSighting | None:
        room = self._room_of.pop(entity, None)
        return None if room is None else self._rooms[room].pop(entity)

    def _put(self, thing: RememberedSighting) -> None:
        self._rooms.setdefault(thing.room, {})[thing.entity] = thing
        self._room_of[thing.entity] = thing.room

    def last_seen(self, name: str) -> RememberedSighting | None:
        """Return where something was seen last, by its name; None if it was not, or is gone."""
        found = [thing for thing in self._all() if thing.name == name]
        return max(found, key=lambda thing: (thing.time, thing.pixels, -thing.entity), default=None)

    def things(self, *, kind: str | None = None, room: str | None = None) -> list[RememberedSighting]:
        """Return what is remembered, the latest first; of one kind, or in one room (empty: outdoors)."""
        within = self._all() if room is None else self._rooms.get(room, {}).values()
        found = [thing for thing in within if kind is None or thing.kind == kind]
        return sorted(found, key=lambda thing: (-thing.time, thing.entity))

    def _all(self) -> list[RememberedSighting]:
        return [self._rooms[room][entity] for entity, room in self._room_of.items()]

    def looked_at(self, room: str) -> float:
        """Return the share of the directions that one looked in from within a room, 0 to 1."""
        return self._looks.get(room, 0).bit_count() / VIEW_DIRECTIONS

    def forget(self, entity: int) -> None:
        """Forget a thing: it was picked up, say."""
        self._pop(entity)

    def state(self) -> AgentState:
        """Return all of it."""
        things = self._all()
        return {
            "entity": [thing.entity for thing in things],
            "kind": [thing.kind for thing in things],
            "name": [thing.name for thing in things],
            "room": [thing.room for thing in things],
            "position": np.array([thing.position for thing in things], np.float64).reshape(-1, 3),
            "time": [thing.time for thing in things],
            "pixels": [thing.pixels for thing in things],
            "looks": dict(self._looks),
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Remember what `state` returned."""
        rows = zip(
            *(state[name] for name in ("entity", "kind", "name", "position", "room", "time", "pixels")), strict=True
        )
        things = [RememberedSighting(*row) for row in rows]
        self._rooms, self._room_of = {}, {}
        for thing in things:
            self._put(replace(thing, entity=int(thing.entity), position=np.array(thing.position, np.float64)))
        self._looks = {str(room): int(looks) for room, looks in state["looks"].items()}


def _direction_bits(yaw: float) -> int:
    """Return the directions that a picture takes in, a bit each."""
    bits = 0
    for k in range(VIEW_DIRECTIONS):
        away = (2 * math.pi * k / VIEW_DIRECTIONS - yaw + math.pi) % (2 * math.pi) - math.pi
        bits |= (abs(away) <= _HALF_DIRECTION) << k
    return bits


def _which_are_gone(things: Sequence[RememberedSighting], observation: Mapping[str, Any]) -> NDArray[np.bool_]:
    """Tell of which things a picture shows what lies behind their places."""
    if not things:
        return np.zeros(0, np.bool_)
    extrinsics, intrinsics = observation["extrinsics"], observation["intrinsics"]
    depth = np.asarray(observation["depth"])
    places = np.array([thing.position for thing in things])
    x, y, z = apply_matrix(places, extrinsics[:3, :3]).T + extrinsics[:3, 3:]
    ahead = z >= _NEVER_GONE
    z = np.where(ahead, z, 1.0)
    column, row = intrinsics[0, 0] * x / z + intrinsics[0, 2], intrinsics[1, 1] * y / z + intrinsics[1, 2]
    inside = (column >= 1) & (column < depth.shape[1] - 1) & (row >= 1) & (row < depth.shape[0] - 1)
    column, row = (np.where(inside, k, 1).astype(np.int64) for k in (column, row))
    gone = ahead & inside
    # A little more than the pixel itself: what is small may lie beside it.
    for dy in (-1, 0, 1):
        for dx in (-1, 0, 1):
            seen = depth[row + dy, column + dx]
            gone &= (seen == 0.0) | (seen > z + _SEEN_BEHIND)
    return gone
