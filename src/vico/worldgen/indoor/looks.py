"""How rooms look by their kind: floors, walls, colours, daylight."""

from __future__ import annotations

from dataclasses import dataclass, replace

from vico.assets.shapes import Colour


@dataclass(frozen=True)
class RoomStyle:
    """Floor and its colour, what is on the walls, from which palette, whether there are windows, or shop windows."""

    floor: str
    tone: Colour
    walls: str
    palette: int
    daylight: bool = True
    street: bool = False


_WOOD, _PALE, _GREY_TILE, _WARM_TILE, _CARPET, _STONE, _CONCRETE = (
    (196, 160, 120),
    (222, 196, 160),
    (206, 206, 202),
    (214, 200, 178),
    (128, 138, 152),
    (200, 194, 184),
    (170, 170, 168),
)
_RED_CARPET: Colour = (132, 58, 60)
PALETTES: tuple[tuple[Colour, ...], ...] = (
    ((236, 230, 218), (222, 228, 224), (232, 220, 204), (216, 224, 232), (230, 218, 214)),  # light
    ((226, 206, 176), (206, 216, 196), (222, 196, 180), (190, 206, 216), (232, 222, 196)),  # warm
    ((236, 240, 240), (222, 236, 238), (240, 240, 234), (226, 238, 230), (238, 234, 226)),  # clean
    ((196, 158, 130), (168, 146, 132), (126, 146, 150), (176, 128, 110), (150, 150, 130)),  # strong
)
PLAIN = RoomStyle("planks", _WOOD, "plaster", 0)


def _looks() -> dict[str, RoomStyle]:
    wet, homely = ("tiles", _GREY_TILE, "tiled", 2), ("planks", _PALE, "wallpaper", 1)
    return {
        "hall": RoomStyle("parquet", _PALE, "plaster", 0, False),
        "corridor": RoomStyle("carpet", _CARPET, "plaster", 0, False),
        "living_room": RoomStyle("parquet", _WOOD, "wallpaper", 1),
        "kitchen": RoomStyle("tiles", _WARM_TILE, "tiled", 2),
        "bedroom": RoomStyle(*homely),
        "kids_room": RoomStyle("planks", _PALE, "wallpaper", 0),
        "studio": RoomStyle(*homely),
        "bathroom": RoomStyle(*wet, False),
        "washroom": RoomStyle(*wet, False),
        "shower_room": RoomStyle(*wet, False),
        "hotel_room": RoomStyle("carpet", (150, 122, 112), "wallpaper", 1),
        "dormitory": RoomStyle("planks", _PALE, "plaster", 1),
        "lobby": RoomStyle("stone", _STONE, "panels", 0),
        "storage": RoomStyle("concrete", _CONCRETE, "plaster", 0, False),
        "dining_room": RoomStyle("planks", _WOOD, "panels", 1),
        "restaurant_kitchen": RoomStyle(*wet, False),
        "cafe": RoomStyle("planks", _PALE, "brick", 1),
        "bar": RoomStyle("planks", (150, 112, 82), "panels", 3),
        "fast_food": RoomStyle("chequer", (236, 232, 226), "tiled", 1),
        "bakery": RoomStyle("tiles", _WARM_TILE, "tiled", 1),
        "supermarket": RoomStyle("tiles", (226, 226, 222), "plaster", 2, False),
        "pharmacy": RoomStyle("tiles", (232, 234, 232), "plaster", 2),
        "jeweller": RoomStyle("carpet", (92, 96, 122), "panels", 0),
        "florist": RoomStyle("stone", _STONE, "brick", 2),
        "salon": RoomStyle("chequer", (238, 236, 232), "plaster", 0),
        "laundry": RoomStyle(*wet),
        "repair_shop": RoomStyle("concrete", _CONCRETE, "brick", 0),
        "sales_floor": RoomStyle("stone", (226, 222, 214), "plaster", 2, False),
        "clothes_shop": RoomStyle("planks", _PALE, "plaster", 2),
        "bookshop": RoomStyle("planks", _WOOD, "plaster", 1),
        "wine_shop": RoomStyle("stone", _STONE, "brick", 3),
        "reception": RoomStyle("stone", _STONE, "plaster", 2),
        "open_office": RoomStyle("carpet", _CARPET, "plaster", 2),
        "office": RoomStyle("carpet", _CARPET, "plaster", 0),
        "meeting_room": RoomStyle("carpet", (110, 124, 130), "plaster", 0),
        "break_room": RoomStyle("tiles", _WARM_TILE, "plaster", 1),
        "classroom": RoomStyle("planks", _PALE, "plaster", 1),
        "laboratory": RoomStyle("tiles", _GREY_TILE, "plaster", 2),
        "library": RoomStyle("carpet", (134, 116, 96), "panels", 0),
        "gallery": RoomStyle("parquet", _WOOD, "plaster", 2, False),
        "ward": RoomStyle("tiles", (214, 226, 226), "plaster", 2),
        "consulting_room": RoomStyle("tiles", (220, 228, 226), "plaster", 2),
        "waiting_room": RoomStyle("tiles", _GREY_TILE, "plaster", 0),
        "foyer": RoomStyle("carpet", _RED_CARPET, "panels", 1),
        "auditorium": RoomStyle("carpet", (96, 40, 46), "panels", 3, False),
        "theatre": RoomStyle("carpet", (110, 40, 46), "panels", 3, False),
        "nave": RoomStyle("stone", (190, 182, 170), "plaster", 0, False),
        "narthex": RoomStyle("stone", (190, 182, 170), "plaster", 0),
        "sacristy": RoomStyle("planks", _WOOD, "panels", 0),
        "gym": RoomStyle("carpet", (86, 90, 96), "plaster", 2),
        "sports_hall": RoomStyle("planks", (224, 184, 130), "plaster", 2),
        "changing_room": RoomStyle(*wet, False),
        "club": RoomStyle("concrete", (92, 90, 96), "brick", 3, False),
        "games": RoomStyle("carpet", (92, 62, 96), "panels", 3),
        "community_hall": RoomStyle("parquet", _WOOD, "panels", 1),
        "bank_hall": RoomStyle("stone", _STONE, "panels", 2),
        "council_room": RoomStyle("parquet", _WOOD, "panels", 0),
        "cell": RoomStyle("concrete", _CONCRETE, "tiled", 2, False),
        "station_hall": RoomStyle("stone", (206, 202, 194), "tiled", 2),
        "workshop": RoomStyle("concrete", _CONCRETE, "brick", 2),
        "parking": RoomStyle("concrete", (150, 150, 150), "plaster", 0, False),
        "stairs": RoomStyle("stone", _STONE, "plaster", 0, False),
        "lift": RoomStyle("stone", (150, 150, 152), "plaster", 2, False),
    }


_STREET = [
    "shop", "clothes_shop", "pharmacy", "electronics_shop", "bookshop", "jeweller", "florist", "furniture_shop",
    "toy_shop", "wine_shop", "kiosk", "salon", "repair_shop", "laundry", "bakery", "cafe", "fast_food", "bar",
    "dining_room", "bank_hall", "gym",
]  # fmt: skip
LOOKS = {kind: replace(look, street=kind in _STREET) for kind, look in _looks().items()}
LOOKS |= {kind: replace(PLAIN, street=True) for kind in _STREET if kind not in LOOKS}
