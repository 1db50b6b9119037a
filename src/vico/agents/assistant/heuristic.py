"""The heuristic planner: the finite-state automaton of the paper's figure on the delivery task.

::

    0 goto(source) -> 1 search near source -> 2 navigate to object -> 3 pick object(s)
    3 -> 1 no target and carrying nothing     3 -> 4 hands full, or no target and carrying something
    4 goto(destination) -> 5 drop at destination
    5 -> 0 empty hands, not all done          5 -> 6 empty hands, all done
    6 send complete -> 7 finished

One guard is ours: a search that has looked everywhere three times gives the errand up, where the figure would go on
for ever.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import IntEnum
from typing import Any, ClassVar

from vico.agents.assistant.skills import GRASP, Action, AssistantSkills, LookAround, ObservationView
from vico.agents.perception import Sighting
from vico.agents.state import AgentState
from vico.seeds import rng
from vico.world.public import PublicMap

SEARCH_ROUNDS = 3


class AutomatonState(IntEnum):
    """States of the automaton, numbered as in the figure."""

    GOTO_SOURCE = 0
    SEARCH = 1
    NAVIGATE = 2
    PICK = 3
    GOTO_DESTINATION = 4
    DROP = 5
    COMPLETE = 6
    FINISHED = 7


class HeuristicDelivery:
    """Does the errands one after the other, in the order given.

    Parameters
    ----------
    instructions
        The task's errands, as told.
    number, of
        Several assistants share the errands: this one takes every `of`-th, from `number` on.
    """

    def __init__(
        self, instructions: list[dict[str, Any]], public_map: PublicMap, *, seed: int, number: int = 0, of: int = 1
    ) -> None:
        self.errands = instructions[number::of]
        self.skills = AssistantSkills(public_map, rng(seed, "heuristic", number))
        self.phase = AutomatonState.GOTO_SOURCE if self.errands else AutomatonState.FINISHED
        self._current = 0
        self._search: LookAround | None = None
        self._rounds = 0
        self._target: Sighting | None = None
        self._picked: set[str] = set()
        self._near = GRASP
        self._picking = ""
        self._reported = 0
        self._steps_here = 0

    def state(self) -> AgentState:
        """Return the errand in hand and how far it came, and what the skills remember."""
        return {
            "skills": self.skills.state(),
            "phase": int(self.phase),
            "current": self._current,
            "search": None if self._search is None else self._search.state(),
            "rounds": self._rounds,
            "target": None if self._target is None else self._target.state(),
            "picked": sorted(self._picked),
            "near": self._near,
            "picking": self._picking,
            "reported": self._reported,
            "steps_here": self._steps_here,
        }

    def restore(self, state: AgentState) -> None:
        """Go on with the errands as `state` returned them."""
        self.skills.restore(state["skills"])
        self.phase, self._current = AutomatonState(state["phase"]), state["current"]
        self._search = None
        if state["search"] is not None:
            self._search = self._new_search()
            self._search.restore(state["search"])
        self._rounds, self._near = state["rounds"], state["near"]
        self._target = None if state["target"] is None else Sighting(**state["target"])
        self._picked, self._picking = set(state["picked"]), state["picking"]
        self._reported, self._steps_here = state["reported"], state["steps_here"]

    @property
    def errand(self) -> dict[str, Any]:
        """The errand in hand."""
        return self.errands[self._current]

    def act(self, observation: Mapping[str, Any], info: Mapping[str, Any]) -> Action:
        """Return one action for one observation."""
        if info.get("coming_out"):  # of a door: nobody does anything else meanwhile
            return {"type": "wait"}
        view = ObservationView(observation, info)
        self.skills.notice(view)
        for _ in range(12):  # a chain of states that are done at once, each at most once or twice
            before = self.phase
            action = self._STEPS[self.phase](self, view)
            self._steps_here = self._steps_here + 1 if self.phase == before else 0
            if action is not None:
                return action
        return {"type": "wait"}

    def _wanted(self, thing: Sighting) -> bool:
        return thing.name in self.errand["objects"] and thing.name not in self._picked

    def _new_search(self) -> LookAround:
        return LookAround(self.skills, self._wanted, self.errand["source"])

    def _goto_source(self, view: ObservationView) -> Action | None:
        action = self.skills.go_to(view, self.errand["source"])
        if action is None:
            self._search = self._new_search()
            self.phase = AutomatonState.SEARCH
        return action

    def _look(self, view: ObservationView) -> Action | None:
        assert self._search is not None
        action = self._search.act(view)
        if action is not None:
            return action
        if self._search.found is not None:
            self._target, self._near = self._search.found, GRASP
            self.phase = AutomatonState.NAVIGATE
            return None
        self._rounds += 1
        if any(view.held):
            self.phase = AutomatonState.GOTO_DESTINATION
        elif self._rounds >= SEARCH_ROUNDS:
            self._next_errand()
        else:
            self._search = self._new_search()
            return {"type": "wait"}
        return None

    def _navigate(self, view: ObservationView) -> Action | None:
        assert self._target is not None
        # What is in view again is placed better from nearer.
        self._target = next((t for t in view.things if t.entity == self._target.entity), self._target)
        action = self.skills.approach(view, self._target.position, near=self._near)
        if action is not None and self._steps_here < 60:
            return action
        self.phase = AutomatonState.PICK
        return None

    def _pick(self, view: ObservationView) -> Action | None:
        assert self._target is not None
        if self._picking:
            name, self._picking = self._picking, ""
            if not view.refused:
                self._picked.add(name)
            elif self._near > 0.5:
                self._near -= 0.3
                self.phase = AutomatonState.NAVIGATE
                return None
            else:
                self.phase = AutomatonState.SEARCH
                self._search = self._new_search()
                return {"type": "wait"}
        left = [name for name in self.errand["objects"] if name not in self._picked]
        if not left or all(view.held):
            self.phase = AutomatonState.GOTO_DESTINATION
            return None
        if self._target.name in left:
            self._picking = self._target.name
            return {"type": "pick", "hand": view.held.index(0), "object": self._target.entity}
        seen = next((thing for thing in view.things if self._wanted(thing)), None)
        if seen is not None:
            self._target, self._near = seen, GRASP
            self.phase = AutomatonState.NAVIGATE
            return None
        # More is wanted from here: one look around before carrying off what is in hand.
        self._search = self._new_search()
        self.phase = AutomatonState.SEARCH
        return None

    def _goto_destination(self, view: ObservationView) -> Action | None:
        action = self.skills.go_to(view, self.errand["destination"])
        if action is None:
            self.phase = AutomatonState.DROP
        return action

    def _drop(self, view: ObservationView) -> Action | None:
        full = [hand for hand, entity in enumerate(view.held) if entity]
        if full:
            if view.refused and self._steps_here > 0:
                if self._steps_here > 12:
                    self.phase = AutomatonState.GOTO_DESTINATION
                if self._steps_here % 2:
                    return {"type": "turn_left", "degrees": 70.0}
            return {"type": "put", "hand": full[0]}
        left = [name for name in self.errand["objects"] if name not in self._picked]
        if left and self._rounds < SEARCH_ROUNDS:
            self.phase = AutomatonState.GOTO_SOURCE
            return None
        self._next_errand()
        return None

    def _next_errand(self) -> None:
        self._current += 1
        self._rounds = 0
        self._search = None
        self._target = None
        self.phase = AutomatonState.GOTO_SOURCE if self._current < len(self.errands) else AutomatonState.COMPLETE

    def _complete(self, view: ObservationView) -> Action | None:
        if self._reported < len(self.errands):
            index = int(self.errands[self._reported]["index"])
            self._reported += 1
            return {"type": "task_complete", "index": index}
        self.phase = AutomatonState.FINISHED
        return None

    def _finished(self, view: ObservationView) -> Action | None:
        return {"type": "wait"}

    _STEPS: ClassVar[dict[AutomatonState, Callable[[HeuristicDelivery, ObservationView], Action | None]]] = {
        AutomatonState.GOTO_SOURCE: _goto_source,
        AutomatonState.SEARCH: _look,
        AutomatonState.NAVIGATE: _navigate,
        AutomatonState.PICK: _pick,
        AutomatonState.GOTO_DESTINATION: _goto_destination,
        AutomatonState.DROP: _drop,
        AutomatonState.COMPLETE: _complete,
        AutomatonState.FINISHED: _finished,
    }
