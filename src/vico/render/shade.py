"""The shading pass: every pixel once, from the triangle the visibility pass left in it."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vico.render.arrays import RECORDS
from vico.render.lighting import SKY_STEPS, TONE_RANGE, TONE_STEPS
from vico.render.pixels import (
    AROUND,
    BLOCK,
    BLUE,
    COLUMNS,
    GREEN,
    NX,
    NY,
    NZ,
    PIXEL,
    QUEUE,
    RED,
    ROWS,
    SHINE,
    SKY,
    START,
    STRIDE,
    SU,
    SUN,
    SV,
    U,
    V,
    X,
    Y,
    Z,
    finish,
    finish_sky,
)
from vico.render.raster import camera_matrix
from vico.render.textures import DOUBLE_SIDED

SKY_SIZE = 512
_TONE_SCALE = (TONE_STEPS - 1) / TONE_RANGE


class Light(NamedTuple):
    """What the shader reads of the light; see `vico.render.lighting` and `vico.render.shadows`.

    Attributes
    ----------
    numbers
        `light_numbers`.
    tone
        `tone_table`.
    sky
        `paint_sky`.
    shadow
        Closeness to the sun of the first surface, uint16, shape ``(n, n)``.
    shadow_frame
        Rows that take a world point (and 1) to column, row and closeness of the shadow map, float32, shape ``(3, 4)``.
    relief
        Blurred top heights of the static scene, float32, shape ``(m, m)``; points beneath them see less sky.
    relief_frame
        Its south-west corner (x, y) and texels a metre.
    """

    numbers: NDArray[np.float32]
    tone: NDArray[np.uint8]
    sky: NDArray[np.uint32]
    shadow: NDArray[np.uint16]
    shadow_frame: NDArray[np.float32]
    relief: NDArray[np.float32]
    relief_frame: NDArray[np.float32]


@njit(cache=True, nogil=True, error_model="numpy")
def item_of(base: Any, drawn: int, number: int) -> int:
    """Index of the drawn item a triangle number belongs to."""
    low, high = 0, drawn
    while high - low > 1:
        middle = (low + high) // 2
        if base[middle] <= number:
            low = middle
        else:
            high = middle
    return low


@njit(cache=True, nogil=True, error_model="numpy")
def write_depth(keys: Any, depth: Any) -> None:
    """Metres along the optical axis; 0 where nothing was hit."""
    flat = depth.reshape(-1)
    for i in range(flat.size):
        key = keys[i]
        seen = key & np.uint64(0xFFFFFFFF) != np.uint64(0)
        w = np.uint32(key >> np.uint64(32)).view(np.float32)
        flat[i] = np.float32(1.0) / w if seen else np.float32(0.0)


@njit(cache=True, nogil=True, error_model="numpy")
def write_entities(arrays: Any, buffers: Any, drawn: int, out: Any) -> None:
    """Entity of every pixel; 0 where nothing was hit."""
    flat = out.reshape(-1)
    clusters = len(arrays.cluster_where)
    last, entity, low, high, item = 0, 0, 0, 0, 0
    for i in range(flat.size):
        number = int(buffers.keys[i] & np.uint64(0xFFFFFFFF))
        if number != last:
            last = number
            if number == 0:
                entity = 0
            else:
                if number < low or number >= high:
                    item = item_of(buffers.base, drawn, number)
                    low, high = buffers.base[item], buffers.base[item + 1]
                entity = arrays.mesh.entity[buffers.level[item] + number - low]
                code = buffers.drawn[item]
                if entity == 0 and clusters <= code < clusters + arrays.counts[0]:
                    entity = arrays.instances.entity[code - clusters]
        flat[i] = entity


@njit(cache=True, nogil=True, error_model="numpy")
def _sky(n: Any, table: Any, clouds: Any, dx: float, dy: float, dz: float) -> tuple[float, float, float]:
    """Linear colour of the sky (or the haze below the horizon) in a unit direction."""
    s = np.sqrt(abs(dz))
    if dz < 0.0:
        s = -s
    place = (s + 1.0) * (0.5 * (SKY_STEPS - 1))
    i = min(int(place), SKY_STEPS - 2)
    f = place - i
    r = table[i, 0] + f * (table[i + 1, 0] - table[i, 0])
    g = table[i, 1] + f * (table[i + 1, 1] - table[i, 1])
    b = table[i, 2] + f * (table[i + 1, 2] - table[i, 2])
    toward = dx * n[0] + dy * n[1] + dz * n[2]
    if toward > 0.0:
        glow = toward * toward
        glow *= glow
        wide = 0.07 * glow
        glow *= glow
        glow *= glow
        glow *= glow
        wide += 0.16 * glow
        r += wide * n[3]
        g += wide * n[4]
        b += wide * n[5]
        if toward > 0.9994:
            disc = min((toward - 0.9994) * 5000.0, 1.0) * 2.0
            r += disc * n[3]
            g += disc * n[4]
            b += disc * n[5]
    if dz > 0.015:
        # Clouds lie on a plane overhead; a second look toward the sun tells lit rims from grey bellies.
        reach = 34.0 / (dz + 0.06)
        u, v = dx * reach, dy * reach
        thick = _cloud(clouds, u, v)
        cover = (thick - (1.0 - n[17])) * 4.0
        if cover > 0.0:
            beyond = _cloud(clouds, u + n[0] * 5.0, v + n[1] * 5.0)
            lit = min(max(0.55 + (thick - beyond) * 2.2 - 0.35 * (thick - 0.75), 0.0), 1.0)
            cover = min(cover, 1.0) * min((dz - 0.015) * 5.0, 1.0) * 0.9
            r += cover * (n[26] + lit * (n[23] - n[26]) - r)
            g += cover * (n[27] + lit * (n[24] - n[27]) - g)
            b += cover * (n[28] + lit * (n[25] - n[28]) - b)
    return r, g, b


@njit(cache=True, nogil=True, error_model="numpy")
def _cloud(clouds: Any, u: float, v: float) -> float:
    i, j = int(np.floor(u)), int(np.floor(v))
    f, g = u - i, v - j
    a, b = float(clouds[j & 255, i & 255]), float(clouds[j & 255, (i + 1) & 255])
    c, d = float(clouds[(j + 1) & 255, i & 255]), float(clouds[(j + 1) & 255, (i + 1) & 255])
    low, high = a + f * (b - a), c + f * (d - c)
    return (low + g * (high - low)) * (1.0 / 255.0)


@njit(cache=True, nogil=True, error_model="numpy")
def _openness(relief: Any, u: float, v: float, z: float) -> float:
    """Share of the sky's light that reaches a point between the masses around it."""
    size = relief.shape[0]
    if not (u >= 0.0 and v >= 0.0 and u < size - 1 and v < size - 1):
        return 1.0
    i, j = np.uint32(u), np.uint32(v)
    a, b = u - i, v - j
    one = np.uint32(1)
    low = relief[j, i] + a * (relief[j, i + one] - relief[j, i])
    high = relief[j + one, i] + a * (relief[j + one, i + one] - relief[j + one, i])
    deep = low + b * (high - low) - z
    if deep <= 0.0:
        return 1.0
    return 1.0 - 0.62 * deep / (deep + 5.0)


