"""Moving shadow casters: their place, the direction of the sun, and the pixels that they may darken.

Each limb of a person is a capsule. Seen from the sun a capsule is a line with a rim, wherever along the light it is: so
a point's distance from that line says whether it is in shadow, and how far the capsule is ahead how soft the rim is.
Into vehicles that can be looked into the sun comes by their windows, and their lamps light what is in them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.assets.vehicle_parts import Cabin
from vico.render.arrays import PAD, SHADOWLESS, STRIDE
from vico.render.compiled import inlined, kernel
from vico.render.limbs import LIMB_RADIUS
from vico.render.records import CABIN, CABIN_STEPS, CASTER
from vico.render.uniforms import Record

#: Vehicles whose inside is seen are lit this far away, metres: lit ones are seen from afar by night.
CABIN_REACH = 200.0
#: Share of the sky's light that is left under a vehicle's roof.
UNDER_ROOF = np.float32(0.8)
#: Light of a cabin's lamps on what stands upright in it, what is added for each unit of a normal's z, and the colour.
CABIN_LAMP, CABIN_TILT = np.float32(0.42), np.float32(0.16)
CABIN_GREEN, CABIN_BLUE = np.float32(0.94), np.float32(0.82)
# Width of the rims of light on floor and seats, metres.
_PENUMBRA = 0.04
_ZERO, _HALF, _ONE, _TINY = (np.float32(value) for value in (0.0, 0.5, 1.0, 1e-9))
_STEPS, _LAST = np.float32(CABIN_STEPS - 1), CABIN_STEPS - 2
# Scratch memory of a block (see `vico.render.shadows.moving`): where a pixel is in the vehicle, what is left of the
# sun; then whether it is inside, the sun that comes in, whether by a side, and where along it.
_UNIT_A, _UNIT_B, _UNIT_C, LEFT, INSIDE = (k * STRIDE for k in (3, 4, 5, 6, 7))
_SUNLIT, _ALONG = 8 * STRIDE, 9 * STRIDE


def cabin_records(
    names: Sequence[str], cabins: Mapping[str, Cabin], low: NDArray[np.float32], high: NDArray[np.float32]
) -> tuple[NDArray[np.int32], NDArray[np.void]]:
    """Return which prototype has which cabin, as `Prototypes` has them.

    Parameters
    ----------
    names, low, high
        Of all prototypes, and their bounds, metres, shape ``(p, 3)``.
    cabins
        By the names of those that have one.
    """
    known = [name for name in names if name in cabins]
    rows, records = np.full(len(names), -1, np.int32), np.zeros(max(len(known), 1), CABIN)
    for row, name in enumerate(known):
        k = names.index(name)
        rows[k] = row
        middle, half = (low[k] + high[k]) / 2.0, np.maximum(high[k] - low[k], 1e-6) / 2.0
        _fill(records[row], cabins[name], middle.astype(np.float64), half.astype(np.float64))
    return rows, records


def _fill(record: Any, cabin: Cabin, middle: NDArray[np.float64], half: NDArray[np.float64]) -> None:
    """Write a cabin in the frame in which its vehicle's bounding box has corners at +-1."""
    record["low"] = (np.array(cabin.low) - middle) / half
    record["high"] = (np.array(cabin.high) - middle) / half
    for name in ("windows", "front", "rear"):
        record[name] = (np.array(getattr(cabin, name)) - middle[2]) / half[2]
    record["end_half"] = cabin.end_half / half[1]
    record["sharp"] = half / _PENUMBRA
    x = middle[0] + half[0] * np.linspace(-1.0, 1.0, CABIN_STEPS)
    for side, panes in enumerate((cabin.right, cabin.left)):
        for start, end in panes:
            within = np.minimum(x - start, end - x) / _PENUMBRA + 0.5
            record["open"][side] = np.maximum(record["open"][side], np.clip(within, 0.0, 1.0))


