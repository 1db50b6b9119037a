"""Meshes, textures and models of a city, as bytes that a browser hands to its graphics library as they are.

Textures are layers of a few texture arrays: one material then draws all walls of a tile in one call. Meshes are
columns of vertices, then indices. Models stand or move in numbers and have a near and a far shape. Robots are links
with the joints between them. Rooms are one file a building, fetched only when somebody goes in.
"""

from __future__ import annotations

import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from vico.assets.models.library import in_hand_models, signal_prototypes
from vico.assets.models.movable import movable_colours, movable_kinds, movable_prototype, movable_surfaces
from vico.assets.robots import RobotModel, robot_model, robot_names
from vico.assets.simplification import simplify_mesh
from vico.assets.transit_vehicles import train_prototypes, tram_prototypes
from vico.assets.vehicles import CAR_KINDS, lit_lamps, night_lamps, ridden_prototypes, vehicle_prototypes
from vico.io.files import write_bytes
from vico.io.mujoco import mujoco
from vico.world.mesh import Material, Surface
from vico.world.world import World

#: Height and width of each array's layers, pixels: storeys of walls, strips of ground floors, patches that repeat.
SHAPES = ((256, 256), (512, 512), (512, 1024), (256, 2048))
#: Layer 0 of the first array is white: what has no texture of its own.
PLAIN = 0


@dataclass(frozen=True)
class Layer:
    """Where a material's texture is.

    Attributes
    ----------
    array
        Index into `SHAPES`.
    layer
        Index in that array, below 256.
    cutout
        Whether alpha means holes; else it is the share of the material's emission that a texel gives.
    colour
        Mean colour, sRGB 0..255, float64, shape ``(3,)``.
    """

    array: int
    layer: int
    cutout: bool
    colour: NDArray[np.float64]


_WHITE = Layer(0, PLAIN, False, np.full(3, 255.0))


