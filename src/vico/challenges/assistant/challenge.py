"""The community assistant challenge, as `vico eval assistant` plays it.

An episode is a task, a world with its people, planners that see only what they may, and a verdict. A person may play,
too: what happens ten times a second is judged second by second.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, Protocol

from vico.agents.assistant import METHODS, make_planner
from vico.agents.base import Agent, model_faults_of
from vico.agents.requester import Requester
from vico.agents.schedule import followers_of
from vico.assets.models.movable import movable_kinds, movable_prototype, movable_surfaces
from vico.challenges.assistant.evaluate import CAUSES, CauseTracker, Judge
from vico.challenges.assistant.generate import first_subtasks, generate_task
from vico.challenges.assistant.tasks import CATEGORIES, RESIDENTS, STEPS, SUBTASKS, Category, Task
from vico.challenges.episode_record import episode_record
from vico.challenges.episodes import for_size
from vico.challenges.records import EpisodeRecord, Job, Metric, Part, Progress, Setting
from vico.clock import seconds_of_day
from vico.community import build_community
from vico.community.folder import digest_of
from vico.community.model import Community
from vico.envs import Simulation, make
from vico.errors import InputError, SchemaError
from vico.runner.foreign import AbsentAgent, Terms, foreign_agents
from vico.runner.gather import FaultLog, Gatherer
from vico.runner.loading import AgentSeat
from vico.runner.loop import Director, Hook, Runner, Step
from vico.runner.recording import RecordedOnce, Recorder, recorded_in
from vico.world.folder import kept_world
from vico.world.public import PublicMap
from vico.world.world import World

#: The method that is a person.
HUMAN = "human"

# What is done all the time; everything else is told of at once.
_MOVING = ("move_forward", "turn_left", "turn_right", "look_at", "wait")


class Performance(Protocol):
    """An episode that a person plays, while it goes on."""

    @property
    def hooks(self) -> Sequence[Hook]:
        """Who follows it, after the recorder."""

    @property
    def director(self) -> Director:
        """Who holds it to the clock, and up while the person is away."""

    @property
    def over(self) -> bool:
        """Whether it is to end before its time."""

    def confirm(self) -> None:
        """Make sure that it was played to its end.

        Raises
        ------
        vico.errors.InputError
            If the person left and did not come back.
        """


class Theatre(Protocol):
    """Gives a person's agent, and a page to play it from."""

    @property
    def period(self) -> float:
        """Seconds between what the person does."""

    def agent(self, name: str) -> Agent:
        """Return who acts for the person."""

    def perform(
        self, recorder: Recorder, agents: Gatherer, task: Callable[[float], Mapping[str, Any]]
    ) -> AbstractContextManager[Performance]:
        """Open the page for an episode that is recorded.

        Parameters
        ----------
        task
            Returns what is asked, and what of it is done, at a second of the simulation.
        """


@dataclass(frozen=True)
class PlayedByHand:
    """A method one part of which is a person, and where they play.

    Attributes
    ----------
    method
        ``human``, or with another assistant's planner, joined by ``+``.
    """

    method: str
    theatre: Theatre


class JudgedSeconds(Hook):
    """Tells judge and chronicle of an episode each second, and at once of what assistants do beside moving.

    For those whose agents act oftener than once a second: what is counted are seconds, whoever plays.

    Parameters
    ----------
    start
        Second of the simulation at which the episode began.
    """

    def __init__(self, sim: Simulation, judge: Judge, chronicle: CauseTracker, *, start: float) -> None:
        self._sim, self._judge, self._chronicle, self._start = sim, judge, chronicle, start

    def begin(self, observations: Mapping[str, dict[str, Any]]) -> None:
        """Let them take in how things stand."""
        self._judge.begin(observations)
        self._chronicle.begin(observations)

    def on_step(self, step: Step) -> None:
        """Tell them, if it is time."""
        passed = self._sim.state.second - self._start
        whole = abs(passed - round(passed)) < 1e-6
        # What is done within a second is done by its end.
        told = replace(step, number=round(passed) if whole else int(passed) + 1)
        acted = any(step.actions.get(name, {}).get("type", "wait") not in _MOVING for name in self._judge.assistants)
        if whole:
            self._judge.on_step(told)
        elif acted:
            self._judge.look(told.number)
            self._judge.take_reports(told)
        if whole or acted:
            self._chronicle.on_step(told)


