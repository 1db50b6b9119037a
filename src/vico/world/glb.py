"""Surfaces in a GLB file: binary glTF 2.0 with its textures inside, one node a group of surfaces.

The entity of each vertex is the attribute ``_ENTITY`` (float32, exact up to 2^24), which other glTF readers ignore.
"""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Sequence
from dataclasses import replace
from hashlib import blake2b
from pathlib import Path
from typing import Any
from weakref import WeakValueDictionary

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from vico.errors import SchemaError
from vico.io.files import write_bytes
from vico.threads import in_order
from vico.world.mesh import Material, Surface

# glTF is y-up: (x, y, z) of ours is (x, z, -y) of the file's.
_TO_GLTF = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]], np.float32)
# Component types of accessors, glTF 2.0, 3.6.2.2.
_FLOAT = 5126
_UINT = 5125
_USHORT = 5123
_UBYTE = 5121
# Of JPEG: 40 dB on walls, 37 on roofs; photogrammetry itself is 20 dB off. 84 saves a seventh and costs 1 dB.
_PHOTO_QUALITY = 88
_PNG_LEVEL = 6  # an eighth smaller than 4; 9 takes six times as long for another twelfth
_UNIT = 1e-3  # by how much a normal's length may differ from 1
_FEW = 256  # vertices that are not worth a search for equal ones
_SHAPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}


class _Buffer:
    """The binary chunk while it grows, with its views and accessors."""

    def __init__(self) -> None:
        self.chunks: list[bytes] = []
        self.size = 0
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def view(self, data: bytes, target: int | None = None) -> int:
        padded = data + b"\0" * (-len(data) % 4)
        entry: dict[str, Any] = {"buffer": 0, "byteOffset": self.size, "byteLength": len(data)}
        if target:
            entry["target"] = target
        self.views.append(entry)
        self.chunks.append(padded)
        self.size += len(padded)
        return len(self.views) - 1

    def accessor(self, array: NDArray[Any], component: int, *, bounds: bool = False, normalised: bool = False) -> int:
        width = 1 if array.ndim == 1 else array.shape[1]
        target = 34963 if component in (_UINT, _USHORT) else 34962
        entry: dict[str, Any] = {
            "bufferView": self.view(np.ascontiguousarray(array).tobytes(), target),
            "componentType": component,
            "count": len(array),
            "type": _SHAPES[width],
        }
        if bounds:
            entry["min"], entry["max"] = array.min(0).tolist(), array.max(0).tolist()
        if normalised:
            entry["normalized"] = True
        self.accessors.append(entry)
        return len(self.accessors) - 1


