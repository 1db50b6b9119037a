"""What stands in the rooms of homes and hotels, of shops, and where people eat and drink: one function a kind."""

from __future__ import annotations

from vico.worldgen.indoor.furnishing import Canvas, Member

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


def plants(c: Canvas, most: int = 1) -> None:
    """Plants in the corners."""
    for _ in range(most):
        c.against("pot_plant", along="corner", front=0.0)


def pictures(c: Canvas, most: int = 2) -> None:
    """Pictures on the walls."""
    names = ("painting", "painting_tall", "painting_field")
    for k in range(most):
        c.hang(names[int(c.chance.integers(3))], c.walls if k else None)


def _hall(c: Canvas) -> None:
    c.hang("coat_rack", c.walls)
    c.against("shoe_bench", front=0.5)
    c.hang("mirror", c.walls)
    c.lay("mat", *c.doors[0].point(c.size, 0.6), turn=c.doors[0].side)


def _corridor(c: Canvas) -> None:
    if c.size[0] * c.size[1] > 9:
        c.against("pot_plant", along="corner", front=0.0)
    pictures(c, 3)


def _living_room(c: Canvas) -> None:
    spot = c.against("sofa", [c.far, *c.sides], along="middle", front=0.5, extra=[("coffee_table", 1.05, 0.0, 0.0)])
    if spot:
        side, at = spot
        opposite = (side + 2) % 4
        c.against("television", [opposite, *c.sides], along="middle" if abs(at) < 0.6 else "any", front=0.4)
        deep = 1.5
        x, y = (0.0, at) if side in (0, 2) else (at, 0.0)
        sign = 1 if side in (0, 1) else -1
        x, y = (sign * (c.size[0] / 2 - deep), y) if side in (0, 2) else (x, sign * (c.size[1] / 2 - deep))
        c.lay("rug", x, y, side)
    c.against("bookcase", front=0.5)
    c.against("armchair", along="corner", front=0.4)
    c.against("floor_lamp", along="corner", front=0.0)
    if c.size[0] * c.size[1] > 20:
        for where in ((1.2, 1.0), (-1.2, 1.0), (1.2, -1.0), (-1.2, -1.0), (0.0, 0.0)):
            if c.put(_home_table(), where[0], where[1], int(c.chance.integers(2)), aisle=0.45):
                break
        c.against("chest_of_drawers", front=0.5)
    plants(c)
    pictures(c, 2)


def _home_table() -> tuple[Member, ...]:
    return (
        ("kitchen_table", 0, 0, 0),
        ("chair", -0.66, 0.3, 0),
        ("chair", -0.66, -0.3, 0),
        ("chair", 0.66, 0.3, 180),
        ("chair", 0.66, -0.3, 180),
    )


def _kitchen(c: Canvas) -> None:
    c.against("kitchen", [c.far, *c.sides, c.near], along="corner", front=0.8)
    c.against("fridge", along="corner", front=0.6)
    for where in ((0.0, 0.0), (0.6, -0.5), (-0.6, -0.5), (0.6, 0.5), (-0.6, 0.5), (0.9, 0.0), (-0.9, 0.0)):
        if c.put(_home_table(), where[0], where[1], 0, aisle=0.3) or c.put(
            _home_table(), where[0], where[1], 1, aisle=0.3
        ):
            break
    else:
        c.against("kitchen_table", front=0.0, extra=[("chair", 0.62, 0.3, 180), ("chair", 0.62, -0.3, 180)])
    pictures(c, 1)


def _bedroom(c: Canvas) -> None:
    bed = "bed_double" if min(c.size) > 2.7 else "bed_single"
    spot = c.against(
        bed,
        [c.far, *c.sides],
        along="middle",
        front=0.5,
        width=2.7 if bed == "bed_double" else 1.5,
        extra=[("bedside_table", -0.78, 1.1 if bed == "bed_double" else 0.72, 0.0)],
    )
    if spot is None:
        c.against(bed, along="corner", front=0.4)
    c.against("wardrobe", front=0.6)
    c.against("desk", front=0.3, extra=[("office_chair", 0.72, 0.0, 180.0)])
    c.against("chest_of_drawers", front=0.5)
    c.against("floor_lamp", along="corner", front=0.0)
    c.lay("rug_blue", 0.0, -0.4)
    pictures(c, 2)


