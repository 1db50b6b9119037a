"""Our planner: the best order of what is left, made anew whenever something new is known.

- **Order**: the exact best order in the abstract model, with two hands, ways by the map and the time that is left.
- **Memory**: whatever is seen on the way and is wanted is fetched when that fits the order.
- **Asking**: whoever is met is asked for the people that are looked for; where they point to is looked at, too.
- **Allocation**: two assistants share the subtasks so that the worse of both plans ends soonest; both reckon alike from
  what both were told, so that nothing need be said. Who has finished its own goes on with what the other does last.
- **Search**: regions are looked through in the order of chance per second; what was looked at comes last.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np

from vico.agents.assistant.asking import Enquiries, region_of
from vico.agents.assistant.choosing import ChoicePlanner
from vico.agents.assistant.errands import Choice
from vico.agents.assistant.ordering import Plan, best_plan
from vico.agents.assistant.outlook import Model
from vico.agents.assistant.skills import Action, ObservationView
from vico.agents.state import AgentState

# Stages of an errand that something new may interrupt.
_MAY_TURN = ("go", "look")


class OurPlanner(ChoicePlanner):
    """Plans an order, and again when a wanted thing comes into view."""

    method = "ours"

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._share: list[int] | None = None
        self._known: list[int] = []
        self._enquiries = Enquiries(self.skills.map)

    def state(self) -> AgentState:
        """Return what is under way, and all that is known."""
        mine = {"share": self._share, "known": list(self._known), "enquiries": self._enquiries.state()}
        return super().state() | mine

    def restore(self, state: AgentState) -> None:
        """Go on where `state` was returned."""
        self._enquiries.restore(state["enquiries"])
        places = self.skills.map.place_by_id
        for k, told in self.book.instructions.items():
            for place in self._enquiries.places.get(told["person"]["name"], []):
                self.book.add_source(k, region_of(places[place]))
        super().restore(state)
        self._share = None if state["share"] is None else [int(k) for k in state["share"]]
        self._known = [int(entity) for entity in state["known"]]

    def notice(self, view: ObservationView) -> Action | None:
        """Plan anew when something that is wanted comes into view while one is on the way or looking."""
        known = sorted({thing.entity for thing in self.seen(view).values()})
        new = [entity for entity in known if entity not in self._known]
        self._known = known
        if new and self.errand is not None and self.errand.stage in _MAY_TURN:
            choice = self.decide(view)
            if choice is not None and choice != self.errand.choice and choice.kind == "fetch":
                self.errand = None
        return self._ask(view)

    def _ask(self, view: ObservationView) -> Action | None:
        """Ask whoever is near for those who are looked for, and note what is answered."""
        wanted = {
            k: str(told["person"]["name"])
            for k, told in self.book.instructions.items()
            if self.book.category(k) == "carry" and self.book.is_open(k) and not self.book.in_hand(k, view)
        }
        if not wanted:
            return None
        for k, place in self._enquiries.listen(view, wanted):
            self.book.add_source(k, region_of(place))
        if self.errand is None or self.errand.stage not in _MAY_TURN or view.state["vehicle"]:
            return None
        return self._enquiries.question(view, wanted)

    def decide(self, view: ObservationView) -> Choice | None:
        """Return the first choice of the best plan."""
        left = self.time_left(view)
        if self._share is None:
            self._share = self._shared(view, left)
        plan = best_plan(self._model(self._share, view), left)
        if not plan.choices and self.of > 1:
            others = [k for k in self.book.instructions if k not in self._share]
            plan = best_plan(self._model(others, view), left)
        if plan.choices:
            return plan.choices[0]
        # Nothing can be done in time, as it seems: what is nearest to being done, then.
        choices = self.book.choices(view, self.seen(view))
        mine = [choice for choice in choices if choice.subtask in self._share]
        return next(iter(mine or choices), None) if left > 0.0 else None

    def _model(self, subtasks: list[int], view: ObservationView) -> Model:
        return Model(self.book, self.estimates, subtasks, view, self.seen(view))

    def _shared(self, view: ObservationView, left: float) -> list[int]:
        """Return the subtasks that are this assistant's: of all ways to share, the one that ends best."""
        subtasks = list(self.book.instructions)
        if self.of == 1:
            return subtasks
        plans: dict[tuple[int, ...], Plan] = {}
        # Both reckon from one point that both know, not from where each stands: so they come to the same shares.
        told = [region["centre"] for one in self.book.instructions.values() for region in one["sources"]]
        middle = (float(np.mean([at[0] for at in told])), float(np.mean([at[1] for at in told])))

        def plan_of(part: tuple[int, ...]) -> Plan:
            if part not in plans:
                model = self._model(list(part), view)
                model.start = replace(model.start, at=middle, time=0.0)
                plans[part] = best_plan(model, left)
            return plans[part]

        best = (-1.0, 0.0)
        shared: tuple[tuple[int, ...], tuple[int, ...]] = (tuple(subtasks), ())
        for count in range(1, len(subtasks)):
            for first in combinations(subtasks, count):
                second = tuple(k for k in subtasks if k not in first)
                one, other = plan_of(first), plan_of(second)
                value = (one.worth + other.worth, -max(one.time, other.time))
                if value > best:
                    best, shared = value, (first, second)
        return list(shared[self.number % 2])
