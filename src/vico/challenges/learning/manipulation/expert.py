"""A scripted expert: it knows where the box is, plans by inverse kinematics, and acts as any policy does.

It proves that a task can be done with the actions that learners have, and makes demonstrations.
"""

from __future__ import annotations

import math
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from vico.challenges.learning.manipulation.environment import ManipulationEnv
from vico.challenges.learning.manipulation.motors import ACTIONS
from vico.challenges.learning.manipulation.readings import Readings, hand_poses
from vico.challenges.learning.manipulation.scene import PAD, Array
from vico.exact import apply_matrix, product
from vico.kinematics.ways import downward, way_down

#: Tilts of the hand that are tried, rad, and turns about the vertical of what is put down.
_TILTS = (0.0, 0.25, -0.25, 0.5, -0.5)
_TURNS = tuple(k * math.pi / 4 for k in (0, 1, -1, 2, -2, 3, -3, 4))
# What the jaw is wider than the box by on each side; how near a joint has to come, rad; steps that closing takes at
# most, and that pads press before the hand goes up; metres that a box is let go of above its ground.
_ROOM, _THERE, _CLOSING, _PRESSES, _DROP = 0.02, 0.02, 40, 3, 0.006


class Stage(Enum):
    """What the expert is at."""

    DOWN, CLOSE, UP, CARRY, OPEN, BACK, DONE = range(7)


class ScriptedExpert:
    """Does Reach, Lift, Place and PickPlace.

    Parameters
    ----------
    env
        Whose state it knows. An episode has just begun.
    """

    def __init__(self, env: ManipulationEnv) -> None:
        self.env = env
        self._chain, self._stand = env.copies.scene.chain, env.copies.scene.stand
        self._task = env.task.name
        self._waited = self._pressed = 0
        self._opening = float(env.readings.targets[0, 7])
        self._way: list[Array] = []
        self._up: list[Array] = []
        self.stage = Stage.DOWN
        self._begin(env.readings)

    def act(self) -> NDArray[np.float32]:
        """Return the next action, float32, shape ``(8,)``."""
        r = self.env.readings
        jaw = self._jaw_of(r)
        arm = self._follow(r)
        if not self._way and self._is_done(r):
            self._next(r)
        found: NDArray[np.float32] = np.clip(np.append(arm, jaw), -1.0, 1.0).astype(np.float32)
        assert found.shape == (ACTIONS,)
        return found

    def _begin(self, r: Readings) -> None:
        if self._task == "place":
            self.stage = Stage.CARRY
            self._plan_carry(r)
            return
        half = self.env.copies.half[0]
        grip = r.grasp_point[0] - [0.0, 0.0, self._stand]
        goals = []
        for axis in np.argsort(half[:2]).tolist():
            along = r.thing_rotation[0, :2, axis]
            goals += [downward(grip, sign * along, tilt) for tilt in _TILTS for sign in (1.0, -1.0)]
        found = way_down(self._chain, r.joints[0, :7].copy(), goals, holds=False)
        if found is None:
            self.stage = Stage.DONE
            return
        way, down = found
        self._way, self._up = list(way[: down + 1]), list(way[down + 1 :])
        across = apply_matrix(self._hand_y(way[down]), r.thing_rotation[0, :2, :2].T)
        self._opening = float(half[int(np.abs(across).argmax())]) - PAD + _ROOM

    def _hand_y(self, angles: Array) -> Array:
        pose = np.empty((1, 3, 4))
        hand_poses(self._chain, angles[None].copy(), pose)
        return np.asarray(pose[0, :2, 1])

    def _plan_carry(self, r: Readings) -> None:
        """Plan the way that brings the box's underside to its goal."""
        goal = r.goal[0] + r.hand[0] - r.thing[0] + [0.0, 0.0, _DROP - self._stand]
        turned = []
        for turn in _TURNS:
            c, s = math.cos(turn), math.sin(turn)
            rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
            at = goal.copy()
            at[:2] = r.goal[0, :2] + apply_matrix(r.hand[0] - r.thing[0], rotation)[:2]
            turned.append(np.column_stack([product(rotation, r.hand_rotation[0]), at]))
        found = way_down(self._chain, r.joints[0, :7].copy(), turned, holds=True)
        if found is None:
            self.stage = Stage.DONE
            return
        way, down = found
        self._way, self._up = list(way[: down + 1]), list(way[down + 1 :])

    def _follow(self, r: Readings) -> Array:
        """Return the arm's part of an action: all joints come to the next angles together."""
        step = self.env.options.joint_step
        now = r.targets[0, :7]
        while self._way and float(np.abs(self._way[0] - now).max()) < 1e-9:
            self._way.pop(0)
        if not self._way or (self.stage is Stage.DOWN and self._is_in_the_way(r)):
            return np.zeros(7)
        # A step may pass several of the angles.
        goal = self._way[0]
        for further in self._way[1:]:
            if float(np.abs(further - now).max()) > step:
                break
            goal = further
            self._way.pop(0)
        away = goal - now
        return np.asarray(away / max(float(np.abs(away).max()), step))

    def _is_in_the_way(self, r: Readings) -> bool:
        """Return whether the jaw has still to open before the hand goes down the last bit."""
        low = r.hand[0, 2] < r.grasp_point[0, 2] + 0.12
        return bool(low and r.joints[0, 7] < self._opening - 0.01)

    def _jaw_of(self, r: Readings) -> float:
        now, step = float(r.targets[0, 7]), self.env.options.finger_step
        if self.stage in (Stage.DOWN, Stage.OPEN):
            return (self._opening - now) / step
        return -1.0 if self.stage in (Stage.CLOSE, Stage.UP, Stage.CARRY) else 0.0

    def _is_done(self, r: Readings) -> bool:
        """Return whether the stage is over, as the way is."""
        self._waited += 1
        if self.stage is Stage.CLOSE:
            self._pressed = self._pressed + 1 if bool(r.gripped[0]) else 0
            return self._pressed >= _PRESSES or self._waited > _CLOSING
        if self.stage is Stage.OPEN:
            return bool(r.joints[0, 7] > self._opening - 0.004) or self._waited > _CLOSING
        return bool(np.abs(r.joints[0, :7] - r.targets[0, :7]).max() < _THERE) or self._waited > _CLOSING

    def _next(self, r: Readings) -> None:
        """Go over to the next stage."""
        self._waited = 0
        if self.stage is Stage.DOWN:
            self.stage = Stage.DONE if self._task == "reach" else Stage.CLOSE
        elif self.stage is Stage.CLOSE:
            self.stage, self._way = Stage.UP, self._up
        elif self.stage is Stage.UP and self._task == "pick_place":
            self.stage = Stage.CARRY
            self._plan_carry(r)
        elif self.stage is Stage.CARRY:
            self.stage = Stage.OPEN
            self._opening = float(r.joints[0, 7]) + _ROOM
        elif self.stage is Stage.OPEN:
            self.stage, self._way = Stage.BACK, self._up
        elif self.stage is Stage.BACK:
            self.stage = Stage.DONE