# In a window of 800 m; smaller ones have as many for their size, so that the cars find room.
CARS, PEDESTRIANS = 30, 30


@lru_cache(maxsize=4)
def world_and_people(folder: Path, category: Category) -> tuple[World, Community]:
    """Read a world, and make the people among whom a category's episodes take place: always the same ones."""
    world = kept_world(folder)
    return world, build_community(world, residents=RESIDENTS[category], seed=0)


def play_task(
    world: World,
    community: Community,
    task: Task,
    *,
    method: str | PlayedByHand,
    setting: Setting | None = None,
    terms: Terms | None = None,
    recording: Path | None = None,
    hooks: Sequence[Hook] = (),
) -> EpisodeRecord:
    """Play one task through and judge it.

    Parameters
    ----------
    method
        Name of a planner (see `vico.agents.assistant.METHODS`), ``my_module:MyPlanner``, or two joined by ``+``, one
        for each assistant; with its theatre where one of them is ``human``, which needs a recording.
    setting
        What planners are told beside the task: ``distance``, and what the record is to name.
    terms
        On which terms planners from elsewhere take part.
    recording
        Folder to which the run is recorded; None records nothing.
    hooks
        Who else follows the run, told after the judge.

    Raises
    ------
    SchemaError
        If the task was made for another world, or for other people.
    InputError
        If the method names more or fewer planners than there are assistants, or a person does not play to the end.
    """
    began = time.perf_counter()
    theatre = method.theatre if isinstance(method, PlayedByHand) else None
    method = method.method if isinstance(method, PlayedByHand) else method
    _check_made_for(task, world, community)
    names = [f"assistant_{i}" for i in range(len(task.assistants))]
    methods = method.split("+")
    played = [name for i, name in enumerate(names) if methods[i % len(methods)] == HUMAN]
    if len(played) > 1:
        raise InputError("eval: one person plays one assistant; name a planner for the other one: human+heuristic")
    if played and (theatre is None or recording is None):
        raise InputError("eval: a person plays at a page: vico eval assistant --method human, or vico play --task")
    env = make(
        world,
        community,
        seed=task.seed,
        start=task.start,
        assistants=len(names),
        cars=for_size(CARS, world),
        pedestrians=for_size(PEDESTRIANS, world),
        observe=tuple(names),
        max_steps=task.steps,
        periods={} if theatre is None else dict.fromkeys(played, theatre.period),
        setup=lambda simulation: set_up(simulation, task),
    )
    sim = env.sim
    terms = terms or Terms()
    planners = _planners(method, names, task, world, terms, setting or {})
    if theatre is not None:
        planners |= {name: theatre.agent(name) for name in played}
    residents = residents_of_task(task, community, env.public_map)
    judge = Judge(task, world, sim.ground_truth, names)
    chronicle = CauseTracker(judge)
    judge.watch(0)
    judges: list[Hook] = (
        [JudgedSeconds(sim, judge, chronicle, start=sim.state.second)] if played else [judge, chronicle]
    )
    agents = Gatherer(residents | planners, trusted=residents, deadline=terms.deadline, workers=terms.workers)
    runner = Runner(sim, agents, hooks=[*judges, *hooks])
    with ExitStack() as stack:
        stack.callback(agents.close)
        recorded: RecordedOnce | None = None
        if recording is not None:
            wanted = task.steps if theatre is None else round(task.steps / theatre.period)
            recorded = stack.enter_context(recorded_in(recording, sim, runner.faults, wanted=wanted))
            runner.hooks.append(recorded)
        if theatre is not None and recorded is not None:
            shown = theatre.perform(recorded.recorder, agents, partial(_task_for_person, task, judge))
            _perform(runner, stack.enter_context(shown), judge, task)
        else:
            runner.run(task.steps, until=lambda: judge.over)
        for name, planner in planners.items():
            for step, why in model_faults_of(planner):
                runner.faults.add(step, name, "model", why)
    return _record(task, method, setting or {}, chronicle, sim, runner.faults, planners, time.perf_counter() - began)


