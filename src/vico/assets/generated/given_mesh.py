"""A mesh out of a file: what a network that is run elsewhere wrote, a scan, or a model of one's own."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from vico.assets.generated.raw_mesh import RawMesh
from vico.errors import MissingFileError, SchemaError

_KINDS = (".glb", ".obj", ".ply", ".stl", ".off")
_Y_UP = (".glb", ".obj")
_MOST_BYTES = 512 << 20
_GREY = 200


def mesh_of_file(path: Path, *, up: str = "") -> RawMesh:
    """Read a mesh.

    Parameters
    ----------
    path
        GLB, OBJ, PLY, STL or OFF.
    up
        Which axis is up, "y" or "z"; without, y for GLB and OBJ, z for the others.

    Returns
    -------
    RawMesh
        All its parts in one; colours of vertices, or of textures where the vertices lie, grey where it has none.

    Raises
    ------
    MissingFileError, SchemaError
        If it is not there, or can't be read.
    """
    kind = path.suffix.lower()
    if not path.is_file():
        raise MissingFileError(f"{path}: no such mesh")
    if kind not in _KINDS or path.stat().st_size > _MOST_BYTES:
        raise SchemaError(
            f"{path}: no mesh of at most {_MOST_BYTES >> 20} MB in one of {', '.join(_KINDS)}; convert it"
        )
    try:
        scene = trimesh.load_scene(str(path), file_type=kind[1:])
        parts = [part for part in scene.dump() if isinstance(part, trimesh.Trimesh) and len(part.faces)]
        read = [(np.asarray(p.vertices, np.float64), np.asarray(p.faces, np.int64), _colours(p)) for p in parts]
    except Exception as error:  # whatever the readers of a dozen formats raise
        raise SchemaError(f"{path}: not a readable mesh ({str(error)[:200]}); export it anew") from None
    if not read:
        raise SchemaError(f"{path}: holds no triangles; export it anew")
    starts = np.cumsum([0, *(len(points) for points, _, _ in read)])
    points = np.concatenate([points for points, _, _ in read])
    if (up or ("y" if kind in _Y_UP else "z")) == "y":
        points = points[:, [0, 2, 1]] * (1.0, -1.0, 1.0)
    faces = np.concatenate([faces + start for (_, faces, _), start in zip(read, starts[:-1], strict=True)])
    return RawMesh(points, faces, np.concatenate([colours for _, _, colours in read]))


def _colours(part: Any) -> NDArray[np.uint8]:
    """Return sRGB of each vertex."""
    visual = part.visual
    if getattr(visual, "kind", None) == "texture":
        visual = visual.to_color()
    found = np.asarray(getattr(visual, "vertex_colors", np.zeros((0, 4))), np.uint8)
    if found.ndim != 2 or len(found) != len(part.vertices):
        return np.full((len(part.vertices), 3), _GREY, np.uint8)
    return found[:, :3].copy()
