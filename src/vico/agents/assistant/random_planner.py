"""The random planner: a high-level action drawn without any plan, carried out, then the next (paper, section 4.1)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vico.agents.assistant.looking import LookAround
from vico.agents.assistant.skills import GRASP, Action, AssistantSkills, ObservationView
from vico.agents.perception import Sighting
from vico.agents.state import AgentState, generator_state, restore_generator
from vico.seeds import rng
from vico.world.public import PublicMap

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
        things = [thing for thing in view.things if thing.kind == "object" and thing.entity not in view.held]
        self._target = things[int(self._random.integers(len(things)))] if things else None
        self._index = int(errand["index"])
        self._done = False

    def _continue(self, view: ObservationView) -> Action | None:
        if self._plan == "go":
            return self.skills.go_to(view, self._region)
        if self._plan == "search" and self._search is not None:
            return self._search.act(view)
        if self._plan == "pick" and self._target is not None and 0 in view.held and not self._done:
            step = self.skills.approach(view, self._target.position, near=GRASP)
            if step is not None:
                return step
            self._done = True
            return {"type": "pick", "hand": view.held.index(0), "object": self._target.entity}
        if self._plan == "put" and any(view.held) and not self._done:
            self._done = True
            return {"type": "put", "hand": next(h for h, entity in enumerate(view.held) if entity)}
        if self._plan == "complete" and not self._done:
            self._done = True
            return {"type": "task_complete", "index": self._index}
        return None
