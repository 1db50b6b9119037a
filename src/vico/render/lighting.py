"""The light of a moment: sun, sky, haze and lamps, the tables the shader reads them from, and the painted sky."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.exact import each
from vico.render.compiled import inlined, kernel
from vico.seeds import rng

Colour = tuple[float, float, float]
SKY_STEPS = 512
TONE_STEPS = 4096
TONE_RANGE = 4.0
#: Seconds for which the direction that shadows are cast from is held.
SHADOW_STEP = 300.0
# Haze of clear air, metres to 63 %: farther than a world is wide, it gives depth.
_CLEAREST = 1600.0


@dataclass(frozen=True)
class Lighting:
    """Daylight and lamps; colours are linear light, 1 = a white wall's brightness in full light.

    Attributes
    ----------
    sun_direction
        From the ground to the sun (or the moon at night), ENU; need not have unit length.
    shadow_direction
        From where shadows are cast: the sun's direction, held still for five minutes at a time so that the shadow map
        of the buildings is computed seldom. None: the sun's.
    sun_colour, ambient, bounce
        Light of the sun, of the sky from above, and of the ground from below.
    zenith, horizon
        Colours of the sky overhead and at its rim; haze takes the latter.
    fog
        Distance at which haze hides 63 % of a thing, metres.
    clouds
        Share of the sky under clouds, 0..1.
    lamps
        How far lit windows and lamps are switched on, 0..1.
    exposure
        Factor on everything before tone mapping.
    wet, snow_cover
        How wet open ground is, and how far under snow, 0..1.
    rain, snowfall
        Water that falls, mm/h.
    unlit
        Ground on which all that is fixed and shines is out: x, y and radius of a circle, ENU metres.
    """

    sun_direction: Colour = (-0.45, -0.55, 0.75)
    shadow_direction: Colour | None = None
    sun_colour: Colour = (2.15, 1.94, 1.62)
    ambient: Colour = (0.66, 0.74, 0.90)
    bounce: Colour = (0.44, 0.40, 0.34)
    zenith: Colour = (0.17, 0.37, 0.78)
    horizon: Colour = (0.80, 0.90, 1.00)
    fog: float = 1600.0
    clouds: float = 0.45
    lamps: float = 0.0
    exposure: float = 0.78
    wet: float = 0.0
    snow_cover: float = 0.0
    rain: float = 0.0
    snowfall: float = 0.0
    unlit: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @classmethod
    def at(
        cls,
        seconds_of_day: float,
        lat: float = 50.0,
        *,
        day: int = 172,
        clouds: float = 0.45,
        visibility: float = 20_000.0,
    ) -> Lighting:
        """Return the light at a (solar) time of day.

        Parameters
        ----------
        seconds_of_day
            Since midnight, local solar time; values outside one day wrap around.
        lat
            Latitude, degrees.
        day
            Day of the year, 1..365; 172 is the June solstice.
        """
        sun = sun_direction(seconds_of_day, lat, day)
        held = sun_direction(np.floor(seconds_of_day / SHADOW_STEP) * SHADOW_STEP, lat, day)
        return cls.under(sun, held_sun=held, clouds=clouds, visibility=visibility)

    @classmethod
    def under(
        cls,
        sun: Colour,
        *,
        held_sun: Colour | None = None,
        moon: Colour = (0.35, -0.30, 0.88),
        moon_lit: float = 0.5,
        clouds: float = 0.45,
        falling: float = 0.0,
        visibility: float = 20_000.0,
        lamps: float = 1.0,
    ) -> Lighting:
        """Return the light under a sky.

        Parameters
        ----------
        sun, moon
            Unit vectors to them, ENU; below the horizon they do not shine.
        held_sun
            The sun's direction that shadows are cast from; None: the sun's.
        moon_lit
            Share of the moon's disc, 0..1.
        clouds
            Share of the sky, 0..1; from about 0.6 on they hide the sun.
        falling
            How thick rain or snow falls, mm/h of rain.
        visibility
            Meteorological visibility, metres; the contrast left there is 5 %, that is exp(-3).
        lamps
            Share of lamps and windows that are lit when it is dark, 0..1.
        """
        held = sun if held_sun is None else held_sun
        up = sun[2]
        high = _ramp(up, 0.02, 0.55)
        day_share = _ramp(up, -0.14, 0.16)
        # Fog is a cloud on the ground: nothing but itself is seen of the sky.
        fogged = 1 - _ramp(visibility, 150.0, 3000.0)
        hidden = max(_ramp(clouds, 0.6, 1.0), fogged)
        gloom = 1 - 0.35 * hidden * min(falling / 10.0, 1.0)
        glow = _ramp(up, -0.16, 0.02) * (1 - _ramp(up, 0.05, 0.38)) * (1 - hidden)
        shine = _ramp(up, -0.02, 0.10) * (1 - 0.55 * clouds * clouds) * (1 - 0.92 * hidden)
        warm = _mix((1.0, 0.52, 0.24), (1.0, 0.92, 0.80), high)
        night = up < -0.03
        moonlight = 0.10 + 0.30 * moon_lit * _ramp(moon[2], 0.0, 0.3) * (1 - 0.9 * hidden)
        sun_colour = _scale((0.10, 0.13, 0.20) if night else warm, moonlight if night else (1.15 + 0.95 * high) * shine)
        zenith = _mix((0.15, 0.27, 0.54), (0.17, 0.37, 0.78), high)
        zenith = _mix((0.006, 0.010, 0.026), _mix(zenith, _scale((0.60, 0.63, 0.68), gloom), hidden), day_share)
        horizon = _mix((0.72, 0.74, 0.80), (0.80, 0.90, 1.00), high)
        horizon = _mix((0.018, 0.024, 0.046), _mix(horizon, _scale((0.74, 0.77, 0.80), gloom), hidden), day_share)
        horizon = _mix(horizon, (0.92, 0.52, 0.30), 0.6 * glow)
        zenith = _mix(zenith, horizon, 0.9 * fogged)
        ambient = _mix((0.52, 0.55, 0.64), (0.66, 0.74, 0.90), high)
        ambient = _mix((0.040, 0.050, 0.085), _mix(ambient, _scale((0.74, 0.77, 0.82), gloom), hidden), day_share)
        bounce = _mix((0.28, 0.24, 0.21), (0.44, 0.40, 0.34), high)
        bounce = _mix((0.022, 0.022, 0.026), _mix(bounce, _scale((0.34, 0.33, 0.32), gloom), hidden), day_share)
        # The lamps of a town light the air above it, and walls and ground by what they throw back.
        town = lamps * (1 - day_share)
        zenith, horizon = _add(zenith, (0.006, 0.005, 0.005), town), _add(horizon, (0.030, 0.023, 0.017), town)
        ambient, bounce = _add(ambient, (0.024, 0.018, 0.012), town), _add(bounce, (0.024, 0.019, 0.013), town)
        light = (moon if moon[2] > 0.15 else (0.35, -0.30, 0.88)) if night else sun
        return cls(
            sun_direction=light,
            shadow_direction=light if night else (held if held[2] > 0.02 else sun),
            sun_colour=sun_colour,
            ambient=ambient,
            bounce=bounce,
            zenith=zenith,
            horizon=horizon,
            fog=min(_CLEAREST, visibility / 3.0),
            clouds=clouds * (1 - fogged),
            lamps=lamps * (1.0 - _ramp(up, -0.10, 0.10)),
            exposure=0.78 + 0.75 * (1 - day_share) + 0.18 * (1 - high) * day_share,
        )


def sun_direction(seconds_of_day: float, lat: float, day: int = 172) -> Colour:
    """Return the unit vector to the sun, ENU, from the usual declination and hour-angle formulas (Cooper 1969)."""
    declination = np.radians(23.45) * np.sin(2 * np.pi * (284 + day) / 365)
    hour = (seconds_of_day / 86400.0 - 0.5) * 2 * np.pi
    phi = np.radians(lat)
    east = -np.cos(declination) * np.sin(hour)
    north = np.cos(phi) * np.sin(declination) - np.sin(phi) * np.cos(declination) * np.cos(hour)
    up = np.sin(phi) * np.sin(declination) + np.cos(phi) * np.cos(declination) * np.cos(hour)
    return float(east), float(north), float(up)


def _ramp(value: float, low: float, high: float) -> float:
    share = float(np.clip((value - low) / (high - low), 0.0, 1.0))
    return share * share * (3 - 2 * share)


def _mix(a: Colour, b: Colour, share: float) -> Colour:
    return (a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share, a[2] + (b[2] - a[2]) * share)


def _add(a: Colour, b: Colour, share: float) -> Colour:
    return (a[0] + b[0] * share, a[1] + b[1] * share, a[2] + b[2] * share)


def _scale(a: Colour, factor: float) -> Colour:
    return (a[0] * factor, a[1] * factor, a[2] * factor)


def unit(vector: Colour) -> NDArray[np.float64]:
    """Return the vector's direction."""
    array = np.asarray(vector, np.float64)
    return array / max(float(np.linalg.norm(array)), 1e-12)


