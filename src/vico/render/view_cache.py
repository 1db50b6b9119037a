"""What stays of a camera's last picture: where nothing has changed it is copied, else what moves is drawn anew."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from vico.render.arrays import Buffers, buffers_for
from vico.render.scene import Scene
from vico.render.shading.light import Light
from vico.render.shadows.notice import CoarseDepth, is_disturbed, new_scratch
from vico.render.uniforms import Record
from vico.render.view import NOTHING_KEPT, Kept, Pictures, take
from vico.render.visibility.draw import write_depth


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
    _kept: Kept = NOTHING_KEPT
    _coarse: CoarseDepth | None = None
    _segmentation: NDArray[np.int32] = field(default_factory=lambda: np.zeros((0, 0), np.int32))
    _light: Light | None = None

    def take(self, scene: Scene, camera: Record, light: Light, buffers: Buffers, out: Pictures) -> bool:
        """Take pictures of a camera, as little as possible being done anew; return whether they were but copied."""
        scratch = new_scratch()
        if self._is_all(scene, camera, light, scratch):
            self._copy_to(out)
            return True
        caster = scratch[0]
        if not self._is_lit(camera, light) or self._kept.rgb.shape != out.rgb.shape:
            self._set(scene, camera, light, buffers, np.empty_like(out.rgb), caster)
        take(scene.arrays, camera, light, buffers, self._kept, True, caster, out)
        return False

    def _is_all(self, scene: Scene, camera: Record, light: Light, scratch: tuple[Record, Record, Record]) -> bool:
        """Return whether it is the whole picture: in a room, if nothing that moves can be noticed."""
        if self._coarse is None or not self._is_lit(camera, light) or not camera["indoors"]:
            return False
        return not is_disturbed(scene.arrays, camera, light.uniforms, self._coarse, scratch)

    def _copy_to(self, out: Pictures) -> None:
        out.rgb[...] = self._kept.rgb
        if out.depth.size:
            write_depth(self._kept.keys, out.depth)
        if out.segmentation.size:
            out.segmentation[...] = self._segmentation

    def _set(
        self, scene: Scene, camera: Record, light: Light, buffers: Buffers, rgb: NDArray[np.uint8], caster: Record
    ) -> None:
        """Draw what never moves, if it isn't drawn yet, and colour it."""
        kept = self._kept._replace(rgb=NOTHING_KEPT.rgb)
        segmentation = np.empty((rgb.shape[:2]) if self._coarse is None else (0, 0), np.int32)
        out = Pictures(rgb, np.zeros((0, 0), np.float32), segmentation)
        drawn = take(scene.arrays, camera, light, buffers, kept, False, caster, out)
        self._light = light
        if self._coarse is not None:
            self._kept = kept._replace(rgb=rgb)
            return
        self._coarse, self._segmentation = CoarseDepth(buffers.tiles.copy(), buffers.blocks.copy()), segmentation
        self._kept = Kept(
            buffers.keys.copy(),
            buffers.drawn[:drawn].copy(),
            buffers.base[: drawn + 1].copy(),
            buffers.first_triangle[:drawn].copy(),
            rgb,
        )

    def _is_lit(self, camera: Record, light: Light) -> bool:
        """Return whether the colours are those of this light; the camera says how a room is lit."""
        return self._light is light or (self._light is not None and bool(camera["indoors"]))


def fitting_buffers(known: Buffers | None, scene: Scene, width: int, height: int) -> Buffers:
    """Return the same scratch memory, or new one where the pictures are others or the scene has grown."""
    if known is not None and known.fit(scene.arrays, width, height):
        return known
    return buffers_for(scene.arrays, width, height)
