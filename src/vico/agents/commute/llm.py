"""The LLM agent: a language model plans each commute from the public map (paper, appendix "Single Agent Task").

The model is asked once at the start of each commute, and again when its plan fails. A model that cannot be reached, or
whose answer cannot be carried out, is no reason to stop: the agent walks, and counts it in `LlmPlanner.fallbacks`.
"""

from __future__ import annotations

import logging
import math
from bisect import bisect_left
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from vico.agents.commute.commuter import CommuteQuery
from vico.agents.commute.legs import LegMaker
from vico.clock import DAY, clock_of
from vico.errors import InputError, LlmBudgetError, LlmReplyError, SourceError
from vico.llm import LanguageModel
from vico.llm.prompts import read_prompt
from vico.rules import BIKE_ASTRAY, BIKE_RATE, BUS_FARE, WALK_SPEED
from vico.world.model import Point2
from vico.world.public import PublicMap
from vico.world.transit import Line, TramLine
from vico.world.trips import Leg, Trip

log = logging.getLogger(__name__)

_GOAL = "goal"
# Departures of each line that a model is told of.
_DEPARTURES = 4


class CommuteStep(BaseModel):
    """A step of a plan.

    Attributes
    ----------
    goal_place
        Id of a stop or station, or ``goal``.
    """

    model_config = ConfigDict(extra="forbid")

    goal_place: str = Field(min_length=1, max_length=80)
    transit_type: Literal["walk", "bus", "bike"]


class CommutePlan(BaseModel):
    """A plan, step by step."""

    model_config = ConfigDict(extra="forbid")

    steps: list[CommuteStep] = Field(min_length=1, max_length=12)


@dataclass(frozen=True)
class _Standing:
    """Where a plan has got to: the point, the id of the stop or station there, and when."""

    point: Point2
    name: str
    time: float


