"""Jams: vehicles that block each other back up, and the log of vehicles that were stuck or taken out.

A vehicle backs up that keeps another one from leaving a junction, or stands head to head with it. Having made room it
stays until the other one has passed: it would be in its way again. Every vehicle that is stuck, or was taken out of a
jam, is counted.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.io.compiled import compiled
from vico.sim.traffic.junctions import waits_outside
from vico.sim.traffic.state import NONE

#: Who has stood still, or walked on the spot, for so long is stuck, s.
STUCK_AFTER = 60.0
#: So many rescues are kept with all particulars; all are counted.
KEPT = 64

#: A rescue: index and place of the vehicle before it, seconds from the start of the traffic to it, how long it had
#: stood, and the entity before it (0 for none).
_RESCUE = np.dtype(
    [
        ("vehicle", np.int32),
        ("x", np.float64),
        ("y", np.float64),
        ("at", np.float64),
        ("stood", np.float64),
        ("before", np.int64),
    ]
)


@dataclass(frozen=True)
class Jam:
    """Somebody who got nowhere.

    Attributes
    ----------
    entity
        Whose body.
    position
        Where, ENU metres, shape ``(2,)``.
    at, stood
        When this was so, seconds after the traffic began, and for how long it had been.
    before
        Entity of whom it stood behind, 0 for nobody.
    """

    entity: int
    position: tuple[float, float]
    at: float
    stood: float
    before: int


class JamLog:
    """Remembers rescues: part of the traffic's state.

    Attributes
    ----------
    elapsed
        Seconds since the traffic began, shape ``(1,)``.
    """

    def __init__(self, first_entity: int) -> None:
        self._first = first_entity
        self.elapsed = np.zeros(1)
        self._rescues = np.zeros(KEPT, _RESCUE)
        self._count = np.zeros(1, np.int64)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Every array by name, not copied."""
        found = {"elapsed": self.elapsed, "rescues": self._count}
        return found | {f"rescue_{name}": self._rescues[name] for name in _RESCUE.fields or ()}

    @property
    def count(self) -> int:
        """How many vehicles were taken out of jams."""
        return int(self._count[0])

    def note_rescue(self, vehicle: int, xy: tuple[float, float], stood: float, before: int) -> None:
        """Remember that a vehicle was taken away from where it had stood."""
        if self._count[0] < KEPT:
            self._rescues[self._count[0]] = (vehicle, *xy, self.elapsed[0], stood, before)
        self._count[0] += 1

    def rescued(self) -> list[Jam]:
        """Return the first rescues."""
        kept = self._rescues[: min(self.count, KEPT)]
        return [
            Jam(
                self._first + int(r["vehicle"]),
                (float(r["x"]), float(r["y"])),
                float(r["at"]),
                float(r["stood"]),
                int(r["before"]),
            )
            for r in kept
        ]


_BACK_UP_AFTER = 3.0  # s that both have stood
_ALIKE = 0.85  # cosine of the angle between two headings that count as the same
_QUEUE = 6  # vehicles behind one another that make room
_ROOM = 6.0  # m that are left behind a vehicle that lets another one pass: it may have to back up farther
_AWAY = 3.0  # m between two vehicles' outer circles from which on they have passed each other
_BACK_UP_FOR_PERSON, _LOOKS_FOR_WAY = 8.0, 0.2  # s that it has stood, and m/s at which the person walks to and fro
_GIVES_WAY_FOR = 25.0  # s after which a vehicle that lets another one pass does no longer


@compiled
def _block_each_other(vehicle, other):
    """Return whether both, one behind the other, have stood for a while, and not at a stop."""
    if other.gives_way_to == vehicle.index:
        return True
    return not other.at_stop and vehicle.stopped_time >= _BACK_UP_AFTER and other.stopped_time >= _BACK_UP_AFTER


@compiled
def _plans_over(vehicle, lane):
    """Return whether a vehicle is going to take a lane."""
    takes = False
    for k in range(vehicle.planned_count):
        takes = takes or vehicle.planned_lanes[k] == lane
    return takes


@compiled
def _gives_way_head_on(net, vehicle, other):
    """Return whether `other`, of two in each other's way, backs up.

    Who already does; else the one that follows the other's way; the one outside the junction; a car rather than a bus;
    the higher number.
    """
    if other.gives_way_to == vehicle.index or vehicle.gives_way_to == other.index:
        return other.gives_way_to == vehicle.index
    if _plans_over(other, vehicle.lane) != _plans_over(vehicle, other.lane):
        return _plans_over(other, vehicle.lane)
    inside, other_inside = net.lanes[vehicle.lane].junction >= 0, net.lanes[other.lane].junction >= 0
    is_shorter = other.length < vehicle.length
    is_later = other.length == vehicle.length and other.index > vehicle.index
    return (inside and not other_inside) or (inside == other_inside and (is_shorter or is_later))


