"""From a sketch to a furnished plan, and from plans to rooms: doors, furniture, containers, small things.

Which plan a place gets is decided by what it is for; plans are made once in their own frame (origin at the middle of
the lowest floor) and placed as often as needed: rooms, doorways, containers, furniture and surfaces in the world's
frame. Small things are chosen by room and surface, apart from each other and from the edges: a surface gives a strip at
one of its ends to them; what is left of it stays a container, so that things put down there never stand in a vase.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.assets.interior import DOOR_HEIGHT, HEAD, RISE, SHOP_SILL, SILL, THICK, Inside, WallOpening, shell
from vico.assets.models.library import furniture_models
from vico.assets.models.model import Model, Top
from vico.assets.shapes import pose_matrix
from vico.io.data_files import cached_data
from vico.rules import REACH
from vico.seeds import rng
from vico.world.mesh import Surface, merge_surfaces
from vico.world.model import FIRST_FURNITURE, FIRST_ROOM, LANDING, Category, Container, Doorway, Place, Room
from vico.world.objects import Objects
from vico.worldgen.facts.fault_isolation import drop_on_failure
from vico.worldgen.indoor import catalogue
from vico.worldgen.indoor.catalogue import UNFURNISHED, RoomKind, room_kinds
from vico.worldgen.indoor.floorplans import OUTSIDE, Sketch, SketchRoom, sketch_of
from vico.worldgen.indoor.furnishing import EAST, GRID, NORTH, SOUTH, STEP_IN, WEST, Furnishing, Opening, RoomDraft
from vico.worldgen.indoor.recipes import furnish_room

_GAP = 0.02
_STRIP = 0.24
_LEAST_LEFT = 0.45  # what a surface keeps for other things, metres

_USED = {"table", "desk"}


@dataclass(frozen=True)
class SmallThings:
    """Small things of a room, in its frame, and what is left of the surfaces they stand on, by furniture index.

    A surface that is full maps to None.
    """

    things: tuple[Furnishing, ...]
    tops: dict[int, Top | None]


def _small_things(kind: str, items: Sequence[Furnishing], chance: np.random.Generator) -> SmallThings:
    """Lay small things on the tables, desks and counters of a room.

    Parameters
    ----------
    kind
        Of the room.
    items
        Its furniture.
    """
    models, known = furniture_models(), room_kinds()
    things: list[Furnishing] = []
    tops: dict[int, Top | None] = {}
    for k, item in enumerate(items):
        top = models[item.prototype].top
        if top is None or top.kind not in _USED or chance.random() < 0.15:
            continue
        wanted = known.on.get(item.prototype) or known.of(kind).entry.small
        if not wanted:
            continue
        order = [wanted[int(j)] for j in chance.permutation(len(wanted))]
        deep, wide = top.size
        small = deep * wide < 0.3
        strip = wide if small else max(_STRIP, min(0.42, wide * 0.34))
        if not small and wide - strip < _LEAST_LEFT:
            continue
        end = 1.0 if chance.random() < 0.5 else -1.0
        middle = top.centre[1] if small else top.centre[1] + end * (wide - strip) / 2
        laid = _along(order, deep, strip, 1 if small else 3)
        if not laid:
            continue
        c, s = math.cos(item.yaw), math.sin(item.yaw)
        for name, u, turn in laid:
            x, y = top.centre[0] + u, middle
            things.append(
                Furnishing(
                    name,
                    round(item.x + c * x - s * y, 3),
                    round(item.y + s * x + c * y, 3),
                    round(math.remainder(item.yaw + turn, 2 * math.pi), 5),
                    round(top.height + item.z, 3),
                )
            )
        rest = None
        if not small:
            rest = replace(top, size=(deep, wide - strip), centre=(top.centre[0], top.centre[1] - end * strip / 2))
        tops[k] = rest
    return SmallThings(tuple(things), tops)


def _along(names: Sequence[str], deep: float, strip: float, most: int) -> list[tuple[str, float, float]]:
    """Things side by side across a strip: name, place along its depth from its middle, quarter turn."""
    models = furniture_models()
    row: list[tuple[str, float, float]] = []  # name, width taken, turn
    used = _GAP
    for name in names:
        if len(row) == most:
            break
        a, b, _ = models[name].size
        for along, across, turn in ((a, b, 0.0), (b, a, math.pi / 2)):
            if across <= strip - 0.01 and used + along + _GAP <= deep:
                row.append((name, along, turn))
                used += along + _GAP
                break
    spare = (deep - used) / (len(row) + 1) if row else 0.0
    found, at = [], -deep / 2 + _GAP
    for name, along, turn in row:
        at += spare
        found.append((name, at + along / 2, turn))
        at += along + _GAP
    return found


_MOST_CHAIRS = 3  # containers of this kind a room
_LARGEST_TOP = 24  # containers a room
VARIANTS = 4


@dataclass(frozen=True)
class ContainerPlan:
    """A container of a plan: kind, index of its furniture (-1: the floor), centre, size, yaw, and the reach point."""

    kind: str
    item: int
    centre: tuple[float, float, float]
    size: tuple[float, float]
    yaw: float
    reach: tuple[float, float]


@dataclass(frozen=True)
class DoorPlan:
    """A way out of a room: to which room (-1: outdoors), where, and the free spot inside; plan frame."""

    to: int
    position: tuple[float, float, float]
    inside: tuple[float, float, float]


@dataclass(frozen=True)
class RoomPlan:
    """A room of a plan, all in the plan's frame; `yaw` is 0 but for stairs, `size` runs along its own axes."""

    kind: str
    centre: tuple[float, float, float]
    size: tuple[float, float, float]
    yaw: float
    rise: float
    doors: tuple[DoorPlan, ...]
    items: tuple[Furnishing, ...]
    spots: tuple[ContainerPlan, ...]

    @property
    def links(self) -> tuple[int, ...]:
        """Rooms this one opens to."""
        return tuple(sorted({door.to for door in self.doors if door.to != OUTSIDE}))


