"""glTF 2.0 files of other people: read with suspicion, one node transform deep, as plain triangles.

Only what a city mesh needs is kept: positions, texture coordinates, base colours and textures, and the feature numbers
that 3D Tiles add. What would be read wrongly (another compression, KTX2 textures, glTF 1.0) is refused by name.
"""

from __future__ import annotations

import base64
import binascii
import io
import json
import math
import struct
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from vico.errors import MissingExtraError, SchemaError

_MAGIC, _JSON, _BIN = 0x46546C67, 0x4E4F534A, 0x004E4942
_COMPONENTS: dict[int, np.dtype[Any]] = {
    5120: np.dtype("<i1"),
    5121: np.dtype("<u1"),
    5122: np.dtype("<i2"),
    5123: np.dtype("<u2"),
    5125: np.dtype("<u4"),
    5126: np.dtype("<f4"),
}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_KNOWN = {
    "KHR_draco_mesh_compression",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
    "EXT_texture_webp",
    "CESIUM_RTC",
    "EXT_mesh_features",
    "EXT_structural_metadata",
    "EXT_feature_metadata",
    "CESIUM_primitive_outline",
}
_MOST_VERTICES = 20_000_000
_MOST_PIXELS = 16384 * 8192
_MOST_DEPTH = 200


@dataclass(frozen=True)
class GltfPart:
    """Triangles of one primitive of one node.

    Attributes
    ----------
    positions
        In the file's axes (y up), node transforms applied, float64, shape ``(n, 3)``.
    triangles
        int32, shape ``(m, 3)``.
    uv
        v = 0 is the texture's row 0, float32, shape ``(n, 2)``.
    colour
        Base colour, sRGB uint8, shape ``(n, 3)``.
    texture
        Index into the scene's textures, or -1.
    feature
        The vertices' batch or feature numbers, int32, shape ``(n,)``; None where there are none.
    """

    positions: NDArray[np.float64]
    triangles: NDArray[np.int32]
    uv: NDArray[np.float32]
    colour: NDArray[np.uint8]
    texture: int
    feature: NDArray[np.int32] | None = None


@dataclass(frozen=True)
class GltfScene:
    """What a glTF file shows.

    Attributes
    ----------
    parts
        Its triangles.
    textures
        sRGB, uint8, shape ``(h, w, 3)`` each.
    copyright
        ``asset.copyright``, or an empty string.
    centre
        Of the extension CESIUM_RTC: what is added to all positions once they are turned z up; zeros without.
    """

    parts: tuple[GltfPart, ...]
    textures: tuple[NDArray[np.uint8], ...]
    copyright: str
    centre: NDArray[np.float64]


class GltfFault(ValueError):
    """Something a glTF file must not have; becomes one sentence with the file's name."""


def read_gltf(data: bytes, where: str, *, resource: Callable[[str], bytes] | None = None) -> GltfScene:
    """Read a binary or textual glTF 2.0 file.

    Parameters
    ----------
    data
        The file.
    where
        What to call it in errors.
    resource
        Fetches what the file refers to by a relative address; None refuses such files.

    Raises
    ------
    SchemaError
        If the file is damaged, or needs an extension that is not read here.
    MissingExtraError
        If it is Draco-compressed and DracoPy is not installed.
    """
    try:
        document, binary = _document(data)
        with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is sorted out point by point
            return _Reader(document, binary, resource).scene()
    except GltfFault as fault:
        raise SchemaError(f"{where}: {fault}") from None
    except (ValueError, KeyError, IndexError, TypeError, AttributeError, OverflowError, struct.error) as error:
        told = f"{type(error).__name__}: {' '.join(str(error).split())[:120]}"
        raise SchemaError(f"{where}: not a readable glTF file ({told}); export it anew") from None
    except (RecursionError, MemoryError) as error:
        raise SchemaError(f"{where}: not a readable glTF file ({type(error).__name__}); export it anew") from None


