"""Playing a commuter's day: one agent in the full simulation, asked while it is on its way."""

from __future__ import annotations

import time
from contextlib import ExitStack
from functools import partial
from pathlib import Path

from vico.agents.base import Agent
from vico.agents.commute import METHODS, make_planner
from vico.agents.wrappers import usage_of
from vico.challenges.commute import rules
from vico.challenges.commute.causes import part_of
from vico.challenges.commute.judge import DayJudge
from vico.challenges.commute.legal import CommuteInfo, LegalAgent
from vico.challenges.commute.model import CommuteTask
from vico.challenges.records import EpisodeRecord, Job, Progress
from vico.clock import clock_of
from vico.envs import CommunityEnv, Simulation, make
from vico.errors import InputError
from vico.runner.foreign import AbsentAgent, foreign_agents
from vico.runner.gather import Gatherer
from vico.runner.isolated import IsolatedAgent
from vico.runner.loading import AgentSeat
from vico.runner.loop import Hook, Runner, Step
from vico.runner.recording import recorded_in
from vico.world.public import PublicMap
from vico.world.transit_model import Stop, TramStop
from vico.world.world import World

AGENT = "assistant_0"


def play_day(
    world: World, task: CommuteTask, job: Job, *, recording: Path | None = None, progress: Progress | None = None
) -> EpisodeRecord:
    """Play one day and judge it.

    While the agent is at an appointment nobody is asked for anything, and the city goes on (`Simulation.advance`), so
    the day is simulated without a gap and its states have the same hashes whoever plays it in which process.

    Parameters
    ----------
    recording
        Folder to which the steps are recorded in which the agent is on its way.
    progress
        Called with a label, seconds of the day that are over, and how many there are.
    """
    began = time.perf_counter()
    env = _env(world, task, job)
    sim, public_map = env.sim, env.public_map
    told = task.instructions()
    info = CommuteInfo(told)
    inner = _agent(job, task, world, public_map)
    agent = LegalAgent(inner, info)
    judge = DayJudge(task, AGENT, sim.ground_truth, stops_of(public_map))
    own = job.method in METHODS
    agents = Gatherer({AGENT: agent}, trusted=[AGENT] if own else [], deadline=job.terms.deadline)
    hooks: list[Hook] = [judge, _Index(judge, info)]
    if progress is not None:
        hooks.append(_Reported(progress, f"{task.world}, {job.method}, day {task.seed}", task))
    runner = Runner(sim, agents, hooks=hooks)
    with ExitStack() as stack:
        stack.callback(agents.close)
        if isinstance(inner, IsolatedAgent):
            stack.callback(inner.close)
        if recording is not None:
            recorded = recorded_in(recording, sim, runner.faults, wanted=task.seconds)
            runner.hooks.append(stack.enter_context(recorded))
        while not judge.over:
            runner.run(task.seconds, until=lambda: judge.stays or judge.over)
            if judge.stays:
                stay_until(sim, judge.logs[-1].item.end)
                judge.release(float(sim.state.second))
                info.index = len(judge.logs)
    return _record(task, job, judge, runner, public_map, agent, time.perf_counter() - began)


def stay_until(sim: Simulation, end: float) -> None:
    """Let time pass with the agent standing where it is."""
    sim.act({})
    sim.advance(float(end - sim.state.second))


class _Index(Hook):
    """Keeps what the agent is told up with the judge."""

    def __init__(self, judge: DayJudge, info: CommuteInfo) -> None:
        self._judge, self._info = judge, info

    def on_step(self, step: Step) -> None:
        self._info.index = len(self._judge.logs)


class _Reported(Hook):
    """Tells how far a day is."""

    def __init__(self, progress: Progress, label: str, task: CommuteTask) -> None:
        self._progress, self._label, self._task = progress, label, task

    def on_step(self, step: Step) -> None:
        observation = step.result.observations.get(AGENT)
        if observation is not None:
            done = round(float(observation["state"]["time"])) - self._task.appointments[0].end
            self._progress(self._label, done, self._task.seconds)


def _env(world: World, task: CommuteTask, job: Job) -> CommunityEnv:
    return make(
        world,
        None,
        seed=task.seed,
        start=clock_of(task.appointments[0].end),
        assistants=1,
        cars=for_size(rules.CARS, world),
        pedestrians=for_size(rules.PEDESTRIANS, world),
        observe=() if job.method in METHODS else (AGENT,),
        max_steps=task.seconds,
        setup=partial(set_up, task=task),
    )


def set_up(simulation: Simulation, *, task: CommuteTask) -> None:
    """Stand the agent where the day begins, with its money."""
    simulation.scenario.place_agent(AGENT, (*task.appointments[0].position, 0.0))
    simulation.scenario.give_cash(AGENT, task.resident.cash)


def for_size(number: int, world: World) -> int:
    """Return how many there are in a world, of so many in a window of 800 m."""
    return min(number, round(number * (world.half / 400.0) ** 2))


def stops_of(public_map: PublicMap) -> list[tuple[float, float]]:
    """Return where one waits for buses and trams, ENU metres."""
    stops: list[Stop | TramStop] = [*public_map.stops, *public_map.tram_stops]
    return [(stop.wait[0], stop.wait[1]) for stop in stops]


def _agent(job: Job, task: CommuteTask, world: World, public_map: PublicMap) -> Agent:
    """Make the agent of an episode; one that can't be made fails at each of its steps."""
    if job.method in METHODS:
        return make_planner(job.method, task.instructions(), public_map, seed=task.seed)
    seat = AgentSeat(AGENT, task.seed, task.instructions())
    try:
        return foreign_agents(job.method, [seat], world, job.terms)[AGENT]
    except InputError as error:
        return AbsentAgent(str(error))


def _record(
    task: CommuteTask,
    job: Job,
    judge: DayJudge,
    runner: Runner,
    public_map: PublicMap,
    agent: LegalAgent,
    seconds: float,
) -> EpisodeRecord:
    logs, usage = judge.logs, usage_of(getattr(agent.inner, "planner", agent.inner))
    counts = runner.faults.by_kind()
    notes = {
        f"llm_{kind}": n for kind, n in sorted(getattr(getattr(agent.inner, "planner", None), "fallbacks", {}).items())
    }
    refused = {"illegal": agent.refused.total()} if agent.refused else {}
    return EpisodeRecord(
        challenge=job.challenge,
        category=job.category,
        method=job.method,
        setting=job.setting,
        world=task.world,
        seed=task.seed,
        metrics={
            "travel_time": sum(log.travel for log in logs) / 60.0,
            "price": round(sum(log.spent for log in logs), 2),
            "walk_distance": sum(log.walked for log in logs) / 1000.0,
            "late_rate": 100.0 * sum(log.late for log in logs) / len(logs),
        },
        parts=[part_of(log, k, public_map, last=k == len(logs)) for k, log in enumerate(logs, 1)],
        steps=runner.sim.metrics.steps,
        limit=task.seconds,
        wall_seconds=seconds,
        state_hash=runner.sim.state_hash(),
        tokens=usage.tokens,
        cost=usage.cost,
        fault_counts={**counts, **refused, **notes},
        faults=runner.faults.first,
    )
