"""Carry and Deliver as learners take part in them: one task after the other, residents who live on, the rewards."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from vico.agents.base import Agent
from vico.agents.robot.body import Stance
from vico.agents.robot.grasps import thing_box
from vico.agents.robot.sight import look
from vico.agents.robot.thing_watch import pose_of_box
from vico.agents.single import answers_of
from vico.assets.robots import robot_model
from vico.challenges.assistant.episode import CARS, PEDESTRIANS, for_size
from vico.challenges.assistant.rules import entrance_of
from vico.challenges.robot.bodies import arm_body
from vico.challenges.robot.episode import CARRIER, MANIPULATOR, TEAM, residents_of_robot_task, set_up, truth_of
from vico.challenges.robot.generate import generate_robot_task
from vico.challenges.robot.judge import RobotJudge
from vico.challenges.robot.model import Category, RobotTask
from vico.challenges.robot.thresholds import PERIOD, STEPS
from vico.clock import seconds_of_day
from vico.community.model import Community
from vico.envs import CommunityEnv, StepResult, make
from vico.envs.arrays.observation import DIRECTION, HIGH, LOW, direction
from vico.envs.arrays.surroundings import surroundings_of
from vico.errors import InputError
from vico.geometry import distance
from vico.runner.loop import Step
from vico.world.world import World

#: What ``goal`` holds, and how many numbers each has; ``other`` is the other robot.
GOAL = {"source": DIRECTION, "destination": DIRECTION, "person": DIRECTION, "other": DIRECTION, "thing": 7}
# The paper's reward: a metre costs so much a step, up to so many metres; holding and delivering are worth so much.
_PENALTY, _FAR, _GRASP, _PLACE = 0.02, 10.0, 5.0, 100.0


@dataclass(frozen=True, kw_only=True)
class RobotOptions:
    """What an episode is.

    Attributes
    ----------
    reward
        ``"paper"`` or ``"sparse"``.
    period
        Seconds between two actions, 0.01 to 0.1, a multiple of 0.01.
    seconds
        Of an episode at most.
    """

    reward: str = "paper"
    period: float = PERIOD
    seconds: int = STEPS


class RobotStage:
    """The world of an episode, its judge and its rewards, for whoever moves the robots.

    Task, randomisation and success are those of the challenge (`vico.challenges.robot`).

    Reward, sparse: 1 for success, which ends the episode. Paper: each step minus 0.02 times the metres from hand to
    thing, 10 at most, and the same from thing to destination; 5 while both fingers press on the thing and its middle is
    more than twice its height above the ground; 100 for success. (There a cube has to stay within 0.1 m of a goal for
    100 steps; here the challenge's own rule is what counts.) It knows where the thing is; robots are not told.

    Parameters
    ----------
    learners
        Names of the robots that learn: they are given pictures, and every other one plays its part.
    settings
        Of `vico.envs.spec.EnvSpec`.

    Attributes
    ----------
    env
        In which it takes place.
    result
        What the simulation told last.
    goal_space
        Of what `goal` returns.

    Raises
    ------
    InputError
        If there is no such reward, or a number is out of bounds.
    """

    def __init__(
        self,
        world: World,
        community: Community,
        category: Category,
        options: RobotOptions,
        *,
        learners: Sequence[str],
        settings: Mapping[str, Any],
    ) -> None:
        if options.reward not in ("paper", "sparse"):
            raise InputError(f"env: reward is {options.reward!r}; use 'paper' or 'sparse'")
        ticks = options.period * 100.0
        if not 0.01 <= options.period <= 0.1 or abs(ticks - round(ticks)) > 1e-6:
            raise InputError(f"env: a period of {options.period:g} s; it has to be 0.01 to 0.1, a multiple of 0.01")
        if options.seconds < 1:
            raise InputError(f"env: {options.seconds} seconds; it has to be 1 or more")
        self.options, self.category = options, category
        given = {
            "robots": TEAM,
            "cars": for_size(CARS, world),
            "pedestrians": for_size(PEDESTRIANS, world),
            "observe": tuple(learners),
            "periods": dict.fromkeys((MANIPULATOR, CARRIER), options.period),
            "max_steps": math.ceil(options.seconds / options.period),
            **settings,
        }
        self.env: CommunityEnv = make(world, community, **given)
        self._community = community
        self._body = arm_body(robot_model(TEAM[0]))
        self._known: dict[int, RobotTask] = {}
        self.goal_space = spaces.Box(LOW, HIGH, (sum(GOAL.values()),), np.float32)
        self.steps = 0

    def begin(self, seed: int, others: Mapping[str, Agent]) -> StepResult:
        """Draw the task of a seed, and start it.

        Parameters
        ----------
        others
            Who moves the robots that do not learn.
        """
        world = self.env.world
        if seed not in self._known:
            self._known[seed] = generate_robot_task(
                world, self._community, self.category, seed=seed, steps=self.options.seconds
            )
        self.task = task = self._known[seed]
        starts = {MANIPULATOR: task.manipulator, CARRIER: task.carrier}
        places = {name: (*start.position, start.yaw) for name, start in starts.items()}
        self.env.arrange(partial(set_up, task=task), start=seconds_of_day(task.start), robot_places=places)
        self.result = self.env.begin(task.seed)
        sim = self.env.sim
        assert sim.state.robots is not None
        residents = residents_of_robot_task(task, self._community, self.env.public_map)
        self._others = answers_of({**residents, **others})
        self._judge = RobotJudge(task, world, sim.ground_truth, sim.state.robots, lambda: sim.state.second)
        self._truth, self._entity = truth_of(sim, task), sim.ground_truth.object_entity(task.thing.name)
        self.goal_at = np.array(
            task.destination.centre if self.category == "deliver" else entrance_of(task.destination, world), np.float64
        )
        self.steps = 0
        return self.result

    def advance(self, actions: Mapping[str, Any]) -> StepResult:
        """Let the learners act for a period, all others as they are due, and judge."""
        others = self._others(self.result.observations, self.result.infos)
        self.result = self.env.advance({**others, **actions})
        self.steps += 1
        told = {name: dict(action) for name, action in actions.items()}
        self._judge.on_step(Step(self.steps, told, {}, self.result))
        return self.result

    @property
    def success(self) -> bool:
        """Whether the task is done."""
        return self._judge.over

    @property
    def cut(self) -> bool:
        """Whether the time is over, and the task is not done."""
        return not self.success and not self.env.agents

    def cause(self) -> str:
        """Return why it failed, as far as it went; "" if it did not."""
        return self._judge.cause()

    def is_held(self) -> bool:
        """Return whether the jaw holds the thing."""
        robots = self.env.sim.state.robots
        assert robots is not None
        return bool(robots.in_hand(0) == self._entity)

    def reward(self) -> float:
        """Return what the last step was worth to the robots."""
        if self.options.reward == "sparse":
            return float(self.success)
        thing = self._truth(self._entity)
        assert thing is not None
        observation = self.result.observations[MANIPULATOR]
        hand = self._body.hand(np.asarray(observation["sensors"]["joint_position"], np.float64)[:7])[:, 3]
        away = float(np.linalg.norm(Stance.of(observation).outside(hand) - thing.middle))
        missing = distance(thing.middle[:2], self.goal_at[:2])
        lifted = float(thing.middle[2]) - float(self.env.world.height(thing.middle[:2])) > 4.0 * float(thing.half[2])
        reward = -_PENALTY * (min(away, _FAR) + min(missing, _FAR))
        return reward + _GRASP * (self.is_held() and lifted) + _PLACE * self.success

    def goal(self, name: str, result: StepResult) -> NDArray[np.float32]:
        """Return what is asked of a robot and what it sees of it, in numbers.

        Directions (`vico.envs.arrays.observation.DIRECTION`) of the source, of the destination, of the person (where
        they are in view, zeros else), of the other robot, which tells where it is by radio; of the thing, from the
        robot's own pictures: whether it is in view, its middle in the frame of the base (metres) and half its sides,
        the shorter level one first; zeros where it is not.
        """
        observation, info = result.observations[name], result.infos[name]
        pose = np.asarray(observation["pose"], np.float64)
        heading = math.atan2(pose[4], pose[3])
        told = [direction(region.centre, pose, heading) for region in (self.task.source, self.task.destination)]
        around = surroundings_of(observation, info, self.env.public_map)
        names = (self.task.person.agent, self.task.person.name)
        person = next((one.position for one in around.people if one.name in names), None)
        told.append([0.0] * DIRECTION if person is None else direction(person, pose, heading))
        told.append(direction(self.bodies()[int(name == MANIPULATOR)], pose, heading))
        return np.concatenate([*told, self._seen(observation, info)]).astype(np.float32)

    def bodies(self) -> NDArray[np.float64]:
        """Return where the robots are, ENU metres, shape ``(2, 3)``."""
        robots = self.env.sim.state.robots
        assert robots is not None
        return np.asarray(robots.bodies().position, np.float64)

    def _seen(self, observation: Mapping[str, Any], info: Mapping[str, Any]) -> NDArray[np.float64]:
        if "depth" not in observation or "segmentation" not in observation:
            return np.zeros(GOAL["thing"])
        named = (int(e) for e, about in info["entities"].items() if about.get("name") == self.task.thing.name)
        box = thing_box(look(observation).of(next(named, 0)))
        if box is None:
            return np.zeros(GOAL["thing"])
        pose = pose_of_box(box)
        return np.concatenate([[1.0], pose.middle, pose.half])


def is_usable(action: Mapping[str, Any]) -> bool:
    """Return whether an action's vector holds neither NaN nor infinity."""
    return bool(np.isfinite(np.asarray(action.get("vector", ()), np.float64)).all())
