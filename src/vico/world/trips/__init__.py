"""Ways from door to door on foot, by bus, by tram and by bicycle, by the clock: one router for all who plan."""

from vico.world.trips.model import AHEAD, MODES, Closure, Leg, Trip
from vico.world.trips.router import Trips

__all__ = ["AHEAD", "MODES", "Closure", "Leg", "Trip", "Trips"]
