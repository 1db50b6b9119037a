"""What shaders are told about a camera and the light."""

from __future__ import annotations

from typing import Any

from vico.render.gl.lamps import LAMP_FLOATS
from vico.render.lighting import TONE_RANGE, TONE_STEPS
from vico.render.shading.light import Light
from vico.render.uniforms import Record


def vector(record: Record, name: str, parts: str = "xyz") -> tuple[float, ...]:
    """Return the parts of a record's field as numbers."""
    return tuple(float(record[f"{name}_{part}"]) for part in parts)


def _colour(record: Record, name: str) -> tuple[float, ...]:
    return tuple(float(record[f"{name}_{part}"]) for part in ("red", "green", "blue"))


def view_uniforms(camera: Record) -> dict[str, Any]:
    """Return the uniforms about a camera."""
    focal = float(camera["focal"])
    return {
        "eye": (float(camera["x"]), float(camera["y"]), float(camera["z"])),
        "right": vector(camera, "right"),
        "down": vector(camera, "down"),
        "forward": vector(camera, "forward"),
        "scale": (2.0 * focal / float(camera["width"]), 2.0 * focal / float(camera["height"])),
        "centre": (
            2.0 * float(camera["centre_x"]) / float(camera["width"]) - 1.0,
            2.0 * float(camera["centre_y"]) / float(camera["height"]) - 1.0,
        ),
        "near": float(camera["near"]),
        "far": float(camera["far"]),
        "indoors": int(camera["indoors"]),
        "hidden": int(camera["hidden_entity"]),
        "most_taps": int(camera["most_taps"]),
        "room_place": (*vector(camera, "room"), float(camera["room_cos"])),
        "room_size": (
            float(camera["room_half_length"]),
            float(camera["room_half_width"]),
            float(camera["room_height"]),
            float(camera["room_sin"]),
        ),
        "room_light": tuple(float(camera[f"room_{name}"]) for name in ("lamp", "around", "window")),
    }


def light_uniforms(light: Light) -> dict[str, Any]:
    """Return the uniforms about the light."""
    u = light.uniforms
    relief, grid = light.relief, light.lamps
    return {
        "lamp_grid": (float(grid.x), float(grid.y), float(grid.columns), float(grid.rows)),
        "lamp_parts": (len(grid.start), len(grid.start) + LAMP_FLOATS * len(grid.lamps)),
        "sun": vector(u, "sun"),
        "sun_colour": _colour(u, "sun"),
        "ambient": _colour(u, "ambient"),
        "tilt": _colour(u, "tilt"),
        "haze": _colour(u, "haze"),
        "side": vector(u, "side", "xy"),
        "unlit": (float(u["unlit_x"]), float(u["unlit_y"]), float(u["unlit_radius"])),
        "haze_per_metre": float(u["haze_per_metre"]),
        "lamp_exposure": float(u["lamp_exposure"]),
        "wet": float(u["wet"]),
        "snow_cover": float(u["snow_cover"]),
        "softness": float(u["shadow_softness"]),
        "glass": float(u["glass"]),
        "interiors": float(u["interiors"]),
        "tone_scale": (TONE_STEPS - 1) / TONE_RANGE,
        "shadow_frame": tuple(float(v) for v in light.shadow.matrix.T.reshape(-1)),
        "relief_frame": (float(relief.x), float(relief.y), float(relief.texels_per_metre)),
    }
