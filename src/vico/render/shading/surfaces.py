"""Per-triangle set-up, and normals and past places of a picture's pixels.

Normals, and where each seen point was before, are read off the keys that the visibility pass left.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from vico.render.arrays import SETUPS
from vico.render.compiled import inlined, kernel
from vico.render.records import (
    DOUBLE_SIDED,
    FLAT_NORMAL,
    GROUND_WINDOWS,
    MOVES,
    NO_WINDOWS,
    PLAIN_COLOUR,
    SHELTERED,
    TWO_SIDED,
    WINDOW_GROUND,
    WINDOW_SHIFT,
)
from vico.render.visibility.culling import set_instance_view, set_world_view
from vico.render.visibility.draw import item_of
from vico.render.visibility.rasteriser import triangle_number


@inlined
def set_up_triangle(scene: Any, camera: Any, buffers: Any, drawn: int, number: int, setup: Any) -> None:
    """Write the `TRIANGLE_SETUP` of a triangle number."""
    item = item_of(buffers.base, drawn, number)
    code = buffers.drawn[item]
    index = buffers.first_triangle[item] + number - buffers.base[item]
    triangle = scene.mesh.triangle[index]
    vertex, ids = scene.mesh.vertex, triangle.vertices
    a, b, c = vertex[ids[0]], vertex[ids[1]], vertex[ids[2]]
    clusters = len(scene.cluster_where)
    is_instance = clusters <= code < clusters + scene.counts.instances
    if is_instance:
        set_instance_view(scene.instances.matrix[code - clusters], camera, buffers.model_view)
    else:
        set_world_view(camera, buffers.model_view)
    _set_planes(a, b, c, buffers.model_view, camera, setup)
    setup.u, setup.v = c.u, c.v
    setup.first_u, setup.first_v = a.u - c.u, a.v - c.v
    setup.second_u, setup.second_v = b.u - c.u, b.v - c.v
    plain = _set_colours(a, b, c, setup.colour)
    flat = _set_normals(a, b, c, setup.normal)
    if is_instance:
        _turn_normals(scene.instances.matrix[code - clusters], setup.normal)
    _finish_normals(setup.normal, flat)
    material = scene.textures.materials[triangle.material]
    setup.emission = material.emission * _windows_share(scene, material, scene.mesh.entity[index])
    setup.window = _window_number(material, scene.mesh.entity[index])
    setup.texture_width = 1 << material.log2_width
    setup.texture_height = 1 << material.log2_height
    setup.material = triangle.material
    both = material.flags & DOUBLE_SIDED != 0
    is_person = code >= clusters + scene.counts.instances
    setup.flags = (FLAT_NORMAL if flat else 0) | (PLAIN_COLOUR if plain else 0) | (TWO_SIDED if both else 0)
    setup.flags |= SHELTERED if is_person else 0
    setup.flags |= MOVES if code >= clusters + scene.counts.static_instances else 0


@inlined
def _windows_share(scene: Any, material: Any, entity: Any) -> Any:
    """Return the share of a material's light that is on in a building."""
    if material.windows == NO_WINDOWS or len(scene.windows) == 0:
        return np.float32(1.0)
    low, high = 0, len(scene.windows)
    while low < high:
        middle = (low + high) >> 1
        if scene.windows[middle].building < entity:
            low = middle + 1
        else:
            high = middle
    if low == len(scene.windows) or scene.windows[low].building != entity:
        return np.float32(1.0)
    return scene.windows[low].shares[material.windows - 1]


@inlined
def _window_number(material: Any, entity: Any) -> Any:
    """Return whose window a triangle may show, 0 for none."""
    if material.windows == NO_WINDOWS:
        return np.uint32(0)
    ground = WINDOW_GROUND if material.windows == GROUND_WINDOWS else 0
    return np.uint32((int(entity) << WINDOW_SHIFT) | ground | material.storeys)


@inlined
def _in_camera(vertex: Any, model_view: Any) -> Any:
    """Return a vertex in the camera's frame, metres."""
    m, origin, position = model_view.matrix, model_view.origin, vertex.position
    x, y, z = float(position[0]) - origin[0], float(position[1]) - origin[1], float(position[2]) - origin[2]
    return (
        m[0, 0] * x + m[0, 1] * y + m[0, 2] * z + m[0, 3],
        m[1, 0] * x + m[1, 1] * y + m[1, 2] * z + m[1, 3],
        m[2, 0] * x + m[2, 1] * y + m[2, 2] * z + m[2, 3],
    )


