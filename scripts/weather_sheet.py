"""Make a contact sheet of every kind of weather by day and by night: the same street and moment, kind by kind.

python scripts/weather_sheet.py WORLD docs/images/weather.jpg
"""

import argparse
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from vico.render import Cameras
from vico.sim.config import SimConfig
from vico.sim.environment import weather_kinds
from vico.sim.loop.simulation import Simulation
from vico.sim.pictures.scene import SceneRenderer
from vico.world.folder import read_world
from vico.worldgen.previews import viewpoints

WIDTH, HEIGHT = 320, 200
NOON, EVENING = 12 * 3600, 18 * 3600


def main() -> None:
    """Photograph a street in each weather; kinds that it is too cold or too warm for get the nearest temperature."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("world", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--view", type=int, default=0, help="which of the world's street views, from 0")
    parser.add_argument("--kinds", default=",".join(weather_kinds()), help="kinds of weather, with commas between")
    arguments = parser.parse_args()
    world = read_world(arguments.world)
    view = viewpoints(world, count=12)[arguments.view]
    camera = Cameras(
        np.array([view.position]), np.array([view.forward]), fov_y=np.radians(55.0), width=WIDTH, height=HEIGHT
    )
    renderer = None
    pictures: dict[tuple[str, int], Image.Image] = {}
    for kind in arguments.kinds.split(","):
        for second in (NOON, EVENING):
            config = SimConfig(
                cars=40, pedestrians=120, seed=1, observe=(), date="2026-01-15", start=second, weather=kind
            )
            sim = Simulation(world, None, config)
            for _ in range(5):
                sim.step({})
            renderer = SceneRenderer(sim) if renderer is None else renderer.rebind(sim)
            pictures[kind, second] = Image.fromarray(renderer.render_cameras(sim.state, camera, samples=2)[0])
    save_sheet(pictures, arguments.out)


def save_sheet(pictures: dict[tuple[str, int], Image.Image], path: Path) -> None:
    """Put pictures into rows of two kinds, each by day and by night, with their names."""
    kinds = list(dict.fromkeys(kind for kind, _ in pictures))
    rows = -(-len(kinds) // 2)
    sheet = Image.new("RGB", (4 * (WIDTH + 4), rows * (HEIGHT + 4)), "white")
    for k, kind in enumerate(kinds):
        for night, second in enumerate((NOON, EVENING)):
            picture = pictures[kind, second]
            ImageDraw.Draw(picture).text(
                (6, 4), kind.replace("_", " "), fill="white", stroke_width=2, stroke_fill="black"
            )
            sheet.paste(picture, ((2 * (k % 2) + night) * (WIDTH + 4), k // 2 * (HEIGHT + 4)))
    sheet.save(path, quality=85)


if __name__ == "__main__":
    main()
