"""How people walk: on the roadway, along kerbs' edges, to and fro; and whether they meet or get stuck.

    python benchmarks/walking.py WORLD COMMUNITY [--start 08:00 17:00] [--steps 600] [--pedestrians 200] [--cars 40]
        [--table benchmarks/results/walking.md]

Residents follow their schedules; everybody outdoors on foot is looked at in every sub-step (0.1 s). *Roadway* is the
share of the metres walked below a kerb that are not on crossings, *along the edge* that of the metres on the upper side
with a kerb's edge within 0.2 m to the side. A *drop* is a pelvis that comes down by more than 8 cm within 0.2 s, a
*reversal* a velocity that turns against that of at most 0.3 s before, both above 0.5 m/s.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from crowd import ask, asked_together
from numpy.typing import NDArray
from reporting import machine, publish

from vico.agents.schedule import followers_of
from vico.clock import seconds_of_day
from vico.community import read_community
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.sim.pictures.scene import SceneRenderer
from vico.world.folder import read_world
from vico.world.public import PublicMap
from vico.world.walkable import CROSSING

_DROP, _WITHIN = 0.08, 2  # m, and in so many sub-steps
_FAST, _LOOK_BACK = 0.5, 3  # m/s, and sub-steps
_BESIDE, _KERB = 0.2, 0.05  # m to the side, and the least height of a kerb
_SUBSTEP = 0.1
_LONGEST = 0.5  # m in a sub-step: who goes further was put somewhere else


@dataclass
class Walks:
    """What is noted of everybody on foot, sub-step by sub-step.

    Attributes
    ----------
    hours
        Walked, of all people together.
    metres, roadway, edge
        Metres walked; those below kerbs and off crossings; those on top with an edge beside them.
    drops, reversals
        How often.
    """

    sim: Simulation
    poses: SceneRenderer
    hours: float = 0.0
    metres: float = 0.0
    roadway: float = 0.0
    edge: float = 0.0
    drops: int = 0
    reversals: int = 0
    examples: list[str] = field(default_factory=list)
    _pelvis: list[NDArray[np.float64]] = field(default_factory=list)
    _velocity: list[NDArray[np.float64]] = field(default_factory=list)
    _at: NDArray[np.float64] | None = None

    def note(self) -> None:
        """Look at everybody."""
        state = self.sim.state
        motion = self.poses._motion(state)
        _, offsets = self.poses._poses(motion, state.second)
        at, yaw, afoot = motion.position.copy(), motion.yaw, motion.on_ground
        before = at if self._at is None else self._at
        move = at[:, :2] - before[:, :2]
        gone = np.hypot(*move.T)
        whole = afoot & (gone < _LONGEST)
        walks = whole & (gone > 0.2 * _SUBSTEP)
        self._at = at
        pelvis = np.where(whole, at[:, 2] + offsets[:, 2], np.nan)
        velocity = np.where(whole[:, None], move / _SUBSTEP, np.nan)
        self._count_drops(pelvis, at, walks)
        self._count_reversals(velocity, at)
        self.hours += float(walks.sum()) * _SUBSTEP / 3600
        self.metres += float(gone[walks].sum())
        height, world = self.sim.world.height, self.sim.world
        here = at[walks]
        left = np.stack([-np.sin(yaw[walks]), np.cos(yaw[walks]), np.zeros(len(here))], axis=1)
        top = height.upper(here) - height(here)
        is_low = (top > _KERB) & (np.abs(height(here) - here[:, 2]) < 0.3)
        is_low &= world.walkable.class_at(here) != CROSSING
        sides = [height(here + side * _BESIDE * left) < height(here) - _KERB for side in (1.0, -1.0)]
        self.roadway += float(gone[walks][is_low].sum())
        self.edge += float(gone[walks][(sides[0] | sides[1]) & ~is_low].sum())

    def _count_drops(self, pelvis: NDArray[np.float64], at: NDArray[np.float64], walks: NDArray[np.bool_]) -> None:
        self._pelvis.append(pelvis)
        if len(self._pelvis) <= _WITHIN:
            return
        fell = walks & (self._pelvis[0] - pelvis > _DROP)
        # One drop is counted once: not while it goes on.
        fresh = fell & ~(self._pelvis[0] - self._pelvis[1] > 0.5 * _DROP)
        self.drops += int(fresh.sum())
        for i in np.flatnonzero(fresh)[:1]:
            fall = self._pelvis[0][i] - pelvis[i]
            self.examples.append(f"drop {fall:.2f} m of {i} at {at[i, :2].round(1)}, {self.sim.state.second:.1f} s")
        self._pelvis.pop(0)

    def _count_reversals(self, velocity: NDArray[np.float64], at: NDArray[np.float64]) -> None:
        fast = np.hypot(*velocity.T) > _FAST
        for old in self._velocity:
            turned = fast & (np.hypot(*old.T) > _FAST) & ((velocity * old).sum(axis=1) < 0.0)
            if turned.any():
                self.reversals += int(turned.sum())
                i = int(np.flatnonzero(turned)[0])
                self.examples.append(f"reversal of {i} at {at[i, :2].round(1)}, {self.sim.state.second:.1f} s")
                break
        self._velocity = [*self._velocity[-(_LOOK_BACK - 1) :], velocity]


def row(world_folder: Path, community_folder: Path, start: str, given: argparse.Namespace) -> str:
    """Walk for a while; return a line of the table."""
    world = read_world(world_folder)
    community = read_community(community_folder, world)
    config = SimConfig(
        start=seconds_of_day(start), seed=given.seed, cars=given.cars, pedestrians=given.pedestrians, observe=()
    )
    sim = Simulation(world, community, config)
    sim.check_overlaps()
    followers = followers_of(community, PublicMap.from_world(world), seed=config.seed)
    observations, infos = sim.observe()
    together = asked_together(followers)
    walks = Walks(sim, SceneRenderer(sim))
    checked = sim.state.on_substep
    spent = 0.0

    def look() -> None:
        nonlocal spent
        if checked is not None:
            checked()
        begun = time.process_time()
        walks.note()
        spent += time.process_time() - begun

    sim.state.on_substep = look
    begun = time.process_time()
    for _ in range(given.steps):
        step = sim.step(ask(followers, together, (observations, infos)))
        observations, infos = step.observations, step.infos
    cost = 1e3 * (time.process_time() - begun - spent) / given.steps
    reports = sim.reports()
    for line in walks.examples[: given.examples]:
        print(" ", line)
    figures = [
        start,
        f"{walks.hours:.1f}",
        f"{100 * walks.roadway / walks.metres:.1f}",
        f"{100 * walks.edge / walks.metres:.1f}",
        f"{walks.drops / walks.hours:.1f}",
        f"{walks.reversals / walks.hours:.1f}",
        f"{reports['overlaps']['count']} of {reports['overlaps']['sub_steps']}",
        str(reports["stuck"]["count"]),
        f"{cost:.1f}",
    ]
    return f"| {' | '.join(figures)} |"


def main() -> None:
    """Walk at each time of the day."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("world", type=Path)
    parser.add_argument("community", type=Path)
    parser.add_argument("--start", nargs="+", default=["08:00", "17:00"])
    parser.add_argument("--steps", type=int, default=600)
    parser.add_argument("--pedestrians", type=int, default=200)
    parser.add_argument("--cars", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--examples", type=int, default=0, help="print so many places at which something happened")
    parser.add_argument("--table", type=Path)
    given = parser.parse_args()
    lines = [
        "# How people walk",
        "",
        f"{given.pedestrians} pedestrians, {given.cars} cars, {given.steps} s, seed {given.seed}. {machine()}",
        "",
        "| start | hours walked | % of metres on the roadway | % along a kerb's edge | drops an hour walked | "
        "reversals an hour walked | overlaps in sub-steps | stuck | CPU ms a step |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for start in given.start:
        lines.append(row(given.world, given.community, start, given))
        print(lines[-1], flush=True)
    publish(lines, given.table)


if __name__ == "__main__":
    main()
