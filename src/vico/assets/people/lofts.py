"""Lofted parts of a body: rings along a limb, each with its shape, its colour and the joints that carry it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.assets.people.model import JOINTS, Colour, SkinnedBody, t_pose

Vector = tuple[float, float, float] | NDArray[np.float64]
Weights = dict[int, float]


@dataclass(frozen=True)
class LoftRing:
    """A closed outline across a limb: four half-ellipse radii around a centre.

    Attributes
    ----------
    centre
        Metres, body frame.
    front, back, side
        Radii, metres, along `+forward`, `-forward` and both ways across it.
    weights
        Joint -> share.
    colour
        sRGB of the skin or cloth from here on.
    square
        Superellipse exponent: 2 an ellipse, more is boxier.
    """

    centre: Vector
    front: float
    back: float
    side: float
    weights: Weights
    colour: Colour
    square: float = 2.0


@dataclass
class BodyPart:
    """A mesh under construction.

    Attributes
    ----------
    vertices, colour, weights
        ``(v, 3)``, ``(v, 3)``, dense joint shares ``(v, 55)``.
    triangles
        ``(m, 3)``.
    """

    vertices: NDArray[np.float64]
    triangles: NDArray[np.int64]
    colour: NDArray[np.float64]
    weights: NDArray[np.float64]
    normals: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 3)))


def dense(weights: Weights) -> NDArray[np.float64]:
    """One row of joint shares, normalised."""
    row = np.zeros(len(JOINTS))
    for joint, share in weights.items():
        row[joint] += share
    return row / row.sum()


def blend(a: Weights, b: Weights, share: float) -> Weights:
    """Mix two sets of shares, `share` of `b`."""
    mixed = {joint: value * (1 - share) for joint, value in a.items()}
    for joint, value in b.items():
        mixed[joint] = mixed.get(joint, 0.0) + value * share
    return {joint: value for joint, value in mixed.items() if value > 1e-6}


def loft(
    rings: Sequence[LoftRing],
    *,
    sides: int = 12,
    forward: Vector = (1.0, 0.0, 0.0),
    close_start: bool = False,
    close_end: bool = False,
) -> BodyPart:
    """Skin a row of rings; where the colour changes the ring is doubled, so that the edge is sharp.

    Parameters
    ----------
    rings
        From one end to the other; outlines are perpendicular to the local axis.
    sides
        Corners of each outline.
    forward
        Direction that `front` means, made perpendicular to the axis ring by ring.
    close_start, close_end
        Whether to cap the ends with a vertex at the ring's centre.
    """
    doubled: list[LoftRing] = []
    for ring, following in zip(rings, [*rings[1:], rings[-1]], strict=True):
        doubled.append(ring)
        if following.colour != ring.colour:
            doubled.append(replace(ring, colour=following.colour))
    centres = np.array([np.asarray(ring.centre, np.float64) for ring in doubled])
    axes = _axes(centres)
    angles = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    points, colours, shares = [], [], []
    for ring, centre, axis in zip(doubled, centres, axes, strict=True):
        ahead = np.asarray(forward, np.float64) - axis * (np.asarray(forward, np.float64) @ axis)
        ahead /= np.linalg.norm(ahead)
        left = np.cross(axis, ahead)
        c, s = np.cos(angles), np.sin(angles)
        power = 2.0 / ring.square
        a = np.sign(c) * np.abs(c) ** power * np.where(c >= 0, ring.front, ring.back)
        b = np.sign(s) * np.abs(s) ** power * ring.side
        points.append(centre + a[:, None] * ahead + b[:, None] * left)
        colours.append(np.tile(np.asarray(ring.colour, np.float64), (sides, 1)))
        shares.append(np.tile(dense(ring.weights), (sides, 1)))
    faces = []
    for k in range(len(doubled) - 1):
        if np.allclose(points[k], points[k + 1]):
            continue
        for i in range(sides):
            j = (i + 1) % sides
            a0, b0, b1, a1 = k * sides + i, k * sides + j, (k + 1) * sides + j, (k + 1) * sides + i
            faces += [(a0, b0, b1), (a0, b1, a1)]
    vertices, colour, weights = np.concatenate(points), np.concatenate(colours), np.concatenate(shares)
    for closed, k, flip in ((close_start, 0, True), (close_end, len(doubled) - 1, False)):
        if closed:
            tip = len(vertices)
            vertices = np.vstack([vertices, centres[k]])
            colour = np.vstack([colour, doubled[k].colour])
            weights = np.vstack([weights, dense(doubled[k].weights)])
            for i in range(sides):
                a0, b0 = k * sides + i, k * sides + (i + 1) % sides
                faces.append((b0, a0, tip) if flip else (a0, b0, tip))
    part = with_normals(BodyPart(vertices, np.array(faces, np.int64), colour, weights))
    # Lofts that run down or backwards come inside out: those whose volume is negative are turned.
    corners = part.vertices[part.triangles] - part.vertices.mean(0)
    volume = float(np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum())
    if volume < 0:
        part.triangles = part.triangles[:, ::-1].copy()
        return with_normals(part)
    return part


def _axes(centres: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return unit tangents of the centre line; doubled rings share one."""
    axes = np.empty_like(centres)
    for k in range(len(centres)):
        low, high = k, k
        while low > 0 and np.linalg.norm(centres[high] - centres[low]) < 1e-9:
            low -= 1
        if k > 0 and low == k:
            low = k - 1
        while high < len(centres) - 1 and np.linalg.norm(centres[high] - centres[k]) < 1e-9:
            high += 1
        while low > 0 and np.linalg.norm(centres[low] - centres[k]) < 1e-9:
            low -= 1
        way = centres[high] - centres[low]
        axes[k] = way / np.linalg.norm(way)
    return axes


