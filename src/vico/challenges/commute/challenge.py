"""The commute challenge: one agent in the full simulation for a day, asked while it is on its way.

What is not legal in the challenge is refused before the agent's action reaches the simulation.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

from vico.agents.base import Action, Agent, FieldState, Info, Observation, usage_of
from vico.agents.commute import METHODS, make_planner
from vico.challenges.commute import tasks
from vico.challenges.commute.evaluate import CAUSES, DayJudge, part_of
from vico.challenges.commute.generate import generate_commute
from vico.challenges.commute.tasks import HOURS, LEGAL, MOST_ON_BIKE, MOST_ON_FOOT, CommuteTask
from vico.challenges.episodes import for_size
from vico.challenges.records import EpisodeRecord, Job, Metric, Progress
from vico.clock import clock_of
from vico.envs import Simulation, make
from vico.errors import InputError
from vico.rules import ReasonCode, code_name
from vico.runner.foreign import AbsentAgent, IsolatedAgent, foreign_agents
from vico.runner.gather import Gatherer
from vico.runner.loading import AgentSeat
from vico.runner.loop import Hook, Runner, Step
from vico.runner.recording import recorded_in
from vico.world.folder import kept_world
from vico.world.public import PublicMap
from vico.world.transit import Stop, TramStop
from vico.world.world import World

_TINY = 1e-6


def refusal(action: object, vehicle: str) -> tuple[str, str] | None:
    """Return code and reason why an action is not legal; None if it is, or if it has no form to be judged by.

    Parameters
    ----------
    action
        What the agent answered. What is no action at all is left to the simulation, which refuses and counts it.
    vehicle
        What the agent rides, as observations have it.
    """
    if not isinstance(action, Mapping) or not isinstance(kind := action.get("type"), str):
        return None
    if kind not in LEGAL:
        return code_name(ReasonCode.NOT_ABLE), f"{kind}: not legal on a commute; legal are {', '.join(LEGAL)}"
    distance = action.get("distance")
    most = MOST_ON_BIKE if vehicle == "bike" else MOST_ON_FOOT
    if kind == "move_forward" and isinstance(distance, (int, float)) and distance > most + _TINY:
        return code_name(ReasonCode.OUT_OF_RANGE), f"move_forward: {distance:g} m; {most:g} m a step are legal"
    return None


class LegalAgent(FieldState):
    """Passes an agent's legal actions on; one that is not becomes a wait, is counted, and the agent is told.

    Parameters
    ----------
    inner
        The agent under test.
    commutes
        What the agent is told as ``info["commute"]``: the appointment it is on its way to. Looked up at every step.

    Attributes
    ----------
    refused
        How often each type of action was refused.
    """

    inner: Agent
    _last: tuple[str, str] | None = None
    refused: Counter[str]

    def __init__(self, inner: Agent, commutes: CommuteInfo) -> None:
        self.inner = inner
        self.refused = Counter()
        self._commutes = commutes

    def act(self, observation: Observation, info: Info) -> Action:
        """Return the agent's action, or a wait."""
        if self._last is not None:
            code, reason = self._last
            said = {"action_status": "refused", "action_code": code, "action_reason": reason}
            observation = {**observation, "state": {**observation["state"], **said}}
        action = self.inner.act(observation, {**info, "commute": self._commutes.current()})
        self._last = refusal(action, observation["state"]["vehicle"])
        if self._last is None:
            return action
        self.refused[str(action["type"])[:40]] += 1
        return {"type": "wait"}


class CommuteInfo:
    """The appointment an agent is on its way to, as plain data."""

    def __init__(self, instructions: list[dict[str, Any]]) -> None:
        self._told = instructions[0]["appointments"]
        #: Number of the appointment.
        self.index = 1

    def current(self) -> dict[str, Any]:
        """Return number, place, position, start and end of the appointment, and whether it is the day's last."""
        last = self.index == len(self._told) - 1
        return {"index": self.index, "last": last, **self._told[self.index]}


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
    env = make(
        world,
        None,
        seed=task.seed,
        start=clock_of(task.appointments[0].end),
        assistants=1,
        cars=for_size(tasks.CARS, world),
        pedestrians=for_size(tasks.PEDESTRIANS, world),
        observe=() if job.method in METHODS else (AGENT,),
        max_steps=task.seconds,
        setup=partial(set_up, task=task),
    )
    sim, public_map = env.sim, env.public_map
    told = task.instructions()
    info = CommuteInfo(told)
    inner = _agent(job, task, world, public_map)
    agent = LegalAgent(inner, info)
    judge = DayJudge(task, AGENT, sim.ground_truth, stops_of(public_map))
    own = job.method in METHODS
    agents = Gatherer({AGENT: agent}, trusted=[AGENT] if own else [], deadline=job.terms.deadline)
    hooks: list[Hook] = [judge, _CommuteIndex(judge, info)]
    if progress is not None:
        hooks.append(_DayProgress(progress, f"{task.world}, {job.method}, day {task.seed}", task))
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
    seconds = time.perf_counter() - began
    logs, planner = judge.logs, getattr(inner, "planner", None)
    usage, counts = usage_of(planner or inner), runner.faults.by_kind()
    notes = {f"llm_{kind}": n for kind, n in sorted(getattr(planner, "fallbacks", {}).items())}
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
        steps=sim.metrics.steps,
        limit=task.seconds,
        wall_seconds=seconds,
        state_hash=sim.state_hash(),
        tokens=usage.tokens,
        cost=usage.cost,
        fault_counts={**counts, **refused, **notes},
        faults=runner.faults.first,
    )