def _document(data: bytes) -> tuple[dict[str, Any], bytes | None]:
    """Return the JSON and the binary chunk."""
    if data[:4] != b"glTF":
        document = json.loads(data)
        if not isinstance(document, dict):
            raise GltfFault("is no glTF document; export it anew")
        return document, None
    if len(data) < 20:
        raise GltfFault(f"truncated after {len(data)} bytes; download it again")
    _, version, length = struct.unpack_from("<III", data)
    if version != 2:
        raise GltfFault(f"is binary glTF {version}; only glTF 2.0 is read: convert it first")
    if length > len(data) or length < 20:
        raise GltfFault(f"truncated at byte {len(data):,} of {length:,}; download it again")
    size, kind = struct.unpack_from("<II", data, 12)
    if kind != _JSON or 20 + size > length:
        raise GltfFault("its first chunk is no JSON, or leaves the file; download it again")
    document = json.loads(data[20 : 20 + size])
    if not isinstance(document, dict):
        raise GltfFault("is no glTF document; export it anew")
    at = 20 + size
    at += -at % 4
    while at + 8 <= length:
        size, kind = struct.unpack_from("<II", data, at)
        if at + 8 + size > length:
            raise GltfFault(f"its chunk at byte {at:,} leaves the file; download it again")
        if kind == _BIN:
            return document, data[at + 8 : at + 8 + size]
        at += 8 + size + (-size % 4)
    return document, None


