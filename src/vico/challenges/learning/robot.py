"""Carry and Deliver of the community robot challenge for learners: one, or two at once.

One task follows the other while residents live on. One learner is the mobile manipulator (Gymnasium); two learn as a
team (PettingZoo).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from vico.agents.base import Action, Agent, FieldState, Info, Observation, heading
from vico.agents.robot.body import Stance, view_points
from vico.agents.robot.carrier import Carrier, call_message
from vico.agents.robot.grasps import object_box, pose_of_box
from vico.agents.single import action_function
from vico.assets.robots import robot_model
from vico.challenges.assistant.challenge import CARS, PEDESTRIANS
from vico.challenges.assistant.evaluate import entrance_of
from vico.challenges.episodes import for_size
from vico.challenges.learning.env import TaskStep, begin_episode, with_goal, with_goal_space
from vico.challenges.learning.manipulation.tasks import PAPER_FARTHEST, PAPER_GRASP, PAPER_METRE, PAPER_PLACE
from vico.challenges.robot.challenge import (
    CARRIER,
    MANIPULATOR,
    TEAM,
    UNUSABLE,
    residents_of_robot_task,
    set_up,
    truth_of,
)
from vico.challenges.robot.evaluate import RobotJudge
from vico.challenges.robot.generate import generate_robot_task
from vico.challenges.robot.tasks import PERIOD, STEPS, Category, RobotTask
from vico.challenges.robot_tasks import arm_body
from vico.clock import seconds_of_day
from vico.community.model import Community
from vico.envs import CommunityEnv, StepResult, make
from vico.envs.array_observations import DIRECTION, HIGH, LOW, direction, surroundings_of
from vico.envs.forms import FormOptions
from vico.errors import InputError
from vico.geometry import distance
from vico.runner.loop import Step
from vico.seeds import rng
from vico.world.world import World

#: What ``goal`` holds, and how many numbers each has; ``other`` is the other robot.
GOAL = {"source": DIRECTION, "destination": DIRECTION, "person": DIRECTION, "other": DIRECTION, "thing": 7}


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


class RobotTaskWorld:
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
        self._others = action_function({**residents, **others})
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
        reward = -PAPER_METRE * (min(away, PAPER_FARTHEST) + min(missing, PAPER_FARTHEST))
        return reward + PAPER_GRASP * (self.is_held() and lifted) + PAPER_PLACE * self.success

    def goal(self, name: str, result: StepResult) -> NDArray[np.float32]:
        """Return what is asked of a robot and what it sees of it, in numbers.

        Directions (`vico.envs.array_observations.DIRECTION`) of the source, of the destination, of the person (where
        they are in view, zeros else), of the other robot, which tells where it is by radio; of the thing, from the
        robot's own pictures: whether it is in view, its middle in the frame of the base (metres) and half its sides,
        the shorter level one first; zeros where it is not.
        """
        observation, info = result.observations[name], result.infos[name]
        pose = np.asarray(observation["pose"], np.float64)
        yaw = heading(observation)
        told = [direction(region.centre, pose, yaw) for region in (self.task.source, self.task.destination)]
        around = surroundings_of(observation, info, self.env.public_map)
        names = (self.task.person.agent, self.task.person.name)
        person = next((one.position for one in around.people if one.name in names), None)
        told.append([0.0] * DIRECTION if person is None else direction(person, pose, yaw))
        told.append(direction(self.bodies()[int(name == MANIPULATOR)], pose, yaw))
        return np.concatenate([*told, self._thing_numbers(observation, info)]).astype(np.float32)

    def bodies(self) -> NDArray[np.float64]:
        """Return where the robots are, ENU metres, shape ``(2, 3)``."""
        robots = self.env.sim.state.robots
        assert robots is not None
        return np.asarray(robots.bodies().position, np.float64)

    def _thing_numbers(self, observation: Mapping[str, Any], info: Mapping[str, Any]) -> NDArray[np.float64]:
        if "depth" not in observation or "segmentation" not in observation:
            return np.zeros(GOAL["thing"])
        named = (int(e) for e, about in info["entities"].items() if about.get("name") == self.task.thing.name)
        box = object_box(view_points(observation).of(next(named, 0)))
        if box is None:
            return np.zeros(GOAL["thing"])
        pose = pose_of_box(box)
        return np.concatenate([[1.0], pose.middle, pose.half])


def is_usable(action: Mapping[str, Any]) -> bool:
    """Return whether an action's vector holds neither NaN nor infinity."""
    return bool(np.isfinite(np.asarray(action.get("vector", ()), np.float64)).all())