@dataclass(frozen=True)
class FloorPlan:
    """Rooms of a place, the one with the way out first; `shell` holds indices of rooms as entities."""

    use: str
    rooms: tuple[RoomPlan, ...]
    size: tuple[float, float]
    height: float
    shell: tuple[Surface, ...]


def uses() -> list[str]:
    """All uses there are plans for."""
    return list(catalogue.uses().uses)


@cached_data
def plan_of(use: str, size: int = 0, storeys: int = 1, variant: int = 0) -> FloorPlan:
    """Return the furnished plan of a use; variants differ in handedness, colours and furniture."""
    sketch = sketch_of(use, size, storeys, mirrored=variant % 2 == 1)
    return furnish_sketch(sketch, rng(0, "plan", use, size, storeys, variant), variant)


def furnish_sketch(sketch: Sketch, chance: np.random.Generator, variant: int = 0) -> FloorPlan:
    """Give a sketch walls, doors, windows, furniture, containers and small things."""
    w, h = sketch.size
    boxes = [_inner(room) for room in sketch.rooms]
    openings = _doorways(sketch, boxes)
    order = _from_the_street(sketch)
    rooms: list[RoomPlan] = []
    insides: list[Inside] = []
    for i, room in enumerate(sketch.rooms):
        x0, y0, x1, y1 = boxes[i]
        cx, cy, z = round((x0 + x1) / 2 - w / 2, 3), round((y0 + y1) / 2 - h / 2, 3), round(room.storey * RISE, 3)
        size = (round(x1 - x0, 3), round(y1 - y0, 3))
        mine = sorted(openings[i], key=lambda way: -1 if way.to == OUTSIDE else order[way.to])
        kind = room_kinds().of(room.kind)
        windows = _windows(sketch, room, size, mine, street=kind.entry.shop_window) if kind.entry.daylight else []
        draft = RoomDraft(size, [way.opening for way in mine if not way.lift], windows, chance)
        if room.items is not None:
            items = list(room.items)
        elif room.rise:
            items = [
                Furnishing("stair_wall", *_rotate_quarters(-LANDING / 2, 0.0, room.facing), room.facing * math.pi / 2)
            ]
        elif room.kind == "lift":
            items = [Furnishing("lift_panel", *_lift_panel(draft))]
        else:
            if kind.composition is not None:
                kind.composition(draft)
            else:
                furnish_room(draft, kind.entry.furniture, room_kinds().names)
            items = draft.items
        dress = _small_things(room.kind, items, chance) if room.kind not in UNFURNISHED else SmallThings((), {})
        spots = _spots(room, draft, items, dress) if room.kind not in UNFURNISHED else ()
        rooms.append(
            RoomPlan(
                kind=room.kind,
                centre=(cx, cy, z),
                size=(
                    *(size if room.facing % 2 == 0 or not room.rise else size[::-1]),
                    room.height,
                ),
                yaw=room.facing * math.pi / 2 if room.rise else 0.0,
                rise=room.rise,
                doors=tuple(_door_plan(way, draft, (cx, cy, z)) for way in mine),
                items=tuple(
                    replace(i, x=round(i.x + cx, 3), y=round(i.y + cy, 3), z=round(i.z + z, 3))
                    for i in (*items, *dress.things)
                ),
                spots=tuple(_translate_container(spot, cx, cy, z) for spot in spots),
            )
        )
        insides.append(_inside(i, room, kind, (cx, cy, z), size, mine, windows, variant))
    return FloorPlan(sketch.use, tuple(rooms), sketch.size, round(sketch.height, 3), tuple(shell(insides)))


