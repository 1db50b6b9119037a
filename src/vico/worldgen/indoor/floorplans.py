"""Floor plans by use: which rooms, how large, side by side how, which doors, on how many floors.

A sketch lies in its own frame: x from 0 to its width, y from 0 to its depth, the street at the south or west. Rooms
are rectangles that share walls; doors lie on shared walls. Furniture comes later.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from vico.assets.interior import RISE
from vico.worldgen.indoor.catalogue import uses
from vico.worldgen.indoor.furnishing import Furnishing
from vico.worldgen.indoor.records import Cell, EntryPlan, FrontPlan, SpinePlan

CEILING = 2.7
OUTSIDE = -1
CORE = (2.6, 4.6)  # a stairs room with its walls, metres
_CAR = 1.8
_CORRIDOR = 1.8

Box = tuple[float, float, float, float]


@dataclass(frozen=True)
class SketchRoom:
    """A room: its rectangle ``x0, y0, x1, y1``, its floor, clear height; stairs climb along `facing` quarter turns.

    Attributes
    ----------
    items
        Its furniture, in the frame of its own middle; None: furnished by its kind.
    floor, walls, colour
        How it looks, if not as its kind does.
    """

    kind: str
    box: Box
    storey: int = 0
    height: float = CEILING
    rise: float = 0.0
    facing: int = 1
    items: tuple[Furnishing, ...] | None = None
    floor: str | None = None
    walls: str | None = None
    colour: tuple[int, int, int] | None = None


@dataclass(frozen=True)
class SketchDoor:
    """A doorway between two rooms (`b` may be `OUTSIDE`), its middle on their wall; or a ride between two lift cars."""

    a: int
    b: int
    at: tuple[float, float]
    storey: int = 0
    width: float = 1.0
    lift: bool = False


@dataclass(frozen=True)
class Sketch:
    """Rooms and doors of a place; the first room has the way out."""

    use: str
    size: tuple[float, float]
    rooms: tuple[SketchRoom, ...]
    doors: tuple[SketchDoor, ...]

    @property
    def height(self) -> float:
        """From the lowest floor to the highest ceiling, metres."""
        return max(room.storey * RISE + room.height for room in self.rooms)


@dataclass
class _Draft:
    rooms: list[SketchRoom] = field(default_factory=list)
    doors: list[SketchDoor] = field(default_factory=list)

    def room(
        self, kind: str, x0: float, y0: float, x1: float, y1: float, storey: int = 0, height: float = CEILING
    ) -> int:
        box = (round(x0, 2), round(y0, 2), round(x1, 2), round(y1, 2))
        self.rooms.append(SketchRoom(kind, box, storey, height))
        return len(self.rooms) - 1

    def door(self, a: int, b: int, x: float, y: float, storey: int = 0, width: float = 1.0) -> None:
        self.doors.append(SketchDoor(a, b, (round(x, 2), round(y, 2)), storey, width))

    def strip(
        self, x0: float, x1: float, wall: float, deep: float, cells: Sequence[Cell], host: int, storey: int = 0
    ) -> None:
        """Rooms side by side from x0 to x1, each with a door to `host` on the wall at y = `wall`; north if deep > 0."""
        total = sum(share for _, share in cells)
        x = x0
        for k, (kind, share) in enumerate(cells):
            end = x1 if k == len(cells) - 1 else round(x + (x1 - x0) * share / total, 1)
            y0, y1 = (wall, wall + deep) if deep > 0 else (wall + deep, wall)
            room = self.room(kind, x, y0, end, y1, storey)
            self.door(host, room, min(x + 1.0, (x + end) / 2) if k % 2 else max(end - 1.0, (x + end) / 2), wall, storey)
            x = end

    def cores(self, x: float, wall: float, hosts: Sequence[int], *, lift: bool) -> float:
        """Stairs (and a lift) north of a wall, from floor to floor; hosts are the rooms before them. New x."""
        storeys = len(hosts)
        for k in range(storeys - 1):
            left = x + CORE[0] * k
            middle = left + CORE[0] / 2
            self.rooms.append(
                SketchRoom("stairs", (left, wall, left + CORE[0], wall + CORE[1]), k, RISE + CEILING, RISE)
            )
            room = len(self.rooms) - 1
            self.door(hosts[k], room, middle + 0.62, wall, k, 0.95)
            self.door(hosts[k + 1], room, middle - 0.62, wall, k + 1, 0.95)
            for other in range(storeys):
                if other not in (k, k + 1):
                    spare = self.room("storage", left, wall, left + CORE[0], wall + CORE[1], other)
                    self.door(hosts[other], spare, middle, wall, other)
        x = round(x + CORE[0] * (storeys - 1), 2)
        if lift and storeys > 1:
            cars = [self.room("lift", x, wall, x + _CAR, wall + _CAR, k) for k in range(storeys)]
            for k, car in enumerate(cars):
                self.door(hosts[k], car, x + _CAR / 2, wall, k)
            for k, car in enumerate(cars):
                for other in range(k + 1, storeys):
                    self.doors.append(SketchDoor(car, cars[other], (x + _CAR / 2, wall + _CAR - 0.5), k, 1.0, True))
            x = round(x + _CAR, 2)
        return x

    def finish(self, use: str, size: tuple[float, float]) -> Sketch:
        return Sketch(use, size, tuple(self.rooms), tuple(self.doors))


Composer = Callable[["_Draft", float, float, int], None]


def _front(d: _Draft, plan: FrontPlan, size: tuple[float, float], storeys: int) -> None:
    """Draw a large room at the street, rooms for the staff behind it."""
    w, h = size
    back = max(plan.depth, CORE[1]) if storeys > 1 else plan.depth
    hosts = [d.room(plan.front, 0, 0, w, h - back, k, plan.height) for k in range(storeys)]
    d.door(hosts[0], OUTSIDE, round(w * 0.35, 1), 0, 0, 1.2)
    x = d.cores(0.0, h - back, hosts, lift=plan.lift) if storeys > 1 else 0.0
    for k, host in enumerate(hosts):
        if plan.backs:
            d.strip(x, w, h - back, back, plan.backs if not k else plan.backs[:2], host, k)


def _entry(d: _Draft, plan: EntryPlan, size: tuple[float, float]) -> None:
    """Draw a hall at the street, the large room behind it; perhaps a side room, perhaps one more room beyond."""
    w, h = size
    beyond = 3.4 if plan.after else 0.0
    edge = w - 2.6 if plan.side else w
    first = d.room(plan.entry, 0, 0, edge, plan.depth)
    large = d.room(plan.main, 0, plan.depth, w, h - beyond, 0, plan.height)
    d.door(first, OUTSIDE, round(edge / 2, 1), 0, 0, 1.2)
    d.door(first, large, round(min(w / 2, edge - 0.9), 1), plan.depth, 0, 1.4)
    if plan.side:
        room = d.room(plan.side, edge, 0, w, plan.depth)
        d.door(first, room, edge, plan.depth / 2)
    if plan.after:
        room = d.room(plan.after, 0, h - beyond, min(w, 5.0), h)
        d.door(large, room, 1.1, h - beyond)


def _spine(d: _Draft, plan: SpinePlan, size: tuple[float, float], storeys: int) -> None:
    """Draw a lobby, then a corridor with rooms on both sides; the same on every floor above."""
    w, h = size
    up = CORE[1] if storeys > 1 else round((h - _CORRIDOR) / 2, 1)
    ys = round(h - up - _CORRIDOR, 2)
    yn = round(ys + _CORRIDOR, 2)
    hosts: list[int] = []
    first = d.room(plan.spine, 0, 0, plan.hall_width, h)
    d.door(first, OUTSIDE, 0, round(h / 2, 1), 0, 1.2)
    hosts.append(d.room("corridor", plan.hall_width, ys, w, yn))
    d.door(first, hosts[0], plan.hall_width, ys + _CORRIDOR / 2, 0, 1.3)
    hosts += [d.room("corridor", 0, ys, w, yn, k) for k in range(1, storeys)]
    x = d.cores(plan.hall_width, yn, hosts, lift=plan.lift) if storeys > 1 else plan.hall_width
    above = (plan.north if plan.upper_north is None else plan.upper_north,
             plan.south if plan.upper_south is None else plan.upper_south)  # fmt: skip
    for k, host in enumerate(hosts):
        north, south = (plan.north, plan.south) if k == 0 else above
        d.strip(x, w, yn, h - yn, north, host, k)
        d.strip(plan.hall_width if k == 0 else 0.0, w, ys, -ys, south, host, k)
        if k:
            d.strip(0.0, plan.hall_width, yn, h - yn, north[:1], host, k)


def _flat_small(d: _Draft, w: float, h: float, storeys: int) -> None:
    hall = d.room("hall", 0, 0, w / 2, 2.4)
    bath = d.room("bathroom", w / 2, 0, w, 2.4)
    main = d.room("studio", 0, 2.4, w, h)
    d.door(hall, OUTSIDE, 1.2, 0)
    d.door(hall, bath, w / 2, 1.2)
    d.door(hall, main, 1.2, 2.4)


def _flat_medium(d: _Draft, w: float, h: float, storeys: int) -> None:
    hall = d.room("hall", 3.2, 0, 5.6, 3.0)
    kitchen = d.room("kitchen", 0, 0, 3.2, 3.0)
    bath = d.room("bathroom", 5.6, 0, w, 3.0)
    living = d.room("living_room", 0, 3.0, 4.8, h)
    bedroom = d.room("bedroom", 4.8, 3.0, w, h)
    d.door(hall, OUTSIDE, 4.4, 0)
    d.door(hall, living, 4.1, 3.0)
    d.door(hall, bath, 5.6, 1.5)
    d.door(living, kitchen, 1.6, 3.0)
    d.door(living, bedroom, 4.8, 4.2)


def _flat_large(d: _Draft, w: float, h: float, storeys: int) -> None:
    hall = d.room("hall", 0, 4.0, 7.4, 5.5)
    living = d.room("living_room", 7.4, 3.6, w, h)
    kitchen = d.room("kitchen", 7.4, 0, w, 3.6)
    d.door(hall, OUTSIDE, 0, 4.75)
    d.door(hall, living, 7.4, 4.75)
    d.door(living, kitchen, 9.4, 3.6)
    d.strip(0, 7.4, 4.0, -4.0, (("bedroom", 3.9), ("bathroom", 2.4), ("storage", 1.7)), hall)
    d.strip(0, 7.4, 5.5, h - 5.5, (("bedroom", 1.0), ("kids_room", 1.0)), hall)


def _maisonette(d: _Draft, w: float, h: float, storeys: int) -> None:
    halls = [d.room("hall", 0, 4.0, w, 5.5, k) for k in range(2)]
    d.door(halls[0], OUTSIDE, 0, 4.75)
    x = d.cores(0.0, 5.5, halls, lift=False)
    d.strip(x, w, 5.5, h - 5.5, (("living_room", 1.0),), halls[0])
    d.strip(0, w, 4.0, -4.0, (("kitchen", 4.2), ("bathroom", 2.4), ("storage", 2.0)), halls[0])
    d.strip(x, w, 5.5, h - 5.5, (("bedroom", 1.0), ("kids_room", 0.9)), halls[1], 1)
    d.strip(0, w, 4.0, -4.0, (("bedroom", 4.2), ("bathroom", 2.4), ("storage", 2.0)), halls[1], 1)


def _galleries(d: _Draft, w: float, h: float, storeys: int) -> None:
    lobby = d.room("foyer", 0, 0, w, 5.0)
    left = d.room("gallery", 0, 5.0, w / 2, h)
    right = d.room("gallery", w / 2, 5.0, w, h)
    d.door(lobby, OUTSIDE, w / 2, 0, 0, 1.2)
    d.door(lobby, left, w / 4, 5.0, 0, 1.4)
    d.door(lobby, right, 3 * w / 4, 5.0, 0, 1.4)
    d.door(left, right, w / 2, (5.0 + h) / 2, 0, 1.4)


_DRAWN: Mapping[str, Composer] = {
    "flat_small": _flat_small,
    "flat_medium": _flat_medium,
    "flat_large": _flat_large,
    "maisonette": _maisonette,
    "galleries": _galleries,
}


def area_of(use: str, size: int) -> float:
    """Floor area of a use's plan of a size, one floor, square metres."""
    w, h = _extent(use, size)
    return w * h


