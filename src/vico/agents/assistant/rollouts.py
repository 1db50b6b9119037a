"""Decisions under uncertainty: beliefs of where things are, and rollouts of each first choice in many possible worlds.

`Beliefs` holds a chance for each region of a task. A region starts with what is known of such places at that hour.
Having looked there in vain lowers its chance, for people less and less as time goes on; having seen somebody there, or
having been told so, raises it, for a while.

A `Situation` is a task as rollouts take it: ways, spots to look at, and how likely each is. In each of many worlds it
is drawn where everything is; after the first choice one goes on by chance per second, and what is found when is
counted (rollout of a greedy policy, Bertsekas et al. 1997). All choices meet the same worlds, so that luck does not
decide between them. Compiled: some hundreds of plans a millisecond.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.agents.assistant.errands import LOOKS, Book, Choice
from vico.agents.assistant.estimates import DOOR, FIND_CHANCE, MEET, OUTDOORS, PICK, PUT, Estimates, Habits
from vico.agents.assistant.skills import AssistantSkills, ObservationView
from vico.agents.base import AgentState
from vico.agents.perception import RememberedSighting
from vico.agents.requester import PACE_HOME
from vico.io.compiled import compiled
from vico.world.public import PublicMap

#: How far a subtask has come: to be found, in hand, done.
OPEN, IN_HAND, DONE = range(3)
#: How much a subtask that is done at the end counts less than one that is done at once.
IMPATIENCE = 0.25


class Situation(NamedTuple):
    """A task as rollouts take it: ways between points, and places to look at ("spots") for each subtask.

    Attributes
    ----------
    travel
        Seconds from point to point, float64, shape ``(points, points)``; one is at the first.
    spot_point, spot_task, spot_seconds, spot_chance, spot_finds
        Of each spot: its point, its subtask's row, how long a look takes, how likely it is there, and how likely a look
        finds what is there.
    end, service
        Of each subtask: the point where it ends, -1 where it ends where it is found; and seconds from each point to
        there once it is found, with all there is to do, shape ``(points, subtasks)``.
    brought
        Whether what is found is picked up and brought later, with others.
    pick, put, load
        Seconds of picking up and of putting down, and hands that it takes.
    stage
        How far each has come.
    hands
        Free hands.
    left
        Seconds to the end.
    """

    travel: NDArray[np.float64]
    spot_point: NDArray[np.int64]
    spot_task: NDArray[np.int64]
    spot_seconds: NDArray[np.float64]
    spot_chance: NDArray[np.float64]
    spot_finds: NDArray[np.float64]
    end: NDArray[np.int64]
    service: NDArray[np.float64]
    brought: NDArray[np.bool_]
    pick: NDArray[np.float64]
    put: NDArray[np.float64]
    load: NDArray[np.int64]
    stage: NDArray[np.int64]
    hands: int
    left: float


def draw_worlds(
    situation: Situation, chance: np.random.Generator, count: int
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Draw where everything is, and which looks would find it.

    Returns
    -------
    tuple
        The spot of each subtask, -1 for none of them, shape ``(count, subtasks)``; and whether a look at each spot
        finds what is there, shape ``(count, spots)``.
    """
    tasks = len(situation.stage)
    # Evenly spread over each subtask's chances, and paired at random: fewer worlds are needed than with plain draws.
    spread = (np.arange(count) + 0.5) / count
    truth = np.full((count, tasks), -1, np.int64)
    for k in range(tasks):
        spots = np.flatnonzero(situation.spot_task == k)
        drawn = chance.permutation(spread)
        which = np.searchsorted(np.cumsum(situation.spot_chance[spots]), drawn, side="right")
        inside = which < len(spots)
        truth[inside, k] = spots[which[inside]]
    finds = chance.random((count, len(situation.spot_task))) < situation.spot_finds
    return truth, finds


def best_first_choice(situation: Situation, chance: np.random.Generator, *, worlds: int) -> int:
    """Return the best first choice: a spot's index, or the number of spots plus the row of what is brought; -1: none.

    Parameters
    ----------
    worlds
        How many are drawn.
    """
    values = _choice_values(situation, *draw_worlds(situation, chance, worlds))
    best = int(np.argmax(values)) if len(values) else -1
    return best if best >= 0 and values[best] > 0.0 else -1