def _perform(runner: Runner, performance: Performance, judge: Judge, task: Task) -> None:
    """Run an episode that a person plays: as many seconds as any other."""
    sim = runner.sim
    runner.hooks += performance.hooks
    runner.director = performance.director
    end = sim.state.second + task.steps
    steps = 100 * task.steps  # more than there can be: seconds decide
    runner.run(steps, until=lambda: judge.over or performance.over or sim.state.second >= end)
    performance.confirm()


def _task_for_person(task: Task, judge: Judge, second: float) -> dict[str, Any]:
    """Return what a person is told of the task, at a second of the simulation."""
    subtasks = [
        {"index": subtask.index, "text": subtask.text, "done": verdict is not None}
        for subtask, verdict in zip(task.subtasks, judge.verdicts, strict=True)
    ]
    left = max(seconds_of_day(task.start) + task.steps - second, 0.0)
    return {"instruction": task.category, "subtasks": subtasks, "seconds_left": left}


def _check_made_for(task: Task, world: World, community: Community) -> None:
    """Refuse a task of another world or community: who is asked for, and where, would be somebody else."""
    if task.world_digest != world.digest:
        raise SchemaError(
            f"task: made for another world ({task.world!r}, {task.world_digest[:12]}) than {world.manifest.name!r} "
            f"({world.digest[:12]}); give that world, or generate the task for this one"
        )
    if task.community_digest != (digest := digest_of(community)):
        raise SchemaError(
            f"task: made for another community ({task.community_digest[:12]}) than this one of "
            f"{len(community.residents)} residents ({digest[:12]}); give that community, or generate the task for "
            "this one"
        )


class EpisodeProgress(Hook):
    """Tells how far the episode of a task is."""

    def __init__(self, progress: Progress, task: Task) -> None:
        self._progress, self._label = progress, f"{task.world}, {task.category}, seed {task.seed}"
        self._steps = task.steps

    def on_step(self, step: Step) -> None:
        """Tell it."""
        self._progress(self._label, step.number, self._steps)


def residents_of_task(task: Task, community: Community, public_map: PublicMap) -> dict[str, Agent]:
    """Make those who live there; who is to be helped with carrying waits for helpers."""
    followers = followers_of(community, public_map, seed=task.seed)
    residents: dict[str, Agent] = dict(followers)
    if task.category == "carry":
        for subtask in task.subtasks:
            name = subtask.person.agent
            residents[name] = Requester(followers[name], community.resident_by_id[name], public_map, seed=task.seed)
    return residents


def _planners(
    method: str, names: list[str], task: Task, world: World, terms: Terms, setting: Setting
) -> dict[str, Agent]:
    """Make the planners of an episode; those that can't be made fail at each of its steps."""
    told, of = task.instructions(), len(names)
    methods = method.split("+")
    if len(methods) not in (1, of):
        raise InputError(f"eval: {method!r} names {len(methods)} planners for {of} assistants")
    public_map = PublicMap.from_world(world)
    made: dict[str, Agent] = {}
    for i, name in enumerate(names):
        mine = methods[i % len(methods)]
        if mine == HUMAN:
            continue
        if mine in METHODS:
            made[name] = make_planner(
                mine, told, public_map, seed=task.seed, number=i, of=of, distance=bool(setting.get("distance", True))
            )
            continue
        try:
            made |= foreign_agents(mine, [AgentSeat(name, task.seed, told, i, of)], world, terms)
        except InputError as error:
            made[name] = AbsentAgent(str(error))
    return made


def set_up(simulation: Simulation, task: Task) -> None:
    """Put the things of a task where they are at its start, and the assistants where they begin."""
    for thing in task.objects:
        kind, size = movable_kinds()[thing.kind], movable_kinds()[thing.kind].size
        shape = movable_surfaces(kind.kind, thing.colour)
        prototype = movable_prototype(kind.kind, thing.colour)
        if thing.holder is not None:
            simulation.scenario.hand_object(thing.name, prototype, shape, thing.holder, size=size)
            continue
        room = thing.room or ""
        simulation.scenario.add_object(
            thing.name, prototype, shape, thing.position, room=room, size=size, yaw=thing.yaw
        )
    for i, start in enumerate(task.assistants):
        simulation.scenario.place_agent(f"assistant_{i}", (*start.position, 0.0), yaw=start.yaw)


