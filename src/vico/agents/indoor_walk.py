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
        # The room one is in, and the last few before it, the one that was left last at the end: as plain data, for a
        # grid takes some ten times as much memory, and a thousand residents remember six rooms each.
        self._room: str | None = None
        self._grid = DepthGrid((0.0, 0.0))
        self._left: dict[str, AgentState] = {}

    def state(self) -> AgentState:
        """Return what it knows of which rooms, numbered from the one that was entered longest ago."""
        rooms = list(self._left.items())
        if self._room is not None:
            rooms.append((self._room, self._grid.state()))
        return {str(k): {"room": room, "grid": grid} for k, (room, grid) in enumerate(rooms)}

    def restore(self, state: AgentState) -> None:
        """Know what `state` returned."""
        self._room, self._left = None, {state[str(k)]["room"]: state[str(k)]["grid"] for k in range(len(state))}
        if self._left:
            self._room, grid = self._left.popitem()
            self._grid.restore(grid)

    def notice(self, observation: Observation, info: Info, *, ignore: ArrayLike = ()) -> None:
        """Take in what a new observation shows of the room one is in.

        Parameters
        ----------
        info
            Its ``in_view``, if it has one, knows the room: then pictures are not looked at.
        ignore
            Entities that are not in the way (what one carries or is going to pick up).
        """
        new, in_view = observation["state"]["room"] not in (self._room, *self._left), info.get("in_view")
        grid, pose = self._grid_of(observation), np.asarray(observation["pose"], np.float64)
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
        route = self._grid_of(observation).route(position, goal, near=near * 0.9)
        # Where no way is known, nothing known is in the way of trying.
        aim = _straight(position, route) if len(route) else goal
        turn = wrapped(math.atan2(aim[1] - position[1], aim[0] - position[0]) - heading(observation))
        if abs(turn) > _ALIGNED:
            return {"type": "turn_left" if turn > 0 else "turn_right", "degrees": abs(math.degrees(turn))}
        return {"type": "move_forward", "distance": max(0.1, min(_STRIDE, math.dist(position, aim)))}

    def _grid_of(self, observation: Observation) -> DepthGrid:
        """Return the grid of the room one is in; what it holds was known before where one was there before."""
        room = observation["state"]["room"]
        if room != self._room:
            if self._room is not None:
                self._left[self._room] = self._grid.state()
            known = self._left.pop(room, None)
            self._room, self._grid = room, DepthGrid(np.asarray(observation["pose"], np.float64)[:2])
            if known is not None:
                self._grid.restore(known)
            if len(self._left) >= _REMEMBERED:
                del self._left[next(iter(self._left))]
        return self._grid


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
