"""Street objects and plants: every thing OpenStreetMap maps at its place, with a model, a facing and a size.

What the tags mean is in the modules beside this one; here everything gets its room. Order is rank: stops first, then
barriers, which can't be moved, then mapped things, then what fills mapped areas, then lamps where none are mapped.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from vico.assets.furniture_pack import credits_of, our_models, read_things
from vico.assets.models.library import street_models
from vico.assets.models.model import Model
from vico.assets.vehicles import vehicle_prototypes
from vico.geo.osm import OsmData
from vico.rules import TRAM_WIDTH
from vico.seeds import rng
from vico.world.heights import HeightField
from vico.world.lanes import LaneGraph
from vico.world.mesh import Surface
from vico.world.model import FIRST_OBJECT, Dropped, Source
from vico.world.objects import FEET, Objects
from vico.world.transit import Transit
from vico.worldgen.facts.fault_isolation import NamedShape, buffer_named, drop_on_failure
from vico.worldgen.objects.catalogue import standing
from vico.worldgen.objects.mapped_objects import (
    area_placements,
    barrier_placements,
    lamp_placements,
    mapped_placements,
    region,
    thing_of,
)
from vico.worldgen.objects.placement import FreeSpace, Placement
from vico.worldgen.objects.trees import lawn_placements, planted_area_placements, planting


def models_of(objects: Objects, *, installed: bool) -> tuple[dict[str, Sequence[Surface]], list[Source]]:
    """Return the surfaces of every prototype that `objects` use, and the sources of those that are not ours."""
    pack = read_things() if installed else None
    stand_ins = pack[0] if pack is not None else {}
    used = set(objects.prototype.tolist())
    models: dict[str, Sequence[Surface]] = {
        name: list(stand_ins.get(name, model.surfaces)) for name, model in our_models().items() if name in used
    }
    credits = [
        Source(kind="things", name=name, licence=credit.licence, attribution=credit.words, sha256=credit.sha256)
        for name, model in our_models().items()
        if name in models and name not in stand_ins and (credit := model.credit) is not None
    ]
    models |= {name: surfaces for name, surfaces in vehicle_prototypes().items() if name in used}
    foreign = [name for name in models if name in stand_ins]
    if pack is None or not foreign:
        return models, credits
    credits += [
        Source(kind="things", name=c.collection, licence=c.licence, attribution=c.words, sha256=pack[2])
        for c in credits_of(foreign)
    ]
    return models, credits


_PLANTS = "natural"  # the group of their models
_LAMPS = ("street_lamp", "lamp")  # kinds
_TWIN_GAP = 0.3  # metres between two that are one, mapped twice
_KERB_REACH = 9.0  # signals and signs are mapped on the street's middle
_TRAM = TRAM_WIDTH / 2 + 0.15  # metres beside the middle of a track that nothing stands in
_SWEPT = 0.36  # metres at each side of a lane that no vehicle's body sweeps, a little less than `vico check` allows


@dataclass(frozen=True)
class Surroundings:
    """Surroundings that are there before objects are placed.

    Attributes
    ----------
    solids
        Footprints that nothing may stand in.
    carriageway
        Where vehicles drive: nothing may stand there either.
    openings
        Where walkers pass through fences, walls and hedges.
    lawns, mapped
        Where trees and shrubs grow though no map says so, unless it says what the ground is: areas of that.
    """

    solids: Sequence[BaseGeometry] = ()
    carriageway: BaseGeometry = field(default_factory=shapely.MultiPolygon)
    openings: BaseGeometry = field(default_factory=shapely.MultiPolygon)
    lawns: BaseGeometry = field(default_factory=shapely.MultiPolygon)
    mapped: Sequence[BaseGeometry] = ()


def objects_from_osm(
    osm: OsmData,
    grounds: Surroundings,
    *,
    height: HeightField,
    transit: Transit | None = None,
    lanes: LaneGraph | None = None,
    seed: int = 0,
) -> tuple[Objects, list[Dropped]]:
    """Place the street objects, trees and barriers of a map.

    Parameters
    ----------
    osm
        The map, local metres.
    grounds
        Houses, streets and lawns.
    height
        Ground heights.
    transit
        Stops and bicycle stations to put poles and docks at; their objects carry the entities of the records.
    lanes
        Lanes that vehicles follow; what they sweep is kept free too, where it leaves the carriageway.
    seed
        Decides facings, sizes and species that the map leaves open.

    Returns
    -------
    Objects, list of Dropped
        By rank, and in the map's order; what found no room within reach, with the reason. What was planted only to
        fill an area, or put up to light a street without mapped lamps, and found no room, is no loss and not listed.
    """
    half, carriageway, openings = osm.half, grounds.carriageway, grounds.openings
    models = street_models()
    swept = [*_swept(lanes), *_tram_beds(transit)]
    site = FreeSpace(solids=grounds.solids, carriageway=carriageway, lanes=swept, openings=openings, half=half)
    zone, where = planting(osm, height), region(osm)
    mapped = mapped_placements(osm, height, seed)
    lamps = np.array([wish.xy for wish in mapped if models[wish.prototype].kind in _LAMPS]).reshape(-1, 2)
    lots: list[tuple[list[Placement], bool]] = [
        (_transit_placements(transit, carriageway), True),
        (barrier_placements(osm, carriageway, openings, half), True),
        (mapped, True),
        (area_placements(osm, openings, half, seed, where=where), True),
        (planted_area_placements(osm, height, carriageway, openings, half, seed, zone), False),
        (lawn_placements(osm, grounds.lawns, openings, grounds.mapped, seed, zone), False),
        (
            lamp_placements(
                osm, carriageway, grounds.solids, lamps, lamp=thing_of({"highway": "street_lamp"}, where=where)
            ),
            False,
        ),
    ]
    rows: list[dict[str, Any]] = []
    dropped: list[Dropped] = []
    for wishes, listed in lots:
        for wish in wishes:
            if np.abs(wish.xy).max() < half:
                with drop_on_failure(wish.id):
                    reason = _settle(wish, models[wish.prototype], site, seed, rows)
                    if reason is not None and listed:
                        dropped.append(Dropped(id=wish.id, reason=reason))
    next_entity = FIRST_OBJECT
    for row in rows:
        if row["entity"] is None:
            row["entity"] = next_entity
            next_entity += 1
        row["z"] = round(float(height((row["x"], row["y"]))), 3)
    return Objects.from_rows(rows), dropped


def _swept(lanes: LaneGraph | None) -> list[BaseGeometry]:
    """Return what vehicles sweep on each lane between junctions."""
    if lanes is None or not len(lanes):
        return []
    driven = np.flatnonzero(lanes.inside < 0)
    lines = [NamedShape(lanes.ids[int(k)], shapely.LineString(lanes.line(int(k))[:, :2])) for k in driven]
    widths = np.maximum(lanes.width[driven] / 2 - _SWEPT, 0.1)
    return [strip.shape for strip in buffer_named(lines, widths, cap_style="flat")]


def _tram_beds(transit: Transit | None) -> list[BaseGeometry]:
    """Return what trams sweep, in the street and beside it."""
    lines = [] if transit is None else transit.tram_lines
    named = [NamedShape(line.id, shapely.LineString(line.track)) for line in lines]
    return [strip.shape for strip in buffer_named(named, np.full(len(named), _TRAM), cap_style="flat")]


def _settle(wish: Placement, model: Model, site: FreeSpace, seed: int, rows: list[dict[str, Any]]) -> str | None:
    """Put a wish where it fits, near where it is mapped; the reason where it fits nowhere."""
    random = rng(seed, "object", wish.id)
    if wish.prototype.startswith("street_lamp") and wish.id.startswith("n") and _far(wish, site, 8.0):
        model = street_models()["park_lamp"]  # over a footpath
    yaw = wish.yaw if wish.yaw is not None else _facing(wish, site, random)
    scale = _fitting_scale(wish, model, site)
    side = FEET.get(model.kind)
    foot = (side, side) if side is not None else model.size[:2]
    wide, deep = foot[0] * scale, foot[1] * scale
    if model.kind in standing().twins and site.twin(
        model.kind, _rectangles(wish.xy[None], wide, deep, yaw)[0], min(wide, _TWIN_GAP)
    ):
        return f"{model.kind}: mapped twice"
    reach = _KERB_REACH if model.kind in standing().at_kerbs else wish.reach
    found, reason = _room(
        wish,
        wide,
        deep,
        yaw,
        0.0 if wish.piece else reach,
        site,
        None if not model.solid or model.kind in standing().landmarks else model.group != _PLANTS,
    )
    if found is None:
        return f"{model.kind}: {reason}" + (f", and no room within {reach:g} m" if reach and not wish.piece else "")
    (x, y), shape = found
    if model.solid:
        site.claim(model.kind, shape, piece=wish.piece)
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
    return None


def _room(
    wish: Placement, wide: float, deep: float, yaw: float, reach: float, site: FreeSpace, keeps_way: bool | None
) -> tuple[tuple[NDArray[np.float64], shapely.Polygon] | None, str | None]:
    """Find the nearest free spot and the foot there, or None and why there is none where the wish is.

    `keeps_way` says whether it leaves people room to pass anywhere, on footways only (False), or nowhere (None).
    """
    foot = _rectangles(wish.xy[None], wide, deep, yaw)[0]
    if wish.piece:
        core = _rectangles(wish.xy[None], wide * 0.5, deep * 0.5, yaw)[0]
        reason = site.conflict(foot, 0.0, core=core)
        return (None, reason) if reason else ((wish.xy, foot), None)
    reason = site.conflict(foot, 0.1)
    if reason is None and keeps_way is not None and site.blocks_way(foot, anywhere=keeps_way):
        reason = "in the only way past"
    if reason is None:
        return (wish.xy, foot), None
    for ring in _rings(reach):
        spots = wish.xy + ring
        feet = _rectangles(spots, wide, deep, yaw)
        for k in np.flatnonzero(site.free(feet, 0.1)).tolist():
            if keeps_way is None or not site.blocks_way(feet[k], anywhere=keeps_way):
                return (spots[k], feet[k]), None
    return None, reason


@cache
def _rings(reach: float) -> list[NDArray[np.float64]]:
    """Shifts further and further round about, a ring at a time, metres."""
    turns = np.arange(16) * (np.pi / 8)
    circle = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    return [r * circle for r in np.arange(1, int(reach / 0.3) + 1) * 0.3]


def _rectangles(at: NDArray[np.float64], wide: float, deep: float, yaw: float) -> NDArray[np.object_]:
    """Rectangles about points, shape ``(n,)``."""
    c, s = math.cos(yaw), math.sin(yaw)
    corners = np.array([(-wide / 2, -deep / 2), (wide / 2, -deep / 2), (wide / 2, deep / 2), (-wide / 2, deep / 2)])
    turned = np.stack([c * corners[:, 0] - s * corners[:, 1], s * corners[:, 0] + c * corners[:, 1]], axis=1)
    return np.asarray(shapely.polygons(at[:, None, :] + turned), object)


def _far(wish: Placement, site: FreeSpace, distance: float) -> bool:
    point = shapely.Point(wish.xy)
    return not site.carriageway.is_empty and not shapely.dwithin(site.carriageway.shape, point, distance)


def _facing(wish: Placement, site: FreeSpace, random: np.random.Generator) -> float:
    """Away from a near wall; lamps and stops towards the carriageway; benches to the path, backs to traffic."""
    point = shapely.Point(wish.xy)
    name = wish.prototype
    free = float(random.uniform(-np.pi, np.pi))
    if name.startswith(standing().facing_anywhere):
        return free
    if not name.startswith(standing().facing_street):
        wall = site.solids.query_nearest(point, max_distance=4.0, all_matches=False)
        if len(wall):
            shape = site.shapes[int(wall[0])]
            away = _heading(shapely.shortest_line(shape.boundary, point))
            if away is not None:
                return away + (math.pi if shape.contains(point) else 0.0)
    if name.startswith(standing().facing_path):
        return _to_path(point, site, free)
    if site.carriageway.is_empty:
        return free
    near = site.carriageway.to_edge(point)
    if near.length > 25.0:
        return _to_path(point, site, free)
    yaw = _heading(near)
    if yaw is None:
        yaw = free
    elif shapely.contains(site.carriageway.shape, point):
        yaw += math.pi
    # Signals face the traffic on their side of the street; lamps reach over it.
    return yaw + math.pi / 2 if name.startswith(standing().facing_along) else yaw


def _to_path(point: shapely.Point, site: FreeSpace, free: float) -> float:
    """Facing of a seat: back to near traffic, else over the path beside it, else to the nearest path."""
    if not site.carriageway.is_empty and not shapely.intersects(site.carriageway.shape, point):
        road = shapely.reverse(site.carriageway.to_edge(point))
        if 0.05 < road.length < 6.0:
            return _heading(road) or free
    if site.openings.is_empty:
        return free
    edge = shapely.reverse(site.openings.to_edge(point))
    on_it = bool(shapely.intersects(site.openings.shape, point))
    towards = _heading(edge)
    if towards is None or (edge.length > 20.0 and not on_it):
        return free
    # On the path: from its nearer edge across it. Beside it: towards it.
    return towards if on_it else towards + math.pi


def _heading(line: shapely.LineString) -> float | None:
    """Direction of a line from its first point to its last; None if they all but coincide."""
    (x0, y0), (x1, y1) = line.coords[0], line.coords[-1]
    return math.atan2(y1 - y0, x1 - x0) if math.hypot(x1 - x0, y1 - y0) > 0.05 else None


def _fitting_scale(wish: Placement, model: Model, site: FreeSpace) -> float:
    """Trees close to a wall are smaller, so that their crowns don't grow through it."""
    if model.kind != "tree":
        return wish.scale
    near = site.solids.query_nearest(shapely.Point(wish.xy), max_distance=6.0, all_matches=False)
    if not len(near):
        return wish.scale
    room = shapely.distance(site.shapes[int(near[0])], shapely.Point(wish.xy)) + 0.7
    return float(np.clip(2 * room / max(model.size[0], model.size[1]), min(0.42, wish.scale), wish.scale))


