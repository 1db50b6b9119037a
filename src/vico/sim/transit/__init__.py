"""Buses on their timetable and bicycles to rent."""

from vico.sim.transit.bus_plan import BusPlan, departure, plan_buses
from vico.sim.transit.system import (
    BIKE_ASTRAY,
    BIKE_RATE,
    BIKE_REACH,
    CAPACITY,
    DOOR_REACH,
    DWELL,
    FARE,
    TransitSystem,
    ride_price,
)

__all__ = [
    "BIKE_ASTRAY",
    "BIKE_RATE",
    "BIKE_REACH",
    "CAPACITY",
    "DOOR_REACH",
    "DWELL",
    "FARE",
    "BusPlan",
    "TransitSystem",
    "departure",
    "plan_buses",
    "ride_price",
]
