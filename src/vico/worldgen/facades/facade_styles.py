"""Facade styles: what facades can look like by region, age and use, and which of them a building gets.

`styles` is all that the files of ``vico/data/worldgen/facades`` say, read once; `records` describes their fields, and
docs/adding_a_facade.md how to add to them. `family_of` asks the rules of `RULES` in their order which family a building
belongs to: by what the map says, else by use, height, age and region; the first rule that knows decides. The style has
materials and colours: by the map's tags, else by the family and a draw of the building's own.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import NamedTuple, Protocol, TypeVar

import numpy as np

from vico.errors import SchemaError
from vico.io.data_files import DataRecord, cached_data, data_files, read_record
from vico.worldgen.facades.records import (
    ROOM,
    BlankWall,
    ColoursFile,
    FamiliesFile,
    Family,
    Finish,
    FinishesFile,
    GroundFloor,
    RegionalStyle,
    RegionsFile,
    Rgb,
    RoofCover,
    RoofsFile,
    Shares,
    SignsFile,
    SignTrade,
    StreetMix,
    TagValues,
    Uses,
    UsesFile,
)
from vico.worldgen.facades.textures.ground_floors import GROUNDS
from vico.worldgen.facades.textures.regional_walls import UPPER_FLOORS


@dataclass(frozen=True)
class FacadeStyles:
    """All that the files say, by name; fields as of the files' records."""

    plaster: tuple[Rgb, ...]
    stone: tuple[Rgb, ...]
    families: Mapping[str, Family]
    ground_floors: Mapping[str, GroundFloor]
    blank_walls: Mapping[str, BlankWall]
    regions: Mapping[str, RegionalStyle]
    uses: Uses
    materials: Mapping[str, Shares]
    architectures: Mapping[str, Shares]
    wood: tuple[Rgb, ...]
    felt: tuple[Rgb, ...]
    modern_roofs: tuple[Rgb, ...]
    roofs: Mapping[str, RoofCover]
    colours: Mapping[str, Rgb]
    finishes: Mapping[str, Finish]
    trades: Mapping[str, SignTrade]

    def region(self, name: str) -> RegionalStyle:
        """Return the region of that name; an unknown one is like the first."""
        return self.regions.get(name) or next(iter(self.regions.values()))

    def ground_floor(self, name: str) -> GroundFloor:
        """Return how a ground floor is tinted."""
        return self.ground_floors.get(name) or GroundFloor(name=name)


@cached_data
def styles() -> FacadeStyles:
    """Return what facades can look like: the package's data and the user's (``$VICO_DATA/worldgen/facades``).

    Raises
    ------
    InputError
        If the variable names no folder.
    SchemaError
        If a file can't be used; the message says which, where, and what is wrong.
    """
    families, regions, uses = _files("families", FamiliesFile), _files("regions", RegionsFile), _files("uses", UsesFile)
    roofs, signs = _files("roofs", RoofsFile), _files("signs", SignsFile)
    _check_pictures(families)
    _check_named_families(regions, uses, {family.name for family in _all_entries(families, lambda file: file.family)})
    return FacadeStyles(
        plaster=_all_entries(families, lambda file: file.plaster),
        stone=_all_entries(families, lambda file: file.stone),
        families=_by_name(_all_entries(families, lambda file: file.family)),
        ground_floors=_by_name(_all_entries(families, lambda file: file.ground_floor)),
        blank_walls=_by_name(_all_entries(families, lambda file: file.blank_wall)),
        regions=_by_name(_all_entries(regions, lambda file: file.region)),
        uses=[file.uses for _, file in uses if file.uses is not None][-1],
        materials=_families_by_value(_all_entries(uses, lambda file: file.material)),
        architectures=_families_by_value(_all_entries(uses, lambda file: file.architecture)),
        wood=_all_entries(roofs, lambda file: file.wood),
        felt=_all_entries(roofs, lambda file: file.felt),
        modern_roofs=_all_entries(roofs, lambda file: file.modern),
        roofs=_by_name(_all_entries(roofs, lambda file: file.roof)),
        colours=dict(_all_entries(_files("colours", ColoursFile), lambda file: file.named.items())),
        finishes=_by_name(_all_entries(_files("finishes", FinishesFile), lambda file: file.finish)),
        trades=_by_name(_all_entries(signs, lambda file: file.trade)),
    )


