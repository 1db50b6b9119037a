"""Parked cars: at kerbs where the map has parking lanes or where streets are wide, and in open car parks.

Bays are those that are painted. A car stands in most of them; the others are free spots that traffic may use.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from vico.assets.vehicles import CAR_KINDS, vehicle_prototypes, vehicle_size
from vico.geo import overlay
from vico.geo.osm import OsmData, Tags
from vico.seeds import rng
from vico.world.heights import HeightField
from vico.world.lanes import LaneGraph
from vico.world.model import FIRST_OBJECT, FIRST_STOP, ParkingSpot
from vico.world.objects import Objects
from vico.world.transit import Transit
from vico.worldgen.facts.fault_isolation import drop_on_failure
from vico.worldgen.facts.site import SiteFacts
from vico.worldgen.facts.streets import (
    Bay,
    Street,
    StreetPolygons,
    is_perpendicular_parking,
    junction_zones,
    kerb_bays,
    lot_bays,
)
from vico.worldgen.objects.parking_paths import with_parking_paths

CAR = "parked_car"
"""Kind of the objects that are parked cars."""

_TAKEN = (0.70, 0.85)  # share of a street's or a car park's bays that have a car
_SHARES = {"hatchback": 0.40, "sedan": 0.29, "suv": 0.22, "van": 0.08, "taxi": 0.01}
_HABIT = ("residential", "unclassified", "tertiary")  # where people park though the map says nothing
_HABIT_DEPTH = 2.1  # metres
_HABIT_ROOM = 3.0  # metres of carriageway for a lane beside parked cars
_BUMPER = 0.09  # metres that a car leaves to the ends of its bay
_WALL = 0.3  # metres to walls
_THING = 0.15  # metres to things
_WALKER = 0.45  # metres to the lines that walkers follow
_JUNCTION = 2.0  # beyond where lines are painted: 5 m from the corner in all
_CROSSING = 4.0  # metres to crossings
_HYDRANT = 5.0  # metres to hydrants and to the gates of garages
_STOP_BEFORE = 18.0  # metres of the lane before a bus stop
_STOP_AFTER = 6.0  # and after it
_STOP_WIDE = 4.5  # metres, breadth of the strip that stays free there
_RAIL = 1.8  # metres from a tram track's middle
_STEEP = 0.06  # slope along a car on which it still stands level
_LANE_REACH = 6.5  # metres from a bay to the lane beside it
_LANE_TURN = 0.35  # rad between the two at most


class _Candidate(NamedTuple):
    """A bay before it is known whether anybody can stand there; `source` is the street or car park it belongs to."""

    id: str
    source: str
    kind: str
    bay: Bay


@dataclass(frozen=True)
class Parking:
    """Parked cars, and all spots, those with a car and free ones."""

    cars: Objects
    spots: list[ParkingSpot]


def parking_from_osm(
    site: SiteFacts,
    *,
    streets: StreetPolygons,
    lanes: LaneGraph,
    objects: Objects,
    solids: Sequence[BaseGeometry],
    height: HeightField,
    transit: Transit,
    seed: int = 0,
) -> Parking:
    """Lay out the parking spots of a map and park cars in them.

    Parameters
    ----------
    site
        The map and its facts.
    streets
        Its streets, as they are painted.
    lanes
        What vehicles and walkers follow: it stays free.
    objects
        What stands outdoors already.
    solids
        Footprints of buildings.
    height
        Ground heights.
    transit
        Stops, which buses have to reach.
    seed
        Decides which spots have cars, and which cars.

    Returns
    -------
    Parking
        Cars in the order of their spots, with entities after those of `objects`.
    """
    osm = site.osm
    found = [*_kerb_candidates(osm, streets, site.left_driving), *_lot_candidates(osm, streets)]
    if not found:
        return Parking(Objects.from_rows([]), [])
    # The ground that a car in each bay may take is shorter and narrower than the bay.
    less = {"kerb": (0.3, -0.1), "across": (0.1, 0.1), "lot": (0.3, 0.1)}  # along the kerb mirrors stick out
    sizes = [(one.bay.length - less[one.kind][0], one.bay.width - less[one.kind][1]) for one in found]
    feet = np.asarray(
        shapely.polygons([_rectangle(one.bay, *size) for one, size in zip(found, sizes, strict=True)]), object
    )
    # Bays at kerbs lie on the carriageway, others on car parks, all within the world.
    within = np.abs(shapely.bounds(feet)).max(axis=1) < osm.half - 1.0
    lot = np.array([one.kind == "lot" for one in found])
    for shape, own in ((streets.carriageway, ~lot), (streets.parking, lot)):
        shapely.prepare(shape)
        within[own] &= shapely.covers(shape, feet[own])
    keep = np.asarray(within, bool) & _on_level_ground(found, height)
    for shapes, away in _kept_free(osm, streets, lanes, transit, solids, objects):
        keep[shapely.STRtree(shapes).query(feet, predicate="dwithin", distance=max(away, 1e-6))[0]] = False
    chosen = _apart(np.flatnonzero(keep), feet)
    entity = max([FIRST_OBJECT - 1, *objects.entity[objects.entity < FIRST_STOP].tolist()]) + 1
    rows, spots = [], []
    for k in chosen.tolist():
        one = found[k]
        row = _car(one, seed, height)
        if row is not None:
            rows.append(row | {"entity": entity})
        spots.append(_spot(one, lanes, height, entity if row is not None else None))
        entity += row is not None
    cars = Objects.from_rows(rows)
    standing = Objects.joined([objects, cars])
    found_ways = with_parking_paths(spots, streets=streets, lanes=lanes, objects=standing, solids=solids, height=height)
    return Parking(cars, found_ways)


def _parking_tag(tags: Tags, side: str) -> str | None:
    """Return what the map says of parking on a side; None where it says nothing."""
    for key in ("parking", "parking:lane"):
        for where in (side, "both"):
            if (value := tags.get(f"{key}:{where}")) is not None:
                return value
    return None


def _kerb_candidates(osm: OsmData, streets: StreetPolygons, left_driving: bool) -> Iterator[_Candidate]:
    """Bays along kerbs: in the parking lanes of the map, else where a street by its kind and width has them."""
    tags_of = {way.id: way.tags for way in osm.ways}
    breaks = junction_zones(streets)
    shapely.prepare(breaks)
    window = shapely.box(-osm.half, -osm.half, osm.half, osm.half)
    for street in streets.streets:
        tags = tags_of.get(street.way, {})
        raised = any(tags.get(key, "no") != "no" for key in ("bridge", "tunnel", "covered"))
        if raised or not shapely.intersects(window, shapely.LineString(street.line)):
            continue
        with drop_on_failure(f"w{street.way}"):
            turned = tags.get("oneway") == "-1"
            depths = {"left": street.parking_left, "right": street.parking_right}
            free = street.width - street.parking_left - street.parking_right
            for side, sign in (("left", 1.0), ("right", -1.0)):
                depth = depths[side]
                mapped = {"left": "right", "right": "left"}[side] if turned else side
                if not depth:
                    if not _by_habit(street, _parking_tag(tags, mapped), free):
                        continue
                    depth = _HABIT_DEPTH
                    free -= depth
                elif _for_loading(tags, mapped):
                    continue
                against = not street.oneway and (side == "right" if left_driving else side == "left")
                kind = "across" if is_perpendicular_parking(street, depth) else "kerb"
                for k, bay in enumerate(kerb_bays(street, sign, depth, breaks)):
                    if shapely.dwithin(breaks, shapely.Polygon(_rectangle(bay, bay.length, bay.width)), _JUNCTION):
                        continue
                    turn = math.pi if against and kind == "kerb" else 0.0
                    bay = bay._replace(yaw=math.remainder(bay.yaw + turn, 2 * math.pi))
                    yield _Candidate(f"w{street.way}.{side}.{k}", f"w{street.way}.{side}", kind, bay)


def _by_habit(street: Street, said: str | None, free: float) -> bool:
    """Whether people park at a kerb without a mapped parking lane."""
    if said is not None or street.kind not in _HABIT or street.slanted or street.cycle_left or street.cycle_right:
        return False
    return free >= _HABIT_DEPTH + _HABIT_ROOM * max(street.lanes, 1)


def _for_loading(tags: Tags, side: str) -> bool:
    """Whether a kerb is for loading only."""
    keys = [f"parking:{kind}:{where}" for kind in ("condition", "restriction") for where in (side, "both")]
    keys += [f"parking:{where}:restriction" for where in (side, "both")]
    return any(re.search("loading|no_stopping|no_parking", tags.get(key, "")) for key in keys)


def _lot_candidates(osm: OsmData, streets: StreetPolygons) -> Iterator[_Candidate]:
    window = shapely.box(-osm.half, -osm.half, osm.half, osm.half)
    for n, shape in enumerate(streets.parking.geoms):
        if shapely.intersects(window, shape):
            with drop_on_failure(f"car park {n}"):
                for k, bay in enumerate(lot_bays(shape)):
                    yield _Candidate(f"lot{n}.{k}", f"lot{n}", "lot", bay)


def _rectangle(bay: Bay, length: float, width: float) -> NDArray[np.float64]:
    c, s = math.cos(bay.yaw), math.sin(bay.yaw)
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * (length / 2, width / 2)
    return np.asarray(bay.centre) + corners @ np.array([[c, s], [-s, c]])


def _on_level_ground(found: Sequence[_Candidate], height: HeightField) -> NDArray[np.bool_]:
    """Which bays are so level that a car's wheels touch the ground."""
    middle = np.array([one.bay.centre for one in found])
    yaw = np.array([one.bay.yaw for one in found])
    ahead = 1.4 * np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
    across = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1) / 2
    rise = np.abs(height(middle + ahead) - height(middle - ahead)) / 2.8
    tilt = np.abs(height(middle + across) - height(middle - across)) / 1.4
    return np.asarray((rise < _STEEP) & (tilt < _STEEP), bool)


