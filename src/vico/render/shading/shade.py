"""The shading pass: every pixel once, from the triangle the visibility pass left in it.

Pixels that lie side by side and show one triangle are a *run*. Runs are laid in blocks into a queue of fields
(position, normal, colour, place in the texture ...); `vico.render.shading.pixels` turns a full queue into colours.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from vico.render.arrays import (
    AROUND,
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
    RUN,
    SETUPS,
    SHINE,
    SKY,
    START,
    STRIDE,
    SU,
    SUN,
    SV,
    WINDOW,
    U,
    V,
    X,
    Y,
    Z,
)
from vico.render.compiled import inlined, kernel
from vico.render.lamps import queue_lamplight, shown_beams
from vico.render.lighting import SKY_SIZE
from vico.render.records import FLAT_NORMAL, MOVES, PLAIN_COLOUR, SHELTERED, TWO_SIDED
from vico.render.shading.pixels import MovingShadows, PixelQueue, finish, finish_sky
from vico.render.shading.surfaces import set_up_triangle
from vico.render.visibility.rasteriser import triangle_number

# Linear red, green, blue of what lies behind a room's walls (doors and windows that nothing fills), sRGB bytes.
_BEHIND_ROOM = (8, 8, 9)
# Points are looked up in the relief map this far before the surface, metres.
_RELIEF_OFFSET = 1.2
# Sky light falls by half of this share where a point lies this deep (metres) below the blurred heights around it.
_RELIEF_DEPTH, _RELIEF_SHARE = 5.0, 0.62
_ZERO, _HALF, _ONE, _TINY = np.float32(0.0), np.float32(0.5), np.float32(1.0), np.float32(1e-12)
# No lamp shines there.
_NOWHERE = 1e9
# A position in the queue, masked so that the compiler knows it is not negative.
_POSITION = 511
# The same for pixels.
_INDEX = 0x7FFFFFFF


class _Eye(NamedTuple):
    """Where the camera is, and the step between neighbouring columns' rays: in single precision, then in double."""

    x: Any
    y: Any
    z: Any
    step_x: Any
    step_y: Any
    step_z: Any
    exact_step_x: float
    exact_step_y: float
    exact_step_z: float


class _Ray(NamedTuple):
    """Direction through a pixel's centre, of depth 1, world frame."""

    x: float
    y: float
    z: float


class _RowPlanes(NamedTuple):
    """Inverse depth and weights of the first two corners along one row: at column 0, and steps."""

    inverse: float
    first: float
    second: float
    inverse_step: float
    first_step: float
    second_step: float


class _Middle(NamedTuple):
    """Inverse depth and weights of the first two corners at the middle of a block."""

    inverse: float
    first: float
    second: float


class _ReliefFrame(NamedTuple):
    """Corner (world metres) and scale of a `ReliefMap`."""

    x: float
    y: float
    texels_per_metre: float


class _TextureWindow(NamedTuple):
    """Where a block of pixels looks in a texture.

    Attributes
    ----------
    start, columns, rows
        First texel and sides of the level of detail.
    u, v
        Texture coordinates of the third corner, whole repeats left out, for precision.
    du, dv
        Steps between samples, texels.
    taps
        How many samples.
    """

    start: Any
    columns: int
    rows: int
    u: Any
    v: Any
    du: Any
    dv: Any
    taps: int


