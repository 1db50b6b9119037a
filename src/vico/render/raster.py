"""The visibility pass: which triangle is seen in which pixel, and how near it is.

Clusters and instances are drawn front to back into a buffer of keys (see `vico.render.fill`); a coarse buffer of the
farthest depth in each 8 x 8 tile tells which of the later ones are hidden as a whole.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from vico.render.arrays import ANYWHERE, BLOCK, CROWD, INDOORS, TILE
from vico.render.fill import fill, fill_cutout
from vico.render.geometry import GROUP
from vico.render.textures import CUTOUT, DOUBLE_SIDED

BUCKETS = 640
# The coarse depth buffer is renewed after this many triangles.
_RENEW = 1200
# ... or after this many boxes were compared with it.
_ASKED = 48
# Triangles that touch no more tiles than these are looked up in it one by one.
_MOST_TILES = 64


@njit(cache=True, nogil=True, error_model="numpy")
def renew_tiles(keys: Any, tiles: Any, blocks: Any, strip: Any, width: int, height: int) -> None:
    """Farthest depth of every tile and of every block of tiles, as the bits of its inverse."""
    across = (width + TILE - 1) // TILE
    blocks_across = (across + BLOCK - 1) // BLOCK
    blocks[:] = np.uint32(0xFFFFFFFF)
    for tile_row in range((height + TILE - 1) // TILE):
        top = tile_row * TILE
        for i in range(width):
            strip[i] = keys[top * width + i]
        for row in range(top + 1, min(top + TILE, height)):
            offset = row * width
            for i in range(width):
                strip[i] = min(strip[i], keys[offset + i])
        for tile in range(across):
            least = strip[tile * TILE]
            for i in range(tile * TILE + 1, min(tile * TILE + TILE, width)):
                least = min(least, strip[i])
            bits = np.uint32(least >> np.uint64(32))
            tiles[tile_row * across + tile] = bits
            block = tile_row // BLOCK * blocks_across + tile // BLOCK
            blocks[block] = min(blocks[block], bits)


@njit(cache=True, nogil=True, error_model="numpy")
def camera_matrix(placed: Any, clusters: int, instances: int, view: Any, code: int, out: Any) -> None:
    """Model-to-camera matrix of an item, then the point to subtract first; 15 numbers.

    Clusters subtract the camera's position before turning, which keeps single precision exact near the camera. Here
    and below, innermost functions take single arrays: passing all of a scene's costs half a microsecond.
    """
    if clusters <= code < clusters + instances:
        m = placed[code - clusters]
        for row in range(3):
            r0, r1, r2 = view[3 + row * 3], view[4 + row * 3], view[5 + row * 3]
            for column in range(3):
                out[row * 4 + column] = r0 * m[column] + r1 * m[4 + column] + r2 * m[8 + column]
            out[row * 4 + 3] = r0 * (m[3] - view[0]) + r1 * (m[7] - view[1]) + r2 * (m[11] - view[2])
        out[12], out[13], out[14] = 0.0, 0.0, 0.0
    else:
        for row in range(3):
            for column in range(3):
                out[row * 4 + column] = view[3 + row * 3 + column]
            out[row * 4 + 3] = 0.0
        out[12], out[13], out[14] = view[0], view[1], view[2]


@njit(cache=True, nogil=True, error_model="numpy")
def set_box(matrix: Any, low: Any, high: Any, box: Any) -> None:
    """Centre and half axes of a bounding box in camera space: 12 numbers."""
    cx = 0.5 * (float(low[0]) + high[0]) - matrix[12]
    cy = 0.5 * (float(low[1]) + high[1]) - matrix[13]
    cz = 0.5 * (float(low[2]) + high[2]) - matrix[14]
    for row in range(3):
        m0, m1, m2 = matrix[row * 4], matrix[row * 4 + 1], matrix[row * 4 + 2]
        box[row] = m0 * cx + m1 * cy + m2 * cz + matrix[row * 4 + 3]
        box[3 + row] = m0 * 0.5 * (float(high[0]) - low[0])
        box[6 + row] = m1 * 0.5 * (float(high[1]) - low[1])
        box[9 + row] = m2 * 0.5 * (float(high[2]) - low[2])


@njit(cache=True, nogil=True, error_model="numpy")
def in_view(box: Any, view: Any, width: int, height: int) -> bool:
    """Whether a box in camera space may touch the viewing frustum."""
    reach = abs(box[5]) + abs(box[8]) + abs(box[11])
    if box[2] + reach <= view[16] or box[2] - reach >= view[17]:
        return False
    for axis in range(2):
        size = width if axis == 0 else height
        tangent = 0.5 * size / view[12]
        for sign in (-1.0, 1.0):
            distance = box[2] * tangent + sign * box[axis]
            radius = (
                abs(box[5] * tangent + sign * box[3 + axis])
                + abs(box[8] * tangent + sign * box[6 + axis])
                + abs(box[11] * tangent + sign * box[9 + axis])
            )
            if distance + radius <= 0.0:
                return False
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def is_hidden(box: Any, view: Any, tiles: Any, blocks: Any, width: int, height: int) -> bool:
    """Whether everything drawn so far covers a box that lies beyond the near plane."""
    nearest = box[2] - abs(box[5]) - abs(box[8]) - abs(box[11])
    if nearest <= view[16]:
        return False
    left, right, top, bottom = 1e30, -1e30, 1e30, -1e30
    for corner in range(8):
        a = 1.0 if corner & 1 else -1.0
        b = 1.0 if corner & 2 else -1.0
        c = 1.0 if corner & 4 else -1.0
        w = view[12] / (box[2] + a * box[5] + b * box[8] + c * box[11])
        x = view[14] + w * (box[0] + a * box[3] + b * box[6] + c * box[9])
        y = view[15] + w * (box[1] + a * box[4] + b * box[7] + c * box[10])
        left, right = min(left, x), max(right, x)
        top, bottom = min(top, y), max(bottom, y)
    # A hundredth of a pixel of slack: these corners and the vertices are rounded differently.
    first = int(np.ceil(max(left - 0.51, 0.0)))
    last = int(np.ceil(min(right - 0.49, float(width))))
    upper = int(np.ceil(max(top - 0.51, 0.0)))
    lower = int(np.ceil(min(bottom - 0.49, float(height))))
    if first >= last or upper >= lower:
        return True
    bits = np.float32(1.00001 / nearest).view(np.uint32)
    across = (width + TILE - 1) // TILE
    blocks_across = (across + BLOCK - 1) // BLOCK
    first_tile, last_tile = first // TILE, (last - 1) // TILE
    first_row, last_row = upper // TILE, (lower - 1) // TILE
    for block_row in range(first_row // BLOCK, last_row // BLOCK + 1):
        for block in range(first_tile // BLOCK, last_tile // BLOCK + 1):
            if blocks[block_row * blocks_across + block] >= bits:
                continue
            for row in range(max(first_row, block_row * BLOCK), min(last_row, block_row * BLOCK + BLOCK - 1) + 1):
                for tile in range(max(first_tile, block * BLOCK), min(last_tile, block * BLOCK + BLOCK - 1) + 1):
                    if tiles[row * across + tile] < bits:
                        return False
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def _distance(low: Any, high: Any, view: Any) -> float:
    total = 0.0
    for axis in range(3):
        gap = max(float(low[axis]) - view[axis], view[axis] - float(high[axis]), 0.0)
        total += gap * gap
    return np.sqrt(total)


@njit(cache=True, nogil=True, error_model="numpy")
def worth_drawing(
    k: int,
    owners: Any,
    places: Any,
    spheres: Any,
    unseen: int,
    indoors: bool,
    view: Any,
    width: int,
    height: int,
) -> bool:
    """A cheap first test of an instance: a sphere against the planes of the frustum, and its size on screen."""
    if unseen != 0 and owners[k] == unseen:
        return False
    where = places[k]
    if where != ANYWHERE and (where == INDOORS) != indoors:
        return False
    dx, dy, dz = spheres[k, 0] - view[0], spheres[k, 1] - view[1], spheres[k, 2] - view[2]
    radius = float(spheres[k, 3])
    ahead = dx * view[9] + dy * view[10] + dz * view[11]
    if ahead + radius <= view[16] or ahead - radius >= view[17] or 2.0 * radius * view[12] < 0.8 * ahead:
        return False
    tangent_x, tangent_y = 0.5 * width / view[12], 0.5 * height / view[12]
    aside = abs(dx * view[3] + dy * view[4] + dz * view[5])
    if (aside - ahead * tangent_x) > radius * np.sqrt(1.0 + tangent_x * tangent_x):
        return False
    above = abs(dx * view[6] + dy * view[7] + dz * view[8])
    return (above - ahead * tangent_y) <= radius * np.sqrt(1.0 + tangent_y * tangent_y)


@njit(cache=True, nogil=True, error_model="numpy")
def _collect(arrays: Any, view: Any, buffers: Any, width: int, height: int) -> int:
    """List what may be in view, nearest first: clusters, groups of static instances, what moves, avatars.

    Numbered in this order. What is in a group is looked at when its turn comes: most groups are hidden by then.
    """
    clusters, instances, indoors = len(arrays.cluster_where), int(arrays.counts[0]), view[18] > 0.5
    matrix, box = buffers.matrix, buffers.box
    cluster_where, lows, highs, cones = (
        arrays.cluster_where,
        arrays.clusters.low,
        arrays.clusters.high,
        arrays.clusters.cone,
    )
    codes, buckets = buffers.code, buffers.bucket
    found = 0
    skip = False
    camera_matrix(arrays.instances.matrix, clusters, instances, view, clusters + instances, matrix)
    for k in range(clusters):
        if k % GROUP == 0:
            group = k // GROUP
            set_box(matrix, arrays.clusters.group_low[group], arrays.clusters.group_high[group], box)
            skip = not in_view(box, view, width, height)
        if skip:
            continue
        where = cluster_where[k]
        if where != ANYWHERE and (where == INDOORS) != indoors:
            continue
        low, high, cone = lows[k], highs[k], cones[k]
        if cone[3] < 2.0:
            dx = 0.5 * (float(low[0]) + high[0]) - view[0]
            dy = 0.5 * (float(low[1]) + high[1]) - view[1]
            dz = 0.5 * (float(low[2]) + high[2]) - view[2]
            ex, ey, ez = float(high[0]) - low[0], float(high[1]) - low[1], float(high[2]) - low[2]
            radius = 0.5 * np.sqrt(ex * ex + ey * ey + ez * ez)
            length = np.sqrt(dx * dx + dy * dy + dz * dz)
            if dx * cone[0] + dy * cone[1] + dz * cone[2] > cone[3] * length + radius * (1.0 + cone[3]):
                continue
        set_box(matrix, low, high, box)
        if not in_view(box, view, width, height):
            continue
        codes[found] = k
        buckets[found] = min(int(20.0 * np.sqrt(_distance(low, high, view))), BUCKETS - 1)
        found += 1
    fixed, groups = int(arrays.counts[1]), arrays.instances.groups
    where_of, group_low, group_high, widest = groups.where, groups.low, groups.high, groups.radius
    for k in range(len(where_of)):
        if where_of[k] != ANYWHERE and (where_of[k] == INDOORS) != indoors:
            continue
        low, high = group_low[k], group_high[k]
        set_box(matrix, low, high, box)
        nearest = box[2] - abs(box[5]) - abs(box[8]) - abs(box[11])
        if 2.0 * widest[k] * view[12] < 0.8 * nearest or not in_view(box, view, width, height):
            continue
        codes[found] = clusters + k
        buckets[found] = min(int(20.0 * np.sqrt(_distance(low, high, view))), BUCKETS - 1)
        found += 1
    unseen, spheres = int(view[27]), arrays.instances.sphere
    owners, places = arrays.instances.entity, arrays.instances.where
    for k in range(fixed, instances):
        if not worth_drawing(k, owners, places, spheres, unseen, indoors, view, width, height):
            continue
        dx, dy, dz = spheres[k, 0] - view[0], spheres[k, 1] - view[1], spheres[k, 2] - view[2]
        distance = max(np.sqrt(dx * dx + dy * dy + dz * dz) - spheres[k, 3], 0.0)
        codes[found] = clusters + len(where_of) + k - fixed
        buckets[found] = min(int(20.0 * np.sqrt(distance)), BUCKETS - 1)
        found += 1
    first = clusters + len(where_of) + instances - fixed
    for k in range(arrays.counts[2]):
        if unseen != 0 and arrays.mesh.entity[arrays.avatars.span[k, 0]] == unseen:
            continue
        low, high = arrays.avatars.low[k], arrays.avatars.high[k]
        set_box(matrix, low, high, box)
        if not in_view(box, view, width, height):
            continue
        codes[found] = first + k
        buckets[found] = min(int(20.0 * np.sqrt(_distance(low, high, view))), BUCKETS - 1)
        found += 1
    counts = np.zeros(BUCKETS + 1, np.int32)
    ordered = buffers.ordered
    for k in range(found):
        counts[buckets[k] + 1] += 1
    for k in range(BUCKETS):
        counts[k + 1] += counts[k]
    for k in range(found):
        slot = buckets[k]
        ordered[counts[slot]] = codes[k]
        counts[slot] += 1
    return found


@njit(cache=True, nogil=True, error_model="numpy")
def _level(box: Any, view: Any, limits: Any) -> int:
    """Level of detail that an instance's size on screen asks for."""
    size = 0.0
    for axis in range(3):
        size += box[3 + axis] ** 2 + box[6 + axis] ** 2 + box[9 + axis] ** 2
    pixels = 2.0 * np.sqrt(size) * view[12] / max(box[2], view[16])
    level = 0
    while level < 2 and pixels < limits[level + 1]:
        level += 1
    return level


