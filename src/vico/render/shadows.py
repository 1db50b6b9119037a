"""Shadows: a map of what the sun sees of the static scene, a relief for sky light, and casters that move."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vico.render.arrays import INDOORS
from vico.render.fill import PAD, fill, fill_cutout
from vico.render.raster import camera_matrix, in_view, is_hidden, set_box, worth_drawing
from vico.render.textures import CUTOUT, DOUBLE_SIDED


@njit(cache=True, nogil=True, error_model="numpy")
def draw_flat(arrays: Any, frame: Any, keys: Any, size: int, lit: bool) -> None:
    """Draw all static outdoor things in parallel projection: `frame` gives column, row and closeness of a point.

    Closeness must be positive. Without `lit`, single-sided faces that look toward the viewer are left out: what casts
    a shadow is then the far side of a body, and its lit side can't shade itself.
    """
    mesh, clusters = arrays.mesh, len(arrays.cluster_where)
    points = np.empty((3, 3))
    model = np.zeros(12)
    for k in range(clusters + arrays.counts[1]):
        if k < clusters:
            if arrays.cluster_where[k] == INDOORS:
                continue
            span = arrays.clusters.span[k]
            model[:] = 0.0
            model[0], model[5], model[10] = 1.0, 1.0, 1.0
        else:
            if arrays.instances.where[k - clusters] == INDOORS:
                continue
            span = arrays.prototypes.levels[arrays.instances.prototype[k - clusters], 0]
            model[:] = arrays.instances.matrix[k - clusters]
        for t in range(span[0], span[1]):
            ids = mesh.triangle[t]
            for corner in range(3):
                c = mesh.corner[ids[corner]]
                x = model[0] * c[0] + model[1] * c[1] + model[2] * c[2] + model[3]
                y = model[4] * c[0] + model[5] * c[1] + model[6] * c[2] + model[7]
                z = model[8] * c[0] + model[9] * c[1] + model[10] * c[2] + model[11]
                for axis in range(3):
                    points[corner, axis] = frame[axis, 0] * x + frame[axis, 1] * y + frame[axis, 2] * z + frame[axis, 3]
            a, b, c = points[0], points[1], points[2]
            area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])
            if not lit and area > 0.0 and arrays.textures.flags[ids[3]] & DOUBLE_SIDED == 0:
                continue
            if arrays.textures.flags[ids[3]] & CUTOUT:
                p, q, r = mesh.corner[ids[0]], mesh.corner[ids[1]], mesh.corner[ids[2]]
                fill_cutout(
                    keys,
                    size,
                    size,
                    a[0],
                    a[1],
                    a[2],
                    b[0],
                    b[1],
                    b[2],
                    c[0],
                    c[1],
                    c[2],
                    1,
                    arrays.textures,
                    ids[3],
                    float(p[6]),
                    float(p[7]),
                    float(q[6]),
                    float(q[7]),
                    float(r[6]),
                    float(r[7]),
                )
            else:
                fill(keys, size, size, a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2], 1)


@njit(cache=True, nogil=True, error_model="numpy")
def _closeness(keys: Any, scale: float, out: Any) -> None:
    flat = out.reshape(-1)
    for i in range(flat.size):
        flat[i] = np.uint16(np.uint32(keys[i] >> np.uint64(32)).view(np.float32) * scale)


@njit(cache=True, nogil=True, error_model="numpy")
def _heights(keys: Any, low: float, out: Any) -> None:
    flat = out.reshape(-1)
    for i in range(flat.size):
        flat[i] = np.uint32(keys[i] >> np.uint64(32)).view(np.float32) + low - 1.0


def shadow_map(
    arrays: Any, sun: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64], size: int
) -> tuple[NDArray[np.uint16], NDArray[np.float32]]:
    """What a parallel light sees of the static scene within a box of the world.

    Returns
    -------
    shadow
        Closeness to the sun of the first surface (65535 nearest), uint16, shape ``(size, size)``.
    frame
        Takes a world point and 1 to column, row and closeness, float32, shape ``(3, 4)``.
    """
    across = np.cross([0.0, 0.0, 1.0], sun)
    across = across / np.linalg.norm(across) if np.linalg.norm(across) > 1e-6 else np.array([1.0, 0.0, 0.0])
    axes = np.stack([across, np.cross(sun, across), sun])
    corners = np.array([[(low, high)[i][0], (low, high)[j][1], (low, high)[k][2]] for i, j, k in np.ndindex(2, 2, 2)])
    reach = corners @ axes.T
    first, last = reach.min(axis=0), reach.max(axis=0)
    span = np.maximum(last - first, 1e-3)
    factor = np.array([size / span[0], size / span[1], 1.0 / (span[2] * 1.01)])
    frame = np.zeros((3, 4))
    frame[:, :3] = axes * factor[:, None]
    frame[:, 3] = -first * factor
    frame[2, 3] += 0.005
    keys = np.zeros(size * size + PAD, np.uint64)
    draw_flat(arrays, frame, keys, size, False)
    shadow = np.zeros((size, size), np.uint16)
    _closeness(keys, 65535.0, shadow)
    frame[2] *= 65535.0
    return shadow, frame.astype(np.float32)


def relief_map(
    arrays: Any, low: NDArray[np.float64], high: NDArray[np.float64], size: int, radius: float
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Top heights of the static scene, blurred twice over `radius` metres, and the map's frame."""
    span = max(float((high - low)[:2].max()), 1e-3)
    frame = np.zeros((3, 4))
    frame[0, 0] = frame[1, 1] = size / span
    frame[0, 3], frame[1, 3] = -low[0] * size / span, -low[1] * size / span
    frame[2, 2], frame[2, 3] = 1.0, 1.0 - low[2]
    keys = np.zeros(size * size + PAD, np.uint64)
    keys[:] = np.uint64(np.float32(1.0).view(np.uint32)) << np.uint64(32)
    draw_flat(arrays, frame, keys, size, True)
    heights = np.zeros((size, size), np.float32)
    _heights(keys, float(low[2]), heights)
    reach = max(round(radius * size / span), 1)
    for _ in range(2):
        for axis in (0, 1):
            heights = _box_blur(heights, reach, axis)
    return heights, np.array([low[0], low[1], size / span], np.float32)


