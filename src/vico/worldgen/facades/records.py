"""Records of the files in ``vico/data/worldgen/facades``: every field that they may have."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import Field

from vico.io.data_files import DataRecord
from vico.world.model import Category

ROOM = "worldgen/facades"  # folder of the files
LONGEST_NAME = 24  # characters of a material

Name = Annotated[str, Field(min_length=1, max_length=LONGEST_NAME)]
Channel = Annotated[int, Field(ge=0, le=255)]
Rgb = tuple[Channel, Channel, Channel]
Share = Annotated[float, Field(gt=0.0)]
Metres = Annotated[float, Field(gt=0.0)]
#: Names, and how often each is taken beside the others.
Shares = Mapping[str, Share]
#: The same for shapes of roofs.
RoofShares = Mapping[Literal["gabled", "hipped", "half-hipped", "mansard", "flat"], Share]


class Family(DataRecord):
    """A family of facades: what the walls of a building wear together.

    Attributes
    ----------
    name
        Of the family and of its material; the upper floors' picture is painted under this name, or `picture`.
    picture
        Name of the painter in `textures.block_walls.UPPER_FLOORS`; empty: the family's own name.
    bay
        Wished width of a bay, metres.
    tints
        Colours that multiply the picture, sRGB; empty: those of plaster.
    ground_floors
        Pictures of ground floors (`textures.ground_floors.GROUNDS`), each as likely as it is named often.
    blank
        Walls without windows; empty: as the back says.
    back
        Upper floors away from streets; empty: as the front.
    own_colour
        The picture has a colour of its own, such as brick: a colour that is tagged is taken over by half.
    painted
        Whether a tagged colour is taken over at all.
    modern
        Under a metal roof, unless the map says what covers it.
    keeps_ground_floor
        Even where a garage or works would get gates.
    hall
        One row of windows from a low base to the eaves, as churches have.
    wooden_gable
        Boards above the eaves.
    cornice
        Where it ends in a cornice.
    cornice_size
        How deep below the eaves, and how far out a cornice is, metres.
    cornice_finishes
        What cornices wear; each building gets one.
    hangs
        What hangs on its fronts (`buildings.projections`).
    by_storey
        The picture's rows are storeys from the first floor up, so that its best floor is the first; else a wall begins
        on any row.
    roofs
        Shapes of its pitched roofs, where the map says none (`buildings.roofs.customs`); empty: the region's.
    ridge
        Whether a gabled roof's ridge runs along the street, or across; empty: along the longer side.
    gable
        What stands before a gable towards the street (`buildings.gables`).
    source
        What is known of such houses, and from where.
    """

    name: Name
    picture: str = ""
    bay: Metres = 3.0
    tints: tuple[Rgb, ...] = ()
    ground_floors: Annotated[tuple[str, ...], Field(min_length=1)]
    blank: str = ""
    back: Literal["", "wall_back", "wall_back_brick"] = ""
    own_colour: bool = False
    painted: bool = True
    modern: bool = False
    keeps_ground_floor: bool = False
    hall: bool = False
    wooden_gable: bool = False
    cornice: Literal["none", "always", "under_flat_roofs"] = "none"
    cornice_size: tuple[Metres, Metres] = (0.42, 0.32)
    cornice_finishes: Annotated[tuple[str, ...], Field(min_length=1)] = ("cornice",)
    hangs: Literal[
        "",
        "balconies",
        "french_balconies",
        "small_balconies",
        "wooden_balconies",
        "fire_escapes",
        "oriels",
        "oriels_and_balconies",
    ] = ""
    by_storey: bool = False
    roofs: RoofShares = Field(default_factory=dict)
    ridge: Literal["", "along", "across"] = ""
    gable: Literal["", "stepped"] = ""
    source: str = ""


class GroundFloor(DataRecord):
    """A ground floor that is not tinted as the wall above.

    Attributes
    ----------
    name
        Of its picture.
    stone
        Half of them are pale stone under walls of any colour.
    own_colour
        It is never tinted.
    as_wall
        It is of the wall's own stuff, and tinted alike.
    """

    name: str
    stone: bool = False
    own_colour: bool = False
    as_wall: bool = False


class BlankWall(DataRecord):
    """A wall without windows: its texture's name, and how many metres it covers."""

    name: str
    tile: Metres


class Bounds(DataRecord):
    """A box of latitudes and longitudes, degrees, its sides excluded; open where nothing is said."""

    south: float = -math.inf
    north: float = math.inf
    west: float = -math.inf
    east: float = math.inf


