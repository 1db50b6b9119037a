"""Running assistant episodes: a task, a world with its people, planners that see only what they may, and a verdict."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import Any

from vico.agents.assistant import METHODS, make_planner
from vico.agents.base import Agent
from vico.agents.schedule import followers_of
from vico.agents.wrappers import usage_of
from vico.assets.models.movable import movable_kinds, movable_prototype, movable_surfaces
from vico.challenges.assistant.delivery import delivered, generate_delivery
from vico.challenges.assistant.model import StateView, Task, write_task
from vico.challenges.results import EpisodeResult, read_episode, write_episode, write_results
from vico.community import build_community
from vico.community.model import Community
from vico.envs import Simulation, make
from vico.errors import InputError
from vico.runner.faults import FaultLog
from vico.runner.foreign import AbsentAgent, Terms, foreign_agents
from vico.runner.gather import Gatherer
from vico.runner.loading import AgentSeat, source_digest
from vico.runner.loop import Hook, Runner, Step
from vico.version import __version__
from vico.world.folder import World
from vico.world.public import PublicMap

START = "08:00"
RESIDENTS = 15
# In a window of 800 m; smaller ones have as many for their size, so that the cars find room.
CARS, PEDESTRIANS = 30, 30

Progress = Callable[[str, int, int], None]


class Judge(Hook):
    """Keeps the verdicts of one episode.

    A subtask is judged once and for all when an assistant reports it (`task_complete`), or else at the episode's end.
    `done_at` tells when what was judged a success had last become true.
    """

    def __init__(self, task: Task, world: World, state: StateView) -> None:
        self.task, self.world, self.state = task, world, state
        # The simulation knows things by the names agents hear; the rule by their ids.
        names = {thing.id: thing.name for thing in task.objects}
        self._subtasks = [s.model_copy(update={"objects": [names[i] for i in s.objects]}) for s in task.subtasks]
        self.verdicts: list[bool | None] = [None] * len(task.subtasks)
        self.since: list[int | None] = [None] * len(task.subtasks)

    def stepped(self, step: Step) -> None:
        """Look at the state after a step, and take the reports that were made in it."""
        self.watch(step.number)
        for name, action in step.actions.items():
            # Only what the simulation accepted counts as a report.
            if action.get("type") != "task_complete" or not name.startswith("assistant_"):
                continue
            seen = step.result.observations.get(name)
            if seen is not None and seen["state"]["action_status"] == "ok":
                self.report(int(action["index"]))

    def watch(self, step: int) -> None:
        """Look at the state after a step."""
        for k, subtask in enumerate(self._subtasks):
            if self.verdicts[k] is None:
                done = delivered(subtask, self.state, self.world)
                self.since[k] = (self.since[k] if self.since[k] is not None else step) if done else None

    def report(self, index: int) -> None:
        """Take an assistant's word that a subtask is done."""
        if 0 <= index < len(self.verdicts) and self.verdicts[index] is None:
            self.verdicts[index] = self.since[index] is not None

    @property
    def over(self) -> bool:
        """Whether everything was reported."""
        return None not in self.verdicts

    def final(self) -> list[bool]:
        """Verdicts, with what nobody reported judged as it stands."""
        return [since is not None if v is None else v for v, since in zip(self.verdicts, self.since, strict=True)]


def community_for(world: World, *, residents: int = RESIDENTS) -> Community:
    """People among whom episodes of a world take place: always the same ones."""
    return build_community(world, residents=residents, seed=0)


def run_episode(
    world: World,
    community: Community,
    task: Task,
    *,
    method: str,
    terms: Terms | None = None,
    progress: Progress | None = None,
    label: str = "episode",
) -> EpisodeResult:
    """Play one task through and judge it.

    Parameters
    ----------
    method
        Name of the planner (see `vico.agents.assistant.METHODS`), or ``my_module:MyPlanner``.
    terms
        On which terms planners from elsewhere take part.
    progress
        Called with `label`, the step and the limit.
    """
    began = time.perf_counter()
    count = len(task.assistants)
    names = [f"assistant_{i}" for i in range(count)]
    env = make(
        world,
        community,
        seed=task.seed,
        start=START,
        assistants=count,
        cars=_for_size(CARS, world),
        pedestrians=_for_size(PEDESTRIANS, world),
        observe=tuple(names),
        max_steps=task.steps,
        setup=lambda simulation: _set_up(simulation, task),
    )
    sim = env.sim
    terms = terms or Terms()
    planners = _planners(method, names, task, world, terms)
    followers = followers_of(community, env.public_map, seed=task.seed)
    judge = Judge(task, world, sim.ground_truth)
    judge.watch(0)
    hooks: list[Hook] = [judge]
    if progress is not None:
        hooks.append(_Reported(progress, label, task.steps))
    agents = Gatherer(followers | planners, trusted=followers, deadline=terms.deadline, workers=terms.workers)
    runner = Runner(sim, agents, hooks=hooks)
    try:
        runner.run(task.steps, until=lambda: judge.over)
    finally:
        agents.close()
    return _result(task, method, judge, sim, runner.faults, list(planners.values()), time.perf_counter() - began)


