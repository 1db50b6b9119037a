"""Areas that hold several things of a kind: stalls of a market, tables outside, play equipment, flower beds."""

from __future__ import annotations

import math

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay
from vico.geo.osm import OsmArea, OsmData
from vico.geometry import distance
from vico.seeds import rng
from vico.worldgen.facts.expendable import expendable
from vico.worldgen.objects.kinds import on_the_ground, thing_of
from vico.worldgen.objects.trees import spread
from vico.worldgen.objects.wishes import Wish

_PLAY = ("swing", "springy", "seesaw", "climbing_frame", "sandpit", "roundabout", "swing_nest")
_BEDS = ("flowers", "flowers_violet", "flowers_yellow")
_LARGE = 2500.0  # square metres: what is larger is no single thing


def group_wishes(osm: OsmData, openings: BaseGeometry, half: float, seed: int, *, where: str = "") -> list[Wish]:
    """Wish for what stands in mapped areas."""
    found: list[Wish] = []
    played = [n.xy for n in osm.nodes if "playground" in n.tags]
    for area in osm.areas:
        tags = area.tags
        if "building" in tags or "building:part" in tags or not on_the_ground(tags):
            continue
        if not area.polygon.intersects(shapely.box(-half, -half, half, half)):
            continue
        with expendable(area.id):
            found += _of_area(area, openings, played, seed, where)
    return found


def _of_area(
    area: OsmArea, openings: BaseGeometry, played: list[NDArray[np.float64]], seed: int, where: str
) -> list[Wish]:
    """Wish for what stands in one area; `played` is where play equipment is mapped piece by piece."""
    tags, random = area.tags, rng(seed, "group", area.id)
    if tags.get("amenity") in ("marketplace", "market"):
        names = ("market_stall", "market_stall_green")
        return _grid(area, names, (3.2, 4.4), 30, random, keep=openings if _narrow(area) else None)
    if tags.get("leisure") == "outdoor_seating" or tags.get("amenity") == "biergarten":
        names = ("cafe_parasol", "cafe_table") if tags.get("leisure") else ("picnic_table", "picnic_table")
        return _grid(area, names, (3.1, 3.1), 24, random)
    if tags.get("landuse") == "flowerbed" or tags.get("garden:type") == "flower_bed":
        return _flower_bed(area, random)
    if tags.get("leisure") == "playground":
        return _playground(area, played, random)
    if tags.get("leisure") == "pitch":
        return _pitch(area)
    if tags.get("leisure") == "fitness_station":
        return [Wish(area.id, "fitness_station", _middle(area))]
    return _single(area, seed, where)


def _flower_bed(area: OsmArea, random: np.random.Generator) -> list[Wish]:
    inner = overlay.buffer(area.polygon, -0.35)
    name = _BEDS[int(random.integers(3))]
    return [
        Wish(f"{area.id}.{k}", name, xy, float(random.uniform(-np.pi, np.pi)), 0.8, reach=0.0)
        for k, xy in enumerate(spread(inner, 1.7, 60, random, least=0.98))
    ]


def _middle(area: OsmArea) -> NDArray[np.float64]:
    return np.array(area.polygon.representative_point().coords[0])


def _narrow(area: OsmArea) -> bool:
    """Whether a market is but a widening of streets, which must stay open."""
    return bool(overlay.buffer(area.polygon, -6.0).is_empty)


def _single(area: OsmArea, seed: int, where: str) -> list[Wish]:
    """Wish for an area that is one thing."""
    size = float(area.polygon.area)
    name = thing_of(area.tags, where=where, random=rng(seed, "thing", area.id))
    if name is None or size > _LARGE or name in ("toilets", "fuel_pump") or name.startswith("sign"):
        return []
    xy = _middle(area)
    if name.startswith("fountain"):
        if size < 5.0:
            return [Wish(area.id, "fountain", xy, None, float(np.clip(math.sqrt(size / math.pi) / 2.0, 0.4, 1.0)))]
        side = math.sqrt(size)
        name = "fountain" if shapely.minimum_bounding_radius(area.polygon) < 0.62 * side else "fountain_jets"
        wide = 2.0 * math.sqrt(size / math.pi) if name == "fountain" else side
        return [Wish(area.id, name, xy, _along(area), float(np.clip(wide / 4.2, 0.5, 2.6)))]
    if name.startswith("bicycle_"):
        return _stands(area)
    if name == "motorcycles":
        return _grid(area, ("motorcycles",), (2.4, 2.2), 12, rng(seed, "group", area.id))
    return [Wish(area.id, name, xy)]


