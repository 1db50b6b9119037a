"""Rooms whose furniture follows from their shape, composed in Python: one function a kind.

What a list of steps can say is data (`recipes`); an entry of ``data/indoor`` names one of these as ``composed``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from vico.worldgen.indoor.furnishing import Member, RoomDraft
from vico.worldgen.indoor.recipes import rows
from vico.worldgen.indoor.records import RowsStep

Composition = Callable[[RoomDraft], None]


def _plants(room: RoomDraft, most: int) -> None:
    """Plants in the corners."""
    for _ in range(most):
        room.against("pot_plant", along="corner", front=0.0)


def _pictures(room: RoomDraft, most: int) -> None:
    """Pictures on the walls."""
    names = ("painting", "painting_tall", "painting_field")
    for _ in range(most):
        room.hang(names[int(room.chance.integers(3))])


_HOME_TABLE: tuple[Member, ...] = (
    ("kitchen_table", 0, 0, 0),
    ("chair", -0.66, 0.3, 0),
    ("chair", -0.66, -0.3, 0),
    ("chair", 0.66, 0.3, 180),
    ("chair", 0.66, -0.3, 180),
)


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
            if room.put(_HOME_TABLE, where[0], where[1], int(room.chance.integers(2)), aisle=0.45):
                break
        room.against("chest_of_drawers", front=0.5)
    _plants(room, 1)
    _pictures(room, 2)


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


def _sales_floor(room: RoomDraft) -> None:
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
    _plants(room, 2)


def _classroom(room: RoomDraft) -> None:
    room.hang("blackboard", room.far)
    turn = room.far
    sign = 1.0 if turn in (0, 1) else -1.0
    deep = (room.size[0] if turn in (0, 2) else room.size[1]) / 2
    x, y = (sign * (deep - 1.1), 1.6) if turn in (0, 2) else (1.6, sign * (deep - 1.1))
    room.put([("desk", 0, 0, 0), ("office_chair", 0.72, 0, 180)], x, y, turn + 2)
    rows(
        room,
        RowsStep(rows="school_desk", pitch=1.45, back=1.6, front=2.4, aisle=0.9, beside=("chair", -0.55, 0.0, 0.0)),
    )
    room.against("bookcase", [*room.sides, room.near], front=0.4)
    room.against("cupboard", [*room.sides, room.near], front=0.4)
    room.hang("painting", room.sides)


def _library(room: RoomDraft) -> None:
    room.against("reception_desk", [*room.sides, room.near], along="door", front=0.9, gap=0.9)
    for _ in range(5):
        room.against("bookcase", [room.far, *room.sides], front=0.6)
    x, y = room.size[0] / 2, room.size[1] / 2
    room.fill([("double_bookcase", 0, 0, 0)], (1.6, 2.06), aisle=0.01, inset=1.6, box=(-x, -0.5, x, y), most=14)
    reading: list[Member] = [
        ("work_table", 0, 0, 0),
        *(("chair", sx * 0.72, yy, 180.0 if sx > 0 else 0.0) for sx in (-1, 1) for yy in (-0.5, 0.5)),
    ]
    room.fill(reading, (3.0, 3.0), aisle=0.75, inset=1.5, most=4)
    room.against("armchair", along="corner", front=0.4)
    _plants(room, 2)


def _gallery(room: RoomDraft) -> None:
    names = ("painting_coast", "painting_still", "painting_bold")
    first = int(room.chance.integers(3))
    for k in range(8):
        room.hang(names[(first + k) % 3], [k % 4, *room.walls])
    things = (("sculpture", 0, 0, 0), ("display_case", 0, 0, 0), ("plinth", 0, 0, 0))
    long_side = room.size[0] >= room.size[1]
    for k in (-1, 0, 1):
        a = k * max(room.size) * 0.28
        thing = ("pew", 0, 0, 0) if k == 0 else things[(first + k) % 3]
        room.put([thing], *((a, 0.0) if long_side else (0.0, a)), int(room.chance.integers(4)), aisle=0.8)
    room.fill([things[first]], (3.4, 3.4), aisle=1.1, inset=1.5, most=3)


def _foyer(room: RoomDraft) -> None:
    room.against("counter", [*room.sides, room.far], along="middle", front=1.0, gap=0.8)
    room.against("reception_desk", [*room.sides, room.far], front=1.0, gap=0.8)
    room.against("vending_machine", front=0.6)
    room.against("sofa", front=0.4)
    for _ in range(2):
        room.put([("rope_barrier", 0, 0, 0)], 0.9 if room.chance.random() < 0.5 else -0.9, 0.0, aisle=0.7)
    _pictures(room, 4)
    _plants(room, 2)


def _nave(room: RoomDraft) -> None:
    room.against("altar", room.far, along="middle", front=1.2, gap=0.6)
    room.hang("wall_cross", room.far, at=0.0)
    room.against("pulpit", room.far, along="corner", front=0.5, gap=1.4)
    room.against("font", room.far, along="corner", front=0.5, gap=1.4)
    turn = room.far
    along = room.size[0] if turn in (0, 2) else room.size[1]
    across = room.size[1] if turn in (0, 2) else room.size[0]
    if across > 10:
        for k in range(int((along - 6) / 3.5)):
            s = -along / 2 + 3.0 + 3.5 * k
            for side in (-1, 1):
                o = side * (across / 2 - 1.5)
                room.put([("column", 0, 0, 0)], *((s, o) if turn in (0, 2) else (o, s)), 0)
    rows(room, RowsStep(rows="pew", pitch=1.05, back=2.2, front=4.6, aisle=1.4))
    x, y = (1.5, 0.0) if turn in (0, 2) else (0.0, 1.5)
    for k in range(-2, 3):
        room.lay("runner", x * k * 2, y * k * 2, turn + 1)
    for side in room.sides:
        for k in range(-3, 4):
            room.hang("stained_glass", side, at=k * min(3.2, along / 6.5))
    room.against("organ", [*room.sides, room.near], along="corner", front=0.8)


def _parking(room: RoomDraft) -> None:
    """Bays on both sides of a lane; a barrier hut by the way in."""
    turn = 0 if room.size[1] >= room.size[0] else 1
    long_side = max(room.size)
    short = min(room.size)
    names = ("car_red", "car_blue", "car_grey", "car_grey")
    count = int((long_side - 3.0) / 2.7)
    for k in range(count):
        s = -long_side / 2 + 2.4 + 2.7 * k
        for side in (-1, 1):
            if room.chance.random() < 0.3:
                continue
            o = side * (short / 2 - 2.5)
            name = names[int(room.chance.integers(4))]
            x, y = (o, s) if turn == 0 else (s, o)
            room.put([(name, 0, 0, 180.0 if side > 0 else 0.0)], x, y, turn, aisle=0.5)
    for k in range(1, count, 3):
        s = -long_side / 2 + 1.05 + 2.7 * k
        for side in (-1, 1):
            o = side * (short / 2 - 0.4)
            room.put([("pillar", 0, 0, 0)], *((o, s) if turn == 0 else (s, o)), 0)
    room.against("ticket_machine", [room.near, *room.sides], along="door", front=0.7)
    room.against("waiting_bench", front=0.5)


COMPOSITIONS: Mapping[str, Composition] = {
    "living_room": _living_room,
    "supermarket": _supermarket,
    "sales_floor": _sales_floor,
    "classroom": _classroom,
    "library": _library,
    "gallery": _gallery,
    "foyer": _foyer,
    "nave": _nave,
    "parking": _parking,
}
