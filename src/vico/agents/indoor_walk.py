"""Walking within a room: a grid of the room's floor, paths on it, and the walker that follows them.

Where walls and furniture are known, `RoomGrid` finds paths past people who stand there, and spots where one is in
nobody's way. A body's width is kept from everything, so that the path behind a counter is found where there is one, and
none is tried where nobody fits through. `IndoorWalker` walks around what is in view and what it bumped into, past
others, and out of their way.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.agents.base import Action, AgentState, Info, Observation, heading
from vico.agents.perception import DepthGrid
from vico.geometry import wrap_angle
from vico.io.compiled import compiled
from vico.rules import ReasonCode, code_name

#: People who have a choice stand so far apart, metres, middle to middle: near enough to talk.
PERSONAL = 1.0
#: Nobody stays standing so near to a door, metres, nor where there is less room to walls and furniture than `PASSAGE`.
DOORWAY, PASSAGE = 1.0, 0.42
# What is asked of a spot to stand aside: room to walls and furniture, metres to doors and to others; where there are
# others and no such spot, less will do.
_ASIDE_MARGINS = ((PASSAGE, DOORWAY, PERSONAL), (0.27, 0.0, PERSONAL), (0.27, 0.0, 0.7))
# The same of a spot where others get past: with room for them beside one.
_LET_PASS_MARGINS = ((0.8, 0.0, PERSONAL), (PASSAGE, 0.0, PERSONAL), (0.27, 0.0, PERSONAL), (0.27, 0.0, 0.7))
# Metres between the points of a grid. Half a person's width and a little; and what will do where that leaves no way.
_CELL, _WIDTHS = 0.1, (0.27, 0.252)
_PASSES = 0.55  # metres, middle to middle, at which one passes people
_LEFT = 0.15  # metres to the left that oncoming people are taken to be: they are passed on the right
_ONCOMING = 2.5  # metres within which people are oncoming
# Ways keep this far from walls and furniture where there is room, metres; a step nearer to them counts as so many.
_EASY, _NARROW_COSTS = 0.45, 2.0
_CACHED_ROOMS = 128  # rooms

Area = NDArray[np.float64]
_NOBODY: Area = np.zeros((0, 2))


class RoomGrid:
    """A room's floor as a grid along its walls: how much room there is at each point.

    Parameters
    ----------
    room
        Floor as ``x, y, yaw, half length, half width``, ENU metres and radians, shape ``(5,)``.
    furniture
        What stands in it, in the same form, shape ``(k, 5)``.
    """

    def __init__(self, room: Area, furniture: Area) -> None:
        self._x, self._y, yaw, self._half_u, self._half_v = (float(value) for value in room)
        self._cos, self._sin = math.cos(yaw), math.sin(yaw)
        u = np.arange(-self._half_u, self._half_u + _CELL / 2, _CELL)
        v = np.arange(-self._half_v, self._half_v + _CELL / 2, _CELL)
        self._shape = len(v), len(u)
        across, along = np.meshgrid(u, v)
        self._points = np.stack(
            [
                self._x + self._cos * across - self._sin * along,
                self._y + self._sin * across + self._cos * along,
            ],
            axis=-1,
        )
        gap = np.minimum(self._half_u - np.abs(across), self._half_v - np.abs(along))
        for box in furniture:
            gap = np.minimum(gap, _rectangle_distances(box, self._points))
        #: Metres to the nearest wall or piece of furniture, float32, shape ``(rows, columns)``; negative within one.
        self.room = gap.astype(np.float32)

    def gap(self, point: ArrayLike) -> float:
        """Return the room around a point, metres."""
        column, row = self._cell(np.asarray(point, np.float64))
        return float(self.room[row, column])

    def way(
        self, start: Area, goal: Area, *, near: float, people: Area = _NOBODY, bumps: Area = _NOBODY
    ) -> Area | None:
        """Return the points of a way to within `near` metres of a goal, shape ``(k, 2)``; None if there is none.

        Parameters
        ----------
        people
            Where others stand, who are passed, shape ``(m, 2)``.
        bumps
            Where something stands that is not known otherwise, shape ``(m, 2)``.
        """
        return self._search(start, self._away_from(goal) <= max(near, 0.75 * _CELL), people, bumps, goal, near)

    def aside(
        self, start: Area, *, people: Area, doors: Sequence[Sequence[float]] | None = None, within: float
    ) -> Area | None:
        """Return the points of the shortest way to where one stands in nobody's way; None if there is no such spot.

        It ends `PERSONAL` metres from others, or 0.7 m where there is no more room.

        Parameters
        ----------
        people
            Where others are, shape ``(m, 2)``.
        doors
            Where doors are, ENU metres, at which nobody stays; None for who only lets others pass.
        within
            How far off the spot may be, metres.
        """
        near = self._away_from(start) <= within
        for width, from_doors, from_people in _LET_PASS_MARGINS if doors is None else _ASIDE_MARGINS:
            wanted = near & (self.room >= width)
            for x, y in people:
                wanted &= self._away_from((x, y)) >= from_people
            for door in doors or ():
                wanted &= self._away_from(door) >= from_doors
            way = self._search(start, wanted, people, _NOBODY, start, math.inf) if wanted.any() else None
            if way is not None or not len(people):
                return way
        return None

    def is_out_of_the_way(self, point: Area, doors: Sequence[Sequence[float]]) -> bool:
        """Return whether who stands at a point leaves others room to pass and to come in by the doors."""
        return self.gap(point) >= PASSAGE - _CELL and all(
            math.dist(point, door[:2]) >= DOORWAY - _CELL for door in doors
        )

    def is_clear(self, one: Area, other: Area, people: Area) -> bool:
        """Return whether one gets straight from one point to another, past people who stand there."""
        steps = max(2, math.ceil(math.dist(one, other) / (_CELL / 2)))
        line = one + np.linspace(0.0, 1.0, steps)[1:, None] * (other - one)
        least = min(_WIDTHS[0], self.gap(one))
        if any(self.gap(point) < least for point in line):
            return False
        if not len(people):
            return True
        away = np.hypot(*np.moveaxis(line[:, None] - people[None], -1, 0))
        return bool((away >= _PASSES - 0.02).all())

    def _search(
        self, start: Area, wanted: NDArray[np.bool_], people: Area, bumps: Area, aim: Area, near: float
    ) -> Area | None:
        """Return the cheapest way from a point to one of those that are wanted."""
        gap = self.room
        for points, reach in ((people, _PASSES), (bumps, 0.3)):
            for x, y in points:
                gap = np.minimum(gap, (self._away_from((x, y)) - (reach - _WIDTHS[0])).astype(np.float32))
        column, row = self._cell(start)
        aim_column, aim_row = self._cell(aim)
        for width in _WIDTHS:
            found = _cheapest_path(
                gap, wanted, (row, column), (aim_row, aim_column), near / _CELL, (width, _EASY, _NARROW_COSTS)
            )
            if len(found):
                # The last cell stands for the first point: the way begins where one is.
                rows, columns = found[1:].T if len(found) > 1 else found.T
                return np.asarray(self._points[rows, columns])
        return None

    def _away_from(self, point: Sequence[float] | Area) -> Area:
        """Return how far all points of the grid are from a point, metres."""
        return np.asarray(np.hypot(self._points[..., 0] - point[0], self._points[..., 1] - point[1]))

    def _cell(self, point: Area) -> tuple[int, int]:
        """Return column and row of the point of the grid that is nearest to a point."""
        dx, dy = float(point[0]) - self._x, float(point[1]) - self._y
        u = self._cos * dx + self._sin * dy + self._half_u
        v = self._cos * dy - self._sin * dx + self._half_v
        rows, columns = self._shape
        return min(max(round(u / _CELL), 0), columns - 1), min(max(round(v / _CELL), 0), rows - 1)


@lru_cache(maxsize=_CACHED_ROOMS)
def _cached_room_grid(room: bytes, furniture: bytes) -> RoomGrid:
    """Return the grid of a room, given the bytes of its arrays; those of the rooms asked for last are kept."""
    return RoomGrid(np.frombuffer(room), np.frombuffer(furniture).reshape(-1, 5))


def shift_oncoming_left(people: Area, position: Area, yaw: float) -> Area:
    """Return where people are taken to be whom one goes around: those ahead a little to the left, shape ``(m, 2)``."""
    if not len(people):
        return people
    east, north = math.cos(yaw), math.sin(yaw)
    away = people - position
    oncoming = (away[:, 0] * east + away[:, 1] * north > 0.0) & (np.hypot(*away.T) <= _ONCOMING)
    return people + np.where(oncoming[:, None], _LEFT * np.array([-north, east]), 0.0)


def _rectangle_distances(box: Area, points: Area) -> Area:
    """Return signed distances from points to an oriented rectangle, metres."""
    middle, yaw, half = box[:2], box[2], box[3:5]
    c, s = math.cos(yaw), math.sin(yaw)
    dx, dy = np.moveaxis(points - middle, -1, 0)
    u, v = np.abs(c * dx + s * dy) - half[0], np.abs(c * dy - s * dx) - half[1]
    outside = np.hypot(np.maximum(u, 0.0), np.maximum(v, 0.0))
    return np.asarray(outside + np.minimum(np.maximum(u, v), 0.0))


@compiled
def _cheapest_path(gap, wanted, start, aim, near, costs):
    """Run A* on a grid to the first wanted cell; return rows and columns from the start on, none if there is no way.

    A cell with too little room may be left for one with more, so that whoever touches something gets away from it.
    """
    width, easy, dear = costs
    rows, columns = gap.shape
    cost = np.full((rows, columns), np.inf)
    parent = np.full((rows, columns), -1, np.int64)
    done = np.zeros((rows, columns), np.bool_)
    cost[start[0], start[1]] = 0.0
    queue = [(0.0, start[0], start[1])]
    while len(queue) > 0:
        _, y, x = heapq.heappop(queue)
        if done[y, x]:
            continue
        done[y, x] = True
        if wanted[y, x]:
            return _path_cells(parent, y, x)
        for dy in range(-1, 2):
            for dx in range(-1, 2):
                j, i = y + dy, x + dx
                if not (0 <= j < rows and 0 <= i < columns) or done[j, i]:
                    continue
                if gap[j, i] < width and gap[j, i] <= gap[y, x]:
                    continue
                # No corner is cut.
                if dx != 0 and dy != 0:
                    least = min(gap[y, i], gap[j, x])
                    if least < width and least <= gap[y, x]:
                        continue
                step = math.sqrt(dx * dx + dy * dy)
                new = cost[y, x] + step * (dear if gap[j, i] < easy else 1.0)
                if new < cost[j, i]:
                    cost[j, i] = new
                    parent[j, i] = y * columns + x
                    left = math.sqrt((j - aim[0]) ** 2 + (i - aim[1]) ** 2) - near
                    heapq.heappush(queue, (new + max(left, 0.0), j, i))
    return np.zeros((0, 2), np.int64)


@compiled
def _path_cells(parent, y, x):
    """Return the cells of the way that led to one, the start first."""
    columns = parent.shape[1]
    count, j, i = 1, y, x
    while parent[j, i] >= 0:
        before = parent[j, i]
        j, i = before // columns, before % columns
        count += 1
    cells = np.empty((count, 2), np.int64)
    j, i = y, x
    for k in range(count - 1, -1, -1):
        cells[k, 0], cells[k, 1] = j, i
        before = parent[j, i]
        j, i = before // columns, before % columns
    return cells


_STRIDE = 1.0  # metres a step
_HIT_SOLID, _HIT_BODY = (code_name(code) for code in (ReasonCode.HIT_SOLID, ReasonCode.HIT_BODY))
_ALIGNED = math.radians(8.0)
_ROOMS_REMEMBERED = 6  # rooms
_REACH_OF_BUMPS = 0.4  # metres ahead of one's middle is what stopped a step
# A step may end so far off its line, metres, and half as far where there is less room than `_NARROW`.
_DRIFT, _NARROW = 0.08, 0.45
# People are remembered for so many seconds after they were in view, and what stopped a step for so many.
_PEOPLE_KEPT, _BUMPS_KEPT = 5.0, 30.0
_YIELDS = 2  # seconds that the later one by name waits until it makes way for others
_YIELDS_LATE = 8  # seconds that others wait
_STAYS_ASIDE = 8  # seconds that one stays aside, unless the way is free sooner
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
            grid.bump(_point_ahead(observation, _REACH_OF_BUMPS))

    def _take_in(self, observation: Observation, info: Info) -> RoomGrid:
        """Take in what is told of the room and of those in it; return the ways in it."""
        view, state = info["in_view"], observation["state"]
        time = float(state["time"])
        if state["room"] != self._told_room:
            self._told_room, self._people, self._bumps = state["room"], {}, []
            self._anchor, self._waited, self._aside_until = (math.inf, math.inf, 0.0), 0, -math.inf
        ways = _cached_room_grid(
            np.ascontiguousarray(view.room).tobytes(), np.ascontiguousarray(view.furniture).tobytes()
        )
        self._people = {k: seen for k, seen in self._people.items() if time - seen[3] <= _PEOPLE_KEPT}
        self._bumps = [bump for bump in self._bumps if time - bump[2] <= _BUMPS_KEPT]
        for body in view:
            self._people[body.entity] = (body.agent, body.position[0], body.position[1], time)
        if state["action_status"] != "collision":
            return ways
        x, y = _point_ahead(observation, _REACH_OF_BUMPS).tolist()
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
        aim = _furthest_straight_point(position, route) if len(route) else goal
        turn = wrap_angle(math.atan2(aim[1] - position[1], aim[0] - position[0]) - heading(observation))
        if abs(turn) > _ALIGNED:
            return _turn_action(turn)
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
        self, ways: RoomGrid, observation: Observation, goal: NDArray[np.float64], near: float
    ) -> Action | None:
        """Return the next action on a way past others; who has none waits a moment, and then steps aside."""
        position, time = np.asarray(observation["pose"], np.float64)[:2], float(observation["state"]["time"])
        self._note_progress(observation, position, time)
        people = self._positions(but=goal)
        bumps = np.array([bump[:2] for bump in self._bumps], np.float64).reshape(-1, 2)
        near *= 0.9
        passed = shift_oncoming_left(people, position, heading(observation))
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
        self, ways: RoomGrid, observation: Observation, way: NDArray[np.float64], people: NDArray[np.float64]
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
            ahead = _point_ahead(observation, _REACH_OF_BUMPS).tolist()
            self._bumps.append((ahead[0], ahead[1], time))

    def _positions(self, *, but: NDArray[np.float64] | None = None) -> NDArray[np.float64]:
        """Return where others are, shape ``(m, 2)``, without whoever is at a point."""
        found = [seen[1:3] for seen in self._people.values() if but is None or math.dist(seen[1:3], but) > _IS_THE_GOAL]
        return np.array(found, np.float64).reshape(-1, 2)

    def _step_on(self, ways: RoomGrid, observation: Observation, way: NDArray[np.float64]) -> Action:
        """Return a turn or a step along a way, as far as it is straight."""
        position = np.asarray(observation["pose"], np.float64)[:2]
        aim = way[0]
        for point in way[1:]:
            if math.dist(position, point) > _STRIDE or not ways.is_clear(position, point, way[:0]):
                break
            aim = point
        away = math.dist(position, aim)
        turn = wrap_angle(math.atan2(aim[1] - position[1], aim[0] - position[0]) - heading(observation))
        room = min(ways.gap(position), ways.gap(aim))
        drift = _DRIFT if room >= _NARROW else _DRIFT / 4
        if away > 0.02 and abs(turn) > 1e-3 and (math.cos(turn) <= 0.0 or away * abs(math.sin(turn)) > drift):
            return _turn_action(turn)
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
            if len(self._left) >= _ROOMS_REMEMBERED:
                del self._left[next(iter(self._left))]
        return self._grid


def _point_ahead(observation: Observation, reach: float) -> NDArray[np.float64]:
    """Return a point so far ahead of one, metres."""
    yaw = heading(observation)
    return np.asarray(observation["pose"], np.float64)[:2] + reach * np.array([math.cos(yaw), math.sin(yaw)])


def _turn_action(angle: float) -> Action:
    return {"type": "turn_left" if angle > 0 else "turn_right", "degrees": abs(math.degrees(angle))}


def _furthest_straight_point(position: NDArray[np.float64], route: NDArray[np.float64]) -> NDArray[np.float64]:
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
