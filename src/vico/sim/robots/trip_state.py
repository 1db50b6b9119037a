"""Where robots are indoors, and where they go, as arrays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.sim.robots.rooms import OUTDOORS

Array = NDArray[np.float64]

#: No room, no door.
NONE = -2


@dataclass
class RobotTrips:
    """Where robots are indoors, and where they go; row = robot.

    Attributes
    ----------
    room
        Room it is in, `OUTDOORS` for none, int32, shape ``(n,)``.
    goal_room, goal
        Space it goes to, `NONE` without a trip, and the point there, ENU metres, shape ``(n, 3)``.
    leg
        Space behind the door that its path leads to, `NONE` where that leads to the goal, int32, shape ``(n,)``.
    door
        Space behind the door that it stands at and waits to go through, else `NONE`, int32, shape ``(n,)``.
    ride
        Seconds it has ridden in a lift, float64, shape ``(n,)``.
    """

    room: NDArray[np.int32]
    goal_room: NDArray[np.int32]
    goal: Array
    leg: NDArray[np.int32]
    door: NDArray[np.int32]
    ride: Array

    @classmethod
    def none(cls, robots: int) -> RobotTrips:
        """All robots are outdoors, and go nowhere."""
        nowhere = np.full(robots, NONE, np.int32)
        outdoors = np.full(robots, OUTDOORS, np.int32)
        return cls(outdoors, nowhere, np.zeros((robots, 3)), nowhere.copy(), nowhere.copy(), np.zeros(robots))

    def end(self, robot: int) -> None:
        """Forget where a robot was going."""
        self.goal_room[robot] = self.leg[robot] = self.door[robot] = NONE
        self.goal[robot], self.ride[robot] = 0.0, 0.0

    def saved(self) -> dict[str, NDArray[Any]]:
        """Every number, copied."""
        return {f"trip_{name}": array.copy() for name, array in vars(self).items()}

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go back to what `saved` returned."""
        for name, array in vars(self).items():
            array[...] = arrays[f"trip_{name}"]
