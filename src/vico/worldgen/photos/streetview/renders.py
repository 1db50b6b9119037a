"""Renders of an unfinished world as a camera at a photo's pose sees it: what street photos are matched with."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from vico.render.cameras import Cameras
from vico.render.frames import render
from vico.render.world_scene import scene_of
from vico.world.world import World
from vico.worldgen.photos.streetview.photo import Photographer


def photographer_of(world: World) -> Photographer:
    """Return what renders a world with pinhole cameras whose principal point is the picture's middle."""
    scene = scene_of(world, rooms=False)

    def take(
        position: NDArray[np.float64], rotation: NDArray[np.float64], intrinsics: NDArray[np.float64], w: int, h: int
    ) -> tuple[NDArray[np.uint8], NDArray[np.float32], NDArray[np.int32]]:
        fov = 2 * math.atan(h / 2 / intrinsics[1, 1])
        camera = Cameras(position[None], rotation[2][None], up=-rotation[1], fov_y=fov, width=w, height=h)
        frames = render(scene, camera, samples=1)
        return frames.rgb[0], frames.depth[0], frames.segmentation[0]

    return take
