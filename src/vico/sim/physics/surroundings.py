"""What of a world robots can touch: ground, walls up to the height robots reach, and things that stand outdoors."""

from __future__ import annotations

import math
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from vico.exact import apply_matrix
from vico.sim.physics.records import StaticScene
from vico.world.heights import HeightField
from vico.world.mesh import Surface
from vico.world.objects import Objects

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
    boxes, pillars = _objects(world.objects, height, reach)
    return StaticScene(height, tuple(hulls), boxes, pillars)


def _objects(objects: Objects, height: HeightField, reach: float) -> tuple[NDArray[Any], NDArray[Any]]:
    chosen = objects.where(objects.solid & objects.outdoors & (objects.size_z > _FLAT))
    stem = np.array([_STEMS.get(str(kind), 0.0) for kind in chosen.kind])
    ground = height(chosen.position) if len(chosen) else np.zeros(0)
    # Only what robots can reach matters, and from a little below ground, for the ground is not level.
    low = np.minimum(chosen.z, ground) - 0.3
    half = (np.minimum(chosen.z + chosen.size_z, chosen.z + reach) - low) / 2
    boxes = np.column_stack([chosen.x, chosen.y, low + half, chosen.yaw, chosen.size_x / 2, chosen.size_y / 2, half])
    pillars = np.column_stack([chosen.x, chosen.y, low + half, stem, half])
    return boxes[stem == 0.0], pillars[stem > 0.0]
