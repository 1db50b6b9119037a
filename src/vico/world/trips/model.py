"""Trips: legs on foot and in vehicles, with their times and prices."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vico.world.model import Point2

#: Ways to get about.
MODES = ("walk", "bus", "tram", "bike")

#: Seconds that each takes: getting into a bus, out of it, on and off a bicycle. An agent acts once a second.
BOARD = ALIGHT = MOUNT = DISMOUNT = 1.0
#: Who boards on the way has to be there so many seconds before the bus is due to leave: it may be early by as much.
AHEAD = 10.0

#: Something out of use: the id of a line, a stop or a bicycle station, or a circle of ground: x, y, radius, metres.
Closure = str | tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Leg:
    """A part of a trip in one mode.

    Attributes
    ----------
    mode
        walk, bus, tram or bike.
    start, end
        ENU metres: of a ride the stops or stations.
    polyline
        The way, shape ``(k, 2)``, ``k >= 1``; of a bus ride the stops it calls at.
    depart
        When one sets out, or the bus leaves; second of the day, past midnight above 86,400.
    arrive
        When one is there, off the vehicle.
    metres
        Length of the polyline.
    price
        What the ride costs.
    line
        Id of the bus or tram line; None for other modes.
    origin, destination
        Ids of the stops or stations where the ride begins and ends; None on foot.
    """

    mode: str
    start: Point2
    end: Point2
    polyline: NDArray[np.float64]
    depart: float
    arrive: float
    metres: float
    price: float = 0.0
    line: str | None = None
    origin: str | None = None
    destination: str | None = None

    @property
    def seconds(self) -> float:
        """Return how long it takes."""
        return self.arrive - self.depart


@dataclass(frozen=True, eq=False)
class Trip:
    """A way from one point to another.

    Attributes
    ----------
    depart
        When one sets out, second of the day.
    legs
        In order; between them one may have to wait.
    """

    depart: float
    legs: tuple[Leg, ...]

    @property
    def arrive(self) -> float:
        """Return when one is there, second of the day."""
        return self.legs[-1].arrive

    @property
    def seconds(self) -> float:
        """Return how long it takes, waiting included."""
        return self.arrive - self.depart

    @property
    def price(self) -> float:
        """Price of all rides together."""
        return round(sum(leg.price for leg in self.legs), 2)

    @property
    def walked(self) -> float:
        """Metres on foot."""
        return sum(leg.metres for leg in self.legs if leg.mode == "walk")

    @property
    def modes(self) -> tuple[str, ...]:
        """The modes of its legs."""
        return tuple(leg.mode for leg in self.legs)
