"""Shows how it is done: drives up to the thing, and picks and places by what the robot sees and feels."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.agents.robot.body import Stance
from vico.agents.robot.increments import JOINTS
from vico.agents.robot.stages import Stage
from vico.agents.robot.worker import ArmWorker
from vico.assets.robots import robot_model
from vico.challenges.pick_place.episode import Observation
from vico.challenges.pick_place.task import PickPlaceTask
from vico.challenges.robot.bodies import arm_body

#: What it is called in the records of a dataset.
METHOD = "arm_worker"
# Nearer than that the arm's own skills bring the base up, metres; on the way there, m/s and rad/s.
_NEAR, _FASTEST, _TURNS, _GAIN, _AHEAD = 1.2, 0.5, 0.8, 1.5, 0.15


class Demonstrator:
    """An `ArmWorker` that is told which thing it is about and where to put it.

    All it does are speeds of the base and places of the servos: what a policy can do, too.

    Attributes
    ----------
    why
        What did not work; empty if all did.
    """

    def __init__(self, *, period: float) -> None:
        self._worker = ArmWorker(arm_body(robot_model("manipulator")), period=period)
        self._task: PickPlaceTask | None = None
        self._entity = 0
        self._begun = 0
        self._servos: list[float] = []
        self.why = ""

    def begin(self, task: PickPlaceTask, entity: int) -> None:
        """Take up a task; the thing is the entity in what the robot sees."""
        self._task, self._entity = task, entity

    def act(self, observation: Observation, instruction: str) -> dict[str, Any] | None:
        """Return the action for the coming period; None once all is done, or given up."""
        assert self._task is not None
        if not self._servos:
            self._servos = [float(angle) for angle in observation["sensors"]["joint_position"]]
        worker = self._worker
        if self._begun and not worker.busy:
            self.why = worker.why
            if worker.outcome == "failed" or self._begun == 2:
                return None
        goal = np.array(self._task.spot if self._begun and not worker.busy else self._task.thing.position)
        if not worker.busy:
            way = self._approach(observation, goal)
            if way is not None:
                return way
            self._begun += 1
            if self._begun == 1:
                worker.pick(self._entity, goal)
            else:
                worker.place(goal)
        action = worker.act(observation)
        if action["type"] != "control":  # it would drive by the map, which is no speeds
            self.why = "drifted off"
            return None
        self._servos = action["vector"][: len(JOINTS)]
        return action if worker.busy or worker.stage is Stage.IDLE else None

    def _approach(self, observation: Observation, goal: NDArray[np.float64]) -> dict[str, Any] | None:
        """Return speeds that bring the base straight near a goal; None if it is there."""
        x, y, _ = Stance.of(observation).inside(goal).tolist()
        distance, bearing = math.hypot(x, y), math.atan2(y, x)
        if distance <= _NEAR:
            return None
        turn = min(max(_GAIN * bearing, -_TURNS), _TURNS)
        forward = min(0.08 + distance - _NEAR, _FASTEST) if abs(bearing) < _AHEAD else 0.0
        return {"type": "control", "vector": [*self._servos, forward, turn]}
