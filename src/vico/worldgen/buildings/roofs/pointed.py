"""Pyramids, domes and onions: the outline's ring drawn together towards a point above it."""

from __future__ import annotations

import math

import numpy as np
import shapely
from manifold3d import Manifold, Mesh64
from numpy.typing import NDArray
from shapely import Polygon

from vico.geo import overlay
from vico.geometry import distances
from vico.worldgen.facts.outlines.roof_shapes import Roof, prism, rings_of

_DOME = [(math.cos(a), math.sin(a)) for a in np.linspace(0.0, math.pi / 2, 8)[1:-1]]
# Width and height of an onion's rings. It swells out to the drum's walls, not beyond: a bulge past the outline would
# stand in what is next to it.
_ONION = [
    (0.80, 0.0),
    (0.90, 0.05),
    (0.98, 0.13),
    (1.0, 0.21),
    (0.97, 0.30),
    (0.87, 0.40),
    (0.70, 0.50),
    (0.48, 0.60),
    (0.29, 0.70),
    (0.15, 0.80),
    (0.06, 0.90),
]


def drawn_together(polygon: Polygon, rings: list[NDArray[np.float64]], low: float, roof: Roof) -> Manifold | None:
    """Return the solid from `low` under a pyramid, dome or onion; the eaves are at 0.

    None for a pyramid over an outline that is not seen whole from any point of it.
    """
    steps = {"dome": _DOME, "onion": _ONION}.get(roof.shape, [])
    for point in (polygon.centroid, polygon.representative_point()):
        centre = np.asarray(point.coords[0])
        if _sees_all(rings[0], centre):
            if len(rings) == 1:
                return _loft(rings[0], centre, low, steps, roof.height)
            # What stands in the middle (a lantern, a spire) is cut out of the roof and doesn't change it.
            return prism(rings, low, roof.height) ^ _loft(rings[0], centre, low - 1.0, steps, roof.height)
    if not steps:
        return None
    # Over wings the vault spans the hull, and the outline is cut out of it.
    hull = shapely.convex_hull(polygon)
    ring = rings_of(overlay.buffer(hull, 0.02, join_style="mitre"))[0]
    vault = _loft(ring, np.asarray(hull.centroid.coords[0]), low - 1.0, steps, roof.height)
    return prism(rings, low, roof.height) ^ vault


def _sees_all(ring: NDArray[np.float64], centre: NDArray[np.float64]) -> bool:
    a = ring - centre
    b = np.roll(a, -1, axis=0)
    cross = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    # A hand's breadth of every edge's line: a roof that is nearly folded over itself is none.
    return bool((cross > 0.1 * np.maximum(distances(b, a), 1e-9)).all())


def _loft(
    ring: NDArray[np.float64],
    centre: NDArray[np.float64],
    low: float,
    steps: list[tuple[float, float]],
    rise: float,
) -> Manifold:
    """Rings about a centre that sees all of them, stacked from `low`, closed by a point above and a face below."""
    n = len(ring)
    scales = [(1.0, low), (1.0, 0.0), *((width, height * rise) for width, height in steps)]
    points = [np.c_[centre + (ring - centre) * width, np.full(n, z)] for width, z in scales]
    points += [np.array([[*centre, low], [*centre, rise]])]
    i = np.arange(n)
    j = (i + 1) % n
    faces = [np.stack([np.full(n, n * len(scales)), j, i], axis=1)]
    for k in range(len(scales) - 1):
        lower, upper = k * n, (k + 1) * n
        faces += [
            np.stack([lower + i, lower + j, upper + j], axis=1),
            np.stack([lower + i, upper + j, upper + i], axis=1),
        ]
    last = (len(scales) - 1) * n
    faces.append(np.stack([last + i, last + j, np.full(n, n * len(scales) + 1)], axis=1))
    mesh = Mesh64(
        vert_properties=np.ascontiguousarray(np.concatenate(points), np.float64),
        tri_verts=np.ascontiguousarray(np.concatenate(faces), np.uint64),
    )
    return Manifold(mesh)