@njit(cache=True, nogil=True, error_model="numpy")
def _transform(xs: Any, ys: Any, zs: Any, matrix: Any, view: Any, out: Any) -> None:
    """Camera-space and screen positions of vertices: rows x, y, z, screen x, screen y, 1/z."""
    m00, m01, m02, m03 = matrix[0], matrix[1], matrix[2], matrix[3]
    m10, m11, m12, m13 = matrix[4], matrix[5], matrix[6], matrix[7]
    m20, m21, m22, m23 = matrix[8], matrix[9], matrix[10], matrix[11]
    ox, oy, oz = matrix[12], matrix[13], matrix[14]
    focal, cx, cy = np.float32(view[12]), np.float32(view[14]), np.float32(view[15])
    one = np.float32(1.0)
    o0, o1, o2, o3, o4, o5 = out[0], out[1], out[2], out[3], out[4], out[5]
    count = len(xs)
    # One loop a result: with more arrays in one, the compiler gives up proving them apart and writes scalar code.
    for i in range(count):
        o0[i] = m00 * (xs[i] - ox) + m01 * (ys[i] - oy) + m02 * (zs[i] - oz) + m03
    for i in range(count):
        o1[i] = m10 * (xs[i] - ox) + m11 * (ys[i] - oy) + m12 * (zs[i] - oz) + m13
    for i in range(count):
        o2[i] = m20 * (xs[i] - ox) + m21 * (ys[i] - oy) + m22 * (zs[i] - oz) + m23
    for i in range(count):
        o5[i] = one / o2[i]
    for i in range(count):
        o3[i] = cx + focal * o0[i] * o5[i]
    for i in range(count):
        o4[i] = cy + focal * o1[i] * o5[i]