def region_of(lat: float, lon: float) -> str:
    """Return the name of the region whose building customs are to be expected at a place."""
    return next(region.name for region in reversed(list(styles().regions.values())) if region.holds(lat, lon))


class _Named(Protocol):
    @property
    def name(self) -> str: ...


N = TypeVar("N", bound=_Named)
R = TypeVar("R", bound=DataRecord)
T = TypeVar("T")


def _files(kind: str, record: type[R]) -> list[tuple[Path, R]]:
    return [(path, read_record(path, record)) for path in data_files(ROOM, kind)]


def _by_name(entries: Iterable[N]) -> dict[str, N]:
    """Return entries by name; a later one of the same name comes in the place of the earlier, at the end."""
    found: dict[str, N] = {}
    for entry in entries:
        found.pop(entry.name, None)
        found[entry.name] = entry
    return found


def _all_entries(files: Iterable[tuple[Path, R]], entries: Callable[[R], Iterable[T]]) -> tuple[T, ...]:
    """Return the entries of all files, in their order."""
    return tuple(entry for _, file in files for entry in entries(file))


def _families_by_value(entries: Iterable[TagValues]) -> dict[str, Shares]:
    return {value: entry.families for entry in entries for value in entry.values}


def _check_pictures(files: Iterable[tuple[Path, FamiliesFile]]) -> None:
    for path, file in files:
        for k, family in enumerate(file.family):
            _check_painted(f"{path}: family.{k}.picture", family.picture or family.name, UPPER_FLOORS)
            for floor in family.ground_floors:
                _check_painted(f"{path}: family.{k}.ground_floors", floor, GROUNDS)


def _check_painted(where: str, name: str, painted: Iterable[str]) -> None:
    if name not in painted:
        raise SchemaError(f"{where}: nothing paints {name!r}; there are {', '.join(sorted(painted))}")


def _check_named_families(
    regions: Iterable[tuple[Path, RegionsFile]], uses: Iterable[tuple[Path, UsesFile]], known: set[str]
) -> None:
    for path, places in regions:
        for where, shares in _shares_of_regions(places):
            _check_shares(path, where, shares, known)
    for path, use in uses:
        for where, shares in _shares_of_uses(use):
            _check_shares(path, where, shares, known)


def _check_shares(path: Path, where: str, shares: Shares, known: set[str]) -> None:
    for name in shares:
        if name not in known:
            raise SchemaError(f"{path}: {where}: no family {name!r}; there are {', '.join(sorted(known))}")


def _shares_of_regions(file: RegionsFile) -> Iterator[tuple[str, Shares]]:
    for k, region in enumerate(file.region):
        for age in StreetMix.model_fields:
            yield f"region.{k}.streets.{age}", getattr(region.streets, age)
        yield f"region.{k}.towers", region.towers
        yield f"region.{k}.office_towers", region.office_towers
        for value, shares in region.materials.items():
            yield f"region.{k}.materials.{value}", shares
        yield f"region.{k}.wooden_gables", region.wooden_gables


def _shares_of_uses(file: UsesFile) -> Iterator[tuple[str, Shares]]:
    if file.uses is not None:
        for use in Uses.model_fields:
            yield f"uses.{use}", getattr(file.uses, use)
    for name, entries in (("material", file.material), ("architecture", file.architecture)):
        for k, entry in enumerate(entries):
            yield f"{name}.{k}.families", entry.families