def expected_worth(situation: Situation, chance: np.random.Generator, *, worlds: int) -> float:
    """Return what the greedy policy achieves on average: subtasks done, those done late a little less."""
    return float(_mean_worth(situation, *draw_worlds(situation, chance, worlds)))


@compiled
def _choice_values(situation, truth, finds):
    spots = len(situation.spot_task)
    values = np.full(spots + len(situation.stage), -1.0)
    looked = np.zeros(spots, np.bool_)
    for first in range(len(values)):
        if not _is_possible(situation, first, situation.stage, situation.hands, looked):
            continue
        total = 0.0
        for world in range(len(truth)):
            total += _play_world(situation, first, truth[world], finds[world])
        values[first] = total / len(truth)
    return values


@compiled
def _mean_worth(situation, truth, finds):
    looked = np.zeros(len(situation.spot_task), np.bool_)
    first = _greedy_choice(situation, 0, 0.0, situation.stage, situation.hands, looked)
    if first < 0:
        return 0.0
    total = 0.0
    for world in range(len(truth)):
        total += _play_world(situation, first, truth[world], finds[world])
    return total / len(truth)


@compiled
def _is_possible(situation, choice, stage, hands, looked):
    """Return whether a choice is one: something to bring is in hand, or a spot may still be looked at."""
    spots = len(situation.spot_task)
    if choice >= spots:
        return stage[choice - spots] == IN_HAND
    k = situation.spot_task[choice]
    return not looked[choice] and stage[k] == OPEN and hands >= situation.load[k]


@compiled
def _play_world(situation, first, truth, finds):
    """Return the worth of a choice and what follows from it in one world."""
    spots = len(situation.spot_task)
    stage, looked = situation.stage.copy(), np.zeros(spots, np.bool_)
    hands, at, time, value = situation.hands, 0, 0.0, 0.0
    choice = first
    while choice >= 0 and time < situation.left:
        done = -1
        if choice >= spots:
            done = choice - spots
            time += situation.travel[at, situation.end[done]] + situation.put[done]
            at = situation.end[done]
            hands += situation.load[done]
        else:
            k, point = situation.spot_task[choice], situation.spot_point[choice]
            time += situation.travel[at, point] + situation.spot_seconds[choice]
            at = point
            looked[choice] = True
            if truth[k] == choice and finds[choice]:
                if situation.brought[k]:
                    time += situation.pick[k]
                    stage[k] = IN_HAND
                    hands -= situation.load[k]
                else:
                    done = k
                    time += situation.service[point, k]
                    if situation.end[k] >= 0:
                        at = situation.end[k]
        if done >= 0:
            stage[done] = DONE
            if time <= situation.left:
                value += 1.0 - IMPATIENCE * time / situation.left
        choice = _greedy_choice(situation, at, time, stage, hands, looked)
    return value


@compiled
def _greedy_choice(situation, at, time, stage, hands, looked):
    """Return the choice with the most chance per second of those that may be done in time; -1 if there is none."""
    spots = len(situation.spot_task)
    # What is left of each subtask's chances: the spots that were looked at are out of the question.
    rest = np.ones(len(stage))
    for spot in range(spots):
        if looked[spot]:
            rest[situation.spot_task[spot]] -= situation.spot_chance[spot]
    best, chosen = 0.0, -1
    for choice in range(spots + len(stage)):
        if not _is_possible(situation, choice, stage, hands, looked):
            continue
        if choice >= spots:
            k = choice - spots
            seconds = situation.travel[at, situation.end[k]] + situation.put[k]
            service, likely = 0.0, 1.0
        else:
            k, point = situation.spot_task[choice], situation.spot_point[choice]
            seconds = situation.travel[at, point] + situation.spot_seconds[choice]
            service = situation.service[point, k]
            likely = situation.spot_finds[choice] * situation.spot_chance[choice] / max(rest[k], 0.05)
        if time + seconds + service > situation.left:
            continue
        rate = likely / (seconds + likely * service + 1.0)
        if rate > best:
            best, chosen = rate, choice
    return chosen


