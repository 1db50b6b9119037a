"""Playing a robot episode: a task, a world with its people, two robots that see only what they may, a verdict."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from vico.agents.base import Agent
from vico.agents.robot import METHODS, make_robots
from vico.agents.robot.carrier import Carrier
from vico.agents.robot.depositor import Depositor
from vico.agents.robot.heuristic import Manipulator
from vico.agents.robot.learned import LearnedArm
from vico.agents.robot.thing_watch import ThingPose, Truth
from vico.agents.schedule import followers_of
from vico.assets.models.movable import movable_kinds
from vico.assets.robots import robot_model
from vico.challenges.records import EpisodeRecord, Progress, Setting
from vico.challenges.robot.bodies import team_of
from vico.challenges.robot.judge import RobotJudge
from vico.challenges.robot.model import RobotTask
from vico.challenges.robot.policy_files import LEARNED, read_arm_policy
from vico.challenges.robot.thresholds import PACE_HOME, PERIOD, WAITS
from vico.challenges.staging import (
    ReportedSeconds,
    Verdict,
    make_stage,
    place_waiting,
    play_out,
    put_thing,
    record_of,
    robots_from_elsewhere,
    verdict_on,
)
from vico.challenges.task_files import check_made_for
from vico.community.model import Community
from vico.envs import Simulation
from vico.quaternions import matrix_of
from vico.runner.foreign import Terms
from vico.runner.gather import Gatherer
from vico.runner.loop import Runner
from vico.world.public import PublicMap
from vico.world.world import World

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
        Name of a pair of robots (see `vico.agents.robot.METHODS` and `vico.challenges.robot.policy_files.LEARNED`), or
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
        If the method's policy cannot be used; see `vico.challenges.robot.policy_files.policy_setting`.
    """
    began = time.perf_counter()
    check_made_for(task, world, community)
    setting = setting or {}
    period = float(setting.get("period", PERIOD))
    starts = (task.manipulator, task.carrier)
    env = make_stage(
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
    return record_of(
        task,
        runner,
        robots,
        _verdict(task, judge),
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


def _verdict(task: RobotTask, judge: RobotJudge) -> Verdict:
    more = {"force": judge.story.force, "drops": float(judge.story.drops)}
    if task.category == "carry":
        more["together"] = judge.together()
    return verdict_on(task.thing.name, judge.done_at, judge.cause(), task.steps, more)


__all__: Sequence[str] = ["CARRIER", "MANIPULATOR", "TEAM", "play_robot_task", "set_up"]