def glb_bytes(layers: dict[str, Sequence[Surface]]) -> bytes:
    """Pack named groups of surfaces (one node each) into a binary glTF 2.0 file with its textures inside.

    Equal vertices of a surface are written once, triangles that have two corners in one place not at all.
    """
    buffer = _Buffer()
    materials: list[dict[str, Any]] = []
    images: list[dict[str, Any]] = []
    known: dict[str, int] = {}
    nodes: list[dict[str, Any]] = []
    meshes: list[dict[str, Any]] = []
    used: dict[str, Material] = {}
    for surface in (surface for group in layers.values() for surface in group if len(surface.triangles)):
        used.setdefault(surface.material.name, surface.material)
    pictures = dict(zip(used, in_order(_picture, used.values()), strict=True))
    for name, surfaces in layers.items():
        primitives = []
        for surface in (_weld_vertices(_sound(given)) for given in surfaces):
            if not len(surface.triangles):
                continue
            material = surface.material
            if material.name not in known:
                known[material.name] = len(materials)
                materials.append(_material_entry(material, pictures[material.name], buffer, images))
            index, kind = (np.uint16, _USHORT) if len(surface.positions) < 0xFFFF else (np.uint32, _UINT)
            rgba = np.concatenate([surface.colour, np.full((len(surface.colour), 1), 255, np.uint8)], axis=1)
            primitives.append(
                {
                    "attributes": {
                        "POSITION": buffer.accessor(surface.positions @ _TO_GLTF.T, _FLOAT, bounds=True),
                        "NORMAL": buffer.accessor(surface.normals @ _TO_GLTF.T, _FLOAT),
                        "TEXCOORD_0": buffer.accessor(surface.uv, _FLOAT),
                        "COLOR_0": buffer.accessor(rgba, _UBYTE, normalised=True),
                        "_ENTITY": buffer.accessor(surface.entity.astype(np.float32), _FLOAT),
                    },
                    "indices": buffer.accessor(surface.triangles.astype(index).ravel(), kind),
                    "material": known[material.name],
                }
            )
        node: dict[str, Any] = {"name": name}
        if primitives:
            node["mesh"] = len(meshes)
            meshes.append({"name": name, "primitives": primitives})
        nodes.append(node)
    document: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "vico"},
        "scene": 0,
        "scenes": [{"nodes": list(range(len(nodes)))}],
        "nodes": nodes,
    }
    if meshes:
        document |= {
            "meshes": meshes,
            "materials": materials,
            "accessors": buffer.accessors,
            "bufferViews": buffer.views,
            "buffers": [{"byteLength": buffer.size}],
        }
    if images:
        document["images"] = images
        document["textures"] = [{"source": i, "sampler": 0} for i in range(len(images))]
        document["samplers"] = [{"wrapS": 10497, "wrapT": 10497, "magFilter": 9729, "minFilter": 9987}]
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    parts = [struct.pack("<II", len(text), 0x4E4F534A), text]
    if buffer.size:
        parts += [struct.pack("<II", buffer.size, 0x004E4942), *buffer.chunks]
    return b"".join([struct.pack("<III", 0x46546C67, 2, 12 + sum(map(len, parts))), *parts])


def _sound(surface: Surface) -> Surface:
    """Return the same surface as glTF wants it: triangles with three corners, normals of length 1."""
    a, b, c = (surface.positions[surface.triangles[:, k]] for k in range(3))
    collapsed = (a == b).all(axis=1) | (b == c).all(axis=1) | (c == a).all(axis=1)
    if collapsed.any():
        surface = replace(surface, triangles=surface.triangles[~collapsed])
    wrong = np.abs(np.linalg.norm(surface.normals, axis=1) - 1.0) > _UNIT
    if not wrong.any():
        return surface
    # What has no normal, as a corner of triangles without area alone, takes that of its triangles, else looks up.
    corners = surface.positions[surface.triangles].astype(np.float64)
    facing = np.zeros(surface.positions.shape)
    for k in range(3):
        np.add.at(
            facing, surface.triangles[:, k], np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        )
    given = surface.normals.astype(np.float64)
    found = np.where((np.linalg.norm(given, axis=1) > _UNIT)[:, None], given, facing)
    length = np.linalg.norm(found, axis=1, keepdims=True)
    found = np.where(length > 1e-12, found / np.maximum(length, 1e-12), (0.0, 0.0, 1.0))
    return replace(surface, normals=np.where(wrong[:, None], found, surface.normals).astype(np.float32))


def _weld_vertices(surface: Surface) -> Surface:
    """Return the same surface with equal vertices once, in the order first met."""
    count = len(surface.positions)
    if count < _FEW:
        return surface
    columns = [*surface.positions.T, *surface.normals.T, *surface.uv.T, *surface.colour.T, surface.entity]
    key = np.zeros(count, np.uint64)
    for column in columns:
        bits = np.ascontiguousarray(column).view(f"u{column.dtype.itemsize}").astype(np.uint64)
        key = (key ^ bits) * np.uint64(0x9E3779B97F4A7C15)
        key ^= key >> np.uint64(29)
    _, first, same = np.unique(key, return_index=True, return_inverse=True)
    if len(first) == count or any((column != column[first][same]).any() for column in columns):
        return surface  # nothing to gain; or two vertices share a key, and all stay as they are
    order = np.argsort(first)
    rank = np.empty(len(first), np.int32)
    rank[order] = np.arange(len(first), dtype=np.int32)
    keep = first[order]
    return replace(
        surface,
        positions=surface.positions[keep],
        normals=surface.normals[keep],
        uv=surface.uv[keep],
        colour=surface.colour[keep],
        entity=surface.entity[keep],
        triangles=rank[same][surface.triangles],
    )


