"""Angles that bring a hand to a pose and keep an arm near a posture and off everything."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from vico.io.compiled import compiled
from vico.kinematics.arm import damped_step, hand_error, hand_jacobian, hand_pose
from vico.kinematics.planning import Arm, is_free
from vico.seeds import rng

Array = NDArray[np.float64]

_STEPS, _LONGEST, _STARTS = 80, 0.25, 12
# Share of what is left to the posture that a step takes; exact enough, metres and radians summed.
_DRAWN, _EXACT = 0.15, 2e-3


def free_reach(
    arm: Arm, goals: Sequence[Array], near: Array, *, posture: Array | None = None
) -> tuple[Array, int] | None:
    """Return angles that bring the hand to one of some poses and touch nothing, and which pose it is.

    The poses are tried in order; each from `near`, from the posture, and from starts drawn for it. Of the solutions
    of a pose the nearest to `near` counts.

    Parameters
    ----------
    goals
        Of the hand in the base's frame, shape ``(3, 4)``, the best first.
    near
        Angles the arm has, rad.
    posture
        Angles it is drawn to where the hand leaves it a choice; None for the middle of its bounds.
    """
    chain = arm.chain
    drawn = (chain.low + chain.high) / 2 if posture is None else posture
    for number, goal in enumerate(goals):
        stream = rng(0, "inverse kinematics")
        best: tuple[float, Array] | None = None
        for start in range(_STARTS):
            angles = (
                near.copy()
                if start == 0
                else drawn.copy()
                if start == 1
                else stream.uniform(0.8 * chain.low, 0.8 * chain.high)
            )
            if solve_near(chain, angles, goal, drawn, _STEPS) > _EXACT or not is_free(arm, angles):
                continue
            far = float(np.abs(angles - near).max())
            if best is None or far < best[0]:
                best = far, angles
        if best is not None:
            return best[1], number
    return None


@compiled
def solve_near(chain, angles, goal, posture, steps):  # type: ignore[no-untyped-def]
    """Bring the hand to a pose and the joints towards a posture, in place; return what is left, metres plus radians.

    Damped least squares; the pull to the posture is in the null space of the hand's motion, and within the bounds.
    """
    n = len(angles)
    origins, directions, pose = np.empty((n, 3)), np.empty((n, 3)), np.empty((3, 4))
    jacobian, error, change = np.empty((6, n)), np.empty(6), np.empty(n)
    pull, felt, back = np.empty(n), np.empty(6), np.empty(n)
    left = 1e9
    for step in range(steps):
        hand_pose(chain, angles, origins, directions, pose)
        left = hand_error(pose, goal, error)
        # Half a turn off there is no error that leads back.
        if left < 1e-4 and pose[0, 0] * goal[0, 0] + pose[1, 0] * goal[1, 0] + pose[2, 0] * goal[2, 0] < 0.0:
            return 1e9
        if left < 1e-4 and step > steps // 2:
            break
        hand_jacobian(pose, origins, directions, jacobian)
        damped_step(jacobian, error, change)
        # In the last steps the hand alone counts.
        share = _DRAWN if step < steps // 2 else 0.0
        for k in range(n):
            pull[k] = share * (posture[k] - angles[k])
        for i in range(6):
            felt[i] = 0.0
            for k in range(n):
                felt[i] += jacobian[i, k] * pull[k]
        damped_step(jacobian, felt, back)
        most = 0.0
        for k in range(n):
            change[k] += pull[k] - back[k]
            most = max(most, abs(change[k]))
        scale = min(1.0, _LONGEST / most) if most > 0.0 else 0.0
        for k in range(n):
            angles[k] = min(max(angles[k] + scale * change[k], chain.low[k]), chain.high[k])
    return left
