"""Floor plans by use: which rooms a place has, what stands in them, and where people can reach it from.

A plan is a row of rooms along x; the entrance is in the first one's west wall. Along the middle of each room there is
an aisle. Plans are made once in their own frame, then placed as often as needed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from vico.assets.furniture import furniture_models
from vico.assets.interior import room_shell
from vico.assets.shapes import Colour
from vico.world.mesh import Surface
from vico.world.model import Category

REACH = 1.5
BODY = 0.3
_GRID = 0.1
_MOST_CHAIRS = 3  # containers of this kind a room

Item = tuple[str, str, float, float, float]  # prototype, placing (N, S, E or F), x, y, yaw in degrees


@dataclass(frozen=True)
class _Spec:
    kind: str
    width: float
    floor: str
    items: tuple[Item, ...]


@dataclass(frozen=True)
class Spot:
    """A container of a plan: kind, index of its furniture (-1: the floor), centre, size, yaw, and the reach point."""

    kind: str
    item: int
    centre: tuple[float, float, float]
    size: tuple[float, float]
    yaw: float
    reach: tuple[float, float]


@dataclass(frozen=True)
class Furnishing:
    """A piece of furniture: prototype, position and yaw in the room's frame."""

    prototype: str
    x: float
    y: float
    yaw: float


@dataclass(frozen=True)
class RoomPlan:
    """A room of a plan; `x` is its middle along the row, `door` and `inside` are in its own frame."""

    kind: str
    x: float
    size: tuple[float, float]
    door: tuple[float, float]
    inside: tuple[float, float]
    links: tuple[int, ...]
    items: tuple[Furnishing, ...]
    spots: tuple[Spot, ...]
    shell: tuple[Surface, ...]


@dataclass(frozen=True)
class Plan:
    """Rooms in a row, entrance room first; `size` is the whole extent."""

    rooms: tuple[RoomPlan, ...]
    size: tuple[float, float]


def _n(name: str, x: float) -> Item:
    return (name, "N", x, 0.0, -90.0)


def _s(name: str, x: float) -> Item:
    return (name, "S", x, 0.0, 90.0)


def _e(name: str, y: float) -> Item:
    return (name, "E", 0.0, y, 180.0)


def _f(name: str, x: float, y: float, yaw: float = 0.0) -> Item:
    return (name, "F", x, y, yaw)


def _set(table: str, chair: str, x: float, y: float, gap: float = 0.64) -> tuple[Item, ...]:
    """A table with a chair on either side along x."""
    return (_f(table, x, y), _f(chair, x - gap, y, 0.0), _f(chair, x + gap, y, 180.0))


_BEDROOM = _Spec("bedroom", 3.9, "planks", (
    _n("bed_double", 0.3), _n("bedside_table", -0.8), _s("wardrobe", -0.95), _s("desk", 1.0),
    _f("office_chair", 1.0, -1.08, -90), _e("floor_lamp", 1.85)))  # fmt: skip
_LIVING = _Spec("living_room", 4.8, "planks", (
    _n("sofa", 0.3), _f("coffee_table", 0.3, 0.8, 90), _s("television", 0.3), _s("bookcase", -1.5),
    _n("floor_lamp", 1.7), _s("pot_plant", 1.9)))  # fmt: skip
_HOME_KITCHEN = _Spec("kitchen", 3.6, "tiles", (
    _n("kitchen", 0.3), _n("fridge", -1.35), _f("dining_table", 0.2, -1.36, 90), _f("chair", -0.2, -0.72, -90),
    _f("chair", 0.6, -0.72, -90), _f("chair", -0.2, -1.98, 90), _f("chair", 0.6, -1.98, 90)))  # fmt: skip
_LOBBY = _Spec("lobby", 5.2, "tiles", (
    _n("counter", -0.5), _s("sofa_teal", 0.8), _f("coffee_table", 0.8, -0.83, 90), _s("pot_plant", -0.9),
    _n("armchair", 1.8)))  # fmt: skip
