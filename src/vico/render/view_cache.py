"""What each camera saw last: a view in which nothing can have changed is copied, not rendered again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.render.arrays import Buffers, buffers_for
from vico.render.scene import Scene
from vico.render.shading.light import Light
from vico.render.shadows.moving import CoarseDepth, is_disturbed
from vico.render.uniforms import Record
from vico.render.visibility.culling import renew_tiles

_MOVING_SHADOW_METRES = 70.0


class ViewCache:
    """What each camera of a batch saw last, so that a view in which nothing can have changed is not rendered again.

    That is: a camera that stands still in a room, where nothing that moves comes into sight or darkens anything,
    neither then nor now. Out of doors there is always somebody about. Copies equal new pictures bit for bit.

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
        self._known: dict[int, _CachedView] = {}
        self._buffers: dict[int, Buffers] = {}

    def buffers(self, k: int, scene: Scene, width: int, height: int) -> Buffers:
        """Return scratch memory that stays camera `k`'s until its RGB is there."""
        self._buffers[k] = fitting_buffers(self._buffers.get(k), scene, width, height)
        return self._buffers[k]

    def repeat(self, k: int, scene: Scene, camera: Record, light: Light, into: Sequence[NDArray[Any]]) -> bool:
        """Copy the last pictures of camera `k` if they are still right; return whether they are."""
        known = self._known.get(k)
        if known is None or known.of != (camera.tobytes(), scene.version) or known.light is not light:
            return False
        if [p.shape for p in known.pictures] != [p.shape for p in into] or known.is_disturbed(scene, camera):
            return False
        for old, new in zip(known.pictures, into, strict=True):
            new[...] = old
        self.hits += 1
        return True

    def keep(
        self, k: int, scene: Scene, camera: Record, light: Light, pictures: Sequence[NDArray[Any]], buffers: Buffers
    ) -> None:
        """Remember pictures just taken with `buffers`, if they can be right again."""
        self._known.pop(k, None)
        if not camera["indoors"]:
            return
        renew_tiles(buffers, camera)
        coarse = CoarseDepth(buffers.tiles.copy(), buffers.blocks.copy())
        known = _CachedView((camera.tobytes(), scene.version), light, coarse, [p.copy() for p in pictures])
        if not known.is_disturbed(scene, camera):
            self._known[k] = known


@dataclass(frozen=True)
class _CachedView:
    """Pictures, what they were taken of, and the coarse depths of what is seen."""

    of: tuple[bytes, int]
    light: Light
    coarse: CoarseDepth
    pictures: list[NDArray[Any]]

    def is_disturbed(self, scene: Scene, camera: Record) -> bool:
        return is_disturbed(scene.arrays, camera, self.light.uniforms, self.coarse, shadow_reach(camera))


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
