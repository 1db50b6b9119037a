"""Street objects and plants: every thing OpenStreetMap maps at its place, with a model, a facing and a size."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from vico.assets.model import Model
from vico.assets.street import street_models
from vico.geo.osm import OsmData, Tags
from vico.world.heights import HeightField
from vico.world.model import FIRST_OBJECT, Dropped, Transit
from vico.world.objects import FEET, Objects
from vico.world.seeds import rng

_AMENITIES = {
    "bench": "bench", "waste_basket": "waste_basket", "waste_disposal": "recycling", "recycling": "recycling",
    "bicycle_parking": "bicycle_parking", "fountain": "fountain", "post_box": "post_box", "telephone": "telephone",
    "vending_machine": "vending_machine", "atm": "atm", "drinking_water": "drinking_water",
    "water_point": "drinking_water", "clock": "clock", "shelter": "shelter", "charging_station": "charging_station",
    "parcel_locker": "parcel_locker", "binoculars": "binoculars", "grit_bin": "grit_bin", "toilets": "toilets",
    "luggage_locker": "luggage_locker", "ashtray": "waste_basket", "lounger": "bench", "kiosk": "kiosk",
    "motorcycle_parking": "sign", "taxi": "sign", "car_sharing": "sign", "bbq": "grit_bin",
}  # fmt: skip
_BY_KEY: dict[str, dict[str, str]] = {
    "amenity": _AMENITIES,
    "highway": {"street_lamp": "street_lamp", "traffic_signals": "traffic_signals", "speed_camera": "pillar"},
    "emergency": {"fire_hydrant": "fire_hydrant", "phone": "telephone", "drinking_water": "drinking_water"},
    "barrier": {"bollard": "bollard", "block": "stone", "lift_gate": "lift_gate", "planter": "planter"},
    "advertising": {"column": "advertising_column", "billboard": "billboard", "poster_box": "poster_box",
                    "board": "billboard", "screen": "poster_box", "sign": "sign", "totem": "pillar"},
    "man_made": {"flagpole": "flagpole", "utility_pole": "utility_pole", "mast": "mast", "obelisk": "obelisk",
                 "street_cabinet": "street_cabinet", "water_well": "drinking_water", "water_tap": "drinking_water",
                 "support_pillar": "pillar", "planter": "planter"},
    "power": {"cable_distribution_cabinet": "street_cabinet", "pole": "utility_pole"},
    "street_cabinet": {"": "street_cabinet"},
    "historic": {"memorial": "memorial", "monument": "statue", "milestone": "stone", "boundary_stone": "stone",
                 "wayside_cross": "memorial"},
    "tourism": {"artwork": "sculpture", "information": "information", "picnic_site": "picnic_table"},
    "leisure": {"picnic_table": "picnic_table", "playground": "slide", "outdoor_seating": "picnic_table",
                "table_tennis_table": "table_tennis"},
    "natural": {"shrub": "shrub", "stone": "stone"},
    "railway": {"subway_entrance": "subway_entrance"},
    "building": {"kiosk": "kiosk"},
    "playground": {"slide": "slide", "swing": "swing"},
}  # fmt: skip
_BARRIERS = {
    "fence": "fence", "wall": "wall", "hedge": "hedge", "guard_rail": "guard_rail", "city_wall": "wall",
    "handrail": "guard_rail", "railing": "fence",
}  # fmt: skip
_GENERA = {
    "tilia": "tree_lime", "acer": "tree_maple", "platanus": "tree_maple", "quercus": "tree_oak", "aesculus": "tree_oak",
    "betula": "tree_birch", "populus": "tree_birch", "picea": "tree_spruce", "pinus": "tree_spruce",
    "abies": "tree_spruce", "larix": "tree_spruce", "cupressus": "tree_spruce", "phoenix": "tree_palm",
    "washingtonia": "tree_palm", "trachycarpus": "tree_palm", "sorbus": "tree_young", "prunus": "tree_young",
    "malus": "tree_young", "ulmus": "tree_oak", "fraxinus": "tree_lime", "carpinus": "tree_lime",
}  # fmt: skip
_COMMON_TREES = ("tree_lime", "tree_lime", "tree_maple", "tree_oak", "tree_birch", "tree_young")
_SEGMENT = 2.0  # metres of fence, wall or hedge a model covers
_REACH = 3.0  # how far things are moved to find room, metres
_KERB_REACH = 9.0  # signals are mapped on the street's middle
_WOOD_TREE, _SCRUB_SHRUB = 45.0, 7.0  # square metres a plant of its own where only the area is mapped
_MOST_SCATTERED = 400


@dataclass
class _Wish:
    """A thing that should stand somewhere."""

    id: str
    prototype: str
    xy: NDArray[np.float64]
    yaw: float | None
    scale: float
    entity: int | None = None
    group: str | None = None
    movable: bool = True


@dataclass
class _Site:
    """What is already there: buildings, carriageways, things."""

    solids: shapely.STRtree
    shapes: Sequence[BaseGeometry]
    carriageway: BaseGeometry
    half: float
    placed: dict[tuple[int, int], list[shapely.Polygon]] = field(default_factory=dict)

    def conflict(self, foot: shapely.Polygon, margin: float) -> str | None:
        """Why a foot can't be there, or None."""
        x0, y0, x1, y1 = foot.bounds
        if min(x0, y0) < -self.half or max(x1, y1) > self.half:
            return "beyond the edge of the world"
        if len(self.solids.query(foot, predicate="dwithin", distance=margin)):
            return "inside a building"
        if shapely.intersects(self.carriageway, foot):
            return "on a lane"
        for cell in self._cells(foot):
            if any(other.intersects(foot) for other in self.placed.get(cell, ())):
                return "overlaps another object"
        return None

    def claim(self, foot: shapely.Polygon) -> None:
        """Take the room."""
        for cell in self._cells(foot):
            self.placed.setdefault(cell, []).append(foot)

    @staticmethod
    def _cells(foot: shapely.Polygon) -> Iterator[tuple[int, int]]:
        x0, y0, x1, y1 = foot.bounds
        for i in range(math.floor(x0 / 8), math.floor(x1 / 8) + 1):
            for j in range(math.floor(y0 / 8), math.floor(y1 / 8) + 1):
                yield i, j


