"""Two legs: a clock, a plain stepping motion, and a trained network that corrects it, of all robots of a kind at once.

Half of a stride is like the other half with left and right exchanged. So the network knows one half alone, in which the
first leg swings; in the other half it sees the mirror image of the robot, and its answer is mirrored back.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.io.compiled import compiled

#: Joints of a leg and of both, and what the network sees.
LEG, LEGS, OBSERVED = 5, 10, 44
#: Entries of a robot's memory: where in its stride it is (0..1), whether it steps, seconds it has been calm, the
#: velocity it follows, the last action, how far ankles and knees are fitted to the ground (left, right), seconds since
#: it stopped without a command, the place held since then (x, y, yaw, ENU).
PHASE, STEPPING, CALM, COMMAND, ACTION, GROUND, IDLE, PLACE, MEMORY = 0, 1, 2, 3, 6, 16, 20, 21, 24
#: Metres a second and radians of tilt beyond which a standing robot steps to catch itself, and a stepping one goes on:
#: steps sway.
_PUSHED, _TILTED = (0.22, 0.60), (0.09, 0.20)
#: Seconds of calm after which it stands.
_PATIENCE = 0.7
#: How far knees bend in a swing, rad, and how far a hip swings for each m/s, rad.
_LIFT, _SWING = 0.60, 0.20
#: Radians for one unit of the network's answer, and the least and largest of that.
SCALE, ACTION_LIMIT = 0.25, 5.0


class StepSettings(NamedTuple):
    """What a robot's steps are made of.

    Attributes
    ----------
    period
        Seconds between two calls.
    stride
        Seconds of two steps.
    rest
        Angles of a leg at rest, rad, shape ``(5,)``.
    low, high
        Bounds of all joints, rad, shape ``(10,)``.
    """

    period: float
    stride: float
    rest: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]


@compiled
def mirrored(memory):  # type: ignore[no-untyped-def]
    """Whether the right leg's swing is next, or under way."""
    return memory[PHASE] >= 0.5 - 1e-9


@compiled
def _swap_action(memory):  # type: ignore[no-untyped-def]
    """Exchange left and right of the last action: the other leg begins to swing."""
    for k in range(LEG):
        sign = -1.0 if k < 2 else 1.0
        a, b = memory[ACTION + k], memory[ACTION + LEG + k]
        memory[ACTION + k], memory[ACTION + LEG + k] = sign * b, sign * a


@compiled
def advance_clock(settings, planar, tilt, memory):  # type: ignore[no-untyped-def]
    """Let the stride of a robot go on, begin or end.

    Parameters
    ----------
    planar
        vx, vy, wz in the base's frame.
    tilt
        Of its base, rad.
    """
    # Without a command it steps no longer for being steered back to its place.
    follows = memory[COMMAND] != 0.0 or memory[COMMAND + 1] != 0.0 or memory[COMMAND + 2] != 0.0
    asked = follows and memory[IDLE] == 0.0
    steps = 1 if memory[STEPPING] > 0.0 else 0
    if asked or math.hypot(planar[0], planar[1]) > _PUSHED[steps] or tilt > _TILTED[steps]:
        memory[CALM] = 0.0
        memory[STEPPING] = 1.0
    else:
        memory[CALM] += settings.period
    if memory[STEPPING] > 0.0:
        before = memory[PHASE]
        after = before + settings.period / settings.stride
        half = math.floor(2.0 * after + 1e-9)
        if memory[CALM] > _PATIENCE and half != math.floor(2.0 * before + 1e-9):
            after = 0.5 * half  # both feet are on the ground
            memory[STEPPING] = 0.0
        swapped = mirrored(memory)
        memory[PHASE] = after - math.floor(after + 1e-9)
        if swapped != mirrored(memory):
            _swap_action(memory)


@compiled
def _put_legs(out, first, values, rest, swap, scale):  # type: ignore[no-untyped-def]
    """Write the numbers of both legs, less those at rest, the leg that swings first."""
    for k in range(LEGS):
        j = (k + LEG) % LEGS if swap else k
        sign = -1.0 if swap and k % LEG < 2 else 1.0
        out[first + k] = sign * (values[j] - rest[k % LEG]) * scale


@compiled
def observe(settings, moving, joints, memory, out):  # type: ignore[no-untyped-def]
    """Write what the network sees of a robot.

    Parameters
    ----------
    moving
        Rotation, velocity and angular velocity (in its own frame) of the base.
    joints
        Angles and speeds.
    """
    rotation, velocity, spin = moving
    command = memory[COMMAND : COMMAND + 3]
    swap = mirrored(memory)
    s = -1.0 if swap else 1.0
    for k in range(3):
        v = rotation[0, k] * velocity[0] + rotation[1, k] * velocity[1] + rotation[2, k] * velocity[2]
        sideways = s if k == 1 else 1.0
        out[k] = sideways * v
        out[3 + k] = (1.0 if k == 1 else s) * 0.5 * spin[k]
        out[6 + k] = sideways * -rotation[2, k]
    out[9], out[10], out[11] = command[0], s * command[1], s * command[2]
    angle = 2.0 * math.pi * (memory[PHASE] - (0.5 if swap else 0.0))
    out[12] = math.sin(angle) * memory[STEPPING]
    out[13] = math.cos(angle) * memory[STEPPING]
    _put_legs(out, 14, joints[0], settings.rest, swap, 1.0)
    _put_legs(out, 24, joints[1], np.zeros(LEG), swap, 0.05)
    out[34:44] = memory[ACTION : ACTION + LEGS]


@compiled
def leg_targets(settings, action, memory, out):  # type: ignore[no-untyped-def]
    """Write the joints' targets, of plain steps and the network's answer to them; that becomes the last action."""
    swap = mirrored(memory)
    s = 2.0 * (memory[PHASE] - (0.5 if swap else 0.0))
    lift = memory[STEPPING] * max(0.0, math.sin(math.pi * s)) ** 2
    swing = memory[STEPPING] * _SWING * memory[COMMAND] * math.cos(math.pi * s)
    for k in range(LEGS):
        part, first = k % LEG, k < LEG
        bend = (-0.5 if part == 2 else (1.0 if part == 3 else -0.5)) * _LIFT * lift if first and part >= 2 else 0.0
        ahead = (swing if part == 2 else -swing) * (1.0 if first else -1.0) if part == 2 or part == 4 else 0.0
        a = min(max(action[k], -ACTION_LIMIT), ACTION_LIMIT)
        angle = settings.rest[part] + bend + ahead + SCALE * a
        j = (k + LEG) % LEGS if swap else k
        if swap and part < 2:
            angle = -angle
        out[j] = min(max(angle, settings.low[j]), settings.high[j])
        memory[ACTION + k] = a
