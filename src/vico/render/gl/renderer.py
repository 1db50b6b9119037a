"""Takes pictures by OpenGL: uploads a scene's arrays as they are, culls with numpy, draws, and reads back."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.errors import MissingExtraError
from vico.render.arrays import SceneArrays
from vico.render.behind.panes import show_rooms
from vico.render.cameras import Cameras
from vico.render.frames import Frames, PictureRequest, light_of
from vico.render.gl.culling import cluster_ranges, instances_in_view, joined_ranges
from vico.render.gl.lamps import LAMP_FLOATS, packed_beams, packed_lamps
from vico.render.gl.moving import CASTER_ROWS, OPENINGS, packed_cabins, packed_casters, packed_openings, packed_past
from vico.render.lamps.grid import CELL
from vico.render.lighting import TONE_RANGE, TONE_STEPS
from vico.render.records import CABIN_STEPS
from vico.render.scene import Scene
from vico.render.sensors.past import PastPlaces
from vico.render.shading.finishing import occlude, smooth_edges
from vico.render.shading.lamplight import AROUND_CORNER, BEFORE
from vico.render.shading.light import Light
from vico.render.shading.sky import SKY_SIZE
from vico.render.shading.weather import draw_weather
from vico.render.shadows import cabins
from vico.render.textures import LEVELS
from vico.render.uniforms import Record, camera_uniforms

_HERE = Path(__file__).parent
_NOBODY = 1
# What shaders share with the processor's renderer.
_CONSTANTS = {
    "CASTER_ROWS": CASTER_ROWS,
    "CABIN_STEPS": CABIN_STEPS,
    "UNDER_ROOF": cabins.UNDER_ROOF,
    "CABIN_LAMP": cabins.CABIN_LAMP,
    "CABIN_TILT": cabins.CABIN_TILT,
    "CABIN_GREEN": cabins.CABIN_GREEN,
    "CABIN_BLUE": cabins.CABIN_BLUE,
    "CELL": CELL,
    "AROUND_CORNER": AROUND_CORNER,
    "BEFORE": BEFORE,
}
# The sky is this far away, metres: only turning moves it.
_SKY = 1e7


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
        self._gl = _context()
        self._program = self._gl.program(*_sources("surface"))
        self._sky = self._gl.program(*_sources("sky"))
        self._empty = self._gl.vertex_array(self._program, [])
        self._empty_sky = self._gl.vertex_array(self._sky, [])
        self._buffers: dict[str, Any] = {}
        # The arrays themselves: a number of theirs may be another array's one day.
        self._uploaded: dict[str, NDArray[Any]] = {}
        self._kept: dict[str, Any] = {}
        self._targets: dict[tuple[int, int, bool], Any] = {}

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
            wide = self._colours(fine, light, request)
            blocks = wide.reshape(cameras.height, samples, cameras.width, samples, 3).astype(np.float32)
            rgb = np.round(blocks.mean(axis=(1, 3))).astype(np.uint8)
        elif request.rgb:
            rgb = self._colours(camera, light, request)
        target = self._draw(camera, light, moving=request.moving, past=request.past[k] if request.past else None)
        if len(frames.places):
            frames.places[k] = _with_sky(target.places(), target.depth(), camera)
        if len(frames.depth):
            frames.depth[k] = target.depth()
        if len(frames.segmentation):
            frames.segmentation[k] = target.entities()
        if len(frames.normals):
            frames.normals[k] = target.normals()
        if request.rgb:
            keys = _keys(target.depth(), target.entities())
            if request.quality.ambient_occlusion:
                occlude(camera, keys, rgb)
            if request.quality.smooth_edges and samples == 1:
                smooth_edges(camera, keys, rgb)
            draw_weather(camera, light, keys, self.scene.moment, rgb)
            frames.rgb[k] = rgb

    def _colours(self, camera: Record, light: Light, request: PictureRequest) -> NDArray[np.uint8]:
        """Return what a camera sees, with rooms behind glass."""
        target = self._draw(camera, light, moving=request.moving)
        rgb = target.colours()
        if request.quality.interiors:
            keys, glass = _keys(target.depth(), target.entities()), target.glass()

            def draw(inside: Record) -> NDArray[np.uint8]:
                return self._draw(inside, light, moving=request.moving).colours()

            show_rooms(self.scene, camera, light.uniforms, keys, glass, draw, rgb)
        return rgb

    def _draw(self, camera: Record, light: Light, *, moving: bool, past: PastPlaces | None = None) -> _Target:
        """Draw what a camera sees, with where it was if the past is known."""
        width, height = int(camera["width"]), int(camera["height"])
        size = width, height, past is not None
        target = self._targets.get(size)
        if target is None:
            target = self._targets[size] = _Target(self._gl, *size)
        target.clear()
        shadows = self._set_moving(camera, light, past, moving=moving)
        for binding, buffer in self._buffers.values():
            buffer.bind_to_storage_buffer(binding)
        view = _view_uniforms(camera)
        self._gl.disable(self._gl.DEPTH_TEST)
        _set(self._sky, view | {"size": SKY_SIZE, "indoors": int(camera["indoors"])})
        self._empty_sky.render(self._gl.TRIANGLES, vertices=3)
        self._gl.enable(self._gl.DEPTH_TEST)
        self._gl.disable(self._gl.CULL_FACE)
        self._gl.depth_func, self._gl.front_face = "<", "cw"
        self._kept["closeness"].use(0)
        self._kept["relief"].use(1)
        _set(
            self._program,
            view | shadows | _light_uniforms(light) | {"closeness": 0, "relief": 1, "levels_each": LEVELS},
        )
        counts = self.scene.arrays.counts
        _set(self._program, {"first_moving": int(counts["static_instances"]), "is_person": 0, "is_instance": 0})
        for start, end in cluster_ranges(self.scene.arrays, camera):
            self._render(start, end - start)
        _set(self._program, {"is_instance": 1})
        self._draw_instances(camera, moving=moving)
        if moving and int(counts["avatars"]):
            spans = self.scene.arrays.avatars.span
            _set(self._program, {"is_instance": 0, "is_person": 1})
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
        code, number = instances_in_view(self.scene.arrays, camera, moving=moving)
        if not len(number):
            return
        order = np.argsort(code, kind="stable")
        code, number = code[order], number[order].astype(np.int32)
        self._buffer("chosen", 8, number)
        self._buffers["chosen"][1].bind_to_storage_buffer(8)
        starts = np.flatnonzero(np.diff(code, prepend=-1))
        ends = np.append(starts[1:], len(code))
        levels = self.scene.arrays.prototypes.levels
        for start, end in zip(starts.tolist(), ends.tolist(), strict=True):
            span = levels[code[start] // 3, code[start] % 3]
            _set(self._program, {"first": start})
            triangles = int(span["end_triangle"]) - int(span["first_triangle"])
            self._render(int(span["first_triangle"]), triangles, end - start)

    def _render(self, base: int, triangles: int, instances: int = 1) -> None:
        if triangles > 0:
            self._program["base"].value = base
            self._empty.render(self._gl.TRIANGLES, vertices=3 * triangles, instances=instances)

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
            self._buffer("materials", 3, textures.materials)
            self._buffer("starts", 4, textures.start.astype(np.int32))
            self._buffer("texels", 5, textures.texels)
            self._buffer("cabins", 15, packed_cabins(arrays))
        elif int(arrays.counts["avatars"]):
            spans = arrays.avatars.span
            first, last = int(spans["first_vertex"].min()), int(spans["end_vertex"].max())
            self._buffers["vertices"][1].write(mesh.vertex[first:last].tobytes(), offset=first * mesh.vertex.itemsize)
            first, last = int(spans["first_triangle"].min()), int(spans["end_triangle"].max())
            self._buffers["triangles"][1].write(
                mesh.triangle[first:last].tobytes(), offset=first * mesh.triangle.itemsize
            )
            self._buffers["entities"][1].write(mesh.entity[first:last].tobytes(), offset=first * 4)
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
        data = np.ascontiguousarray(values).tobytes() or bytes(64)
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
        texture = self._gl.texture((width, height), 1, np.ascontiguousarray(values).tobytes(), dtype=kind, alignment=1)
        texture.filter = self._gl.NEAREST, self._gl.NEAREST
        self._kept[name] = texture


class _Target:
    """A frame buffer with all outputs; its first row is the picture's upper one."""

    def __init__(self, gl: Any, width: int, height: int, with_past: bool) -> None:
        size = width, height
        self._shape = height, width
        self._planes = [
            gl.texture(size, 4, dtype="f1"),
            gl.texture(size, 1, dtype="f4"),
            gl.texture(size, 1, dtype="i4"),
            gl.texture(size, 4, dtype="f4"),
        ]
        if with_past:
            self._planes.append(gl.texture(size, 4, dtype="f4"))
        for plane in self._planes:
            plane.filter = gl.NEAREST, gl.NEAREST
        self._buffer = gl.framebuffer(self._planes, gl.depth_texture(size))

    def clear(self) -> None:
        self._buffer.use()
        self._buffer.clear(depth=1.0)

    def glass(self) -> NDArray[np.uint8]:
        """Return how much of what is behind is seen through each pixel, of 255, in one dimension."""
        return np.ascontiguousarray(self._read(0, np.uint8, 4)[..., 3]).reshape(-1)

    def colours(self) -> NDArray[np.uint8]:
        return np.ascontiguousarray(self._read(0, np.uint8, 4)[..., :3])

    def depth(self) -> NDArray[np.float32]:
        return self._read(1, np.float32, 1)[..., 0]

    def entities(self) -> NDArray[np.int32]:
        return self._read(2, np.int32, 1)[..., 0]

    def normals(self) -> NDArray[np.float32]:
        return self._read(3, np.float32, 4)[..., :3]

    def places(self) -> NDArray[np.float64]:
        """Return where points were, from where the eye was, as far as that is known."""
        found = self._read(4, np.float32, 4).astype(np.float64)
        return np.where(found[..., 3:] > 0.5, found[..., :3], np.nan)

    def _read(self, plane: int, kind: Any, channels: int) -> NDArray[Any]:
        return np.frombuffer(self._planes[plane].read(), kind).reshape(*self._shape, channels).copy()


