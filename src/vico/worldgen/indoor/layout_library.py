"""Layouts of one's own: JSON files with rooms, doors and furniture, and the interface of authors that draw them.

A layout file holds one floor plan of a use or a category::

    {"schema": "vico.layout", "version": 1, "name": "Corner bar", "use": "bar", "size": [8.0, 6.0],
     "rooms": [{"id": "bar", "kind": "bar", "rect": [0, 0, 8, 4]},
               {"id": "store", "kind": "storage", "rect": [0, 4, 8, 6],
                "furniture": [{"model": "store_rack", "at": [1.0, 5.6], "yaw": -90}]}],
     "doors": [{"between": ["bar", "outside"], "at": [4.0, 0.0]},
               {"between": ["bar", "store"], "at": [6.0, 4.0]}]}

x runs east from 0 to the first size, y north from 0 to the second, metres; yaw is counter-clockwise from east in
degrees and names the side a piece is used from. Rooms without ``furniture`` are furnished by their kind. Everything
is checked before use: `findings_of` says what is wrong in sentences an author can act on.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Protocol

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from vico.assets.interior import FLOORS, THICK, WALLS
from vico.assets.models.library import furniture_models
from vico.errors import InputError, MissingFileError, SchemaError
from vico.seeds import rng
from vico.world.check.indoors import walkable_inside
from vico.world.model import Category, Place
from vico.worldgen.indoor.catalogue import UNFURNISHED, room_kinds
from vico.worldgen.indoor.floorplans import OUTSIDE, Sketch, SketchDoor, SketchRoom
from vico.worldgen.indoor.furnished_plans import FloorPlan, furnish_sketch, rooms_of_plan, uses
from vico.worldgen.indoor.furnishing import Furnishing

SCHEMA = "vico.layout"
VERSION = 1
_MOST_BYTES = 4 << 20
_MOST_ROOMS = 60  # of a layout
_MOST_PIECES = 400  # of a room's furniture
_LEAST_ROOM = 1.4
_EDGE = 0.06  # metres a point may lie off the wall it is meant to be on
_CLEAR_WIDTH = 0.9

Metres = Annotated[float, Field(ge=-100.0, le=100.0, allow_inf_nan=False)]
Colour = Annotated[str, Field(pattern=r"^#[0-9a-fA-F]{6}$")]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class LayoutPiece(_Strict):
    """A piece of furniture: its model, where its middle stands in the plan, which way it faces (degrees)."""

    model: str
    at: list[Metres] = Field(min_length=2, max_length=2)
    yaw: Annotated[float, Field(ge=-360.0, le=360.0, allow_inf_nan=False)] = 0.0

    @model_validator(mode="after")
    def _check_model(self) -> LayoutPiece:
        if self.model not in furniture_models():
            raise ValueError(
                f"there is no furniture called {self.model!r}; see vico.assets.models.library.furniture_models"
            )
        return self


class LayoutRoom(_Strict):
    """A room: rectangle ``[x0, y0, x1, y1]``; `furniture` null (or left out) lets its kind decide."""

    id: Annotated[str, Field(min_length=1, max_length=60)]
    kind: Annotated[str, Field(min_length=1, max_length=40)]
    rect: list[Metres] = Field(min_length=4, max_length=4)
    height: Annotated[float, Field(ge=2.2, le=12.0)] = 2.7
    floor: Literal["planks", "tiles", "carpet", "stone", "concrete", "parquet", "chequer"] | None = None
    walls: Literal["plaster", "wallpaper", "tiled", "brick", "panels"] | None = None
    colour: Colour | None = None
    furniture: list[LayoutPiece] | None = Field(default=None, max_length=_MOST_PIECES)


class LayoutDoor(_Strict):
    """A doorway: the two rooms (or a room and ``outside``), its middle on the wall they share, its clear width."""

    between: list[str] = Field(min_length=2, max_length=2)
    at: list[Metres] = Field(min_length=2, max_length=2)
    width: Annotated[float, Field(ge=_CLEAR_WIDTH, le=4.0)] = 1.0


class Layout(_Strict):
    """A floor plan of a use (one of `indoor.layouts.uses`, or ``flat``) or of a whole category of places."""

    schema_: Literal["vico.layout"] = Field(alias="schema")
    version: Literal[1]
    name: Annotated[str, Field(min_length=1, max_length=120)]
    use: str | None = None
    category: Literal["accommodation", "food", "store", "office", "entertainment", "open", "transit"] | None = None
    size: list[Annotated[float, Field(ge=2.0, le=60.0)]] = Field(min_length=2, max_length=2)
    rooms: list[LayoutRoom] = Field(min_length=1, max_length=_MOST_ROOMS)
    doors: list[LayoutDoor] = Field(min_length=1, max_length=4 * _MOST_ROOMS)
    licence: str | None = None

    @property
    def area(self) -> float:
        """Floor area, square metres."""
        return self.size[0] * self.size[1]

    def sketch(self) -> Sketch:
        """Return the same as a bare plan, the room with the way out first."""
        order = sorted(range(len(self.rooms)), key=lambda i: not self._leads_out(self.rooms[i].id))
        number = {self.rooms[i].id: k for k, i in enumerate(order)} | {"outside": OUTSIDE}
        rooms = tuple(_sketch_room(self.rooms[i]) for i in order)
        doors = []
        for door in self.doors:
            a, b = number[door.between[0]], number[door.between[1]]
            a, b = (b, a) if a == OUTSIDE else (a, b)
            doors.append(SketchDoor(a, b, (door.at[0], door.at[1]), 0, door.width))
        return Sketch(self.use or self.category or "", (self.size[0], self.size[1]), rooms, tuple(doors))

    def plan(self, seed: int) -> FloorPlan:
        """Furnish it."""
        chance = rng(seed, "layout", self.name)
        return furnish_sketch(self.sketch(), chance, int(chance.integers(4)))

    def _leads_out(self, room: str) -> bool:
        return any(room in door.between and "outside" in door.between for door in self.doors)


def _sketch_room(room: LayoutRoom) -> SketchRoom:
    x0, y0, x1, y1 = room.rect
    cx, cy = (x0 + x1) / 2, (y0 + y1) / 2
    items = None
    if room.furniture is not None:
        items = tuple(
            Furnishing(p.model, round(p.at[0] - cx, 3), round(p.at[1] - cy, 3),
                       round(math.remainder(math.radians(p.yaw), 2 * math.pi), 5))
            for p in room.furniture
        )  # fmt: skip
    colour = None
    if room.colour is not None:
        colour = (int(room.colour[1:3], 16), int(room.colour[3:5], 16), int(room.colour[5:7], 16))
    return SketchRoom(room.kind, (x0, y0, x1, y1), 0, room.height, 0.0, 1, items, room.floor, room.walls, colour)


def _room_kinds() -> list[str]:
    """All kinds of rooms that can be furnished."""
    return sorted(kind for kind in room_kinds().kinds if kind not in UNFURNISHED)


def layout_schema() -> dict[str, Any]:
    """JSON Schema of a layout, with what can stand in it: what a language model is given to draw one."""
    schema = Layout.model_json_schema(by_alias=True)
    schema["x-room-kinds"] = _room_kinds()
    schema["x-uses"] = ["flat", *uses()]
    schema["x-furniture"] = {
        name: {"size": list(model.size), "solid": model.solid}
        for name, model in sorted(furniture_models().items())
    }  # fmt: skip
    schema["x-floors"], schema["x-walls"] = list(FLOORS), list(WALLS)
    return schema


def layout_guide() -> str:
    """Return the rules a layout has to keep, in words, for an author."""
    return (
        "Rooms are rectangles [x0, y0, x1, y1] in metres that lie within the size and do not overlap; neighbours "
        "share a wall. Every room can be reached through doors from the one door to 'outside', which lies on the "
        "plan's edge. A door's middle lies on the wall its two rooms share, half its width and 5 cm away from the "
        f"wall's ends; it is at least {_CLEAR_WIDTH} m wide. Furniture stands within its room, does not overlap, "
        "leaves 1 m before each door free, and lets a body of 25 cm radius walk from door to door and to every table, "
        "desk, sofa, chair and bed. Yaw 0 means that the side one uses a piece from looks east; pieces at the north "
        "wall have yaw -90."
    )


def parse_layout(text: str | bytes, where: str) -> Layout:
    """Read a layout.

    Parameters
    ----------
    where
        Name of the file, for the sentence.

    Raises
    ------
    SchemaError
        If it is no layout; the sentence names the path of the field.
    InputError
        If the plan is well formed but can't be built.
    """
    layout = _well_formed(text, where)
    wrong = findings_of(layout)
    if wrong:
        raise InputError(f"{where}: {wrong[0]}" + (f" (and {len(wrong) - 1} more)" if len(wrong) > 1 else ""))
    return layout


def _well_formed(text: str | bytes, where: str) -> Layout:
    try:
        return Layout.model_validate_json(text, by_alias=True)
    except ValidationError as error:
        first = error.errors()[0]
        path = ".".join(str(part) for part in first["loc"]) or "the whole file"
        raise SchemaError(f"{where}: {path}: {first['msg']}; see the layout schema in the documentation") from None


def findings_of(layout: Layout) -> list[str]:
    """Return what keeps a layout from being built, one sentence each, by field; empty if nothing does."""
    # Doors are looked at once the rooms are right, furniture once the plan is.
    wrong = [*_purpose_findings(layout), *_rooms_findings(layout)]
    wrong = wrong or [*_doors_findings(layout), *_ways_out_findings(layout), *_unreachable_rooms(layout)]
    return wrong or _furniture_findings(layout)


def _purpose_findings(layout: Layout) -> Iterator[str]:
    if (layout.use is None) == (layout.category is None):
        yield "use: give either use or category, not both and not neither"
    if layout.use is not None and layout.use not in (*uses(), "flat"):
        yield f"use: {layout.use!r} is none of flat, {', '.join(uses())}"


def _rooms_findings(layout: Layout) -> Iterator[str]:
    for k, room in enumerate(layout.rooms):
        here = f"rooms.{k} ({room.id})"
        before = layout.rooms[:k]
        if room.id == "outside" or any(room.id == other.id for other in before):
            yield f"{here}.id: ids have to differ, and none may be 'outside'"
        known = _room_kinds()
        if room.kind not in known and room.furniture is None:
            yield f"{here}.kind: nothing is known of {room.kind!r}; give its furniture, or one of {', '.join(known)}"
        x0, y0, x1, y1 = room.rect
        if x1 - x0 < _LEAST_ROOM or y1 - y0 < _LEAST_ROOM:
            yield f"{here}.rect: it is {x1 - x0:.2f} x {y1 - y0:.2f} m; {_LEAST_ROOM} m is the least"
        w, h = layout.size
        if x0 < -1e-6 or y0 < -1e-6 or x1 > w + 1e-6 or y1 > h + 1e-6:
            yield f"{here}.rect: it leaves the plan of {w:g} x {h:g} m"
        for j, other in enumerate(before):
            a = other.rect
            if x0 < a[2] - 0.01 and a[0] < x1 - 0.01 and y0 < a[3] - 0.01 and a[1] < y1 - 0.01:
                yield f"{here}.rect: it overlaps rooms.{j} ({other.id})"


def _doors_findings(layout: Layout) -> Iterator[str]:
    rooms = {room.id: room for room in layout.rooms}
    for k, door in enumerate(layout.doors):
        here = f"doors.{k}"
        lost = [name for name in door.between if name != "outside" and name not in rooms]
        if lost:
            yield f"{here}.between: there is no room {lost[0]!r}"
            continue
        if door.between[0] == door.between[1]:
            yield f"{here}.between: twice the same room"
            continue
        for name in door.between:
            if name != "outside" and not _on_wall(rooms[name].rect, door):
                yield f"{here}.at: {door.at} with {door.width:g} m is not on a wall of {name!r}, clear of its ends"
        if "outside" in door.between and not _on_wall([0.0, 0.0, *layout.size], door):
            yield f"{here}.at: {door.at} leads outside, but is not on the plan's edge"


def _ways_out_findings(layout: Layout) -> Iterator[str]:
    out = sum("outside" in door.between for door in layout.doors)
    if out != 1:
        yield f"doors: {out} of them lead outside; exactly one has to"


def _unreachable_rooms(layout: Layout) -> Iterator[str]:
    names = [room.id for room in layout.rooms]
    links: dict[str, set[str]] = {name: set() for name in [*names, "outside"]}
    for door in layout.doors:
        one, two = door.between
        if one in links and two in links:
            links[one].add(two)
            links[two].add(one)
    seen, queue = {"outside"}, ["outside"]
    while queue:
        fresh = links[queue.pop()] - seen
        seen |= fresh
        queue.extend(fresh)
    for k, name in enumerate(names):
        if name not in seen:
            yield f"rooms.{k} ({name}): no door leads there"


def _on_wall(rect: Sequence[float], door: LayoutDoor) -> bool:
    x, y = door.at
    x0, y0, x1, y1 = rect
    spare = door.width / 2 + THICK / 2
    across = min(abs(x - x0), abs(x - x1)) <= _EDGE and y0 + spare - 1e-6 <= y <= y1 - spare + 1e-6
    return across or (min(abs(y - y0), abs(y - y1)) <= _EDGE and x0 + spare - 1e-6 <= x <= x1 - spare + 1e-6)


def _furniture_findings(layout: Layout) -> list[str]:
    """Pieces that leave their room or stand in each other, and rooms that can't be walked through."""
    models = furniture_models()
    wrong: list[str] = []
    for k, room in enumerate(layout.rooms):
        x0, y0, x1, y1 = (v + s * THICK / 2 for v, s in zip(room.rect, (1, 1, -1, -1), strict=True))
        placed: list[tuple[float, float, float, float, float, str]] = []
        for j, piece in enumerate(room.furniture or ()):
            here = f"rooms.{k} ({room.id}).furniture.{j} ({piece.model})"
            model = models[piece.model]
            yaw = math.radians(piece.yaw)
            c, s = abs(math.cos(yaw)), abs(math.sin(yaw))
            a, b = (c * model.size[0] + s * model.size[1]) / 2, (s * model.size[0] + c * model.size[1]) / 2
            x, y = piece.at
            if x - a < x0 - 0.03 or y - b < y0 - 0.03 or x + a > x1 + 0.03 or y + b > y1 + 0.03:
                wrong.append(f"{here}: it does not stand within its room")
            if model.solid:
                for ox, oy, oa, ob, _, name in placed:
                    if abs(x - ox) < a + oa - 0.01 and abs(y - oy) < b + ob - 0.01:
                        wrong.append(f"{here}: it stands in the {name}")
                placed.append((x, y, a, b, yaw, piece.model))
    if wrong:
        return wrong
    plan = layout.plan(0)
    for made in plan.rooms:
        if not made.spots:
            wrong.append(f"rooms ({made.kind}): furniture stands in its doorway: leave 1 m before each door free")
    rooms, objects = rooms_of_plan(plan)
    return wrong or [f"{f.where}: {f.what}" for f in walkable_inside(rooms, objects)]


