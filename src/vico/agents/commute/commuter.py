"""The commuter: what its planner is asked, the agent that makes the trips, and the rule planner, which always walks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from vico.agents.base import Action, FieldState, Info, Observation
from vico.agents.commute.legs import LegMaker
from vico.agents.travel import Traveller
from vico.rules import WALK_SPEED
from vico.seeds import rng
from vico.world.model import Point2
from vico.world.public import PublicMap
from vico.world.trips import Closure, Trip

__all__ = ["CommuteQuery", "Commuter", "Planner", "WalkPlanner"]


@dataclass(frozen=True)
class CommuteQuery:
    """Where a commuter is and wants to be.

    Attributes
    ----------
    here, goal
        ENU metres.
    now, due
        Seconds of the day: now, and when to be there.
    cash
        What it has.
    vehicle
        What it rides: ``bike`` or nothing.
    index
        Number of the appointment it is on its way to.
    closed
        Stops, stations and lines that were of no use on this commute, and ground that is closed.
    first
        Whether it is asked for the first time on this commute.
    """

    here: Point2
    goal: Point2
    now: float
    due: float
    cash: float
    vehicle: str
    index: int
    closed: tuple[Closure, ...]
    first: bool


#: Plans a trip; None if there is none. One that departs later than now is begun then.
Planner = Callable[[CommuteQuery], Trip | None]


class Commuter(FieldState):
    """Makes the trips that a planner plans, one commute after the other, from observations and the public map.

    Parameters
    ----------
    planner
        Asked at the start of each commute, and again when a trip fails: a bus gone, a rack empty.
    public_map
        Streets, timetables and stations.
    seed
        Of the episode.

    Attributes
    ----------
    trip_modes
        The modes of the trips planned so far.
    """

    _traveller: Traveller
    _generator: np.random.Generator
    _asked: int = -1
    _departs: float = 0.0

    def __init__(self, planner: Planner, public_map: PublicMap, *, seed: int) -> None:
        self.planner = planner
        self._generator = rng(seed, "commuter")
        self._traveller = Traveller(public_map, self._generator, planner=self._plan, fastest=WALK_SPEED)
        self._commute: dict[str, Any] = {}
        self.trip_modes: list[tuple[str, ...]] = []

    def act(self, observation: Observation, info: Info) -> Action:
        """Return the next action on the way to the appointment that ``info["commute"]`` names."""
        self._commute = info["commute"]
        x, y = self._commute["position"]
        action = self._traveller.towards((float(x), float(y)), observation, info)
        if action is None:
            # As near as this trip leads: the next one may lead nearer.
            self._traveller.stop()
        if action is None or observation["state"]["time"] < self._departs:
            return {"type": "wait"}
        if action["type"] == "move_forward" and observation["state"]["vehicle"] != "bike":
            # Steps aside may be longer than is legal on foot.
            return {**action, "distance": min(float(action["distance"]), WALK_SPEED)}
        return action

    def _plan(self, observation: Observation, goal: Point2, closed: tuple[Closure, ...]) -> Trip | None:
        state, index = observation["state"], int(self._commute["index"])
        x, y = (float(v) for v in observation["pose"][:2])
        question = CommuteQuery(
            here=(x, y),
            goal=goal,
            now=float(state["time"]),
            due=float(self._commute["start"]),
            cash=float(state["cash"]),
            vehicle=str(state["vehicle"]),
            index=index,
            closed=closed,
            first=index != self._asked,
        )
        self._asked = index
        trip = self.planner(question)
        if trip is not None:
            self.trip_modes.append(trip.modes)
            self._departs = trip.depart
        return trip


class WalkPlanner:
    """Plans the walk (paper, appendix: the rule-based agent)."""

    def __init__(self, public_map: PublicMap) -> None:
        self._legs = LegMaker(public_map)

    def __call__(self, question: CommuteQuery) -> Trip | None:
        """Return the walk from here to the goal."""
        leg = self._legs.walk(question.here, question.goal, question.now)
        return None if leg is None else Trip(question.now, (leg,))