def _transit_placements(transit: Transit | None, carriageway: BaseGeometry) -> list[Placement]:
    """Poles between the waiting place and the kerb; docks along the street."""
    found: list[Placement] = []
    if transit is None:
        return found
    for stop in transit.stops:
        wait = np.array(stop.wait[:2])
        spot, yaw = wait + np.array([1.0, 0.0]), 0.0
        with drop_on_failure(stop.id):
            kerb = _towards(wait, carriageway)
            if kerb is not None:
                out = kerb - wait
                reach = float(np.hypot(*out))
                out = out / max(reach, 1e-9)
                along = np.array([-out[1], out[0]])
                spot, yaw = wait + out * max(reach - 0.35, 0.0) + along * 0.9, math.atan2(out[1], out[0])
            found.append(Placement(stop.id, "bus_stop", spot, yaw, 1.0, stop.entity))
    for station in transit.bike_stations:
        at = np.array(station.position[:2])
        with drop_on_failure(station.id):
            kerb = _towards(at, carriageway)
            yaw = math.atan2(*(kerb - at)[::-1]) if kerb is not None else 0.0
            found.append(Placement(station.id, "bike_station", at, yaw, 1.0, station.entity))
    return found


def _towards(xy: NDArray[np.float64], shape: BaseGeometry) -> NDArray[np.float64] | None:
    """Return the nearest point of a shape within 20 m, if it lies elsewhere."""
    if shape.is_empty:
        return None
    line = shapely.shortest_line(shapely.Point(xy), shape)
    return np.array(line.coords[-1]) if 0.01 < line.length < 20.0 else None