class StreetMix(DataRecord):
    """Facade families along streets of a region, as shares.

    Attributes
    ----------
    old, small, cottage
        Houses of before 1920: of towns, of small plots, and the smallest.
    middle
        Of 1920 to 1975.
    new
        Later ones.
    """

    old: Shares
    small: Shares
    cottage: Shares
    middle: Shares
    new: Shares


class RegionalStyle(DataRecord):
    """Building customs of a part of the world; what the map says of a building always goes first.

    Attributes
    ----------
    name
        Of the region.
    within
        Where it is; of several regions that hold a place the last one counts.
    streets
        What its streets are lined with.
    roofs
        What pitched roofs are covered with.
    eaves
        How far pitched roofs reach out over the walls, metres.
    pitched
        Shapes of pitched roofs of houses of three storeys and more, where neither the map nor the family says any;
        empty: as elsewhere.
    dormers
        Of houses with a suitable roof, how many have any; mansards always do.
    chimneys
        Whether they stand by the ridge, or as rows of pots on the walls between houses.
    towers
        Of homes of eight storeys and more; empty: as elsewhere.
    office_towers
        Of other houses of fourteen storeys and more; empty: as elsewhere.
    materials
        What a value of ``building:material`` stands for here, where that is not what it is elsewhere.
    small_town_trade
        Share of low houses of trade that are like the small old ones beside them; 0: they are as elsewhere.
    brick_backs
        Share of plain backs that are of brick.
    wooden_gables
        Families, and the share of their houses whose gables are of boards.
    wooden_eaves
        Families whose eaves are of wood.
    balconies_right_along, small_balconies, fire_escapes, water_tanks
        What its houses have: balconies along the whole front, small ones before single windows, iron fire escapes, and
        water tanks on flat roofs.
    """

    name: str
    within: tuple[Bounds, ...]
    streets: StreetMix
    roofs: Shares
    eaves: Annotated[float, Field(ge=0.0)] = 0.35
    pitched: RoofShares = Field(default_factory=dict)
    dormers: Annotated[float, Field(ge=0.0, le=1.0)] = 0.7
    chimneys: Literal["by_the_ridge", "on_party_walls"] = "by_the_ridge"
    towers: Shares = Field(default_factory=dict)
    office_towers: Shares = Field(default_factory=dict)
    materials: Mapping[str, Shares] = Field(default_factory=dict)
    small_town_trade: Annotated[float, Field(ge=0.0, le=1.0)] = 0.0
    brick_backs: Annotated[float, Field(ge=0.0, le=1.0)] = 0.0
    wooden_gables: Shares = Field(default_factory=dict)
    wooden_eaves: tuple[str, ...] = ()
    balconies_right_along: bool = False
    small_balconies: bool = False
    fire_escapes: bool = False
    water_tanks: bool = False

    def holds(self, lat: float, lon: float) -> bool:
        """Return whether a place lies in the region."""
        return any(box.south < lat < box.north and box.west < lon < box.east for box in self.within)


class Uses(DataRecord):
    """Families of buildings whose use decides more than their region.

    Attributes
    ----------
    church, shed, garage, works, old_works
        Places of worship; sheds and barns; garages and whatever is tiny; works, and those of before 1945.
    tower_of_homes, tower_of_offices
        Of fourteen storeys and more.
    trade
        Offices, shops and hotels that do not look like the old houses beside them.
    public, high_house
        Public buildings, and houses of eight storeys and more: beside the old and the middle houses of the region.
    """

    church: Shares
    shed: Shares
    garage: Shares
    works: Shares
    old_works: Shares
    tower_of_homes: Shares
    tower_of_offices: Shares
    trade: Shares
    public: Shares
    high_house: Shares


class TagValues(DataRecord):
    """Values of a tag, in small letters, and the families they stand for."""

    values: tuple[str, ...]
    families: Shares


class RoofCover(DataRecord):
    """Covering of a roof.

    Attributes
    ----------
    name
        Of its material.
    tile
        Metres its texture covers.
    tints
        Its colours, sRGB.
    materials
        Values of ``roof:material``.
    word
        Part of such values.
    """

    name: Name
    tile: Metres
    tints: Annotated[tuple[Rgb, ...], Field(min_length=1)]
    materials: tuple[str, ...] = ()
    word: str = ""


