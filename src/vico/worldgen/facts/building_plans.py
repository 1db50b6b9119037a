"""Plans of buildings: records between the deciding and the building, and the solids that a building consists of.

A solid (`PartPlan`) is decided from its tags (`part_of`): heights above the base, storeys, roof. OSM wiki, Simple 3D
Buildings. A measured roof is divided into parts instead (`parts_of_roof`), one for each stretch of roof without a step
in it: a tower beside a hall, a house with a lower wing has eaves of its own, up to which its walls have windows. Small
pieces (dormers, lift houses, chimneys) stay with the roof they sit on.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import MultiPolygon, Polygon

from vico.geo import overlay
from vico.geo.buildings import RoofFacet, form_of
from vico.geo.osm import Tags
from vico.geo.overlay import OverlayError
from vico.geo.quantities import Kind, quantity, read
from vico.world.model import OPEN_KINDS, Dropped
from vico.worldgen.facts.building_heights import STOREY, kind_eaves, tagged_height, tagged_levels
from vico.worldgen.facts.fault_isolation import NamedShape
from vico.worldgen.facts.roofs import Roof, RoofCell, inradius, measured_solid, rings_of, roof_cells, shape_named

_TALL = 2.2  # metres: what begins higher up is walked under

RULES = ("height tag", "levels tag", "parts", "kind", "neighbours", "area", "town")
"""How a height was decided, strongest first: tagged, by its parts, by the kind of building, by neighbours of its use
within 100 m, by the nearest of any use, by how dense the town stands."""


@dataclass(frozen=True)
class PartPlan:
    """A solid to build, heights in metres above the building's base.

    Attributes
    ----------
    low
        Underside; 0 where it stands on the ground.
    eaves
        Where the roof begins.
    levels
        Storeys between ground (or underside) and eaves.
    finish
        Empty for what has rooms; else what it is beside (`finishes.FINISHES`): cornice, eaves, dormer, chimney, ...
    mesh
        The closed solid itself where outline and roof don't say it: points (metres, height above the building's
        base), shape ``(n, 3)``, and faces, shape ``(m, 3)``.
    """

    polygon: Polygon
    low: float
    eaves: float
    levels: int
    roof: Roof
    tags: Tags
    finish: str = ""
    mesh: tuple[NDArray[np.float64], NDArray[np.int64]] | None = field(default=None, compare=False)

    @property
    def top(self) -> float:
        """The highest point."""
        return self.eaves + self.roof.height


@dataclass(frozen=True)
class BuildingOrigin:
    """Where a building's facts are from: ``osm``, kind and file of another source, a rule; empty: by `rule` and tags.

    Attributes
    ----------
    footprint, height, roof
        Of its outline, its height and its roof; a roof built of a model's surfaces is ``KIND:FILE surfaces``.
    """

    footprint: str
    height: str = ""
    roof: str = ""


@dataclass(frozen=True)
class BuildingPlan:
    """A building decided but not yet built.

    Attributes
    ----------
    shops
        Named shops, restaurants and the like inside it or at its walls.
    rooftop
        What sits on `parts` or holds them up.
    rule
        How its height was decided, one of `RULES`.
    origin
        Where its facts are from; None where only the map was asked.
    """

    id: str
    name: str | None
    use: str
    tags: Tags
    outline: Polygon
    levels: int
    shops: int
    parts: list[PartPlan]
    rooftop: list[PartPlan] = field(default_factory=list)
    rule: str = "town"
    origin: BuildingOrigin | None = None

    @property
    def solids(self) -> list[PartPlan]:
        """Everything to build."""
        return [*self.parts, *self.rooftop]


@dataclass(frozen=True)
class BuildingPlans:
    """The buildings of a place, decided but not yet built.

    Attributes
    ----------
    plans
        In the order of their ids, without overlaps among their solids.
    dropped
        What the map has and the place has not, with reasons.
    """

    plans: list[BuildingPlan]
    dropped: list[Dropped]

    def standing(self) -> list[NamedShape]:
        """Return the footprints of what stands on the ground: parts that begin lower than a person is tall, metres."""
        return [NamedShape(plan.id, part.polygon) for plan in self.plans for part in plan.parts if part.low < _TALL]


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
    said = tagged_levels(tags)
    usual_eaves = kind_eaves(merged, use, polygon.area) if said is None and not outer else None
    may_vary = said is None and not outer and usual_eaves is None
    storeys = said or _untagged_storeys(kind, levels, may_vary, float(draw[0]))
    roof = _roof(polygon, merged, use, storeys, flat, draw, open_below)
    allowance = 0.8 if use in ("retail", "commercial", "office", "civic", "hotel") else 0.4
    height = tagged_height(tags)
    low = _tagged_low(tags, allowance)
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


def _untagged_storeys(kind: str, levels: int, may_vary: bool, draw: float) -> int:
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


def _tagged_low(tags: Tags, allowance: float) -> float:
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
            shape = "flat" if tiers == 0 else _usual_roof(use, storeys, flat and not tiers, area, deep, float(draw[1]))
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


def _usual_roof(use: str, storeys: int, flat: bool, area: float, deep: float, draw: float) -> str:
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


_STEP = 0.35  # metres between roofs that are two
_OWN_PART = 12.0  # square metres from which on a stretch of roof is a part of its own
_SHARE = 0.03  # and of the building
OUTLINE_TOLERANCE = 0.05  # metres of outline detail that is not seen but costs triangles
_LEAST_EAVES = 2.2
_PARAPET = 0.6  # metres, of level roofs as large as those that get one without a model
_WITH_PARAPET = 60.0  # square metres


def parts_of_roof(
    outline: Polygon | MultiPolygon, facets: Sequence[RoofFacet], tags: Mapping[str, str]
) -> list[PartPlan]:
    """Return the parts of a building under a measured roof.

    Parameters
    ----------
    outline
        Of the building, metres.
    facets
        The surfaces of its roof, heights above its ground.
    tags
        Of the building.

    Raises
    ------
    OverlayError
        If they can't be made; the building then needs a roof that is fitted.
    """
    parts: list[PartPlan] = []
    for piece in overlay.polygons_of(overlay.simplify(outline, OUTLINE_TOLERANCE), 2.0):
        cells = roof_cells(piece, facets)
        for members in _stretches(cells, piece.area):
            parts += _parts([cells[k] for k in members], facets, tags)
    if not parts:
        raise OverlayError("nothing of its outline lies under its roof")
    return parts


def _stretches(cells: Sequence[RoofCell], area: float) -> list[list[int]]:
    """Cells that are one stretch of roof; small stretches are joined to the one they have most edge in common with."""
    group = list(range(len(cells)))

    def root(k: int) -> int:
        while group[k] != k:
            group[k] = group[group[k]]
            k = group[k]
        return k

    shared: list[tuple[int, int, float]] = []
    for one, two, length, step in _common_edges(cells):
        if step < _STEP:
            group[max(root(one), root(two))] = min(root(one), root(two))
        else:
            shared.append((one, two, length))
    least = max(_OWN_PART, _SHARE * area)
    while True:
        size: dict[int, float] = {}
        for k, cell in enumerate(cells):
            size[root(k)] = size.get(root(k), 0.0) + cell.polygon.area
        lengths: dict[tuple[int, int], float] = {}
        for one, two, length in shared:
            a, b = root(one), root(two)
            if a != b:
                lengths[a, b] = lengths.get((a, b), 0.0) + length
                lengths[b, a] = lengths.get((b, a), 0.0) + length
        small = sorted((size[a], a) for a in size if size[a] < least and any(pair[0] == a for pair in lengths))
        if not small:
            break
        a = small[0][1]
        into = max((length, -b) for (x, b), length in lengths.items() if x == a)[1]
        group[max(a, -into)] = min(a, -into)
    made: dict[int, list[int]] = {}
    for k in range(len(cells)):
        made.setdefault(root(k), []).append(k)
    return list(made.values())


def _common_edges(cells: Sequence[RoofCell]) -> list[tuple[int, int, float, float]]:
    """Pairs of cells side by side: the length of each edge, metres, and the larger step in height along it."""
    seen: dict[tuple[float, ...], tuple[int, float, float]] = {}
    found: list[tuple[int, int, float, float]] = []
    for k, cell in enumerate(cells):
        for ring, heights in zip(rings_of(cell.polygon), cell.heights, strict=True):
            for i in range(len(ring)):
                j = (i + 1) % len(ring)
                a, b = (float(ring[i][0]), float(ring[i][1])), (float(ring[j][0]), float(ring[j][1]))
                other = seen.pop((*b, *a), None)
                if other is None:
                    seen[(*a, *b)] = (k, float(heights[i]), float(heights[j]))
                elif other[0] != k:
                    step = max(abs(other[1] - float(heights[j])), abs(other[2] - float(heights[i])))
                    found.append((other[0], k, float(np.hypot(a[0] - b[0], a[1] - b[1])), step))
    return found


def _parts(cells: Sequence[RoofCell], facets: Sequence[RoofFacet], tags: Mapping[str, str]) -> list[PartPlan]:
    """Return the parts under one stretch of roof."""
    under: dict[int, list[Polygon]] = {}
    for cell in cells:
        under.setdefault(cell.facet, []).append(cell.polygon)
    # Only what of each surface lies over this stretch decides its form.
    seen = [
        RoofFacet(piece, facets[k].plane) for k, shapes in under.items() for piece in overlay.polygons_of(
            overlay.union_all(shapes), 0.01)
    ]  # fmt: skip
    form = form_of(seen)
    whole = overlay.union_all([cell.polygon for cell in cells])
    made: list[PartPlan] = []
    for piece in overlay.polygons_of(overlay.simplify(whole, 0.02), 1.0):
        eaves = max(form.eaves, _LEAST_EAVES)
        levels = _levels(tags, eaves)
        level = form.shape == "flat" and _spread(seen) < 0.4
        parapet = _PARAPET if piece.area >= _WITH_PARAPET else 0.0
        plain = PartPlan(piece, 0.0, eaves, levels, Roof("flat", parapet if level else 0.0), dict(tags))
        if level:
            made.append(plain)
            continue
        over = tuple(facets[k].moved(up=-eaves) for k in sorted(under))
        x, y = _middle(piece)
        near_origin = shapely.transform(piece, lambda xy, middle=(x, y): xy - middle)
        solid = measured_solid(near_origin, -eaves, [facet.moved(east=-x, north=-y) for facet in over])
        *_, top = solid.bounding_box()
        roof = Roof(form.shape, round(max(top, 0.0), 3), None, over)
        made.append(replace(plain, eaves=eaves, roof=roof))
    return made


def _spread(facets: Sequence[RoofFacet]) -> float:
    """Height between the lowest and the highest of level surfaces."""
    heights = np.concatenate([facet.height(np.asarray(facet.polygon.exterior.coords)[:, :2]) for facet in facets])
    return float(heights.max() - heights.min())


def _middle(polygon: Polygon) -> tuple[float, float]:
    x, y = (round(v) for v in polygon.centroid.coords[0])
    return float(x), float(y)


def _levels(tags: Mapping[str, str], eaves: float) -> int:
    """Storeys below the eaves: as said, where that can be; else by height."""
    said = quantity(tags, "building:levels")
    if said is not None and 1 <= said <= 150 and 2.2 <= eaves / said <= 6.5:
        return max(round(said), 1)
    return max(round((eaves - 0.6) / STOREY), 1)