def _kids_room(c: Canvas) -> None:
    c.against("bed_bunk", along="corner", front=0.5)
    c.against("desk", front=0.3, extra=[("office_chair", 0.72, 0.0, 180.0)])
    c.against("wardrobe", front=0.6)
    c.against("toy_box", front=0.4)
    c.against("bookcase", front=0.4)
    c.lay("rug_blue", 0.2, 0.0)
    pictures(c, 2)


def _studio(c: Canvas) -> None:
    c.against("kitchen", [*c.sides, c.near], along="corner", front=0.8)
    c.against("fridge", [*c.sides, c.near], along="corner", front=0.5)
    c.against("bed_double", [c.far, *c.sides], along="corner", front=0.4)
    c.against("sofa", front=0.4, extra=[("coffee_table", 0.95, 0.0, 0.0)])
    c.against("wardrobe", front=0.5)
    c.against("desk", front=0.3, extra=[("office_chair", 0.72, 0.0, 180.0)])
    c.against("floor_lamp", along="corner", front=0.0)
    pictures(c, 2)


def _bathroom(c: Canvas) -> None:
    long_side = max(c.size) > 2.3 and c.size[0] * c.size[1] > 4.5
    c.against(
        "bathtub" if long_side and c.chance.random() < 0.5 else "shower", [c.far, *c.sides], along="corner", front=0.5
    )
    c.against("toilet", front=0.5)
    c.against("sink", front=0.5)
    if c.size[0] * c.size[1] > 5:
        c.against("washing_machine", front=0.5)
    c.lay("mat", 0.0, 0.0)


def washroom(c: Canvas) -> None:
    """Toilets of a public place."""
    most = 3 if c.size[0] * c.size[1] > 7 else 1
    for k in range(most):
        c.against("toilet", [c.far, *c.sides], along="corner" if not k else "any", front=0.5, width=0.9)
    for _ in range(most):
        c.against("sink", front=0.5)


def _shower_room(c: Canvas) -> None:
    for _ in range(3):
        c.against("shower", [c.far, *c.sides], along="corner", front=0.5)
    for _ in range(2):
        c.against("sink", front=0.5)
    c.against("toilet", front=0.5)


def _hotel_room(c: Canvas) -> None:
    c.against(
        "bed_double",
        [*c.sides, c.far],
        along="middle",
        front=0.0,
        width=2.8,
        extra=[("bedside_table", -0.78, 1.1, 0.0), ("bedside_table", -0.78, -1.1, 0.0)],
    )
    c.against("desk", front=0.3, extra=[("office_chair", 0.72, 0.0, 180.0)])
    c.against("wardrobe", front=0.5)
    c.against("luggage_rack", front=0.3)
    c.against("armchair", along="corner", front=0.3)
    c.against("floor_lamp", along="corner", front=0.0)
    c.hang("painting", c.walls)
    c.hang("mirror", c.walls)


def _dormitory(c: Canvas) -> None:
    for k in range(4):
        c.against("bed_bunk", [*c.sides, c.far], along="corner" if k < 2 else "any", front=0.4)
    c.against("lockers", front=0.5)
    c.against("kitchen_table", along="middle", front=0.0, extra=[("chair", 0.62, 0.25, 180)])


def _common_room(c: Canvas) -> None:
    c.against("kitchen", [c.far, *c.sides], along="corner", front=0.8)
    c.against("fridge", along="corner", front=0.5)
    c.fill(_home_table(), (2.2, 2.0), most=3, aisle=0.5, inset=1.2)
    c.against("sofa", front=0.4)
    c.against("bookcase", front=0.4)
    pictures(c, 2)


def _lobby(c: Canvas) -> None:
    c.against("reception_desk", [c.far, *c.sides], along="middle", front=1.0, gap=0.9)
    c.lay("rug", 0.0, 0.0)
    for k in range(2):
        c.against("sofa_teal" if k else "sofa", front=0.4, extra=[("coffee_table", 0.95, 0.0, 0.0)])
    c.against("armchair", along="corner", front=0.4)
    plants(c, 3)
    pictures(c, 3)


def _storage(c: Canvas) -> None:
    for _ in range(4):
        c.against("store_rack", [c.far, *c.sides], along="corner", front=0.6)
    c.against("cupboard", front=0.5)


