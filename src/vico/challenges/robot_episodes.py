"""Episodes of challenges of robots: how a job becomes a task that is drawn, set up, played and judged.

Things that are set up, agents from elsewhere, progress, verdicts and records are the same in all of them.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Generic, NamedTuple, Protocol, TypeVar

from vico.agents.base import Agent
from vico.assets.models.movable import movable_kinds, movable_prototype, movable_surfaces
from vico.challenges.assistant.challenge import CARS, PEDESTRIANS
from vico.challenges.assistant.tasks import Start, TaskObject
from vico.challenges.episode_record import episode_record
from vico.challenges.episodes import for_size
from vico.challenges.records import EpisodeRecord, Job, Metric, Part, Progress, Setting
from vico.challenges.robot_tasks import PlacedTask
from vico.community import build_community
from vico.community.model import Community
from vico.envs import CommunityEnv, Simulation, make
from vico.errors import InputError
from vico.runner.foreign import AbsentAgent, Terms, foreign_agents
from vico.runner.gather import Gatherer
from vico.runner.loading import AgentSeat
from vico.runner.loop import Hook, Runner, Step
from vico.runner.recording import RecordedOnce, recorded_in
from vico.world.folder import kept_world
from vico.world.world import World


@lru_cache(maxsize=2)
def world_and_people(folder: Path, residents: int) -> tuple[World, Community]:
    """Read a world, and make the people among whom its episodes take place: always the same ones."""
    world = kept_world(folder)
    return world, build_community(world, residents=residents, seed=0)


def make_episode_env(
    world: World,
    community: Community,
    task: PlacedTask,
    *,
    team: Mapping[str, tuple[str, Start]],
    period: float,
    setup: Callable[[Simulation], None],
    oracle_grasp: bool = False,
) -> CommunityEnv:
    """Make what an episode takes place in: the world of a task with its people, traffic and robots.

    Parameters
    ----------
    team
        Model and start of each robot, by its name, in order.
    period
        Seconds between two actions of a robot.
    setup
        Puts things and people where they are at the start.
    """
    return make(
        world,
        community,
        seed=task.seed,
        start=task.start,
        robots=tuple(model for model, _ in team.values()),
        robot_places={name: (*start.position, start.yaw) for name, (_, start) in team.items()},
        cars=for_size(CARS, world),
        pedestrians=for_size(PEDESTRIANS, world),
        observe=tuple(team),
        periods=dict.fromkeys(team, period),
        oracle_grasp=oracle_grasp,
        max_steps=round(task.steps / min(period, 1.0)),
        setup=setup,
    )


def place_waiting(simulation: Simulation, name: str, waits: Start) -> None:
    """Put somebody where they wait."""
    simulation.scenario.place_agent(name, (*waits.position, 0.0), yaw=waits.yaw)


def put_thing(simulation: Simulation, thing: TaskObject) -> None:
    """Put a thing of a task where it is at the start: into somebody's hand, or where it lies.

    Raises
    ------
    InputError
        If there is no room for it there.
    """
    kind = movable_kinds()[thing.kind]
    shape, prototype = movable_surfaces(kind.kind, thing.colour), movable_prototype(kind.kind, thing.colour)
    if thing.holder is not None:
        simulation.scenario.hand_object(thing.name, prototype, shape, thing.holder, size=kind.size)
        return
    simulation.scenario.add_object(
        thing.name, prototype, shape, thing.position, room=thing.room or "", size=kind.size, yaw=thing.yaw
    )


def foreign_robots(
    method: str, names: Sequence[str], told: Mapping[str, Any], world: World, terms: Terms, *, seed: int
) -> dict[str, Agent]:
    """Make the robots of an episode by ``my_module:MyRobot``; those that can't be made fail at each of its steps."""
    made: dict[str, Agent] = {}
    for i, name in enumerate(names):
        try:
            made |= foreign_agents(method, [AgentSeat(name, seed, [dict(told)], i, len(names))], world, terms)
        except InputError as error:
            made[name] = AbsentAgent(str(error))
    return made


class ReportedSeconds(Hook):
    """Tells how far an episode is whose steps are not seconds.

    Parameters
    ----------
    label
        Under which it is told.
    limit
        Seconds at most.
    """

    def __init__(self, progress: Progress, sim: Simulation, *, label: str, limit: int) -> None:
        self._progress, self._label = progress, label
        self._sim, self._limit, self._start = sim, limit, sim.state.second

    def on_step(self, step: Step) -> None:
        """Tell it."""
        self._progress(self._label, int(self._sim.state.second - self._start), self._limit)


def play_out(
    runner: Runner, agents: Gatherer, *, over: Callable[[], bool], seconds: int, period: float, recording: Path | None
) -> None:
    """Let an episode go on until it is over, or its time is; in the end its agents are let go.

    Parameters
    ----------
    over
        Says whether there is a verdict.
    period
        Seconds between two actions of a robot.
    recording
        Folder to which the run is recorded; None records nothing.
    """
    sim = runner.sim
    with ExitStack() as stack:
        stack.callback(agents.close)
        if recording is not None:
            recorded: RecordedOnce = stack.enter_context(
                recorded_in(recording, sim, runner.faults, wanted=round(seconds / period))
            )
            runner.hooks.append(recorded)
        end = sim.state.second + seconds
        runner.run(100 * seconds, until=lambda: over() or sim.state.second >= end)