def _context() -> Any:
    try:
        import moderngl
    except ImportError:
        raise MissingExtraError(
            "the renderer gl needs moderngl: pip install 'vico[gl]', or take the renderer cpu"
        ) from None
    try:
        context = moderngl.create_standalone_context(backend="egl", require=450)
    except Exception as error:  # whatever a driver says
        raise MissingExtraError(
            f"the renderer gl finds no OpenGL 4.5 through EGL ({error}); install a driver (Debian: apt install libegl1 "
            "libgl1-mesa-dri), or take the renderer cpu"
        ) from None
    return context


def _sources(name: str) -> tuple[str, str]:
    """Return the sources of a program's vertex and fragment shader."""
    fragment = (_HERE / f"{name}.frag").read_text()
    for constant, value in _CONSTANTS.items():
        fragment = fragment.replace(f"%{constant}%", str(value))
    return (_HERE / f"{name}.vert").read_text(), fragment


def _keys(depth: NDArray[np.float32], entity: NDArray[np.int32]) -> NDArray[np.uint64]:
    """Return keys as the visibility pass leaves them, as far as what comes after shading looks at them."""
    seen = depth > 0
    inverse = np.where(seen, 1.0 / np.where(seen, depth, 1.0), 0.0).astype(np.float32)
    number = np.where(seen, np.maximum(entity, _NOBODY), 0).astype(np.uint64)
    keys = (inverse.view(np.uint32).astype(np.uint64) << np.uint64(32)) | number
    return np.concatenate([keys.reshape(-1), np.zeros(64, np.uint64)])


