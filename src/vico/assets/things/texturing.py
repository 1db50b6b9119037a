"""Texture coordinates for furniture that was thinned: read again from the nearest of the old triangles."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

Array = NDArray[Any]

_SAMPLES = 6000


def textured_again(
    points: Array, faces: Array, paint: Array, old_points: Array, old_faces: Array, old_uv: Array, old_paint: Array
) -> Array:
    """Texture coordinates of thinned triangles: the map of the nearest old triangle of the same material goes on.

    Returns
    -------
    uv
        float64, shape ``(m, 3, 2)``.
    """
    uv = np.zeros((len(faces), 3, 2))
    corners = old_points[old_faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(cross, axis=1) / 2
    centres = points[faces].mean(axis=1)
    ours = np.cross(points[faces[:, 1]] - points[faces[:, 0]], points[faces[:, 2]] - points[faces[:, 0]])
    ours /= np.maximum(np.linalg.norm(ours, axis=1, keepdims=True), 1e-18)
    reach = 0.05 * float(np.ptp(old_points, axis=0).max())
    for number in np.unique(paint).tolist():
        there = np.flatnonzero((old_paint == number) & (area > 1e-14) & np.isfinite(old_uv).all(axis=(1, 2)))
        here = np.flatnonzero(paint == number)
        if not len(there):
            continue
        # Places spread evenly over the old surface, with the way it faces, so that neighbours round a corner differ.
        ends = np.cumsum(area[there])
        who = there[np.searchsorted(ends, (np.arange(_SAMPLES) + 0.5) / _SAMPLES * ends[-1])]
        u, v = np.modf(np.arange(1, _SAMPLES + 1)[:, None] * np.array([0.7548776662, 0.5698402910]))[0].T
        over = u + v > 1
        u, v = np.where(over, 1 - u, u), np.where(over, 1 - v, v)
        first, second, third = corners[who, 0], corners[who, 1], corners[who, 2]
        spots = first + u[:, None] * (second - first) + v[:, None] * (third - first)
        facing = cross[who] / (2 * area[who, None])
        tree = cKDTree(np.concatenate([spots, facing * reach], axis=1))
        _, nearest = tree.query(np.concatenate([centres[here], ours[here] * reach], axis=1))
        source = who[nearest]
        a, b, c = (corners[source, k][:, None, :] for k in range(3))
        p = points[faces[here]] - a
        e, f = b - a, c - a
        ee, ef, ff = (e * e).sum(-1), (e * f).sum(-1), (f * f).sum(-1)
        pe, pf = (p * e).sum(-1), (p * f).sum(-1)
        size = np.maximum(ee * ff - ef * ef, 1e-30)
        s, t = (ff * pe - ef * pf) / size, (ee * pf - ef * pe) / size
        old = old_uv[source]
        uv[here] = old[:, :1] + s[..., None] * (old[:, 1:2] - old[:, :1]) + t[..., None] * (old[:, 2:3] - old[:, :1])
    return uv
