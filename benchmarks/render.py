"""How long a 256 x 256 RGB + depth + segmentation picture takes, with 15 avatars in motion.

    python benchmarks/render.py [WORLD ...] [--frames 20] [--pictures FOLDER] [--table benchmarks/results/render.md]

First a synthetic city of about 290,000 triangles, 700 trees and street objects, then the world folders. Times are
processor time of the one thread that renders (so that a busy machine does not blur them) and wall time of whole
batches with one and two threads.
"""

from __future__ import annotations

import argparse
import os
import platform
import sys
import time
from pathlib import Path

import numba
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from vico.assets.shapes import ball, box, cylinder, lathe, pose_matrix
from vico.render import Cameras, Scene, render
from vico.render.world_scene import scene_of
from vico.seeds import rng
from vico.world.folder import read_world
from vico.world.mesh import Material, Surface, merge_surfaces

EYE = 1.6


def facade_texture(seed: int) -> NDArray[np.uint8]:
    """Paint a 64 x 64 bay of wall with a window; row 0 is at the bottom."""
    generator = np.random.default_rng(seed)
    tile = np.full((64, 64, 3), 225.0)
    tile += generator.normal(0, 5, (64, 64, 1))
    tile[0:3] *= 0.8
    tile[18:54, 16:48] = 245
    tile[20:52, 18:46] = np.linspace(70, 120, 32)[:, None, None] * np.array([0.8, 0.95, 1.1])
    tile[20:52, 31:33] = 240
    tile[14:18, 13:51] = 190
    return np.clip(tile, 0, 255).astype(np.uint8)


def ground_texture(seed: int, level: float, colour: tuple[float, float, float]) -> NDArray[np.uint8]:
    """Paint a noisy 128 x 128 tile."""
    noise = np.random.default_rng(seed).normal(0, 9, (128, 128, 1))
    return np.clip((level + noise) * np.array(colour), 0, 255).astype(np.uint8)


def grid_quad(
    corner: NDArray[np.float64],
    along: NDArray[np.float64],
    up: NDArray[np.float64],
    cells: tuple[int, int],
    uv: tuple[float, float],
    **options: object,
) -> Surface:
    """Make a rectangle cut into cells; it faces along x up."""
    n, m = cells
    s, t = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, m + 1))
    points = corner + s[..., None] * along + t[..., None] * up
    index = np.arange((n + 1) * (m + 1)).reshape(m + 1, n + 1)
    a, b, c, d = index[:-1, :-1].ravel(), index[:-1, 1:].ravel(), index[1:, 1:].ravel(), index[1:, :-1].ravel()
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    normal = np.cross(along, up)
    normal /= np.linalg.norm(normal)
    coordinates = np.stack([s * uv[0], t * uv[1]], -1).reshape(-1, 2)
    flat = points.reshape(-1, 3)
    return Surface.from_triangles(flat, faces, uv=coordinates, normals=np.tile(normal, (len(flat), 1)), **options)  # type: ignore[arg-type]


