"""Our planner: what to do next is planned anew whenever something new is known.

- **Order**: where it is known where everything is, the exact best order in the abstract model, with two hands, ways by
  the map and the time that is left; where it is not, the first choice that does best in many worlds that may be.
- **Search**: regions by how likely what is wanted is there: people by the habits of people at that hour, and everything
  by what was looked at, seen and heard since.
- **Memory**: whatever is seen on the way and is wanted is fetched when that fits the plan.
- **Asking**: whoever is met is asked for the people that are looked for; where they point to is looked at, too.
- **Allocation**: two assistants share the subtasks so that together they get most done; both reckon alike from what
  both were told, so that nothing need be said. Who has finished its own goes on with the other's.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np

from vico.agents.assistant.errands import Choice, ChoicePlanner
from vico.agents.assistant.estimates import read_habits
from vico.agents.assistant.people import Enquiries, region_of_place
from vico.agents.assistant.rollouts import Beliefs, SituationBuilder, best_first_choice, expected_worth
from vico.agents.assistant.skills import Action, ObservationView
from vico.agents.assistant.task_planning import TaskModel, best_plan
from vico.agents.base import AgentState
from vico.seeds import rng

# Stages of an errand that something new may interrupt.
_MAY_TURN = ("go", "look")
# So many worlds are drawn for a choice, and for each way to share.
_WORLDS, _WORLDS_TO_SHARE = 200, 60


class OurPlanner(ChoicePlanner):
    """Plans anew at each decision, and when a wanted thing comes into view."""

    method = "ours"

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._share: list[int] | None = None
        self._known: list[int] = []
        self._enquiries = Enquiries(self.skills.map)
        self._beliefs = Beliefs(self.book, self.skills.map, read_habits())
        self._situations = SituationBuilder(self.book, self.estimates, self._beliefs)

    def state(self) -> AgentState:
        """Return what is under way, and all that is known."""
        mine = {
            "share": self._share,
            "known": list(self._known),
            "enquiries": self._enquiries.state(),
            "beliefs": self._beliefs.state(),
        }
        return super().state() | mine

    def restore(self, state: AgentState) -> None:
        """Go on where `state` was returned."""
        self._enquiries.restore(state["enquiries"])
        places = self.skills.map.place_by_id
        for k, told in self.book.instructions.items():
            for place in self._enquiries.places.get(told["person"]["name"], []):
                self.book.add_source(k, region_of_place(places[place]))
        super().restore(state)
        self._beliefs.restore(state["beliefs"])
        self._share = None if state["share"] is None else [int(k) for k in state["share"]]
        self._known = [int(entity) for entity in state["known"]]

    def notice(self, view: ObservationView) -> Action | None:
        """Plan anew when something that is wanted comes into view while one is on the way or looking."""
        self._beliefs.notice(view, self.skills)
        known = sorted({thing.entity for thing in self.last_sightings(view).values()})
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
        for k, place, how in self._enquiries.listen(view, wanted):
            self.book.add_source(k, region_of_place(place))
            self._beliefs.hear(k, place.id, float(view.state["time"]), how)
        if self.errand is None or self.errand.stage not in _MAY_TURN or view.state["vehicle"]:
            return None
        return self._enquiries.question(view, wanted)

    def decide(self, view: ObservationView) -> Choice | None:
        """Return the first choice of the best plan."""
        left = self.time_left(view)
        if self._share is None:
            self._share = self._share_for(view, left)
        others = [k for k in self.book.instructions if k not in self._share]
        for subtasks in (self._share, others):
            choice = self._best_of(subtasks, view, left)
            if choice is not None:
                return choice
        # Nothing can be done in time, as it seems: what is nearest to being done, then.
        choices = self.book.choices(view, self.last_sightings(view))
        mine = [choice for choice in choices if choice.subtask in self._share]
        return next(iter(mine or choices), None) if left > 0.0 else None

    def _best_of(self, subtasks: list[int], view: ObservationView, left: float) -> Choice | None:
        """Return what is best to do next for some of the subtasks; None if none of them can be done in time."""
        if not any(self.book.is_open(k) for k in subtasks):
            return None
        if not self._is_uncertain(subtasks):
            plan = best_plan(TaskModel(self.book, self.estimates, subtasks, view, self.last_sightings(view)), left)
            return plan.choices[0] if plan.choices else None
        situation, choices = self._situations.now(subtasks, view, self.last_sightings(view), left)
        chance = rng(self.seed, "ours", self.number, round(float(view.state["time"])))
        chosen = best_first_choice(situation, chance, worlds=_WORLDS)
        return None if chosen < 0 else choices[chosen]

    def _is_uncertain(self, subtasks: list[int]) -> bool:
        """Whether one must look for some of them in more than one region."""
        return any(self.book.is_open(k) and len(self.book.instructions[k]["sources"]) > 1 for k in subtasks)

    def _share_for(self, view: ObservationView, left: float) -> list[int]:
        """Return the subtasks that are this assistant's: of all ways to share, the one that ends best."""
        subtasks = list(self.book.instructions)
        if self.of == 1:
            return subtasks
        # Both reckon from one point that both know, not from where each stands: so they come to the same shares.
        told = [region["centre"] for one in self.book.instructions.values() for region in one["sources"]]
        middle = (float(np.mean([at[0] for at in told])), float(np.mean([at[1] for at in told])))
        values: dict[tuple[int, ...], tuple[float, float]] = {}

        def value_of(part: tuple[int, ...]) -> tuple[float, float]:
            if part not in values:
                values[part] = self._value(list(part), middle, view, left)
            return values[part]

        best = (-1.0, 0.0)
        shared: tuple[tuple[int, ...], tuple[int, ...]] = (tuple(subtasks), ())
        for count in range(1, len(subtasks)):
            for first in combinations(subtasks, count):
                second = tuple(k for k in subtasks if k not in first)
                one, other = value_of(first), value_of(second)
                value = (one[0] + other[0], -max(one[1], other[1]))
                if value > best:
                    best, shared = value, (first, second)
        return list(shared[self.number % 2])

    def _value(
        self, part: list[int], middle: tuple[float, float], view: ObservationView, left: float
    ) -> tuple[float, float]:
        """Return what one assistant gets done of some subtasks, and the seconds it takes where that is known."""
        if self._is_uncertain(part):
            situation, _ = self._situations.from_point(part, middle, view, left)
            return expected_worth(situation, rng(self.seed, "ours", "shares"), worlds=_WORLDS_TO_SHARE), 0.0
        model = TaskModel(self.book, self.estimates, part, view, {})
        model.start = replace(model.start, at=middle, time=0.0)
        plan = best_plan(model, left)
        return plan.worth, plan.time
