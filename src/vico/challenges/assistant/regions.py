"""The regions that tasks speak of: places and spots outdoors within a walk of the start that somebody knows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from vico.challenges.assistant.model import Region, Surface
from vico.challenges.assistant.thresholds import CANDIDATES
from vico.community.model import Resident
from vico.world.model import Place
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


def told(region: Region) -> str:
    """Return a region as instructions put it."""
    if region.kind == "outdoor":
        return f"outdoors at {region.name}"
    return f"{region.name}, by the {region.surface.kind}" if region.surface is not None else region.name


def either(regions: Sequence[Region]) -> str:
    """Return several regions as instructions put them, one of which is right."""
    names = [told(region) for region in regions]
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} or {names[-1]}"
