"""Baseline planners: the heuristic one, an automaton for each category, and the random one.

The heuristic planner does one subtask after the other in the order given (paper, appendix, and its figure). Its
automata are data: states, and where each outcome leads. Delivery's states are numbered as in the paper's figure. Two
things are ours, where the figure would go on for ever: a region that was looked through is left for the next one, and
a subtask that was looked for everywhere is put at the end of the line, at most so often as `ROUNDS` says.

The random planner draws a high-level action without any plan, carries it out, then draws the next (paper, section 4.1).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from vico.agents.assistant.options import GoTo, Option, PickUp, PutDown, Search, WalkUp
from vico.agents.assistant.people import PERSON, AwaitPerson, Escort, Meet, Report, Show
from vico.agents.assistant.skills import GRASP, Action, AssistantSkills, LookAround, ObservationView
from vico.agents.base import AgentState, FieldState, Plan, generator_state, restore_generator
from vico.agents.day_plan import plan_of_errand
from vico.agents.perception import Sighting
from vico.seeds import rng
from vico.world.public import PublicMap

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


# States that are passed through in one step, at most.
_CHAIN = 12
# Things that so many attempts did not reach are left.
_REFUSALS = 2
# How long one waits for somebody who was followed home, steps.
_PATIENCE = 8
# What Search's reports are made from: nearer than any setting asks for, metres.
_SHOW_WITHIN = 4.6


class HeuristicPlanner(FieldState):
    """Follows the automaton of the task's category.

    Parameters
    ----------
    instructions
        The subtasks, as told.
    number, of
        Several assistants share the subtasks: this one takes every `of`-th, from `number` on.
    distance
        Taken for the other planners' sake: the automata know no distances.
    """

    skills: AssistantSkills
    number: int
    line: list[int]  # subtasks still to do, by their place in `errands`, the one in hand first
    _tried: list[int]
    _region: int = 0
    _picked: set[str]
    _refused: list[str]
    _target: Sighting | None = None

    def __init__(
        self,
        instructions: list[dict[str, Any]],
        public_map: PublicMap,
        *,
        seed: int,
        number: int = 0,
        of: int = 1,
        distance: bool = True,
    ) -> None:
        self.errands = instructions[number::of]
        self.skills = AssistantSkills(public_map, rng(seed, "heuristic", number))
        self.automaton = AUTOMATA[str(instructions[0]["category"]) if instructions else "delivery"]
        self.line = list(range(len(self.errands)))
        self.number = 0 if self.line else self.automaton.final
        self._tried = [0] * len(self.errands)
        self._picked, self._refused = set(), []
        self._option: Option | None = None  # made again from the automaton's state, which `number` is

    def plan(self, second: float) -> Plan:
        """Return what it is about."""
        errand = self.errand if self.line and self.number != self.automaton.final else None
        doing = "" if errand is None else self.automaton.states[self.number]
        source = -1 if errand is None or self.number > 1 else self._region % len(errand["sources"])
        return plan_of_errand(errand, doing, self.skills.map, self.skills.navigator.walker.way, source=source)

    def state(self) -> AgentState:
        """Return the subtask in hand and how far it came, and what the skills remember."""
        return {**super().state(), "option": None if self._option is None else self._option.state()}

    def restore(self, state: AgentState) -> None:
        """Go on with the subtasks as `state` returned them."""
        super().restore(state)
        self._option = None
        if state["option"] is not None:
            self._option = self._begin()
            self._option.restore(state["option"])

    @property
    def errand(self) -> dict[str, Any]:
        """The subtask in hand."""
        return self.errands[self.line[0]]

    def act(self, observation: Mapping[str, Any], info: Mapping[str, Any]) -> Action:
        """Return one action for one observation."""
        if info.get("coming_out"):  # of a door: nobody does anything else meanwhile
            return {"type": "wait"}
        view = ObservationView(observation, info)
        self.skills.notice(view)
        for _ in range(_CHAIN):
            if self.number == self.automaton.final:
                break
            if self._option is None:
                self._option = self._begin()
            action = self._option.act(view)
            if action is not None:
                return action
            outcome = self._outcome(self._option, view)
            self.number, self._option = self.automaton.edges[self.number, outcome], None
        return {"type": "wait"}

    def _begin(self) -> Option:
        """Make the option of the state one is in."""
        return {"delivery": self._delivery, "search": self._search, "carry": self._carry}[self.automaton.category]()

    def _delivery(self) -> Option:
        errand, target = self.errand, self._target
        if self.number in (2, 3):
            assert target is not None
            return WalkUp(self.skills, target) if self.number == 2 else PickUp(self.skills, target)
        makers: dict[int, Callable[[], Option]] = {
            0: lambda: GoTo(self.skills, self._source),
            1: lambda: Search(self.skills, self._is_wanted, self._source),
            4: lambda: GoTo(self.skills, errand["destination"]),
            5: lambda: PutDown(self.skills, errand["destination"]),
            6: lambda: Report(int(errand["index"])),
        }
        return makers[self.number]()

    def _search(self) -> Option:
        if self.number == 2:
            assert self._target is not None
            return Show(self.skills, self._target, within=_SHOW_WITHIN)
        makers: dict[int, Callable[[], Option]] = {
            0: lambda: GoTo(self.skills, self._source),
            1: lambda: Search(self.skills, self._is_wanted, self._source),
            3: lambda: Report(int(self.errand["index"])),
        }
        return makers[self.number]()

    def _carry(self) -> Option:
        errand, person = self.errand, str(self.errand["person"]["name"])
        where = None if self._target is None else self._target.position
        makers: dict[int, Callable[[], Option]] = {
            0: lambda: GoTo(self.skills, self._source),
            1: lambda: Search(
                self.skills, lambda seen: seen.kind == PERSON and seen.name == person, self._source, large=True
            ),
            2: lambda: Meet(self.skills, person, len(errand["objects"]), where),
            3: lambda: Escort(self.skills, person, errand["destination"]),
            4: lambda: PutDown(self.skills, errand["destination"]),
            5: lambda: AwaitPerson(person, _PATIENCE),
            6: lambda: Report(int(errand["index"])),
        }
        return makers[self.number]()

    @property
    def _source(self) -> dict[str, Any]:
        regions: list[dict[str, Any]] = self.errand["sources"]
        return regions[self._region % len(regions)]

    def _is_wanted(self, thing: Sighting) -> bool:
        out_of_reach = self._refused.count(thing.name) >= _REFUSALS
        return thing.name in self.errand["objects"] and thing.name not in self._picked and not out_of_reach

    def _outcome(self, option: Option, view: ObservationView) -> str:
        """Say what came of an option, in the words of the automaton's edges, and take note of it."""
        state = self.automaton.states[self.number]
        if isinstance(option, Search):
            return self._after_search(option, view)
        if isinstance(option, PickUp):
            return self._after_pick(option, view)
        if isinstance(option, WalkUp | Show):
            self._target = option.target
        if isinstance(option, PutDown) and self.automaton is AUTOMATA["delivery"]:
            return self._after_put(option)
        if state == "report":
            return self._next("")
        if option.outcome == "did not come":
            return self._next("did not come, ")
        return option.outcome

    def _after_search(self, search: Search, view: ObservationView) -> str:
        if search.found is not None:
            self._target = search.found
            return "found"
        if self.automaton is AUTOMATA["delivery"] and any(view.hands):
            return "nothing, but carrying"
        self._region += 1
        if self._region % len(self.errand["sources"]):
            return "nothing"
        # Looked for everywhere: others first.
        self._tried[self.line[0]] += 1
        self.line.append(self.line.pop(0))
        self.line = [k for k in self.line if self._tried[k] < ROUNDS]
        self._region = 0
        return "nothing" if self.line else "nothing left"

    def _after_pick(self, pick: PickUp, view: ObservationView) -> str:
        if pick.outcome == "picked":
            self._picked.add(pick.target.name)
            left = [name for name in self.errand["objects"] if name not in self._picked]
            return "picked, more wanted" if left and not all(view.hands) else "picked, all of it"
        if pick.outcome == "refused":
            self._refused.append(pick.target.name)
        return pick.outcome

    def _after_put(self, put: PutDown) -> str:
        if put.outcome == "stuck":
            return "stuck"
        left = [name for name in self.errand["objects"] if name not in self._picked]
        if not left:
            return "empty hands"
        self._tried[self.line[0]] += 1
        return "empty hands, more wanted" if self._tried[self.line[0]] < ROUNDS else "empty hands"

    def _next(self, prefix: str) -> str:
        """Go on to the next subtask."""
        self.line.pop(0)
        self._region = 0
        self._target = None
        return f"{prefix}{'not all done' if self.line else 'all done'}"