def _box_blur(values: NDArray[np.float32], reach: int, axis: int) -> NDArray[np.float32]:
    width = [(0, 0), (0, 0)]
    width[axis] = (reach + 1, reach)
    sums = np.cumsum(np.pad(values.astype(np.float64), width, mode="edge"), axis=axis)
    window = 2 * reach + 1
    if axis == 0:
        return ((sums[window:] - sums[:-window]) / window).astype(np.float32)
    return ((sums[:, window:] - sums[:, :-window]) / window).astype(np.float32)


@njit(cache=True, nogil=True, error_model="numpy")
def _cast(
    arrays: Any,
    k: int,
    view: Any,
    numbers: Any,
    width: int,
    height: int,
    reach: float,
    centre: Any,
    corners: Any,
    inverse: Any,
    sun: Any,
    points: Any,
    bounds: Any,
) -> bool:
    """Where on the screen a moving thing may darken something: False if nowhere.

    Leaves its centre, half axes (columns of `corners`), world-to-unit-box transform, the sun's direction in that
    frame, and the bounds (first and end column, first and end row).
    """
    rigid, indoors = arrays.counts[0], view[18] > 0.5
    sx, sy, sz = float(numbers[18]), float(numbers[19]), float(numbers[20])
    round_shape = k >= rigid
    if round_shape:
        if indoors and view[27] != 0.0 and arrays.mesh.entity[arrays.avatars.span[k - rigid, 0]] == int(view[27]):
            # Nobody sees their own body: in a room, its shadow would be a stain around nothing.
            return False
        low, high = arrays.avatars.low[k - rigid], arrays.avatars.high[k - rigid]
        corners[:, :] = 0.0
        for axis in range(3):
            centre[axis] = 0.5 * (float(low[axis]) + high[axis])
            corners[axis, axis] = 0.5 * (float(high[axis]) - low[axis])
        corners[0, 0], corners[1, 1] = min(corners[0, 0], 0.30), min(corners[1, 1], 0.30)
    else:
        m = arrays.instances.matrix[k]
        model = arrays.instances.prototype[k]
        low, high = arrays.prototypes.low[model], arrays.prototypes.high[model]
        for row in range(3):
            total = float(m[row * 4 + 3])
            for axis in range(3):
                total += m[row * 4 + axis] * 0.5 * (float(low[axis]) + high[axis])
                corners[row, axis] = m[row * 4 + axis] * 0.5 * (float(high[axis]) - low[axis])
            centre[row] = total
    gx, gy, gz = centre[0] - view[0], centre[1] - view[1], centre[2] - view[2]
    if gx * gx + gy * gy + gz * gz > reach * reach:
        return False
    up = abs(corners[2, 0]) + abs(corners[2, 1]) + abs(corners[2, 2])
    for axis in range(3):
        length = corners[0, axis] ** 2 + corners[1, axis] ** 2 + corners[2, axis] ** 2
        if length < 1e-8:
            return False
        for row in range(3):
            inverse[axis, row] = corners[row, axis] / length
        inverse[axis, 3] = -(inverse[axis, 0] * centre[0] + inverse[axis, 1] * centre[1] + inverse[axis, 2] * centre[2])
        sun[axis] = inverse[axis, 0] * sx + inverse[axis, 1] * sy + inverse[axis, 2] * sz
    # The box and its shadow on the ground beneath, with a rim for the contact shadow; in rooms the latter alone.
    throw = 0.0 if indoors else min(2.0 * up / max(sz, 0.08), 14.0)
    rim, middle, tall = 1.3, 0.0, 1.1
    if indoors and round_shape:
        rim, middle, tall = 2.0, -1.0, 0.5 / up
    for corner in range(16):
        a = rim if corner & 1 else -rim
        b = rim if corner & 2 else -rim
        c = middle + (tall if corner & 4 else -tall)
        away = throw if corner & 8 else 0.0
        wx = centre[0] + a * corners[0, 0] + b * corners[0, 1] + c * corners[0, 2] - away * sx - view[0]
        wy = centre[1] + a * corners[1, 0] + b * corners[1, 1] + c * corners[1, 2] - away * sy - view[1]
        wz = centre[2] + a * corners[2, 0] + b * corners[2, 1] + c * corners[2, 2] - away * sz - view[2]
        points[corner, 0] = wx * view[3] + wy * view[4] + wz * view[5]
        points[corner, 1] = wx * view[6] + wy * view[7] + wz * view[8]
        points[corner, 2] = wx * view[9] + wy * view[10] + wz * view[11]
    near = float(view[16])
    left, right, top, bottom = 1e30, -1e30, 1e30, -1e30
    for i in range(16):
        if points[i, 2] <= near:
            continue
        w = view[12] / points[i, 2]
        px, py = view[14] + w * points[i, 0], view[15] + w * points[i, 1]
        left, right, top, bottom = min(left, px), max(right, px), min(top, py), max(bottom, py)
        for j in range(16):
            # What lies behind the near plane is cut off there.
            if points[j, 2] <= near:
                s = (points[i, 2] - near) / (points[i, 2] - points[j, 2])
                px = view[14] + view[12] / near * (points[i, 0] + s * (points[j, 0] - points[i, 0]))
                py = view[15] + view[12] / near * (points[i, 1] + s * (points[j, 1] - points[i, 1]))
                left, right, top, bottom = min(left, px), max(right, px), min(top, py), max(bottom, py)
    bounds[0], bounds[1] = int(min(max(left, 0.0), 1e9)), int(max(min(right + 1.0, float(width)), -1.0))
    bounds[2], bounds[3] = int(min(max(top, 0.0), 1e9)), int(max(min(bottom + 1.0, float(height)), -1.0))
    return bool(bounds[0] < bounds[1] and bounds[2] < bounds[3])


