"""An arm and a box: environments for learners, one file a task, with MuJoCo's batched stepping for many copies."""

from vico.challenges.learning.manipulation.environment import ManipulationBatch, ManipulationEnv
from vico.challenges.learning.manipulation.make import MANIPULATION, make_manipulation, make_manipulation_vec
from vico.challenges.learning.manipulation.options import ManipulationOptions
from vico.challenges.learning.manipulation.policy import ArrayPolicy, read_policy

__all__ = [
    "MANIPULATION",
    "ArrayPolicy",
    "ManipulationBatch",
    "ManipulationEnv",
    "ManipulationOptions",
    "make_manipulation",
    "make_manipulation_vec",
    "read_policy",
]
