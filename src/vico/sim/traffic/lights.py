"""Lights of a vehicle: brakes, indicators, both indicators at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vico.assets.vehicles import lit_lamps
from vico.io.compiled import compiled
from vico.sim.bodies.arrays import Drawn
from vico.sim.traffic.state import APPROACHING, NONE

# Bits of what a vehicle shows.
BRAKE = 1
LEFT = 2
RIGHT = 4

_BRAKES = 0.6  # m/s^2: who loses speed faster is on the brake
_SIGNALS_FROM = 35.0  # m before a turn, or before a lane change is over
_CHANGES = 0.3  # m to the side that a lane change has still to go
_BLINKS = 3.0  # times a second that indicators go on or off


@compiled
def shown_lights(net, vehicle, speed_before, dt):
    """Return the lights that a vehicle shows: whether it brakes or stands, and where it turns or changes lanes to."""
    if vehicle.is_bicycle:
        return 0
    shown = BRAKE if vehicle.speed == 0.0 or speed_before - vehicle.speed > _BRAKES * dt else 0
    if vehicle.stopping == APPROACHING:
        return shown
    if vehicle.lateral_offset > _CHANGES and vehicle.lane_change_distance < vehicle.length:
        return shown | RIGHT  # it comes from the left
    if vehicle.lateral_offset < -_CHANGES and vehicle.lane_change_distance < vehicle.length:
        return shown | LEFT
    turn = net.lanes[vehicle.lane].turn
    ahead = net.lanes[vehicle.lane].length - vehicle.offset
    for k in range(vehicle.planned_count):
        if turn != 0 or ahead > _SIGNALS_FROM or vehicle.planned_lanes[k] == NONE:
            break
        turn = net.lanes[vehicle.planned_lanes[k]].turn
        ahead += net.lanes[vehicle.planned_lanes[k]].length
    if turn == 0:
        return shown
    return shown | (LEFT if turn > 0 else RIGHT)


class LampDrawing:
    """Draws the lamps that are lit.

    Parameters
    ----------
    kinds
        Of each vehicle: a kind of car, ``bus``, or ``bicycle``, which has none.
    """

    def __init__(self, kinds: list[str]) -> None:
        self._names = list(lit_lamps())
        number = {name: k for k, name in enumerate(self._names)}
        self._lamps = np.array(
            [[number.get(f"{kind}:{lamp}", 0) for kind in kinds] for lamp in ("brake", "left", "right")]
        )
        self._lamps = self._lamps.reshape(3, len(kinds)).astype(np.int32)

    def draw(self, lights: NDArray[np.uint8], elapsed: float, vehicles: Drawn) -> Drawn:
        """Return the lamps that are lit at a moment.

        Parameters
        ----------
        lights
            Of each vehicle, bits.
        elapsed
            Seconds since the traffic began: indicators blink.
        vehicles
            The vehicles as drawn.
        """
        blinks = (int(np.floor(elapsed * _BLINKS + 0.5)) + np.arange(len(lights))) % 2 == 0
        lit = np.stack([lights & BRAKE > 0, (lights & LEFT > 0) & blinks, (lights & RIGHT > 0) & blinks])
        which, who = np.nonzero(lit)
        return Drawn(self._names, self._lamps[which, who], vehicles.transforms[who], vehicles.entity[who])