class LlmPlanner:
    """Asks a language model for each commute's plan.

    Parameters
    ----------
    instructions
        What the task tells: the day, and whose it is.
    public_map
        Streets, timetables and stations.
    model
        Whom to ask; None: the one that the environment names (`vico.llm`). Where it names none the agent walks.

    Attributes
    ----------
    fallbacks
        How often it walked instead, by why: ``unset``, ``unreachable``, ``budget``, ``garbage``.
    tokens, cost
        Spent so far.
    """

    def __init__(
        self, instructions: list[dict[str, Any]], public_map: PublicMap, *, model: LanguageModel | None = None
    ) -> None:
        self._told = instructions[0]
        self._map = public_map
        self._legs = LegMaker(public_map)
        self.fallbacks: Counter[str] = Counter()
        self._model = model or self._from_environment()
        self.tokens, self.cost = 0, 0.0

    def _from_environment(self) -> LanguageModel | None:
        try:
            return LanguageModel.from_environment()
        except InputError as error:
            log.warning("commute: no language model, so the agent walks: %s", error)
            return None

    def __call__(self, question: CommuteQuery) -> Trip | None:
        """Return the trip that the model plans; the walk if it plans none that can be made."""
        if question.vehicle == "bike":
            return self._legs.brought_back(question.here, question.goal, question.now, question.closed)
        plan = self._ask_model(question)
        trip = None if plan is None else self.trip_of(plan, question)
        return trip if trip is not None else self._walk(question)

    def _ask_model(self, question: CommuteQuery) -> CommutePlan | None:
        if self._model is None:
            self.fallbacks["unset"] += 1
            return None
        spent = self._model.budget.spent
        before = (spent.tokens, spent.cost)
        try:
            reply = self._model.ask(
                read_prompt("commute", "plan", CommutePlan).messages(**self.inputs(question)),
                CommutePlan,
                check=partial(self.findings, question),
                rounds=1,
            )
        except SourceError as error:
            self._fell_back("unreachable", error)
            return None
        except LlmBudgetError as error:
            self._fell_back("budget", error)
            return None
        except LlmReplyError as error:
            self._fell_back("garbage", error)
            return None
        finally:
            spent = self._model.budget.spent
            self.tokens += spent.tokens - before[0]
            self.cost += spent.cost - before[1]
        return reply.value

    def _fell_back(self, why: str, error: Exception) -> None:
        self.fallbacks[why] += 1
        log.info("commute: the agent walks: %s", error)

    # -- what the model is told --------------------------------------------------------------------------------------

    def inputs(self, question: CommuteQuery) -> dict[str, Any]:
        """Return what goes into the prompt."""
        day = [
            {"place": a["name"], "kind": a["kind"], "start": clock_of(a["start"]), "end": clock_of(a["end"])}
            for a in self._told["appointments"]
        ]
        goal = self._told["appointments"][question.index]
        points = self._points()
        resident = self._told["resident"]
        return {
            "character": {k: resident[k] for k in ("name", "age", "occupation", "lifestyle")} | {"cash": question.cash},
            "time": clock_of(int(question.now) % DAY),
            "schedule": day,
            "goal": {"name": goal["name"], "kind": goal["kind"], "be_there_by": clock_of(goal["start"])},
            "walk_seconds": _seconds(question.here, question.goal),
            "transit": self._transit(question.now),
            "walks_to": {name: _seconds(question.here, point) for name, point in points.items()},
            "walks_from": {name: _seconds(point, question.goal) for name, point in points.items()},
        }

    def _points(self) -> dict[str, Point2]:
        return self._legs.stops | {name: self._legs.point_of(name) for name in self._legs.stations}

    def _transit(self, now: float) -> dict[str, Any]:
        lines = []
        every: list[Line | TramLine] = [*self._map.lines, *self._map.tram_lines]
        for line in every:
            if not line.departures:
                continue
            first = bisect_left(line.departures, now % DAY)
            coming = [line.departures[(first + k) % len(line.departures)] for k in range(_DEPARTURES)]
            lines.append(
                {
                    "line": line.id,
                    "stops": line.stops,
                    "seconds_after_departure": [round(t) for t in line.travel[: len(line.stops)]],
                    "departures": [clock_of(int(t) % DAY) for t in coming],
                }
            )
        stations = [{"station": s.id, "bicycles": s.bikes, "places": s.capacity} for s in self._map.bike_stations]
        prices = {"fare": BUS_FARE, "bicycle_per_minute": BIKE_RATE, "bicycle_left_elsewhere": BIKE_ASTRAY}
        return {"lines": lines, "bicycle_stations": stations, "prices": prices}

    # -- what becomes of its answer ----------------------------------------------------------------------------------

    def findings(self, question: CommuteQuery, plan: CommutePlan) -> list[str]:
        """Return what is wrong with a plan, a sentence each; an empty list if it can be carried out."""
        known = self._points()
        here, found = "", []
        for k, step in enumerate(plan.steps, 1):
            to = step.goal_place
            if to != _GOAL and to not in known:
                return [f"step {k}: there is no stop or station {to!r}; give an id of the lists, or {_GOAL!r}"]
            if step.transit_type == "bus" and not self._is_served(here, to):
                found.append(f"step {k}: no line goes from {here or 'where they are'} to {to} without a change")
            if step.transit_type == "bike" and not {here, to} <= self._legs.stations.keys():
                found.append(f"step {k}: a bicycle goes from one bicycle station to another, not from {here!r} to {to}")
            here = to
        if here != _GOAL:
            found.append(f"the last step leads to {here}; it has to lead to {_GOAL!r}")
        return found

    def _is_served(self, origin: str, destination: str) -> bool:
        stops = self._legs.stops
        return origin in stops and destination in stops and destination in self._legs.reached_from(origin)

    def trip_of(self, plan: CommutePlan, question: CommuteQuery) -> Trip | None:
        """Return a plan as a trip; None (and counted) if it cannot be carried out now."""
        legs: list[Leg] = []
        at = _Standing(question.here, "", question.now)
        for step in plan.steps:
            leg = self._leg(step, at, question)
            if leg is None:
                self.fallbacks["garbage"] += 1
                return None
            if leg.metres > 0.0:
                legs.append(leg)
            at = _Standing(leg.end, step.goal_place, leg.arrive)
        return Trip(question.now, tuple(legs)) if legs else None

    def _leg(self, step: CommuteStep, at: _Standing, question: CommuteQuery) -> Leg | None:
        to = step.goal_place
        if step.transit_type == "bus":
            ids = [name for name in question.closed if isinstance(name, str)]
            return self._legs.bus(at.name, to, at.time, ids)
        if step.transit_type == "bike":
            if at.name in question.closed:
                return None
            return self._legs.rent(at.name, to, question.goal, at.time)
        end = question.goal if to == _GOAL else self._points()[to]
        return self._legs.walk(at.point, end, at.time)

    def _walk(self, question: CommuteQuery) -> Trip | None:
        leg = self._legs.walk(question.here, question.goal, question.now)
        return None if leg is None else Trip(question.now, (leg,))


def _seconds(start: Sequence[float], goal: Sequence[float]) -> int:
    """Estimate a walk as the paper's agent can: by the distance as the crow flies."""
    return round(math.dist(start, goal) / WALK_SPEED)
