"""Which family of facade a building belongs to: by what the map says, else by use, height, age and region.

`family_of` asks the rules of `RULES` in their order; the first that knows decides.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from vico.worldgen.facades.catalogue import FacadeStyles, styles
from vico.worldgen.facades.records import RegionalStyle, Shares
from vico.worldgen.facades.tags import year_of

_ORDINARY_HOUSES = ("house", "residential", "apartments", "office", "yes")  # what a church became
_SHEDS = ("shed", "hut", "barn", "cabin", "farm_auxiliary", "stable")
_TOWN_USES = ("residential", "other", "retail", "commercial", "hotel")
_TRADE_USES = ("office", "commercial", "retail", "transport", "hotel")
_OLD, _POST_WAR = 1920, 1975  # years that ages of houses begin and end with
_TOWN_HOUSE_YEAR = 1880  # of what is old, but nobody says since when
_OLD_TOWN_SHARE = 0.6  # of houses on small plots that are old
_OLD_SHARE, _MIDDLE_SHARE = 0.62, 0.86  # of houses that nothing is known of: old ones, and old and middle ones
_MODERN_OFFICES, _MODERN_SHOPS = 0.7, 0.4  # shares that do not look like the old houses beside them

#: Families with their shares; one may come twice.
Table = Sequence[tuple[str, float]]


@dataclass(frozen=True)
class House:
    """What is known of a building whose facade is looked for.

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
    return picked(table, draw[0])


def picked(table: Table, draw: float) -> str:
    """Return one of the names, by their shares."""
    edges = np.cumsum([share for _, share in table])
    return table[int(np.searchsorted(edges, min(draw, 0.999999) * edges[-1], side="right"))][0]


def table_of(*shares: Shares) -> Table:
    """Return several families' shares as one table."""
    return [entry for some in shares for entry in some.items()]


def of_its_material(house: House) -> Table | None:
    """Decide by ``building:material``."""
    said = house.tags.get("building:material", house.tags.get("building:facade:material", "")).lower()
    return table_of(house.region.materials.get(said) or house.styles.materials.get(said, {}))


def place_of_worship(house: House) -> Table | None:
    """Decide by use: a place of worship that is not in an ordinary house."""
    if house.use == "religious" and house.tags.get("building") not in _ORDINARY_HOUSES:
        return table_of(house.styles.uses.church)
    return None


def of_its_architecture(house: House) -> Table | None:
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


def of_its_age(house: House) -> Table | None:
    """Decide by the year it was built in, told or supposed, and the customs of that time."""
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
    of_its_material,
    place_of_worship,
    of_its_architecture,
    shed_or_garage,
    works,
    tower,
    of_its_age,
    public_building,
    house_of_trade,
    home,
)
