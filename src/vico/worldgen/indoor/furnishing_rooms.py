"""What stands in the rooms of homes and hotels, of shops, and where people eat and drink: one function a kind."""

from __future__ import annotations

from vico.worldgen.indoor.furnishing import Member, RoomDraft

_SET2: tuple[Member, ...] = (
    ("restaurant_table", 0, 0, 0),
    ("restaurant_chair", -0.62, 0, 0),
    ("restaurant_chair", 0.62, 0, 180),
)
_SET4: tuple[Member, ...] = (
    ("dining_table", 0, 0, 0),
    ("restaurant_chair", -0.68, 0.34, 0),
    ("restaurant_chair", -0.68, -0.34, 0),
    ("restaurant_chair", 0.68, 0.34, 180),
    ("restaurant_chair", 0.68, -0.34, 180),
)
_CAFE_SET: tuple[Member, ...] = (("cafe_table", 0, 0, 0), ("chair", -0.62, 0, 0), ("chair", 0.62, 0, 180))
_BOOTH: tuple[Member, ...] = (("dining_table", 0, 0, 0), ("booth", -0.8, 0, 0), ("booth", 0.8, 0, 180))
_HIGH_SET: tuple[Member, ...] = (("high_table", 0, 0, 0), ("bar_stool", -0.6, 0, 0), ("bar_stool", 0.6, 0, 180))


def plants(room: RoomDraft, most: int = 1) -> None:
    """Plants in the corners."""
    for _ in range(most):
        room.against("pot_plant", along="corner", front=0.0)


def pictures(room: RoomDraft, most: int = 2) -> None:
    """Pictures on the walls."""
    names = ("painting", "painting_tall", "painting_field")
    for k in range(most):
        room.hang(names[int(room.chance.integers(3))], room.walls if k else None)


def _hall(room: RoomDraft) -> None:
    room.hang("coat_rack", room.walls)
    room.against("shoe_bench", front=0.5)
    room.hang("mirror", room.walls)
    room.lay("mat", *room.doors[0].point(room.size, 0.6), turn=room.doors[0].side)


def _corridor(room: RoomDraft) -> None:
    if room.size[0] * room.size[1] > 9:
        room.against("pot_plant", along="corner", front=0.0)
    pictures(room, 3)


def _living_room(room: RoomDraft) -> None:
    spot = room.against(
        "sofa", [room.far, *room.sides], along="middle", front=0.5, extra=[("coffee_table", 1.05, 0.0, 0.0)]
    )
    if spot:
        side, at = spot
        opposite = (side + 2) % 4
        room.against("television", [opposite, *room.sides], along="middle" if abs(at) < 0.6 else "any", front=0.4)
        deep = 1.5
        x, y = (0.0, at) if side in (0, 2) else (at, 0.0)
        sign = 1 if side in (0, 1) else -1
        x, y = (sign * (room.size[0] / 2 - deep), y) if side in (0, 2) else (x, sign * (room.size[1] / 2 - deep))
        room.lay("rug", x, y, side)
    room.against("bookcase", front=0.5)
    room.against("armchair", along="corner", front=0.4)
    room.against("floor_lamp", along="corner", front=0.0)
    if room.size[0] * room.size[1] > 20:
        for where in ((1.2, 1.0), (-1.2, 1.0), (1.2, -1.0), (-1.2, -1.0), (0.0, 0.0)):
            if room.put(_home_table(), where[0], where[1], int(room.chance.integers(2)), aisle=0.45):
                break
        room.against("chest_of_drawers", front=0.5)
    plants(room)
    pictures(room, 2)


def _home_table() -> tuple[Member, ...]:
    return (
        ("kitchen_table", 0, 0, 0),
        ("chair", -0.66, 0.3, 0),
        ("chair", -0.66, -0.3, 0),
        ("chair", 0.66, 0.3, 180),
        ("chair", 0.66, -0.3, 180),
    )


