"""What stands in offices, schools, clinics, churches, cinemas, gyms, museums, stations, workshops, garages."""

from __future__ import annotations

from vico.assets.furniture import furniture_models
from vico.worldgen.indoor.furnishing import Canvas, Member
from vico.worldgen.indoor.furnishing_rooms import bar, pictures, plants

_WORKPLACES: tuple[Member, ...] = (
    ("desk", 0.4, 0, 0),
    ("desk", -0.4, 0, 180),
    ("office_chair", 1.1, 0, 180),
    ("office_chair", -1.1, 0, 0),
)
_DESK: tuple[Member, ...] = (("school_desk", 0, 0, 0), ("chair", -0.55, 0.3, 0), ("chair", -0.55, -0.3, 0))


def _rows(
    c: Canvas,
    name: str,
    pitch: float,
    *,
    back: float,
    front: float,
    aisle: float,
    most: int = 99,
    member: Member | None = None,
) -> None:
    """Rows across the room that look at the far wall, with an aisle in the middle."""
    turn = c.far
    along = c.size[0] if turn in (0, 2) else c.size[1]
    across = c.size[1] if turn in (0, 2) else c.size[0]
    members: tuple[Member, ...] = ((name, 0, 0, 0),) if member is None else ((name, 0, 0, 0), member)
    wide = furniture_models()[name].size[1]
    count = 0
    sign = 1.0 if turn in (0, 1) else -1.0
    each = max(1, int((across / 2 - aisle / 2 - 0.8) / (wide + 0.02)))
    k = 0
    while count < most and -along / 2 + back + k * pitch < along / 2 - front:
        s = sign * (-along / 2 + back + k * pitch)
        for j in range(each):
            for side in (-1, 1):
                offset = side * (aisle / 2 + wide / 2 + j * (wide + 0.02))
                x, y = (s, offset) if turn in (0, 2) else (offset, s)
                if c.put(members, x, y, turn):
                    count += 1
        k += 1


def _reception(c: Canvas) -> None:
    c.against("reception_desk", [c.far, *c.sides], along="middle", front=1.0, gap=0.9)
    c.against("waiting_bench", front=0.5)
    c.against("sofa", front=0.4)
    c.against("water_cooler", front=0.4)
    plants(c, 2)
    pictures(c, 2)


def _open_office(c: Canvas) -> None:
    c.fill(_WORKPLACES, (3.4, 1.75), aisle=0.0, inset=1.4)
    for name in ("cupboard", "filing_cabinet", "photocopier", "bookcase"):
        c.against(name, front=0.6)
    c.hang("whiteboard", c.walls)
    plants(c, 2)


def _office(c: Canvas) -> None:
    c.against("desk", [c.far, *c.sides], front=0.3, extra=[("office_chair", 0.72, 0.0, 180.0)])
    c.against("desk", front=0.3, extra=[("office_chair", 0.72, 0.0, 180.0)])
    for name in ("filing_cabinet", "bookcase", "cupboard"):
        c.against(name, front=0.5)
    plants(c)
    pictures(c, 1)


def _meeting_room(c: Canvas) -> None:
    chairs: list[Member] = [
        ("office_chair", sx * 0.95, y, 180.0 if sx > 0 else 0.0) for sx in (-1, 1) for y in (-1.0, 0.0, 1.0)
    ]
    for turn in (0, 1) if c.size[1] >= c.size[0] else (1, 0):
        if c.put([("conference_table", 0, 0, 0), *chairs], 0.0, 0.0, turn, aisle=0.3):
            break
    else:
        c.put(
            [
                ("work_table", 0, 0, 0),
                *(("chair", sx * 0.72, y, 180.0 if sx > 0 else 0.0) for sx in (-1, 1) for y in (-0.5, 0.5)),
            ],
            0.0,
            0.0,
        )
    c.hang("whiteboard", [c.far, *c.walls])
    c.against("cupboard", front=0.4)
    plants(c)


