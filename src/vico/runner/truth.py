"""Ground truth of a run, for challenges: authors change it before the first step, judges read it afterwards.

Challenges import these types from here, because they do not know the simulation. Agents must not import this module.
"""

from vico.sim.loop.scenario import GroundTruth as GroundTruth
from vico.sim.loop.scenario import Scenario as Scenario
from vico.sim.robots.population import RobotPopulation as RobotPopulation