# People stay where they were seen, or were not, for about so long, seconds.
_MEMORY_TIME = 1200.0
# How much likelier a region is where somebody was seen, and where somebody says that they are, were or often are.
_SIGHTING_FACTOR = 4.0
_CLAIM_FACTORS = {"see": 3.0, "myself": 3.0, "saw_in": 1.5, "saw_near": 1.0, "told": 1.0, "usual": 0.4}
_OTHER_CLAIM_FACTOR = 0.3
_ELSEWHERE_THINGS = 0.03  # chance that a thing is where nobody said
_ELSEWHERE = 0.03  # chance that a person is, at first: they are at a place that was told
_ELSEWHERE_LATER = 0.0002  # and by how much more each second, for they go on
_ELSEWHERE_MOST = 0.35  # at most
# How much of their time people are at each place that somebody says they are often seen at, at least.
_LEAST_SHARE = 0.04

#: Regions of a subtask: ``(subtask, region)``.
RegionKey = tuple[int, int]


class Beliefs:
    """Chances of regions, and why.

    Parameters
    ----------
    book
        Regions, and how often each was looked through.
    habits
        Of people.
    """

    def __init__(self, book: Book, public_map: PublicMap, habits: Habits) -> None:
        self._book, self._map, self._habits = book, public_map, habits
        self._looks: dict[RegionKey, int] = {}
        self._looked_at: dict[RegionKey, float] = {}
        self._seen_at: dict[RegionKey, float] = {}
        self._told_at: dict[RegionKey, float] = {}
        self._told: dict[RegionKey, float] = {}
        self._began: float | None = None

    def state(self) -> AgentState:
        """Return all of it."""
        return {
            "looks": _spot_rows(self._looks),
            "looked_at": _spot_rows(self._looked_at),
            "seen_at": _spot_rows(self._seen_at),
            "told_at": _spot_rows(self._told_at),
            "told": _spot_rows(self._told),
            "began": self._began,
        }

    def restore(self, state: AgentState) -> None:
        """Know what `state` returned."""
        self._looks = {(int(k), int(r)): int(n) for k, r, n in state["looks"]}
        self._began = state["began"]
        self._looked_at, self._seen_at, self._told_at, self._told = (
            {(int(k), int(r)): float(at) for k, r, at in state[name]}
            for name in ("looked_at", "seen_at", "told_at", "told")
        )

    def notice(self, view: ObservationView, skills: AssistantSkills) -> None:
        """Take in where people are in view, and which regions have been looked through since."""
        now = float(view.state["time"])
        self._began = now if self._began is None else self._began
        for k, looks in self._book.looked.items():
            for r, count in looks.items():
                if count > self._looks.get((k, r), 0):
                    self._looked_at[k, r] = now
                self._looks[k, r] = count
        for k, told in self._book.instructions.items():
            if self._book.category(k) != "carry" or not self._book.is_open(k):
                continue
            thing = skills.seen.last_seen(str(told["person"]["name"]))
            place = None if thing is None else skills.places.get(thing.room)
            at = None if place is None else self._region_at(k, place)
            if thing is not None and at is not None:
                self._seen_at[k, at] = thing.time

    def hear(self, k: int, place: str, now: float, how: str) -> None:
        """Take in that somebody is said to be at a place, which is one of the subtask's regions.

        Parameters
        ----------
        how
            What was said: a kind of `vico.agents.talk.sentences.Claim`.
        """
        r = self._region_at(k, place)
        if r is not None:
            self._told_at[k, r], self._told[k, r] = now, _CLAIM_FACTORS.get(how, _OTHER_CLAIM_FACTOR)

    def _region_at(self, k: int, place: str) -> int | None:
        sources = self._book.instructions[k]["sources"]
        return next((r for r, region in enumerate(sources) if region["place"] == place), None)

    def chances(self, k: int, now: float) -> list[float]:
        """Return how likely what a subtask is about is in each of its regions; together 1 at most."""
        person = self._book.category(k) == "carry"
        sources = self._book.instructions[k]["sources"]
        first = [self._habit(region, now) if person else 1.0 for region in sources]
        weights = [self._weight((k, r), weight, now, person=person) for r, weight in enumerate(first)]
        elsewhere = self._elsewhere(now) if person else _ELSEWHERE_THINGS
        total = sum(weights) + sum(first) * elsewhere / (1.0 - elsewhere)
        return [weight / total for weight in weights]

    def _elsewhere(self, now: float) -> float:
        """Return how likely somebody is at none of the places that were told."""
        since = now if self._began is None else self._began
        return min(_ELSEWHERE_MOST, _ELSEWHERE + _ELSEWHERE_LATER * (now - since))

    def _weight(self, spot: RegionKey, weight: float, now: float, *, person: bool) -> float:
        """Return what is left of a region's weight after all that was learnt of it."""
        if person:
            told, seen = self._told_at.get(spot), self._seen_at.get(spot)
            weight += 0.0 if told is None else self._told[spot] * math.exp(-(now - told) / _MEMORY_TIME)
            weight += 0.0 if seen is None else _SIGHTING_FACTOR * math.exp(-(now - seen) / _MEMORY_TIME)
        looked = self._looked_at.get(spot)
        if looked is None or (person and looked < self._seen_at.get(spot, -math.inf)):
            return weight
        missed = FIND_CHANCE * (math.exp(-(now - looked) / _MEMORY_TIME) if person else 1.0)
        return weight * (1.0 - missed) ** (1 if person else self._looks.get(spot, 1))

    def _habit(self, region: Mapping[str, Any], now: float) -> float:
        place = None if region["place"] is None else self._map.place_by_id.get(str(region["place"]))
        category = OUTDOORS if place is None else place.category.value
        return max(_LEAST_SHARE, self._habits.share(category, now / 3600.0 % 24.0))


