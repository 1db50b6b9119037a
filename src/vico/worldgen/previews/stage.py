"""Write the pictures of a finished world: the map, the square from straight above, and views at eye height."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from vico.render.cameras import Cameras
from vico.render.frames import render, render_top_down
from vico.render.scene import Scene
from vico.render.world_scene import scene_of
from vico.threads import for_each, in_order, meanwhile
from vico.world.world import World
from vico.worldgen.previews.maps import map_picture
from vico.worldgen.previews.viewpoints import Overhead, Viewpoint, viewpoints

_VIEWS = 8
_PNG_LEVEL = 2  # a tenth larger than 6, which takes four times as long


def write_previews(world: World, folder: Path, *, views: bool) -> dict[str, int]:
    """Write ``map.png`` and, with `views`, the rendered pictures of ``previews/``; return how many there are."""
    if not views:
        write_map(world, folder)
        return {"maps": 1, "views": 0}
    scene = meanwhile(lambda: _lit(world))
    write_map(world, folder)
    spots = viewpoints(world, count=_VIEWS)
    (folder / "previews").mkdir(exist_ok=True)
    names = ["above", *(f"view_{k}" for k in range(len(spots)))]
    frames = _rendered(scene(), world.half, [Overhead(), *spots])

    def save(taken: tuple[str, NDArray[np.uint8]]) -> None:
        name, frame = taken
        Image.fromarray(frame).save(folder / "previews" / f"{name}.png", compress_level=_PNG_LEVEL)

    for_each(save, zip(names, frames, strict=True))
    return {"maps": 1, "views": len(spots)}


def write_map(world: World, folder: Path) -> None:
    """Write ``map.png``."""
    map_picture(world).save(folder / "map.png")


def render_views(world: World, views: Sequence[Viewpoint | Overhead]) -> Iterator[NDArray[np.uint8]]:
    """Render a world from viewpoints.

    Yields
    ------
    ndarray
        RGB, uint8, shape ``(height, width, 3)``, in the order of `views`.
    """
    return _rendered(_lit(world), world.half, views)


def _lit(world: World) -> Scene:
    scene = scene_of(world, rooms=False)
    scene.light()
    return scene


def _rendered(scene: Scene, half: float, views: Sequence[Viewpoint | Overhead]) -> Iterator[NDArray[np.uint8]]:
    def take(view: Viewpoint | Overhead) -> NDArray[np.uint8]:
        if isinstance(view, Overhead):
            return render_top_down(scene, half, view.side)
        cameras = Cameras(
            np.array([view.position]),
            np.array([view.forward]),
            fov_y=view.fov_y,
            width=view.width,
            height=view.height,
        )
        return render(scene, cameras, depth=False, segmentation=False, samples=2, threads=1).rgb[0]

    return in_order(take, views)
