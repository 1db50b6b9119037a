"""The heuristic planner's automata hold together: every state is reached, every outcome leads on to the end."""

from __future__ import annotations

import inspect
import re

import pytest

from vico.agents.assistant import options, people
from vico.agents.assistant.baselines import AUTOMATA, CARRY, DELIVERY, SEARCH, Automaton, HeuristicPlanner

# What comes of an option in the planner's words, where those are not the option's own; and which option each state has.
SEARCHED = {"found", "nothing", "nothing left"}
REPORTED = {"not all done", "all done"}
STATES = {
    "delivery": {
        0: options.GoTo, 1: options.Search, 2: options.WalkUp, 3: options.PickUp, 4: options.GoTo, 5: options.PutDown,
        6: people.Report,
    },
    "search": {0: options.GoTo, 1: options.Search, 2: people.Show, 3: people.Report},
    "carry": {
        0: options.GoTo, 1: options.Search, 2: people.Meet, 3: people.Escort, 4: options.PutDown, 5: people.AwaitPerson,
        6: people.Report,
    },
}  # fmt: skip
IN_WORDS: dict[tuple[str, int], set[str]] = {
    ("delivery", 1): SEARCHED | {"nothing, but carrying"},
    ("search", 1): SEARCHED,
    ("carry", 1): SEARCHED,
    ("delivery", 3): {"picked, more wanted", "picked, all of it", "refused", "hands full"},
    ("delivery", 5): {"empty hands, more wanted", "empty hands", "stuck"},
    ("carry", 5): {"came", "did not come, not all done", "did not come, all done"},
} | dict.fromkeys((("delivery", 6), ("search", 3), ("carry", 6)), REPORTED)


def outcomes_of(option: type) -> set[str]:
    """Outcomes as an option's own text names them."""
    told = inspect.getdoc(option) or ""
    named = re.search(r"Outcomes?: (.*?)\.(?:\s|$)", told, re.DOTALL)
    assert named is not None, option
    return set(re.findall(r"``([^`]+)``", named[1]))


def outcomes_in_code(option: type) -> set[str]:
    """Outcomes that an option's code sets."""
    code = inspect.getsource(option)
    found: set[str] = set()
    for line in re.findall(r"self\.outcome = (.*)", code):
        value = re.sub(r'"[^"]*"\]', "", line)  # what is looked up is no outcome
        found |= set(re.findall(r'"([^"]+)"', value))
    return found


@pytest.mark.parametrize(
    "option", sorted({kind for states in STATES.values() for kind in states.values()}, key=lambda kind: kind.__name__)
)
def test_options_say_which_outcomes_they_have(option: type) -> None:
    assert outcomes_of(option) == outcomes_in_code(option)


@pytest.mark.parametrize("automaton", AUTOMATA.values(), ids=lambda one: one.category)
def test_every_outcome_has_an_edge_and_every_edge_an_outcome(automaton: Automaton) -> None:
    for state in automaton.states:
        edges = {outcome for (begin, outcome) in automaton.edges if begin == state}
        if state == automaton.final:
            assert edges == set()
            continue
        expected = IN_WORDS.get((automaton.category, state)) or outcomes_of(STATES[automaton.category][state])
        assert edges == expected, automaton.states[state]


@pytest.mark.parametrize("automaton", AUTOMATA.values(), ids=lambda one: one.category)
def test_every_state_is_reached_and_the_end_from_every_state(automaton: Automaton) -> None:
    onward: dict[int, set[int]] = {state: set() for state in automaton.states}
    for (state, _), after in automaton.edges.items():
        onward[state].add(after)

    def reached(start: int) -> set[int]:
        seen, stack = {start}, [start]
        while stack:
            new = onward[stack.pop()] - seen
            seen |= new
            stack += new
        return seen

    assert reached(0) == set(automaton.states)
    assert all(automaton.final in reached(state) for state in automaton.states)


def test_the_automata_are_those_of_the_categories() -> None:
    assert AUTOMATA == {"carry": CARRY, "delivery": DELIVERY, "search": SEARCH}
    assert list(DELIVERY.states) == list(range(8))  # the paper's figure
    # Every state but the last has an option, and no other has.
    for name, automaton in AUTOMATA.items():
        assert set(STATES[name]) == set(automaton.states) - {automaton.final}
        assert hasattr(HeuristicPlanner, f"_{name}")
