"""A task as rollouts take it, from what one planner knows: ways, spots to look at, and how likely each is."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from vico.agents.assistant.beliefs import Beliefs
from vico.agents.assistant.errands import LOOKS, Book, Choice
from vico.agents.assistant.estimates import DOOR, FINDS, MEET, PICK, PUT, Estimates
from vico.agents.assistant.rollouts import IN_HAND, OPEN, Situation
from vico.agents.assistant.skills import ObservationView
from vico.agents.navigation.memory import SeenThing
from vico.agents.requester import PACE_HOME

Point = tuple[float, float]

# What was seen is there still, for a thing; people go on, and are found with a chance that falls off in these seconds.
_STILL_THERE, _PASSING = 0.95, 60.0


@dataclass
class Situations:
    """Makes situations of one task; ways between its points are kept.

    Parameters
    ----------
    book, estimates, beliefs
        Of the planner.
    """

    book: Book
    estimates: Estimates
    beliefs: Beliefs
    _ways: dict[tuple[Point, Point, float], float] = field(default_factory=dict)

    def now(
        self, subtasks: Sequence[int], view: ObservationView, seen: Mapping[int, SeenThing], left: float
    ) -> tuple[Situation, list[Choice]]:
        """Return the situation of an observation, and what its choices are.

        Parameters
        ----------
        subtasks
            Which of the book's are planned for.
        seen
            By subtask, where what it is about was seen.
        left
            Seconds to the end.
        """
        here = (float(view.pose[0]), float(view.pose[1]))
        return self._made(subtasks, here, view, seen, left)

    def from_point(
        self, subtasks: Sequence[int], point: Point, view: ObservationView, left: float
    ) -> tuple[Situation, list[Choice]]:
        """Return the situation of somebody at a point who knows what was told alone."""
        return self._made(subtasks, point, view, {}, left)

    def _made(
        self,
        subtasks: Sequence[int],
        here: Point,
        view: ObservationView,
        seen: Mapping[int, SeenThing],
        left: float,
    ) -> tuple[Situation, list[Choice]]:
        now = float(view.state["time"])
        self.estimates.time = now
        held = {k: len(self.book.in_hand(k, view)) for k in subtasks}
        tasks = [k for k in subtasks if self.book.is_open(k)]
        rows = {k: row for row, k in enumerate(tasks)}
        spots = [spot for k in tasks if not held[k] for spot in self._spots(k, now, seen.get(k))]
        ends = [self._end(k) for k in tasks]
        points = list(dict.fromkeys([here, *(spot.point for spot in spots), *(end for end in ends if end)]))
        index = {point: i for i, point in enumerate(points)}
        travel = np.array([[self._seconds(a, b, here) for b in points] for a in points], np.float64)
        load = [max(held[k], len(self.book.wanted(k)), 1) if self.book.category(k) != "search" else 0 for k in tasks]
        situation = Situation(
            travel=travel.reshape(len(points), len(points)),
            spot_point=np.array([index[spot.point] for spot in spots], np.int64),
            spot_task=np.array([rows[spot.choice.subtask] for spot in spots], np.int64),
            spot_seconds=np.array([spot.seconds for spot in spots], np.float64),
            spot_chance=np.array([spot.chance for spot in spots], np.float64),
            spot_finds=np.array([spot.finds for spot in spots], np.float64),
            end=np.array([index[end] if end else -1 for end in ends], np.int64),
            service=np.array([[self._service(k, point, here) for k in tasks] for point in points], np.float64),
            brought=np.array([self.book.category(k) == "delivery" for k in tasks], np.bool_),
            pick=PICK * np.array(load, np.float64),
            put=np.array([PUT * n + self._doors(k) for k, n in zip(tasks, load, strict=True)], np.float64),
            load=np.minimum(np.array(load, np.int64), 2),
            stage=np.array([IN_HAND if held[k] else OPEN for k in tasks], np.int64),
            hands=view.held.count(0),
            left=left,
        )
        return situation, [spot.choice for spot in spots] + [Choice("deliver", k) for k in tasks]

    def _spots(self, k: int, now: float, seen: SeenThing | None) -> list[_Spot]:
        """Return where one may look for what a subtask is about, and where it was seen."""
        person = self.book.category(k) == "carry"
        found: list[_Spot] = []
        still = 0.0
        if seen is not None:
            still = math.exp(-(now - seen.time) / _PASSING) if person else _STILL_THERE
            doors = 2 * DOOR if seen.room else 0.0
            point = (float(seen.position[0]), float(seen.position[1]))
            found.append(_Spot(Choice("fetch", k), point, doors, still, _STILL_THERE))
        for r, (region, chance) in enumerate(
            zip(self.book.instructions[k]["sources"], self.beliefs.chances(k, now), strict=True)
        ):
            if self.book.looked[k].get(r, 0) >= LOOKS and not person:
                continue
            point = (float(region["centre"][0]), float(region["centre"][1]))
            seconds = self.estimates.look(region, person=person)
            found.append(_Spot(Choice("look", k, r), point, seconds, (1.0 - still) * chance, FINDS))
        return found

    def _end(self, k: int) -> Point | None:
        region = self.book.instructions[k]["destination"]
        return None if region is None else (float(region["centre"][0]), float(region["centre"][1]))

    def _doors(self, k: int) -> float:
        region = self.book.instructions[k]["destination"]
        return 2 * DOOR if region is not None and region["kind"] == "place" else 0.0

    def _service(self, k: int, point: Point, here: Point) -> float:
        """Seconds from finding what a subtask is about at a point until it is done."""
        end, category = self._end(k), self.book.category(k)
        if category == "search" or end is None:
            return 2 * PUT
        if category == "carry":
            return MEET + self._seconds(point, end, here, pace=PACE_HOME) + DOOR + PUT
        return PICK + self._seconds(point, end, here) + PUT + self._doors(k)

    def _seconds(self, start: Point, goal: Point, here: Point, *, pace: float = 0.0) -> float:
        """Seconds of a way; those between the task's own points are kept."""
        if goal == here and start != here:
            return self._seconds(here, start, here, pace=pace)  # nobody goes back to here: any guess does
        key = (start, goal, pace)
        if key in self._ways:
            return self._ways[key]
        if start == goal:
            return 0.0
        seconds = self.estimates.travel(start, goal, pace=pace) if pace else self.estimates.travel(start, goal)
        if start != here:
            self._ways[key] = seconds
        return seconds


@dataclass(frozen=True)
class _Spot:
    """One place to look at."""

    choice: Choice
    point: Point
    seconds: float
    chance: float
    finds: float
