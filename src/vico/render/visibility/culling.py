"""Culling, nearest first: drops parts out of the frustum, too small, turned away, elsewhere or hidden.

Here and in `vico.render.visibility.draw`, functions that are called for every item take single arrays: passing all of a
scene's costs half a microsecond.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from vico.render.arrays import ANYWHERE, BLOCK, INDOORS, INSTANCE_GROUP, TILE
from vico.render.compiled import inlined, kernel
from vico.render.geometry import CLUSTER_GROUP
from vico.render.records import NEVER_CULLED

# What is thinner than this on screen is not drawn, pixels.
_LEAST_PIXELS = 0.8
# Triangles that touch no more tiles than these are looked up in the coarse depth buffer one by one.
_MOST_TILES = 64


@inlined
def tiles_along(pixels: int) -> int:
    """Return how many tiles lie along a side of a picture."""
    return (pixels + TILE - 1) // TILE


@kernel
def renew_tiles(buffers: Any, camera: Any) -> None:
    """Write the farthest depth of every tile and of every block of tiles, as the bits of its inverse."""
    keys, tiles, blocks, strip = buffers.keys, buffers.tiles, buffers.blocks, buffers.strip
    width, height = camera.width, camera.height
    across = tiles_along(width)
    blocks_across = (across + BLOCK - 1) // BLOCK
    blocks[:] = np.uint32(0xFFFFFFFF)
    for tile_row in range(tiles_along(height)):
        top = tile_row * TILE
        # Slices: of a sum of two numbers the compiler can't tell that it is no index from the end, and gathers.
        line = keys[top * width : (top + 1) * width]
        for i in range(width):
            strip[i] = line[i]
        for row in range(top + 1, min(top + TILE, height)):
            line = keys[row * width : (row + 1) * width]
            for i in range(width):
                strip[i] = min(strip[i], line[i])
        for tile in range(across):
            first = tile * TILE
            least = strip[first]
            if first + TILE <= width:
                # Of a fixed length: vector code.
                for i in range(TILE):
                    least = min(least, strip[first + i])
            else:
                for i in range(first, width):
                    least = min(least, strip[i])
            bits = np.uint32(least >> np.uint64(32))
            tiles[tile_row * across + tile] = bits
            block = tile_row // BLOCK * blocks_across + tile // BLOCK
            blocks[block] = min(blocks[block], bits)


@inlined
def is_elsewhere(where: int, indoors: bool) -> bool:
    """Return whether a thing is outdoors and the camera in a room, or the other way round."""
    return where != ANYWHERE and (where == INDOORS) != indoors


@kernel
def set_world_view(camera: Any, out: Any) -> None:
    """Write the `MODEL_VIEW` of what is given in world coordinates.

    The camera's position is subtracted before turning, which keeps single precision exact near the camera.
    """
    m = out.matrix
    m[0, 0], m[0, 1], m[0, 2], m[0, 3] = camera.right_x, camera.right_y, camera.right_z, 0.0
    m[1, 0], m[1, 1], m[1, 2], m[1, 3] = camera.down_x, camera.down_y, camera.down_z, 0.0
    m[2, 0], m[2, 1], m[2, 2], m[2, 3] = camera.forward_x, camera.forward_y, camera.forward_z, 0.0
    out.origin[0], out.origin[1], out.origin[2] = camera.x, camera.y, camera.z


@inlined
def _write_row(m: Any, camera: Any, row: int, axis: Any, out: Any) -> None:
    r0, r1, r2 = axis
    for column in range(3):
        out[row, column] = r0 * m[0, column] + r1 * m[1, column] + r2 * m[2, column]
    out[row, 3] = r0 * (m[0, 3] - camera.x) + r1 * (m[1, 3] - camera.y) + r2 * (m[2, 3] - camera.z)


@kernel
def set_instance_view(m: Any, camera: Any, out: Any) -> None:
    """Write the `MODEL_VIEW` of an instance whose model-to-world transform is `m`."""
    matrix = out.matrix
    _write_row(m, camera, 0, (camera.right_x, camera.right_y, camera.right_z), matrix)
    _write_row(m, camera, 1, (camera.down_x, camera.down_y, camera.down_z), matrix)
    _write_row(m, camera, 2, (camera.forward_x, camera.forward_y, camera.forward_z), matrix)
    out.origin[0], out.origin[1], out.origin[2] = 0.0, 0.0, 0.0


@kernel
def set_box(model_view: Any, low: Any, high: Any, box: Any) -> None:
    """Write a bounding box in the camera's frame; `low` and `high` are its corners in the model's."""
    matrix, origin = model_view.matrix, model_view.origin
    cx = 0.5 * (float(low[0]) + high[0]) - origin[0]
    cy = 0.5 * (float(low[1]) + high[1]) - origin[1]
    cz = 0.5 * (float(low[2]) + high[2]) - origin[2]
    for row in range(3):
        m0, m1, m2 = matrix[row, 0], matrix[row, 1], matrix[row, 2]
        box.centre[row] = m0 * cx + m1 * cy + m2 * cz + matrix[row, 3]
        box.a[row] = m0 * 0.5 * (float(high[0]) - low[0])
        box.b[row] = m1 * 0.5 * (float(high[1]) - low[1])
        box.c[row] = m2 * 0.5 * (float(high[2]) - low[2])


@inlined
def nearest_depth(box: Any) -> float:
    """Return the least depth of a box, metres."""
    return box.centre[2] - abs(box.a[2]) - abs(box.b[2]) - abs(box.c[2])


@kernel
def in_view(box: Any, camera: Any) -> bool:
    """Return whether a box in the camera's frame may touch the viewing frustum."""
    depth, a, b, c = box.centre[2], box.a[2], box.b[2], box.c[2]
    reach = abs(a) + abs(b) + abs(c)
    if depth + reach <= camera.near or depth - reach >= camera.far:
        return False
    for axis in range(2):
        size, centre = (camera.width, camera.centre_x) if axis == 0 else (camera.height, camera.centre_y)
        tangent = max(centre, size - centre) / camera.focal
        for sign in (-1.0, 1.0):
            distance = depth * tangent + sign * box.centre[axis]
            radius = (
                abs(a * tangent + sign * box.a[axis])
                + abs(b * tangent + sign * box.b[axis])
                + abs(c * tangent + sign * box.c[axis])
            )
            if distance + radius <= 0.0:
                return False
    return True