class _Reported(Hook):
    """Tells how far an episode is."""

    def __init__(self, progress: Progress, label: str, steps: int) -> None:
        self._progress, self._label, self._steps = progress, label, steps

    def stepped(self, step: Step) -> None:
        """Tell it."""
        self._progress(self._label, step.number, self._steps)


def _planners(method: str, names: list[str], task: Task, world: World, terms: Terms) -> dict[str, Agent]:
    """Make the planners of an episode; those that can't be made fail at each of its steps."""
    told, of = task.instructions(), len(names)
    if method in METHODS:
        public_map = PublicMap.from_world(world)
        return {
            name: make_planner(method, told, public_map, seed=task.seed, number=i, of=of)
            for i, name in enumerate(names)
        }
    made: dict[str, Agent] = {}
    for i, name in enumerate(names):
        seat = AgentSeat(name, task.seed, told, i, of)
        try:
            made |= foreign_agents(method, [seat], world, terms)
        except InputError as error:
            made[name] = AbsentAgent(str(error))
    return made


def _for_size(number: int, world: World) -> int:
    return min(number, round(number * (world.half / 400.0) ** 2))


def _set_up(simulation: Simulation, task: Task) -> None:
    for thing in task.objects:
        simulation.scenario.add_object(
            thing.name,
            movable_prototype(thing.kind, thing.colour),
            movable_surfaces(thing.kind, thing.colour),
            thing.position,
            room=thing.room or "",
            size=movable_kinds()[thing.kind].size,
            yaw=thing.yaw,
        )
    for i, start in enumerate(task.assistants):
        simulation.scenario.place_agent(f"assistant_{i}", (*start.position, 0.0), yaw=start.yaw)


def _result(
    task: Task, method: str, judge: Judge, sim: Simulation, faults: FaultLog, planners: list[Agent], seconds: float
) -> EpisodeResult:
    success = judge.final()
    done_at = [since if ok else None for ok, since in zip(success, judge.since, strict=True)]
    finished = [step for step in done_at if step is not None]
    return EpisodeResult(
        world=task.world,
        seed=task.seed,
        category=task.category,
        method=method,
        assistants=len(task.assistants),
        success=success,
        done_at=done_at,
        steps=max(finished) if all(success) else task.steps,
        limit=task.steps,
        wall_seconds=seconds,
        state_hash=sim.state_hash(),
        tokens=sum(usage_of(planner).tokens for planner in planners),
        cost=sum(usage_of(planner).cost for planner in planners),
        fault_counts=faults.by_kind(),
        faults=faults.first,
    )


def evaluate(
    worlds: list[World],
    *,
    method: str,
    assistants: int,
    seeds: int,
    steps: int,
    folder: Path,
    terms: Terms | None = None,
    progress: Progress | None = None,
) -> list[EpisodeResult]:
    """Generate and play `seeds` delivery episodes a world.

    Task files go to ``folder/tasks``, what each episode came to into ``folder/episodes`` as soon as it is over, and
    the results so far into ``folder/results.json`` and ``results.md``. Episodes that are there are not played again.
    """
    terms = terms or Terms()
    episodes: list[EpisodeResult] = []
    names: set[str] = set()
    for number, world in enumerate(worlds):
        community = community_for(world)
        for seed in range(seeds):
            task = generate_delivery(world, seed=seed, assistants=assistants, steps=steps)
            name = f"{number}_{world.manifest.name}_{seed}.json"
            write_task(folder / "tasks" / name, task)
            key = _key(world, task, method, terms)
            episode = read_episode(folder / "episodes" / name, key)
            if episode is None:
                label = f"{world.manifest.name}, seed {seed}"
                episode = run_episode(
                    world, community, task, method=method, terms=terms, progress=progress, label=label
                )
                write_episode(folder / "episodes" / name, key, episode)
            names.add(name)
            episodes.append(episode)
            write_results(folder, episodes)
    for path in (*(folder / "tasks").iterdir(), *(folder / "episodes").iterdir()):
        if path.name not in names:  # of an interrupted evaluation with other settings
            path.unlink()
    return episodes


def _key(world: World, task: Task, method: str, terms: Terms) -> str:
    """Digest of all that decides an episode."""
    decides: dict[str, Any] = {
        "version": __version__,
        "world": world.digest,
        "task": task.model_dump(mode="json"),
        "method": method,
    }
    if method not in METHODS:
        decides |= {"source": source_digest(method), "terms": [terms.deadline, terms.isolate, terms.memory]}
    return sha256(json.dumps(decides, sort_keys=True).encode()).hexdigest()
