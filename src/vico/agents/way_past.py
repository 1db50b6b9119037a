"""Getting past people in rooms: on the right where there is room, else one of two makes way for the other.

Two who stop each other both know it in the same second, see each other and the same walls, so both follow one rule
book without a word: who can get by on the right goes; else both step to the right, as far as there is room. Who then
can on the left alone waits a little first, for the other one may go on the right. Where nobody gets by, the one whose
name comes first steps aside to the nearest spot that lets the other through, and stays until that one has passed; then
the other one tries.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vico.agents.base import Action, Info, Observation, heading, wrapped
from vico.agents.room_ground import Point, RoomGround
from vico.agents.state import AgentState
from vico.rules import ReasonCode, code_name

_HIT_BODY = code_name(ReasonCode.HIT_BODY)
_PEOPLE = ("resident", "assistant", "pedestrian")
# People so near are minded, metres, for so many seconds after they were last seen; an encounter is over so many seconds
# after the last contact.
_NEAR, _REMEMBERED, _OVER = 2.5, 3.0, 6.0
# Who can get by on the left alone waits so long, and who makes way is the other one after so long, seconds.
_LEFT_WAITS, _TURN = 2.0, 8.0
# How near to the spot where one lets others pass is there, metres; for how long one walks there, and stays, at most,
# seconds.
_AT_SPOT, _WALKS, _STAYS = 0.04, 8.0, 6.0
# Who stands aside goes on after so many seconds if there is room to; who is in the way of somebody who gets up goes so
# far from where that one would stand, metres.
_LETS_GO, _OFF = 3.0, 0.7
# Who has got so far past where one stood, metres, has passed.
_PASSED = 0.3
_ALIGNED, _FACING = math.radians(0.5), math.radians(40.0)
_LEVEL = 0.8  # metres up or down: on another flight of stairs


@dataclass
class _Aside:
    """Where one stands aside: the spot, where one was and which way the other one goes.

    `begun` is when one set out for it, `since` when one got there, seconds; -1 before.
    """

    spot: Point
    stood: Point
    way: Point
    begun: float
    since: float = -1.0

    def has_passed(self, other: Point) -> bool:
        """Whether somebody who is there now has got past where one stood."""
        dx, dy = other[0] - self.stood[0], other[1] - self.stood[1]
        return dx * self.way[0] + dy * self.way[1] > _PASSED


class WayPast:
    """Gets past people whom one has walked into in a room, as far as ``info["in_view"]`` tells of them.

    Parameters
    ----------
    name
        One's own, as others see it.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._room = ""
        # When this encounter began, and the last contact; whom one has met, where they were last seen, and when.
        self._since = self._last = -math.inf
        self._met: dict[str, tuple[float, float, float]] = {}
        self._among = False
        # On which side one gets past: 1 to the right of them, -1 to the left, 0 not decided; and where one steps to the
        # right, None before that; whether that is done.
        self._side = 0.0
        self._right: Point | None = None
        self._stepped = False
        self._aside: _Aside | None = None

    def state(self) -> AgentState:
        """Return all it remembers."""
        aside = self._aside
        return {
            "room": self._room,
            "times": [None if math.isinf(time) else time for time in (self._since, self._last)],
            "met": {name: list(seen) for name, seen in self._met.items()},
            "among": self._among,
            "side": self._side,
            "right": None if self._right is None else list(self._right),
            "stepped": self._stepped,
            "aside": None if aside is None else [*aside.spot, *aside.stood, *aside.way, aside.begun, aside.since],
        }

    def restore(self, state: AgentState) -> None:
        """Remember what `state` returned."""
        self._room, self._side = str(state["room"]), float(state["side"])
        self._since, self._last = (-math.inf if time is None else float(time) for time in state["times"])
        self._met = {name: (float(x), float(y), float(time)) for name, (x, y, time) in state["met"].items()}
        self._among, right = bool(state["among"]), state["right"]
        self._right = None if right is None else (float(right[0]), float(right[1]))
        self._stepped = bool(state["stepped"])
        self._aside = None
        if state["aside"] is not None:
            x, y, was_x, was_y, east, north, begun, since = (float(value) for value in state["aside"])
            self._aside = _Aside((x, y), (was_x, was_y), (east, north), begun, since)

    def notice(self, observation: Observation, info: Info) -> None:
        """Take in whom one has walked into, and who is near meanwhile."""
        state = observation["state"]
        time, room = float(state["time"]), str(state["room"])
        if room != self._room or "in_view" not in info:
            self._room, self._last = room, -math.inf
        if "in_view" in info and state["action_status"] == "collision" and state["action_code"] == _HIT_BODY:
            if time - self._last > _OVER:
                self._since = time
                self._forget()
            self._last = time
        if time - self._last > _OVER:
            self._forget()
            return
        z = float(observation["pose"][2])
        for body in info["in_view"].within(_NEAR):
            if body.kind in _PEOPLE and abs(body.position[2] - z) < _LEVEL:
                self._met[body.agent or str(body.entity)] = (body.position[0], body.position[1], time)
        if "stopped_by" in info:  # who is beside one is felt, not seen
            x, y, _ = info["stopped_by"]["position"]
            self._met[info["stopped_by"]["agent"]] = (x, y, time)
        self._met = {name: seen for name, seen in self._met.items() if time - seen[2] <= _REMEMBERED}
        self._among = self._among or bool(self._met)

    def _forget(self) -> None:
        self._met, self._among, self._side = {}, False, 0.0
        self._right, self._stepped, self._aside = None, False, None

    @property
    def is_on(self) -> bool:
        """Whether one is getting past somebody."""
        return self._among

    @property
    def met(self) -> list[Point]:
        """Where those stand who are to be got past, ENU metres."""
        return [(x, y) for x, y, _ in self._met.values()]

    def towards(self, goal: Point, near: float, observation: Observation, info: Info) -> Action | None:
        """Return the next action on the way to a point not far off, past who is met, to within `near` metres of it.

        None where nobody is in the way any more, and no way is seen.
        """
        time = float(observation["state"]["time"])
        here = float(observation["pose"][0]), float(observation["pose"][1])
        others = self.met
        view = info["in_view"]
        ground = RoomGround(here, view.room, view.furniture, others)
        if self._aside is not None and not self._is_let_on(self._aside, goal, near, ground, time):
            action = self._stand_aside(self._aside, ground, observation)
            if action is not None:
                return action
        self._aside = None
        if not others:
            way = ground.way(goal, near=near)
            return _step(ground.first_step(way), observation) if len(way) else None
        if self._right is not None and not self._stepped:
            self._stepped = math.dist(here, self._right) <= _AT_SPOT
            if not self._stepped and time - self._since < _LEFT_WAITS:
                return _step(self._right, observation)
        name, other = self._nearest(here)
        # Who keeps to the right has the other one on the left.
        side = self._side or 1.0
        way = ground.way(goal, near=near, closed=ground.beside(other, side))
        if not len(way):
            if self._right is None:
                self._right = ground.spot_to_the_right(other) or here
                return _step(self._right, observation)
            if time - self._since >= _LEFT_WAITS:
                side = -side
                way = ground.way(goal, near=near, closed=ground.beside(other, side))
        if len(way):
            self._side = side
            return _step(ground.first_step(way), observation)
        self._side = 0.0
        return self._make_way(name, other, ground, observation) or {"type": "wait"}

    def make_room(self, observation: Observation, info: Info) -> Action | None:
        """Return the next action of who only stands here and is in somebody's way; None for who is not."""
        wanted = info.get("in_the_way_of", ())
        # Who is not asked while there is nothing to decide learns nothing then; nor does who is asked.
        if "in_view" not in info or (self._aside is None and not wanted):
            return None
        self.notice(observation, info)
        here = float(observation["pose"][0]), float(observation["pose"][1])
        time, view = float(observation["state"]["time"]), info["in_view"]
        for other in wanted:
            if not other["gets_up"]:
                self._met[other["agent"]] = (other["position"][0], other["position"][1], time)
        ground = RoomGround(here, view.room, view.furniture, self.met)
        if self._aside is None:
            if not wanted:
                return None
            if not self._among:
                self._since = time
            self._last, self._among = time, True
            x, y, _ = wanted[0]["position"]
            spot = ground.spot_off((x, y), away=_OFF) if wanted[0]["gets_up"] else ground.spot_aside((x, y))
            if spot is None:
                return None
            self._aside = _Aside(spot, here, (0.0, 0.0), time)
        elif math.dist(here, self._aside.spot) <= _AT_SPOT:
            self._aside = None
            return None
        return self._stand_aside(self._aside, ground, observation)

    def _is_let_on(self, aside: _Aside, goal: Point, near: float, ground: RoomGround, time: float) -> bool:
        """Whether one who has stood aside for a moment gets on past the other one, who does not come."""
        return aside.since >= 0.0 and time - aside.since >= _LETS_GO and len(ground.way(goal, near=near)) > 0

    def _make_way(self, name: str, other: Point, ground: RoomGround, observation: Observation) -> Action | None:
        """Begin to step aside for somebody, if it is one's turn and there is a spot for it."""
        time = float(observation["state"]["time"])
        here = float(observation["pose"][0]), float(observation["pose"][1])
        spot = ground.spot_aside(other) if self._makes_way(name, time) else None
        if spot is None:
            return None
        far = max(math.dist(here, other), 1e-9)
        self._aside = _Aside(spot, here, ((here[0] - other[0]) / far, (here[1] - other[1]) / far), time)
        return self._stand_aside(self._aside, ground, observation)

    def _nearest(self, here: Point) -> tuple[str, Point]:
        name = min(self._met, key=lambda other: (math.dist(self._met[other][:2], here), other))
        return name, self._met[name][:2]

    def _makes_way(self, other: str, time: float) -> bool:
        """Whether it is one's own turn to step aside."""
        turn = int((time - self._since) // _TURN) % 2
        return (self._name < other) == (turn == 0)

    def _stand_aside(self, aside: _Aside, ground: RoomGround, observation: Observation) -> Action | None:
        """Go to the spot and wait there, looking at the other one; None once that one has passed."""
        time = float(observation["state"]["time"])
        here = float(observation["pose"][0]), float(observation["pose"][1])
        self._last = time
        if aside.since < 0.0 and math.dist(here, aside.spot) > _AT_SPOT:
            way = ground.way(aside.spot, near=0.0)
            if len(way) and time - aside.begun < _WALKS:
                return _step(ground.first_step(np.vstack([way[:-1], aside.spot])), observation)
            self._aside = None
            return {"type": "wait"}
        if aside.since < 0.0:
            aside.since = time
        now = [(x, y) for x, y, seen in self._met.values() if seen == time]
        if all(aside.has_passed(other) for other in now) and (now or time > aside.since + 1.0):
            self._aside = None
            return None
        if time - aside.since > _STAYS or not self._met:
            self._aside = None
            return None
        other = min(self.met, key=lambda point: math.dist(point, here))
        turn = wrapped(math.atan2(other[1] - here[1], other[0] - here[0]) - heading(observation))
        if abs(turn) > _FACING:
            return {"type": "turn_left" if turn > 0 else "turn_right", "degrees": abs(math.degrees(turn))}
        return {"type": "wait"}


def _step(point: Sequence[float], observation: Observation) -> Action:
    """Turn to a point, or walk to it; wait who is there."""
    east, north = point[0] - float(observation["pose"][0]), point[1] - float(observation["pose"][1])
    if math.hypot(east, north) < 0.01:
        return {"type": "wait"}
    turn = wrapped(math.atan2(north, east) - heading(observation))
    if abs(turn) > _ALIGNED:
        return {"type": "turn_left" if turn > 0 else "turn_right", "degrees": abs(math.degrees(turn))}
    return {"type": "move_forward", "distance": math.hypot(east, north)}


__all__ = ["WayPast"]
