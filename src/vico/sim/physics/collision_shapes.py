"""Shapes that robots collide with: solids near them, people and vehicles as kinematic bodies, parts of movable objects.

Cells of the ground say where something solid could be reached. The simulation moves everybody else in sub-steps of
0.1 s. Physics sees them move smoothly, from where they were to where they will be at the end of the sub-step, never
jump: what is pushed is pushed, not thrown. Free rigid objects have a fixed number of convex parts each, of which some
are in use.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.errors import InputError, SchemaError
from vico.exact import apply_matrix
from vico.geometry import rotation_matrix
from vico.io.compiled import compiled
from vico.sim.bodies.arrays import OBJECT, Bodies
from vico.sim.physics.records import BALL, BOX, CYLINDER, PARTS, Capacity, RigidObject, RigidPart, StaticScene

#: Side of a cell, metres.
_CELL = 0.5
#: Directions in which the outline of a solid is measured: what lies between them counts to it.
_DIRECTIONS = np.stack([np.cos(np.arange(16) * np.pi / 8), np.sin(np.arange(16) * np.pi / 8)], axis=1)
# Which of the directions are these.
_EAST, _NORTH, _WEST, _SOUTH = range(0, 16, 4)


#: Metres a robot, or a link of one, may move before it is asked again.
SLACK = 0.1
_HALF_DIAGONAL = _CELL * math.sqrt(0.5)
# What a distance kept with 4 bytes may be wrong by, metres.
_ROUNDING = 1e-3


@compiled
def _measure(cells, corner, outlines, directions, reach):
    """Write how far each cell's middle is from the nearest outline, and how high the highest within `reach` goes.

    The first cell begins at `corner`. Outlines are given by how far they go in each direction, and their tops.
    """
    away, tops = cells
    count = len(away)
    west, south = corner
    for k in range(len(outlines[0])):
        outline, top = outlines[0][k], outlines[1][k]
        first_column = max(int((-outline[_WEST] - reach - west) / _CELL), 0)
        last_column = min(int((outline[_EAST] + reach - west) / _CELL), count - 1)
        first_row = max(int((-outline[_SOUTH] - reach - south) / _CELL), 0)
        last_row = min(int((outline[_NORTH] + reach - south) / _CELL), count - 1)
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


class CellArrays(NamedTuple):
    """Squares of `SolidCells` as compiled code takes them; its attributes say what each is."""

    number: NDArray[np.int32]
    away: NDArray[np.float32]
    tops: NDArray[np.float32]
    half: float
    side: float


@compiled
def is_clear(cells, point, radius):
    """Return whether nothing solid is within some metres of a point, `radius` no more than the cells are made for.

    Of points that no square holds it is not known: False.
    """
    side = cells.side
    east, north = point[0] + cells.half, point[1] + cells.half
    across, up = math.floor(east / side), math.floor(north / side)
    if not (0 <= up < len(cells.number) and 0 <= across < len(cells.number)):
        return False
    k = cells.number[int(up), int(across)]
    if k < 0:
        return False
    last = cells.away.shape[1] - 1
    r, c = min(int((north - up * side) / _CELL), last), min(int((east - across * side) / _CELL), last)
    return cells.away[k, r, c] > radius + _HALF_DIAGONAL + _ROUNDING or point[2] - radius > cells.tops[k, r, c]


@compiled
def find_near(cells, reach, seconds, state, near):
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
            solids = _outlines_and_tops(scene)
            for k, (west, south) in enumerate(corners.tolist()):
                _measure((self.away[k], self.tops[k]), (west, south), solids, _DIRECTIONS, whole)
        if len(finite) < len(reaches):  # something of it may be anywhere
            self.mark_all()

    @property
    def cells(self) -> CellArrays:
        """The squares as compiled code takes them."""
        return CellArrays(self.number, self.away, self.tops, self.half, self.side)

    def mark_all(self) -> None:
        """Have something solid be near everywhere."""
        self.away[:], self.tops[:] = 0.0, np.inf


def _outlines_and_tops(scene: StaticScene) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return how far each solid goes in each direction, metres, shape ``(n, 16)``, and the height of its top."""
    found: list[NDArray[Any]] = [apply_matrix(points[:, :2], _DIRECTIONS).max(axis=0)[None] for points in scene.hulls]
    x, y, _, yaw, a, b, _ = scene.boxes.T
    middle = apply_matrix(np.stack([x, y], axis=1), _DIRECTIONS)
    c, s = np.cos(yaw), np.sin(yaw)
    forward = apply_matrix(np.stack([c, s], axis=1), _DIRECTIONS)
    sideways = apply_matrix(np.stack([-s, c], axis=1), _DIRECTIONS)
    found.append(middle + np.abs(forward) * a[:, None] + np.abs(sideways) * b[:, None])
    found.append(apply_matrix(scene.pillars[:, :2], _DIRECTIONS) + scene.pillars[:, 3:4])
    hulls = [float(points[:, 2].max()) for points in scene.hulls]
    boxes, pillars = (solids[:, 2] + solids[:, -1] for solids in (scene.boxes, scene.pillars))  # middle and half height
    tops = np.concatenate([np.array(hulls), boxes, pillars]) + _ROUNDING
    return np.concatenate([np.zeros((0, len(_DIRECTIONS))), *found]), tops


