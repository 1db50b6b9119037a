"""Rendering: a scene in, RGB, depth and segmentation for many cameras out, on the CPU.

A picture is made in two passes over the arrays of a `Scene` (`arrays`, `records`): `visibility` finds the nearest
triangle of every pixel, `shading` gives it a colour. `shadows` holds the maps that shading looks the sun and the sky up
in, and the shadows of what moves; `uniforms` what the kernels read of a camera and of the light of a moment.
"""

from vico.render.cameras import Cameras
from vico.render.frames import Frames, render, render_top_down, warm_up
from vico.render.lighting import Lighting, sun_direction
from vico.render.scene import Scene
from vico.render.view import ViewCache

__all__ = [
    "Cameras",
    "Frames",
    "Lighting",
    "Scene",
    "ViewCache",
    "render",
    "render_top_down",
    "sun_direction",
    "warm_up",
]
