"""NamedPlace places of OpenStreetMap: which tags make a place people go to, and of which of our categories."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.geo.osm import OsmData, Tags
from vico.world.model import Category
from vico.worldgen.facts.expendable import expendable

_FOOD = "restaurant cafe fast_food pub bar biergarten ice_cream food_court canteen"
_STORE = "pharmacy marketplace bureau_de_change car_rental money_transfer fuel bank post_office"
_OFFICE = (
    "embassy townhall courthouse police fire_station clinic doctors dentist hospital veterinary school university "
    "college kindergarten childcare driving_school language_school music_school prep_school coworking_space "
    "social_facility research_institute studio conference_centre public_building post_depot"
)
_FUN = (
    "cinema theatre nightclub casino arts_centre community_centre events_venue library social_centre gambling "
    "place_of_worship dojo planetarium public_bath spa internet_cafe"
)


def _all(text: str, category: Category) -> dict[str, Category]:
    return dict.fromkeys(text.split(), category)


_CATEGORIES: dict[str, dict[str, Category]] = {
    "tourism": {
        **_all("hotel hostel guest_house motel apartment chalet", Category.ACCOMMODATION),
        **_all("museum gallery attraction zoo theme_park aquarium", Category.ENTERTAINMENT),
        "viewpoint": Category.OPEN,
        "picnic_site": Category.OPEN,
    },
    "amenity": {
        **_all(_FOOD, Category.FOOD),
        **_all(_STORE, Category.STORE),
        **_all(_OFFICE, Category.OFFICE),
        **_all(_FUN, Category.ENTERTAINMENT),
        "fountain": Category.OPEN,
        "bus_station": Category.TRANSIT,
        "ferry_terminal": Category.TRANSIT,
    },
    "leisure": {
        **_all(
            "fitness_centre sports_centre dance bowling_alley amusement_arcade adult_gaming_centre escape_game sauna "
            "sports_hall ice_rink hackerspace arena",
            Category.ENTERTAINMENT,
        ),
        **_all("park garden playground pitch dog_park common nature_reserve miniature_golf bandstand", Category.OPEN),
    },
    "historic": _all("castle church monument", Category.ENTERTAINMENT),
    "railway": _all("station halt subway_entrance tram_stop train_station_entrance", Category.TRANSIT),
    "place": {"square": Category.OPEN},
    "natural": {"beach": Category.OPEN},
}
_ANY = (
    ("shop", Category.STORE),
    ("office", Category.OFFICE),
    ("craft", Category.STORE),
    ("healthcare", Category.OFFICE),
)
_CLOSED_VALUES = {"no", "vacant", "disused", "closed", "abandoned"}


@dataclass(frozen=True)
class NamedPlace:
    """Something with a name that people go to.

    Attributes
    ----------
    xy
        Where, metres, shape ``(2,)``.
    area
        Its area, None for points.
    exact
        False where `xy` may say which building it is in, but not where its door is.
    """

    id: str
    name: str
    category: Category
    kind: str
    xy: NDArray[np.float64]
    tags: Tags
    area: shapely.Geometry | None
    exact: bool = True


def named_places(osm: OsmData) -> list[NamedPlace]:
    """Everything with a name and a category, within the square."""
    found: list[NamedPlace] = []
    rows = [(f"n{n.id}", n.xy, n.tags, None) for n in osm.nodes]
    for area in osm.areas:
        with expendable(area.id):
            centre = np.array(area.polygon.representative_point().coords[0])
            rows.append((area.id, centre, area.tags, area.polygon))
    for key, xy, tags, shape in rows:
        name = tags.get("name") or tags.get("brand") or (tags.get("operator") if "shop" in tags else None)
        if not name or np.abs(xy).max() > osm.half:
            continue
        what = category_of(tags, shape is not None)
        if what is not None:
            found.append(NamedPlace(key, name.strip(), what[0], what[1], xy, tags, shape))
    return found


def category_of(tags: Tags, is_area: bool) -> tuple[Category, str] | None:
    """Return the category that tags mean, and the value that says so; None if they mean no place."""
    for key, values in _CATEGORIES.items():
        value = tags.get(key, "").split(";")[0]
        if value in values:
            return values[value], value
    for key, category in _ANY:
        value = tags.get(key, "no").split(";")[0]
        if value not in _CLOSED_VALUES:
            return category, value if value != "yes" else key
    if is_area and tags.get("highway") == "pedestrian" and "building" not in tags:
        return Category.OPEN, "square"
    return None
