"""Interface of a learned policy of a mobile manipulator: state, increments, their sizes and its clock.

A policy acts twenty times a second. Its action holds an increment for each degree of freedom: of the arm, rad, and the
fingers, metres, from where the joint *is* to where its servo is told to be; of the base, how far it is to go ahead,
metres, and to turn to the left, rad, in the period. So the servo's position is the state's plus the action's, exactly.

`PolicyClock` says when a policy that acts at a rate of its own is asked, by a robot that acts at another. `ChunkShape`
holds the sizes of an action-chunk policy, which training, network and agent share.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.agents.robot.body import Stance
from vico.errors import InputError
from vico.exact import dot

#: Seconds between two actions.
PERIOD = 0.05
#: Degrees of freedom in the order of actions: those of the arm and the fingers, then the base's.
JOINTS = ("torso", "shoulder", "bicep", "elbow", "forearm", "wrist", "gripper", "right_finger", "left_finger")
BASE = ("forward", "yaw")
#: What ``action`` holds, rad and metres.
INCREMENTS = tuple(f"delta.{name}" for name in (*JOINTS, *BASE))
#: What ``observation.state`` holds: positions (rad; of fingers off the middle, metres) and speeds of joints, and
#: speeds of the base, m/s and rad/s.
STATE = tuple(f"{what}.{name}" for what in ("position", "velocity") for name in JOINTS) + tuple(
    f"velocity.{name}" for name in BASE
)
#: Fastest that the base is told to drive and turn, m/s and rad/s.
FASTEST_BASE = (0.8, 1.2)


def arm_state(observation: Mapping[str, Any]) -> NDArray[np.float32]:
    """Return what a manipulator feels of its joints and its base, float32, in the order of `STATE`.

    Raises
    ------
    InputError
        If the observation is of another kind of robot.
    """
    sensors = observation["sensors"]
    angles = np.asarray(sensors.get("joint_position", ()), np.float64)
    if angles.shape != (len(JOINTS),):
        raise InputError(
            f"state: a robot of {angles.size} joints; such policies are for the manipulator, which has {len(JOINTS)}"
        )
    speeds = np.asarray(sensors["joint_velocity"], np.float64)
    forward = dot(Stance.of(observation).rotation[:, 0], np.asarray(sensors["base_velocity"], np.float64))
    turn = float(sensors["angular_velocity"][2])
    return np.concatenate([angles, speeds, [forward, turn]]).astype(np.float32)


def increments_of(control: ArrayLike, state: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return a ``control`` vector of the manipulator as increments, float32, in the order of `INCREMENTS`.

    Parameters
    ----------
    control
        Where the servos are told to be, and speeds of the base, shape ``(11,)``.
    state
        Of `arm_state`, as it was when the action was chosen.
    """
    vector = np.asarray(control, np.float64)
    count = len(JOINTS)
    return np.concatenate([vector[:count] - state[:count], vector[count:] * PERIOD]).astype(np.float32)


def control_of(increments: ArrayLike, state: NDArray[np.float32]) -> dict[str, Any]:
    """Return the action that increments stand for; undoes `increments_of`.

    Raises
    ------
    InputError
        If there are not as many as degrees of freedom, or they are not finite.
    """
    vector = np.asarray(increments, np.float64)
    if vector.shape != (len(INCREMENTS),) or not np.isfinite(vector).all():
        raise InputError(f"increments: of shape {vector.shape}; give {len(INCREMENTS)} finite numbers")
    count = len(JOINTS)
    base = np.clip(vector[count:] / PERIOD, np.negative(FASTEST_BASE), FASTEST_BASE)
    return {"type": "control", "vector": [*(vector[:count] + state[:count]).tolist(), *base.tolist()]}


# Control periods are multiples of this, seconds.
_TICK = 0.01


class PolicyPeriod(NamedTuple):
    """What is to be done in a period.

    Attributes
    ----------
    asks
        How often the policy is to be asked: with a period longer than its own several times on end, from what is known
        now, as no newer observation comes.
    share
        How much of its last action's time will be over at the end of the period, 0 to 1: servos are to have come so
        far.
    """

    asks: int
    share: float


class PolicyClock:
    """Counts a policy's periods within a robot's.

    Parameters
    ----------
    period
        Seconds between two actions of the robot.
    own
        Seconds between two actions that the policy was trained with.

    Raises
    ------
    InputError
        If either is no multiple of 0.01 s.
    """

    def __init__(self, period: float, *, own: float) -> None:
        for seconds in (period, own):
            if seconds < _TICK / 2 or abs(seconds / _TICK - round(seconds / _TICK)) > 1e-6:
                raise InputError(f"policy: a period of {seconds:g} s; it has to be a multiple of {_TICK:g} s")
        self._period, self._own = round(period / _TICK), round(own / _TICK)
        self.ticks = 0

    def tick(self) -> PolicyPeriod:
        """Pass on to the next period; return what is due in the one that begins."""
        before, end = -(-self.ticks // self._own), self.ticks + self._period
        after = -(-end // self._own)
        self.ticks = end
        return PolicyPeriod(after - before, min(1.0, (end - self._own * (after - 1)) / self._own))


@dataclass(frozen=True)
class ChunkShape:
    """Sizes of a policy.

    Attributes
    ----------
    side
        Of the picture, pixels.
    chunk
        Actions that it gives at once.
    state, action
        Numbers of each.
    words, vocabulary
        Words of an instruction that are read, and how many it tells apart.
    width, heads, encoders, decoders, dropout
        Of the transformer.
    """

    side: int = 96
    chunk: int = 20
    state: int = len(STATE)
    action: int = len(INCREMENTS)
    words: int = 24
    vocabulary: int = 512
    width: int = 256
    heads: int = 8
    encoders: int = 4
    decoders: int = 2
    dropout: float = 0.1