def _break_room(c: Canvas) -> None:
    c.against("kitchen", [c.far, *c.sides], along="corner", front=0.8)
    c.against("fridge", along="corner", front=0.5)
    c.fill(
        (("cafe_table", 0, 0, 0), ("chair", -0.62, 0, 0), ("chair", 0.62, 0, 180)),
        (2.0, 1.6),
        aisle=0.5,
        inset=1.0,
        most=3,
    )
    c.against("vending_machine", front=0.6)


def _classroom(c: Canvas) -> None:
    c.hang("blackboard", c.far)
    turn = c.far
    sign = 1.0 if turn in (0, 1) else -1.0
    deep = (c.size[0] if turn in (0, 2) else c.size[1]) / 2
    x, y = (sign * (deep - 1.1), 1.6) if turn in (0, 2) else (1.6, sign * (deep - 1.1))
    c.put([("desk", 0, 0, 0), ("office_chair", 0.72, 0, 180)], x, y, turn + 2)
    _rows(c, "school_desk", 1.45, back=1.6, front=2.4, aisle=0.9, member=("chair", -0.55, 0.0, 0))
    c.against("bookcase", [*c.sides, c.near], front=0.4)
    c.against("cupboard", [*c.sides, c.near], front=0.4)
    c.hang("painting", c.sides)


def _laboratory(c: Canvas) -> None:
    c.hang("whiteboard", c.far)
    c.fill(
        (
            ("work_table", 0, 0, 0),
            ("stool", 0.75, 0.4, 180),
            ("stool", 0.75, -0.4, 180),
            ("stool", -0.75, 0.4, 0),
            ("stool", -0.75, -0.4, 0),
        ),
        (2.8, 3.0),
        aisle=0.7,
        inset=1.6,
    )
    for name in ("medical_cabinet", "steel_sink", "cupboard", "medical_cabinet"):
        c.against(name, front=0.5)


def _library(c: Canvas) -> None:
    c.against("reception_desk", [*c.sides, c.near], along="door", front=0.9, gap=0.9)
    for _ in range(5):
        c.against("bookcase", [c.far, *c.sides], front=0.6)
    x, y = c.size[0] / 2, c.size[1] / 2
    c.fill([("double_bookcase", 0, 0, 0)], (1.6, 2.06), aisle=0.01, inset=1.6, box=(-x, -0.5, x, y), most=14)
    reading: list[Member] = [
        ("work_table", 0, 0, 0),
        *(("chair", sx * 0.72, yy, 180.0 if sx > 0 else 0.0) for sx in (-1, 1) for yy in (-0.5, 0.5)),
    ]
    c.fill(reading, (3.0, 3.0), aisle=0.75, inset=1.5, most=4)
    c.against("armchair", along="corner", front=0.4)
    plants(c, 2)


def _gallery(c: Canvas) -> None:
    names = ("painting_coast", "painting_still", "painting_bold")
    first = int(c.chance.integers(3))
    for k in range(8):
        c.hang(names[(first + k) % 3], [k % 4, *c.walls])
    things = (("sculpture", 0, 0, 0), ("display_case", 0, 0, 0), ("plinth", 0, 0, 0))
    long_side = c.size[0] >= c.size[1]
    for k in (-1, 0, 1):
        a = k * max(c.size) * 0.28
        thing = ("pew", 0, 0, 0) if k == 0 else things[(first + k) % 3]
        c.put([thing], *((a, 0.0) if long_side else (0.0, a)), int(c.chance.integers(4)), aisle=0.8)
    c.fill([things[first]], (3.4, 3.4), aisle=1.1, inset=1.5, most=3)


def _ward(c: Canvas) -> None:
    for k in range(4):
        c.against(
            "hospital_bed",
            [*c.sides, c.far],
            along="corner" if not k else "any",
            front=0.5,
            width=1.9,
            extra=[("bedside_table", -0.78, 0.74, 0.0)],
        )
    c.against("sink", front=0.5)
    c.against("medical_cabinet", front=0.5)
    c.against("chair", front=0.3)