@dataclass(frozen=True)
class Library:
    """Layouts read from a folder, in the order of their files."""

    layouts: tuple[Layout, ...]

    def nearest(self, use: str, category: Category, area: float, chance: np.random.Generator) -> Layout | None:
        """Return the layout that fits a place best; None if none is for its use or category.

        Layouts of the use itself come before those of the category. Among those not larger than `area` the largest
        wins (else the smallest there is); between layouts within a tenth of its area chance decides.
        """
        mine = [one for one in self.layouts if one.use == use]
        mine = mine or [one for one in self.layouts if one.category == category.value]
        if not mine:
            return None
        fitting = [one for one in mine if one.area <= area]
        best = max(one.area for one in fitting) if fitting else min(one.area for one in mine)
        close = [one for one in fitting or mine if abs(one.area - best) <= 0.1 * best]
        return close[int(chance.integers(len(close)))]


def read_library(folder: Path) -> Library:
    """Read every ``*.json`` of a folder.

    Raises
    ------
    MissingFileError
        If there is no such folder, or no layout in it.
    SchemaError, InputError
        If a file is no layout, or its plan can't be built; the sentence names file and field.
    """
    path = Path(folder)
    if not path.is_dir():
        raise MissingFileError(f"{path}: no such folder; give a folder with layouts (*.json)")
    found = []
    for file in sorted(path.glob("*.json")):
        if file.stat().st_size > _MOST_BYTES:
            raise SchemaError(f"{file}: {file.stat().st_size:,} bytes; a layout has at most {_MOST_BYTES:,}")
        found.append(parse_layout(file.read_bytes(), str(file)))
    if not found:
        raise MissingFileError(f"{path}: holds no layout (*.json)")
    return Library(tuple(found))


