"""Furnishing a room: pieces against walls, in sets and in rows, with free doors, free fronts and a way to everything.

A `RoomDraft` is a room while it is being furnished, in its own frame (origin at the middle of the floor, x east, y
north of the plan). Every solid piece is taken back if it cuts off a door. Walls are numbered 0 east, 1 north, 2 west,
3 south.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from vico.assets.models.library import furniture_models
from vico.assets.models.model import Model
from vico.geometry import distances

GRID = 0.1
BODY = 0.3  # bodies are 0.25 m; the rest is for the raster
STEP_IN = 0.6  # metres from a doorway to the spot inside it
_BESIDE_BED = 0.85  # metres from the hips to the side at which a bed is got out of
_NEAR_SIDE = 1.4  # metres from there to the spot at most
_SAMPLES = 16  # points at which the line to the hips is looked at for other furniture
_DOOR_CLEAR = (1.1, 0.95)  # width and depth kept free before a doorway, metres
_LOW = 1.0  # what is lower may stand before a window
_BESIDE = ndimage.generate_binary_structure(2, 1)  # cells that one steps between

Box = tuple[float, float, float, float]
Member = tuple[str, float, float, float]  # prototype, x, y in the set's frame, yaw in degrees
EAST, NORTH, WEST, SOUTH = range(4)


@dataclass(frozen=True)
class Furnishing:
    """A thing in a room: prototype, position and yaw in the room's frame, height of its foot above the floor."""

    prototype: str
    x: float
    y: float
    yaw: float
    z: float = 0.0


@dataclass(frozen=True)
class Opening:
    """A doorway or a window of a room: its wall, where along it (x or y of the room's frame), and how wide."""

    side: int
    at: float
    width: float

    def point(self, size: tuple[float, float], inwards: float = 0.0) -> tuple[float, float]:
        """Its middle, or a point some metres in from it."""
        if self.side in (EAST, WEST):
            x = size[0] / 2 - inwards
            return (x if self.side == EAST else -x, self.at)
        y = size[1] / 2 - inwards
        return (self.at, y if self.side == NORTH else -y)


class _Bed(NamedTuple):
    """A place to lie: where the hips are, where one stands to its left and right, and the outline of the bed."""

    hips: tuple[float, float]
    sides: tuple[tuple[float, float], tuple[float, float]]
    box: Box


class _Hung(NamedTuple):
    """Something on a wall: which, where along it, how wide, and from where to where above the floor."""

    side: int
    at: float
    width: float
    low: float
    high: float


