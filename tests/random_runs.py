"""Random runs in worlds: people, traffic, robots and weather drawn by chance, and all that must hold in any run."""

from __future__ import annotations

import math
import time
import traceback
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from random_windows import frame_of
from vico.agents.base import RandomAgent
from vico.agents.schedule import followers_of
from vico.community import Community, build_community
from vico.errors import EmptyInputError, VicoError
from vico.runner.gather import Gatherer
from vico.runner.loop import Hook, Runner, Step
from vico.seeds import rng
from vico.sim.config import SimConfig
from vico.sim.environment import weather_kinds
from vico.sim.loop.simulation import Simulation
from vico.world.folder import read_world
from vico.world.public import PublicMap
from vico.world.world import World

_AGAIN = 20  # steps before the end from which a run is gone through twice
_NOWHERE = 90  # steps within which a resident who is on the way gets somewhere
_SOMEWHERE = 1.5  # metres
_ROBOTS = ("husky", "go2")


@dataclass(frozen=True)
class Drawn:
    """A run as it was drawn; equal ones run equally.

    Attributes
    ----------
    world
        World folder.
    number
        Decides all the rest.
    steps
        How long it is, seconds.
    """

    world: Path
    number: int
    steps: int

    def __str__(self) -> str:
        return f"{self.world}:{self.number}:{self.steps}"

    @classmethod
    def parse(cls, text: str) -> Drawn:
        """From what `str` gives."""
        path, number, steps = text.rsplit(":", 2)
        return cls(Path(path), int(number), int(steps))

    def config(self) -> tuple[SimConfig, int]:
        """What the run is asked to be, and how large its community is."""
        random = rng(self.number, "random run")
        residents = int(random.integers(1, 40))
        by_day, any_time = int(random.integers(7, 20)) * 3600, int(random.integers(0, 24 * 60)) * 60
        config = SimConfig(
            seed=self.number,
            start=any_time if random.random() < 0.3 else by_day,
            assistants=int(random.integers(0, 4)),
            robots=tuple(random.choice(_ROBOTS, int(random.integers(0, 4))).tolist()),
            errands=True,
            cars=int(random.integers(0, 100)),
            pedestrians=int(random.integers(0, 100)),
            weather=str(random.choice([*sorted(weather_kinds()), "changing"])),
            cyclists=int(random.integers(0, 8)),
            observe=(),
        )
        return config, residents


@dataclass
class Outcome:
    """What became of a run.

    Attributes
    ----------
    state
        ``fine``, ``empty`` (nobody can live there), ``refused``, ``traceback`` or ``findings``.
    what
        The sentence, the exception, or the findings, one a line.
    notes
        What may be, but is worth a look.
    """

    drawn: Drawn
    state: str
    what: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    seconds: float = 0.0
    detail: str = ""


@lru_cache(maxsize=2)
def _world(path: Path) -> World:
    return read_world(path)


@lru_cache(maxsize=4)
def _community(path: Path, residents: int) -> Community:
    return build_community(_world(path), residents, seed=residents)


class _Watch(Hook):
    """Keeps what the last steps were, and sees who gets nowhere."""

    def __init__(self, sim: Simulation, steps: int) -> None:
        self._sim = sim
        self._from = steps - _AGAIN
        self._since: dict[str, tuple[NDArray[np.float64], int]] = {}
        self.before: Mapping[str, NDArray[Any]] = {}
        self.last: list[Step] = []
        self.nowhere: dict[str, str] = {}

    def on_step(self, step: Step) -> None:
        if step.number == self._from:
            self.before = self._sim.snapshot()
        elif step.number > self._from:
            self.last.append(step)
        for name, observation in step.result.observations.items():
            self._look(name, observation, step)

    def _look(self, name: str, observation: Mapping[str, Any], step: Step) -> None:
        """Note an avatar that wants to get on, and has not got anywhere for long."""
        here, state = np.array(observation["pose"][:2]), observation["state"]
        wanted = step.actions.get(name, {}).get("type")
        at, since = self._since.get(name, (here, step.number))
        if wanted not in ("move_forward", "turn_left", "turn_right") or math.dist(here, at) > _SOMEWHERE:
            at, since = here, step.number
        if step.number - since == _NOWHERE and name.startswith("resident"):
            where = "outdoors" if not state["room"] else state["room"]
            self.nowhere[name] = (
                f"{name} got nowhere for {_NOWHERE} s {where} at {here.round(1).tolist()}: {state['action_reason']}"
            )
        self._since[name] = (at, since)


def try_run(drawn: Drawn) -> Outcome:
    """Do a run, and hold it against what must be so in any."""
    start = time.process_time()
    outcome = Outcome(drawn, "fine")
    try:
        _try(drawn, outcome)
        if outcome.what:
            outcome.state = "findings"
    except EmptyInputError as error:
        outcome.state, outcome.what = "empty", [str(error)]
    except VicoError as error:
        outcome.state, outcome.what, outcome.detail = (
            "refused",
            [f"{type(error).__name__}: {error}"],
            traceback.format_exc(),
        )
    except Exception as error:  # any: what is looked for
        outcome.state, outcome.what, outcome.detail = "traceback", [frame_of(error)], traceback.format_exc()
    outcome.seconds = time.process_time() - start
    return outcome


def _try(drawn: Drawn, outcome: Outcome) -> None:
    config, residents = drawn.config()
    world, community = _world(drawn.world), _community(drawn.world, residents)
    sim = Simulation(world, community, config)
    sim.check_overlaps()
    followers = followers_of(community, PublicMap.from_world(world), seed=config.seed)
    others = {f"assistant_{k}": RandomAgent(f"assistant_{k}", seed=config.seed) for k in range(config.assistants)}
    watch = _Watch(sim, drawn.steps)
    runner = Runner(sim, Gatherer(followers | others, trusted=followers), hooks=[watch])
    runner.run(drawn.steps)
    told = sim.reports()
    for one in told["overlaps"]["first"]:
        where = f"{one['where']} {one['room']}, {1000 * one['depth']:.0f} mm, look {one['look']}"
        outcome.what.append(f"overlap: {one['who']} with {one['with']} at {where}")
    outcome.what += [f"fault: {name}: {count}" for name, count in runner.faults.counts.items()]
    outcome.notes += list(watch.nowhere.values())
    for kind in ("rescued", "stuck"):
        for one in told[kind]["who"]:
            outcome.notes.append(f"{kind}: {one['who']} at {one['where']} for {one['seconds']} s: {one['why']}")
    outcome.notes += [f"fallen: {name}" for name in _fallen(sim)]
    _compare(sim, watch, outcome)


def _fallen(sim: Simulation) -> list[str]:
    names = [] if sim.state.robots is None else sim.state.robots.names
    observations, _ = sim.observe(names)
    return [name for name in names if observations[name]["state"].get("fallen")]


def _compare(sim: Simulation, watch: _Watch, outcome: Outcome) -> None:
    """Go through the last steps again from a snapshot: every hash has to come again."""
    if not watch.last:
        return
    sim.restore(watch.before)
    for step in watch.last:
        if sim.step(step.actions).hash != step.result.hash:
            outcome.what.append(f"another hash at step {step.number} after going back to {step.number - _AGAIN}")
            return