_COMES = 4.0  # metres from the other robot from which on the carrier comes after it
_BEHIND = 2.2  # metres behind it to which it comes
_EVERY = 5.0  # seconds between two times, at least


class RobotWork:
    """Carry or Deliver for a mobile manipulator, among residents and traffic; see `RobotStage`.

    The carrier is played: it comes along behind the manipulator, and where that calls it to.

    Fail: an action that holds NaN or infinity ends the episode; all else goes on until the time is over.
    """

    def __init__(
        self, world: World, community: Community, category: Category, options: RobotOptions, **settings: Any
    ) -> None:
        self.agent = MANIPULATOR
        self.stage = RobotTaskWorld(world, community, category, options, learners=(MANIPULATOR,), settings=settings)
        self.env, self.goal_space = self.stage.env, self.stage.goal_space

    def begin(self, seed: int) -> StepResult:
        """Draw the task of a seed."""
        period = self.stage.options.period
        return self.stage.begin(
            seed, {CARRIER: _FollowingCarrier(Carrier(MANIPULATOR, period=period), self._stance, period)}
        )

    def act(self, action: Mapping[str, Any]) -> TaskStep:
        """Let the manipulator act for a period, the carrier and the residents as they are due, and judge."""
        stage = self.stage
        if not is_usable(action):
            return TaskStep(stage.result, 0.0, terminated=True, info={"is_success": False, "cause": UNUSABLE})
        result, held = stage.advance({MANIPULATOR: action}), stage.is_held()
        info: dict[str, Any] = {"is_held": held, "seconds": stage.steps * stage.options.period}
        if stage.success or stage.cut:
            info |= {"is_success": stage.success, "cause": stage.cause()}
        return TaskStep(result, stage.reward(), terminated=stage.success, truncated=stage.cut, info=info)

    def allows(self, action: Mapping[str, Any]) -> bool:
        """Everything."""
        return True

    def goal(self, result: StepResult) -> NDArray[np.float32]:
        """Return what is asked and what is seen of it, in numbers; see `RobotStage.goal`."""
        return self.stage.goal(MANIPULATOR, result)

    def phrases(self) -> list[str]:
        """Nothing is said."""
        return []

    def instructions(self) -> Mapping[str, Any]:
        """Return the instructions, as robots of the challenge get them."""
        return {"instructions": self.stage.task.instruction()}

    def _stance(self) -> Stance:
        return Stance.of(self.stage.result.observations[MANIPULATOR])


class _FollowingCarrier(FieldState):
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

    _carrier: Carrier
    _since: float = _EVERY

    def __init__(self, carrier: Carrier, leader: Callable[[], Stance], period: float) -> None:
        self._carrier, self._leader, self._period = carrier, leader, period

    def act(self, observation: Observation, info: Info) -> Action:
        """Return the action for the coming period."""
        self._since += self._period
        leader, here = self._leader(), Stance.of(observation)
        if self._since >= _EVERY and float(np.hypot(*(leader.position - here.position)[:2])) > _COMES:
            self._since = 0.0
            x, y = (leader.position[:2] - _BEHIND * leader.rotation[:2, 0]).tolist()
            call = {"speaker": MANIPULATOR, "text": call_message(x, y)}
            observation = {**observation, "events": [*observation["events"], call]}
        return self._carrier.act(observation, info)


