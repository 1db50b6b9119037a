"""The teaming challenge, as `vico eval teaming` plays it: its tasks are drawn, set up, played and judged.

What each category draws and judges stands in its own module.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from vico.agents.base import Agent
from vico.agents.schedule import followers_of
from vico.agents.teaming import METHODS, make_team
from vico.agents.teaming.people import Newcomer, Visitor
from vico.challenges.assistant.candidates import Chooser, seeded_chooser
from vico.challenges.records import EpisodeRecord, Metric, Progress, Setting
from vico.challenges.robot_episodes import (
    ReportedSeconds,
    RobotsChallenge,
    foreign_robots,
    make_episode_env,
    place_waiting,
    play_out,
    put_thing,
    record_of,
    verdict_on,
)
from vico.challenges.robot_tasks import Draw, check_made_for, frame_of
from vico.challenges.teaming import accompany, guide, spot
from vico.challenges.teaming.accompany import Accompany
from vico.challenges.teaming.evaluate import CAUSES, TeamingJudge
from vico.challenges.teaming.guide import Guide
from vico.challenges.teaming.spot import Spot
from vico.challenges.teaming.tasks import (
    CATEGORIES,
    FOLLOWS_WITHIN,
    GIVES_UP,
    LEAST_WALK,
    MOST_WALK,
    PERIOD,
    PERIODS,
    RESIDENTS,
    STEPS,
    Category,
    TeamingTask,
)
from vico.community.model import Community
from vico.envs import Simulation
from vico.errors import EmptyInputError
from vico.runner.foreign import Terms
from vico.runner.gather import Gatherer
from vico.runner.loop import Runner
from vico.seeds import rng
from vico.world.public import PublicMap
from vico.world.world import World

#: How a task of each category is drawn.
TASK_DRAWERS: dict[Category, Callable[[Draw, dict[str, Any]], TeamingTask | None]] = {
    "accompany": accompany.draw_task,
    "guide": guide.draw_task,
    "spot": spot.draw_task,
}
# Starts that are tried.
_TRIES = 60


def generate_teaming_task(
    world: World,
    community: Community,
    category: Category,
    *,
    seed: int,
    steps: int = STEPS,
    chooser: Chooser | None = None,
) -> TeamingTask:
    """Make one episode's task; the same world, community, seed and chooser give the same task.

    Parameters
    ----------
    steps
        Seconds at most.
    chooser
        Who picks out of nine candidates; a seeded draw if None.

    Raises
    ------
    EmptyInputError
        If the world and its people have too little around any starting point.
    """
    chance = rng(seed, "teaming task", category, world.digest)
    draw = Draw(world, community, category, chance, chooser or seeded_chooser(chance))
    frame = frame_of(world, community, category, seed=seed, steps=steps)
    for _ in range(_TRIES):
        task = TASK_DRAWERS[category](draw, frame)
        if task is not None:
            return task
        draw.candidates.clear()
    raise EmptyInputError(
        f"teaming: {category}: nobody knows anything that is a walk of {LEAST_WALK:.0f} to {MOST_WALK:.0f} m away and "
        "has free ground; use a larger world or more residents"
    )


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
    team = {f"robot_{k}": (member.model, member.start) for k, member in enumerate(task.team)}
    env = make_episode_env(
        world, community, task, team=team, period=period, setup=lambda simulation: set_up(simulation, task)
    )
    sim = env.sim
    terms = terms or Terms()
    # Robots that can't be made fail at each step of the episode.
    told = task.instruction() | {"period": period}
    if method in METHODS:
        robots = make_team(method, told, PublicMap.from_world(world), seed=task.seed)
    else:
        names = [f"robot_{k}" for k in range(len(task.team))]
        robots = foreign_robots(method, names, told, world, terms, seed=task.seed)
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
    more: dict[str, float] = {}
    match judge.rules:
        case Accompany() | Guide():
            more["together"] = judge.rules.company.share()
        case Spot(seen_at=float(seen)):
            more["seen"] = seen
    return record_of(
        task,
        runner,
        robots,
        verdict_on(task.category, judge.done_at, judge.cause(), task.steps, more),
        challenge="teaming",
        method=method,
        setting=setting,
        wall_seconds=time.perf_counter() - began,
    )


def set_up(simulation: Simulation, task: TeamingTask) -> None:
    """Put the thing where it lies, and whoever waits where they do."""
    if task.thing is not None:
        put_thing(simulation, task.thing)
    if task.walk is not None:
        place_waiting(simulation, task.person.agent, task.walk.waits_at)


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


_SR = Metric("SR", "SR", "%", "higher", 0.0, 100.0, about="success rate: episodes whose task was done")
_TS = Metric("Ts", "Ts", "s", "lower", 0.0, about="seconds until it was; the limit where it was not")
_TOGETHER = Metric(
    "together", "Together on the way", "%", "higher", 0.0, 100.0, about="share of the way on which they were near"
)
_SEEN = Metric("seen", "Thing first in view", "s", "lower", 0.0, about="seconds until the drone had the thing in view")

#: A humanoid, a quadruped and a drone at work with a person or another robot; see `vico.challenges.teaming`.
#:
#: Settings of a job: ``steps``, seconds at most; ``period``, seconds between two actions of a robot.
TEAMING: RobotsChallenge[Category, TeamingTask] = RobotsChallenge(
    name="teaming",
    categories=CATEGORIES,
    methods=METHODS,
    residents=RESIDENTS,
    steps=STEPS,
    period=PERIOD,
    periods=PERIODS,
    columns={"accompany": (_SR, _TS, _TOGETHER), "guide": (_SR, _TS, _TOGETHER), "spot": (_SR, _TS, _SEEN)},
    failures=CAUSES,
    draw_task=generate_teaming_task,
    play_task=play_teaming_task,
)