def _kept_free(
    osm: OsmData,
    streets: StreetPolygons,
    lanes: LaneGraph,
    transit: Transit,
    solids: Sequence[BaseGeometry],
    objects: Objects,
) -> list[tuple[NDArray[np.object_], float]]:
    """Shapes that no car may come near, with the metres it keeps from them."""
    standing = objects.where(objects.outdoors & objects.solid)
    tracks = [shapely.LineString(line) for line in streets.rails]
    hydrants = [shapely.Point(n.xy) for n in osm.nodes if n.tags.get("emergency") == "fire_hydrant"]
    hydrants += [shapely.Point(n.xy) for n in osm.nodes if n.tags.get("amenity") == "parking_entrance"]
    kept: list[tuple[Sequence[BaseGeometry], float]] = [
        (list(solids), _WALL),
        ([shapely.Polygon(corners) for corners in standing.feet()], _THING),
        ([crossing.polygon for crossing in streets.crossings], _CROSSING),
        (tracks, _RAIL),
        (hydrants, _HYDRANT),
        (_lane_bands(lanes), 0.0),
        ([shapely.LineString(lanes.walks.line(k)) for k in range(len(lanes.walks))], _WALKER),
        (_stop_zones(transit, lanes), 0.0),
    ]
    return [(np.array(shapes, object), away) for shapes, away in kept if shapes]


