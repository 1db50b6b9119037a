"""A scene and a thread's scratch memory as plain arrays, for the compiled code."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.render.fill import PAD
from vico.render.geometry import Clusters, Mesh
from vico.render.pixels import REAL_FIELDS, STRIDE, WHOLE_FIELDS
from vico.render.textures import Textures

# Pixels along a tile of the coarse depth buffer, and tiles along a block of the coarser one above it.
TILE, BLOCK = 8, 4
# Triangles whose numbers the shader keeps at hand.
RECORDS = 2048
OUTDOORS, INDOORS, ANYWHERE = 0, 1, 2
# Static instances that are looked at together.
CROWD = 48


class Prototypes(NamedTuple):
    """Meshes that are drawn many times.

    Attributes
    ----------
    low, high
        Bounds in model space, float32, shape ``(p, 3)``.
    levels
        First triangle, end, first vertex, end of each level of detail, finest first, int32, shape ``(p, 3, 4)``.
    pixels
        A level is used below this size on screen, float32, shape ``(p, 3)``.
    """

    low: NDArray[np.float32]
    high: NDArray[np.float32]
    levels: NDArray[np.int32]
    pixels: NDArray[np.float32]


class Groups(NamedTuple):
    """Neighbours among the static instances, `CROWD` at a time, shape ``(g, ...)``.

    Attributes
    ----------
    low, high
        Corners of a box around them, float32.
    where
        OUTDOORS or INDOORS if all are, else ANYWHERE, uint8.
    radius
        Of the largest bounding sphere among them, float32.
    """

    low: NDArray[np.float32]
    high: NDArray[np.float32]
    where: NDArray[np.uint8]
    radius: NDArray[np.float32]


class Instances(NamedTuple):
    """Placed prototypes: the static ones first, in groups of neighbours; then what moves; then spare room.

    Attributes
    ----------
    matrix
        Upper three rows of the model-to-world transform, float32, shape ``(n, 12)``.
    where
        OUTDOORS, INDOORS or ANYWHERE, uint8.
    sphere
        Centre and radius of a bounding sphere in the world, float32, shape ``(n, 4)``.
    groups
        Of the static ones.
    """

    matrix: NDArray[np.float32]
    prototype: NDArray[np.int32]
    entity: NDArray[np.int32]
    where: NDArray[np.uint8]
    sphere: NDArray[np.float32]
    groups: Groups


class Avatars(NamedTuple):
    """Posed bodies: bounds, and first triangle, end, first vertex, end."""

    low: NDArray[np.float32]
    high: NDArray[np.float32]
    span: NDArray[np.int32]


class Arrays(NamedTuple):
    """A whole scene for the compiled code. `counts`: instances (all), static instances, avatars."""

    mesh: Mesh
    textures: Textures
    clusters: Clusters
    cluster_where: NDArray[np.uint8]
    prototypes: Prototypes
    instances: Instances
    avatars: Avatars
    counts: NDArray[np.int64]


class Buffers(NamedTuple):
    """Scratch memory of one thread."""

    keys: NDArray[np.uint64]
    tiles: NDArray[np.uint32]
    blocks: NDArray[np.uint32]
    strip: NDArray[np.uint64]
    vertex: NDArray[np.float32]
    matrix: NDArray[np.float32]
    box: NDArray[np.float64]
    code: NDArray[np.int32]
    bucket: NDArray[np.int32]
    ordered: NDArray[np.int32]
    drawn: NDArray[np.int32]
    base: NDArray[np.int64]
    level: NDArray[np.int32]
    slot: NDArray[np.int32]
    sun: NDArray[np.float32]
    contact: NDArray[np.float32]
    real: NDArray[np.float32]
    whole: NDArray[np.uint32]
    sky_real: NDArray[np.float32]
    sky_whole: NDArray[np.uint32]
    record: NDArray[np.float64]
    record_single: NDArray[np.float32]
    record_whole: NDArray[np.int32]


def buffers_for(arrays: Arrays, width: int, height: int) -> Buffers:
    """Scratch memory for pictures of this size."""
    items = len(arrays.cluster_where) + len(arrays.instances.entity) + len(arrays.avatars.span) + 1
    spans = (arrays.clusters.span, arrays.prototypes.levels.reshape(-1, 4), arrays.avatars.span)
    most = max(int((s[:, 3] - s[:, 2]).max(initial=1)) for s in spans)
    pixels = width * height
    tiles = ((width + TILE - 1) // TILE) * ((height + TILE - 1) // TILE)
    side = TILE * BLOCK
    blocks = ((width + side - 1) // side) * ((height + side - 1) // side)
    return Buffers(
        np.zeros(pixels + PAD, np.uint64),
        np.zeros(tiles, np.uint32),
        np.zeros(blocks, np.uint32),
        np.zeros(width, np.uint64),
        np.zeros((6, most), np.float32),
        np.zeros(16, np.float32),
        np.zeros(16, np.float64),
        np.zeros(items, np.int32),
        np.zeros(items, np.int32),
        np.zeros(items, np.int32),
        np.zeros(items, np.int32),
        np.zeros(items + 1, np.int64),
        np.zeros(items, np.int32),
        np.full(items, -1, np.int32),
        np.ones(pixels, np.float32),
        np.ones(pixels, np.float32),
        np.zeros(REAL_FIELDS * STRIDE, np.float32),
        np.zeros(WHOLE_FIELDS * STRIDE, np.uint32),
        np.zeros(REAL_FIELDS * STRIDE, np.float32),
        np.zeros(WHOLE_FIELDS * STRIDE, np.uint32),
        np.zeros((RECORDS, 16), np.float64),
        np.zeros((RECORDS, 32), np.float32),
        np.zeros((RECORDS, 4), np.int32),
    )
