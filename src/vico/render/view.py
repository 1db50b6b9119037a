"""One camera's pictures in one call of compiled code, which other threads need not wait for the interpreter between."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.render.compiled import inlined, kernel
from vico.render.shading.shade import shade
from vico.render.shadows.moving import NO_SHADOWS, cast_moving
from vico.render.visibility.culling import renew_tiles
from vico.render.visibility.draw import draw_moving, draw_static, mark_changed, write_depth, write_entities


class Kept(NamedTuple):
    """A picture without what moves: parts of `Buffers` after `draw_static`, and its colours.

    Attributes
    ----------
    keys, codes, base, first_triangle
        The first of `Buffers.keys`, ``drawn``, ``base`` and ``first_triangle``, one a drawn item; `base` has one more.
    rgb
        uint8, shape ``(h, w, 3)``; no elements if it has no colours yet.
    """

    keys: NDArray[np.uint64]
    codes: NDArray[np.int32]
    base: NDArray[np.int64]
    first_triangle: NDArray[np.int32]
    rgb: NDArray[np.uint8]


NOTHING_KEPT = Kept(
    np.zeros(0, np.uint64),
    np.zeros(0, np.int32),
    np.zeros(0, np.int64),
    np.zeros(0, np.int32),
    np.zeros((0, 0, 3), np.uint8),
)


class Pictures(NamedTuple):
    """What to write; kinds that are not asked for have no elements.

    Attributes
    ----------
    rgb, depth, segmentation
        uint8, shape ``(h, w, 3)``; float32 and int32, shape ``(h, w)``.
    """

    rgb: NDArray[np.uint8]
    depth: NDArray[np.float32]
    segmentation: NDArray[np.int32]


@kernel
def take(scene: Any, camera: Any, light: Any, buffers: Any, kept: Any, with_moving: bool, caster: Any, out: Any) -> int:
    """Take pictures; return how many items were drawn.

    Parameters
    ----------
    kept
        What never moves, already drawn, or `NOTHING_KEPT`. Where it has colours and `with_moving`, only what differs
        from it is coloured.
    with_moving
        Whether what moves is drawn; without, `Buffers` have the coarse depth of what never does at the end.
    caster
        As from `new_caster`.
    """
    drawn = len(kept.codes)
    if len(kept.keys):
        _lay_kept(kept, buffers)
    else:
        drawn = draw_static(scene, camera, buffers)
    if with_moving:
        drawn = draw_moving(scene, camera, buffers, drawn)
    else:
        renew_tiles(buffers, camera)
    if out.depth.size:
        write_depth(buffers.keys, out.depth)
    if out.segmentation.size:
        write_entities(scene, buffers, drawn, out.segmentation)
    if out.rgb.size:
        darkened = NO_SHADOWS
        if with_moving:
            darkened = cast_moving(scene, camera, light.uniforms, buffers, caster)
        partly = with_moving and kept.rgb.size > 0
        if partly:
            out.rgb[:] = kept.rgb
            mark_changed(buffers, kept.keys, darkened)
        shade(scene, camera, light, buffers, drawn, darkened, partly, out.rgb)
    return drawn


@inlined
def _lay_kept(kept: Any, buffers: Any) -> None:
    buffers.keys[:] = kept.keys
    buffers.drawn[: len(kept.codes)] = kept.codes
    buffers.base[: len(kept.base)] = kept.base
    buffers.first_triangle[: len(kept.codes)] = kept.first_triangle
