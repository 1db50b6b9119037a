"""Small tiles of 3D tilesets, made by hand: what the readers are held against."""

from __future__ import annotations

import io
import json
import math
import struct
from collections.abc import Sequence
from typing import Any

import numpy as np
from PIL import Image
from pyproj import Transformer

_TO_ECEF = Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True)


def ecef(lat: float, lon: float, height: float) -> np.ndarray:
    """Earth-centred place of a point."""
    return np.array(_TO_ECEF.transform(lon, lat, height))


def enu_axes(lat: float, lon: float) -> np.ndarray:
    """Columns east, north, up in earth-centred axes, shape (3, 3)."""
    a, b = math.radians(lat), math.radians(lon)
    up = np.array([math.cos(a) * math.cos(b), math.cos(a) * math.sin(b), math.sin(a)])
    east = np.array([-math.sin(b), math.cos(b), 0.0])
    return np.stack([east, np.cross(up, east), up], axis=1)


def at_place(lat: float, lon: float, height: float = 0.0) -> list[float]:
    """A tile's transform from local east, north, up to earth-centred coordinates, as tilesets store it."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = enu_axes(lat, lon), ecef(lat, lon, height)
    return matrix.T.ravel().tolist()


def square(x: float, y: float, z: float, size: float) -> tuple[np.ndarray, np.ndarray]:
    """Two triangles around a point, east, north, up."""
    h = size / 2
    points = np.array([[x - h, y - h, z], [x + h, y - h, z], [x + h, y + h, z], [x - h, y + h, z]])
    return points, np.array([[0, 1, 2], [0, 2, 3]])


def glb(
    points: np.ndarray,
    triangles: np.ndarray,
    *,
    matrix: Sequence[float] | None = None,
    copyright: str | None = None,
    picture: np.ndarray | None = None,
    uv: np.ndarray | None = None,
    kind: str = "PNG",
    change: dict[str, Any] | None = None,
    edit: Any = None,
) -> bytes:
    """A binary glTF of triangles whose points have z up; `edit` may change the JSON."""
    chunks: list[bytes] = []
    views: list[dict[str, Any]] = []

    def view(data: bytes) -> int:
        views.append({"buffer": 0, "byteOffset": sum(map(len, chunks)), "byteLength": len(data)})
        chunks.append(data + b"\0" * (-len(data) % 4))
        return len(views) - 1

    turned = np.stack([points[:, 0], points[:, 2], -points[:, 1]], axis=1).astype("<f4")
    primitive: dict[str, Any] = {"attributes": {"POSITION": 0}, "indices": 1}
    document: dict[str, Any] = {
        "asset": {"version": "2.0", **({"copyright": copyright} if copyright else {})},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, **({"matrix": list(matrix)} if matrix is not None else {})}],
        "meshes": [{"primitives": [primitive]}],
        "accessors": [
            {"bufferView": view(turned.tobytes()), "componentType": 5126, "count": len(points), "type": "VEC3"},
            {
                "bufferView": view(triangles.astype("<u2").tobytes()),
                "componentType": 5123,
                "count": triangles.size,
                "type": "SCALAR",
            },
        ],
    }
    if picture is not None and uv is not None:
        at = view(uv.astype("<f4").tobytes())
        document["accessors"].append({"bufferView": at, "componentType": 5126, "count": len(uv), "type": "VEC2"})
        primitive["attributes"]["TEXCOORD_0"] = 2
        primitive["material"] = 0
        sink = io.BytesIO()
        Image.fromarray(picture).save(sink, kind, lossless=True) if kind == "WEBP" else Image.fromarray(picture).save(
            sink, kind
        )
        document["images"] = [{"bufferView": view(sink.getvalue()), "mimeType": f"image/{kind.lower()}"}]
        document["textures"] = [
            {"extensions": {"EXT_texture_webp": {"source": 0}}} if kind == "WEBP" else {"source": 0}
        ]
        texture: dict[str, Any] = {"index": 0}
        if change is not None:
            texture["extensions"] = {"KHR_texture_transform": change}
        document["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": texture}}]
    document["bufferViews"] = views
    binary = b"".join(chunks)
    document["buffers"] = [{"byteLength": len(binary)}]
    if edit is not None:
        edit(document)
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(binary), 0x004E4942) + binary
    return struct.pack("<III", 0x46546C67, 2, 12 + len(body)) + body


def b3dm(model: bytes, *, features: bytes = b"", batch: bytes = b"", binary: bytes = b"") -> bytes:
    """A batched model with its tables."""
    features += b" " * (-len(features) % 8)
    batch += b" " * (-len(batch) % 8)
    binary += b"\0" * (-len(binary) % 8)
    length = 28 + len(features) + len(batch) + len(binary) + len(model)
    head = struct.pack("<4sIIIIII", b"b3dm", 1, length, len(features), 0, len(batch), len(binary))
    return head + features + batch + binary + model


def cmpt(*tiles: bytes) -> bytes:
    """A composite of tiles."""
    body = b"".join(tiles)
    return struct.pack("<4sIII", b"cmpt", 1, 16 + len(body), len(tiles)) + body


def box(x: float, y: float, size: float, tall: float = 100.0) -> dict[str, Any]:
    """A bounding volume around a point of the tile's own frame."""
    h = size / 2
    return {"box": [x, y, 0, h, 0, 0, 0, h, 0, 0, 0, tall]}