def _with_sky(places: NDArray[np.float64], depth: NDArray[np.float32], camera: Record) -> NDArray[np.float64]:
    """Return places with those of the sky, far away along each pixel's ray."""
    height, width = depth.shape
    right, down, forward = (np.array(_vector(camera, name)) for name in ("right", "down", "forward"))
    u = (np.arange(width) + 0.5 - float(camera["centre_x"])) / float(camera["focal"])
    v = (np.arange(height) + 0.5 - float(camera["centre_y"])) / float(camera["focal"])
    ray = forward + u[None, :, None] * right + v[:, None, None] * down
    return np.where(depth[..., None] > 0.0, places, _SKY * ray)


def _set(program: Any, values: dict[str, Any]) -> None:
    """Set uniforms; what the compiler has left out of a program is left out."""
    for name, value in values.items():
        if name in program:
            program[name].value = value


def _vector(record: Record, name: str, parts: str = "xyz") -> tuple[float, ...]:
    return tuple(float(record[f"{name}_{part}"]) for part in parts)


def _colour(record: Record, name: str) -> tuple[float, ...]:
    return tuple(float(record[f"{name}_{part}"]) for part in ("red", "green", "blue"))


def _view_uniforms(camera: Record) -> dict[str, Any]:
    focal = float(camera["focal"])
    return {
        "eye": (float(camera["x"]), float(camera["y"]), float(camera["z"])),
        "right": _vector(camera, "right"),
        "down": _vector(camera, "down"),
        "forward": _vector(camera, "forward"),
        "scale": (2.0 * focal / float(camera["width"]), 2.0 * focal / float(camera["height"])),
        "centre": (
            2.0 * float(camera["centre_x"]) / float(camera["width"]) - 1.0,
            2.0 * float(camera["centre_y"]) / float(camera["height"]) - 1.0,
        ),
        "near": float(camera["near"]),
        "far": float(camera["far"]),
        "indoors": int(camera["indoors"]),
        "hidden": int(camera["hidden_entity"]),
        "most_taps": int(camera["most_taps"]),
        "room_place": (*_vector(camera, "room"), float(camera["room_cos"])),
        "room_size": (
            float(camera["room_half_length"]),
            float(camera["room_half_width"]),
            float(camera["room_height"]),
            float(camera["room_sin"]),
        ),
        "room_light": tuple(float(camera[f"room_{name}"]) for name in ("lamp", "around", "window")),
    }


