"""The building of a place, and the doors that it is entered by."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.exact import dot
from vico.geo import overlay
from vico.geo.osm import OsmData, Tags
from vico.world.check.outdoors import faces_into
from vico.world.heights import HeightField
from vico.world.model import Building, Category, Entrance, Place
from vico.world.routing import Router
from vico.world.walkable import CROSSING, OPEN, ROADWAY, SIDEWALK, WalkableMap
from vico.worldgen.facts.fault_isolation import drop_on_failure
from vico.worldgen.facts.named_places import NamedPlace

_NO_DOOR = {"no", "service", "garage", "emergency", "exit", "fire_exit", "private"}

MATCH = 8.0  # metres from a building's outline within which a place is taken to be in it
_OWN_DOOR = 12.0  # metres within which a mapped entrance is a place's own
_SAME_DOOR = 2.5  # metres within which two doors are one
_SHOP_GAP = 4.5  # metres between the doors of two shops
_MOST_THROUGH = 8  # shops deep inside that one mapped entrance serves
_WHOLE = 0.7  # share of a building's ground above which an area in it is the building
_DEEP = 14.0  # metres from every wall at which a shop has none of its own
_STEP = 0.8  # metres between the points of an outline that are tried as doors
_APPROACHES = (0.7, 1.0, 1.3, 1.6, 1.9)
_OUTDOORS = (Category.OPEN, Category.TRANSIT)


@dataclass(frozen=True)
class _DoorSpots:
    """Where a building could have doors.

    Attributes
    ----------
    at, out, approach
        Points on the outline, outward normals, reachable points before them; shape ``(n, 2)``.
    cost
        How ill suited each is (approach on a roadway, near a corner), metres.
    """

    at: NDArray[np.float64]
    out: NDArray[np.float64]
    approach: NDArray[np.float64]
    cost: NDArray[np.float64]


class DoorFinder:
    """Finds buildings and doors, and keeps the doors it made."""

    def __init__(self, osm: OsmData, buildings: Sequence[Building], walkable: WalkableMap, height: HeightField) -> None:
        self.osm = osm
        self.buildings = list(buildings)
        self.walkable = walkable
        self.height = height
        self.router = Router(walkable)
        self.shapes = [shapely.Polygon(b.footprint[0], b.footprint[1:]) for b in buildings]
        self.tree = shapely.STRtree(self.shapes)
        self.index = {b.id: i for i, b in enumerate(buildings)}
        self.entrances: list[Entrance] = []
        self._through: Counter[str] = Counter()
        self._taken: dict[int, dict[str, tuple[float, float]]] = defaultdict(dict)
        self._own: dict[str, list[Entrance]] = defaultdict(list)
        self._doors: dict[int, _DoorSpots] = {}
        self._area_tags = {area.id: area.tags for area in osm.areas}
        self._mapped = self._mapped_entrances()

    def tags_of(self, building: Building) -> Tags:
        """Return the map's tags of a building."""
        return self._area_tags.get(building.id, self._area_tags.get(building.id.split(".")[0], building.tags))

    def ground(self, xy: Sequence[float] | NDArray[np.float64]) -> tuple[float, float, float]:
        """Put a point on the ground."""
        x, y = round(float(xy[0]), 3), round(float(xy[1]), 3)
        return x, y, round(float(self.height((x, y))), 3)

    def building_at(self, xy: NDArray[np.float64], within: float) -> int | None:
        """Find the building that contains a point, else the nearest within some metres."""
        point = shapely.Point(xy)
        inside = self.tree.query(point, predicate="within")
        if len(inside):
            return int(min(inside, key=lambda i: (self.shapes[i].area, i)))
        near = self.tree.query_nearest(point, max_distance=within)
        return int(min(near)) if len(near) else None

    def in_window(self, shape: shapely.Polygon) -> bool:
        """Whether a building's middle lies in the world's square."""
        x, y = shape.centroid.coords[0]
        return max(abs(x), abs(y)) < self.osm.half

    def misfit(self, named: NamedPlace) -> str | None:
        """Why something named is no place here, or None."""
        tags = named.tags
        if any(tags.get(k) == "yes" for k in ("disused", "abandoned", "demolished")):
            return "closed for good"
        if tags.get("access") in ("private", "no") and named.category is Category.OPEN:
            return "not open to the public"
        return None

    def is_outdoors(self, named: NamedPlace) -> bool:
        """Whether a place lies under the sky."""
        if named.category not in _OUTDOORS:
            return False
        return not ("building" in named.tags or named.tags.get("amenity") == "bus_station")

    def outdoors(self, named: NamedPlace) -> Place | str:
        """Make an open place or a station, at a reachable point of it."""
        spot = self.router.nearest_walkable(named.xy, within=40.0 if named.area is not None else 15.0)
        if spot is None:
            return "can't be reached on foot"
        if named.area is not None and named.area.distance(shapely.Point(spot)) > 12.0:
            return "can't be reached on foot"
        return Place(
            id=named.id,
            name=named.name,
            category=named.category,
            kind=named.kind,
            building=None,
            entrance=None,
            position=self.ground(spot),
            opening_hours=named.tags.get("opening_hours"),
        )

    def indoors(self, named: NamedPlace) -> Place | str:
        """Make a place in a building, with its door."""
        whole = self.index.get(named.id)
        shared: list[tuple[float, int]] = []
        if whole is None and named.area is not None:
            hits = self.tree.query(named.area, predicate="intersects")
            shared = [(overlay.common_area(self.shapes[i], named.area), -int(i)) for i in hits]
            if shared and max(shared)[0] > 4.0:
                whole = -max(shared)[1]
        at = whole if whole is not None else self.building_at(named.xy, MATCH)
        part = None
        if whole is not None and shared and max(shared)[0] < _WHOLE * self.shapes[whole].area:
            # A shop drawn as a part of its building.
            whole, part = None, named.area
        if at is None:
            return f"no building within {MATCH:g} m"
        building = self.buildings[at]
        if whole is not None:
            door = self.building_door(building)
        elif named.exact:
            door = self._own_door(at, named.xy if part is None else self._front(at, part, named.xy))
        else:
            door = self.building_door(building, len(self._own[building.id]))
        if door is None:
            return f"building {building.id} has no wall that can be reached on foot"
        return Place(
            id=named.id,
            name=named.name,
            category=named.category,
            kind=named.kind,
            building=building.id,
            entrance=door.id,
            position=self.ground(door.approach),
            opening_hours=named.tags.get("opening_hours"),
        )

    def building_door(self, building: Building, number: int = 0) -> Entrance | None:
        """Find a building's door: the mapped entrances, main one first, else the wall that best faces the street."""
        at = self.index[building.id]
        mapped = self._mapped.get(at, [])
        usable = [e for xy, _ in mapped if (e := self._entrance(at, xy, 3.0)) is not None]
        distinct = list(dict.fromkeys(e.id for e in usable))
        if distinct:
            chosen = distinct[number % len(distinct)]
            return next(e for e in usable if e.id == chosen)
        doors = self._candidates(at)
        if not len(doors.at):
            return None
        cost = doors.cost.copy()
        if number:
            # Further stairways keep their distance from the doors there are.
            taken = np.array([e.position[:2] for e in self._own[building.id]]).reshape(-1, 2)
            if len(taken):
                away = np.min(np.linalg.norm(doors.at[:, None] - taken[None], axis=2), axis=1)
                cost = cost + np.maximum(0.0, 12.0 - away)
        return self._entrance_at(at, doors, int(np.argmin(cost)))

    def _front(self, at: int, part: shapely.Geometry, xy: NDArray[np.float64]) -> NDArray[np.float64]:
        """Where a part of a building has its best door: on the outline it shares, else `xy`."""
        doors = self._candidates(at)
        if not len(doors.at):
            return xy
        along = np.flatnonzero(shapely.dwithin(part, shapely.points(doors.at), 0.8))
        return xy if not len(along) else doors.at[along[int(np.argmin(doors.cost[along]))]]

    def _own_door(self, at: int, xy: NDArray[np.float64]) -> Entrance | None:
        """Find the door of a shop: a mapped entrance near it, else the wall nearest to it, shared only in need.

        Shops deep inside a building (a mall's) are entered by the building's doors.
        """
        mapped = [place for place, _ in self._mapped.get(at, [])]
        taken = self._taken[at]
        deep = float(self.shapes[at].exterior.distance(shapely.Point(xy))) > _DEEP
        near = sorted((float(np.hypot(*(place - xy))), k) for k, place in enumerate(mapped))
        doors = [
            door
            for distance, k in near
            if (deep or distance < _OWN_DOOR) and (door := self._entrance(at, mapped[k], 3.0)) is not None
        ]
        free = [door for door in doors if door.id not in taken]
        if doors and deep:
            # Not all of a mall through one door.
            chosen = next((door for door in doors if self._through[door.id] < _MOST_THROUGH), None)
            chosen = chosen or self._entrance(at, xy, math.inf) or doors[0]
            self._through[chosen.id] += 1
            return chosen
        chosen = free[0] if free else self._spaced_door(at, xy, taken)
        if chosen is None and doors:
            chosen = doors[0]
        if chosen is None:
            chosen = self._entrance(at, xy, math.inf)
        if chosen is not None:
            taken[chosen.id] = chosen.position[:2]
        return chosen

    def _spaced_door(self, at: int, xy: NDArray[np.float64], taken: dict[str, tuple[float, float]]) -> Entrance | None:
        """Find the wall nearest to a point that is no other shop's; None where it is another street's, or far off."""
        doors = self._candidates(at)
        if not len(doors.at):
            return None
        away = np.linalg.norm(doors.at - xy, axis=1) + 0.35 * doors.cost
        best = int(np.argmin(away))
        others = np.array(list(taken.values())).reshape(-1, 2)
        if len(others):
            gap = np.linalg.norm(doors.at[:, None] - others[None], axis=2).min(axis=1)
            alike = (dot(doors.out, doors.out[best]) > 0.7) & (doors.cost < doors.cost[best] + 4.0)
            away = np.where((gap >= _SHOP_GAP) & (away < away[best] + _OWN_DOOR) & alike, away, np.inf)
            best = int(np.argmin(away))
            if not np.isfinite(away[best]):
                return None
        return self._entrance_at(at, doors, best)

    def _entrance(self, at: int, xy: NDArray[np.float64], within: float) -> Entrance | None:
        """Find the door nearest to a point."""
        doors = self._candidates(at)
        if not len(doors.at):
            return None
        away = np.linalg.norm(doors.at - xy, axis=1)
        best = int(np.argmin(away + 0.35 * doors.cost))
        if away[best] > within:
            return None
        return self._entrance_at(at, doors, best)

    def _entrance_at(self, at: int, doors: _DoorSpots, k: int) -> Entrance:
        """Return the entrance at a candidate, or the one that is there already."""
        building = self.buildings[at]
        for other in self._own[building.id]:
            if math.hypot(other.position[0] - doors.at[k, 0], other.position[1] - doors.at[k, 1]) < _SAME_DOOR:
                return other
        door = Entrance(
            id=f"entrance_{len(self.entrances)}",
            building=building.id,
            position=self.ground(doors.at[k]),
            facing=round(math.atan2(doors.out[k, 1], doors.out[k, 0]), 5),
            approach=(round(float(doors.approach[k, 0]), 3), round(float(doors.approach[k, 1]), 3)),
        )
        self.entrances.append(door)
        self._own[building.id].append(door)
        return door

    def _mapped_entrances(self) -> dict[int, list[tuple[NDArray[np.float64], str]]]:
        """Entrance nodes by building, main ones first."""
        found: dict[int, list[tuple[NDArray[np.float64], str]]] = defaultdict(list)
        for node in self.osm.nodes:
            kind = node.tags.get("entrance") or ("yes" if node.tags.get("building") == "entrance" else "no")
            if kind in _NO_DOOR or node.tags.get("access") in ("no", "private"):
                continue
            with drop_on_failure(f"n{node.id}"):
                point = shapely.Point(node.xy)
                near = self.tree.query(point, predicate="dwithin", distance=1.0)
                near = [i for i in near.tolist() if shapely.distance(self.shapes[i].exterior, point) < 1.0]
                if near:
                    found[min(near)].append((node.xy, kind))
        for doors in found.values():
            doors.sort(key=lambda door: ("main", "home", "staircase", "yes").index(door[1])
                       if door[1] in ("main", "home", "staircase", "yes") else 4)  # fmt: skip
        return found

    def _candidates(self, at: int) -> _DoorSpots:
        """Points of a building's outer ring that can be reached from outside."""
        if at in self._doors:
            return self._doors[at]
        ring = np.array(self.shapes[at].exterior.coords)[:, :2]
        if not self.shapes[at].exterior.is_ccw:
            ring = ring[::-1]
        spots, outs, corner = [], [], []
        for a, b in pairwise(ring):
            length = float(np.hypot(*(b - a)))
            if length < 1.2:
                continue
            along = (b - a) / length
            count = max(1, int((length - 1.0) / _STEP) + 1)
            offsets = length / 2 + (np.arange(count) - (count - 1) / 2) * ((length - 1.2) / max(count - 1, 1))
            spots.append(a + offsets[:, None] * along)
            outs.append(np.tile([along[1], -along[0]], (count, 1)))
            # A door in a wall's middle, and in a long wall rather than a short one.
            corner.append(np.abs(offsets - length / 2) * 0.05 + np.maximum(0.0, 6.0 - length) * 0.5)
        if not spots:
            nowhere = np.zeros((0, 2))
            self._doors[at] = _DoorSpots(nowhere, nowhere, nowhere, np.zeros(0))
            return self._doors[at]
        where, out, cost = np.concatenate(spots), np.concatenate(outs), np.concatenate(corner)
        # What a door opens to: the sidewalk best, then open ground, then the roadway.
        price = np.full(6, np.inf)
        price[[SIDEWALK, CROSSING, OPEN, ROADWAY]] = (0.0, 0.0, 4.0, 8.0)
        best = np.full(len(where), np.inf)
        approach = np.zeros_like(where)
        for distance in _APPROACHES:
            # As it is written: a millimetre decides on which side of a cell's edge a spot lies.
            spot = np.round(where + out * distance, 3)
            found = price[self.walkable.class_at(spot)] + distance
            found[~self.walkable.is_connected(spot)] = np.inf
            better = found < best
            best[better], approach[better] = found[better], spot[better]
        # In blocks the street is where the sidewalk is: count how far it is from the door, up to 12 m.
        for distance in (4.0, 8.0, 12.0):
            seen = self.walkable.class_at(where + out * distance)
            cost = cost + np.where(np.isin(seen, (SIDEWALK, CROSSING, ROADWAY)), 0.0, 1.0)
        # A wall that comes back on itself within a hand's breadth has its other side before it.
        good = np.isfinite(best) & ~faces_into(self.shapes[at], np.round(where, 3), out)
        self._doors[at] = _DoorSpots(where[good], out[good], approach[good], (cost + best)[good])
        return self._doors[at]
