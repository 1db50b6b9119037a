"""Pictures of a scene: RGB, depth and segmentation for many cameras in one call, and how carefully they are made.

Each switch of quality has its price.
"""

from __future__ import annotations

import math
import os
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field, fields, replace
from functools import cache, partial
from typing import Any, NamedTuple
from weakref import WeakSet

import numpy as np
from numpy.typing import NDArray

from vico.errors import InputError
from vico.render.arrays import Buffers, buffers_for
from vico.render.cameras import Cameras
from vico.render.lamps import LIT_FROM
from vico.render.lighting import Lighting
from vico.render.motion import NO_PAST, PastPlaces
from vico.render.portals import show_rooms
from vico.render.scene import Scene
from vico.render.shading.post_processing import draw_weather, occlude, smooth_edges
from vico.render.shading.surfaces import write_surface
from vico.render.shadows.casters import new_caster
from vico.render.uniforms import NO_LIGHT, Light, Record, camera_uniforms
from vico.render.view import NO_STATIC_PICTURE, ViewCache, ViewOutputs, render_view
from vico.world.mesh import Material, Surface


@dataclass(frozen=True)
class RenderQuality:
    """What is done beyond a quick picture; nothing, unless told.

    Attributes
    ----------
    soft_shadows
        The rims of the sun's shadows are blurred instead of following the texels of the shadow map.
    ambient_occlusion
        Corners, and the ground beneath things, get less light from around.
    smooth_edges
        Edges of what stands before something else are smoothed.
    reflections
        Windows and other glass mirror the sky and the street.
    interiors
        Rooms are seen behind windows: the shop's own behind its front, behind others one that might be there.
    """

    soft_shadows: bool = False
    ambient_occlusion: bool = False
    smooth_edges: bool = False
    reflections: bool = False
    interiors: bool = False

    @property
    def is_plain(self) -> bool:
        """Whether nothing is done."""
        return not any(getattr(self, field.name) for field in fields(self))

    @classmethod
    def of(cls, wanted: str | Mapping[str, Any]) -> RenderQuality:
        """Make a record of ``"plain"``, ``"fine"`` (everything), or of switches by name.

        Raises
        ------
        InputError
            If it is another word, a switch is unknown, or not true or false.
        """
        names = [field.name for field in fields(cls)]
        if isinstance(wanted, str):
            if wanted not in ("plain", "fine"):
                raise InputError(f"quality: {wanted!r}; it has to be plain, fine, or switches: {', '.join(names)}")
            return cls(**dict.fromkeys(names, wanted == "fine"))
        for name, value in wanted.items():
            if name not in names or not isinstance(value, bool):
                raise InputError(f"quality: {name!r} is {value!r}; switches are {', '.join(names)}, true or false")
        return cls(**wanted)


PLAIN_QUALITY, FINE_QUALITY = RenderQuality(), RenderQuality.of("fine")


# Squares along a side of a picture from above.
_SQUARES = 8
# Of as many dimensions as a picture: compiled code is made for that.
_EMPTY_U8 = np.zeros((0, 0, 3), np.uint8)
_EMPTY_F32, _EMPTY_I32 = np.zeros((0, 0), np.float32), np.zeros((0, 0), np.int32)
_NO_NORMALS, _NO_PLACES = np.zeros((0, 0, 0, 3), np.float32), np.zeros((0, 0, 0, 3), np.float64)

# Soft shadows' rims, texels of the shadow map, and the light that marks glass by day.
_SOFT_TEXELS, _LEAST_SHINE = 1.1, 1e-4
_begun: WeakSet[PendingView] = WeakSet()


class PendingView:
    """One camera's pictures that a thread works on, or that wait for one; whoever waits for them takes them itself."""

    def __init__(self, crew: ThreadPoolExecutor, take: Callable[[], None]) -> None:
        self._take: Callable[[], None] | None = take
        self._lock = threading.Lock()
        _begun.add(self)
        self._turn = crew.submit(self.wait)

    def help(self) -> None:
        """Take the pictures in this thread, unless another one is at it."""
        if self._turn.cancel():
            self.wait()

    def wait(self) -> None:
        """Return when they are there; raises what went wrong with them, to everybody who waits."""
        with self._lock:
            if self._take is not None:
                self._take()
                self._take = None


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
    normals
        Unit vectors in the world's axes, 0 where nothing is hit, float32, shape ``(k, h, w, 3)``.
    places
        Where the seen points were before, from where the eye was then, world's axes, metres, float64, shape
        ``(k, h, w, 3)``; NaN for what was not there.
    pending
        One a camera, of pictures that may still be worked on; empty unless that was deferred.
    """

    rgb: NDArray[np.uint8]
    depth: NDArray[np.float32]
    segmentation: NDArray[np.int32]
    normals: NDArray[np.float32] = field(default_factory=lambda: _NO_NORMALS)
    places: NDArray[np.float64] = field(default_factory=lambda: _NO_PLACES)
    pending: tuple[PendingView, ...] = ()

    def wait(self) -> None:
        """Wait for all pictures that are still being worked on; see ``deferred`` of `ViewCache`."""
        for view in self.pending:
            view.help()
        for view in self.pending:
            view.wait()

    def wait_for(self, k: int) -> None:
        """Wait for camera `k`'s pictures."""
        if self.pending:
            self.pending[k].wait()


