"""The things of a task: what they are, and where they lie."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from vico.assets.models.movable import movable_colours, movable_kinds
from vico.challenges.assistant.beside import Lying, spot_beside
from vico.challenges.assistant.model import Region, TaskObject
from vico.challenges.assistant.thresholds import OFF_MIDDLE
from vico.errors import EmptyInputError
from vico.geometry import distances
from vico.world.model import Container, Point3, Room
from vico.world.walkable import OPEN, SIDEWALK
from vico.world.world import World

_TRIES = 100


@dataclass
class Things:
    """The things of an episode as they are drawn, each with a name that no other has.

    Parameters
    ----------
    chance
        Decides colours and where things lie.
    """

    world: World
    chance: np.random.Generator
    made: list[TaskObject] = field(default_factory=list)
    _lying: dict[str, list[Lying]] = field(default_factory=dict, init=False, repr=False)

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

    def described(self, names: Sequence[str]) -> str:
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
        wanted = Lying(thing.position, (width, depth, height), thing.yaw)
        found = spot_beside(wanted, lying, self.world.room_by_id[room].containers)
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