# Food and drink


def _dining_room(c: Canvas) -> None:
    c.against("counter", [*c.sides, c.near], along="door", front=0.8, gap=0.7)
    for _ in range(3):
        c.against(
            "booth", [*c.sides, c.far], front=0.0, extra=[("dining_table", 0.8, 0.0, 0.0), ("booth", 1.6, 0.0, 180.0)]
        )
    c.fill(_SET4, (2.5, 2.3), aisle=0.62, inset=1.25, most=8)
    c.fill(_SET2, (2.0, 1.5), aisle=0.55, inset=0.95, most=8)
    c.against("cupboard", front=0.5)
    plants(c, 2)
    pictures(c, 4)


def _restaurant_kitchen(c: Canvas) -> None:
    c.against("stove", [c.far, *c.sides], along="middle", front=0.8)
    c.against("steel_sink", [*c.sides, c.far], front=0.7)
    c.against("oven", front=0.7)
    c.against("fridge", front=0.6)
    c.against("store_rack", front=0.5)
    if not c.put([("steel_table", 0, 0, 90)], 0.0, 0.0, aisle=0.6):
        c.against("steel_table", front=0.6)


def _cafe(c: Canvas) -> None:
    spot = c.against("pastry_case", [*c.sides, c.far], along="door", front=0.9, gap=1.0)
    if spot:
        c.against("counter", spot[0], front=0.9, gap=1.0)
        c.against("cupboard", spot[0], along=spot[1], front=0.0)
        c.hang("menu_board", [spot[0], *c.walls])
    c.against("sofa", [c.far, *c.sides], front=0.3, extra=[("coffee_table", 0.95, 0.0, 0.0)])
    c.fill(_CAFE_SET, (2.0, 1.6), aisle=0.6, inset=0.95, most=9)
    plants(c, 2)
    pictures(c, 3)


def bar(c: Canvas) -> None:
    """A bar with its shelves, booths, and high tables."""
    for side in [*c.sides, c.far]:
        spot = c.against(
            "bar_counter",
            side,
            along="corner",
            front=0.5,
            gap=1.3,
            extra=[("bar_stool", 0.62, y, 180.0) for y in (-0.8, 0.0, 0.8)],
        )
        if spot:
            c.against("back_bar", spot[0], along=spot[1], front=0.0)
            c.against(
                "bar_counter",
                spot[0],
                front=0.5,
                gap=1.3,
                extra=[("bar_stool", 0.62, y, 180.0) for y in (-0.8, 0.0, 0.8)],
            )
            c.against("back_bar", spot[0], along=spot[1], front=0.0)
            break
    for _ in range(3):
        c.against(
            "booth", [*c.sides, c.far], front=0.0, extra=[("dining_table", 0.8, 0.0, 0.0), ("booth", 1.6, 0.0, 180.0)]
        )
    if c.size[0] * c.size[1] > 85:
        c.put([("pool_table", 0, 0, 0)], 0.0, 0.0, aisle=0.9)
    c.fill(_HIGH_SET, (2.2, 1.7), aisle=0.6, inset=1.0, most=6)
    pictures(c, 3)


def _fast_food(c: Canvas) -> None:
    side = c.far
    count = 0
    while count < 3 and c.against("counter", side, along="middle", front=1.0, gap=0.9):
        count += 1
    c.hang("menu_board", side)
    c.hang("menu_board", side)
    for _ in range(2):
        c.against("order_kiosk", c.sides, front=0.7)
    for _ in range(4):
        c.against(
            "booth", [*c.sides, c.near], front=0.0, extra=[("dining_table", 0.8, 0.0, 0.0), ("booth", 1.6, 0.0, 180.0)]
        )
    c.fill(_CAFE_SET, (2.1, 1.7), aisle=0.6, inset=1.0, most=8)
    plants(c)


def _bakery(c: Canvas) -> None:
    spot = c.against("pastry_case", [c.far, *c.sides], along="middle", front=1.0, gap=1.4)
    if spot:
        c.against("pastry_case", spot[0], front=0.9, gap=1.4)
        c.against("bread_shelf", spot[0], along=spot[1], front=0.0)
        c.against("bread_shelf", spot[0], along=spot[1], front=0.0)
        c.hang("menu_board", c.walls)
    c.against("bread_shelf", c.sides, front=0.6)
    c.against("fridge_display", front=0.6)
    c.fill(_CAFE_SET, (2.0, 1.6), aisle=0.6, inset=0.95, most=3)


