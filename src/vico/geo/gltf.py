"""glTF 2.0 files of other people: read with suspicion, one node transform deep, as plain triangles.

Only what a city mesh needs is kept: positions, texture coordinates, base colours and textures, and the feature numbers
that 3D Tiles add. What would be read wrongly (another compression, KTX2 textures, glTF 1.0) is refused by name.
"""

from __future__ import annotations

import io
import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from vico.errors import MissingExtraError
from vico.io.gltf_file import COMPONENTS, GltfFault, GltfFile, gltf_errors, node_matrix

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
    """Triangles and textures of a glTF file.

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
    with gltf_errors(where), np.errstate(over="ignore", invalid="ignore"):  # what is not finite is sorted out later
        return _Reader(GltfFile.of(data, resource)).scene()


class _Reader:
    """One glTF document while it is read."""

    def __init__(self, file: GltfFile) -> None:
        self.file = file
        self.document = file.document
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
            matrix = above @ node_matrix(node)
            if not np.isfinite(matrix).all():
                raise GltfFault(f"node {index} has no finite transform; export it anew")
            if "EXT_mesh_gpu_instancing" in node.get("extensions", {}):
                raise GltfFault("requires the extension EXT_mesh_gpu_instancing, which is not read")
            if "mesh" in node:
                for primitive in self.file.entry("meshes", node["mesh"])["primitives"]:
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

    def _part(self, primitive: dict[str, Any], matrix: NDArray[np.float64]) -> GltfPart | None:
        mode = primitive.get("mode", 4)
        if mode not in (4, 5, 6):
            return None  # points and lines have no surface
        attributes = primitive["attributes"]
        draco = primitive.get("extensions", {}).get("KHR_draco_mesh_compression")
        if draco is not None:
            arrays, faces = self._draco(draco, attributes)
        else:
            arrays = {name: self.file.accessor(attributes[name]) for name in attributes if name in _WANTED}
            faces = None
            if "indices" in primitive:
                faces = self.file.accessor(primitive["indices"]).ravel().astype(np.int64)
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
        material: dict[str, Any] = {} if index is None else self.file.entry("materials", index)
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
        entry = self.file.entry("textures", index)
        source = entry.get("extensions", {}).get("EXT_texture_webp", {}).get("source", entry.get("source"))
        if source is None:
            if "KHR_texture_basisu" in entry.get("extensions", {}):
                raise GltfFault("has KTX2 textures (KHR_texture_basisu), which are not read; export JPEG, PNG or WebP")
            return -1
        if source not in self.texture_index:
            image = self.file.entry("images", source)
            if "bufferView" in image:
                data = bytes(self.file.view(image["bufferView"])[0])
            else:
                data = self.file.bytes_at(image["uri"])
            if data[:12] == b"\xabKTX 20\xbb\r\n\x1a\n":
                raise GltfFault("has KTX2 textures, which are not read; export JPEG, PNG or WebP")
            self.texture_index[source] = len(self.textures)
            self.textures.append(_picture(data))
        return self.texture_index[source]

    def _draco(
        self, entry: dict[str, Any], attributes: dict[str, Any]
    ) -> tuple[dict[str, NDArray[Any]], NDArray[np.int64]]:
        try:
            import DracoPy
        except ImportError:
            raise MissingExtraError(
                "Draco-compressed tiles need DracoPy: pip install 'virtual-community[photos]'"
            ) from None
        data = bytes(self.file.view(entry["bufferView"])[0])
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
            accessor = self.file.entry("accessors", attributes[name]) if name in attributes else {}
            # Draco hands out integers in wider types than they have: what they mean the accessor says.
            kind = COMPONENTS[accessor.get("componentType", 5126)]
            if accessor.get("normalized") and kind.kind in "iu" and values.dtype.kind in "iu":
                values = np.maximum(values / float(np.iinfo(kind).max), -1.0)
            arrays[name] = values[:, 0] if values.ndim == 2 and values.shape[1] == 1 else values
        return arrays, faces


_FEATURES = ("_BATCHID", "_FEATURE_ID_0", "BATCHID")
_WANTED = {"POSITION", "COLOR_0", "TEXCOORD_0", "TEXCOORD_1", "TEXCOORD_2", "TEXCOORD_3", *_FEATURES}


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