def with_normals(part: BodyPart) -> BodyPart:
    """Give a part smooth normals; vertices at one place (doubled rings) share one, so no seam shows."""
    corners = part.vertices[part.triangles]
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    _, place = np.unique(np.round(part.vertices, 6), axis=0, return_inverse=True)
    place = place.ravel()
    sums = np.zeros((int(place.max()) + 1, 3))
    for k in range(3):
        np.add.at(sums, place[part.triangles[:, k]], flat)
    sums /= np.maximum(np.linalg.norm(sums, axis=1, keepdims=True), 1e-12)
    part.normals = sums[place]
    return part


def blob(
    centre: Vector,
    radii: Sequence[float] | NDArray[np.float64],
    weights: Weights,
    colour: Colour,
    *,
    sides: int = 8,
    rings: int = 5,
) -> BodyPart:
    """Return an ellipsoid carried by joints."""
    turns = np.linspace(-np.pi / 2, np.pi / 2, rings + 1)
    middle = np.asarray(centre, np.float64)
    rows = [
        LoftRing(
            middle + np.array([0, 0, radii[2] * np.sin(t)]),
            max(radii[0] * np.cos(t), 1e-5),
            max(radii[0] * np.cos(t), 1e-5),
            max(radii[1] * np.cos(t), 1e-5),
            weights,
            colour,
        )
        for t in turns
    ]
    return loft(rows, sides=sides)


def merge_parts(parts: Sequence[BodyPart]) -> BodyPart:
    """Put parts together without welding."""
    offsets = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])])
    return BodyPart(
        np.concatenate([part.vertices for part in parts]),
        np.concatenate([part.triangles + offset for part, offset in zip(parts, offsets, strict=True)]),
        np.concatenate([part.colour for part in parts]),
        np.concatenate([part.weights for part in parts]),
        np.concatenate([part.normals for part in parts]),
    )


def skin_parts(parts: Sequence[BodyPart], joints: NDArray[np.float64], height: float) -> SkinnedBody:
    """Make a body of its parts.

    Parameters
    ----------
    parts
        All of them; they are put together without welding.
    joints
        Where the joints are at rest, metres, shape ``(len(JOINTS), 3)``.
    height
        Metres, of the person.
    """
    whole = merge_parts(parts)
    weight_joints, weights = _strongest(whole.weights)
    frames, turned = t_pose(joints)
    return SkinnedBody(
        whole.vertices.astype(np.float32),
        whole.normals.astype(np.float32),
        whole.triangles.astype(np.int32),
        np.clip(np.rint(whole.colour), 0, 255).astype(np.uint8),
        weight_joints,
        weights,
        joints.astype(np.float32),
        frames,
        turned,
        height,
    )


def _strongest(weights: NDArray[Any]) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Keep each vertex's four strongest joints, renormalised, descending."""
    order = np.argsort(-weights, axis=1, kind="stable")[:, :4]
    kept = np.take_along_axis(weights, order, axis=1)
    kept = np.where(kept < 0.01, 0, kept)
    kept = kept / kept.sum(axis=1, keepdims=True)
    return np.where(kept > 0, order, order[:, :1]).astype(np.int32), kept.astype(np.float32)
