"""Walking within a room: around what depth images showed and what one bumped into."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.agents.base import Action, Observation, heading, wrapped
from vico.agents.perception import DepthGrid

_STRIDE = 1.0
_ALIGNED = math.radians(8.0)


class IndoorWalker:
    """Remembers what stands in each room, from pictures where there are any and from bumps otherwise."""

    def __init__(self) -> None:
        self._grids: dict[str, DepthGrid] = {}

    def towards(self, observation: Observation, target: ArrayLike, *, near: float) -> Action | None:
        """Return the next action on the way to a point of the room; None once within `near` metres of it."""
        state, pose = observation["state"], np.asarray(observation["pose"], np.float64)
        position = pose[:2]
        goal = np.asarray(target, np.float64)[:2]
        grid = self._grids.setdefault(state["room"], DepthGrid(position))
        if "depth" in observation:
            grid.see(observation, floor=float(pose[2]))
        yaw = heading(observation)
        if state["action_status"] == "collision":
            grid.bump(position + 0.4 * np.array([math.cos(yaw), math.sin(yaw)]))
        if math.dist(position, goal) <= near:
            return None
        route = grid.route(position, goal, near=near * 0.9)
        aim = _straight(position, route) if len(route) else goal
        turn = wrapped(math.atan2(aim[1] - position[1], aim[0] - position[0]) - yaw)
        if abs(turn) > _ALIGNED:
            return {"type": "turn_left" if turn > 0 else "turn_right", "degrees": abs(math.degrees(turn))}
        return {"type": "move_forward", "distance": max(0.1, min(_STRIDE, math.dist(position, aim)))}


def _straight(position: NDArray[np.float64], route: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the last point of a route that one step reaches without cutting a corner."""
    aim: NDArray[np.float64] = route[0]
    for k in range(1, len(route)):
        way = route[k] - position
        length = math.hypot(*way)
        across = [abs(way[0] * (p[1] - position[1]) - way[1] * (p[0] - position[0])) for p in route[:k]]
        if length > _STRIDE or max(across) / max(length, 1e-9) > 0.12:
            break
        aim = route[k]
    return aim
