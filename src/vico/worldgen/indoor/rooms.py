"""Plans put into the world: rooms, doorways, containers, furniture and surfaces in the world's frame."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.assets.models.library import furniture_models
from vico.assets.models.model import Model
from vico.assets.shapes import pose_matrix
from vico.world.mesh import Surface, merge_surfaces
from vico.world.model import FIRST_FURNITURE, FIRST_ROOM, Category, Container, Doorway, Place, Room
from vico.world.objects import Objects
from vico.worldgen.facts.expendable import expendable
from vico.worldgen.indoor.floorplans import OUTSIDE
from vico.worldgen.indoor.layouts import ContainerPlan, FloorPlan, RoomPlan


@dataclass(frozen=True)
class Indoors:
    """What the stage made.

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


def assembled(places: Sequence[Place], slots: dict[int, tuple[Slot, FloorPlan]]) -> Indoors:
    """Rooms, objects and surfaces of places whose plans have their slots, by index of place."""
    rooms: list[Room] = []
    rows: list[dict[str, Any]] = []
    surfaces: list[Surface] = []
    furnished: list[Place] = []
    for k, place in enumerate(places):
        if k not in slots:
            furnished.append(place)
            continue
        with expendable(place.id):
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
    made = assembled([alone], {0: (slot, plan)})
    return made.rooms, made.furniture


@cache
def _sized(prototype: str) -> tuple[Model, tuple[float, float, float]]:
    model = furniture_models()[prototype]
    return model, model.size


def _objects(room: RoomPlan, name: str, slot: Slot, first: int) -> Iterator[dict[str, Any]]:
    for n, item in enumerate(room.items):
        model, size = _sized(item.prototype)
        x, y, z = _moved(slot, (item.x, item.y, item.z))
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
            position=_moved(slot, door.position),
            inside=_moved(slot, door.inside),
        )
        for door in plan.doors
    ]
    return Room(
        id=ids[index],
        entity=entity,
        place=place.id,
        building=place.building or "",
        kind=plan.kind,
        centre=_moved(slot, plan.centre),
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
        centre=_moved(slot, spot.centre),
        size=spot.size,
        yaw=round(math.remainder(spot.yaw + slot.yaw, 2 * math.pi), 4),
        reach=_moved(slot, (*spot.reach, 0.0))[:2],
    )


def _moved(slot: Slot, point: tuple[float, float, float]) -> tuple[float, float, float]:
    x, y, z = point
    c, s = slot.direction
    return round(slot.x + c * x - s * y, 3), round(slot.y + s * x + c * y, 3), round(slot.z + z, 3)