@dataclass(frozen=True, kw_only=True)
class PictureRequest:
    """What pictures of a scene are to show, beside where they are taken from.

    Attributes
    ----------
    rgb, depth, segmentation, normals
        Whether each is wanted; see `Frames`.
    past
        What was where when each camera looked last; empty where nobody asks for `Frames.places`.
    samples
        RGB is the mean of ``samples * samples`` rays a pixel: 1 for observations, 2 or more for pictures to look at.
        All else always comes from the ray through the pixel's centre.
    moving
        Whether what moves is there.
    quality
        What is done beyond a quick picture.
    """

    rgb: bool = True
    depth: bool = True
    segmentation: bool = True
    normals: bool = False
    past: tuple[PastPlaces, ...] = ()
    samples: int = 1
    moving: bool = True
    quality: RenderQuality = PLAIN_QUALITY

    def __post_init__(self) -> None:
        if self.samples < 1:
            raise InputError(f"render: samples is {self.samples}; it must be at least 1")


def render(
    scene: Scene,
    cameras: Cameras,
    *,
    rgb: bool = True,
    depth: bool = True,
    segmentation: bool = True,
    samples: int = 1,
    threads: int | None = None,
    cache: ViewCache | None = None,
) -> Frames:
    """Take a picture with every camera; see `PictureRequest` and `take_pictures`.

    Raises
    ------
    InputError
        If `samples` is less than 1.
    """
    request = PictureRequest(rgb=rgb, depth=depth, segmentation=segmentation, samples=samples)
    return take_pictures(scene, cameras, request, threads=threads, cache=cache)


def take_pictures(
    scene: Scene,
    cameras: Cameras,
    request: PictureRequest,
    *,
    threads: int | None = None,
    cache: ViewCache | None = None,
) -> Frames:
    """Take pictures with every camera.

    Parameters
    ----------
    threads
        How many cameras are worked on at once; by default as many as there are processors to run on. The pictures do
        not depend on it.
    cache
        What the same cameras saw in the last call: a view in which nothing can have changed is copied.
    """
    shape = len(cameras), cameras.height, cameras.width
    light = light_of(scene.light(), request.quality) if request.rgb else None
    batch = _Batch(
        scene,
        cameras,
        light,
        np.empty((*shape, 3) if request.rgb else (0, 0, 0, 3), np.uint8),
        np.empty(shape if request.depth else (0, 0, 0), np.float32),
        np.empty(shape if request.segmentation else (0, 0, 0), np.int32),
        np.empty((*shape, 3), np.float32) if request.normals else _NO_NORMALS,
        np.empty((*shape, 3), np.float64) if request.past else _NO_PLACES,
        request.past,
        request.moving,
        request.quality,
    )
    pending: tuple[PendingView, ...] = ()
    if light is not None and request.samples > 1:
        _for_each(lambda k: batch.render_smooth(k, light, request.samples), len(cameras), threads)
    elif cache is not None and (light is not None or cache.deferred):
        pending = _render_cached(batch, light, cache, threads)
    else:
        _for_each(batch.render, len(cameras), threads)
    return Frames(batch.rgb, batch.depth, batch.segmentation, batch.normals, batch.places, pending)


class _How(NamedTuple):
    """Whether what moves is drawn, and how carefully."""

    moving: bool
    quality: RenderQuality


_USUAL = _How(True, PLAIN_QUALITY)