@dataclass
class TextureLayers:
    """Collects textures; the same picture is kept once.

    Attributes
    ----------
    pictures
        Of each array, its layers: sRGB and alpha, uint8, shape ``(h, w, 4)``.
    """

    pictures: list[list[NDArray[np.uint8]]] = field(default_factory=lambda: [[] for _ in SHAPES])
    _known: dict[bytes, Layer] = field(default_factory=dict)
    # By the material itself, which is kept so that its number stays its own.
    _seen: dict[int, tuple[Material, Layer]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Begin with the white layer."""
        self.pictures[0].append(np.full((*SHAPES[0], 4), 255, np.uint8))

    def layer_of(self, material: Material) -> Layer:
        """Return where a material's texture is, adding it if it is new."""
        if material.texture is None:
            return _WHITE
        if id(material) not in self._seen:
            self._seen[id(material)] = material, self._layer_of(material)
        return self._seen[id(material)][1]

    def _layer_of(self, material: Material) -> Layer:
        assert material.texture is not None
        key = repr((material.texture.shape, material.cutout)).encode() + material.texture.tobytes()
        if key not in self._known:
            picture = material.texture
            if picture.shape[2] != 4:  # without an alpha channel: opaque
                alpha = np.full((*picture.shape[:2], 1), 255, np.uint8)
                picture = np.concatenate([picture, alpha], axis=2)
            array = _array_for(*picture.shape[:2])
            if len(self.pictures[array]) >= 255:
                # More pictures than a byte can number: the mean colour is left of the rest.
                return Layer(0, PLAIN, False, picture[:, :, :3].reshape(-1, 3).mean(axis=0))
            self.pictures[array].append(_resize(picture, SHAPES[array]))
            solid = picture[:, :, 3] > 127 if material.cutout else np.ones(picture.shape[:2], np.bool_)
            colour = picture[solid][:, :3].mean(axis=0) if solid.any() else np.full(3, 128.0)
            self._known[key] = Layer(array, len(self.pictures[array]) - 1, material.cutout, colour)
        return self._known[key]

    def files(self) -> Iterable[tuple[dict[str, Any], bytes]]:
        """Yield every layer as a JPEG of its colours and, where its alpha says something, a PNG of that."""
        for array, layers in enumerate(self.pictures):
            for number, picture in enumerate(layers):
                yield {"array": array, "layer": number, "what": "colour"}, _encode(picture[:, :, :3], "JPEG")
                if picture[:, :, 3].min() < 255:
                    yield {"array": array, "layer": number, "what": "alpha"}, _encode(picture[:, :, 3], "PNG")


def _array_for(height: int, width: int) -> int:
    """Return the smallest array whose layers hold a picture; the last that is as wide for those that none holds."""
    for array, (tall, wide) in enumerate(SHAPES):
        if height <= tall and width <= wide:
            return array
    return len(SHAPES) - 1 if width > 2 * height else 2


def _resize(picture: NDArray[np.uint8], shape: tuple[int, int]) -> NDArray[np.uint8]:
    if picture.shape[:2] == shape:
        return np.ascontiguousarray(picture)
    size = shape[1], shape[0]
    # Colour and alpha apart: where alpha is 0 the colour still counts.
    colour = Image.fromarray(np.ascontiguousarray(picture[:, :, :3])).resize(size, Image.Resampling.BICUBIC)
    alpha = Image.fromarray(np.ascontiguousarray(picture[:, :, 3])).resize(size, Image.Resampling.BILINEAR)
    return np.dstack([np.asarray(colour), np.asarray(alpha)])


def _encode(pixels: NDArray[np.uint8], form: str) -> bytes:
    out = io.BytesIO()
    options: dict[str, Any] = {"quality": 88, "subsampling": 0} if form == "JPEG" else {"compress_level": 3}
    Image.fromarray(np.ascontiguousarray(pixels)).save(out, form, **options)
    return out.getvalue()


# The fourth number of normals: alpha means holes; or how many hundredths of its colour a surface gives at night.
_CUTOUT, _FULLY = 127, 100


@dataclass(frozen=True)
class PackedMesh:
    """Triangles that one draw call can draw: all their textures lie in one array.

    Attributes
    ----------
    array
        Which array, an index into `vico.viewer.city.models.SHAPES`.
    both_sides
        Whether triangles are seen from behind too.
    position, uv
        float32, shapes ``(n, 3)`` and ``(n, 2)``.
    normal
        int8, shape ``(n, 4)``, unit vectors times 127; the fourth is 127 where the texture's alpha means holes, else
        the material's emission times 100.
    colour
        uint8, shape ``(n, 4)``: sRGB that multiplies the texture, and the layer.
    entity
        int32, shape ``(n,)``.
    triangles
        int32, shape ``(m, 3)``.
    """

    array: int
    both_sides: bool
    position: NDArray[np.float32]
    normal: NDArray[np.int8]
    uv: NDArray[np.float32]
    colour: NDArray[np.uint8]
    entity: NDArray[np.int32]
    triangles: NDArray[np.int32]

    def select(self, triangles: NDArray[Any]) -> PackedMesh:
        """Return some of the triangles, with the vertices they need."""
        used, faces = np.unique(self.triangles[triangles], return_inverse=True)
        return PackedMesh(
            self.array,
            self.both_sides,
            self.position[used],
            self.normal[used],
            self.uv[used],
            self.colour[used],
            self.entity[used],
            faces.reshape(-1, 3).astype(np.int32),
        )


def pack_surfaces(surfaces: Iterable[Surface], textures: TextureLayers) -> list[PackedMesh]:
    """Return surfaces as meshes, one for each texture array that they use, those seen from both sides apart."""
    by_array: dict[tuple[int, bool], list[tuple[Surface, int, int]]] = {}
    for surface in surfaces:
        if not len(surface.triangles):
            continue
        layer = textures.layer_of(surface.material)
        flag = _CUTOUT if layer.cutout else round(_FULLY * min(surface.material.emission, 1.0))
        both = layer.cutout or surface.material.double_sided
        by_array.setdefault((layer.array, both), []).append((surface, layer.layer, flag))
    return [_join_surfaces(array, both, parts) for (array, both), parts in sorted(by_array.items())]


def _join_surfaces(array: int, both: bool, parts: Sequence[tuple[Surface, int, int]]) -> PackedMesh:
    counts = [len(surface.positions) for surface, _, _ in parts]
    starts = np.cumsum([0, *counts[:-1]])
    normal = np.zeros((sum(counts), 4), np.int8)
    normal[:, :3] = np.round(np.concatenate([np.clip(s.normals, -1, 1) for s, _, _ in parts]) * 127)
    normal[:, 3] = np.repeat([flag for _, _, flag in parts], counts)
    colour = np.empty((sum(counts), 4), np.uint8)
    colour[:, :3] = np.concatenate([surface.colour[:, :3] for surface, _, _ in parts])
    colour[:, 3] = np.repeat([layer for _, layer, _ in parts], counts)
    return PackedMesh(
        array,
        both,
        np.concatenate([s.positions for s, _, _ in parts]).astype(np.float32),
        normal,
        np.concatenate([s.uv for s, _, _ in parts]).astype(np.float32),
        colour,
        np.concatenate([s.entity for s, _, _ in parts]).astype(np.int32),
        np.concatenate([s.triangles + start for (s, _, _), start in zip(parts, starts, strict=True)]).astype(np.int32),
    )


class Blob:
    """Bytes that grow; what is put in is found again by its entry."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._size = 0

    def add(self, content: bytes | NDArray[Any]) -> int:
        """Append bytes, padded to a multiple of four; return where they begin."""
        data = content if isinstance(content, bytes) else np.ascontiguousarray(content).tobytes()
        start = self._size
        padding = -len(data) % 4
        self._parts += [data, b"\0" * padding]
        self._size += len(data) + padding
        return start

    def mesh(self, mesh: PackedMesh) -> dict[str, Any]:
        """Append a mesh; return its entry: where it begins, how many vertices and indices, bounds."""
        short = len(mesh.position) < 65536
        start = self.add(mesh.position)
        for column in (mesh.normal, mesh.uv, mesh.colour, mesh.entity):
            self.add(column)
        self.add(mesh.triangles.astype(np.uint16 if short else np.uint32))
        return {
            "array": mesh.array,
            "both": mesh.both_sides,
            "offset": start,
            "vertices": len(mesh.position),
            "indices": int(mesh.triangles.size),
            "low": np.round(mesh.position.min(axis=0), 2).tolist(),
            "high": np.round(mesh.position.max(axis=0), 2).tolist(),
        }

    def bytes(self) -> bytes:
        """Return everything."""
        return b"".join(self._parts)


# What a shape has from far away.
_FAR_SHARE = 0.14  # of its triangles
_FAR_LEAST = 12  # triangles
_FAR_LEAVES = 0.17  # share of its leaves, each larger


def moving_models() -> dict[str, Sequence[Surface]]:
    """Return the shapes of vehicles, their lamps, and what people carry, by prototype's name."""
    found: dict[str, Sequence[Surface]] = {**vehicle_prototypes(), **ridden_prototypes()}
    found |= tram_prototypes() | train_prototypes() | lit_lamps() | signal_prototypes()
    found |= {f"{kind}:night": [night_lamps(kind)] for kind in (*CAR_KINDS, "bus", "bicycle")}
    found |= {name: model.surfaces for name, model in in_hand_models().items()}
    for kind in movable_kinds():
        for colour in movable_colours():
            found[movable_prototype(kind, colour)] = movable_surfaces(kind, colour)
    return found


def model_entry(surfaces: list[Surface], textures: TextureLayers, blob: Blob) -> dict[str, Any]:
    """Write a shape, from near and from far; return its entry."""
    near = [blob.mesh(mesh) for mesh in pack_surfaces(surfaces, textures)]
    far = [blob.mesh(mesh) for mesh in pack_surfaces(coarse(surfaces, textures), textures)]
    low = np.min([mesh["low"] for mesh in near], axis=0) if near else np.zeros(3)
    high = np.max([mesh["high"] for mesh in near], axis=0) if near else np.zeros(3)
    return {"near": near, "far": far, "low": low.tolist(), "high": high.tolist()}


def coarse(surfaces: Sequence[Surface], textures: TextureLayers) -> list[Surface]:
    """Return shapes as they may look from some sixty metres away, in plain colours but for leaves."""
    found = []
    for surface in surfaces:
        if surface.material.cutout:
            found.append(_fewer_leaves(surface))
        elif len(surface.triangles) <= _FAR_LEAST:
            found.append(surface)
        else:
            found.append(_simplify_surface(surface, textures))
    return found


def _simplify_surface(surface: Surface, textures: TextureLayers) -> Surface:
    wanted = max(_FAR_LEAST, round(_FAR_SHARE * len(surface.triangles)))
    points, faces, kept = simplify_mesh(surface.positions, surface.triangles, wanted)
    if not len(faces):
        return surface
    tint = textures.layer_of(surface.material).colour / 255.0
    corner_colour = (surface.colour[surface.triangles[kept, 0], :3] * tint).astype(np.uint8)
    split = points[faces].reshape(-1, 3)
    colours = np.repeat(corner_colour, 3, axis=0)
    return Surface.from_triangles(split, np.arange(len(split)).reshape(-1, 3), colour=colours)


def _fewer_leaves(surface: Surface) -> Surface:
    """Return a share of the squares that leaves are painted on, each larger, so that a crown stays as dense."""
    squares = _connected_parts(surface.triangles, len(surface.positions))
    numbers = np.unique(squares)
    step = max(1, round(1 / _FAR_LEAVES))
    chosen = np.isin(squares, numbers[::step])
    positions = surface.positions.astype(np.float64).copy()
    for number in numbers[::step].tolist():
        own = np.unique(surface.triangles[squares == number])
        middle = positions[own].mean(axis=0)
        positions[own] = middle + (positions[own] - middle) * np.sqrt(step) * 0.95
    used, faces = np.unique(surface.triangles[chosen], return_inverse=True)
    return Surface(
        positions[used].astype(np.float32),
        surface.normals[used],
        surface.uv[used],
        surface.colour[used],
        surface.entity[used],
        faces.reshape(-1, 3).astype(np.int32),
        surface.material,
    )


def _connected_parts(triangles: NDArray[Any], count: int) -> NDArray[np.int64]:
    """Return a number for each triangle, the same for those that share vertices."""
    owner = np.arange(count)
    while True:
        least = owner[triangles].min(axis=1)
        before = owner.copy()
        for corner in range(3):
            np.minimum.at(owner, triangles[:, corner], least)
        if np.array_equal(owner, before):
            return np.asarray(owner[triangles[:, 0]], np.int64)


def write_instances(world: World, chosen: NDArray[np.bool_], blob: Blob) -> list[dict[str, Any]]:
    """Write where objects stand, by prototype: x, y, z, yaw, scale (float32) of each, then entities (int32)."""
    objects, entries = world.objects, []
    rows = np.flatnonzero(chosen)
    names, which = np.unique(objects.prototype[rows].astype(str), return_inverse=True)
    for k, name in enumerate(names.tolist()):
        own = rows[which == k]
        columns = (objects.x, objects.y, objects.z, objects.yaw, objects.scale)
        table = np.column_stack([column[own] for column in columns]).astype(np.float32)
        offset = blob.add(table)
        blob.add(objects.entity[own].astype(np.int32))
        entries.append({"prototype": name, "offset": offset, "count": len(own)})
    return entries


_HINGE, _SLIDE = int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)


