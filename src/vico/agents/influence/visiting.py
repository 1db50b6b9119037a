"""Going to somebody: to where their day says they are, through the door, from room to room until they are in view.

`room_viewpoints` says from where to look about in a room, so that nobody behind a shelf is overlooked.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from vico.agents.base import Action, AgentState, Info, Observation
from vico.agents.indoor_walk import IndoorWalker
from vico.agents.influence.situation import Ending
from vico.agents.wayfinding import Walker
from vico.rules import WALK_SPEED
from vico.world.public import PublicMap, PublicPlace

Point = tuple[float, float]

# Spots are so far apart, and none is wanted nearer than this to where one has looked from, metres.
_VIEWPOINT_SPACING, _VIEWPOINT_DISTANCE = 6.0, 2.5


def room_viewpoints(room: NDArray[np.float64], here: Point) -> list[Point]:
    """Return the spots of a room that are worth going to after one has looked about `here`, ENU metres, nearest first.

    Parameters
    ----------
    room
        Its floor as `vico.sim.perception.InView.room` has it, shape ``(5,)``; an endless one has no spots.
    """
    x, y, yaw, half_length, half_width = room.tolist()
    if not (math.isfinite(half_length) and math.isfinite(half_width)):
        return []
    cos, sin = math.cos(yaw), math.sin(yaw)
    spots = [
        (x + cos * a - sin * b, y + sin * a + cos * b)
        for a in _part_middles(half_length)
        for b in _part_middles(half_width)
    ]
    return remaining_viewpoints(spots, here)


def remaining_viewpoints(spots: Iterable[Point], here: Point) -> list[Point]:
    """Return those spots that one has not looked from yet, now that one has `here`, nearest first."""
    return sorted(
        (spot for spot in spots if math.dist(spot, here) > _VIEWPOINT_DISTANCE), key=lambda spot: math.dist(spot, here)
    )


def _part_middles(half: float) -> list[float]:
    """Return the middles of the parts that a length, twice `half`, is cut into."""
    parts = max(1, round(2.0 * half / _VIEWPOINT_SPACING))
    return [half * ((2 * k + 1) / parts - 1.0) for k in range(parts)]


OUTSIDE = "outside"
# One stops this near to somebody to talk, metres, and looks about in quarter turns.
_BESIDE = 1.6
_TURN, _TURNS = 85.0, 4
# In the open people stroll so far from a place's position; so many spots there are looked from, metres.
_AROUND, _SPOTS = 25.0, 4
# A room, or the way to a door, is given up after so many steps; a door after so many refusals.
_STEPS_A_ROOM, _REFUSALS = 60, 3
# A spot in a room that is not reached within so many steps is looked at from where one has come to.
_STEPS_A_SPOT = 20
_AT_PLACE = 2.5
# Who keeps being stopped in a room goes a step another way.
_BUMP = 2  # what a collision in a room counts
_FORGOTTEN = 1  # what is forgotten of it at each other step
_STUCK = 6  # from this count on one takes a step another way
_ASIDE, _ASIDE_STEP = (50.0, 150.0), 0.6


class Visitor:
    """Finds somebody by a place and by what is in view.

    Parameters
    ----------
    public_map
        Streets and places.
    generator
        Decides where to look from, and how to get around others.
    """

    def __init__(self, public_map: PublicMap, generator: np.random.Generator) -> None:
        self._map, self._rng = public_map, generator
        self._walker = Walker(public_map, generator)
        self._indoors = IndoorWalker()
        #: Why the one who is looked for could not be found; empty while looking.
        self.failure: Ending | Literal[""] = ""
        self._target = ""
        self._place: PublicPlace | None = None
        self._reset()

        # The room that is looked about in, and the spots that it is still to be done from.
        self._searched = ""
        self._lookouts: list[tuple[float, float]] = []
        self._bumps = 0
        self._aside: list[Action] = []

    def _reset(self) -> None:
        self._is_in = False
        self._turns = self._steps = self._refused = self._spots = 0
        self._seen_rooms: list[str] = []
        self._trail: list[str] = []
        self._spot: tuple[float, float] | None = None

    @property
    def is_there(self) -> bool:
        """Whether one has come to the place: in, or where one looks about in the open."""
        return self._is_in or self._spots > 0 or self._turns > 0

    def start(self, target: str, place: str) -> None:
        """Look for somebody at a place from now on."""
        self.failure = ""
        self._target, self._place = target, self._map.place_by_id[place]
        self._walker.stop()
        self._searched, self._lookouts = "", []
        self._reset()

    def towards(self, observation: Observation, info: Info) -> Action | None:
        """Return the next action; None once beside them. Whoever cannot be found is waited for: `failure` says so."""
        assert self._place is not None
        state = observation["state"]
        if info.get("coming_out"):
            return {"type": "wait"}
        if state["posture"] != "standing":
            return {"type": "wake" if state["posture"] == "lying" else "stand"}
        if state["room"]:
            self._indoors.notice(observation, info)
        seen = body_in_view(info, self._target)
        if seen is not None:
            return self._approach(seen, observation, info)
        if state["room"]:
            return self._search(observation, info) if self._has_come(observation) else self._leave(observation)
        self._trail = []
        return self._go(observation, info)

    def state(self) -> AgentState:
        """Return whom it looks for, and where it has looked; the generator is its owner's to save."""
        return {
            "walker": self._walker.state(),
            "indoors": self._indoors.state(),
            "failure": self.failure,
            "target": self._target,
            "place": None if self._place is None else self._place.id,
            "is_in": self._is_in,
            "counts": [self._turns, self._steps, self._refused, self._spots, self._bumps],
            "aside": [dict(action) for action in self._aside],
            "seen_rooms": list(self._seen_rooms),
            "trail": list(self._trail),
            "searched": self._searched,
            "lookouts": [list(spot) for spot in self._lookouts],
            "spot": None if self._spot is None else list(self._spot),
        }

    def restore(self, state: AgentState) -> None:
        """Go on where `state` was."""
        self._walker.restore(state["walker"])
        self._indoors.restore(state["indoors"])
        self.failure, self._target, self._is_in = state["failure"], str(state["target"]), bool(state["is_in"])
        self._place = None if state["place"] is None else self._map.place_by_id[state["place"]]
        self._turns, self._steps, self._refused, self._spots, self._bumps = (int(n) for n in state["counts"])
        self._aside = [dict(action) for action in state["aside"]]
        self._searched, self._lookouts = str(state["searched"]), [(float(x), float(y)) for x, y in state["lookouts"]]
        self._seen_rooms, self._trail = list(state["seen_rooms"]), list(state["trail"])
        spot = state["spot"]
        self._spot = None if spot is None else (float(spot[0]), float(spot[1]))

    def _approach(self, seen: tuple[float, float, float], observation: Observation, info: Info) -> Action | None:
        x, y, distance = seen
        if distance <= _BESIDE:
            return None
        if observation["state"]["room"]:
            return self._towards_indoors(observation, (x, y), near=_BESIDE)
        return self._walker.towards((x, y), WALK_SPEED, observation, info) or self._fail("not reached")

    def _has_come(self, observation: Observation) -> bool:
        """Return whether one has come into the place that is wanted, or was in it all along."""
        assert self._place is not None
        self._is_in = self._is_in or observation["state"]["place"] == self._place.id
        return self._is_in

    def _go(self, observation: Observation, info: Info) -> Action | None:
        """Walk to the place, and in; in the open, look about there."""
        assert self._place is not None
        state, place = observation["state"], self._place
        if place.building is None and self._away(observation, place.position) <= _AT_PLACE + _AROUND * bool(
            self._spots
        ):
            return self._look_around_outdoors(observation, info)
        if self._is_in:  # came out again: the place was searched
            return self._fail("not found")
        if place.id in state["accessible_places"]:
            self._refused += state["action_status"] == "refused"
            self._steps += 1
            is_shut = self._refused > _REFUSALS or self._steps > _STEPS_A_ROOM
            return self._fail("not reached") if is_shut else {"type": "enter", "place": place.id}
        goal = (float(place.position[0]), float(place.position[1]))
        return self._walker.towards(goal, WALK_SPEED, observation, info) or self._fail("not reached")

    def _look_around_outdoors(self, observation: Observation, info: Info) -> Action | None:
        assert self._place is not None
        if self._spot is not None:
            self._steps += 1
            step = self._walker.towards(self._spot, WALK_SPEED, observation, info)
            if step is not None and self._steps <= _STEPS_A_ROOM:
                return step
            self._spot, self._turns, self._steps = None, 0, 0
        if self._turns < _TURNS:
            self._turns += 1
            return {"type": "turn_left", "degrees": _TURN}
        if self._spots >= _SPOTS:
            return self._fail("not found")
        self._spots += 1
        x, y = self._map.walkable.random_point(self._rng, near=self._place.position[:2], radius=_AROUND)
        self._spot = float(x), float(y)
        return {"type": "wait"}

    def _search(self, observation: Observation, info: Info) -> Action | None:
        """Look about in a room, then go on to the next one that was not seen, and back where there is none."""
        room = observation["state"]["room"]
        if self._trail[-1:] != [room]:
            self._steps = 0  # of another room; else the next door would be given up for the way back from the last one
        if room in self._trail:
            del self._trail[self._trail.index(room) + 1 :]
        else:
            self._trail.append(room)
        if room not in self._seen_rooms:
            step = self._look_about(observation, info)
            if step is not None:
                return step
            self._seen_rooms.append(room)
            self._steps = 0
        doors = [door for door in observation["state"]["doors"] if door["to"] != OUTSIDE]
        onward = next((door for door in doors if door["to"] not in self._seen_rooms), None)
        if onward is None:
            back = self._trail[-2] if len(self._trail) > 1 else ""
            onward = next((door for door in doors if door["to"] == back), None)
        if onward is None:
            return self._fail("not found")
        self._steps += 1
        if self._steps > _STEPS_A_ROOM:
            self._seen_rooms.append(onward["to"])
            self._steps = 0
        return self._through(onward, observation)

    def _look_about(self, observation: Observation, info: Info) -> Action | None:
        """Look about in a room, from where one came in and from more spots in a large one; None once it is done."""
        if self._turns < _TURNS:
            self._turns += 1
            return {"type": "turn_left", "degrees": _TURN}
        room, here = observation["state"]["room"], (float(observation["pose"][0]), float(observation["pose"][1]))
        in_view = info.get("in_view")
        if room != self._searched:
            self._searched, self._steps = room, 0
            self._lookouts = [] if in_view is None else room_viewpoints(in_view.room, here)
        if not self._lookouts:
            return None
        step = self._towards_indoors(observation, self._lookouts[0], near=0.8)
        self._steps += 1
        if step is not None and self._steps <= _STEPS_A_SPOT:
            return step
        self._lookouts, self._steps, self._turns = remaining_viewpoints(self._lookouts[1:], here), 0, 1
        return {"type": "turn_left", "degrees": _TURN}

    def _through(self, door: dict[str, object], observation: Observation) -> Action:
        position = door["position"]
        assert isinstance(position, Sequence)
        step = self._towards_indoors(observation, position, near=0.9)
        if step is not None:
            return step
        self._turns = 0
        return {"type": "enter", "place": door["to"]}

    def _leave(self, observation: Observation) -> Action | None:
        """Go out, room by room: through the door to the street, else through one that was not tried."""
        state = observation["state"]
        self._steps += 1
        if self._steps > 4 * _STEPS_A_ROOM:
            return self._fail("not reached")
        room, doors = state["room"], state["doors"]
        if room not in self._trail:
            self._trail.append(room)
        out = next((door for door in doors if door["to"] == OUTSIDE), None)
        if out is not None:
            step = self._towards_indoors(observation, out["position"], near=1.9)
            return step or {"type": "exit"}
        onward = next((door for door in doors if door["to"] not in self._trail), doors[0] if doors else None)
        return self._fail("not reached") if onward is None else self._through(onward, observation)

    def _towards_indoors(self, observation: Observation, point: Sequence[float], *, near: float) -> Action | None:
        """Return the next action on the way to a point of the room; None once within `near` metres of it.

        What stops one may be where no way around it is known, or none but the one that was tried: from a little
        further off there is another.
        """
        if self._aside:
            return self._aside.pop(0)
        is_stopped = observation["state"]["action_status"] == "collision"
        self._bumps = self._bumps + _BUMP if is_stopped else max(0, self._bumps - _FORGOTTEN)
        if self._bumps < _STUCK:
            return self._indoors.towards(observation, point, near=near)
        self._bumps = 0
        self._aside = [{"type": "move_forward", "distance": _ASIDE_STEP}]
        side = "turn_left" if self._rng.random() < 0.5 else "turn_right"
        return {"type": side, "degrees": float(self._rng.uniform(*_ASIDE))}

    def _fail(self, why: Ending) -> Action:
        self.failure = why
        return {"type": "wait"}

    @staticmethod
    def _away(observation: Observation, point: Sequence[float]) -> float:
        x, y = observation["pose"][:2]
        return math.hypot(x - point[0], y - point[1])


def body_in_view(info: Info, agent: str) -> tuple[float, float, float] | None:
    """Return where an agent that is in view stands, ENU metres, and how far away; None if it is not in view."""
    for body in info.get("in_view", ()):
        if body.agent == agent:
            return body.position[0], body.position[1], body.distance
    return None