def _kitchen(room: RoomDraft) -> None:
    room.against("kitchen", [room.far, *room.sides, room.near], along="corner", front=0.8)
    room.against("fridge", along="corner", front=0.6)
    for where in ((0.0, 0.0), (0.6, -0.5), (-0.6, -0.5), (0.6, 0.5), (-0.6, 0.5), (0.9, 0.0), (-0.9, 0.0)):
        if room.put(_home_table(), where[0], where[1], 0, aisle=0.3) or room.put(
            _home_table(), where[0], where[1], 1, aisle=0.3
        ):
            break
    else:
        room.against("kitchen_table", front=0.0, extra=[("chair", 0.62, 0.3, 180), ("chair", 0.62, -0.3, 180)])
    pictures(room, 1)


def _bedroom(room: RoomDraft) -> None:
    bed = "bed_double" if min(room.size) > 2.7 else "bed_single"
    spot = room.against(
        bed,
        [room.far, *room.sides],
        along="middle",
        front=0.5,
        width=2.7 if bed == "bed_double" else 1.5,
        extra=[("bedside_table", -0.78, 1.1 if bed == "bed_double" else 0.72, 0.0)],
    )
    if spot is None:
        room.against(bed, along="corner", front=0.4)
    room.against("wardrobe", front=0.6)
    room.against("desk", front=0.3, extra=[("office_chair", 0.72, 0.0, 180.0)])
    room.against("chest_of_drawers", front=0.5)
    room.against("floor_lamp", along="corner", front=0.0)
    room.lay("rug_blue", 0.0, -0.4)
    pictures(room, 2)


def _kids_room(room: RoomDraft) -> None:
    room.against("bed_bunk", along="corner", front=0.5)
    room.against("desk", front=0.3, extra=[("office_chair", 0.72, 0.0, 180.0)])
    room.against("wardrobe", front=0.6)
    room.against("toy_box", front=0.4)
    room.against("bookcase", front=0.4)
    room.lay("rug_blue", 0.2, 0.0)
    pictures(room, 2)


def _studio(room: RoomDraft) -> None:
    room.against("kitchen", [*room.sides, room.near], along="corner", front=0.8)
    room.against("fridge", [*room.sides, room.near], along="corner", front=0.5)
    room.against("bed_double", [room.far, *room.sides], along="corner", front=0.4)
    room.against("sofa", front=0.4, extra=[("coffee_table", 0.95, 0.0, 0.0)])
    room.against("wardrobe", front=0.5)
    room.against("desk", front=0.3, extra=[("office_chair", 0.72, 0.0, 180.0)])
    room.against("floor_lamp", along="corner", front=0.0)
    pictures(room, 2)


def _bathroom(room: RoomDraft) -> None:
    long_side = max(room.size) > 2.3 and room.size[0] * room.size[1] > 4.5
    room.against(
        "bathtub" if long_side and room.chance.random() < 0.5 else "shower",
        [room.far, *room.sides],
        along="corner",
        front=0.5,
    )
    room.against("toilet", front=0.5)
    room.against("sink", front=0.5)
    if room.size[0] * room.size[1] > 5:
        room.against("washing_machine", front=0.5)
    room.lay("mat", 0.0, 0.0)


def washroom(room: RoomDraft) -> None:
    """Toilets of a public place."""
    most = 3 if room.size[0] * room.size[1] > 7 else 1
    for k in range(most):
        room.against("toilet", [room.far, *room.sides], along="corner" if not k else "any", front=0.5, width=0.9)
    for _ in range(most):
        room.against("sink", front=0.5)


def _shower_room(room: RoomDraft) -> None:
    for _ in range(3):
        room.against("shower", [room.far, *room.sides], along="corner", front=0.5)
    for _ in range(2):
        room.against("sink", front=0.5)
    room.against("toilet", front=0.5)