# Longest time for one high-level action, steps: a drawn one may be impossible.
PATIENCE = 300


class RandomPlanner:
    """Draws among: go to a source or destination, search, pick what is in view, put down, report an errand done."""

    def __init__(
        self,
        instructions: list[dict[str, Any]],
        public_map: PublicMap,
        *,
        seed: int,
        number: int = 0,
        of: int = 1,
        distance: bool = True,
    ) -> None:
        self.errands = instructions
        self.skills = AssistantSkills(public_map, rng(seed, "random planner, feet", number))
        self._random = rng(seed, "random planner", number)
        self._plan = ""
        self._region: Mapping[str, Any] = {}
        self._search: LookAround | None = None
        self._target: Sighting | None = None
        self._age = 0
        self._index = 0
        self._done = False

    def state(self) -> AgentState:
        """Return the plan under way, and where chance stands."""
        return {
            "skills": self.skills.state(),
            "generator": generator_state(self._random),
            "plan": self._plan,
            "region": dict(self._region),
            "search": None if self._search is None else self._search.state(),
            "target": None if self._target is None else self._target.state(),
            "age": self._age,
            "index": self._index,
            "done": self._done,
        }

    def restore(self, state: AgentState) -> None:
        """Go on with the plan that `state` returned."""
        self.skills.restore(state["skills"])
        restore_generator(self._random, state["generator"])
        self._plan, self._region = state["plan"], dict(state["region"])
        self._search = None
        if state["search"] is not None:
            self._search = self._any_object()
            self._search.restore(state["search"])
        self._target = None if state["target"] is None else Sighting(**state["target"])
        self._age, self._index, self._done = state["age"], state["index"], state["done"]

    def _any_object(self) -> LookAround:
        return LookAround(self.skills, lambda thing: thing.kind == "object", None)

    def act(self, observation: Mapping[str, Any], info: Mapping[str, Any]) -> Action:
        """Return one action for one observation."""
        if info.get("coming_out"):  # of a door: nobody does anything else meanwhile
            return {"type": "wait"}
        view = ObservationView(observation, info)
        self.skills.notice(view)
        self._age += 1
        for _ in range(8):
            action = self._continue(view)
            if action is not None and self._age <= PATIENCE:
                return action
            self._draw(view)
        return {"type": "wait"}

    def _draw(self, view: ObservationView) -> None:
        errand = self.errands[int(self._random.integers(len(self.errands)))]
        self._plan = ("go", "search", "pick", "put", "complete")[int(self._random.integers(5))]
        self._age = 0
        regions = [*errand["sources"], *([errand["destination"]] if errand["destination"] else [])]
        self._region = regions[int(self._random.integers(len(regions)))]
        self._search = self._any_object()
        things = [thing for thing in view.things if thing.kind == "object" and thing.entity not in view.hands]
        self._target = things[int(self._random.integers(len(things)))] if things else None
        self._index = int(errand["index"])
        self._done = False

    def _continue(self, view: ObservationView) -> Action | None:
        if self._plan == "go":
            return self.skills.go_to(view, self._region)
        if self._plan == "search" and self._search is not None:
            return self._search.act(view)
        if self._plan == "pick" and self._target is not None and 0 in view.hands and not self._done:
            step = self.skills.approach(view, self._target.position, near=GRASP)
            if step is not None:
                return step
            self._done = True
            return {"type": "pick", "hand": view.hands.index(0), "object": self._target.entity}
        if self._plan == "put" and any(view.hands) and not self._done:
            self._done = True
            return {"type": "put", "hand": next(h for h, entity in enumerate(view.hands) if entity)}
        if self._plan == "complete" and not self._done:
            self._done = True
            return {"type": "task_complete", "index": self._index}
        return None
