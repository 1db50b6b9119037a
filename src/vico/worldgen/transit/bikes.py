"""Bicycle stations: those of the map, else planned on sidewalks near where people go."""

from __future__ import annotations

import math
import re

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.geo import overlay
from vico.geometry import distances
from vico.seeds import rng
from vico.world.heights import HeightField
from vico.world.lanes import LaneGraph
from vico.world.transit import BikeStation
from vico.world.walkways import SIDEWALK, Walkways
from vico.worldgen.facts.fault_isolation import drop_on_failure
from vico.worldgen.facts.site import SiteFacts
from vico.worldgen.transit.plan import k_means, where_people_go

FIRST_STATION = 95_000

_CAPACITY = 12
_EACH = 40_000.0  # square metres of window for each planned station
_FEWEST, _MOST = 2, 6
_APART = 80.0
_INSIDE = 5.0  # metres from the window's edge
_ASIDE = 2.2  # metres from the middle of a footway
_FOOTWAYS = ("pedestrian", "footway", "living_street", "path", "cycleway")


def bike_stations(
    site: SiteFacts, lanes: LaneGraph, walks: Walkways, height: HeightField, seed: int
) -> tuple[list[BikeStation], str]:
    """Rental stations and where they come from (osm, planned)."""
    osm = site.osm
    random = rng(seed, "transit", "bikes")
    found: list[tuple[NDArray[np.float64], str, int]] = []
    places = [(f"n{n.id}", shapely.Point(n.xy), n.tags) for n in osm.nodes]
    places += [(a.id, a.polygon, a.tags) for a in osm.areas if not a.polygon.is_empty]
    for key, shape, tags in places:
        if tags.get("amenity") != "bicycle_rental":
            continue
        with drop_on_failure(key):
            xy = np.array(shape.centroid.coords[0])
            if osm.holds(xy, inset=_INSIDE):
                size = re.match(r"\d{1,4}", tags.get("capacity", ""))
                capacity = int(np.clip(int(size.group()) if size else _CAPACITY, 2, 60))
                name = tags.get("name") or f"Bike station {len(found) + 1}"
                found.append((_off_the_lanes(lanes, xy), name, capacity))
    origin = "osm"
    if not found:
        origin = "planned"
        found = [(xy, f"Bike station {k + 1}", _CAPACITY) for k, xy in enumerate(_planned(site, walks, seed))]
    stations = [
        BikeStation(
            id=f"bikes_{k}",
            entity=FIRST_STATION + k,
            name=name,
            position=(round(float(xy[0]), 3), round(float(xy[1]), 3), round(float(height(xy)), 3)),
            capacity=capacity,
            bikes=max(1, int(capacity * random.uniform(0.4, 0.8))),
        )
        for k, (xy, name, capacity) in enumerate(found)
    ]
    return stations, origin


def _planned(site: SiteFacts, walks: Walkways, seed: int) -> list[NDArray[np.float64]]:
    """Points of long stretches of sidewalk (of footways where there is none), nearest to where people go."""
    osm = site.osm
    stretches = [shapely.LineString(walks.line(int(i))) for i in np.flatnonzero(walks.kind == SIDEWALK)]
    stretches = [line for line in stretches if line.length > 15.0]
    if not stretches:
        west, south, east, north = osm.box
        window = shapely.box(west + _INSIDE, south + _INSIDE, east - _INSIDE, north - _INSIDE)
        for way in osm.ways:
            if way.tags.get("highway") in _FOOTWAYS and len(way.line) > 1:
                # Beside the way, not on it.
                with drop_on_failure(f"w{way.id}"):
                    beside = overlay.offset_curve(shapely.LineString(way.line), -_ASIDE)
                    stretches += [part for part in shapely.get_parts(overlay.intersection(beside, window))
                                  if part.geom_type == "LineString" and part.length > 15.0]  # fmt: skip
    if not stretches:
        return []
    # Not at the very corners, where people cross.
    spots = np.concatenate(
        [shapely.get_coordinates(line.interpolate(np.arange(6.0, line.length - 5.0, 4.0))) for line in stretches]
    )
    spots = spots[osm.holds(spots, inset=_INSIDE, edge=False)]
    wide, high = osm.sides
    count = int(np.clip(round(wide * high / _EACH), _FEWEST, _MOST))
    wanted = where_people_go(site)
    chosen: list[NDArray[np.float64]] = []
    for centre in k_means(wanted if len(wanted) else spots, count, rng(seed, "transit", "racks")):
        away = distances(spots, centre)
        for other in chosen:
            away = np.where(distances(spots, other) < _APART, np.inf, away)
        if len(away) and np.isfinite(away).any():
            chosen.append(spots[int(np.argmin(away))])
    return chosen


def _off_the_lanes(lanes: LaneGraph, xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Move a rack from the carriageway onto the kerb where the map has it on the street."""
    for _ in range(6):
        near = lanes.nearest(xy, among=np.ones(len(lanes), bool), reach=8.0)
        if near is None:
            break
        lane, offset, away = near
        least = float(lanes.width[lane]) / 2 + 1.0
        if away >= least:
            break
        x, y, yaw = lanes.at(lane, offset)
        aside = xy - (x, y)
        # To the side it is on already; to the right of the lane where it is on its middle.
        right = np.array([math.sin(yaw), -math.cos(yaw)])
        step = aside / away if away > 0.3 else right
        xy = np.array([x, y]) + step * (least + 0.05)
    return xy
