"""A fountain in a square of a city: water computed by Genesis, filmed in the city by our own renderer.

Genesis is an extra: pip install -e '.[genesis]'

python examples/09_fountain.py --world out/demo/world --seconds 8 --out fountain.mp4
"""

import argparse
import importlib.util
from pathlib import Path

import numpy as np
from scipy.ndimage import distance_transform_edt, gaussian_filter

from vico.assets.shapes import ball, box, cylinder, lathe
from vico.render.cameras import Cameras
from vico.render.film import FilmWriter
from vico.render.frames import render
from vico.render.lighting import Lighting
from vico.render.world_scene import scene_of
from vico.world.folder import read_world
from vico.world.walkable import SIDEWALK

#: Side and depth of the water at first, and diameter of its particles, metres.
SIDE, DEPTH, GRAIN = 3.6, 0.26, 0.06
#: How high the basin's floor and rim lie above the ground, metres.
FLOOR, RIM = 0.12, 0.52
#: Pictures a second; steps of 1/120 s, solved in four.
RATE, STEPS, SUBSTEPS = 30, 120, 4
STONE, DARK, SPRAY = (178, 172, 160), (64, 82, 88), (226, 238, 246)


def jets() -> list[tuple[tuple[float, ...], tuple[float, ...], float, float, int]]:
    """Where each jet leaves, its direction, m/s, width in metres, and how many particles the pump lets it have."""
    found = [((0.0, 0.0, 0.9), (0.0, 0.0, 1.0), 5.2, 0.14, 2200)]
    for k in range(8):
        c, s = np.cos(k * np.pi / 4), np.sin(k * np.pi / 4)
        found.append(((1.45 * c, 1.45 * s, 0.36), (-0.38 * c, -0.38 * s, 1.0), 4.2, 0.07, 420))
    return found