def _picture(material: Material) -> tuple[bytes, str] | None:
    """Return a material's texture as a file, and that file's type."""
    if material.texture is None:
        return None
    if material.photo and material.texture.shape[2] == 3:
        packed = io.BytesIO()
        Image.fromarray(material.texture).save(packed, "JPEG", quality=_PHOTO_QUALITY, optimize=True)
        return packed.getvalue(), "image/jpeg"
    return material.png or packed_png(material.texture), "image/png"


def packed_png(texture: NDArray[np.uint8]) -> bytes:
    """Return a texture as the PNG file that a glTF file holds."""
    packed = io.BytesIO()
    Image.fromarray(texture).save(packed, "PNG", compress_level=_PNG_LEVEL)
    return packed.getvalue()


def _material_entry(
    material: Material, picture: tuple[bytes, str] | None, buffer: _Buffer, images: list[dict[str, Any]]
) -> dict[str, Any]:
    pbr: dict[str, Any] = {"metallicFactor": 0.0, "roughnessFactor": 0.9}
    if picture is not None:
        content, kind = picture
        images.append({"bufferView": buffer.view(content), "mimeType": kind, "name": material.name})
        pbr["baseColorTexture"] = {"index": len(images) - 1}
    entry: dict[str, Any] = {"name": material.name, "pbrMetallicRoughness": pbr}
    if material.cutout:
        entry["alphaMode"], entry["alphaCutoff"] = "MASK", 0.5
    if material.double_sided:
        entry["doubleSided"] = True
    if material.emission:
        entry["extras"] = {"emission": material.emission}
    return entry


def write_glb(path: Path, layers: dict[str, Sequence[Surface]]) -> None:
    """Write named groups of surfaces as one GLB, whole or not at all."""
    write_bytes(path, glb_bytes(layers))


def read_glb(path: Path, *, only: str | None = None) -> dict[str, list[Surface]]:
    """Read a GLB that `write_glb` wrote: surfaces by node name.

    Parameters
    ----------
    only
        Name of the one material whose surfaces are read, without its texture: that takes a tenth of the time.

    Raises
    ------
    SchemaError
        If the file is damaged or uses features these files never have.
    """
    data = path.read_bytes()
    try:
        magic, version, length = struct.unpack_from("<III", data, 0)
        if magic != 0x46546C67 or version != 2 or length != len(data):
            raise ValueError("wrong header or length")
        text_length, _ = struct.unpack_from("<II", data, 12)
        document = json.loads(data[20 : 20 + text_length])
        binary = memoryview(data)[28 + text_length :]
        return _surfaces_of(document, binary, only)
    except (ValueError, KeyError, IndexError, TypeError, struct.error, OSError) as error:
        raise SchemaError(f"{path}: not a readable GLB ({error}); build the world anew") from None


def glb_bounds(path: Path) -> NDArray[np.float64] | None:
    """Read the lowest and the highest corner of the box around a GLB that `write_glb` wrote, shape ``(2, 3)``.

    None where it is empty. Reads the file's head alone.

    Raises
    ------
    SchemaError
        If the file is damaged.
    """
    try:
        with path.open("rb") as file:
            head = file.read(20)
            magic, _, _, length, _ = struct.unpack("<IIIII", head)
            if magic != 0x46546C67:
                raise ValueError("wrong header")
            document = json.loads(file.read(length))
        places = [
            document["accessors"][primitive["attributes"]["POSITION"]]
            for mesh in document.get("meshes", ())
            for primitive in mesh["primitives"]
        ]
        if not places:
            return None
        corners = np.array([[place["min"], place["max"]] for place in places], np.float64) @ _TO_GLTF.astype(np.float64)
    except (ValueError, KeyError, IndexError, TypeError, struct.error, OSError) as error:
        raise SchemaError(f"{path}: not a readable GLB ({error}); build the world anew") from None
    return np.stack([corners.min(axis=(0, 1)), corners.max(axis=(0, 1))])


