"""Carry and Deliver of the community robot challenge for one learner, who is the mobile manipulator."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from vico.agents.base import Action, Info, Observation
from vico.agents.robot.body import Stance
from vico.agents.robot.carrier import Carrier
from vico.agents.robot.grasps import thing_box
from vico.agents.robot.sight import look
from vico.agents.robot.team import says_come
from vico.agents.robot.thing_watch import pose_of_box
from vico.agents.single import answers_of
from vico.agents.state import AgentState
from vico.assets.robots import robot_model
from vico.challenges.assistant.episode import CARS, PEDESTRIANS, for_size
from vico.challenges.assistant.rules import entrance_of
from vico.challenges.learning.env import Moment
from vico.challenges.robot.bodies import arm_body
from vico.challenges.robot.episode import (
    CARRIER,
    MANIPULATOR,
    TEAM,
    UNUSABLE,
    residents_of_robot_task,
    set_up,
    truth_of,
)
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
from vico.runner.loop import Step
from vico.world.folder import World

#: What ``goal`` holds, and how many numbers each has.
GOAL = {"source": DIRECTION, "destination": DIRECTION, "person": DIRECTION, "carrier": DIRECTION, "thing": 7}
# The paper's reward: a metre costs so much a step, up to so many metres; holding and delivering are worth so much.
_PENALTY, _FAR, _GRASP, _PLACE = 0.02, 10.0, 5.0, 100.0
# The carrier comes after the other robot once that is so far away, metres, to so far behind it, and not oftener than
# every so many seconds.
_COMES, _BEHIND, _EVERY = 4.0, 2.2, 5.0


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


class RobotWork:
    """Carry or Deliver for a mobile manipulator, among residents and traffic.

    Task, randomisation and success are those of the challenge (`vico.challenges.robot`). The carrier is played: it
    comes along behind the manipulator, and where that calls it to.

    Reward, sparse: 1 for success, which ends the episode. Paper: each step minus 0.02 times the metres from hand to
    thing, 10 at most, and the same from thing to destination; 5 while both fingers press on the thing and its middle is
    more than twice its height above the ground; 100 for success. (There a cube has to stay within 0.1 m of a goal for
    100 steps; here the challenge's own rule is what counts.) It knows where the thing is; the agent is not told.

    Fail: an action that holds NaN or infinity ends the episode; all else goes on until the time is over.
    """

    def __init__(
        self, world: World, community: Community, category: Category, options: RobotOptions, **settings: Any
    ) -> None:
        if options.reward not in ("paper", "sparse"):
            raise InputError(f"env: reward is {options.reward!r}; use 'paper' or 'sparse'")
        ticks = options.period * 100.0
        if not 0.01 <= options.period <= 0.1 or abs(ticks - round(ticks)) > 1e-6:
            raise InputError(f"env: a period of {options.period:g} s; it has to be 0.01 to 0.1, a multiple of 0.01")
        if options.seconds < 1:
            raise InputError(f"env: {options.seconds} seconds; it has to be 1 or more")
        self.options, self.category, self.agent = options, category, MANIPULATOR
        given = {
            "robots": TEAM,
            "cars": for_size(CARS, world),
            "pedestrians": for_size(PEDESTRIANS, world),
            "observe": (MANIPULATOR,),
            "periods": dict.fromkeys((MANIPULATOR, CARRIER), options.period),
            "max_steps": math.ceil(options.seconds / options.period),
            **settings,
        }
        self.env: CommunityEnv = make(world, community, **given)
        self._community = community
        self._body = arm_body(robot_model(TEAM[0]))
        self._known: dict[int, RobotTask] = {}
        self.goal_space = spaces.Box(LOW, HIGH, (sum(GOAL.values()),), np.float32)
        self._steps = 0

    def begin(self, seed: int) -> StepResult:
        """Draw the task of a seed."""
        world = self.env.world
        if seed not in self._known:
            self._known[seed] = generate_robot_task(
                world, self._community, self.category, seed=seed, steps=self.options.seconds
            )
        self._task = task = self._known[seed]
        starts = {MANIPULATOR: task.manipulator, CARRIER: task.carrier}
        places = {name: (*start.position, start.yaw) for name, start in starts.items()}
        self.env.arrange(partial(set_up, task=task), start=seconds_of_day(task.start), robot_places=places)
        self._result = self.env.begin(task.seed)
        sim = self.env.sim
        assert sim.state.robots is not None
        residents = residents_of_robot_task(task, self._community, self.env.public_map)
        carrier = _ComesAlong(Carrier(MANIPULATOR, period=self.options.period), self._stance, self.options.period)
        self._others = answers_of({**residents, CARRIER: carrier})
        self._judge = RobotJudge(task, world, sim.ground_truth, sim.state.robots, lambda: sim.state.second)
        self._truth, self._entity = truth_of(sim, task), sim.ground_truth.object_entity(task.thing.name)
        self._goal = np.array(
            task.destination.centre if self.category == "deliver" else entrance_of(task.destination, world), np.float64
        )
        self._steps = 0
        return self._result

    def act(self, action: Mapping[str, Any]) -> Moment:
        """Let the manipulator act for a period, the carrier and the residents as they are due, and judge."""
        if not np.isfinite(np.asarray(action.get("vector", ()), np.float64)).all():
            return Moment(self._result, 0.0, terminated=True, info={"is_success": False, "cause": UNUSABLE})
        others = self._others(self._result.observations, self._result.infos)
        self._result = self.env.advance({**others, MANIPULATOR: action})
        self._steps += 1
        self._judge.stepped(Step(self._steps, {MANIPULATOR: dict(action)}, {}, self._result))
        success = self._judge.over
        cut = not success and not self.env.agents
        held = self._is_held()
        info: dict[str, Any] = {"is_held": held, "seconds": self._steps * self.options.period}
        if success or cut:
            info |= {"is_success": success, "cause": self._judge.cause()}
        return Moment(self._result, self._reward(held, success), terminated=success, truncated=cut, info=info)

    def allows(self, action: Mapping[str, Any]) -> bool:
        """Everything."""
        return True

    def goal(self, result: StepResult) -> NDArray[np.float32]:
        """Return what is asked and what is seen of it, in numbers.

        Directions (`vico.envs.arrays.observation.DIRECTION`) of the source, of the destination, of the person (where
        they are in view, zeros else), of the carrier, which tells where it is by radio; of the thing, from the robot's
        own pictures: whether it is in view, its middle in the frame of the base (metres) and half its sides, the
        shorter level one first; zeros where it is not.
        """
        observation, info = result.observations[MANIPULATOR], result.infos[MANIPULATOR]
        pose = np.asarray(observation["pose"], np.float64)
        heading = math.atan2(pose[4], pose[3])
        told = [direction(region.centre, pose, heading) for region in (self._task.source, self._task.destination)]
        around = surroundings_of(observation, info, self.env.public_map)
        names = (self._task.person.agent, self._task.person.name)
        person = next((one.position for one in around.people if one.name in names), None)
        told.append([0.0] * DIRECTION if person is None else direction(person, pose, heading))
        told.append(direction(self._bodies()[1], pose, heading))
        return np.concatenate([*told, self._seen(observation, info)]).astype(np.float32)

    def phrases(self) -> list[str]:
        """Nothing is said."""
        return []

    def told(self) -> Mapping[str, Any]:
        """Return the instructions, as robots of the challenge get them."""
        return {"instructions": self._task.instruction()}

    def _seen(self, observation: Mapping[str, Any], info: Mapping[str, Any]) -> NDArray[np.float64]:
        if "depth" not in observation or "segmentation" not in observation:
            return np.zeros(GOAL["thing"])
        named = (int(e) for e, about in info["entities"].items() if about.get("name") == self._task.thing.name)
        box = thing_box(look(observation).of(next(named, 0)))
        if box is None:
            return np.zeros(GOAL["thing"])
        pose = pose_of_box(box)
        return np.concatenate([[1.0], pose.middle, pose.half])

    def _reward(self, held: bool, success: bool) -> float:
        if self.options.reward == "sparse":
            return float(success)
        thing = self._truth(self._entity)
        assert thing is not None
        sensors = self._result.observations[MANIPULATOR]["sensors"]
        hand = self._body.hand(np.asarray(sensors["joint_position"], np.float64)[:7])[:, 3]
        hand = Stance.of(self._result.observations[MANIPULATOR]).outside(hand)
        away = float(np.linalg.norm(hand - thing.middle))
        missing = float(np.hypot(*(thing.middle[:2] - self._goal[:2])))
        lifted = float(thing.middle[2]) - float(self.env.world.height(thing.middle[:2])) > 4.0 * float(thing.half[2])
        reward = -_PENALTY * (min(away, _FAR) + min(missing, _FAR))
        return reward + _GRASP * (held and lifted) + _PLACE * success

    def _is_held(self) -> bool:
        robots = self.env.sim.state.robots
        assert robots is not None
        return bool(robots.in_hand(0) == self._entity)

    def _bodies(self) -> NDArray[np.float64]:
        robots = self.env.sim.state.robots
        assert robots is not None
        return np.asarray(robots.bodies().position, np.float64)

    def _stance(self) -> Stance:
        return Stance.of(self._result.observations[MANIPULATOR])


class _ComesAlong:
    """A carrier that comes after the other robot, which has no words where it acts in numbers.

    Parameters
    ----------
    carrier
        That is called.
    leader
        Returns where the other robot stands.
    period
        Seconds between two actions.
    """

    def __init__(self, carrier: Carrier, leader: Callable[[], Stance], period: float) -> None:
        self._carrier, self._leader, self._period = carrier, leader, period
        self._since = _EVERY

    def act(self, observation: Observation, info: Info) -> Action:
        """Return the action for the coming period."""
        self._since += self._period
        leader, here = self._leader(), Stance.of(observation)
        if self._since >= _EVERY and float(np.hypot(*(leader.position - here.position)[:2])) > _COMES:
            self._since = 0.0
            x, y = (leader.position[:2] - _BEHIND * leader.rotation[:2, 0]).tolist()
            call = {"speaker": MANIPULATOR, "text": says_come(x, y)}
            observation = {**observation, "events": [*observation["events"], call]}
        return self._carrier.act(observation, info)

    def state(self) -> AgentState:
        """Return all it remembers."""
        return {"carrier": self._carrier.state(), "since": self._since}

    def restore(self, state: AgentState) -> None:
        """Remember what `state` returned."""
        self._carrier.restore(state["carrier"])
        self._since = float(state["since"])
