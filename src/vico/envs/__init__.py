"""How other people's code drives the simulation: PettingZoo environments and their spaces."""

from vico.envs.parallel import CommunityEnv, make
from vico.sim.simulation import Simulation

__all__ = ["CommunityEnv", "Simulation", "make"]
