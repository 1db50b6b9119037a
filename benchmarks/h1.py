"""How H1 walks: speed, turning, stopping, pushes, kerbs, and minutes of errands in real streets.

    PYTHONPATH=tests python benchmarks/h1.py [WORLD ...] [--seconds 300] [--table benchmarks/results/h1.md]

Several robots at a time, far apart, each its own trial, on dry ground. A *push* is a force of 0.1 s on the chest, at
1.2 m, from eight directions. *Kerbs as in a world* are those of its ground, which physics has as ramps of half a metre;
*sharp* ones are boxes with vertical sides, up and down again. Errands: four robots that nobody commands go from place
to place of a world, and meet each other.
"""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from reporting import machine, publish

from robot_field import HALF, field
from vico.assets.shapes import box
from vico.sim.bodies.arrays import Bodies
from vico.sim.robots import RobotPopulation
from vico.world.folder import read_world
from vico.world.heights import HeightField, Steps
from vico.world.world import World

STEP = 0.1
NOBODY = Bodies.none()
KERBS = (0.04, 0.08, 0.12)


def team(world: World, count: int, *, x: float = -20.0, yaw: float = 0.0) -> RobotPopulation:
    """Return robots beside each other, 3 m apart and each a little further ahead, in other phases of their steps."""
    k = np.arange(count)
    places = np.column_stack([x + 0.09 * k, 3.0 * (k - (count - 1) / 2), np.full(count, yaw)])
    robots = RobotPopulation(world, ["h1"] * count, places)
    for robot in range(count):
        robots.drive(robot, (0.08 * robot, 0.0, 0.0))
    advance(robots, 0.7)
    return robots


def advance(robots: RobotPopulation, seconds: float) -> set[int]:
    """Let time pass; return who fell."""
    fallen = set()
    for _ in range(round(seconds / STEP)):
        robots.advance(STEP, NOBODY)
        fallen |= {event.robot for event in robots.events() if event.kind == "fallen"}
    return fallen


def speeds() -> list[str]:
    """Commanded and reached velocity over 10 s after 3 s."""
    lines = ["| commanded vx, vy (m/s), wz (rad/s) | reached | falls of 8 |", "|---|---|---|"]
    ahead = [(speed, 0.0, 0.0) for speed in (0.3, 0.5, 0.7, 1.0, -0.3)]
    for command in [*ahead, (0.0, 0.1, 0.0), (0.0, 0.0, 0.4), (0.0, 0.0, 0.8), (0.5, 0.0, 0.5)]:
        robots = team(field(), 8, x=-15.0)
        for robot in range(8):
            robots.drive(robot, command)
        fallen = advance(robots, 3.0)
        reached = []
        for _ in range(10):
            fallen |= advance(robots, 1.0)
            for robot in range(8):
                base = robots.engine.base(robot)
                c, s = np.cos(base.yaw), np.sin(base.yaw)
                vx, vy = base.velocity[:2]
                reached.append((c * vx + s * vy, c * vy - s * vx, base.angular_velocity_body[2]))
        mean = np.mean(reached, axis=0)
        lines.append(
            f"| {command[0]:g}, {command[1]:g}, {command[2]:g} | {mean[0]:.2f}, {mean[1]:.2f}, {mean[2]:.2f} "
            f"| {len(fallen)} |"
        )
    return lines


def stops() -> list[str]:
    """Metres and seconds from the command to stop until it stands."""
    lines = ["| from | distance | time | falls of 8 |", "|---|---|---|---|"]
    for speed in (0.5, 1.0):
        robots = team(field(), 8)
        for robot in range(8):
            robots.drive(robot, (speed, 0, 0))
        fallen = advance(robots, 5.0)
        before = robots.bodies().position[:, :2].copy()
        for robot in range(8):
            robots.stop(robot)
        way, at = np.zeros(8), np.full(8, np.nan)
        for tick in range(50):
            fallen |= advance(robots, STEP)
            way = np.maximum(way, np.linalg.norm(robots.bodies().position[:, :2] - before, axis=1))
            slow = np.linalg.norm(robots.bodies().velocity, axis=1) < 0.05
            at = np.where(slow, np.where(np.isnan(at), (tick + 1) * STEP, at), np.nan)
        lines.append(f"| {speed} m/s | {way.mean():.2f} m | {np.nanmean(at):.1f} s | {len(fallen)} |")
    return lines


