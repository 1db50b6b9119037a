"""One solid decided from its tags: heights above the base, storeys, roof. OSM wiki, Simple 3D Buildings."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon

from vico.geo.osm import Tags
from vico.geo.quantities import Kind, quantity, read
from vico.world.model import OPEN_KINDS
from vico.worldgen.facts.outlines.heights import STOREY, kind_eaves, said_height, said_levels
from vico.worldgen.facts.outlines.plans import PartPlan
from vico.worldgen.facts.outlines.roof_shapes import Roof, inradius, shape_named

SMALL_KINDS = {"kiosk", "garage", "garages", "shed", "hut", "carport", "service", "toilets", "pavilion", "greenhouse"}

_INHERITED = {
    "building",
    "building:colour",
    "building:material",
    "building:facade:material",
    "roof:shape",
    "roof:colour",
    "roof:material",
    "name",
}
_HIPPED = ("hipped", "half-hipped", "side_hipped", "side_half-hipped", "hipped-and-gabled", "gabled", "crosspitched")


def part_of(
    polygon: Polygon, tags: Tags, outer: Tags, use: str, levels: int, flat: bool, random: np.random.Generator
) -> PartPlan:
    """Decide one solid.

    Parameters
    ----------
    polygon, tags
        Its outline, and what is said of it.
    outer
        Tags of the building it is part of; empty for a whole building.
    use, levels
        What the building is used for, and its storeys where nothing is said.
    flat
        Whether untagged town roofs are flat here.
    random
        The building's own stream.
    """
    draw = random.random(4)
    merged = _with_inherited(tags, outer)
    kind = tags.get("building", tags.get("building:part", "yes"))
    open_below = kind in OPEN_KINDS or tags.get("wall") == "no"
    said = said_levels(tags)
    usual_eaves = kind_eaves(merged, use, polygon.area) if said is None and not outer else None
    may_vary = said is None and not outer and usual_eaves is None
    storeys = said or _unsaid_storeys(kind, levels, may_vary, float(draw[0]))
    roof = _roof(polygon, merged, use, storeys, flat, draw, open_below)
    allowance = 0.8 if use in ("retail", "commercial", "office", "civic", "hotel") else 0.4
    height = said_height(tags)
    low = _said_low(tags, allowance)
    if height is not None:
        roof = _roof_below(height, roof, tags, low)
        eaves = height - (roof.height if roof.shape != "flat" else 0.0)
    elif open_below:
        eaves = 4.4
    elif usual_eaves is not None:
        eaves = usual_eaves
        storeys = 1 if use == "religious" else max(round(eaves / STOREY), 1)
    else:
        eaves = max(storeys * STOREY + allowance, 2.6)
    if open_below and low <= 0.0:
        low = max(eaves - 0.45, 0.5)
        storeys = 0
    if height is None and low > max(eaves - 1.0, 0.0):
        # Only its first level is said: it begins there and has its storeys above.
        eaves = low + max(storeys, 1) * STOREY
    low = min(low, eaves - 0.05) if low > 0 else 0.0
    if said is None and storeys and use != "religious":
        storeys = max(round((eaves - low - 0.6) / STOREY), 1)
    return PartPlan(polygon, low, eaves, storeys, roof, merged)


def _with_inherited(tags: Tags, outer: Tags) -> dict[str, str]:
    """Return the tags of a part, with those of its building that hold for it too."""
    merged = {**{k: v for k, v in outer.items() if k in _INHERITED}, **tags}
    measured = outer and "height" in tags and "roof:shape" not in tags
    if measured and outer.get("roof:shape") not in (None, "flat"):
        # A part of a measured model that says nothing of a roof has none of its own.
        merged.pop("roof:shape", None)
    return merged


def _unsaid_storeys(kind: str, levels: int, may_vary: bool, draw: float) -> int:
    """Storeys where nobody says them: one in what is small; in high houses sometimes one more or less than usual."""
    if kind in SMALL_KINDS:
        return 1
    if may_vary and levels >= 3:
        return levels + (-1 if draw < 0.2 else 1 if draw > 0.8 else 0)
    return levels


def _roof_below(height: float, roof: Roof, tags: Tags, low: float) -> Roof:
    """Return a roof that ends at a stated height: lower where its walls would not be seen."""
    if quantity(tags, "roof:height") is None and low <= 0.0:
        roof = replace(roof, height=min(roof.height, 0.4 * height))
    room = height - max(low, 0.0) - (0.05 if low > 0.0 else 0.5)
    return replace(roof, height=max(min(roof.height, room), 0.0))


def _said_low(tags: Tags, allowance: float) -> float:
    """Height of the underside: stated, else from the first level; 0 on the ground."""
    low = quantity(tags, "min_height") or quantity(tags, "building:min_height")
    if low is None:
        bottom = quantity(tags, "building:min_level") or quantity(tags, "min_level")
        # The same allowance as for eaves, so that what is stacked meets and does not overlap.
        low = bottom * STOREY + allowance if bottom else 0.0
    return low if 0.0 < low < 900.0 else 0.0


# Height of a roof by the depth of its outline, and at most, metres.
_RISES = {
    "dome": (1.0, math.inf),
    "onion": (2.1, math.inf),
    "round": (0.6, 8.0),
    "gambrel": (0.95, 5.5),
    "skillion": (0.35, 4.0),
    "butterfly": (0.35, 4.0),
    "sawtooth": (0.5, 3.0),
    "gabled_row": (0.5, 3.0),
}


def _roof(
    polygon: Polygon, tags: Tags, use: str, storeys: int, flat: bool, draw: NDArray[np.float64], open_below: bool
) -> Roof:
    """Return the roof that is tagged, else one that suits use, size and region."""
    shape = shape_named(tags.get("roof:shape"))
    area = polygon.area
    deep = inradius(polygon)
    tiers = quantity(tags, "roof:levels")
    if shape is None:
        if open_below:
            shape = "flat"
        else:
            # Storeys within the roof are said of pitched roofs; a roof said to have none is flat.
            shape = "flat" if tiers == 0 else usual_roof(use, storeys, flat and not tiers, area, deep, float(draw[1]))
    if shape == "flat":
        return Roof("flat", 0.0 if open_below or area < 60.0 else 0.5 + 0.5 * float(draw[2]))
    if shape in ("gabled", "round", "gambrel", "saltbox") and deep < 0.5:
        return Roof("flat", 0.0)
    height = quantity(tags, "roof:height")
    if height is None:
        height = _usual_height(shape, tags, use, deep, float(draw[2]))
    return Roof(shape, float(np.clip(height, 0.3, 90.0)), _direction(polygon, tags, shape))


def _usual_height(shape: str, tags: Tags, use: str, deep: float, draw: float) -> float:
    """Return how high a roof rises whose height nobody says: by its levels or its angle, else by shape and depth."""
    tiers, angle = quantity(tags, "roof:levels"), quantity(tags, "roof:angle")
    if tiers:
        return 2.8 * min(tiers, 4.0)
    if angle and 3.0 < angle < 75.0:
        return deep * math.tan(math.radians(angle))
    if shape in ("mansard", "quadruple_saltbox", "double_saltbox"):
        return min(2.6 + 0.8 * draw, 1.2 * deep)
    if shape == "pyramidal" and (use == "religious" or tags.get("building:part") == "tower") and deep < 6.0:
        return 3.0 * deep
    if shape in _RISES:
        rise, highest = _RISES[shape]
        return min(rise * deep, highest)
    pitch = 52.0 if use == "religious" else 28.0 + 12.0 * draw
    return min(deep * math.tan(math.radians(pitch)), 12.0 if use == "religious" else 5.5)


def usual_roof(use: str, storeys: int, flat: bool, area: float, deep: float, draw: float) -> str:
    """Return the roof of a building that doesn't say."""
    if use == "religious":
        return "gabled"
    if area < 45.0 or storeys >= 8 or use in ("industrial", "garage", "transport") or deep > 24.0:
        return "flat"
    # Sheds and halls of trade are flat; a narrow house with a shop in it, in a town of pitched roofs, is not.
    if use in ("retail", "other") and (flat or storeys < 2 or deep > 9.0):
        return "flat"
    if storeys <= 2 and area < 260.0:
        return "gabled" if draw < 0.65 else "hipped" if draw < 0.9 else "half-hipped"
    if flat:
        return "flat"
    if use in ("office", "commercial"):
        return "flat" if draw < 0.45 else "mansard" if draw < 0.65 else "hipped"
    return "hipped" if draw < 0.5 else "mansard" if draw < 0.7 else "gabled" if draw < 0.88 else "flat"


