"""Build a small world from the packaged map and take a picture of one of its streets.

python examples/01_first_world.py --out out/first_world
"""

import argparse
from pathlib import Path

import numpy as np
from PIL import Image

from vico.render import Cameras, render
from vico.render.world_scene import scene_of
from vico.world.folder import read_world
from vico.worldgen.packaged import packaged_extract
from vico.worldgen.pipeline import build_world
from vico.worldgen.previews import viewpoints


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--radius", type=float, default=150.0)
    arguments = parser.parse_args()

    place = packaged_extract()
    manifest = build_world(place.path, lat=place.lat, lon=place.lon, half=arguments.radius, out=arguments.out)
    print(f"{manifest.counts['buildings']} buildings, {manifest.counts['places']} places")

    world = read_world(arguments.out)
    view = viewpoints(world, count=1)[0]
    camera = Cameras(np.array([view.position]), np.array([view.forward]), fov_y=view.fov_y, width=640, height=360)
    frames = render(scene_of(world, rooms=False), camera, samples=2)
    Image.fromarray(frames.rgb[0]).save(arguments.out.with_suffix(".png"))
    seen = [world.entities[int(e)]["name"] for e in np.unique(frames.segmentation[0]) if e >= 1000]
    print(f"in view: {', '.join(sorted({name for name in seen if name})[:8])}")


if __name__ == "__main__":
    main()
