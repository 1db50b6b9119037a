"""Walking to a box, indoors and outdoors, by what pictures show and the public map."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.agents.base import Action, AgentState, Info, Observation, heading
from vico.agents.navigation.path_planning import PathKeeper, Target, furthest_straight_cell
from vico.agents.navigation.voxels import BESIDE_COST, SIDE, VOXEL, VoxelMap
from vico.agents.wayfinding import Walker
from vico.exact import dot
from vico.geometry import wrap_angle
from vico.rules import ReasonCode, code_name
from vico.world.public import PublicMap

_STRIDE = 1.0  # metres a step
_HIT_SOLID = code_name(ReasonCode.HIT_SOLID)
#: Rooms that are remembered beside the one one is in.
ROOMS = 6
# Doors of one room that lie so much higher than others have stairs between them, metres.
_STOREY = 0.5
# Off the line by more than this after a step means turning first, metres: with room beside it, and without.
_DRIFT, _NARROW_DRIFT = 0.12, 0.04
# The last point of a way lies so much inside the target, metres: one stops where the caller, too, finds one there.
_INSIDE, _LEAST_NEAR = 0.06, 0.05
# Straight pieces of ways are looked for up to so many columns ahead; fewer on stairs, where less is in view.
_AHEAD, _AHEAD_ON_STAIRS = 120.0, 10.0
# What moves and leaves no way is waited for so many steps.
_PATIENCE = 5
# What one bumped into on the way to one target is forgotten so often, where no way is left.
_FORGIVEN = 2
# Who has just come in stands so near to the door, metres.
_CAME_IN = 1.2
OUTDOORS = ""


class Navigator:
    """Knows what stands where from pictures, and walks to targets around it.

    Indoors, ways are found on the 0.1 m columns of the voxels. Outdoors they are the public map's router's, on its
    cells of 0.5 m; what stops one there is stepped round.

    Parameters
    ----------
    public_map
        What one knows of the world.
    generator
        Decides how one gets out of others' way outdoors.
    """

    def __init__(self, public_map: PublicMap, generator: np.random.Generator) -> None:
        self._public = public_map
        self.walker = Walker(public_map, generator)
        # The space one is in, and the last few before it, as plain data: a map takes ten times as much memory.
        self._space: str | None = None
        self._floor = 0.0
        self._map = VoxelMap(None)
        self._left: dict[str, AgentState] = {}
        self._keeper = PathKeeper(SIDE)
        self._target: Target | None = None
        self._waited = 0
        self._forgiven = 0
        # How often in a row something solid stopped a step, and whether the last action was one.
        self._stumbles = 0
        self._stepped = False

    @property
    def searches(self) -> int:
        """How often a way was searched indoors so far."""
        return self._keeper.searches

    def notice(self, observation: Observation, info: Info, *, ignore: ArrayLike = ()) -> None:
        """Take in what a new observation shows, and whether the last step was stopped.

        Parameters
        ----------
        observation
            With pictures.
        info
            Its ``entities`` tell what moves.
        ignore
            Entities that are in nobody's way: what one carries.
        """
        self._enter_space(observation)
        if self._space == OUTDOORS:
            return
        self._map.see(observation, info["entities"], ignore)
        state = observation["state"]
        if state["action_status"] == "collision":
            self._stumbles += state["action_code"] == _HIT_SOLID
            times = self._stumbles if state["action_code"] == _HIT_SOLID else 0
            self._map.stumble(np.asarray(observation["pose"], np.float64), int(state["time"]), times=times)
        elif self._stepped:
            self._stumbles = 0

    def towards(self, observation: Observation, info: Info, target: Target, *, speed: float = 1.0) -> Action | None:
        """Return the next action on the way to a target; None once there, or where no way leads nearer.

        Parameters
        ----------
        observation, info
            The ones that `notice` was given last.
        target
            Where to go.
        speed
            Metres a second to walk at outdoors.
        """
        self._stepped = False
        x, y = (float(value) for value in observation["pose"][:2])
        if target.away(x, y) <= target.near and self._is_level(observation, target):
            self.stop()
            return None
        if target != self._target:
            self._target, self._waited, self._forgiven = target, 0, 0
        if self._space == OUTDOORS:
            return self.walker.towards((target.x, target.y), speed, observation, info)
        return self._indoors(observation, target)

    def stop(self) -> None:
        """Forget the way."""
        self._target = None
        self.walker.stop()

    def _is_level(self, observation: Observation, target: Target) -> bool:
        return not self._map.climbs or target.z is None or abs(float(observation["pose"][2]) - target.z) <= _STOREY

    # Spaces.

    def _enter_space(self, observation: Observation) -> None:
        """Have the map of the room one is in, or of outdoors; what it held is known where one was there before."""
        space = str(observation["state"]["room"] or OUTDOORS)
        if space == self._space:
            return
        if self._space is not None:
            self._left[self._space] = self._map_state()
        known = self._left.pop(space, None)
        self._space = space
        self._keeper.forget()
        self._take_map(observation, known)
        while len(self._left) > ROOMS:
            del self._left[next(iter(self._left))]

    def _take_map(self, observation: Observation, known: AgentState | None) -> None:
        self._floor = float(observation["pose"][2]) if known is None else float(known["floor"])
        heights = [float(door["position"][2]) for door in observation["state"]["doors"]]
        self._map = self._made_map(min([*heights, self._floor]), max(heights, default=0.0) - min(heights, default=0.0))
        if known is not None:
            self._map.restore(known["map"])
        elif self._space != OUTDOORS:
            self._assume_wall_behind(observation)

    def _assume_wall_behind(self, observation: Observation) -> None:
        """Take it that the wall of the door one has just come in by, which one has behind, is straight."""
        pose = np.asarray(observation["pose"], np.float64)
        doors = [np.asarray(door["position"], np.float64) for door in observation["state"]["doors"]]
        near = [door for door in doors if np.linalg.norm(door - pose[:3]) <= _CAME_IN]
        ahead = pose[3:5] / max(float(np.hypot(*pose[3:5])), 1e-9)
        behind = [door for door in near if float(dot((door - pose[:3])[:2], ahead)) < 0.0]
        if behind:
            nearest = min(behind, key=lambda door: float(np.linalg.norm(door - pose[:3])))
            self._map.assume_wall(nearest, ahead, int(observation["state"]["time"]))

    def _made_map(self, lowest: float, rise: float) -> VoxelMap:
        if self._space == OUTDOORS:
            return VoxelMap(self._public.height.upper, least=2)
        if rise > _STOREY:
            return VoxelMap(None, lowest=lowest)
        return VoxelMap(self._floor)

    def _map_state(self) -> AgentState:
        return {"floor": self._floor, "climbs": self._map.climbs, "map": self._map.state()}

    # Indoors.

    def _indoors(self, observation: Observation, target: Target) -> Action | None:
        cells = self._way(observation, target)
        # What one bumped into may have been taken for wider than it is.
        now = int(observation["state"]["time"])
        if len(cells) < 2 and self._forgiven < _FORGIVEN and self._map.forget_stumbles(now):
            self._forgiven += 1
            cells = self._way(observation, target)
        if len(cells) < 2 and self._map.passing and self._waited < _PATIENCE:
            self._waited += 1
            return {"type": "wait"}
        if len(cells) < 2 and self._map.forget_moving():
            cells = self._way(observation, target)
        return self._step(observation, cells) if len(cells) > 1 else None

    def _way(self, observation: Observation, target: Target) -> NDArray[np.int64]:
        """Return the cells of the best way known, from the one that one stands in."""
        voxels, pose = self._map.voxels, observation["pose"]
        x, y = float(pose[0]), float(pose[1])
        column, row = math.floor(x / VOXEL), math.floor(y / VOXEL)
        base = self._map.base if self._map.climbs else 0.0
        near = max(target.near - _INSIDE, _LEAST_NEAR)
        inner = Target(target.x, target.y, target.yaw, target.half_length, target.half_width, near, target.z)
        start = (column, row, (float(pose[2]) - base) / VOXEL)
        return self._keeper.way(voxels.cost, voxels.mask, start, inner.values(base), climb=self._map.climbs)

    def _step(self, observation: Observation, cells: NDArray[np.int64]) -> Action:
        x, y = (float(value) for value in observation["pose"][:2])
        most = _AHEAD_ON_STAIRS if self._map.climbs else _AHEAD
        which, limit = furthest_straight_cell(self._map.cost, cells, x / VOXEL, y / VOXEL, most)
        east, north = ((float(cells[which, k]) + 0.5) * VOXEL - here for k, here in ((0, x), (1, y)))
        away = math.hypot(east, north)
        turn = wrap_angle(math.atan2(north, east) - heading(observation))
        stride = min(away, _STRIDE)
        drift = _DRIFT if limit <= BESIDE_COST else _NARROW_DRIFT
        if math.cos(turn) <= 0.0 or stride * abs(math.sin(turn)) > drift:
            return {"type": "turn_left" if turn > 0 else "turn_right", "degrees": abs(math.degrees(turn))}
        self._stepped = True
        return {"type": "move_forward", "distance": stride}

    # Plain data.

    def state(self) -> AgentState:
        """Return what stands where in the spaces that are remembered, and the way under way."""
        spaces = list(self._left.items())
        if self._space is not None:
            spaces.append((self._space, self._map_state()))
        target = self._target
        return {
            "spaces": {str(k): {"space": space, **known} for k, (space, known) in enumerate(spaces)},
            "here": self._space is not None,
            "keeper": self._keeper.state(self._map.cost),
            "walker": self.walker.state(),
            "target": None if target is None else [target.x, target.y, target.yaw, target.half_length,
                                                   target.half_width, target.near, target.z],
            "waited": self._waited,
            "forgiven": self._forgiven,
            "stumbles": self._stumbles,
            "stepped": self._stepped,
        }  # fmt: skip

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on as `state` returned it."""
        spaces = state["spaces"]
        self._left = {str(spaces[str(k)]["space"]): dict(spaces[str(k)]) for k in range(len(spaces))}
        self._space, self._map = None, VoxelMap(None)
        if state["here"]:
            self._space, known = self._left.popitem()
            self._floor = float(known["floor"])
            lowest = float(known["map"]["lowest"])
            self._map = self._made_map(lowest, math.inf if known["climbs"] else 0.0)
            self._map.restore(known["map"])
        self._keeper.restore(state["keeper"], self._map.cost)
        self.walker.restore(state["walker"])
        self._target = None if state["target"] is None else Target(*state["target"])
        self._waited, self._stumbles = int(state["waited"]), int(state["stumbles"])
        self._stepped, self._forgiven = bool(state["stepped"]), int(state["forgiven"])
