"""Regions of tasks, and the objects of a task on their surfaces.

Regions are places and spots outdoors within a walk of the start that somebody knows. Things lie where they find room
beside others: a chair holds one toolbox.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.assets.models.movable import movable_colours, movable_kinds
from vico.challenges.assistant.tasks import CANDIDATES, OFF_MIDDLE, Region, Surface, TaskObject
from vico.community.model import Resident
from vico.errors import EmptyInputError
from vico.exact import apply_matrix, dot
from vico.geometry import distances
from vico.world.model import Container, Place, Point3, Room
from vico.world.routing import Router
from vico.world.walkable import OPEN, SIDEWALK
from vico.world.world import World

# Nearer to the start than this is no errand, metres of walk.
_LEAST_WALK = 15.0
# Spots outdoors lie so near to places that somebody knows, metres.
_BESIDE = 40.0
_STREET_WITHIN = 40.0


class Neighbourhood:
    """What lies within a walk of a starting point.

    Parameters
    ----------
    start
        ENU metres, shape ``(2,)``.
    reach
        Longest walk from the start, metres.
    """

    def __init__(self, world: World, router: Router, start: NDArray[np.float64], *, reach: float) -> None:
        self.world = world
        self.start = start
        self.reach = reach
        self._walk = router.distance_field(start)
        #: Places with rooms, by id.
        self.places = {p.id: p for p in world.places if p.rooms and self.is_near(p.position)}

    def distance(self, point: Sequence[float] | NDArray[np.float64]) -> float:
        """Walk from the start, metres; infinite where nobody can go."""
        walkable = self.world.walkable
        ix, iy = np.clip(walkable.cell_of(np.asarray(point)[:2]), 0, walkable.n - 1)
        return float(self._walk[iy, ix])

    def is_near(self, point: Sequence[float] | NDArray[np.float64]) -> bool:
        """Whether a task may speak of a point: within reach, and not where one stands already."""
        return _LEAST_WALK <= self.distance(point) <= self.reach

    def places_of(self, person: Resident) -> list[Place]:
        """Places within reach that somebody knows: those of their day first, in its order."""
        of_day = [item.place for item in person.schedule if item.place is not None]
        known = dict.fromkeys((*of_day, person.home, *person.known_places))
        return [self.places[place] for place in known if place in self.places]

    def stays_of(self, person: Resident, *, radius: float) -> list[Region]:
        """Regions within reach where somebody spends time on that day, in its order: places, and spots outdoors."""
        of_day = dict.fromkeys(item.place for item in person.schedule if item.place is not None)
        places = [self.world.place_by_id[place] for place in of_day]
        return [self.whereabouts(place, radius=radius) for place in places if self.is_near(place.position)]

    def whereabouts(self, place: Place, *, radius: float) -> Region:
        """Return where somebody is who is at a place: inside, or about the spot where it has no rooms."""
        return place_region(place) if place.rooms else self.spot(np.asarray(place.position[:2]), radius=radius)

    def spots_of(self, person: Resident, chance: np.random.Generator, *, radius: float) -> list[Region]:
        """Spots on pavements and squares, with free room around them, near places that somebody knows."""
        walkable = self.world.walkable
        known = dict.fromkeys((*person.known_places, person.home, *(i.place for i in person.schedule if i.place)))
        middles = np.array([self.world.place_by_id[place].position[:2] for place in known])
        free = walkable.connected & np.isin(walkable.cls, (OPEN, SIDEWALK)) & (walkable.clearance >= 1.0)
        free &= (self._walk >= _LEAST_WALK) & (self._walk <= self.reach)
        iy, ix = np.nonzero(free)
        centres = walkable.centre_of(np.column_stack([ix, iy]))
        near = np.zeros(len(centres), bool)
        for middle in middles:
            near |= np.hypot(*(centres - middle).T) <= _BESIDE
        centres = centres[near]
        if not len(centres):
            return []
        chosen = chance.choice(len(centres), size=min(CANDIDATES, len(centres)), replace=False)
        return [self.spot(centres[k], radius=radius) for k in chosen]

    def spot(self, xy: NDArray[np.float64], *, radius: float) -> Region:
        """Return the region around a spot outdoors."""
        centre = (float(xy[0]), float(xy[1]), float(self.world.height(xy)))
        return Region(kind="outdoor", name=describe_spot(self.world, xy), place=None, centre=centre, radius=radius)


def place_region(place: Place) -> Region:
    """Return the region that a place is."""
    return Region(kind="place", name=place.name, place=place.id, centre=place.position, radius=0.0)


def with_surface(region: Region, world: World, chance: np.random.Generator) -> Region:
    """Name one of a place's surfaces, at or on which things are to be put; spots outdoors stay as they are."""
    if region.place is None:
        return region
    rooms = [world.room_by_id[name] for name in world.place_by_id[region.place].rooms]
    surfaces = [(room, one) for room in rooms for one in room.containers if one.kind != "floor"]
    if not surfaces:
        return region
    room, one = surfaces[int(chance.integers(len(surfaces)))]
    return region.model_copy(update={"surface": Surface(room=room.id, kind=one.kind, entity=one.entity)})