_DINING = _Spec("dining_room", 7.2, "planks", (
    _n("counter", -2.1), *_set("restaurant_table", "restaurant_chair", 0.4, 1.6),
    *_set("restaurant_table", "restaurant_chair", 2.5, 1.6), *_set("restaurant_table", "restaurant_chair", -1.7, -1.6),
    *_set("restaurant_table", "restaurant_chair", 0.4, -1.6), *_set("restaurant_table", "restaurant_chair", 2.5, -1.6),
    ))  # fmt: skip
_KITCHEN = _Spec("kitchen", 3.6, "tiles", (
    _n("stove", 0.3), _n("fridge", -1.2), _s("steel_table", 0.85), _s("shelf", -1.0)))  # fmt: skip
_CAFE = _Spec("cafe", 6.2, "tiles", (
    _n("counter", -1.5), *_set("cafe_table", "chair", 0.9, 1.6), *_set("cafe_table", "chair", -1.5, -1.6),
    *_set("cafe_table", "chair", 0.3, -1.6), _s("sofa", 2.1), _n("pot_plant", 2.6)))  # fmt: skip
_BAR = _Spec("bar", 6.2, "planks", (
    _n("counter", -1.3), _n("counter", 0.85), _f("stool", -1.9, 1.5), _f("stool", -0.7, 1.5), _f("stool", 0.4, 1.5),
    _s("sofa", -1.5), *_set("restaurant_table", "restaurant_chair", 0.6, -1.6), _s("floor_lamp", 2.4)))  # fmt: skip
_SHOP = _Spec("shop", 6.4, "tiles", (
    _s("counter", -1.7), _n("shelf", -2.3), _n("shelf", -0.8), _n("shelf", 0.7), _n("shelf", 2.2),
    _s("shelf", 0.7), _s("shelf", 2.2), _f("display_table", 1.4, -1.12, 90)))  # fmt: skip
_CLOTHES = _Spec("shop", 6.4, "planks", (
    _s("counter", -1.7), _f("clothes_rack", -1.6, 1.6, 90), _f("clothes_rack", 0.4, 1.6, 90),
    _f("clothes_rack", 2.3, 1.6, 90), _f("clothes_rack", 2.3, -1.6, 90), _f("display_table", 0.3, -1.5, 90),
    _s("pot_plant", 1.25)))  # fmt: skip
_SALON = _Spec("salon", 5.6, "tiles", (
    _s("counter", -1.5), _n("washstand", -1.4), _n("washstand", 0.2), _n("washstand", 1.8),
    _f("office_chair", -1.4, 1.5, 90), _f("office_chair", 0.2, 1.5, 90), _f("office_chair", 1.8, 1.5, 90),
    _s("sofa", 1.2)))  # fmt: skip
_OFFICE = _Spec("office", 6.4, "carpet", (
    _n("desk", -1.9), _n("desk", 0.1), _n("desk", 2.1), _f("office_chair", -1.9, 1.46, 90),
    _f("office_chair", 0.1, 1.46, 90), _f("office_chair", 2.1, 1.46, 90), _s("filing_cabinet", -2.3),
    _s("bookcase", -1.4), _s("desk", 0.6), _f("office_chair", 0.6, -1.46, -90), _s("pot_plant", 2.6)))  # fmt: skip
_MEETING = _Spec("meeting_room", 4.2, "carpet", (
    _f("work_table", 0.5, 0.95, 90), _f("chair", 0.0, 0.25, 90), _f("chair", 1.0, 0.25, 90),
    _f("chair", 0.0, 1.64, -90), _f("chair", 1.0, 1.64, -90), _s("bookcase", 0.6)))  # fmt: skip
_RECEPTION = _Spec("reception", 4.8, "tiles", (
    _n("counter", 0.3), _s("sofa", -0.6), _s("filing_cabinet", 1.2), _n("pot_plant", -1.7)))  # fmt: skip
