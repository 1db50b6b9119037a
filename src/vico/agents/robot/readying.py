"""Ways of an arm to where a policy takes over: as episodes of its training began."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.agents.robot.body import ArmBody, Stance
from vico.agents.robot.following import turned_aside
from vico.agents.robot.held import Held
from vico.agents.robot.reaching import GAP, reach_spot, room_around
from vico.agents.robot.sight import look
from vico.agents.robot.skill import Ready
from vico.kinematics.planning import Arm, free_way

Array = NDArray[np.float64]

# Before it is put down a thing is held so far beside its goal, metres, on either side of it.
_BESIDE = 0.22
# Gaps that are tried on the way, metres.
_GAPS = (GAP, 0.0, -0.02)


def way_to_ready(body: ArmBody, observation: Mapping[str, Any], now: Array, ready: Ready) -> Array | None:
    """Return a way from angles to those a policy picks from, shape ``(m, 7)``; None if none is free."""
    room, limbs = room_around(body, look(observation).points), body.limbs(ready.opening)
    for gap in _GAPS:
        way = free_way(Arm(body.chain, limbs, room, gap), now, ready.angles)
        if way is not None:
            return way
    return None


def way_beside(
    body: ArmBody, observation: Mapping[str, Any], now: Array, held: Held, spot: Array, *, entity: int
) -> Array:
    """Return a way on which what is held comes beside its goal, a little above what that lies on, shape ``(m, 7)``.

    Where no such place can be reached the policy begins with the arm as it is.

    Parameters
    ----------
    spot
        The goal, ENU metres, shape ``(3,)``.
    entity
        Of what is held.
    """
    seen, inside = look(observation), Stance.of(observation).inside(spot)
    room = room_around(body, seen.without(entity))
    for side in (_BESIDE, -_BESIDE):
        reach = reach_spot(body, room, now, turned_aside(inside, side), held)
        if reach is not None:
            return reach.over
    return now[None]
