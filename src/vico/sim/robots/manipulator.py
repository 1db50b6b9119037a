"""Mobile manipulators: the controller of base and arm, the state of arm tasks, and oracle grasps.

Oracle grasp: a run may have hands that never lose what they closed on. When a closing jaw touches a thing whose box the
middle between the pads is inside of, or no farther than `MARGIN` from, the thing keeps the place in the hand's frame
that it has then, whatever it weighs and wherever it is touched, until the jaw opens by `OPENS`. While it is held it
weighs nothing and collides with nothing, and the fingers stay where they touched it. To come there, to close on it, and
to come down again is the robot's own affair, and it does not go through doors. The observation shows it
(``state.held``). Nothing else is given.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import MobileManipulator, RobotModel
from vico.errors import SchemaError
from vico.exact import apply_matrix, product
from vico.geometry import quaternion_from_matrix, rotation_matrix
from vico.io.compiled import compiled
from vico.kinematics.arm import Chain, hand_pose
from vico.sim.bodies.state_arrays import MovableObjects
from vico.sim.physics.engine import PhysicsEngine
from vico.sim.physics.records import Motion
from vico.sim.robots.controller import Array, MotorController, planar_motion
from vico.sim.robots.path_following import WaypointFollowers

#: Entries of its memory: where the arm's servos are told to be and where they go, both less the model's rest; the
#: speeds of the base as far as they were let through; how far it has rolled and turned since it stands; for how long
#: motor commands have told it not to roll, and not to turn, seconds.
ARM_NOW, ARM_GOAL, DRIVEN, ROLLED, COMMANDED = slice(0, 9), slice(9, 18), slice(18, 20), slice(20, 22), slice(22, 24)
#: Of joints, rad/s; of fingers, m/s.
JOINT_SPEED, FINGER_SPEED = 0.9, 0.12
_SPEED_UP, _TURN_UP = 0.8, 2.0
# Who stands on a slope would roll down it as slowly as its servos give way: it drives back by so much a second of what
# it has rolled, at these speeds at most, m/s and rad/s.
_BACK, _BACK_SPEEDS = 4.0, (0.2, 0.4)
# Seconds in which it brakes that is told to stand: what it goes then is no rolling.
_BRAKES = 0.5


@compiled
def _arm_and_base_targets(rest, fastest, slew, period, moved, command, memory):
    out = np.empty((len(command), len(rest) + 2))
    n = len(rest)
    for k in range(len(command)):
        longest = 1.0
        for j in range(n):
            longest = max(longest, abs(memory[k, n + j] - memory[k, j]) / fastest[j])
        for j in range(n):
            memory[k, j] += (memory[k, n + j] - memory[k, j]) / longest
            out[k, j] = rest[j] + memory[k, j]
        for j in range(2):
            goal = command[k, 0] if j == 0 else command[k, 2]
            before = memory[k, 2 * n + j]
            memory[k, 2 * n + j] = before + min(max(goal - before, -slew[j]), slew[j])
            out[k, n + j] = memory[k, 2 * n + j]
            rolled = 2 * n + 2 + j
            if goal != 0.0 or memory[k, 2 * n + j] != 0.0:
                memory[k, rolled] = 0.0
                continue
            memory[k, rolled] += moved[k, j] * period
            out[k, n + j] = min(max(-_BACK * memory[k, rolled], -_BACK_SPEEDS[j]), _BACK_SPEEDS[j])
    return out


@compiled
def _commanded_targets(moved, period, command, memory):
    out = command.copy()
    n = command.shape[1] - 2
    for k in range(len(command)):
        memory[k, : 2 * n + 2] = 0.0
        for j in range(2):
            rolled, stands = 2 * n + 2 + j, 2 * n + 4 + j
            memory[k, stands] = 0.0 if command[k, n + j] != 0.0 else memory[k, stands] + period
            if memory[k, stands] < _BRAKES:
                memory[k, rolled] = 0.0
                continue
            memory[k, rolled] += moved[k, j] * period
            out[k, n + j] = min(max(-_BACK * memory[k, rolled], -_BACK_SPEEDS[j]), _BACK_SPEEDS[j])
    return out


@compiled
def _base_motion(rotation, velocity, angular_velocity_body):
    """Return how fast bases go ahead and turn, m/s and rad/s, shape ``(k, 2)``."""
    out = np.empty((len(rotation), 2))
    for k in range(len(rotation)):
        motion = planar_motion(rotation[k], velocity[k], angular_velocity_body[k])
        out[k, 0], out[k, 1] = motion[0], motion[2]
    return out


class ArmOnWheels(MotorController):
    """Drives the base by velocities, and brings the arm to where a task wants it."""

    memory = 24

    def __init__(self, model: RobotModel) -> None:
        super().__init__(model)
        c, period = model.controller, model.control_period
        assert isinstance(c, MobileManipulator)
        self.chain = Chain(c.places, c.axes, c.low, c.high, c.grip)
        self._fastest = np.array([JOINT_SPEED] * 7 + [FINGER_SPEED] * 2) * period
        self._slew, self._period = np.array([_SPEED_UP, _TURN_UP]) * period, period

    def targets(self, motion: Motion, command: Array, memory: Array) -> Array:
        """Arm angles, fingers, and speeds of the base."""
        moved = _base_motion(motion.rotation, motion.velocity, motion.angular_velocity_body)
        found: Array = _arm_and_base_targets(
            self.model.rest, self._fastest, self._slew, self._period, moved, command, memory
        )
        return found

    def command_targets(self, motion: Motion, command: Array, memory: Array) -> Array:
        """Motor commands as they are, but a base that is told to stand drives back what it rolls."""
        moved = _base_motion(motion.rotation, motion.velocity, motion.angular_velocity_body)
        found: Array = _commanded_targets(moved, self._period, command, memory)
        return found


Floats = NDArray[np.float64]


class TaskKind(IntEnum):
    """What an arm is about."""

    NOTHING, REACH, PICK, PLACE, OFFER = range(5)


class TaskStage(IntEnum):
    """How far a task has come; what is to be put down is raised before anything else."""

    GO, ALIGN, PLAN, MOVE, GRIP, LIFT, TUCK, RAISE = range(8)


@dataclass
class TaskArrays:
    """What changes of tasks; row = robot of the kind.

    Attributes
    ----------
    kind, stage
        A `Kind` and a `Stage`, int8, shape ``(k,)``.
    entity
        What is to be picked, int32, shape ``(k,)``.
    target
        Where the hand goes or a thing is put, ENU metres, float64, shape ``(k, 3)``.
    timer
        Seconds that the stage has lasted, float64, shape ``(k,)``.
    tries
        How often it was planned, int64, shape ``(k,)``.
    point
        Which point of the arm's way comes next, int64, shape ``(k,)``.
    turn_at
        After which point of the way the fingers do their work, int64, shape ``(k,)``.
    held
        What the hand holds, 0 for nothing, and how far its underside is below the grip, metres; float64, shape
        ``(k, 2)``.
    """

    kind: NDArray[np.int8]
    stage: NDArray[np.int8]
    entity: NDArray[np.int32]
    target: NDArray[np.float64]
    timer: NDArray[np.float64]
    tries: NDArray[np.int64]
    point: NDArray[np.int64]
    turn_at: NDArray[np.int64]
    held: NDArray[np.float64]

    @classmethod
    def idle(cls, k: int) -> TaskArrays:
        """Nothing to do."""
        integers = [np.zeros(k, np.int64) for _ in range(3)]
        return cls(
            np.zeros(k, np.int8),
            np.zeros(k, np.int8),
            np.zeros(k, np.int32),
            np.zeros((k, 3)),
            np.zeros(k),
            integers[0],
            integers[1],
            integers[2],
            np.zeros((k, 2)),
        )


@dataclass
class ArmTasks(WaypointFollowers):
    """The tasks of the robots of a kind that has arms.

    Attributes
    ----------
    model
        Their model.
    robots
        Their indices, int64, shape ``(k,)``.
    arrays
        What changes.
    ways
        Angles of the arm that are gone through, rad, shape ``(m, 7)`` each.
    """

    width = 7

    arrays: TaskArrays = field(init=False)

    def __post_init__(self) -> None:
        c = self.model.controller
        assert isinstance(c, MobileManipulator)
        self.chain = Chain(c.places, c.axes, c.low, c.high, c.grip)
        self.opening = c.opening
        self.arrays = TaskArrays.idle(len(self.robots))
        self.ways = [self.no_way()] * len(self.robots)

    @property
    def busy(self) -> bool:
        """Whether any of them works or holds something."""
        return bool(self.arrays.kind.any() or self.arrays.held[:, 0].any())


#: How far from a thing's box the middle of the jaw may be, and how far each finger opens to let go, metres.
MARGIN, OPENS = 0.02, 0.006
# A jaw that has closed by less than this since it was looked at stands still, metres.
_CLOSES = 2e-4
_FINGERS = slice(7, 9)  # of the targets of an arm's motors


class Hand(NamedTuple):
    """A hand: its arm, the names of the links of its fingers, and how far each of them opens at most, metres."""

    chain: Chain
    fingers: tuple[str, ...]
    opening: float


class OracleGrasp:
    """What the hands of a run's robots hold by oracle.

    Parameters
    ----------
    hands
        By robot.
    entities
        Of all robots, int32, shape ``(n,)``.

    Attributes
    ----------
    entity
        Of the thing in each robot's hand, 0 for none, int32, shape ``(n,)``.
    """

    def __init__(self, hands: Mapping[int, Hand], entities: NDArray[np.int32]) -> None:
        self._hands, self._robots = dict(hands), entities
        self.entity = np.zeros(len(entities), np.int32)
        self._place = np.zeros((len(entities), 7))  # of the thing in the hand's frame: position, quaternion
        self._apart = np.zeros(len(entities))  # of fingers, when they were looked at last
        self._touched = np.zeros(len(entities))  # and when they touched what they hold

    def hold(self, engine: PhysicsEngine, objects: MovableObjects) -> None:
        """Take what hands have closed on, keep it in its place, and let go of it."""
        for robot, own in self._hands.items():
            angles = engine.joints(robot)[0]
            apart, before = float(angles[_FINGERS].min()), float(self._apart[robot])
            self._apart[robot] = apart
            if self.entity[robot]:
                k = objects.index(int(self.entity[robot]))
                if objects.holder[k] != self._robots[robot]:
                    self.entity[robot] = 0  # somebody has taken it
                elif apart > self._touched[robot] + OPENS and apart >= before:
                    self.entity[robot] = objects.holder[k] = 0
                else:
                    self._move(robot, k, _hand_pose(engine, robot, own.chain, angles[:7]), objects)
            elif apart < before - _CLOSES:
                self._close(robot, engine, _hand_pose(engine, robot, own.chain, angles[:7]), objects)

    def spread(self, robots: NDArray[np.int64], targets: Floats) -> Floats:
        """Return motor targets of robots, shape ``(k, m)``, with fingers kept where they touch what they hold."""
        holds = self.entity[robots] != 0
        if not holds.any():
            return targets
        kept = targets.copy()
        kept[holds, _FINGERS] = np.maximum(kept[holds, _FINGERS], self._touched[robots[holds], None])
        return kept

    def _close(self, robot: int, engine: PhysicsEngine, hand: Floats, objects: MovableObjects) -> None:
        """Take a thing that a closing jaw touches and is about."""
        links, contacts = engine.link_names(robot), engine.contacts()
        own = self._hands[robot]
        touched = set().union(*(contacts.objects_at(robot, links.index(name)) for name in own.fingers))
        if not touched:
            return
        at, turn = hand[:, 3], hand[:, :3]
        for k in np.flatnonzero((objects.holder == 0) & (objects.room < 0)).tolist():
            lies, half = objects.rotation(k), objects.size[k] / 2
            inside = apply_matrix(at - objects.position[k], lies.T) - (0.0, 0.0, half[2])
            if np.all(np.abs(inside) <= half + MARGIN):
                away = apply_matrix(objects.position[k] - at, turn.T)
                self._place[robot] = [*away, *quaternion_from_matrix(product(turn.T, lies))]
                # Who holds what is as wide as the jaw can still open it.
                self._touched[robot] = min(float(self._apart[robot]), own.opening - OPENS - _CLOSES)
                self.entity[robot], objects.holder[k], objects.hand[k] = objects.entity[k], self._robots[robot], -1
                return

    def _move(self, robot: int, k: int, hand: Floats, objects: MovableObjects) -> None:
        place = self._place[robot]
        objects.position[k] = hand[:, 3] + apply_matrix(place[:3], hand[:, :3])
        objects.set_rotation(k, product(hand[:, :3], rotation_matrix(place[3:])))

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Every number that decides the future, copied."""
        return {
            "oracle_entity": self.entity.copy(),
            "oracle_place": self._place.copy(),
            "oracle_fingers": np.column_stack([self._apart, self._touched]),
        }

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go back to what `arrays` held.

        Raises
        ------
        SchemaError
            If it was saved without oracle grasp, or of other robots.
        """
        if "oracle_entity" not in arrays or arrays["oracle_entity"].shape != self.entity.shape:
            raise SchemaError("robots: the saved state is of a run without oracle grasp, or of other robots")
        self.entity[:], self._place[:] = arrays["oracle_entity"], arrays["oracle_place"]
        self._apart[:], self._touched[:] = arrays["oracle_fingers"].T


def _hand_pose(engine: PhysicsEngine, robot: int, chain: Chain, angles: Floats) -> Floats:
    """Return the pose of the middle between the pads in the world, shape ``(3, 4)``."""
    count, pose = len(chain.places), np.empty((3, 4))
    hand_pose(chain, np.ascontiguousarray(angles), np.empty((count, 3)), np.empty((count, 3)), pose)
    base = engine.base(robot)
    at = apply_matrix(pose[:, 3], base.rotation) + base.position
    return np.column_stack([product(base.rotation, pose[:, :3]), at])