@inlined
def sun_in_cabin(cabin: Any, sun: Any, real: Any) -> None:
    """Lay whether a block's pixels are in a cabin, and for those what windows let in of the sun."""
    low, high, sharp, windows = cabin.low, cabin.high, cabin.sharp, cabin.windows
    low_a, low_b, low_c = low[0], low[1], low[2]
    high_a, high_b, high_c = high[0], high[1], high[2]
    sun_a, sun_b, sun_c = np.float32(sun[0]), np.float32(sun[1]), np.float32(sun[2])
    to_a, to_b, to_c = _inverse(sun_a), _inverse(sun_b), _inverse(sun_c)
    end_a, end_b, end_c = (
        high_a if to_a > _ZERO else low_a,
        high_b if to_b > _ZERO else low_b,
        high_c if to_c > _ZERO else low_c,
    )
    ends = cabin.front if to_a > _ZERO else cabin.rear
    sill, head, end_sill, end_head, end_half = windows[0], windows[1], ends[0], ends[1], cabin.end_half
    sharp_b, sharp_c = sharp[1], sharp[2]
    side = cabin.open[1 if to_b > _ZERO else 0]
    for i in range(PAD):
        a, b, c = real[_UNIT_A + i], real[_UNIT_B + i], real[_UNIT_C + i]
        inside = (a > low_a) & (a < high_a) & (b > low_b) & (b < high_b) & (c > low_c) & (c < high_c)
        real[INSIDE + i] = _ONE if inside else _ZERO
        # How far it is to each of the walls that the sun may come through.
        way_a, way_b, way_c = (end_a - a) * to_a, (end_b - b) * to_b, (end_c - c) * to_c
        way = min(way_a, way_b, way_c)
        hit_a, hit_b, hit_c = a + way * sun_a, b + way * sun_b, c + way * sun_c
        by_side = (way_b <= way_a) & (way_b <= way_c)
        by_end = (way_a < way_b) & (way_a <= way_c)
        pane = _within((hit_c - sill) * sharp_c) * _within((head - hit_c) * sharp_c)
        end = _within((hit_c - end_sill) * sharp_c) * _within((end_head - hit_c) * sharp_c)
        end *= _within((end_half - abs(hit_b)) * sharp_b)
        real[_SUNLIT + i] = end if by_end else (pane if by_side else _ZERO)
        along = min(max((hit_a + _ONE) * _HALF, _ZERO), _ONE) * _STEPS
        real[_ALONG + i] = along if by_side & inside else -_ONE
    for i in range(PAD):
        along = real[_ALONG + i]
        if along >= _ZERO:
            k = min(int(along), _LAST)
            real[_SUNLIT + i] *= side[k] + (along - np.float32(k)) * (side[k + 1] - side[k])
    for i in range(PAD):
        real[LEFT + i] = real[_SUNLIT + i] if real[INSIDE + i] > _ZERO else real[LEFT + i]


@inlined
def _inverse(way: Any) -> Any:
    return _ONE / (way if abs(way) > _TINY else _TINY)


@inlined
def _within(depth: Any) -> Any:
    """Return how far a point is within a rim, in penumbras: 0 well without, 1 well within."""
    return min(max(depth + _HALF, _ZERO), _ONE)


