"""Small things on furniture: chosen by room and surface, apart from each other and from the edges.

A surface gives a strip at one of its ends to small things; what is left of it stays a container, so that things put
down there never stand in a vase.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vico.assets.models.furniture import furniture_models
from vico.assets.models.model import Top
from vico.worldgen.indoor.furnishing import Furnishing

_GAP = 0.02
_STRIP = 0.24
_LEAST_LEFT = 0.45  # what a surface keeps for other things, metres

_TABLES = {
    "living_room": "vase book_stack magazines remote candle fruit_bowl cup",
    "kitchen": "fruit_bowl mug plate bread_basket place_setting",
    "bedroom": "book table_lamp clock_small cup",
    "kids_room": "toy_blocks toy_car open_book pen_pot",
    "studio": "laptop cup book_stack small_plant",
    "hotel_room": "table_lamp phone water_bottle newspaper",
    "dormitory": "book water_bottle phone",
    "common_room": "mug plate bread_basket magazines",
    "lobby": "magazines vase newspaper small_plant",
    "dining_room": "wine_glass candle bread_basket wine_bottle place_setting",
    "cafe": "cup mug meal newspaper",
    "restaurant_kitchen": "pan pot plate sauce_bottle",
    "bar": "wine_glass glass candle",
    "fast_food": "sauce_bottle meal cup",
    "bakery": "cup bread_basket",
    "office": "papers mug pen_pot laptop phone",
    "open_office": "papers mug pen_pot laptop",
    "meeting_room": "water_bottle laptop papers glass",
    "break_room": "mug toaster fruit_bowl",
    "classroom": "open_book pen_pot papers",
    "laboratory": "first_aid tablet glass",
    "library": "open_book book_stack book",
    "ward": "water_bottle vase glass",
    "consulting_room": "papers first_aid tablet",
    "waiting_room": "magazines papers small_plant",
    "foyer": "magazines cup vase",
    "nave": "candle bible",
    "sacristy": "bible candle",
    "salon": "towels soap",
    "lounge": "cup vase magazines",
    "club": "wine_glass glass",
    "games": "glass",
    "workshop": "tools cardboard_box",
    "repair_shop": "tools cardboard_box",
    "florist": "vase small_plant",
    "clothes_shop": "folded_clothes gift_box",
    "sales_floor": "folded_clothes gift_box vase",
    "shop": "gift_box vase basket",
    "bookshop": "book_stack book",
    "toy_shop": "toy_blocks toy_car gift_box",
    "wine_shop": "wine_bottle gift_box",
    "storage": "cardboard_box",
    "reception": "small_plant phone papers",
    "bank_hall": "papers pen_pot",
    "hall": "vase basket",
    "council_room": "papers water_bottle globe",
    "electronics_shop": "tablet phone",
    "furniture_shop": "vase table_lamp fruit_bowl",
}
_BY_PIECE = {
    "bedside_table": "table_lamp clock_small book",
    "side_table": "table_lamp vase",
    "counter": "papers small_plant gift_box",
    "kitchen": "toaster pot soap",
    "desk": "mug papers phone pen_pot",
    "chest_of_drawers": "table_lamp vase book_stack",
    "reception_desk": "phone papers small_plant",
    "pastry_case": "till",
    "bar_counter": "glass wine_glass",
    "coffee_table": "magazines remote cup vase",
    "altar": "bible",
    "display_table": "folded_clothes gift_box basket book_stack",
}
_USED = {"table", "desk"}


@dataclass(frozen=True)
class Dressed:
    """Small things of a room, in its frame, and what is left of the surfaces they stand on, by furniture index.

    A surface that is full maps to None.
    """

    things: tuple[Furnishing, ...]
    tops: dict[int, Top | None]


def dressed(kind: str, items: Sequence[Furnishing], chance: np.random.Generator) -> Dressed:
    """Lay small things on the tables, desks and counters of a room.

    Parameters
    ----------
    kind
        Of the room.
    items
        Its furniture.
    """
    models = furniture_models()
    things: list[Furnishing] = []
    tops: dict[int, Top | None] = {}
    for k, item in enumerate(items):
        top = models[item.prototype].top
        if top is None or top.kind not in _USED or chance.random() < 0.15:
            continue
        wanted = (_BY_PIECE.get(item.prototype) or _TABLES.get(kind, "")).split()
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
    return Dressed(tuple(things), tops)


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
