"""Meshes as bytes that a browser hands to its graphics library as they are: columns of vertices, then indices."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.viewer.city.textures import SHAPES, TextureLayers
from vico.world.mesh import Surface

# The fourth number of normals: alpha means holes; or how many hundredths of its colour a surface gives at night.
_CUTOUT, _FULLY = 127, 100


@dataclass(frozen=True)
class PackedMesh:
    """Triangles that one draw call can draw: all their textures lie in one array.

    Attributes
    ----------
    array
        Which array, an index into `vico.viewer.city.textures.SHAPES`.
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

    def chosen(self, triangles: NDArray[Any]) -> PackedMesh:
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


def packed(surfaces: Iterable[Surface], textures: TextureLayers) -> list[PackedMesh]:
    """Return surfaces as meshes, one for each texture array that they use, those seen from both sides apart."""
    by_array: dict[tuple[int, bool], list[tuple[Surface, int, int]]] = {}
    for surface in surfaces:
        if not len(surface.triangles):
            continue
        layer = textures.layer_of(surface.material)
        flag = _CUTOUT if layer.cutout else round(_FULLY * min(surface.material.emission, 1.0))
        both = layer.cutout or surface.material.double_sided
        by_array.setdefault((layer.array, both), []).append((surface, layer.layer, flag))
    return [_joined(array, both, parts) for (array, both), parts in sorted(by_array.items())]


def _joined(array: int, both: bool, parts: Sequence[tuple[Surface, int, int]]) -> PackedMesh:
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


def array_entries() -> list[dict[str, int]]:
    """Return the sizes of the texture arrays as the manifest has them."""
    return [{"height": height, "width": width} for height, width in SHAPES]
