"""A photogrammetry mesh as surfaces, to look at it with the renderer that shows our own worlds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from vico.geo.tiles3d import TileMesh
from vico.world.mesh import Material, Surface


def tile_surfaces(mesh: TileMesh, *, entity: int = 1) -> list[Surface]:
    """One surface a texture, and one for what has none.

    Textures get sides that are powers of two: padded where the coordinates stay inside, else stretched.
    """
    surfaces = []
    corner = mesh.positions[mesh.triangles]
    flat = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    total = np.stack(
        [
            np.bincount(mesh.triangles.ravel(), np.repeat(flat[:, k], 3), minlength=len(mesh.positions))
            for k in range(3)
        ],
        axis=1,
    )
    normals = total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-12)
    for texture in np.unique(mesh.texture_of).tolist():
        own = mesh.triangles[mesh.texture_of == texture]
        used, local = np.unique(own, return_inverse=True)
        uv, picture = mesh.uv[used], None
        if texture >= 0:
            picture, uv = _power_of_two(mesh.textures[texture], uv)
        surfaces.append(
            Surface(
                mesh.positions[used].astype(np.float32),
                normals[used].astype(np.float32),
                uv,
                mesh.colour[used],
                np.full(len(used), entity, np.int32),
                local.reshape(-1, 3).astype(np.int32),
                Material(f"tile {texture}", picture, double_sided=True, photo=True),
            )
        )
    return surfaces


def _power_of_two(texture: NDArray[np.uint8], uv: NDArray[np.float32]) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
    h, w = texture.shape[:2]
    wide, tall = (1 << max(side - 1, 1).bit_length() for side in (w, h))
    if (wide, tall) == (w, h):
        return texture, uv
    if uv.size and uv.min() >= 0.0 and uv.max() <= 1.0:
        padded = np.pad(texture, ((0, tall - h), (0, wide - w), (0, 0)), mode="edge")
        return padded, (uv * np.array([w / wide, h / tall], np.float32)).astype(np.float32)
    return np.asarray(Image.fromarray(texture).resize((wide, tall))), uv
