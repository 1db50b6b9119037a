"""Kinds of rooms and uses of places: data of ``vico/data/worldgen/indoor`` and of a user's own, read once.

docs/adding_a_room.md describes the files, `records` their fields.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from vico.assets.models.library import furniture_models
from vico.assets.shapes import Colour
from vico.errors import SchemaError
from vico.io.data_files import DataRecord, cached_data, data_files, read_record
from vico.world.model import Category
from vico.worldgen.indoor.recipes import COMPOSITIONS, Composition, NamedPieces
from vico.worldgen.indoor.records import (
    DrawnPlan,
    EntryPlan,
    FillStep,
    FrontPlan,
    HangStep,
    LayStep,
    LineStep,
    PlaceUsesFile,
    PutStep,
    RoomEntry,
    RoomsFile,
    RowsStep,
    SpinePlan,
    StandStep,
    Step,
    Use,
)

ROOM = "worldgen/indoor"
GUIDE = "docs/adding_a_room.md"
#: Rooms that plans make themselves; they are not furnished.
UNFURNISHED = ("stairs", "lift")
#: Plans that are drawn in Python, see `floorplans`.
DRAWN = ("flat_small", "flat_medium", "flat_large", "maisonette", "galleries")


@dataclass(frozen=True)
class RoomKind:
    """A kind of room: how it looks, what lies on its tables, and how it is furnished.

    Attributes
    ----------
    tone
        Colour of the floor.
    palette
        Colours the walls may have.
    """

    entry: RoomEntry
    tone: Colour
    palette: tuple[Colour, ...]
    composition: Composition | None


@dataclass(frozen=True)
class RoomKinds:
    """All kinds of rooms by name, what steps may name, and small things by the piece they lie on."""

    kinds: Mapping[str, RoomKind]
    names: NamedPieces
    on: Mapping[str, tuple[str, ...]]
    plain: RoomKind

    def of(self, kind: str) -> RoomKind:
        """Return a kind of room; a plain one for what nobody described."""
        return self.kinds.get(kind, self.plain)


@dataclass(frozen=True)
class PlaceUses:
    """Uses by name, the use of a kind of place and of a category, and the kinds that are homes."""

    uses: Mapping[str, Use]
    by_kind: Mapping[str, str]
    by_category: Mapping[Category, str]
    home_kinds: frozenset[str]

    @property
    def homes(self) -> tuple[str, ...]:
        """Uses that are homes."""
        return tuple(name for name, use in self.uses.items() if use.home is not None)


@cached_data
def room_kinds() -> RoomKinds:
    """Return all kinds of rooms.

    Raises
    ------
    SchemaError
        If a file can't be used, or names a piece, a set, a colour or a composition that nobody made.
    """
    files = _read("rooms", RoomsFile)
    colours = {name: colour for _, file in files for name, colour in file.colours.items()}
    palettes = {name: palette for _, file in files for name, palette in file.palettes.items()}
    names = NamedPieces(
        sets={name: members for _, file in files for name, members in file.sets.items()},
        choices={name: pieces for _, file in files for name, pieces in file.choices.items()},
    )
    kinds: dict[str, RoomKind] = {}
    for path, file in files:
        _check_names(path, file)
        for kind, entry in file.room.items():
            where = f"{path}: room.{kind}"
            _check_steps(f"{where}.furniture", entry.furniture, names)
            _check_pieces(f"{where}.small", entry.small)
            kinds[kind] = _room_kind(where, entry, colours, palettes)
    on = {piece: small for _, file in files for piece, small in file.on.items()}
    plain = _room_kind("a plain room", RoomEntry(), colours, palettes)
    return RoomKinds(kinds, names, on, plain)


@cached_data
def uses() -> PlaceUses:
    """Return what floor plans are for.

    Raises
    ------
    SchemaError
        If a file can't be used, or names a kind of room, a plan or a use that there is none of.
    """
    files = _read("uses", PlaceUsesFile)
    found = {name: use for _, file in files for name, use in file.use.items()}
    for path, file in files:
        for name, use in file.use.items():
            _check_plan(f"{path}: use.{name}.plan", use)
        for category, name in file.categories.items():
            if name not in found:
                raise SchemaError(f"{path}: categories.{category.value}: no use {name!r}; there are {', '.join(found)}")
    by_kind = {kind: name for _, file in files for name, use in file.use.items() for kind in use.kinds}
    return PlaceUses(
        found,
        by_kind,
        {category: name for _, file in files for category, name in file.categories.items()},
        frozenset(kind for _, file in files for kind in file.home_kinds) - by_kind.keys(),
    )


def use_of(category: Category, kind: str) -> str:
    """Return which use a place's plan is for: one of `uses`, or ``flat`` for a home of any size."""
    known = uses()
    return "flat" if kind in known.home_kinds else known.by_kind.get(kind, known.by_category[category])


