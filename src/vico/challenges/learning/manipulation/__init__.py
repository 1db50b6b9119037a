"""An arm and a box: environments for learners, one file a task, with MuJoCo's batched stepping for many copies."""

from vico.challenges.learning.manipulation.environment import (
    MANIPULATION,
    ManipulationBatch,
    ManipulationEnv,
    make_manipulation,
    make_manipulation_vec,
)
from vico.challenges.learning.manipulation.policies import ArrayPolicy, read_policy
from vico.challenges.learning.manipulation.scene import ManipulationOptions

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