@kernel
def shade(scene: Any, camera: Any, light: Any, buffers: Any, drawn: int, shadows: int, partly: bool, out: Any) -> None:
    """Colour every pixel of one camera's picture, or `partly` the runs of pixels that `mark_changed` touched.

    `drawn` is what `draw` returned, `shadows` what `cast_moving` did.
    """
    # Everything is looked up once, out here: taking an array out of a tuple costs as much as shading a pixel.
    keys, setups, known, changed = buffers.keys, buffers.setup, buffers.setup_number, buffers.changed
    real, whole, sky_real, sky_whole = buffers.real, buffers.whole, buffers.sky_real, buffers.sky_whole
    queue, sky_queue = PixelQueue(real, whole, buffers.glass), PixelQueue(sky_real, sky_whole, buffers.glass)
    moving = MovingShadows(buffers.sun, buffers.contact, buffers.inside, shadows)
    texels, texel_start, materials = scene.textures.texels, scene.textures.start, scene.textures.materials
    sky, relief, relief_height = light.sky, light.relief, light.relief.height
    relief_frame = _ReliefFrame(relief.x, relief.y, relief.texels_per_metre)
    lamp_exposure = light.uniforms.lamp_exposure
    beams = shown_beams(scene.beams, camera, lamp_exposure)
    indoors, width, eye = camera.indoors != 0, camera.width, _eye(camera)
    is_covered = light.uniforms.snow_cover > _ZERO or light.uniforms.wet > _ZERO
    flat_out = out.reshape(-1)
    unlit = _Circle(light.uniforms.unlit_x, light.uniforms.unlit_y, light.uniforms.unlit_radius)
    _clear(real, whole)
    _clear(sky_real, sky_whole)
    for i in range(STRIDE):
        sky_whole[COLUMNS + i] = sky_whole[ROWS + i] = SKY_SIZE
    known[:] = 0
    queued, sky_queued, taps = 0, 0, 0
    for row in range(camera.height):
        offset = row * width
        left = _left_ray(camera, row)
        column = width if partly and not changed[offset : offset + width].any() else 0
        while column < width:
            number = triangle_number(keys[offset + column])
            end = _end_of_run(keys, offset, column, width)
            # With its neighbours: if one of them is new, the run may have been a longer one.
            if partly and not changed[offset + max(column - 1, 0) : offset + min(end + 1, width)].any():
                column = end
                continue
            if number == 0 and indoors:
                _write_background(flat_out, offset + column, offset + end)
                column = end
                continue
            if number == 0:
                run = (offset, column, end)
                sky_queued = _queue_sky_run(sky, sky_queue, sky_queued, left, eye, run, flat_out)
                column = end
                continue
            slot = number & np.uint32(SETUPS - 1)
            setup = setups[slot]
            if known[slot] != number:
                set_up_triangle(scene, camera, buffers, drawn, int(number), setup)
                known[slot] = number
            planes = _planes_of_row(setup, row)
            shine = _shine(setup, materials, indoors, lamp_exposure)
            while column < end:
                count = min(end - column, RUN)
                # The block's middle stands for what changes slowly: level of the texture, share of the sky.
                middle = _middle_of_block(planes, column + 0.5 * (count - 1))
                ray = _ray_at(left, eye, column)
                window = _texture_window(setup, planes, middle, materials, texel_start, camera.most_taps)
                taps = max(taps, window.taps)
                open_sky, own, x, y = _ONE, shine, _NOWHERE, _NOWHERE
                if not indoors:
                    x, y, z = _before_surface(setup, middle, _ray_at(left, eye, column + 0.5 * (count - 1)), camera)
                    open_sky = np.float32(sky_visibility(relief_height, relief_frame, x, y, z))
                    own = _own_light(setup, shine, unlit, x, y)
                    if is_covered and setup.flags & SHELTERED:
                        open_sky = -open_sky  # `cover_ground` puts it right again
                at = queued & _POSITION
                _queue_places(real, at, setup, planes, column, ray, eye, window)
                _queue_colours(real, at, setup)
                _queue_normals(real, at, setup, eye)
                _queue_constants(real, at, window.du, window.dv, open_sky, own)
                _queue_addresses(whole, at, window, offset + column, setup.window)
                queue_lamplight(real, at, light.lamps, beams, x, y)
                queued += count
                column += count
                if queued > QUEUE - RUN:
                    finish(light, camera, texels, queue, moving, queued, taps, flat_out)
                    queued, taps = 0, 0
    if queued:
        finish(light, camera, texels, queue, moving, queued, taps, flat_out)
    if sky_queued:
        finish_sky(sky, sky_queue, sky_queued, flat_out)


class _Circle(NamedTuple):
    """Ground on which the power is cut, metres."""

    x: Any
    y: Any
    radius: Any


@inlined
def _shine(setup: Any, materials: Any, indoors: bool, lamp_exposure: Any) -> Any:
    """Return what a surface shines at most: indoors that of windows, which have a picture, and lamps have none."""
    if indoors:
        return setup.emission if materials[setup.material].levels > 0 else _ZERO
    return setup.emission * lamp_exposure


@inlined
def _own_light(setup: Any, shine: Any, unlit: Any, x: Any, y: Any) -> Any:
    """Return what a surface shines at a point: nothing where the power is cut, unless it moves."""
    if unlit.radius <= _ZERO or setup.flags & MOVES:
        return shine
    return _ZERO if (x - unlit.x) ** 2 + (y - unlit.y) ** 2 <= unlit.radius**2 else shine


@inlined
def _end_of_run(keys: Any, offset: int, column: int, width: int) -> int:
    """Return the column after the last one that shows the same triangle."""
    number = triangle_number(keys[(offset + column) & _INDEX])
    end = column + 1
    while end < width and triangle_number(keys[(offset + end) & _INDEX]) == number:
        end += 1
    return end


