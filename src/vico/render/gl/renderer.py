"""Takes pictures by OpenGL: uploads a scene's arrays as they are, culls, draws, and reads back.

Shaders are programs that remember their uniforms. A target is what is drawn into and read back.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.errors import MissingExtraError
from vico.render.arrays import SceneArrays
from vico.render.cameras import Cameras
from vico.render.compiled import kernel
from vico.render.frames import Frames, PictureRequest, light_of
from vico.render.gl.draw_data import (
    CASTER_ROWS,
    LAMP_FLOATS,
    OPENINGS,
    cluster_ranges,
    instances_in_view,
    joined_ranges,
    light_uniforms,
    packed_beams,
    packed_cabins,
    packed_casters,
    packed_lamps,
    packed_openings,
    packed_past,
    view_uniforms,
)
from vico.render.lamps import AROUND_CORNER, BEFORE, CELL
from vico.render.lighting import SKY_SIZE
from vico.render.materials import LEVELS
from vico.render.motion import PastPlaces
from vico.render.portals import show_rooms
from vico.render.records import CABIN_STEPS
from vico.render.scene import Scene
from vico.render.shading.post_processing import draw_weather, occlude, smooth_edges
from vico.render.shadows.casters import CABIN_BLUE, CABIN_GREEN, CABIN_LAMP, CABIN_TILT, UNDER_ROOF
from vico.render.uniforms import Light, Record, camera_uniforms

_HERE = Path(__file__).parent


class Program:
    """A vertex and a fragment shader, which pull corners out of the scene's buffers.

    Parameters
    ----------
    gl
        The context.
    name
        Of the two files.
    constants
        What shaders share with the processor's renderer, by the names in ``%``.
    """

    def __init__(self, gl: Any, name: str, constants: Mapping[str, object]) -> None:
        fragment = (_HERE / f"{name}.frag").read_text()
        for constant, value in constants.items():
            fragment = fragment.replace(f"%{constant}%", str(value))
        program = gl.program((_HERE / f"{name}.vert").read_text(), fragment)
        self._mode = gl.TRIANGLES
        self._uniforms = {name: program[name] for name in program}
        self._told: dict[str, Any] = {}
        self._corners = gl.vertex_array(program, [])

    def tell(self, values: Mapping[str, Any]) -> None:
        """Set uniforms that are other than before; what the compiler has left out of the shaders is left out."""
        for name, value in values.items():
            if self._told.get(name) != value:
                self._told[name] = value
                if name in self._uniforms:
                    self._uniforms[name].value = value

    def draw(self, triangles: int, instances: int = 1) -> None:
        """Draw some triangles."""
        if triangles > 0:
            self._corners.render(self._mode, vertices=3 * triangles, instances=instances)


def new_context() -> Any:
    """Return a context of OpenGL 4.5, through EGL.

    Raises
    ------
    MissingExtraError
        If moderngl, or a driver, is not there.
    """
    try:
        import moderngl
    except ImportError:
        raise MissingExtraError(
            "the renderer gl needs moderngl: pip install 'virtual-community[gl]', or take the renderer cpu"
        ) from None
    try:
        context = moderngl.create_standalone_context(backend="egl", require=450)
    except Exception as error:  # whatever a driver says
        raise MissingExtraError(
            f"the renderer gl finds no OpenGL 4.5 through EGL ({error}); install a driver (Debian: apt install libegl1 "
            "libgl1-mesa-dri), or take the renderer cpu"
        ) from None
    return context


_NOBODY = 1
# Keys have spare places behind a picture's last pixel.
_SPARE = 64
# The sky is this far away, metres: only turning moves it.
_SKY = 1e7


class PictureBuffers(NamedTuple):
    """A picture and what comes after shading looks at.

    Attributes
    ----------
    rgb
        uint8, shape ``(h, w, 3)``.
    glass
        How much of what is behind is seen through each pixel, of 255, uint8, shape ``(h * w,)``.
    keys
        As the visibility pass leaves them, uint64: the inverse depth's bits, then who is seen.
    """

    rgb: NDArray[np.uint8]
    glass: NDArray[np.uint8]
    keys: NDArray[np.uint64]


class Target:
    """A frame buffer with all outputs; its first row is the picture's upper one.

    Parameters
    ----------
    gl
        The context.
    width, height
        Pixels.
    with_past
        Whether it takes where points were.
    """

    def __init__(self, gl: Any, width: int, height: int, with_past: bool) -> None:
        size = width, height
        self._shape = height, width
        self._colours = gl.texture(size, 4, dtype="f1")
        self._depth = gl.texture(size, 1, dtype="f4")
        self._entity = gl.texture(size, 1, dtype="i4")
        self._normals = gl.texture(size, 4, dtype="f4")
        planes = [self._colours, self._depth, self._entity, self._normals]
        if with_past:
            self._places = gl.texture(size, 4, dtype="f4")
            planes.append(self._places)
        for plane in planes:
            plane.filter = gl.NEAREST, gl.NEAREST
        self._read_colours = np.empty((height * width, 4), np.uint8)
        self._buffer = gl.framebuffer(planes, gl.depth_texture(size))

    def clear(self) -> None:
        """Draw into it from here on, from nothing."""
        self._buffer.use()
        self._buffer.clear(depth=1.0)

    def depth(self, into: NDArray[np.float32] | None = None) -> NDArray[np.float32]:
        """Return depths, metres, shape ``(h, w)``; 0 for the sky."""
        return self._read(self._depth, np.empty(self._shape, np.float32) if into is None else into)

    def entities(self, into: NDArray[np.int32] | None = None) -> NDArray[np.int32]:
        """Return who is seen, shape ``(h, w)``."""
        return self._read(self._entity, np.empty(self._shape, np.int32) if into is None else into)

    def normals(self) -> NDArray[np.float32]:
        """Return normals, shape ``(h, w, 3)``."""
        return self._read(self._normals, np.empty((*self._shape, 4), np.float32))[..., :3]

    def places(self, depth: NDArray[np.float32], camera: Record) -> NDArray[np.float64]:
        """Return where points were, from where the eye was, shape ``(h, w, 3)``; NaN where that is not known."""
        found = self._read(self._places, np.empty((*self._shape, 4), np.float32)).astype(np.float64)
        return _with_sky(np.where(found[..., 3:] > 0.5, found[..., :3], np.nan), depth, camera)

    def picture_of(self, depth: NDArray[np.float32], entity: NDArray[np.int32]) -> PictureBuffers:
        """Return the picture, given the depths and who is seen in it."""
        size = self._shape[0] * self._shape[1]
        colours = self._read(self._colours, self._read_colours)
        seen = PictureBuffers(
            np.empty((*self._shape, 3), np.uint8), np.empty(size, np.uint8), np.zeros(size + _SPARE, np.uint64)
        )
        halves = seen.keys.view(np.uint32), seen.keys.view(np.float32)
        _unpack(colours, depth.reshape(-1), entity.reshape(-1), seen.rgb.reshape(-1, 3), seen.glass, *halves)
        return seen

    def _read(self, plane: Any, into: NDArray[Any]) -> NDArray[Any]:
        plane.read_into(into)
        return into


@kernel
def _unpack(colours: Any, depth: Any, entity: Any, rgb: Any, glass: Any, whole: Any, real: Any) -> None:
    """Write a picture's pixels and keys; `whole` and `real` are the keys' halves, the lower one first."""
    for i in range(len(depth)):
        rgb[i, 0], rgb[i, 1], rgb[i, 2] = colours[i, 0], colours[i, 1], colours[i, 2]
        glass[i] = colours[i, 3]
        if depth[i] > 0.0:
            real[2 * i + 1] = np.float32(1.0) / depth[i]
            whole[2 * i] = max(entity[i], _NOBODY)


def _with_sky(places: NDArray[np.float64], depth: NDArray[np.float32], camera: Record) -> NDArray[np.float64]:
    """Return places with those of the sky, far away along each pixel's ray."""
    height, width = depth.shape
    right, down, forward = (
        np.array([float(camera[f"{name}_{part}"]) for part in "xyz"]) for name in ("right", "down", "forward")
    )
    u = (np.arange(width) + 0.5 - float(camera["centre_x"])) / float(camera["focal"])
    v = (np.arange(height) + 0.5 - float(camera["centre_y"])) / float(camera["focal"])
    ray = forward + u[None, :, None] * right + v[:, None, None] * down
    return np.where(depth[..., None] > 0.0, places, _SKY * ray)


