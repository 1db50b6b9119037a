"""Shadows of what moves, worked out on the picture."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from vico.render.arrays import PAD, STRIDE
from vico.render.compiled import inlined, kernel
from vico.render.shadows.casters import (
    DEEPEST,
    INSIDE,
    TALLEST,
    UNDER_ROOF,
    instance_reach,
    is_box_far,
    limb_shadow,
    set_caster,
    shadow_reach,
    sun_in_cabin,
)
from vico.render.visibility.rasteriser import inverse_depth, triangle_number

# Contact shadows: how far from the middle they reach, half axes; how steeply they grow; how dark they are at most.
_ROUND_EDGE = 2.0
_BOX_EDGE = 1.25
_ROUND_GAIN = 1.5
_BOX_GAIN = 4.0
_DARKEST = 0.75
# Half the height of the layer at the ground in which they lie, metres.
_CONTACT_HEIGHT = 0.5
_ZERO, _ONE, _TWO, _THREE, _TINY = (np.float32(value) for value in (0.0, 1.0, 2.0, 3.0, 1e-9))
# Pixels that are looked at together, and the fields of the scratch memory of a block.
_BLOCK = PAD
# A pixel's number, masked so that the compiler knows it is not negative.
_INDEX = 0x7FFFFFFF
_DEPTH, _REACHED, _ABOVE, _UNIT_A, _UNIT_B, _UNIT_C, _LEFT = (k * STRIDE for k in range(7))


# What `cast_moving` found.
NO_SHADOWS = 0
SHADOWS = 1
CABINS = 2  # insides of vehicles as well


@kernel
def cast_moving(scene: Any, camera: Any, light: Any, buffers: Any, caster: Any) -> int:
    """Darken `buffers.sun` and `buffers.contact` where moving things stand between a pixel and the sun or the ground.

    Rigid things cast the shadow of their bounding box; the longer the light's way through it, the darker, which
    softens the rim. Avatars cast that of their limbs, far ones that of an ellipsoid. What is far is passed over. What
    is in a vehicle with windows gets the sun by these; `buffers.inside` tells where that is. Return NO_SHADOWS, SHADOWS
    or CABINS.
    """
    reach = shadow_reach(camera)
    # Taken out of their tuples once: that costs as much as a caster that is far away.
    clusters, base, slots = len(scene.cluster_where), buffers.base, buffers.slot
    spheres, models, cabin_of = scene.instances.sphere, scene.instances.prototype, scene.prototypes.cabin
    lows, highs, cabins = scene.avatars.low, scene.avatars.high, scene.prototypes.cabins
    instances = scene.counts.instances
    found = NO_SHADOWS
    for k in range(scene.counts.static_instances, instances + scene.counts.avatars):
        within = reach
        if k < instances:
            within = instance_reach(spheres[k], cabin_of[models[k]], camera, reach)
            far = within == 0.0
        else:
            far = is_box_far(lows[k - instances], highs[k - instances], camera, reach)
        if far or not set_caster(scene, k, camera, light, within, caster):
            continue
        if found == NO_SHADOWS:
            buffers.sun[:] = np.float32(1.0)
            buffers.contact[:] = np.float32(1.0)
            found = SHADOWS
        slot = slots[clusters + k]
        own, own_end = 0, 0
        if slot >= 0:
            own, own_end = base[slot], base[slot + 1]
        if caster.limb_count > 0:
            _darken_by_limbs(camera, buffers, caster, own, own_end)
        elif caster.cabin >= 0:
            if found != CABINS:
                buffers.inside[:] = np.float32(0.0)
                found = CABINS
            _darken_with_cabin(camera, buffers, caster, cabins[caster.cabin], own, own_end)
        else:
            _darken(camera, buffers, caster, own, own_end)
    return found


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
    line_a, line_b, line_c = _unit_lines(camera, caster)
    foot = _foot_of(camera, caster)
    for row in range(first_row, end_row):
        for column in range(first_column, end_column, _BLOCK):
            pixel = (row * width + column) & _INDEX
            _unpack_block(keys, pixel, np.uint32(own), np.uint32(own_end), real)
            _keep_reached(foot, row, column, real)
            _lay_line(line_a, row, column, _UNIT_A, real)
            _lay_line(line_b, row, column, _UNIT_B, real)
            if not indoors:
                _lay_line(line_c, row, column, _UNIT_C, real)
                _shadow_of_block(sun_way, soft, is_round, real)
                _multiply(sun, pixel, end_column - column, real)
            _contact_of_block(is_round, real)
            _multiply(contact, pixel, end_column - column, real)


@kernel
def _darken_with_cabin(camera: Any, buffers: Any, caster: Any, cabin: Any, own: int, own_end: int) -> None:
    """Darken the pixels that a vehicle with windows may reach, as `_darken` does, and its inside by its roof."""
    keys, real, sun, contact, inside = buffers.keys, buffers.real, buffers.sun, buffers.contact, buffers.inside
    soft = np.float32(caster.inverse_soft)
    sun_way, width, first_column, end_column = caster.sun, camera.width, caster.first_column, caster.end_column
    line_a, line_b, line_c = _unit_lines(camera, caster)
    foot = _foot_of(camera, caster)
    for row in range(caster.first_row, caster.end_row):
        for column in range(first_column, end_column, _BLOCK):
            pixel = (row * width + column) & _INDEX
            _unpack_block(keys, pixel, np.uint32(own), np.uint32(own_end), real)
            _keep_reached(foot, row, column, real)
            _lay_line(line_a, row, column, _UNIT_A, real)
            _lay_line(line_b, row, column, _UNIT_B, real)
            _lay_line(line_c, row, column, _UNIT_C, real)
            _shadow_of_block(sun_way, soft, False, real)
            sun_in_cabin(cabin, sun_way, real)
            _multiply(sun, pixel, end_column - column, real)
            _contact_of_block(False, real)
            for i in range(_BLOCK):
                real[_LEFT + i] = UNDER_ROOF if real[INSIDE + i] > _ZERO else real[_LEFT + i]
            _multiply(contact, pixel, end_column - column, real)
            for i in range(_BLOCK):
                inside[pixel + i] = max(inside[pixel + i], real[INSIDE + i] if i < end_column - column else _ZERO)


@kernel
def _darken_by_limbs(camera: Any, buffers: Any, caster: Any, own: int, own_end: int) -> None:
    """Darken the pixels that an avatar with limbs may reach, as `_darken` does."""
    keys, real, sun, contact = buffers.keys, buffers.real, buffers.sun, buffers.contact
    width, first_column, end_column = camera.width, caster.first_column, caster.end_column
    area, limbs, count = caster.area, caster.limbs, caster.limb_count
    across, upward, along = _sun_line(camera, caster, 0), _sun_line(camera, caster, 1), _sun_line(camera, caster, 2)
    line_a, line_b = _unit_line(camera, caster, 0), _unit_line(camera, caster, 1)
    foot = _foot_of(camera, caster)
    for row in range(caster.first_row, caster.end_row):
        for column in range(first_column, end_column, _BLOCK):
            pixel = (row * width + column) & _INDEX
            _unpack_block(keys, pixel, np.uint32(own), np.uint32(own_end), real)
            _keep_reached(foot, row, column, real)
            _lay_line(across, row, column, _UNIT_A, real)
            _lay_line(upward, row, column, _UNIT_B, real)
            # Most of a low sun's long shadow's rectangle is not in it.
            if not _is_any_within(area, real):
                continue
            _lay_line(along, row, column, _UNIT_C, real)
            _shadow_of_limbs(limbs, count, real)
            _multiply(sun, pixel, end_column - column, real)
            _lay_line(line_a, row, column, _UNIT_A, real)
            _lay_line(line_b, row, column, _UNIT_B, real)
            _contact_of_block(True, real)
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
def _unit_lines(camera: Any, caster: Any) -> Any:
    """Return the three coordinates in the caster's unit frame."""
    return _unit_line(camera, caster, 0), _unit_line(camera, caster, 1), _unit_line(camera, caster, 2)


