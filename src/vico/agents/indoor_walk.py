"""Walking within a room: around what is in view there and what one bumped into."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.agents.base import Action, Info, Observation, heading, wrapped
from vico.agents.perception import DepthGrid
from vico.agents.state import AgentState
from vico.rules import ReasonCode, code_name

_STRIDE = 1.0  # metres a step
_HIT_SOLID = code_name(ReasonCode.HIT_SOLID)
_ALIGNED = math.radians(8.0)
_REMEMBERED = 6  # rooms
_REACH_OF_BUMPS = 0.4  # metres ahead of one's middle is what stopped a step


class IndoorWalker:
    """Remembers what stands in rooms, by what is in view where that is told, else from pictures, and from bumps."""

    def __init__(self) -> None:
        # The last few rooms, the one that was entered last at the end.
        self._grids: dict[str, DepthGrid] = {}

    def state(self) -> AgentState:
        """Return what it knows of which rooms, numbered from the one that was entered longest ago."""
        return {str(k): {"room": room, "grid": grid.state()} for k, (room, grid) in enumerate(self._grids.items())}

    def restore(self, state: AgentState) -> None:
        """Know what `state` returned."""
        self._grids = {}
        for k in range(len(state)):
            grid = DepthGrid((0.0, 0.0))
            grid.restore(state[str(k)]["grid"])
            self._grids[state[str(k)]["room"]] = grid

    def notice(self, observation: Observation, info: Info, *, ignore: ArrayLike = ()) -> None:
        """Take in what a new observation shows of the room one is in.

        Parameters
        ----------
        info
            Its ``in_view``, if it has one, knows the room: then pictures are not looked at.
        ignore
            Entities that are not in the way (what one carries or is going to pick up).
        """
        new, in_view = observation["state"]["room"] not in self._grids, info.get("in_view")
        grid, pose = self._grid(observation), np.asarray(observation["pose"], np.float64)
        if in_view is not None:
            if new:
                grid.mark(in_view.room, in_view.furniture)
        elif "depth" in observation:
            grid.see(observation, floor=float(pose[2]), ignore=ignore)
        # Who is told what is in the room need not take people for furniture, who go away again.
        state = observation["state"]
        if state["action_status"] == "collision" and (in_view is None or state["action_code"] == _HIT_SOLID):
            yaw = heading(observation)
            grid.bump(pose[:2] + _REACH_OF_BUMPS * np.array([math.cos(yaw), math.sin(yaw)]))

    def towards(self, observation: Observation, target: ArrayLike, *, near: float) -> Action | None:
        """Return the next action on the way to a point of the room; None once within `near` metres of it."""
        position = np.asarray(observation["pose"], np.float64)[:2]
        goal = np.asarray(target, np.float64)[:2]
        if math.dist(position, goal) <= near:
            return None
        route = self._grid(observation).route(position, goal, near=near * 0.9)
        # Where no way is known, nothing known is in the way of trying.
        aim = _straight(position, route) if len(route) else goal
        turn = wrapped(math.atan2(aim[1] - position[1], aim[0] - position[0]) - heading(observation))
        if abs(turn) > _ALIGNED:
            return {"type": "turn_left" if turn > 0 else "turn_right", "degrees": abs(math.degrees(turn))}
        return {"type": "move_forward", "distance": max(0.1, min(_STRIDE, math.dist(position, aim)))}

    def _grid(self, observation: Observation) -> DepthGrid:
        room = observation["state"]["room"]
        grid = self._grids.pop(room, None)
        self._grids[room] = grid or DepthGrid(np.asarray(observation["pose"], np.float64)[:2])
        if len(self._grids) > _REMEMBERED:
            del self._grids[next(iter(self._grids))]
        return self._grids[room]


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
