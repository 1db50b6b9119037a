"""How far a cycle of each motion carries: what phases advance by, so that feet never slide."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.exact import each
from vico.io.compiled import compiled
from vico.sim.animation.names import CARRY, CARRY_LEFT, CARRY_RIGHT, RIDE_BIKE, RUN, WALK

#: Metres that a turn of a bicycle's cranks covers.
TURN_OF_CRANKS = 4.0
_STRIDE, _POWER = 0.727, 0.45  # of a walk at 1 m/s, in statures; how strides grow with speed
_SLOWEST = 0.15  # shorter strides than at this speed nobody takes, m/s


@compiled
def stride_of(clip, speed, height):  # type: ignore[no-untyped-def]
    """Return the metres one cycle of one motion covers; see `stride_length`."""
    if clip in (WALK, CARRY, CARRY_LEFT, CARRY_RIGHT):
        return _STRIDE * height * max(speed, _SLOWEST) ** _POWER
    if clip == RUN:
        return height * (0.62 + 0.20 * speed)
    return TURN_OF_CRANKS if clip == RIDE_BIKE else np.inf


@compiled
def pace_of_step(step, height):  # type: ignore[no-untyped-def]
    """Return the speed at which somebody's steps are so long on level ground, m/s."""
    return max((2.0 * step / (_STRIDE * height)) ** (1.0 / _POWER), _SLOWEST)


def pace_on(treads: NDArray[np.float64], pace: NDArray[np.float64], height: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the speed that strides are those of, m/s: of a tread a step where treads are so deep, else `pace`."""
    on_treads = each(math.pow, np.maximum(2.0 * treads / (_STRIDE * height), 0.0), 1.0 / _POWER)
    return np.where(treads > 0.0, np.maximum(on_treads, _SLOWEST), pace)


def stride_length(
    clip: NDArray[Any] | int, speed: NDArray[Any] | float, height: NDArray[Any] | float
) -> NDArray[np.float64]:
    """Return the metres one cycle (two steps, or a turn of the cranks) covers.

    Parameters
    ----------
    clip
        Motion numbers, shape ``(n,)``.
    speed
        Metres a second over the ground, shape ``(n,)``.
    height
        Stature, metres, shape ``(n,)``.

    Returns
    -------
    ndarray
        float64; infinite for motions that do not cover ground (their phase runs with time).

    Notes
    -----
    Fitted to Grieve and Gear's relation of stride and speed.
    """
    number, v, tall = np.broadcast_arrays(
        np.asarray(clip, np.int64), np.asarray(speed, np.float64), np.asarray(height, np.float64)
    )
    found = np.empty(number.shape)
    _strides(number.flatten(), v.flatten(), tall.flatten(), found.reshape(-1))
    return found


@compiled
def _strides(clip, speed, height, found):  # type: ignore[no-untyped-def]
    for k in range(len(found)):
        found[k] = stride_of(clip[k], speed[k], height[k])