_COMPASS = "N NNE NE ENE E ESE SE SSE S SSW SW WSW W WNW NW NNW"
_POINTS = {name: 22.5 * k for k, name in enumerate(_COMPASS.split(" "))}
_WORDS = {"NORTH": "N", "EAST": "E", "SOUTH": "S", "WEST": "W"}


def bearing_of(text: str | None) -> float | None:
    """Degrees clockwise from north of ``135``, ``135°``, ``SW``, ``south-west`` or ``north_west``; None for others."""
    if not text:
        return None
    word = text.strip().upper().rstrip("°").strip()
    if word not in _POINTS:
        joined = word.replace("-", "").replace("_", "").replace(" ", "")
        for long, short in _WORDS.items():
            joined = joined.replace(long, short)
        word = joined if joined in _POINTS else word
    bearing = _POINTS.get(word)
    return bearing if bearing is not None else read(word, Kind.ANGLE).value


def _direction(polygon: Polygon, tags: Tags, shape: str) -> float | None:
    """Yaw of a roof's ridge or of a skillion's fall, radians; tags give compass bearings of the fall."""
    bearing = bearing_of(tags.get("roof:direction"))
    orientation = tags.get("roof:orientation", "").strip().lower()
    if bearing is None and orientation not in ("", "along", "across"):
        bearing = bearing_of(orientation)
    if bearing is not None:
        yaw = math.radians(90.0 - bearing)
        if shape in ("skillion", "side_hipped", "side_half-hipped"):
            return yaw
        # The long slope of an uneven roof lies left of its ridge.
        return yaw - math.pi / 2
    corners = np.asarray(shapely.minimum_rotated_rectangle(polygon).exterior.coords)[:3]
    sides = np.diff(corners, axis=0)
    side = sides[int(np.hypot(*sides.T).argmax())]
    yaw = math.atan2(side[1], side[0])
    if shape == "skillion":
        return yaw + math.pi / 2
    return yaw + math.pi / 2 if orientation == "across" else None
