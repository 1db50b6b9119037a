"""Solids that robots can touch: ground, walls, outdoor objects, and movable objects that physics moves.

Walls count up to the height robots reach. Of a city the tiles around robots are read chunk by chunk, the rest is not.

A thing outdoors that nobody carries enters physics when a robot comes near it, or when it was let go where nothing
holds it up. It leaves when it has come to rest and no robot is near; between the two its pose is what physics says.
The rest of the world's things cost nothing.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from vico.assets.models.movable import movable_mass, movable_solids
from vico.errors import SchemaError
from vico.exact import apply_matrix
from vico.geometry import rotation_matrix
from vico.sim.bodies.state_arrays import MovableObjects
from vico.sim.physics.engine import PhysicsEngine
from vico.sim.physics.records import Chunk, RigidObject, RigidPart, StaticChunks, StaticScene
from vico.world.city_world import CityWorld
from vico.world.heights import HeightField
from vico.world.mesh import Surface
from vico.world.objects import Objects
from vico.world.world import World

#: Solids that begin higher than this above the ground touch no robot, metres; so do things lower than the second.
_REACH, _FLAT = 2.0, 0.12
#: Half the thickness of what grows or stands on a stem, metres: their boxes are those of their crowns and arms.
_STEMS = {"tree": 0.25, "palm": 0.25, "street_lamp": 0.1, "lamp": 0.1, "traffic_signals": 0.1, "flagpole": 0.1}


class PhysicsGround(Protocol):
    """What `static_scene_of` asks of a world."""

    @property
    def height(self) -> HeightField:
        """The ground."""

    @property
    def objects(self) -> Objects:
        """Things that stand around."""

    def surfaces(self, layer: str) -> list[Surface]:
        """Surfaces of a layer."""


def convex_parts(surface: Surface) -> list[NDArray[np.float64]]:
    """Corner points of the pieces of a surface that hang together, shape ``(n, 3)`` each, in a fixed order."""
    if not len(surface.triangles):
        return []
    if _is_convex(surface):
        return [surface.positions.astype(np.float64)]
    points, index = np.unique(surface.positions, axis=0, return_inverse=True)
    # Pieces of different entities may touch: they stay apart.
    owner = surface.entity[surface.triangles[:, 0]]
    corners = index[surface.triangles]
    keys, corner_index = np.unique(
        np.stack([corners.ravel(), np.repeat(owner, 3)], axis=1), axis=0, return_inverse=True
    )
    triangles = corner_index.reshape(-1, 3)
    rows = np.concatenate([triangles[:, 0], triangles[:, 1]])
    columns = np.concatenate([triangles[:, 1], triangles[:, 2]])
    graph = coo_matrix((np.ones(len(rows), np.int8), (rows, columns)), shape=(len(keys), len(keys)))
    count, label = connected_components(graph, directed=False)
    order = np.argsort(label, kind="stable")
    starts = np.searchsorted(label[order], np.arange(count + 1))
    corner_points = points[keys[:, 0]].astype(np.float64)
    return [corner_points[order[starts[k] : starts[k + 1]]] for k in range(count)]


def _is_convex(surface: Surface) -> bool:
    """Return whether it is one closed convex solid of one entity: no point lies before any of its faces."""
    if len(surface.triangles) > 200 or surface.entity.min() != surface.entity.max():
        return False
    points = surface.positions.astype(np.float64)
    corners = points[surface.triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.sqrt(np.einsum("ij,ij->i", normal, normal))
    ahead = apply_matrix(points, normal) - np.einsum("ij,ij->i", normal, corners[:, 0])
    return bool((ahead <= 0.002 * size + 1e-9).all())


def static_scene_of(world: PhysicsGround, *, flying: bool = False) -> StaticScene:
    """Everything of a world that robots can touch.

    Convex solids of the layer ``collision`` that reach down to where robots are, and solid objects outdoors: stems as
    cylinders, the rest as boxes.

    Parameters
    ----------
    flying
        Some of the robots fly: all of it counts, as high as it is.
    """
    height, reach = world.height, math.inf if flying else _REACH
    hulls = []
    for surface in world.surfaces("collision"):
        for points in convex_parts(surface):
            flat = np.ptp(points, axis=0).min() < 1e-3
            if not flat and points[:, 2].min() < float(height(points[:, :2]).max()) + reach:
                hulls.append(points)
    objects = world.objects
    chosen = objects.where(objects.solid & objects.outdoors & (objects.size_z > _FLAT))
    stem = np.array([_STEMS.get(str(kind), 0.0) for kind in chosen.kind])
    ground = height(chosen.position) if len(chosen) else np.zeros(0)
    # Only what robots can reach matters, and from a little below ground, for the ground is not level.
    low = np.minimum(chosen.z, ground) - 0.3
    half = (np.minimum(chosen.z + chosen.size_z, chosen.z + reach) - low) / 2
    z = low + half
    boxes = np.column_stack([chosen.x, chosen.y, z, chosen.yaw, chosen.size_x / 2, chosen.size_y / 2, half])
    pillars = np.column_stack([chosen.x, chosen.y, z, stem, half])
    return StaticScene(height, tuple(hulls), boxes[stem == 0.0], pillars[stem > 0.0])


#: About the side of a chunk, metres: a whole number of them is as long as a tile.
_SIDE = 128.0
#: Metres beyond its tile that a thing may reach which is no building: it stands in its tile, and is smaller than that.
_OVERHANG = 64.0
# Tiles whose solids are kept.
_TILES = 16


@dataclass(frozen=True)
class _Tile:
    """Solids of a tile, and the boxes around them: west, south, east, north, shape ``(n, 4)``."""

    solids: StaticScene
    hulls: NDArray[np.float64]
    boxes: NDArray[np.float64]
    pillars: NDArray[np.float64]


class CityChunks:
    """See `vico.sim.physics.records.StaticChunks`.

    A solid is in the scene of every chunk that some part of it is in, whichever tile has it, and in one place among
    the others: tiles follow each other as in the city.

    Parameters
    ----------
    city
        The city.
    flying
        Some of the robots fly: all of its solids count, as high as they are.
    """

    def __init__(self, city: CityWorld, *, flying: bool = False) -> None:
        self._city, self._flying = city, flying
        size = city.city.manifest.size
        self.side = size / max(round(size / _SIDE), 1)
        self._read: dict[tuple[int, int], _Tile] = {}

    @property
    def height(self) -> HeightField:
        """The ground of the whole city."""
        return self._city.height

    @cached_property
    def _outer(self) -> NDArray[np.float64]:
        """Boxes that no solid of a tile reaches beyond: west, south, east, north, shape ``(tiles, 4)``."""
        city = self._city.city
        found = []
        for tile in city.manifest.tiles:
            middle = np.array([tile.column, tile.row]) * city.manifest.size
            half = city.manifest.size / 2 + _OVERHANG
            low, high = middle - half, middle + half
            walls = city.world((tile.column, tile.row)).bounds("collision")
            if walls is not None:
                low, high = np.minimum(low, walls[0, :2] + middle), np.maximum(high, walls[1, :2] + middle)
            found.append([*low, *high])
        return np.array(found).reshape(-1, 4)

    def _tile(self, place: tuple[int, int]) -> _Tile:
        known = self._read.pop(place, None)
        if known is None:
            solids = static_scene_of(self._city.part([place]), flying=self._flying)
            corners = [(points[:, :2].min(axis=0), points[:, :2].max(axis=0)) for points in solids.hulls]
            *_, half_length, half_width, _ = solids.boxes.T
            around = np.hypot(half_length, half_width)
            known = _Tile(
                solids,
                np.array(corners).reshape(-1, 4),
                _around(solids.boxes, around),
                _around(solids.pillars, solids.pillars[:, 3]),
            )
        self._read[place] = known
        while len(self._read) > _TILES:
            self._read.pop(next(iter(self._read)))
        return known

    def scene(self, chunks: Collection[Chunk]) -> StaticScene:
        """Return the ground of some chunks, and all solids of which some part is in one of them."""
        squares = np.array(list(chunks), np.float64).reshape(-1, 2) * self.side - self.height.half
        bounds = np.concatenate([squares, squares + self.side], axis=1)
        tiles = [
            self._tile((tile.column, tile.row))
            for tile, near in zip(self._city.city.manifest.tiles, _meets(self._outer, bounds), strict=True)
            if near
        ]
        hulls = [tile.solids.hulls[k] for tile in tiles for k in np.flatnonzero(_meets(tile.hulls, bounds)).tolist()]
        boxes = [tile.solids.boxes[_meets(tile.boxes, bounds)] for tile in tiles]
        pillars = [tile.solids.pillars[_meets(tile.pillars, bounds)] for tile in tiles]
        return StaticScene(
            self.height,
            tuple(hulls),
            np.concatenate([np.zeros((0, 7)), *boxes]),
            np.concatenate([np.zeros((0, 5)), *pillars]),
            squares,
            self.side,
        )

    def whole(self) -> StaticScene:
        """Return all of it."""
        return static_scene_of(self._city, flying=self._flying)


def surroundings_of(world: World, *, flying: bool = False) -> StaticScene | StaticChunks:
    """Return everything of a world that robots can touch: all at once, of a city of several tiles chunk by chunk.

    Parameters
    ----------
    flying
        Some of the robots fly: all of it counts, as high as it is.
    """
    if isinstance(world, CityWorld) and len(world.city.manifest.tiles) > 1:
        return CityChunks(world, flying=flying)
    return static_scene_of(world, flying=flying)


def _around(solids: NDArray[np.float64], reach: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return boxes around upright solids: west, south, east, north."""
    return np.concatenate([solids[:, :2] - reach[:, None], solids[:, :2] + reach[:, None]], axis=1)