def write_robots(textures: TextureLayers, blob: Blob) -> dict[str, Any]:
    """Write all robots' links; return their entries by model's name."""
    return {name: _robot_entry(robot_model(name), textures, blob) for name in robot_names()}


def _robot_entry(model: RobotModel, textures: TextureLayers, blob: Blob) -> dict[str, Any]:
    """Return links in an order in which each follows its parent.

    A link's ``joints`` turn or slide it, one after the other, about ``axis`` through ``at``, both in the link's own
    frame; ``index`` is the place of the angle among the robot's measured joints, None where nobody measures it.
    """
    physics = mujoco.MjModel.from_xml_string(model.mjcf)
    measured = _measured_joints(physics, model)
    links = []
    for body in range(1, physics.nbody):
        name = mujoco.mj_id2name(physics, mujoco.mjtObj.mjOBJ_BODY, body)
        surfaces = list(model.shapes.get(name, ()))
        links.append(
            {
                "name": name,
                "parent": int(physics.body_parentid[body]) - 1,
                "position": physics.body_pos[body].tolist(),
                "quaternion": physics.body_quat[body].tolist(),
                "joints": _joints_of(physics, body, measured),
                "rotor": _rotor(model, name),
                "near": [blob.mesh(mesh) for mesh in pack_surfaces(surfaces, textures)],
                "far": [blob.mesh(mesh) for mesh in pack_surfaces(coarse(surfaces, textures), textures)],
            }
        )
    # The base is placed by its recorded pose.
    links[0]["position"], links[0]["quaternion"] = [0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]
    return {"title": model.title, "joints": list(model.joints), "rest": model.rest.tolist(), "links": links}


