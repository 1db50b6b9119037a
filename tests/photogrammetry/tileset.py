"""Writing a textured mesh as a 3D Tiles tileset, so that any viewer of such tiles can stream it.

A quadtree with REPLACE refinement: the leaves hold the mesh as it is, every level above a coarser one with textures of
half the size. Tiles are binary glTF (Draco-compressed if wished) around their own centre, whose earth-centred place is
in the node matrix.
"""

from __future__ import annotations

import io
import json
import math
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from pyproj import Transformer

from vico.errors import EmptyInputError, InputError, MissingExtraError, OutputExistsError
from vico.geo.frame import LocalFrame
from vico.io.files import write_bytes, write_json

_MOST_LEVELS = 8
_POSITION_BITS, _UV_BITS = 16, 14
_QUALITY = 88


class TexturedTriangles(Protocol):
    """What can be written: triangles with textures, ENU metres, as `vico.geo.tiles3d.TileMesh` has them."""

    @property
    def positions(self) -> NDArray[np.float64]:
        """Shape ``(n, 3)``."""

    @property
    def triangles(self) -> NDArray[np.int32]:
        """Shape ``(m, 3)``."""

    @property
    def uv(self) -> NDArray[np.float32]:
        """Texture coordinates, v = 0 is row 0, shape ``(n, 2)``."""

    @property
    def texture_of(self) -> NDArray[np.int32]:
        """Index into the textures of each triangle, or -1."""

    @property
    def textures(self) -> tuple[NDArray[np.uint8], ...]:
        """Shape ``(h, w, 3)`` each."""

    @property
    def colour(self) -> NDArray[np.uint8]:
        """Colour of each vertex, sRGB, shape ``(n, 3)``."""

    @property
    def attributions(self) -> tuple[str, ...]:
        """Whom to credit."""


@dataclass(frozen=True)
class _Primitive:
    """Triangles of one texture (or none), ready to be written."""

    positions: NDArray[np.float64]
    triangles: NDArray[np.int32]
    uv: NDArray[np.float64]
    colour: NDArray[np.uint8]
    texture: NDArray[np.uint8] | None


def write_tileset(
    mesh: TexturedTriangles,
    frame: LocalFrame,
    out: Path,
    *,
    levels: int = 3,
    detail: float = 1.0,
    draco: bool = True,
) -> int:
    """Write a mesh as a 3D Tiles 1.1 tileset.

    Parameters
    ----------
    mesh
        What to write; z is taken as metres above the WGS 84 ellipsoid.
    frame
        The local frame of its coordinates.
    out
        Folder to make: ``tileset.json`` and ``tiles/*.glb``.
    levels
        Of the quadtree: 1 writes a single tile, 3 one, four and sixteen.
    detail
        Geometric error of the level above the leaves, metres; it doubles with every level up.
    draco
        Compress positions to 16 and texture coordinates to 14 bits of each tile's size.

    Returns
    -------
    int
        Tiles written.

    Raises
    ------
    EmptyInputError
        If the mesh has no triangles.
    OutputExistsError
        If `out` holds something already.
    MissingExtraError
        If DracoPy is not installed and `draco` is true.
    """
    out = Path(out)
    if not 1 <= levels <= _MOST_LEVELS:
        raise InputError(f"tileset: {levels} levels; it must be 1 to {_MOST_LEVELS}")
    if not len(mesh.triangles):
        raise EmptyInputError("tileset: the mesh has no triangles; give one that has")
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise OutputExistsError(f"{out}: exists already; choose another folder")
    writer = _Writer(mesh, frame, out, levels, detail, draco)
    root = writer.tile(0, 0, 0, np.arange(len(mesh.triangles)))
    assert root is not None
    document = {
        "asset": {"version": "1.1", "generator": "vico"},
        "geometricError": 2.0 * root["geometricError"] if levels > 1 else detail,
        "root": {**root, "refine": "REPLACE"},
    }
    write_json(out / "tileset.json", document)
    return writer.written


