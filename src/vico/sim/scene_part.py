"""What a scene shows of a city: the tiles near a camera in full, all others from afar."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from vico.render.palette import Palette
from vico.sim.bodies import Drawn
from vico.world.city_world import CityPart
from vico.world.mesh import Surface


@dataclass(frozen=True)
class ScenePart:
    """Some tiles of a city, and what is drawn with them.

    Attributes
    ----------
    world
        The tiles.
    low, high
        Corners of the ground they cover, ENU metres: what moves is drawn within them.
    far
        Returns what the other tiles look like from afar: asked for each scene that is made, which keeps its own form of
        it.
    palette
        Textures that parts of the city share.
    """

    world: CityPart
    low: tuple[float, float]
    high: tuple[float, float]
    far: Callable[[], Sequence[Surface]]
    palette: Palette

    def holds(self, points: NDArray[np.floating], margin: float = 0.0) -> NDArray[np.bool_]:
        """Return which points, shape ``(n, 2 or more)``, lie in the tiles, or so many metres beside them."""
        low, high = np.array(self.low) - margin, np.array(self.high) + margin
        return np.asarray(((points[:, :2] >= low) & (points[:, :2] <= high)).all(axis=1), np.bool_)

    def drawn(self, shapes: Drawn) -> Drawn:
        """Return those of some shapes that stand in the tiles."""
        here = self.holds(shapes.transforms[:, :2, 3])
        return Drawn(shapes.prototypes, shapes.index[here], shapes.transforms[here], shapes.entity[here])

    @cached_property
    def rooms(self) -> NDArray[np.int64]:
        """Row of each of the city's rooms among those of the tiles; -1 for all others."""
        return _rows(self.world.room_numbers, len(self.world.whole.rooms))

    @cached_property
    def places(self) -> NDArray[np.int64]:
        """Row of each of the city's places among those of the tiles; -1 for all others."""
        own = {place.id for place in self.world.places}
        numbers = [k for k, place in enumerate(self.world.whole.places) if place.id in own]
        return _rows(np.array(numbers, np.int64), len(self.world.whole.places))


def _rows(numbers: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    found = np.full(count, -1, np.int64)
    found[numbers] = np.arange(len(numbers))
    return found