# Width of a rim where it begins, and what it grows by for each metre on the way: the sun is half a degree wide.
_RIM, _SPREAD = np.float32(0.03), np.float32(0.012)
# A rim is at most so many times a limb's radius wide.
_WIDEST = np.float32(2.5)
# The inverse of the way past a limb from which on its shadow is whole, 1/m: what it rests on is lit beside it.
_BEHIND = np.float32(25.0)
_FOOT_WIDTH = 0.62  # half width of the shadow at the foot, metres
_FOOT_HEIGHT = 0.5  # half the height of the layer it lies in, metres
# Columns of a caster's limb, in the frame across (p, q) and along (r) the light: its start, and from there to its end.
_P, _Q, _ALONG_P, _ALONG_Q = range(4)
_INVERSE_SQUARE = 4  # of its length across the light
_R, _ALONG_R = 5, 6
_RADIUS = 7  # metres


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
        p0, q0, r0 = _place_limb(frame, 0, limb, 0), _place_limb(frame, 1, limb, 0), _place_limb(frame, 2, limb, 0)
        p1, q1, r1 = _place_limb(frame, 0, limb, 3), _place_limb(frame, 1, limb, 3), _place_limb(frame, 2, limb, 3)
        p, q = p1 - p0, q1 - q0
        row[_P], row[_Q], row[_ALONG_P], row[_ALONG_Q] = np.float32(p0), np.float32(q0), np.float32(p), np.float32(q)
        row[_INVERSE_SQUARE] = np.float32(1.0 / max(p * p + q * q, 1e-9))
        row[_R], row[_ALONG_R], row[_RADIUS] = np.float32(r0), np.float32(r1 - r0), limb[LIMB_RADIUS]
        rim = limb[LIMB_RADIUS] * np.float32(1.0 + 0.5 * _WIDEST)
        area[0], area[1] = min(area[0], np.float32(min(p0, p1)) - rim), max(area[1], np.float32(max(p0, p1)) + rim)
        area[2], area[3] = min(area[2], np.float32(min(q0, q1)) - rim), max(area[3], np.float32(max(q0, q1)) + rim)


@inlined
def _place_limb(frame: Any, axis: int, limb: Any, end: int) -> float:
    """Return a coordinate of a limb's end."""
    row = frame[axis]
    return float(row[0] * limb[end] + row[1] * limb[end + 1] + row[2] * limb[end + 2] + row[3])


@inlined
def limb_shadow(limb: Any, p: Any, q: Any, r: Any) -> Any:
    """Return how dark a limb makes a point, 0..1; all float32, in the frame across and along the light."""
    x, y = p - limb[_P], q - limb[_Q]
    way = min(max((x * limb[_ALONG_P] + y * limb[_ALONG_Q]) * limb[_INVERSE_SQUARE], _ZERO), _ONE)
    x, y = x - way * limb[_ALONG_P], y - way * limb[_ALONG_Q]
    ahead = limb[_R] + way * limb[_ALONG_R] - r
    rim = min(_RIM + _SPREAD * max(ahead, _ZERO), _WIDEST * limb[_RADIUS])
    dark = min(max((limb[_RADIUS] - np.sqrt(x * x + y * y)) / rim + _HALF, _ZERO), _ONE)
    return dark * min(max(ahead * _BEHIND, _ZERO), _ONE)


# An avatar's shadow, where it is that of an ellipsoid, is of at most this half width, metres: arms and coats are thin.
AVATAR_HALF_WIDTH = 0.30
# Whoever is as high as this in the picture throws a shadow with arms and legs, pixels.
_LIMB_PIXELS = 24.0
# Lengths of the light's way that make a full shadow, metres.
_SOFT_BALL = 0.22  # through an avatar's ball
_SOFT_BOX = 0.5  # through a box; of what is thinner, such as a robot's legs, its thinnest side does
_THINNEST = 0.02
# The longest shadow, metres; a sun this low casts no longer ones.
_LONGEST_SHADOW, _LOWEST_SUN = 14.0, 0.08
# Out of doors, what is further away than this casts no shadow, metres.
_OUTDOOR_REACH = 70.0
# Half the height of things that stand on the ground at least, metres.
_SMALL = 0.65
# Nothing is darkened further below a caster's foot than this, metres.
DEEPEST = np.float32(6.0)
# Nothing is darkened further above a caster's foot than this, in half heights.
TALLEST = np.float32(2.2)
# What rounding may move a caster's centre by, and far more, metres.
_SLACK = 0.1


def new_caster() -> Record:
    """Return an empty `CASTER` record."""
    return np.zeros(1, CASTER)[0]