@njit(cache=True, nogil=True, error_model="numpy")
def _log2(value: float) -> int:
    """Whole part of the base-2 logarithm of a positive number."""
    return int(np.float32(value).view(np.uint32) >> np.uint32(23)) - 127


@njit(cache=True, nogil=True, error_model="numpy")
def paint_sky(n: Any, table: Any, clouds: Any, tone: Any, out: Any) -> None:
    """Paint the upper half of the sky, tone-mapped and packed like a texture, onto an unfolded octahedron.

    The direction (x, y, z) lies at u, v = (1 + (x + y) / s) / 2, (1 + (x - y) / s) / 2 with s = |x| + |y| + z.
    """
    for j in range(SKY_SIZE):
        for i in range(SKY_SIZE):
            p, q = (i + 0.5) * (2.0 / SKY_SIZE) - 1.0, (j + 0.5) * (2.0 / SKY_SIZE) - 1.0
            x, y = 0.5 * (p + q), 0.5 * (p - q)
            z = max(1.0 - abs(x) - abs(y), 0.0)
            scale = 1.0 / np.sqrt(x * x + y * y + z * z)
            red, green, blue = _sky(n, table, clouds, x * scale, y * scale, z * scale)
            r = np.uint32(tone[min(int(red * _TONE_SCALE), TONE_STEPS - 1)])
            g = np.uint32(tone[min(int(green * _TONE_SCALE), TONE_STEPS - 1)])
            b = np.uint32(tone[min(int(blue * _TONE_SCALE), TONE_STEPS - 1)])
            out[j * SKY_SIZE + i] = r | (g << np.uint32(8)) | (b << np.uint32(16))