@njit(cache=True, nogil=True, error_model="numpy")
def _unseen(
    tiles: Any,
    width: int,
    height: int,
    x0: float,
    y0: float,
    x1: float,
    y1: float,
    x2: float,
    y2: float,
    nearest: Any,
) -> bool:
    """Whether a triangle holds no pixel's centre, or lies behind all that is drawn around it.

    `nearest` is the largest of its inverse depths. Large triangles are not looked at: drawing them costs less.
    """
    left = int(max(np.ceil(min(x0, x1, x2) - 0.5), 0.0))
    right = int(min(np.ceil(max(x0, x1, x2) - 0.5), float(width)))
    top = int(max(np.ceil(min(y0, y1, y2) - 0.5), 0.0))
    bottom = int(min(np.ceil(max(y0, y1, y2) - 0.5), float(height)))
    if left >= right or top >= bottom:
        return True
    first, last, upper, lower = left // TILE, (right - 1) // TILE, top // TILE, (bottom - 1) // TILE
    if (last - first + 1) * (lower - upper + 1) > _MOST_TILES:
        return False
    bits = np.float32(nearest).view(np.uint32)
    across = (width + TILE - 1) // TILE
    for row in range(upper, lower + 1):
        for tile in range(first, last + 1):
            if tiles[row * across + tile] <= bits:
                return False
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def _clipped(
    triangle: Any,
    corner: Any,
    textures: Any,
    cutout: bool,
    view: Any,
    keys: Any,
    width: int,
    height: int,
    v: Any,
    ids: Any,
    number: int,
    both: bool,
) -> None:
    """Draw a triangle that crosses the near plane: cut it there, then draw the one or two that remain."""
    near, focal = view[16], view[12]
    points = np.empty((4, 5))
    count = 0
    for k in range(3):
        a, b = ids[k], ids[(k + 1) % 3]
        za, zb = float(v[2, a]), float(v[2, b])
        ca, cb = corner[triangle[k]], corner[triangle[(k + 1) % 3]]
        if za >= near:
            # The very numbers the whole neighbours use: another rounding would leave a crack.
            points[count, 0], points[count, 1], points[count, 2] = v[3, a], v[4, a], v[5, a]
            points[count, 3], points[count, 4] = ca[6], ca[7]
            count += 1
        if (za >= near) != (zb >= near):
            # Always from the visible end, so that both triangles of an edge get the same point.
            if za >= near:
                s = (za - near) / (za - zb)
                i, j, ci, cj = a, b, ca, cb
            else:
                s = (zb - near) / (zb - za)
                i, j, ci, cj = b, a, cb, ca
            points[count, 0] = view[14] + focal * (v[0, i] + s * (float(v[0, j]) - v[0, i])) / near
            points[count, 1] = view[15] + focal * (v[1, i] + s * (float(v[1, j]) - v[1, i])) / near
            points[count, 2] = 1.0 / near
            points[count, 3] = ci[6] + s * (float(cj[6]) - ci[6])
            points[count, 4] = ci[7] + s * (float(cj[7]) - ci[7])
            count += 1
    if count < 3:
        return
    x, y, w = points[:, 0], points[:, 1], points[:, 2]
    material = triangle[3]
    for k in range(1, count - 1):
        area = (x[k] - x[0]) * (y[k + 1] - y[0]) - (x[k + 1] - x[0]) * (y[k] - y[0])
        if area >= 0.0 and not both:
            continue
        if cutout:
            fill_cutout(
                keys,
                width,
                height,
                x[0],
                y[0],
                w[0],
                x[k],
                y[k],
                w[k],
                x[k + 1],
                y[k + 1],
                w[k + 1],
                number,
                textures,
                material,
                points[0, 3],
                points[0, 4],
                points[k, 3],
                points[k, 4],
                points[k + 1, 3],
                points[k + 1, 4],
            )
        else:
            fill(keys, width, height, x[0], y[0], w[0], x[k], y[k], w[k], x[k + 1], y[k + 1], w[k + 1], number)