def _lane_bands(lanes: LaneGraph) -> list[BaseGeometry]:
    """Return the lanes in their full width, those through junctions too."""
    if not len(lanes):
        return []
    lines = np.array([shapely.LineString(lanes.line(k)) for k in range(len(lanes))], object)
    return list(overlay.buffer(lines, lanes.width / 2 - 0.05, cap_style="flat"))


def _stop_zones(transit: Transit, lanes: LaneGraph) -> list[BaseGeometry]:
    """Return the kerbs that buses draw up at."""
    zones = []
    for stop in transit.stops:
        lane = lanes.index.get(stop.lane)
        if lane is not None:
            ends = [stop.offset - _STOP_BEFORE, stop.offset, stop.offset + _STOP_AFTER]
            line = shapely.LineString(lanes.at(lane, np.array(ends))[:, :2])
            zones.append(overlay.buffer(line, _STOP_WIDE, cap_style="flat"))
    return zones


def _apart(chosen: NDArray[np.int64], feet: NDArray[np.object_]) -> NDArray[np.int64]:
    """Of bays that overlap (streets mapped in pieces, or twice), keep the first."""
    first, second = shapely.STRtree(feet[chosen]).query(feet[chosen], predicate="intersects")
    taken = np.zeros(len(chosen), bool)
    for a, b in sorted(zip(first.tolist(), second.tolist(), strict=True)):
        if a < b and not taken[a]:
            taken[b] = True
    return chosen[~taken]


