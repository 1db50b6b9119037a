"""Policies of manipulation: trained ones as plain arrays, two of them in turn, and a scripted expert.

A trained policy is dense layers with ELU between them, run by numpy alone; a controller runs it on a robot in a
city's simulation. The expert knows where the box is, plans by inverse kinematics, and acts as any policy does.
"""

from __future__ import annotations

import math
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from itertools import accumulate
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import MobileManipulator, robot_model
from vico.challenges.learning.manipulation.environment import ManipulationEnv
from vico.challenges.learning.manipulation.observation import FULL, PRESSING, Readings, hand_poses, observe
from vico.challenges.learning.manipulation.scene import (
    ACTIONS,
    JAW,
    PAD,
    Array,
    ManipulationOptions,
    hand_of_robot,
    motors_of,
)
from vico.errors import InputError, MissingFileError, SchemaError
from vico.exact import apply_matrix, each, product
from vico.io.arrays import read_npz
from vico.io.files import new_file
from vico.kinematics.hand_paths import downward, path_down

Numbers = NDArray[np.float32]

_KNOWN = ("weight_", "bias_")


@dataclass(frozen=True)
class ArrayPolicy:
    """A network from observations to actions.

    Attributes
    ----------
    weights, biases
        Of its layers, float32, shapes ``(outputs, inputs)`` and ``(outputs,)``.
    mean, deviation
        Observations are shifted and scaled by these first, shape ``(inputs,)``.
    """

    weights: tuple[Numbers, ...]
    biases: tuple[Numbers, ...]
    mean: Numbers
    deviation: Numbers

    @property
    def inputs(self) -> int:
        """How many numbers an observation has."""
        return int(self.weights[0].shape[1])

    @property
    def outputs(self) -> int:
        """How many numbers an action has."""
        return int(self.weights[-1].shape[0])

    def act(self, observation: NDArray[Any]) -> Numbers:
        """Return actions, float32, shape ``(..., outputs)``, each number from -1 to 1.

        Parameters
        ----------
        observation
            Shape ``(..., inputs)``.

        Raises
        ------
        SchemaError
            If observations have another number of entries.
        """
        x = np.asarray(observation, np.float32)
        if x.shape[-1:] != (self.inputs,):
            raise SchemaError(
                f"policy: an observation of shape {x.shape} for a network of {self.inputs} inputs; make the "
                "environment with the task and observation that it was trained on"
            )
        x = np.asarray((x - self.mean) / self.deviation, np.float32)
        for layer, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            x = np.asarray(apply_matrix(x, weight) + bias, np.float32)
            if layer < len(self.weights) - 1:
                x = np.where(x > 0.0, x, each(math.expm1, np.minimum(x, 0.0)).astype(np.float32))
        return np.clip(x, -1.0, 1.0).astype(np.float32)


def write_policy(path: Path, policy: ArrayPolicy) -> None:
    """Write a policy as an archive of plain arrays.

    Raises
    ------
    OutputError
        If it cannot be written.
    """
    layers = zip(policy.weights, policy.biases, strict=True)
    arrays = {name: a for k, (w, b) in enumerate(layers) for name, a in ((f"weight_{k}", w), (f"bias_{k}", b))}
    with new_file(path) as temporary, temporary.open("wb") as file:
        np.savez(file, allow_pickle=False, mean=policy.mean, deviation=policy.deviation, **arrays)