@inlined
def _set_planes(a: Any, b: Any, c: Any, model_view: Any, camera: Any, setup: Any) -> None:
    """Write inverse depth and the corners' weights as planes over the picture."""
    ax, ay, az = _in_camera(a, model_view)
    bx, by, bz = _in_camera(b, model_view)
    cx, cy, cz = _in_camera(c, model_view)
    # A ray's share in a corner is its product with the normal of the plane through the eye and the opposite edge.
    e0x, e0y, e0z = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
    e1x, e1y, e1z = cy * az - cz * ay, cz * ax - cx * az, cx * ay - cy * ax
    e2x, e2y, e2z = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    setup.volume = ax * e0x + ay * e0y + az * e0z
    pixel = 1.0 / camera.focal
    u, v = (0.5 - camera.centre_x) * pixel, (0.5 - camera.centre_y) * pixel
    ex, ey, ez = e0x + e1x + e2x, e0y + e1y + e2y, e0z + e1z + e2z
    setup.inverse_column, setup.inverse_row, setup.inverse_start = ex * pixel, ey * pixel, ex * u + ey * v + ez
    setup.first_column, setup.first_row, setup.first_start = e0x * pixel, e0y * pixel, e0x * u + e0y * v + e0z
    setup.second_column, setup.second_row, setup.second_start = e1x * pixel, e1y * pixel, e1x * u + e1y * v + e1z


@inlined
def _set_colours(a: Any, b: Any, c: Any, colour: Any) -> bool:
    """Write the third corner's colour and the others' differences; return whether there are none."""
    plain = True
    for channel in range(3):
        c0, c1, c2 = a.colour[channel], b.colour[channel], c.colour[channel]
        colour[0, channel], colour[1, channel], colour[2, channel] = c2, c0 - c2, c1 - c2
        plain = plain and c0 == c2 and c1 == c2
    return plain


@inlined
def _set_normals(a: Any, b: Any, c: Any, normal: Any) -> bool:
    """Write the third, first and second corner's normals; return whether they are one."""
    flat = True
    for axis in range(3):
        n0, n1, n2 = a.normal[axis], b.normal[axis], c.normal[axis]
        normal[0, axis], normal[1, axis], normal[2, axis] = n2, n0, n1
        flat = flat and n0 == n2 and n1 == n2
    return flat


@inlined
def _turn_normals(transform: Any, normal: Any) -> None:
    """Turn normals from an instance's model to the world."""
    for k in range(3):
        a, b, c = normal[k, 0], normal[k, 1], normal[k, 2]
        for axis in range(3):
            normal[k, axis] = transform[axis, 0] * a + transform[axis, 1] * b + transform[axis, 2] * c


@inlined
def _finish_normals(normal: Any, flat: bool) -> None:
    """Make one normal a unit vector, or three the third and the others' differences."""
    if flat:
        a, b, c = normal[0, 0], normal[0, 1], normal[0, 2]
        scale = np.float32(1.0) / max(np.sqrt(a * a + b * b + c * c), np.float32(1e-12))
        normal[0, 0], normal[0, 1], normal[0, 2] = a * scale, b * scale, c * scale
    else:
        for axis in range(3):
            normal[1, axis] -= normal[0, axis]
            normal[2, axis] -= normal[0, axis]


# The sky is this far away, metres: only turning moves it.
_SKY = 1e7


