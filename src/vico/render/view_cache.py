"""What stays of a camera's last picture: where nothing has changed it is copied, else what moves is drawn anew."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from vico.render.arrays import Buffers, buffers_for
from vico.render.scene import Scene
from vico.render.shading.light import Light
from vico.render.shading.shade import shade
from vico.render.shadows.moving import CoarseDepth, cast_moving, is_disturbed, new_caster
from vico.render.uniforms import Record
from vico.render.visibility.culling import renew_tiles
from vico.render.visibility.draw import draw_moving, draw_static, mark_changed, write_depth, write_entities

_MOVING_SHADOW_METRES = 70.0


class ViewCache:
    """What each camera of a batch saw last, so that only what has changed is rendered again.

    Of a camera that stands still, what never moves is kept with its colours; only what moves is drawn and shaded, and
    what lies in its shadow. In a room where nothing that moves comes into sight or darkens anything, the picture is
    copied. Either equals a new picture bit for bit.

    Parameters
    ----------
    defer_rgb
        `render` returns when depth and segmentation are there, and lets threads work on RGB. It must not be read, nor
        the scene be changed, before `Frames.wait`.

    Attributes
    ----------
    hits
        How many views were copied so far.
    """

    def __init__(self, *, defer_rgb: bool = False) -> None:
        self.defer_rgb = defer_rgb
        self.hits = 0
        self._last: dict[int, bytes] = {}
        self._known: dict[int, Background] = {}
        self._buffers: dict[int, Buffers] = {}

    def buffers(self, k: int, scene: Scene, width: int, height: int) -> Buffers:
        """Return scratch memory that stays camera `k`'s until its RGB is there."""
        self._buffers[k] = fitting_buffers(self._buffers.get(k), scene, width, height)
        return self._buffers[k]

    def background(self, k: int, scene: Scene, camera: Record) -> Background | None:
        """Return what is kept of camera `k`'s view, to be made by its first `Background.draw`.

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
    _parts: _Parts | None = None
    _light: Light | None = None
    _rgb: NDArray[np.uint8] = field(default_factory=lambda: np.zeros(0, np.uint8))

    def is_all(self, scene: Scene, camera: Record, light: Light) -> bool:
        """Return whether it is the whole picture: in a room, if nothing that moves can be noticed."""
        if self._parts is None or not self._is_lit(camera, light) or not camera["indoors"]:
            return False
        return not is_disturbed(scene.arrays, camera, light.uniforms, self._parts.coarse, shadow_reach(camera))

    def copy_to(self, rgb: NDArray[np.uint8], depth: NDArray[np.float32], segmentation: NDArray[np.int32]) -> None:
        """Copy the pictures, kinds that are not asked for being empty."""
        assert self._parts is not None
        rgb[...] = self._rgb
        if depth.size:
            write_depth(self._parts.keys, depth)
        if segmentation.size:
            segmentation[...] = self._parts.segmentation

    def draw(self, scene: Scene, camera: Record, buffers: Buffers) -> int:
        """Do as `vico.render.visibility.draw.draw`, what never moves being drawn only once."""
        if self._parts is None:
            self._parts = _drawn_parts(scene, camera, buffers)
        else:
            self._parts.copy_to(buffers)
        drawn: int = draw_moving(scene.arrays, camera, buffers, self._parts.drawn)
        return drawn

    def shade(
        self, scene: Scene, camera: Record, light: Light, buffers: Buffers, drawn: int, rgb: NDArray[np.uint8]
    ) -> None:
        """Colour what `draw` left, only where it is not what never moves in its own light."""
        assert self._parts is not None
        keys = self._parts.keys
        if not self._is_lit(camera, light) or self._rgb.shape != rgb.shape:
            self._rgb = np.empty_like(rgb)
            alone = buffers._replace(keys=keys)
            shade(scene.arrays, camera, light, alone, self._parts.drawn, False, False, self._rgb)
            self._light = light
        rgb[...] = self._rgb
        moving = cast_moving(scene.arrays, camera, light.uniforms, buffers, shadow_reach(camera), new_caster())
        mark_changed(buffers, keys, moving)
        shade(scene.arrays, camera, light, buffers, drawn, moving, True, rgb)

    def _is_lit(self, camera: Record, light: Light) -> bool:
        """Return whether the colours are those of this light; rooms have lamps of their own, always the same."""
        return self._light is light or (self._light is not None and bool(camera["indoors"]))


@dataclass(frozen=True)
class _Parts:
    """A picture without what moves: parts of `Buffers` after `draw_static`, how many items were drawn, its entities."""

    drawn: int
    keys: NDArray[np.uint64]
    codes: NDArray[np.int32]
    base: NDArray[np.int64]
    first_triangle: NDArray[np.int32]
    coarse: CoarseDepth
    segmentation: NDArray[np.int32]

    def copy_to(self, buffers: Buffers) -> None:
        buffers.keys[:] = self.keys
        buffers.drawn[: self.drawn] = self.codes
        buffers.base[: self.drawn + 1] = self.base
        buffers.first_triangle[: self.drawn] = self.first_triangle


def _drawn_parts(scene: Scene, camera: Record, buffers: Buffers) -> _Parts:
    """Draw what never moves into `buffers`; return a copy of it."""
    drawn: int = draw_static(scene.arrays, camera, buffers)
    renew_tiles(buffers, camera)
    segmentation = np.empty((int(camera["height"]), int(camera["width"])), np.int32)
    write_entities(scene.arrays, buffers, drawn, segmentation)
    return _Parts(
        drawn,
        buffers.keys.copy(),
        buffers.drawn[:drawn].copy(),
        buffers.base[: drawn + 1].copy(),
        buffers.first_triangle[:drawn].copy(),
        CoarseDepth(buffers.tiles.copy(), buffers.blocks.copy()),
        segmentation,
    )


def shadow_reach(camera: Record) -> float:
    """Return how near moving things must be to cast a shadow into a view, metres: in a room, those in it or close."""
    if not camera["indoors"]:
        return _MOVING_SHADOW_METRES
    return float(np.hypot(camera["room_half_length"], camera["room_half_width"])) * 2.0 + 1.0


def fitting_buffers(known: Buffers | None, scene: Scene, width: int, height: int) -> Buffers:
    """Return the same scratch memory, or new one where the pictures are others or the scene has grown."""
    if known is not None and known.fit(scene.arrays, width, height):
        return known
    return buffers_for(scene.arrays, width, height)
