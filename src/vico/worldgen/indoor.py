"""Rooms for the places in buildings: floor plans by use, stacked below ground so that nothing shows from outside."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.assets.furniture import furniture_models
from vico.assets.interior import WALL_HEIGHT
from vico.assets.shapes import pose_matrix
from vico.world.heights import HeightField
from vico.world.mesh import Surface, joined
from vico.world.model import FIRST_FURNITURE, FIRST_ROOM, Building, Container, Place, Room
from vico.world.objects import Objects
from vico.world.seeds import rng
from vico.worldgen.layouts import VARIANTS, Plan, RoomPlan, plan_of, use_of

_DEPTH = 6.0  # metres from the ground down to the first floor of rooms
_STOREY = 3.4
_GAP = 0.4
_DEEPEST = 400


@dataclass(frozen=True)
class Indoors:
    """What the stage made.

    Attributes
    ----------
    places
        The places, with the ids of their rooms.
    rooms
        Rooms, in the order of their places.
    furniture
        Objects in them.
    surfaces
        Walls, floors, ceilings, doors, with the rooms' entities.
    """

    places: list[Place]
    rooms: list[Room]
    furniture: Objects
    surfaces: list[Surface]


@dataclass(frozen=True)
class _Slot:
    """Where a plan is put: its middle, yaw, floor height, and extent."""

    x: float
    y: float
    z: float
    yaw: float
    size: tuple[float, float]

    @property
    def shape(self) -> shapely.Polygon:
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        a, b = self.size[0] / 2, self.size[1] / 2
        return shapely.Polygon(
            [(self.x + c * u - s * v, self.y + s * u + c * v) for u, v in ((-a, -b), (a, -b), (a, b), (-a, b))]
        )


class _Ground:
    """The rooms there are, so that no two meet."""

    def __init__(self) -> None:
        self._cells: dict[tuple[int, int], list[tuple[float, shapely.Polygon]]] = defaultdict(list)

    def take(self, slot: _Slot) -> bool:
        """Claim a slot if it is free."""
        shape = slot.shape
        room = shape.buffer(_GAP / 2, join_style="mitre")
        cells = list(self._around(room))
        for cell in cells:
            for z, other in self._cells[cell]:
                if abs(z - slot.z) < WALL_HEIGHT + _GAP and other.intersects(room):
                    return False
        for cell in cells:
            self._cells[cell].append((slot.z, room))
        return True

    @staticmethod
    def _around(shape: shapely.Polygon) -> Iterator[tuple[int, int]]:
        x0, y0, x1, y1 = shape.bounds
        for i in range(math.floor(x0 / 16), math.floor(x1 / 16) + 1):
            for j in range(math.floor(y0 / 16), math.floor(y1 / 16) + 1):
                yield i, j


def furnish(places: Sequence[Place], *, buildings: Sequence[Building], height: HeightField, seed: int = 0) -> Indoors:
    """Give every place in a building its rooms.

    Parameters
    ----------
    places
        Places; those without a building keep none.
    buildings
        The buildings they are in.
    height
        Ground heights: all rooms lie at least 3 m below.
    seed
        Decides colours and handedness.

    Returns
    -------
    Indoors
        Rooms lie under their building's footprint where it has room for them, in storeys of 3.4 m; no two overlap.
    """
    by_id = {b.id: b for b in buildings}
    wanted: dict[str, list[int]] = defaultdict(list)
    for k, place in enumerate(places):
        if place.building is not None:
            wanted[place.building].append(k)
    ground = _Ground()
    slots: dict[int, tuple[_Slot, Plan]] = {}
    for building in buildings:
        if building.id in wanted:
            chosen = [(k, _plan(places[k], seed)) for k in wanted[building.id]]
            for k, slot, plan in _stacked(by_id[building.id], chosen, height, ground):
                slots[k] = (slot, plan)
    return _assembled(places, slots)


def _plan(place: Place, seed: int) -> Plan:
    variant = int(rng(seed, "rooms", place.id).integers(VARIANTS))
    return plan_of(use_of(place.category, place.kind), variant)


def _stacked(
    building: Building, wanted: list[tuple[int, Plan]], height: HeightField, ground: _Ground
) -> Iterator[tuple[int, _Slot, Plan]]:
    """Slots for a building's plans: rows along its longer side, then the next storey down."""
    shape = shapely.Polygon(building.footprint[0], building.footprint[1:])
    centre, yaw, extent = _frame(shape)
    wide = max(plan.size[0] for _, plan in wanted) + _GAP
    deep = max(plan.size[1] for _, plan in wanted) + _GAP
    columns, rows = max(1, int(extent[0] // wide)), max(1, int(extent[1] // deep))
    c, s = math.cos(yaw), math.sin(yaw)
    spots = []
    for i in range(columns):
        for j in range(rows):
            u, v = (i - (columns - 1) / 2) * wide, (j - (rows - 1) / 2) * deep
            x, y = centre[0] + c * u - s * v, centre[1] + s * u + c * v
            spots.append((not shape.contains(shapely.Point(x, y)), x, y))
    inside = [spot for spot in spots if not spot[0]] or [min(spots)]
    level, at = 0, 0
    for k, plan in wanted:
        while True:
            _, x, y = inside[at]
            slot = _Slot(x, y, 0.0, yaw, plan.size)
            low = min(float(height(np.array(slot.shape.exterior.coords)[:4]).min()), building.base)
            slot = _Slot(x, y, round(low - _DEPTH - _STOREY * level, 3), yaw, plan.size)
            at += 1
            if at == len(inside):
                level, at = level + 1, 0
            if level > _DEEPEST:
                raise RuntimeError(f"indoor: no room under building {building.id} within {_DEEPEST} storeys")
            if ground.take(slot):
                break
        yield k, slot, plan


def _frame(shape: shapely.Polygon) -> tuple[tuple[float, float], float, tuple[float, float]]:
    """Middle, direction and extent of the smallest rectangle around a footprint, longer side first."""
    corners = np.array(shapely.minimum_rotated_rectangle(shape).exterior.coords)[:4]
    first, second = corners[1] - corners[0], corners[2] - corners[1]
    a, b = float(np.hypot(*first)), float(np.hypot(*second))
    along = first if a >= b else second
    yaw = math.atan2(along[1], along[0]) % math.pi
    middle = corners.mean(axis=0)
    return (float(middle[0]), float(middle[1])), yaw, (max(a, b), min(a, b))


def _assembled(places: Sequence[Place], slots: dict[int, tuple[_Slot, Plan]]) -> Indoors:
    models = furniture_models()
    rooms: list[Room] = []
    rows: list[dict[str, Any]] = []
    surfaces: list[Surface] = []
    furnished: list[Place] = []
    for k, place in enumerate(places):
        if k not in slots:
            furnished.append(place)
            continue
        slot, plan = slots[k]
        ids = [f"{place.id}.room{i}" for i in range(len(plan.rooms))]
        for i, plan_room in enumerate(plan.rooms):
            entity = FIRST_ROOM + len(rooms)
            matrix = pose_matrix(slot.x, slot.y, slot.z, slot.yaw) @ pose_matrix(plan_room.x, 0.0, 0.0)
            first = FIRST_FURNITURE + len(rows)
            for n, item in enumerate(plan_room.items):
                model = models[item.prototype]
                x, y, z = _moved(matrix, (item.x, item.y, 0.0))
                rows.append(
                    {
                        "id": f"{ids[i]}.{n}",
                        "entity": first + n,
                        "kind": model.kind,
                        "group": "indoor",
                        "prototype": model.name,
                        "x": x,
                        "y": y,
                        "z": z,
                        "yaw": round(math.remainder(item.yaw + slot.yaw, 2 * math.pi), 4),
                        "scale": 1.0,
                        "size_x": model.size[0],
                        "size_y": model.size[1],
                        "size_z": model.size[2],
                        "solid": True,
                        "room": ids[i],
                    }
                )
            rooms.append(_room(place, ids, i, plan_room, slot, matrix, entity, first))
            surfaces += [surface.moved(matrix).of_entity(entity) for surface in _shell(plan_room)]
        furnished.append(place.model_copy(update={"rooms": ids}))
    return Indoors(furnished, rooms, Objects.from_rows(rows), joined(surfaces))


_SHELLS: dict[int, list[Surface]] = {}


def _shell(room: RoomPlan) -> list[Surface]:
    """A plan's surfaces, one a material."""
    key = id(room)  # plans are cached for good, so their identity is theirs
    if key not in _SHELLS:
        _SHELLS[key] = joined(room.shell)
    return _SHELLS[key]


def _room(
    place: Place,
    ids: list[str],
    index: int,
    plan: RoomPlan,
    slot: _Slot,
    matrix: NDArray[np.float64],
    entity: int,
    first: int,
) -> Room:
    containers = []
    for n, spot in enumerate(plan.spots):
        reach = _moved(matrix, (*spot.reach, 0.0))
        containers.append(
            Container(
                id=f"{ids[index]}.{spot.kind}{n}",
                entity=entity if spot.item < 0 else first + spot.item,
                kind=spot.kind,
                centre=_moved(matrix, spot.centre),
                size=spot.size,
                yaw=round(math.remainder(spot.yaw + slot.yaw, 2 * math.pi), 4),
                reach=reach[:2],
            )
        )
    return Room(
        id=ids[index],
        entity=entity,
        place=place.id,
        building=place.building or "",
        kind=plan.kind,
        centre=_moved(matrix, (0.0, 0.0, 0.0)),
        size=(plan.size[0], plan.size[1], WALL_HEIGHT),
        yaw=round(slot.yaw, 6),
        door=_moved(matrix, (*plan.door, 0.0)),
        inside=_moved(matrix, (*plan.inside, 0.0)),
        links=[ids[i] for i in plan.links],
        containers=containers,
    )


def _moved(matrix: NDArray[np.float64], point: tuple[float, float, float]) -> tuple[float, float, float]:
    x, y, z = matrix[:3, :3] @ np.asarray(point) + matrix[:3, 3]
    return round(float(x), 3), round(float(y), 3), round(float(z), 3)