#: Bodies within this distance of a robot can be met, metres.
NEAR = 10.0
#: Kinematic bodies are this much larger than what they stand for: soft contact never lets the real ones overlap.
SKIN = 0.03
#: Further than this from where its velocity says that it comes from, metres, a body has jumped (or been moved).
_JUMP = 0.5
X, Y, Z, YAW = range(4)
_FIELDS = ("entity", "start", "end", "half", "time", "left_out")


@compiled
def _gaps(position, half_length, half_width, centres):
    """Distance of every body's outline (at least) from the nearest of `centres`, metres."""
    out = np.empty(len(position))
    for k in range(len(position)):
        least = np.inf
        for c in range(len(centres)):
            least = min(least, math.hypot(position[k, 0] - centres[c, 0], position[k, 1] - centres[c, 1]))
        out[k] = least - max(half_length[k], half_width[k])
    return out


@compiled
def moved_poses(start, end, time):
    """Return middle and yaw of everybody on the way, the shorter way round; arguments as in `KinematicBodies`."""
    share = 1.0 if time[1] <= 0.0 else min(1.0, time[0] / time[1])
    out = np.empty(start.shape)
    for k in range(len(start)):
        for i in range(YAW):
            out[k, i] = start[k, i] + (end[k, i] - start[k, i]) * share
        turn = (end[k, YAW] - start[k, YAW] + math.pi) % (2 * math.pi) - math.pi
        out[k, YAW] = start[k, YAW] + turn * share
    return out