R = TypeVar("R", bound=DataRecord)


def _read(kind: str, record: type[R]) -> list[tuple[Path, R]]:
    return [(path, read_record(path, record, guide=GUIDE)) for path in data_files(ROOM, kind)]


def _room_kind(
    where: str, entry: RoomEntry, colours: Mapping[str, Colour], palettes: Mapping[str, tuple[Colour, ...]]
) -> RoomKind:
    tone = entry.tone if not isinstance(entry.tone, str) else colours.get(entry.tone)
    if tone is None:
        raise SchemaError(f"{where}.tone: no colour {entry.tone!r}; there are {', '.join(colours)}")
    if entry.palette not in palettes:
        raise SchemaError(f"{where}.palette: no palette {entry.palette!r}; there are {', '.join(palettes)}")
    if entry.composed is not None and entry.composed not in COMPOSITIONS:
        raise SchemaError(f"{where}.composed: no {entry.composed!r}; there are {', '.join(COMPOSITIONS)}")
    composition = None if entry.composed is None else COMPOSITIONS[entry.composed]
    return RoomKind(entry, tone, palettes[entry.palette], composition)


def _check_names(path: Path, file: RoomsFile) -> None:
    for name, pieces in file.choices.items():
        _check_pieces(f"{path}: choices.{name}", pieces)
    for name, members in file.sets.items():
        _check_pieces(f"{path}: sets.{name}", (piece for piece, *_ in members))
    for piece, small in file.on.items():
        _check_pieces(f"{path}: on.{piece}", (piece, *small))


def _check_steps(where: str, steps: Iterable[Step], names: NamedPieces) -> None:
    for k, step in enumerate(steps):
        here = f"{where}.{k}"
        for piece in _named_pieces(step):
            if piece.startswith("@"):
                if piece[1:] not in names.choices:
                    raise SchemaError(f"{here}: no choice {piece!r}; there are {', '.join(names.choices)}")
            elif piece not in names.sets:
                _check_pieces(here, (piece,))
        _check_steps(f"{here}.then", getattr(step, "then", ()), names)
        _check_steps(f"{here}.else", getattr(step, "else_", ()), names)


def _named_pieces(step: Step) -> Iterator[str]:
    """All pieces, sets and choices that a step names."""
    if isinstance(step, StandStep | HangStep):
        named = step.stand if isinstance(step, StandStep) else step.hang
        yield from (named,) if isinstance(named, str) else named
    elif isinstance(step, PutStep | FillStep):
        members = step.put if isinstance(step, PutStep) else step.fill
        yield from (members,) if isinstance(members, str) else (piece for piece, *_ in members)
    elif isinstance(step, LineStep):
        yield step.line
    elif isinstance(step, LayStep):
        yield step.lay
    elif isinstance(step, RowsStep):
        yield step.rows
    beside = getattr(step, "beside", None) or ()
    yield from (beside[0],) if isinstance(step, RowsStep) and beside else (piece for piece, *_ in beside)


def _check_pieces(where: str, pieces: Iterable[str]) -> None:
    models = furniture_models()
    for piece in pieces:
        if piece not in models:
            raise SchemaError(
                f"{where}: no furniture {piece!r}; write it (docs/adding_a_model.md) or use one of "
                + ", ".join(sorted(models))
            )


def _check_plan(where: str, use: Use) -> None:
    plan = use.plan
    known = room_kinds().kinds
    if isinstance(plan, DrawnPlan):
        if plan.drawn not in DRAWN:
            raise SchemaError(f"{where}.drawn: nobody draws {plan.drawn!r}; there are {', '.join(DRAWN)}")
        return
    for kind in _rooms_of_plan(plan):
        if kind not in known or kind in UNFURNISHED:
            raise SchemaError(f"{where}: no kind of room {kind!r}; there are {', '.join(sorted(known))}")


def _rooms_of_plan(plan: FrontPlan | EntryPlan | SpinePlan) -> Iterator[str]:
    if isinstance(plan, FrontPlan):
        yield plan.front
        yield from (kind for kind, _ in plan.backs)
    elif isinstance(plan, EntryPlan):
        yield from (kind for kind in (plan.entry, plan.main, plan.side, plan.after) if kind is not None)
    else:
        yield plan.spine
        for cells in (plan.north, plan.south, plan.upper_north or (), plan.upper_south or ()):
            yield from (kind for kind, _ in cells)
