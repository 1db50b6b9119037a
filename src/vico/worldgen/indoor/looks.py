"""How rooms look by their kind: floors, walls, colours, daylight."""

from __future__ import annotations

from dataclasses import dataclass, replace

from vico.assets.shapes import Colour


@dataclass(frozen=True)
class Look:
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
PLAIN = Look("planks", _WOOD, "plaster", 0)


def _looks() -> dict[str, Look]:
    wet, homely = ("tiles", _GREY_TILE, "tiled", 2), ("planks", _PALE, "wallpaper", 1)
    return {
        "hall": Look("parquet", _PALE, "plaster", 0, False),
        "corridor": Look("carpet", _CARPET, "plaster", 0, False),
        "living_room": Look("parquet", _WOOD, "wallpaper", 1),
        "kitchen": Look("tiles", _WARM_TILE, "tiled", 2),
        "bedroom": Look(*homely),
        "kids_room": Look("planks", _PALE, "wallpaper", 0),
        "studio": Look(*homely),
        "bathroom": Look(*wet, False),
        "washroom": Look(*wet, False),
        "shower_room": Look(*wet, False),
        "hotel_room": Look("carpet", (150, 122, 112), "wallpaper", 1),
        "dormitory": Look("planks", _PALE, "plaster", 1),
        "lobby": Look("stone", _STONE, "panels", 0),
        "storage": Look("concrete", _CONCRETE, "plaster", 0, False),
        "dining_room": Look("planks", _WOOD, "panels", 1),
        "restaurant_kitchen": Look(*wet, False),
        "cafe": Look("planks", _PALE, "brick", 1),
        "bar": Look("planks", (150, 112, 82), "panels", 3),
        "fast_food": Look("chequer", (236, 232, 226), "tiled", 1),
        "bakery": Look("tiles", _WARM_TILE, "tiled", 1),
        "supermarket": Look("tiles", (226, 226, 222), "plaster", 2, False),
        "pharmacy": Look("tiles", (232, 234, 232), "plaster", 2),
        "jeweller": Look("carpet", (92, 96, 122), "panels", 0),
        "florist": Look("stone", _STONE, "brick", 2),
        "salon": Look("chequer", (238, 236, 232), "plaster", 0),
        "laundry": Look(*wet),
        "repair_shop": Look("concrete", _CONCRETE, "brick", 0),
        "sales_floor": Look("stone", (226, 222, 214), "plaster", 2, False),
        "clothes_shop": Look("planks", _PALE, "plaster", 2),
        "bookshop": Look("planks", _WOOD, "plaster", 1),
        "wine_shop": Look("stone", _STONE, "brick", 3),
        "reception": Look("stone", _STONE, "plaster", 2),
        "open_office": Look("carpet", _CARPET, "plaster", 2),
        "office": Look("carpet", _CARPET, "plaster", 0),
        "meeting_room": Look("carpet", (110, 124, 130), "plaster", 0),
        "break_room": Look("tiles", _WARM_TILE, "plaster", 1),
        "classroom": Look("planks", _PALE, "plaster", 1),
        "laboratory": Look("tiles", _GREY_TILE, "plaster", 2),
        "library": Look("carpet", (134, 116, 96), "panels", 0),
        "gallery": Look("parquet", _WOOD, "plaster", 2, False),
        "ward": Look("tiles", (214, 226, 226), "plaster", 2),
        "consulting_room": Look("tiles", (220, 228, 226), "plaster", 2),
        "waiting_room": Look("tiles", _GREY_TILE, "plaster", 0),
        "foyer": Look("carpet", _RED_CARPET, "panels", 1),
        "auditorium": Look("carpet", (96, 40, 46), "panels", 3, False),
        "theatre": Look("carpet", (110, 40, 46), "panels", 3, False),
        "nave": Look("stone", (190, 182, 170), "plaster", 0, False),
        "narthex": Look("stone", (190, 182, 170), "plaster", 0),
        "sacristy": Look("planks", _WOOD, "panels", 0),
        "gym": Look("carpet", (86, 90, 96), "plaster", 2),
        "sports_hall": Look("planks", (224, 184, 130), "plaster", 2),
        "changing_room": Look(*wet, False),
        "club": Look("concrete", (92, 90, 96), "brick", 3, False),
        "games": Look("carpet", (92, 62, 96), "panels", 3),
        "community_hall": Look("parquet", _WOOD, "panels", 1),
        "bank_hall": Look("stone", _STONE, "panels", 2),
        "council_room": Look("parquet", _WOOD, "panels", 0),
        "cell": Look("concrete", _CONCRETE, "tiled", 2, False),
        "station_hall": Look("stone", (206, 202, 194), "tiled", 2),
        "workshop": Look("concrete", _CONCRETE, "brick", 2),
        "parking": Look("concrete", (150, 150, 150), "plaster", 0, False),
        "stairs": Look("stone", _STONE, "plaster", 0, False),
        "lift": Look("stone", (150, 150, 152), "plaster", 2, False),
    }


_STREET = [
    "shop", "clothes_shop", "pharmacy", "electronics_shop", "bookshop", "jeweller", "florist", "furniture_shop",
    "toy_shop", "wine_shop", "kiosk", "salon", "repair_shop", "laundry", "bakery", "cafe", "fast_food", "bar",
    "dining_room", "bank_hall", "gym",
]  # fmt: skip
LOOKS = {kind: replace(look, street=kind in _STREET) for kind, look in _looks().items()}
LOOKS |= {kind: replace(PLAIN, street=True) for kind in _STREET if kind not in LOOKS}
