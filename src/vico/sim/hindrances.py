"""Who is in whose way in rooms: whom one has walked into, and who keeps one from getting up."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from vico.rules import ActionStatus, ReasonCode
from vico.sim.simulation_state import SimulationState
from vico.sim.state import RADIUS, Posture

# Who stands no farther than this from where somebody would stand who gets up is in the way, metres.
_IN_THE_WAY = 2 * RADIUS + 0.1


class Hindrances:
    """Who was in whose way in the last second, as people in rooms are told it.

    Parameters
    ----------
    state
        Of that moment.

    Attributes
    ----------
    stopped_by
        By person: whom one walked into, as ``agent`` and ``position``.
    in_the_way_of
        By person: who walked into one, as ``agent`` and ``position``; and who can't get up for one, with the position
        where they would stand. ``gets_up`` tells which.
    """

    def __init__(self, state: SimulationState) -> None:
        self.stopped_by: dict[int, dict[str, Any]] = {}
        self.in_the_way_of: dict[int, list[dict[str, Any]]] = {}
        p = state.people
        stopped = (p.status == ActionStatus.COLLISION) & (p.contact > 0) & (p.room >= 0)
        for i in np.flatnonzero(stopped).tolist():
            who = np.flatnonzero(p.entity == p.contact[i])
            if len(who):
                self._add_contact(i, int(who[0]), state)
        bound = (p.status == ActionStatus.REFUSED) & (p.reason_code == ReasonCode.NO_FREE_SPOT)
        for i in np.flatnonzero(bound & (p.seat >= 0) & (p.room >= 0)).tolist():
            self._add_bound(i, state)

    def _add_contact(self, i: int, other: int, state: SimulationState) -> None:
        p = state.people
        self.stopped_by[i] = {"agent": p.names[other], "position": tuple(p.position[other].tolist())}
        pushes = {"agent": p.names[i], "position": tuple(p.position[i].tolist()), "gets_up": False}
        self.in_the_way_of.setdefault(other, []).append(pushes)

    def _add_bound(self, i: int, state: SimulationState) -> None:
        """Note who stands where somebody would who can't get up."""
        p = state.people
        spot = state.seats.stand_before(int(p.seat[i]), state.indoor)
        if spot is None:
            return
        there = (p.room == p.room[i]) & (p.posture == Posture.STANDING)
        for other in np.flatnonzero(there).tolist():
            if math.dist(p.position[other, :2].tolist(), spot[:2]) <= _IN_THE_WAY:
                wants = {"agent": p.names[i], "position": spot, "gets_up": True}
                self.in_the_way_of.setdefault(other, []).append(wants)


__all__ = ["Hindrances"]
