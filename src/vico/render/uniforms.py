"""Uniforms of the kernels: one record of a camera, one of the light of a moment, and the light's tables."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.render.cameras import Cameras
from vico.render.lamps import NO_LAMPS, LampGrid
from vico.render.lighting import Lighting, unit
from vico.render.records import CAMERA_UNIFORMS, LIGHT_UNIFORMS

# A `numpy.void`: one element of a structured array, its fields by name.
Record = Any

# Texture samples a pixel on slanted surfaces: of a quick picture, and of one to look at.
_QUICK_TAPS, _FINE_TAPS = 2, 4

# Light all around in a room whose lamps are out, as a share of that with lamps: none from windows, and by day.
_UNLIT, _DAYLIT = 0.03, 0.75
# Share of the daylight picture that windows show at night.
_NIGHT_WINDOW = 0.05


def camera_uniforms(cameras: Cameras, k: int, samples: int, room: Record | None) -> Record:
    """Return the `CAMERA_UNIFORMS` of one camera, whose picture has `samples` rows and columns for each pixel.

    `room` is the `ROOM` that it is in.
    """
    camera = np.zeros(1, CAMERA_UNIFORMS)[0]
    camera["x"], camera["y"], camera["z"] = cameras.position[k]
    right, down, forward = cameras.rotation[k]
    camera["right_x"], camera["right_y"], camera["right_z"] = right
    camera["down_x"], camera["down_y"], camera["down_z"] = down
    camera["forward_x"], camera["forward_y"], camera["forward_z"] = forward
    width, height = cameras.width * samples, cameras.height * samples
    camera["width"], camera["height"] = width, height
    camera["focal"] = cameras.intrinsics[0, 0] * samples
    camera["centre_x"], camera["centre_y"] = width / 2, height / 2
    camera["near"], camera["far"] = cameras.near, cameras.far
    camera["hidden_entity"] = np.asarray(cameras.hidden_entity)[k]
    camera["most_taps"] = _QUICK_TAPS if samples == 1 else _FINE_TAPS
    if room is not None:
        set_room(camera, room)
    return camera


def set_room(camera: Record, room: Record) -> None:
    """Write into `CAMERA_UNIFORMS` that a room is what is seen."""
    camera["indoors"] = 1
    for name in ("x", "y", "z", "half_length", "half_width", "height"):
        camera[f"room_{name}"] = room[name]
    camera["room_cos"], camera["room_sin"] = np.cos(room["yaw"]), np.sin(room["yaw"])
    lamp, daylight = float(room["lamp"]), float(room["daylight"])
    camera["room_lamp"] = lamp
    camera["room_around"] = lamp + (1.0 - lamp) * (_UNLIT + (_DAYLIT - _UNLIT) * daylight)
    camera["room_window"] = _NIGHT_WINDOW + (1.0 - _NIGHT_WINDOW) * daylight


def light_uniforms(light: Lighting) -> Record:
    """Return the `LIGHT_UNIFORMS` of a moment."""
    sun, shadow = unit(light.sun_direction), unit(light.shadow_direction or light.sun_direction)
    uniforms = np.zeros(1, LIGHT_UNIFORMS)[0]
    uniforms["sun_x"], uniforms["sun_y"], uniforms["sun_z"] = sun
    uniforms["shadow_x"], uniforms["shadow_y"], uniforms["shadow_z"] = shadow
    _set_colour(uniforms, "sun", np.asarray(light.sun_colour) * light.exposure)
    ambient, bounce = np.asarray(light.ambient) * light.exposure, np.asarray(light.bounce) * light.exposure
    # ambient + n.z * tilt is the sky above and the lit ground below, seen by a surface of that tilt.
    _set_colour(uniforms, "ambient", (ambient + bounce) / 2)
    _set_colour(uniforms, "tilt", (ambient - bounce) / 2)
    _set_colour(uniforms, "haze", np.asarray(light.horizon) * light.exposure)
    uniforms["haze_per_metre"] = 1.0 / max(light.fog, 1.0)
    uniforms["lamp_exposure"] = light.lamps * 1.6
    uniforms["cloud_cover"] = light.clouds
    # Light that turns the corner from the sun's side, so that walls in shade do not all look alike.
    level = np.hypot(sun[0], sun[1])
    side = sun[:2] / level if level > 1e-6 else np.zeros(2)
    uniforms["side_x"], uniforms["side_y"] = 0.22 * side * float(ambient.mean())
    cloud = (np.asarray(light.ambient) * 1.05 + np.asarray(light.sun_colour) * 0.16) * light.exposure
    _set_colour(uniforms, "cloud_lit", cloud)
    _set_colour(uniforms, "cloud_shade", cloud * 0.60)
    for name in ("wet", "snow_cover", "rain", "snowfall"):
        uniforms[name] = getattr(light, name)
    uniforms["unlit_x"], uniforms["unlit_y"], uniforms["unlit_radius"] = light.unlit
    return uniforms


def _set_colour(uniforms: Record, name: str, colour: Any) -> None:
    uniforms[f"{name}_red"], uniforms[f"{name}_green"], uniforms[f"{name}_blue"] = colour


class ShadowMap(NamedTuple):
    """What the sun sees of the static scene.

    Attributes
    ----------
    closeness
        To the sun of the first surface, 65535 nearest, uint16, shape ``(n, n)``.
    matrix
        Takes a world point (metres) and 1 to column, row and closeness, float32, shape ``(3, 4)``.
    """

    closeness: NDArray[np.uint16]
    matrix: NDArray[np.float32]


class ReliefMap(NamedTuple):
    """Blurred top heights of the static scene; points beneath them see less sky.

    Attributes
    ----------
    height
        World metres, float32, shape ``(m, m)``; rows go north.
    x, y
        South-west corner, world metres.
    texels_per_metre
        Along both axes.
    """

    height: NDArray[np.float32]
    x: float
    y: float
    texels_per_metre: float


class Light(NamedTuple):
    """What the shader reads of the light.

    Attributes
    ----------
    uniforms
        A `LIGHT_UNIFORMS` record.
    tone
        `tone_table`, uint8, shape ``(TONE_STEPS,)``.
    sky
        `paint_sky`: packed like a texture, uint32, shape ``(SKY_SIZE ** 2,)``.
    shadow, relief
        Of the static scene.
    lamps
        Those that stay where they are, as they shine now.
    """

    uniforms: Any
    tone: NDArray[np.uint8]
    sky: NDArray[np.uint32]
    shadow: ShadowMap
    relief: ReliefMap
    lamps: LampGrid


#: For pictures without colours.
NO_LIGHT = Light(
    np.zeros(1, LIGHT_UNIFORMS)[0],
    np.zeros(1, np.uint8),
    np.zeros(1, np.uint32),
    ShadowMap(np.zeros((1, 1), np.uint16), np.zeros((3, 4), np.float32)),
    ReliefMap(np.zeros((1, 1), np.float32), 0.0, 0.0, 0.0),
    NO_LAMPS,
)