@njit(cache=True, nogil=True, error_model="numpy")
def cast_moving(arrays: Any, view: Any, numbers: Any, buffers: Any, width: int, height: int, reach: float) -> bool:
    """Darken `buffers.sun` and `buffers.contact` where moving things stand between a pixel and the sun or the ground.

    Rigid things cast the shadow of their bounding box, avatars that of an ellipsoid; the longer the light's way
    through it, the darker, which softens the rim. Only casters within `reach` metres are taken. Returns whether there
    were any.
    """
    clusters, rigid, indoors = len(arrays.cluster_where), arrays.counts[0], view[18] > 0.5
    inverse, corners, points = np.zeros((3, 4)), np.zeros((3, 3)), np.zeros((16, 3))
    sun, centre, bounds = np.zeros(3), np.zeros(3), np.zeros(4, np.int64)
    started = False
    pixel = 1.0 / view[12]
    for k in range(arrays.counts[1], rigid + arrays.counts[2]):
        round_shape = k >= rigid
        if not _cast(arrays, k, view, numbers, width, height, reach, centre, corners, inverse, sun, points, bounds):
            continue
        x_first, x_last, y_first, y_last = bounds[0], bounds[1], bounds[2], bounds[3]
        up = abs(corners[2, 0]) + abs(corners[2, 1]) + abs(corners[2, 2])
        if not started:
            buffers.sun[:] = np.float32(1.0)
            buffers.contact[:] = np.float32(1.0)
            started = True
        slot = buffers.slot[clusters + k]
        mine, mine_end = 0, 0
        if slot >= 0:
            mine, mine_end = buffers.base[slot], buffers.base[slot + 1]
        foot = centre[2] - up
        for row in range(y_first, y_last):
            cv = (row + 0.5 - view[15]) * pixel
            for column in range(x_first, x_last):
                key = buffers.keys[row * width + column]
                number = int(key & np.uint64(0xFFFFFFFF))
                if number == 0 or mine <= number < mine_end:
                    continue
                depth = 1.0 / np.uint32(key >> np.uint64(32)).view(np.float32)
                cu = (column + 0.5 - view[14]) * pixel
                x = view[0] + depth * (view[9] + cu * view[3] + cv * view[6])
                y = view[1] + depth * (view[10] + cu * view[4] + cv * view[7])
                z = view[2] + depth * (view[11] + cu * view[5] + cv * view[8])
                if z > foot + 2.2 * up or z < foot - 6.0:
                    continue
                a = inverse[0, 0] * x + inverse[0, 1] * y + inverse[0, 2] * z + inverse[0, 3]
                b = inverse[1, 0] * x + inverse[1, 1] * y + inverse[1, 2] * z + inverse[1, 3]
                c = inverse[2, 0] * x + inverse[2, 1] * y + inverse[2, 2] * z + inverse[2, 3]
                if not indoors:
                    if round_shape:
                        # Distances along the ray at which it enters and leaves the unit ball.
                        qa = sun[0] * sun[0] + sun[1] * sun[1] + sun[2] * sun[2]
                        qb = a * sun[0] + b * sun[1] + c * sun[2]
                        qc = a * a + b * b + c * c - 1.0
                        root = qb * qb - qa * qc
                        near, far = 0.0, -1.0
                        if root > 0.0:
                            root = np.sqrt(root)
                            near, far = (-qb - root) / qa, (-qb + root) / qa
                        soft = 0.22
                    else:
                        near, far = -1e30, 1e30
                        for axis in range(3):
                            o = a if axis == 0 else (b if axis == 1 else c)
                            d = sun[axis]
                            if abs(d) < 1e-9:
                                if abs(o) > 1.0:
                                    far = -1e30
                            else:
                                t0, t1 = (-1.0 - o) / d, (1.0 - o) / d
                                near, far = max(near, min(t0, t1)), min(far, max(t0, t1))
                        soft = 0.5
                    way = far - max(near, 0.0)
                    if far > 0.0 and way > 0.0:
                        dark = min(way / soft, 1.0)
                        buffers.sun[row * width + column] *= np.float32(1.0 - dark * dark * (3.0 - 2.0 * dark))
                if abs(z - foot) < 0.5:
                    # Under and beside the thing even the sky is hidden.
                    spread = np.sqrt(a * a + b * b) if round_shape else max(abs(a), abs(b))
                    edge = 2.0 if round_shape else 1.25
                    if spread < edge:
                        dark = (1.0 - spread / edge) * (1.0 - abs(z - foot) * 2.0)
                        dark = min(dark * (1.5 if round_shape else 4.0), 0.75)
                        buffers.contact[row * width + column] *= np.float32(1.0 - dark)
    return started