def leaf_cells(positions: NDArray[np.float64], triangles: NDArray[np.int32], levels: int) -> NDArray[np.int64]:
    """Column and row of the quadtree's leaf that each triangle goes into, shape ``(m, 2)``.

    The square that is divided is the smallest around the triangles' middles, from its south-western corner.
    """
    middle = positions[triangles].mean(axis=1)[:, :2]
    low, high = middle.min(axis=0), middle.max(axis=0)
    across = 2 ** (levels - 1)
    size = max(float((high - low).max()), 1e-6) * (1 + 1e-9)
    return np.minimum(((middle - low) / size * across).astype(np.int64), across - 1)


class _Writer:
    """The quadtree while it is written."""

    def __init__(
        self, mesh: TexturedTriangles, frame: LocalFrame, out: Path, levels: int, detail: float, draco: bool
    ) -> None:
        self.mesh = mesh
        self.frame = frame
        self.out = out
        self.levels = levels
        self.detail = detail
        self.draco = draco
        self.written = 0
        self.to_ecef = Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True)
        self.cell = leaf_cells(mesh.positions, mesh.triangles, levels)

    def tile(self, level: int, x: int, y: int, faces: NDArray[np.int64]) -> dict[str, Any] | None:
        """Write a tile and all below it; None if there is nothing."""
        if not len(faces):
            return None
        below = self.levels - 1 - level
        error = self.detail * 2.0 ** (below - 1) if below else 0.0
        name = f"tiles/{level}_{x}_{y}.glb"
        content = self._glb(faces, below, error)
        write_bytes(self.out / name, content)
        self.written += 1
        points = self.mesh.positions[np.unique(self.mesh.triangles[faces])]
        lat, lon = self.frame.to_geodetic(points[:, :2])
        # What is coarser lies up to its error off; a tenth of a metre covers the quantisation.
        slack = error + 0.1
        turn = math.degrees(slack / 6.3e6)
        aside = turn / math.cos(math.radians(self.frame.lat))
        west, south = lon.min() - aside, lat.min() - turn
        east, north = lon.max() + aside, lat.max() + turn
        sides = [*np.radians([west, south, east, north]), points[:, 2].min() - slack, points[:, 2].max() + slack]
        entry: dict[str, Any] = {
            "boundingVolume": {"region": [float(v) for v in sides]},
            "geometricError": error,
            "content": {"uri": name},
        }
        if below:
            here = self.cell[faces] >> (below - 1)
            children = []
            for j in (0, 1):
                for i in (0, 1):
                    chosen = faces[(here[:, 0] == 2 * x + i) & (here[:, 1] == 2 * y + j)]
                    child = self.tile(level + 1, 2 * x + i, 2 * y + j, chosen)
                    if child is not None:
                        children.append(child)
            entry["children"] = children
        return entry

    def _glb(self, faces: NDArray[np.int64], below: int, error: float) -> bytes:
        mesh = self.mesh
        primitives = []
        for texture in np.unique(mesh.texture_of[faces]).tolist():
            own = mesh.triangles[faces[mesh.texture_of[faces] == texture]]
            used, local = np.unique(own, return_inverse=True)
            positions, uv, colour = mesh.positions[used], mesh.uv[used].astype(np.float64), mesh.colour[used]
            triangles = local.reshape(-1, 3)
            if error > 0:
                positions, uv, colour, triangles = _coarser(positions, uv, colour, triangles, error)
            if not len(triangles):
                continue
            picture = None
            if texture >= 0:
                picture, uv = _cropped(mesh.textures[texture], uv, 2**below)
            primitives.append(_Primitive(positions, triangles.astype(np.int32), uv, colour, picture))
        if not primitives:  # everything fell into single cells: a tile must hold something
            primitives = [self._marker(faces)]
        middle = np.concatenate([p.positions for p in primitives])
        centre = self._ecef(0.5 * (middle.min(axis=0) + middle.max(axis=0))[None])[0]
        return _glb(primitives, [self._ecef(p.positions) - centre for p in primitives], centre, self.draco, mesh)

    def _marker(self, faces: NDArray[np.int64]) -> _Primitive:
        """Return the largest triangle alone, untextured."""
        corner = self.mesh.positions[self.mesh.triangles[faces]]
        area = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
        best = self.mesh.triangles[faces[int(area.argmax())]]
        return _Primitive(
            self.mesh.positions[best], np.array([[0, 1, 2]], np.int32), np.zeros((3, 2)), self.mesh.colour[best], None
        )

    def _ecef(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        lat, lon = self.frame.to_geodetic(points[:, :2])
        x, y, z = self.to_ecef.transform(lon, lat, points[:, 2])
        return np.stack([np.asarray(x), np.asarray(y), np.asarray(z)], axis=1)


def _coarser(
    positions: NDArray[np.float64],
    uv: NDArray[np.float64],
    colour: NDArray[np.uint8],
    triangles: NDArray[np.int64],
    cell: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.uint8], NDArray[np.int64]]:
    """Gather the vertices of every grid cell in their mean place; each corner keeps its texture coordinates.

    The grid is the local frame's, so that tiles that are neighbours gather their common border alike.
    """
    key = np.floor(positions / cell).astype(np.int64)
    _, place = np.unique(key, axis=0, return_inverse=True)
    place = place.ravel()
    many = np.bincount(place)
    centre = np.stack([np.bincount(place, positions[:, k]) / many for k in range(3)], axis=1)
    corner = place[triangles]
    whole = (corner[:, 0] != corner[:, 1]) & (corner[:, 1] != corner[:, 2]) & (corner[:, 2] != corner[:, 0])
    kept, first = np.unique(np.sort(corner[whole], axis=1), axis=0, return_index=True)
    triangles = triangles[np.flatnonzero(whole)[np.sort(first)]] if len(kept) else triangles[:0]
    used, local = np.unique(triangles, return_inverse=True)
    return centre[place[used]], uv[used], colour[used], local.reshape(-1, 3)