# What shaders share with the processor's renderer.
_CONSTANTS = {
    "CASTER_ROWS": CASTER_ROWS,
    "CABIN_STEPS": CABIN_STEPS,
    "UNDER_ROOF": UNDER_ROOF,
    "CABIN_LAMP": CABIN_LAMP,
    "CABIN_TILT": CABIN_TILT,
    "CABIN_GREEN": CABIN_GREEN,
    "CABIN_BLUE": CABIN_BLUE,
    "CELL": CELL,
    "AROUND_CORNER": AROUND_CORNER,
    "BEFORE": BEFORE,
}


class GlRenderer:
    """Takes pictures of one scene by OpenGL 4.5, through EGL: no window is needed.

    Parameters
    ----------
    scene
        It may change between pictures, as everywhere.

    Raises
    ------
    MissingExtraError
        If moderngl, or a driver, is not there.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self._gl = new_context()
        self._program = Program(self._gl, "surface", _CONSTANTS)
        self._sky = Program(self._gl, "sky", _CONSTANTS)
        self._buffers: dict[str, Any] = {}
        self._told_light: dict[str, Any] = {}
        # The arrays themselves: a number of theirs may be another array's one day.
        self._uploaded: dict[str, NDArray[Any]] = {}
        self._kept: dict[str, Any] = {}
        self._targets: dict[tuple[int, int, bool], Target] = {}

    @property
    def device(self) -> str:
        """Name of what draws."""
        return str(self._gl.info["GL_RENDERER"])

    def take(self, cameras: Cameras, request: PictureRequest) -> Frames:
        """Take pictures with every camera; see `vico.render.frames.take_pictures`."""
        shape = len(cameras), cameras.height, cameras.width
        frames = Frames(
            np.empty((*shape, 3) if request.rgb else (0, 0, 0, 3), np.uint8),
            np.empty(shape if request.depth else (0, 0, 0), np.float32),
            np.empty(shape if request.segmentation else (0, 0, 0), np.int32),
            np.empty((*shape, 3) if request.normals else (0, 0, 0, 3), np.float32),
            np.empty((*shape, 3) if request.past else (0, 0, 0, 3), np.float64),
        )
        light = light_of(self.scene.light(), request.quality)
        self._upload(self.scene.arrays, light)
        self._told_light = light_uniforms(light)
        for k in range(len(cameras)):
            self._take_one(cameras, k, request, light, frames)
        return frames

    def _take_one(self, cameras: Cameras, k: int, request: PictureRequest, light: Light, frames: Frames) -> None:
        samples = request.samples
        room = self.scene.room_of(cameras.position[k])
        camera = camera_uniforms(cameras, k, 1, room)
        camera["most_taps"] = 2 if samples == 1 else 4
        if samples > 1 and request.rgb:
            fine = camera_uniforms(cameras, k, samples, room)
            target = self._draw(fine, light, moving=request.moving)
            wide = self._with_rooms(target.picture_of(target.depth(), target.entities()), fine, light, request)
            blocks = wide.reshape(cameras.height, samples, cameras.width, samples, 3).astype(np.float32)
            rgb = np.round(blocks.mean(axis=(1, 3))).astype(np.uint8)
        target = self._draw(camera, light, moving=request.moving, past=request.past[k] if request.past else None)
        depth = target.depth(frames.depth[k] if len(frames.depth) else None)
        entity = target.entities(frames.segmentation[k] if len(frames.segmentation) else None)
        if len(frames.places):
            frames.places[k] = target.places(depth, camera)
        if len(frames.normals):
            frames.normals[k] = target.normals()
        if request.rgb:
            seen = target.picture_of(depth, entity)
            if samples == 1:
                rgb = self._with_rooms(seen, camera, light, request)
            if request.quality.ambient_occlusion:
                occlude(camera, seen.keys, rgb)
            if request.quality.smooth_edges and samples == 1:
                smooth_edges(camera, seen.keys, rgb)
            draw_weather(camera, light, seen.keys, self.scene.moment, rgb)
            frames.rgb[k] = rgb

    def _with_rooms(
        self, seen: PictureBuffers, camera: Record, light: Light, request: PictureRequest
    ) -> NDArray[np.uint8]:
        """Return a picture with the rooms behind its glass; draws anew what its target holds."""
        if request.quality.interiors:

            def draw(inside: Record) -> NDArray[np.uint8]:
                target = self._draw(inside, light, moving=request.moving)
                return target.picture_of(target.depth(), target.entities()).rgb

            show_rooms(self.scene, camera, light.uniforms, seen.keys, seen.glass, draw, seen.rgb)
        return seen.rgb

    def _draw(self, camera: Record, light: Light, *, moving: bool, past: PastPlaces | None = None) -> Target:
        """Draw what a camera sees, with where it was if the past is known."""
        width, height = int(camera["width"]), int(camera["height"])
        size = width, height, past is not None
        target = self._targets.get(size)
        if target is None:
            target = self._targets[size] = Target(self._gl, *size)
        target.clear()
        shadows = self._set_moving(camera, light, past, moving=moving)
        for binding, buffer in self._buffers.values():
            buffer.bind_to_storage_buffer(binding)
        view = view_uniforms(camera)
        self._gl.disable(self._gl.DEPTH_TEST)
        self._sky.tell(view | {"size": SKY_SIZE})
        self._sky.draw(1)
        self._gl.enable(self._gl.DEPTH_TEST)
        self._gl.disable(self._gl.CULL_FACE)
        self._gl.depth_func, self._gl.front_face = "<", "cw"
        self._kept["closeness"].use(0)
        self._kept["relief"].use(1)
        self._program.tell(view | shadows | self._told_light | {"closeness": 0, "relief": 1, "levels_each": LEVELS})
        counts = self.scene.arrays.counts
        self._program.tell({"lit_count": len(self.scene.arrays.windows)})
        self._program.tell({"first_moving": int(counts["static_instances"]), "is_person": 0, "is_instance": 0})
        for start, end in cluster_ranges(self.scene.arrays, camera):
            self._render(start, end - start)
        self._draw_instances(camera, moving=moving)
        if moving and int(counts["avatars"]):
            spans = self.scene.arrays.avatars.span
            self._program.tell({"is_instance": 0, "is_person": 1})
            for start, end in joined_ranges(spans["first_triangle"], spans["end_triangle"]):
                self._render(start, end - start)
        return target

    def _set_moving(self, camera: Record, light: Light, past: PastPlaces | None, *, moving: bool) -> dict[str, Any]:
        """Bring what throws shadows and where things were onto the card; return the uniforms about that."""
        arrays = self.scene.arrays
        casters = packed_casters(arrays, camera, light) if moving else np.zeros((0, 1), np.float32)
        self._buffer("casters", 12, casters)
        beams = packed_beams(arrays.beams, camera, light.uniforms) if moving else np.zeros(0, np.float32)
        self._buffer("beams", 17, beams)
        shown = min(len(arrays.openings), OPENINGS) if moving and not camera["indoors"] else 0
        uniforms: dict[str, Any] = {
            "caster_count": len(casters),
            "beam_count": len(beams) // LAMP_FLOATS,
            "opening_count": shown,
            "with_past": int(past is not None),
        }
        if shown:
            uniforms["openings"] = [tuple(row) for row in packed_openings(arrays, camera).reshape(-1, 4).tolist()]
        if past is None:
            return uniforms
        bodies, things = packed_past(past)
        self._buffer("past_bodies", 13, bodies)
        self._buffer("past_things", 14, things)
        spans = arrays.avatars.span
        first = int(spans["first_vertex"].min()) if len(spans) else 0
        shift = np.array([camera["x"], camera["y"], camera["z"]]) - past.eye
        return uniforms | {
            "eye_moved": tuple(float(v) for v in shift),
            "first_vertex": first,
            "bodies_known": int(len(bodies) > 0),
        }

    def _draw_instances(self, camera: Record, *, moving: bool) -> None:
        numbers, groups = instances_in_view(self.scene.arrays, camera, moving=moving)
        if not groups:
            return
        self._buffer("chosen", 8, numbers)
        self._buffers["chosen"][1].bind_to_storage_buffer(8)
        self._program.tell({"is_instance": 1})
        levels, first = self.scene.arrays.prototypes.levels, 0
        for code, count in groups:
            span = levels[code // 3, code % 3]
            self._program.tell({"first": first})
            self._render(int(span["first_triangle"]), int(span["end_triangle"]) - int(span["first_triangle"]), count)
            first += count

    def _render(self, base: int, triangles: int, instances: int = 1) -> None:
        self._program.tell({"base": base})
        self._program.draw(triangles, instances)

    # Uploading.

    def _upload(self, arrays: SceneArrays, light: Light) -> None:
        """Bring what has changed onto the card; what never moves only once."""
        mesh, textures, instances = arrays.mesh, arrays.textures, arrays.instances
        fresh = self._uploaded.get("mesh") is not mesh.vertex
        self._uploaded["mesh"] = mesh.vertex
        if fresh:
            self._buffer("vertices", 0, mesh.vertex)
            self._buffer("triangles", 1, mesh.triangle)
            self._buffer("entities", 2, mesh.entity)
            self._buffer("cabins", 15, packed_cabins(arrays))
        elif int(arrays.counts["avatars"]):
            spans = arrays.avatars.span
            first, last = int(spans["first_vertex"].min()), int(spans["end_vertex"].max())
            self._buffers["vertices"][1].write(_bytes(mesh.vertex[first:last]), offset=first * mesh.vertex.itemsize)
            first, last = int(spans["first_triangle"].min()), int(spans["end_triangle"].max())
            self._buffers["triangles"][1].write(
                _bytes(mesh.triangle[first:last]), offset=first * mesh.triangle.itemsize
            )
            self._buffers["entities"][1].write(_bytes(mesh.entity[first:last]), offset=first * 4)
        if self._uploaded.get("texels") is not textures.texels:
            self._uploaded["texels"] = textures.texels
            self._buffer("materials", 3, textures.materials)
            self._buffer("starts", 4, textures.start.astype(np.int32))
            self._buffer("texels", 5, textures.texels)
        if self._uploaded.get("windows") is not arrays.windows:
            self._uploaded["windows"] = arrays.windows
            self._buffer("windows", 11, arrays.windows)
        count = int(arrays.counts["instances"])
        self._buffer("matrices", 6, np.ascontiguousarray(instances.matrix[: max(count, 1)]))
        self._buffer("owners", 7, np.ascontiguousarray(instances.entity[: max(count, 1)]))
        if self._uploaded.get("light") is not light.sky:
            self._uploaded["light"] = light.sky
            self._buffer("tone", 9, light.tone.astype(np.int32))
            self._buffer("sky", 10, light.sky)
        if self._uploaded.get("lamps") is not light.lamps.power:
            self._uploaded["lamps"] = light.lamps.power
            self._buffer("lamps", 16, packed_lamps(light.lamps))
        self._texture("closeness", light.shadow.closeness, "u2")
        self._texture("relief", light.relief.height, "f4")

    def _buffer(self, name: str, binding: int, values: NDArray[Any]) -> None:
        data = _bytes(values) if values.size else bytes(64)
        known = self._buffers.get(name)
        if known is not None and known[1].size == len(data):
            known[1].write(data)
            return
        if known is not None:
            known[1].release()
        self._buffers[name] = binding, self._gl.buffer(data)

    def _texture(self, name: str, values: NDArray[Any], kind: str) -> None:
        if self._uploaded.get(name) is values:
            return
        self._uploaded[name] = values
        if name in self._kept:
            self._kept[name].release()
        height, width = values.shape
        texture = self._gl.texture((width, height), 1, _bytes(values), dtype=kind, alignment=1)
        texture.filter = self._gl.NEAREST, self._gl.NEAREST
        self._kept[name] = texture


def _bytes(values: NDArray[Any]) -> Any:
    """Return an array as plain bytes, without a copy where it lies in one piece."""
    return np.ascontiguousarray(values).reshape(-1).view(np.uint8)
