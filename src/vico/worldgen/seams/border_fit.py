"""The drawn ground along a border: what one tile draws there, the other one meets point by point."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from vico.world.city import ABOVE, ALIKE, NEAR, SAME, Profile, Side, edges_on, profile_of
from vico.world.mesh import Surface

Floats = NDArray[np.float64]

_HEIGHT_COUNTS = 0.01  # what a metre of height counts beside one along the border
_SLIP = 0.15  # metres along the border that both sides may disagree where one kind of ground ends


def conformed(surfaces: Sequence[Surface], side: Side, first: Profile) -> list[Surface]:
    """Return surfaces that meet what the tile across a side draws.

    Points on the side come to lie on the other's edges, and edges get the other's corners: no gap, and no step but
    where both have one.

    Parameters
    ----------
    surfaces
        The ground.
    side
        Which of its sides.
    first
        What is drawn there by the tile that comes first.
    """
    return [surface if surface.material.name in ABOVE else _conformed(surface, side, first) for surface in surfaces]


def _conformed(surface: Surface, side: Side, first: Profile) -> Surface:
    positions = surface.positions.copy()
    on = np.flatnonzero(side.on(positions))
    if not len(on) or not len(first.start):
        return surface
    along = 1 - side.axis
    t, z = (positions[on, k].astype(np.float64) for k in (along, 2))
    stuff = surface.material.name
    wanted = first.heights(t, z, stuff)
    # Where a kind of ground ends a little earlier or later than across the border, it ends there, too.
    theirs = first.ends(stuff)
    for at, height in profile_of([surface], side).ends(stuff).tolist() if len(theirs) else []:
        # Of ends at one spot, of a drive and of the stone beside it, that at the same height.
        rise = np.abs(theirs[:, 1] - height)
        away = np.abs(theirs[:, 0] - at) + _HEIGHT_COUNTS * rise
        off = np.where(rise <= NEAR, away, np.inf)
        if not np.isfinite(off).any():
            off = np.where(rise <= ALIKE, away, np.inf)
        best = int(off.argmin())
        if off[best] <= _SLIP:
            here = (np.abs(t - at) < SAME) & (np.abs(z - height) < SAME)
            t[here], wanted[here] = theirs[best]
    known = np.isfinite(wanted)
    positions[on[known], along], positions[on[known], 2] = t[known], wanted[known]
    return _divided(replace(surface, positions=positions), side, first)


def _divided(surface: Surface, side: Side, first: Profile) -> Surface:
    """Put the other tile's corners into the edges on a side."""
    edges = edges_on(surface, side)
    corners = np.unique(np.r_[first.start, first.end])
    new: list[tuple[int, int, float, float]] = []  # the edge's ends, the share of the second, the height
    fans: dict[int, list[int]] = {}
    count = len(surface.positions)
    for a, b, face in edges.tolist():
        ends = surface.positions[[a, b]].astype(np.float64)
        t, z = ends[:, 1 - side.axis], ends[:, 2]
        between = corners[(corners > min(t) + SAME) & (corners < max(t) - SAME)]
        if not len(between):
            continue
        share = (between - t[0]) / (t[1] - t[0])
        height = first.heights(between, z[0] + share * (z[1] - z[0]), surface.material.name)
        order = np.argsort(share, kind="stable")
        chain = [a]
        for k in order[np.isfinite(height[order])].tolist():
            chain.append(count + len(new))
            new.append((a, b, float(share[k]), float(height[k])))
        if len(chain) > 1:
            fans[face] = [*chain, b]
    if not new:
        return surface
    triangles: list[list[int]] = []
    for face, triangle in enumerate(surface.triangles.tolist()):
        if face not in fans:
            triangles.append(triangle)
            continue
        corners_of = fans[face]
        apex = next(k for k in triangle if k not in (corners_of[0], corners_of[-1]))
        triangles += [[apex, one, two] for one, two in pairwise(corners_of)]
    a, b = (np.array([row[k] for row in new]) for k in (0, 1))
    share = np.array([row[2] for row in new])[:, None]

    def between_ends(values: NDArray[np.generic]) -> Floats:
        return np.asarray(values[a] * (1.0 - share) + values[b] * share, np.float64)

    added = between_ends(surface.positions)
    added[:, 2] = [row[3] for row in new]
    added[:, side.axis] = side.at
    normals = between_ends(surface.normals)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return replace(
        surface,
        positions=np.concatenate([surface.positions, added.astype(np.float32)]),
        normals=np.concatenate([surface.normals, normals.astype(np.float32)]),
        uv=np.concatenate([surface.uv, between_ends(surface.uv).astype(np.float32)]),
        colour=np.concatenate([surface.colour, np.round(between_ends(surface.colour)).astype(np.uint8)]),
        entity=np.concatenate([surface.entity, surface.entity[a]]),
        triangles=np.array(triangles, np.int32),
    )