def _consulting_room(c: Canvas) -> None:
    c.against("desk", [*c.sides, c.far], front=0.3, extra=[("office_chair", 0.72, 0.0, 180.0)])
    c.against("exam_couch", along="corner", front=0.5)
    c.against("medical_cabinet", front=0.5)
    c.against("washstand", front=0.5)
    c.against("chair", front=0.3)
    pictures(c, 1)


def _waiting_room(c: Canvas) -> None:
    c.against("reception_desk", [c.far, *c.sides], along="middle", front=1.0, gap=0.9)
    for _ in range(4):
        c.against("waiting_bench", front=0.6)
    c.against("water_cooler", front=0.4)
    plants(c, 2)
    pictures(c, 2)


def _foyer(c: Canvas) -> None:
    c.against("counter", [*c.sides, c.far], along="middle", front=1.0, gap=0.8)
    c.against("reception_desk", [*c.sides, c.far], front=1.0, gap=0.8)
    c.against("vending_machine", front=0.6)
    c.against("sofa", front=0.4)
    for _ in range(2):
        c.put([("rope_barrier", 0, 0, 0)], 0.9 if c.chance.random() < 0.5 else -0.9, 0.0, aisle=0.7)
    pictures(c, 4)
    plants(c, 2)


def auditorium(c: Canvas) -> None:
    """A cinema: rows of seats before a screen."""
    c.hang("cinema_screen", c.far, at=0.0)
    _rows(c, "cinema_seats", 1.15, back=1.9, front=2.6, aisle=1.2)
    _rows(c, "cinema_seats_pair", 1.15, back=1.9, front=2.6, aisle=1.2)


def _theatre(c: Canvas) -> None:
    c.against("stage_large", c.far, along="middle", front=1.0, gap=0.02)
    _rows(c, "cinema_seats", 1.15, back=1.9, front=4.6, aisle=1.2)
    _rows(c, "cinema_seats_pair", 1.15, back=1.9, front=4.6, aisle=1.2)


def _nave(c: Canvas) -> None:
    c.against("altar", c.far, along="middle", front=1.2, gap=0.6)
    c.hang("wall_cross", c.far, at=0.0)
    c.against("pulpit", c.far, along="corner", front=0.5, gap=1.4)
    c.against("font", c.far, along="corner", front=0.5, gap=1.4)
    turn = c.far
    along = c.size[0] if turn in (0, 2) else c.size[1]
    across = c.size[1] if turn in (0, 2) else c.size[0]
    if across > 10:
        for k in range(int((along - 6) / 3.5)):
            s = -along / 2 + 3.0 + 3.5 * k
            for side in (-1, 1):
                o = side * (across / 2 - 1.5)
                c.put([("column", 0, 0, 0)], *((s, o) if turn in (0, 2) else (o, s)), 0)
    _rows(c, "pew", 1.05, back=2.2, front=4.6, aisle=1.4)
    x, y = (1.5, 0.0) if turn in (0, 2) else (0.0, 1.5)
    for k in range(-2, 3):
        c.lay("runner", x * k * 2, y * k * 2, turn + 1)
    for side in c.sides:
        for k in range(-3, 4):
            c.hang("stained_glass", side, at=k * min(3.2, along / 6.5))
    c.against("organ", [*c.sides, c.near], along="corner", front=0.8)


def _narthex(c: Canvas) -> None:
    c.against("pew", front=0.4)
    c.against("side_table", front=0.3)
    c.against("pot_plant", along="corner", front=0.0)
    pictures(c, 2)


def _sacristy(c: Canvas) -> None:
    c.against("wardrobe", front=0.5)
    c.against("desk", front=0.3, extra=[("office_chair", 0.72, 0.0, 180.0)])
    c.against("cupboard", front=0.5)


