"""The best order of choices: the most subtasks done in time, in the least time, exactly, in the abstract model.

Chances are left out: a plan is made anew whenever something comes out otherwise. Among outlooks with the same place
and stages the earliest dominates, so a sweep over them by the number of choices made finds the optimum; six subtasks
have at most some ten thousand.
"""

from __future__ import annotations

from dataclasses import dataclass

from vico.agents.assistant.errands import Choice
from vico.agents.assistant.outlook import DONE, Model, Outlook

#: More outlooks than this are not looked at in one sweep; the earliest are kept.
_WIDEST = 3000
# How much a subtask that is done late counts less than one that is done at once.
_IMPATIENCE = 0.25


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


def best_plan(model: Model, left: float) -> Plan:
    """Return the best plan.

    Parameters
    ----------
    left
        Seconds to the end.
    """
    best = Plan()
    front: dict[tuple[object, ...], tuple[Outlook, Plan]] = {_key(model.start): (model.start, best)}
    while front:
        after: dict[tuple[object, ...], tuple[Outlook, Plan]] = {}
        for outlook, plan in front.values():
            for choice, reached, likely in model.steps(outlook):
                if reached.time > left:
                    continue
                gained = sum(s == DONE for s in reached.stages) - sum(s == DONE for s in outlook.stages)
                worth = plan.worth + gained * likely * (1.0 - _IMPATIENCE * reached.time / max(left, 1.0))
                done = plan.done + gained
                longer = Plan((*plan.choices, choice), done, reached.time if gained else plan.time, worth)
                key = _key(reached)
                known = after.get(key)
                if known is None or (reached.time, -worth) < (known[0].time, -known[1].worth):
                    after[key] = reached, longer
                if (worth, -longer.time) > (best.worth, -best.time):
                    best = longer
        if len(after) > _WIDEST:
            earliest = sorted(after.values(), key=lambda pair: (-pair[1].worth, pair[0].time))[:_WIDEST]
            after = {_key(outlook): (outlook, plan) for outlook, plan in earliest}
        front = after
    return best


def _key(outlook: Outlook) -> tuple[object, ...]:
    return (outlook.at, outlook.stages)