class LayoutAuthor(Protocol):
    """Author of floor plans: a language model, a vision model, a script."""

    def draw(self, request: LayoutRequest, feedback: Sequence[str]) -> str | None:
        """Answer with a layout as JSON text; None gives up.

        Parameters
        ----------
        request
            What is wanted.
        feedback
            What was wrong with the last answer, one sentence each; empty the first time.
        """


@dataclass(frozen=True)
class LayoutRequest:
    """Request for a floor plan.

    Attributes
    ----------
    size
        Extent the plan may have at most, metres.
    place
        Id of the place it is for.
    """

    name: str
    kind: str
    category: str
    use: str
    size: tuple[float, float]
    seed: int
    place: str = ""


def layout_problems(layout: Layout, request: LayoutRequest) -> list[str]:
    """`findings_of` a layout, after whether it is larger than what was asked for."""
    wrong = findings_of(layout)
    w, h = request.size
    if layout.size[0] > w + 0.01 or layout.size[1] > h + 0.01:
        wrong.insert(0, f"size: {layout.size} is larger than the {w:g} x {h:g} m there are")
    return wrong


def layout_from_author(
    author: LayoutAuthor, place: Place, *, use: str, area: float, seed: int = 0, attempts: int = 3
) -> Layout | None:
    """Ask an author for a place's layout, telling what is wrong up to `attempts` times.

    Returns
    -------
    Layout or None
        None if every answer was bad, or the author gave up: the caller then plans by rule.
    """
    side = round(max(5.0, min(24.0, math.sqrt(max(area, 25.0)))), 1)
    request = LayoutRequest(place.name, place.kind, place.category.value, use, (side, side), seed, place.id)
    feedback: list[str] = []
    for _ in range(attempts):
        answer = author.draw(request, tuple(feedback))
        if answer is None:
            return None
        try:
            layout = _well_formed(answer, "layout")
        except SchemaError as error:
            feedback = [str(error)]
            continue
        feedback = layout_problems(layout, request)
        if not feedback:
            return layout
        feedback = feedback[:8]
    return None


def write_layout(layout: Layout, path: Path) -> None:
    """Write a layout as JSON that `read_library` reads."""
    text = json.dumps(layout.model_dump(mode="json", by_alias=True, exclude_none=True), indent=1, ensure_ascii=False)
    path.write_text(text + "\n", encoding="utf-8")