def read_policy(path: Path | str, *, inputs: int | None = None, outputs: int | None = None) -> ArrayPolicy:
    """Read a policy; nothing in the file is ever run.

    Parameters
    ----------
    inputs, outputs
        What it is to have.

    Raises
    ------
    MissingFileError
        If there is no such file.
    SchemaError
        If it is no archive of plain arrays, or its arrays do not fit each other or what was asked for.
    """
    path = Path(path)
    try:
        arrays = read_npz(path.read_bytes())
    except FileNotFoundError:
        raise MissingFileError(f"policy: {path}: no such file") from None
    except (ValueError, OSError, EOFError, zipfile.BadZipFile, zlib.error):
        raise SchemaError(
            f"policy: {path} is no archive of plain arrays (pickled objects are refused); write it with "
            "scripts/train_manipulation.py"
        ) from None
    count = sum(name.startswith("weight_") for name in arrays)
    names = {f"{kind}{k}" for kind in _KNOWN for k in range(count)} | {"mean", "deviation"}
    if not count or names != set(arrays):
        raise SchemaError(f"policy: {path} holds {', '.join(sorted(arrays))[:200] or 'nothing'}; expected weight_0, "
                          "bias_0, weight_1 and on, mean and deviation")  # fmt: skip
    for name, array in arrays.items():
        if array.dtype != np.float32 or not np.isfinite(array).all():
            raise SchemaError(f"policy: {path}: {name} is {array.dtype}, or holds NaN; all have to be finite float32")
    weights = tuple(arrays[f"weight_{k}"] for k in range(count))
    biases = tuple(arrays[f"bias_{k}"] for k in range(count))
    width = arrays["mean"].shape
    for k, (weight, bias) in enumerate(zip(weights, biases, strict=True)):
        if weight.ndim != 2 or weight.shape[1:] != width or bias.shape != weight.shape[:1]:
            raise SchemaError(
                f"policy: {path}: weight_{k} has shape {weight.shape} and bias_{k} {bias.shape} after {width}; "
                "layers have to fit each other"
            )
        width = bias.shape
    if arrays["deviation"].shape != arrays["mean"].shape or not (arrays["deviation"] > 0.0).all():
        raise SchemaError(f"policy: {path}: deviation has to have the shape of mean, and to be above 0")
    policy = ArrayPolicy(weights, biases, arrays["mean"], arrays["deviation"])
    for what, has, wanted in (("inputs", policy.inputs, inputs), ("outputs", policy.outputs, outputs)):
        if wanted is not None and has != wanted:
            raise SchemaError(
                f"policy: {path} has {has} {what}, not {wanted}: it was trained on another task or observation"
            )
    return policy


_ENDS = list(accumulate(FULL.values()))
#: Where in an observation its entries are.
PLACES = {name: slice(end - FULL[name], end) for name, end in zip(FULL, _ENDS, strict=True)}
_GOAL = 0.2  # metres above where it stood that a lifted box is to be
_LIFTED = 0.12  # metres from which on it counts as lifted
_DROPPED = 0.03  # metres below which it counts as dropped
_NEAR = 0.1


class DecomposedPolicy:
    """Lifts, then places, in `PickPlace` with full observations; takes what was dropped up again.

    Parameters
    ----------
    lift, place
        Trained on `Lift` and `Place`.

    Raises
    ------
    InputError
        If they were trained on other observations.
    """

    def __init__(self, lift: ArrayPolicy, place: ArrayPolicy) -> None:
        for name, policy in (("lift", lift), ("place", place)):
            if policy.inputs != sum(FULL.values()):
                raise InputError(
                    f"policy: {name} has {policy.inputs} inputs, not {sum(FULL.values())}; train it on full ones"
                )
        self._lift, self._place = lift, place
        self.reset()

    def reset(self) -> None:
        """Forget; the next observations are of episodes that begin."""
        self._start = np.zeros((0, 3), np.float32)
        self.places = np.zeros(0, bool)

    def act(self, seen: Numbers) -> Numbers:
        """Return actions of all copies, shape ``(n, 8)``, given their observations, shape ``(n, 42)``."""
        box, away = seen[:, PLACES["object"]], seen[:, PLACES["object_to_goal"]]
        if len(self._start) != len(seen):
            self._start, self.places = box.copy(), np.zeros(len(seen), bool)
        lifted = box[:, 2] - self._start[:, 2]
        held = (seen[:, PLACES["pressing"]] > 0.5).all(axis=1)
        there = np.linalg.norm(away, axis=1) < _NEAR
        dropped = self.places & ~held & ~there & (lifted < _DROPPED)
        # What was dropped lies somewhere else now.
        self._start[dropped] = box[dropped]
        self.places = (self.places | (held & (lifted > _LIFTED))) & ~dropped
        return np.where(self.places[:, None], self._place.act(seen), self._lift.act(self._as_lift(seen)))

    def _as_lift(self, seen: Numbers) -> Numbers:
        """Return observations with the goal that lifting has: above where the box stood."""
        told = seen.copy()
        up = self._start + np.array([0.0, 0.0, _GOAL], np.float32) - seen[:, PLACES["object"]]
        told[:, PLACES["object_to_goal"]] = up
        told[:, PLACES["hand_to_goal"]] = seen[:, PLACES["hand_to_object"]] + up
        return told


