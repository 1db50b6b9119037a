"""Shadows of what moves, worked out on the picture; and whether any of it can be noticed in a room."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.render.arrays import PAD, STRIDE
from vico.render.compiled import inlined, kernel
from vico.render.records import BOX, CASTER, MODEL_VIEW
from vico.render.uniforms import Record
from vico.render.visibility.culling import (
    in_view,
    is_hidden,
    is_instance_in_view,
    set_box,
    set_instance_view,
    set_world_view,
)
from vico.render.visibility.fill import inverse_depth, triangle_number

# An avatar's shadow is that of an ellipsoid of at most this half width, metres: arms and coats are thin.
_AVATAR_HALF_WIDTH = 0.30
# Lengths of the light's way through an avatar's ball and through a box that make a full shadow, metres; of what is
# thinner, such as a robot's legs, its thinnest side does.
_SOFT_BALL, _SOFT_BOX, _THINNEST = 0.22, 0.5, 0.02
# The longest shadow, metres; a sun this low casts no longer ones.
_LONGEST_SHADOW, _LOWEST_SUN = 14.0, 0.08
# Out of doors, what is further away than this casts no shadow, metres.
_OUTDOOR_REACH = 70.0
# Contact shadows: how far from the middle they reach (in half axes), how steeply they grow, how dark at most.
_ROUND_EDGE, _BOX_EDGE, _ROUND_GAIN, _BOX_GAIN, _DARKEST = 2.0, 1.25, 1.5, 4.0, 0.75
# Half the height of the layer at the ground in which they lie, metres.
_CONTACT_HEIGHT = 0.5
# Half the height of things that stand on the ground at least, metres.
_SMALL = 0.65
# Nothing is darkened further below a caster's foot than this, metres.
_DEEPEST = np.float32(6.0)
# ... nor further above it than this, in half heights.
_TALLEST = np.float32(2.2)
_ZERO, _ONE, _TWO, _THREE, _TINY = (np.float32(value) for value in (0.0, 1.0, 2.0, 3.0, 1e-9))
# Pixels that are looked at together, and the fields of the scratch memory of a block.
_BLOCK = PAD
# A pixel's number, masked so that the compiler knows it is not negative.
_INDEX = 0x7FFFFFFF
# What rounding may move a caster's centre by, and far more, metres.
_SLACK = 0.1
_DEPTH, _REACHED, _ABOVE, _UNIT_A, _UNIT_B, _UNIT_C, _LEFT = (k * STRIDE for k in range(7))


class CoarseDepth(NamedTuple):
    """Farthest depths of a picture's tiles and of blocks of tiles, as in `Buffers`."""

    tiles: NDArray[np.uint32]
    blocks: NDArray[np.uint32]


def new_caster() -> Record:
    """Return an empty `CASTER` record."""
    return np.zeros(1, CASTER)[0]


@inlined
def _shadow_reach(camera: Any) -> float:
    """Return how near moving things must be to cast a shadow into a view, metres: in a room, those in it or close."""
    if camera.indoors == 0:
        return _OUTDOOR_REACH
    return np.sqrt(camera.room_half_length**2 + camera.room_half_width**2) * 2.0 + 1.0


@kernel
def is_disturbed(scene: Any, camera: Any, light: Any, coarse: Any, scratch: Any) -> bool:
    """Return whether a moving thing may be seen in a room, or darken something that is.

    `coarse`, a `CoarseDepth`, is that of the room without such things: what lies behind all of it is hidden. `scratch`
    is as from `new_scratch`.
    """
    caster, model_view, box = scratch
    reach = _shadow_reach(camera)
    if _may_instance_be_noticed(scene, camera, light, coarse, reach, caster, model_view, box):
        return True
    return bool(_may_avatar_be_noticed(scene, camera, coarse, model_view, box))


def new_scratch() -> tuple[Record, Record, Record]:
    """Return empty `CASTER`, `MODEL_VIEW` and `BOX` records."""
    return new_caster(), np.zeros(1, MODEL_VIEW)[0], np.zeros(1, BOX)[0]


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
    axes[0, 0], axes[1, 1] = min(axes[0, 0], _AVATAR_HALF_WIDTH), min(axes[1, 1], _AVATAR_HALF_WIDTH)


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
def _is_sphere_far(sphere: Any, camera: Any, reach: float) -> bool:
    """Return whether `_is_near` is false of a thing with this bounding sphere: a quick first test."""
    # The sphere's centre is the caster's, but for rounding.
    x, y, z = float(sphere.x) - camera.x, float(sphere.y) - camera.y, float(sphere.z) - camera.z
    return x * x + y * y + z * z > (reach + _SLACK) * (reach + _SLACK)