def _hotel_room(room: RoomDraft) -> None:
    room.against(
        "bed_double",
        [*room.sides, room.far],
        along="middle",
        front=0.0,
        width=2.8,
        extra=[("bedside_table", -0.78, 1.1, 0.0), ("bedside_table", -0.78, -1.1, 0.0)],
    )
    room.against("desk", front=0.3, extra=[("office_chair", 0.72, 0.0, 180.0)])
    room.against("wardrobe", front=0.5)
    room.against("luggage_rack", front=0.3)
    room.against("armchair", along="corner", front=0.3)
    room.against("floor_lamp", along="corner", front=0.0)
    room.hang("painting", room.walls)
    room.hang("mirror", room.walls)


def _dormitory(room: RoomDraft) -> None:
    for k in range(4):
        room.against("bed_bunk", [*room.sides, room.far], along="corner" if k < 2 else "any", front=0.4)
    room.against("lockers", front=0.5)
    room.against("kitchen_table", along="middle", front=0.0, extra=[("chair", 0.62, 0.25, 180)])


def _common_room(room: RoomDraft) -> None:
    room.against("kitchen", [room.far, *room.sides], along="corner", front=0.8)
    room.against("fridge", along="corner", front=0.5)
    room.fill(_home_table(), (2.2, 2.0), most=3, aisle=0.5, inset=1.2)
    room.against("sofa", front=0.4)
    room.against("bookcase", front=0.4)
    pictures(room, 2)


def _lobby(room: RoomDraft) -> None:
    room.against("reception_desk", [room.far, *room.sides], along="middle", front=1.0, gap=0.9)
    room.lay("rug", 0.0, 0.0)
    for k in range(2):
        room.against("sofa_teal" if k else "sofa", front=0.4, extra=[("coffee_table", 0.95, 0.0, 0.0)])
    room.against("armchair", along="corner", front=0.4)
    plants(room, 3)
    pictures(room, 3)


def _storage(room: RoomDraft) -> None:
    for _ in range(4):
        room.against("store_rack", [room.far, *room.sides], along="corner", front=0.6)
    room.against("cupboard", front=0.5)


# Food and drink


def _dining_room(room: RoomDraft) -> None:
    room.against("counter", [*room.sides, room.near], along="door", front=0.8, gap=0.7)
    for _ in range(3):
        room.against(
            "booth",
            [*room.sides, room.far],
            front=0.0,
            extra=[("dining_table", 0.8, 0.0, 0.0), ("booth", 1.6, 0.0, 180.0)],
        )
    room.fill(_SET4, (2.5, 2.3), aisle=0.62, inset=1.25, most=8)
    room.fill(_SET2, (2.0, 1.5), aisle=0.55, inset=0.95, most=8)
    room.against("cupboard", front=0.5)
    plants(room, 2)
    pictures(room, 4)


def _restaurant_kitchen(room: RoomDraft) -> None:
    room.against("stove", [room.far, *room.sides], along="middle", front=0.8)
    room.against("steel_sink", [*room.sides, room.far], front=0.7)
    room.against("oven", front=0.7)
    room.against("fridge", front=0.6)
    room.against("store_rack", front=0.5)
    if not room.put([("steel_table", 0, 0, 90)], 0.0, 0.0, aisle=0.6):
        room.against("steel_table", front=0.6)


def _cafe(room: RoomDraft) -> None:
    spot = room.against("pastry_case", [*room.sides, room.far], along="door", front=0.9, gap=1.0)
    if spot:
        room.against("counter", spot[0], front=0.9, gap=1.0)
        room.against("cupboard", spot[0], along=spot[1], front=0.0)
        room.hang("menu_board", [spot[0], *room.walls])
    room.against("sofa", [room.far, *room.sides], front=0.3, extra=[("coffee_table", 0.95, 0.0, 0.0)])
    room.fill(_CAFE_SET, (2.0, 1.6), aisle=0.6, inset=0.95, most=9)
    plants(room, 2)
    pictures(room, 3)


