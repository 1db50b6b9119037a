"""State of all copies of an environment at a moment, and a learner's observation of it, as arrays."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.challenges.learning.manipulation.scene import JAW, OPENING, PAD, Array, Scene, ready_angles
from vico.exact import each
from vico.io.compiled import compiled
from vico.kinematics.arm import hand_pose

Bools = NDArray[np.bool_]
#: As `vico.agents.robot.grasps`: pads hold the upper part of what is high, and keep off what it stands on, metres.
_BELOW_TOP, _ABOVE_SURFACE = 0.06, 0.047
#: Newtons from which a pad counts as pressing.
PRESSING = 0.5


class Readings(NamedTuple):
    """State of ``n`` copies. Frame: x ahead of where the base stood at first, y left, z up, origin on the ground.

    Attributes
    ----------
    joints, joint_rates
        Of the arm, rad, rad/s, and the jaw (each finger's way), metres, m/s; shape ``(n, 8)``.
    base
        Position of its frame, metres, shape ``(n, 3)``.
    base_rotation
        Shape ``(n, 3, 3)``.
    hand
        Middle between the pads, metres, shape ``(n, 3)``.
    hand_rotation
        Columns: x; the way the jaw opens; the way the fingers point. Shape ``(n, 3, 3)``.
    thing, thing_rotation
        Middle of the box, metres, shape ``(n, 3)``, and its axes in columns, shape ``(n, 3, 3)``.
    thing_speed
        Metres and radians a second, shape ``(n, 2)``.
    pressure
        Force of each pad on the box, newtons, shape ``(n, 2)``.
    targets
        Of the joints and the jaw, as commanded, shape ``(n, 8)``.
    half, surface, start, goal
        Of the episode: half sides of the box; height of what it stands on; where its middle was at first, and is to
        be; metres, shapes ``(n, 3)``, ``(n,)``, ``(n, 3)`` and ``(n, 3)``.
    at_goal
        How many steps the box has been within 0.1 m of the goal without a break, int64, shape ``(n,)``.
    was_lifted
        Whether the jaw has lifted the box in this episode, shape ``(n,)``.
    """

    joints: Array
    joint_rates: Array
    base: Array
    base_rotation: Array
    hand: Array
    hand_rotation: Array
    thing: Array
    thing_rotation: Array
    thing_speed: Array
    pressure: Array
    targets: Array
    half: Array
    surface: Array
    start: Array
    goal: Array
    at_goal: NDArray[np.int64]
    was_lifted: Bools

    @property
    def grasp_point(self) -> Array:
        """Where the middle between the pads is to be, metres, shape ``(n, 3)``."""
        found = self.thing.copy()
        tall = self.height_half
        low = self.thing[:, 2] - tall
        found[:, 2] = np.maximum(self.thing[:, 2] + tall - _BELOW_TOP, low + _ABOVE_SURFACE)
        return found

    @property
    def height_half(self) -> Array:
        """Half the height of the box as it stands, metres, shape ``(n,)``."""
        return np.asarray((np.abs(self.thing_rotation[:, 2, :]) * self.half).sum(axis=1))

    @property
    def lift(self) -> Array:
        """Height of the box's middle above where that was at first, metres, shape ``(n,)``."""
        return np.asarray(self.thing[:, 2] - self.start[:, 2])

    @property
    def clearance(self) -> Array:
        """From what the box stood on to its underside, metres, shape ``(n,)``."""
        return np.asarray(self.thing[:, 2] - self.height_half - self.surface)

    @property
    def pointing(self) -> Array:
        """Cosine of the angle between the fingers and straight down, shape ``(n,)``."""
        return np.asarray(-self.hand_rotation[:, 2, 2])

    @property
    def jaw_in_thing(self) -> Array:
        """The way the jaw opens along the box's axes, shape ``(n, 3)``."""
        return np.einsum("nij,ni->nj", self.thing_rotation, self.hand_rotation[:, :, 1])

    @property
    def squareness(self) -> Array:
        """Cosine of the angle between the way the jaw opens and the nearest axis of the box, shape ``(n,)``."""
        return np.asarray(np.abs(self.jaw_in_thing).max(axis=1))

    @property
    def jaw_turn(self) -> Array:
        """Angle of the way the jaw opens to the box's first level axis, from above to the left, rad, shape ``(n,)``."""
        k, up, first, second = self._level_axes()
        jaw = self.jaw_in_thing
        side = np.where(self.thing_rotation[k, 2, up] < 0.0, -1.0, 1.0)
        return each(math.atan2, side * jaw[k, second], jaw[k, first])

    @property
    def level_half(self) -> Array:
        """Half the box's level sides, the one across the jaw first, and half its height, metres, shape ``(n, 3)``."""
        k, up, first, second = self._level_axes()
        across = np.abs(np.cos(self.jaw_turn)) >= np.sqrt(0.5)
        a, b = self.half[k, first], self.half[k, second]
        return np.column_stack([np.where(across, a, b), np.where(across, b, a), self.half[k, up]])

    def _level_axes(self) -> tuple[NDArray[np.int64], ...]:
        """Return the number of each copy, and which axis of its box stands and which two lie."""
        up = np.abs(self.thing_rotation[:, 2, :]).argmax(axis=1)
        return np.arange(len(up)), up, (up + 1) % 3, (up + 2) % 3

    @property
    def gripped_half(self) -> Array:
        """Half the side of the box that lies across the jaw, metres, shape ``(n,)``."""
        side = np.abs(self.jaw_in_thing).argmax(axis=1)
        return np.asarray(self.half[np.arange(len(side)), side])

    @property
    def gap(self) -> Array:
        """Between each pad and the side of the box if that is in the middle of the jaw, metres, shape ``(n,)``."""
        return np.asarray(self.joints[:, JAW] + PAD - self.gripped_half)

    @property
    def touching(self) -> Bools:
        """Whether either pad presses on the box, shape ``(n,)``."""
        return np.asarray((self.pressure > PRESSING).any(axis=1))

    @property
    def is_gripped(self) -> Bools:
        """Whether both pads press on the box, shape ``(n,)``."""
        return np.asarray((self.pressure > PRESSING).all(axis=1))

    @property
    def goal_distance(self) -> Array:
        """From the box to the goal, metres, shape ``(n,)``."""
        return np.asarray(np.linalg.norm(self.thing - self.goal, axis=1))


@compiled
def hand_poses(chain, angles, out):
    """Write the poses of many hands in their bases' frames, shape ``(n, 3, 4)``."""
    n = angles.shape[1]
    origins, directions = np.empty((n, 3)), np.empty((n, 3))
    for k in range(len(angles)):
        hand_pose(chain, angles[k], origins, directions, out[k])


@compiled
def rotations_of(quaternions, out):
    """Write the matrices of unit quaternions (w, x, y, z), shape ``(n, 3, 3)``."""
    for k in range(len(quaternions)):
        w, x, y, z = quaternions[k, 0], quaternions[k, 1], quaternions[k, 2], quaternions[k, 3]
        out[k, 0, 0], out[k, 0, 1], out[k, 0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
        out[k, 1, 0], out[k, 1, 1], out[k, 1, 2] = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
        out[k, 2, 0], out[k, 2, 1], out[k, 2, 2] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)


class Pose(NamedTuple):
    """Positions, shape ``(n, 3)``, and rotations, shape ``(n, 3, 3)``."""

    position: Array
    rotation: Array


def poses_in(scene: Scene, state: Array) -> tuple[Pose, Pose, Pose]:
    """Return base, hand and box out of MuJoCo's states, shape ``(n, state_size)``."""
    n = len(state)
    positions = state[:, 1 : 1 + scene.model.nq]
    base = Pose(np.tile([0.0, 0.0, scene.stand], (n, 1)), np.tile(np.eye(3), (n, 1, 1)))
    if scene.base is not None:
        base.position[:] = positions[:, scene.base : scene.base + 3]
        rotations_of(np.ascontiguousarray(positions[:, scene.base + 3 : scene.base + 7]), base.rotation)
    hands = np.empty((n, 3, 4))
    hand_poses(scene.chain, np.ascontiguousarray(positions[:, scene.joints[:7]]), hands)
    if scene.base is None:
        hand = Pose(hands[:, :, 3] + base.position, hands[:, :, :3])
    else:
        turned = np.einsum("nij,njk->nik", base.rotation, hands)
        hand = Pose(turned[:, :, 3] + base.position, turned[:, :, :3])
    thing = Pose(positions[:, scene.thing : scene.thing + 3], np.empty((n, 3, 3)))
    rotations_of(np.ascontiguousarray(positions[:, scene.thing + 3 : scene.thing + 7]), thing.rotation)
    return base, hand, thing


#: Entries and how many numbers each has. Positions and vectors are along the axes of the robot's base, metres.
PAPER = {
    "joints": 8,
    "joint_rates": 8,
    "robot": 3,
    "object": 3,
    "hand_to_object": 3,
    "object_to_goal": 3,
    "hand_to_goal": 3,
}
FULL = {
    **PAPER,
    "half_sides": 3,
    "jaw": 3,
    "fingers": 3,
    "pressing": 2,
}
#: Numbers are cut off here.
BOUND = 10.0


# What the numbers of an entry are about, and how far they differ from that.
_INPUT_SCALING: dict[str, tuple[object, object]] = {
    "joint_rates": (0.0, [0.6] * 7 + [0.1]),
    "robot": ([0.0, 0.0, 0.1], 0.1),
    "object": ([0.6, 0.0, 0.1], [0.1, 0.15, 0.25]),
    "hand_to_object": (0.0, 0.2),
    "object_to_goal": (0.0, 0.2),
    "hand_to_goal": (0.0, 0.25),
    "half_sides": (0.075, 0.03),
    "jaw": ([0.0, 0.0, 0.03], [0.7, 0.7, 0.05]),
    "fingers": (0.0, 0.7),
    "pressing": (0.5, 0.5),
}


def input_scaling(observation: str) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return by what a network's inputs are shifted and divided, float32, shape ``(size,)`` each.

    Fixed numbers: with running means a policy changes while nothing is learnt, which an adaptive learning rate takes
    for learning too fast.
    """
    sizes = FULL if observation == "full" else PAPER
    known = {**_INPUT_SCALING, "joints": ([*ready_angles(), OPENING], [0.7] * 7 + [0.05])}
    both = [
        [np.broadcast_to(np.asarray(known[name][k], np.float32), size) for name, size in sizes.items()] for k in (0, 1)
    ]
    return np.concatenate(both[0]), np.concatenate(both[1])


def size_of(observation: str) -> int:
    """Return how many numbers an observation has."""
    return sum((FULL if observation == "full" else PAPER).values())


def observe(readings: Readings, observation: str) -> NDArray[np.float32]:
    """Return the observation of each copy, float32, shape ``(n, size)``.

    ``robot`` is the base's position where it stood at first. ``object`` is seen from the base. ``half_sides`` are half
    the box's level sides, the one across the jaw first, and half its height. ``jaw`` is sine and cosine of four times
    the angle between the way the jaw opens and the box (a box is the same after a quarter turn), and what the jaw is
    wider than the box on each side. ``fingers`` is the way they point, ``pressing`` whether each pad presses on the
    box, which is what the robot's contacts tell.
    """
    r = readings

    def in_base_frame(vector: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.einsum("nij,ni->nj", r.base_rotation, vector)

    parts = [
        r.joints,
        r.joint_rates,
        r.base,
        in_base_frame(r.thing - r.base),
        in_base_frame(r.thing - r.hand),
        in_base_frame(r.goal - r.thing),
        in_base_frame(r.goal - r.hand),
    ]
    if observation == "full":
        turn = 4.0 * r.jaw_turn
        parts += [
            r.level_half,
            np.column_stack([np.sin(turn), np.cos(turn), r.gap]),
            in_base_frame(r.hand_rotation[:, :, 2]),
            (r.pressure > PRESSING).astype(np.float64),
        ]
    return np.clip(np.concatenate(parts, axis=1), -BOUND, BOUND).astype(np.float32)