def sky_table(light: Lighting) -> NDArray[np.float32]:
    """Return linear sky colours by elevation, shape ``(SKY_STEPS, 3)``.

    Row i is the sine of elevation ``s * abs(s)`` with s from -1 to 1: fine steps at the horizon.
    """
    s = np.linspace(-1, 1, SKY_STEPS)
    sine = s * np.abs(s)
    share = np.clip(sine, 0, 1)[:, None]
    zenith, horizon = np.asarray(light.zenith), np.asarray(light.horizon)
    sky = zenith + (horizon - zenith) * each(math.exp, -share * 4.2)
    below = horizon * (0.9 + 0.1 * each(math.exp, np.clip(sine, -1, 0) * 6))[:, None]
    table = np.where(sine[:, None] >= 0, sky, below)
    return np.ascontiguousarray(table * light.exposure, np.float32)


@lru_cache(maxsize=1)
def tone_table() -> NDArray[np.uint8]:
    """Return the table from linear light (0..TONE_RANGE in TONE_STEPS steps) to sRGB bytes, with a soft shoulder."""
    x = np.arange(TONE_STEPS) * (TONE_RANGE / (TONE_STEPS - 1))
    # Straight up to 0.55, then an exponential shoulder of matching slope: midtones keep their colour.
    knee = 0.55
    mapped = np.where(x < knee, x, knee + (1 - knee) * (1 - np.exp(-(x - knee) / (1 - knee))))
    srgb = np.where(mapped <= 0.0031308, 12.92 * mapped, 1.055 * mapped ** (1 / 2.4) - 0.055)
    return np.clip(np.round(srgb * 255), 0, 255).astype(np.uint8)


