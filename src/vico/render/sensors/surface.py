"""Normals, and where each seen point was before: read off the keys that the visibility pass left."""

from __future__ import annotations

from typing import Any

import numpy as np

from vico.render.arrays import SETUPS
from vico.render.compiled import inlined, kernel
from vico.render.records import FLAT_NORMAL, TWO_SIDED
from vico.render.shading.triangle import set_up_triangle
from vico.render.visibility.draw import item_of
from vico.render.visibility.fill import triangle_number

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
