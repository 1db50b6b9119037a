"""What a manipulator feels, made up."""

from typing import Any

import numpy as np


def sensors(joints: int = 9) -> dict[str, Any]:
    """A robot that looks north, drives north and turns left."""
    half = np.sqrt(0.5)
    return {
        "joint_position": np.linspace(-0.5, 0.5, joints),
        "joint_velocity": np.linspace(1.0, 2.0, joints),
        "base_pose": np.array([3.0, 4.0, 0.1, half, 0.0, 0.0, half]),
        "base_velocity": np.array([0.1, 0.4, 0.0]),
        "angular_velocity": np.array([0.0, 0.0, 0.3]),
    }
