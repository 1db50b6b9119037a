"""What a graphics card gives: wall milliseconds a picture on the processor and by OpenGL, by size and light.

    python benchmarks/graphics_card.py [WORLD] [--frames 3] [--pictures FOLDER] [--table FILE]

The place is a world folder, or the synthetic city of `render.py`; 15 street cameras, 15 bodies in motion; RGB, depth
and segmentation, as arrays in memory. OpenGL needs the extra ``gl``; ``EGL`` chooses the card. Without a card Mesa's
software driver draws, and the table says so. Differences are of RGB values of 255, and of pixels whose entity differs.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from renderers import LIGHTS
from reporting import machine, publish

from render import WalkingFigures, scene_to_measure, street_cameras
from vico.render import Cameras
from vico.render.frames import Frames, PictureRequest, take_pictures
from vico.render.gl.renderer import GlRenderer

SIZES = ((256, 256), (1280, 720))
_CAMERAS = 15

Take = Callable[[Cameras], Frames]


def timed(take: Take, cameras: Cameras, frames: int, move: Callable[[int], None]) -> NDArray[np.float64]:
    """Wall milliseconds a picture, of each batch of all cameras."""
    take(cameras)
    times = []
    for frame in range(frames):
        move(frame)
        start = time.perf_counter()
        take(cameras)
        times.append((time.perf_counter() - start) * 1000 / len(cameras))
    return np.array(times)


def compared(one: Frames, other: Frames) -> tuple[float, float]:
    """Return the mean difference of RGB values, and percent of pixels whose entity differs."""
    colours = np.abs(one.rgb.astype(np.int16) - other.rgb.astype(np.int16)).mean()
    return float(colours), float((one.segmentation != other.segmentation).mean() * 100)


def sheet(rows: list[Frames]) -> NDArray[np.uint8]:
    """Put the first four pictures of each into a row."""
    return np.concatenate([np.concatenate(list(frames.rgb[:4]), axis=1) for frames in rows])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("world", nargs="?", type=Path)
    parser.add_argument("--frames", type=int, default=3)
    parser.add_argument("--pictures", type=Path, help="folder for a sheet of both renderers' pictures")
    parser.add_argument("--table", type=Path)
    arguments = parser.parse_args()
    head, cores = machine(), os.cpu_count() or 1
    name, scene, points, triangles = scene_to_measure(arguments.world)
    figures = WalkingFigures([p + np.array([4.0, 0.5 * (k % 3), 0.0]) for k, p in enumerate(points[:_CAMERAS])])
    figures.set(scene, 0)
    gl = GlRenderer(scene)
    request = PictureRequest()

    def by_processor(threads: int) -> Take:
        return lambda cameras: take_pictures(scene, cameras, request, threads=threads)

    takes: dict[str, Take] = {
        "processor, 1 thread": by_processor(1),
        f"processor, {cores} threads": by_processor(cores),
        "OpenGL": lambda cameras: gl.take(cameras, request),
    }
    lines = [
        "# Graphics card: wall milliseconds a picture",
        "",
        head,
        "",
        f"OpenGL: {gl.device}.",
        "",
        f"## {name}",
        "",
    ]
    lines += [f"{triangles:,} static triangles, {_CAMERAS} pictures at a time: RGB, depth, segmentation.", ""]
    lines += [
        "| picture | drawn by | median ms | least | greatest | n | beside the first |",
        "|---|---|---|---|---|---|---|",
    ]
    differences = ["", "| picture | mean difference of RGB | pixels of another entity, % |", "|---|---|---|"]
    seen: list[Frames] = []
    for light, lighting in LIGHTS.items():
        scene.lighting = lighting
        for width, height in SIZES:
            cameras = street_cameras(points, _CAMERAS, width=width, height=height)
            label, first = f"{light}, {width} x {height}", 0.0
            for drawn_by, take in takes.items():
                times = timed(take, cameras, arguments.frames, lambda frame: figures.set(scene, frame))
                middle = float(np.median(times))
                first = first or middle
                lines.append(
                    f"| {label} | {drawn_by} | {middle:.2f} | {times.min():.2f} | {times.max():.2f} | {len(times)} "
                    f"| {middle / first:.2f} |"
                )
            pair = [by_processor(cores)(cameras), gl.take(cameras, request)]
            colours, pixels = compared(*pair)
            differences.append(f"| {label} | {colours:.2f} | {pixels:.2f} |")
            if width == SIZES[0][0]:
                seen += pair
    publish(lines + differences, arguments.table)
    if arguments.pictures:
        arguments.pictures.mkdir(parents=True, exist_ok=True)
        Image.fromarray(sheet(seen)).save(arguments.pictures / "graphics_card.png")


if __name__ == "__main__":
    main()