def bar(room: RoomDraft) -> None:
    """Furnish a bar with its shelves, booths, and high tables."""
    for side in [*room.sides, room.far]:
        spot = room.against(
            "bar_counter",
            side,
            along="corner",
            front=0.5,
            gap=1.3,
            extra=[("bar_stool", 0.62, y, 180.0) for y in (-0.8, 0.0, 0.8)],
        )
        if spot:
            room.against("back_bar", spot[0], along=spot[1], front=0.0)
            room.against(
                "bar_counter",
                spot[0],
                front=0.5,
                gap=1.3,
                extra=[("bar_stool", 0.62, y, 180.0) for y in (-0.8, 0.0, 0.8)],
            )
            room.against("back_bar", spot[0], along=spot[1], front=0.0)
            break
    for _ in range(3):
        room.against(
            "booth",
            [*room.sides, room.far],
            front=0.0,
            extra=[("dining_table", 0.8, 0.0, 0.0), ("booth", 1.6, 0.0, 180.0)],
        )
    if room.size[0] * room.size[1] > 85:
        room.put([("pool_table", 0, 0, 0)], 0.0, 0.0, aisle=0.9)
    room.fill(_HIGH_SET, (2.2, 1.7), aisle=0.6, inset=1.0, most=6)
    pictures(room, 3)


def _fast_food(room: RoomDraft) -> None:
    side = room.far
    count = 0
    while count < 3 and room.against("counter", side, along="middle", front=1.0, gap=0.9):
        count += 1
    room.hang("menu_board", side)
    room.hang("menu_board", side)
    for _ in range(2):
        room.against("order_kiosk", room.sides, front=0.7)
    for _ in range(4):
        room.against(
            "booth",
            [*room.sides, room.near],
            front=0.0,
            extra=[("dining_table", 0.8, 0.0, 0.0), ("booth", 1.6, 0.0, 180.0)],
        )
    room.fill(_CAFE_SET, (2.1, 1.7), aisle=0.6, inset=1.0, most=8)
    plants(room)


def _bakery(room: RoomDraft) -> None:
    spot = room.against("pastry_case", [room.far, *room.sides], along="middle", front=1.0, gap=1.4)
    if spot:
        room.against("pastry_case", spot[0], front=0.9, gap=1.4)
        room.against("bread_shelf", spot[0], along=spot[1], front=0.0)
        room.against("bread_shelf", spot[0], along=spot[1], front=0.0)
        room.hang("menu_board", room.walls)
    room.against("bread_shelf", room.sides, front=0.6)
    room.against("fridge_display", front=0.6)
    room.fill(_CAFE_SET, (2.0, 1.6), aisle=0.6, inset=0.95, most=3)


# Shops


def _shop(room: RoomDraft) -> None:
    room.against("counter", [*room.sides, room.near], along="door", front=0.8, gap=0.7)
    for _ in range(5):
        room.against("shelf", [*room.sides, room.far], front=0.7)
    room.fill([("display_table", 0, 0, 0)], (2.4, 2.6), aisle=0.9, inset=1.5, most=6)
    plants(room)


def _supermarket(room: RoomDraft) -> None:
    depth = room.size[1] if room.near in (1, 3) else room.size[0]
    turn = 0 if room.near in (1, 3) else 1
    sign = 1.0 if room.near in (0, 1) else -1.0
    for k in range(-2, 3):
        ahead = sign * (depth / 2 - 2.3)
        x, y = (k * 1.9, ahead) if room.near in (1, 3) else (ahead, k * 1.9)
        room.put([("checkout", 0, 0, 0)], x, y, turn, aisle=0.9)
    for _ in range(4):
        room.against("fridge_display", [room.far, *room.sides], front=0.9)
    room.against("produce_stand", room.sides, front=0.9)
    room.against("produce_stand", room.sides, front=0.9)
    room.against("bread_shelf", [room.far, *room.sides], front=0.9)
    x, y = room.size[0] / 2 - 1.6, room.size[1] / 2 - 1.8
    back = 2.2  # between the shelves and the tills
    box = {3: (-x, -y + back, x, y), 1: (-x, -y, x, y - back), 2: (-x + back, -y, x, y), 0: (-x, -y, x - back, y)}[
        room.near
    ]
    room.fill(
        [("gondola", 0, 0, 0)], (2.4, 2.5) if turn == 0 else (2.5, 2.4), aisle=0.02, inset=1.0, box=box, turn=turn
    )
    room.fill([("freezer_chest", 0, 0, 0)], (3.0, 3.0), aisle=1.0, inset=1.0, most=2)


