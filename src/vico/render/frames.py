"""Pictures of a scene: RGB, depth and segmentation for many cameras in one call."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.errors import InputError
from vico.render.arrays import Buffers, buffers_for
from vico.render.cameras import Cameras
from vico.render.raster import draw
from vico.render.scene import Scene
from vico.render.shade import Light, shade, write_depth, write_entities
from vico.render.shadows import cast_moving
from vico.world.mesh import Material, Surface

_MOVING_SHADOW_METRES = 70.0
_EMPTY_U8, _EMPTY_F32, _EMPTY_I32 = np.zeros(0, np.uint8), np.zeros(0, np.float32), np.zeros(0, np.int32)


@dataclass(frozen=True)
class Frames:
    """Pictures of a batch of cameras; a kind that was not asked for has no elements.

    Attributes
    ----------
    rgb
        sRGB, uint8, shape ``(k, h, w, 3)``.
    depth
        Metres along the optical axis, 0 where nothing is hit before `Cameras.far`, float32, shape ``(k, h, w)``.
    segmentation
        Entity ids, 0 where nothing is hit, int32, shape ``(k, h, w)``.
    """

    rgb: NDArray[np.uint8]
    depth: NDArray[np.float32]
    segmentation: NDArray[np.int32]


def render(
    scene: Scene,
    cameras: Cameras,
    *,
    rgb: bool = True,
    depth: bool = True,
    segmentation: bool = True,
    samples: int = 1,
    threads: int | None = None,
    without: NDArray[np.int32] | None = None,
) -> Frames:
    """Take a picture with every camera.

    Parameters
    ----------
    samples
        RGB is the mean of ``samples * samples`` rays a pixel: 1 for observations, 2 or more for pictures to look at.
        Depth and segmentation always come from the ray through the pixel's centre.
    threads
        How many cameras are worked on at once; by default as many as there are processors to run on. The pictures do
        not depend on it.
    without
        Entity of a body that each camera does not see (its own), 0 for none, shape ``(k,)``.
    """
    if samples < 1:
        raise InputError(f"render: samples is {samples}; it must be at least 1")
    count, size = len(cameras), (cameras.height, cameras.width)
    colours = np.empty((count, *size, 3), np.uint8) if rgb else _EMPTY_U8
    depths = np.empty((count, *size), np.float32) if depth else _EMPTY_F32
    entities = np.empty((count, *size), np.int32) if segmentation else _EMPTY_I32
    light = scene.light() if rgb else None
    own = np.zeros(count, np.int32) if without is None else without
    views = [_view(scene, cameras, k, 1, int(own[k])) for k in range(count)]
    fine = [_view(scene, cameras, k, samples, int(own[k])) for k in range(count)] if rgb and samples > 1 else views

    def take(k: int) -> None:
        if rgb and samples > 1:
            wide = np.empty((size[0] * samples, size[1] * samples, 3), np.uint8)
            _take(scene, fine[k], light, wide, _EMPTY_F32, _EMPTY_I32)
            blocks = wide.reshape(size[0], samples, size[1], samples, 3).astype(np.float32)
            colours[k] = np.round(blocks.mean(axis=(1, 3))).astype(np.uint8)
            if depth or segmentation:
                _take(scene, views[k], None, _EMPTY_U8, _part(depths, k), _part(entities, k))
        else:
            _take(scene, views[k], light, _part(colours, k), _part(depths, k), _part(entities, k))

    _for_each(take, count, threads)
    return Frames(colours, depths, entities)


def render_top_down(scene: Scene, half: float, pixels: int, *, samples: int = 2) -> NDArray[np.uint8]:
    """The square world of half side `half` seen from straight above, north up, uint8, shape ``(pixels, pixels, 3)``.

    The camera hangs so high that the projection is parallel for the eye: at the rim a roof 30 m up is displaced by
    less than a thousandth of `half`.
    """
    height = 50.0 * max(half, 10.0) + 200.0
    cameras = Cameras(
        np.array([[0.0, 0.0, height]]),
        np.array([[0.0, 0.0, -1.0]]),
        up=(0.0, 1.0, 0.0),
        fov_y=float(2 * np.arctan(half / height)),
        width=pixels,
        height=pixels,
        near=height - 3000.0 if height > 4000.0 else 1.0,
        far=height + 3000.0,
    )
    light = scene.light()
    numbers = light.numbers.copy()
    numbers[15] = 0.0
    clear = light._replace(numbers=numbers)
    picture = np.empty((pixels * samples, pixels * samples, 3), np.uint8)
    _take(scene, _view(scene, cameras, 0, samples), clear, picture, _EMPTY_F32, _EMPTY_I32)
    blocks = picture.reshape(pixels, samples, pixels, samples, 3).astype(np.float32)
    return np.round(blocks.mean(axis=(1, 3))).astype(np.uint8)


def warm_up() -> None:
    """Compile everything the renderer runs (or load it from the cache), so that the first real frame is quick."""
    plain = Surface.from_triangles(
        np.array([[5.0, -5, 0], [5, 5, 0], [5, 0, 8]]), np.array([[0, 2, 1]]), entity=1, uv=np.eye(3)[:, :2]
    )
    leaf = Material("leaf", np.full((4, 4, 4), 200, np.uint8), cutout=True, double_sided=True)
    scene = Scene([plain], {"leaf": [replace(plain, material=leaf)]})
    scene.place(["leaf"], np.eye(4)[None], [2])
    scene.set_rigid([0], np.eye(4)[None], [3])
    scene.set_skinned(plain.positions, plain.normals, plain.triangles, plain.colour, plain.entity)
    render(scene, Cameras(np.zeros((1, 3)), np.array([[1.0, 0, 0]]), width=16, height=16), threads=1)


_local = threading.local()


def _part(values: NDArray[Any], k: int) -> NDArray[Any]:
    return values[k] if values.size else values


def _for_each(task: Callable[[int], None], count: int, threads: int | None) -> None:
    available = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    workers = min(threads or available, count)
    if workers <= 1:
        for k in range(count):
            task(k)
        return
    # The compiled code holds no interpreter lock, so plain threads run side by side; unlike numba's own threading
    # layers they may be used from several threads and after a fork.
    with ThreadPoolExecutor(workers) as pool:
        list(pool.map(task, range(count)))


def _view(
    scene: Scene, cameras: Cameras, k: int, samples: int, unseen: int = 0
) -> tuple[NDArray[np.float64], int, int]:
    """The numbers of one camera: position, rotation, focal length, centre, depths, and the room it is in."""
    numbers = np.zeros(32)
    numbers[0:3], numbers[3:12] = cameras.position[k], cameras.rotation[k].ravel()
    width, height = cameras.width * samples, cameras.height * samples
    numbers[12] = numbers[13] = cameras.intrinsics[0, 0] * samples
    # Pictures to look at take more texture samples on slanted walls.
    numbers[27], numbers[28] = unseen, samples > 1
    numbers[14], numbers[15], numbers[16], numbers[17] = width / 2, height / 2, cameras.near, cameras.far
    room = scene.room_of(cameras.position[k])
    if room >= 0:
        box = scene.rooms[room]
        numbers[18] = 1.0
        numbers[19:25], numbers[25], numbers[26] = box[:6], np.cos(box[6]), np.sin(box[6])
    return numbers, width, height


def _take(
    scene: Scene,
    view: tuple[NDArray[np.float64], int, int],
    light: Light | None,
    rgb: NDArray[np.uint8],
    depth: NDArray[np.float32],
    segmentation: NDArray[np.int32],
) -> None:
    numbers, width, height = view
    buffers = _buffers(scene, width, height)
    drawn = draw(scene.arrays, numbers, buffers, width, height)
    if light is not None and rgb.size:
        moving = cast_moving(scene.arrays, numbers, light.numbers, buffers, width, height, _MOVING_SHADOW_METRES)
        shade(scene.arrays, numbers, light, buffers, drawn, moving, width, height, rgb)
    if depth.size:
        write_depth(buffers.keys, depth)
    if segmentation.size:
        write_entities(scene.arrays, buffers, drawn, segmentation)


def _buffers(scene: Scene, width: int, height: int) -> Buffers:
    """Scratch memory of the running thread, grown where the scene has grown."""
    a = scene.arrays
    items = len(a.cluster_where) + len(a.instances.entity) + len(a.avatars.span) + 1
    spans = (a.clusters.span, a.prototypes.levels.reshape(-1, 4), a.avatars.span)
    most = max(int((s[:, 3] - s[:, 2]).max(initial=1)) for s in spans)
    known: Buffers | None = getattr(_local, "buffers", None)
    size = (width, height)
    if (
        known is None
        or getattr(_local, "size", None) != size
        or len(known.code) < items
        or known.vertex.shape[1] < most
    ):
        known = buffers_for(scene.arrays, width, height)
        _local.buffers, _local.size = known, size
    return known