# Shops


def _shop(c: Canvas) -> None:
    c.against("counter", [*c.sides, c.near], along="door", front=0.8, gap=0.7)
    for _ in range(5):
        c.against("shelf", [*c.sides, c.far], front=0.7)
    c.fill([("display_table", 0, 0, 0)], (2.4, 2.6), aisle=0.9, inset=1.5, most=6)
    plants(c)


def _supermarket(c: Canvas) -> None:
    depth = c.size[1] if c.near in (1, 3) else c.size[0]
    turn = 0 if c.near in (1, 3) else 1
    sign = 1.0 if c.near in (0, 1) else -1.0
    for k in range(-2, 3):
        ahead = sign * (depth / 2 - 2.3)
        x, y = (k * 1.9, ahead) if c.near in (1, 3) else (ahead, k * 1.9)
        c.put([("checkout", 0, 0, 0)], x, y, turn, aisle=0.9)
    for _ in range(4):
        c.against("fridge_display", [c.far, *c.sides], front=0.9)
    c.against("produce_stand", c.sides, front=0.9)
    c.against("produce_stand", c.sides, front=0.9)
    c.against("bread_shelf", [c.far, *c.sides], front=0.9)
    x, y = c.size[0] / 2 - 1.6, c.size[1] / 2 - 1.8
    back = 2.2  # between the shelves and the tills
    box = {3: (-x, -y + back, x, y), 1: (-x, -y, x, y - back), 2: (-x + back, -y, x, y), 0: (-x, -y, x - back, y)}[
        c.near
    ]
    c.fill([("gondola", 0, 0, 0)], (2.4, 2.5) if turn == 0 else (2.5, 2.4), aisle=0.02, inset=1.0, box=box, turn=turn)
    c.fill([("freezer_chest", 0, 0, 0)], (3.0, 3.0), aisle=1.0, inset=1.0, most=2)


def _clothes(c: Canvas) -> None:
    c.against("counter", [*c.sides, c.far], along="corner", front=0.9, gap=0.7)
    for _ in range(2 if c.size[0] * c.size[1] > 60 else 1):
        c.against("fitting_booth", [c.far, *c.sides], along="corner", front=0.7)
    c.against("shoe_wall", [*c.sides, c.far], front=0.7)
    for k in range(3):
        c.against("mannequin_blue" if k % 2 else "mannequin", [c.near, *c.sides], along="door", front=0.3)
    c.fill([("clothes_rack", 0, 0, 0)], (1.8, 2.5), aisle=0.8, inset=1.4, most=8)
    c.fill([("display_table", 0, 0, 0)], (2.2, 2.4), aisle=0.8, inset=1.4, most=3)
    c.hang("mirror", c.walls)
    c.hang("mirror", c.walls)


def _pharmacy(c: Canvas) -> None:
    spot = c.against("counter", [c.far, *c.sides], along="middle", front=1.0, gap=1.1)
    if spot:
        c.against("counter", spot[0], front=1.0, gap=1.1)
        for _ in range(3):
            c.against("pharmacy_shelf", spot[0], along=spot[1], front=0.0)
    for _ in range(4):
        c.against("pharmacy_shelf", c.walls, front=0.7)
    c.fill([("gondola", 0, 0, 0)], (2.4, 2.6), aisle=0.9, inset=1.6, most=2)
    c.against("waiting_bench", front=0.4)
    plants(c)


def _specialist(c: Canvas, stock: tuple[str, ...], middle: str, most: int = 7) -> None:
    c.against("counter", [*c.sides, c.far], along="corner", front=0.8, gap=0.7)
    for k in range(most):
        c.against(stock[k % len(stock)], [c.far, *c.sides, c.near], front=0.7)
    c.fill([(middle, 0, 0, 0)], (2.3, 2.5), aisle=0.85, inset=1.4, most=4)
    plants(c)


def _electronics(c: Canvas) -> None:
    _specialist(c, ("shelf", "toy_shelf"), "gadget_table", 4)


