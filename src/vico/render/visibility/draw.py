"""The visibility pass: which triangle is seen in which pixel, and how near it is.

What never moves is drawn first, then what moves, so that the former can be kept. Clusters and instances are drawn front
to back into a buffer of keys (see `vico.render.visibility.rasteriser`); a coarse buffer of the farthest depth in each 8
x 8 tile tells which of the later ones are hidden as a whole.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from vico.render.arrays import INVERSE_DEPTH, SCREEN_X, SCREEN_Y, VIEW_X, VIEW_Y, VIEW_Z
from vico.render.compiled import inlined, kernel
from vico.render.records import CUTOUT, DOUBLE_SIDED
from vico.render.visibility.culling import (
    in_view,
    is_hidden,
    is_instance_in_view,
    is_triangle_hidden,
    list_moving,
    list_static,
    members,
    nearest_depth,
    renew_tiles,
    set_box,
    set_instance_view,
    set_world_view,
)
from vico.render.visibility.rasteriser import (
    CornerUv,
    PictureSize,
    ScreenPoint,
    ScreenTriangle,
    cut_openings,
    fill,
    fill_cutout,
    triangle_number,
    twice_area,
)

# The coarse depth buffer is renewed after this many triangles of a 256 x 256 picture ...
_RENEW_TRIANGLES = 1200
# ... or after this many boxes were compared with it.
_RENEW_BOXES = 48
_PIXELS = 256 * 256


@kernel
def draw(scene: Any, camera: Any, buffers: Any) -> int:
    """Fill `buffers.keys` for one camera; return how many items were drawn.

    `buffers.drawn` lists them, `buffers.base` the first number of each one's triangles (from 1 up; the end follows).
    """
    return int(draw_moving(scene, camera, buffers, draw_static(scene, camera, buffers)))


@kernel
def draw_static(scene: Any, camera: Any, buffers: Any) -> int:
    """Draw what never moves, and nothing else; see `draw`."""
    _clear(camera, buffers)
    return int(_draw_listed(scene, camera, buffers, list_static(scene, camera, buffers), 0))


@kernel
def draw_moving(scene: Any, camera: Any, buffers: Any, drawn: int) -> int:
    """Add what moves to a picture in which `drawn` items are that never do; see `draw`."""
    buffers.slot[len(scene.cluster_where) + scene.counts.static_instances :] = -1
    if len(scene.openings) and not camera.indoors:
        cut_openings(scene.openings, camera, buffers.keys)
    found = list_moving(scene, camera, buffers)
    if found:
        renew_tiles(buffers, camera)
    return int(_draw_listed(scene, camera, buffers, found, drawn))


@kernel
def _draw_listed(scene: Any, camera: Any, buffers: Any, found: int, drawn: int) -> int:
    """Draw the first `found` entries of `buffers.ordered` behind the `drawn` items that are there; return how many."""
    clusters, groups = len(scene.cluster_where), len(scene.instances.groups.low)
    static_instances = scene.counts.static_instances
    owners, places, spheres = scene.instances.entity, scene.instances.where, scene.instances.sphere
    group_lows, group_highs = scene.instances.groups.low, scene.instances.groups.high
    ordered, tiles, blocks = buffers.ordered, buffers.tiles, buffers.blocks
    model_view, box = buffers.model_view, buffers.box
    drawn_codes, base, firsts, slots = buffers.drawn, buffers.base, buffers.first_triangle, buffers.slot
    # Larger pictures take longer to look over.
    patience = max(1, camera.width * camera.height // _PIXELS)
    number, since, asked = base[drawn], 0, 0
    for k in range(found):
        entry = ordered[k]
        # Few triangles may hide much (a room's walls), so questions asked count, too.
        if since > _RENEW_TRIANGLES * patience or (since > 0 and asked > _RENEW_BOXES * patience):
            renew_tiles(buffers, camera)
            since, asked = 0, 0
        asked += 1
        is_group = clusters <= entry < clusters + groups
        if is_group:
            set_world_view(camera, model_view)
            set_box(model_view, group_lows[entry - clusters], group_highs[entry - clusters], box)
            if is_hidden(box, camera, tiles, blocks):
                continue
        first_code, end_code = members(entry, clusters, groups, static_instances)
        for code in range(first_code, end_code):
            i = code - clusters
            if is_group and not is_instance_in_view(spheres[i], owners[i], places[i], camera):
                continue
            if not _set_item_box(scene, camera, code, model_view, box):
                continue
            if since > _RENEW_TRIANGLES * patience:
                renew_tiles(buffers, camera)
                since, asked = 0, 0
            if is_hidden(box, camera, tiles, blocks):
                continue
            first, end = _draw_item(scene, camera, buffers, code, number)
            drawn_codes[drawn] = code
            base[drawn] = number
            firsts[drawn] = first
            slots[code] = drawn
            drawn += 1
            number += end - first
            since += end - first
    base[drawn] = number
    return drawn


@inlined
def _clear(camera: Any, buffers: Any) -> None:
    """Nothing is drawn yet before the far plane."""
    empty = np.uint64(np.float32(1.0 / camera.far).view(np.uint32)) << np.uint64(32)
    buffers.keys[:] = empty
    buffers.tiles[:] = np.uint32(empty >> np.uint64(32))
    buffers.blocks[:] = np.uint32(empty >> np.uint64(32))
    buffers.base[0] = 1


@inlined
def _set_item_box(scene: Any, camera: Any, code: int, model_view: Any, box: Any) -> bool:
    """Write an item's transform and bounding box; return whether it may be in view."""
    clusters, instances = len(scene.cluster_where), scene.counts.instances
    if code < clusters:
        set_world_view(camera, model_view)
        set_box(model_view, scene.clusters.low[code], scene.clusters.high[code], box)
        return True
    if code < clusters + instances:
        i = code - clusters
        model = scene.instances.prototype[i]
        set_instance_view(scene.instances.matrix[i], camera, model_view)
        set_box(model_view, scene.prototypes.low[model], scene.prototypes.high[model], box)
        return in_view(box, camera)
    avatar = code - clusters - instances
    set_world_view(camera, model_view)
    set_box(model_view, scene.avatars.low[avatar], scene.avatars.high[avatar], box)
    return True