def _gym(c: Canvas) -> None:
    c.hang("mirror_wall", [*c.sides, c.far])
    c.hang("mirror_wall", [*c.sides, c.far])
    for _ in range(4):
        c.against("treadmill", [c.far, *c.sides], front=0.6)
    for _ in range(3):
        c.against("exercise_bike", front=0.6)
    c.against("dumbbell_rack", front=0.8)
    c.fill([("bench_press", 0, 0, 0)], (2.6, 2.2), aisle=0.8, inset=1.5, most=6)
    c.fill([("exercise_bike", 0, 0, 90)], (1.7, 2.1), aisle=0.7, inset=2.0, most=6)
    for k in range(2):
        c.lay("yoga_mat", -c.size[0] / 4 + 1.0 * k, -c.size[1] / 4, 1)


def _sports_hall(c: Canvas) -> None:
    c.hang("mirror_wall", [c.far, *c.sides])
    c.hang("mirror_wall", [c.far, *c.sides])
    for i in range(-2, 3):
        for j in range(-1, 2):
            c.lay("yoga_mat", i * 1.5, j * 2.2, 1)
    c.against("waiting_bench", front=0.4)
    c.against("waiting_bench", front=0.4)
    c.against("lockers", front=0.6)


def _changing_room(c: Canvas) -> None:
    for _ in range(4):
        c.against("lockers", front=0.7)
    c.against("shower", along="corner", front=0.5)
    c.put([("waiting_bench", 0, 0, 0)], 0.0, 0.0, 0, aisle=0.6)


def _club(c: Canvas) -> None:
    c.against("dj_booth", [c.far, *c.sides], along="middle", front=1.5)
    bar(c)
    for _ in range(3):
        c.against("sofa_teal", front=0.4)


def _games(c: Canvas) -> None:
    for side in c.sides:
        c.row("slot_machine", side, most=5, front=0.7, pitch=0.8)
    c.put([("pool_table", 0, 0, 0)], 0.0, 0.0, 0, aisle=0.9)
    c.against(
        "bar_counter",
        [c.far, *c.sides],
        front=0.5,
        gap=1.2,
        extra=[("bar_stool", 0.62, y, 180.0) for y in (-0.8, 0.0, 0.8)],
    )
    c.against("sofa", front=0.4)
    plants(c)


def _lounge(c: Canvas) -> None:
    c.against("counter", [*c.sides, c.far], front=0.8, gap=0.7)
    for _ in range(2):
        c.against("sofa", front=0.4, extra=[("coffee_table", 0.95, 0.0, 0.0)])
    c.fill(
        (("cafe_table", 0, 0, 0), ("chair", -0.62, 0, 0), ("chair", 0.62, 0, 180)),
        (2.2, 1.8),
        aisle=0.6,
        inset=1.0,
        most=5,
    )
    c.against("bookcase", front=0.4)
    plants(c, 2)
    pictures(c, 3)


def _community_hall(c: Canvas) -> None:
    c.against("stage", c.far, along="middle", front=1.0)
    _rows(c, "chair", 0.95, back=1.8, front=2.9, aisle=1.0, most=40)
    c.against("cupboard", [*c.sides, c.near], front=0.5)
    plants(c, 2)


def _bank_hall(c: Canvas) -> None:
    for _ in range(2):
        c.against("reception_desk", [c.far, *c.sides], along="middle", front=1.0, gap=0.9)
    c.against("cash_machine", [c.near, *c.sides], along="door", front=0.7)
    c.against("cash_machine", [c.near, *c.sides], along="door", front=0.7)
    for k in (-1, 1):
        c.put([("rope_barrier", 0, 0, 0)], 0.9 * k, 0.0, 0, aisle=0.7)
    c.against("waiting_bench", front=0.5)
    c.against("sofa", front=0.4)
    plants(c, 2)
    pictures(c, 2)


def _council_room(c: Canvas) -> None:
    c.against("flag_stand", c.far, along="corner", front=0.0)
    c.against("desk", c.far, along="middle", front=0.6, gap=0.9)
    _rows(c, "waiting_bench", 1.3, back=1.8, front=3.4, aisle=1.2)
    c.hang("painting_coast", [c.far, *c.walls])
    c.against("cupboard", front=0.4)