def objects_from_osm(
    osm: OsmData,
    *,
    solids: Sequence[BaseGeometry],
    carriageway: BaseGeometry,
    openings: BaseGeometry,
    height: HeightField,
    transit: Transit | None = None,
    half: float | None = None,
    seed: int = 0,
) -> tuple[Objects, list[Dropped]]:
    """Place the street objects, trees and barriers of a map.

    Parameters
    ----------
    osm
        The map, local metres.
    solids
        Footprints that nothing may stand in.
    carriageway
        Where vehicles drive: nothing may stand there either.
    openings
        Where walkers pass through fences, walls and hedges.
    height
        Ground heights.
    transit
        Stops and bicycle stations to put poles and docks at; their objects carry the entities of the records.
    half
        Half the side of the world, metres; the map's own where not given.
    seed
        Decides facings, sizes and species that the map leaves open.

    Returns
    -------
    Objects, list of Dropped
        In the map's order; what found no room within 3 m, with the reason.
    """
    half = half or osm.half
    models = street_models()
    site = _Site(shapely.STRtree(list(solids)), list(solids), carriageway, half)
    shapely.prepare(carriageway)
    wishes = [*_transit_wishes(transit, carriageway), *_point_wishes(osm, seed), *_row_wishes(osm, seed)]
    wishes = [w for w in wishes if np.abs(w.xy).max() < half]
    rows: list[dict[str, Any]] = []
    dropped: list[Dropped] = []
    for wish in wishes:
        _settle(wish, models[wish.prototype], site, seed, rows, dropped)
    for wish in _scattered_wishes(osm, carriageway, openings, half, seed):
        _settle(wish, models[wish.prototype], site, seed, rows, [])
    for wish in _barrier_wishes(osm, carriageway, openings, half):
        _settle(wish, models[wish.prototype], site, seed, rows, dropped)
    next_entity = FIRST_OBJECT
    for row in rows:
        if row["entity"] is None:
            row["entity"] = next_entity
            next_entity += 1
        row["z"] = round(float(height((row["x"], row["y"]))), 3)
    return Objects.from_rows(rows), dropped