class RoomDraft:
    """A room that is being furnished.

    Parameters
    ----------
    size
        Extent along x and y, metres.
    doors
        Doorways; the first one is the way in.
    windows
        Windows: tall pieces do not stand before them.
    chance
        Decides what rules leave open.
    """

    def __init__(
        self,
        size: tuple[float, float],
        doors: Sequence[Opening],
        windows: Sequence[Opening],
        chance: np.random.Generator,
    ) -> None:
        self.size = size
        self.doors, self.windows, self.chance = list(doors), list(windows), chance
        self.items: list[Furnishing] = []
        self.solid: list[Box] = []
        self.tall: list[Box] = []
        self._clear = [self._door_zone(door) for door in self.doors]
        self._hung: list[_Hung] = []
        self._beds: list[_Bed] = []
        self.taken = self._empty()
        self._spots = [self._cell(door.point(size, STEP_IN)) for door in self.doors]

    @property
    def near(self) -> int:
        """The wall with the way in."""
        return self.doors[0].side if self.doors else SOUTH

    @property
    def far(self) -> int:
        """The wall opposite the way in."""
        return (self.near + 2) % 4

    @property
    def sides(self) -> list[int]:
        """The walls to the left and right of the first door, the longer choice first decided by chance."""
        found = [(self.near + 1) % 4, (self.near + 3) % 4]
        return found if self.chance.random() < 0.5 else found[::-1]

    @property
    def walls(self) -> list[int]:
        """All walls in an order by chance, the way in last."""
        order = [int(k) for k in self.chance.permutation(4)]
        return [k for k in order if k != self.near] + [self.near]

    def length(self, side: int) -> float:
        """Length of a wall."""
        return self.size[1] if side in (EAST, WEST) else self.size[0]

    def _empty(self) -> NDArray[np.bool_]:
        nx, ny = round(self.size[0] / GRID), round(self.size[1] / GRID)
        taken = np.zeros((ny, nx), np.bool_)
        edge = math.ceil(BODY / GRID - 0.5)
        taken[:edge] = taken[-edge:] = True
        taken[:, :edge] = taken[:, -edge:] = True
        return taken

    def _cell(self, point: tuple[float, float]) -> tuple[int, int]:
        ny, nx = self.taken.shape
        ix, iy = int((point[0] + self.size[0] / 2) / GRID), int((point[1] + self.size[1] / 2) / GRID)
        return min(max(iy, 0), ny - 1), min(max(ix, 0), nx - 1)

    def _door_zone(self, door: Opening) -> Box:
        return self._strip(door.side, door.at, max(_DOOR_CLEAR[0], door.width + 0.1), 0.0, _DOOR_CLEAR[1])

    def _strip(self, side: int, at: float, width: float, start: float, deep: float) -> Box:
        """Return a rectangle before a wall: its middle along the wall, width, and from where to where off the wall."""
        a, b = at - width / 2, at + width / 2
        x, y = self.size[0] / 2, self.size[1] / 2
        if side == EAST:
            return (x - start - deep, a, x - start, b)
        if side == NORTH:
            return (a, y - start - deep, b, y - start)
        if side == WEST:
            return (start - x, a, start + deep - x, b)
        return (a, start - y, b, start + deep - y)

    def _is_free(self, box: Box, *, gap: float = 0.04, clear: bool = True) -> bool:
        x, y = self.size[0] / 2 + 1e-6, self.size[1] / 2 + 1e-6
        if box[0] < -x or box[1] < -y or box[2] > x or box[3] > y:
            return False
        if any(_meet(box, other, gap) for other in self.solid):
            return False
        return not (clear and any(_meet(box, other, 0.0) for other in self._clear))

    def reachable(self) -> NDArray[np.bool_]:
        """Cells where a body can stand that came in by the first door, indexed ``[iy, ix]``."""
        labels, _ = ndimage.label(~self.taken, _BESIDE)
        home = labels[self._spots[0]] if self._spots else 0
        return np.asarray((labels == home) & (home > 0))

    def _are_left(self, beds: Sequence[_Bed], new: Sequence[Box]) -> bool:
        """Whether all of some beds can be reached from the first door and lain in, with new pieces there."""
        if not beds:
            return True
        iy, ix = np.nonzero(self.reachable())
        points = np.column_stack([ix + 0.5, iy + 0.5]) * GRID - np.array(self.size) / 2
        return all(self._has_side(bed, points, [box for box in (*self.solid, *new) if box != bed.box]) for bed in beds)

    @staticmethod
    def _has_side(bed: _Bed, points: NDArray[np.float64], others: Sequence[Box]) -> bool:
        """Whether one can stand beside a bed at one of some points with nothing but the bed up to the hips."""
        away = np.min([distances(points, side) for side in bed.sides], axis=0)
        x, y = points[away <= _NEAR_SIDE].T
        along = np.linspace(0.0, 1.0, _SAMPLES)
        u, v = x[:, None] + along * (bed.hips[0] - x[:, None]), y[:, None] + along * (bed.hips[1] - y[:, None])
        met = np.zeros(len(x), np.bool_)
        for x0, y0, x1, y1 in others:
            met |= ((u > x0 - 1e-6) & (u < x1 + 1e-6) & (v > y0 - 1e-6) & (v < y1 + 1e-6)).any(axis=1)
        return not met.all()

    def _is_whole(self) -> bool:
        labels, _ = ndimage.label(~self.taken, _BESIDE)
        marks = {int(labels[cell]) for cell in self._spots}
        return len(marks) == 1 and 0 not in marks

    def _leaves_ring(self, window: tuple[int, int, int, int]) -> bool:
        """Whether what is free right around a blocked rectangle hangs together: then it parts nothing."""
        y0, y1, x0, x1 = window
        ny, nx = self.taken.shape
        a, b, c, d = max(y0 - 1, 0), min(y1 + 1, ny), max(x0 - 1, 0), min(x1 + 1, nx)
        ring = ~self.taken[a:b, c:d]
        ring[y0 - a : y1 - a, x0 - c : x1 - c] = False
        return int(ndimage.label(ring, _BESIDE)[1]) <= 1

    def _block(self, box: Box) -> tuple[int, int, int, int]:
        """Take a rectangle and what is too near to it; the rows and columns of cells that were taken."""
        ny, nx = self.taken.shape
        x0 = math.ceil((box[0] - BODY + self.size[0] / 2) / GRID - 0.5)
        x1 = math.floor((box[2] + BODY + self.size[0] / 2) / GRID - 0.5)
        y0 = math.ceil((box[1] - BODY + self.size[1] / 2) / GRID - 0.5)
        y1 = math.floor((box[3] + BODY + self.size[1] / 2) / GRID - 0.5)
        window = max(y0, 0), max(min(y1 + 1, ny), 0), max(x0, 0), max(min(x1 + 1, nx), 0)
        self.taken[window[0] : window[1], window[2] : window[3]] = True
        return window

    def block_all(self, items: Iterable[Furnishing]) -> None:
        """Take furniture that is there already into account."""
        models = furniture_models()
        for item in items:
            if models[item.prototype].solid:
                box = _outline(models[item.prototype], item.x, item.y, item.yaw)
                self.solid.append(box)
                self._block(box)

    def put(
        self,
        members: Iterable[Member],
        x: float,
        y: float,
        turn: int = 0,
        *,
        aisle: float = 0.0,
        front: Box | None = None,
    ) -> bool:
        """Stand a set somewhere, turned by quarter turns; False, and nothing changed, if it does not fit there.

        Parameters
        ----------
        aisle
            Free room wanted around the set as a whole, metres.
        front
            A rectangle of the room that has to be free, and stays so.
        """
        models = furniture_models()
        things: list[tuple[Furnishing, Box, Model]] = []
        c, s = (1, 0, -1, 0)[turn % 4], (0, 1, 0, -1)[turn % 4]
        for name, dx, dy, degrees in members:
            yaw = math.remainder(math.radians(degrees) + turn * math.pi / 2, 2 * math.pi)
            px, py = x + c * dx - s * dy, y + s * dx + c * dy
            model = models[name]
            things.append(
                (Furnishing(name, round(px, 3), round(py, 3), round(yaw, 5)), _outline(model, px, py, yaw), model)
            )
        solid = [box for _, box, model in things if model.solid]
        if solid and aisle > 0.0:
            whole = (
                min(b[0] for b in solid),
                min(b[1] for b in solid),
                max(b[2] for b in solid),
                max(b[3] for b in solid),
            )
            if any(_meet(whole, other, aisle) for other in self.solid):
                return False
        if not all(self._is_free(box) for box in solid):
            return False
        if front is not None and any(_meet(front, other, 0.0) for other in [*self.solid, *solid]):
            return False
        before = self.taken.copy()
        windows = [self._block(box) for box in solid]
        if not all(self._leaves_ring(window) for window in windows) and not self._is_whole():
            self.taken = before
            return False
        beds = [bed for thing, box, model in things for bed in _beds_of(thing, box, model)]
        if any(self.taken[cell] for cell in self._spots) or not self._are_left([*self._beds, *beds], solid):
            self.taken = before
            return False
        self.solid += solid
        self._beds += beds
        self.tall += [box for _, box, model in things if model.solid and model.size[2] > _LOW]
        self.items += [thing for thing, _, _ in things]
        if front is not None:
            self._clear.append(front)
        return True

    def against(
        self,
        name: str,
        sides: int | Sequence[int] | None = None,
        *,
        along: str | float = "any",
        front: float = 0.6,
        gap: float = 0.03,
        extra: Sequence[Member] = (),
        width: float = 0.0,
    ) -> tuple[int, float] | None:
        """Stand a piece with its back to a wall.

        Parameters
        ----------
        sides
            Walls to try, in this order; all of them if not given.
        along
            ``any``, ``middle``, ``corner``, ``door`` (as near to the way in as can be), or a place along the wall to be
            as near to as can be.
        front
            Depth kept free before it, metres.
        extra
            Further pieces of the set: prototype, metres ahead of the piece's middle, metres to its left, yaw in
            degrees from the direction the piece faces.
        width
            Width to reserve along the wall, if more than the piece's own.

        Returns
        -------
        tuple or None
            The wall and where along it; None if it fits nowhere.
        """
        models = furniture_models()
        model = models[name]
        deep, wide = model.size[0], max(model.size[1], width)
        order = [sides] if isinstance(sides, int) else list(sides) if sides is not None else self.walls
        for side in order:
            length = self.length(side)
            free = (length - wide) / 2 - 0.02
            if free < 0:
                continue
            steps = max(1, min(36, round(2 * free / 0.12)))
            spots = [-free + 2 * free * k / steps for k in range(steps + 1)] if free > 0.01 else [0.0]
            tries = 0
            for at in self._order_spots(spots, along, side):
                if model.size[2] > _LOW and self._covers_window(side, at, wide):
                    continue
                inner = deep / 2 + gap + max([deep / 2, *(e[1] + max(models[e[0]].size[:2]) / 2 + 0.02 for e in extra)])
                if not self._is_free(self._strip(side, at, wide, 0.0, inner)):
                    continue
                x, y = _middle(self._strip(side, at, 0.0, gap, deep))
                ahead = self._strip(side, at, wide * 0.8, inner, front) if front else None
                turn = (side + 2) % 4
                if self.put([(name, 0.0, 0.0, 0.0), *extra], x, y, turn, front=ahead):
                    return side, at
                tries += 1
                if tries > 4:
                    break
        return None

    def row(self, name: str, side: int, *, most: int, front: float = 0.7, gap: float = 0.03, pitch: float = 0.0) -> int:
        """Line a wall with pieces; how many were placed."""
        count = 0
        while count < most and self.against(
            name, side, along="corner" if not count else "any", front=front, gap=gap, width=pitch
        ):
            count += 1
        return count

    def _order_spots(self, spots: list[float], along: str | float, side: int) -> list[float]:
        if isinstance(along, float):
            return sorted(spots, key=lambda s: abs(s - along))
        if along == "middle":
            return sorted(spots, key=abs)
        if along == "corner":
            sign = 1.0 if self.chance.random() < 0.5 else -1.0
            return sorted(spots, key=lambda s: -abs(s) - 0.01 * sign * s)
        if along == "door" and self.doors:
            x, y = self.doors[0].point(self.size)
            goal = y if side in (EAST, WEST) else x
            return sorted(spots, key=lambda s: abs(s - goal))
        return [spots[int(k)] for k in self.chance.permutation(len(spots))]

    def _covers_window(self, side: int, at: float, wide: float) -> bool:
        return any(w.side == side and abs(w.at - at) < (w.width + wide) / 2 - 0.1 for w in self.windows)

    def fill(
        self,
        members: Sequence[Member],
        pitch: tuple[float, float],
        *,
        most: int = 99,
        aisle: float = 0.5,
        turn: int = 0,
        inset: float = 0.5,
        box: Box | None = None,
    ) -> int:
        """Stand a set again and again on a lattice; how many found room.

        Parameters
        ----------
        pitch
            Between the middles of neighbours along x and y, metres.
        inset
            From the walls to the lattice, metres.
        box
            Part of the room to fill; all of it if not given.
        """
        x0, y0, x1, y1 = box or (-self.size[0] / 2, -self.size[1] / 2, self.size[0] / 2, self.size[1] / 2)
        columns = max(1, int((x1 - x0 - 2 * inset) / pitch[0]) + 1)
        rows = max(1, int((y1 - y0 - 2 * inset) / pitch[1]) + 1)
        count = 0
        for j in range(rows):
            for i in range(columns):
                x = (x0 + x1) / 2 + (i - (columns - 1) / 2) * pitch[0]
                y = (y0 + y1) / 2 + (j - (rows - 1) / 2) * pitch[1]
                if count < most and self.put(members, x, y, turn, aisle=aisle):
                    count += 1
        return count

    def lay(self, name: str, x: float, y: float, turn: int = 0) -> None:
        """Lay a flat thing on the floor."""
        low = _outline(furniture_models()[name], x, y, turn * math.pi / 2)
        a, b = self.size[0] / 2 - 0.05, self.size[1] / 2 - 0.05
        if low[0] > -a and low[1] > -b and low[2] < a and low[3] < b:
            self.items.append(
                Furnishing(name, round(x, 3), round(y, 3), round(math.remainder(turn * math.pi / 2, 2 * math.pi), 5))
            )

    def hang(self, name: str, sides: int | Sequence[int] | None = None, *, at: float | None = None) -> bool:
        """Hang a thing on a wall, clear of doors, windows, tall furniture and what hangs there."""
        model = furniture_models()[name]
        wide, low, high = model.size[1], float(model.bounds[0, 2]), float(model.bounds[1, 2])
        order = [sides] if isinstance(sides, int) else list(sides) if sides is not None else self.walls
        for side in order:
            free = (self.length(side) - wide) / 2 - 0.1
            if free < 0:
                continue
            spots = [at] if at is not None else self._order_spots([free * k / 6 for k in range(-6, 7)], "middle", side)
            for s in spots:
                if abs(s) > free:
                    continue
                blocked = any(
                    o.side == side and abs(o.at - s) < (o.width + wide) / 2 + 0.12 for o in [*self.doors, *self.windows]
                )
                blocked |= any(
                    h.side == side and abs(h.at - s) < (h.width + wide) / 2 + 0.1 and h.low < high and low < h.high
                    for h in self._hung
                )
                strip = self._strip(side, s, wide, 0.0, 0.25)
                blocked |= low < 2.0 and any(_meet(strip, box, 0.0) for box in self.tall)
                if not blocked:
                    x, y = _middle(self._strip(side, s, 0.0, 0.012, model.size[0]))
                    yaw = math.remainder((side + 2) * math.pi / 2, 2 * math.pi)
                    self.items.append(Furnishing(name, round(x, 3), round(y, 3), round(yaw, 5)))
                    self._hung.append(_Hung(side, s, wide, low, high))
                    return True
        return False