def stay_until(sim: Simulation, end: float) -> None:
    """Let time pass with the agent standing where it is."""
    sim.act({})
    sim.advance(float(end - sim.state.second))


class _CommuteIndex(Hook):
    """Keeps what the agent is told up with the judge."""

    def __init__(self, judge: DayJudge, info: CommuteInfo) -> None:
        self._judge, self._info = judge, info

    def on_step(self, step: Step) -> None:
        self._info.index = len(self._judge.logs)


class _DayProgress(Hook):
    """Tells how far a day is."""

    def __init__(self, progress: Progress, label: str, task: CommuteTask) -> None:
        self._progress, self._label, self._task = progress, label, task

    def on_step(self, step: Step) -> None:
        observation = step.result.observations.get(AGENT)
        if observation is not None:
            done = round(float(observation["state"]["time"])) - self._task.appointments[0].end
            self._progress(self._label, done, self._task.seconds)


def set_up(simulation: Simulation, *, task: CommuteTask) -> None:
    """Stand the agent where the day begins, with its money."""
    simulation.scenario.place_agent(AGENT, (*task.appointments[0].position, 0.0))
    simulation.scenario.give_cash(AGENT, task.resident.cash)


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


CATEGORY = "commute"

_METRICS = (
    Metric("late_rate", "Late Rate", "%", "lower", 0.0, 100.0, about="commutes that were late or missed"),
    Metric("travel_time", "Travel Time", "min", "lower", 0.0, digits=2, about="minutes a day from leaving to arrival"),
    Metric("price", "Price", "a day", "lower", 0.0, digits=2, about="fares, rents, and fees for bicycles left about"),
    Metric("walk_distance", "Walk Distance", "km", "lower", 0.0, digits=2, about="kilometres a day on foot"),
)


class CommuteChallenge:
    """Be in time at every place of a day, with little travelling, money and walking.

    Settings of a job: ``hours`` from the first leaving to the end (`vico.challenges.commute.tasks.HOURS` unless given).
    """

    name = "commute"
    categories: Sequence[str] = (CATEGORY,)
    methods: Sequence[str] = tuple(METHODS)

    def metrics(self, category: str) -> Sequence[Metric]:
        """Columns of the table: who is late least comes first."""
        return _METRICS

    def causes(self, category: str) -> Sequence[str]:
        """All causes that a failed commute may have."""
        return CAUSES

    def task(self, job: Job) -> Mapping[str, object]:
        """Return what is asked in an episode, as JSON.

        Raises
        ------
        vico.errors.InputError
            If the setting is not usable, or the world has too few places far enough apart.
        """
        return self._task(job, kept_world(job.world)).model_dump(mode="json")

    def play(self, job: Job, *, recording: Path | None = None, progress: Progress | None = None) -> EpisodeRecord:
        """Play one day and judge it; see `vico.challenges.records.Challenge.play`."""
        world = kept_world(job.world)
        return play_day(world, self._task(job, world), job, recording=recording, progress=progress)

    def _task(self, job: Job, world: World) -> CommuteTask:
        unknown = sorted(set(job.setting) - {"hours"})
        if unknown:
            raise InputError(f"commute: there is no setting {unknown[0]!r}; there is hours")
        hours = job.setting.get("hours", HOURS)
        if isinstance(hours, bool) or not isinstance(hours, (int, float)):
            raise InputError(f"commute: hours is {hours!r}; give a number")
        return generate_commute(world, seed=job.seed, hours=float(hours))


COMMUTE = CommuteChallenge()
