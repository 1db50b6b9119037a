"""Rotations and two-bone limbs for animation, compiled."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.io.compiled import compiled

Array = NDArray[Any]
# Axes of the body: forward, left, up.
X, Y, Z = range(3)


@compiled
def rotation_about(axis: int, angle: float) -> Array:
    """Return the rotation matrix about `X`, `Y` or `Z`; radians."""
    c, s = np.cos(angle), np.sin(angle)
    m = np.zeros((3, 3))
    a, b = (axis + 1) % 3, (axis + 2) % 3
    m[axis, axis] = 1.0
    m[a, a], m[a, b], m[b, a], m[b, b] = c, -s, s, c
    return m


@compiled
def compose(a: Array, b: Array) -> Array:
    """Return the product of two 3x3 matrices, without a call to BLAS."""
    m = np.empty((3, 3))
    for r in range(3):
        for c in range(3):
            m[r, c] = a[r, 0] * b[0, c] + a[r, 1] * b[1, c] + a[r, 2] * b[2, c]
    return m


@compiled
def relative_rotation(a: Array, b: Array) -> Array:
    """Return rotation `b` as seen from `a`: the inverse of `a` times `b`."""
    m = np.empty((3, 3))
    for r in range(3):
        for c in range(3):
            m[r, c] = a[0, r] * b[0, c] + a[1, r] * b[1, c] + a[2, r] * b[2, c]
    return m


@compiled
def rotate(a: Array, v: Array) -> Array:
    """Return a 3x3 matrix times a vector."""
    out = np.empty(3)
    for r in range(3):
        out[r] = a[r, 0] * v[0] + a[r, 1] * v[1] + a[r, 2] * v[2]
    return out


@compiled
def cross(a: Array, b: Array) -> Array:
    """Return the cross product of two vectors."""
    out = np.empty(3)
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]
    return out


@compiled
def unit(v: Array) -> Array:
    """Return the direction of a vector."""
    return v / max(np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]), 1e-12)


@compiled
def axis_angle(m: Array, out: Array) -> None:
    """Write the axis-angle vector of a rotation matrix, through its quaternion (stable at every angle)."""
    trace = m[0, 0] + m[1, 1] + m[2, 2]
    q = np.empty(4)
    if trace > 0:
        s = 2.0 * np.sqrt(trace + 1.0)
        q[0], q[1], q[2], q[3] = 0.25 * s, (m[2, 1] - m[1, 2]) / s, (m[0, 2] - m[2, 0]) / s, (m[1, 0] - m[0, 1]) / s
    else:
        i = 0
        if m[1, 1] > m[i, i]:
            i = 1
        if m[2, 2] > m[i, i]:
            i = 2
        j, k = (i + 1) % 3, (i + 2) % 3
        s = 2.0 * np.sqrt(max(1.0 + m[i, i] - m[j, j] - m[k, k], 1e-12))
        q[0] = (m[k, j] - m[j, k]) / s
        q[1 + i], q[1 + j], q[1 + k] = 0.25 * s, (m[j, i] + m[i, j]) / s, (m[k, i] + m[i, k]) / s
    if q[0] < 0:
        q[:] = -q
    sine = np.sqrt(q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    factor = 2.0 if sine < 1e-9 else 2.0 * np.arctan2(sine, q[0]) / sine
    out[0], out[1], out[2] = factor * q[1], factor * q[2], factor * q[3]


@compiled
def two_bone_ik(start: Array, goal: Array, pole: Array, first: float, second: float) -> tuple[Array, Array, Array]:
    """Bend a limb of two bones to reach a point.

    Parameters
    ----------
    start, goal
        Where it hangs and where its end should be, metres.
    pole
        Direction the middle joint points to.
    first, second
        Bone lengths, metres.

    Returns
    -------
    first direction, second direction, hinge
        Unit vectors; the hinge is the axis that turns the first into the second.

    Notes
    -----
    A goal out of reach is approached in its direction.
    """
    way = goal - start
    distance = np.sqrt(way[0] * way[0] + way[1] * way[1] + way[2] * way[2])
    along = way / max(distance, 1e-9)
    distance = min(max(distance, abs(first - second) + 1e-4), (first + second) * 0.9998)
    side = pole - along * (pole[0] * along[0] + pole[1] * along[1] + pole[2] * along[2])
    side = unit(side)
    cosine = (first * first + distance * distance - second * second) / (2 * first * distance)
    cosine = min(max(cosine, -1.0), 1.0)
    sine = np.sqrt(1 - cosine * cosine)
    upper = along * cosine + side * sine
    lower = unit(along * distance - upper * first)
    return upper, lower, unit(cross(side, along))


@compiled
def smoothstep(x: float) -> float:
    """Return 0 before 0, 1 after 1, and a curve with level ends between."""
    t = min(max(x, 0.0), 1.0)
    return t * t * (3 - 2 * t)


@compiled
def hermite(a: float, b: float, slope_a: float, slope_b: float, t: float) -> float:
    """Return the cubic from `a` to `b` over t = 0..1 with the given slopes at the ends."""
    u = t * t
    w = u * t
    return (2 * w - 3 * u + 1) * a + (w - 2 * u + t) * slope_a + (3 * u - 2 * w) * b + (w - u) * slope_b
