"""Playing a robot episode: a task, a world with its people, two robots that see only what they may, a verdict."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from vico.agents.base import Agent
from vico.agents.robot import METHODS, make_robots
from vico.agents.robot.carrier import Carrier
from vico.agents.robot.depositor import Depositor
from vico.agents.robot.heuristic import Manipulator
from vico.agents.robot.learned import LearnedArm
from vico.agents.robot.thing_watch import ThingPose, Truth
from vico.agents.schedule import followers_of
from vico.agents.wrappers import usage_of
from vico.assets.models.movable import movable_kinds
from vico.assets.robots import robot_model
from vico.challenges.assistant.episode import CARS, PEDESTRIANS, for_size, world_in
from vico.challenges.records import EpisodeRecord, Part, Progress, Setting
from vico.challenges.robot.bodies import team_of
from vico.challenges.robot.judge import RobotJudge
from vico.challenges.robot.model import RobotTask
from vico.challenges.robot.policy_files import LEARNED, read_arm_policy
from vico.challenges.robot.thresholds import PACE_HOME, PERIOD, RESIDENTS, WAITS
from vico.challenges.staging import ReportedSeconds, play_out, put_thing, robots_from_elsewhere
from vico.challenges.task_files import check_made_for
from vico.clock import seconds_of_day
from vico.community import build_community
from vico.community.model import Community
from vico.envs import Simulation, make
from vico.quaternions import matrix_of
from vico.runner.faults import FaultLog
from vico.runner.foreign import Terms
from vico.runner.gather import Gatherer
from vico.runner.loop import Runner
from vico.world.folder import World
from vico.world.public import PublicMap

#: The cause of an episode that ended as a learned policy gave numbers that are none.
UNUSABLE = "unusable action"
#: The robots, in the order of their names.
TEAM = ("manipulator", "husky")
MANIPULATOR, CARRIER = "robot_0", "robot_1"


@lru_cache(maxsize=2)
def world_and_people(folder: Path) -> tuple[World, Community]:
    """Read a world, and make the people among whom its episodes take place: always the same ones."""
    world = world_in(folder)
    return world, build_community(world, residents=RESIDENTS, seed=0)


def play_robot_task(
    world: World,
    community: Community,
    task: RobotTask,
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
        Name of a pair of robots (see `vico.agents.robot.METHODS` and `vico.challenges.robot.policy_files.LEARNED`), or
        ``my_module:MyRobot``, which plays both.
    setting
        ``period``: seconds between two actions of a robot. ``oracle_grasp``: whether hands never lose what they closed
        on (`vico.sim.robots.oracle`); without it friction alone holds. ``policy``, ``policy_sha256``: of a method that
        was learned.
    terms
        On which terms robots from elsewhere take part.
    recording
        Folder to which the run is recorded; None records nothing.

    Raises
    ------
    SchemaError
        If the task was made for another world, or for other people.
    InputError
        If there is no such method.
    VicoError
        If the method's policy cannot be used; see `vico.challenges.robot.policy_files.policy_setting`.
    """
    began = time.perf_counter()
    check_made_for(task, world, community)
    setting = setting or {}
    period = float(setting.get("period", PERIOD))
    starts = {MANIPULATOR: task.manipulator, CARRIER: task.carrier}
    env = make(
        world,
        community,
        seed=task.seed,
        start=task.start,
        robots=TEAM,
        robot_places={name: (*start.position, start.yaw) for name, start in starts.items()},
        cars=for_size(CARS, world),
        pedestrians=for_size(PEDESTRIANS, world),
        observe=(MANIPULATOR, CARRIER),
        periods=dict.fromkeys(starts, period),
        oracle_grasp=bool(setting.get("oracle_grasp", False)),
        max_steps=round(task.steps / period),
        setup=lambda simulation: set_up(simulation, task),
    )
    sim = env.sim
    terms = terms or Terms()
    learned = _learned_arm(method, setting, task, sim, period) if method in LEARNED else None
    robots = _robots(method, task, world, terms, period) if learned is None else _learned_robots(task, learned, period)
    residents = residents_of_robot_task(task, community, env.public_map)
    truth, system = sim.ground_truth, sim.state.robots
    assert system is not None
    judge = RobotJudge(task, world, truth, system, lambda: sim.state.second)
    trusted = residents | robots if method in (*METHODS, *LEARNED) else residents
    agents = Gatherer(residents | robots, trusted=trusted, deadline=terms.deadline, workers=terms.workers)
    runner = Runner(sim, agents, hooks=[judge])
    if progress is not None:
        label = f"{task.world}, {task.category}, seed {task.seed}"
        runner.hooks.append(ReportedSeconds(progress, sim, label=label, limit=task.steps))
    play_out(
        runner,
        agents,
        over=lambda: judge.over or (learned is not None and bool(learned.broken)),
        seconds=task.steps,
        period=period,
        recording=recording,
    )
    if learned is not None and learned.broken:
        judge.ended_by = UNUSABLE
    return _record(task, method, setting, judge, sim, runner.faults, robots, time.perf_counter() - began)


