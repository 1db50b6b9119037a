"""Triangles with a material: what every mesh of ours is between the stages.

A surface keeps, beside positions and colours, the entity each vertex belongs to, so that one file can hold all the
facades of a city in a handful of draw calls and a segmentation image can still tell the buildings apart.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.exact import apply_matrix


@dataclass(frozen=True)
class Material:
    """Look of a surface.

    Attributes
    ----------
    name
        Unique among the surfaces of a file.
    texture
        sRGB, uint8, shape ``(h, w, 3)`` or ``(h, w, 4)``, sides powers of two, repeated in both directions; row 0 is
        at v = 0 (glTF's convention). None: vertex colour alone. Vertex colour multiplies the texture.
    cutout
        Texels with alpha under one half are holes (leaves, fences).
    emission
        Share of the colour that shines by itself at night (lit windows), 0..1. A texture's alpha, where it does not
        mean holes, says how much of that each texel does.
    double_sided
        Drawn from behind too.
    photo
        A photo: kept as JPEG in files, which loses detail nobody sees and a tenth of the bytes remain.
    png
        This very texture as a PNG file, where it has been packed already; None goes with another texture.
    """

    name: str
    texture: NDArray[np.uint8] | None = None
    cutout: bool = False
    emission: float = 0.0
    double_sided: bool = False
    photo: bool = False
    png: bytes | None = field(default=None, repr=False, compare=False)


@dataclass(frozen=True)
class Surface:
    """Triangles of one material, counter-clockwise seen from outside, ENU metres.

    Attributes
    ----------
    positions, normals
        float32, shape ``(n, 3)``; normals have unit length.
    uv
        Texture coordinates, float32, shape ``(n, 2)``; may leave 0..1 (the texture repeats).
    colour
        sRGB, uint8, shape ``(n, 3)``.
    entity
        int32, shape ``(n,)``; 0 where the surface is a prototype and gets its entity when placed.
    triangles
        Vertex indices, int32, shape ``(m, 3)``.
    """

    positions: NDArray[np.float32]
    normals: NDArray[np.float32]
    uv: NDArray[np.float32]
    colour: NDArray[np.uint8]
    entity: NDArray[np.int32]
    triangles: NDArray[np.int32]
    material: Material = field(default_factory=lambda: Material("plain"))

    @classmethod
    def from_triangles(
        cls,
        positions: NDArray[Any],
        triangles: NDArray[Any],
        *,
        colour: tuple[int, int, int] | NDArray[np.uint8] = (200, 200, 200),
        entity: int = 0,
        uv: NDArray[Any] | None = None,
        normals: NDArray[Any] | None = None,
        material: Material | None = None,
    ) -> Surface:
        """Make a surface; without `normals` every triangle is flat-shaded (its vertices are split)."""
        points = np.asarray(positions, np.float32)
        faces = np.asarray(triangles, np.int32)
        colours = np.broadcast_to(np.asarray(colour, np.uint8), (len(points), 3))
        coordinates = np.zeros((len(points), 2), np.float32) if uv is None else np.asarray(uv, np.float32)
        if normals is None:
            order = faces.ravel()
            points, colours, coordinates = points[order], colours[order], coordinates[order]
            corners = points.reshape(-1, 3, 3)
            flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            flat /= np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-12)
            directions = np.repeat(flat, 3, axis=0).astype(np.float32)
            faces = np.arange(len(points), dtype=np.int32).reshape(-1, 3)
        else:
            directions = np.asarray(normals, np.float32)
        return cls(
            points,
            directions,
            coordinates,
            np.ascontiguousarray(colours),
            np.full(len(points), entity, np.int32),
            faces,
            material or Material("plain"),
        )

    def moved(self, transform: NDArray[Any]) -> Surface:
        """Return a copy under a rigid (or uniformly scaled) 4x4 transform."""
        matrix = np.asarray(transform, np.float64)
        positions = apply_matrix(self.positions, matrix[:3, :3]) + matrix[:3, 3]
        normals = apply_matrix(self.normals, matrix[:3, :3])
        normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        return replace(self, positions=positions.astype(np.float32), normals=normals.astype(np.float32))

    def of_entity(self, entity: int) -> Surface:
        """Return a copy that belongs to one entity."""
        return replace(self, entity=np.full(len(self.positions), entity, np.int32))


def quad_triangles(first: NDArray[Any], *, by_halves: bool = False) -> NDArray[Any]:
    """Return the triangles of quadrilaterals whose four corners follow one another.

    Parameters
    ----------
    first
        Number of each quad's first corner, integers, shape ``(n,)``.
    by_halves
        List the first triangles of all quads before the second ones, instead of quad by quad.

    Returns
    -------
    NDArray
        Of `first`'s type, shape ``(2 * n, 3)``.
    """
    halves = [first[:, None] + np.array(corners, first.dtype) for corners in ((0, 1, 2), (0, 2, 3))]
    return np.concatenate(halves, axis=0 if by_halves else 1).reshape(-1, 3)


def surface_of_quads(
    corners: NDArray[Any],
    normals: NDArray[Any],
    uv: NDArray[Any],
    *,
    colour: NDArray[Any] | tuple[int, int, int],
    entity: NDArray[Any] | int,
    material: Material,
    by_halves: bool = False,
) -> Surface:
    """Make a surface of flat quadrilaterals, each with four vertices of its own.

    Parameters
    ----------
    corners
        Counter-clockwise seen from outside, shape ``(n, 4, 3)``.
    normals
        Of unit length, shape ``(n, 3)``.
    uv
        Texture coordinates of the corners, shape ``(n, 4, 2)``.
    colour
        sRGB: one for all, ``(n, 3)`` for each quad, or ``(4 * n, 3)`` for each corner.
    entity
        One for all, or shape ``(n,)``.
    by_halves
        List the first triangles of all quads before the second ones, instead of quad by quad.
    """
    count = len(corners)
    triangles = quad_triangles(4 * np.arange(count, dtype=np.int32), by_halves=by_halves)
    colours = np.asarray(colour, np.uint8)
    if colours.shape == (count, 3):
        colours = np.repeat(colours, 4, axis=0)
    return Surface(
        np.asarray(corners, np.float32).reshape(-1, 3),
        np.repeat(np.asarray(normals, np.float32), 4, axis=0),
        np.asarray(uv, np.float32).reshape(-1, 2),
        np.ascontiguousarray(np.broadcast_to(colours, (4 * count, 3))),
        np.broadcast_to(np.repeat(np.asarray(entity, np.int32), 4 if np.ndim(entity) else 1), 4 * count).copy(),
        triangles,
        material,
    )


def merge_surfaces(surfaces: Iterable[Surface]) -> list[Surface]:
    """Merge surfaces that share a material's name: one surface a material, in the order first met."""
    groups: dict[str, list[Surface]] = {}
    for surface in surfaces:
        if len(surface.triangles):
            groups.setdefault(surface.material.name, []).append(surface)
    merged = []
    for parts in groups.values():
        offsets = np.cumsum([0, *(len(part.positions) for part in parts[:-1])])
        merged.append(
            Surface(
                np.concatenate([part.positions for part in parts]),
                np.concatenate([part.normals for part in parts]),
                np.concatenate([part.uv for part in parts]),
                np.concatenate([part.colour for part in parts]),
                np.concatenate([part.entity for part in parts]),
                np.concatenate([part.triangles + np.int32(o) for part, o in zip(parts, offsets, strict=True)]),
                parts[0].material,
            )
        )
    return merged