@inlined
def _screen_bounds(box: Any, camera: Any) -> Any:
    """Return left, right, top and bottom of a box beyond the near plane, pixels."""
    left, right, top, bottom = 1e30, -1e30, 1e30, -1e30
    for corner in range(8):
        a = 1.0 if corner & 1 else -1.0
        b = 1.0 if corner & 2 else -1.0
        c = 1.0 if corner & 4 else -1.0
        w = camera.focal / (box.centre[2] + a * box.a[2] + b * box.b[2] + c * box.c[2])
        x = camera.centre_x + w * (box.centre[0] + a * box.a[0] + b * box.b[0] + c * box.c[0])
        y = camera.centre_y + w * (box.centre[1] + a * box.a[1] + b * box.b[1] + c * box.c[1])
        left, right = min(left, x), max(right, x)
        top, bottom = min(top, y), max(bottom, y)
    return left, right, top, bottom


@kernel
def is_hidden(box: Any, camera: Any, tiles: Any, blocks: Any) -> bool:
    """Return whether everything drawn so far covers a box that lies beyond the near plane."""
    nearest = nearest_depth(box)
    if nearest <= camera.near:
        return False
    left, right, top, bottom = _screen_bounds(box, camera)
    # A hundredth of a pixel of slack: these corners and the vertices are rounded differently.
    first = int(np.ceil(max(left - 0.51, 0.0)))
    last = int(np.ceil(min(right - 0.49, float(camera.width))))
    upper = int(np.ceil(max(top - 0.51, 0.0)))
    lower = int(np.ceil(min(bottom - 0.49, float(camera.height))))
    if first >= last or upper >= lower:
        return True
    bits = np.float32(1.00001 / nearest).view(np.uint32)
    across = tiles_along(camera.width)
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


@inlined
def is_triangle_hidden(t: Any, tiles: Any, size: Any) -> bool:
    """Return whether a triangle holds no pixel's centre, or lies behind all that is drawn around it.

    Large triangles are not looked at: drawing them costs less.
    """
    left = int(max(np.ceil(min(t.a.x, t.b.x, t.c.x) - 0.5), 0.0))
    right = int(min(np.ceil(max(t.a.x, t.b.x, t.c.x) - 0.5), float(size.width)))
    top = int(max(np.ceil(min(t.a.y, t.b.y, t.c.y) - 0.5), 0.0))
    bottom = int(min(np.ceil(max(t.a.y, t.b.y, t.c.y) - 0.5), float(size.height)))
    if left >= right or top >= bottom:
        return True
    first, last, upper, lower = left // TILE, (right - 1) // TILE, top // TILE, (bottom - 1) // TILE
    if (last - first + 1) * (lower - upper + 1) > _MOST_TILES:
        return False
    nearest = max(t.a.inverse_depth, t.b.inverse_depth, t.c.inverse_depth)
    bits = np.float32(nearest).view(np.uint32)
    across = tiles_along(size.width)
    for row in range(upper, lower + 1):
        for tile in range(first, last + 1):
            if tiles[row * across + tile] <= bits:
                return False
    return True