@njit(cache=True, nogil=True, error_model="numpy")
def draw(arrays: Any, view: Any, buffers: Any, width: int, height: int) -> int:
    """Fill `buffers.keys` for one camera; returns how many items were drawn.

    `buffers.drawn` lists them, `buffers.base` the first number of each one's triangles (from 1 up; the end follows).
    """
    keys, tiles, matrix, box, v = buffers.keys, buffers.tiles, buffers.matrix, buffers.box, buffers.vertex
    empty = np.uint64(np.float32(1.0 / view[17]).view(np.uint32)) << np.uint64(32)
    keys[:] = empty
    tiles[:] = np.uint32(empty >> np.uint64(32))
    buffers.blocks[:] = np.uint32(empty >> np.uint64(32))
    found = _collect(arrays, view, buffers, width, height)
    clusters, instances, fixed = len(arrays.cluster_where), int(arrays.counts[0]), int(arrays.counts[1])
    buffers.slot[clusters + fixed :] = -1
    group_low, group_high = arrays.instances.groups.low, arrays.instances.groups.high
    groups = len(group_low)
    owners, places, spheres = arrays.instances.entity, arrays.instances.where, arrays.instances.sphere
    unseen, indoors = int(view[27]), view[18] > 0.5
    mesh, textures, flags = arrays.mesh, arrays.textures, arrays.textures.flags
    triangles, corners = mesh.triangle, mesh.corner
    lows, highs, spans = arrays.clusters.low, arrays.clusters.high, arrays.clusters.span
    placed, prototype = arrays.instances.matrix, arrays.instances.prototype
    model_low, model_high = arrays.prototypes.low, arrays.prototypes.high
    levels, limits = arrays.prototypes.levels, arrays.prototypes.pixels
    avatar_low, avatar_high, avatar_span = arrays.avatars.low, arrays.avatars.high, arrays.avatars.span
    ordered, blocks, strip = buffers.ordered, buffers.blocks, buffers.strip
    drawn_codes, base, firsts, slots = buffers.drawn, buffers.base, buffers.level, buffers.slot
    xs, ys, zs = mesh.x, mesh.y, mesh.z
    near = np.float32(view[16])
    # Larger pictures take longer to look over.
    patience = max(1, width * height // 65536)
    drawn, number, since, asked = 0, 1, 0, 0
    ids = np.empty(3, np.int64)
    for k in range(found):
        entry = ordered[k]
        # Few triangles may hide much (a room's walls), so questions asked count, too.
        if since > _RENEW * patience or (since > 0 and asked > _ASKED * patience):
            renew_tiles(keys, tiles, blocks, strip, width, height)
            since, asked = 0, 0
        asked += 1
        first_code, end_code = entry, entry + 1
        grouped = clusters <= entry < clusters + groups
        if grouped:
            camera_matrix(placed, clusters, instances, view, clusters + instances, matrix)
            set_box(matrix, group_low[entry - clusters], group_high[entry - clusters], box)
            if is_hidden(box, view, tiles, blocks, width, height):
                continue
            first_code = clusters + (entry - clusters) * CROWD
            end_code = min(first_code + CROWD, clusters + fixed)
        elif entry >= clusters:
            first_code = entry - groups + fixed
            end_code = first_code + 1
        for code in range(first_code, end_code):
            if grouped and not worth_drawing(
                code - clusters, owners, places, spheres, unseen, indoors, view, width, height
            ):
                continue
            camera_matrix(placed, clusters, instances, view, code, matrix)
            model, avatar = 0, 0
            if code < clusters:
                set_box(matrix, lows[code], highs[code], box)
            elif code < clusters + instances:
                model = prototype[code - clusters]
                set_box(matrix, model_low[model], model_high[model], box)
                if not in_view(box, view, width, height):
                    continue
            else:
                avatar = code - clusters - instances
                set_box(matrix, avatar_low[avatar], avatar_high[avatar], box)
            if since > _RENEW * patience:
                renew_tiles(keys, tiles, blocks, strip, width, height)
                since, asked = 0, 0
            if is_hidden(box, view, tiles, blocks, width, height):
                continue
            if code < clusters:
                span = spans[code]
            elif code < clusters + instances:
                span = levels[model, _level(box, view, limits[model])]
            else:
                span = avatar_span[avatar]
            first, end, origin = span[0], span[1], span[2]
            _transform(xs[origin : span[3]], ys[origin : span[3]], zs[origin : span[3]], matrix, view, v)
            cut = box[2] - abs(box[5]) - abs(box[8]) - abs(box[11]) <= view[16] * 1.001
            sx, sy, sw, sz = v[3], v[4], v[5], v[2]
            for t in range(first, end):
                a, b, c = triangles[t, 0] - origin, triangles[t, 1] - origin, triangles[t, 2] - origin
                flag = flags[triangles[t, 3]]
                if cut and min(sz[a], sz[b], sz[c]) < near:
                    if max(sz[a], sz[b], sz[c]) > near:
                        ids[0], ids[1], ids[2] = a, b, c
                        both = flag & DOUBLE_SIDED != 0
                        _clipped(
                            triangles[t],
                            corners,
                            textures,
                            flag & CUTOUT != 0,
                            view,
                            keys,
                            width,
                            height,
                            v,
                            ids,
                            number + t - first,
                            both,
                        )
                    continue
                x0, y0 = float(sx[a]), float(sy[a])
                x1, y1 = float(sx[b]), float(sy[b])
                x2, y2 = float(sx[c]), float(sy[c])
                if (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0) >= 0 and flag & DOUBLE_SIDED == 0:
                    continue
                if _unseen(tiles, width, height, x0, y0, x1, y1, x2, y2, max(sw[a], sw[b], sw[c])):
                    continue
                if flag & CUTOUT:
                    p, q, r = (
                        corners[triangles[t, 0]],
                        corners[triangles[t, 1]],
                        corners[triangles[t, 2]],
                    )
                    fill_cutout(
                        keys,
                        width,
                        height,
                        x0,
                        y0,
                        float(sw[a]),
                        x1,
                        y1,
                        float(sw[b]),
                        x2,
                        y2,
                        float(sw[c]),
                        number + t - first,
                        textures,
                        triangles[t, 3],
                        float(p[6]),
                        float(p[7]),
                        float(q[6]),
                        float(q[7]),
                        float(r[6]),
                        float(r[7]),
                    )
                else:
                    fill(
                        keys,
                        width,
                        height,
                        x0,
                        y0,
                        float(sw[a]),
                        x1,
                        y1,
                        float(sw[b]),
                        x2,
                        y2,
                        float(sw[c]),
                        number + t - first,
                    )
            drawn_codes[drawn] = code
            base[drawn] = number
            firsts[drawn] = first
            slots[code] = drawn
            drawn += 1
            number += end - first
            since += end - first
    base[drawn] = number
    return drawn