def _record(
    task: Task,
    method: str,
    setting: Setting,
    chronicle: CauseTracker,
    sim: Simulation,
    faults: FaultLog,
    planners: dict[str, Any],
    seconds: float,
) -> EpisodeRecord:
    """Condense an episode."""
    judge = chronicle.judge
    success = judge.final()
    parts = [
        Part(str(k), done, "" if done else chronicle.cause_of(k), judge.since[k] if done else None)
        for k, done in enumerate(success)
    ]
    finished = [part.done_at for part in parts if part.done_at is not None]
    metrics = {
        "SR": 100.0 * sum(success) / len(success),
        "Ts": float(max(finished)) if all(success) else float(task.steps),
    }
    if task.category == "carry":
        metrics["HR"], metrics["HR_escort"] = judge.following(task.steps)
    about = {"assistants": len(task.assistants), "advanced": task.advanced, "steps": task.steps}
    return episode_record(
        task,
        sim,
        faults,
        planners.values(),
        judged=(metrics, parts),
        of=("assistant", method, dict(setting) | about),
        wall_seconds=seconds,
    )


_SR = Metric("SR", "SR", "%", "higher", 0.0, 100.0, about="success rate: subtasks that were done")
_TS = Metric(
    "Ts", "Ts", "steps", "lower", 0.0, about="step at which the last subtask was done; the limit if not all were"
)
_HR = Metric(
    "HR", "HR", "%", "higher", 0.0, 100.0,
    about="human following rate: steps within 5 m of a person who walks home, of all steps of the limit",
)  # fmt: skip
_HR_ESCORT = Metric(
    "HR_escort", "HR from hand-over to arrival", "%", "higher", 0.0, 100.0,
    about="the same, of the steps from hand-over to arrival",
)  # fmt: skip


class AssistantChallenge:
    """Carry, Delivery and Search; see `vico.challenges.assistant.evaluate`."""

    name = "assistant"
    categories: Sequence[str] = CATEGORIES

    @property
    def methods(self) -> Sequence[str]:
        """Names of the planners that come with it."""
        return tuple(METHODS)

    def metrics(self, category: str) -> Sequence[Metric]:
        """Columns of a category's table."""
        return (_SR, _HR, _HR_ESCORT, _TS) if category == "carry" else (_SR, _TS)

    def causes(self, category: str) -> Sequence[str]:
        """All causes that a failed subtask may have."""
        return CAUSES

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
        return self._play(job, job.method, recording, progress)

    def _play(
        self, job: Job, method: str | PlayedByHand, recording: Path | None, progress: Progress | None
    ) -> EpisodeRecord:
        task = self._task(job)
        world, people = world_and_people(job.world, task.category)
        return play_task(
            world,
            people,
            task,
            method=method,
            setting=job.setting,
            terms=job.terms,
            recording=recording,
            hooks=[] if progress is None else [EpisodeProgress(progress, task)],
        )

    def _task(self, job: Job) -> Task:
        category = next((one for one in CATEGORIES if one == job.category), None)
        if category is None:
            raise InputError(f"assistant: no category called {job.category!r}; there are {', '.join(CATEGORIES)}")
        world, people = world_and_people(job.world, category)
        assistants = int(job.setting.get("assistants", 1))
        if not 1 <= assistants <= 2:
            raise InputError(f"assistant: {assistants} assistants; the tasks are for 1 or 2")
        task = generate_task(
            world,
            people,
            category,
            seed=job.seed,
            assistants=assistants,
            advanced=bool(job.setting.get("advanced", False)),
            steps=int(job.setting.get("steps", STEPS)),
        )
        return first_subtasks(task, subtasks=int(job.setting.get("subtasks", SUBTASKS)))


ASSISTANT = AssistantChallenge()