def _measured_joints(physics: mujoco.MjModel, model: RobotModel) -> dict[int, int]:
    """Return which measured joint each joint of the physics is."""
    found = {}
    for index, name in enumerate(model.joints):
        actuator = mujoco.mj_name2id(physics, mujoco.mjtObj.mjOBJ_ACTUATOR, name)
        joint = (
            int(physics.actuator_trnid[actuator, 0])
            if actuator >= 0
            else mujoco.mj_name2id(physics, mujoco.mjtObj.mjOBJ_JOINT, name)
        )
        if joint >= 0:
            found[joint] = index
    return found


def _joints_of(physics: mujoco.MjModel, body: int, measured: dict[int, int]) -> list[dict[str, Any]]:
    first = int(physics.body_jntadr[body])
    entries = []
    for joint in range(first, first + int(physics.body_jntnum[body])) if first >= 0 else ():
        kind = int(physics.jnt_type[joint])
        if kind in (_HINGE, _SLIDE):
            entries.append(
                {
                    "index": measured.get(joint),
                    "slides": kind == _SLIDE,
                    "axis": physics.jnt_axis[joint].tolist(),
                    "at": physics.jnt_pos[joint].tolist(),
                    "zero": float(physics.qpos0[physics.jnt_qposadr[joint]]),
                }
            )
    return entries