def _cropped(
    texture: NDArray[np.uint8], uv: NDArray[np.float64], smaller: int
) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    """Return the part of a texture that is used, in a smaller size, and the texture coordinates in it."""
    h, w = texture.shape[:2]
    low, high = uv.min(axis=0), uv.max(axis=0)
    if (low >= 0).all() and (high <= 1).all():
        x0, y0 = (max(int(v) - 2, 0) for v in np.floor(low * (w, h)))
        x1, y1 = min(math.ceil(high[0] * w) + 2, w), min(math.ceil(high[1] * h) + 2, h)
        texture = texture[y0:y1, x0:x1]
        uv = (uv * (w, h) - (x0, y0)) / (x1 - x0, y1 - y0)
        h, w = texture.shape[:2]
    if smaller > 1:
        picture = Image.fromarray(np.ascontiguousarray(texture))
        texture = np.asarray(picture.resize((max(w // smaller, 4), max(h // smaller, 4)), Image.Resampling.BOX))
    return np.ascontiguousarray(texture), uv


def _glb(
    primitives: list[_Primitive],
    positions: list[NDArray[np.float64]],
    centre: NDArray[np.float64],
    draco: bool,
    mesh: TexturedTriangles,
) -> bytes:
    """Return a binary glTF of primitives around an earth-centred place."""
    document: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "vico"},
        "extensionsUsed": ["KHR_materials_unlit"],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, *_y_up(centre[None])[0].tolist(), 1]}],
        "meshes": [{"primitives": []}],
        "materials": [],
        "accessors": [],
        "bufferViews": [],
    }
    if mesh.attributions:
        document["asset"]["copyright"] = ";".join(mesh.attributions)
    if draco:
        document["extensionsUsed"].append("KHR_draco_mesh_compression")
        document["extensionsRequired"] = ["KHR_draco_mesh_compression"]
    chunks: list[bytes] = []

    def view(data: bytes) -> int:
        start = sum(map(len, chunks))
        document["bufferViews"].append({"buffer": 0, "byteOffset": start, "byteLength": len(data)})
        chunks.append(data + b"\0" * (-len(data) % 4))
        return len(document["bufferViews"]) - 1

    def accessor(count: int, component: int, shape: str, **more: Any) -> int:
        document["accessors"].append({"componentType": component, "count": count, "type": shape, **more})
        return len(document["accessors"]) - 1

    for primitive, points in zip(primitives, positions, strict=True):
        local = _y_up(points)
        tint = None if (primitive.colour == 255).all() else _linear(primitive.colour)
        bounds = {"min": local.min(axis=0).tolist(), "max": local.max(axis=0).tolist()}
        entry: dict[str, Any] = {"material": len(document["materials"]), "mode": 4}
        if draco:
            data, count, faces, names = _packed(local, primitive, tint)
            entry["attributes"] = {"POSITION": accessor(count, 5126, "VEC3", **bounds)}
            if "TEXCOORD_0" in names:
                entry["attributes"]["TEXCOORD_0"] = accessor(count, 5126, "VEC2")
            if "COLOR_0" in names:
                entry["attributes"]["COLOR_0"] = accessor(count, 5123, "VEC3", normalized=True)
            entry["indices"] = accessor(3 * faces, 5125, "SCALAR")
            entry["extensions"] = {"KHR_draco_mesh_compression": {"bufferView": view(data), "attributes": names}}
        else:
            count = len(local)
            plain = np.ascontiguousarray(local, "<f4")
            bounds = {"min": plain.min(axis=0).tolist(), "max": plain.max(axis=0).tolist()}
            at = view(plain.tobytes())
            entry["attributes"] = {"POSITION": accessor(count, 5126, "VEC3", bufferView=at, **bounds)}
            if primitive.texture is not None:
                at = view(np.ascontiguousarray(primitive.uv, "<f4").tobytes())
                entry["attributes"]["TEXCOORD_0"] = accessor(count, 5126, "VEC2", bufferView=at)
            if tint is not None:
                at = view(np.ascontiguousarray(np.c_[tint, np.zeros(count, np.uint16)], "<u2").tobytes())
                document["bufferViews"][at]["byteStride"] = 8
                entry["attributes"]["COLOR_0"] = accessor(count, 5123, "VEC3", bufferView=at, normalized=True)
            at = view(np.ascontiguousarray(primitive.triangles, "<u4").tobytes())
            entry["indices"] = accessor(primitive.triangles.size, 5125, "SCALAR", bufferView=at)
        material: dict[str, Any] = {
            "pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 1.0},
            "extensions": {"KHR_materials_unlit": {}},
        }
        if primitive.texture is not None:
            sink = io.BytesIO()
            Image.fromarray(primitive.texture).save(sink, "JPEG", quality=_QUALITY)
            images = document.setdefault("images", [])
            document.setdefault("textures", []).append({"source": len(images)})
            material["pbrMetallicRoughness"]["baseColorTexture"] = {"index": len(images)}
            images.append({"mimeType": "image/jpeg", "bufferView": view(sink.getvalue())})
        document["materials"].append(material)
        document["meshes"][0]["primitives"].append(entry)
    binary = b"".join(chunks)
    document["buffers"] = [{"byteLength": len(binary)}]
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(binary), 0x004E4942) + binary
    return struct.pack("<III", 0x46546C67, 2, 12 + len(body)) + body