# Numbers kept of a triangle. Double: depth's, the first and the second corner's weights as planes over the picture.
_INVERSE, _FIRST, _SECOND, _VOLUME = 0, 3, 6, 9
# Single: uv at the third corner and differences to the others, colour, normals, own light, texture's sides.
_UV, _COLOUR, _NORMAL, _SHINE, _SIDES = 0, 6, 15, 24, 25
# Whole: triangle's number, material, and the bits below.
_FLAT, _PLAIN, _BOTH = 1, 2, 4


@njit(cache=True, nogil=True, error_model="numpy")
def _remember(
    corner: Any,
    triangles: Any,
    placed: Any,
    instances: int,
    clusters: int,
    view: Any,
    code: int,
    triangle: int,
    m: Any,
    emission: Any,
    sizes: Any,
    flags: Any,
    number: int,
    record: Any,
    single: Any,
    whole: Any,
) -> None:
    """Work out what the shader needs of a triangle."""
    camera_matrix(placed, clusters, instances, view, code, m)
    i0, i1, i2 = triangles[triangle, 0], triangles[triangle, 1], triangles[triangle, 2]
    material = triangles[triangle, 3]
    x, y, z = float(corner[i0, 0]) - m[12], float(corner[i0, 1]) - m[13], float(corner[i0, 2]) - m[14]
    ax, ay = m[0] * x + m[1] * y + m[2] * z + m[3], m[4] * x + m[5] * y + m[6] * z + m[7]
    az = m[8] * x + m[9] * y + m[10] * z + m[11]
    x, y, z = float(corner[i1, 0]) - m[12], float(corner[i1, 1]) - m[13], float(corner[i1, 2]) - m[14]
    bx, by = m[0] * x + m[1] * y + m[2] * z + m[3], m[4] * x + m[5] * y + m[6] * z + m[7]
    bz = m[8] * x + m[9] * y + m[10] * z + m[11]
    x, y, z = float(corner[i2, 0]) - m[12], float(corner[i2, 1]) - m[13], float(corner[i2, 2]) - m[14]
    cx, cy = m[0] * x + m[1] * y + m[2] * z + m[3], m[4] * x + m[5] * y + m[6] * z + m[7]
    cz = m[8] * x + m[9] * y + m[10] * z + m[11]
    # A ray's share in a corner is its product with the normal of the plane through the eye and the opposite edge.
    e0x, e0y, e0z = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
    e1x, e1y, e1z = cy * az - cz * ay, cz * ax - cx * az, cx * ay - cy * ax
    e2x, e2y, e2z = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    record[_VOLUME] = ax * e0x + ay * e0y + az * e0z
    pixel = 1.0 / view[12]
    u, v = (0.5 - view[14]) * pixel, (0.5 - view[15]) * pixel
    ex, ey, ez = e0x + e1x + e2x, e0y + e1y + e2y, e0z + e1z + e2z
    record[_INVERSE], record[_INVERSE + 1], record[_INVERSE + 2] = ex * pixel, ey * pixel, ex * u + ey * v + ez
    record[_FIRST], record[_FIRST + 1], record[_FIRST + 2] = e0x * pixel, e0y * pixel, e0x * u + e0y * v + e0z
    record[_SECOND], record[_SECOND + 1], record[_SECOND + 2] = e1x * pixel, e1y * pixel, e1x * u + e1y * v + e1z
    u0, v0 = corner[i2, 6], corner[i2, 7]
    single[_UV], single[_UV + 1] = u0, v0
    single[_UV + 2], single[_UV + 3] = corner[i0, 6] - u0, corner[i0, 7] - v0
    single[_UV + 4], single[_UV + 5] = corner[i1, 6] - u0, corner[i1, 7] - v0
    plain, flat = True, True
    for axis in range(3):
        c0, c1, c2 = corner[i0, 8 + axis], corner[i1, 8 + axis], corner[i2, 8 + axis]
        single[_COLOUR + axis], single[_COLOUR + 3 + axis], single[_COLOUR + 6 + axis] = c2, c0 - c2, c1 - c2
        plain = plain and c0 == c2 and c1 == c2
        n0, n1, n2 = corner[i0, 3 + axis], corner[i1, 3 + axis], corner[i2, 3 + axis]
        single[_NORMAL + axis], single[_NORMAL + 3 + axis], single[_NORMAL + 6 + axis] = n2, n0, n1
        flat = flat and n0 == n2 and n1 == n2
    if clusters <= code < clusters + instances:
        t = placed[code - clusters]
        for k in range(_NORMAL, _NORMAL + 9, 3):
            a, b, c = single[k], single[k + 1], single[k + 2]
            for axis in range(3):
                single[k + axis] = t[axis * 4] * a + t[axis * 4 + 1] * b + t[axis * 4 + 2] * c
    a, b, c = single[_NORMAL], single[_NORMAL + 1], single[_NORMAL + 2]
    if flat:
        scale = np.float32(1.0) / max(np.sqrt(a * a + b * b + c * c), np.float32(1e-12))
        single[_NORMAL], single[_NORMAL + 1], single[_NORMAL + 2] = a * scale, b * scale, c * scale
    else:
        for k in range(3):
            single[_NORMAL + 3 + k] -= single[_NORMAL + k]
            single[_NORMAL + 6 + k] -= single[_NORMAL + k]
    single[_SHINE] = emission[material]
    single[_SIDES] = 1 << sizes[material, 0]
    single[_SIDES + 1] = 1 << sizes[material, 1]
    whole[0], whole[1] = number, material
    both = flags[material] & DOUBLE_SIDED != 0
    whole[2] = (_FLAT if flat else 0) | (_PLAIN if plain else 0) | (_BOTH if both else 0)