def pushes() -> list[str]:
    """Share of pushes after which it is still on its feet 5 s later."""
    sizes = (10, 20, 30, 40, 50, 60, 80)
    lines = ["| push | " + " | ".join(f"{size} Ns" for size in sizes) + " |", "|---" * (len(sizes) + 1) + "|"]
    for name, command in (("standing", (0, 0, 0)), ("walking at 0.6 m/s", (0.6, 0, 0))):
        shares = []
        for size in sizes:
            survived = 0
            for delay in (4.0, 4.2):
                robots = team(field(), 8)
                for robot in range(8):
                    robots.drive(robot, command)
                advance(robots, delay)
                for robot in range(8):
                    shove(robots, robot, size / 0.1, robot * np.pi / 4)
                advance(robots, STEP)
                for robot in range(8):
                    shove(robots, robot, 0.0, 0.0)
                survived += 8 - len(advance(robots, 5.0))
            shares.append(f"{survived / 16:.0%}")
        lines.append(f"| {name} | " + " | ".join(shares) + " |")
    return lines


def shove(robots: RobotPopulation, robot: int, newtons: float, angle: float) -> None:
    """Push a robot's chest from now on, towards an angle of the world."""
    rotation = robots.engine.base(robot).rotation
    force = rotation.T @ (newtons * np.array([np.cos(angle), np.sin(angle), 0.0]))
    robots.engine.thrust(robot, ["chest"], force[None])


def kerb(rise: float) -> HeightField:
    """Return level ground with kerbs between x = -12 and -6 m, as worlds have them."""
    n = round(2 * HALF / 0.5) + 1
    x = np.broadcast_to(np.linspace(-HALF, HALF, n), (n, n))
    inside = np.minimum(x + 12.0, -6.0 - x)
    edge = np.clip(np.rint(inside * 127), -127, 127).astype(np.int8)
    steps = Steps(edge, np.zeros((n, n), np.int16), np.full((n, n), round(1000 * rise), np.int16))
    return HeightField(np.zeros((2, 2), np.float32), HALF, steps)


def sharp(rise: float) -> World:
    """Return level ground with a platform of vertical sides from x = -12 to -6 m."""
    world = field()
    world._layers["collision"] = [box((6.0, 60.0, 0.3), (-9.0, 0.0, rise - 0.15))]
    return world


def kerbs() -> list[str]:
    """Share of those who come up a kerb and down another on their feet."""
    lines = ["| kerb | " + " | ".join(f"{rise * 100:.0f} cm" for rise in KERBS) + " |", "|---" * (len(KERBS) + 1) + "|"]
    for name, make in (("as in a world", lambda rise: field(height=kerb(rise))), ("sharp", sharp)):
        for speed in (0.5, 0.8):
            shares = []
            for rise in KERBS:
                over = 0
                for start, yaw in ((-15.0, 0.0), (-15.2, 0.35)):
                    robots = team(make(rise), 8, x=start, yaw=yaw)
                    for robot in range(8):
                        robots.drive(robot, (speed, 0, 0))
                    fallen = advance(robots, 14.0 / speed)
                    through = set(np.flatnonzero(robots.bodies().position[:, 0] > -5.0).tolist())
                    over += len(through - fallen)
                shares.append(f"{over / 16:.0%}")
            lines.append(f"| {name}, {speed} m/s | " + " | ".join(shares) + " |")
    return lines


def errands(folder: Path, seconds: float) -> str:
    """Return a row about robots on errands of their own in a world."""
    robots = RobotPopulation(read_world(folder), ["h1"] * 4, seed=7, errands=True)
    kinds: Counter[str] = Counter()
    way: NDArray[np.float64] = np.zeros(4)
    last = robots.bodies().position[:, :2].copy()
    for _ in range(round(seconds / STEP)):
        robots.advance(STEP, NOBODY)
        kinds.update(event.kind for event in robots.events())
        here = robots.bodies().position[:, :2]
        way += np.linalg.norm(here - last, axis=1)
        last = here.copy()
    return (
        f"| {folder.name} | {seconds / 60:.0f} min x 4 | {way.sum():.0f} m | {kinds['arrived']} | {kinds['blocked']} "
        f"| {kinds['fallen']} |"
    )


def main() -> None:
    """Measure and report."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("worlds", type=Path, nargs="*")
    parser.add_argument("--seconds", type=float, default=300.0, help="of errands in each world")
    parser.add_argument("--table", type=Path)
    given = parser.parse_args()
    lines = ["# How H1 walks", "", machine(), "", "## Speed", "", *speeds(), "", "## Stopping", "", *stops()]
    lines += ["", "## Pushes survived", "", *pushes(), "", "## Kerbs, up and down", "", *kerbs()]
    if given.worlds:
        lines += ["", "## Errands", "", "| world | time | way | arrived | blocked | fallen |", "|---" * 6 + "|"]
        lines += [errands(folder, given.seconds) for folder in given.worlds]
    publish(lines, given.table)


if __name__ == "__main__":
    main()