@inlined
def _is_box_far(low: Any, high: Any, camera: Any, reach: float) -> bool:
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
    drop = 2.0 * up if up > _SMALL else _DEEPEST + 2.0 * up
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


@inlined
def set_caster(scene: Any, k: int, camera: Any, light: Any, reach: float, caster: Any) -> bool:
    """Write the `CASTER` of a moving thing (instances, then avatars); return whether it may darken what is seen."""
    avatar = k - scene.counts.instances
    caster.is_round = 1 if avatar >= 0 else 0
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
    _set_reach(caster, camera, light)
    return _set_screen_bounds(caster, camera)


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


@kernel
def cast_moving(scene: Any, camera: Any, light: Any, buffers: Any, caster: Any) -> bool:
    """Darken `buffers.sun` and `buffers.contact` where moving things stand between a pixel and the sun or the ground.

    Rigid things cast the shadow of their bounding box, avatars that of an ellipsoid; the longer the light's way
    through it, the darker, which softens the rim. Far casters are passed over. Return whether there were any.
    """
    reach = _shadow_reach(camera)
    # Taken out of their tuples once: that costs as much as a caster that is far away.
    clusters, base, slots = len(scene.cluster_where), buffers.base, buffers.slot
    spheres, lows, highs = scene.instances.sphere, scene.avatars.low, scene.avatars.high
    instances = scene.counts.instances
    started = False
    for k in range(scene.counts.static_instances, instances + scene.counts.avatars):
        if k < instances:
            far = _is_sphere_far(spheres[k], camera, reach)
        else:
            far = _is_box_far(lows[k - instances], highs[k - instances], camera, reach)
        if far or not set_caster(scene, k, camera, light, reach, caster):
            continue
        if not started:
            buffers.sun[:] = np.float32(1.0)
            buffers.contact[:] = np.float32(1.0)
            started = True
        slot = slots[clusters + k]
        own, own_end = 0, 0
        if slot >= 0:
            own, own_end = base[slot], base[slot + 1]
        _darken(camera, buffers, caster, own, own_end)
    return started


@kernel
def _darken(camera: Any, buffers: Any, caster: Any, own: int, own_end: int) -> None:
    """Darken the pixels that one caster may reach, but for its own triangles, `own` to `own_end`.

    In blocks of a fixed length, without branches, in single precision, and on one array: so it becomes vector code.
    """
    # Taken out of their tuple once: that costs as much as a block.
    keys, real, sun, contact = buffers.keys, buffers.real, buffers.sun, buffers.contact
    soft = np.float32(caster.inverse_soft)
    sun_way, is_round, indoors, width = caster.sun, caster.is_round != 0, camera.indoors != 0, camera.width
    first_row, end_row, first_column, end_column = (
        caster.first_row,
        caster.end_row,
        caster.first_column,
        caster.end_column,
    )
    line_a, line_b, line_c = _unit_line(camera, caster, 0), _unit_line(camera, caster, 1), _unit_line(camera, caster, 2)
    height = _line(camera, 0.0, 0.0, 1.0, -caster.foot)
    tallest = np.float32(_TALLEST * caster.half_height)
    for row in range(first_row, end_row):
        for column in range(first_column, end_column, _BLOCK):
            pixel = (row * width + column) & _INDEX
            _unpack_block(keys, pixel, np.uint32(own), np.uint32(own_end), real)
            _lay_line(height, row, column, _ABOVE, real)
            _take_out_unreached(tallest, real)
            _lay_line(line_a, row, column, _UNIT_A, real)
            _lay_line(line_b, row, column, _UNIT_B, real)
            if not indoors:
                _lay_line(line_c, row, column, _UNIT_C, real)
                _shadow_of_block(sun_way, soft, is_round, real)
                _multiply(sun, pixel, end_column - column, real)
            _contact_of_block(is_round, real)
            _multiply(contact, pixel, end_column - column, real)


class _Line(NamedTuple):
    """A coordinate of what is seen: depth times (start + row steps + column steps), plus that of the eye."""

    start: float
    row_step: float
    column_step: float
    eye: Any


@inlined
def _line(camera: Any, x: float, y: float, z: float, offset: float) -> Any:
    """Return the coordinate that is a vector's product with a place in the world, plus `offset`."""
    pixel = 1.0 / camera.focal
    ahead = x * camera.forward_x + y * camera.forward_y + z * camera.forward_z
    aside = (x * camera.right_x + y * camera.right_y + z * camera.right_z) * pixel
    below = (x * camera.down_x + y * camera.down_y + z * camera.down_z) * pixel
    start = ahead + (0.5 - camera.centre_x) * aside + (0.5 - camera.centre_y) * below
    return _Line(start, below, aside, np.float32(x * camera.x + y * camera.y + z * camera.z + offset))


