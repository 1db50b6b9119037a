"""Point goal: go to a point that is told by direction and distance, on foot or as a robot."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from scipy import sparse

from vico.agents.base import heading
from vico.challenges.learning.env import TaskStep
from vico.envs import CommunityEnv, StepResult, make
from vico.envs.array_observations import DIRECTION, HIGH, LOW, direction
from vico.errors import EmptyInputError, InputError
from vico.seeds import rng
from vico.world.walkable import WalkableMap
from vico.world.world import World

#: What people may do on the way.
KINDS = ("move_forward", "turn_left", "turn_right", "wait")
_TRIES = 50
# How far round start and goal ways are looked for, metres.
_MARGIN = 30.0


@dataclass(frozen=True, kw_only=True)
class PointGoalOptions:
    """What a point goal is.

    Attributes
    ----------
    robot
        A model with a space of velocities, such as ``"go2:velocity"`` or ``"husky:velocity"``; empty: a person.
    least, most
        Metres from start to goal as the crow flies.
    reach
        Metres from the goal at which one is there.
    reward
        ``"sparse"`` or ``"shaped"``.
    max_steps
        Of an episode.
    period
        Control period of a robot, seconds.
    """

    robot: str = ""
    least: float = 8.0
    most: float = 30.0
    reach: float = 2.0
    reward: str = "shaped"
    max_steps: int = 120
    period: float = 0.5


class PointGoal:
    """Go to a point.

    Task: be within `PointGoalOptions.reach` metres of a point outdoors.

    Randomisation: start and heading; the goal, so far from it as the options say, with a way on foot between them.

    Success: being there; it ends the episode.

    Reward: 1 for being there. Shaped: a tenth of the metres that the way to the goal became shorter (along the free
    ground of the public map), and -0.01 a step.
    """

    def __init__(self, world: World, options: PointGoalOptions, **settings: Any) -> None:
        if options.reward not in ("sparse", "shaped"):
            raise InputError(f"env: reward is {options.reward!r}; use 'sparse' or 'shaped'")
        if not 0.0 < options.reach < options.least <= options.most:
            raise InputError(
                f"env: reach {options.reach:g}, least {options.least:g} and most {options.most:g} metres; they have to "
                "grow in this order"
            )
        self.options = options
        self.agent = "robot_0" if options.robot else "assistant_0"
        who: dict[str, Any] = {"robots": (options.robot,)} if options.robot else {"assistants": 1}
        if options.robot:
            who["periods"] = {"robot_0": options.period}
        given = {"observe": "none", "transit": False, "max_steps": options.max_steps, **who, **settings}
        self.env: CommunityEnv = make(world, None, **given)
        self.goal_space = spaces.Box(LOW, HIGH, (DIRECTION,), np.float32)
        self._goal = np.zeros(2)
        self._ways: NDArray[np.float64] | None = None
        self._corner = (0, 0)
        self._away = math.inf

    def begin(self, seed: int) -> StepResult:
        """Draw start and goal."""
        chance = rng(seed, "point goal", self.env.world.digest)
        start, self._goal = self._draw(chance)
        yaw = float(chance.uniform(-math.pi, math.pi))
        if self.options.robot:
            self.env.arrange(robot_places={self.agent: (float(start[0]), float(start[1]), yaw)})
        else:
            self.env.arrange(setup=lambda sim: sim.scenario.place_agent(self.agent, (*start.tolist(), 0.0), yaw=yaw))
        result = self.env.begin(seed)
        self._away = self._way_from(self._position(result))
        return result

    def act(self, action: Mapping[str, Any]) -> TaskStep:
        """Take a step."""
        result = self.env.advance({self.agent: action})
        position = self._position(result)
        before, self._away = self._away, self._way_from(position)
        arrived = float(np.hypot(*(position - self._goal))) <= self.options.reach
        reward = float(arrived)
        if self.options.reward == "shaped":
            reward += (before - self._away) / 10.0 - 0.01
        return TaskStep(
            result,
            reward,
            terminated=arrived,
            truncated=not arrived and not self.env.agents,
            info={"is_success": arrived, "distance": self._away},
        )

    def allows(self, action: Mapping[str, Any]) -> bool:
        """Everything."""
        return True

    def goal(self, result: StepResult) -> NDArray[np.float32]:
        """Return the direction of the goal; see `vico.envs.array_observations.DIRECTION`."""
        observation = result.observations[self.agent]
        pose = np.asarray(observation["pose"], np.float64)
        return np.array(direction(self._goal, pose, heading(observation)), np.float32)

    def phrases(self) -> list[str]:
        """Nothing is said."""
        return []

    def instructions(self) -> Mapping[str, Any]:
        """Return the point, ENU metres."""
        return {"instructions": f"Go to the point {self._goal[0]:.1f} m east, {self._goal[1]:.1f} m north."}

    def _position(self, result: StepResult) -> NDArray[np.float64]:
        return np.asarray(result.observations[self.agent]["pose"][:2], np.float64)

    def _draw(self, chance: np.random.Generator) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Draw start and goal, and find the ways to the goal."""
        walkable, options = self.env.world.walkable, self.options
        room = 1.0 if options.robot else 0.5
        for _ in range(_TRIES):
            start = walkable.random_point(chance, clearance=room)
            try:
                goal = walkable.random_point(chance, near=start, radius=options.most, clearance=room)
            except InputError:
                continue
            if float(np.hypot(*(goal - start))) < options.least:
                continue
            self._ways, self._corner = path_lengths_to(walkable, goal, options.most + _MARGIN)
            if math.isfinite(self._way_from(start)):
                self._goal = goal
                return start, goal
        raise EmptyInputError(
            f"point goal: {self.env.world.manifest.name} has no two points {options.least:g} to {options.most:g} m "
            "apart with a way between them; change least and most"
        )

    def _way_from(self, point: NDArray[np.float64]) -> float:
        """Return how long the way from a point to the goal is, metres; as before where the point is off the map."""
        assert self._ways is not None
        ix, iy = self.env.world.walkable.cell_of(point).tolist()
        row, column = iy - self._corner[1], ix - self._corner[0]
        rows, columns = self._ways.shape
        if not (0 <= row < rows and 0 <= column < columns):
            return self._away
        # Bodies stand up to a cell off the cells that count as free.
        near = self._ways[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2]
        least = float(near.min())
        exact = float(self._ways[row, column])
        found = exact if math.isfinite(exact) else least
        return found if math.isfinite(found) else self._away