@dataclass(frozen=True)
class _Batch:
    """Cameras, and the pictures they are to take; kinds that are not asked for are empty."""

    scene: Scene
    cameras: Cameras
    light: Light | None
    rgb: NDArray[np.uint8]
    depth: NDArray[np.float32]
    segmentation: NDArray[np.int32]
    normals: NDArray[np.float32]
    places: NDArray[np.float64]
    past: tuple[PastPlaces, ...]
    moving: bool
    quality: RenderQuality

    @property
    def reads_surfaces(self) -> bool:
        """Whether normals or past places are asked for."""
        return bool(len(self.normals) or len(self.places))

    @property
    def _how(self) -> _How:
        return _How(self.moving, self.quality)

    def pictures(self, k: int) -> ViewOutputs:
        """Return camera `k`'s part of each kind."""
        return ViewOutputs(_part(self.rgb, k), _part(self.depth, k), _part(self.segmentation, k))

    def render(self, k: int) -> None:
        camera = _camera(self.scene, self.cameras, k, 1)
        drawn = _take(self.scene, camera, self.light, self.pictures(k), self._how)
        self._read_surfaces(k, camera, drawn)

    def _read_surfaces(self, k: int, camera: Record, drawn: int) -> None:
        """Write normals and past places of the picture that was just taken, where they are asked for."""
        if self.reads_surfaces:
            buffers = _buffers(self.scene, self.cameras.width, self.cameras.height)
            past = self.past[k] if self.past else NO_PAST
            write_surface(
                self.scene.arrays, camera, buffers, drawn, past, _part(self.normals, k), _part(self.places, k)
            )

    def render_smooth(self, k: int, light: Light, samples: int) -> None:
        """Take the mean of several rays a pixel for RGB; depth and segmentation of the middle ray."""
        height, width = self.rgb.shape[1:3]
        wide = np.empty((height * samples, width * samples, 3), np.uint8)
        only_rgb = ViewOutputs(wide, _EMPTY_F32, _EMPTY_I32)
        _take(
            self.scene,
            _camera(self.scene, self.cameras, k, samples),
            light,
            only_rgb,
            _How(self.moving, replace(self.quality, smooth_edges=False)),
        )
        self.rgb[k] = _mean_of_blocks(wide, samples)
        if self.depth.size or self.segmentation.size or self.reads_surfaces:
            camera, without_rgb = _camera(self.scene, self.cameras, k, 1), self.pictures(k)._replace(rgb=_EMPTY_U8)
            self._read_surfaces(k, camera, _take(self.scene, camera, None, without_rgb, self._how))


def _render_cached(
    batch: _Batch, light: Light | None, cache: ViewCache, threads: int | None
) -> tuple[PendingView, ...]:
    """Render what is not still right from the last call; return the work that was deferred, one a camera."""
    scene, cameras = batch.scene, batch.cameras

    def take_one(k: int) -> None:
        if light is None or batch.reads_surfaces or not batch.moving or not batch.quality.is_plain:
            batch.render(k)
            return
        camera, pictures = _camera(scene, cameras, k, 1), batch.pictures(k)
        background = cache.background(k, scene, camera)
        # Headlights of what moves light what stays.
        lit = len(scene.arrays.beams) > 0 and light.uniforms["lamp_exposure"] >= LIT_FROM and not camera["indoors"]
        if background is None or lit:
            _take(scene, camera, light, pictures)
            return
        buffers = _buffers(scene, cameras.width, cameras.height)
        if background.take(scene, camera, light, buffers, pictures):
            cache.hits += 1
        else:
            draw_weather(camera, light, buffers.keys, scene.moment, pictures.rgb)

    # Long ones first: with a short one at the end, no thread waits long for the others.
    order = sorted(range(len(cameras)), key=cache.was_quick)
    if not cache.deferred:
        _for_each(lambda place: take_one(order[place]), len(order), threads)
        return ()
    # One thread fewer than processors: the program goes on, and works on pictures as soon as it waits for one.
    crew = _crew(max(min((threads or _available()) - 1, len(order)), 1))
    begun = {k: PendingView(crew, partial(take_one, k)) for k in order}
    return tuple(begun[k] for k in range(len(order)))