def flow(seconds: float, settle: float) -> list[np.ndarray]:
    """Return the water in each picture: its particles' places, metres from the middle of the basin's floor, and m/s.

    Returns
    -------
    list of ndarray
        float32, shape ``(n, 6)``; nan for what the pump still holds.
    """
    import genesis as gs

    gs.init(backend=gs.cpu, precision="32", logging_level="error")
    half = SIDE / 2
    scene = gs.Scene(
        sim_options=gs.options.SimOptions(dt=1 / STEPS, substeps=SUBSTEPS, gravity=(0.0, 0.0, -9.81)),
        sph_options=gs.options.SPHOptions(
            lower_bound=(-half, -half, 0.0), upper_bound=(half, half, 4.0), particle_size=GRAIN
        ),
        show_viewer=False,
    )
    water, seen = gs.materials.SPH.Liquid(mu=0.02, gamma=0.02), gs.surfaces.Default(vis_mode="particle")
    low, high = (GRAIN - half, GRAIN - half, GRAIN), (half - GRAIN, half - GRAIN, DEPTH)
    scene.add_entity(material=water, morph=gs.morphs.Box(lower=low, upper=high), surface=seen)
    pumps = [(scene.add_emitter(material=water, max_particles=jet[-1], surface=seen), *jet[:-1]) for jet in jets()]
    scene.build()
    pictures = []
    for step in range(round((settle + seconds) * STEPS)):
        for pump, place, direction, speed, width in pumps:
            pump.emit(droplet_shape="circle", droplet_size=width, pos=place, direction=direction, speed=speed)
        scene.step()
        if step >= settle * STEPS and step % (STEPS // RATE) == 0:
            parts = scene.sim.sph_solver.entities
            places = np.concatenate([e.get_particles_pos().numpy().reshape(-1, 3) for e in parts])
            speeds = np.concatenate([e.get_particles_vel().numpy().reshape(-1, 3) for e in parts])
            held = np.abs(places).max(axis=1) > 10.0  # far away
            pictures.append(np.where(held[:, None], np.nan, np.hstack([places, speeds])).astype(np.float32))
    return pictures


def basin() -> list:
    """Return a square basin of stone with nozzles in it, standing on the ground."""
    outer, wall = SIDE + 0.6, 0.3
    found = [box((SIDE, SIDE, FLOOR), (0, 0, FLOOR / 2), colour=DARK)]
    for along in (-1, 1):
        middle = along * (SIDE + wall) / 2
        for size, place in (((wall, outer), (middle, 0)), ((SIDE, wall), (0, middle))):
            found.append(box((*size, RIM), (*place, RIM / 2), colour=STONE))
            found.append(box((size[0] + 0.08, size[1] + 0.08, 0.06), (*place, RIM + 0.03), colour=(196, 190, 178)))
    column = [(0.0, 0.0), (0.34, 0.0), (0.24, 0.12), (0.14, 0.3), (0.12, 0.66), (0.2, 0.78), (0.1, 0.88), (0.0, 0.88)]
    found.append(lathe(column, sides=20, colour=STONE, centre=(0, 0, FLOOR)))
    for place, *_ in jets()[1:]:
        found.append(cylinder(0.035, 0.34, colour=(96, 88, 72), centre=(place[0], place[1], FLOOR)))
    return found


class Water:
    """Turns particles into what is drawn: the surface in the basin, and drops above it.

    Parameters
    ----------
    place
        Middle of the basin's floor, ENU metres.
    """

    CELLS, DROPS = 56, 6

    def __init__(self, place: np.ndarray) -> None:
        self.place, n = place, self.CELLS
        self.axis = np.linspace(-SIDE / 2, SIDE / 2, n)
        corner = np.arange(n * n).reshape(n, n)
        a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]
        faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
        self.faces, self.entity = faces.astype(np.int32), np.ones(n * n, np.int32)
        self.height = np.full((n, n), DEPTH)
        # A particle is drawn as some drops, spread over it, and over its way in half a picture's time.
        self.spread = np.random.default_rng(1).normal(0.0, 0.3 * GRAIN, (997, self.DROPS, 3))
        self.sizes = np.random.default_rng(2).uniform(0.5, 1.1, (997, self.DROPS))

    def draw(self, scene, points: np.ndarray) -> None:
        """Put the water of one picture, as `flow` returns it, into a scene."""
        n, cell = self.CELLS, SIDE / (self.CELLS - 1)
        number = np.flatnonzero(np.isfinite(points[:, 0]))
        points, speeds = points[number, :3], points[number, 3:]
        low = points[points[:, 2] < 0.5]
        row, column = self._cells(low)
        level = float(np.percentile(low[:, 2], 85)) + GRAIN / 2
        top = np.full((n, n), -np.inf)
        np.maximum.at(top, (row, column), low[:, 2] + GRAIN / 2)
        top[~np.isfinite(top)] = level
        rough = np.clip(top - level, -0.08, 0.12)
        waves = gaussian_filter(rough, 1.6)
        # Particles flicker from picture to picture where water does not.
        self.height += 0.6 * (level + waves - self.height)
        gy, gx = np.gradient(self.height, cell)
        normals = np.stack([-gx, -gy, np.ones_like(gx)], axis=-1)
        normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
        x, y = np.meshgrid(self.axis, self.axis)
        vertices = np.stack([x, y, self.height], axis=-1).reshape(-1, 3) + self.place
        foam = np.clip(gaussian_filter(np.abs(rough - waves), 1.2) * 22.0 - 0.1, 0.0, 1.0)[..., None]
        colour = (np.array([62, 104, 118]) * (1 - foam) + np.array(SPRAY) * foam).astype(np.uint8).reshape(-1, 3)
        flat = normals.reshape(-1, 3).astype(np.float32)
        scene.set_skinned(vertices.astype(np.float32), flat, self.faces, colour, self.entity)
        flying = points[:, 2] > self.height[self._cells(points)] + 0.03
        pick = number[flying] % len(self.spread)
        late = (np.arange(self.DROPS) / self.DROPS - 0.5) * 0.5 / RATE
        drops = points[flying, None] + self.spread[pick] + speeds[flying, None] * late[:, None]
        transforms = np.zeros((drops.shape[0] * self.DROPS, 4, 4))
        transforms[:, [0, 1, 2], [0, 1, 2]] = self.sizes[pick].reshape(-1, 1)
        transforms[:, :3, 3], transforms[:, 3, 3] = drops.reshape(-1, 3) + self.place, 1.0
        names = np.full(len(transforms), scene.names["drop"], np.int32)
        scene.set_rigid(names, transforms, np.full(len(transforms), 2, np.int32))

    def _cells(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Row and column of the surface's grid that points lie over."""
        cells = np.clip(np.round((points[:, :2] / SIDE + 0.5) * (self.CELLS - 1)), 0, self.CELLS - 1).astype(int)
        return cells[:, 1], cells[:, 0]


def open_square(world, within: float = 200.0) -> np.ndarray:
    """Return the middle of the widest piece of walkway near the middle of a world, ENU metres."""
    walks = world.walkable
    room = distance_transform_edt(walks.cls == SIDEWALK)
    rows, columns = np.indices(room.shape)
    away = np.hypot(rows - walks.n / 2, columns - walks.n / 2) * walks.cell
    cell = np.unravel_index(np.where(away < within, room, 0.0).argmax(), room.shape)
    x, y = ((index + 0.5) * walks.cell - walks.half for index in (cell[1], cell[0]))
    return np.array([x, y, float(world.height(np.array([x, y])))])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--world", type=Path, required=True)
    parser.add_argument("--out", type=Path, default=Path("fountain.mp4"))
    parser.add_argument("--seconds", type=float, default=8.0)
    parser.add_argument("--settle", type=float, default=2.0, help="seconds of water before the film begins")
    parser.add_argument("--width", type=int, default=960)
    arguments = parser.parse_args()
    if importlib.util.find_spec("genesis") is None:
        raise SystemExit("the fountain's water is computed by Genesis: pip install -e '.[genesis]'")

    world = read_world(arguments.world)
    square = open_square(world)
    print(f"a fountain at {square.round(1).tolist()}")
    pictures = flow(arguments.seconds, arguments.settle)
    print(f"{len(pictures)} pictures of {len(pictures[0])} particles")

    drop = ball((0.34 * GRAIN,) * 3, colour=SPRAY, sides=6, rings=3)
    models = {"basin": basin(), "drop": [drop]}
    scene = scene_of(world, rooms=False, prototypes=models, lighting=Lighting.at(15.5 * 3600, lat=60.0, clouds=0.3))
    frame = np.eye(4)
    frame[:3, 3] = square
    scene.place(["basin"], frame[None], [3])
    water = Water(square + np.array([0.0, 0.0, FLOOR]))
    size = arguments.width, arguments.width * 9 // 16 // 2 * 2
    with FilmWriter(arguments.out, rate=RATE, crf=20) as film:
        for k, points in enumerate(pictures):
            water.draw(scene, points)
            turn = np.radians(-115.0 + 3.0 * k / RATE)
            eye = square + np.array([7.4 * np.cos(turn), 7.4 * np.sin(turn), 2.3])
            look = square + np.array([0.0, 0.0, 1.15]) - eye
            camera = Cameras(eye, look, fov_y=0.72, width=size[0], height=size[1])
            film.add(render(scene, camera, depth=False, segmentation=False, samples=2).rgb[0])
    print(f"{arguments.out}: {film.frames} pictures, {film.frames / RATE:.1f} s")


if __name__ == "__main__":
    main()
