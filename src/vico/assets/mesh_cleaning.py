"""From a mesh as a network or a file has it to the surface of a model: cleaned, thinned, sized, upright.

A file may be what a network that runs elsewhere wrote, a scan, or a model of one's own. Holes and places where more
than two triangles meet are left as they are; geometry that shows nothing is refused.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from vico.assets.simplification import Worth, collapse_edges, is_sound
from vico.errors import InputError, MissingFileError, SchemaError
from vico.world.mesh import Material, Surface

Along = Literal["height", "longest"]

_WELD = 1e-6  # of the longest side
_CRUMB = 0.01  # of all area: smaller pieces that hang in the air are left out
_THIN = 0.01  # of the longest side: flatter is a sheet
_FEWEST, _MOST = 4, 2_000_000  # triangles
_COLOUR_WORTH = 0.1  # of the longest side that a change from black to white is worth
_MOST_SIZE = 100.0  # metres


@dataclass(frozen=True)
class RawMesh:
    """A coloured mesh, z up, in any unit.

    Attributes
    ----------
    points
        float64, shape ``(n, 3)``.
    faces
        Triangles, int64, shape ``(m, 3)``.
    colours
        sRGB of the points, uint8, shape ``(n, 3)``.
    """

    points: NDArray[np.float64]
    faces: NDArray[np.int64]
    colours: NDArray[np.uint8]


def object_surface(
    raw: RawMesh, *, size: float, along: Along = "height", turn: float = 0.0, faces: int = 1500
) -> Surface:
    """Make the surface of a model of a mesh.

    Parameters
    ----------
    raw
        The mesh.
    size
        Its height, or its longest side, metres.
    along
        Which of them `size` is.
    turn
        Counter-clockwise about z, degrees: so that its front looks along +x.
    faces
        How many triangles it may have.

    Returns
    -------
    Surface
        Metres, z up, the origin in the middle of its foot; normals are smooth.

    Raises
    ------
    InputError
        If a number can't be used, or the mesh is degenerate; the reason says how.
    """
    if not (math.isfinite(size) and 0.01 <= size <= _MOST_SIZE):
        raise InputError(f"size: {size:g} m; it must lie within 0.01..{_MOST_SIZE:g} m")
    if faces < _FEWEST:
        raise InputError(f"faces: {faces}; a thing has at least {_FEWEST} triangles")
    mesh = _thin(_outward(_without_crumbs(_weld(_check_mesh(raw)))), faces)
    points = _place(mesh.points, size, along, turn)
    return Surface.from_triangles(
        points,
        mesh.faces,
        colour=mesh.colours,
        normals=_normals(points, mesh.faces),
        material=Material("generated", double_sided=True),
    )


def _check_mesh(raw: RawMesh) -> RawMesh:
    """Refuse what is no mesh."""
    if len(raw.faces) < _FEWEST or len(raw.points) < _FEWEST:
        raise InputError(f"mesh: {len(raw.faces)} triangles are no thing; try another seed or picture")
    if len(raw.faces) > _MOST:
        raise InputError(f"mesh: {len(raw.faces):,} triangles are more than {_MOST:,}; thin it first")
    if not np.isfinite(raw.points).all():
        raise InputError("mesh: it has points that are no finite numbers; try another seed or picture")
    if raw.faces.min() < 0 or raw.faces.max() >= len(raw.points):
        raise InputError("mesh: its triangles name points that it lacks; make the file anew")
    extent = np.ptp(raw.points[np.unique(raw.faces)], axis=0)
    if extent.max() <= 0.0:
        raise InputError("mesh: all its points are at one place; try another seed or picture")
    if extent.min() < _THIN * extent.max():
        flat, share = "xyz"[int(extent.argmin())], 100 * extent.min() / extent.max()
        raise InputError(
            f"mesh: it is a flat sheet ({share:.1f} % as thick along {flat} as it is long); try another seed or picture"
        )
    return raw


def _weld(mesh: RawMesh) -> RawMesh:
    """One point a place, triangles that have an area, each once."""
    step = float(np.ptp(mesh.points, axis=0).max()) * _WELD
    _, first, owner = np.unique(
        np.round(mesh.points / step).astype(np.int64), axis=0, return_index=True, return_inverse=True
    )
    faces = np.asarray(owner).reshape(-1)[mesh.faces]
    faces = faces[is_sound(faces)]
    _, once = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    faces = faces[np.sort(once)]
    points = mesh.points[first]
    faces = faces[_areas(points, faces) > step * step]
    if len(faces) < _FEWEST:
        raise InputError(f"mesh: only {len(faces)} of its triangles have an area; try another seed or picture")
    return RawMesh(points, faces, mesh.colours[first])


def _without_crumbs(mesh: RawMesh) -> RawMesh:
    """Leave out small pieces that nothing holds."""
    label = _pieces(mesh)
    areas = np.bincount(label, _areas(mesh.points, mesh.faces))
    return replace(mesh, faces=mesh.faces[areas[label] >= _CRUMB * areas.sum()])


def _outward(mesh: RawMesh) -> RawMesh:
    """Turn each piece whose triangles look inwards: its volume comes out negative."""
    a, b, c = (mesh.points[mesh.faces[:, k]] - mesh.points.mean(axis=0) for k in range(3))
    label = _pieces(mesh)
    volume = np.bincount(label, np.einsum("ij,ij->i", a, np.cross(b, c)))
    wrong = volume[label] < 0.0
    return replace(mesh, faces=np.where(wrong[:, None], mesh.faces[:, ::-1], mesh.faces))


def _thin(mesh: RawMesh, faces: int) -> RawMesh:
    """Collapse edges until so many triangles are left; shape counts, and colour a little."""
    kept = mesh.faces
    if len(kept) > faces:
        longest = float(np.ptp(mesh.points, axis=0).max())
        count = len(mesh.points)
        traits = mesh.colours.astype(np.float64) / 255 * (_COLOUR_WORTH * longest)
        worth = Worth(traits, np.ones(count), np.full(count, np.inf))
        _, kept = collapse_edges(mesh.points, mesh.faces, mesh.faces, worth, triangles=faces)
    if len(kept) > faces:
        raise InputError(f"mesh: it can't be thinned below {len(kept)} triangles; allow as many with --faces")
    used, index = np.unique(kept, return_inverse=True)
    return RawMesh(mesh.points[used], np.asarray(index, np.int64).reshape(-1, 3), mesh.colours[used])


def _place(points: NDArray[np.float64], size: float, along: Along, turn: float) -> NDArray[np.float64]:
    """Turn, scale and stand a mesh on the middle of its foot."""
    c, s = math.cos(math.radians(turn)), math.sin(math.radians(turn))
    turned = points @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    extent = np.ptp(turned, axis=0)
    turned = turned * (size / float(extent[2] if along == "height" else extent.max()))
    low, high = turned.min(axis=0), turned.max(axis=0)
    return np.asarray(turned - [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, low[2]], np.float64)


def _normals(points: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.float64]:
    """Directions of the points: those of their triangles, weighted by area."""
    corners = points[faces]
    facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    total = np.zeros_like(points)
    for k in range(3):
        np.add.at(total, faces[:, k], facing)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.where(length > 1e-15, total / np.maximum(length, 1e-15), (0.0, 0.0, 1.0))


def _areas(points: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[Any]:
    corners = points[faces]
    return np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2


def _pieces(mesh: RawMesh) -> NDArray[np.int64]:
    """Return a number for each triangle, of the piece that it hangs together with."""
    f, count = mesh.faces, len(mesh.points)
    edges = coo_matrix((np.ones(2 * len(f)), (np.r_[f[:, 0], f[:, 1]], np.r_[f[:, 1], f[:, 2]])), (count, count))
    _, label = connected_components(edges, directed=False)
    return np.unique(label[f[:, 0]], return_inverse=True)[1].astype(np.int64)


_MESH_SUFFIXES = (".glb", ".obj", ".ply", ".stl", ".off")
_Y_UP = (".glb", ".obj")
_MOST_BYTES = 512 << 20
_MESH_GREY = 200


def read_mesh_file(path: Path, *, up: str = "") -> RawMesh:
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
    if kind not in _MESH_SUFFIXES or path.stat().st_size > _MOST_BYTES:
        raise SchemaError(
            f"{path}: no mesh of at most {_MOST_BYTES >> 20} MB in one of {', '.join(_MESH_SUFFIXES)}; convert it"
        )
    try:
        scene = trimesh.load_scene(str(path), file_type=kind[1:])
        parts = [part for part in scene.dump() if isinstance(part, trimesh.Trimesh) and len(part.faces)]
        read = [(np.asarray(p.vertices, np.float64), np.asarray(p.faces, np.int64), _mesh_colours(p)) for p in parts]
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


def _mesh_colours(part: Any) -> NDArray[np.uint8]:
    """Return sRGB of each vertex."""
    visual = part.visual
    if getattr(visual, "kind", None) == "texture":
        visual = visual.to_color()
    found = np.asarray(getattr(visual, "vertex_colors", np.zeros((0, 4))), np.uint8)
    if found.ndim != 2 or len(found) != len(part.vertices):
        return np.full((len(part.vertices), 3), _MESH_GREY, np.uint8)
    return found[:, :3].copy()
