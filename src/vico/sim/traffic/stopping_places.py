"""Where cars stop: free parking spots that can be reached, at the kerb and in car parks, and edges of lanes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.sim.traffic.car_park_ways import places_in_car_parks
from vico.sim.traffic.records import NONE, STOPPING_PLACE, Records
from vico.sim.traffic.state import LaneNetwork
from vico.world.lanes import LaneGraph
from vico.world.walkways import CROSSING, Walkways
from vico.world.world import World

#: Length, width, overhang and wheelbase of the largest car that parks, and of the van, metres.
_CAR, _VAN = (4.7, 1.9, 0.92, 2.78), (5.1, 1.98, 0.95, 3.1)
_SPARE = 0.5  # m of a spot that a car leaves free
_RADIUS, _LEAST_TAPER = 6.0, 8.0  # m, of the bend into a place, and of lane it takes
_AIR = 0.12  # m between a car on its way into a place and anything that stands
_BEFORE, _AFTER = 6.0, 7.0  # m of lane before that way and after it, where others wait for a junction
_STEP = 0.5  # m between outlines of the way
_DELIVERY_ENDS, _DELIVERY_EVERY, _DELIVERY_LANE = 35.0, 20.0, 80.0  # m to a lane's ends, between places, of lane
_EDGE, _INWARDS = 0.15, 0.5  # m that a van keeps to its lane's edge; how far it leaves the middle
_CROSSING, _STOP, _RAILS = 10.0, 25.0, 4.0  # m kept to crossings, stops and rails


class _Place(NamedTuple):
    lane: int
    middle: float
    side: float
    longest: float
    taper: float
    reverse: bool
    delivery: bool


def with_stopping_places(
    network: LaneNetwork, lanes: LaneGraph, walks: Walkways, world: World, solids: Sequence[shapely.Polygon]
) -> LaneNetwork:
    """Return the lanes with the places of a world where cars stop.

    Parameters
    ----------
    network
        The lanes, without such places.
    lanes, walks
        Lanes and walkways as the world has them, in the network's order.
    solids
        Footprints nobody drives through.
    """
    if not len(lanes):
        return network
    tree = shapely.STRtree(list(solids))
    found = [*_parking(world, network, lanes, tree), *_deliveries(world, network, lanes, walks, tree)]
    places = np.zeros(len(found), STOPPING_PLACE)
    places["lot"] = NONE
    for name, column in zip(_Place._fields, zip(*sorted(found), strict=True), strict=False):
        places[name] = column
    parks, points = places_in_car_parks(world.parking, network, lanes, walks, tree)
    places = np.concatenate([places, parks])
    places = places[np.argsort(places["lane"], kind="stable")]
    return with_places(network, places)._replace(way_points=points)


def with_places(network: LaneNetwork, places: Records) -> LaneNetwork:
    """Return the lanes with some places, dtype `STOPPING_PLACE`, in the order of their lanes."""
    records = network.lanes.copy()
    records["first_place"] = np.searchsorted(places["lane"], np.arange(len(records)), side="left")
    records["end_place"] = np.searchsorted(places["lane"], np.arange(len(records)), side="right")
    return network._replace(lanes=records, places=places)


def without_deliveries(network: LaneNetwork, lanes: NDArray[np.int32]) -> LaneNetwork:
    """Return the network without places for deliveries on some lanes."""
    places = network.places
    return with_places(network, places[~(places["delivery"] & np.isin(places["lane"], lanes))])


def _parking(world: World, network: LaneNetwork, lanes: LaneGraph, tree: shapely.STRtree) -> Iterator[_Place]:
    """Free spots along kerbs that a car gets out of forwards."""
    for spot in world.parking:
        lane = lanes.index.get(spot.lane) if spot.lane is not None else None
        if spot.car is not None or spot.kind != "kerb" or lane is None or network.lanes["closed"][lane]:
            continue
        place = _Place(lane, spot.offset, spot.side, spot.length - _SPARE, _taper(spot.side), True, False)
        if not _fits_lane(place, _CAR, lanes):
            continue
        ways = [_swept(place, _CAR, lanes, ahead=ahead) for ahead in (True, False)]
        clear = [not len(tree.query(way, predicate="intersects")) for way in ways]
        if not clear[0]:
            continue
        yield place._replace(reverse=not clear[1])


def _deliveries(
    world: World, network: LaneNetwork, lanes: LaneGraph, walks: Walkways, tree: shapely.STRtree
) -> Iterator[_Place]:
    """Places at the kerb side of streets that have another lane, away from crossings, stops and rails."""
    transit = world.transit
    crossings = [shapely.LineString(walks.line(int(k))) for k in np.flatnonzero(walks.kind == CROSSING)]
    stops = [shapely.Point(stop.wait[:2]) for stop in transit.stops]
    stops += [shapely.Point(stop.wait[:2]) for stop in transit.tram_stops]
    rails = [shapely.LineString(line.track) for line in transit.tram_lines]
    kept = [
        (shapely.STRtree(shapes), away) for shapes, away in ((crossings, _CROSSING), (stops, _STOP), (rails, _RAILS))
    ]
    records = network.lanes
    kerb, beside = (lanes.left, lanes.right) if lanes.lefthand else (lanes.right, lanes.left)
    usable = (records["inside"] < 0) & (records["junction"] < 0) & ~records["closed"] & (lanes.length > _DELIVERY_LANE)
    usable &= (kerb < 0) & (beside >= 0) & ~records["closed"][np.maximum(beside, 0)]
    for lane in np.flatnonzero(usable).tolist():
        side = min(max(float(lanes.width[lane]) / 2 - _VAN[1] / 2 - _EDGE, 0.0), _INWARDS)
        side = side if lanes.lefthand else -side
        for middle in np.arange(_DELIVERY_ENDS, lanes.length[lane] - _DELIVERY_ENDS, _DELIVERY_EVERY).tolist():
            place = _Place(lane, middle, side, 6.0, _LEAST_TAPER, False, True)
            way = _swept(place, _VAN, lanes, ahead=False)
            near = any(len(shapes.query(way, predicate="dwithin", distance=away)) for shapes, away in kept)
            if not near and not len(tree.query(way, predicate="intersects")):
                yield place


def _taper(side: float) -> float:
    return max(_LEAST_TAPER, float(np.sqrt(6.0 * abs(side) * _RADIUS)))


def _fits_lane(place: _Place, size: tuple[float, float, float, float], lanes: LaneGraph) -> bool:
    """Return whether the ways into a place and out of it are on its lane."""
    length, _, _, wheelbase = size
    begin = place.middle - length / 2 - place.taper
    end = place.middle + length / 2 + place.taper + wheelbase
    return bool(begin > _BEFORE and end < lanes.length[place.lane] - _AFTER)


def _swept(
    place: _Place, size: tuple[float, float, float, float], lanes: LaneGraph, *, ahead: bool
) -> shapely.Geometry:
    """Return the ground that a vehicle takes on its way out of a place (`ahead`), or forwards into it."""
    length, width, overhang, wheelbase = size
    rest = place.middle + length / 2
    reach = place.taper + wheelbase
    fronts = np.arange(rest, rest + reach + _STEP, _STEP) if ahead else np.arange(rest - reach, rest + _STEP, _STEP)
    axles = np.stack([fronts - overhang, fronts - overhang - wheelbase])
    done = (axles - (rest - overhang)) if ahead else (rest - overhang - wheelbase - axles)
    share = np.clip(done / max(place.taper, 1e-6), 0.0, 1.0)
    x, y, yaw = np.moveaxis(lanes.at(np.int64(place.lane), axles.ravel()), -1, 0)
    off = (place.side * (1.0 - share * share * (3.0 - 2.0 * share))).ravel()
    xy = np.stack([x - np.sin(yaw) * off, y + np.cos(yaw) * off], axis=-1).reshape(2, -1, 2)
    along = (xy[0] - xy[1]) / np.linalg.norm(xy[0] - xy[1], axis=1)[:, None]
    centre = xy[0] + along * (overhang - length / 2)
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    corners = [
        centre + a * (length / 2 + _AIR) * along + b * (width / 2 + _AIR) * across
        for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))
    ]
    return shapely.union_all(shapely.polygons(np.stack(corners, axis=1)))