@inlined
def _clear(real: Any, whole: Any) -> None:
    """Lay harmless values into places that nothing is laid into before the queue is worked off."""
    real[:] = _ZERO
    whole[:] = np.uint32(0)
    for i in range(STRIDE):
        whole[COLUMNS + i] = whole[ROWS + i] = np.uint32(1)


@inlined
def _eye(camera: Any) -> Any:
    pixel = 1.0 / camera.focal
    return _Eye(
        np.float32(camera.x),
        np.float32(camera.y),
        np.float32(camera.z),
        np.float32(camera.right_x * pixel),
        np.float32(camera.right_y * pixel),
        np.float32(camera.right_z * pixel),
        camera.right_x * pixel,
        camera.right_y * pixel,
        camera.right_z * pixel,
    )


@inlined
def _left_ray(camera: Any, row: int) -> Any:
    """Return the ray through the first column's centre."""
    pixel = 1.0 / camera.focal
    cv, cu = (row + 0.5 - camera.centre_y) * pixel, (0.5 - camera.centre_x) * pixel
    return _Ray(
        camera.forward_x + cu * camera.right_x + cv * camera.down_x,
        camera.forward_y + cu * camera.right_y + cv * camera.down_y,
        camera.forward_z + cu * camera.right_z + cv * camera.down_z,
    )


@inlined
def _ray_at(left: Any, eye: Any, column: Any) -> Any:
    """Return the ray through a column's centre."""
    return _Ray(
        left.x + column * eye.exact_step_x, left.y + column * eye.exact_step_y, left.z + column * eye.exact_step_z
    )


@inlined
def _write_background(out: Any, first: int, end: int) -> None:
    """Colour what nothing fills in a room's walls."""
    for i in range(first, end):
        out[3 * i], out[3 * i + 1], out[3 * i + 2] = _BEHIND_ROOM


@inlined
def _queue_sky(real: Any, whole: Any, at: int, ray: Any, eye: Any, pixel: int) -> None:
    """Lay a block of pixels that show the sky into their queue: where they look in its picture."""
    sky_size, rim = np.float32(SKY_SIZE), np.float32(SKY_SIZE - 1)
    x0, y0, z0 = np.float32(ray.x), np.float32(ray.y), np.float32(ray.z)
    for i in range(RUN):
        ahead = np.float32(i)
        dx, dy, dz = x0 + ahead * eye.step_x, y0 + ahead * eye.step_y, max(z0 + ahead * eye.step_z, _ZERO)
        scale = _HALF / (abs(dx) + abs(dy) + dz)
        u = ((dx + dy) * scale + _HALF) * sky_size - _HALF
        v = ((dx - dy) * scale + _HALF) * sky_size - _HALF
        real[U + at + i] = min(max(u, _ZERO), rim)
        real[V + at + i] = min(max(v, _ZERO), rim)
    for i in range(RUN):
        whole[PIXEL + at + i] = pixel + i


@inlined
def _queue_sky_run(sky: Any, queue: Any, queued: int, left: Any, eye: Any, run: Any, out: Any) -> int:
    """Lay pixels that show the sky into their queue, which is worked off when it is full; return how many it holds."""
    offset, column, end = run
    while column < end:
        ray = _ray_at(left, eye, column)
        _queue_sky(queue.real, queue.whole, queued & _POSITION, ray, eye, offset + column)
        count = min(end - column, RUN)
        queued += count
        column += count
        if queued > QUEUE - RUN:
            finish_sky(sky, queue, queued, out)
            queued = 0
    return queued


@inlined
def _planes_of_row(setup: Any, row: int) -> Any:
    return _RowPlanes(
        setup.inverse_row * row + setup.inverse_start,
        setup.first_row * row + setup.first_start,
        setup.second_row * row + setup.second_start,
        setup.inverse_column,
        setup.first_column,
        setup.second_column,
    )


@inlined
def _middle_of_block(planes: Any, column: float) -> Any:
    inverse = 1.0 / (planes.inverse + planes.inverse_step * column)
    return _Middle(
        inverse,
        min(max((planes.first + planes.first_step * column) * inverse, 0.0), 1.0),
        min(max((planes.second + planes.second_step * column) * inverse, 0.0), 1.0),
    )


