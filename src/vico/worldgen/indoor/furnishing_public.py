"""What stands in offices, schools, clinics, churches, cinemas, gyms, museums, stations, workshops, garages."""

from __future__ import annotations

from vico.assets.models.furniture import furniture_models
from vico.worldgen.indoor.furnishing import Member, RoomDraft
from vico.worldgen.indoor.furnishing_rooms import bar, pictures, plants

_WORKPLACES: tuple[Member, ...] = (
    ("desk", 0.4, 0, 0),
    ("desk", -0.4, 0, 180),
    ("office_chair", 1.1, 0, 180),
    ("office_chair", -1.1, 0, 0),
)
_DESK: tuple[Member, ...] = (("school_desk", 0, 0, 0), ("chair", -0.55, 0.3, 0), ("chair", -0.55, -0.3, 0))


def _rows(
    room: RoomDraft,
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
    turn = room.far
    along = room.size[0] if turn in (0, 2) else room.size[1]
    across = room.size[1] if turn in (0, 2) else room.size[0]
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
                if room.put(members, x, y, turn):
                    count += 1
        k += 1


def _reception(room: RoomDraft) -> None:
    room.against("reception_desk", [room.far, *room.sides], along="middle", front=1.0, gap=0.9)
    room.against("waiting_bench", front=0.5)
    room.against("sofa", front=0.4)
    room.against("water_cooler", front=0.4)
    plants(room, 2)
    pictures(room, 2)


def _open_office(room: RoomDraft) -> None:
    room.fill(_WORKPLACES, (3.4, 1.75), aisle=0.0, inset=1.4)
    for name in ("cupboard", "filing_cabinet", "photocopier", "bookcase"):
        room.against(name, front=0.6)
    room.hang("whiteboard", room.walls)
    plants(room, 2)


def _office(room: RoomDraft) -> None:
    room.against("desk", [room.far, *room.sides], front=0.3, extra=[("office_chair", 0.72, 0.0, 180.0)])
    room.against("desk", front=0.3, extra=[("office_chair", 0.72, 0.0, 180.0)])
    for name in ("filing_cabinet", "bookcase", "cupboard"):
        room.against(name, front=0.5)
    plants(room)
    pictures(room, 1)


def _meeting_room(room: RoomDraft) -> None:
    chairs: list[Member] = [
        ("office_chair", sx * 0.95, y, 180.0 if sx > 0 else 0.0) for sx in (-1, 1) for y in (-1.0, 0.0, 1.0)
    ]
    for turn in (0, 1) if room.size[1] >= room.size[0] else (1, 0):
        if room.put([("conference_table", 0, 0, 0), *chairs], 0.0, 0.0, turn, aisle=0.3):
            break
    else:
        room.put(
            [
                ("work_table", 0, 0, 0),
                *(("chair", sx * 0.72, y, 180.0 if sx > 0 else 0.0) for sx in (-1, 1) for y in (-0.5, 0.5)),
            ],
            0.0,
            0.0,
        )
    room.hang("whiteboard", [room.far, *room.walls])
    room.against("cupboard", front=0.4)
    plants(room)


def _break_room(room: RoomDraft) -> None:
    room.against("kitchen", [room.far, *room.sides], along="corner", front=0.8)
    room.against("fridge", along="corner", front=0.5)
    room.fill(
        (("cafe_table", 0, 0, 0), ("chair", -0.62, 0, 0), ("chair", 0.62, 0, 180)),
        (2.0, 1.6),
        aisle=0.5,
        inset=1.0,
        most=3,
    )
    room.against("vending_machine", front=0.6)


def _classroom(room: RoomDraft) -> None:
    room.hang("blackboard", room.far)
    turn = room.far
    sign = 1.0 if turn in (0, 1) else -1.0
    deep = (room.size[0] if turn in (0, 2) else room.size[1]) / 2
    x, y = (sign * (deep - 1.1), 1.6) if turn in (0, 2) else (1.6, sign * (deep - 1.1))
    room.put([("desk", 0, 0, 0), ("office_chair", 0.72, 0, 180)], x, y, turn + 2)
    _rows(room, "school_desk", 1.45, back=1.6, front=2.4, aisle=0.9, member=("chair", -0.55, 0.0, 0))
    room.against("bookcase", [*room.sides, room.near], front=0.4)
    room.against("cupboard", [*room.sides, room.near], front=0.4)
    room.hang("painting", room.sides)


def _laboratory(room: RoomDraft) -> None:
    room.hang("whiteboard", room.far)
    room.fill(
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
        room.against(name, front=0.5)


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
    plants(room, 2)


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


def _ward(room: RoomDraft) -> None:
    for k in range(4):
        room.against(
            "hospital_bed",
            [*room.sides, room.far],
            along="corner" if not k else "any",
            front=0.5,
            width=1.9,
            extra=[("bedside_table", -0.78, 0.74, 0.0)],
        )
    room.against("sink", front=0.5)
    room.against("medical_cabinet", front=0.5)
    room.against("chair", front=0.3)


def _consulting_room(room: RoomDraft) -> None:
    room.against("desk", [*room.sides, room.far], front=0.3, extra=[("office_chair", 0.72, 0.0, 180.0)])
    room.against("exam_couch", along="corner", front=0.5)
    room.against("medical_cabinet", front=0.5)
    room.against("washstand", front=0.5)
    room.against("chair", front=0.3)
    pictures(room, 1)


def _waiting_room(room: RoomDraft) -> None:
    room.against("reception_desk", [room.far, *room.sides], along="middle", front=1.0, gap=0.9)
    for _ in range(4):
        room.against("waiting_bench", front=0.6)
    room.against("water_cooler", front=0.4)
    plants(room, 2)
    pictures(room, 2)


def _foyer(room: RoomDraft) -> None:
    room.against("counter", [*room.sides, room.far], along="middle", front=1.0, gap=0.8)
    room.against("reception_desk", [*room.sides, room.far], front=1.0, gap=0.8)
    room.against("vending_machine", front=0.6)
    room.against("sofa", front=0.4)
    for _ in range(2):
        room.put([("rope_barrier", 0, 0, 0)], 0.9 if room.chance.random() < 0.5 else -0.9, 0.0, aisle=0.7)
    pictures(room, 4)
    plants(room, 2)


def auditorium(room: RoomDraft) -> None:
    """Furnish a cinema: rows of seats before a screen."""
    room.hang("cinema_screen", room.far, at=0.0)
    _rows(room, "cinema_seats", 1.15, back=1.9, front=2.6, aisle=1.2)
    _rows(room, "cinema_seats_pair", 1.15, back=1.9, front=2.6, aisle=1.2)


def _theatre(room: RoomDraft) -> None:
    room.against("stage_large", room.far, along="middle", front=1.0, gap=0.02)
    _rows(room, "cinema_seats", 1.15, back=1.9, front=4.6, aisle=1.2)
    _rows(room, "cinema_seats_pair", 1.15, back=1.9, front=4.6, aisle=1.2)


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
    _rows(room, "pew", 1.05, back=2.2, front=4.6, aisle=1.4)
    x, y = (1.5, 0.0) if turn in (0, 2) else (0.0, 1.5)
    for k in range(-2, 3):
        room.lay("runner", x * k * 2, y * k * 2, turn + 1)
    for side in room.sides:
        for k in range(-3, 4):
            room.hang("stained_glass", side, at=k * min(3.2, along / 6.5))
    room.against("organ", [*room.sides, room.near], along="corner", front=0.8)


def _narthex(room: RoomDraft) -> None:
    room.against("pew", front=0.4)
    room.against("side_table", front=0.3)
    room.against("pot_plant", along="corner", front=0.0)
    pictures(room, 2)


def _sacristy(room: RoomDraft) -> None:
    room.against("wardrobe", front=0.5)
    room.against("desk", front=0.3, extra=[("office_chair", 0.72, 0.0, 180.0)])
    room.against("cupboard", front=0.5)


def _gym(room: RoomDraft) -> None:
    room.hang("mirror_wall", [*room.sides, room.far])
    room.hang("mirror_wall", [*room.sides, room.far])
    for _ in range(4):
        room.against("treadmill", [room.far, *room.sides], front=0.6)
    for _ in range(3):
        room.against("exercise_bike", front=0.6)
    room.against("dumbbell_rack", front=0.8)
    room.fill([("bench_press", 0, 0, 0)], (2.6, 2.2), aisle=0.8, inset=1.5, most=6)
    room.fill([("exercise_bike", 0, 0, 90)], (1.7, 2.1), aisle=0.7, inset=2.0, most=6)
    for k in range(2):
        room.lay("yoga_mat", -room.size[0] / 4 + 1.0 * k, -room.size[1] / 4, 1)


def _sports_hall(room: RoomDraft) -> None:
    room.hang("mirror_wall", [room.far, *room.sides])
    room.hang("mirror_wall", [room.far, *room.sides])
    for i in range(-2, 3):
        for j in range(-1, 2):
            room.lay("yoga_mat", i * 1.5, j * 2.2, 1)
    room.against("waiting_bench", front=0.4)
    room.against("waiting_bench", front=0.4)
    room.against("lockers", front=0.6)


def _changing_room(room: RoomDraft) -> None:
    for _ in range(4):
        room.against("lockers", front=0.7)
    room.against("shower", along="corner", front=0.5)
    room.put([("waiting_bench", 0, 0, 0)], 0.0, 0.0, 0, aisle=0.6)


def _club(room: RoomDraft) -> None:
    room.against("dj_booth", [room.far, *room.sides], along="middle", front=1.5)
    bar(room)
    for _ in range(3):
        room.against("sofa_teal", front=0.4)


def _games(room: RoomDraft) -> None:
    for side in room.sides:
        room.row("slot_machine", side, most=5, front=0.7, pitch=0.8)
    room.put([("pool_table", 0, 0, 0)], 0.0, 0.0, 0, aisle=0.9)
    room.against(
        "bar_counter",
        [room.far, *room.sides],
        front=0.5,
        gap=1.2,
        extra=[("bar_stool", 0.62, y, 180.0) for y in (-0.8, 0.0, 0.8)],
    )
    room.against("sofa", front=0.4)
    plants(room)


def _lounge(room: RoomDraft) -> None:
    room.against("counter", [*room.sides, room.far], front=0.8, gap=0.7)
    for _ in range(2):
        room.against("sofa", front=0.4, extra=[("coffee_table", 0.95, 0.0, 0.0)])
    room.fill(
        (("cafe_table", 0, 0, 0), ("chair", -0.62, 0, 0), ("chair", 0.62, 0, 180)),
        (2.2, 1.8),
        aisle=0.6,
        inset=1.0,
        most=5,
    )
    room.against("bookcase", front=0.4)
    plants(room, 2)
    pictures(room, 3)


def _community_hall(room: RoomDraft) -> None:
    room.against("stage", room.far, along="middle", front=1.0)
    _rows(room, "chair", 0.95, back=1.8, front=2.9, aisle=1.0, most=40)
    room.against("cupboard", [*room.sides, room.near], front=0.5)
    plants(room, 2)


def _bank_hall(room: RoomDraft) -> None:
    for _ in range(2):
        room.against("reception_desk", [room.far, *room.sides], along="middle", front=1.0, gap=0.9)
    room.against("cash_machine", [room.near, *room.sides], along="door", front=0.7)
    room.against("cash_machine", [room.near, *room.sides], along="door", front=0.7)
    for k in (-1, 1):
        room.put([("rope_barrier", 0, 0, 0)], 0.9 * k, 0.0, 0, aisle=0.7)
    room.against("waiting_bench", front=0.5)
    room.against("sofa", front=0.4)
    plants(room, 2)
    pictures(room, 2)


def _council_room(room: RoomDraft) -> None:
    room.against("flag_stand", room.far, along="corner", front=0.0)
    room.against("desk", room.far, along="middle", front=0.6, gap=0.9)
    _rows(room, "waiting_bench", 1.3, back=1.8, front=3.4, aisle=1.2)
    room.hang("painting_coast", [room.far, *room.walls])
    room.against("cupboard", front=0.4)


def cell(room: RoomDraft) -> None:
    """Furnish a holding room of a police station."""
    room.against("bed_single", along="corner", front=0.5)
    room.against("toilet", along="corner", front=0.4)
    room.against("sink", front=0.4)


def _station_hall(room: RoomDraft) -> None:
    for _ in range(3):
        room.against("ticket_machine", [*room.sides, room.near], front=0.9)
    room.against("newsstand", front=0.6)
    room.against("vending_machine", front=0.6)
    room.hang("departures_board", [room.far, *room.walls])
    room.hang("departures_board", [*room.walls])
    room.fill([("turnstile", 0, 0, 90 if room.far in (1, 3) else 0)], (1.6, 6.0), aisle=0.7, inset=3.0, most=4)
    room.fill([("waiting_bench", 0.3, 0, 0), ("waiting_bench", -0.3, 0, 180)], (3.2, 3.4), aisle=0.9, inset=1.6, most=6)
    room.against("reception_desk", [room.far, *room.sides], front=0.9, gap=0.9)


def _workshop(room: RoomDraft) -> None:
    for _ in range(3):
        room.against("workbench", [*room.sides, room.far], front=0.8)
    room.against("tool_cabinet", front=0.6)
    room.against("pallet_rack", front=0.8)
    room.against("pallet_rack", front=0.8)
    room.fill([("machine_tool", 0, 0, 0)], (3.2, 3.2), aisle=1.0, inset=2.0, most=4)
    room.fill([("pallet", 0, 0, 0)], (2.6, 2.6), aisle=0.9, inset=1.4, most=3)


def parking(room: RoomDraft) -> None:
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


def stairs(room: RoomDraft) -> None:
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