@inlined
def _span_of(scene: Any, camera: Any, code: int, box: Any) -> Any:
    """Return an item's range of triangles and vertices, instances at the level of detail that their size asks for."""
    clusters, instances = len(scene.cluster_where), scene.counts.instances
    if code < clusters:
        return scene.clusters.span[code]
    if code < clusters + instances:
        model = scene.instances.prototype[code - clusters]
        return scene.prototypes.levels[model, _level_of_detail(box, camera, scene.prototypes.pixels[model])]
    return scene.avatars.span[code - clusters - instances]


@inlined
def _level_of_detail(box: Any, camera: Any, limits: Any) -> int:
    size = 0.0
    for axis in range(3):
        size += box.a[axis] ** 2 + box.b[axis] ** 2 + box.c[axis] ** 2
    pixels = 2.0 * np.sqrt(size) * camera.focal / max(box.centre[2], camera.near)
    level = 0
    while level < 2 and pixels < limits[level + 1]:
        level += 1
    return level


@kernel
def _transform(xs: Any, ys: Any, zs: Any, model_view: Any, camera: Any, out: Any) -> None:
    """Write the camera-space and screen positions of vertices to the rows of `out`."""
    m, origin = model_view.matrix, model_view.origin
    m00, m01, m02, m03 = m[0, 0], m[0, 1], m[0, 2], m[0, 3]
    m10, m11, m12, m13 = m[1, 0], m[1, 1], m[1, 2], m[1, 3]
    m20, m21, m22, m23 = m[2, 0], m[2, 1], m[2, 2], m[2, 3]
    ox, oy, oz = origin[0], origin[1], origin[2]
    focal, cx, cy = np.float32(camera.focal), np.float32(camera.centre_x), np.float32(camera.centre_y)
    one = np.float32(1.0)
    view_x, view_y, view_z = out[VIEW_X], out[VIEW_Y], out[VIEW_Z]
    screen_x, screen_y, inverse = out[SCREEN_X], out[SCREEN_Y], out[INVERSE_DEPTH]
    count = len(xs)
    # One loop a result: with more arrays in one, the compiler gives up proving them apart and writes scalar code.
    for i in range(count):
        view_x[i] = m00 * (xs[i] - ox) + m01 * (ys[i] - oy) + m02 * (zs[i] - oz) + m03
    for i in range(count):
        view_y[i] = m10 * (xs[i] - ox) + m11 * (ys[i] - oy) + m12 * (zs[i] - oz) + m13
    for i in range(count):
        view_z[i] = m20 * (xs[i] - ox) + m21 * (ys[i] - oy) + m22 * (zs[i] - oz) + m23
    for i in range(count):
        inverse[i] = one / view_z[i]
    for i in range(count):
        screen_x[i] = cx + focal * view_x[i] * inverse[i]
    for i in range(count):
        screen_y[i] = cy + focal * view_y[i] * inverse[i]