@inlined
def _unit_line(camera: Any, caster: Any, axis: int) -> Any:
    """Return a coordinate in the caster's unit frame."""
    row = caster.to_unit[axis]
    return _line(camera, row[0], row[1], row[2], row[3])


@inlined
def _lay_line(line: Any, row: int, column: int, field: int, real: Any) -> None:
    """Lay a coordinate of a block's pixels into the scratch memory."""
    start, step = np.float32(line.start + row * line.row_step + column * line.column_step), np.float32(line.column_step)
    eye = line.eye
    for i in range(_BLOCK):
        real[field + i] = eye + real[_DEPTH + i] * (start + np.float32(i) * step)


@inlined
def _unpack_block(keys: Any, pixel: Any, own: Any, own_end: Any, real: Any) -> None:
    """Lay depths into the scratch memory, and 1 for what is seen there and is not the caster itself, else 0."""
    for i in range(_BLOCK):
        real[_DEPTH + i] = _ONE / inverse_depth(keys[pixel + i])
    for i in range(_BLOCK):
        number = triangle_number(keys[pixel + i])
        other = (number != np.uint32(0)) & ((number < own) | (number >= own_end))
        real[_REACHED + i] = _ONE if other else _ZERO


@inlined
def _take_out_unreached(tallest: Any, real: Any) -> None:
    """Leave what is too high or too low for the caster's shadow."""
    for i in range(_BLOCK):
        above = real[_ABOVE + i]
        real[_REACHED + i] = real[_REACHED + i] if (above <= tallest) & (above >= -_DEEPEST) else _ZERO


@inlined
def _shadow_of_block(sun: Any, soft: Any, is_round: bool, real: Any) -> None:
    """Lay what the caster leaves of the sun."""
    sun_a, sun_b, sun_c = np.float32(sun[0]), np.float32(sun[1]), np.float32(sun[2])
    if is_round:
        for i in range(_BLOCK):
            shadow = _ball_shadow(real[_UNIT_A + i], real[_UNIT_B + i], real[_UNIT_C + i], sun_a, sun_b, sun_c, soft)
            real[_LEFT + i] = _ONE - shadow * real[_REACHED + i]
    else:
        for i in range(_BLOCK):
            shadow = _box_shadow(real[_UNIT_A + i], real[_UNIT_B + i], real[_UNIT_C + i], sun_a, sun_b, sun_c, soft)
            real[_LEFT + i] = _ONE - shadow * real[_REACHED + i]


@inlined
def _contact_of_block(is_round: bool, real: Any) -> None:
    """Lay what the caster leaves of the light at the ground."""
    if is_round:
        for i in range(_BLOCK):
            dark = _contact_shadow(real[_UNIT_A + i], real[_UNIT_B + i], abs(real[_ABOVE + i]), True)
            real[_LEFT + i] = _ONE - dark * real[_REACHED + i]
    else:
        for i in range(_BLOCK):
            dark = _contact_shadow(real[_UNIT_A + i], real[_UNIT_B + i], abs(real[_ABOVE + i]), False)
            real[_LEFT + i] = _ONE - dark * real[_REACHED + i]


@inlined
def _multiply(light: Any, pixel: Any, count: int, real: Any) -> None:
    """Take the caster's share of light from the first `count` pixels of a block."""
    for i in range(_BLOCK):
        light[pixel + i] *= real[_LEFT + i] if i < count else _ONE


@inlined
def _shadow_of_way(near: Any, far: Any, soft: Any) -> Any:
    """Return how dark it is behind a body that the light goes through from `near` to `far`, 0..1."""
    dark = min(max((far - max(near, _ZERO)) * soft, _ZERO), _ONE)
    return dark * dark * (_THREE - _TWO * dark)


@inlined
def _ball_shadow(a: Any, b: Any, c: Any, sun_a: Any, sun_b: Any, sun_c: Any, soft: Any) -> Any:
    """Return the shadow of the unit ball at a point, all float32."""
    # Distances along the ray at which it enters and leaves the ball; where it misses, both are its nearest point's.
    qa = sun_a * sun_a + sun_b * sun_b + sun_c * sun_c
    qb = a * sun_a + b * sun_b + c * sun_c
    qc = a * a + b * b + c * c - _ONE
    root = np.sqrt(max(qb * qb - qa * qc, _ZERO))
    inverse = _ONE / qa
    return _shadow_of_way((-qb - root) * inverse, (-qb + root) * inverse, soft)


