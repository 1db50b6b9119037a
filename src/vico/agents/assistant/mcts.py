"""The MCTS planner: Monte-Carlo tree search over the order of choices, in the abstract model (paper, section 4.1).

Nodes are selected by UCB1. As in the paper's commute planner, a node's reward is what was achieved less the time it
took and the distance that remains: each subtask done counts a hundred seconds of travel.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from vico.agents.assistant.choosing import ChoicePlanner
from vico.agents.assistant.errands import Choice
from vico.agents.assistant.outlook import Model, Outlook
from vico.agents.assistant.rollouts import DONE
from vico.agents.assistant.skills import ObservationView
from vico.seeds import rng

ITERATIONS = 300
#: Weight of exploration in UCB1, of the distance that remains (the paper's alpha), and of a subtask done, seconds.
EXPLORATION, ALPHA, DONE_WORTH = math.sqrt(2.0), 1.0, 100.0


@dataclass
class _Node:
    """An outlook in the tree."""

    outlook: Outlook
    choice: Choice | None = None
    untried: list[tuple[Choice, Outlook, float]] = field(default_factory=list)
    children: list[_Node] = field(default_factory=list)
    visits: int = 0
    value: float = 0.0


class MctsPlanner(ChoicePlanner):
    """Searches anew at each decision."""

    method = "mcts"

    def decide(self, view: ObservationView) -> Choice | None:
        """Return the choice of the most visited child of the root."""
        model = Model(self.book, self.estimates, self.mine, view, self.seen(view))
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
                path.append(_select(path[-1], worst, best))
            node = path[-1]
            if node.untried:
                choice, outlook, likely = node.untried.pop(int(chance.integers(len(node.untried))))
                reached = outlook if chance.random() < likely else _in_vain(node.outlook, outlook)
                child = _Node(reached, choice, untried=list(model.steps(reached)) if reached.time < left else [])
                node.children.append(child)
                path.append(child)
            reward = _reward(_rollout(path[-1].outlook, model, left, chance), model, left)
            worst, best = min(worst, reward), max(best, reward)
            for node in path:
                node.visits += 1
                node.value += reward
        return max(root.children, key=lambda node: (node.visits, node.value)).choice


def _select(node: _Node, worst: float, best: float) -> _Node:
    """Return the child with the highest upper confidence bound, rewards scaled to 0..1."""
    spread = max(best - worst, 1e-9)

    def bound(child: _Node) -> float:
        mean = (child.value / child.visits - worst) / spread
        return mean + EXPLORATION * math.sqrt(math.log(node.visits) / child.visits)

    return max(node.children, key=bound)


def _in_vain(before: Outlook, after: Outlook) -> Outlook:
    """Return what an attempt that fails leads to: the time is gone, and one is there."""
    return Outlook(after.at, after.time, before.stages, before.hands)


def _rollout(outlook: Outlook, model: Model, left: float, chance: np.random.Generator) -> Outlook:
    """Choose at random until the time is over."""
    while outlook.time < left:
        steps = list(model.steps(outlook))
        if not steps:
            return outlook
        _, after, likely = steps[int(chance.integers(len(steps)))]
        if after.time > left:
            return outlook
        outlook = after if chance.random() < likely else _in_vain(outlook, after)
    return outlook


def _reward(outlook: Outlook, model: Model, left: float) -> float:
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