@kernel
def write_surface(scene: Any, camera: Any, buffers: Any, drawn: int, past: Any, normals: Any, places: Any) -> None:
    """Write what every pixel of a picture shows of surfaces; arrays without elements are left out.

    Parameters
    ----------
    drawn
        What `draw` returned.
    past
        `PastPlaces`.
    normals
        Unit normals in the world's axes, 0 where nothing was hit; float32, shape ``(h, w, 3)``.
    places
        Where the seen points were, from where the eye was, in the world's axes, metres; NaN for what was not there.
        float64, shape ``(h, w, 3)``.
    """
    # All arrays are taken out of their tuples here: each time costs as much as a pixel.
    keys, setups, known = buffers.keys, buffers.setup, buffers.setup_number
    base, codes, firsts = buffers.base, buffers.drawn, buffers.first_triangle
    triangles, vertex = scene.mesh.triangle, scene.mesh.vertex
    matrix, was_there, px, py, pz, eye = past.matrix, past.known, past.x, past.y, past.z, past.eye
    clusters, instances, fixed = len(scene.cluster_where), scene.counts.instances, scene.counts.static_instances
    start = scene.avatars.span[0].first_vertex if scene.counts.avatars > 0 else 0
    known[:] = 0
    width, last, code, ids = camera.width, np.uint32(0), 0, triangles[0].vertices
    with_normals, with_places = normals.size > 0, places.size > 0
    for row in range(camera.height):
        for column in range(width):
            number = triangle_number(keys[row * width + column])
            ray = _ray(camera, column, row)
            if number == 0:
                _write_sky(ray, normals, places, row, column)
                continue
            slot = number & np.uint32(SETUPS - 1)
            setup = setups[slot]
            if known[slot] != number:
                set_up_triangle(scene, camera, buffers, drawn, int(number), setup)
                known[slot] = number
            if number != last:
                last = number
                item = item_of(base, drawn, int(number))
                code, ids = codes[item] - clusters, triangles[firsts[item] + int(number) - base[item]].vertices
            inverse = 1.0 / (setup.inverse_column * column + setup.inverse_row * row + setup.inverse_start)
            first = (setup.first_column * column + setup.first_row * row + setup.first_start) * inverse
            second = (setup.second_column * column + setup.second_row * row + setup.second_start) * inverse
            first, second = min(max(first, 0.0), 1.0), min(max(second, 0.0), 1.0)
            if with_normals:
                _write_normal(setup, first, second, ray, normals, row, column)
            if not with_places:
                continue
            x = y = z = np.nan
            third = 1.0 - first - second
            if code < fixed:
                depth = setup.volume * inverse
                x, y, z = camera.x + depth * ray[0], camera.y + depth * ray[1], camera.z + depth * ray[2]
            elif code < instances:
                if was_there[code - fixed]:
                    a, b, c = vertex[ids[0]].position, vertex[ids[1]].position, vertex[ids[2]].position
                    mx = first * a[0] + second * b[0] + third * c[0]
                    my = first * a[1] + second * b[1] + third * c[1]
                    mz = first * a[2] + second * b[2] + third * c[2]
                    k = code - fixed
                    x = matrix[k, 0, 0] * mx + matrix[k, 0, 1] * my + matrix[k, 0, 2] * mz + matrix[k, 0, 3]
                    y = matrix[k, 1, 0] * mx + matrix[k, 1, 1] * my + matrix[k, 1, 2] * mz + matrix[k, 1, 3]
                    z = matrix[k, 2, 0] * mx + matrix[k, 2, 1] * my + matrix[k, 2, 2] * mz + matrix[k, 2, 3]
            elif len(px):
                i, j, k = ids[0] - start, ids[1] - start, ids[2] - start
                x = first * px[i] + second * px[j] + third * px[k]
                y = first * py[i] + second * py[j] + third * py[k]
                z = first * pz[i] + second * pz[j] + third * pz[k]
            places[row, column, 0], places[row, column, 1] = x - eye[0], y - eye[1]
            places[row, column, 2] = z - eye[2]


@inlined
def _ray(camera: Any, column: int, row: int) -> Any:
    """Return the direction of depth 1 through a pixel's centre, world's axes."""
    u, v = (column + 0.5 - camera.centre_x) / camera.focal, (row + 0.5 - camera.centre_y) / camera.focal
    return (
        camera.forward_x + u * camera.right_x + v * camera.down_x,
        camera.forward_y + u * camera.right_y + v * camera.down_y,
        camera.forward_z + u * camera.right_z + v * camera.down_z,
    )


@inlined
def _write_sky(ray: Any, normals: Any, places: Any, row: int, column: int) -> None:
    for axis in range(3):
        if normals.size > 0:
            normals[row, column, axis] = 0.0
        if places.size > 0:
            places[row, column, axis] = _SKY * ray[axis]


@inlined
def _write_normal(setup: Any, first: float, second: float, ray: Any, out: Any, row: int, column: int) -> None:
    n = setup.normal
    x, y, z = float(n[0, 0]), float(n[0, 1]), float(n[0, 2])
    if setup.flags & FLAT_NORMAL == 0:
        x += first * n[1, 0] + second * n[2, 0]
        y += first * n[1, 1] + second * n[2, 1]
        z += first * n[1, 2] + second * n[2, 2]
    scale = 1.0 / max(np.sqrt(x * x + y * y + z * z), 1e-12)
    if setup.flags & TWO_SIDED and x * ray[0] + y * ray[1] + z * ray[2] > 0.0:
        scale = -scale
    out[row, column, 0], out[row, column, 1], out[row, column, 2] = x * scale, y * scale, z * scale