def colour_of(tag: str | None) -> Rgb | None:
    """Return an OSM colour (``#rgb``, ``#rrggbb`` or a common name); None where it is none of these."""
    if not tag:
        return None
    text = tag.strip().lower().split(";")[0].replace(" ", "").replace("_", "")
    if text.startswith("#"):
        digits = text[1:]
        if len(digits) == 3:
            digits = "".join(2 * c for c in digits)
        if len(digits) == 6 and all(c in "0123456789abcdef" for c in digits):
            return int(digits[:2], 16), int(digits[2:4], 16), int(digits[4:], 16)
    return styles().colours.get(text)


def year_of(text: str | None) -> int | None:
    """Return the year a ``start_date`` means: ``1887``, ``~1900``, ``1960s``, ``C19``, ``before 1800``; else None."""
    if not text:
        return None
    century = re.search(r"\bC(\d{1,2})\b", text.strip())
    if century:
        return int(century.group(1)) * 100 - 50
    year = re.search(r"(?<!\d)(1\d{3}|20\d{2})(?!\d{2})", text)
    return int(year.group(1)) if year else None


_ORDINARY_HOUSES = ("house", "residential", "apartments", "office", "yes")  # what a church became
_SHEDS = ("shed", "hut", "barn", "cabin", "farm_auxiliary", "stable")
_TOWN_USES = ("residential", "other", "retail", "commercial", "hotel")
_TRADE_USES = ("office", "commercial", "retail", "transport", "hotel")
_OLD = 1920  # year before which houses are old
_POST_WAR = 1975  # year in which the age after it ends
_TOWN_HOUSE_YEAR = 1880  # of what is old, but has no year
_OLD_TOWN_SHARE = 0.6  # of houses on small plots that are old
_OLD_SHARE = 0.62  # share of old ones in houses that nothing is known of
_MIDDLE_SHARE = 0.86  # share of old and middle ones
_MODERN_OFFICES = 0.7  # share that does not look like the old houses beside it
_MODERN_SHOPS = 0.4  # the same of shops

#: Families with their shares; one may come twice.
Table = Sequence[tuple[str, float]]


@dataclass(frozen=True)
class House:
    """Facts about a building that decide its facade.

    Attributes
    ----------
    use, tags
        Its use, and the map's tags.
    levels, area
        Storeys, and square metres of ground.
    region
        Its customs.
    styles
        What facades there are.
    draw
        The building's own draw that chooses between ages, 0..1.
    """

    use: str
    tags: Mapping[str, str]
    levels: int
    area: float
    region: RegionalStyle
    styles: FacadeStyles
    draw: float

    @cached_property
    def year(self) -> int | None:
        """When it was built, as tagged."""
        return year_of(self.tags.get("start_date"))


def family_of(
    use: str,
    tags: Mapping[str, str],
    *,
    levels: int,
    area: float,
    region: str,
    draw: tuple[float, float] = (0.5, 0.5),
) -> str:
    """Return the family of facade a building belongs to, by name of its material.

    What the map says of material and architecture comes first; then use and height; homes and houses of trade follow
    the customs of their region, the old ones where the map or a small plot suggests age.
    """
    known = styles()
    house = House(use, tags, levels, area, known.region(region), known, draw[1])
    table = next(table for rule in RULES if (table := rule(house)))
    return draw_by_share(table, draw[0])


def draw_by_share(table: Table, draw: float) -> str:
    """Return one of the names, by their shares."""
    edges = np.cumsum([share for _, share in table])
    return table[int(np.searchsorted(edges, min(draw, 0.999999) * edges[-1], side="right"))][0]


def table_of(*shares: Shares) -> Table:
    """Return several families' shares as one table."""
    return [entry for some in shares for entry in some.items()]


def by_material_tag(house: House) -> Table | None:
    """Decide by ``building:material``."""
    said = house.tags.get("building:material", house.tags.get("building:facade:material", "")).lower()
    return table_of(house.region.materials.get(said) or house.styles.materials.get(said, {}))


def place_of_worship(house: House) -> Table | None:
    """Decide by use: a place of worship that is not in an ordinary house."""
    if house.use == "religious" and house.tags.get("building") not in _ORDINARY_HOUSES:
        return table_of(house.styles.uses.church)
    return None