@inlined
def shadow_reach(camera: Any) -> float:
    """Return how near moving things must be to cast a shadow into a view, metres: in a room, those in it or close."""
    if camera.indoors == 0:
        return _OUTDOOR_REACH
    return np.sqrt(camera.room_half_length**2 + camera.room_half_width**2) * 2.0 + 1.0


@inlined
def _set_avatar_axes(scene: Any, avatar: int, caster: Any) -> None:
    low, high = scene.avatars.low[avatar], scene.avatars.high[avatar]
    centre, axes = caster.centre, caster.half_axes
    for row in range(3):
        for column in range(3):
            axes[row, column] = 0.0
    for axis in range(3):
        centre[axis] = 0.5 * (float(low[axis]) + high[axis])
        axes[axis, axis] = 0.5 * (float(high[axis]) - low[axis])
    axes[0, 0], axes[1, 1] = min(axes[0, 0], AVATAR_HALF_WIDTH), min(axes[1, 1], AVATAR_HALF_WIDTH)


@inlined
def _set_instance_axes(scene: Any, instance: int, caster: Any) -> None:
    m, model = scene.instances.matrix[instance], scene.instances.prototype[instance]
    low, high = scene.prototypes.low[model], scene.prototypes.high[model]
    centre, axes = caster.centre, caster.half_axes
    for row in range(3):
        total = float(m[row, 3])
        for axis in range(3):
            total += m[row, axis] * 0.5 * (float(low[axis]) + high[axis])
            axes[row, axis] = m[row, axis] * 0.5 * (float(high[axis]) - low[axis])
        centre[row] = total


@inlined
def _is_near(caster: Any, camera: Any, reach: float) -> bool:
    """Return whether a caster's centre lies within `reach` metres of the camera."""
    centre = caster.centre
    gx, gy, gz = centre[0] - camera.x, centre[1] - camera.y, centre[2] - camera.z
    return not gx * gx + gy * gy + gz * gz > reach * reach


@inlined
def is_sphere_far(sphere: Any, camera: Any, reach: float) -> bool:
    """Return whether `_is_near` is false of a thing with this bounding sphere: a quick first test."""
    # The sphere's centre is the caster's, but for rounding.
    x, y, z = float(sphere.x) - camera.x, float(sphere.y) - camera.y, float(sphere.z) - camera.z
    return x * x + y * y + z * z > (reach + _SLACK) * (reach + _SLACK)


@inlined
def instance_reach(sphere: Any, cabin: Any, camera: Any, reach: float) -> float:
    """Return how near an instance must be to darken anything, metres: `reach`, or more of lit insides; 0 if it isn't.

    `cabin` is below 0 of what has none. A quick first test, as `is_sphere_far`.
    """
    if not is_sphere_far(sphere, camera, reach):
        return reach
    if cabin < 0 or camera.indoors != 0 or is_sphere_far(sphere, camera, CABIN_REACH):
        return 0.0
    return CABIN_REACH


@inlined
def is_box_far(low: Any, high: Any, camera: Any, reach: float) -> bool:
    """Return whether `_is_near` is false of an avatar with these bounds: a quick first test."""
    x = 0.5 * (float(low[0]) + high[0]) - camera.x
    y = 0.5 * (float(low[1]) + high[1]) - camera.y
    z = 0.5 * (float(low[2]) + high[2]) - camera.z
    return x * x + y * y + z * z > (reach + _SLACK) * (reach + _SLACK)