def _along(area: OsmArea) -> float:
    """Direction of an area's longer side."""
    box = shapely.oriented_envelope(area.polygon)
    if box.geom_type != "Polygon":
        return 0.0
    corners = np.array(box.exterior.coords[:3])
    first, second = corners[1] - corners[0], corners[2] - corners[1]
    side = first if np.hypot(*first) >= np.hypot(*second) else second
    return math.atan2(side[1], side[0])


def _stands(area: OsmArea) -> list[Wish]:
    """Stands along the longer side of a bicycle park."""
    box = shapely.oriented_envelope(area.polygon)
    corners = np.array(box.exterior.coords[:3])
    sides = sorted(distance(corners[k + 1], corners[k]) for k in range(2))
    yaw = _along(area)
    along = np.array([math.cos(yaw), math.sin(yaw)])
    count = max(1, min(8, int(sides[1] // 3.6)))
    middle = np.array(box.centroid.coords[0])
    names = ("bicycle_parking", "bicycle_parking_empty")
    return [
        Wish(f"{area.id}.{k}", names[k % 2], middle + along * (k + 0.5 - count / 2) * 3.5, yaw - math.pi / 2)
        for k in range(count)
    ]


def _grid(
    area: OsmArea,
    names: tuple[str, ...],
    step: tuple[float, float],
    most: int,
    random: np.random.Generator,
    keep: BaseGeometry | None = None,
) -> list[Wish]:
    """Things in rows along the longer side of an area."""
    yaw = _along(area)
    u, v = np.array([math.cos(yaw), math.sin(yaw)]), np.array([-math.sin(yaw), math.cos(yaw)])
    middle = np.array(area.polygon.centroid.coords[0])
    reach = float(shapely.minimum_bounding_radius(area.polygon))
    n = int(reach // min(step)) + 1
    inner = overlay.buffer(area.polygon, -0.5 * min(step) * 0.8)
    if inner.is_empty:
        inner = area.polygon
    if keep is not None:
        inner = overlay.difference(inner, keep)
    shapely.prepare(inner)
    found: list[Wish] = []
    for j in range(-n, n + 1):
        for i in range(-n, n + 1):
            xy = middle + u * i * step[0] + v * j * step[1]
            if len(found) < most and inner.contains(shapely.Point(xy)):
                facing = yaw + math.pi / 2 + (math.pi if j % 2 else 0.0)
                name = names[int(random.integers(len(names)))]
                found.append(Wish(f"{area.id}.{len(found)}", name, xy, facing, reach=0.5))
    return found


def _playground(area: OsmArea, played: list[NDArray[np.float64]], random: np.random.Generator) -> list[Wish]:
    """Equipment by the ground's size, unless somebody mapped it piece by piece."""
    shape = area.polygon
    if any(shape.contains(shapely.Point(xy)) for xy in played):
        return []
    spots = spread(overlay.buffer(shape, -1.6), 30.0, 9, random, least=0.85)
    if not len(spots):
        return [Wish(area.id, "springy", _middle(area))]
    names = ["play_tower" if shape.area > 60 else "slide", *np.array(_PLAY)[random.permutation(len(_PLAY))].tolist()]
    names.append("bench")
    yaws = random.uniform(-np.pi, np.pi, len(spots))
    return [
        Wish(area.id if k == 0 else f"{area.id}.{k}", str(name), xy, float(yaw))
        for k, (name, xy, yaw) in enumerate(zip(names, spots, yaws, strict=False))
    ]


def _pitch(area: OsmArea) -> list[Wish]:
    """Goals and hoops at the ends of a pitch."""
    sport = area.tags.get("sport", "")
    name = "basketball_hoop" if "basketball" in sport else "goal"
    if not any(s in sport for s in ("basketball", "soccer", "multi", "football", "futsal", "handball")):
        if "table_tennis" in sport:
            return [Wish(area.id, "table_tennis", _middle(area))]
        return [Wish(area.id, "chess_table", _middle(area))] if "chess" in sport else []
    yaw = _along(area)
    along = np.array([math.cos(yaw), math.sin(yaw)])
    ring = shapely.oriented_envelope(area.polygon)
    if ring.geom_type != "Polygon":
        return []
    corners = np.array(ring.exterior.coords[:3])
    long = max(distance(corners[k + 1], corners[k]) for k in range(2))
    middle = np.array(ring.centroid.coords[0])
    scale = float(np.clip(long / 60.0, 1.0, 2.0)) if name == "goal" else 1.0
    out = long / 2 - 1.0 * scale
    return [
        Wish(f"{area.id}.0", name, middle + along * out, yaw + math.pi, scale),
        Wish(f"{area.id}.1", name, middle - along * out, yaw, scale),
    ]