def synthetic_city(half: float = 400.0) -> tuple[Scene, list[NDArray[np.float64]], int]:
    """Blocks of houses on a grid of streets; returns the scene, street points and the number of static triangles."""
    generator = np.random.default_rng(7)
    facades = [Material(f"facade {k}", facade_texture(k), emission=0.0) for k in range(3)]
    asphalt = Material("asphalt", ground_texture(1, 95, (1, 1, 1.02)))
    paving = Material("paving", ground_texture(2, 165, (1.0, 0.98, 0.94)))
    roof = Material("roof", ground_texture(3, 150, (1.0, 0.72, 0.6)))
    parts: list[Surface] = []
    cells = int(2 * half / 5)
    parts.append(
        grid_quad(
            np.array([-half, -half, 0.0]),
            np.array([2 * half, 0, 0]),
            np.array([0, 2 * half, 0]),
            (cells, cells),
            (2 * half / 4, 2 * half / 4),
            entity=2,
            material=asphalt,
            colour=(200, 200, 200),
        )
    )
    entity = 1000
    pitch, street = 80.0, 18.0
    for bx in np.arange(-half, half, pitch):
        for by in np.arange(-half, half, pitch):
            low, size = np.array([bx + street / 2, by + street / 2]), pitch - street
            parts.append(
                grid_quad(
                    np.array([*low, 0.12]),
                    np.array([size, 0, 0]),
                    np.array([0, size, 0]),
                    (8, 8),
                    (size / 2, size / 2),
                    entity=1,
                    material=paving,
                    colour=(220, 220, 220),
                )
            )
            if generator.random() < 0.06:
                continue
            inner = low + 4.0
            side = (size - 8.0) / 3
            for i in range(3):
                for j in range(3):
                    if i == 1 and j == 1:
                        continue
                    floors = int(generator.integers(4, 8))
                    tint = generator.integers(150, 255, 3)
                    tint = (tint * 0.4 + tint.mean() * 0.6).astype(np.uint8)
                    parts += house(
                        inner + np.array([i, j]) * side, side, floors, facades[(i + j) % 3], roof, entity, tint
                    )
                    entity += 1
    static = merge_surfaces(parts)
    leaf = ball((1.7, 1.7, 2.0), (0, 0, 4.6), colour=(92, 138, 62), sides=12, rings=9)
    tree = merge_surfaces(
        [leaf, ball((1.2, 1.2, 1.2), (0.9, 0.4, 3.8), colour=(80, 124, 56)), cylinder(0.16, 3.4, colour=(96, 74, 56))]
    )
    lamp = merge_surfaces(
        [cylinder(0.07, 5.0, colour=(70, 74, 78)), box((0.7, 0.25, 0.12), (0.25, 0, 5.0), colour=(70, 74, 78))]
    )
    bench = merge_surfaces(
        [
            box((1.6, 0.45, 0.06), (0, 0, 0.45), colour=(140, 96, 60)),
            box((1.4, 0.35, 0.42), (0, 0, 0.21), colour=(60, 60, 64)),
        ]
    )
    car = merge_surfaces(
        [
            box((4.3, 1.8, 0.75), (0, 0, 0.62), colour=(178, 40, 44)),
            box((2.3, 1.6, 0.6), (-0.2, 0, 1.25), colour=(60, 70, 82)),
            *(
                lathe(
                    [(0.0, -0.12), (0.32, -0.12), (0.32, -0.12), (0.32, 0.12), (0.32, 0.12), (0, 0.12)],
                    colour=(30, 30, 32),
                ).moved(pose_matrix(x, y, 0.32) @ np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1.0]]))
                for x in (-1.35, 1.35)
                for y in (-0.8, 0.8)
            ),
        ]
    )
    scene = Scene(static, {"tree": tree, "lamp": lamp, "bench": bench, "car": car})
    names, poses = [], []
    for k in range(700):
        line = generator.integers(-4, 5) * pitch + generator.choice([-1, 1]) * (street / 2 + 1.2)
        other = generator.uniform(-half, half)
        x, y = (line, other) if k % 2 else (other, line)
        names.append(("tree", "lamp", "bench")[0 if k % 10 < 5 else (1 if k % 10 < 8 else 2)])
        poses.append(pose_matrix(x, y, 0.12, generator.uniform(0, 6)))
    scene.place(names, np.array(poses), np.arange(20_000, 20_000 + len(names)))
    points: list[NDArray[np.float64]] = []
    for _ in range(60):
        line, other = generator.integers(-3, 4) * pitch, generator.uniform(-0.75 * half, 0.75 * half)
        points.append(np.array([line + 3.0, other, 0.0]) if len(points) % 2 else np.array([other, line - 3.0, 0.0]))
    return scene, points, sum(len(s.triangles) for s in static)


def house(
    low: NDArray[np.float64],
    side: float,
    floors: int,
    facade: Material,
    roof: Material,
    entity: int,
    tint: NDArray[np.uint8],
) -> list[Surface]:
    """Make a box with windows on its four sides."""
    height, bays = floors * 3.2, max(int(side / 3), 1)
    corners = [low + np.array(step) * side for step in ((0, 0), (1, 0), (1, 1), (0, 1))]
    walls = [
        grid_quad(
            np.array([*corners[k], 0.1]),
            np.array([*(corners[(k + 1) % 4] - corners[k]), 0]),
            np.array([0, 0, height]),
            (bays, floors),
            (bays, floors),
            entity=entity,
            material=facade,
            colour=tuple(int(c) for c in tint),
        )
        for k in range(4)
    ]
    top = grid_quad(
        np.array([*low, height + 0.1]),
        np.array([side, 0, 0]),
        np.array([0, side, 0]),
        (4, 4),
        (side / 3, side / 3),
        entity=entity,
        material=roof,
    )
    return [*walls, top]