@inlined
def _texture_window(setup: Any, planes: Any, middle: Any, materials: Any, texel_start: Any, most_taps: int) -> Any:
    """Return where a block looks in its texture: level of detail and samples by the footprint of its middle pixel."""
    material = materials[setup.material]
    levels = material.levels
    if levels == 0:
        return _TextureWindow(np.uint32(0), 1, 1, _ZERO, _ZERO, _ZERO, _ZERO, 0)
    wide, high = float(setup.texture_width), float(setup.texture_height)
    k0 = (planes.first_step - middle.first * planes.inverse_step) * middle.inverse
    k1 = (planes.second_step - middle.second * planes.inverse_step) * middle.inverse
    ux, vx = (k0 * setup.first_u + k1 * setup.second_u) * wide, (k0 * setup.first_v + k1 * setup.second_v) * high
    k0 = (setup.first_row - middle.first * setup.inverse_row) * middle.inverse
    k1 = (setup.second_row - middle.second * setup.inverse_row) * middle.inverse
    uy, vy = (k0 * setup.first_u + k1 * setup.second_u) * wide, (k0 * setup.first_v + k1 * setup.second_v) * high
    long_x, long_y = ux * ux + vx * vx, uy * uy + vy * vy
    longest = max(long_x, long_y)
    # The footprint is a slanted ellipse: several samples along it instead of one blur over it. Without branches, which
    # would be foreseen wrongly, and without divisions, for which all that follows would wait.
    area = max(abs(ux * vy - uy * vx), 0.0625 * longest)
    two = (longest > 1.2) & (longest >= 2.0 * area)
    four = two & (longest >= 5.0 * area) & (most_taps >= 4)
    taps = 4 if four else (2 if two else 1)
    between = 0.0625 if four else (0.25 if two else 1.0)
    level = min(max(_log2(longest * between * 1.4) >> 1, 0), levels - 1)
    columns = 1 << max(material.log2_width - level, 0)
    rows = 1 << max(material.log2_height - level, 0)
    across, several = long_x >= long_y, 1.0 if two else 0.0
    du = np.float32((ux if across else uy) * (several / wide) * columns)
    dv = np.float32((vx if across else vy) * (several / high) * rows)
    u = np.float32(setup.u - np.floor(setup.u + middle.first * setup.first_u + middle.second * setup.second_u))
    v = np.float32(setup.v - np.floor(setup.v + middle.first * setup.first_v + middle.second * setup.second_v))
    return _TextureWindow(np.uint32(texel_start[setup.material, level]), columns, rows, u, v, du, dv, taps)


@inlined
def _log2(value: float) -> int:
    """Return the whole part of the base-2 logarithm of a positive number."""
    return int(np.float32(value).view(np.uint32) >> np.uint32(23)) - 127


@inlined
def _before_surface(setup: Any, middle: Any, ray: Any, camera: Any) -> Any:
    """Return a point a little before the surface at a block's middle, world metres; `ray` goes through it."""
    depth = float(np.float32(setup.volume)) * middle.inverse
    x = camera.x + depth * ray.x + _RELIEF_OFFSET * setup.normal[0, 0]
    y = camera.y + depth * ray.y + _RELIEF_OFFSET * setup.normal[0, 1]
    z = camera.z + depth * ray.z
    return x, y, z


@inlined
def sky_visibility(height: Any, frame: Any, x: float, y: float, z: float) -> float:
    """Return the share of the sky's light that reaches a point between the masses around it, 0..1.

    `height` and `frame` are of a `ReliefMap`.
    """
    u, v = (x - frame.x) * frame.texels_per_metre - 0.5, (y - frame.y) * frame.texels_per_metre - 0.5
    size = height.shape[0]
    if not (u >= 0.0 and v >= 0.0 and u < size - 1 and v < size - 1):
        return 1.0
    i, j = np.uint32(u), np.uint32(v)
    a, b = u - i, v - j
    one = np.uint32(1)
    low = height[j, i] + a * (height[j, i + one] - height[j, i])
    high = height[j + one, i] + a * (height[j + one, i + one] - height[j + one, i])
    deep = max(low + b * (high - low) - z, 0.0)
    return 1.0 - _RELIEF_SHARE * deep / (deep + _RELIEF_DEPTH)


