"""The heuristic planner's automata as data: states, and where each outcome leads (paper, appendix, and its figure).

Delivery's states are numbered as in the paper's figure. Two things are ours, where the figure would go on for ever: a
region that was looked through is left for the next one, and a subtask that was looked for everywhere is put at the end
of the line, at most so often as `ROUNDS` says.
"""

from __future__ import annotations

from dataclasses import dataclass

#: How often a subtask is tried.
ROUNDS = 3


@dataclass(frozen=True)
class Automaton:
    """States by number, and the next one by state and outcome.

    Attributes
    ----------
    final
        The state in which nothing is left to do.
    """

    category: str
    states: dict[int, str]
    edges: dict[tuple[int, str], int]
    final: int


DELIVERY = Automaton(
    "delivery",
    {
        0: "go to the source",
        1: "search near the source",
        2: "walk up to the thing",
        3: "pick it up",
        4: "go to the destination",
        5: "put down at the destination",
        6: "report",
        7: "finished",
    },
    {
        (0, "arrived"): 1,
        (0, "stuck"): 1,
        (1, "found"): 2,
        (1, "nothing"): 0,
        (1, "nothing, but carrying"): 4,
        (1, "nothing left"): 7,
        (2, "arrived"): 3,
        (2, "stuck"): 3,
        (3, "picked, more wanted"): 1,
        (3, "picked, all of it"): 4,
        (3, "hands full"): 4,
        (3, "refused"): 1,
        (4, "arrived"): 5,
        (4, "stuck"): 5,
        (5, "empty hands, more wanted"): 0,
        (5, "empty hands"): 6,
        (5, "stuck"): 0,
        (6, "not all done"): 0,
        (6, "all done"): 7,
    },
    7,
)

SEARCH = Automaton(
    "search",
    {0: "go to the region", 1: "search there", 2: "have it in view", 3: "report", 4: "finished"},
    {
        (0, "arrived"): 1,
        (0, "stuck"): 1,
        (1, "found"): 2,
        (1, "nothing"): 0,
        (1, "nothing left"): 4,
        (2, "shown"): 3,
        (2, "lost"): 1,
        (3, "not all done"): 0,
        (3, "all done"): 4,
    },
    4,
)

CARRY = Automaton(
    "carry",
    {
        0: "go where the person is often seen",
        1: "look for the person",
        2: "offer help and take the things",
        3: "follow the person home",
        4: "put down",
        5: "wait for the person",
        6: "report",
        7: "finished",
    },
    {
        (0, "arrived"): 1,
        (0, "stuck"): 1,
        (1, "found"): 2,
        (1, "nothing"): 0,
        (1, "nothing left"): 7,
        (2, "handed"): 3,
        (2, "lost"): 1,
        (3, "home"): 4,
        (3, "stuck"): 4,
        (4, "empty hands"): 5,
        (4, "stuck"): 5,
        (5, "came"): 6,
        (5, "did not come, not all done"): 0,
        (5, "did not come, all done"): 7,
        (6, "not all done"): 0,
        (6, "all done"): 7,
    },
    7,
)

AUTOMATA = {automaton.category: automaton for automaton in (CARRY, DELIVERY, SEARCH)}
