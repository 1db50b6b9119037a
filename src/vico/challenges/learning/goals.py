"""What agents are told of their task, beside what they observe: in a space of its own, or behind the numbers."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray


def with_goal_space(space: spaces.Space[Any], goal: spaces.Box[Any]) -> spaces.Space[Any]:
    """Return the space of observations with a goal: one more entry of a Dict, more numbers of a Box."""
    if isinstance(space, spaces.Box):
        low, high = (np.concatenate([a, b.reshape(-1)]) for a, b in ((space.low, goal.low), (space.high, goal.high)))
        return spaces.Box(low, high, dtype=np.float32)
    assert isinstance(space, spaces.Dict)
    return spaces.Dict({**space.spaces, "goal": goal})


def with_goal(observation: Any, goal: NDArray[np.float32], space: spaces.Box[Any]) -> Any:
    """Return an observation with a goal, whose numbers are cut off at the bounds of its space."""
    told = np.clip(goal, space.low, space.high).astype(np.float32)
    if isinstance(observation, np.ndarray):
        return np.concatenate([observation, told.reshape(-1)])
    return {**observation, "goal": told}