class ArmState(NamedTuple):
    """What is known of an arm and its box. Vectors are in the frame of the robot's base, metres.

    Attributes
    ----------
    joints, joint_rates
        Of the arm and both fingers, rad and metres (a second), shape ``(9,)``.
    box, box_rotation
        Its middle, shape ``(3,)``, and its axes in columns, shape ``(3, 3)``.
    half
        Half its sides, shape ``(3,)``.
    goal
        Where its middle is to be, shape ``(3,)``.
    pressing
        Whether each finger touches it, shape ``(2,)``.
    """

    joints: Array
    joint_rates: Array
    box: Array
    box_rotation: Array
    half: Array
    goal: Array
    pressing: NDArray[np.bool_]


class ArmController:
    """Asks a policy 20 times a second, and keeps the targets that its increments add up to.

    The base is told to the policy as standing where it is.

    Parameters
    ----------
    policy
        From observations, shape ``(1, size)``, to actions, shape ``(1, 8)``: `ArrayPolicy.act`, `DecomposedPolicy.act`.
    options
        That it was trained with.
    """

    def __init__(self, policy: Callable[[NDArray[np.float32]], NDArray[Any]], options: ManipulationOptions) -> None:
        arm = robot_model("manipulator").controller
        assert isinstance(arm, MobileManipulator)
        self._policy, self._options = policy, options
        self._motors, self._hand = motors_of(arm, options), hand_of_robot()
        self._targets: Array | None = None

    def reset(self, targets: Array | None = None) -> None:
        """Begin anew from what the motors are told now, shape ``(9,)``; None: from where the joints are."""
        self._targets = None if targets is None else np.append(targets[:7], targets[7:9].mean())[None]

    def targets(self, moment: ArmState) -> Array:
        """Return the next targets of the arm's joints and both fingers, rad and metres, shape ``(9,)``."""
        joints = np.append(moment.joints[:7], moment.joints[7:9].mean())[None]
        before = joints if self._targets is None else self._targets
        action = np.asarray(self._policy(self.observation(moment)), np.float64)
        self._targets = self._motors.move_targets(before, joints, action)
        return np.append(self._targets[0], self._targets[0, JAW])

    def observation(self, moment: ArmState) -> NDArray[np.float32]:
        """Return what the policy is told, shape ``(1, size)``."""
        up = np.array([0.0, 0.0, self._hand.stand])
        hand = np.empty((1, 3, 4))
        hand_poses(self._hand.chain, np.ascontiguousarray(moment.joints[None, :7]), hand)
        jaw, jaw_rate = moment.joints[7:9].mean(), moment.joint_rates[7:9].mean()
        box = (moment.box + up)[None]
        readings = Readings(
            joints=np.append(moment.joints[:7], jaw)[None],
            joint_rates=np.append(moment.joint_rates[:7], jaw_rate)[None],
            base=up[None],
            base_rotation=np.eye(3)[None],
            hand=hand[:, :, 3] + up,
            hand_rotation=hand[:, :, :3],
            thing=box,
            thing_rotation=moment.box_rotation[None],
            thing_speed=np.zeros((1, 2)),
            pressure=np.where(moment.pressing, 2.0 * PRESSING, 0.0)[None],
            targets=np.zeros((1, 8)),
            half=moment.half[None],
            surface=np.zeros(1),
            start=box,
            goal=(moment.goal + up)[None],
            at_goal=np.zeros(1, np.int64),
            was_lifted=np.zeros(1, bool),
        )
        return observe(readings, self._options.observation)


