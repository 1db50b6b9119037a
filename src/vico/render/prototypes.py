"""Models that are placed many times, with their levels of detail."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from vico.assets.vehicle_parts import Cabin
from vico.render.arrays import Prototypes
from vico.render.geometry import Mesh, Soup, mesh_of, simplified
from vico.render.records import SPAN
from vico.render.shadows.cabins import cabin_records

# A level of detail is left for the next coarser one below these sizes on screen, pixels.
_LEVEL_PIXELS = (1e9, 48.0, 20.0)
_LEVEL_CELLS = (0.07, 0.16)


def prototypes_of(
    soups: Sequence[Soup], names: Sequence[str], cabins: Mapping[str, Cabin]
) -> tuple[Prototypes, list[Mesh]]:
    """Return models with their levels of detail, and the meshes of these one behind the other."""
    levels = np.zeros((len(soups), len(_LEVEL_PIXELS)), SPAN)
    bounds = np.zeros((2, len(soups), 3), np.float32)
    pixels = np.tile(np.array(_LEVEL_PIXELS, np.float32), (len(soups), 1))
    meshes: list[Mesh] = []
    triangles, vertices = 0, 0
    for k, soup in enumerate(soups):
        if not len(soup.triangles):
            continue
        bounds[:, k] = soup.position.min(axis=0), soup.position.max(axis=0)
        size = float(np.linalg.norm(bounds[1, k] - bounds[0, k]))
        for level in range(len(_LEVEL_PIXELS)):
            coarse = soup if level == 0 else simplified(soup, max(size * _LEVEL_CELLS[level - 1], 1e-6))
            if coarse is None:
                levels[k, level] = levels[k, level - 1]
                continue
            end_triangle, end_vertex = triangles + len(coarse.triangles), vertices + len(coarse.position)
            levels[k, level] = triangles, end_triangle, vertices, end_vertex
            triangles, vertices = end_triangle, end_vertex
            meshes.append(mesh_of(coarse))
    return Prototypes(bounds[0], bounds[1], levels, pixels, *cabin_records(names, cabins, *bounds)), meshes
