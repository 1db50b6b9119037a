"""Buses on their timetable and bicycles to rent."""

from vico.sim.transit.bicycles import BIKE_ASTRAY, BIKE_RATE, BIKE_REACH, Bicycles, ride_price
from vico.sim.transit.bus_plan import BusPlan, departure, plan_buses
from vico.sim.transit.system import CAPACITY, DOOR_REACH, DWELL, FARE, TransitSystem

__all__ = [
    "BIKE_ASTRAY",
    "BIKE_RATE",
    "BIKE_REACH",
    "CAPACITY",
    "DOOR_REACH",
    "DWELL",
    "FARE",
    "Bicycles",
    "BusPlan",
    "TransitSystem",
    "departure",
    "plan_buses",
    "ride_price",
]