class RobotTeamEnv(ParallelEnv):  # type: ignore[misc]
    """Carry or Deliver for the mobile manipulator, ``robot_0``, and the carrier, ``robot_1``.

    Task: as in the challenge (`vico.challenges.robot`); what is asked stands in ``info["instructions"]`` after a reset
    and, in numbers, in the ``goal`` of each observation (`RobotStage.goal`).

    Randomizations: those of the challenge; `reset(seed=n)` starts episode ``n``, without a seed numbers are drawn.

    Success: the challenge's own rule. It ends the episode for both; so does an action of either that holds NaN or
    infinity. Both are given the same reward (`RobotStage`), and both are cut off when the time is over.

    Parameters
    ----------
    tasks
        How many different episodes there are: a seed counts modulo this; None sets no limit.
    seed
        Of the numbers that are drawn before `reset` is given a seed.
    settings
        Of `vico.envs.spec.EnvSpec`.

    Raises
    ------
    InputError
        If there are no tasks, or an option is not usable.
    """

    metadata = {"render_modes": ["rgb_array"], "name": "vico/RobotTeam-v0", "is_parallelizable": True}  # noqa: RUF012
    render_mode = "rgb_array"

    def __init__(
        self,
        world: World,
        community: Community,
        category: Category,
        options: RobotOptions,
        *,
        tasks: int | None = None,
        seed: int = 0,
        **settings: Any,
    ) -> None:
        if tasks is not None and tasks < 1:
            raise InputError(f"env: tasks is {tasks}; it has to be 1 or more")
        self.possible_agents = [MANIPULATOR, CARRIER]
        self.agents: list[str] = []
        self.stage = RobotTaskWorld(
            world, community, category, options, learners=self.possible_agents, settings=settings
        )
        self._tasks = tasks
        self._random = rng(seed, "robot team episodes")
        self._plain_infos = FormOptions.of(self.stage.env.spec.form).name == "arrays"
        forms, goal = self.stage.env.forms, self.stage.goal_space
        self._observations = {
            name: with_goal_space(forms[name].observation_space, goal) for name in self.possible_agents
        }

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Space of a robot's observations; the same object each time."""
        if agent not in self._observations:
            raise InputError(f"env: no agent is called {agent!r}; there are {', '.join(self.possible_agents)}")
        return self._observations[agent]

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """Space of a robot's actions; the same object each time."""
        return self.stage.env.action_space(agent)

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """Start an episode; in the rich form ``info`` holds its number as ``task``, and ``instructions``.

        Raises
        ------
        VicoError
            If the world does not hold the task with this seed; or none of many, where no seed is given.
        """
        if seed is not None:
            self._random = rng(seed, "robot team episodes")
        number, result = begin_episode(
            lambda number: self.stage.begin(number, {}), seed, tasks=self._tasks, random=self._random
        )
        self.agents = list(self.possible_agents)
        return self._results_for(result, {"task": number, "instructions": self.stage.task.instruction()})

    def step(
        self, actions: Mapping[str, Any]
    ) -> tuple[dict[str, Any], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """Let both act for a period; who has no action waits.

        Raises
        ------
        InputError
            If the episode is over, or has not begun.
        """
        if not self.agents:
            raise InputError("env: the episode is over (or has not begun); call reset() before step()")
        stage, names = self.stage, self.possible_agents
        short = {name: stage.env.forms[name].decode(action) for name, action in actions.items() if name in names}
        usable = all(is_usable(action) for action in short.values())
        reward, cause = 0.0, UNUSABLE
        if usable:
            stage.advance(short)
            reward, cause = stage.reward(), stage.cause()
        over, cut = stage.success or not usable, usable and stage.cut
        info: dict[str, Any] = {"is_held": stage.is_held(), "seconds": stage.steps * stage.options.period}
        if over or cut:
            self.agents = []
            info |= {"is_success": stage.success and usable, "cause": cause}
        observations, infos = self._results_for(stage.result, info)
        return (
            observations,
            dict.fromkeys(names, reward),
            dict.fromkeys(names, over),
            dict.fromkeys(names, cut),
            infos,
        )

    def render(self) -> NDArray[np.uint8]:
        """Return what both see, side by side, uint8, shape ``(image, 2 * image, 3)``."""
        return self.stage.env.render()

    def state_hash(self) -> str:
        """Hash of the whole state."""
        return self.stage.env.state_hash()

    def close(self) -> None:
        """Let go of the simulation."""
        self.stage.env.close()
        self.agents = []

    def _results_for(
        self, result: StepResult, more: Mapping[str, Any]
    ) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """Return what each is told; in the array form infos hold numbers alone, which libraries make tensors of."""
        observations: dict[str, Any] = {}
        infos: dict[str, dict[str, Any]] = {}
        for name in self.possible_agents:
            observation, info = self.stage.env.told(name, result)
            observations[name] = with_goal(observation, self.stage.goal(name, result), self.stage.goal_space)
            if self._plain_infos:
                infos[name] = {
                    key: float(value) for key, value in more.items() if isinstance(value, bool | int | float)
                }
            else:
                infos[name] = {**info, **more}
        return observations, infos
