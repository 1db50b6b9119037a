"""The community assistant's tasks for one learner: Carry, Delivery and Search; see `vico.challenges.assistant`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from vico.agents.base import heading
from vico.agents.single import action_function
from vico.challenges.assistant.challenge import CARS, PEDESTRIANS, residents_of_task, set_up
from vico.challenges.assistant.evaluate import Judge
from vico.challenges.assistant.generate import generate_task
from vico.challenges.assistant.tasks import STEPS, Category, Subtask, Task
from vico.challenges.episodes import for_size
from vico.challenges.learning.env import TaskStep
from vico.clock import seconds_of_day
from vico.community.model import Community
from vico.english import split_name
from vico.envs import CommunityEnv, StepResult, make
from vico.envs.array_observations import DIRECTION, HIGH, LOW, PEOPLE, THINGS, direction, surroundings_of
from vico.errors import InputError
from vico.runner.loop import Step
from vico.world.world import World

AGENT = "assistant_0"
#: Subtasks of an episode, and regions that one of them names as sources: more are not told in numbers.
SUBTASKS, SOURCES = 6, 3
# Of a subtask: whether it was reported, how many things it is about by two, directions of sources and destination.
_ROW = 2 + (SOURCES + 1) * DIRECTION
_HELD = 0.25  # of the potential: holding a thing
_NEARER = 0.25  # bringing it nearer
_NEAR = 0.25  # being near to what is next
_FAR = 200.0  # metres within which that counts


@dataclass(frozen=True, kw_only=True)
class AssistantOptions:
    """What an episode is.

    Attributes
    ----------
    reward
        ``"sparse"`` or ``"shaped"``.
    advanced
        Whether it is of the advanced setting.
    max_steps
        Of an episode.
    """

    reward: str = "sparse"
    advanced: bool = False
    max_steps: int = STEPS


class AssistantTask:
    """Carry, Delivery or Search for one assistant.

    Task, randomisation and success are those of the challenge.

    Reward: 1 when a subtask comes to be done, and -1 when one comes undone before it was reported, so that an episode's
    rewards sum up to the subtasks that count as done at its end. Shaped: the change of a potential beside it, which
    sums up to its last value less its first: for each subtask that is not reported 0.25 for its things in the
    assistant's hands, 0.25 for the share of their way that they were brought nearer to where they belong, and 0.25
    times ``1 - metres / 200`` to what is next (the destination of what it holds, else the nearest thing, or person with
    Carry, of a subtask that is not reported). The potential knows where things are; the agent is not told.
    """

    def __init__(
        self, world: World, community: Community, category: Category, options: AssistantOptions, **settings: Any
    ) -> None:
        if options.reward not in ("sparse", "shaped"):
            raise InputError(f"env: reward is {options.reward!r}; use 'sparse' or 'shaped'")
        self.options, self.category, self.agent = options, category, AGENT
        given = {
            "assistants": 1,
            "cars": for_size(CARS, world),
            "pedestrians": for_size(PEDESTRIANS, world),
            "observe": (AGENT,),
            "max_steps": options.max_steps,
            **settings,
        }
        self.env: CommunityEnv = make(world, community, **given)
        self._community = community
        self._known: dict[int, Task] = {}
        self.goal_space = spaces.Box(LOW, HIGH, (SUBTASKS * _ROW + THINGS + PEOPLE,), np.float32)
        self._steps = self._done = 0
        self._potential = 0.0

    def begin(self, seed: int) -> StepResult:
        """Draw the task of a seed."""
        world = self.env.world
        if seed not in self._known:
            self._known[seed] = generate_task(
                world,
                self._community,
                self.category,
                seed=seed,
                advanced=self.options.advanced,
                steps=self.options.max_steps,
            )
        self._task = task = self._known[seed]
        self.env.arrange(partial(set_up, task=task), start=seconds_of_day(task.start))
        self._result = self.env.begin(task.seed)
        self._others = action_function(residents_of_task(task, self._community, self.env.public_map))
        self._judge = Judge(task, world, self.env.sim.ground_truth, [AGENT])
        self._judge.watch(0)
        self._steps, self._done = 0, self._count()
        self._ways = [self._to_go(k) for k in range(len(task.subtasks))]
        self._potential = self._value()
        return self._result

    def act(self, action: Mapping[str, Any]) -> TaskStep:
        """Let the residents and the assistant act for a second, and judge."""
        others = self._others(self._result.observations, self._result.infos)
        self._result = self.env.advance({**others, AGENT: action})
        self._steps += 1
        self._judge.on_step(Step(self._steps, {AGENT: dict(action)}, {}, self._result))
        done, self._done = self._done, self._count()
        reward = float(self._done - done)
        if self.options.reward == "shaped":
            before, self._potential = self._potential, self._value()
            reward += self._potential - before
        over = self._judge.over
        cut = not over and not self.env.agents
        reported = sum(verdict is not None for verdict in self._judge.verdicts)
        info: dict[str, Any] = {"done": self._done, "reported": reported}
        if over or cut:
            info["is_success"] = all(self._judge.final())
        return TaskStep(self._result, reward, terminated=over, truncated=cut, info=info)

    def allows(self, action: Mapping[str, Any]) -> bool:
        """Everything but reports of what there is not, or was reported."""
        if action.get("type") != "task_complete":
            return True
        index = action.get("index", -1)
        return 0 <= index < len(self._judge.verdicts) and self._judge.verdicts[index] is None

    def goal(self, result: StepResult) -> NDArray[np.float32]:
        """Return the subtasks as rows of numbers, and what in view belongs to which.

        A row has: whether it was reported; things / 2; the directions of up to three sources, and of the destination
        (`vico.envs.array_observations.DIRECTION`; zeros where there is none). Behind the rows stand, for each thing and
        then for each person that the observation tells of, in its order, ``(subtask + 1) / 6``, or 0.
        """
        observation = result.observations[AGENT]
        pose = np.asarray(observation["pose"], np.float64)
        yaw = heading(observation)
        rows = np.zeros((SUBTASKS, _ROW))
        for k, subtask in enumerate(self._task.subtasks[:SUBTASKS]):
            rows[k, 0] = self._judge.verdicts[k] is not None
            rows[k, 1] = len(subtask.objects) / 2.0
            regions = [*subtask.sources[:SOURCES], *[None] * (SOURCES - len(subtask.sources)), subtask.destination]
            for j, region in enumerate(regions):
                if region is not None:
                    rows[k, 2 + j * DIRECTION :][:DIRECTION] = direction(region.centre, pose, yaw)
        around = surroundings_of(observation, result.infos[AGENT], self.env.public_map)
        names = {name: k for k, things in enumerate(self._judge.things) for name in things}
        people = {s.person.agent: k for k, s in enumerate(self._task.subtasks)} if self.category == "carry" else {}
        marks = np.zeros(THINGS + PEOPLE)
        for k, thing in enumerate(around.things):
            marks[k] = (names.get(thing.name, -1) + 1) / SUBTASKS
        for k, person in enumerate(around.people):
            marks[THINGS + k] = (people.get(person.name, -1) + 1) / SUBTASKS
        return np.concatenate([rows.reshape(-1), marks]).astype(np.float32)

    def phrases(self) -> list[str]:
        """Return what is said to those who want help with carrying, one a subtask."""
        if self.category != "carry":
            return []
        return [
            f"Hello {split_name(subtask.person.name)[1]}! May I help?" for subtask in self._task.subtasks[:SUBTASKS]
        ]

    def instructions(self) -> Mapping[str, Any]:
        """Return the instructions, as planners get them."""
        return {"instructions": self._task.instructions()}

    def _count(self) -> int:
        return sum(self._judge.final())

    def _open(self) -> list[int]:
        return [k for k, verdict in enumerate(self._judge.verdicts) if verdict is None]

    def _to_go(self, k: int) -> float:
        """Return how far a subtask's things are from where they belong, metres; 0 where they belong nowhere."""
        destination = self._task.subtasks[k].destination
        if destination is None:
            return 0.0
        truth = self.env.sim.ground_truth
        return sum(_ground_distance(truth.object_position(name), destination.centre) for name in self._judge.things[k])

    def _value(self) -> float:
        """Return the potential."""
        truth, value = self.env.sim.ground_truth, 0.0
        for k in self._open():
            things = self._judge.things[k]
            value += _HELD * sum(truth.object_holder(name) == AGENT for name in things) / len(things)
            if self._ways[k] > 0.0:
                value += _NEARER * max(-1.0, 1.0 - self._to_go(k) / self._ways[k])
        return value + _NEAR * (1.0 - min(1.0, self._next_away() / _FAR))

    def _next_away(self) -> float:
        """Return how far it is to what is next, metres."""
        truth = self.env.sim.ground_truth
        here = truth.agent_position(AGENT)
        subtasks = [(k, self._task.subtasks[k]) for k in self._open()]
        held = [
            _ground_distance(here, s.destination.centre)
            for k, s in subtasks
            if s.destination is not None and any(truth.object_holder(n) == AGENT for n in self._judge.things[k])
        ]
        return min(held or [self._source_away(k, subtask) for k, subtask in subtasks], default=0.0)

    def _source_away(self, k: int, subtask: Subtask) -> float:
        truth = self.env.sim.ground_truth
        here = truth.agent_position(AGENT)
        if self.category == "carry":
            return _ground_distance(here, truth.agent_position(subtask.person.agent))
        return min(_ground_distance(here, truth.object_position(name)) for name in self._judge.things[k])


def _ground_distance(a: Any, b: Any) -> float:
    return math.dist((float(a[0]), float(a[1])), (float(b[0]), float(b[1])))