class _Reader:
    """One glTF document while it is read."""

    def __init__(self, document: dict[str, Any], binary: bytes | None, resource: Callable[[str], bytes] | None) -> None:
        self.document = document
        self.binary = binary
        self.resource = resource
        self.buffers: dict[int, bytes] = {}
        self.textures: list[NDArray[np.uint8]] = []
        self.texture_index: dict[int, int] = {}
        self.vertices = 0

    def scene(self) -> GltfScene:
        """Everything the document's scene shows."""
        asset = self.document.get("asset", {})
        if not str(asset.get("version", "2.0")).startswith("2"):
            raise GltfFault(f"is glTF {asset['version']}; only glTF 2.0 is read: convert it first")
        for name in self.document.get("extensionsRequired", []):
            if "meshopt" in str(name):
                raise GltfFault(f"is compressed with {name}, which is not read; export it plain or with Draco")
            if name == "KHR_texture_basisu":
                raise GltfFault("has KTX2 textures (KHR_texture_basisu), which are not read; export JPEG, PNG or WebP")
            if name not in _KNOWN and not str(name).startswith("KHR_materials_"):
                raise GltfFault(f"requires the extension {name}, which is not read; export it without")
        parts: list[GltfPart] = []
        nodes = self.document.get("nodes", [])
        scenes = self.document.get("scenes", [])
        roots = scenes[self.document.get("scene", 0)].get("nodes", []) if scenes else list(range(len(nodes)))
        seen: set[int] = set()
        stack: list[tuple[int, NDArray[np.float64], int]] = [(index, np.eye(4), 0) for index in reversed(roots)]
        while stack:
            index, above, depth = stack.pop()
            # A node has one parent: whoever comes twice goes round in a circle or multiplies without end.
            if index in seen or depth > _MOST_DEPTH or index < 0:
                raise GltfFault(f"node {index} is its own ancestor or has two parents; export it anew")
            seen.add(index)
            node = nodes[index]
            matrix = above @ _matrix(node)
            if not np.isfinite(matrix).all():
                raise GltfFault(f"node {index} has no finite transform; export it anew")
            if "EXT_mesh_gpu_instancing" in node.get("extensions", {}):
                raise GltfFault("requires the extension EXT_mesh_gpu_instancing, which is not read")
            if "mesh" in node:
                for primitive in self._entry("meshes", node["mesh"])["primitives"]:
                    part = self._part(primitive, matrix)
                    if part is not None:
                        parts.append(part)
            stack += [(child, matrix, depth + 1) for child in reversed(node.get("children", []))]
        centre = self.document.get("extensions", {}).get("CESIUM_RTC", {}).get("center", (0.0, 0.0, 0.0))
        middle = np.asarray(centre, np.float64)
        if middle.shape != (3,) or not np.isfinite(middle).all():
            raise GltfFault("the centre of CESIUM_RTC is no point; export it anew")
        credit = asset.get("copyright", "")
        return GltfScene(tuple(parts), tuple(self.textures), credit if isinstance(credit, str) else "", middle)

    def _entry(self, name: str, index: int) -> dict[str, Any]:
        """Return an entry of one of the document's lists; negative numbers name nothing."""
        if not isinstance(index, int) or index < 0:
            raise GltfFault(f"names {name}[{index}], which is not there; export it anew")
        entry = self.document[name][index]
        if not isinstance(entry, dict):
            raise GltfFault(f"{name}[{index}] is no object; export it anew")
        return entry

    def _part(self, primitive: dict[str, Any], matrix: NDArray[np.float64]) -> GltfPart | None:
        mode = primitive.get("mode", 4)
        if mode not in (4, 5, 6):
            return None  # points and lines have no surface
        attributes = primitive["attributes"]
        draco = primitive.get("extensions", {}).get("KHR_draco_mesh_compression")
        if draco is not None:
            arrays, faces = self._draco(draco, attributes)
        else:
            arrays = {name: self._accessor(attributes[name]) for name in attributes if name in _WANTED}
            faces = None
            if "indices" in primitive:
                faces = self._accessor(primitive["indices"]).ravel().astype(np.int64)
        points = arrays["POSITION"].astype(np.float64)
        if points.ndim != 2 or points.shape[1] != 3:
            raise GltfFault("positions are no triples; export it anew")
        count = len(points)
        self.vertices += count
        if self.vertices > _MOST_VERTICES:
            raise GltfFault(f"has more than {_MOST_VERTICES:,} vertices; cut it into tiles")
        if faces is None:
            faces = np.arange(count)
        triangles = _triangles(faces, mode)
        if triangles.size and (triangles.min() < 0 or triangles.max() >= count):
            raise GltfFault(f"a triangle names vertex {int(triangles.max()):,} of {count:,}; export it anew")
        points = points @ matrix[:3, :3].T + matrix[:3, 3]
        if np.linalg.det(matrix[:3, :3]) < 0:
            triangles = triangles[:, ::-1]  # a mirror turns the faces inside out
        good = np.asarray(np.isfinite(points).all(axis=1))
        if not good.all():
            triangles = triangles[good[triangles].all(axis=1)]
            points = np.where(good[:, None], points, 0.0)
        if not len(triangles):
            return None
        texture, coordinates, colour = self._material(primitive.get("material"), arrays, count)
        feature = next((arrays[name] for name in _FEATURES if name in arrays), None)
        numbers = None if feature is None or feature.size != count else feature.ravel().astype(np.int32)
        # Primitives often share one long list of vertices: each part keeps only its own.
        used, faces = np.unique(triangles, return_inverse=True)
        return GltfPart(
            points[used],
            faces.reshape(-1, 3).astype(np.int32),
            coordinates[used],
            colour[used],
            texture,
            None if numbers is None else numbers[used],
        )

    def _material(
        self, index: int | None, arrays: dict[str, NDArray[Any]], count: int
    ) -> tuple[int, NDArray[np.float32], NDArray[np.uint8]]:
        """Texture, texture coordinates and colours of a primitive."""
        material: dict[str, Any] = {} if index is None else self._entry("materials", index)
        pbr = material.get("pbrMetallicRoughness", {})
        said = pbr.get("baseColorTexture")
        factor = pbr.get("baseColorFactor", (1.0, 1.0, 1.0, 1.0))
        old = material.get("extensions", {}).get("KHR_materials_pbrSpecularGlossiness")
        if old is not None and said is None:
            said, factor = old.get("diffuseTexture"), old.get("diffuseFactor", factor)
        linear = np.broadcast_to(np.asarray(factor, np.float64)[:3], (count, 3))
        tint = arrays.get("COLOR_0")
        if tint is not None and tint.shape[0] == count and tint.ndim == 2 and tint.shape[1] >= 3:
            linear = linear * tint[:, :3]
        colour = _srgb(linear)
        coordinates = np.zeros((count, 2), np.float32)
        if said is None:
            return -1, coordinates, colour
        change = said.get("extensions", {}).get("KHR_texture_transform", {})
        source = arrays.get(f"TEXCOORD_{change.get('texCoord', said.get('texCoord', 0))}")
        if source is None or source.shape != (count, 2):
            return -1, coordinates, colour
        coordinates = source.astype(np.float64)
        if change:
            angle = float(change.get("rotation", 0.0))
            c, s = math.cos(angle), math.sin(angle)
            u, v = (coordinates * np.asarray(change.get("scale", (1.0, 1.0)), np.float64)).T
            coordinates = np.stack([c * u + s * v, -s * u + c * v], axis=1)
            coordinates = coordinates + np.asarray(change.get("offset", (0.0, 0.0)), np.float64)
        # Number that are none would poison every look-up near them.
        coordinates = np.nan_to_num(coordinates, nan=0.0, posinf=0.0, neginf=0.0)
        return self._texture(said["index"]), np.ascontiguousarray(coordinates, np.float32), colour

    def _texture(self, index: int) -> int:
        entry = self._entry("textures", index)
        source = entry.get("extensions", {}).get("EXT_texture_webp", {}).get("source", entry.get("source"))
        if source is None:
            if "KHR_texture_basisu" in entry.get("extensions", {}):
                raise GltfFault("has KTX2 textures (KHR_texture_basisu), which are not read; export JPEG, PNG or WebP")
            return -1
        if source not in self.texture_index:
            image = self._entry("images", source)
            if "bufferView" in image:
                data = bytes(self._view(image["bufferView"])[0])
            else:
                data = self._bytes_at(image["uri"])
            if data[:12] == b"\xabKTX 20\xbb\r\n\x1a\n":
                raise GltfFault("has KTX2 textures, which are not read; export JPEG, PNG or WebP")
            self.texture_index[source] = len(self.textures)
            self.textures.append(_picture(data))
        return self.texture_index[source]

    def _bytes_at(self, uri: str) -> bytes:
        if uri.startswith("data:"):
            head, _, body = uri.partition(",")
            if not head.endswith(";base64"):
                raise GltfFault("holds a data address that is not base64; export it anew")
            try:
                return base64.b64decode(body, validate=True)
            except binascii.Error:
                raise GltfFault("holds a broken data address; export it anew") from None
        if self.resource is None:
            raise GltfFault(f"refers to {uri[:80]!r} outside itself; export it as one .glb file")
        return self.resource(uri)

    def _buffer(self, index: int) -> bytes:
        if index not in self.buffers:
            uri = self._entry("buffers", index).get("uri")
            if uri is not None:
                self.buffers[index] = self._bytes_at(uri)
            elif index == 0 and self.binary is not None:
                self.buffers[index] = self.binary
            else:
                raise GltfFault(f"its buffer {index} is not there; download it again")
        return self.buffers[index]

    def _view(self, index: int) -> tuple[memoryview, int]:
        """Return the bytes of a buffer view, and its stride (0: packed)."""
        view = self._entry("bufferViews", index)
        for name in view.get("extensions", {}):
            if "meshopt" in name:
                raise GltfFault(f"is compressed with {name}, which is not read; export it plain or with Draco")
        buffer = self._buffer(view["buffer"])
        start, size = view.get("byteOffset", 0), view["byteLength"]
        if start < 0 or size < 0 or start + size > len(buffer):
            raise GltfFault(f"buffer view {index} leaves the file; download it again")
        return memoryview(buffer)[start : start + size], int(view.get("byteStride", 0))

    def _accessor(self, index: int) -> NDArray[Any]:
        """Return an accessor's values, normalised ones as float."""
        accessor = self._entry("accessors", index)
        kind = _COMPONENTS[accessor["componentType"]]
        width = _WIDTHS[accessor["type"]]
        count = accessor["count"]
        if not isinstance(count, int) or not 0 <= count <= _MOST_VERTICES * 3:
            raise GltfFault(f"accessor {index} claims {count} values; export it anew")
        if "bufferView" in accessor:
            values = self._strided(accessor["bufferView"], accessor.get("byteOffset", 0), kind, width, count, index)
        else:
            values = np.zeros((count, width), kind)
        sparse = accessor.get("sparse")
        if sparse:
            values = values.copy()
            many = sparse["count"]
            at, new = sparse["indices"], sparse["values"]
            which = self._strided(
                at["bufferView"], at.get("byteOffset", 0), _COMPONENTS[at["componentType"]], 1, many, index
            )
            values[which[:, 0]] = self._strided(new["bufferView"], new.get("byteOffset", 0), kind, width, many, index)
        if accessor.get("normalized") and kind.kind in "iu":
            values = np.maximum(values / float(np.iinfo(kind).max), -1.0)
        return values[:, 0] if width == 1 else values

    def _strided(self, view: int, offset: int, kind: np.dtype[Any], width: int, count: int, index: int) -> NDArray[Any]:
        data, stride = self._view(view)
        packed = kind.itemsize * width
        stride = stride or packed
        if count and (offset < 0 or stride < packed or offset + stride * (count - 1) + packed > len(data)):
            raise GltfFault(f"accessor {index} reaches past its buffer view; download it again")
        values: NDArray[Any] = np.ndarray((count, width), kind, data, offset, (stride, kind.itemsize))
        return values

    def _draco(
        self, entry: dict[str, Any], attributes: dict[str, Any]
    ) -> tuple[dict[str, NDArray[Any]], NDArray[np.int64]]:
        try:
            import DracoPy
        except ImportError:
            raise MissingExtraError(
                "Draco-compressed tiles need DracoPy: pip install 'virtual-community[photos]'"
            ) from None
        data = bytes(self._view(entry["bufferView"])[0])
        try:
            mesh = DracoPy.decode(data)
            faces = np.asarray(mesh.faces, np.int64).ravel()
            found = {int(a["unique_id"]): np.asarray(a["data"]) for a in mesh.attributes}
        except Exception as error:  # the decoder raises classes of its own and bare ones
            raise GltfFault(f"its Draco data is broken ({' '.join(str(error).split())[:80]}); download again") from None
        arrays: dict[str, NDArray[Any]] = {}
        for name, number in entry["attributes"].items():
            if name not in _WANTED:
                continue
            values = found[number]
            accessor = self._entry("accessors", attributes[name]) if name in attributes else {}
            # Draco hands out integers in wider types than they have: what they mean the accessor says.
            kind = _COMPONENTS[accessor.get("componentType", 5126)]
            if accessor.get("normalized") and kind.kind in "iu" and values.dtype.kind in "iu":
                values = np.maximum(values / float(np.iinfo(kind).max), -1.0)
            arrays[name] = values[:, 0] if values.ndim == 2 and values.shape[1] == 1 else values
        return arrays, faces