def by_architecture_tag(house: House) -> Table | None:
    """Decide by ``building:architecture``."""
    style = house.tags.get("building:architecture", "").lower()
    return table_of(house.styles.architectures.get(style, {})) if house.levels >= 2 else None


def shed_or_garage(house: House) -> Table | None:
    """Decide by use: sheds, garages and whatever is tiny."""
    if house.tags.get("building") in _SHEDS:
        return table_of(house.styles.uses.shed)
    if house.use == "garage" or (house.area < 60.0 and house.levels <= 1):
        return table_of(house.styles.uses.garage)
    return None


def works(house: House) -> Table | None:
    """Decide by use: works, and large halls of transport."""
    if house.use == "industrial" or (house.use == "transport" and house.area > 1500):
        old = house.year is not None and house.year < 1945
        return table_of(house.styles.uses.old_works if old else house.styles.uses.works)
    return None


def tower(house: House) -> Table | None:
    """Decide by height, where it decides more than the region does."""
    if house.levels >= 8 and house.use in ("residential", "other") and house.region.towers:
        return table_of(house.region.towers)
    if house.levels < 14:
        return None
    uses = house.styles.uses
    if house.use == "residential":
        return table_of(uses.tower_of_homes)
    return table_of(house.region.office_towers or uses.tower_of_offices)


def by_age(house: House) -> Table | None:
    """Decide by the year it was built in, mapped or supposed, and the customs of that time."""
    year = house.year
    if year is None and _of_an_old_town(house):
        year = _TOWN_HOUSE_YEAR
    if year is None:
        return None
    streets = house.region.streets
    if year >= _OLD:
        return table_of(streets.middle if year < _POST_WAR else streets.new)
    if house.levels <= 4 and house.area < 420.0 and house.use in _TOWN_USES:
        return table_of(streets.cottage if house.area < 140.0 and house.levels <= 3 else streets.small)
    return table_of(streets.old)


def _of_an_old_town(house: House) -> bool:
    if "heritage" in house.tags or "historic" in house.tags:
        return True
    plot = house.area < 320.0 and house.levels <= 5
    return plot and house.use not in ("office", "industrial") and house.draw < _OLD_TOWN_SHARE


def public_building(house: House) -> Table | None:
    """Decide by use: schools, hospitals, town halls."""
    if house.use not in ("civic", "education", "health", "religious"):
        return None
    streets = house.region.streets
    return table_of(house.styles.uses.public, streets.old, streets.middle)


def house_of_trade(house: House) -> Table | None:
    """Decide by use: like the old houses of its town, or modern."""
    streets, share = house.region.streets, house.region.small_town_trade
    low = house.levels <= 4 and house.area < 900.0
    if share > 0.0 and low and house.use in ("commercial", "retail", "hotel"):
        return table_of(streets.small if house.draw < share else streets.new)
    if house.use not in _TRADE_USES:
        return None
    modern = house.draw < (_MODERN_OFFICES if house.use == "office" else _MODERN_SHOPS)
    return table_of(house.styles.uses.trade if modern else streets.old)


def home(house: House) -> Table | None:
    """Decide by size: high houses, cottages, and what streets are lined with."""
    streets = house.region.streets
    if house.levels >= 8:
        return table_of(house.styles.uses.high_house, streets.middle, streets.old)
    if house.levels <= 2 and house.area < 260.0:
        return table_of(streets.cottage)
    if house.draw < _OLD_SHARE:
        return table_of(streets.old)
    return table_of(streets.middle if house.draw < _MIDDLE_SHARE else streets.new)


#: In their order; the last knows always.
RULES: Sequence[Callable[[House], Table | None]] = (
    by_material_tag,
    place_of_worship,
    by_architecture_tag,
    shed_or_garage,
    works,
    tower,
    by_age,
    public_building,
    house_of_trade,
    home,
)


_WHITE: Rgb = (255, 255, 255)
_PALE_STONE: Rgb = (226, 222, 216)
_BACK_PLASTER: Rgb = (238, 234, 226)
_BACK_BRICK: Rgb = (255, 250, 240)
_GATES, _LOBBY = "ground_gates", "ground_lobby"


