"""Robots in a city on each physics engine: what they do, how long it takes, how much memory.

    python benchmarks/physics.py WORLD [--engines mujoco,genesis] [--seconds 20] [--table benchmarks/results/physics.md]

One robot of every kind stands on the widest square of the world. Each engine runs in a process of its own: it builds
the city, the robots stand, drive, walk and fly as they are told, stop before people; then 50 people walk around them
while they follow velocities, and a second of that is timed. Then a new set of robots does what robots are for, task by
task (`robot_tasks.py`). Times are processor time of one core.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from reporting import machine, publish
from robot_tasks import Tasks, tables
from scipy.ndimage import distance_transform_edt

from vico.assets.robots import robot_names
from vico.sim.bodies.arrays import RESIDENT, Bodies
from vico.sim.physics import engine_names
from vico.sim.physics.records import COARSE, FINE
from vico.sim.robots import RobotPopulation, RobotScene
from vico.world.folder import read_world
from vico.world.walkable import SIDEWALK
from vico.world.world import World

_AVATARS, _APART = 50, 5.0
# Metres a second that each kind is told to go with.
_SPEED = {"husky": 0.8, "go2": 0.6, "h1": 0.5, "manipulator": 0.4}


def widest_square(world: World) -> np.ndarray:
    """Return the middle of the widest piece of walkway, ENU metres."""
    walks = world.walkable
    row, column = np.unravel_index(distance_transform_edt(walks.cls == SIDEWALK).argmax(), walks.cls.shape)
    return np.array([(k + 0.5) * walks.cell - walks.half for k in (column, row)])


def people_at(points: np.ndarray, velocity: np.ndarray, world: World) -> Bodies:
    """Return people of one size at points, ENU metres, shape ``(n, 2)``."""
    n, quarter = len(points), np.full(len(points), 0.25)
    position = np.column_stack([points, world.height(points)])
    entity, kind = np.arange(500, 500 + n).astype(np.int32), np.full(n, RESIDENT, np.int8)
    return Bodies(entity, kind, position, np.zeros(n), quarter, quarter, np.full(n, 1.75), velocity)


class Trial:
    """A robot of every kind on a square, on one engine."""

    def __init__(self, world: World, engine: str) -> None:
        began = time.process_time()
        self.world, self.kinds = world, tuple(robot_names())
        scene = RobotScene(world, self.kinds, packs=False, physics=engine)
        x, y = widest_square(world)
        places = [[x - 8.0, y + _APART * (k - len(self.kinds) / 2), 0.0] for k in range(len(self.kinds))]
        self.robots = RobotPopulation(world, self.kinds, places, packs=False, scene=scene)
        self.run(0.1)
        self.start = time.process_time() - began
        self.walkers = [kind for kind in self.kinds if kind in _SPEED]

    def run(self, seconds: float, people: Bodies | None = None) -> None:
        """Let time pass."""
        for _ in range(round(seconds * 10)):
            self.robots.advance(0.1, people if people is not None else Bodies.none())

    def drive(self) -> None:
        """Have all that go on the ground go ahead."""
        for kind in self.walkers:
            self.robots.drive(self.kinds.index(kind), (_SPEED[kind], 0.0, 0.0))

    def behaviour(self) -> dict[str, str]:
        """Return what they do, by what it is."""
        robots, found = self.robots, {}
        self.run(2.0)
        for k, kind in enumerate(self.kinds):
            base = robots.engine.base(k)
            ground = float(self.world.height(base.position))
            found[f"{kind} stands, base above ground, m"] = f"{base.position[2] - ground:.3f}"
        self.drive()
        if "drone" in self.kinds:
            drone = self.kinds.index("drone")
            over = robots.run.position(drone) + np.array([0.0, 0.0, 4.0])
            robots.fly_to(drone, over)
        self.run(2.0)
        before = robots.bodies().position.copy()
        self.run(3.0)
        for kind in self.walkers:
            k = self.kinds.index(kind)
            speed = np.linalg.norm(robots.bodies().position[k] - before[k]) / 3.0
            found[f"{kind} told {_SPEED[kind]} m/s goes, m/s"] = f"{speed:.3f}"
        ahead = np.array(
            [robots.bodies().position[self.kinds.index(kind), :2] + np.array([3.0, 0.0]) for kind in self.walkers]
        )
        self.run(8.0, people_at(ahead, np.zeros_like(ahead), self.world))
        for kind, point in zip(self.walkers, ahead, strict=True):
            k = self.kinds.index(kind)
            nose = robots.bodies().position[k, 0] + robots.models[k].half_length
            found[f"{kind} stops before a person, gap, m"] = f"{point[0] - 0.25 - nose:.2f}"
        if "drone" in self.kinds:
            away = np.linalg.norm(robots.run.position(drone) - over)
            found["drone hovers, off its target, m"] = f"{away:.3f}"
        return found

    def crowd(self, seconds: int) -> list[float]:
        """Return the processor time of each simulated second among people who walk in circles around the robots."""
        self.drive()
        spent, around = [], np.arange(_AVATARS)
        middle = self.robots.bodies().position[around % len(self.kinds), :2].copy()
        radius, phase = 2.0 + 0.12 * around, 2.4 * around
        for step in range(10 * seconds):
            angle = phase + 1.3 / radius * 0.1 * step
            circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
            velocity = 1.3 * np.stack([-circle[:, 1], circle[:, 0]], axis=1)
            people = people_at(middle + radius[:, None] * circle, velocity, self.world)
            began = time.process_time()
            self.robots.advance(0.1, people)
            spent.append(time.process_time() - began)
        return np.array(spent).reshape(seconds, 10).sum(axis=1).tolist()

    def frames(self, frame: float) -> float:
        """Return frames a second of the engine alone."""
        began = time.process_time()
        self.robots.engine.step(100, frame=frame)
        return 100 / (time.process_time() - began)


def child(world: Path, engine: str, seconds: int) -> dict[str, Any]:
    """Measure one engine."""
    place = read_world(world)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    trial = Trial(place, engine)
    behaviour = trial.behaviour()
    crowd = trial.crowd(seconds)
    saved = time.process_time()
    arrays = trial.robots.arrays()
    saved = time.process_time() - saved
    again = time.process_time()
    trial.robots.restore(arrays)
    again = time.process_time() - again
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    frames = {
        f"frames of {frame} s a second, the engine alone": f"{trial.frames(frame):.0f}" for frame in (COARSE, FINE)
    }
    low, middle, high = np.percentile(crowd, [10, 50, 90])
    figures = {
        f"**{len(trial.kinds)} robots, {_AVATARS} people, nobody rendering: times real time**": f"**{1 / middle:.1f}**",
        "the same, CPU ms a simulated second, median": f"{1e3 * middle:.0f}",
        "the same, 10 and 90 %": f"{1e3 * low:.0f}, {1e3 * high:.0f}",
        **frames,
        "from the world to the first step, CPU s": f"{trial.start:.1f}",
        "memory beside the world, MB, peak": f"{peak - before:.0f}",
        "snapshot / going back to it, CPU ms": f"{1e3 * saved:.1f} / {1e3 * again:.1f}",
    }
    tasks = Tasks(place, widest_square(place), engine).all()
    return {"kinds": trial.kinds, "rows": figures | behaviour, "tasks": tasks}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("world", type=Path)
    parser.add_argument("--engines", default=",".join(engine_names()))
    parser.add_argument("--seconds", type=int, default=20)
    parser.add_argument("--table", type=Path)
    parser.add_argument("--engine", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.engine:
        print(json.dumps(child(given.world, given.engine, given.seconds)))
        return
    engines, found = given.engines.split(","), {}
    for engine in engines:
        command = [sys.executable, __file__, str(given.world), "--engine", engine, "--seconds", str(given.seconds)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            sys.exit(f"{engine}: exit status {done.returncode}\n{done.stderr}")
        found[engine] = json.loads(done.stdout.splitlines()[-1])
    first = found[engines[0]]
    lines = [
        "# Physics engines side by side",
        "",
        machine(),
        f"Made by `python benchmarks/physics.py WORLD --seconds {given.seconds} --table TABLE`.",
        "",
        f"World: {read_world(given.world).manifest.name}; robots: {', '.join(first['kinds'])}, our own models.",
        "Processor time of one core, of robots with their controllers; physics knows people who are near a robot.",
        "",
        f"| | {' | '.join(engines)} |",
        "|---|" + "---|" * len(engines),
        *(f"| {name} | {' | '.join(found[engine]['rows'][name] for engine in engines)} |" for name in first["rows"]),
        "",
        "Robots at their tasks, all five on the square while one works, nobody else about. Times real time: of all",
        "five, by processor time of one core.",
        "",
        *tables({engine: found[engine]["tasks"] for engine in engines}),
    ]
    publish(lines, given.table)


if __name__ == "__main__":
    main()