def _inner(room: SketchRoom) -> tuple[float, float, float, float]:
    """Return a room's rectangle within its walls."""
    x0, y0, x1, y1 = room.box
    half = THICK / 2
    return round(x0 + half, 3), round(y0 + half, 3), round(x1 - half, 3), round(y1 - half, 3)


class _Doorway(NamedTuple):
    """A way out of a room: the room it leads to, its opening, its height above the room's floor, whether a lift's."""

    to: int
    opening: Opening
    low: float
    lift: bool


def _doorways(sketch: Sketch, boxes: Sequence[tuple[float, float, float, float]]) -> list[list[_Doorway]]:
    found: list[list[_Doorway]] = [[] for _ in boxes]
    for door in sketch.doors:
        for mine, other in ((door.a, door.b), (door.b, door.a)):
            if mine == OUTSIDE:
                continue
            x0, y0, x1, y1 = boxes[mine]
            cx, cy = (x0 + x1) / 2, (y0 + y1) / 2
            x, y = door.at
            gaps = {EAST: abs(x - x1), NORTH: abs(y - y1), WEST: abs(x - x0), SOUTH: abs(y - y0)}
            side = min(gaps, key=lambda k: gaps[k])
            at = round(y - cy if side in (EAST, WEST) else x - cx, 3)
            low = round((door.storey - sketch.rooms[mine].storey) * RISE, 3) if not door.lift else 0.0
            found[mine].append(_Doorway(other, Opening(side, at, door.width), low, door.lift))
    return found


def _from_the_street(sketch: Sketch) -> list[int]:
    """Doors between each room and the street."""
    links: dict[int, list[int]] = {i: [] for i in range(-1, len(sketch.rooms))}
    for door in sketch.doors:
        links[door.a].append(door.b)
        links[door.b].append(door.a)
    away = {OUTSIDE: 0}
    queue = deque([OUTSIDE])
    while queue:
        here = queue.popleft()
        for other in links[here]:
            if other not in away:
                away[other] = away[here] + 1
                queue.append(other)
    return [away.get(i, 10**6) for i in range(len(sketch.rooms))]


def _windows(
    sketch: Sketch, room: SketchRoom, size: tuple[float, float], ways: Sequence[_Doorway], *, street: bool
) -> list[Opening]:
    """Windows in the walls that are the house's own, some 3 m apart, clear of doors; shops have them at the street."""
    x0, y0, x1, y1 = room.box
    w, h = sketch.size
    outer = {EAST: abs(x1 - w) < 0.01, NORTH: abs(y1 - h) < 0.01, WEST: x0 < 0.01, SOUTH: y0 < 0.01}
    wide = 2.2 if street else 1.6
    way_out = next((way.opening.side for way in ways if way.to == OUTSIDE), SOUTH)
    found = []
    for side, is_outer in outer.items():
        length = size[1] if side in (EAST, WEST) else size[0]
        if not is_outer or length < wide + 0.6 or (street and side != way_out):
            continue
        count = max(1, int(length / (wide + 0.7 if street else 3.0)))
        for k in range(count):
            at = round(((k + 0.5) / count - 0.5) * length, 2)
            doors = (way.opening for way in ways)
            if all(o.side != side or abs(o.at - at) > (o.width + wide) / 2 + 0.15 for o in doors):
                found.append(Opening(side, at, wide))
    return found