def _meets(boxes: NDArray[np.float64], others: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which boxes (west, south, east, north) meet one of others, shape ``(n,)``."""
    found = np.zeros(len(boxes), np.bool_)
    for west, south, east, north in others.tolist():
        found |= (boxes[:, 0] <= east) & (boxes[:, 2] >= west) & (boxes[:, 1] <= north) & (boxes[:, 3] >= south)
    return found


#: Things enter physics within the first distance of a robot's base, and leave beyond the second, metres.
ENTER, LEAVE = 2.5, 3.5
#: What is higher than this above what is below it falls; what reaches deeper into ground or kerb is lifted out of it
#: when it enters, but not by more than the second: then it lies in something that physics takes for solid, metres.
_IN_THE_AIR, _TOO_DEEP = 0.03, 0.15
# Of a thing's box, and bounds of its mass, where no entry says what it weighs.
_DENSITY = 150.0  # kg/m^3
_LIGHTEST = 0.05  # kg
_HEAVIEST = 60.0  # kg
# Where it is asked what lies below a thing: its middle and near its corners, shares of its half extents.
_PROBES = np.array([[0.0, 0.0], [0.9, 0.9], [0.9, -0.9], [-0.9, 0.9], [-0.9, -0.9]])


def object_mass(size: NDArray[np.float64]) -> float:
    """Kilograms of a thing of some extents, metres, shape ``(3,)``."""
    return float(np.clip(_DENSITY * np.prod(size), _LIGHTEST, _HEAVIEST))


def _convex_parts_of_object(prototype: str, height: float) -> tuple[RigidPart, ...]:
    """Return a thing's convex parts about the middle of its box."""
    lift = np.array([0.0, 0.0, height / 2])
    return tuple(
        RigidPart(solid.shape, solid.half, solid.middle - lift, solid.quaternion) for solid in movable_solids(prototype)
    )


class LooseObjects:
    """Which things are in physics, and where.

    Parameters
    ----------
    engine
        The robots' physics.
    objects
        All movable things of the run: read, and written where physics moves them.

    Attributes
    ----------
    entity
        Entity of the thing in each slot of the engine, 0 for none, int32, shape ``(slots,)``.
    left_out
        How many things should have entered and found no slot, when that was last decided.
    """

    def __init__(self, engine: PhysicsEngine, objects: MovableObjects) -> None:
        self._engine, self._objects = engine, objects
        self.entity = np.zeros(len(engine.objects().present), np.int32)
        self.left_out = 0
        # Poses as they were last seen or written, whether each was loose then, and whether it is still to fall.
        self._position = np.zeros((0, 3))
        self._orientation = np.zeros((0, 4))
        self._loose = np.zeros(0, np.bool_)
        self._falling = np.zeros(0, np.bool_)

    def __len__(self) -> int:
        return len(self._objects)

    def update(self, robots: NDArray[np.float64]) -> None:
        """Decide who enters and who leaves.

        Parameters
        ----------
        robots
            Where the robots are, shape ``(r, 2)``.
        """
        objects = self._objects
        if not len(objects):
            return
        self._know_all()
        loose = (objects.holder == 0) & (objects.room < 0)
        moved = np.any(objects.position != self._position, axis=1) | np.any(
            objects.orientation != self._orientation, axis=1
        )
        changed = loose & (moved | ~self._loose)
        away = np.full(len(objects), np.inf)
        for x, y in robots[:, :2]:
            away = np.minimum(away, np.hypot(objects.position[:, 0] - x, objects.position[:, 1] - y))
        self._keep_stacks(loose, away)
        self._falling &= loose
        self._leave(loose, changed, away)
        inside = np.isin(objects.entity, self.entity)
        for k in np.flatnonzero(changed & ~inside):
            # What lies on another thing is held up, which physics does not know as long as that one is not in it.
            held_up = objects.support_of(int(k)) >= 0
            self._falling[k] = not held_up and self._clearances(int(k))[0] > _IN_THE_AIR
        self._enter(np.flatnonzero(loose & ~inside & (self._falling | (away < ENTER))), away)
        self._remember(loose)

    def _keep_stacks(self, loose: NDArray[np.bool_], away: NDArray[np.float64]) -> None:
        """Count what holds a thing up as near to robots as that is: else the thing would fall into it."""
        for k in np.flatnonzero(loose & (away < LEAVE)).tolist():
            below = self._objects.support_of(k)
            while below >= 0 and away[below] > away[k]:
                away[below] = away[k]
                below = self._objects.support_of(below)

    def _know_all(self) -> None:
        """Make room for things that were added since."""
        missing = len(self._objects) - len(self._loose)
        if missing > 0:
            self._position = np.vstack([self._position, np.full((missing, 3), np.nan)])
            self._orientation = np.vstack([self._orientation, np.full((missing, 4), np.nan)])
            self._loose = np.append(self._loose, np.zeros(missing, np.bool_))
            self._falling = np.append(self._falling, np.zeros(missing, np.bool_))

    def _remember(self, loose: NDArray[np.bool_]) -> None:
        self._position[:], self._orientation[:] = self._objects.position, self._objects.orientation
        self._loose[:] = loose

    def _leave(self, loose: NDArray[np.bool_], changed: NDArray[np.bool_], away: NDArray[np.float64]) -> None:
        """Take out who was taken away, moved by somebody else, or rests far from robots."""
        taken = np.flatnonzero(self.entity)
        if not len(taken):
            return
        resting = self._engine.objects().resting
        for slot in taken:
            k = self._objects.index(int(self.entity[slot]))
            rests = resting[slot] and away[k] > LEAVE
            if not loose[k] or changed[k] or rests:
                self._engine.remove_object(int(slot))
                self.entity[slot] = 0
                self._falling[k] = False

    def _enter(self, rows: NDArray[np.int64], away: NDArray[np.float64]) -> None:
        """Put things into free slots, the nearest to a robot first."""
        free = np.flatnonzero(self.entity == 0).tolist()
        self.left_out = 0
        for k in rows[np.lexsort((self._objects.entity[rows], away[rows]))].tolist():
            lift = max(0.0, -float(self._clearances(k).min()))
            if lift > _TOO_DEEP:
                self._falling[k] = False
            elif free:
                self._place(free.pop(0), k, lift)
            else:
                self.left_out += 1

    def _place(self, slot: int, k: int, lift: float) -> None:
        objects = self._objects
        middle = objects.position[k] + rotation_matrix(objects.orientation[k])[:, 2] * objects.size[k, 2] / 2
        middle[2] += lift
        size, prototype = objects.size[k], objects.prototypes[k]
        thing = RigidObject(size, movable_mass(prototype) or object_mass(size), middle, objects.orientation[k].copy())
        self._engine.place_object(slot, replace(thing, parts=_convex_parts_of_object(prototype, float(size[2]))))
        self.entity[slot] = objects.entity[k]
        self._falling[k] = False

    def _clearances(self, k: int) -> NDArray[np.float64]:
        """Metres between a thing's underside and what is below it, at its middle and near its corners, shape ``(5,)``.

        Negative where something reaches into the thing.
        """
        body = self._objects.bodies_of(np.array([k]))
        turn = float(body.yaw[0])
        u, v = (_PROBES * (float(body.half_length[0]), float(body.half_width[0]))).T
        c, s = np.cos(turn), np.sin(turn)
        x, y, z = body.position[0]
        # From a little above its top: two of one height in one place are seen to be that.
        height = float(body.height[0]) + 0.002
        points = np.column_stack([x + c * u - s * v, y + s * u + c * v, np.full(len(u), z + height)])
        return self._engine.clearance_below(points) - height

    def _has_moved(self, k: int) -> bool:
        """Return whether somebody else has written a thing's pose since it was last seen or written."""
        objects = self._objects
        stays = np.array_equal(objects.position[k], self._position[k])
        return not (stays and np.array_equal(objects.orientation[k], self._orientation[k]))

    @property
    def moving(self) -> bool:
        """Whether physics moves any of them."""
        if not self.entity.any():
            return False
        motion = self._engine.objects()
        return bool(np.any(motion.present & ~motion.resting))

    def write_back(self) -> None:
        """Write where physics has moved them into the state."""
        taken = np.flatnonzero(self.entity)
        if not len(taken):
            return
        motion, objects = self._engine.objects(), self._objects
        for slot in taken:
            k = objects.index(int(self.entity[slot]))
            if self._has_moved(k):
                continue  # by somebody else, within a sub-step: `update` takes it from there
            up = rotation_matrix(motion.quaternion[slot])[:, 2]
            objects.position[k] = motion.position[slot] - up * objects.size[k, 2] / 2
            objects.orientation[k] = motion.quaternion[slot]
            self._position[k], self._orientation[k] = objects.position[k], objects.orientation[k]

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Everything that decides who enters and leaves."""
        return {
            "loose_entity": self.entity.copy(),
            "loose_position": self._position.copy(),
            "loose_orientation": self._orientation.copy(),
            "loose_known": self._loose.copy(),
            "loose_falling": self._falling.copy(),
            "loose_left_out": np.array([self.left_out]),
        }

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go back to what `arrays` held; the engine is restored by itself.

        Raises
        ------
        SchemaError
            If it belongs to an engine with room for another number of things.
        """
        if arrays["loose_entity"].shape != self.entity.shape:
            raise SchemaError("physics: the saved state has room for another number of loose things")
        self.entity[:] = arrays["loose_entity"]
        self._position, self._orientation = arrays["loose_position"].copy(), arrays["loose_orientation"].copy()
        self._loose, self._falling = arrays["loose_known"].copy(), arrays["loose_falling"].copy()
        self.left_out = int(arrays["loose_left_out"][0])
