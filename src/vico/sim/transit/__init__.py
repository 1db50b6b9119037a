"""Buses on their timetable and bicycles to rent."""

from vico.sim.transit.bicycles import Bicycles
from vico.sim.transit.buses import BusPlan, plan_buses
from vico.sim.transit.system import TransitSystem

__all__ = ["Bicycles", "BusPlan", "TransitSystem", "plan_buses"]
