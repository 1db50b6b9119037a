"""What moves, as it throws a shadow: where it is, which way the sun is from it, and which pixels it may darken."""

from __future__ import annotations

from typing import Any

import numpy as np

from vico.render.arrays import SHADOWLESS
from vico.render.compiled import inlined, kernel
from vico.render.records import CASTER
from vico.render.shadows.cabins import CABIN_REACH
from vico.render.shadows.people import set_limbs
from vico.render.uniforms import Record

# An avatar's shadow, where it is that of an ellipsoid, is of at most this half width, metres: arms and coats are thin.
AVATAR_HALF_WIDTH = 0.30
# Whoever is as high as this in the picture throws a shadow with arms and legs, pixels.
_LIMB_PIXELS = 24.0
# Lengths of the light's way through an avatar's ball and through a box that make a full shadow, metres; of what is
# thinner, such as a robot's legs, its thinnest side does.
_SOFT_BALL, _SOFT_BOX, _THINNEST = 0.22, 0.5, 0.02
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