def _settle(
    wish: _Wish, model: Model, site: _Site, seed: int, rows: list[dict[str, Any]], dropped: list[Dropped]
) -> None:
    """Put a wish where it fits, at most 3 m away, or drop it with the reason."""
    random = rng(seed, "object", wish.id)
    yaw = wish.yaw if wish.yaw is not None else _facing(wish, site, random)
    scale = _fitting_scale(wish, model, site)
    foot = model.foot or model.size[:2]
    if model.kind in FEET:
        foot = (FEET[model.kind], FEET[model.kind])
    wide, deep = foot[0] * scale, foot[1] * scale
    if not wish.movable:
        wide *= 0.5  # pieces of one fence meet at its corners
    margin = 0.1 if wish.movable else 0.0
    reason = None
    reach = _KERB_REACH if wish.prototype in ("traffic_signals", "bus_stop") else _REACH
    for shift in _shifts(reach) if wish.movable else _shifts(0.0):
        x, y = wish.xy + shift
        shape = _rectangle(float(x), float(y), wide, deep, yaw)
        why = site.conflict(shape, margin)
        if why is None:
            break
        reason = reason or why
    else:
        dropped.append(Dropped(id=wish.id, reason=f"{model.kind}: {reason}, and no room within {reach:g} m"))
        return
    if model.solid:
        site.claim(shape)
    size = model.size
    rows.append(
        {
            "id": wish.id,
            "entity": wish.entity,
            "kind": model.kind,
            "group": wish.group or model.group,
            "prototype": model.name,
            "x": round(float(x), 3),
            "y": round(float(y), 3),
            "yaw": round(float(yaw), 4),
            "scale": round(scale, 3),
            "size_x": round(size[0] * scale, 3),
            "size_y": round(size[1] * scale, 3),
            "size_z": round(size[2] * scale, 3),
            "solid": model.solid,
            "room": "",
        }
    )


@cache
def _shifts(reach: float) -> list[NDArray[np.float64]]:
    """Nowhere, then further and further round about."""
    turns = np.arange(16) * (np.pi / 8)
    steps = np.arange(1, int(reach / 0.3) + 1) * 0.3
    return [np.zeros(2), *(r * np.array([np.cos(t), np.sin(t)]) for r in steps for t in turns)]


def _rectangle(x: float, y: float, wide: float, deep: float, yaw: float) -> shapely.Polygon:
    c, s = math.cos(yaw), math.sin(yaw)
    corners = [(-wide / 2, -deep / 2), (wide / 2, -deep / 2), (wide / 2, deep / 2), (-wide / 2, deep / 2)]
    return shapely.Polygon([(x + c * u - s * v, y + s * u + c * v) for u, v in corners])


def _facing(wish: _Wish, site: _Site, random: np.random.Generator) -> float:
    """Away from a near wall; lamps and stops towards the carriageway; else free."""
    point = shapely.Point(wish.xy)
    name = wish.prototype
    if name.startswith(("tree", "shrub", "stone")):
        return float(random.uniform(-np.pi, np.pi))
    wall = site.solids.query_nearest(point, max_distance=4.0, all_matches=False)
    if len(wall) and name not in ("street_lamp", "bus_stop", "traffic_signals", "bollard"):
        shape = site.shapes[int(wall[0])]
        near = shapely.shortest_line(shape.boundary, point)
        (x0, y0), (x1, y1) = near.coords[0], near.coords[-1]
        sign = -1.0 if shape.contains(point) else 1.0
        if math.hypot(x1 - x0, y1 - y0) > 0.05:
            return math.atan2(sign * (y1 - y0), sign * (x1 - x0))
    if not site.carriageway.is_empty:
        near = shapely.shortest_line(point, site.carriageway.boundary)
        if near.length < 25.0:
            (x0, y0), (x1, y1) = near.coords[0], near.coords[-1]
            yaw = math.atan2(y1 - y0, x1 - x0) if near.length > 0.05 else float(random.uniform(-np.pi, np.pi))
            if site.carriageway.contains(point):
                yaw += math.pi
            # Signals look along the street, lamps reach over it.
            return yaw + math.pi / 2 if name in ("traffic_signals", "sign", "billboard") else yaw
    return float(random.uniform(-np.pi, np.pi))


