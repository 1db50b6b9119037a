"""Furnishing a room by the steps of its kind's entry in ``data/indoor``."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from vico.assets.models.library import furniture_models
from vico.worldgen.indoor import records
from vico.worldgen.indoor.furnishing import STEP_IN, Member, RoomDraft

Spot = tuple[int, float]  # a wall, and where along it


@dataclass(frozen=True)
class NamedPieces:
    """What steps may name: sets of pieces that stand together, and pieces of which chance picks one."""

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
            _stand(room, step, names, spot)
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
            _lay(room, step)


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


def _stand(room: RoomDraft, step: records.StandStep, names: NamedPieces, spot: Spot | None) -> None:
    for piece in names.pieces(step.stand, step.times, room):
        along: str | float = step.along
        if step.along == "same":
            along = "any" if spot is None else spot[1]
        found = room.against(
            piece,
            _walls(room, step.walls, spot),
            along=along,
            front=step.front,
            gap=step.gap,
            extra=step.beside,
            width=step.width,
        )
        furnish_room(room, step.then if found else step.else_, names, found or spot)


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


def _lay(room: RoomDraft, step: records.LayStep) -> None:
    if step.at == "door":
        room.lay(step.lay, *room.doors[0].point(room.size, STEP_IN), turn=room.doors[0].side)
        return
    for x, y in step.at:
        room.lay(step.lay, x + step.shares[0] * room.size[0], y + step.shares[1] * room.size[1], step.turn)


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
