"""Pictures of a scene: RGB, depth and segmentation for many cameras in one call."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.errors import InputError
from vico.render.arrays import Buffers, buffers_for
from vico.render.cameras import Cameras
from vico.render.raster import draw, renew_tiles
from vico.render.scene import Scene
from vico.render.shade import Light, shade, write_depth, write_entities
from vico.render.shadows import cast_moving, is_disturbed
from vico.world.mesh import Material, Surface

_MOVING_SHADOW_METRES = 70.0
# Squares along a side of a picture from above.
_SQUARES = 8
_View = tuple[NDArray[np.float64], int, int]
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
    later: tuple[Future[None], ...] = ()

    def finish(self) -> None:
        """Wait for colours that are still being worked on; see ``colours_later`` of `render`."""
        for colours in self.later:
            colours.result()


class Stills:
    """What each camera of a batch saw last, so that a view in which nothing can have changed is not taken again.

    That is: a camera that stands still in a room, where nothing that moves comes into sight or darkens anything,
    neither then nor now. Out of doors there is always somebody about. Copies equal new pictures bit for bit.
    """

    def __init__(self) -> None:
        self._known: dict[int, _Still] = {}
        self._buffers: dict[int, Buffers] = {}
        self.repeated = 0

    def buffers(self, k: int, scene: Scene, width: int, height: int) -> Buffers:
        """Scratch memory that stays camera `k`'s until its colours are there."""
        self._buffers[k] = _fitting(self._buffers.get(k), scene, width, height)
        return self._buffers[k]

    def repeat(self, k: int, scene: Scene, view: _View, light: Light, into: Sequence[NDArray[Any]]) -> bool:
        """Copy the last pictures of camera `k` if they are still right."""
        still = self._known.get(k)
        if still is None or still.of != (view[0].tobytes(), scene.version) or still.light is not light:
            return False
        if [p.shape for p in still.pictures] != [p.shape for p in into] or still.is_disturbed(scene, view):
            return False
        for old, new in zip(still.pictures, into, strict=True):
            new[...] = old
        self.repeated += 1
        return True

    def keep(
        self, k: int, scene: Scene, view: _View, light: Light, pictures: Sequence[NDArray[Any]], b: Buffers
    ) -> None:
        """Remember pictures just taken with buffers `b`, if they can be right again."""
        self._known.pop(k, None)
        numbers, width, height = view
        if numbers[18] < 0.5:
            return
        renew_tiles(b.keys, b.tiles, b.blocks, b.strip, width, height)
        of = numbers.tobytes(), scene.version
        still = _Still(of, light, b.tiles.copy(), b.blocks.copy(), [p.copy() for p in pictures])
        if not still.is_disturbed(scene, view):
            self._known[k] = still


@dataclass(frozen=True)
class _Still:
    """Pictures, what they were taken of, and the coarse depths of what is seen."""

    of: tuple[bytes, int]
    light: Light
    tiles: NDArray[np.uint32]
    blocks: NDArray[np.uint32]
    pictures: list[NDArray[Any]]

    def is_disturbed(self, scene: Scene, view: _View) -> bool:
        n, width, height = view
        reach = _shadow_reach(n)
        return bool(is_disturbed(scene.arrays, n, self.light.numbers, self.tiles, self.blocks, width, height, reach))


def _shadow_reach(numbers: NDArray[np.float64]) -> float:
    """How near things that move must be to cast a shadow into a view, metres: in a room only those in it, or close."""
    return _MOVING_SHADOW_METRES if numbers[18] < 0.5 else float(np.hypot(numbers[22], numbers[23])) * 2.0 + 1.0


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
    before: Stills | None = None,
    colours_later: bool = False,
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
    before
        What the same cameras saw in the last call: a view in which nothing can have changed is copied.
    colours_later
        With `before`: return when depth and segmentation are there, and let threads work on RGB. It must not be read,
        nor the scene be changed, before `Frames.finish`.
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
            return
        pictures = _part(colours, k), _part(depths, k), _part(entities, k)
        if before is None or light is None:
            _take(scene, views[k], light, *pictures)
        elif not before.repeat(k, scene, views[k], light, pictures):
            b = before.buffers(k, scene, size[1], size[0]) if colours_later else _buffers(scene, size[1], size[0])
            drawn = _see(scene, views[k], b, pictures[1], pictures[2])
            if colours_later:
                seen[k] = drawn
            else:
                colour(k, b, drawn)

    def colour(k: int, b: Buffers, drawn: int) -> None:
        assert before is not None
        assert light is not None
        _colour(scene, views[k], light, b, drawn, colours[k])
        before.keep(k, scene, views[k], light, (_part(colours, k), _part(depths, k), _part(entities, k)), b)

    seen: dict[int, int] = {}
    _for_each(take, count, threads)
    crew = _crew(min(threads or _available(), max(count, 1)))
    later = [crew.submit(colour, k, before._buffers[k], seen[k]) for k in sorted(seen) if before is not None]
    return Frames(colours, depths, entities, tuple(later))