_CLINIC = _Spec("consulting_room", 4.2, "tiles", (
    _s("desk", 0.4), _f("office_chair", 0.4, -1.46, -90), _f("bed_single", 0.4, 1.9, 180), _s("filing_cabinet", -1.3),
    _e("washstand", 0.6), _f("chair", -0.8, -1.3, 0)))  # fmt: skip
_CLASS = _Spec("classroom", 6.8, "planks", (
    *(_f("work_table", x, y, 0) for x in (-0.9, 0.9) for y in (-1.5, 1.5)),
    *(_f("chair", x - 0.7, y, 0) for x in (-0.9, 0.9) for y in (-1.9, -1.1, 1.1, 1.9)),
    _f("desk", 2.6, 1.2, 180), _n("bookcase", -2.6)))  # fmt: skip
_GALLERY = _Spec("exhibition", 7.0, "planks", (
    _f("plinth", -1.6, 1.6), _f("plinth", 0.4, 1.6), _f("plinth", 2.4, 1.6), _f("plinth", -0.6, -1.6),
    _f("plinth", 2.6, -1.6), _f("pew", 1.0, -1.6, 90), _s("counter", -2.3)))  # fmt: skip
_HALL = _Spec("hall", 8.0, "carpet", (
    _e("stage", 0.0), *(_f("pew", x, y, 0) for x in (-2.2, -1.1, 0.0, 1.1) for y in (-1.5, 1.5)),
    ))  # fmt: skip
_GYM = _Spec("gym", 6.6, "carpet", (
    _s("counter", -1.8), *(_f("treadmill", x, 1.6, -90) for x in (-2.0, -0.7, 0.6, 1.9)), _s("washstand", 0.4),
    _s("pew", 2.0)))  # fmt: skip
_LIBRARY = _Spec("library", 6.8, "carpet", (
    *(_n("bookcase", x) for x in (-2.6, -1.5, -0.4, 0.7, 1.8)), _s("counter", -2.0),
    _f("work_table", 1.0, -1.5, 90), _f("chair", 0.6, -0.82, -90), _f("chair", 1.4, -0.82, -90),
    _f("chair", 0.6, -2.2, 90), _f("chair", 1.4, -2.2, 90), _s("pot_plant", 2.9)))  # fmt: skip
_CLUB = _Spec("club", 7.0, "planks", (
    _n("counter", -1.8), _f("stool", -2.4, 1.5), _f("stool", -1.2, 1.5), _e("stage", 0.0), _s("sofa_teal", -1.6),
    _s("sofa_teal", 0.6), *_set("cafe_table", "chair", 0.9, 1.6)))  # fmt: skip
_LOUNGE = _Spec("lounge", 6.0, "carpet", (
    _n("counter", -1.4), _s("sofa", -1.0), _f("coffee_table", -1.0, -1.0, 90), *_set("cafe_table", "chair", 1.4, 1.6),
    _s("bookcase", 1.0), _s("pot_plant", 2.2)))  # fmt: skip

