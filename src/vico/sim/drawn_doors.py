"""Doors of houses that are not closed, as they are drawn: their leaves, and the halls behind them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.assets.house_doors import (
    BEHIND,
    DOOR_MATERIAL,
    HALLS,
    hall_name,
    hall_surface,
    leaf_names,
    leaf_poses,
    leaf_surfaces,
    opening_of,
)
from vico.exact import apply_matrix
from vico.render.records import OPENING
from vico.sim.base import SimulationBase
from vico.sim.bodies import Drawn
from vico.sim.scene_part import ScenePart
from vico.sim.simulation_state import SimulationState
from vico.world.mesh import Surface
from vico.world.model import Building
from vico.world.world import World

_CORNER = 0.1  # metres between a hall and the outside of its house


class OpenDoors(NamedTuple):
    """What is drawn of doors.

    Attributes
    ----------
    shapes
        Leaves and halls.
    openings
        Where the wall is not drawn, `OPENING`.
    """

    shapes: Drawn
    openings: NDArray[np.void]


class DrawnDoors:
    """Draws the doors of a world.

    Parameters
    ----------
    base
        The world, with its doors.
    part
        Of a city, outside of which no doors are drawn; none: all are.

    Attributes
    ----------
    prototypes
        Leaves and halls by name.
    """

    def __init__(self, base: SimulationBase, part: ScenePart | None = None) -> None:
        self._doors, self._world = base.house_doors, base.world
        self._drawn = self._doors["kind"] >= 0
        if part is not None:
            self._drawn &= part.holds(np.column_stack([self._doors["x"], self._doors["y"]]))
        self._sizes: dict[int, int] = {}
        self.prototypes = _shapes_of(self._doors[self._drawn], base.world if part is None else part.world)
        self._index = {name: k for k, name in enumerate(self.prototypes)}

    @classmethod
    def of(cls, base: SimulationBase) -> DrawnDoors:
        """Return those of a world; they are kept with it."""
        return base.world.shared(cls, lambda: cls(base))

    def draw(self, state: SimulationState) -> OpenDoors | None:
        """Return what is drawn of the doors that are not closed; None of none."""
        rows = [k for k, e in enumerate(state.leaves.entrance.tolist()) if self._drawn[e]]
        if not rows:
            return None
        names: list[str] = []
        poses, owners, openings = [], [], []
        for k in rows:
            number = int(state.leaves.entrance[k])
            door = self._doors[number]
            share = float(state.leaves.share[k])
            middle = np.array([[float(door["x"]), float(door["y"])]])
            lit = bool(state.environment.has_power(middle)[0])
            here = [*leaf_names(door), hall_name(door, self._size(number), lit=lit)]
            names += here
            poses += [*leaf_poses(door, share), _base(door)]
            owners += [self._building(number).entity] * len(here)
            openings.append(opening_of(door))
        index = np.array([self._index[name] for name in names], np.int32)
        shapes = Drawn(list(self.prototypes), index, np.array(poses, np.float32), np.array(owners, np.int32))
        return OpenDoors(shapes, np.array(openings, OPENING))

    def _size(self, number: int) -> int:
        if number not in self._sizes:
            self._sizes[number] = hall_size(self._doors[number], self._building(number).footprint)
        return self._sizes[number]

    def _building(self, number: int) -> Building:
        return self._world.building_by_id[self._world.entrances[number].building]


def hall_size(door: NDArray[np.void], footprint: Sequence[Sequence[tuple[float, float]]]) -> int:
    """Return how large a hall fits behind a door of a house with some outline and courtyards: a row of `HALLS`."""
    house = shapely.Polygon(footprint[0], footprint[1:]).buffer(-_CORNER)
    fitting = (k for k in range(len(HALLS)) if house.contains(_floor(door, k)))
    return next(fitting, len(HALLS) - 1)


def _floor(door: NDArray[np.void], size: int) -> shapely.Polygon:
    """Return the ground that a hall takes."""
    deep, beside = HALLS[size]
    half = float(door["half_width"]) + beside
    corners = np.array([(-half, BEHIND, 0, 1), (half, BEHIND, 0, 1), (half, deep, 0, 1), (-half, deep, 0, 1)])
    return shapely.Polygon(apply_matrix(corners, _base(door))[:, :2])


def _base(door: NDArray[np.void]) -> NDArray[np.float64]:
    """Return a door's frame: right as seen from outside, inwards, up; shape ``(4, 4)``."""
    ix, iy = float(door["inward_x"]), float(door["inward_y"])
    base = np.eye(4)
    base[:2, 0], base[:2, 1] = (iy, -ix), (ix, iy)
    base[:3, 3] = door["x"], door["y"], door["z"]
    return base


def _shapes_of(doors: NDArray[np.void], world: World) -> dict[str, Sequence[Surface]]:
    """Return every leaf and hall of some of a world's doors, equal ones once."""
    shapes: dict[str, Sequence[Surface]] = {}
    if not len(doors):
        return shapes
    material = next(s.material for s in world.surfaces("buildings") if s.material.name == DOOR_MATERIAL)
    for door in doors:
        names = leaf_names(door)
        if names[0] not in shapes:
            shapes |= dict(zip(names, leaf_surfaces(door, material), strict=True))
        for size in range(len(HALLS)):
            for lit in (False, True):
                name = hall_name(door, size, lit=lit)
                if name not in shapes:
                    shapes[name] = [hall_surface(door, size, lit=lit)]
    return shapes