@inlined
def _foot_of(camera: Any, caster: Any) -> Any:
    """Return the coordinate of height above a caster's foot, and up to which height it darkens."""
    return _line(camera, 0.0, 0.0, 1.0, -caster.foot), np.float32(TALLEST * caster.half_height)


@inlined
def _keep_reached(foot: Any, row: int, column: int, real: Any) -> None:
    """Take out of a block what is higher than a caster darkens; `foot` is of `_foot_of`."""
    _lay_line(foot[0], row, column, _ABOVE, real)
    _take_out_unreached(foot[1], real)


@inlined
def _sun_line(camera: Any, caster: Any, axis: int) -> Any:
    """Return a coordinate in the frame that limbs' shadows are told in."""
    row = caster.sun_frame[axis]
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
        real[_REACHED + i] = real[_REACHED + i] if (above <= tallest) & (above >= -DEEPEST) else _ZERO


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
def _is_any_within(area: Any, real: Any) -> bool:
    """Return whether a caster may reach any pixel of a block."""
    p0, p1, q0, q1 = area[0], area[1], area[2], area[3]
    found = 0
    for i in range(_BLOCK):
        p, q = real[_UNIT_A + i], real[_UNIT_B + i]
        within = (p >= p0) & (p <= p1) & (q >= q0) & (q <= q1) & (real[_REACHED + i] > _ZERO)
        found |= 1 if within else 0
    return found != 0


@inlined
def _shadow_of_limbs(limbs: Any, count: int, real: Any) -> None:
    """Lay what an avatar's limbs leave of the sun."""
    for i in range(_BLOCK):
        real[_LEFT + i] = _ZERO
    for k in range(count):
        limb = limbs[k]
        for i in range(_BLOCK):
            dark = limb_shadow(limb, real[_UNIT_A + i], real[_UNIT_B + i], real[_UNIT_C + i])
            real[_LEFT + i] = max(real[_LEFT + i], dark)
    for i in range(_BLOCK):
        dark = real[_LEFT + i]
        real[_LEFT + i] = _ONE - dark * dark * (_THREE - _TWO * dark) * real[_REACHED + i]


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
