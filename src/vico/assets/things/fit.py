"""A model of others in the place of one of ours: turned to our front, thinned, and fitted into our model's outline.

Ours keeps saying what a thing is, what it is for, what can lie on it and what room it takes; only its looks change.
Worlds therefore place the same things at the same spots whichever models they show.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.assets.models.model import Model
from vico.assets.shading import shaded
from vico.assets.shapes import pose_matrix
from vico.assets.simplify import thinned
from vico.assets.things.archive import ArchiveEntry
from vico.assets.things.obj import ObjMaterial, ObjMesh
from vico.assets.things.texturing import textured_again
from vico.world.mesh import Material, Surface, merge_surfaces

#: In place of a collection: one of our own models, as it is.
OURS = "="

_CREASE = 42.0
_GLOW = 0.9
_GLOW_COLOUR = (255, 236, 196)
# The list's axes are x right, y up, z to the viewer, who looks at the front; ours are x front, y left, z up.
_AXES = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


@dataclass(frozen=True)
class StandIn:
    """One model of a pack, and where it goes in ours.

    Attributes
    ----------
    pack
        Letter of its collection, or `OURS`.
    name
        Its name in the archive.
    digest
        First digits of the SHA-256 of what it is made of; another is refused.
    triangles
        How many it may have.
    box
        Lowest and highest corner of where it goes, metres from our model's origin; None: our model's own box.
    turn
        Quarter turns, counter-clockwise seen from above, that bring its front to ours.
    whole
        Scaled alike in all directions, so that it touches the box; otherwise it fills the box.
    glow
        Its materials that shine at night.
    """

    pack: str
    name: str
    digest: str
    triangles: int = 1500
    box: tuple[float, float, float, float, float, float] | None = None
    turn: int = 0
    whole: bool = False
    glow: tuple[str, ...] = ()


def fitted(
    pieces: Sequence[StandIn],
    name: str,
    models: Mapping[str, Model],
    look: Callable[[StandIn], tuple[ArchiveEntry, ObjMesh]],
) -> list[Surface]:
    """Make the surfaces that stand for one of our models.

    Parameters
    ----------
    pieces
        What it is made of.
    name
        The model whose outline they take.
    models
        Our models.
    look
        Reads a piece's entry and solid.
    """
    parts: list[Surface] = []
    for piece in pieces:
        if piece.pack == OURS:
            x, y = piece.box[:2] if piece.box else (0.0, 0.0)
            parts += [surface.moved(pose_matrix(x, y)) for surface in models[piece.name].surfaces]
        else:
            parts += _placed(piece, models[name], *look(piece))
    return merge_surfaces(parts)


def _placed(piece: StandIn, ours: Model, entry: ArchiveEntry, solid: ObjMesh) -> list[Surface]:
    upright = _upright(solid.points, entry, piece.turn)
    points, faces, kept = thinned(upright, solid.faces, piece.triangles, kinds=solid.paint)
    paint = solid.paint[kept]
    if len(faces) == len(solid.faces):
        uv = solid.uv[kept]
    else:
        uv = textured_again(points, faces, paint, upright, solid.faces, solid.uv, solid.paint)
    points = _into_box(points, _box_of(piece, ours), whole=piece.whole)
    corners = shaded(points, faces, (255, 255, 255), crease=_CREASE)
    positions = corners.positions.reshape(-1, 3, 3)
    normals = corners.normals.reshape(-1, 3, 3)
    surfaces = []
    for number, worn in enumerate(solid.paints):
        chosen = paint == number
        if chosen.any():
            label = f"{piece.pack}/{piece.name}/{number}"
            surfaces.append(
                _surface(positions[chosen], normals[chosen], uv[chosen], worn, label, glows=worn.name in piece.glow)
            )
    return surfaces


def _upright(points: NDArray[Any], entry: ArchiveEntry, turn: int) -> NDArray[np.float64]:
    """In our axes and at the size the list says, the front where the piece's turn brings it."""
    turned = points @ np.array(entry.rotation).reshape(3, 3).T
    wide = np.ptp(turned, axis=0)
    width, depth, height = entry.size
    turned = (turned - turned.min(axis=0)) / np.maximum(wide, 1e-9) * np.array([width, height, depth])
    c, s = ((1, 0), (0, 1), (-1, 0), (0, -1))[turn % 4]
    spin = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]], np.float64)
    return np.asarray(turned @ _AXES.T @ spin.T, np.float64)


def _box_of(piece: StandIn, ours: Model) -> NDArray[np.float64]:
    """Where a piece goes; what of ours is under the ground (foundations) is not counted."""
    if piece.box is not None:
        return np.array(piece.box, np.float64).reshape(2, 3)
    box = ours.bounds.copy()
    box[0, 2] = max(float(box[0, 2]), 0.0)
    return box


def _into_box(points: NDArray[Any], box: NDArray[np.float64], *, whole: bool) -> NDArray[np.float64]:
    """Scaled into a box, standing on its floor in its middle."""
    low, high = points.min(axis=0), points.max(axis=0)
    scale = (box[1] - box[0]) / np.maximum(high - low, 1e-9)
    if whole:
        scale = np.full(3, scale.min())
    middle = (box[0] + box[1]) / 2
    out = (points - (low + high) / 2) * scale + middle
    if whole:
        out[:, 2] += box[0, 2] - out[:, 2].min()
    return np.asarray(out, np.float64)


def _surface(
    positions: NDArray[Any], normals: NDArray[Any], uv: NDArray[Any], worn: ObjMaterial, label: str, *, glows: bool
) -> Surface:
    """Return the triangles of one material; those of plain colour share one material across all models."""
    uv = np.nan_to_num(uv.reshape(-1, 2).copy())
    uv[:, 1] = 1.0 - uv[:, 1]  # a picture's first row is at its top
    colour = _GLOW_COLOUR if glows else worn.colour
    if worn.picture is None or glows:
        uv[:] = 0.0
        material = Material("thing_glow", emission=_GLOW, double_sided=True) if glows else Material(
            "thing", double_sided=True
        )  # fmt: skip
    else:
        cutout = worn.picture.shape[2] == 4
        material = Material(label, worn.picture, cutout=cutout, double_sided=True, photo=not cutout)
    # Whole tiles less, so that coordinates stay small; then corners that are alike become one vertex.
    uv -= np.floor(uv.min(axis=0))
    rows = np.concatenate([positions.reshape(-1, 3), normals.reshape(-1, 3), uv], axis=1).astype(np.float32)
    _, first, index = np.unique(np.round(rows, 4), axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    place = np.empty(len(order), np.int64)
    place[order] = np.arange(len(order))
    kept = rows[first[order]]
    return Surface(
        kept[:, :3].copy(),
        kept[:, 3:6].copy(),
        kept[:, 6:].copy(),
        np.tile(np.array(colour, np.uint8), (len(kept), 1)),
        np.zeros(len(kept), np.int32),
        place[np.asarray(index).reshape(-1)].reshape(-1, 3).astype(np.int32),
        material,
    )
