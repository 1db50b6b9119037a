"""The state behind a run, for challenges: authors change it before the first step, judges ask about it after.

Agents get none of this. Challenges import these types from here: rooms above the runner don't know the simulation.
"""

from vico.sim.loop.scenario import GroundTruth as GroundTruth
from vico.sim.loop.scenario import Scenario as Scenario
from vico.sim.robots.population import RobotPopulation as RobotPopulation
