"""Furnishing a room by its kind: by the steps of the kind's entry in ``data/worldgen/indoor``, or composed in Python.

What a list of steps can't say, since it follows from the room's shape, is one function a kind; an entry of
``data/worldgen/indoor`` names one of these as ``composed``.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from vico.assets.models.library import furniture_models
from vico.worldgen.indoor import records
from vico.worldgen.indoor.furnishing import STEP_IN, Member, RoomDraft
from vico.worldgen.indoor.records import RowsStep

Spot = tuple[int, float]  # a wall, and where along it


@dataclass(frozen=True)
class NamedPieces:
    """Names that steps may use: sets of pieces that stand together, and pieces of which chance picks one."""

    sets: Mapping[str, tuple[Member, ...]]
    choices: Mapping[str, tuple[str, ...]]

    def members(self, named: str | Sequence[Member]) -> tuple[Member, ...]:
        """Return the pieces of a set; a piece alone stands in its middle."""
        if not isinstance(named, str):
            return tuple(named)
        return self.sets.get(named) or ((named, 0.0, 0.0, 0.0),)

    def pieces(self, named: records.Pieces, times: int | None, room: RoomDraft) -> Iterator[str]:
        """Yield the pieces that a step wants, in turn; chance picks from choices when their turn comes."""
        several = (named,) if isinstance(named, str) else named
        for name in itertools.islice(itertools.cycle(several), times or len(several)):
            if name.startswith("@"):
                among = self.choices[name[1:]]
                yield among[int(room.chance.integers(len(among)))]
            else:
                yield name


def furnish_room(room: RoomDraft, steps: Sequence[records.Step], names: NamedPieces, spot: Spot | None = None) -> None:
    """Furnish a room by steps.

    Parameters
    ----------
    spot
        Where the step before stood, for walls called ``same`` and ``opposite``.
    """
    for step in steps:
        if isinstance(step, records.StandStep):
            for one in names.pieces(step.stand, step.times, room):
                along: str | float = step.along
                if step.along == "same":
                    along = "any" if spot is None else spot[1]
                found = room.against(
                    one,
                    _walls(room, step.walls, spot),
                    along=along,
                    front=step.front,
                    gap=step.gap,
                    extra=step.beside,
                    width=step.width,
                )
                furnish_room(room, step.then if found else step.else_, names, found or spot)
        elif isinstance(step, records.PutStep):
            after = step.then if _put(room, step, names) else step.else_
            furnish_room(room, after, names, spot)
        elif isinstance(step, records.IfStep):
            furnish_room(room, step.then if _is_so(room, step.if_) else step.else_, names, spot)
        elif isinstance(step, records.FillStep):
            turn = room.far % 2 if step.turn == "way_in" else step.turn
            members = names.members(step.fill)
            room.fill(members, step.pitch, most=step.most, aisle=step.aisle, turn=turn, inset=step.inset)
        elif isinstance(step, records.RowsStep):
            rows(room, step)
        elif isinstance(step, records.LineStep):
            for side in _walls(room, step.walls, spot) or ():
                room.row(step.line, side, most=step.most, front=step.front, pitch=step.pitch)
        elif isinstance(step, records.HangStep):
            for piece in names.pieces(step.hang, step.times, room):
                room.hang(piece, _walls(room, step.walls, spot), at=step.at)
        else:
            if step.at == "door":
                room.lay(step.lay, *room.doors[0].point(room.size, STEP_IN), turn=room.doors[0].side)
            else:
                for x, y in step.at:
                    room.lay(step.lay, x + step.shares[0] * room.size[0], y + step.shares[1] * room.size[1], step.turn)


def _walls(room: RoomDraft, names: Sequence[records.WallName], spot: Spot | None) -> list[int] | None:
    """Return the numbers of walls, None for any."""
    found: list[int] = []
    for name in names:
        if name == "far":
            found.append(room.far)
        elif name == "near":
            found.append(room.near)
        elif name in ("same", "opposite"):
            found += [] if spot is None else [spot[0] if name == "same" else (spot[0] + 2) % 4]
        else:
            found += room.sides if name == "sides" else room.walls
    return found or None


def _put(room: RoomDraft, step: records.PutStep, names: NamedPieces) -> bool:
    """Put a set where the step says; whether it found room anywhere."""
    members = names.members(step.put)
    done = False
    for x, y in step.at:
        if step.turns == "chance":
            turns: Sequence[int] = (int(room.chance.integers(2)),)
        elif step.turns == "long_side":
            turns = (0, 1) if room.size[1] >= room.size[0] else (1, 0)
        else:
            turns = step.turns
        done |= any(room.put(members, x, y, turn, aisle=step.aisle) for turn in turns)
        if done and not step.everywhere:
            break
    return done


def _is_so(room: RoomDraft, wanted: records.RoomSize) -> bool:
    sizes = (
        (wanted.area, room.size[0] * room.size[1]),
        (wanted.long_side, max(room.size)),
        (wanted.short_side, min(room.size)),
    )
    if any(least is not None and size <= least for least, size in sizes):
        return False
    return wanted.chance is None or bool(room.chance.random() < wanted.chance)


def rows(room: RoomDraft, step: records.RowsStep) -> None:
    """Put rows across the room that look at the far wall, with an aisle in the middle."""
    turn = room.far
    along = room.size[0] if turn in (0, 2) else room.size[1]
    across = room.size[1] if turn in (0, 2) else room.size[0]
    seat: Member = (step.rows, 0.0, 0.0, 0.0)
    members = (seat,) if step.beside is None else (seat, step.beside)
    wide = furniture_models()[step.rows].size[1]
    count = 0
    sign = 1.0 if turn in (0, 1) else -1.0
    each = max(1, int((across / 2 - step.aisle / 2 - 0.8) / (wide + 0.02)))
    k = 0
    while count < step.most and -along / 2 + step.back + k * step.pitch < along / 2 - step.front:
        s = sign * (-along / 2 + step.back + k * step.pitch)
        for j in range(each):
            for side in (-1, 1):
                offset = side * (step.aisle / 2 + wide / 2 + j * (wide + 0.02))
                x, y = (s, offset) if turn in (0, 2) else (offset, s)
                if room.put(members, x, y, turn):
                    count += 1
        k += 1


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