@compiled
def _drives_before(shapes, other, vehicle):
    """Return whether `other` is ahead of a vehicle and headed as it is, as in a queue; beside it, it is in its way."""
    v, o = vehicle.index, other.index
    if other.lane == vehicle.lane and other.lateral_offset == 0.0:
        return other.offset > vehicle.offset  # in bends they are headed otherwise
    c, s = np.cos(shapes.yaw[v]), np.sin(shapes.yaw[v])
    ahead = (shapes.x[o] - shapes.x[v]) * c + (shapes.y[o] - shapes.y[v]) * s
    return np.cos(shapes.yaw[v] - shapes.yaw[o]) >= _ALIKE and ahead > vehicle.length / 2


@compiled
def _waits_beside_way(net, vehicle, other):
    """Return whether `other` waits for a junction on another street than those that a vehicle takes: no queue."""
    return waits_outside(net, other) and other.lane != vehicle.lane and not _plans_over(vehicle, other.lane)


@compiled
def _have_passed(shapes, vehicle, other):
    """Return whether a vehicle that lets another one pass need not wait for it any more."""
    v, o = vehicle.index, other.index
    if other.blocker == v:
        return False
    apart = np.hypot(shapes.x[o] - shapes.x[v], shapes.y[o] - shapes.y[v])
    # Behind it, it is in nobody's way however near it is.
    ahead = (shapes.x[o] - shapes.x[v]) * np.cos(shapes.yaw[v]) + (shapes.y[o] - shapes.y[v]) * np.sin(shapes.yaw[v])
    return ahead < 0.0 or apart > (vehicle.length + other.length) / 2 + _AWAY


@compiled
def _leaves_no_way(net, vehicle, shapes, b):
    """Return whether a vehicle in a junction stands in the way of a person who looks for one round it, body b."""
    moves = shapes.vx[b] ** 2 + shapes.vy[b] ** 2 > _LOOKS_FOR_WAY**2
    return net.lanes[vehicle.lane].junction >= 0 and vehicle.stopped_time > _BACK_UP_FOR_PERSON and moves


@compiled
def vehicles_backing_up(net, fleet, shapes, dt):
    """Return for each vehicle whether it backs up in this step, bool, shape ``(vehicles,)``; note whom it lets pass."""
    for vehicle in fleet:
        o = vehicle.gives_way_to
        if o == NONE:
            continue
        vehicle.gave_way_for += dt
        if vehicle.gave_way_for > _GIVES_WAY_FOR or _have_passed(shapes, vehicle, fleet[o]):
            vehicle.gives_way_to = NONE
    backs_up = np.zeros(len(fleet), np.bool_)
    for v in range(len(fleet)):
        vehicle, b = fleet[v], fleet[v].blocker
        if b >= len(fleet):
            backs_up[v] = _leaves_no_way(net, vehicle, shapes, b)
        if not 0 <= b < len(fleet) or not _block_each_other(vehicle, fleet[b]):
            continue
        if fleet[b].blocker == v or fleet[b].gives_way_to == v:
            backs_up[b] = _gives_way_head_on(net, vehicle, fleet[b])
        elif net.lanes[vehicle.lane].junction >= 0:
            is_aside = _waits_beside_way(net, vehicle, fleet[b])
            backs_up[b] = backs_up[b] or is_aside or not _drives_before(shapes, fleet[b], vehicle)
        if backs_up[b] and fleet[b].gives_way_to == NONE:
            fleet[b].gives_way_to, fleet[b].gave_way_for = v, 0.0
    # Who stands close behind one that backs up backs up, too.
    for _ in range(_QUEUE):
        for v in range(len(fleet)):
            b = fleet[v].blocker
            if 0 <= b < len(fleet) and backs_up[b] and fleet[v].route < 0 and fleet[v].stopped_time > 0.0:
                backs_up[v] = backs_up[v] or np.cos(shapes.yaw[v] - shapes.yaw[b]) > _ALIKE
    return backs_up


@compiled
def leaves_room_for(fleet, v, gap, leader):
    """Return whether vehicle v, `gap` metres behind its leader, stays there because that one lets another one pass."""
    if not 0 <= leader < len(fleet) or gap > _ROOM:
        return False
    return fleet[leader].gives_way_to != NONE and fleet[leader].gives_way_to != v
