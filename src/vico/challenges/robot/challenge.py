"""The community robot challenge, as `vico eval robot` plays it.

Two robots see only what they may; the episode is set up, played, and given a verdict.
"""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np

from vico.agents.base import Agent
from vico.agents.requester import Depositor
from vico.agents.robot import METHODS, make_robots
from vico.agents.robot.carrier import Carrier
from vico.agents.robot.grasps import ObjectPose, PoseOracle
from vico.agents.robot.heuristic import Manipulator
from vico.agents.robot.learned_arm import LearnedArm
from vico.agents.schedule import followers_of
from vico.assets.models.movable import movable_kinds
from vico.assets.robots import robot_model
from vico.challenges.records import OF_POLICIES, EpisodeRecord, Metric, Progress, Setting
from vico.challenges.robot.arm_policies import LEARNED, read_arm_policy
from vico.challenges.robot.evaluate import CAUSES, RobotJudge
from vico.challenges.robot.generate import generate_robot_task
from vico.challenges.robot.tasks import CATEGORIES, PACE_HOME, PERIOD, RESIDENTS, STEPS, WAITS, Category, RobotTask
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
from vico.challenges.robot_tasks import check_made_for, team_of
from vico.community.model import Community
from vico.envs import Simulation
from vico.geometry import rotation_matrix
from vico.runner.foreign import Terms
from vico.runner.gather import Gatherer
from vico.runner.loop import Runner
from vico.world.public import PublicMap
from vico.world.world import World

__all__ = ["CARRIER", "MANIPULATOR", "ROBOT", "TEAM", "play_robot_task", "set_up"]
#: The cause of an episode that ended as a learned policy gave numbers that are none.
UNUSABLE = "unusable action"
#: The robots, in the order of their names.
TEAM = ("manipulator", "husky")
MANIPULATOR, CARRIER = "robot_0", "robot_1"


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
        Name of a pair of robots (see `vico.agents.robot.METHODS` and `vico.challenges.robot.arm_policies.LEARNED`), or
        ``my_module:MyRobot``, which plays both.
    setting
        ``period``: seconds between two actions of a robot. ``oracle_grasp``: whether hands never lose what they closed
        on (`vico.sim.robots.manipulator`); without it friction alone holds. ``policy``, ``policy_sha256``: of a method
        that was learned.
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
        If the method's policy cannot be used; see `vico.challenges.robot.arm_policies.policy_setting`.
    """
    began = time.perf_counter()
    check_made_for(task, world, community)
    setting = setting or {}
    period = float(setting.get("period", PERIOD))
    starts = (task.manipulator, task.carrier)
    env = make_episode_env(
        world,
        community,
        task,
        team=dict(zip((MANIPULATOR, CARRIER), zip(TEAM, starts, strict=True), strict=True)),
        period=period,
        setup=lambda simulation: set_up(simulation, task),
        oracle_grasp=bool(setting.get("oracle_grasp", False)),
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
    more = {"force": judge.story.force, "drops": float(judge.story.drops)}
    if task.category == "carry":
        more["together"] = judge.together()
    return record_of(
        task,
        runner,
        robots,
        verdict_on(task.thing.name, judge.done_at, judge.cause(), task.steps, more),
        challenge="robot",
        method=method,
        setting=setting,
        wall_seconds=time.perf_counter() - began,
    )


def set_up(simulation: Simulation, task: RobotTask) -> None:
    """Put the thing where it is at the start, and whoever waits with it."""
    if task.waits_at is not None:
        place_waiting(simulation, task.person.agent, task.waits_at)
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
    return foreign_robots(method, (MANIPULATOR, CARRIER), told, world, terms, seed=task.seed)


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


def truth_of(sim: Simulation, task: RobotTask) -> PoseOracle:
    """Return what tells where the thing of a task really is, as a box in the world."""
    half = np.array(movable_kinds()[task.thing.kind].size) / 2.0
    entity = sim.ground_truth.object_entity(task.thing.name)

    def pose(asked: int) -> ObjectPose | None:
        if asked != entity:
            return None
        objects = sim.state.objects
        k = objects.names.index(task.thing.name)
        rotation = rotation_matrix(objects.orientation[k])
        # Things are placed by the middle of their underside.
        return ObjectPose(objects.position[k] + rotation[:, 2] * half[2], rotation, half)

    return pose


_SR = Metric("SR", "SR", "%", "higher", 0.0, 100.0, about="success rate: episodes in which the thing was brought")
_TS = Metric("Ts", "Ts", "s", "lower", 0.0, about="seconds until it was; the limit where it was not")
_TOGETHER = Metric(
    "together", "With the person on the way home", "%", "higher", 0.0, 100.0,
    about="share of the person's way home on which a robot was near",
)  # fmt: skip
_FORCE = Metric("force", "Grip on the weaker finger", "N", "higher", 0.0, about="force that held the thing")
_DROPS = Metric("drops", "Drops", "an episode", "lower", 0.0, digits=2, about="times that the thing was let fall")
# Robots act 10 to 100 times a second.
_PERIODS = (0.01, 0.1)

#: Carry and Deliver by a mobile manipulator and a carrier, with real contact; see `vico.challenges.robot.generate`.
#:
#: Settings of a job: ``steps``, seconds at most; ``period``, seconds between two actions of a robot; ``oracle_grasp``,
#: whether hands never lose what they closed on; of methods that were learned ``policy``, where theirs lies, and its
#: hash ``policy_sha256``.
ROBOT: RobotsChallenge[Category, RobotTask] = RobotsChallenge(
    name="robot",
    categories=CATEGORIES,
    methods=(*METHODS, *LEARNED),
    residents=RESIDENTS,
    steps=STEPS,
    period=PERIOD,
    periods=_PERIODS,
    columns={"carry": (_SR, _TS, _TOGETHER, _DROPS, _FORCE), "deliver": (_SR, _TS, _DROPS, _FORCE)},
    failures=dict.fromkeys(CATEGORIES, CAUSES),
    draw_task=generate_robot_task,
    play_task=play_robot_task,
    settings=("oracle_grasp", *OF_POLICIES),
    told_settings="steps, period and oracle_grasp",
)
