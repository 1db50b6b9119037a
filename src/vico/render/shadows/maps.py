"""Maps of the static scene seen from afar: what the sun sees, and how high everything is."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.exact import apply_matrix
from vico.render.arrays import INDOORS, PAD
from vico.render.compiled import inlined, kernel
from vico.render.lamps import TopHeights
from vico.render.records import CUTOUT, DOUBLE_SIDED
from vico.render.uniforms import ReliefMap, ShadowMap
from vico.render.visibility.draw import corner_uv
from vico.render.visibility.rasteriser import (
    PictureSize,
    ScreenPoint,
    ScreenTriangle,
    fill,
    fill_cutout,
    inverse_depth,
    twice_area,
)

# Texels of the heights that keep the light of lamps from places, metres.
_TOP_METRES = 1.0


@inlined
def _project(position: Any, model: Any, frame: Any) -> Any:
    """Return column, row and closeness of a point of a model."""
    c, m, f = position, model, frame
    x = m[0, 0] * c[0] + m[0, 1] * c[1] + m[0, 2] * c[2] + m[0, 3]
    y = m[1, 0] * c[0] + m[1, 1] * c[1] + m[1, 2] * c[2] + m[1, 3]
    z = m[2, 0] * c[0] + m[2, 1] * c[1] + m[2, 2] * c[2] + m[2, 3]
    return ScreenPoint(
        f[0, 0] * x + f[0, 1] * y + f[0, 2] * z + f[0, 3],
        f[1, 0] * x + f[1, 1] * y + f[1, 2] * z + f[1, 3],
        f[2, 0] * x + f[2, 1] * y + f[2, 2] * z + f[2, 3],
    )


@kernel
def draw_flat(scene: Any, frame: Any, keys: Any, side: int, lit: bool) -> None:
    """Draw all static outdoor things in parallel projection: `frame` gives column, row and closeness of a point.

    Closeness must be positive. Without `lit`, single-sided faces that look toward the viewer are left out: what casts
    a shadow is then the far side of a body, and its lit side can't shade itself.
    """
    clusters = len(scene.cluster_where)
    model = np.zeros((3, 4))
    for k in range(clusters + scene.counts.static_instances):
        if k < clusters:
            if scene.cluster_where[k] == INDOORS:
                continue
            span = scene.clusters.span[k]
            model[:] = 0.0
            model[0, 0], model[1, 1], model[2, 2] = 1.0, 1.0, 1.0
        else:
            if scene.instances.where[k - clusters] == INDOORS:
                continue
            span = scene.prototypes.levels[scene.instances.prototype[k - clusters], 0]
            model[:] = scene.instances.matrix[k - clusters]
        _draw_span(scene, span, model, frame, keys, PictureSize(side, side), lit)


@kernel
def _draw_span(scene: Any, span: Any, model: Any, frame: Any, keys: Any, size: Any, lit: bool) -> None:
    triangles, vertices, materials = scene.mesh.triangle, scene.mesh.vertex, scene.textures.materials
    for row in range(span.first_triangle, span.end_triangle):
        triangle = triangles[row]
        ids, flags = triangle.vertices, materials[triangle.material].flags
        a, b, c = vertices[ids[0]], vertices[ids[1]], vertices[ids[2]]
        t = ScreenTriangle(
            _project(a.position, model, frame),
            _project(b.position, model, frame),
            _project(c.position, model, frame),
        )
        if not lit and twice_area(t) > 0.0 and flags & DOUBLE_SIDED == 0:
            continue
        if flags & CUTOUT:
            fill_cutout(keys, size, t, 1, scene.textures, triangle.material, corner_uv(a, b, c))
        else:
            fill(keys, size, t, 1)


@kernel
def _closeness(keys: Any, scale: float, out: Any) -> None:
    flat = out.reshape(-1)
    for i in range(flat.size):
        flat[i] = np.uint16(inverse_depth(keys[i]) * scale)


@kernel
def _heights(keys: Any, low: float, out: Any) -> None:
    flat = out.reshape(-1)
    for i in range(flat.size):
        flat[i] = inverse_depth(keys[i]) + low - 1.0


def shadow_map(
    scene: Any, sun: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64], size: int
) -> ShadowMap:
    """Return what a parallel light sees of the static scene within a box of the world, `size` texels a side."""
    across = np.cross([0.0, 0.0, 1.0], sun)
    across = across / np.linalg.norm(across) if np.linalg.norm(across) > 1e-6 else np.array([1.0, 0.0, 0.0])
    axes = np.stack([across, np.cross(sun, across), sun])
    corners = np.array([[(low, high)[i][0], (low, high)[j][1], (low, high)[k][2]] for i, j, k in np.ndindex(2, 2, 2)])
    reach = apply_matrix(corners, axes)
    first, last = reach.min(axis=0), reach.max(axis=0)
    span = np.maximum(last - first, 1e-3)
    factor = np.array([size / span[0], size / span[1], 1.0 / (span[2] * 1.01)])
    frame = np.zeros((3, 4))
    frame[:, :3] = axes * factor[:, None]
    frame[:, 3] = -first * factor
    frame[2, 3] += 0.005
    keys = np.zeros(size * size + PAD, np.uint64)
    draw_flat(scene, frame, keys, size, False)
    closeness = np.zeros((size, size), np.uint16)
    _closeness(keys, 65535.0, closeness)
    frame[2] *= 65535.0
    return ShadowMap(closeness, frame.astype(np.float32))


def built_tops(scene: Any, low: NDArray[np.float64], high: NDArray[np.float64]) -> TopHeights:
    """Return the top heights of ground and buildings, without what is placed on them."""
    counts = scene.counts.copy()
    counts["static_instances"] = 0
    side = float((high - low)[:2].max())
    size = int(np.clip(side / _TOP_METRES, 16, 2048))
    heights, scale = _top_heights(scene._replace(counts=counts), low, high, size)
    return TopHeights(heights, float(low[0]), float(low[1]), scale)


def relief_map(scene: Any, low: NDArray[np.float64], high: NDArray[np.float64], size: int, radius: float) -> ReliefMap:
    """Return the top heights of the static scene, blurred twice over `radius` metres, `size` texels a side."""
    heights, scale = _top_heights(scene, low, high, size)
    reach = max(round(radius * scale), 1)
    for _ in range(2):
        for axis in (0, 1):
            heights = _box_blur(heights, reach, axis)
    west, south, scale = (float(np.float32(value)) for value in (low[0], low[1], scale))
    return ReliefMap(heights, west, south, scale)


def _top_heights(
    scene: Any, low: NDArray[np.float64], high: NDArray[np.float64], size: int
) -> tuple[NDArray[np.float32], float]:
    """Return the top heights of the static scene, metres, and texels a metre."""
    span = max(float((high - low)[:2].max()), 1e-3)
    frame = np.zeros((3, 4))
    frame[0, 0] = frame[1, 1] = size / span
    frame[0, 3], frame[1, 3] = -low[0] * size / span, -low[1] * size / span
    frame[2, 2], frame[2, 3] = 1.0, 1.0 - low[2]
    keys = np.zeros(size * size + PAD, np.uint64)
    keys[:] = np.uint64(np.float32(1.0).view(np.uint32)) << np.uint64(32)
    draw_flat(scene, frame, keys, size, True)
    heights = np.zeros((size, size), np.float32)
    _heights(keys, float(low[2]), heights)
    return heights, size / span


def _box_blur(values: NDArray[np.float32], reach: int, axis: int) -> NDArray[np.float32]:
    width = [(0, 0), (0, 0)]
    width[axis] = (reach + 1, reach)
    sums = np.cumsum(np.pad(values.astype(np.float64), width, mode="edge"), axis=axis)
    window = 2 * reach + 1
    if axis == 0:
        return ((sums[window:] - sums[:-window]) / window).astype(np.float32)
    return ((sums[:, window:] - sums[:, :-window]) / window).astype(np.float32)