def render_top_down(scene: Scene, half: float, pixels: int, *, samples: int = 2) -> NDArray[np.uint8]:
    """The square world of half side `half` seen from straight above, north up, uint8, shape ``(pixels, pixels, 3)``.

    The camera hangs so high that the projection is parallel for the eye: at the rim a roof 30 m up is displaced by
    less than a thousandth of `half`.
    """
    height = 50.0 * max(half, 10.0) + 200.0
    # In squares that threads share, each from straight above its own middle.
    step = -(-pixels // _SQUARES)
    metre = pixels / (2 * half)
    corners = np.array([(x, y) for y in range(0, pixels, step) for x in range(0, pixels, step)])
    middles = (corners + step / 2) / metre - half
    cameras = Cameras(
        np.column_stack([middles[:, 0], -middles[:, 1], np.full(len(corners), height)]),
        np.tile([0.0, 0.0, -1.0], (len(corners), 1)),
        up=(0.0, 1.0, 0.0),
        fov_y=float(2 * np.arctan(step / metre / 2 / height)),
        width=step,
        height=step,
        near=height - 3000.0 if height > 4000.0 else 1.0,
        far=height + 3000.0,
    )
    light = scene.light()
    numbers = light.numbers.copy()
    numbers[15] = 0.0
    clear = light._replace(numbers=numbers)
    picture = np.empty((pixels, pixels, 3), np.uint8)

    def take(k: int) -> None:
        x, y = corners[k]
        square = np.empty((step * samples, step * samples, 3), np.uint8)
        _take(scene, _view(scene, cameras, k, samples), clear, square, _EMPTY_F32, _EMPTY_I32)
        blocks = square.reshape(step, samples, step, samples, 3).astype(np.float32)
        place = picture[y : y + step, x : x + step]
        place[:] = np.round(blocks.mean(axis=(1, 3))).astype(np.uint8)[: place.shape[0], : place.shape[1]]

    _for_each(take, len(corners), None)
    return picture


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
    workers = min(threads or _available(), count)
    if workers <= 1:
        for k in range(count):
            task(k)
        return
    # The compiled code holds no interpreter lock, so plain threads run side by side; unlike numba's own threading
    # layers they may be used from several threads and after a fork.
    list(_crew(workers).map(task, range(count)))


def _available() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@cache
def _crew(workers: int) -> ThreadPoolExecutor:
    """Threads that stay, and with them their scratch memory."""
    return ThreadPoolExecutor(workers, "render")


# A forked child has none of its parent's threads.
os.register_at_fork(after_in_child=_crew.cache_clear)


def _view(scene: Scene, cameras: Cameras, k: int, samples: int, unseen: int = 0) -> _View:
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
    view: _View,
    light: Light | None,
    rgb: NDArray[np.uint8],
    depth: NDArray[np.float32],
    segmentation: NDArray[np.int32],
) -> None:
    buffers = _buffers(scene, view[1], view[2])
    drawn = _see(scene, view, buffers, depth, segmentation)
    if light is not None and rgb.size:
        _colour(scene, view, light, buffers, drawn, rgb)


def _see(
    scene: Scene, view: _View, buffers: Buffers, depth: NDArray[np.float32], segmentation: NDArray[np.int32]
) -> int:
    """Find what is visible; returns how many items were drawn."""
    numbers, width, height = view
    drawn: int = draw(scene.arrays, numbers, buffers, width, height)
    if depth.size:
        write_depth(buffers.keys, depth)
    if segmentation.size:
        write_entities(scene.arrays, buffers, drawn, segmentation)
    return drawn


def _colour(scene: Scene, view: _View, light: Light, buffers: Buffers, drawn: int, rgb: NDArray[np.uint8]) -> None:
    """Colour what is visible."""
    numbers, width, height = view
    moving = cast_moving(scene.arrays, numbers, light.numbers, buffers, width, height, _shadow_reach(numbers))
    shade(scene.arrays, numbers, light, buffers, drawn, moving, width, height, rgb)


def _buffers(scene: Scene, width: int, height: int) -> Buffers:
    """Scratch memory of the running thread."""
    buffers = _fitting(getattr(_local, "buffers", None), scene, width, height)
    _local.buffers = buffers
    return buffers


def _fitting(known: Buffers | None, scene: Scene, width: int, height: int) -> Buffers:
    """The same scratch memory, or new one where the pictures are others or the scene has grown."""
    a = scene.arrays
    items = len(a.cluster_where) + len(a.instances.entity) + len(a.avatars.span) + 1
    spans = (a.clusters.span, a.prototypes.levels.reshape(-1, 4), a.avatars.span)
    most = max(int((s[:, 3] - s[:, 2]).max(initial=1)) for s in spans)
    fits = known is not None and len(known.strip) == width and len(known.sun) == width * height
    if known is None or not fits or len(known.code) < items or known.vertex.shape[1] < most:
        return buffers_for(a, width, height)
    return known