class KinematicBodies:
    """A fixed number of slots: people on foot first, then everything else that is driven or ridden.

    Attributes
    ----------
    entity
        Who is in each slot, 0 for nobody, int32, shape ``(n,)``.
    start, end
        Middle and yaw at the beginning and at the end of the motion, float64, shape ``(n, 4)``.
    half
        Half extents, metres, shape ``(n, 3)``; people are as long as wide.
    time
        Seconds of the motion that have passed, and all of them, shape ``(2,)``.
    left_out
        How many near bodies found no slot, shape ``(1,)``.
    """

    def __init__(self, capacity: Capacity) -> None:
        n = capacity.people + capacity.vehicles
        self.people = capacity.people
        self.entity = np.zeros(n, np.int32)
        self.start, self.end = np.zeros((n, 4)), np.zeros((n, 4))
        self.half = np.full((n, 3), 0.25)
        self.time = np.zeros(2)
        self.left_out = np.zeros(1, np.int64)

    def set(self, bodies: Bodies, dt: float, centres: NDArray[np.float64]) -> None:
        """Take those near `centres` (robots, shape ``(r, 2)``): they arrive `dt` seconds from now."""
        before, poses = self.entity.copy(), self.poses()
        self.entity[:] = 0
        self.time[:] = 0.0, dt
        self.left_out[0] = 0
        if not len(bodies) or not len(centres):
            return
        gap = _gaps(bodies.position, bodies.half_length, bodies.half_width, centres)
        near = (gap < NEAR) & (bodies.kind != OBJECT)
        if not near.any():
            return
        on_foot = bodies.rounding == bodies.half_length
        for first, count, chosen in (
            (0, self.people, on_foot),
            (self.people, len(self.entity) - self.people, ~on_foot),
        ):
            rows = np.flatnonzero(chosen & near)
            rows = rows[np.lexsort((bodies.entity[rows], gap[rows]))]
            self.left_out[0] += max(len(rows) - count, 0)
            # In the order of their numbers, so that who comes and goes far away changes nothing.
            rows = rows[:count][np.argsort(bodies.entity[rows[:count]], kind="stable")]
            self._fill(slice(first, first + len(rows)), bodies, rows, dt)
        slot_of = {int(entity): k for k, entity in enumerate(before) if entity}
        for k in np.flatnonzero(self.entity):
            was = slot_of.get(int(self.entity[k]))
            away = np.inf if was is None else float(np.linalg.norm(self.start[k, :3] - poses[was, :3]))
            if was is not None and away <= _JUMP + 0.5 * float(np.linalg.norm(self.end[k, :3] - self.start[k, :3])):
                self.start[k] = poses[was]

    def _fill(self, slots: slice, bodies: Bodies, rows: NDArray[Any], dt: float) -> None:
        self.entity[slots] = bodies.entity[rows]
        self.half[slots, 0] = bodies.half_length[rows] + SKIN
        self.half[slots, 1] = bodies.half_width[rows] + SKIN
        self.half[slots, 2] = bodies.height[rows] / 2
        self.end[slots, :3] = bodies.position[rows]
        self.end[slots, Z] += bodies.height[rows] / 2
        self.end[slots, YAW] = bodies.yaw[rows]
        self.start[slots] = self.end[slots]
        self.start[slots, :2] -= bodies.velocity[rows] * dt

    @property
    def moving(self) -> bool:
        """Whether anybody is on the way."""
        return bool(self.time[0] < self.time[1] - 1e-9 and self.entity.any())

    def advance(self, dt: float) -> None:
        """Let time pass."""
        self.time[0] += dt

    def poses(self) -> NDArray[np.float64]:
        """Middle and yaw of everybody now, shape ``(n, 4)``."""
        found: NDArray[np.float64] = moved_poses(self.start, self.end, self.time)
        return found

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Everything that decides where they will be."""
        return {f"movers_{name}": getattr(self, name).copy() for name in _FIELDS}

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go back to what `arrays` held."""
        for name in _FIELDS:
            saved, mine = arrays[f"movers_{name}"], getattr(self, name)
            if saved.shape != mine.shape:
                raise SchemaError("physics: the saved state has room for other numbers of people and vehicles")
            mine[...] = saved


Array = NDArray[np.float64]

_IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])
_IS_CYLINDER, _IS_BALL = (np.array([shape == one for shape in PARTS]) for one in (CYLINDER, BALL))
# Half the extent of parts that are not in use, metres: what a model holds has to be of some size.
_NOTHING = 1e-3
# Share of its box that a shape fills.
_FILLS = {BOX: 1.0, CYLINDER: np.pi / 4, BALL: np.pi / 6}


