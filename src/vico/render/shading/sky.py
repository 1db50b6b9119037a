"""The sky: its colour in a direction, painted once for a moment."""

from __future__ import annotations

from typing import Any

import numpy as np

from vico.render.compiled import inlined, kernel
from vico.render.lighting import SKY_STEPS, TONE_RANGE, TONE_STEPS

SKY_SIZE = 512
_TONE_SCALE = (TONE_STEPS - 1) / TONE_RANGE


@kernel
def paint_sky(light: Any, table: Any, clouds: Any, tone: Any, out: Any) -> None:
    """Paint the upper half of the sky, tone-mapped and packed like a texture, onto an unfolded octahedron.

    The direction (x, y, z) lies at u, v = (1 + (x + y) / s) / 2, (1 + (x - y) / s) / 2 with s = |x| + |y| + z.
    """
    for j in range(SKY_SIZE):
        for i in range(SKY_SIZE):
            p, q = (i + 0.5) * (2.0 / SKY_SIZE) - 1.0, (j + 0.5) * (2.0 / SKY_SIZE) - 1.0
            x, y = 0.5 * (p + q), 0.5 * (p - q)
            z = max(1.0 - abs(x) - abs(y), 0.0)
            scale = 1.0 / np.sqrt(x * x + y * y + z * z)
            red, green, blue = _sky_colour(light, table, clouds, x * scale, y * scale, z * scale)
            r = np.uint32(tone[min(int(red * _TONE_SCALE), TONE_STEPS - 1)])
            g = np.uint32(tone[min(int(green * _TONE_SCALE), TONE_STEPS - 1)])
            b = np.uint32(tone[min(int(blue * _TONE_SCALE), TONE_STEPS - 1)])
            out[j * SKY_SIZE + i] = r | (g << np.uint32(8)) | (b << np.uint32(16))


@kernel
def _sky_colour(light: Any, table: Any, clouds: Any, dx: float, dy: float, dz: float) -> tuple[float, float, float]:
    """Return the linear colour of the sky (or of the haze below the horizon) in a unit direction."""
    r, g, b = _gradient(table, dz)
    glow, disc = _sun_glow(light, dx, dy, dz)
    if glow > 0.0:
        r += glow * light.sun_red
        g += glow * light.sun_green
        b += glow * light.sun_blue
    if disc > 0.0:
        r += disc * light.sun_red
        g += disc * light.sun_green
        b += disc * light.sun_blue
    cover, lit = _cloud_cover(light, clouds, dx, dy, dz)
    if cover > 0.0:
        r += cover * (light.cloud_shade_red + lit * (light.cloud_lit_red - light.cloud_shade_red) - r)
        g += cover * (light.cloud_shade_green + lit * (light.cloud_lit_green - light.cloud_shade_green) - g)
        b += cover * (light.cloud_shade_blue + lit * (light.cloud_lit_blue - light.cloud_shade_blue) - b)
    return r, g, b


@inlined
def _gradient(table: Any, dz: float) -> Any:
    """Return the clear sky's colour at a sine of elevation, between two rows of `sky_table`."""
    s = np.sqrt(abs(dz))
    if dz < 0.0:
        s = -s
    place = (s + 1.0) * (0.5 * (SKY_STEPS - 1))
    i = min(int(place), SKY_STEPS - 2)
    f = place - i
    r = table[i, 0] + f * (table[i + 1, 0] - table[i, 0])
    g = table[i, 1] + f * (table[i + 1, 1] - table[i, 1])
    b = table[i, 2] + f * (table[i + 1, 2] - table[i, 2])
    return r, g, b


@inlined
def _sun_glow(light: Any, dx: float, dy: float, dz: float) -> Any:
    """Return how much of the sun's colour its halo and its disc add."""
    toward = dx * light.sun_x + dy * light.sun_y + dz * light.sun_z
    if toward <= 0.0:
        return 0.0, 0.0
    glow = toward * toward
    glow *= glow
    wide = 0.07 * glow
    glow *= glow
    glow *= glow
    glow *= glow
    wide += 0.16 * glow
    disc = min((toward - 0.9994) * 5000.0, 1.0) * 2.0 if toward > 0.9994 else 0.0
    return wide, disc


@inlined
def _cloud_cover(light: Any, clouds: Any, dx: float, dy: float, dz: float) -> Any:
    """Return how much a cloud covers, and how much of it is lit, both 0..1.

    Clouds lie on a plane overhead; a second look toward the sun tells lit rims from grey bellies.
    """
    if dz <= 0.015:
        return 0.0, 0.0
    reach = 34.0 / (dz + 0.06)
    u, v = dx * reach, dy * reach
    thick = _cloud_thickness(clouds, u, v)
    cover = (thick - (1.0 - light.cloud_cover)) * 4.0
    if cover <= 0.0:
        return 0.0, 0.0
    beyond = _cloud_thickness(clouds, u + light.sun_x * 5.0, v + light.sun_y * 5.0)
    lit = min(max(0.55 + (thick - beyond) * 2.2 - 0.35 * (thick - 0.75), 0.0), 1.0)
    return min(cover, 1.0) * min((dz - 0.015) * 5.0, 1.0) * 0.9, lit


@inlined
def _cloud_thickness(clouds: Any, u: float, v: float) -> float:
    """Return the cloud map's value at a place, 0..1, blended between its four neighbours."""
    i, j = int(np.floor(u)), int(np.floor(v))
    f, g = u - i, v - j
    a, b = float(clouds[j & 255, i & 255]), float(clouds[j & 255, (i + 1) & 255])
    c, d = float(clouds[(j + 1) & 255, i & 255]), float(clouds[(j + 1) & 255, (i + 1) & 255])
    low, high = a + f * (b - a), c + f * (d - c)
    return (low + g * (high - low)) * (1.0 / 255.0)