@inlined
def distance_to_box(low: Any, high: Any, camera: Any) -> float:
    """Return how far the camera is from a box in the world, metres."""
    dx = max(float(low[0]) - camera.x, camera.x - float(high[0]), 0.0)
    dy = max(float(low[1]) - camera.y, camera.y - float(high[1]), 0.0)
    dz = max(float(low[2]) - camera.z, camera.z - float(high[2]), 0.0)
    return np.sqrt(dx * dx + dy * dy + dz * dz)


@inlined
def faces_away(low: Any, high: Any, cone: Any, camera: Any) -> bool:
    """Return whether every face of a cluster is seen from behind."""
    if cone.limit >= NEVER_CULLED:
        return False
    dx = 0.5 * (float(low[0]) + high[0]) - camera.x
    dy = 0.5 * (float(low[1]) + high[1]) - camera.y
    dz = 0.5 * (float(low[2]) + high[2]) - camera.z
    ex, ey, ez = float(high[0]) - low[0], float(high[1]) - low[1], float(high[2]) - low[2]
    radius = 0.5 * np.sqrt(ex * ex + ey * ey + ez * ez)
    length = np.sqrt(dx * dx + dy * dy + dz * dz)
    return dx * cone.x + dy * cone.y + dz * cone.z > cone.limit * length + radius * (1.0 + cone.limit)


@inlined
def is_tiny(radius: Any, depth: Any, camera: Any) -> bool:
    """Return whether a sphere is too small on screen to be drawn."""
    return 2.0 * radius * camera.focal < _LEAST_PIXELS * depth


@kernel
def is_instance_in_view(sphere: Any, owner: int, where: int, camera: Any) -> bool:
    """Return whether an instance may be seen: a cheap first test of its sphere, its place and its size on screen."""
    if camera.hidden_entity != 0 and owner == camera.hidden_entity:
        return False
    if is_elsewhere(where, camera.indoors != 0):
        return False
    dx, dy, dz = sphere.x - camera.x, sphere.y - camera.y, sphere.z - camera.z
    radius = float(sphere.radius)
    ahead = dx * camera.forward_x + dy * camera.forward_y + dz * camera.forward_z
    if ahead + radius <= camera.near or ahead - radius >= camera.far or is_tiny(radius, ahead, camera):
        return False
    tangent_x = max(camera.centre_x, camera.width - camera.centre_x) / camera.focal
    tangent_y = max(camera.centre_y, camera.height - camera.centre_y) / camera.focal
    aside = abs(dx * camera.right_x + dy * camera.right_y + dz * camera.right_z)
    if (aside - ahead * tangent_x) > radius * np.sqrt(1.0 + tangent_x * tangent_x):
        return False
    above = abs(dx * camera.down_x + dy * camera.down_y + dz * camera.down_z)
    return (above - ahead * tangent_y) <= radius * np.sqrt(1.0 + tangent_y * tangent_y)


_BUCKETS = 640
_BUCKETS_PER_ROOT_METRE = 20.0


@kernel
def list_static(scene: Any, camera: Any, buffers: Any) -> int:
    """Write what may be in view of what never moves to `buffers.ordered`, nearest first; return how many entries.

    Entries count clusters, groups of static instances, instances that move, avatars, in this order. What is in a group
    is looked at when its turn comes: most groups are hidden by then.
    """
    set_world_view(camera, buffers.model_view)
    found = _list_clusters(scene, camera, buffers)
    found = _list_groups(scene, camera, buffers, len(scene.cluster_where), found)
    _sort_by_bucket(buffers.candidate, buffers.bucket, buffers.ordered, found)
    return found


@kernel
def list_moving(scene: Any, camera: Any, buffers: Any) -> int:
    """Do as `list_static` for what moves."""
    set_world_view(camera, buffers.model_view)
    first = len(scene.cluster_where) + len(scene.instances.groups.where)
    found = _list_instances(scene, camera, buffers, first, 0)
    first += scene.counts.instances - scene.counts.static_instances
    found = _list_avatars(scene, camera, buffers, first, found)
    _sort_by_bucket(buffers.candidate, buffers.bucket, buffers.ordered, found)
    return found