class Finish(DataRecord):
    """The stuffs of one kind of small solid on a building.

    Attributes
    ----------
    name
        As a plan's `finish` says it.
    side, tint
        Material and colour of its sides.
    as_wall
        Its sides have the colour of the building's walls instead.
    picture
        What its outline's edges show from bottom to top, where that is not plain; "" nothing.
    bay
        Width of one of the picture's bays, metres.
    shown
        Which edges of the outline show the picture; empty: all.
    cover, cover_tint
        Material and colour of what faces up; "" the building's roof.
    under, under_tint
        Of what faces down.
    """

    name: str
    side: str
    tint: Rgb
    as_wall: bool = False
    picture: str = ""
    bay: Metres = 1.0
    shown: tuple[int, ...] = ()
    cover: str = "roof_gravel"
    cover_tint: Rgb = (150, 148, 146)
    under: str = "blank_plaster"
    under_tint: Rgb = (168, 164, 158)


class BoardColours(DataRecord):
    """Colours of a sign board and of the letters on it."""

    ground: Rgb
    letters: Rgb


class SignTrade(DataRecord):
    """A trade whose sign boards look alike.

    Attributes
    ----------
    name
        Of the trade.
    kinds
        Kinds of places that it is.
    category
        Category of places that it is, where no trade has their kind; the last trade suits anything.
    boards
        Its boards' colours; a place's name picks one, so that a chain has the same everywhere.
    """

    name: str
    kinds: tuple[str, ...] = ()
    category: Category | None = None
    boards: Annotated[tuple[BoardColours, ...], Field(min_length=1)]


class FamiliesFile(DataRecord):
    """``families*.toml``.

    Attributes
    ----------
    plaster, stone
        Colours of plaster, and of stone ground floors under walls that have a colour of their own.
    family, ground_floor, blank_wall
        Each by its name.
    """

    plaster: tuple[Rgb, ...] = ()
    stone: tuple[Rgb, ...] = ()
    family: tuple[Family, ...] = ()
    ground_floor: tuple[GroundFloor, ...] = ()
    blank_wall: tuple[BlankWall, ...] = ()


class RegionsFile(DataRecord):
    """``regions*.toml``."""

    region: tuple[RegionalStyle, ...] = ()


class UsesFile(DataRecord):
    """``uses*.toml``: families by use, by ``building:material`` and by ``building:architecture``."""

    uses: Uses | None = None
    material: tuple[TagValues, ...] = ()
    architecture: tuple[TagValues, ...] = ()


class RoofsFile(DataRecord):
    """``roofs*.toml``.

    Attributes
    ----------
    wood, felt, modern
        Colours of wooden gables, of flat roofs, and of metal roofs over modern walls.
    roof
        Each by its name.
    """

    wood: tuple[Rgb, ...] = ()
    felt: tuple[Rgb, ...] = ()
    modern: tuple[Rgb, ...] = ()
    roof: tuple[RoofCover, ...] = ()


class ColoursFile(DataRecord):
    """``colours*.toml``: what names of colours in tags mean."""

    named: Mapping[str, Rgb] = Field(default_factory=dict)


class FinishesFile(DataRecord):
    """``finishes*.toml``."""

    finish: tuple[Finish, ...] = ()


class SignsFile(DataRecord):
    """``signs*.toml``."""

    trade: tuple[SignTrade, ...] = ()


class WindowStyle(DataRecord):
    """How a window looks; lengths in pixels.

    Attributes
    ----------
    name
        As painters ask for it.
    columns, rows
        Panes.
    transom
        Height of the upper row's share; 0 for equal rows.
    frame, bar
        Colour of frame and bars, and their width.
    surround
        Width of the trim around; `trim` is its colour.
    hood
        What crowns it: "" nothing, "flat" a small cornice, "gable" a pediment, "lintel" a plain stone.
    sill
        Whether it has one.
    sash
        The upper half stands before the lower one.
    arch
        The head is round, with a fan of bars.
    scale
        Pixels a 128th of a storey: sizes of shadows and sills follow it.
    """

    name: str
    columns: Annotated[int, Field(ge=1)] = 2
    rows: Annotated[int, Field(ge=1)] = 2
    transom: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.3
    frame: Rgb = (248, 247, 243)
    bar: float = 2
    surround: float = 0
    trim: Rgb = (250, 248, 243)
    hood: Literal["", "flat", "gable", "lintel"] = ""
    sill: bool = True
    sash: bool = False
    arch: bool = False
    scale: Annotated[float, Field(gt=0.0)] = 1.0


class WindowsFile(DataRecord):
    """``windows*.toml``."""

    window: tuple[WindowStyle, ...] = ()