# Pictures that somebody has, by the digest of their file: files of many tiles hold the same facades.
_DECODED: WeakValueDictionary[bytes, NDArray[np.uint8]] = WeakValueDictionary()


def _decode_picture(packed: memoryview) -> NDArray[np.uint8]:
    """Return the picture of a PNG or JPEG file, not writable; the same one as long as somebody has it."""
    key = blake2b(packed, digest_size=16).digest()
    picture = _DECODED.get(key)
    if picture is None:
        picture = np.asarray(Image.open(io.BytesIO(packed)))
        picture.flags.writeable = False
        _DECODED[key] = picture
    return picture


def _surfaces_of(document: dict[str, Any], binary: memoryview, only: str | None = None) -> dict[str, list[Surface]]:
    types: dict[int, np.dtype[Any]] = {
        _FLOAT: np.dtype(np.float32),
        _UINT: np.dtype(np.uint32),
        _USHORT: np.dtype(np.uint16),
        _UBYTE: np.dtype(np.uint8),
    }
    widths = {name: width for width, name in _SHAPES.items()}

    def bytes_of(index: int) -> memoryview:
        view = document["bufferViews"][index]
        start = view.get("byteOffset", 0)
        if start < 0 or start + view["byteLength"] > len(binary):
            raise ValueError(f"buffer view {index} leaves the file")
        return binary[start : start + view["byteLength"]]

    def array(index: int) -> NDArray[Any]:
        accessor = document["accessors"][index]
        values = np.frombuffer(bytes_of(accessor["bufferView"]), types[accessor["componentType"]])
        width = widths[accessor["type"]]
        return values if width == 1 else values.reshape(-1, width)

    def material(entry: dict[str, Any]) -> Material:
        texture = entry["pbrMetallicRoughness"].get("baseColorTexture") if only is None else None
        pixels, photo = None, False
        if texture is not None:
            image = document["images"][document["textures"][texture["index"]]["source"]]
            pixels = _decode_picture(bytes_of(image["bufferView"]))
            photo = image.get("mimeType") == "image/jpeg"
        return Material(
            entry["name"],
            pixels,
            cutout=entry.get("alphaMode") == "MASK",
            emission=float(entry.get("extras", {}).get("emission", 0.0)),
            double_sided=bool(entry.get("doubleSided", False)),
            photo=photo,
        )

    materials = list(in_order(material, document.get("materials", [])))
    layers: dict[str, list[Surface]] = {}
    for node in document["nodes"]:
        surfaces = layers.setdefault(node["name"], [])
        if "mesh" not in node:
            continue
        for primitive in document["meshes"][node["mesh"]]["primitives"]:
            if only is not None and materials[primitive["material"]].name != only:
                continue
            attributes = primitive["attributes"]
            positions = array(attributes["POSITION"])
            triangles = array(primitive["indices"]).reshape(-1, 3)
            if triangles.size and int(triangles.max()) >= len(positions):
                raise ValueError("a triangle names a vertex that is not there")
            surfaces.append(
                Surface(
                    positions @ _TO_GLTF,
                    array(attributes["NORMAL"]) @ _TO_GLTF,
                    array(attributes["TEXCOORD_0"]).copy(),
                    array(attributes["COLOR_0"])[:, :3].copy(),
                    array(attributes["_ENTITY"]).astype(np.int32),
                    triangles.astype(np.int32),
                    materials[primitive["material"]],
                )
            )
    return layers