@inlined
def members(entry: int, clusters: int, groups: int, static_instances: int) -> Any:
    """Return the first and the end item code that an entry of the list stands for."""
    if entry < clusters:
        return entry, entry + 1
    if entry < clusters + groups:
        first = clusters + (entry - clusters) * INSTANCE_GROUP
        return first, min(first + INSTANCE_GROUP, clusters + static_instances)
    first = entry - groups + static_instances
    return first, first + 1


@inlined
def _bucket(distance: float) -> int:
    """Return a number that grows with the distance, finest nearby."""
    return min(int(_BUCKETS_PER_ROOT_METRE * np.sqrt(distance)), _BUCKETS - 1)


@inlined
def _list_clusters(scene: Any, camera: Any, buffers: Any) -> int:
    where, indoors = scene.cluster_where, camera.indoors != 0
    lows, highs, cones = scene.clusters.low, scene.clusters.high, scene.clusters.cone
    group_lows, group_highs = scene.clusters.group_low, scene.clusters.group_high
    model_view, box, candidate, bucket = buffers.model_view, buffers.box, buffers.candidate, buffers.bucket
    found = 0
    skip = False
    for k in range(len(where)):
        if k % CLUSTER_GROUP == 0:
            group = k // CLUSTER_GROUP
            set_box(model_view, group_lows[group], group_highs[group], box)
            skip = not in_view(box, camera)
        if skip or is_elsewhere(where[k], indoors):
            continue
        low, high = lows[k], highs[k]
        if faces_away(low, high, cones[k], camera):
            continue
        set_box(model_view, low, high, box)
        if in_view(box, camera):
            candidate[found] = k
            bucket[found] = _bucket(distance_to_box(low, high, camera))
            found += 1
    return found


@inlined
def _list_groups(scene: Any, camera: Any, buffers: Any, first: int, found: int) -> int:
    groups, indoors = scene.instances.groups, camera.indoors != 0
    where, lows, highs, widest = groups.where, groups.low, groups.high, groups.radius
    model_view, box, candidate, bucket = buffers.model_view, buffers.box, buffers.candidate, buffers.bucket
    for k in range(len(where)):
        if is_elsewhere(where[k], indoors):
            continue
        low, high = lows[k], highs[k]
        set_box(model_view, low, high, box)
        if is_tiny(widest[k], nearest_depth(box), camera) or not in_view(box, camera):
            continue
        candidate[found] = first + k
        bucket[found] = _bucket(distance_to_box(low, high, camera))
        found += 1
    return found


@inlined
def _list_instances(scene: Any, camera: Any, buffers: Any, first: int, found: int) -> int:
    start, end = scene.counts.static_instances, scene.counts.instances
    spheres, owners, where = scene.instances.sphere, scene.instances.entity, scene.instances.where
    candidate, bucket = buffers.candidate, buffers.bucket
    for k in range(start, end):
        sphere = spheres[k]
        if is_instance_in_view(sphere, owners[k], where[k], camera):
            dx, dy, dz = sphere.x - camera.x, sphere.y - camera.y, sphere.z - camera.z
            candidate[found] = first + k - start
            bucket[found] = _bucket(max(np.sqrt(dx * dx + dy * dy + dz * dz) - sphere.radius, 0.0))
            found += 1
    return found


@inlined
def _list_avatars(scene: Any, camera: Any, buffers: Any, first: int, found: int) -> int:
    entities, spans = scene.mesh.entity, scene.avatars.span
    lows, highs = scene.avatars.low, scene.avatars.high
    model_view, box, candidate, bucket = buffers.model_view, buffers.box, buffers.candidate, buffers.bucket
    for k in range(scene.counts.avatars):
        if camera.hidden_entity != 0 and entities[spans[k].first_triangle] == camera.hidden_entity:
            continue
        low, high = lows[k], highs[k]
        set_box(model_view, low, high, box)
        if in_view(box, camera):
            candidate[found] = first + k
            bucket[found] = _bucket(distance_to_box(low, high, camera))
            found += 1
    return found


@inlined
def _sort_by_bucket(candidate: Any, bucket: Any, ordered: Any, found: int) -> None:
    counts = np.zeros(_BUCKETS + 1, np.int32)
    for k in range(found):
        counts[bucket[k] + 1] += 1
    for k in range(_BUCKETS):
        counts[k + 1] += counts[k]
    for k in range(found):
        slot = bucket[k]
        ordered[counts[slot]] = candidate[k]
        counts[slot] += 1