def _spot_rows(known: Mapping[RegionKey, float]) -> list[list[float]]:
    return [[k, r, value] for (k, r), value in known.items()]


Point = tuple[float, float]

# What was seen is there still, for a thing; people go on, and are found with a chance that falls off in these seconds.
_STILL_THERE, _PERSON_FADES = 0.95, 60.0


@dataclass
class SituationBuilder:
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
        self, subtasks: Sequence[int], view: ObservationView, seen: Mapping[int, RememberedSighting], left: float
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
        return self._situation_of(subtasks, here, view, seen, left)

    def from_point(
        self, subtasks: Sequence[int], point: Point, view: ObservationView, left: float
    ) -> tuple[Situation, list[Choice]]:
        """Return the situation of somebody at a point who knows what was told alone."""
        return self._situation_of(subtasks, point, view, {}, left)

    def _situation_of(
        self,
        subtasks: Sequence[int],
        here: Point,
        view: ObservationView,
        seen: Mapping[int, RememberedSighting],
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
        load = [
            max(held[k], len(self.book.missing_names(k)), 1) if self.book.category(k) != "search" else 0 for k in tasks
        ]
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
            hands=view.hands.count(0),
            left=left,
        )
        return situation, [spot.choice for spot in spots] + [Choice("deliver", k) for k in tasks]

    def _spots(self, k: int, now: float, seen: RememberedSighting | None) -> list[_SearchSpot]:
        """Return where one may look for what a subtask is about, and where it was seen."""
        person = self.book.category(k) == "carry"
        found: list[_SearchSpot] = []
        still = 0.0
        if seen is not None:
            still = math.exp(-(now - seen.time) / _PERSON_FADES) if person else _STILL_THERE
            doors = 2 * DOOR if seen.room else 0.0
            point = (float(seen.position[0]), float(seen.position[1]))
            found.append(_SearchSpot(Choice("fetch", k), point, doors, still, _STILL_THERE))
        for r, (region, chance) in enumerate(
            zip(self.book.instructions[k]["sources"], self.beliefs.chances(k, now), strict=True)
        ):
            if self.book.looked[k].get(r, 0) >= LOOKS and not person:
                continue
            point = (float(region["centre"][0]), float(region["centre"][1]))
            seconds = self.estimates.look(region, person=person)
            found.append(_SearchSpot(Choice("look", k, r), point, seconds, (1.0 - still) * chance, FIND_CHANCE))
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
class _SearchSpot:
    """One place to look at."""

    choice: Choice
    point: Point
    seconds: float
    chance: float
    finds: float