def _beds_of(thing: Furnishing, box: Box, model: Model) -> list[_Bed]:
    """Return the places to lie of a piece that stands in a room."""
    if model.seat is None or not model.seat.lies:
        return []
    c, s = math.cos(thing.yaw), math.sin(thing.yaw)
    found = []
    for u, v in model.seat.places:
        x, y = thing.x + c * u - s * v, thing.y + s * u + c * v
        left, right = ((x - away * s, y + away * c) for away in (_BESIDE_BED, -_BESIDE_BED))
        found.append(_Bed((x, y), (left, right), box))
    return found


def _outline(model: Model, x: float, y: float, yaw: float) -> Box:
    c, s = abs(math.cos(yaw)), abs(math.sin(yaw))
    a, b = (c * model.size[0] + s * model.size[1]) / 2, (s * model.size[0] + c * model.size[1]) / 2
    return (x - a, y - b, x + a, y + b)


def _meet(one: Box, other: Box, gap: float) -> bool:
    return bool(
        one[0] < other[2] + gap - 1e-9
        and other[0] < one[2] + gap - 1e-9
        and one[1] < other[3] + gap - 1e-9
        and other[1] < one[3] + gap - 1e-9
    )


def _middle(box: Box) -> tuple[float, float]:
    return (box[0] + box[2]) / 2, (box[1] + box[3]) / 2
