"""One camera's pictures in one call of compiled code, and what is kept of the last ones.

Other threads need not wait for the interpreter between. Where nothing has changed the last picture is copied, else what
moves is drawn anew. A kept picture of a room holds while nothing that moves can be noticed there.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.render.arrays import Buffers
from vico.render.compiled import inlined, kernel
from vico.render.records import BOX, MODEL_VIEW
from vico.render.scene import Scene
from vico.render.shading.shade import shade
from vico.render.shadows.casters import AVATAR_HALF_WIDTH, is_sphere_far, new_caster, set_caster, shadow_reach
from vico.render.shadows.moving import NO_SHADOWS, cast_moving
from vico.render.uniforms import Light, Record
from vico.render.visibility.culling import (
    in_view,
    is_hidden,
    is_instance_in_view,
    renew_tiles,
    set_box,
    set_instance_view,
    set_world_view,
)
from vico.render.visibility.draw import draw_moving, draw_static, mark_changed, write_depth, write_entities


class StaticPicture(NamedTuple):
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


NO_STATIC_PICTURE = StaticPicture(
    np.zeros(0, np.uint64),
    np.zeros(0, np.int32),
    np.zeros(0, np.int64),
    np.zeros(0, np.int32),
    np.zeros((0, 0, 3), np.uint8),
)


class ViewOutputs(NamedTuple):
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
def render_view(
    scene: Any, camera: Any, light: Any, buffers: Any, kept: Any, with_moving: bool, caster: Any, out: Any
) -> int:
    """Take pictures; return how many items were drawn.

    Parameters
    ----------
    kept
        What never moves, already drawn, or `NO_STATIC_PICTURE`. Where it has colours and `with_moving`, only what
        differs from it is coloured.
    with_moving
        Whether what moves is drawn; without, `Buffers` have the coarse depth of what never does at the end.
    caster
        As from `new_caster`.
    """
    drawn = len(kept.codes)
    if len(kept.keys):
        _copy_static_picture(kept, buffers)
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
def _copy_static_picture(kept: Any, buffers: Any) -> None:
    buffers.keys[:] = kept.keys
    buffers.drawn[: len(kept.codes)] = kept.codes
    buffers.base[: len(kept.base)] = kept.base
    buffers.first_triangle[: len(kept.codes)] = kept.first_triangle


class CoarseDepth(NamedTuple):
    """Farthest depths of a picture's tiles and of blocks of tiles, as in `Buffers`."""

    tiles: NDArray[np.uint32]
    blocks: NDArray[np.uint32]


@kernel
def is_motion_noticeable(scene: Any, camera: Any, light: Any, coarse: Any, scratch: Any) -> bool:
    """Return whether a moving thing may be seen in a room, or darken something that is.

    `coarse`, a `CoarseDepth`, is that of the room without such things: what lies behind all of it is hidden. `scratch`
    is empty `CASTER`, `MODEL_VIEW` and `BOX` records.
    """
    caster, model_view, box = scratch
    reach = shadow_reach(camera)
    if _may_instance_be_noticed(scene, camera, light, coarse, reach, caster, model_view, box):
        return True
    return bool(_may_avatar_be_noticed(scene, camera, coarse, model_view, box))


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