def _packed(
    local: NDArray[np.float64], primitive: _Primitive, tint: NDArray[np.uint16] | None
) -> tuple[bytes, int, int, dict[str, int]]:
    """Draco data, its vertices and triangles (repeated ones go), and the numbers of its attributes."""
    try:
        import DracoPy
    except ImportError:
        raise MissingExtraError(
            "Draco-compressed tiles need DracoPy: pip install 'virtual-community[photos]'"
        ) from None
    data = DracoPy.encode(
        local,
        primitive.triangles.astype(np.uint32),
        quantization_bits=_POSITION_BITS,
        compression_level=7,
        tex_coord=None if primitive.texture is None else primitive.uv,
        tex_coord_quantization_bits=_UV_BITS,
        generic_attributes=None if tint is None else {9: tint},
    )
    mesh = DracoPy.decode(data)
    # Draco's kinds of attributes: 0 position, 3 texture coordinate, 4 generic.
    kinds = {0: "POSITION", 3: "TEXCOORD_0", 4: "COLOR_0"}
    names = {kinds[a["attribute_type"]]: int(a["unique_id"]) for a in mesh.attributes}
    return bytes(data), len(mesh.points), len(mesh.faces), names


def _y_up(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points with z up in glTF's axes."""
    return np.stack([points[:, 0], points[:, 2], -points[:, 1]], axis=1)


def _linear(colour: NDArray[np.uint8]) -> NDArray[np.uint16]:
    """Give sRGB bytes as the linear shares of 65,535 that glTF wants."""
    value = colour.astype(np.float64) / 255
    linear = np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
    return np.round(linear * 65535).astype(np.uint16)