@inlined
def _box_shadow(a: Any, b: Any, c: Any, sun_a: Any, sun_b: Any, sun_c: Any, soft: Any) -> Any:
    """Return the shadow of the box with corners at +-1 at a point, all float32."""
    near_a, far_a = _slab(a, sun_a)
    near_b, far_b = _slab(b, sun_b)
    near_c, far_c = _slab(c, sun_c)
    return _shadow_of_way(max(near_a, near_b, near_c), min(far_a, far_b, far_c), soft)


@inlined
def _slab(place: Any, direction: Any) -> Any:
    """Return where along a ray the layer between -1 and 1 of one axis begins and ends."""
    # A ray along the layer is in it always or never: far apart and of unlike or like signs, as it should be.
    inverse = _ONE / (direction if abs(direction) > _TINY else _TINY)
    t0, t1 = (-_ONE - place) * inverse, (_ONE - place) * inverse
    return min(t0, t1), max(t0, t1)


@inlined
def _contact_shadow(a: Any, b: Any, away: Any, is_round: bool) -> Any:
    """Return how much of the sky a thing hides under and beside it, `away` metres above or below its foot, 0..1."""
    if is_round:
        dark = (_ONE - np.sqrt(a * a + b * b) * np.float32(1.0 / _ROUND_EDGE)) * np.float32(_ROUND_GAIN)
    else:
        dark = (_ONE - max(abs(a), abs(b)) * np.float32(1.0 / _BOX_EDGE)) * np.float32(_BOX_GAIN)
    low = max(_ONE - away * np.float32(1.0 / _CONTACT_HEIGHT), _ZERO)
    return min(max(dark, _ZERO) * low, np.float32(_DARKEST))


@inlined
def _may_box_be_seen(camera: Any, tiles: Any, blocks: Any, box: Any) -> bool:
    return in_view(box, camera) and not is_hidden(box, camera, tiles, blocks)


@kernel
def _may_instance_be_noticed(
    scene: Any, camera: Any, light: Any, coarse: Any, reach: float, caster: Any, model_view: Any, box: Any
) -> bool:
    """Return whether an instance that moves may be seen, or its shadow."""
    spheres, owners, places = scene.instances.sphere, scene.instances.entity, scene.instances.where
    matrices, prototype = scene.instances.matrix, scene.instances.prototype
    lows, highs, tiles, blocks = scene.prototypes.low, scene.prototypes.high, coarse.tiles, coarse.blocks
    for k in range(scene.counts.static_instances, scene.counts.instances):
        if is_instance_in_view(spheres[k], owners[k], places[k], camera):
            set_instance_view(matrices[k], camera, model_view)
            set_box(model_view, lows[prototype[k]], highs[prototype[k]], box)
            if _may_box_be_seen(camera, tiles, blocks, box):
                return True
        if not _is_sphere_far(spheres[k], camera, reach) and set_caster(scene, k, camera, light, reach, caster):
            return True
    return False


@kernel
def _may_avatar_be_noticed(scene: Any, camera: Any, coarse: Any, model_view: Any, box: Any) -> bool:
    """Return whether an avatar may be seen, or its shadow."""
    set_world_view(camera, model_view)
    low, high = np.zeros(3), np.zeros(3)
    lows, highs, tiles, blocks = scene.avatars.low, scene.avatars.high, coarse.tiles, coarse.blocks
    owners, spans, hidden = scene.mesh.entity, scene.avatars.span, camera.hidden_entity
    for k in range(scene.counts.avatars):
        if hidden != 0 and owners[spans[k].first_triangle] == hidden:
            continue
        for axis in range(3):
            low[axis], high[axis] = float(lows[k, axis]), float(highs[k, axis])
        set_box(model_view, low, high, box)
        if _may_box_be_seen(camera, tiles, blocks, box):
            return True
        # The floor around somebody's feet, which is all that they darken in a room.
        for axis in range(2):
            middle = 0.5 * (low[axis] + high[axis])
            half = min(0.5 * (high[axis] - low[axis]), _AVATAR_HALF_WIDTH)
            low[axis], high[axis] = middle - 2.01 * half, middle + 2.01 * half
        low[2], high[2] = low[2] - 0.51, low[2] + 0.51
        set_box(model_view, low, high, box)
        if _may_box_be_seen(camera, tiles, blocks, box):
            return True
    return False