def _fitting_scale(wish: _Wish, model: Model, site: _Site) -> float:
    """Trees close to a wall are smaller, so that their crowns don't grow through it."""
    if model.kind != "tree":
        return wish.scale
    near = site.solids.query_nearest(shapely.Point(wish.xy), max_distance=6.0, all_matches=False)
    if not len(near):
        return wish.scale
    room = shapely.distance(site.shapes[int(near[0])], shapely.Point(wish.xy)) + 0.7
    return float(np.clip(2 * room / max(model.size[0], model.size[1]), 0.42, wish.scale))


def _number(text: str | None) -> float | None:
    found = re.match(r"\s*(\d+(?:[.,]\d+)?)", text or "")
    return float(found.group(1).replace(",", ".")) if found else None


def _direction(tags: Tags) -> float | None:
    """Yaw from a `direction` tag: degrees clockwise from north, or a compass point."""
    said = tags.get("direction", tags.get("camera:direction", ""))
    points = ["N", "NNE", "NE", "ENE", "E", "ESE", "SE", "SSE", "S", "SSW", "SW", "WSW", "W", "WNW", "NW", "NNW"]
    degrees = 22.5 * points.index(said) if said in points else _number(said)
    return None if degrees is None else math.remainder(math.pi / 2 - math.radians(degrees), 2 * math.pi)


def _prototype(tags: Tags) -> str | None:
    """The model for a mapped thing, None if it is nothing that stands in streets."""
    if tags.get("location") in ("underground", "indoor") or tags.get("indoor", "no") not in ("no", "outdoor"):
        return None
    if (_number(tags.get("level")) or 0) != 0 or tags.get("level", "").startswith("-"):
        return None
    if tags.get("fire_hydrant:type") in ("underground", "wall", "pipe"):
        return None
    for key, values in _BY_KEY.items():
        value = tags.get(key)
        if value is None:
            continue
        found = values.get(value) or values.get("")
        if found == "sculpture":
            art = tags.get("artwork_type", "")
            if art in ("mural", "graffiti", "mosaic", "relief", "painting", "tilework"):
                return None
            found = "statue" if art in ("statue", "bust") else "sculpture"
        if found == "memorial":
            kind = tags.get("memorial", "")
            if kind in ("plaque", "blue_plaque", "stolperstein"):
                return None
            found = "statue" if kind in ("statue", "bust") else "memorial"
        if found == "vending_machine" and tags.get("vending", "") in ("parking_tickets", "public_transport_tickets"):
            found = "parking_meter"
        if found:
            return found
    return None


