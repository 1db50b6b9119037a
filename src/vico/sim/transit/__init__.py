"""Buses on their timetable and bicycles to rent."""

from vico.rules import BIKE_ASTRAY, BIKE_RATE, BIKE_REACH, ride_price
from vico.rules import BUS_CAPACITY as CAPACITY
from vico.rules import BUS_DOOR_REACH as DOOR_REACH
from vico.rules import BUS_DWELL as DWELL
from vico.rules import BUS_FARE as FARE
from vico.sim.transit.bicycles import Bicycles
from vico.sim.transit.bus_plan import BusPlan, plan_buses
from vico.sim.transit.system import TransitSystem
from vico.world.timetable import departure

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