@inlined
def _draw_item(scene: Any, camera: Any, buffers: Any, code: int, number: int) -> Any:
    """Draw an item's triangles, numbered from `number` up; return its first and end triangle in the mesh."""
    mesh, textures, v = scene.mesh, scene.textures, buffers.vertex
    vertices, triangles, materials = mesh.vertex, mesh.triangle, textures.materials
    keys, tiles, box = buffers.keys, buffers.tiles, buffers.box
    size, near = PictureSize(camera.width, camera.height), np.float32(camera.near)
    span = _span_of(scene, camera, code, box)
    first, end, origin, last = span.first_triangle, span.end_triangle, span.first_vertex, span.end_vertex
    _transform(mesh.x[origin:last], mesh.y[origin:last], mesh.z[origin:last], buffers.model_view, camera, v)
    may_be_cut = nearest_depth(box) <= camera.near * 1.001
    sx, sy, sw, sz = v[SCREEN_X], v[SCREEN_Y], v[INVERSE_DEPTH], v[VIEW_Z]
    for row in range(first, end):
        triangle = triangles[row]
        ids = triangle.vertices
        a, b, c = ids[0] - origin, ids[1] - origin, ids[2] - origin
        flags = materials[triangle.material].flags
        if may_be_cut and min(sz[a], sz[b], sz[c]) < near:
            if max(sz[a], sz[b], sz[c]) > near:
                _draw_cut(triangle, origin, vertices, textures, camera, v, keys, number + row - first)
            continue
        t = ScreenTriangle(
            ScreenPoint(float(sx[a]), float(sy[a]), float(sw[a])),
            ScreenPoint(float(sx[b]), float(sy[b]), float(sw[b])),
            ScreenPoint(float(sx[c]), float(sy[c]), float(sw[c])),
        )
        if is_backfacing(t, flags) or is_triangle_hidden(t, tiles, size):
            continue
        if flags & CUTOUT:
            uv = corner_uv(vertices[ids[0]], vertices[ids[1]], vertices[ids[2]])
            fill_cutout(keys, size, t, number + row - first, textures, triangle.material, uv)
        else:
            fill(keys, size, t, number + row - first)
    return first, end


@inlined
def is_backfacing(t: Any, flags: int) -> bool:
    """Return whether a single-sided triangle is seen from behind, or edge on."""
    return twice_area(t) >= 0 and flags & DOUBLE_SIDED == 0


@inlined
def corner_uv(a: Any, b: Any, c: Any) -> Any:
    """Return the texture coordinates of three vertices."""
    return CornerUv(float(a.u), float(a.v), float(b.u), float(b.v), float(c.u), float(c.v))


@kernel
def _draw_cut(
    triangle: Any, origin: int, vertices: Any, textures: Any, camera: Any, v: Any, keys: Any, number: int
) -> None:
    """Draw a triangle that crosses the near plane: cut it there, then draw the one or two that remain."""
    points = np.empty((4, 5))
    count = _clip_to_near_plane(triangle.vertices, origin, vertices, camera, v, points)
    size, flags = PictureSize(camera.width, camera.height), textures.materials[triangle.material].flags
    for k in range(1, count - 1):
        p, q, r = points[0], points[k], points[k + 1]
        t = ScreenTriangle(
            ScreenPoint(p[_X], p[_Y], p[_W]), ScreenPoint(q[_X], q[_Y], q[_W]), ScreenPoint(r[_X], r[_Y], r[_W])
        )
        if is_backfacing(t, flags):
            continue
        if flags & CUTOUT:
            uv = CornerUv(p[_U], p[_V], q[_U], q[_V], r[_U], r[_V])
            fill_cutout(keys, size, t, number, textures, triangle.material, uv)
        else:
            fill(keys, size, t, number)