@njit(cache=True, nogil=True, error_model="numpy")
def shade(
    arrays: Any,
    view: Any,
    light: Any,
    buffers: Any,
    drawn: int,
    dynamic: bool,
    width: int,
    height: int,
    out: Any,
) -> None:
    """Colour every pixel of one camera's picture.

    Runs of pixels of one triangle are laid into a queue in blocks; see `vico.render.pixels` for the rest.
    """
    # Everything is looked up once, out here: taking an array out of a tuple costs as much as shading a pixel.
    keys, real, whole = buffers.keys, buffers.real, buffers.whole
    sky_real, sky_whole = buffers.sky_real, buffers.sky_whole
    record, record_single, record_whole = buffers.record, buffers.record_single, buffers.record_whole
    texels, texel_start, texture_size = arrays.textures.texels, arrays.textures.start, arrays.textures.size
    corner, triangles, placed = arrays.mesh.corner, arrays.mesh.triangle, arrays.instances.matrix
    instances, clusters = int(arrays.counts[0]), len(arrays.cluster_where)
    emission, flags = arrays.textures.emission, arrays.textures.flags
    base, codes, firsts = buffers.base, buffers.drawn, buffers.level
    relief, sky, tone, numbers = light.relief, light.sky, light.tone, light.numbers
    shadow, shadow_frame, sun, contact = light.shadow, light.shadow_frame, buffers.sun, buffers.contact
    matrix = buffers.matrix
    relief_x, relief_y = float(light.relief_frame[0]), float(light.relief_frame[1])
    relief_scale = float(light.relief_frame[2])
    exposure_lamp = numbers[16]
    indoors, most_taps = view[18] > 0.5, 2 if view[28] < 0.5 else 4
    flat_out = out.reshape(-1)
    record_whole[:, 0] = 0
    _clear(real, whole)
    _clear(sky_real, sky_whole)
    for i in range(STRIDE):
        sky_whole[COLUMNS + i] = sky_whole[ROWS + i] = SKY_SIZE
    zero, one, half = np.float32(0.0), np.float32(1.0), np.float32(0.5)
    tiny, sky_size, low_rim, high_rim = (
        np.float32(1e-12),
        np.float32(SKY_SIZE),
        np.float32(0.0),
        np.float32(SKY_SIZE - 1),
    )
    vx, vy, vz = np.float32(view[0]), np.float32(view[1]), np.float32(view[2])
    pixel = 1.0 / view[12]
    step_x, step_y, step_z = np.float32(view[3] * pixel), np.float32(view[4] * pixel), np.float32(view[5] * pixel)
    queued, sky_queued, taps = 0, 0, 0
    for row in range(height):
        cv, cu = (row + 0.5 - view[15]) * pixel, (0.5 - view[14]) * pixel
        left_x = view[9] + cu * view[3] + cv * view[6]
        left_y = view[10] + cu * view[4] + cv * view[7]
        left_z = view[11] + cu * view[5] + cv * view[8]
        offset = row * width
        column = 0
        while column < width:
            number = np.uint32(keys[offset + column] & np.uint64(0xFFFFFFFF))
            end = column + 1
            while end < width and np.uint32(keys[offset + end] & np.uint64(0xFFFFFFFF)) == number:
                end += 1
            if number == 0:
                if indoors:
                    for i in range(offset + column, offset + end):
                        flat_out[3 * i], flat_out[3 * i + 1], flat_out[3 * i + 2] = 8, 8, 9
                    column = end
                    continue
                while column < end:
                    x0, y0, z0 = (
                        np.float32(left_x + column * view[3] * pixel),
                        np.float32(left_y + column * view[4] * pixel),
                        np.float32(left_z + column * view[5] * pixel),
                    )
                    # Masked so that the compiler knows it is not negative.
                    at = sky_queued & 511
                    for i in range(BLOCK):
                        ahead = np.float32(i)
                        dx, dy, dz = x0 + ahead * step_x, y0 + ahead * step_y, max(z0 + ahead * step_z, zero)
                        scale = half / (abs(dx) + abs(dy) + dz)
                        u, v = (
                            ((dx + dy) * scale + half) * sky_size - half,
                            ((dx - dy) * scale + half) * sky_size - half,
                        )
                        sky_real[U + at + i] = min(max(u, low_rim), high_rim)
                        sky_real[V + at + i] = min(max(v, low_rim), high_rim)
                    for i in range(BLOCK):
                        sky_whole[PIXEL + at + i] = offset + column + i
                    count = min(end - column, BLOCK)
                    sky_queued += count
                    column += count
                    if sky_queued > QUEUE - BLOCK:
                        finish_sky(sky, sky_real, sky_whole, sky_queued, flat_out)
                        sky_queued = 0
                continue
            slot = number & np.uint32(RECORDS - 1)
            if record_whole[slot, 0] != number:
                item = item_of(base, drawn, int(number))
                _remember(
                    corner,
                    triangles,
                    placed,
                    instances,
                    clusters,
                    view,
                    codes[item],
                    firsts[item] + int(number) - base[item],
                    matrix,
                    emission,
                    texture_size,
                    flags,
                    int(number),
                    record[slot],
                    record_single[slot],
                    record_whole[slot],
                )
            # Values of the planes at this row's first column, and their steps.
            sc, ac, bc = record[slot, _INVERSE], record[slot, _FIRST], record[slot, _SECOND]
            s_left = record[slot, _INVERSE + 1] * row + record[slot, _INVERSE + 2]
            a_left = record[slot, _FIRST + 1] * row + record[slot, _FIRST + 2]
            b_left = record[slot, _SECOND + 1] * row + record[slot, _SECOND + 2]
            volume = np.float32(record[slot, _VOLUME])
            u0, v0 = record_single[slot, _UV], record_single[slot, _UV + 1]
            du0, dv0 = record_single[slot, _UV + 2], record_single[slot, _UV + 3]
            du1, dv1 = record_single[slot, _UV + 4], record_single[slot, _UV + 5]
            material, bits = record_whole[slot, 1], record_whole[slot, 2]
            shine = record_single[slot, _SHINE] * exposure_lamp
            levels = texture_size[material, 2]
            r2, g2, b2 = (
                record_single[slot, _COLOUR],
                record_single[slot, _COLOUR + 1],
                record_single[slot, _COLOUR + 2],
            )
            nx, ny, nz = (
                record_single[slot, _NORMAL],
                record_single[slot, _NORMAL + 1],
                record_single[slot, _NORMAL + 2],
            )
            s_step, a_step, b_step = np.float32(sc), np.float32(ac), np.float32(bc)
            while column < end:
                count = min(end - column, BLOCK)
                # The block's middle stands for what changes slowly: level of the texture, share of the sky.
                middle = column + 0.5 * (count - 1)
                inverse = 1.0 / (s_left + sc * middle)
                m0 = min(max((a_left + ac * middle) * inverse, 0.0), 1.0)
                m1 = min(max((b_left + bc * middle) * inverse, 0.0), 1.0)
                start, columns, rows = np.uint32(0), 1, 1
                u_base, v_base, du, dv = zero, zero, zero, zero
                if levels > 0:
                    wide, high = float(record_single[slot, _SIDES]), float(record_single[slot, _SIDES + 1])
                    k0, k1 = (ac - m0 * sc) * inverse, (bc - m1 * sc) * inverse
                    ux, vx_ = (k0 * du0 + k1 * du1) * wide, (k0 * dv0 + k1 * dv1) * high
                    sr, ar, br = record[slot, _INVERSE + 1], record[slot, _FIRST + 1], record[slot, _SECOND + 1]
                    k0, k1 = (ar - m0 * sr) * inverse, (br - m1 * sr) * inverse
                    uy, vy_ = (k0 * du0 + k1 * du1) * wide, (k0 * dv0 + k1 * dv1) * high
                    long_x, long_y = ux * ux + vx_ * vx_, uy * uy + vy_ * vy_
                    longest = max(long_x, long_y)
                    level, own = 0, 1
                    if longest > 1.2:
                        # The footprint is a slanted ellipse: several samples along it instead of one blur over it.
                        area = abs(ux * vy_ - uy * vx_)
                        ratio = longest / max(area, 0.0625 * longest)
                        own = 1 if ratio < 2.0 else (2 if ratio < 5.0 or most_taps < 4 else 4)
                        level = min(max(_log2(longest / (own * own) * 1.4) >> 1, 0), levels - 1)
                    taps = max(taps, own)
                    columns = 1 << max(texture_size[material, 0] - level, 0)
                    rows = 1 << max(texture_size[material, 1] - level, 0)
                    start = np.uint32(texel_start[material, level])
                    if own > 1:
                        across = long_x >= long_y
                        du = np.float32((ux if across else uy) / wide * columns)
                        dv = np.float32((vx_ if across else vy_) / high * rows)
                    # Whole repeats are left out, for precision.
                    u_base = np.float32(u0 - np.floor(u0 + m0 * du0 + m1 * du1))
                    v_base = np.float32(v0 - np.floor(v0 + m0 * dv0 + m1 * dv1))
                open_sky = one
                ray_x = left_x + column * view[3] * pixel
                ray_y = left_y + column * view[4] * pixel
                ray_z = left_z + column * view[5] * pixel
                if not indoors:
                    depth = float(volume) * inverse
                    ahead_x = 0.5 * (count - 1) * pixel
                    x = view[0] + depth * (ray_x + ahead_x * view[3]) + 1.2 * nx
                    y = view[1] + depth * (ray_y + ahead_x * view[4]) + 1.2 * ny
                    z = view[2] + depth * (ray_z + ahead_x * view[5])
                    open_sky = np.float32(
                        _openness(relief, (x - relief_x) * relief_scale - 0.5, (y - relief_y) * relief_scale - 0.5, z)
                    )
                s0 = np.float32(s_left + sc * column)
                a0, b0 = np.float32(a_left + ac * column), np.float32(b_left + bc * column)
                x0, y0, z0 = np.float32(ray_x), np.float32(ray_y), np.float32(ray_z)
                at = queued & 511
                wide_here, high_here = np.float32(columns), np.float32(rows)
                for i in range(BLOCK):
                    ahead = np.float32(i)
                    w = one / (s0 + ahead * s_step)
                    l0 = min(max((a0 + ahead * a_step) * w, zero), one)
                    l1 = min(max((b0 + ahead * b_step) * w, zero), one)
                    depth_here = volume * w
                    real[X + at + i] = vx + depth_here * (x0 + ahead * step_x)
                    real[Y + at + i] = vy + depth_here * (y0 + ahead * step_y)
                    real[Z + at + i] = vz + depth_here * (z0 + ahead * step_z)
                    real[U + at + i] = (u_base + l0 * du0 + l1 * du1) * wide_here - half
                    real[V + at + i] = (v_base + l0 * dv0 + l1 * dv1) * high_here - half
                    # Weights, until the next loops turn them into colours and normals.
                    real[SUN + at + i], real[AROUND + at + i] = l0, l1
                if bits & _PLAIN:
                    for i in range(BLOCK):
                        real[RED + at + i], real[GREEN + at + i], real[BLUE + at + i] = r2, g2, b2
                else:
                    _blend(real, at, RED, record_single, slot, _COLOUR)
                if bits & _FLAT:
                    for i in range(BLOCK):
                        real[NX + at + i], real[NY + at + i], real[NZ + at + i] = nx, ny, nz
                else:
                    _blend(real, at, NX, record_single, slot, _NORMAL)
                    for i in range(BLOCK):
                        a, b, c = real[NX + at + i], real[NY + at + i], real[NZ + at + i]
                        scale = one / max(np.sqrt(a * a + b * b + c * c), tiny)
                        real[NX + at + i], real[NY + at + i], real[NZ + at + i] = a * scale, b * scale, c * scale
                if bits & _BOTH:
                    for i in range(BLOCK):
                        a, b, c = real[NX + at + i], real[NY + at + i], real[NZ + at + i]
                        away = a * (real[X + at + i] - vx) + b * (real[Y + at + i] - vy) + c * (real[Z + at + i] - vz)
                        sign = -one if away > zero else one
                        real[NX + at + i], real[NY + at + i], real[NZ + at + i] = a * sign, b * sign, c * sign
                for i in range(BLOCK):
                    real[SU + at + i], real[SV + at + i] = du, dv
                    real[SKY + at + i], real[SHINE + at + i] = open_sky, shine
                    real[SUN + at + i], real[AROUND + at + i] = one, one
                for i in range(BLOCK):
                    whole[START + at + i], whole[COLUMNS + at + i], whole[ROWS + at + i] = start, columns, rows
                    whole[PIXEL + at + i] = offset + column + i
                queued += count
                column += count
                if queued > QUEUE - BLOCK:
                    finish(
                        numbers,
                        tone,
                        shadow,
                        shadow_frame,
                        texels,
                        view,
                        real,
                        whole,
                        sun,
                        contact,
                        queued,
                        taps,
                        dynamic,
                        flat_out,
                    )
                    queued, taps = 0, 0
    if queued:
        finish(
            numbers,
            tone,
            shadow,
            shadow_frame,
            texels,
            view,
            real,
            whole,
            sun,
            contact,
            queued,
            taps,
            dynamic,
            flat_out,
        )
    if sky_queued:
        finish_sky(sky, sky_real, sky_whole, sky_queued, flat_out)


@njit(cache=True, nogil=True, error_model="numpy")
def _blend(real: Any, at: int, field: int, single: Any, slot: int, first: int) -> None:
    """Mix the corners' values of three fields by the weights that lie in the queue."""
    a0, b0, c0 = single[slot, first], single[slot, first + 1], single[slot, first + 2]
    a1, b1, c1 = single[slot, first + 3], single[slot, first + 4], single[slot, first + 5]
    a2, b2, c2 = single[slot, first + 6], single[slot, first + 7], single[slot, first + 8]
    for i in range(BLOCK):
        l0, l1 = real[SUN + at + i], real[AROUND + at + i]
        real[field + at + i] = a0 + l0 * a1 + l1 * a2
        real[field + STRIDE + at + i] = b0 + l0 * b1 + l1 * b2
        real[field + 2 * STRIDE + at + i] = c0 + l0 * c1 + l1 * c2


@njit(cache=True, nogil=True, error_model="numpy")
def _clear(real: Any, whole: Any) -> None:
    """Harmless values for places that nothing is laid into before the queue is worked off."""
    real[:] = np.float32(0.0)
    whole[:] = np.uint32(0)
    for i in range(STRIDE):
        whole[COLUMNS + i] = whole[ROWS + i] = np.uint32(1)