class PartRows(NamedTuple):
    """Parts of objects as numbers.

    Attributes
    ----------
    rows
        Half extents (zeros: not in use), middle in the object's frame, metres, and turn w, x, y, z, of each of
        `PARTS`; shape ``(..., parts, 10)``.
    """

    rows: Array

    @property
    def is_used(self) -> NDArray[np.bool_]:
        """Which are in use, shape ``(..., parts)``."""
        return np.asarray(self.rows[..., 0] > 0.0)

    @property
    def half(self) -> Array:
        """Half extents, metres, next to nothing of those that are not in use, shape ``(..., parts, 3)``."""
        return np.where(self.is_used[..., None], self.rows[..., :3], _NOTHING)

    @property
    def position(self) -> Array:
        """Middles in the object's frame, metres, shape ``(..., parts, 3)``."""
        return np.asarray(self.rows[..., 3:6])

    @property
    def quaternion(self) -> Array:
        """Turns in the object's frame, shape ``(..., parts, 4)``."""
        return np.where(self.is_used[..., None], self.rows[..., 6:], _IDENTITY)

    @property
    def sizes(self) -> Array:
        """What a model calls their sizes: of cylinders radius and half length, of balls the radius."""
        found = self.half.copy()
        found[..., _IS_CYLINDER, 1] = found[..., _IS_CYLINDER, 2]
        found[..., _IS_CYLINDER, 2] = 0.0
        found[..., _IS_BALL, 1:] = 0.0
        return found

    @property
    def radii(self) -> Array:
        """Of balls that hold them, metres, shape ``(..., parts)``."""
        squares = self.half * self.half
        squares[..., _IS_CYLINDER, 1] = 0.0
        squares[..., _IS_BALL, 1:] = 0.0
        return np.asarray(np.sqrt(squares.sum(axis=-1)))

    def bounds(self) -> tuple[Array, Array]:
        """Middles of the boxes round whole objects, and half their extents, metres, shape ``(n, 3)`` each."""
        reach = np.einsum("...ij,...j->...i", np.abs(rotation_matrix(self.quaternion)), self.half)
        low = np.where(self.is_used[..., None], self.position - reach, np.inf).min(axis=-2)
        high = np.where(self.is_used[..., None], self.position + reach, -np.inf).max(axis=-2)
        return (low + high) / 2, (high - low) / 2

    def inertia(self, mass: float) -> Array:
        """Moments of one object about its axes, kg m2, shape ``(3,)``, its mass spread evenly over its parts."""
        shares = np.where(self.is_used, np.prod(self.half, axis=-1), 0.0) * [_FILLS[shape] for shape in PARTS]
        found = np.zeros(3)
        for k in np.flatnonzero(self.is_used).tolist():
            part, squares = mass * float(shares[k] / shares.sum()), self.half[k] ** 2
            own = part * _moments(PARTS[k], squares)
            turn, away = rotation_matrix(self.quaternion[k]), self.position[k] ** 2
            found += apply_matrix(own, turn * turn) + part * (away.sum() - away)
        return found


def _moments(shape: str, squares: Array) -> Array:
    """Moments of a shape of one kilogram about its own axes, m2."""
    a, b, c = squares.tolist()
    if shape == CYLINDER:
        return np.array([a / 4 + c / 3, b / 4 + c / 3, a / 2])
    return np.array([b + c, a + c, a + b]) / (5.0 if shape == BALL else 3.0)


def box_parts(half: Array) -> PartRows:
    """Return the parts of a plain box."""
    rows = np.zeros((len(PARTS), 10))
    rows[PARTS.index(BOX)] = [*half, 0.0, 0.0, 0.0, *_IDENTITY]
    return PartRows(rows)


def parts_of(thing: RigidObject) -> PartRows:
    """Return the parts of an object.

    Raises
    ------
    InputError
        If extents or mass are not positive, or there is no room for so many parts of a shape.
    """
    size = np.asarray(thing.size, np.float64)
    if size.shape != (3,) or not (np.isfinite(size).all() and size.min() > 0.0 and thing.mass > 0.0):
        raise InputError(
            f"physics: an object needs three positive extents and a mass, not {size.tolist()}, {thing.mass} kg"
        )
    return _rows_of(thing.parts) if thing.parts else box_parts(size / 2)


def _rows_of(parts: Sequence[RigidPart]) -> PartRows:
    rows = np.zeros((len(PARTS), 10))
    for part in parts:
        free = [k for k, shape in enumerate(PARTS) if shape == part.shape and not rows[k, 0]]
        if not free:
            room = ", ".join(f"{PARTS.count(shape)} {shape}" for shape in dict.fromkeys(PARTS))
            raise InputError(f"physics: an object has no room for another {part.shape}; there is room for {room}")
        rows[free[0]] = [*part.half, *part.position, *part.quaternion]
    return PartRows(rows)
