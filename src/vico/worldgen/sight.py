"""What can be seen from where: rays cast at a triangle mesh."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.errors import EmptyInputError, InputError, MissingExtraError

_CHUNK = 1 << 19  # rays at a time: about 80 MB of temporaries
_FAR = 1e30  # no limit, to the tracer


@dataclass(frozen=True)
class Hits:
    """The first thing each ray meets.

    Attributes
    ----------
    distance
        In lengths of the ray's direction (metres where that is a unit vector); infinite where nothing is hit.
        float64, shape ``(n,)``.
    triangle
        Index of the triangle, or -1, int32, shape ``(n,)``.
    u, v
        Barycentric weights of the triangle's second and third corner, float32, shape ``(n,)``.
    """

    distance: NDArray[np.float64]
    triangle: NDArray[np.int32]
    u: NDArray[np.float32]
    v: NDArray[np.float32]


class Sight:
    """A mesh to cast rays at; triangles are hit from both sides.

    Parameters
    ----------
    positions
        Metres, shape ``(n, 3)``.
    triangles
        Vertex indices, shape ``(m, 3)``.

    Raises
    ------
    MissingExtraError
        If embreex is not installed.
    EmptyInputError, InputError
        If there are no triangles, or one names a vertex that is not there or not finite.

    Notes
    -----
    Rays are traced in float32 about the middle of the mesh: good to about a tenth of a millimetre in a square
    kilometre.
    """

    def __init__(self, positions: NDArray[Any], triangles: NDArray[Any]) -> None:
        try:
            from embreex import rtcore_scene
            from embreex.mesh_construction import TriangleMesh
        except ImportError:
            raise MissingExtraError(
                "ray casting: embreex is not installed; type: pip install 'virtual-community[photos]'"
            ) from None
        points = np.asarray(positions, np.float64)
        faces = np.asarray(triangles, np.int64)
        if not len(faces):
            raise EmptyInputError("ray casting: the mesh has no triangles; give one that has")
        if faces.min() < 0 or faces.max() >= len(points):
            raise InputError(f"ray casting: a triangle names a vertex outside 0..{len(points) - 1}; mend the mesh")
        used = points[faces.ravel()]
        if not np.isfinite(used).all():
            bad = int(np.flatnonzero(~np.isfinite(used).all(axis=1))[0]) // 3
            raise InputError(f"ray casting: triangle {bad} has a corner that is not a finite point; mend the mesh")
        self._middle = (used.min(axis=0) + used.max(axis=0)) / 2
        # Corners are split: the tracer wants them as one float32 array a triangle.
        self._scene = rtcore_scene.EmbreeScene(robust=True)
        corners = (used - self._middle).astype(np.float32).reshape(-1, 3, 3)
        self._mesh = TriangleMesh(self._scene, corners)

    def first(self, origins: NDArray[Any], directions: NDArray[Any], *, most: float | NDArray[Any] = np.inf) -> Hits:
        """Cast rays.

        Parameters
        ----------
        origins, directions
            Metres, shapes ``(n, 3)``; one direction of shape ``(3,)`` serves all.
        most
            Hits farther than this don't count; one for all, or shape ``(n,)``.

        Returns
        -------
        Hits
            What each ray meets first.
        """
        start = np.asarray(origins, np.float64).reshape(-1, 3)
        n = len(start)
        along = np.broadcast_to(np.asarray(directions, np.float64), (n, 3))
        limit = np.broadcast_to(np.asarray(most, np.float64), (n,))
        distance = np.full(n, np.inf)
        triangle = np.full(n, -1, np.int32)
        u, v = np.zeros(n, np.float32), np.zeros(n, np.float32)
        for k in range(0, n, _CHUNK):
            part = slice(k, k + _CHUNK)
            found = self._scene.run(
                np.ascontiguousarray(start[part] - self._middle, np.float32),
                np.ascontiguousarray(along[part], np.float32),
                dists=np.minimum(limit[part], _FAR).astype(np.float32),
                output=True,
            )
            hit = found["primID"] >= 0
            distance[part] = np.where(hit, found["tfar"], np.inf)
            triangle[part] = np.where(hit, found["primID"], -1)
            u[part], v[part] = np.where(hit, found["u"], 0), np.where(hit, found["v"], 0)
        return Hits(distance, triangle, u, v)
