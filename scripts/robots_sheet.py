"""Make a contact sheet of robots at work: five kinds on a square, each doing what it is for.

python scripts/robots_sheet.py WORLD docs/images/robots.jpg
"""

import argparse
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw
from scipy.ndimage import distance_transform_edt

from vico.assets.shapes import box
from vico.render import Cameras
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.sim.pictures.scene import SceneRenderer
from vico.sim.robots import RobotPopulation
from vico.world.folder import read_world
from vico.world.walkable import SIDEWALK
from vico.world.world import World

WIDTH, HEIGHT = 448, 300
KINDS = ("husky", "manipulator", "go2", "drone", "h1")
HUSKY, MANIPULATOR, GO2, DRONE, H1 = range(5)
PARCEL = (0.14, 0.2, 0.18)
CARDBOARD, GREEN, BLUE = (186, 140, 88), (88, 128, 96), (84, 112, 150)


def main() -> None:
    """Let robots work, photograph each at its work, and put the pictures on a sheet."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("world", type=Path)
    parser.add_argument("out", type=Path)
    arguments = parser.parse_args()
    save_sheet(Day(read_world(arguments.world)).pictures(), arguments.out)


def widest_square(world: World) -> NDArray[np.float64]:
    """Return the middle of the widest piece of walkway, ENU metres."""
    walks = world.walkable
    row, column = np.unravel_index(distance_transform_edt(walks.cls == SIDEWALK).argmax(), walks.cls.shape)
    return np.array([(k + 0.5) * walks.cell - walks.half for k in (column, row)])


class Day:
    """Robots and a person on a square, and a camera that goes about."""

    def __init__(self, world: World) -> None:
        self.world, (x, y) = world, widest_square(world)
        self.middle = np.array([x, y])
        spots = ((-3.0, 0.0, 0.0), (0.0, 0.0, 0.0), (3.0, 4.5, 0.0), (4.0, -4.0, 0.0), (-5.0, 5.0, 0.0))
        places = {f"robot_{k}": (x + dx, y + dy, yaw) for k, (dx, dy, yaw) in enumerate(spots)}
        config = SimConfig(
            robots=KINDS, robot_places=places, assistants=1, cars=30, pedestrians=80, observe=(), seed=3,
            date="2026-06-15", start=15 * 3600,
        )  # fmt: skip
        self.sim = Simulation(world, None, config)
        self.sim.scenario.place_agent("assistant_0", (x + 4.5, y + 4.5), yaw=0.0)
        self.parcel = self.add(0.9, 0.2, CARDBOARD)
        for k, colour in enumerate((GREEN, BLUE)):
            self.lay_on_deck(self.add(-3.2 + 0.4 * k, 1.6, colour))
        self.renderer = SceneRenderer(self.sim)

    @property
    def robots(self) -> RobotPopulation:
        """The robots of the run."""
        robots = self.sim.state.robots
        assert isinstance(robots, RobotPopulation)
        return robots

    def add(self, east: float, north: float, colour: tuple[int, int, int]) -> int:
        """Put a parcel on the ground of the square; return its entity."""
        name = f"parcel {len(self.sim.state.objects.names)}"
        shape = [box(PARCEL, (0, 0, PARCEL[2] / 2), colour=colour)]
        at = [*(self.middle + np.array([east, north])), 0.0]
        at[2] = float(self.world.height(np.array(at)))
        return int(self.sim.scenario.add_object(name, name, shape, at, size=PARCEL))

    def lay_on_deck(self, parcel: int) -> None:
        """Have the person lay a parcel on the Husky's deck, and step back."""
        home = self.sim.state.people.position[0].copy()
        self.sim.scenario.place_agent("assistant_0", self.middle + np.array([-3.0, 1.15]), yaw=-math.pi / 2)
        husky = int(self.robots.entities[HUSKY])
        for action in ({"type": "pick", "hand": 1, "object": parcel}, {"type": "put", "hand": 1, "target": husky}):
            told = self.sim.step({"assistant_0": action}).observations["assistant_0"]["state"]
            assert told["action_status"] == "ok", told["action_reason"]
        self.sim.scenario.place_agent("assistant_0", home[:2], yaw=0.0)

    def until(self, done: Callable[[], bool], seconds: float) -> None:
        """Go on until something is so, for some seconds at most."""
        for _ in range(round(seconds * 5)):
            if done():
                return
            self.sim.advance(0.2)

    def photograph(self, target: NDArray[np.float64], back: tuple[float, float, float]) -> Image.Image:
        """Take a picture of a point from `back` of it, ENU metres."""
        eye = target + np.array(back)
        ahead = (target - eye) / np.linalg.norm(target - eye)
        camera = Cameras(np.array([eye]), np.array([ahead]), fov_y=np.radians(42.0), width=2 * WIDTH, height=2 * HEIGHT)
        picture = Image.fromarray(self.renderer.render_cameras(self.sim.state, camera, samples=2)[0])
        return picture.resize((WIDTH, HEIGHT), Image.Resampling.LANCZOS)

    def at(self, robot: int, up: float = 0.0) -> NDArray[np.float64]:
        """Return a point above a robot's base, ENU metres."""
        return self.robots.run.position(robot) + np.array([0.0, 0.0, up])

    def pictures(self) -> dict[str, Image.Image]:
        """Let them work; return a picture of each job, by what it shows."""
        robots, found = self.robots, {}
        work = robots.run.work[
            robots.scene.groups.index(next(g for g in robots.scene.groups if MANIPULATOR in g.robots))
        ]
        assert work is not None
        robots.pick(MANIPULATOR, self.parcel)
        robots.follow_body(GO2, int(self.sim.state.people.entity[0]))
        goal = self.middle + np.array([7.0, 5.0])
        robots.go_to(H1, goal)
        robots.fly_to(DRONE, self.at(DRONE) + np.array([2.0, 0.0, 5.0]))
        for _ in range(5):
            self.sim.step({"assistant_0": {"type": "move_forward", "distance": 1.0}})
        found["h1 on its way"] = self.photograph(self.at(H1, -0.1), (2.2, -2.6, 0.5))
        found["go2 follows somebody"] = self.photograph(self.at(GO2, 0.35), (-0.8, -3.6, 0.9))
        found["drone in gusts above the square"] = self.photograph(self.at(DRONE), (-2.2, -1.2, 0.9))
        self.until(lambda: int(work.arrays.stage[0]) >= 4, 40.0)
        found["manipulator picks: friction holds"] = self.photograph(self.at(MANIPULATOR, 0.35), (1.6, -2.3, 0.7))
        self.until(lambda: not work.arrays.kind[0], 30.0)
        robots.place(MANIPULATOR, int(robots.entities[HUSKY]))
        self.until(lambda: int(work.arrays.stage[0]) >= 4, 60.0)
        found["... and puts it on Husky's deck"] = self.photograph(self.at(HUSKY, 0.4), (0.9, -2.6, 1.0))
        self.until(lambda: not work.arrays.kind[0], 30.0)
        robots.stop(MANIPULATOR)
        robots.drive(HUSKY, (-0.6, 0.0, 0.3))
        self.sim.advance(3.0)
        found["husky carries three parcels"] = self.photograph(self.at(HUSKY, 0.2), (0.3, -2.5, 1.1))
        return found


def save_sheet(pictures: dict[str, Image.Image], path: Path) -> None:
    """Put pictures into rows of three, with what they show."""
    sheet = Image.new("RGB", (3 * (WIDTH + 4) - 4, -(-len(pictures) // 3) * (HEIGHT + 4) - 4), "white")
    for k, (title, picture) in enumerate(pictures.items()):
        ImageDraw.Draw(picture).text((8, 6), title, fill="white", stroke_width=2, stroke_fill="black")
        sheet.paste(picture, (k % 3 * (WIDTH + 4), k // 3 * (HEIGHT + 4)))
    sheet.save(path, quality=85)


if __name__ == "__main__":
    main()
