"""How it looks: a scene in, RGB, depth and segmentation for many cameras out, on the CPU."""

from vico.render.cameras import Cameras
from vico.render.frames import Frames, Stills, render, render_top_down, warm_up
from vico.render.lighting import Lighting, sun_direction
from vico.render.scene import Scene

__all__ = ["Cameras", "Frames", "Lighting", "Scene", "Stills", "render", "render_top_down", "sun_direction", "warm_up"]