@cache
def _outline(prototype: str) -> tuple[float, float, float]:
    """Size of a model with its mirrors, metres."""
    points = np.concatenate([surface.positions for surface in vehicle_prototypes()[prototype]])
    reach = np.abs(points).max(axis=0)
    return float(2 * reach[0]), float(2 * reach[1]), float(points[:, 2].max())


def _car(one: _Candidate, seed: int, height: HeightField) -> dict[str, object] | None:
    """Park a car in a bay, or leave it free."""
    share = rng(seed, "parking", one.source).uniform(*_TAKEN)
    random = rng(seed, "parking", one.id)
    if random.random() >= share:
        return None
    bay = one.bay
    fitting = [name for name in _SHARES if vehicle_size(name)[0] + 2 * _BUMPER <= bay.length]
    if not fitting:
        return None
    shares = np.array([_SHARES[name] for name in fitting])
    kind = fitting[int(random.choice(len(fitting), p=shares / shares.sum()))]
    prototype = f"{kind}_{CAR_KINDS[kind][int(random.integers(len(CAR_KINDS[kind])))]}"
    size = _outline(prototype)
    ahead = np.array([math.cos(bay.yaw), math.sin(bay.yaw)])
    spare = min(max(bay.length - size[0] - 0.6, 0.0) / 2, 0.3)
    x, y = np.asarray(bay.centre) + ahead * random.uniform(-spare, spare)
    turned = math.pi if one.kind != "kerb" and random.random() < 0.35 else 0.0  # share of cars that back into a bay
    return {
        "id": f"parked.{one.id}",
        "kind": CAR,
        "group": "amenity",
        "prototype": prototype,
        "x": round(float(x), 3),
        "y": round(float(y), 3),
        "z": round(float(height((round(float(x), 3), round(float(y), 3)))), 3),
        "yaw": round(math.remainder(bay.yaw + turned + random.uniform(-0.012, 0.012), 2 * math.pi), 4),
        "scale": 1.0,
        "size_x": round(size[0], 3),
        "size_y": round(size[1], 3),
        "size_z": round(size[2], 3),
        "solid": True,
        "room": "",
    }


def _spot(one: _Candidate, lanes: LaneGraph, height: HeightField, car: int | None) -> ParkingSpot:
    """Make the record of a spot; the lane is the one beside it that leads the way a car in it faces."""
    bay = one.bay
    spot = ParkingSpot(
        id=one.id,
        position=(round(bay.centre[0], 3), round(bay.centre[1], 3), round(float(height(bay.centre)), 3)),
        yaw=round(bay.yaw, 4),
        length=round(bay.length, 2),
        width=round(bay.width, 2),
        kind=one.kind,
        car=car,
    )
    if one.kind != "kerb" or not len(lanes):
        return spot
    near = lanes.nearest(bay.centre, reach=_LANE_REACH)
    if near is None:
        return spot
    lane, offset, _ = near
    x, y, yaw = lanes.at(lane, offset)
    if abs(math.remainder(yaw - bay.yaw, 2 * math.pi)) > _LANE_TURN:
        return spot
    side = math.cos(yaw) * (bay.centre[1] - y) - math.sin(yaw) * (bay.centre[0] - x)
    return spot.model_copy(update={"lane": lanes.ids[lane], "offset": round(offset, 3), "side": round(float(side), 3)})