def _clothes(room: RoomDraft) -> None:
    room.against("counter", [*room.sides, room.far], along="corner", front=0.9, gap=0.7)
    for _ in range(2 if room.size[0] * room.size[1] > 60 else 1):
        room.against("fitting_booth", [room.far, *room.sides], along="corner", front=0.7)
    room.against("shoe_wall", [*room.sides, room.far], front=0.7)
    for k in range(3):
        room.against("mannequin_blue" if k % 2 else "mannequin", [room.near, *room.sides], along="door", front=0.3)
    room.fill([("clothes_rack", 0, 0, 0)], (1.8, 2.5), aisle=0.8, inset=1.4, most=8)
    room.fill([("display_table", 0, 0, 0)], (2.2, 2.4), aisle=0.8, inset=1.4, most=3)
    room.hang("mirror", room.walls)
    room.hang("mirror", room.walls)


def _pharmacy(room: RoomDraft) -> None:
    spot = room.against("counter", [room.far, *room.sides], along="middle", front=1.0, gap=1.1)
    if spot:
        room.against("counter", spot[0], front=1.0, gap=1.1)
        for _ in range(3):
            room.against("pharmacy_shelf", spot[0], along=spot[1], front=0.0)
    for _ in range(4):
        room.against("pharmacy_shelf", room.walls, front=0.7)
    room.fill([("gondola", 0, 0, 0)], (2.4, 2.6), aisle=0.9, inset=1.6, most=2)
    room.against("waiting_bench", front=0.4)
    plants(room)


def _specialist(room: RoomDraft, stock: tuple[str, ...], middle: str, most: int = 7) -> None:
    room.against("counter", [*room.sides, room.far], along="corner", front=0.8, gap=0.7)
    for k in range(most):
        room.against(stock[k % len(stock)], [room.far, *room.sides, room.near], front=0.7)
    room.fill([(middle, 0, 0, 0)], (2.3, 2.5), aisle=0.85, inset=1.4, most=4)
    plants(room)


def _electronics(room: RoomDraft) -> None:
    _specialist(room, ("shelf", "toy_shelf"), "gadget_table", 4)


def _bookshop(room: RoomDraft) -> None:
    _specialist(room, ("bookcase",), "display_table", 9)
    room.fill([("double_bookcase", 0, 0, 0)], (2.4, 2.6), aisle=0.85, inset=1.4, most=3)
    room.against("armchair", along="corner", front=0.4)


def _jeweller(room: RoomDraft) -> None:
    _specialist(room, ("jewel_case",), "jewel_case", 6)
    pictures(room, 3)


def _florist(room: RoomDraft) -> None:
    _specialist(room, ("flower_stand", "flower_stand", "shelf"), "flower_stand", 6)


def _furniture_shop(room: RoomDraft) -> None:
    room.against("counter", [*room.sides, room.far], along="corner", front=0.8, gap=0.7)
    room.fill([("sofa", 0, 0, 0), ("coffee_table", 1.0, 0, 0)], (3.4, 3.0), aisle=0.8, inset=1.6, most=3)
    room.against("bed_double", [room.far, *room.sides], front=0.5)
    room.fill(_home_table(), (3.0, 2.6), aisle=0.8, inset=1.4, most=3)
    for name in ("wardrobe", "bookcase", "chest_of_drawers", "desk", "armchair", "floor_lamp", "television"):
        room.against(name, front=0.5)
    room.lay("rug", 0.0, 0.0)
    pictures(room, 4)


def _toys(room: RoomDraft) -> None:
    _specialist(room, ("toy_shelf", "toy_shelf", "toy_box"), "display_table", 7)


def _wine(room: RoomDraft) -> None:
    _specialist(room, ("wine_shelf",), "display_table", 7)