@inlined
def _set_unit_frame(caster: Any, light: Any) -> bool:
    """Write the frame in which a caster is a unit box or ball, and the sun in it; return whether it has a volume."""
    centre, axes, to_unit = caster.centre, caster.half_axes, caster.to_unit
    sx, sy, sz = float(light.shadow_x), float(light.shadow_y), float(light.shadow_z)
    for axis in range(3):
        length = axes[0, axis] ** 2 + axes[1, axis] ** 2 + axes[2, axis] ** 2
        if length < 1e-8:
            return False
        for row in range(3):
            to_unit[axis, row] = axes[row, axis] / length
        to_unit[axis, 3] = -(to_unit[axis, 0] * centre[0] + to_unit[axis, 1] * centre[1] + to_unit[axis, 2] * centre[2])
        caster.sun[axis] = to_unit[axis, 0] * sx + to_unit[axis, 1] * sy + to_unit[axis, 2] * sz
    return True


@inlined
def _set_reach(caster: Any, camera: Any, light: Any) -> None:
    """Write the corners of a caster with a rim for its contact shadow, and of its shadow on the ground beneath.

    In rooms there is the contact shadow alone.
    """
    centre, axes, reach = caster.centre, caster.half_axes, caster.reach
    sx, sy, sz = float(light.shadow_x), float(light.shadow_y), float(light.shadow_z)
    indoors, up = camera.indoors != 0, caster.half_height
    # Small things are held, worn, fly, or are parts of robots: the ground may lie well below them.
    drop = 2.0 * up if up > _SMALL else DEEPEST + 2.0 * up
    throw = 0.0 if indoors else min(drop / max(sz, _LOWEST_SUN), _LONGEST_SHADOW)
    rim, middle, tall = 1.3, 0.0, 1.1
    if indoors and caster.is_round:
        rim, middle, tall = 2.0, -1.0, 0.5 / up
    for corner in range(16):
        a = rim if corner & 1 else -rim
        b = rim if corner & 2 else -rim
        c = middle + (tall if corner & 4 else -tall)
        away = throw if corner & 8 else 0.0
        wx = centre[0] + a * axes[0, 0] + b * axes[0, 1] + c * axes[0, 2] - away * sx - camera.x
        wy = centre[1] + a * axes[1, 0] + b * axes[1, 1] + c * axes[1, 2] - away * sy - camera.y
        wz = centre[2] + a * axes[2, 0] + b * axes[2, 1] + c * axes[2, 2] - away * sz - camera.z
        reach[corner, 0] = wx * camera.right_x + wy * camera.right_y + wz * camera.right_z
        reach[corner, 1] = wx * camera.down_x + wy * camera.down_y + wz * camera.down_z
        reach[corner, 2] = wx * camera.forward_x + wy * camera.forward_y + wz * camera.forward_z


@inlined
def _set_screen_bounds(caster: Any, camera: Any) -> bool:
    """Write which columns and rows a caster may darken; return whether there are any."""
    points = caster.reach
    near, width, height = float(camera.near), camera.width, camera.height
    left, right, top, bottom = 1e30, -1e30, 1e30, -1e30
    for i in range(16):
        if points[i, 2] <= near:
            continue
        w = camera.focal / points[i, 2]
        px, py = camera.centre_x + w * points[i, 0], camera.centre_y + w * points[i, 1]
        left, right, top, bottom = min(left, px), max(right, px), min(top, py), max(bottom, py)
        for j in range(16):
            # What lies behind the near plane is cut off there.
            if points[j, 2] <= near:
                s = (points[i, 2] - near) / (points[i, 2] - points[j, 2])
                px = camera.centre_x + camera.focal / near * (points[i, 0] + s * (points[j, 0] - points[i, 0]))
                py = camera.centre_y + camera.focal / near * (points[i, 1] + s * (points[j, 1] - points[i, 1]))
                left, right, top, bottom = min(left, px), max(right, px), min(top, py), max(bottom, py)
    caster.first_column = int(min(max(left, 0.0), 1e9))
    caster.end_column = int(max(min(right + 1.0, float(width)), -1.0))
    caster.first_row = int(min(max(top, 0.0), 1e9))
    caster.end_row = int(max(min(bottom + 1.0, float(height)), -1.0))
    return caster.first_column < caster.end_column and caster.first_row < caster.end_row


