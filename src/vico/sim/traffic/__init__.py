"""Cars, buses and pedestrians that nobody plays: who drives where, who yields to whom, all in compiled kernels."""

from vico.sim.traffic.junctions import JunctionRule
from vico.sim.traffic.network import TrafficNetwork
from vico.sim.traffic.placement import TrafficSetup
from vico.sim.traffic.population import Traffic

__all__ = ["JunctionRule", "Traffic", "TrafficNetwork", "TrafficSetup"]
