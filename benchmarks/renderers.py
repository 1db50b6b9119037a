"""What a 256 x 256 picture costs: by light and weather, lens, output and quality, and beside other renderers.

    python benchmarks/renderers.py [WORLD] [--frames 3] [--table benchmarks/results/renderers.md]

The place is a world folder, or the synthetic city of `render.py`; 15 street cameras, 15 bodies in motion. All is
processor time of all threads, medians, so that a busy machine does not blur it and drivers that draw with many threads
have no advantage. OpenGL needs the extra ``gl``, MuJoCo's renderer a driver: what is missing is left out. Without a
graphics card both draw with Mesa's software driver.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from reporting import machine, publish

from render import WalkingFigures, scene_to_measure, street_cameras
from vico.errors import VicoError
from vico.render import Cameras, Lighting, Scene
from vico.render.cameras import Lens
from vico.render.frames import FINE_QUALITY, PictureRequest, take_pictures
from vico.render.viewers import Viewers

DAY = Lighting.at(9 * 3600, 60.0)
NIGHT_RAIN = replace(Lighting.at(23 * 3600, 52.0, day=340, clouds=0.9), wet=1.0, rain=4.0)
LIGHTS = {"day": DAY, "night with rain": NIGHT_RAIN}


def measured(takes: Sequence[Callable[[], Any]], frames: int, move: Callable[[int], None]) -> NDArray[np.float64]:
    """Processor milliseconds of each picture, all threads."""
    times = []
    for take in takes[:2]:
        take()
    for frame in range(frames):
        move(frame)
        for take in takes:
            start = time.process_time()
            take()
            times.append((time.process_time() - start) * 1000)
    return np.array(times)


def singles(cameras: Cameras) -> list[Cameras]:
    """Each camera by itself."""
    return [
        Cameras(cameras.position[k : k + 1], cameras.forward[k : k + 1], width=cameras.width, height=cameras.height)
        for k in range(len(cameras))
    ]


def by_request(scene: Scene, cameras: Cameras, request: PictureRequest) -> list[Callable[[], Any]]:
    """Pictures by the processor, one thread."""
    return [lambda c=c: take_pictures(scene, c, request, threads=1) for c in singles(cameras)]


def by_viewer(scene: Scene, cameras: Cameras, outputs: tuple[str, ...], lens: Lens) -> list[Callable[[], Any]]:
    """Pictures as observations have them; moments pass, so that there is flow."""
    viewers, clock = Viewers(scene, outputs), iter(range(10**9))
    poses = np.concatenate([cameras.position, cameras.forward], axis=1)

    def take(k: int) -> None:
        views = viewers.take(poses[k : k + 1], np.array([k + 1], np.int32), [lens], second=float(next(clock)))
        views.wait()

    return [lambda k=k: take(k) for k in range(len(cameras))]


def by_gl(scene: Scene, cameras: Cameras) -> tuple[str, list[Callable[[], Any]]]:
    """Pictures by OpenGL, and what draws."""
    from vico.render.gl.renderer import GlRenderer

    gl = GlRenderer(scene)
    return gl.device, [lambda c=c: gl.take(c, PictureRequest()) for c in singles(cameras)]


def by_mujoco(scene: Scene, cameras: Cameras) -> list[Callable[[], Any]]:
    """Pictures by MuJoCo's renderer: the same triangles without textures, colour, depth and segmentation."""
    os.environ.setdefault("MUJOCO_GL", "egl")
    import mujoco

    spec = mujoco.MjSpec()
    spec.visual.global_.offwidth = spec.visual.global_.offheight = 256
    arrays = scene.arrays
    mesh, clusters, body = arrays.mesh, arrays.clusters.span, spec.worldbody
    pieces: dict[str, Any] = {}

    def add(name: str, first: int, end: int) -> bool:
        """Add a mesh of some triangles; degenerate ones are left out."""
        if name in pieces:
            return True
        ids = mesh.triangle["vertices"][first:end]
        used, faces = np.unique(ids, return_inverse=True)
        points = mesh.vertex["position"][used].astype(np.float64)
        if len(points) < 4:
            return False
        pieces[name] = spec.add_mesh(
            name=name, uservert=points.reshape(-1), userface=faces.astype(np.int32).reshape(-1)
        )
        pieces[name].inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
        return True

    def show(name: str, transform: NDArray[Any] | None = None) -> None:
        geom = body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, contype=0, conaffinity=0)
        if transform is not None:
            quaternion = np.zeros(4)
            mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(transform[:, :3], np.float64).reshape(-1))
            geom.pos, geom.quat = transform[:, 3].astype(np.float64), quaternion

    step = 32
    for k in range(0, len(clusters), step):
        group = clusters[k : k + step]
        if add(f"static{k}", int(group["first_triangle"][0]), int(group["end_triangle"][-1])):
            show(f"static{k}")
    for i in range(int(arrays.counts["instances"])):
        model = int(arrays.instances.prototype[i])
        span = arrays.prototypes.levels[model, 0]
        if add(f"model{model}", int(span["first_triangle"]), int(span["end_triangle"])):
            show(f"model{model}", arrays.instances.matrix[i])
    for k, span in enumerate(arrays.avatars.span):
        add(f"body{k}", int(span["first_triangle"]), int(span["end_triangle"]))
        show(f"body{k}")
    for k in range(len(cameras)):
        right, down, ahead = cameras.rotation[k]
        quaternion = np.zeros(4)
        mujoco.mju_mat2Quat(quaternion, np.stack([right, -down, -ahead], axis=1).reshape(-1))
        body.add_camera(name=f"camera{k}", pos=cameras.position[k], quat=quaternion, fovy=90.0)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    renderer = mujoco.Renderer(model, 256, 256, max_geom=model.ngeom + 100)

    def take(k: int) -> None:
        renderer.update_scene(data, camera=f"camera{k}")
        renderer.render()
        renderer.enable_depth_rendering()
        renderer.render()
        renderer.disable_depth_rendering()
        renderer.enable_segmentation_rendering()
        renderer.render()
        renderer.disable_segmentation_rendering()

    return [lambda k=k: take(k) for k in range(len(cameras))]