_HOME_DEPTH, _DEPTH = 4.4, 5.2
_PLANS: dict[str, tuple[float, tuple[_Spec, ...]]] = {
    "home": (_HOME_DEPTH, (_LIVING, _HOME_KITCHEN, _BEDROOM)),
    "hotel": (_HOME_DEPTH, (_LOBBY, _BEDROOM)),
    "restaurant": (_DEPTH, (_DINING, _KITCHEN)),
    "cafe": (_DEPTH, (_CAFE,)),
    "bar": (_DEPTH, (_BAR,)),
    "shop": (_DEPTH, (_SHOP,)),
    "clothes": (_DEPTH, (_CLOTHES,)),
    "salon": (_DEPTH, (_SALON,)),
    "office": (_DEPTH, (_OFFICE, _MEETING)),
    "bureau": (_DEPTH, (_RECEPTION, _OFFICE)),
    "clinic": (_DEPTH, (_RECEPTION, _CLINIC)),
    "school": (_DEPTH, (_CLASS,)),
    "museum": (_DEPTH, (_GALLERY,)),
    "hall": (_DEPTH, (_HALL,)),
    "gym": (_DEPTH, (_GYM,)),
    "library": (_DEPTH, (_LIBRARY,)),
    "club": (_DEPTH, (_CLUB,)),
    "lounge": (_DEPTH, (_LOUNGE,)),
    "bank": (_DEPTH, (_RECEPTION,)),
}
_USES = {
    "apartments": "home", "apartment": "home", "cafe": "cafe", "ice_cream": "cafe", "bar": "bar", "pub": "bar",
    "clothes": "clothes", "shoes": "clothes", "fashion": "clothes", "boutique": "clothes", "hairdresser": "salon",
    "beauty": "salon", "massage": "salon", "tattoo": "salon", "cosmetics": "shop", "bank": "bank",
    "bureau_de_change": "bank", "post_office": "bank", "clinic": "clinic", "doctors": "clinic", "dentist": "clinic",
    "hospital": "clinic", "veterinary": "clinic", "alternative": "clinic", "school": "school", "kindergarten": "school",
    "college": "school", "university": "school", "childcare": "school", "museum": "museum", "gallery": "museum",
    "attraction": "museum", "theatre": "hall", "cinema": "hall", "place_of_worship": "hall", "church": "hall",
    "events_venue": "hall", "conference_centre": "hall", "fitness_centre": "gym", "sports_centre": "gym",
    "dance": "gym", "library": "library", "books": "library", "nightclub": "club", "casino": "club",
    "embassy": "bureau", "townhall": "bureau", "courthouse": "bureau", "government": "bureau", "police": "bureau",
    "lawyer": "bureau", "travel_agency": "bank",
}  # fmt: skip
_BY_CATEGORY = {
    Category.ACCOMMODATION: "hotel",
    Category.FOOD: "restaurant",
    Category.STORE: "shop",
    Category.OFFICE: "office",
    Category.ENTERTAINMENT: "lounge",
    Category.OPEN: "lounge",
    Category.TRANSIT: "bank",
}
WALLS: tuple[Colour, ...] = ((232, 226, 214), (214, 220, 216), (228, 216, 198), (206, 214, 222), (222, 210, 206))
_FLOORS: dict[str, Colour] = {"planks": (196, 160, 120), "tiles": (206, 202, 194), "carpet": (128, 134, 144)}
VARIANTS = 2 * len(WALLS)
LARGEST = (12.4, 5.2)


def use_of(category: Category, kind: str) -> str:
    """Which floor plan a place gets."""
    return _USES.get(kind, _BY_CATEGORY[category])


