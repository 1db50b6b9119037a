"""Running assistant episodes: a task, a world with its people, planners that see only what they may, and a verdict."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path

from vico.agents.assistant import make_planner
from vico.agents.base import Agent
from vico.agents.gather import Gatherer
from vico.agents.schedule import followers_of
from vico.assets.models.movable import movable_kinds, movable_prototype, movable_surfaces
from vico.challenges.assistant.delivery import delivered, generate_delivery
from vico.challenges.assistant.model import StateView, Task, write_task
from vico.challenges.results import EpisodeResult, FaultLog, read_episode, write_episode, write_results
from vico.community import build_community
from vico.community.model import Community
from vico.envs import CommunityEnv, Simulation, make
from vico.version import __version__
from vico.world.folder import World

START = "08:00"
RESIDENTS = 15
# In a window of 800 m; smaller ones have as many for their size, so that the cars find room.
CARS, PEDESTRIANS = 30, 30

Progress = Callable[[str, int, int], None]


class Judge:
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
    progress: Progress | None = None,
    label: str = "episode",
) -> EpisodeResult:
    """Play one task through and judge it.

    Parameters
    ----------
    method
        Name of the planner; see `vico.agents.assistant.METHODS`.
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
    observations, infos = env.reset(seed=task.seed)
    planners: dict[str, Agent] = {
        name: make_planner(method, task.instructions(), env.public_map, seed=task.seed, number=i, of=count)
        for i, name in enumerate(names)
    }
    followers = followers_of(community, env.public_map, seed=task.seed)
    agents = Gatherer(followers | planners)
    judge, faults = Judge(task, world, env.sim.ground_truth), FaultLog()
    judge.watch(0)
    steps = 0
    while env.agents and not judge.over:
        gathered = agents.gather(observations, infos)
        observations, _, _, _, infos = env.step(gathered.actions, gathered.agent_faults)
        steps += 1
        for name, (status, reason) in gathered.agent_faults.items():
            faults.add(steps, name, status.name.lower(), reason)
        judge.watch(steps)
        for name in names:
            # Only what the simulation accepted counts as a report.
            action = gathered.actions.get(name)
            if action is None or observations[name]["state"]["action_status"] != "ok":
                continue
            if action["type"] == "task_complete":
                judge.report(int(action["index"]))
        if progress is not None:
            progress(label, steps, task.steps)
    return _result(task, method, judge, env, faults, time.perf_counter() - began)


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
    task: Task, method: str, judge: Judge, env: CommunityEnv, faults: FaultLog, seconds: float
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
        state_hash=env.state_hash(),
        fault_count=faults.count,
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
    progress: Progress | None = None,
) -> list[EpisodeResult]:
    """Generate and play `seeds` delivery episodes a world.

    Task files go to ``folder/tasks``, what each episode came to into ``folder/episodes`` as soon as it is over, and
    the results so far into ``folder/results.json`` and ``results.md``. Episodes that are there are not played again.
    """
    episodes: list[EpisodeResult] = []
    names: set[str] = set()
    for number, world in enumerate(worlds):
        community = community_for(world)
        for seed in range(seeds):
            task = generate_delivery(world, seed=seed, assistants=assistants, steps=steps)
            name = f"{number}_{world.manifest.name}_{seed}.json"
            write_task(folder / "tasks" / name, task)
            key = _key(world, task, method)
            episode = read_episode(folder / "episodes" / name, key)
            if episode is None:
                label = f"{world.manifest.name}, seed {seed}"
                episode = run_episode(world, community, task, method=method, progress=progress, label=label)
                write_episode(folder / "episodes" / name, key, episode)
            names.add(name)
            episodes.append(episode)
            write_results(folder, episodes)
    for path in (*(folder / "tasks").iterdir(), *(folder / "episodes").iterdir()):
        if path.name not in names:  # of an interrupted evaluation with other settings
            path.unlink()
    return episodes


def _key(world: World, task: Task, method: str) -> str:
    """Digest of all that decides an episode."""
    decides = {"version": __version__, "world": world.digest, "task": task.model_dump(mode="json"), "method": method}
    return sha256(json.dumps(decides, sort_keys=True).encode()).hexdigest()