@dataclass(frozen=True)
class FacadeStyle:
    """The materials and colours of one building.

    Attributes
    ----------
    wall, ground, blank, roof, back
        Materials of upper floors, ground floor, walls without windows, roof, and upper floors away from streets.
    bay
        Wished width of a bay, metres.
    tint, ground_tint, roof_tint, back_tint
        What multiplies their pictures.
    hall
        One row of windows from a low base to the eaves, as churches have.
    gable, gable_tint
        What a front shows above its eaves; "": as its blank walls.
    reach
        How far a pitched roof reaches out over the walls, metres.
    eaves
        The finish of what reaches out (`records.Finish`).
    flat_tint
        Colour of a flat roof's gravel or felt.
    """

    wall: str
    ground: str
    blank: str
    roof: str
    bay: float
    tint: Rgb
    ground_tint: Rgb
    roof_tint: Rgb
    back: str = "wall_plain"
    back_tint: Rgb = (255, 255, 255)
    hall: bool = False
    gable: str = ""
    gable_tint: Rgb = (255, 255, 255)
    reach: float = 0.0
    eaves: str = "eaves"
    flat_tint: Rgb = (150, 148, 146)


class _Draws(NamedTuple):
    """A building's own draws, 0..1, by what they decide first."""

    family: float
    tint: float
    ground_floor: float
    roof: float
    roof_tint: float
    age: float
    variant: float
    bay: float


def facade_style_of(
    use: str, tags: Mapping[str, str], *, levels: int, area: float, region: str, random: np.random.Generator
) -> FacadeStyle:
    """Dress a building: by its material, architecture and colour tags, else by use, age, size and region, and a draw.

    `region` is what `region_of` says; an unknown one counts as northern.
    """
    known, place = styles(), styles().region(region)
    draws = _Draws(*map(float, random.random(8)))
    wall = family_of(use, tags, levels=levels, area=area, region=region, draw=(draws.family, draws.age))
    family = known.families[wall]
    tint = _tint(family, tags, draws)
    ground = _ground_floor(family, use, levels, draws)
    roof, roof_tint = _roof(family, tags, place, draws)
    back, back_tint = _back(family, tint, area, place, draws)
    wooden = family.wooden_gable or draws.variant < place.wooden_gables.get(wall, 0.0)
    return FacadeStyle(
        wall,
        ground,
        family.blank or ("blank_brick" if back == "wall_back_brick" else "blank_plaster"),
        roof,
        family.bay * (0.92 + 0.2 * draws.bay),
        tint,
        _ground_tint(family, known.ground_floor(ground), tint, draws),
        roof_tint,
        back,
        back_tint,
        family.hall,
        gable="blank_boards" if wooden else "",
        gable_tint=_colour_by_draw(known.wood, draws.bay) if wooden else _WHITE,
        reach=_reach(family, levels, place, draws),
        eaves="eaves_wood" if wooden or wall in place.wooden_eaves else "eaves",
        flat_tint=_colour_by_draw(known.felt, draws.variant),
    )


def _colour_by_draw(colours: Sequence[Rgb], draw: float) -> Rgb:
    return colours[int(draw * len(colours))]


def _palette(family: Family) -> Sequence[Rgb]:
    return family.tints or styles().plaster


def _tint(family: Family, tags: Mapping[str, str], draws: _Draws) -> Rgb:
    """Return the wall's colour: as tagged, else one of the family's."""
    given = colour_of(tags.get("building:colour", tags.get("building:color")))
    if given is None or not family.painted:
        return _colour_by_draw(_palette(family), draws.tint)
    # The pictures are paler than white plaster; brick is red of its own, so only a brick's shade is taken over.
    return mix_colours(_WHITE, _compensate_grey(given), 0.5 if family.own_colour else 1.0)