def _mean_of_blocks(wide: NDArray[np.uint8], samples: int) -> NDArray[np.uint8]:
    """Return the mean of each square of `samples` pixels a side."""
    total = np.zeros((wide.shape[0] // samples, wide.shape[1] // samples, 3), np.uint32)
    for k in range(samples * samples):
        total += wide[k // samples :: samples, k % samples :: samples]
    return np.round(total / np.float32(samples * samples)).astype(np.uint8)


def render_top_down(scene: Scene, half: float, pixels: int, *, samples: int = 2) -> NDArray[np.uint8]:
    """Return the square world of half side `half` from straight above, north up, uint8, shape ``(pixels, pixels, 3)``.

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
        fov_y=2.0 * math.atan(step / metre / 2 / height),
        width=step,
        height=step,
        near=height - 3000.0 if height > 4000.0 else 1.0,
        far=height + 3000.0,
    )
    light = scene.light()
    without_haze = light.uniforms.copy()
    for name in ("haze_per_metre", "wet", "rain", "snowfall"):
        without_haze[name] = 0.0
    clear = light._replace(uniforms=without_haze)
    picture = np.empty((pixels, pixels, 3), np.uint8)

    def take(k: int) -> None:
        x, y = corners[k]
        square = np.empty((step * samples, step * samples, 3), np.uint8)
        _take(scene, _camera(scene, cameras, k, samples), clear, ViewOutputs(square, _EMPTY_F32, _EMPTY_I32))
        place = picture[y : y + step, x : x + step]
        place[:] = _mean_of_blocks(square, samples)[: place.shape[0], : place.shape[1]]

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
    for light in (Lighting(), Lighting(wet=1.0, rain=1.0, snowfall=1.0)):
        scene.lighting = light
        render(scene, Cameras(np.zeros((1, 3)), np.array([[1.0, 0, 0]]), width=16, height=16), threads=1)


_local = threading.local()


def _part(values: NDArray[Any], k: int) -> NDArray[Any]:
    return values[k] if len(values) else np.zeros(values.shape[1:], values.dtype)


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


def _settle() -> None:
    """Wait for all pictures that are being worked on."""
    for view in tuple(_begun):
        with suppress(Exception):  # told to whoever waits for the picture
            view.wait()


# A forked child has none of its parent's threads: nothing may be left for them to do.
os.register_at_fork(before=_settle, after_in_child=_crew.cache_clear)


def _camera(scene: Scene, cameras: Cameras, k: int, samples: int) -> Record:
    return camera_uniforms(cameras, k, samples, scene.room_of(cameras.position[k]))


def _take(scene: Scene, camera: Record, light: Light | None, out: ViewOutputs, how: _How = _USUAL) -> int:
    """Take pictures of one camera; return how many items were drawn."""
    buffers = _buffers(scene, int(camera["width"]), int(camera["height"]))
    if how.quality.interiors:
        buffers.glass[:] = 0
    drawn = render_view(
        scene.arrays,
        camera,
        NO_LIGHT if light is None else light,
        buffers,
        NO_STATIC_PICTURE,
        how.moving,
        new_caster(),
        out,
    )
    if light is not None and out.rgb.size:
        if how.quality.interiors:
            draw = partial(_picture_of_room, scene, light, how.moving)
            show_rooms(scene, camera, light.uniforms, buffers.keys, buffers.glass, draw, out.rgb)
        if how.quality.ambient_occlusion:
            occlude(camera, buffers.keys, out.rgb)
        if how.quality.smooth_edges:
            smooth_edges(camera, buffers.keys, out.rgb)
        draw_weather(camera, light, buffers.keys, scene.moment, out.rgb)
    return int(drawn)


def light_of(light: Light, quality: RenderQuality) -> Light:
    """Return the light with what the shader reads of switches."""
    if not (quality.soft_shadows or quality.reflections or quality.interiors):
        return light
    uniforms = light.uniforms.copy()
    if quality.soft_shadows:
        uniforms["shadow_softness"] = _SOFT_TEXELS
    uniforms["interiors"] = float(quality.interiors)
    if quality.reflections:
        uniforms["glass"] = 1.0
        # Glass is told by what may shine, be it ever so little by day.
        uniforms["lamp_exposure"] = max(float(uniforms["lamp_exposure"]), _LEAST_SHINE)
    return light._replace(uniforms=uniforms)


def _picture_of_room(scene: Scene, light: Light, moving: bool, camera: Record) -> NDArray[np.uint8]:
    """Take the picture of a room that is seen from outdoors."""
    shape = int(camera["height"]), int(camera["width"])
    spare = getattr(_local, "room_buffers", None)
    if spare is None or not spare.hold(scene.arrays, shape[1], shape[0]):
        # Of any size below: rooms are seen through panes of all sizes.
        side = 64 * -(-max(shape) // 64)
        spare = buffers_for(scene.arrays, side, side)
        _local.room_buffers = spare
    rgb = np.empty((*shape, 3), np.uint8)
    pictures = ViewOutputs(rgb, _EMPTY_F32, _EMPTY_I32)
    render_view(scene.arrays, camera, light, spare.cut(*shape), NO_STATIC_PICTURE, moving, new_caster(), pictures)
    return rgb


def _buffers(scene: Scene, width: int, height: int) -> Buffers:
    """Return scratch memory of the running thread: new where the pictures are others or the scene has grown."""
    buffers: Buffers | None = getattr(_local, "buffers", None)
    if buffers is None or not buffers.fit(scene.arrays, width, height):
        buffers = buffers_for(scene.arrays, width, height)
        _local.buffers = buffers
    return buffers
