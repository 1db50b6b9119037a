"""Lines of sight: rays cast at a triangle mesh."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.errors import EmptyInputError, InputError, MissingExtraError
from vico.threads import for_each

_CHUNK = 1 << 18  # rays at a time: about 40 MB of temporaries a thread
_FAR = 1e30  # no limit, to the tracer


@dataclass(frozen=True)
class RayHits:
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


class RayCaster:
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
        faces = np.asarray(triangles)
        faces = faces if faces.dtype == np.int32 else faces.astype(np.int64)
        if not len(faces):
            raise EmptyInputError("ray casting: the mesh has no triangles; give one that has")
        if faces.min() < 0 or faces.max() >= len(points):
            raise InputError(f"ray casting: a triangle names a vertex outside 0..{len(points) - 1}; mend the mesh")
        used = np.zeros(len(points), np.bool_)
        used[faces] = True
        if not np.isfinite(points[used]).all():
            finite = np.asarray(np.isfinite(points).all(axis=1))
            bad = int(np.flatnonzero(~finite[faces].all(axis=1))[0])
            raise InputError(f"ray casting: triangle {bad} has a corner that is not a finite point; mend the mesh")
        self._middle = (points[used].min(axis=0) + points[used].max(axis=0)) / 2
        # Corners are split: the tracer wants them as one float32 array a triangle.
        self._scene = rtcore_scene.EmbreeScene(robust=True)
        near = np.where(used[:, None], points - self._middle, 0.0).astype(np.float32)
        self._mesh = TriangleMesh(self._scene, near[faces])
        # The first ray makes the tracer sort its triangles, which only one thread may do.
        self._scene.run(np.zeros((1, 3), np.float32), np.array([(0.0, 0.0, 1.0)], np.float32))

    def first(self, origins: NDArray[Any], directions: NDArray[Any], *, most: float | NDArray[Any] = np.inf) -> RayHits:
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

        def cast(first: int) -> None:
            part = slice(first, first + _CHUNK)
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

        if n <= _CHUNK:
            cast(0)
        else:
            for_each(cast, range(0, n, _CHUNK))
        return RayHits(distance, triangle, u, v)