@njit(cache=True, nogil=True, error_model="numpy")
def is_disturbed(
    arrays: Any, view: Any, numbers: Any, tiles: Any, blocks: Any, width: int, height: int, reach: float
) -> bool:
    """Whether a moving thing may be seen in a room, or darken something that is.

    `tiles` and `blocks` are the coarse depths of the room without such things: what lies behind them all is hidden.
    """
    rigid, fixed, unseen = int(arrays.counts[0]), int(arrays.counts[1]), int(view[27])
    clusters = len(arrays.cluster_where)
    spheres, owners, places = arrays.instances.sphere, arrays.instances.entity, arrays.instances.where
    placed, prototype = arrays.instances.matrix, arrays.instances.prototype
    model_low, model_high = arrays.prototypes.low, arrays.prototypes.high
    matrix, box = np.zeros(16, np.float32), np.zeros(16)
    inverse, corners, points = np.zeros((3, 4)), np.zeros((3, 3)), np.zeros((16, 3))
    sun, centre, bounds = np.zeros(3), np.zeros(3), np.zeros(4, np.int64)
    for k in range(fixed, rigid):
        if worth_drawing(k, owners, places, spheres, unseen, view[18] > 0.5, view, width, height):
            camera_matrix(placed, clusters, rigid, view, clusters + k, matrix)
            set_box(matrix, model_low[prototype[k]], model_high[prototype[k]], box)
            if in_view(box, view, width, height) and not is_hidden(box, view, tiles, blocks, width, height):
                return True
        if _cast(arrays, k, view, numbers, width, height, reach, centre, corners, inverse, sun, points, bounds):
            return True
    camera_matrix(placed, clusters, rigid, view, clusters + rigid, matrix)
    low, high = np.zeros(3), np.zeros(3)
    for k in range(arrays.counts[2]):
        if unseen != 0 and arrays.mesh.entity[arrays.avatars.span[k, 0]] == unseen:
            continue
        for axis in range(3):
            low[axis], high[axis] = float(arrays.avatars.low[k, axis]), float(arrays.avatars.high[k, axis])
        set_box(matrix, low, high, box)
        if in_view(box, view, width, height) and not is_hidden(box, view, tiles, blocks, width, height):
            return True
        # The floor around somebody's feet, which is all that they darken in a room.
        for axis in range(2):
            middle, half = 0.5 * (low[axis] + high[axis]), min(0.5 * (high[axis] - low[axis]), 0.30)
            low[axis], high[axis] = middle - 2.01 * half, middle + 2.01 * half
        low[2], high[2] = low[2] - 0.51, low[2] + 0.51
        set_box(matrix, low, high, box)
        if in_view(box, view, width, height) and not is_hidden(box, view, tiles, blocks, width, height):
            return True
    return False