@kernel
def list_casters(scene: Any, camera: Any, light: Any, casters: Any, numbers: Any) -> int:
    """Write the `CASTER` of everything that may darken a picture, and its number among instances and then avatars.

    Return how many there are.
    """
    reach, instances, count = shadow_reach(camera), scene.counts.instances, 0
    spheres, models, cabin_of = scene.instances.sphere, scene.instances.prototype, scene.prototypes.cabin
    for k in range(scene.counts.static_instances, instances + scene.counts.avatars):
        within = instance_reach(spheres[k], cabin_of[models[k]], camera, reach) if k < instances else reach
        if within > 0.0 and set_caster(scene, k, camera, light, within, casters[count]):
            numbers[count] = k
            count += 1
    return count


@inlined
def set_caster(scene: Any, k: int, camera: Any, light: Any, reach: float, caster: Any) -> bool:
    """Write the `CASTER` of a moving thing (instances, then avatars); return whether it may darken what is seen."""
    avatar = k - scene.counts.instances
    caster.is_round = 1 if avatar >= 0 else 0
    if avatar < 0 and scene.instances.where[k] == SHADOWLESS:
        return False
    if avatar >= 0:
        if camera.indoors and is_avatar_hidden(scene, avatar, camera):
            # Nobody sees their own body: in a room, its shadow would be a stain around nothing.
            return False
        _set_avatar_axes(scene, avatar, caster)
    else:
        _set_instance_axes(scene, k, caster)
    if not _is_near(caster, camera, reach):
        return False
    axes = caster.half_axes
    caster.half_height = abs(axes[2, 0]) + abs(axes[2, 1]) + abs(axes[2, 2])
    caster.foot = caster.centre[2] - caster.half_height
    caster.inverse_soft = 1.0 / (_SOFT_BALL if avatar >= 0 else _soft_length(axes))
    if not _set_unit_frame(caster, light):
        return False
    caster.limb_count, caster.cabin = 0, -1
    if avatar < 0 and camera.indoors == 0:
        caster.cabin = scene.prototypes.cabin[scene.instances.prototype[k]]
    if avatar >= 0 and camera.indoors == 0 and len(scene.avatars.limbs) > avatar and _is_large(caster, camera):
        set_limbs(scene.avatars.limbs[avatar], light, caster)
        _widen(scene.avatars.low[avatar], scene.avatars.high[avatar], axes)
    _set_reach(caster, camera, light)
    return _set_screen_bounds(caster, camera)


@inlined
def _is_large(caster: Any, camera: Any) -> bool:
    """Return whether somebody is so near that the shadow is one of a body with limbs."""
    x, y, z = caster.centre[0] - camera.x, caster.centre[1] - camera.y, caster.centre[2] - camera.z
    pixels = 2.0 * caster.half_height * camera.focal
    return pixels * pixels > _LIMB_PIXELS * _LIMB_PIXELS * (x * x + y * y + z * z)


@inlined
def _widen(low: Any, high: Any, axes: Any) -> None:
    """Let half axes along the world's reach as far as an avatar's arms do."""
    for axis in range(2):
        axes[axis, axis] = max(axes[axis, axis], 0.5 * (float(high[axis]) - low[axis]))


@inlined
def _soft_length(half_axes: Any) -> float:
    """Return the length of light's way through a box that makes a full shadow, metres."""
    least = _SOFT_BOX
    for axis in range(3):
        x, y, z = half_axes[0, axis], half_axes[1, axis], half_axes[2, axis]
        least = min(least, 2.0 * np.sqrt(x * x + y * y + z * z))
    return max(least, _THINNEST)


@inlined
def is_avatar_hidden(scene: Any, avatar: int, camera: Any) -> bool:
    """Return whether an avatar is the body that the camera does not see."""
    return (
        camera.hidden_entity != 0
        and scene.mesh.entity[scene.avatars.span[avatar].first_triangle] == camera.hidden_entity
    )
