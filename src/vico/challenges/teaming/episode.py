"""Playing a teaming episode: a task, a world with its people, robots that see only what they may, a verdict."""

from __future__ import annotations

import time
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from vico.agents.base import Agent
from vico.agents.schedule import followers_of
from vico.agents.teaming import METHODS, make_team
from vico.agents.teaming.newcomer import Newcomer
from vico.agents.teaming.visitor import Visitor
from vico.agents.wrappers import usage_of
from vico.challenges.assistant.episode import CARS, PEDESTRIANS, for_size, world_in
from vico.challenges.records import EpisodeRecord, Part, Progress, Setting
from vico.challenges.staging import ReportedSeconds, play_out, put_thing, robots_from_elsewhere
from vico.challenges.task_files import check_made_for
from vico.challenges.teaming.accompany import Accompany
from vico.challenges.teaming.guide import Guide
from vico.challenges.teaming.judge import TeamingJudge
from vico.challenges.teaming.model import TeamingTask
from vico.challenges.teaming.spot import Spot
from vico.challenges.teaming.thresholds import FOLLOWS_WITHIN, GIVES_UP, PERIOD, RESIDENTS
from vico.clock import seconds_of_day
from vico.community import build_community
from vico.community.model import Community
from vico.envs import Simulation, make
from vico.runner.faults import FaultLog
from vico.runner.foreign import Terms
from vico.runner.gather import Gatherer
from vico.runner.loop import Runner
from vico.world.folder import World
from vico.world.public import PublicMap


@lru_cache(maxsize=2)
def world_and_people(folder: Path) -> tuple[World, Community]:
    """Read a world, and make the people among whom its episodes take place: always the same ones."""
    world = world_in(folder)
    return world, build_community(world, residents=RESIDENTS, seed=0)


def play_teaming_task(
    world: World,
    community: Community,
    task: TeamingTask,
    *,
    method: str,
    setting: Setting | None = None,
    terms: Terms | None = None,
    recording: Path | None = None,
    progress: Progress | None = None,
) -> EpisodeRecord:
    """Play one task through and judge it.

    Parameters
    ----------
    method
        Name of a team (see `vico.agents.teaming.METHODS`), or ``my_module:MyRobot``, which plays all robots.
    setting
        ``period``: seconds between two actions of a robot.
    terms
        On which terms robots from elsewhere take part.
    recording
        Folder to which the run is recorded; None records nothing.

    Raises
    ------
    SchemaError
        If the task was made for another world, or for other people.
    """
    began = time.perf_counter()
    check_made_for(task, world, community)
    setting = setting or {}
    period = float(setting.get("period", PERIOD))
    starts = {f"robot_{k}": member.start for k, member in enumerate(task.team)}
    env = make(
        world,
        community,
        seed=task.seed,
        start=task.start,
        robots=tuple(member.model for member in task.team),
        robot_places={name: (*start.position, start.yaw) for name, start in starts.items()},
        cars=for_size(CARS, world),
        pedestrians=for_size(PEDESTRIANS, world),
        observe=tuple(starts),
        periods=dict.fromkeys(starts, period),
        max_steps=round(task.steps / min(period, 1.0)),
        setup=lambda simulation: set_up(simulation, task),
    )
    sim = env.sim
    terms = terms or Terms()
    robots = _robots(method, task, world, terms, period)
    residents = _residents(task, community, env.public_map)
    system = sim.state.robots
    assert system is not None
    judge = TeamingJudge(task, world, sim.ground_truth, system, lambda: sim.state.second)
    trusted = residents | robots if method in METHODS else residents
    agents = Gatherer(residents | robots, trusted=trusted, deadline=terms.deadline, workers=terms.workers)
    runner = Runner(sim, agents, hooks=[judge])
    if progress is not None:
        label = f"{task.world}, {task.category}, seed {task.seed}"
        runner.hooks.append(ReportedSeconds(progress, sim, label=label, limit=task.steps))
    play_out(
        runner,
        agents,
        over=lambda: judge.over,
        seconds=task.steps,
        period=period,
        recording=recording,
    )
    return _record(task, method, setting, judge, sim, runner.faults, robots, time.perf_counter() - began)


def set_up(simulation: Simulation, task: TeamingTask) -> None:
    """Put the thing where it lies, and whoever waits where they do."""
    if task.thing is not None:
        put_thing(simulation, task.thing)
    if task.walk is not None:
        waits = task.walk.waits_at
        simulation.scenario.place_agent(task.person.agent, (*waits.position, 0.0), yaw=waits.yaw)


def _residents(task: TeamingTask, community: Community, public_map: PublicMap) -> dict[str, Agent]:
    residents: dict[str, Agent] = dict(followers_of(community, public_map, seed=task.seed))
    walk, name = task.walk, task.person.agent
    if walk is None:
        return residents
    who = community.resident_by_id[name]
    if task.category == "accompany":
        place = str(task.destination.place)
        residents[name] = Visitor(who, public_map, place=place, pace=walk.pace, stay=walk.stay, seed=task.seed)
    else:
        pauses = [(pause.after, pause.seconds) for pause in walk.pauses]
        residents[name] = Newcomer(
            who, public_map, pace=walk.pace, pauses=pauses, within=FOLLOWS_WITHIN, gives_up=GIVES_UP, seed=task.seed
        )
    return residents


def _robots(method: str, task: TeamingTask, world: World, terms: Terms, period: float) -> dict[str, Agent]:
    """Make the robots of an episode; those that can't be made fail at each of its steps."""
    told = task.instruction() | {"period": period}
    if method in METHODS:
        return make_team(method, told, PublicMap.from_world(world), seed=task.seed)
    names = [f"robot_{k}" for k in range(len(task.team))]
    return robots_from_elsewhere(method, names, told, world, terms, seed=task.seed)


def _record(
    task: TeamingTask,
    method: str,
    setting: Setting,
    judge: TeamingJudge,
    sim: Simulation,
    faults: FaultLog,
    robots: Mapping[str, Any],
    seconds: float,
) -> EpisodeRecord:
    """Condense an episode."""
    done = judge.done_at
    metrics = {"SR": 100.0 if done is not None else 0.0, "Ts": float(task.steps if done is None else done)}
    match judge.rules:
        case Accompany() | Guide():
            metrics["together"] = judge.rules.share()
        case Spot(seen_at=float(seen)):
            metrics["seen"] = seen
    part = Part(task.category, done is not None, judge.cause(), None if done is None else int(done))
    return EpisodeRecord(
        challenge="teaming",
        category=task.category,
        method=method,
        setting=dict(setting) | {"steps": task.steps},
        world=task.world,
        seed=task.seed,
        metrics=metrics,
        parts=[part],
        steps=round(sim.state.second) - seconds_of_day(task.start),
        limit=task.steps,
        wall_seconds=seconds,
        state_hash=sim.state_hash(),
        tokens=sum(usage_of(robot).tokens for robot in robots.values()),
        cost=sum(usage_of(robot).cost for robot in robots.values()),
        fault_counts=faults.by_kind(),
        faults=faults.first,
    )