def _light_uniforms(light: Light) -> dict[str, Any]:
    u = light.uniforms
    relief, grid = light.relief, light.lamps
    return {
        "lamp_grid": (float(grid.x), float(grid.y), float(grid.columns), float(grid.rows)),
        "lamp_parts": (len(grid.start), len(grid.start) + LAMP_FLOATS * len(grid.lamps)),
        "sun": _vector(u, "sun"),
        "sun_colour": _colour(u, "sun"),
        "ambient": _colour(u, "ambient"),
        "tilt": _colour(u, "tilt"),
        "haze": _colour(u, "haze"),
        "side": _vector(u, "side", "xy"),
        "unlit": (float(u["unlit_x"]), float(u["unlit_y"]), float(u["unlit_radius"])),
        "haze_per_metre": float(u["haze_per_metre"]),
        "lamp_exposure": float(u["lamp_exposure"]),
        "wet": float(u["wet"]),
        "snow_cover": float(u["snow_cover"]),
        "softness": float(u["shadow_softness"]),
        "glass": float(u["glass"]),
        "interiors": float(u["interiors"]),
        "tone_scale": (TONE_STEPS - 1) / TONE_RANGE,
        "shadow_frame": tuple(float(v) for v in light.shadow.matrix.T.reshape(-1)),
        "relief_frame": (float(relief.x), float(relief.y), float(relief.texels_per_metre)),
    }