def _bookshop(c: Canvas) -> None:
    _specialist(c, ("bookcase",), "display_table", 9)
    c.fill([("double_bookcase", 0, 0, 0)], (2.4, 2.6), aisle=0.85, inset=1.4, most=3)
    c.against("armchair", along="corner", front=0.4)


def _jeweller(c: Canvas) -> None:
    _specialist(c, ("jewel_case",), "jewel_case", 6)
    pictures(c, 3)


def _florist(c: Canvas) -> None:
    _specialist(c, ("flower_stand", "flower_stand", "shelf"), "flower_stand", 6)


def _furniture_shop(c: Canvas) -> None:
    c.against("counter", [*c.sides, c.far], along="corner", front=0.8, gap=0.7)
    c.fill([("sofa", 0, 0, 0), ("coffee_table", 1.0, 0, 0)], (3.4, 3.0), aisle=0.8, inset=1.6, most=3)
    c.against("bed_double", [c.far, *c.sides], front=0.5)
    c.fill(_home_table(), (3.0, 2.6), aisle=0.8, inset=1.4, most=3)
    for name in ("wardrobe", "bookcase", "chest_of_drawers", "desk", "armchair", "floor_lamp", "television"):
        c.against(name, front=0.5)
    c.lay("rug", 0.0, 0.0)
    pictures(c, 4)


def _toys(c: Canvas) -> None:
    _specialist(c, ("toy_shelf", "toy_shelf", "toy_box"), "display_table", 7)


def _wine(c: Canvas) -> None:
    _specialist(c, ("wine_shelf",), "display_table", 7)


def _kiosk(c: Canvas) -> None:
    c.against("counter", [c.far, *c.sides], along="middle", front=0.8, gap=0.8)
    for name in ("newsstand", "fridge_display", "shelf", "newsstand", "toy_shelf"):
        c.against(name, [*c.sides, c.near, c.far], front=0.6)


def _salon(c: Canvas) -> None:
    c.against("counter", [*c.sides, c.near], along="door", front=0.8, gap=0.7)
    for _ in range(4):
        c.against("salon_mirror", [*c.sides, c.far], front=0.5, extra=[("barber_chair", 0.85, 0.0, 180.0)])
    c.against("washstand", front=0.6)
    c.against("sofa", front=0.4)
    plants(c)
    pictures(c, 2)


def _repair(c: Canvas) -> None:
    c.against("counter", [c.far, *c.sides], along="middle", front=0.9, gap=1.6)
    c.against("repair_bench", [c.far, *c.sides], front=0.7)
    c.against("repair_bench", [*c.sides, c.far], front=0.7)
    for name in ("store_rack", "tool_cabinet", "store_rack"):
        c.against(name, front=0.6)
    c.against("waiting_bench", front=0.4)


def _laundry(c: Canvas) -> None:
    for side in [*c.sides, c.far]:
        c.row("washing_machine", side, most=5, front=0.7)
    c.fill([("work_table", 0, 0, 0)], (2.4, 2.8), aisle=0.8, inset=1.6, most=2)
    c.against("waiting_bench", front=0.4)
    c.against("vending_machine", front=0.6)


def sales_floor(c: Canvas) -> None:
    """A storey of a department store."""
    c.against("counter", [*c.sides, c.far], along="corner", front=0.9, gap=0.7)
    for k in range(2):
        c.against("fitting_booth", [*c.sides, c.near], along="corner" if not k else "any", front=0.7)
    for name in ("shoe_wall", "shelf", "toy_shelf", "wine_shelf", "pharmacy_shelf"):
        c.against(name, [*c.sides, c.near], front=0.8)
    for k in range(3):
        c.against("mannequin_blue" if k % 2 else "mannequin", c.walls, front=0.4)
    kinds = ("clothes_rack", "display_table", "jewel_case", "gadget_table")
    first = int(c.chance.integers(4))
    x, y = c.size[0] / 2, c.size[1] / 2
    for k, box in enumerate(((-x, -y, 0.0, 0.0), (0.0, -y, x, 0.0), (-x, 0.0, 0.0, y), (0.0, 0.0, x, y))):
        c.fill([(kinds[(first + k) % 4], 0, 0, 0)], (2.3, 2.6), aisle=0.85, inset=1.5, box=box, most=5)
    plants(c, 2)


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