class ViewCache:
    """What each camera of a batch saw last, so that only what has changed is rendered again.

    Of a camera that stands still, what never moves is kept with its colours; only what moves is drawn and shaded, and
    what lies in its shadow. In a room where nothing that moves comes into sight or darkens anything, the picture is
    copied. Either equals a new picture bit for bit.

    Parameters
    ----------
    deferred
        `render` returns at once, and lets threads work on the pictures. They must not be read, nor the scene be
        changed, before `Frames.wait`.

    Attributes
    ----------
    hits
        How many views were copied so far.
    """

    def __init__(self, *, deferred: bool = False) -> None:
        self.deferred = deferred
        self.hits = 0
        self._last: dict[int, bytes] = {}
        self._known: dict[int, Background] = {}

    def was_quick(self, k: int) -> bool:
        """Return whether something of camera `k`'s last view was kept: the next one may well take little time."""
        return k in self._known

    def background(self, k: int, scene: Scene, camera: Record) -> Background | None:
        """Return what is kept of camera `k`'s view, to be made by its first `Background.take`.

        None where nothing is worth keeping: out of doors, before a camera has stood still for one call.
        """
        of = camera.tobytes()
        stands, self._last[k] = self._last.get(k) == of, of
        known = self._known.get(k)
        if known is not None and known.of == (of, scene.version):
            return known
        self._known.pop(k, None)
        if not stands and not camera["indoors"]:
            return None
        self._known[k] = Background((of, scene.version))
        return self._known[k]


@dataclass
class Background:
    """What a camera sees of all that never moves.

    Attributes
    ----------
    of
        Camera and version of the scene.
    """

    of: tuple[bytes, int]
    _kept: StaticPicture = NO_STATIC_PICTURE
    _coarse: CoarseDepth | None = None
    _segmentation: NDArray[np.int32] = field(default_factory=lambda: np.zeros((0, 0), np.int32))
    _light: Light | None = None

    def take(self, scene: Scene, camera: Record, light: Light, buffers: Buffers, out: ViewOutputs) -> bool:
        """Take pictures of a camera, as little as possible being done anew; return whether they were but copied."""
        scratch = new_caster(), np.zeros(1, MODEL_VIEW)[0], np.zeros(1, BOX)[0]
        if self._is_all(scene, camera, light, scratch):
            self._copy_to(out)
            return True
        caster = scratch[0]
        if not self._is_lit(camera, light) or self._kept.rgb.shape != out.rgb.shape:
            self._set(scene, camera, light, buffers, np.empty_like(out.rgb), caster)
        render_view(scene.arrays, camera, light, buffers, self._kept, True, caster, out)
        return False

    def _is_all(self, scene: Scene, camera: Record, light: Light, scratch: tuple[Record, Record, Record]) -> bool:
        """Return whether it is the whole picture: in a room, if nothing that moves can be noticed."""
        if self._coarse is None or not self._is_lit(camera, light) or not camera["indoors"]:
            return False
        return not is_motion_noticeable(scene.arrays, camera, light.uniforms, self._coarse, scratch)

    def _copy_to(self, out: ViewOutputs) -> None:
        out.rgb[...] = self._kept.rgb
        if out.depth.size:
            write_depth(self._kept.keys, out.depth)
        if out.segmentation.size:
            out.segmentation[...] = self._segmentation

    def _set(
        self, scene: Scene, camera: Record, light: Light, buffers: Buffers, rgb: NDArray[np.uint8], caster: Record
    ) -> None:
        """Draw what never moves, if it isn't drawn yet, and colour it."""
        kept = self._kept._replace(rgb=NO_STATIC_PICTURE.rgb)
        segmentation = np.empty((rgb.shape[:2]) if self._coarse is None else (0, 0), np.int32)
        out = ViewOutputs(rgb, np.zeros((0, 0), np.float32), segmentation)
        drawn = render_view(scene.arrays, camera, light, buffers, kept, False, caster, out)
        self._light = light
        if self._coarse is not None:
            self._kept = kept._replace(rgb=rgb)
            return
        self._coarse, self._segmentation = CoarseDepth(buffers.tiles.copy(), buffers.blocks.copy()), segmentation
        self._kept = StaticPicture(
            buffers.keys.copy(),
            buffers.drawn[:drawn].copy(),
            buffers.base[: drawn + 1].copy(),
            buffers.first_triangle[:drawn].copy(),
            rgb,
        )

    def _is_lit(self, camera: Record, light: Light) -> bool:
        """Return whether the colours are those of this light; the camera says how a room is lit."""
        return self._light is light or (self._light is not None and bool(camera["indoors"]))