def cell(c: Canvas) -> None:
    """A holding room of a police station."""
    c.against("bed_single", along="corner", front=0.5)
    c.against("toilet", along="corner", front=0.4)
    c.against("sink", front=0.4)


def _station_hall(c: Canvas) -> None:
    for _ in range(3):
        c.against("ticket_machine", [*c.sides, c.near], front=0.9)
    c.against("newsstand", front=0.6)
    c.against("vending_machine", front=0.6)
    c.hang("departures_board", [c.far, *c.walls])
    c.hang("departures_board", [*c.walls])
    c.fill([("turnstile", 0, 0, 90 if c.far in (1, 3) else 0)], (1.6, 6.0), aisle=0.7, inset=3.0, most=4)
    c.fill([("waiting_bench", 0.3, 0, 0), ("waiting_bench", -0.3, 0, 180)], (3.2, 3.4), aisle=0.9, inset=1.6, most=6)
    c.against("reception_desk", [c.far, *c.sides], front=0.9, gap=0.9)


def _workshop(c: Canvas) -> None:
    for _ in range(3):
        c.against("workbench", [*c.sides, c.far], front=0.8)
    c.against("tool_cabinet", front=0.6)
    c.against("pallet_rack", front=0.8)
    c.against("pallet_rack", front=0.8)
    c.fill([("machine_tool", 0, 0, 0)], (3.2, 3.2), aisle=1.0, inset=2.0, most=4)
    c.fill([("pallet", 0, 0, 0)], (2.6, 2.6), aisle=0.9, inset=1.4, most=3)


def parking(c: Canvas) -> None:
    """Bays on both sides of a lane; a barrier hut by the way in."""
    turn = 0 if c.size[1] >= c.size[0] else 1
    long_side = max(c.size)
    short = min(c.size)
    names = ("car_red", "car_blue", "car_grey", "car_grey")
    count = int((long_side - 3.0) / 2.7)
    for k in range(count):
        s = -long_side / 2 + 2.4 + 2.7 * k
        for side in (-1, 1):
            if c.chance.random() < 0.3:
                continue
            o = side * (short / 2 - 2.5)
            name = names[int(c.chance.integers(4))]
            x, y = (o, s) if turn == 0 else (s, o)
            c.put([(name, 0, 0, 180.0 if side > 0 else 0.0)], x, y, turn, aisle=0.5)
    for k in range(1, count, 3):
        s = -long_side / 2 + 1.05 + 2.7 * k
        for side in (-1, 1):
            o = side * (short / 2 - 0.4)
            c.put([("pillar", 0, 0, 0)], *((o, s) if turn == 0 else (s, o)), 0)
    c.against("ticket_machine", [c.near, *c.sides], along="door", front=0.7)
    c.against("waiting_bench", front=0.5)


def stairs(c: Canvas) -> None:
    """Furnished by its plan."""


PUBLIC = {
    "reception": _reception,
    "open_office": _open_office,
    "office": _office,
    "meeting_room": _meeting_room,
    "break_room": _break_room,
    "classroom": _classroom,
    "laboratory": _laboratory,
    "library": _library,
    "gallery": _gallery,
    "ward": _ward,
    "consulting_room": _consulting_room,
    "waiting_room": _waiting_room,
    "foyer": _foyer,
    "auditorium": auditorium,
    "theatre": _theatre,
    "nave": _nave,
    "narthex": _narthex,
    "sacristy": _sacristy,
    "gym": _gym,
    "sports_hall": _sports_hall,
    "changing_room": _changing_room,
    "club": _club,
    "games": _games,
    "lounge": _lounge,
    "community_hall": _community_hall,
    "bank_hall": _bank_hall,
    "council_room": _council_room,
    "cell": cell,
    "station_hall": _station_hall,
    "workshop": _workshop,
    "parking": parking,
    "stairs": stairs,
    "lift": stairs,
}
