"""Standing where the ground is not level, and staying in one place: of robots on two legs.

The network that corrects their steps sees nothing of the ground. Standing as on level ground, a robot on the ramp of a
kerb leans, and walks down it to catch itself. So while it stands, ankles are turned as the ground slopes below each
sole, and the leg on higher ground is bent; the network sees the joints without that, as on level ground.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.io.compiled import compiled
from vico.sim.robots.two_legs import CALM, COMMAND, GROUND, IDLE, LEG, PLACE, STEPPING

#: Where the joints that fit a leg to the ground are among its own.
_HIP, KNEE, _ANKLE = 2, 3, 4
#: From which axis to which each joint of a leg turns: yaw, roll, and three times pitch.
_TURNS = ((0, 1), (1, 2), (2, 0), (2, 0), (2, 0))
#: Radians and metres of a slope and between two soles beyond which it stands as if there were no more.
_STEEPEST, _HIGHEST = 0.35, 0.12
#: Radians a second by which joints are fitted to the ground when it stands, and go back when it steps.
_FIT, _UNFIT = 3.0, 1.0
#: Seconds of calm after which the stance stays as it is: fitted on and on it creeps, and turns.
_FELT = 2.0
#: Seconds without a command after which the place where a robot is becomes the one it holds: by then it has stopped.
_SETTLED = 0.8
#: How it is steered back there, ahead, aside and turning: m/s and rad/s for each metre and radian beyond some slack,
#: and the most of it (the network was trained for more).
_RETURN, _SLACK, _FASTEST = (2.0, 2.0, 1.5), (0.05, 0.05, 0.1), (0.2, 0.2, 0.3)
#: Seconds of calm after which it is steered back: who still catches itself from a push would fall by it.
_CAUGHT = 0.2
#: Metres the place is away at most: it comes along with a robot that is pushed further, which then does not go back all
#: the way into whom it can't see.
_LEASH = 0.4


class StanceSettings(NamedTuple):
    """What a robot's stance is made of.

    Attributes
    ----------
    period
        Seconds between two calls.
    places
        Where the joints of the left leg are, each in the frame of the one before, and the middle of its sole in that of
        the ankle; metres, shape ``(6, 3)``.
    knee
        Its angle at rest, rad.
    """

    period: float
    places: NDArray[np.float64]
    knee: float


@compiled
def sole(places, rotation, angles, side):  # type: ignore[no-untyped-def]
    """Return how far a sole slopes down ahead, rad, and its height above the origin of the base, metres.

    Parameters
    ----------
    rotation
        Base to world.
    angles
        Of the leg's joints.
    side
        1 for the left leg, -1 for the right.
    """
    up = rotation[2].copy()  # of the axes of one link after the other
    height = 0.0
    for link in range(LEG + 1):
        height += up[0] * places[link, 0] + side * up[1] * places[link, 1] + up[2] * places[link, 2]
        if link < LEG:
            a, b = _TURNS[link]
            c, s = math.cos(angles[link]), math.sin(angles[link])
            up[a], up[b] = c * up[a] + s * up[b], c * up[b] - s * up[a]
    return -math.asin(min(max(up[0], -1.0), 1.0)), height


@compiled
def feel_ground(stance, rotation, angles, memory):  # type: ignore[no-untyped-def]
    """Fit the stance of a robot that stands to the ground below its soles; let that go of one that steps."""
    stands = memory[STEPPING] == 0.0
    if stands and memory[CALM] > _FELT:
        return
    slopes, heights = np.zeros(2), np.zeros(2)
    for leg in range(2):
        slopes[leg], heights[leg] = sole(stance.places, rotation, angles[LEG * leg : LEG * (leg + 1)], 1.0 - 2.0 * leg)
    length = -(stance.places[3, 2] + stance.places[4, 2])
    rate = (_FIT if stands else _UNFIT) * stance.period
    for leg in range(2):
        ankle = knee = 0.0
        if stands:
            ankle = min(max(slopes[leg], -_STEEPEST), _STEEPEST)
            shorter = min(max(heights[leg] - heights[1 - leg], 0.0), _HIGHEST)
            knee = 2.0 * math.acos(math.cos(0.5 * stance.knee) - shorter / length) - stance.knee
        for k, wanted in ((GROUND + leg, ankle), (GROUND + 2 + leg, knee)):
            memory[k] += min(max(wanted - memory[k], -rate), rate)


@compiled
def fit_to_ground(memory, angles, sign):  # type: ignore[no-untyped-def]
    """Add what the ground asks for to angles of the joints (`sign` 1), or take it from them (-1)."""
    for leg in range(2):
        ankle, knee = sign * memory[GROUND + leg], sign * memory[GROUND + 2 + leg]
        first = LEG * leg
        angles[first + _HIP] -= 0.5 * knee
        angles[first + KNEE] += knee
        angles[first + _ANKLE] += ankle - 0.5 * knee


@compiled
def wanted_velocity(period, command, position, rotation, memory, out):  # type: ignore[no-untyped-def]
    """Write the velocity to go over to: the command; without one, that by which a robot gets back to where it stopped.

    Only one that steps is steered back: one that stands does not begin to step for it, and one that is calm stands
    still wherever it is.

    Parameters
    ----------
    command
        vx, vy, wz in the base's frame.
    position, rotation
        Of the base, ENU.
    out
        In the base's frame, shape ``(3,)``; written.
    """
    out[:] = command
    if command.any():
        memory[IDLE] = 0.0
        return
    if memory[IDLE] == 0.0 and memory[COMMAND : COMMAND + 3].any():  # it brakes
        return
    place = memory[PLACE : PLACE + 3]
    yaw = math.atan2(rotation[1, 0], rotation[0, 0])
    if memory[IDLE] < _SETTLED:
        memory[IDLE] += period
        place[0], place[1], place[2] = position[0], position[1], yaw
    dx, dy = place[0] - position[0], place[1] - position[1]
    share = _LEASH / max(math.hypot(dx, dy), _LEASH)
    dx, dy = share * dx, share * dy
    place[0], place[1] = position[0] + dx, position[1] + dy
    if memory[STEPPING] == 0.0 or memory[CALM] < _CAUGHT:
        return
    c, s = math.cos(yaw), math.sin(yaw)
    turn = (place[2] - yaw + math.pi) % (2.0 * math.pi) - math.pi
    missing = (c * dx + s * dy, c * dy - s * dx, turn)
    for k in range(3):
        beyond = max(abs(missing[k]) - _SLACK[k], 0.0)
        out[k] = math.copysign(min(_RETURN[k] * beyond, _FASTEST[k]), missing[k])