def _species(tags: Tags, xy: NDArray[np.float64], seed: int, random: np.random.Generator) -> str:
    """Model of a tree: as mapped, else mostly the one common to its surroundings."""
    for key in ("genus", "species", "taxon"):
        genus = tags.get(key, "").split(" ")[0].lower()
        if genus in _GENERA:
            return _GENERA[genus]
    if tags.get("leaf_type") == "needleleaved":
        return "tree_spruce"
    if tags.get("leaf_type") == "palm" or "palm" in tags.get("species:en", "").lower():
        return "tree_palm"
    if random.random() < 0.75:
        local = rng(seed, "species", int(xy[0] // 60) + 10_000, int(xy[1] // 60) + 10_000)
        return _COMMON_TREES[int(local.integers(len(_COMMON_TREES)))]
    return _COMMON_TREES[int(random.integers(len(_COMMON_TREES)))]


def _tree(key: str, tags: Tags, xy: NDArray[np.float64], seed: int) -> _Wish:
    random = rng(seed, "tree", key)
    name = _species(tags, xy, seed, random)
    tall = _number(tags.get("height"))
    scale = float(random.uniform(0.82, 1.15))
    if tall:
        scale = float(np.clip(tall / street_models()[name].size[2], 0.45, 1.7))
    return _Wish(key, name, xy, None, scale)


def _point_wishes(osm: OsmData, seed: int) -> list[_Wish]:
    """Mapped points, and areas that are one thing."""
    found: list[_Wish] = []
    for node in osm.nodes:
        key = f"n{node.id}"
        if node.tags.get("natural") == "tree":
            found.append(_tree(key, node.tags, node.xy, seed))
            continue
        name = _prototype(node.tags)
        if name is not None:
            found.append(_thing(key, name, node.tags, node.xy, seed))
    for area in osm.areas:
        # Buildings have their own meshes; a kiosk mapped as a building is one.
        if "building" in area.tags or "building:part" in area.tags or area.polygon.area > 2500.0:
            continue
        name = _prototype(area.tags)
        if name in (None, "sign", "toilets"):
            continue
        centre = np.array(area.polygon.representative_point().coords[0])
        wish = _thing(area.id, name, area.tags, centre, seed)
        if name == "fountain":
            wish.scale = float(np.clip(math.sqrt(area.polygon.area / math.pi) / 2.0, 0.5, 2.2))
        elif name == "slide":
            found.append(_thing(f"{area.id}.swing", "swing", area.tags, centre + np.array([4.0, 2.0]), seed))
        found.append(wish)
    return found


def _thing(key: str, name: str, tags: Tags, xy: NDArray[np.float64], seed: int) -> _Wish:
    random = rng(seed, "thing", key)
    if name == "street_lamp" and tags.get("lamp_mount") in ("bent_mast", "straight_mast", None):
        tall = _number(tags.get("height"))
        name = "park_lamp" if (tall or 6.0) < 4.5 else name
    scale = 1.0
    if name.startswith(("shrub", "stone")):
        scale = float(random.uniform(0.8, 1.25))
    return _Wish(key, name, xy, _direction(tags), scale)


def _row_wishes(osm: OsmData, seed: int) -> list[_Wish]:
    """Tree rows, a tree every eight metres; the row has one species."""
    found: list[_Wish] = []
    for way in osm.ways:
        if way.tags.get("natural") != "tree_row":
            continue
        line = shapely.LineString(way.line)
        count = max(2, round(line.length / 8.0) + 1)
        name = _tree(f"w{way.id}", way.tags, way.line[0], seed).prototype
        for k, d in enumerate(np.linspace(0, line.length, count)):
            wish = _tree(f"w{way.id}.{k}", way.tags, np.array(line.interpolate(d).coords[0]), seed)
            wish.prototype = name
            found.append(wish)
    return found


def _scattered_wishes(
    osm: OsmData, carriageway: BaseGeometry, openings: BaseGeometry, half: float, seed: int
) -> list[_Wish]:
    """Trees of woods and shrubs of scrub, where only the area is mapped, off the ways."""
    found: list[_Wish] = []
    window = shapely.box(-half, -half, half, half)
    for area in osm.areas:
        wood = area.tags.get("natural") == "wood" or area.tags.get("landuse") == "forest"
        bushes = area.tags.get("natural") in ("scrub", "shrubbery") or area.tags.get("barrier") == "hedge"
        if not (wood or bushes):
            continue
        random = rng(seed, "scatter", area.id)
        ground = shapely.intersection(area.polygon, window)
        if ground.is_empty:
            continue
        count = min(int(ground.area / (_WOOD_TREE if wood else _SCRUB_SHRUB)), 120)
        x0, y0, x1, y1 = ground.bounds
        shapely.prepare(ground)
        points = random.uniform((x0, y0), (x1, y1), (8 * count, 2))
        inside = shapely.contains_xy(ground, points[:, 0], points[:, 1])
        if not openings.is_empty:
            inside &= shapely.distance(shapely.points(points), openings) > 0.8
        for k, xy in enumerate(points[inside][:count]):
            key = f"{area.id}.{k}"
            if wood:
                found.append(_tree(key, area.tags, xy, seed))
            else:
                name = "shrub_tall" if random.random() < 0.4 else "shrub"
                found.append(_Wish(key, name, xy, None, float(random.uniform(0.75, 1.2))))
    return found[:_MOST_SCATTERED]


def _barrier_wishes(osm: OsmData, carriageway: BaseGeometry, openings: BaseGeometry, half: float) -> list[_Wish]:
    """Fences, walls and hedges in pieces of two metres, open where ways and gates lead through."""
    gates = [n.xy for n in osm.nodes if n.tags.get("barrier") in ("gate", "lift_gate", "swing_gate", "entrance",
                                                                 "kissing_gate", "turnstile")]  # fmt: skip
    gaps = [shapely.buffer(openings, 0.3), shapely.buffer(carriageway, 0.3)]
    gaps += [shapely.buffer(shapely.Point(xy), 1.6) for xy in gates]
    through = shapely.union_all(gaps)
    shapely.prepare(through)
    found: list[_Wish] = []
    for way in osm.ways:
        name = _BARRIERS.get(way.tags.get("barrier", ""))
        if name is None or (_number(way.tags.get("layer")) or 0) < 0 or np.abs(way.line).min(axis=0).max() > half:
            continue
        pieces = shapely.get_parts(shapely.difference(shapely.LineString(way.line), through))
        k = 0
        for piece in pieces:
            # Corner to corner, so that segments lie along the mapped line.
            for a, b in zip(piece.coords[:-1], piece.coords[1:], strict=True):
                length = math.hypot(b[0] - a[0], b[1] - a[1])
                count = int(length // _SEGMENT)
                yaw = math.atan2(b[1] - a[1], b[0] - a[0])
                lead = (length - count * _SEGMENT) / 2 + _SEGMENT / 2
                for i in range(count):
                    share = (lead + i * _SEGMENT) / length
                    xy = np.array([a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share])
                    if np.abs(xy).max() < half - _SEGMENT:
                        found.append(_Wish(f"w{way.id}.{k}", name, xy, yaw, 1.0, movable=False))
                        k += 1
    return found


def _transit_wishes(transit: Transit | None, carriageway: BaseGeometry) -> list[_Wish]:
    """Poles between the waiting place and the kerb; docks along the street."""
    found: list[_Wish] = []
    if transit is None:
        return found
    for stop in transit.stops:
        wait = np.array(stop.wait[:2])
        kerb = _towards(wait, carriageway)
        spot, yaw = wait + np.array([1.0, 0.0]), 0.0
        if kerb is not None:
            out = kerb - wait
            reach = float(np.hypot(*out))
            out = out / max(reach, 1e-9)
            along = np.array([-out[1], out[0]])
            spot, yaw = wait + out * max(reach - 0.35, 0.0) + along * 0.9, math.atan2(out[1], out[0])
        found.append(_Wish(stop.id, "bus_stop", spot, yaw, 1.0, stop.entity))
    for station in transit.bike_stations:
        at = np.array(station.position[:2])
        kerb = _towards(at, carriageway)
        yaw = math.atan2(*(kerb - at)[::-1]) if kerb is not None else 0.0
        found.append(_Wish(station.id, "bike_station", at, yaw, 1.0, station.entity))
    return found


def _towards(xy: NDArray[np.float64], shape: BaseGeometry) -> NDArray[np.float64] | None:
    """The nearest point of a shape within 20 m, if it lies elsewhere."""
    if shape.is_empty:
        return None
    line = shapely.shortest_line(shapely.Point(xy), shape)
    return np.array(line.coords[-1]) if 0.01 < line.length < 20.0 else None
