"""Arms that hold something beside what the rest of the body does: umbrella, placard, box before the chest. Compiled."""

from __future__ import annotations

from enum import IntEnum
from typing import Any

import numpy as np

from vico.io.compiled import compiled
from vico.sim.animation.limbs import LEFT, RIGHT, SHOULDER, SIGN, WRIST, grip, joint_in_body, part_way, reach_by
from vico.sim.animation.rotations import X, Y, Z, rotation_about, smoothstep


class Hold(IntEnum):
    """How something is held."""

    NOTHING = 0
    UMBRELLA_LEFT = 1
    UMBRELLA_RIGHT = 2
    BEFORE_CHEST = 3
    PLACARD_RIGHT = 4


_UMBRELLA_LEFT, _UMBRELLA_RIGHT = int(Hold.UMBRELLA_LEFT), int(Hold.UMBRELLA_RIGHT)
_PLACARD_RIGHT = int(Hold.PLACARD_RIGHT)


@compiled
def hold_up(body: Any, hold: int, share: float, width: float) -> None:
    """Bring the arms from what the motion has them do a share of the way to where they hold something.

    `width` is that of what is held before the chest, metres.
    """
    part = smoothstep(share)
    if hold == _UMBRELLA_LEFT:
        _hold_umbrella(body, LEFT, part)
    elif hold in (_UMBRELLA_RIGHT, _PLACARD_RIGHT):
        _hold_umbrella(body, RIGHT, part)
    else:
        _hold_before_chest(body, part, width)


@compiled
def _hold_umbrella(body: Any, side: int, part: float) -> None:
    """Bend an elbow, the fist before the shoulder."""
    tall, sign = body.style.height, SIGN[side]
    shoulder, _ = joint_in_body(body, SHOULDER[side])
    goal = shoulder.copy()
    goal[X] += 0.135 * tall
    goal[Y] -= sign * 0.02 * tall
    goal[Z] -= 0.12 * tall
    wrist = body.local[WRIST[side]].copy()
    reach_by(body, side, goal, np.array([-0.5, sign * 0.5, -1.0]), part)
    body.local[WRIST[side]] = part_way(wrist, rotation_about(X, 0.0), part)
    grip(body, side, 0.38 + 0.62 * part)


@compiled
def _hold_before_chest(body: Any, part: float, width: float) -> None:
    """Bring both hands to the sides of a box, its middle before the belly."""
    tall = body.style.height
    apart = min(max(0.5 * width, 0.06 * tall), 0.16 * tall)
    for side in range(2):
        sign = SIGN[side]
        shoulder, _ = joint_in_body(body, SHOULDER[side])
        goal = np.array([shoulder[X] + 0.17 * tall, sign * apart, shoulder[Z] - 0.21 * tall])
        wrist = body.local[WRIST[side]].copy()
        reach_by(body, side, goal, np.array([-0.6, sign * 1.0, -0.8]), part)
        body.local[WRIST[side]] = part_way(wrist, rotation_about(Z, -sign * 0.35), part)
        grip(body, side, 0.3)
