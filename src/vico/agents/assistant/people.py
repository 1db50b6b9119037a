"""Options about people and about showing what was found: meet somebody, follow them home, show a thing, report."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.agents.assistant.skills import Action, AssistantSkills, ObservationView
from vico.agents.perception import Sighting
from vico.agents.requester import CALL_DISTANCE, HAND_OVER_DISTANCE
from vico.agents.state import AgentState

Region = Mapping[str, Any]

PERSON = "resident"
_OFFER = "Hello! I am here to help you carry that home. May I take it?"
# One speaks from so near, stands so near to be handed something, metres; asks again after so many steps; and gives up
# somebody who is out of view for so long, or hands nothing over, steps.
_SPEAK, _STAND, _AGAIN, _LOST, _LONGEST = CALL_DISTANCE - 3.0, HAND_OVER_DISTANCE - 0.3, 20, 25, 150
# Who follows keeps behind by so much, runs where it is more than the second, metres.
_BEHIND, _RUN_BEYOND, _RUN, _WALK = 1.7, 3.2, 2.2, 1.0
# ... goes to where the person was last seen for so many steps, then home by the map.
_TO_LAST_SEEN = 8
# So many pixels are shown where 20 are asked for, from these distances, metres, of which the first is tried first.
_PIXELS, _SHOW_FROM = 26, (2.6, 1.6, 1.0)
_SHOWING = 40


def person_in_view(view: ObservationView, name: str) -> Sighting | None:
    """Return somebody by name, if they are in view."""
    return next((seen for seen in view.things if seen.name == name and seen.kind == PERSON), None)


class Meet:
    """Go up to a person in view, offer help, and take what they hand over. Outcomes: ``handed``, ``lost``."""

    def __init__(self, skills: AssistantSkills, person: str, count: int, where: NDArray[np.float64] | None) -> None:
        self.outcome = ""
        self._skills, self._person, self._count = skills, person, count
        self._where = where
        self._unseen = self._steps = 0
        self._spoke_at = -_AGAIN
        self._before: int | None = None

    def state(self) -> AgentState:
        """Return how far it came."""
        return {
            "where": None if self._where is None else self._where.copy(),
            "unseen": self._unseen,
            "steps": self._steps,
            "spoke_at": self._spoke_at,
            "before": self._before,
        }

    def restore(self, state: AgentState) -> None:
        """Go on."""
        where = state["where"]
        self._where = None if where is None else np.array(where, np.float64)
        self._unseen, self._steps = state["unseen"], state["steps"]
        self._spoke_at, self._before = state["spoke_at"], state["before"]

    def act(self, view: ObservationView) -> Action | None:
        """Return the next action."""
        held = sum(entity > 0 for entity in view.held)
        if self._before is None:
            self._before = held
        self._steps += 1
        if held >= min(2, self._before + self._count):
            self.outcome = "handed"
            return None
        seen = person_in_view(view, self._person)
        self._unseen = 0 if seen is not None else self._unseen + 1
        if self._unseen > _LOST or self._steps > _LONGEST:
            self.outcome = "handed" if held > self._before else "lost"
            return None
        if seen is not None:
            self._where = seen.position
        elif self._where is None or view.away(self._where) < 1.0 or self._unseen % 5 == 0:
            return {"type": "turn_left", "degrees": 88.0}
        return self._go_up(view)

    def _go_up(self, view: ObservationView) -> Action:
        assert self._where is not None
        if view.away(self._where) <= _SPEAK and self._steps - self._spoke_at >= _AGAIN:
            self._spoke_at = self._steps
            return {"type": "communicate", "text": _OFFER}
        self._skills.pace = _RUN if view.away(self._where) > _SPEAK else _WALK
        step = self._skills.approach(view, self._where, near=_STAND)
        self._skills.pace = _WALK
        return step or {"type": "wait"}


class Escort:
    """Follow a person home, and go inside. Outcomes: ``home``, ``stuck``."""

    def __init__(self, skills: AssistantSkills, person: str, home: Region) -> None:
        self.outcome = ""
        self._skills, self._person, self._home = skills, person, home
        self._last: NDArray[np.float64] | None = None
        self._lost = self._steps = 0

    def state(self) -> AgentState:
        """Return how far it came."""
        last = None if self._last is None else self._last.copy()
        return {"last": last, "lost": self._lost, "steps": self._steps}

    def restore(self, state: AgentState) -> None:
        """Go on."""
        self._last = None if state["last"] is None else np.array(state["last"], np.float64)
        self._lost, self._steps = state["lost"], state["steps"]

    def act(self, view: ObservationView) -> Action | None:
        """Return the next action on the way."""
        self._steps += 1
        if view.place == self._home["place"] or self._steps > 1000:
            self.outcome = "home" if view.place == self._home["place"] else "stuck"
            return None
        seen = person_in_view(view, self._person)
        self._lost = 0 if seen is not None else self._lost + 1
        if seen is not None:
            self._last = seen.position
            return self._keep_up(view, self._last)
        if self._last is not None and self._lost <= _TO_LAST_SEEN and view.away(self._last) > _BEHIND:
            return self._keep_up(view, self._last)
        return self._skills.go_inside(view, str(self._home["place"]))

    def _keep_up(self, view: ObservationView, point: NDArray[np.float64]) -> Action:
        away = view.away(point)
        if away <= _BEHIND:
            return {"type": "look_at", "target": [float(x) for x in point]}
        self._skills.pace = _RUN if away > _RUN_BEYOND else _WALK
        step = self._skills.approach(view, point, near=_BEHIND)
        self._skills.pace = _WALK
        return step or {"type": "wait"}


class Show:
    """Have a thing well in view from near by, as a report asks for. Outcomes: ``shown``, ``lost``.

    Parameters
    ----------
    within
        Farthest distance at which it counts, metres.
    """

    def __init__(self, skills: AssistantSkills, target: Sighting, *, within: float) -> None:
        self.outcome = ""
        self.target = target
        self._skills, self._within = skills, within
        self._try = self._steps = 0
        self._aimed = False

    def state(self) -> AgentState:
        """Return how far it came."""
        return {"target": self.target.state(), "try": self._try, "steps": self._steps, "aimed": self._aimed}

    def restore(self, state: AgentState) -> None:
        """Go on."""
        self.target, self._try = Sighting(**state["target"]), state["try"]
        self._steps, self._aimed = state["steps"], state["aimed"]

    def act(self, view: ObservationView) -> Action | None:
        """Return the next action."""
        seen = next((thing for thing in view.things if thing.entity == self.target.entity), None)
        if seen is not None:
            self.target = seen
            if seen.pixels >= _PIXELS and view.away(seen.position) <= self._within:
                self.outcome = "shown"
                return None
        if self._try >= len(_SHOW_FROM):
            self.outcome = "lost"
            return None
        self._steps += 1
        step = self._skills.approach(view, self.target.position, near=_SHOW_FROM[self._try])
        if step is not None and self._steps <= _SHOWING:
            self._aimed = False
            return step
        if not self._aimed:
            self._aimed = True
            return {"type": "look_at", "target": [float(x) for x in self.target.position]}
        self._aimed, self._steps = False, 0
        self._try += 1
        return {"type": "wait"}


class Report:
    """Report a subtask as done. Outcome: ``reported``."""

    def __init__(self, index: int) -> None:
        self.outcome = ""
        self._index = index
        self._said = False

    def state(self) -> AgentState:
        """Return whether it was said."""
        return {"said": self._said}

    def restore(self, state: AgentState) -> None:
        """Go on."""
        self._said = state["said"]

    def act(self, view: ObservationView) -> Action | None:
        """Return the report; None after it."""
        if self._said:
            self.outcome = "reported"
            return None
        self._said = True
        return {"type": "task_complete", "index": self._index}


class AwaitPerson:
    """Stay until somebody has come in, too. Outcomes: ``came``, ``did not come``."""

    def __init__(self, person: str, patience: int) -> None:
        self.outcome = ""
        self._person, self._patience = person, patience
        self._steps = 0

    def state(self) -> AgentState:
        """Return how long it has waited."""
        return {"steps": self._steps}

    def restore(self, state: AgentState) -> None:
        """Go on."""
        self._steps = state["steps"]

    def act(self, view: ObservationView) -> Action | None:
        """Look about; None once they came, or patience is at its end."""
        self._steps += 1
        if person_in_view(view, self._person) is not None:
            self.outcome = "came"
            return None
        if self._steps > self._patience:
            self.outcome = "did not come"
            return None
        return {"type": "turn_left", "degrees": 88.0}