# Columns of the points of a clipped triangle: screen position, inverse depth, texture coordinates.
_X, _Y, _W, _U, _V = range(5)


@inlined
def _clip_to_near_plane(ids: Any, origin: int, vertices: Any, camera: Any, v: Any, points: Any) -> int:
    """Write the corners of the polygon that remains of a triangle before the camera; return how many there are."""
    near, focal = camera.near, camera.focal
    count = 0
    for k in range(3):
        a, b = ids[k] - origin, ids[(k + 1) % 3] - origin
        za, zb = float(v[VIEW_Z, a]), float(v[VIEW_Z, b])
        if za >= near:
            # The very numbers the whole neighbours use: another rounding would leave a crack.
            point, corner = points[count], vertices[ids[k]]
            point[_X], point[_Y], point[_W] = v[SCREEN_X, a], v[SCREEN_Y, a], v[INVERSE_DEPTH, a]
            point[_U], point[_V] = corner.u, corner.v
            count += 1
        if (za >= near) != (zb >= near):
            # Always from the visible end, so that both triangles of an edge get the same point.
            if za >= near:
                s = (za - near) / (za - zb)
                i, j = a, b
            else:
                s = (zb - near) / (zb - za)
                i, j = b, a
            point, seen, unseen = points[count], vertices[i + origin], vertices[j + origin]
            point[_X] = camera.centre_x + focal * (v[VIEW_X, i] + s * (float(v[VIEW_X, j]) - v[VIEW_X, i])) / near
            point[_Y] = camera.centre_y + focal * (v[VIEW_Y, i] + s * (float(v[VIEW_Y, j]) - v[VIEW_Y, i])) / near
            point[_W] = 1.0 / near
            point[_U] = seen.u + s * (float(unseen.u) - seen.u)
            point[_V] = seen.v + s * (float(unseen.v) - seen.v)
            count += 1
    return count


@kernel
def item_of(base: Any, drawn: int, number: int) -> int:
    """Return the index of the drawn item that a triangle number belongs to."""
    low, high = 0, drawn
    while high - low > 1:
        middle = (low + high) // 2
        if base[middle] <= number:
            low = middle
        else:
            high = middle
    return low


@kernel
def mark_changed(buffers: Any, kept: Any, moving: int) -> None:
    """Mark in `buffers.changed` what shows something else than the keys `kept`, or lies in a moving thing's shadow.

    `moving` is what `cast_moving` returned.
    """
    keys, sun, contact, changed = buffers.keys, buffers.sun, buffers.contact, buffers.changed
    one = np.float32(1.0)
    for i in range(len(changed)):
        changed[i] = keys[i] != kept[i]
    if moving:
        for i in range(len(changed)):
            changed[i] |= (sun[i] != one) | (contact[i] != one)


@kernel
def write_depth(keys: Any, depth: Any) -> None:
    """Write metres along the optical axis; 0 where nothing was hit."""
    flat = depth.reshape(-1)
    for i in range(flat.size):
        key = keys[i]
        seen = key & np.uint64(0xFFFFFFFF) != np.uint64(0)
        w = np.uint32(key >> np.uint64(32)).view(np.float32)
        flat[i] = np.float32(1.0) / w if seen else np.float32(0.0)


@kernel
def write_entities(scene: Any, buffers: Any, drawn: int, out: Any) -> None:
    """Write the entity of every pixel; 0 where nothing was hit."""
    # Taken out of their tuples once: that costs as much as a pixel.
    flat, keys, base, codes, firsts = out.reshape(-1), buffers.keys, buffers.base, buffers.drawn, buffers.first_triangle
    entities, owners = scene.mesh.entity, scene.instances.entity
    clusters, end_instance = len(scene.cluster_where), len(scene.cluster_where) + scene.counts.instances
    last, entity, low, high, item = np.uint32(0), np.int32(0), 0, 0, 0
    for i in range(flat.size):
        number = triangle_number(keys[i])
        if number != last:
            last = number
            if number == 0:
                entity = np.int32(0)
            else:
                if number < low or number >= high:
                    item = item_of(base, drawn, int(number))
                    low, high = base[item], base[item + 1]
                entity = entities[firsts[item] + int(number) - low]
                code = codes[item]
                if entity == 0 and clusters <= code < end_instance:
                    entity = owners[code - clusters]
        flat[i] = entity
