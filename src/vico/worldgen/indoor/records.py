"""Records of the files in ``data/worldgen/indoor``: kinds of rooms with their furniture, uses of places with plans.

docs/adding_a_room.md says how to write one. Metres and degrees; the frames are those of `furnishing.RoomDraft` and
`floorplans.Sketch`.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from vico.io.data_files import DataRecord
from vico.world.model import Category

Metres = Annotated[float, Field(ge=0.0, le=100.0, allow_inf_nan=False)]
Length = Annotated[float, Field(gt=0.0, le=100.0, allow_inf_nan=False)]
Offset = Annotated[float, Field(ge=-100.0, le=100.0, allow_inf_nan=False)]
Channel = Annotated[int, Field(ge=0, le=255)]
Rgb = tuple[Channel, Channel, Channel]
Point = tuple[Offset, Offset]
Placed = tuple[str, Offset, Offset, float]  # piece, ahead and to the left of the set's middle, yaw in degrees
Pieces = str | tuple[str, ...]
Times = Annotated[int, Field(ge=1, le=99)]
#: A wall as seen from the door: opposite, beside, behind; where the step before stood, or opposite to that.
WallName = Literal["far", "sides", "near", "walls", "same", "opposite"]
Floor = Literal["planks", "tiles", "carpet", "stone", "concrete", "parquet", "chequer"]
WallCover = Literal["plaster", "wallpaper", "tiled", "brick", "panels"]


class _Found(DataRecord):
    """A step that may find no place: what then follows where it did, and where not."""

    then: tuple[Step, ...] = ()
    else_: tuple[Step, ...] = Field(default=(), alias="else")


class StandStep(_Found):
    """Stand pieces with their backs to walls.

    Attributes
    ----------
    stand
        A piece; several: one after another; ``@name``: one of `RoomsFile.choices` by chance.
    times
        How many; each of several once if not given.
    walls
        Walls to try in this order; all of them by chance without.
    along
        Where along the wall, see `RoomDraft.against`; ``same``: as near as can be to where the step before stood.
    front, gap, width
        Depth kept free before it; distance to the wall; width reserved along it.
    beside
        Further pieces of the set.
    """

    stand: Pieces
    times: Times | None = None
    walls: tuple[WallName, ...] = ()
    along: Literal["any", "middle", "corner", "door", "same"] = "any"
    front: Metres = 0.6
    gap: Metres = 0.03
    width: Metres = 0.0
    beside: tuple[Placed, ...] = ()


class LineStep(DataRecord):
    """Line each of some walls with a piece, from a corner on; `pitch` is the width that each gets."""

    line: str
    walls: tuple[WallName, ...]
    most: Times = 99
    front: Metres = 0.7
    pitch: Metres = 0.0


class HangStep(DataRecord):
    """Hang pieces on walls, clear of doors and windows: as `StandStep`; `at` is where along the wall."""

    hang: Pieces
    times: Times | None = None
    walls: tuple[WallName, ...] = ()
    at: Offset | None = None


class LayStep(DataRecord):
    """Lay a flat piece on the floor.

    Attributes
    ----------
    at
        Points from the middle, or ``door``: inside the way in.
    shares
        Shares of the room's extents to add to them.
    turn
        Quarter turns.
    """

    lay: str
    at: tuple[Point, ...] | Literal["door"] = ((0.0, 0.0),)
    shares: Point = (0.0, 0.0)
    turn: int = 0


class PutStep(_Found):
    """Put a set down somewhere.

    Attributes
    ----------
    put
        A piece, the name of a set, or what is in it.
    at
        Places to try, from the middle; at the first that is free it is put down.
    everywhere
        At each of the places instead.
    turns
        Quarter turns to try at each place; ``chance``; ``long_side``: along the longer side first.
    aisle
        Room wanted around it.
    """

    put: str | tuple[Placed, ...]
    at: tuple[Point, ...] = ((0.0, 0.0),)
    everywhere: bool = False
    turns: tuple[int, ...] | Literal["chance", "long_side"] = (0,)
    aisle: Metres = 0.0


class FillStep(DataRecord):
    """Put a set down again and again on a lattice, as `PutStep` and `RoomDraft.fill`.

    Attributes
    ----------
    turn
        Quarter turns; ``way_in``: so that its right and left are those of who comes in.
    """

    fill: str | tuple[Placed, ...]
    pitch: tuple[Length, Length]
    most: Times = 99
    aisle: Metres = 0.5
    turn: int | Literal["way_in"] = 0
    inset: Metres = 0.5


class RowsStep(DataRecord):
    """Put rows of seats that look to the far wall, parted by an aisle.

    Attributes
    ----------
    pitch
        From row to row.
    back, front
        From the wall with the way in to the first row, and what stays free before the far wall.
    beside
        A further piece with each seat.
    """

    rows: str
    pitch: Length
    back: Metres
    front: Metres
    aisle: Metres
    most: Times = 99
    beside: Placed | None = None


class RoomSize(DataRecord):
    """Condition on a room: larger than an area, a longer or shorter side longer than; or by chance a share."""

    area: float | None = None
    long_side: float | None = None
    short_side: float | None = None
    chance: Annotated[float, Field(ge=0.0, le=1.0)] | None = None


class IfStep(DataRecord):
    """Do something where the room is so, else something other."""

    if_: RoomSize = Field(alias="if")
    then: tuple[Step, ...] = ()
    else_: tuple[Step, ...] = Field(default=(), alias="else")


_STEPS = ("stand", "line", "hang", "lay", "put", "fill", "rows", "if")


def _kind_of_step(value: Any) -> str | None:
    return next((name for name in _STEPS if name in value), None) if isinstance(value, dict) else None


Step = Annotated[
    Annotated[StandStep, Tag("stand")]
    | Annotated[LineStep, Tag("line")]
    | Annotated[HangStep, Tag("hang")]
    | Annotated[LayStep, Tag("lay")]
    | Annotated[PutStep, Tag("put")]
    | Annotated[FillStep, Tag("fill")]
    | Annotated[RowsStep, Tag("rows")]
    | Annotated[IfStep, Tag("if")],
    Discriminator(
        _kind_of_step,
        custom_error_type="step",
        custom_error_message=f"a step has one of the fields {', '.join(_STEPS)}",
    ),
]


class RoomEntry(DataRecord):
    """A kind of room.

    Attributes
    ----------
    floor, tone
        What the floor is of, and its colour: a name of `RoomsFile.colours`, or red, green and blue.
    walls, palette
        What is on the walls, and the name of the colours they may have.
    daylight
        Whether outer walls have windows.
    shop_window
        Whether it has large windows at the street.
    small
        Small things that lie on its tables, desks and counters.
    furniture
        Steps in their order.
    composed
        Instead: the name of a composition in Python, see `indoor.compositions`.
    """

    floor: Floor = "planks"
    tone: str | Rgb = "wood"
    walls: WallCover = "plaster"
    palette: str = "light"
    daylight: bool = True
    shop_window: bool = False
    small: tuple[str, ...] = ()
    furniture: tuple[Step, ...] = ()
    composed: str | None = None

    @model_validator(mode="after")
    def _furnished_one_way(self) -> RoomEntry:
        if self.composed is not None and self.furniture:
            raise ValueError("give furniture or the composition that it is composed by, not both")
        return self


class RoomsFile(DataRecord):
    """Kinds of rooms by name, and what their entries name.

    Attributes
    ----------
    colours, palettes
        Colours of floors, and of walls to choose from.
    choices
        Pieces of which chance picks one: ``@name``.
    sets
        Pieces that stand together.
    on
        Small things on a piece of furniture, whatever the room.
    """

    colours: dict[str, Rgb] = Field(default_factory=dict)
    palettes: dict[str, tuple[Rgb, ...]] = Field(default_factory=dict)
    choices: dict[str, tuple[str, ...]] = Field(default_factory=dict)
    sets: dict[str, tuple[Placed, ...]] = Field(default_factory=dict)
    on: dict[str, tuple[str, ...]] = Field(default_factory=dict)
    room: dict[str, RoomEntry] = Field(default_factory=dict)


Cell = tuple[str, Length]  # kind of room and its share of the strip


class FrontPlan(DataRecord):
    """A large room at the street (`front`), rooms for the staff behind it, `depth` deep; the same on floors above."""

    front: str
    backs: tuple[Cell, ...] = ()
    depth: Metres
    height: Length = 2.7
    lift: bool = False


class EntryPlan(DataRecord):
    """A hall at the street (`entry`), the large room behind it; perhaps a room beside the hall, and one beyond."""

    entry: str
    main: str
    depth: Length
    height: Length = 2.7
    side: str | None = None
    after: str | None = None


class SpinePlan(DataRecord):
    """A lobby (`spine`), then a corridor with rooms on both sides, on every floor; floors above may differ."""

    spine: str
    north: tuple[Cell, ...]
    south: tuple[Cell, ...]
    upper_north: tuple[Cell, ...] | None = None
    upper_south: tuple[Cell, ...] | None = None
    hall_width: Length = 5.0
    lift: bool = True

    @model_validator(mode="after")
    def _both_sides_above(self) -> SpinePlan:
        if (self.upper_north is None) != (self.upper_south is None):
            raise ValueError("give both upper_north and upper_south, or neither")
        return self


class DrawnPlan(DataRecord):
    """A plan drawn in Python: its name in `indoor.floorplans`."""

    drawn: str


_PLANS = ("front", "entry", "spine", "drawn")


def _kind_of_plan(value: Any) -> str | None:
    return next((name for name in _PLANS if name in value), None) if isinstance(value, dict) else None


Plan = Annotated[
    Annotated[FrontPlan, Tag("front")]
    | Annotated[EntryPlan, Tag("entry")]
    | Annotated[SpinePlan, Tag("spine")]
    | Annotated[DrawnPlan, Tag("drawn")],
    Discriminator(
        _kind_of_plan,
        custom_error_type="plan",
        custom_error_message=f"a plan has one of the fields {', '.join(_PLANS)}",
    ),
]


class Use(DataRecord):
    """Use of a place that a floor plan is for.

    Attributes
    ----------
    kinds
        Kinds of places that have it: values of OpenStreetMap's tags.
    home
        How common it is among homes; None: it is none.
    plan
        How its rooms lie.
    sizes
        Width and depth, the smallest first.
    storeys, least_storeys
        On how many floors at most and at least.
    """

    kinds: tuple[str, ...] = ()
    home: Annotated[float, Field(gt=0.0)] | None = None
    plan: Plan
    sizes: tuple[tuple[Length, Length], ...] = Field(min_length=1)
    storeys: Annotated[int, Field(ge=1, le=3)] = 1
    least_storeys: Annotated[int, Field(ge=1, le=3)] = 1

    @model_validator(mode="after")
    def _fewest_before_most(self) -> Use:
        if self.least_storeys > self.storeys:
            raise ValueError(f"least_storeys {self.least_storeys} is more than storeys {self.storeys}")
        return self


class PlaceUsesFile(DataRecord):
    """Uses by name.

    Attributes
    ----------
    home_kinds
        Kinds of places that are homes.
    categories
        The use of places whose kind no use names.
    """

    home_kinds: tuple[str, ...] = ()
    categories: dict[Category, str] = Field(default_factory=dict)
    use: dict[str, Use] = Field(default_factory=dict)