def _rotate_quarters(u: float, v: float, turn: int) -> tuple[float, float]:
    c, s = (1, 0, -1, 0)[turn % 4], (0, 1, 0, -1)[turn % 4]
    return round(c * u - s * v, 3), round(s * u + c * v, 3)


def _lift_panel(draft: RoomDraft) -> tuple[float, float, float]:
    """Opposite the door of the car."""
    side = draft.far
    x, y = Opening(side, 0.0, 1.0).point(draft.size, 0.02)
    return round(x, 3), round(y, 3), round(math.remainder((side + 2) * math.pi / 2, 2 * math.pi), 5)


def _door_plan(way: _Doorway, draft: RoomDraft, centre: tuple[float, float, float]) -> DoorPlan:
    cx, cy, z = centre
    x, y = way.opening.point(draft.size)
    ix, iy = way.opening.point(draft.size, STEP_IN)
    if way.lift:
        x, y = Opening(draft.far, 0.0, 1.0).point(draft.size, 0.3)
        ix = iy = 0.0
    z = round(z + way.low, 3)
    return DoorPlan(way.to, (round(cx + x, 3), round(cy + y, 3), z), (round(cx + ix, 3), round(cy + iy, 3), z))


def _inside(
    index: int,
    room: SketchRoom,
    kind: RoomKind,
    centre: tuple[float, float, float],
    size: tuple[float, float],
    ways: Sequence[_Doorway],
    windows: Sequence[Opening],
    variant: int,
) -> Inside:
    parts = []
    for other, opening, low, lift in ways:
        if lift:
            continue
        what = "entrance" if other == OUTSIDE else "door"
        parts.append(WallOpening(opening.side, opening.at, opening.width, low, low + DOOR_HEIGHT, what, index < other))
    head = min(HEAD, room.height - 0.3)
    sill = SHOP_SILL if kind.entry.shop_window else SILL
    parts += [WallOpening(o.side, o.at, o.width, sill, head, "window") for o in windows]
    return Inside(
        entity=index,
        centre=centre,
        size=(*size, room.height),
        floor=room.floor or kind.entry.floor,
        floor_colour=kind.tone,
        walls=room.walls or kind.entry.walls,
        wall_colour=room.colour or kind.palette[(variant // 2 + index) % len(kind.palette)],
        openings=tuple(parts),
        rise=room.rise,
        facing=room.facing if room.rise else 0,
    )


def _translate_container(spot: ContainerPlan, x: float, y: float, z: float) -> ContainerPlan:
    a, b, c = spot.centre
    return replace(
        spot,
        centre=(round(a + x, 3), round(b + y, 3), round(c + z, 3)),
        reach=(round(spot.reach[0] + x, 3), round(spot.reach[1] + y, 3)),
    )


def _spots(
    room: SketchRoom, draft: RoomDraft, items: Sequence[Furnishing], dress: SmallThings
) -> tuple[ContainerPlan, ...]:
    """Return the containers of a room that can be reached from its door."""
    models = furniture_models()
    size = draft.size
    if room.items is not None:
        draft.block_all(items)
    rows, columns = np.nonzero(draft.reachable())
    if not len(rows):
        return ()
    px = (columns + 0.5) * GRID - size[0] / 2
    py = (rows + 0.5) * GRID - size[1] / 2
    home = draft.doors[0].point(size, STEP_IN)
    spots = [
        ContainerPlan(
            "floor",
            -1,
            (0.0, 0.0, 0.0),
            (round(size[0] - 0.6, 3), round(size[1] - 0.6, 3)),
            0.0,
            (round(home[0], 3), round(home[1], 3)),
        )
    ]
    chairs = 0
    for k, item in enumerate(items):
        top = dress.tops.get(k, models[item.prototype].top)
        if top is None or (top.kind == "chair" and chairs >= _MOST_CHAIRS) or len(spots) >= _LARGEST_TOP:
            continue
        c, s = math.cos(item.yaw), math.sin(item.yaw)
        cx = item.x + c * top.centre[0] - s * top.centre[1]
        cy = item.y + s * top.centre[0] + c * top.centre[1]
        around = np.flatnonzero((np.abs(px - cx) < REACH) & (np.abs(py - cy) < REACH))
        dx, dy = px[around] - cx, py[around] - cy
        u, v = dx * c + dy * s, dy * c - dx * s
        away = np.hypot(np.maximum(np.abs(u) - top.size[0] / 2, 0), np.maximum(np.abs(v) - top.size[1] / 2, 0))
        middle = np.hypot(u, v)
        near = np.flatnonzero((away <= REACH - 0.3) & (middle <= REACH - 0.1))
        if not len(near):
            continue
        best = around[near[int(np.argmin(middle[near]))]]
        chairs += top.kind == "chair"
        spots.append(
            ContainerPlan(
                top.kind,
                k,
                (round(cx, 3), round(cy, 3), round(top.height + item.z, 3)),
                (round(top.size[0], 3), round(top.size[1], 3)),
                item.yaw,
                (round(float(px[best]), 3), round(float(py[best]), 3)),
            )
        )
    return tuple(spots)


@dataclass(frozen=True)
class Indoors:
    """Product of the stage.

    Attributes
    ----------
    places
        The places, with the ids of their rooms; buildings with a door but no place of their own get one.
    rooms
        Rooms, in the order of their places.
    furniture
        Objects in them; the small things on tables are not solid.
    surfaces
        Walls, floors, ceilings, doors, stairs, with the rooms' entities.
    """

    places: list[Place]
    rooms: list[Room]
    furniture: Objects
    surfaces: list[Surface]


@dataclass(frozen=True)
class Slot:
    """Where a plan is put: its middle, yaw, floor height, extent and how high it is."""

    x: float
    y: float
    z: float
    yaw: float
    size: tuple[float, float]
    height: float

    @cached_property
    def direction(self) -> tuple[float, float]:
        """Cosine and sine of its yaw."""
        return math.cos(self.yaw), math.sin(self.yaw)

    @property
    def shape(self) -> shapely.Polygon:
        """Its outline."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        a, b = self.size[0] / 2, self.size[1] / 2
        return shapely.Polygon(
            [(self.x + c * u - s * v, self.y + s * u + c * v) for u, v in ((-a, -b), (a, -b), (a, b), (-a, b))]
        )

    def samples(self) -> NDArray[np.float64]:
        """Points all over it, shape ``(49, 2)``."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        u, v = np.meshgrid(np.linspace(-0.5, 0.5, 7) * self.size[0], np.linspace(-0.5, 0.5, 7) * self.size[1])
        return np.column_stack([(self.x + c * u - s * v).ravel(), (self.y + s * u + c * v).ravel()])


def place_plans(places: Sequence[Place], slots: dict[int, tuple[Slot, FloorPlan]]) -> Indoors:
    """Rooms, objects and surfaces of places whose plans have their slots, by index of place."""
    rooms: list[Room] = []
    rows: list[dict[str, Any]] = []
    surfaces: list[Surface] = []
    furnished: list[Place] = []
    for k, place in enumerate(places):
        if k not in slots:
            furnished.append(place)
            continue
        with drop_on_failure(place.id):
            own_rooms, own_rows, shell = _put(place, *slots[k], FIRST_ROOM + len(rooms), FIRST_FURNITURE + len(rows))
            rooms += own_rooms
            rows += own_rows
            surfaces += shell
            furnished.append(place.model_copy(update={"rooms": [room.id for room in own_rooms]}))
    return Indoors(furnished, rooms, Objects.from_rows(rows), merge_surfaces(surfaces))


def _put(
    place: Place, slot: Slot, plan: FloorPlan, entity: int, furniture: int
) -> tuple[list[Room], list[dict[str, Any]], list[Surface]]:
    """Return rooms, rows of objects and surfaces of one place; `entity` and `furniture` are the first free numbers."""
    rooms: list[Room] = []
    rows: list[dict[str, Any]] = []
    ids = [f"{place.id}.room{i}" for i in range(len(plan.rooms))]
    matrix = pose_matrix(slot.x, slot.y, slot.z, slot.yaw)
    shell = [replace(surface.moved(matrix), entity=surface.entity + np.int32(entity)) for surface in plan.shell]
    for i, room in enumerate(plan.rooms):
        first = furniture + len(rows)
        rows += _objects(room, ids[i], slot, first)
        rooms.append(_room(place, ids, i, room, slot, entity + i, first))
    return rooms, rows, shell


def rooms_of_plan(plan: FloorPlan, place: str = "plan") -> tuple[list[Room], Objects]:
    """Return a plan's rooms and objects in its own frame, to look at or to check before it is put anywhere."""
    slot = Slot(0.0, 0.0, 0.0, 0.0, plan.size, plan.height)
    alone = Place(id=place, name=place, category=Category.OPEN, kind=plan.use, building=None, entrance=None,
                  position=(0.0, 0.0, 0.0))  # fmt: skip
    made = place_plans([alone], {0: (slot, plan)})
    return made.rooms, made.furniture


@cache
def _model_size(prototype: str) -> tuple[Model, tuple[float, float, float]]:
    model = furniture_models()[prototype]
    return model, model.size


def _objects(room: RoomPlan, name: str, slot: Slot, first: int) -> Iterator[dict[str, Any]]:
    for n, item in enumerate(room.items):
        model, size = _model_size(item.prototype)
        x, y, z = _to_world(slot, (item.x, item.y, item.z))
        yield {
            "id": f"{name}.{n}",
            "entity": first + n,
            "kind": model.kind,
            "group": "indoor",
            "prototype": model.name,
            "x": x,
            "y": y,
            "z": z,
            "yaw": round(math.remainder(item.yaw + slot.yaw, 2 * math.pi), 4),
            "scale": 1.0,
            "size_x": size[0],
            "size_y": size[1],
            "size_z": size[2],
            "solid": model.solid,
            "room": name,
        }


def _room(
    place: Place,
    ids: list[str],
    index: int,
    plan: RoomPlan,
    slot: Slot,
    entity: int,
    first: int,
) -> Room:
    doors = [
        Doorway(
            to="" if door.to == OUTSIDE else ids[door.to],
            position=_to_world(slot, door.position),
            inside=_to_world(slot, door.inside),
        )
        for door in plan.doors
    ]
    return Room(
        id=ids[index],
        entity=entity,
        place=place.id,
        building=place.building or "",
        kind=plan.kind,
        centre=_to_world(slot, plan.centre),
        size=plan.size,
        yaw=round(math.remainder(slot.yaw + plan.yaw, 2 * math.pi), 6),
        door=doors[0].position,
        inside=doors[0].inside,
        links=[ids[i] for i in plan.links],
        containers=[_container(spot, n, ids[index], slot, entity, first) for n, spot in enumerate(plan.spots)],
        rise=plan.rise,
        doors=doors,
    )


def _container(spot: ContainerPlan, n: int, room: str, slot: Slot, entity: int, first: int) -> Container:
    return Container(
        id=f"{room}.{spot.kind}{n}",
        entity=entity if spot.item < 0 else first + spot.item,
        kind=spot.kind,
        centre=_to_world(slot, spot.centre),
        size=spot.size,
        yaw=round(math.remainder(spot.yaw + slot.yaw, 2 * math.pi), 4),
        reach=_to_world(slot, (*spot.reach, 0.0))[:2],
    )


def _to_world(slot: Slot, point: tuple[float, float, float]) -> tuple[float, float, float]:
    x, y, z = point
    c, s = slot.direction
    return round(slot.x + c * x - s * y, 3), round(slot.y + s * x + c * y, 3), round(slot.z + z, 3)
