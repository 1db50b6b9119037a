"""Choosing what a task is about: nine candidates each time, and somebody who picks one.

Who picks is a function, so that a language model can take the seeded choice's place (paper, appendix: place and
object selection).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from vico.challenges.assistant.model import Region
from vico.errors import EmptyInputError
from vico.world.folder import World
from vico.world.model import Place
from vico.world.routing import Router
from vico.world.walkable import OPEN, SIDEWALK

CANDIDATES = 9

#: Given a question and the candidates' descriptions, the index of the one that is chosen.
Chooser = Callable[[str, Sequence[str]], int]


def seeded_chooser(rng: np.random.Generator) -> Chooser:
    """Return the offline chooser: any candidate, with equal chances."""
    return lambda question, candidates: int(rng.integers(len(candidates)))


class NearbyRegions:
    """What lies within a walk of a starting point: the regions a task can speak of.

    Parameters
    ----------
    start
        ENU metres, shape ``(2,)``.
    reach
        Longest walk from the start, metres of sidewalk.
    """

    def __init__(self, world: World, router: Router, start: NDArray[np.float64], *, reach: float) -> None:
        self.world = world
        self.router = router
        self.walk = router.distance_field(start)
        self.reach = reach
        self.places = [p for p in world.places if p.rooms and 15.0 <= self.distance(p.position) <= reach]
        self.rooms = {room.id: room for room in world.rooms}
        if len(self.places) < 2:
            raise EmptyInputError(
                f"tasks: only {len(self.places)} places that can be entered lie within a walk of {reach:.0f} m; "
                "start elsewhere or use a larger world"
            )

    def distance(self, point: Sequence[float] | NDArray[np.float64]) -> float:
        """Walk from the start, metres; infinite where nobody can go."""
        walkable = self.world.walkable
        ix, iy = np.clip(walkable.cell_of(np.asarray(point)[:2]), 0, walkable.n - 1)
        return float(self.walk[iy, ix])

    def indoor_candidates(self, rng: np.random.Generator, count: int) -> list[Region]:
        """Places to enter, each at most once."""
        order = rng.permutation(len(self.places))[:count]
        return [self._place_region(self.places[int(i)]) for i in order]

    def outdoor_candidates(self, rng: np.random.Generator, count: int, *, radius: float) -> list[Region]:
        """Spots on sidewalks and squares with free room around them."""
        found: list[Region] = []
        walkable = self.world.walkable
        free = walkable.connected & np.isin(walkable.cls, (OPEN, SIDEWALK)) & (walkable.clearance >= 1.0)
        free &= (self.walk >= 15.0) & (self.walk <= self.reach)
        cells = np.flatnonzero(free)
        if not len(cells):
            return found
        for cell in rng.choice(cells, size=min(count, len(cells)), replace=False):
            x, y = walkable.centre_of([int(cell) % walkable.n, int(cell) // walkable.n])
            z = float(self.world.height(np.array([x, y])))
            name = describe_spot(self.world, np.array([x, y]))
            found.append(Region(kind="outdoor", name=name, place=None, centre=(x, y, z), radius=radius))
        return found

    def _place_region(self, place: Place) -> Region:
        return Region(kind="place", name=place.name, place=place.id, centre=place.position, radius=0.0)


def describe_spot(world: World, xy: NDArray[np.float64]) -> str:
    """Say where a spot is as a passer-by would: the street, and what is near."""
    street, nearest = "", 40.0
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