def set_up(simulation: Simulation, task: RobotTask) -> None:
    """Put the thing where it is at the start, and whoever waits with it."""
    if task.waits_at is not None:
        simulation.scenario.place_agent(task.person.agent, (*task.waits_at.position, 0.0), yaw=task.waits_at.yaw)
    put_thing(simulation, task.thing)


def residents_of_robot_task(task: RobotTask, community: Community, public_map: PublicMap) -> dict[str, Agent]:
    """Return who lives there, each on their day; with Carry one waits for the robots with a thing."""
    residents: dict[str, Agent] = dict(followers_of(community, public_map, seed=task.seed))
    if task.category == "carry":
        name = task.person.agent
        who = community.resident_by_id[name]
        residents[name] = Depositor(who, public_map, pace=PACE_HOME, waits=WAITS, seed=task.seed)
    return residents


def _robots(method: str, task: RobotTask, world: World, terms: Terms, period: float) -> dict[str, Agent]:
    """Make the robots of an episode; those that can't be made fail at each of its steps."""
    told = task.instruction() | {"period": period}
    if method in METHODS:
        team = team_of(robot_model(TEAM[0]), robot_model(TEAM[1]))
        return dict(make_robots(method, told, PublicMap.from_world(world), team, seed=task.seed))
    return robots_from_elsewhere(method, (MANIPULATOR, CARRIER), told, world, terms, seed=task.seed)


def _learned_arm(method: str, setting: Setting, task: RobotTask, sim: Simulation, period: float) -> LearnedArm:
    """Return the arm of a method that was learned; with an oracle's grasp it is told where the thing really is."""
    team = team_of(robot_model(TEAM[0]), robot_model(TEAM[1]))
    policy = read_arm_policy(method, setting, task, team.arm, period=period)
    truth = truth_of(sim, task) if setting.get("oracle_grasp") else None
    return LearnedArm(team.arm, policy, period=period, truth=truth)


def _learned_robots(task: RobotTask, arm: LearnedArm, period: float) -> dict[str, Agent]:
    """Return robots that drive, search and talk as the heuristic does; one has a learned arm."""
    told = task.instruction() | {"period": period}
    team = team_of(robot_model(TEAM[0]), robot_model(TEAM[1]))
    return {
        MANIPULATOR: Manipulator(told, team, carrier=CARRIER, worker=arm),
        CARRIER: Carrier(MANIPULATOR, period=period),
    }


def truth_of(sim: Simulation, task: RobotTask) -> Truth:
    """Return what tells where the thing of a task really is, as a box in the world."""
    half = np.array(movable_kinds()[task.thing.kind].size) / 2.0
    entity = sim.ground_truth.object_entity(task.thing.name)

    def pose(asked: int) -> ThingPose | None:
        if asked != entity:
            return None
        objects = sim.state.objects
        k = objects.names.index(task.thing.name)
        rotation = matrix_of(objects.orientation[k])
        # Things are placed by the middle of their underside.
        return ThingPose(objects.position[k] + rotation[:, 2] * half[2], rotation, half)

    return pose


def _record(
    task: RobotTask,
    method: str,
    setting: Setting,
    judge: RobotJudge,
    sim: Simulation,
    faults: FaultLog,
    robots: Mapping[str, Any],
    seconds: float,
) -> EpisodeRecord:
    """Condense an episode."""
    done = judge.done_at
    played = round(sim.state.second) - seconds_of_day(task.start)
    metrics = {
        "SR": 100.0 if done is not None else 0.0,
        "Ts": float(task.steps if done is None else min(done, task.steps)),
        "force": judge.story.force,
        "drops": float(judge.story.drops),
    }
    if task.category == "carry":
        metrics["together"] = judge.together()
    parts = [Part(task.thing.name, done is not None, judge.cause(), None if done is None else int(done))]
    return EpisodeRecord(
        challenge="robot",
        category=task.category,
        method=method,
        setting=dict(setting) | {"steps": task.steps},
        world=task.world,
        seed=task.seed,
        metrics=metrics,
        parts=parts,
        steps=played,
        limit=task.steps,
        wall_seconds=seconds,
        state_hash=sim.state_hash(),
        tokens=sum(usage_of(robot).tokens for robot in robots.values()),
        cost=sum(usage_of(robot).cost for robot in robots.values()),
        fault_counts=faults.by_kind(),
        faults=faults.first,
    )


__all__: Sequence[str] = ["CARRIER", "MANIPULATOR", "TEAM", "play_robot_task", "set_up", "world_and_people"]
