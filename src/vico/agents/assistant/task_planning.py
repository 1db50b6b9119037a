"""Planning the order of errands in an abstract model of the task: exactly, and by Monte-Carlo tree search.

A `TaskState` says where one is, how late it is, and how far each subtask has come.

`best_plan` finds the most subtasks done in time, in the least time, exactly. Failures are left out: a plan is made anew
whenever something comes out otherwise. Of two plans that lead to the same place and stages one dominates that is
neither later nor worth less, so a sweep over them by the number of choices made finds the optimum (label setting, as
for shortest paths with two criteria).

`MctsPlanner` searches the order of choices (paper, section 4.1). Nodes are selected by UCB1. As in the paper's commute
planner, a node's reward is what was achieved less the time it took and the distance that remains: each subtask done
counts a hundred seconds of travel.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from vico.agents.assistant.errands import LOOKS, Book, Choice, ChoicePlanner
from vico.agents.assistant.estimates import DOOR, FIND_CHANCE, MEET, PICK, PUT, Estimates
from vico.agents.assistant.rollouts import DONE, IMPATIENCE, IN_HAND, OPEN
from vico.agents.assistant.skills import ObservationView
from vico.agents.perception import RememberedSighting
from vico.agents.requester import PACE_HOME
from vico.seeds import rng

Point = tuple[float, float]


@dataclass(frozen=True)
class TaskState:
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


class TaskModel:
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
        seen: Mapping[int, RememberedSighting],
    ) -> None:
        self.book, self.estimates, self.seen = book, estimates, seen
        self.estimates.time = float(view.state["time"])
        held = {k: len(book.in_hand(k, view)) for k in subtasks}
        self.subtasks = [k for k in subtasks if book.is_open(k) and (held[k] or self._regions(k) or k in seen)]
        #: How many hands each subtask's things take.
        self.load = [max(held[k], len(book.missing_names(k)), 1) for k in self.subtasks]
        stages = tuple(IN_HAND if held[k] else OPEN for k in self.subtasks)
        at = (float(view.pose[0]), float(view.pose[1]))
        self.start = TaskState(at, DOOR if view.room else 0.0, stages, view.hands.count(0))

    def _regions(self, k: int) -> list[int]:
        """Source regions of a subtask that were looked through least, if not too often."""
        looks, count = self.book.looked[k], len(self.book.instructions[k]["sources"])
        least = min(looks.get(r, 0) for r in range(count))
        return [r for r in range(count) if looks.get(r, 0) == least] if least < LOOKS else []

    def steps(self, outlook: TaskState) -> Iterator[tuple[Choice, TaskState, float]]:
        """Yield each choice, what it leads to if it succeeds, and its chance to."""
        for i, k in enumerate(self.subtasks):
            stage = outlook.stages[i]
            if stage == IN_HAND:
                yield Choice("deliver", k), self._after_delivery(outlook, i, k), 1.0
            elif stage == OPEN and self._has_room(outlook, i, k):
                yield from self._find_steps(outlook, i, k)

    def _has_room(self, outlook: TaskState, i: int, k: int) -> bool:
        return self.book.category(k) == "search" or outlook.hands >= min(self.load[i], 2)

    def _find_steps(self, outlook: TaskState, i: int, k: int) -> Iterator[tuple[Choice, TaskState, float]]:
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
            yield Choice("look", k, r), self._after(outlook, i, k, point, seconds), FIND_CHANCE * weight / sum(weights)

    def _after(self, outlook: TaskState, i: int, k: int, point: Point, seconds: float) -> TaskState:
        """Return what finding leads to: the thing in hand; with Carry all of it, with Search the report."""
        category, time = self.book.category(k), outlook.time + seconds
        if category == "search":
            return TaskState(point, time + PUT, _with_stage(outlook.stages, i, DONE), outlook.hands)
        if category == "delivery":
            load = self.load[i]
            return TaskState(point, time + PICK * load, _with_stage(outlook.stages, i, IN_HAND), outlook.hands - load)
        home = self.book.instructions[k]["destination"]["centre"]
        end = (float(home[0]), float(home[1]))
        walk = self.estimates.travel(point, end, pace=PACE_HOME)
        return TaskState(end, time + MEET + walk + DOOR + PUT, _with_stage(outlook.stages, i, DONE), outlook.hands)

    def _after_delivery(self, outlook: TaskState, i: int, k: int) -> TaskState:
        region = self.book.instructions[k]["destination"]
        point = (float(region["centre"][0]), float(region["centre"][1]))
        seconds = self.estimates.travel(outlook.at, point) + PUT * self.load[i]
        seconds += 2 * DOOR if region["kind"] == "place" else 0.0
        hands = min(2, outlook.hands + self.load[i])
        return TaskState(point, outlook.time + seconds, _with_stage(outlook.stages, i, DONE), hands)


def _with_stage(stages: tuple[int, ...], i: int, stage: int) -> tuple[int, ...]:
    return (*stages[:i], stage, *stages[i + 1 :])


#: More plans than this are not looked at in one sweep; those worth most are kept, and the earliest among them.
_MAX_LABELS = 3000


@dataclass(frozen=True)
class TaskPlan:
    """What to do, in order.

    Attributes
    ----------
    choices
        One after the other.
    done
        How many subtasks are done in time.
    time
        When the last of them is, seconds from now.
    worth
        What is maximised: subtasks done, those done late a little less.
    """

    choices: tuple[Choice, ...] = ()
    done: int = 0
    time: float = 0.0
    worth: float = 0.0


#: Where a plan leads, and the plan.
_Label = tuple[TaskState, TaskPlan]


def best_plan(model: TaskModel, left: float) -> TaskPlan:
    """Return the best plan.

    Parameters
    ----------
    left
        Seconds to the end.
    """
    best = TaskPlan()
    front: list[_Label] = [(model.start, best)]
    while front:
        after: dict[tuple[object, ...], list[_Label]] = {}
        for outlook, plan in front:
            for choice, reached, likely in model.steps(outlook):
                if reached.time > left:
                    continue
                gained = sum(s == DONE for s in reached.stages) - sum(s == DONE for s in outlook.stages)
                worth = plan.worth + gained * likely * (1.0 - IMPATIENCE * reached.time / max(left, 1.0))
                longer = TaskPlan(
                    (*plan.choices, choice), plan.done + gained, reached.time if gained else plan.time, worth
                )
                if not _add_label(after.setdefault((reached.at, reached.stages), []), (reached, longer)):
                    continue
                if (longer.worth, -longer.time) > (best.worth, -best.time):
                    best = longer
        front = [label for labels in after.values() for label in labels]
        if len(front) > _MAX_LABELS:
            front = sorted(front, key=lambda label: (-label[1].worth, label[0].time))[:_MAX_LABELS]
    return best


def _add_label(labels: list[_Label], new: _Label) -> bool:
    """Keep a plan unless another one that leads to the same is as early and as good; drop those it is better than."""
    time, worth = new[0].time, new[1].worth
    if any(outlook.time <= time and plan.worth >= worth for outlook, plan in labels):
        return False
    labels[:] = [(outlook, plan) for outlook, plan in labels if outlook.time < time or plan.worth > worth]
    labels.append(new)
    return True


ITERATIONS = 300
#: Weight of exploration in UCB1, of the distance that remains (the paper's alpha), and of a subtask done, seconds.
EXPLORATION, ALPHA, DONE_WORTH = math.sqrt(2.0), 1.0, 100.0


@dataclass
class _Node:
    """An outlook in the tree."""

    outlook: TaskState
    choice: Choice | None = None
    untried: list[tuple[Choice, TaskState, float]] = field(default_factory=list)
    children: list[_Node] = field(default_factory=list)
    visits: int = 0
    value: float = 0.0


class MctsPlanner(ChoicePlanner):
    """Searches anew at each decision."""

    method = "mcts"

    def decide(self, view: ObservationView) -> Choice | None:
        """Return the choice of the most visited child of the root."""
        model = TaskModel(self.book, self.estimates, self.mine, view, self.last_sightings(view))
        now = float(view.state["time"])
        chance = rng(self.seed, "mcts", self.number, round(now))
        root = _Node(model.start, untried=list(model.steps(model.start)))
        if not root.untried:
            return None
        left = self.time_left(view)
        worst, best = math.inf, -math.inf
        for _ in range(ITERATIONS):
            path = [root]
            while not path[-1].untried and path[-1].children:
                path.append(_select_child(path[-1], worst, best))
            node = path[-1]
            if node.untried:
                choice, outlook, likely = node.untried.pop(int(chance.integers(len(node.untried))))
                reached = outlook if chance.random() < likely else _after_failure(node.outlook, outlook)
                child = _Node(reached, choice, untried=list(model.steps(reached)) if reached.time < left else [])
                node.children.append(child)
                path.append(child)
            reward = _node_reward(_rollout(path[-1].outlook, model, left, chance), model, left)
            worst, best = min(worst, reward), max(best, reward)
            for node in path:
                node.visits += 1
                node.value += reward
        return max(root.children, key=lambda node: (node.visits, node.value)).choice


def _select_child(node: _Node, worst: float, best: float) -> _Node:
    """Return the child with the highest upper confidence bound, rewards scaled to 0..1."""
    spread = max(best - worst, 1e-9)

    def confidence_bound(child: _Node) -> float:
        mean = (child.value / child.visits - worst) / spread
        return mean + EXPLORATION * math.sqrt(math.log(node.visits) / child.visits)

    return max(node.children, key=confidence_bound)


def _after_failure(before: TaskState, after: TaskState) -> TaskState:
    """Return what an attempt that fails leads to: the time is gone, and one is there."""
    return TaskState(after.at, after.time, before.stages, before.hands)


def _rollout(outlook: TaskState, model: TaskModel, left: float, chance: np.random.Generator) -> TaskState:
    """Choose at random until the time is over."""
    while outlook.time < left:
        steps = list(model.steps(outlook))
        if not steps:
            return outlook
        _, after, likely = steps[int(chance.integers(len(steps)))]
        if after.time > left:
            return outlook
        outlook = after if chance.random() < likely else _after_failure(outlook, after)
    return outlook


def _node_reward(outlook: TaskState, model: TaskModel, left: float) -> float:
    """Return less the seconds taken, less what is left to travel, and what was done."""
    done = sum(stage == DONE for stage in outlook.stages)
    remaining = 0.0
    for i, k in enumerate(model.subtasks):
        if outlook.stages[i] != DONE:
            told = model.book.instructions[k]
            remaining += model.estimates.travel(outlook.at, (told["destination"] or told["sources"][0])["centre"])
    return (
        DONE_WORTH * done
        - min(outlook.time, left) / max(len(model.subtasks), 1)
        - ALPHA * remaining / max(len(model.subtasks), 1)
    )