class WalkingFigures:
    """Bodies of about 1,200 triangles each (ellipsoids for torso, head and limbs) that walk to and fro."""

    def __init__(self, places: list[NDArray[np.float64]]) -> None:
        self.places = places
        self.bodies = []
        for k in range(len(places)):
            shade = int(60 + 12 * k)
            self.bodies.append(
                merge_surfaces(
                    [
                        ball(
                            (0.16, 0.22, 0.34), (0, 0, 1.15), colour=(shade, 90, 200 - shade // 2), sides=16, rings=12
                        ),
                        ball((0.10, 0.09, 0.13), (0, 0, 1.64), colour=(224, 182, 150), sides=14, rings=10),
                        *(
                            ball((0.09, 0.08, 0.46), (0, s * 0.11, 0.46), colour=(50, 52, 70), sides=12, rings=10)
                            for s in (-1, 1)
                        ),
                        *(
                            ball((0.06, 0.05, 0.34), (0, s * 0.27, 1.12), colour=(shade, 90, 160), sides=12, rings=8)
                            for s in (-1, 1)
                        ),
                    ]
                )[0]
            )
        counts = [len(b.positions) for b in self.bodies]
        shifts = np.cumsum([0, *counts[:-1]])
        self.triangles = np.concatenate([b.triangles + np.int32(s) for b, s in zip(self.bodies, shifts, strict=True)])
        self.colour = np.concatenate([b.colour for b in self.bodies])
        self.entity = np.repeat(np.arange(1_000_000, 1_000_000 + len(places), dtype=np.int32), counts)

    def set(self, scene: Scene, step: int) -> None:
        """Put everybody where they are at a step."""
        vertices, normals = [], []
        for k, (body, place) in enumerate(zip(self.bodies, self.places, strict=True)):
            pose = pose_matrix(place[0] + 0.3 * np.sin(step * 0.3 + k), place[1] + 0.02 * step, place[2], 0.4 * k)
            moved = body.moved(pose)
            vertices.append(moved.positions)
            normals.append(moved.normals)
        scene.set_skinned(np.concatenate(vertices), np.concatenate(normals), self.triangles, self.colour, self.entity)


def street_cameras(points: list[NDArray[np.float64]], count: int, **options: object) -> Cameras:
    """Eyes of people who stand at the first points and look along the streets."""
    position = np.array(points[:count]) + np.array([0, 0, EYE])
    yaw = np.array(
        [(0.0, np.pi / 2, np.pi, -np.pi / 2)[(k // 2 * 2 + (k + 1) % 2) % 4] + 0.12 * np.sin(k) for k in range(count)]
    )
    forward = np.stack([np.cos(yaw), np.sin(yaw), np.full(count, -0.05)], 1)
    return Cameras(position, forward, **options)  # type: ignore[arg-type]


def timed(
    scene: Scene, cameras: Cameras, figures: WalkingFigures, frames: int, *, rgb: bool = True
) -> NDArray[np.float64]:
    """Processor milliseconds of each picture, one thread."""
    singles = [
        Cameras(cameras.position[k : k + 1], cameras.forward[k : k + 1], width=cameras.width, height=cameras.height)
        for k in range(len(cameras))
    ]
    times = []
    for step in range(frames):
        figures.set(scene, step)
        for camera in singles:
            start = time.thread_time()
            render(scene, camera, threads=1, rgb=rgb)
            times.append((time.thread_time() - start) * 1000)
    return np.array(times)


def wall(scene: Scene, cameras: Cameras, figures: WalkingFigures, frames: int, threads: int) -> NDArray[np.float64]:
    """Wall milliseconds a picture in batches of all cameras."""
    times = []
    for step in range(frames):
        figures.set(scene, step)
        start = time.perf_counter()
        render(scene, cameras, threads=threads)
        times.append((time.perf_counter() - start) * 1000 / len(cameras))
    return np.array(times)


def scene_to_measure(folder: Path | None) -> tuple[str, Scene, list[NDArray[np.float64]], int]:
    """Return name, scene, street points and static triangles of the synthetic city or of a world folder."""
    if folder is None:
        return "synthetic city", *synthetic_city()
    world = read_world(folder)
    scene = scene_of(world)
    generator = rng(3, "render benchmark")
    points = []
    for _ in range(60):
        xy = world.walkable.random_point(generator)
        points.append(np.array([xy[0], xy[1], float(world.height(xy))]))
    return world.manifest.name, scene, points, len(scene.arrays.mesh.triangle)


def save_pictures(folder: Path, name: str, scene: Scene, cameras: Cameras) -> None:
    """Write a sheet of all the views and the first four of them in wide."""
    folder.mkdir(parents=True, exist_ok=True)
    small = render(scene, cameras)
    sheet = np.concatenate([np.concatenate(list(small.rgb[r * 5 : r * 5 + 5]), axis=1) for r in range(3)])
    Image.fromarray(sheet).save(folder / f"{name} sheet.png")
    for k in range(4):
        wide = Cameras(cameras.position[k : k + 1], cameras.forward[k : k + 1], width=960, height=540, fov_y=1.2)
        Image.fromarray(render(scene, wide, samples=2).rgb[0]).save(folder / f"{name} {k}.png")


def measure(folder: Path | None, frames: int, pictures: Path | None) -> list[str]:
    """Return the lines of the report on the synthetic city or on a world folder."""
    start = time.perf_counter()
    name, scene, points, triangles = scene_to_measure(folder)
    built = time.perf_counter() - start
    figures = WalkingFigures([p + np.array([4.0, 0.5 * (k % 3), 0.0]) for k, p in enumerate(points[:15])])
    figures.set(scene, 0)
    cameras = street_cameras(points, 15)
    start = time.perf_counter()
    scene.light()
    lit = time.perf_counter() - start
    render(scene, cameras)
    if pictures:
        save_pictures(pictures, name, scene, cameras)
    rows = [
        ("RGB + depth + segmentation, processor time", timed(scene, cameras, figures, frames)),
        ("depth + segmentation, processor time", timed(scene, cameras, figures, frames, rgb=False)),
        ("batch of 15, 1 thread, wall time a picture", wall(scene, cameras, figures, frames, 1)),
        ("batch of 15, 2 threads, wall time a picture", wall(scene, cameras, figures, frames, 2)),
    ]
    lines = [
        f"## {name}",
        "",
        f"{triangles:,} static triangles, {int(scene.arrays.counts['static_instances']):,} placed objects, "
        f"{len(figures.triangles):,} triangles in 15 moving avatars; 256 x 256 pixels, 15 street-level cameras, sun "
        f"shadows. Scene ready in {built:.1f} s, light and shadow map in {lit:.2f} s.",
        "",
        "| what | median ms | p5 | p95 | n |",
        "|---|---|---|---|---|",
    ]
    for label, times in rows:
        low, middle, top = np.percentile(times, [5, 50, 95])
        lines.append(f"| {label} | {middle:.2f} | {low:.2f} | {top:.2f} | {len(times)} |")
    return [*lines, ""]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("worlds", nargs="*", type=Path, help="world folders; the synthetic city always comes first")
    parser.add_argument("--frames", type=int, default=20)
    parser.add_argument("--pictures", type=Path)
    parser.add_argument("--table", type=Path)
    arguments = parser.parse_args()
    lines = [
        "# Render: milliseconds a picture",
        "",
        f"Machine: {platform.machine()}, {processor()}, {os.cpu_count()} processors, load {os.getloadavg()[0]:.1f} at "
        f"the start; Python {platform.python_version()}, numba {numba.__version__}, numpy {np.__version__}.",
        "Made by `python benchmarks/render.py [WORLD ...] --table benchmarks/results/render.md`.",
        "",
    ]
    for folder in (None, *arguments.worlds):
        lines += measure(folder, arguments.frames, arguments.pictures)
    text = "\n".join(lines)
    print(text)
    if arguments.table:
        arguments.table.parent.mkdir(parents=True, exist_ok=True)
        arguments.table.write_text(text)


def processor() -> str:
    """Return what the machine says its processor is."""
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    except OSError:
        pass
    return platform.processor() or sys.platform


if __name__ == "__main__":
    main()
