"""PettingZoo and Gymnasium environments of the simulation, their spaces and checks."""

from vico.envs.check import EnvFinding, check_env
from vico.envs.parallel import CommunityEnv, SingleAgentEnv, make
from vico.envs.spec import EnvSpec, register_ids
from vico.envs.vector import ParallelVectorEnv, VectorAgentEnv, make_parallel_vec
from vico.envs.workers import WorkerError
from vico.sim.loop.simulation import Simulation, StepResult

register_ids()

__all__ = [
    "CommunityEnv",
    "EnvFinding",
    "EnvSpec",
    "ParallelVectorEnv",
    "Simulation",
    "SingleAgentEnv",
    "StepResult",
    "VectorAgentEnv",
    "WorkerError",
    "check_env",
    "make",
    "make_parallel_vec",
    "register_ids",
]