def _extent(use: str, size: int) -> tuple[float, float]:
    sizes = uses().uses[use].sizes
    return sizes[min(size, len(sizes) - 1)]


def sketch_of(use: str, size: int = 0, storeys: int = 1, *, mirrored: bool = False) -> Sketch:
    """Return the bare plan of a use.

    Parameters
    ----------
    size
        0 small, 1 medium, 2 large.
    storeys
        Floors wanted; uses that have fewer get fewer.
    mirrored
        East and west swapped.
    """
    wanted = uses().uses[use]
    w, h = _extent(use, size)
    draft = _Draft()
    floors = max(wanted.least_storeys, min(storeys, wanted.storeys))
    if isinstance(wanted.plan, FrontPlan):
        _front(draft, wanted.plan, (w, h), floors)
    elif isinstance(wanted.plan, EntryPlan):
        _entry(draft, wanted.plan, (w, h))
    elif isinstance(wanted.plan, SpinePlan):
        _spine(draft, wanted.plan, (w, h), floors)
    else:
        _DRAWN[wanted.plan.drawn](draft, w, h, floors)
    sketch = draft.finish(use, (w, h))
    return _mirror_sketch(sketch) if mirrored else sketch


def _mirror_sketch(sketch: Sketch) -> Sketch:
    w = sketch.size[0]
    rooms, doors = [], []
    for room in sketch.rooms:
        x0, y0, x1, y1 = room.box
        rooms.append(
            SketchRoom(
                room.kind,
                (round(w - x1, 2), y0, round(w - x0, 2), y1),
                room.storey,
                room.height,
                room.rise,
                room.facing,
            )
        )
    for door in sketch.doors:
        x = round(w - door.at[0], 2)
        other = sketch.rooms[door.b] if door.b != OUTSIDE else None
        if other is not None and other.rise:
            # Stairs keep their hand: their lower door lies where their lower flight is.
            x0, x1 = w - other.box[2], w - other.box[0]
            x = round(x0 + x1 - x, 2)
        doors.append(SketchDoor(door.a, door.b, (x, door.at[1]), door.storey, door.width, door.lift))
    return Sketch(sketch.use, sketch.size, tuple(rooms), tuple(doors))
