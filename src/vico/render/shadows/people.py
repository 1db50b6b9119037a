"""Shadows of people: each limb is a capsule, and its shadow is told across the light.

Seen from the sun a capsule is a line with a rim, wherever along the light it is: so a point's distance from that line
says whether it is in shadow, and how far the capsule is ahead how soft the rim is.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from vico.render.compiled import inlined

_ZERO, _HALF, _ONE = np.float32(0.0), np.float32(0.5), np.float32(1.0)
# Width of a rim where it begins, and what it grows by for each metre on the way: the sun is half a degree wide.
_RIM, _SPREAD = np.float32(0.03), np.float32(0.012)
# A rim is at most so many times a limb's radius wide.
_WIDEST = np.float32(2.5)
# The inverse of the way past a limb from which on its shadow is whole, 1/m: what it rests on is lit beside it.
_BEHIND = np.float32(25.0)
# Half width of the shadow at the foot, metres; and half the height of the layer it lies in.
_FOOT_WIDTH, _FOOT_HEIGHT = 0.62, 0.5


@inlined
def set_limbs(limbs: Any, light: Any, caster: Any) -> None:
    """Write a `CASTER`'s limbs, which are capsules as `PosedAvatars` has them, and what they may darken."""
    sx, sy, sz = float(light.shadow_x), float(light.shadow_y), float(light.shadow_z)
    level = np.sqrt(sx * sx + sy * sy)
    px, py = (-sy / level, sx / level) if level > 1e-6 else (1.0, 0.0)
    frame, centre, out, area = caster.sun_frame, caster.centre, caster.limbs, caster.area
    for axis in range(3):
        if axis == 0:
            x, y, z = px, py, 0.0
        elif axis == 1:
            x, y, z = -sz * py, sz * px, sx * py - sy * px
        else:
            x, y, z = sx, sy, sz
        frame[axis, 0], frame[axis, 1], frame[axis, 2] = x, y, z
        frame[axis, 3] = -(x * centre[0] + y * centre[1] + z * centre[2])
    caster.limb_count = len(limbs)
    # The shadow at the foot is a disk in a low layer.
    foot, tilt = -caster.half_height * frame[1, 2], abs(sz) * _FOOT_WIDTH + _FOOT_HEIGHT * abs(frame[1, 2])
    area[0], area[1] = np.float32(-_FOOT_WIDTH), np.float32(_FOOT_WIDTH)
    area[2], area[3] = np.float32(foot - tilt), np.float32(foot + tilt)
    for k in range(len(limbs)):
        limb, row = limbs[k], out[k]
        p0, q0, r0 = _place(frame, 0, limb, 0), _place(frame, 1, limb, 0), _place(frame, 2, limb, 0)
        p1, q1, r1 = _place(frame, 0, limb, 3), _place(frame, 1, limb, 3), _place(frame, 2, limb, 3)
        p, q = p1 - p0, q1 - q0
        row[0], row[1], row[2], row[3] = np.float32(p0), np.float32(q0), np.float32(p), np.float32(q)
        row[4] = np.float32(1.0 / max(p * p + q * q, 1e-9))
        row[5], row[6], row[7] = np.float32(r0), np.float32(r1 - r0), limb[6]
        rim = limb[6] * np.float32(1.0 + 0.5 * _WIDEST)
        area[0], area[1] = min(area[0], np.float32(min(p0, p1)) - rim), max(area[1], np.float32(max(p0, p1)) + rim)
        area[2], area[3] = min(area[2], np.float32(min(q0, q1)) - rim), max(area[3], np.float32(max(q0, q1)) + rim)


@inlined
def _place(frame: Any, axis: int, limb: Any, end: int) -> float:
    """Return a coordinate of a limb's end."""
    row = frame[axis]
    return float(row[0] * limb[end] + row[1] * limb[end + 1] + row[2] * limb[end + 2] + row[3])


@inlined
def limb_shadow(limb: Any, p: Any, q: Any, r: Any) -> Any:
    """Return how dark a limb makes a point, 0..1; all float32, in the frame across and along the light."""
    x, y = p - limb[0], q - limb[1]
    way = min(max((x * limb[2] + y * limb[3]) * limb[4], _ZERO), _ONE)
    x, y = x - way * limb[2], y - way * limb[3]
    ahead = limb[5] + way * limb[6] - r
    rim = min(_RIM + _SPREAD * max(ahead, _ZERO), _WIDEST * limb[7])
    dark = min(max((limb[7] - np.sqrt(x * x + y * y)) / rim + _HALF, _ZERO), _ONE)
    return dark * min(max(ahead * _BEHIND, _ZERO), _ONE)
