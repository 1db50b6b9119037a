"""The best order of choices: the most subtasks done in time, in the least time, exactly, in the abstract model.

Failures are left out: a plan is made anew whenever something comes out otherwise. Of two plans that lead to the same
place and stages one dominates that is neither later nor worth less, so a sweep over them by the number of choices made
finds the optimum (label setting, as for shortest paths with two criteria).
"""

from __future__ import annotations

from dataclasses import dataclass

from vico.agents.assistant.errands import Choice
from vico.agents.assistant.outlook import Model, Outlook
from vico.agents.assistant.rollouts import DONE, IMPATIENCE

#: More plans than this are not looked at in one sweep; those worth most are kept, and the earliest among them.
_WIDEST = 3000


@dataclass(frozen=True)
class Plan:
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
_Label = tuple[Outlook, Plan]


def best_plan(model: Model, left: float) -> Plan:
    """Return the best plan.

    Parameters
    ----------
    left
        Seconds to the end.
    """
    best = Plan()
    front: list[_Label] = [(model.start, best)]
    while front:
        after: dict[tuple[object, ...], list[_Label]] = {}
        for outlook, plan in front:
            for choice, reached, likely in model.steps(outlook):
                if reached.time > left:
                    continue
                longer = _and_then(plan, choice, outlook, reached, likely=likely, left=left)
                if not _add(after.setdefault((reached.at, reached.stages), []), (reached, longer)):
                    continue
                if (longer.worth, -longer.time) > (best.worth, -best.time):
                    best = longer
        front = [label for labels in after.values() for label in labels]
        if len(front) > _WIDEST:
            front = sorted(front, key=lambda label: (-label[1].worth, label[0].time))[:_WIDEST]
    return best


def _and_then(plan: Plan, choice: Choice, outlook: Outlook, reached: Outlook, *, likely: float, left: float) -> Plan:
    """Return a plan that is one choice longer."""
    gained = sum(s == DONE for s in reached.stages) - sum(s == DONE for s in outlook.stages)
    worth = plan.worth + gained * likely * (1.0 - IMPATIENCE * reached.time / max(left, 1.0))
    return Plan((*plan.choices, choice), plan.done + gained, reached.time if gained else plan.time, worth)


def _add(labels: list[_Label], new: _Label) -> bool:
    """Keep a plan unless another one that leads to the same is as early and as good; drop those it is better than."""
    time, worth = new[0].time, new[1].worth
    if any(outlook.time <= time and plan.worth >= worth for outlook, plan in labels):
        return False
    labels[:] = [(outlook, plan) for outlook, plan in labels if outlook.time < time or plan.worth > worth]
    labels.append(new)
    return True
