"""Named places of OpenStreetMap: which tags make a place people go to, and of which of our categories."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.geo.osm import OsmData, Tags
from vico.world.model import Category
from vico.worldgen.facts.expendable import expendable
from vico.worldgen.facts.place_words import categories

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
    """Everything with a name and a category, within the map's box."""
    found: list[NamedPlace] = []
    rows = [(f"n{n.id}", n.xy, n.tags, None) for n in osm.nodes]
    for area in osm.areas:
        with expendable(area.id):
            centre = np.array(area.polygon.representative_point().coords[0])
            rows.append((area.id, centre, area.tags, area.polygon))
    for key, xy, tags, shape in rows:
        name = tags.get("name") or tags.get("brand") or (tags.get("operator") if "shop" in tags else None)
        if not name or not osm.holds(xy):
            continue
        what = category_of(tags, shape is not None)
        if what is not None:
            found.append(NamedPlace(key, name.strip(), what[0], what[1], xy, tags, shape))
    return found


def category_of(tags: Tags, is_area: bool) -> tuple[Category, str] | None:
    """Return the category that tags mean, and the value that says so; None if they mean no place."""
    for key, values in categories().tables:
        value = tags.get(key, "").split(";")[0]
        if value in values:
            return values[value], value
    for key, category in categories().any.items():
        value = tags.get(key, "no").split(";")[0]
        if value not in _CLOSED_VALUES:
            return category, value if value != "yes" else key
    if is_area and tags.get("highway") == "pedestrian" and "building" not in tags:
        return Category.OPEN, "square"
    return None
