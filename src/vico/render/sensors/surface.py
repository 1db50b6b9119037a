"""Normals, and where each seen point was before: read off the keys that the visibility pass left."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from vico.render.arrays import SETUPS
from vico.render.compiled import inlined, kernel
from vico.render.records import FLAT_NORMAL, TWO_SIDED
from vico.render.shading.triangle import set_up_triangle
from vico.render.visibility.draw import item_of
from vico.render.visibility.fill import triangle_number

# The sky is this far away, metres: only turning moves it.
_SKY = 1e7


class _Point(NamedTuple):
    """A seen point: its triangle, the weights of two corners, its depth, and the ray of depth 1 to it."""

    triangle: int
    first: float
    second: float
    depth: float
    ray_x: float
    ray_y: float
    ray_z: float


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
    keys, setups, known = buffers.keys, buffers.setup, buffers.setup_number
    known[:] = 0
    width = camera.width
    with_normals, with_places = normals.size > 0, places.size > 0
    for row in range(camera.height):
        for column in range(width):
            number = triangle_number(keys[row * width + column])
            ray = _ray(camera, column, row)
            if number == 0:
                if with_normals:
                    normals[row, column, 0] = normals[row, column, 1] = normals[row, column, 2] = 0.0
                if with_places:
                    for axis in range(3):
                        places[row, column, axis] = _SKY * ray[axis]
                continue
            slot = number & np.uint32(SETUPS - 1)
            setup = setups[slot]
            if known[slot] != number:
                set_up_triangle(scene, camera, buffers, drawn, int(number), setup)
                known[slot] = number
            inverse = 1.0 / (setup.inverse_column * column + setup.inverse_row * row + setup.inverse_start)
            first = (setup.first_column * column + setup.first_row * row + setup.first_start) * inverse
            second = (setup.second_column * column + setup.second_row * row + setup.second_start) * inverse
            first, second = min(max(first, 0.0), 1.0), min(max(second, 0.0), 1.0)
            if with_normals:
                _write_normal(setup, first, second, ray, normals[row, column])
            if with_places:
                depth = setup.volume * inverse
                point = _Point(int(number), first, second, depth, ray[0], ray[1], ray[2])
                _write_place(scene, camera, buffers, drawn, past, point, places[row, column])


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
def _write_normal(setup: Any, first: float, second: float, ray: Any, out: Any) -> None:
    n = setup.normal
    x, y, z = float(n[0, 0]), float(n[0, 1]), float(n[0, 2])
    if setup.flags & FLAT_NORMAL == 0:
        x += first * n[1, 0] + second * n[2, 0]
        y += first * n[1, 1] + second * n[2, 1]
        z += first * n[1, 2] + second * n[2, 2]
    scale = 1.0 / max(np.sqrt(x * x + y * y + z * z), 1e-12)
    if setup.flags & TWO_SIDED and x * ray[0] + y * ray[1] + z * ray[2] > 0.0:
        scale = -scale
    out[0], out[1], out[2] = x * scale, y * scale, z * scale


@kernel
def _write_place(scene: Any, camera: Any, buffers: Any, drawn: int, past: Any, point: Any, out: Any) -> None:
    """Write where a seen point was, from where the eye was."""
    first, second, depth, number = point.first, point.second, point.depth, point.triangle
    item = item_of(buffers.base, drawn, number)
    i = buffers.drawn[item] - len(scene.cluster_where)
    instances, fixed = scene.counts.instances, scene.counts.static_instances
    if i < fixed:
        out[0] = camera.x + depth * point.ray_x - past.eye[0]
        out[1] = camera.y + depth * point.ray_y - past.eye[1]
        out[2] = camera.z + depth * point.ray_z - past.eye[2]
        return
    ids = scene.mesh.triangle[buffers.first_triangle[item] + number - buffers.base[item]].vertices
    third = 1.0 - first - second
    out[0] = out[1] = out[2] = np.nan
    if i < instances:
        if past.known[i - fixed]:
            m = past.matrix[i - fixed]
            vertex = scene.mesh.vertex
            a, b, c = vertex[ids[0]].position, vertex[ids[1]].position, vertex[ids[2]].position
            x = first * a[0] + second * b[0] + third * c[0]
            y = first * a[1] + second * b[1] + third * c[1]
            z = first * a[2] + second * b[2] + third * c[2]
            for axis in range(3):
                out[axis] = m[axis, 0] * x + m[axis, 1] * y + m[axis, 2] * z + m[axis, 3] - past.eye[axis]
    elif len(past.x):
        start = scene.avatars.span[0].first_vertex
        a, b, c = ids[0] - start, ids[1] - start, ids[2] - start
        out[0] = first * past.x[a] + second * past.x[b] + third * past.x[c] - past.eye[0]
        out[1] = first * past.y[a] + second * past.y[b] + third * past.y[c] - past.eye[1]
        out[2] = first * past.z[a] + second * past.z[b] + third * past.z[c] - past.eye[2]