@cache
def plan_of(use: str, variant: int) -> Plan:
    """The floor plan of a use; variants differ in handedness and colours."""
    depth, specs = _PLANS[use]
    mirrored = variant % 2 == 1
    wall = WALLS[(variant // 2) % len(WALLS)]
    total = sum(spec.width for spec in specs)
    rooms: list[RoomPlan] = []
    west = -total / 2
    for k, spec in enumerate(specs):
        links = tuple(i for i in (k - 1, k + 1) if 0 <= i < len(specs))
        doorways = [("west", 0.0)] * (k > 0) + [("east", 0.0)] * (k < len(specs) - 1)
        items = _placed(spec, depth, mirrored)
        half = spec.width / 2
        inside = (-half + 0.6, 0.0)
        rooms.append(
            RoomPlan(
                kind=spec.kind,
                x=west + half,
                size=(spec.width, depth),
                door=(-half, 0.0),
                inside=inside,
                links=links,
                items=items,
                spots=_spots(items, (spec.width, depth), inside),
                shell=tuple(
                    room_shell(
                        (spec.width, depth),
                        doorways=doorways,
                        entrance=("west", 0.0) if k == 0 else None,
                        floor=spec.floor,
                        floor_colour=_FLOORS[spec.floor],
                        wall_colour=wall,
                    )
                ),
            )
        )
        west += spec.width
    return Plan(tuple(rooms), (total, depth))


def uses() -> list[str]:
    """All floor plans there are."""
    return list(_PLANS)


def _placed(spec: _Spec, depth: float, mirrored: bool) -> tuple[Furnishing, ...]:
    models = furniture_models()
    found = []
    for name, how, x, y, yaw in spec.items:
        deep = models[name].size[0]
        if how == "N":
            y = depth / 2 - deep / 2 - 0.03
        elif how == "S":
            y = deep / 2 + 0.03 - depth / 2
        elif how == "E":
            x = spec.width / 2 - deep / 2 - 0.03
        turn = math.radians(yaw)
        if mirrored:
            y, turn = -y, -turn
        found.append(Furnishing(name, round(x, 3), round(y, 3), math.remainder(turn, 2 * math.pi)))
    return tuple(found)


def occupied(items: tuple[Furnishing, ...], size: tuple[float, float]) -> NDArray[np.bool_]:
    """Where nobody can stand: cells of 0.1 m within `BODY` of a wall or a piece of furniture, indexed ``[iy, ix]``."""
    models = furniture_models()
    nx, ny = round(size[0] / _GRID), round(size[1] / _GRID)
    x = (np.arange(nx) + 0.5) * _GRID - size[0] / 2
    y = (np.arange(ny) + 0.5) * _GRID - size[1] / 2
    gx, gy = np.meshgrid(x, y)
    taken = (np.abs(gx) > size[0] / 2 - BODY) | (np.abs(gy) > size[1] / 2 - BODY)
    for item in items:
        wide, deep, _ = models[item.prototype].size
        c, s = math.cos(item.yaw), math.sin(item.yaw)
        u, v = (gx - item.x) * c + (gy - item.y) * s, (gy - item.y) * c - (gx - item.x) * s
        away = np.hypot(np.maximum(np.abs(u) - wide / 2, 0), np.maximum(np.abs(v) - deep / 2, 0))
        taken |= away < BODY
    return np.asarray(taken)


def _spots(items: tuple[Furnishing, ...], size: tuple[float, float], inside: tuple[float, float]) -> tuple[Spot, ...]:
    """The containers of a room that can be reached from its door."""
    models = furniture_models()
    labels, _ = ndimage.label(~occupied(items, size))
    ix, iy = int((inside[0] + size[0] / 2) / _GRID), int((inside[1] + size[1] / 2) / _GRID)
    home = labels[iy, ix]
    assert home > 0, "a floor plan's entrance is blocked"
    rows, columns = np.nonzero(labels == home)
    px = (columns + 0.5) * _GRID - size[0] / 2
    py = (rows + 0.5) * _GRID - size[1] / 2
    spots = [Spot("floor", -1, (0.0, 0.0, 0.0), (size[0] - 0.6, size[1] - 0.6), 0.0, inside)]
    chairs = 0
    for k, item in enumerate(items):
        top = models[item.prototype].top
        if top is None or (top.kind == "chair" and chairs >= _MOST_CHAIRS):
            continue
        c, s = math.cos(item.yaw), math.sin(item.yaw)
        cx = item.x + c * top.centre[0] - s * top.centre[1]
        cy = item.y + s * top.centre[0] + c * top.centre[1]
        u, v = (px - cx) * c + (py - cy) * s, (py - cy) * c - (px - cx) * s
        away = np.hypot(np.maximum(np.abs(u) - top.size[0] / 2, 0), np.maximum(np.abs(v) - top.size[1] / 2, 0))
        middle = np.hypot(u, v)
        near = np.flatnonzero((away <= REACH - 0.3) & (middle <= REACH - 0.1))
        if not len(near):
            continue
        best = near[int(np.argmin(middle[near]))]
        chairs += top.kind == "chair"
        spots.append(
            Spot(
                top.kind,
                k,
                (round(cx, 3), round(cy, 3), top.height),
                top.size,
                item.yaw,
                (round(float(px[best]), 3), round(float(py[best]), 3)),
            )
        )
    return tuple(spots)
