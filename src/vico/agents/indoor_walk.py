"""Walking within a room: around what is in view there and what one bumped into, past others, and out of their way."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.agents.base import Action, Info, Observation, heading, wrapped
from vico.agents.perception import DepthGrid
from vico.agents.room_ways import RoomWays, passed_on_the_right, ways_in
from vico.agents.state import AgentState
from vico.rules import ReasonCode, code_name

_STRIDE = 1.0  # metres a step
_HIT_SOLID, _HIT_BODY = (code_name(code) for code in (ReasonCode.HIT_SOLID, ReasonCode.HIT_BODY))
_ALIGNED = math.radians(8.0)
_REMEMBERED = 6  # rooms
_REACH_OF_BUMPS = 0.4  # metres ahead of one's middle is what stopped a step
# A step may end so far off its line, metres, and half as far where there is less room than `_NARROW`.
_DRIFT, _NARROW = 0.08, 0.45
# People are remembered for so many seconds after they were in view, and what stopped a step for so many.
_PEOPLE_KEPT, _BUMPS_KEPT = 5.0, 30.0
# Whom others are in the way of waits so many seconds before getting out of theirs: the later one by name steps aside
# first. There one stays so long, unless the way is free sooner.
_YIELDS, _YIELDS_LATE, _STAYS_ASIDE = 2, 8, 8
_ASIDE_WITHIN = 4.0  # metres
# Who gets no farther than this in so many seconds takes it that there is no way on there, metres and seconds.
_NO_FARTHER, _GETS_NOWHERE = 0.6, 10.0
# Somebody as near to a goal as this is whom one goes to, metres.
_IS_THE_GOAL = 0.3
# What is known where a step was stopped has no more room about it than this, metres.
_KNOWN = 0.2


class IndoorWalker:
    """Remembers what stands in rooms, by what is in view where that is told, else from pictures, and from bumps.

    Parameters
    ----------
    name
        The agent's. Of two in each other's way the later one by name steps aside first.
    """

    def __init__(self, name: str = "") -> None:
        self._name = name
        # The room one is in, and the last few before it, the one that was left last at the end: as plain data, for a
        # grid takes some ten times as much memory, and a thousand residents remember six rooms each.
        self._room: str | None = None
        self._grid = DepthGrid((0.0, 0.0))
        self._left: dict[str, AgentState] = {}
        # Where walls and furniture are told: what is told now, of which room; who was seen where and when, by entity.
        self._told: Info | None = None
        self._told_room = ""
        self._people: dict[int, tuple[str, float, float, float]] = {}
        self._bumps: list[tuple[float, float, float]] = []
        # Where and since when one is no farther, for how long others have been in the way, and until when one stays
        # aside.
        self._anchor = (math.inf, math.inf, 0.0)
        self._waited = 0
        self._aside_until = -math.inf

    def state(self) -> AgentState:
        """Return what it knows of which rooms, numbered from the one that was entered longest ago, and of people."""
        rooms = list(self._left.items())
        if self._room is not None:
            rooms.append((self._room, self._grid.state()))
        anchor = None if math.isinf(self._anchor[0]) else list(self._anchor)
        return {
            "rooms": {str(k): {"room": room, "grid": grid} for k, (room, grid) in enumerate(rooms)},
            "told_room": self._told_room,
            "people": [[entity, *seen] for entity, seen in self._people.items()],
            "bumps": np.array(self._bumps, np.float64).reshape(-1, 3),
            "anchor": anchor,
            "waited": self._waited,
            "aside_until": None if math.isinf(self._aside_until) else self._aside_until,
        }

    def restore(self, state: AgentState) -> None:
        """Know what `state` returned."""
        rooms = state["rooms"]
        self._room, self._left = None, {rooms[str(k)]["room"]: rooms[str(k)]["grid"] for k in range(len(rooms))}
        if self._left:
            self._room, grid = self._left.popitem()
            self._grid.restore(grid)
        self._told, self._told_room = None, str(state["told_room"])
        self._people = {
            int(entity): (str(agent), float(x), float(y), float(time)) for entity, agent, x, y, time in state["people"]
        }
        self._bumps = [(float(x), float(y), float(time)) for x, y, time in state["bumps"]]
        anchor, aside = state["anchor"], state["aside_until"]
        self._anchor = (math.inf, math.inf, 0.0) if anchor is None else (anchor[0], anchor[1], anchor[2])
        self._waited, self._aside_until = int(state["waited"]), -math.inf if aside is None else float(aside)

    def notice(self, observation: Observation, info: Info, *, ignore: ArrayLike = ()) -> None:
        """Take in what a new observation shows of the room one is in.

        Parameters
        ----------
        info
            Its ``in_view``, if it has one, knows the room: then pictures are not looked at.
        ignore
            Entities that are not in the way (what one carries or is going to pick up).
        """
        # Taken in when one walks: who rests remembers nothing new, asked or not.
        self._told = info if "in_view" in info else None
        if self._told is not None:
            return
        grid, pose = self._grid_of(observation), np.asarray(observation["pose"], np.float64)
        if "depth" in observation:
            grid.see(observation, floor=float(pose[2]), ignore=ignore)
        if observation["state"]["action_status"] == "collision":
            grid.bump(_ahead(observation, _REACH_OF_BUMPS))

    def _take_in(self, observation: Observation, info: Info) -> RoomWays:
        """Take in what is told of the room and of those in it; return the ways in it."""
        view, state = info["in_view"], observation["state"]
        time = float(state["time"])
        if state["room"] != self._told_room:
            self._told_room, self._people, self._bumps = state["room"], {}, []
            self._anchor, self._waited, self._aside_until = (math.inf, math.inf, 0.0), 0, -math.inf
        ways = ways_in(view.room, view.furniture)
        self._people = {k: seen for k, seen in self._people.items() if time - seen[3] <= _PEOPLE_KEPT}
        self._bumps = [bump for bump in self._bumps if time - bump[2] <= _BUMPS_KEPT]
        for body in view:
            self._people[body.entity] = (body.agent, body.position[0], body.position[1], time)
        if state["action_status"] != "collision":
            return ways
        x, y = _ahead(observation, _REACH_OF_BUMPS).tolist()
        if state["action_code"] == _HIT_BODY:
            # Somebody out of view, beside one.
            if not any(math.hypot(px - x, py - y) < 2 * _REACH_OF_BUMPS for _, px, py, _ in self._people.values()):
                self._people[0] = ("", x, y, time)
        elif state["action_code"] == _HIT_SOLID and ways.gap((x, y)) > _KNOWN:
            self._bumps.append((x, y, time))
        return ways

    def towards(self, observation: Observation, target: ArrayLike, *, near: float) -> Action | None:
        """Return the next action on the way to a point of the room; None once within `near` metres of it."""
        position = np.asarray(observation["pose"], np.float64)[:2]
        goal = np.asarray(target, np.float64)[:2]
        if math.dist(position, goal) <= near:
            return None
        if self._told is not None:
            return self._past_others(self._take_in(observation, self._told), observation, goal, near)
        route = self._grid_of(observation).route(position, goal, near=near * 0.9)
        # Where no way is known, nothing known is in the way of trying.
        aim = _straight(position, route) if len(route) else goal
        turn = wrapped(math.atan2(aim[1] - position[1], aim[0] - position[0]) - heading(observation))
        if abs(turn) > _ALIGNED:
            return _turn(turn)
        return {"type": "move_forward", "distance": max(0.1, min(_STRIDE, math.dist(position, aim)))}

    def aside(self, observation: Observation, near: float) -> Action | None:
        """Return the next action of getting out of the way of others; None where one is in nobody's way, or can't.

        One is where others are within `near` metres, at a door, and where it is narrow. Only where walls and furniture
        are told.
        """
        if self._told is None:
            return None
        ways, position = self._take_in(observation, self._told), np.asarray(observation["pose"], np.float64)[:2]
        doors = [door["position"] for door in observation["state"]["doors"]]
        close = [seen for seen in self._people.values() if math.dist(seen[1:3], position) < near]
        comes_first = all(self._name < agent for agent, *_ in close)
        if close and comes_first and self._waited < _YIELDS_LATE:
            self._waited += 1
            return {"type": "wait"}
        if not close and ways.is_out_of_the_way(position, doors):
            self._waited = 0
            return None
        way = ways.aside(position, people=self._positions(), doors=doors, within=_ASIDE_WITHIN)
        if way is None:
            self._waited = 0
            return None
        return self._step_on(ways, observation, way)

    def _past_others(
        self, ways: RoomWays, observation: Observation, goal: NDArray[np.float64], near: float
    ) -> Action | None:
        """Return the next action on a way past others; who has none waits a moment, and then steps aside."""
        position, time = np.asarray(observation["pose"], np.float64)[:2], float(observation["state"]["time"])
        self._note_progress(observation, position, time)
        people = self._positions(but=goal)
        bumps = np.array([bump[:2] for bump in self._bumps], np.float64).reshape(-1, 2)
        near *= 0.9
        passed = passed_on_the_right(people, position, heading(observation))
        # On the right; on either side; and where nothing was but what stopped one, which may have gone.
        for others, spots in ((passed, bumps), (people, bumps), (people, bumps[:0])):
            way = ways.way(position, goal, near=near, people=others, bumps=spots)
            if way is not None:
                self._waited, self._aside_until = 0, -math.inf
                return self._step_on(ways, observation, way)
        way = ways.way(position, goal, near=near)
        if way is None or time < self._aside_until:
            return {"type": "wait"}
        if self._waited < (_YIELDS if self._is_later(position) else _YIELDS_LATE):
            step = self._come_up(ways, observation, way, people)
            self._waited += step["type"] == "wait"
            return step
        way = ways.aside(position, people=people, within=_ASIDE_WITHIN)
        if way is None or math.dist(position, way[-1]) < 0.1:
            self._waited, self._aside_until = 0, time + _STAYS_ASIDE
            return {"type": "wait"}
        return self._step_on(ways, observation, way)

    def _come_up(
        self, ways: RoomWays, observation: Observation, way: NDArray[np.float64], people: NDArray[np.float64]
    ) -> Action:
        """Go on to those in the way, and wait before them."""
        position = np.asarray(observation["pose"], np.float64)[:2]
        ahead = [k for k in range(len(way)) if ways.is_clear(position, way[k], people)]
        if not ahead or ahead[0] > 0 or math.dist(position, way[ahead[-1]]) < _IS_THE_GOAL:
            return {"type": "wait"}
        return self._step_on(ways, observation, way[: ahead[-1] + 1])

    def _is_later(self, position: NDArray[np.float64]) -> bool:
        """Return whether the nearest one who is in the way comes first by name; who has none, a robot, does."""
        agent, *_ = min(self._people.values(), key=lambda seen: math.dist(seen[1:3], position), default=("", 0.0))
        return agent <= self._name

    def _note_progress(self, observation: Observation, position: NDArray[np.float64], time: float) -> None:
        """Take it that there is no way on where one has got no farther for some time."""
        x, y, since = self._anchor
        if not math.dist(position, (x, y)) <= _NO_FARTHER or time - since > 2 * _GETS_NOWHERE:
            self._anchor = float(position[0]), float(position[1]), time
        elif time - since >= _GETS_NOWHERE:
            self._anchor = x, y, time
            ahead = _ahead(observation, _REACH_OF_BUMPS).tolist()
            self._bumps.append((ahead[0], ahead[1], time))

    def _positions(self, *, but: NDArray[np.float64] | None = None) -> NDArray[np.float64]:
        """Return where others are, shape ``(m, 2)``, without whoever is at a point."""
        found = [seen[1:3] for seen in self._people.values() if but is None or math.dist(seen[1:3], but) > _IS_THE_GOAL]
        return np.array(found, np.float64).reshape(-1, 2)

    def _step_on(self, ways: RoomWays, observation: Observation, way: NDArray[np.float64]) -> Action:
        """Return a turn or a step along a way, as far as it is straight."""
        position = np.asarray(observation["pose"], np.float64)[:2]
        aim = way[0]
        for point in way[1:]:
            if math.dist(position, point) > _STRIDE or not ways.is_clear(position, point, way[:0]):
                break
            aim = point
        away = math.dist(position, aim)
        turn = wrapped(math.atan2(aim[1] - position[1], aim[0] - position[0]) - heading(observation))
        room = min(ways.gap(position), ways.gap(aim))
        drift = _DRIFT if room >= _NARROW else _DRIFT / 4
        if away > 0.02 and abs(turn) > 1e-3 and (math.cos(turn) <= 0.0 or away * abs(math.sin(turn)) > drift):
            return _turn(turn)
        return {"type": "move_forward", "distance": max(0.05, away)}

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


def _ahead(observation: Observation, reach: float) -> NDArray[np.float64]:
    """Return a point so far ahead of one, metres."""
    yaw = heading(observation)
    return np.asarray(observation["pose"], np.float64)[:2] + reach * np.array([math.cos(yaw), math.sin(yaw)])


def _turn(angle: float) -> Action:
    return {"type": "turn_left" if angle > 0 else "turn_right", "degrees": abs(math.degrees(angle))}


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
