"""Kernels that all controllers share: letting a command through slowly, and correcting it by what is missing of it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.io.compiled import compiled


class TrimSettings(NamedTuple):
    """How a command is corrected by the integral of what is missing of it; vx, vy, wz.

    Attributes
    ----------
    gain
        Correction a second for each unit that is missing, 1/s, shape ``(3,)``.
    limit
        Largest correction, m/s and rad/s, shape ``(3,)``.
    smoothing
        Seconds over which the motion is smoothed.
    period
        Seconds between two corrections.
    """

    gain: NDArray[np.float64]
    limit: NDArray[np.float64]
    smoothing: float
    period: float


#: What a trim remembers: smoothed motion, correction (3 + 3).
TRIM_SIZE = 6
_SMOOTHED, _CORRECTION = 0, 3


@compiled
def approach(values, goal, step):  # type: ignore[no-untyped-def]
    """Bring `values` nearer to `goal`, each by at most its `step`."""
    for k in range(len(values)):
        values[k] += min(max(goal[k] - values[k], -step[k]), step[k])


@compiled
def planar_motion(rotation, velocity, angular_velocity_body):  # type: ignore[no-untyped-def]
    """Return vx, vy, wz in the base's frame."""
    out = np.empty(3)
    for k in range(2):
        out[k] = rotation[0, k] * velocity[0] + rotation[1, k] * velocity[1] + rotation[2, k] * velocity[2]
    out[2] = angular_velocity_body[2]
    return out


@compiled
def trimmed(trim, motion, command, memory):  # type: ignore[no-untyped-def]
    """Return a command corrected by the integral of what is missing of it."""
    out = np.empty(3)
    share = trim.period / (trim.smoothing + trim.period)
    for k in range(3):
        smoothed, correction = _SMOOTHED + k, _CORRECTION + k
        memory[smoothed] += (motion[k] - memory[smoothed]) * share
        memory[correction] += trim.gain[k] * (command[k] - memory[smoothed]) * trim.period
        memory[correction] = min(max(memory[correction], -trim.limit[k]), trim.limit[k])
        out[k] = command[k] + memory[correction]
    return out