def describe_spot(world: World, xy: NDArray[np.float64]) -> str:
    """Say where a spot is as a passer-by would: the street, and what is near."""
    street, nearest = "", _STREET_WITHIN
    for road in world.roads.roads:
        if not road.name:
            continue
        line = np.asarray(road.line)
        steps = np.diff(line, axis=0)
        squared = np.maximum((steps**2).sum(1), 1e-9)
        along = np.clip(((xy - line[:-1]) * steps).sum(1) / squared, 0.0, 1.0)
        distance = float(np.linalg.norm(line[:-1] + along[:, None] * steps - xy, axis=1).min())
        if distance < nearest:
            street, nearest = road.name, distance
    near = min(world.places, key=lambda p: (float(np.hypot(p.position[0] - xy[0], p.position[1] - xy[1])), p.id))
    if not street:
        return f"the ground near {near.name}"
    return f"{street}, near {near.name}"


def region_text(region: Region) -> str:
    """Return a region as instructions put it."""
    if region.kind == "outdoor":
        return f"outdoors at {region.name}"
    return f"{region.name}, by the {region.surface.kind}" if region.surface is not None else region.name


def regions_text(regions: Sequence[Region]) -> str:
    """Return several regions as instructions put them, one of which is right."""
    names = [region_text(region) for region in regions]
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} or {names[-1]}"


# As the simulation looks for a spot beside.
_RING = 0.1  # metres between two rings
_DIRECTIONS = 16  # directions of each
_WITHIN = 2.0  # metres to the last one
# Surfaces of one height, and how deep things may be in each other, metres.
_SAME_HEIGHT, _TOLERANCE = 0.02, 1e-3


class PlacedThing(NamedTuple):
    """A thing in a room.

    Attributes
    ----------
    spot
        The middle of its underside, ENU metres.
    size
        Extents of its box, metres.
    yaw
        Counter-clockwise from east, radians.
    """

    spot: tuple[float, float, float]
    size: tuple[float, float, float]
    yaw: float


def free_spot(thing: PlacedThing, others: Sequence[PlacedThing], surfaces: Sequence[Container]) -> PlacedThing | None:
    """Return a thing where it would come to lie: where it is, or beside others on the same surface.

    Parameters
    ----------
    others
        What lies in the room already.
    surfaces
        Of the room.

    Returns
    -------
    Lying or None
        None if there is no such spot. On floors there always is one: `thing` is returned as it is.
    """
    if not any(_overlap(thing, other) for other in others):
        return thing
    x, y, z = thing.spot
    if any(one.kind == "floor" and abs(one.centre[2] - z) <= _SAME_HEIGHT for one in surfaces):
        return thing
    for ring in range(1, int(_WITHIN / _RING) + 1):
        for k in range(_DIRECTIONS):
            angle = 2 * math.pi * k / _DIRECTIONS
            spot = (x + _RING * ring * math.cos(angle), y + _RING * ring * math.sin(angle), z)
            moved = thing._replace(spot=spot)
            if _height_at(spot, surfaces, z) and not any(_overlap(moved, other) for other in others):
                return moved
    return None


def _height_at(spot: Sequence[float], surfaces: Sequence[Container], z: float) -> bool:
    """Return whether the highest surface at a point is at a height."""
    heights = [one.centre[2] for one in surfaces if _stands_on(spot, one)]
    return bool(heights) and abs(max(heights) - z) <= _SAME_HEIGHT


def _stands_on(spot: Sequence[float], surface: Container) -> bool:
    dx, dy = spot[0] - surface.centre[0], spot[1] - surface.centre[1]
    c, s = math.cos(surface.yaw), math.sin(surface.yaw)
    return abs(c * dx + s * dy) <= surface.size[0] / 2 and abs(c * dy - s * dx) <= surface.size[1] / 2


def _overlap(one: PlacedThing, other: PlacedThing) -> bool:
    """Return whether two boxes are in each other: no axis of theirs keeps them apart."""
    if one.spot[2] >= other.spot[2] + other.size[2] or other.spot[2] >= one.spot[2] + one.size[2]:
        return False
    mine, theirs = _corners(one), _corners(other)
    for yaw in (one.yaw, one.yaw + math.pi / 2, other.yaw, other.yaw + math.pi / 2):
        axis = np.array([math.cos(yaw), math.sin(yaw)])
        a, b = dot(mine, axis), dot(theirs, axis)
        if min(a.max(), b.max()) - max(a.min(), b.min()) < _TOLERANCE:
            return False
    return True


def _corners(thing: PlacedThing) -> NDArray[np.float64]:
    half = np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]]) * (thing.size[0] / 2, thing.size[1] / 2)
    c, s = math.cos(thing.yaw), math.sin(thing.yaw)
    return apply_matrix(half, np.array([[c, -s], [s, c]])) + thing.spot[:2]