@lru_cache(maxsize=1)
def linear_table() -> NDArray[np.float32]:
    """Return the linear light of the 256 sRGB byte values."""
    c = np.arange(256) / 255
    return np.where(c <= 0.04045, c / 12.92, each(math.pow, (c + 0.055) / 1.055, 2.4)).astype(np.float32)


@lru_cache(maxsize=1)
def cloud_map() -> NDArray[np.uint8]:
    """Return a tiling height map of clouds, shape ``(256, 256)``: five octaves of periodic value noise, equalised."""
    size = 256
    generator = rng(20, "clouds")
    total = np.zeros((size, size))
    for octave, cells in enumerate((4, 8, 16, 32, 64)):
        lattice = generator.random((cells, cells))
        t = np.arange(size) * cells / size
        i = t.astype(np.int64)
        f = t - i
        f = f * f * (3 - 2 * f)
        rows = lattice[i % cells] * (1 - f)[:, None] + lattice[(i + 1) % cells] * f[:, None]
        total += (rows[:, i % cells] * (1 - f) + rows[:, (i + 1) % cells] * f) * 0.52**octave
    ranks = np.argsort(np.argsort(total, axis=None, kind="stable"), kind="stable")
    return (ranks.reshape(size, size) * 256 // (size * size)).astype(np.uint8)


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