#: Tilts of the hand that are tried, rad, and turns about the vertical of what is put down.
_TILTS = (0.0, 0.25, -0.25, 0.5, -0.5)
_TURNS = tuple(k * math.pi / 4 for k in (0, 1, -1, 2, -2, 3, -3, 4))
_ROOM = 0.02  # metres that the jaw is wider than the box, on each side
_THERE = 0.02  # rad to which a joint has to come near
_CLOSING = 40  # steps that closing takes, at most
_PRESSES = 3  # steps that pads press before the hand goes up
_DROP = 0.006  # metres above its ground at which a box is let go


class ExpertPhase(Enum):
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
        self._opening = float(env.readings.targets[0, JAW])
        self._way: list[Array] = []
        self._up: list[Array] = []
        self.stage = ExpertPhase.DOWN
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
            self.stage = ExpertPhase.CARRY
            self._plan_carry(r)
            return
        half = self.env.copies.half[0]
        grip = r.grasp_point[0] - [0.0, 0.0, self._stand]
        goals = []
        for axis in np.argsort(half[:2]).tolist():
            along = r.thing_rotation[0, :2, axis]
            goals += [downward(grip, sign * along, tilt) for tilt in _TILTS for sign in (1.0, -1.0)]
        found = path_down(self._chain, r.joints[0, :7].copy(), goals, holds=False)
        if found is None:
            self.stage = ExpertPhase.DONE
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
        found = path_down(self._chain, r.joints[0, :7].copy(), turned, holds=True)
        if found is None:
            self.stage = ExpertPhase.DONE
            return
        way, down = found
        self._way, self._up = list(way[: down + 1]), list(way[down + 1 :])

    def _follow(self, r: Readings) -> Array:
        """Return the arm's part of an action: all joints come to the next angles together."""
        step = self.env.options.joint_step
        now = r.targets[0, :7]
        while self._way and float(np.abs(self._way[0] - now).max()) < 1e-9:
            self._way.pop(0)
        if not self._way or (self.stage is ExpertPhase.DOWN and self._is_in_the_way(r)):
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
        return bool(low and r.joints[0, JAW] < self._opening - 0.01)

    def _jaw_of(self, r: Readings) -> float:
        now, step = float(r.targets[0, JAW]), self.env.options.finger_step
        if self.stage in (ExpertPhase.DOWN, ExpertPhase.OPEN):
            return (self._opening - now) / step
        return -1.0 if self.stage in (ExpertPhase.CLOSE, ExpertPhase.UP, ExpertPhase.CARRY) else 0.0

    def _is_done(self, r: Readings) -> bool:
        """Return whether the stage is over, as the way is."""
        self._waited += 1
        if self.stage is ExpertPhase.CLOSE:
            self._pressed = self._pressed + 1 if bool(r.is_gripped[0]) else 0
            return self._pressed >= _PRESSES or self._waited > _CLOSING
        if self.stage is ExpertPhase.OPEN:
            return bool(r.joints[0, JAW] > self._opening - 0.004) or self._waited > _CLOSING
        return bool(np.abs(r.joints[0, :7] - r.targets[0, :7]).max() < _THERE) or self._waited > _CLOSING

    def _next(self, r: Readings) -> None:
        """Go over to the next stage."""
        self._waited = 0
        if self.stage is ExpertPhase.DOWN:
            self.stage = ExpertPhase.DONE if self._task == "reach" else ExpertPhase.CLOSE
        elif self.stage is ExpertPhase.CLOSE:
            self.stage, self._way = ExpertPhase.UP, self._up
        elif self.stage is ExpertPhase.UP and self._task == "pick_place":
            self.stage = ExpertPhase.CARRY
            self._plan_carry(r)
        elif self.stage is ExpertPhase.CARRY:
            self.stage = ExpertPhase.OPEN
            self._opening = float(r.joints[0, JAW]) + _ROOM
        elif self.stage is ExpertPhase.OPEN:
            self.stage, self._way = ExpertPhase.BACK, self._up
        elif self.stage is ExpertPhase.BACK:
            self.stage = ExpertPhase.DONE
