"""Shadows of what moves, worked out on the picture; and whether any of it can be noticed in a room."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

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
# Lengths of the light's way through a unit ball and a unit box that make a full shadow.
_SOFT_BALL, _SOFT_BOX = 0.22, 0.5
# The longest shadow, metres; a sun this low casts no longer ones.
_LONGEST_SHADOW, _LOWEST_SUN = 14.0, 0.08
# Contact shadows: how far from the middle they reach (in half axes), how steeply they grow, how dark at most.
_ROUND_EDGE, _BOX_EDGE, _ROUND_GAIN, _BOX_GAIN, _DARKEST = 2.0, 1.25, 1.5, 4.0, 0.75
# Half the height of the layer at the ground in which they lie, metres.
_CONTACT_HEIGHT = 0.5
# Nothing is darkened further below a caster's foot than this, metres.
_DEEPEST = 6.0


class CoarseDepth(NamedTuple):
    """Farthest depths of a picture's tiles and of blocks of tiles, as in `Buffers`."""

    tiles: NDArray[np.uint32]
    blocks: NDArray[np.uint32]


def new_caster() -> Record:
    """Return an empty `CASTER` record."""
    return np.zeros(1, CASTER)[0]


def is_disturbed(scene: Any, camera: Record, light: Record, coarse: CoarseDepth, reach: float) -> bool:
    """Return whether a moving thing may be seen in a room, or darken something that is.

    `coarse` is the depth of the room without such things: what lies behind all of it is hidden.
    """
    model_view, box = np.zeros(1, MODEL_VIEW)[0], np.zeros(1, BOX)[0]
    return bool(
        _may_instance_be_noticed(scene, camera, light, coarse, reach, new_caster(), model_view, box)
        or _may_avatar_be_noticed(scene, camera, coarse, model_view, box)
    )


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
    throw = 0.0 if indoors else min(2.0 * up / max(sz, _LOWEST_SUN), _LONGEST_SHADOW)
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
    if not _set_unit_frame(caster, light):
        return False
    _set_reach(caster, camera, light)
    return _set_screen_bounds(caster, camera)


@inlined
def is_avatar_hidden(scene: Any, avatar: int, camera: Any) -> bool:
    """Return whether an avatar is the body that the camera does not see."""
    return (
        camera.hidden_entity != 0
        and scene.mesh.entity[scene.avatars.span[avatar].first_triangle] == camera.hidden_entity
    )


@kernel
def cast_moving(scene: Any, camera: Any, light: Any, buffers: Any, reach: float, caster: Any) -> bool:
    """Darken `buffers.sun` and `buffers.contact` where moving things stand between a pixel and the sun or the ground.

    Rigid things cast the shadow of their bounding box, avatars that of an ellipsoid; the longer the light's way
    through it, the darker, which softens the rim. Only casters within `reach` metres are taken. Return whether there
    were any.
    """
    clusters, base, slots = len(scene.cluster_where), buffers.base, buffers.slot
    started = False
    for k in range(scene.counts.static_instances, scene.counts.instances + scene.counts.avatars):
        if not set_caster(scene, k, camera, light, reach, caster):
            continue
        if not started:
            buffers.sun[:] = np.float32(1.0)
            buffers.contact[:] = np.float32(1.0)
            started = True
        slot = slots[clusters + k]
        own, own_end = 0, 0
        if slot >= 0:
            own, own_end = base[slot], base[slot + 1]
        _darken(camera, buffers.keys, caster, own, own_end, buffers.sun, buffers.contact)
    return started


@kernel
def _darken(camera: Any, keys: Any, caster: Any, own: int, own_end: int, sun: Any, contact: Any) -> None:
    """Darken the pixels that one caster may reach, but for its own triangles, `own` to `own_end`."""
    pixel = 1.0 / camera.focal
    to_unit, indoors = caster.to_unit, camera.indoors != 0
    up, foot, is_round = caster.half_height, caster.foot, caster.is_round != 0
    for row in range(caster.first_row, caster.end_row):
        cv = (row + 0.5 - camera.centre_y) * pixel
        for column in range(caster.first_column, caster.end_column):
            at = row * camera.width + column
            number = int(triangle_number(keys[at]))
            if number == 0 or own <= number < own_end:
                continue
            depth = 1.0 / inverse_depth(keys[at])
            cu = (column + 0.5 - camera.centre_x) * pixel
            x = camera.x + depth * (camera.forward_x + cu * camera.right_x + cv * camera.down_x)
            y = camera.y + depth * (camera.forward_y + cu * camera.right_y + cv * camera.down_y)
            z = camera.z + depth * (camera.forward_z + cu * camera.right_z + cv * camera.down_z)
            if z > foot + 2.2 * up or z < foot - _DEEPEST:
                continue
            a = to_unit[0, 0] * x + to_unit[0, 1] * y + to_unit[0, 2] * z + to_unit[0, 3]
            b = to_unit[1, 0] * x + to_unit[1, 1] * y + to_unit[1, 2] * z + to_unit[1, 3]
            c = to_unit[2, 0] * x + to_unit[2, 1] * y + to_unit[2, 2] * z + to_unit[2, 3]
            if not indoors:
                shadow = _ball_shadow(a, b, c, caster.sun) if is_round else _box_shadow(a, b, c, caster.sun)
                sun[at] *= np.float32(1.0 - shadow)
            if abs(z - foot) < _CONTACT_HEIGHT:
                contact[at] *= np.float32(1.0 - _contact_shadow(a, b, abs(z - foot), is_round))