def _ground_floor(family: Family, use: str, levels: int, draws: _Draws) -> str:
    """Return the ground floor's picture: gates of works and garages, lobbies of high offices, else the family's."""
    if use in ("garage", "industrial") and not family.keeps_ground_floor:
        return _GATES
    if use in ("office", "hotel", "commercial") and levels >= 7 and draws.variant < 0.7:
        return _LOBBY
    return family.ground_floors[int(draws.ground_floor * len(family.ground_floors))]


def _ground_tint(family: Family, ground: GroundFloor, tint: Rgb, draws: _Draws) -> Rgb:
    """Return the ground floor's colour: its own, the wall's, or that of stone."""
    if ground.own_colour:
        return _WHITE
    if family.own_colour and not ground.as_wall:
        return _colour_by_draw(styles().stone, draws.bay)
    return mix_colours(_PALE_STONE, tint, 0.3) if ground.stone and draws.variant < 0.5 else tint


def _roof(family: Family, tags: Mapping[str, str], region: RegionalStyle, draws: _Draws) -> tuple[str, Rgb]:
    """Return what covers a pitched roof, and its colour."""
    known = styles()
    said = tags.get("roof:material", "")
    name = _roof_cover(said.lower(), region, draws.roof)
    if family.modern and not said:
        name = "roof_metal"
    shades = known.modern_roofs if family.modern else known.roofs[name].tints
    return name, colour_of(tags.get("roof:colour", tags.get("roof:color"))) or _colour_by_draw(shades, draws.roof_tint)


def _roof_cover(said: str, region: RegionalStyle, draw: float) -> str:
    for name, cover in styles().roofs.items():
        if (cover.word and cover.word in said) or said in cover.materials:
            return name
    return draw_by_share(table_of(region.roofs), draw)


def _back(family: Family, tint: Rgb, area: float, region: RegionalStyle, draws: _Draws) -> tuple[str, Rgb]:
    """Return what upper floors away from streets show, plainer than fronts, and its colour."""
    if not family.back or area <= 120.0:
        return family.name, tint
    if family.back == "wall_back_brick" or draws.variant < region.brick_backs:
        return "wall_back_brick", _BACK_BRICK
    return "wall_back", mix_colours(_BACK_PLASTER, tint, 0.5)


def _reach(family: Family, levels: int, region: RegionalStyle, draws: _Draws) -> float:
    """Return how far a pitched roof reaches out over the walls, metres."""
    if family.cornice == "always" or family.gable:
        return 0.0
    if family.hall or levels > 7:
        return 0.25
    return region.eaves * (0.8 + 0.4 * draws.ground_floor)


def distinct_styles(
    looks: Sequence[FacadeStyle], pairs: Sequence[tuple[int, int]], free: Sequence[bool]
) -> list[FacadeStyle]:
    """Give neighbours that would wear the same wall in the same colour different ones.

    Parameters
    ----------
    looks
        Of all buildings.
    pairs
        Neighbours, the earlier first, in order.
    free
        Whose colour the map does not say.
    """
    made = list(looks)
    known = styles().families
    for i, j in pairs:
        palette = _palette(known[made[j].wall])
        if made[i].wall != made[j].wall or made[i].tint != made[j].tint or not free[j] or made[j].tint not in palette:
            continue
        # Two steps on: neighbours in a palette are like each other.
        tint = palette[(palette.index(made[j].tint) + 2) % len(palette)]
        same = made[j].ground_tint == made[j].tint
        made[j] = replace(made[j], tint=tint, ground_tint=tint if same else made[j].ground_tint)
    return made


def mix_colours(a: Rgb, b: Rgb, share: float) -> Rgb:
    """Return a colour between two: `share` of the second."""
    r, g, b_ = (round(x + (y - x) * share) for x, y in zip(a, b, strict=True))
    return r, g, b_


def _compensate_grey(colour: Rgb) -> Rgb:
    """Return a facade's tagged colour made up for the grey of the picture it multiplies."""
    r, g, b = (min(round(c * 1.18) + 6, 255) for c in colour)
    return r, g, b