def _rotor(model: RobotModel, link: str) -> float:
    """Return 1 or -1 for links that turn with a rotor to the left or right, 0 for others."""
    if model.rotors is None or link not in model.rotors.links:
        return 0.0
    return float(np.asarray(model.rotors.turns)[model.rotors.links.index(link)])


def write_rooms(world: World, textures: TextureLayers, folder: Path) -> dict[str, Any]:
    """Write the rooms of each building and the shapes of what stands in them; return their entries.

    Returns
    -------
    dict
        ``files``: of each building its file, meshes and instances; ``rooms``: of each room, by its index in the world,
        which file it is in.
    """
    index = {building: k for k, building in enumerate(sorted({room.building for room in world.rooms}))}
    file_of_entity = {room.entity: index[room.building] for room in world.rooms}
    parts: dict[int, list[Surface]] = {k: [] for k in index.values()}
    for surface in world.surfaces("rooms"):
        owner = _file_of_triangles(surface, file_of_entity)
        for k in np.unique(owner).tolist():
            if k >= 0:
                parts[k].append(_part_of_surface(surface, owner == k))
    file_of_room = {room.id: index[room.building] for room in world.rooms}
    standing = np.array([file_of_room.get(str(room), -1) for room in world.objects.room], np.int64)
    files: list[dict[str, Any]] = []
    for k in range(len(index)):
        blob = Blob()
        entry: dict[str, Any] = {
            "file": f"rooms_{k}.bin",
            "near": [blob.mesh(mesh) for mesh in pack_surfaces(parts[k], textures)],
            "instances": write_instances(world, standing == k, blob),
        }
        write_bytes(folder / f"rooms_{k}.bin", blob.bytes())
        files.append(entry)
    models, shapes = world.prototypes(), Blob()
    used = {entry["prototype"] for file in files for entry in file["instances"]}
    furniture = {
        name: {"near": [shapes.mesh(mesh) for mesh in pack_surfaces(models[name], textures)], "far": []}
        for name in sorted(used)
    }
    write_bytes(folder / "furniture.bin", shapes.bytes())
    return {"files": files, "rooms": [index[room.building] for room in world.rooms], "furniture": furniture}


def _file_of_triangles(surface: Surface, file_of_entity: dict[int, int]) -> NDArray[np.int64]:
    """Return the file of each triangle, -1 for those of no room."""
    entities, inverse = np.unique(surface.entity[surface.triangles[:, 0]], return_inverse=True)
    files = np.array([file_of_entity.get(entity, -1) for entity in entities.tolist()], np.int64)
    return np.asarray(files[inverse])


def _part_of_surface(surface: Surface, chosen: NDArray[np.bool_]) -> Surface:
    used, faces = np.unique(surface.triangles[chosen], return_inverse=True)
    return replace(
        surface,
        positions=surface.positions[used],
        normals=surface.normals[used],
        uv=surface.uv[used],
        colour=surface.colour[used],
        entity=surface.entity[used],
        triangles=faces.reshape(-1, 3).astype(np.int32),
    )