@inlined
def _shadow_of_way(near: float, far: float, soft: float) -> float:
    """Return how dark it is behind a body that the light goes through from `near` to `far`, 0..1."""
    way = far - max(near, 0.0)
    if far > 0.0 and way > 0.0:
        dark = min(way / soft, 1.0)
        return dark * dark * (3.0 - 2.0 * dark)
    return 0.0


@inlined
def _ball_shadow(a: float, b: float, c: float, sun: Any) -> float:
    """Return the shadow of the unit ball at a point."""
    # Distances along the ray at which it enters and leaves the ball.
    qa = sun[0] * sun[0] + sun[1] * sun[1] + sun[2] * sun[2]
    qb = a * sun[0] + b * sun[1] + c * sun[2]
    qc = a * a + b * b + c * c - 1.0
    root = qb * qb - qa * qc
    if root <= 0.0:
        return 0.0
    root = np.sqrt(root)
    return _shadow_of_way((-qb - root) / qa, (-qb + root) / qa, _SOFT_BALL)


@inlined
def _box_shadow(a: float, b: float, c: float, sun: Any) -> float:
    """Return the shadow of the box with corners at +-1 at a point."""
    near, far = -1e30, 1e30
    for axis in range(3):
        o = a if axis == 0 else (b if axis == 1 else c)
        d = sun[axis]
        if abs(d) < 1e-9:
            if abs(o) > 1.0:
                far = -1e30
        else:
            t0, t1 = (-1.0 - o) / d, (1.0 - o) / d
            near, far = max(near, min(t0, t1)), min(far, max(t0, t1))
    return _shadow_of_way(near, far, _SOFT_BOX)


@inlined
def _contact_shadow(a: float, b: float, away: float, is_round: bool) -> float:
    """Return how much of the sky a thing hides under and beside it, `away` metres above or below its foot, 0..1."""
    spread = np.sqrt(a * a + b * b) if is_round else max(abs(a), abs(b))
    edge = _ROUND_EDGE if is_round else _BOX_EDGE
    if spread >= edge:
        return 0.0
    dark = (1.0 - spread / edge) * (1.0 - away * 2.0)
    return min(dark * (_ROUND_GAIN if is_round else _BOX_GAIN), _DARKEST)


@inlined
def _may_box_be_seen(camera: Any, coarse: Any, box: Any) -> bool:
    return in_view(box, camera) and not is_hidden(box, camera, coarse.tiles, coarse.blocks)


@kernel
def _may_instance_be_noticed(
    scene: Any, camera: Any, light: Any, coarse: Any, reach: float, caster: Any, model_view: Any, box: Any
) -> bool:
    """Return whether an instance that moves may be seen, or its shadow."""
    spheres, owners, places = scene.instances.sphere, scene.instances.entity, scene.instances.where
    matrices, prototype = scene.instances.matrix, scene.instances.prototype
    lows, highs = scene.prototypes.low, scene.prototypes.high
    for k in range(scene.counts.static_instances, scene.counts.instances):
        if is_instance_in_view(spheres[k], owners[k], places[k], camera):
            set_instance_view(matrices[k], camera, model_view)
            set_box(model_view, lows[prototype[k]], highs[prototype[k]], box)
            if _may_box_be_seen(camera, coarse, box):
                return True
        if set_caster(scene, k, camera, light, reach, caster):
            return True
    return False


@kernel
def _may_avatar_be_noticed(scene: Any, camera: Any, coarse: Any, model_view: Any, box: Any) -> bool:
    """Return whether an avatar may be seen, or its shadow."""
    set_world_view(camera, model_view)
    low, high = np.zeros(3), np.zeros(3)
    for k in range(scene.counts.avatars):
        if is_avatar_hidden(scene, k, camera):
            continue
        for axis in range(3):
            low[axis], high[axis] = float(scene.avatars.low[k, axis]), float(scene.avatars.high[k, axis])
        set_box(model_view, low, high, box)
        if _may_box_be_seen(camera, coarse, box):
            return True
        # The floor around somebody's feet, which is all that they darken in a room.
        for axis in range(2):
            middle = 0.5 * (low[axis] + high[axis])
            half = min(0.5 * (high[axis] - low[axis]), _AVATAR_HALF_WIDTH)
            low[axis], high[axis] = middle - 2.01 * half, middle + 2.01 * half
        low[2], high[2] = low[2] - 0.51, low[2] + 0.51
        set_box(model_view, low, high, box)
        if _may_box_be_seen(camera, coarse, box):
            return True
    return False