def row(label: str, times: NDArray[np.float64], beside: float) -> str:
    """Return a line of a table."""
    low, middle, high = np.percentile(times, [5, 50, 95])
    return f"| {label} | {middle:.2f} | {low:.2f} | {high:.2f} | {middle / beside:.2f} |"


def own(scene: Scene, cameras: Cameras, frames: int, move: Callable[[int], None]) -> list[str]:
    """Return the table of this renderer alone."""
    lines = ["| picture | median ms | p5 | p95 | beside the first |", "|---|---|---|---|---|"]
    usual = PictureRequest()
    scene.lighting = DAY
    first = measured(by_request(scene, cameras, usual), frames, move)
    beside = float(np.median(first))
    lines.append(row("day: RGB, depth, segmentation", first, beside))
    for name, light in LIGHTS.items():
        scene.lighting = light
        if light is not DAY:
            lines.append(row(name, measured(by_request(scene, cameras, usual), frames, move), beside))
        fine = measured(by_request(scene, cameras, PictureRequest(quality=FINE_QUALITY)), frames, move)
        lines.append(row(f"{name}, quality fine", fine, beside))
    scene.lighting = DAY
    depth = PictureRequest(rgb=False, segmentation=False)
    lines.append(row("depth alone", measured(by_request(scene, cameras, depth), frames, move), beside))
    everything = ("rgb", "depth", "segmentation", "normals", "flow")
    times = measured(by_viewer(scene, cameras, everything, Lens()), frames, move)
    lines.append(row("with normals and flow", times, beside))
    for record in ({"projection": "fisheye"}, {"projection": "panorama", "height": 256}, {"width": 640, "height": 360}):
        lens = Lens.of(record)
        times = measured(by_viewer(scene, cameras, everything[:3], lens), frames, move)
        lines.append(row(f"{lens.projection}, {lens.width} x {lens.height}", times, beside))
    return lines


def others(scene: Scene, cameras: Cameras, frames: int) -> list[str]:
    """Return the table of all renderers on one and the same scene, in which nothing moves meanwhile."""
    lines = ["| renderer | median ms | p5 | p95 | beside the first |", "|---|---|---|---|---|"]
    first = measured(by_request(scene, cameras, PictureRequest()), frames, lambda _: None)
    beside = float(np.median(first))
    lines.append(row("cpu", first, beside))
    for name, make in (
        ("gl", lambda: by_gl(scene, cameras)),
        ("MuJoCo, without textures", lambda: ("EGL", by_mujoco(scene, cameras))),
    ):
        try:
            device, takes = make()
        except (VicoError, ImportError, AttributeError, ValueError) as error:
            print(f"{name} left out: {error}")
            continue
        lines.append(row(f"{name} ({device})", measured(takes, frames, lambda _: None), beside))
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("world", nargs="?", type=Path)
    parser.add_argument("--frames", type=int, default=3)
    parser.add_argument("--table", type=Path)
    arguments = parser.parse_args()
    head = machine()
    name, scene, points, triangles = scene_to_measure(arguments.world)
    figures = WalkingFigures([p + np.array([4.0, 0.5 * (k % 3), 0.0]) for k, p in enumerate(points[:15])])
    figures.set(scene, 0)
    cameras = street_cameras(points, 15)
    lines = ["# Renderers: processor milliseconds a picture", "", head, ""]
    lines += [f"## {name}", "", f"{triangles:,} static triangles; 256 x 256 pixels where nothing else is said.", ""]
    lines += own(scene, cameras, arguments.frames, lambda frame: figures.set(scene, frame))
    name, scene, points, triangles = scene_to_measure(None)
    figures = WalkingFigures([p + np.array([4.0, 0.5 * (k % 3), 0.0]) for k, p in enumerate(points[:15])])
    figures.set(scene, 0)
    lines += ["", f"## {name}: beside others", "", f"{triangles:,} static triangles, RGB, depth and segmentation.", ""]
    lines += others(scene, street_cameras(points, 15), arguments.frames)
    publish(lines, arguments.table)


if __name__ == "__main__":
    main()
