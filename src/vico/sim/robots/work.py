"""What changes of robots' arms at work, beside their physics and their controllers."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import MobileManipulator
from vico.kinematics.arm import Chain
from vico.sim.robots.ways_of_many import OnTheirWays

Array = NDArray[np.float64]


class Kind(IntEnum):
    """What an arm is about."""

    NOTHING, REACH, PICK, PLACE, OFFER = range(5)


class Stage(IntEnum):
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
class Work(OnTheirWays):
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