def path_lengths_to(
    walkable: WalkableMap, goal: NDArray[np.float64], radius: float
) -> tuple[NDArray[np.float64], tuple[int, int]]:
    """Return how long the way to a goal is from each cell around it.

    Parameters
    ----------
    radius
        Half the side of the square round the goal that is looked at, metres.

    Returns
    -------
    tuple
        Metres over cells that are free, infinite where there is no way, shape ``(rows, columns)``, and column and row
        of the first one.
    """
    (left, bottom), (right, top) = walkable.cell_of([goal - radius, goal + radius]).tolist()
    free = walkable.connected[bottom : top + 1, left : right + 1]
    rows, columns = free.shape
    number = np.arange(rows * columns).reshape(rows, columns)
    pairs, lengths = [], []
    for down, along in ((0, 1), (1, 0), (1, 1), (1, -1)):
        a = (slice(0, rows - down), slice(max(0, -along), columns - max(0, along)))
        b = (slice(down, rows), slice(max(0, along), columns - max(0, -along)))
        both = free[a] & free[b]
        pairs.append(np.column_stack([number[a][both], number[b][both]]))
        lengths.append(np.full(int(both.sum()), walkable.cell * math.hypot(down, along)))
    edges, weights = np.concatenate(pairs), np.concatenate(lengths)
    graph = sparse.csr_matrix((weights, (edges[:, 0], edges[:, 1])), shape=(rows * columns,) * 2)
    column, row = walkable.cell_of(goal).tolist()
    away = sparse.csgraph.dijkstra(graph, directed=False, indices=int(number[row - bottom, column - left]))
    return np.asarray(away, np.float64).reshape(rows, columns), (left, bottom)
