"""Whether anything that moves can be noticed in a room: else a picture of it that is kept still holds."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.render.compiled import inlined, kernel
from vico.render.records import BOX, MODEL_VIEW
from vico.render.shadows.casters import AVATAR_HALF_WIDTH, is_sphere_far, new_caster, set_caster, shadow_reach
from vico.render.uniforms import Record
from vico.render.visibility.culling import (
    in_view,
    is_hidden,
    is_instance_in_view,
    set_box,
    set_instance_view,
    set_world_view,
)


class CoarseDepth(NamedTuple):
    """Farthest depths of a picture's tiles and of blocks of tiles, as in `Buffers`."""

    tiles: NDArray[np.uint32]
    blocks: NDArray[np.uint32]


@kernel
def is_disturbed(scene: Any, camera: Any, light: Any, coarse: Any, scratch: Any) -> bool:
    """Return whether a moving thing may be seen in a room, or darken something that is.

    `coarse`, a `CoarseDepth`, is that of the room without such things: what lies behind all of it is hidden. `scratch`
    is as from `new_scratch`.
    """
    caster, model_view, box = scratch
    reach = shadow_reach(camera)
    if _may_instance_be_noticed(scene, camera, light, coarse, reach, caster, model_view, box):
        return True
    return bool(_may_avatar_be_noticed(scene, camera, coarse, model_view, box))


def new_scratch() -> tuple[Record, Record, Record]:
    """Return empty `CASTER`, `MODEL_VIEW` and `BOX` records."""
    return new_caster(), np.zeros(1, MODEL_VIEW)[0], np.zeros(1, BOX)[0]


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
        if not is_sphere_far(spheres[k], camera, reach) and set_caster(scene, k, camera, light, reach, caster):
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
            half = min(0.5 * (high[axis] - low[axis]), AVATAR_HALF_WIDTH)
            low[axis], high[axis] = middle - 2.01 * half, middle + 2.01 * half
        low[2], high[2] = low[2] - 0.51, low[2] + 0.51
        set_box(model_view, low, high, box)
        if _may_box_be_seen(camera, tiles, blocks, box):
            return True
    return False