_FEATURES = ("_BATCHID", "_FEATURE_ID_0", "BATCHID")
_WANTED = {"POSITION", "COLOR_0", "TEXCOORD_0", "TEXCOORD_1", "TEXCOORD_2", "TEXCOORD_3", *_FEATURES}


def _matrix(node: dict[str, Any]) -> NDArray[np.float64]:
    """Return a node's own transform."""
    if "matrix" in node:
        return np.asarray(node["matrix"], np.float64).reshape(4, 4).T
    matrix = np.eye(4)
    x, y, z, w = np.asarray(node.get("rotation", (0.0, 0.0, 0.0, 1.0)), np.float64)
    size = math.sqrt(x * x + y * y + z * z + w * w)
    if size > 0:
        x, y, z, w = x / size, y / size, z / size, w / size
        matrix[:3, :3] = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    matrix[:3, :3] *= np.asarray(node.get("scale", (1.0, 1.0, 1.0)), np.float64)[None, :]
    matrix[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
    return matrix


def _triangles(faces: NDArray[np.int64], mode: int) -> NDArray[np.int64]:
    """Triples of a list, strip or fan."""
    if mode == 4:
        return faces[: len(faces) // 3 * 3].reshape(-1, 3)
    many = max(len(faces) - 2, 0)
    k = np.arange(many)
    if mode == 5:
        odd = k % 2
        return np.stack([faces[k], faces[k + 1 + odd], faces[k + 2 - odd]], axis=1).reshape(-1, 3)
    first = faces[:1].repeat(many)
    return np.stack([first, faces[k + 1], faces[k + 2]], axis=1).reshape(-1, 3)


def _srgb(linear: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Linear colours 0..1 as sRGB bytes."""
    value = np.clip(np.nan_to_num(linear), 0.0, 1.0)
    curved = np.where(value <= 0.0031308, 12.92 * value, 1.055 * np.maximum(value, 1e-9) ** (1 / 2.4) - 0.055)
    return np.round(curved * 255).astype(np.uint8)


def _picture(data: bytes) -> NDArray[np.uint8]:
    """Decode a PNG, JPEG or WebP image."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with Image.open(io.BytesIO(data), formats=("JPEG", "PNG", "WEBP")) as picture:
                if picture.width * picture.height > _MOST_PIXELS:
                    raise GltfFault(f"a texture of {picture.width} x {picture.height} pixels is too large")
                return np.array(picture.convert("RGB"))
    except (OSError, SyntaxError, Image.DecompressionBombError, EOFError) as error:
        raise GltfFault(f"a texture is no readable JPEG, PNG or WebP ({str(error)[:80]}); download again") from None