class Verdict(NamedTuple):
    """What came of an episode: figures by the keys of its metrics, and the one part that it has."""

    metrics: dict[str, float]
    part: Part


def verdict_on(name: str, done_at: float | None, cause: str, limit: int, more: Mapping[str, float]) -> Verdict:
    """Return the verdict on what was asked for.

    Parameters
    ----------
    done_at
        Second at which it was done; None if it was not: then Ts is the limit.
    cause
        Why not; "" if it was.
    more
        Figures beside SR and Ts.
    """
    done = done_at is not None
    metrics = {"SR": 100.0 if done else 0.0, "Ts": float(limit if done_at is None else min(done_at, limit))}
    return Verdict(metrics | dict(more), Part(name, done, cause, None if done_at is None else int(done_at)))


def record_of(
    task: PlacedTask,
    runner: Runner,
    robots: Mapping[str, Agent],
    verdict: Verdict,
    *,
    challenge: str,
    method: str,
    setting: Setting,
    wall_seconds: float,
) -> EpisodeRecord:
    """Condense an episode that was played out."""
    sim, faults = runner.sim, runner.faults
    return episode_record(
        task,
        sim,
        faults,
        robots.values(),
        judged=(verdict.metrics, [verdict.part]),
        of=(challenge, method, dict(setting) | {"steps": task.steps}),
        wall_seconds=wall_seconds,
    )


Category = TypeVar("Category", bound=str)
Task = TypeVar("Task", bound=PlacedTask)
# As parameters and results of what a challenge brings along.
DrawnCategory = TypeVar("DrawnCategory", bound=str, contravariant=True)
DrawnTask = TypeVar("DrawnTask", bound=PlacedTask, covariant=True)
PlayedTask = TypeVar("PlayedTask", bound=PlacedTask, contravariant=True)


class TaskDrawer(Protocol[DrawnCategory, DrawnTask]):
    """Makes one episode's task."""

    def __call__(
        self, world: World, community: Community, category: DrawnCategory, *, seed: int, steps: int
    ) -> DrawnTask:
        """Return it."""


class TaskPlayer(Protocol[PlayedTask]):
    """Plays one task through and judges it."""

    def __call__(
        self,
        world: World,
        community: Community,
        task: PlayedTask,
        *,
        method: str,
        setting: Setting | None,
        terms: Terms | None,
        recording: Path | None,
        progress: Progress | None,
    ) -> EpisodeRecord:
        """Return what came of it."""


@dataclass(frozen=True)
class RobotsChallenge(Generic[Category, Task]):
    """A challenge of robots; see `vico.challenges.episodes` for how it is played.

    Attributes
    ----------
    residents
        People who live in its worlds.
    steps, period, periods
        Unless a setting says otherwise: seconds at most, and between two actions of a robot; bounds of that.
    settings
        Of a job, beside ``steps`` and ``period``.
    told_settings
        Those of them that are told to whoever gives another one.
    columns, failures
        By category.
    """

    name: str
    categories: Sequence[Category]
    methods: Sequence[str]
    residents: int
    steps: int
    period: float
    periods: tuple[float, float]
    columns: Mapping[Category, Sequence[Metric]]
    failures: Mapping[Category, Sequence[str]]
    draw_task: TaskDrawer[Category, Task]
    play_task: TaskPlayer[Task]
    settings: Collection[str] = ()
    told_settings: str = "steps and period"

    def metrics(self, category: str) -> Sequence[Metric]:
        """Columns of a category's table; Ts counts failures as the limit."""
        return self.columns[self._category(category)]

    def causes(self, category: str) -> Sequence[str]:
        """All causes that a failure may have."""
        return self.failures[self._category(category)]

    def task(self, job: Job) -> Mapping[str, object]:
        """Return the task of an episode, as JSON.

        Raises
        ------
        InputError
            If there is no such category or setting, or the world does not hold what the task needs.
        """
        return self._task(job).model_dump(mode="json")

    def play(self, job: Job, *, recording: Path | None = None, progress: Progress | None = None) -> EpisodeRecord:
        """Play one episode and judge it."""
        task = self._task(job)
        world, people = world_and_people(job.world, self.residents)
        return self.play_task(
            world,
            people,
            task,
            method=job.method,
            setting=job.setting,
            terms=job.terms,
            recording=recording,
            progress=progress,
        )

    def _task(self, job: Job) -> Task:
        category = self._category(job.category)
        unknown = sorted(set(job.setting) - {"steps", "period", *self.settings})
        if unknown:
            raise InputError(f"{self.name}: there is no setting {unknown[0]!r}; there are {self.told_settings}")
        period, (low, high) = float(job.setting.get("period", self.period)), self.periods
        if not low <= period <= high or abs(period * 100 - round(period * 100)) > 1e-6:
            raise InputError(
                f"{self.name}: a period of {period:g} s; it has to be {low:g} to {high:g}, a multiple of 0.01"
            )
        world, people = world_and_people(job.world, self.residents)
        return self.draw_task(world, people, category, seed=job.seed, steps=int(job.setting.get("steps", self.steps)))

    def _category(self, name: str) -> Category:
        category = next((one for one in self.categories if one == name), None)
        if category is None:
            raise InputError(f"{self.name}: no category called {name!r}; there are {', '.join(self.categories)}")
        return category
