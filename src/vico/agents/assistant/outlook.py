"""The abstract model of a task that planners search: where one is, how late it is, how far each subtask has come."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from vico.agents.assistant.errands import LOOKS, Book, Choice
from vico.agents.assistant.estimates import DOOR, FINDS, MEET, PICK, PUT, Estimates
from vico.agents.assistant.rollouts import DONE, IN_HAND, OPEN
from vico.agents.assistant.skills import ObservationView
from vico.agents.navigation.memory import SeenThing
from vico.agents.requester import PACE_HOME

Point = tuple[float, float]


@dataclass(frozen=True)
class Outlook:
    """A moment of the plan.

    Attributes
    ----------
    at
        Where one is, ENU metres.
    time
        Seconds from now.
    stages
        Of the subtasks, in the order of `Model.subtasks`.
    hands
        Free hands.
    """

    at: Point
    time: float
    stages: tuple[int, ...]
    hands: int


class Model:
    """What choices lead to, with times and chances.

    Parameters
    ----------
    subtasks
        Which of the book's subtasks are planned for.
    seen
        By subtask, where what it is about was seen.
    """

    def __init__(
        self,
        book: Book,
        estimates: Estimates,
        subtasks: list[int],
        view: ObservationView,
        seen: Mapping[int, SeenThing],
    ) -> None:
        self.book, self.estimates, self.seen = book, estimates, seen
        self.estimates.time = float(view.state["time"])
        held = {k: len(book.in_hand(k, view)) for k in subtasks}
        self.subtasks = [k for k in subtasks if book.is_open(k) and (held[k] or self._regions(k) or k in seen)]
        #: How many hands each subtask's things take.
        self.load = [max(held[k], len(book.wanted(k)), 1) for k in self.subtasks]
        stages = tuple(IN_HAND if held[k] else OPEN for k in self.subtasks)
        at = (float(view.pose[0]), float(view.pose[1]))
        self.start = Outlook(at, DOOR if view.room else 0.0, stages, view.held.count(0))

    def _regions(self, k: int) -> list[int]:
        """Source regions of a subtask that were looked through least, if not too often."""
        looks, count = self.book.looked[k], len(self.book.instructions[k]["sources"])
        least = min(looks.get(r, 0) for r in range(count))
        return [r for r in range(count) if looks.get(r, 0) == least] if least < LOOKS else []

    def steps(self, outlook: Outlook) -> Iterator[tuple[Choice, Outlook, float]]:
        """Yield each choice, what it leads to if it succeeds, and its chance to."""
        for i, k in enumerate(self.subtasks):
            stage = outlook.stages[i]
            if stage == IN_HAND:
                yield Choice("deliver", k), self._delivered(outlook, i, k), 1.0
            elif stage == OPEN and self._has_room(outlook, i, k):
                yield from self._found(outlook, i, k)

    def _has_room(self, outlook: Outlook, i: int, k: int) -> bool:
        return self.book.category(k) == "search" or outlook.hands >= min(self.load[i], 2)

    def _found(self, outlook: Outlook, i: int, k: int) -> Iterator[tuple[Choice, Outlook, float]]:
        """Yield how a subtask's thing or person may be found."""
        category, told = self.book.category(k), self.book.instructions[k]
        if k in self.seen:
            point = (float(self.seen[k].position[0]), float(self.seen[k].position[1]))
            seconds = self.estimates.travel(outlook.at, point) + (2 * DOOR if self.seen[k].room else 0.0)
            yield Choice("fetch", k), self._after(outlook, i, k, point, seconds), 0.95
            return
        regions = self._regions(k)
        weights = [self.estimates.weight(told["sources"][r], person=category == "carry") for r in regions]
        for r, weight in zip(regions, weights, strict=True):
            region = told["sources"][r]
            point = (float(region["centre"][0]), float(region["centre"][1]))
            seconds = self.estimates.travel(outlook.at, point)
            seconds += self.estimates.look(region, person=category == "carry")
            yield Choice("look", k, r), self._after(outlook, i, k, point, seconds), FINDS * weight / sum(weights)

    def _after(self, outlook: Outlook, i: int, k: int, point: Point, seconds: float) -> Outlook:
        """Return what finding leads to: the thing in hand; with Carry all of it, with Search the report."""
        category, time = self.book.category(k), outlook.time + seconds
        if category == "search":
            return Outlook(point, time + PUT, _with(outlook.stages, i, DONE), outlook.hands)
        if category == "delivery":
            load = self.load[i]
            return Outlook(point, time + PICK * load, _with(outlook.stages, i, IN_HAND), outlook.hands - load)
        home = self.book.instructions[k]["destination"]["centre"]
        end = (float(home[0]), float(home[1]))
        walk = self.estimates.travel(point, end, pace=PACE_HOME)
        return Outlook(end, time + MEET + walk + DOOR + PUT, _with(outlook.stages, i, DONE), outlook.hands)

    def _delivered(self, outlook: Outlook, i: int, k: int) -> Outlook:
        region = self.book.instructions[k]["destination"]
        point = (float(region["centre"][0]), float(region["centre"][1]))
        seconds = self.estimates.travel(outlook.at, point) + PUT * self.load[i]
        seconds += 2 * DOOR if region["kind"] == "place" else 0.0
        hands = min(2, outlook.hands + self.load[i])
        return Outlook(point, outlook.time + seconds, _with(outlook.stages, i, DONE), hands)


def _with(stages: tuple[int, ...], i: int, stage: int) -> tuple[int, ...]:
    return (*stages[:i], stage, *stages[i + 1 :])