@inlined
def _queue_places(real: Any, at: int, setup: Any, planes: Any, column: int, ray: Any, eye: Any, window: Any) -> None:
    """Lay a block's positions and texture coordinates into the queue, and its corners' weights.

    The weights lie where `sun` and `around` will, until the next loops turn them into colours and normals.
    """
    volume = np.float32(setup.volume)
    du0, dv0, du1, dv1 = setup.first_u, setup.first_v, setup.second_u, setup.second_v
    s_step, a_step = np.float32(planes.inverse_step), np.float32(planes.first_step)
    b_step = np.float32(planes.second_step)
    s0 = np.float32(planes.inverse + planes.inverse_step * column)
    a0 = np.float32(planes.first + planes.first_step * column)
    b0 = np.float32(planes.second + planes.second_step * column)
    x0, y0, z0 = np.float32(ray.x), np.float32(ray.y), np.float32(ray.z)
    columns, rows = np.float32(window.columns), np.float32(window.rows)
    for i in range(RUN):
        ahead = np.float32(i)
        w = _ONE / (s0 + ahead * s_step)
        l0 = min(max((a0 + ahead * a_step) * w, _ZERO), _ONE)
        l1 = min(max((b0 + ahead * b_step) * w, _ZERO), _ONE)
        depth = volume * w
        real[X + at + i] = eye.x + depth * (x0 + ahead * eye.step_x)
        real[Y + at + i] = eye.y + depth * (y0 + ahead * eye.step_y)
        real[Z + at + i] = eye.z + depth * (z0 + ahead * eye.step_z)
        real[U + at + i] = (window.u + l0 * du0 + l1 * du1) * columns - _HALF
        real[V + at + i] = (window.v + l0 * dv0 + l1 * dv1) * rows - _HALF
        real[SUN + at + i], real[AROUND + at + i] = l0, l1


@inlined
def _blend(real: Any, at: int, field: int, corners: Any) -> None:
    """Mix three fields of the corners by the weights that lie in the queue."""
    a0, b0, c0 = corners[0, 0], corners[0, 1], corners[0, 2]
    a1, b1, c1 = corners[1, 0], corners[1, 1], corners[1, 2]
    a2, b2, c2 = corners[2, 0], corners[2, 1], corners[2, 2]
    for i in range(RUN):
        l0, l1 = real[SUN + at + i], real[AROUND + at + i]
        real[field + at + i] = a0 + l0 * a1 + l1 * a2
        real[field + STRIDE + at + i] = b0 + l0 * b1 + l1 * b2
        real[field + 2 * STRIDE + at + i] = c0 + l0 * c1 + l1 * c2


@inlined
def _queue_colours(real: Any, at: int, setup: Any) -> None:
    if setup.flags & PLAIN_COLOUR:
        red, green, blue = setup.colour[0, 0], setup.colour[0, 1], setup.colour[0, 2]
        for i in range(RUN):
            real[RED + at + i], real[GREEN + at + i], real[BLUE + at + i] = red, green, blue
    else:
        _blend(real, at, RED, setup.colour)


@inlined
def _queue_normals(real: Any, at: int, setup: Any, eye: Any) -> None:
    """Lay a block's unit normals into the queue; those of two-sided faces look at the eye."""
    if setup.flags & FLAT_NORMAL:
        nx, ny, nz = setup.normal[0, 0], setup.normal[0, 1], setup.normal[0, 2]
        for i in range(RUN):
            real[NX + at + i], real[NY + at + i], real[NZ + at + i] = nx, ny, nz
    else:
        _blend(real, at, NX, setup.normal)
        for i in range(RUN):
            a, b, c = real[NX + at + i], real[NY + at + i], real[NZ + at + i]
            scale = _ONE / max(np.sqrt(a * a + b * b + c * c), _TINY)
            real[NX + at + i], real[NY + at + i], real[NZ + at + i] = a * scale, b * scale, c * scale
    if setup.flags & TWO_SIDED:
        for i in range(RUN):
            a, b, c = real[NX + at + i], real[NY + at + i], real[NZ + at + i]
            away = a * (real[X + at + i] - eye.x) + b * (real[Y + at + i] - eye.y) + c * (real[Z + at + i] - eye.z)
            sign = -_ONE if away > _ZERO else _ONE
            real[NX + at + i], real[NY + at + i], real[NZ + at + i] = a * sign, b * sign, c * sign


@inlined
def _queue_constants(real: Any, at: int, du: Any, dv: Any, open_sky: Any, shine: Any) -> None:
    for i in range(RUN):
        real[SU + at + i], real[SV + at + i] = du, dv
        real[SKY + at + i], real[SHINE + at + i] = open_sky, shine
        real[SUN + at + i], real[AROUND + at + i] = _ONE, _ONE


@inlined
def _queue_addresses(whole: Any, at: int, window: Any, pixel: int, number: Any) -> None:
    for i in range(RUN):
        whole[START + at + i], whole[COLUMNS + at + i] = window.start, window.columns
        whole[ROWS + at + i], whole[PIXEL + at + i] = window.rows, pixel + i
        whole[WINDOW + at + i] = number