_TRIES = 100


@dataclass
class ThingPlacer:
    """The things of an episode as they are drawn, each with a name that no other has.

    Parameters
    ----------
    chance
        Decides colours and where things lie.
    """

    world: World
    chance: np.random.Generator
    made: list[TaskObject] = field(default_factory=list)
    _lying: dict[str, list[PlacedThing]] = field(default_factory=dict, init=False, repr=False)

    def make(self, name: str, kind: str, *, in_region: Region, middles: Sequence[Region]) -> TaskObject:
        """Lay a thing down in a region, in the middle of none of those that are told.

        Raises
        ------
        EmptyInputError
            If it can lie in a middle only, or there is no room beside the others.
        """
        if in_region.place is None:
            position = self._spot_outdoors(in_region, np.array([r.centre[:2] for r in middles]))
            return self._add(name, kind, position, room=None, holder=None)
        for _ in range(_TRIES):
            position, room = self._spot_indoors(kind, in_region.place)
            thing = self._add(name, kind, position, room=room, holder=None)
            if self._finds_room(thing, room):
                return thing
            self.made.remove(thing)
        raise EmptyInputError(f"tasks: no surface of {in_region.name} has room for another {kind}; use a larger world")

    def hand(self, name: str, kind: str, *, holder: str, near: Point3) -> TaskObject:
        """Give a thing to somebody who holds it from the start; `near` is where they are expected."""
        return self._add(name, kind, near, room=None, holder=holder)

    def describe(self, names: Sequence[str]) -> str:
        """Return things in words: a red bag and a blue cup."""
        things = [thing for thing in self.made if thing.id in names]
        return " and ".join(movable_kinds()[thing.kind].described(thing.colour) for thing in things)

    def untold(self, regions: Sequence[Region]) -> list[Region]:
        """Regions in whose middle, which is told, no thing lies."""
        lying = np.array([thing.position[:2] for thing in self.made]).reshape(-1, 2)
        return [r for r in regions if (distances(lying, r.centre[:2]) >= OFF_MIDDLE).all()]

    def _add(self, name: str, kind: str, position: Point3, *, room: str | None, holder: str | None) -> TaskObject:
        taken = {thing.name for thing in self.made}
        free = [colour for colour in movable_colours() if f"{colour} {kind}" not in taken]
        if not free:
            raise EmptyInputError(f"tasks: no colour is left for another {kind}; add colours to the movable things")
        colour = free[int(self.chance.integers(len(free)))]
        thing = TaskObject(
            id=name,
            kind=kind,
            colour=colour,
            name=f"{colour} {kind}",
            position=position,
            yaw=float(self.chance.uniform(-np.pi, np.pi)),
            room=room,
            holder=holder,
        )
        self.made.append(thing)
        return thing

    def _finds_room(self, thing: TaskObject, room: str) -> bool:
        """Return whether a thing finds room beside those that lie in its room; where it does, it is one of them."""
        lying = self._lying.setdefault(room, [])
        width, depth, height = movable_kinds()[thing.kind].size
        wanted = PlacedThing(thing.position, (width, depth, height), thing.yaw)
        found = free_spot(wanted, lying, self.world.room_by_id[room].containers)
        if found is not None:
            lying.append(found)
        return found is not None

    def _spot_indoors(self, kind: str, place: str) -> tuple[Point3, str]:
        """Return a spot on one of a place's surfaces, and the id of its room."""
        rooms = [self.world.room_by_id[name] for name in self.world.place_by_id[place].rooms]
        surfaces = [(room, surface) for room in rooms for surface in room.containers]
        room, surface = surfaces[int(self.chance.integers(len(surfaces)))]
        return self._on(surface, room, kind), room.id

    def _spot_outdoors(self, region: Region, middles: NDArray[np.float64]) -> Point3:
        """Return a free, reachable spot of a region that lies in none of the middles that are told."""
        for _ in range(_TRIES):
            spot = self.world.walkable.random_point(
                self.chance, classes=(OPEN, SIDEWALK), near=region.centre, radius=region.radius, clearance=0.5
            )
            if distances(middles, spot).min() >= OFF_MIDDLE:
                return (float(spot[0]), float(spot[1]), float(self.world.height(spot)))
        raise EmptyInputError(f"tasks: at {region.name} things can lie in its middle only; use a larger world")

    def _on(self, surface: Container, room: Room, kind: str) -> Point3:
        """Return a spot on a surface; on the floor, where somebody can stand: furniture never buries the thing."""
        if surface.kind == "floor":
            return (surface.reach[0], surface.reach[1], room.centre[2])
        margin = max(movable_kinds()[kind].size[:2]) / 2
        half = np.maximum(np.asarray(surface.size) / 2 - margin, 0.0)
        u, v = self.chance.uniform(-half, half)
        c, s = np.cos(surface.yaw), np.sin(surface.yaw)
        x, y, z = surface.centre
        return (float(x + c * u - s * v), float(y + s * u + c * v), z)
