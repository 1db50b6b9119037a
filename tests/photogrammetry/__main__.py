"""Make a 3D tileset of a built world, as aerial photogrammetry would: bumpy, melted, with cars, holes and shadows.

    PYTHONPATH=tests python -m photogrammetry out/monaco out/monaco_tiles --half 200 --picture out/monaco_tiles.png

What is built again from the tileset (`vico world build --tiles`) can so be held against the world that is known.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

from photogrammetry.aerial import Photogrammetry, photogrammetry
from photogrammetry.tile_view import tile_surfaces
from photogrammetry.tileset import write_tileset
from vico.errors import VicoError
from vico.geo.tiles3d import TileMesh
from vico.render import Cameras, render
from vico.render.lighting import Lighting
from vico.render.scene import Scene
from vico.world.folder import read_world


def picture_of(mesh: TileMesh, reach: float) -> Image.Image:
    """Return the mesh from the air, from the south-west."""
    middle = float(np.median(mesh.positions[:, 2]))
    position = np.array([-0.8 * reach, -1.3 * reach, middle + 0.9 * reach])
    forward = np.array([0.0, -0.1 * reach, middle]) - position
    camera = Cameras(
        position[None], (forward / np.linalg.norm(forward))[None], fov_y=float(np.radians(50.0)), width=1280, height=720
    )
    # The photos have their light in them already.
    even = Lighting(sun_colour=(0.0, 0.0, 0.0), ambient=(0.85, 0.85, 0.85), bounce=(0.85, 0.85, 0.85), fog=20_000.0)
    scene = Scene(tile_surfaces(mesh), lighting=even)
    frames = render(scene, camera, depth=False, segmentation=False, samples=2)
    return Image.fromarray(frames.rgb[0])


def main() -> int:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("world", type=Path, help="folder of a built world")
    parser.add_argument("out", type=Path, help="folder to make")
    parser.add_argument("--half", type=float, help="half the side of the square to do, metres (the world's)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--levels", type=int, default=3, help="of the quadtree")
    parser.add_argument("--plain", action="store_true", help="without Draco compression")
    parser.add_argument("--picture", type=Path, help="PNG to make of it, from the air")
    arguments = parser.parse_args()
    try:
        world = read_world(arguments.world)
        config = replace(Photogrammetry(), seed=arguments.seed, levels=arguments.levels)
        mesh = photogrammetry(world, config, half=arguments.half)
        tiles = write_tileset(mesh, world.frame, arguments.out, levels=arguments.levels, draco=not arguments.plain)
        if arguments.picture:
            picture_of(mesh, arguments.half or world.half).save(arguments.picture, optimize=True)
    except VicoError as error:
        sys.exit(str(error))
    sys.stdout.write(f"{arguments.out}: {tiles} tiles, {len(mesh.triangles):,} triangles\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