def _kiosk(room: RoomDraft) -> None:
    room.against("counter", [room.far, *room.sides], along="middle", front=0.8, gap=0.8)
    for name in ("newsstand", "fridge_display", "shelf", "newsstand", "toy_shelf"):
        room.against(name, [*room.sides, room.near, room.far], front=0.6)


def _salon(room: RoomDraft) -> None:
    room.against("counter", [*room.sides, room.near], along="door", front=0.8, gap=0.7)
    for _ in range(4):
        room.against("salon_mirror", [*room.sides, room.far], front=0.5, extra=[("barber_chair", 0.85, 0.0, 180.0)])
    room.against("washstand", front=0.6)
    room.against("sofa", front=0.4)
    plants(room)
    pictures(room, 2)


def _repair(room: RoomDraft) -> None:
    room.against("counter", [room.far, *room.sides], along="middle", front=0.9, gap=1.6)
    room.against("repair_bench", [room.far, *room.sides], front=0.7)
    room.against("repair_bench", [*room.sides, room.far], front=0.7)
    for name in ("store_rack", "tool_cabinet", "store_rack"):
        room.against(name, front=0.6)
    room.against("waiting_bench", front=0.4)


def _laundry(room: RoomDraft) -> None:
    for side in [*room.sides, room.far]:
        room.row("washing_machine", side, most=5, front=0.7)
    room.fill([("work_table", 0, 0, 0)], (2.4, 2.8), aisle=0.8, inset=1.6, most=2)
    room.against("waiting_bench", front=0.4)
    room.against("vending_machine", front=0.6)


def sales_floor(room: RoomDraft) -> None:
    """Furnish a storey of a department store."""
    room.against("counter", [*room.sides, room.far], along="corner", front=0.9, gap=0.7)
    for k in range(2):
        room.against("fitting_booth", [*room.sides, room.near], along="corner" if not k else "any", front=0.7)
    for name in ("shoe_wall", "shelf", "toy_shelf", "wine_shelf", "pharmacy_shelf"):
        room.against(name, [*room.sides, room.near], front=0.8)
    for k in range(3):
        room.against("mannequin_blue" if k % 2 else "mannequin", room.walls, front=0.4)
    kinds = ("clothes_rack", "display_table", "jewel_case", "gadget_table")
    first = int(room.chance.integers(4))
    x, y = room.size[0] / 2, room.size[1] / 2
    for k, box in enumerate(((-x, -y, 0.0, 0.0), (0.0, -y, x, 0.0), (-x, 0.0, 0.0, y), (0.0, 0.0, x, y))):
        room.fill([(kinds[(first + k) % 4], 0, 0, 0)], (2.3, 2.6), aisle=0.85, inset=1.5, box=box, most=5)
    plants(room, 2)


ROOMS = {
    "hall": _hall,
    "corridor": _corridor,
    "living_room": _living_room,
    "kitchen": _kitchen,
    "bedroom": _bedroom,
    "kids_room": _kids_room,
    "studio": _studio,
    "bathroom": _bathroom,
    "washroom": washroom,
    "shower_room": _shower_room,
    "hotel_room": _hotel_room,
    "dormitory": _dormitory,
    "common_room": _common_room,
    "lobby": _lobby,
    "storage": _storage,
    "dining_room": _dining_room,
    "restaurant_kitchen": _restaurant_kitchen,
    "cafe": _cafe,
    "bar": bar,
    "fast_food": _fast_food,
    "bakery": _bakery,
    "shop": _shop,
    "supermarket": _supermarket,
    "clothes_shop": _clothes,
    "pharmacy": _pharmacy,
    "electronics_shop": _electronics,
    "bookshop": _bookshop,
    "jeweller": _jeweller,
    "florist": _florist,
    "furniture_shop": _furniture_shop,
    "toy_shop": _toys,
    "wine_shop": _wine,
    "kiosk": _kiosk,
    "salon": _salon,
    "repair_shop": _repair,
    "laundry": _laundry,
    "sales_floor": sales_floor,
}
