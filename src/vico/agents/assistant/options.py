"""What planners choose among: go somewhere, search, pick up, put down, meet a person, follow them home, report.

An option is asked once a step for an action, and answers None when it has come to its `outcome`. All planners share
them, so that tables compare plans and not legs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from vico.agents.assistant.looking import LookAround
from vico.agents.assistant.skills import GRASP, Action, AssistantSkills, ObservationView
from vico.agents.perception import Sighting
from vico.agents.state import AgentState

Region = Mapping[str, Any]

# Steps after which one gives up: going somewhere, walking up to a thing.
_ON_THE_WAY, _WALKING_UP = 500, 60
# From where one tries to pick, metres; and how long one comes no nearer before one gives up, steps.
_NEARER = (GRASP, 0.8, 0.4)
_IN_VAIN = 14
_VIEWS = 4
# Who moved so far, metres, is followed there at once; else not before so many steps after one was stopped.
_AFAR, _HOLD = 6.0, 6


class Option(Protocol):
    """One thing to do."""

    outcome: str

    def act(self, view: ObservationView) -> Action | None:
        """Return the next action; None once `outcome` says what came of it."""

    def state(self) -> AgentState:
        """Return how far it came."""

    def restore(self, state: AgentState) -> None:
        """Go on where another one, made in the same way, was."""


class Pursuit:
    """Going up to something that was seen, or somebody who moves, through the door that they were seen through.

    Attributes
    ----------
    position
        Where it was seen last, ENU metres, shape ``(3,)``; None before.
    """

    def __init__(self, skills: AssistantSkills, position: NDArray[np.float64] | None = None) -> None:
        self.position = position
        self._skills = skills
        self._through = ""
        # What is walked to: it follows the position by strides, so that a way round an obstacle is gone to its end.
        self._goal: NDArray[np.float64] | None = None
        self._holds = 0
        # Views to take in a room that one came into after it, before one walks to where it is thought to be.
        self._views = 0

    def state(self) -> AgentState:
        """Return where it was seen."""
        return {
            "position": None if self.position is None else self.position.copy(),
            "through": self._through,
            "goal": None if self._goal is None else self._goal.copy(),
            "holds": self._holds,
            "views": self._views,
        }

    def restore(self, state: AgentState) -> None:
        """Go on."""
        self.position, self._goal = (
            None if state[name] is None else np.array(state[name], np.float64) for name in ("position", "goal")
        )
        self._through, self._holds, self._views = state["through"], state["holds"], state["views"]

    def see(self, view: ObservationView, position: NDArray[np.float64]) -> None:
        """Take note of where it is now."""
        self.position = position
        self._through = self._skills.door_before(view, position)
        self._views = 0

    def away(self, view: ObservationView) -> float:
        """Metres to where it was seen last; infinite where that is unknown or behind a door."""
        return math.inf if self.position is None or (view.room and self._through) else view.away(self.position)

    def step(self, view: ObservationView, *, near: float) -> Action | None:
        """Return the next action on the way there; None once within `near` metres, or where no way leads nearer."""
        if view.room is not None and self._through == view.room:
            self._views = _VIEWS
        if view.room is None or self._through == view.room:
            self._through = ""
        if self._views > 0:
            self._views -= 1
            return {"type": "turn_left", "degrees": 88.0}
        if self._through:
            action = self._skills.go_through(view, self._through)
            if action is not None:
                return action
            self._through = ""
        return None if self.position is None else self._skills.approach(view, self._aim(view, self.position), near=near)

    def _aim(self, view: ObservationView, position: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what to walk to."""
        self._holds = _HOLD if view.state["action_status"] == "collision" else max(0, self._holds - 1)
        moved = math.inf if self._goal is None else float(np.hypot(*(position - self._goal)[:2]))
        if self._goal is None or moved > _AFAR or (self._holds == 0 and moved > min(_AFAR, 0.3 * view.away(position))):
            self._goal = position
        return self._goal


class GoTo:
    """Go to a region: into the place, or to the middle of the spot outdoors. Outcomes: ``arrived``, ``stuck``."""

    def __init__(self, skills: AssistantSkills, region: Region, *, near: float = 1.0) -> None:
        self.outcome = ""
        self._skills, self._region, self._near = skills, region, near
        self._steps = 0

    def state(self) -> AgentState:
        """Return how far it came."""
        return {"steps": self._steps}

    def restore(self, state: AgentState) -> None:
        """Go on."""
        self._steps = state["steps"]

    def act(self, view: ObservationView) -> Action | None:
        """Return the next action on the way."""
        action = self._skills.go_to(view, self._region, near=self._near)
        self._steps += 1
        if action is None or self._steps > _ON_THE_WAY:
            self.outcome = "arrived" if action is None else "stuck"
            return None
        return action


class Search:
    """Look through a region for something or somebody by name. Outcomes: ``found``, ``nothing``.

    Attributes
    ----------
    found
        What was found.
    """

    def __init__(
        self,
        skills: AssistantSkills,
        wanted: Callable[[Sighting], bool],
        region: Region | None,
        *,
        large: bool = False,
    ) -> None:
        self.outcome = ""
        self.found: Sighting | None = None
        self._look = LookAround(skills, wanted, region, large=large)

    def state(self) -> AgentState:
        """Return what was looked at."""
        return self._look.state()

    def restore(self, state: AgentState) -> None:
        """Go on."""
        self._look.restore(state)

    def act(self, view: ObservationView) -> Action | None:
        """Return the next action of looking about."""
        action = self._look.act(view)
        if action is None:
            self.found = self._look.found
            self.outcome = "found" if self.found is not None else "nothing"
        return action


class WalkUp:
    """Walk up to a thing that was seen. Outcomes: ``arrived``, ``stuck``."""

    def __init__(self, skills: AssistantSkills, target: Sighting, *, near: float = GRASP) -> None:
        self.outcome = ""
        self.target = target
        self._near = near
        self._pursuit = Pursuit(skills, target.position)
        self._nearest = math.inf
        self._steps = self._vain = 0

    def state(self) -> AgentState:
        """Return how far it came."""
        return {
            "target": self.target.state(),
            "pursuit": self._pursuit.state(),
            "nearest": None if math.isinf(self._nearest) else self._nearest,
            "steps": self._steps,
            "vain": self._vain,
        }

    def restore(self, state: AgentState) -> None:
        """Go on."""
        self.target = Sighting(**state["target"])
        self._pursuit.restore(state["pursuit"])
        self._nearest = math.inf if state["nearest"] is None else state["nearest"]
        self._steps, self._vain = state["steps"], state["vain"]

    def act(self, view: ObservationView) -> Action | None:
        """Return the next action on the way."""
        # What is in view again is placed better from nearer.
        seen = next((thing for thing in view.things if thing.entity == self.target.entity), None)
        if seen is not None:
            self.target = seen
            self._pursuit.see(view, seen.position)
        self._steps += 1
        action = self._pursuit.step(view, near=self._near)
        if action is None or self._is_stuck(view):
            self.outcome = "arrived" if action is None else "stuck"
            return None
        return action

    def _is_stuck(self, view: ObservationView) -> bool:
        """Whether it has come no nearer for a while, or takes too long."""
        away = view.away(self.target.position)
        self._vain = 0 if away < self._nearest - 0.2 else self._vain + 1
        self._nearest = min(self._nearest, away)
        return self._vain > _IN_VAIN or self._steps > _WALKING_UP


class PickUp:
    """Pick a thing up, from nearer if that is refused. Outcomes: ``picked``, ``refused``, ``hands full``."""

    def __init__(self, skills: AssistantSkills, target: Sighting) -> None:
        self.outcome = ""
        self.target = target
        self._skills = skills
        self._tries = 0
        self._walk: WalkUp | None = WalkUp(skills, target)
        self._asked = False

    def state(self) -> AgentState:
        """Return how far it came."""
        walk = None if self._walk is None else self._walk.state()
        return {"tries": self._tries, "walk": walk, "asked": self._asked, "target": self.target.state()}

    def restore(self, state: AgentState) -> None:
        """Go on."""
        self._tries, self._asked, self.target = state["tries"], state["asked"], Sighting(**state["target"])
        self._walk = None
        if state["walk"] is not None:
            self._walk = WalkUp(self._skills, self.target, near=_NEARER[self._tries])
            self._walk.restore(state["walk"])

    def act(self, view: ObservationView) -> Action | None:
        """Return the next action."""
        if self._asked:
            self._asked = False
            if self.target.entity in view.held:
                self.outcome = "picked"
                return None
            self._tries += 1
            if self._tries >= len(_NEARER):
                self.outcome = "refused"
                return None
            self._walk = WalkUp(self._skills, self.target, near=_NEARER[self._tries])
        if self._walk is not None:
            action = self._walk.act(view)
            self.target = self._walk.target
            if action is not None:
                return action
            self._walk = None
        if all(view.held):
            self.outcome = "hands full"
            return None
        self._asked = True
        return {"type": "pick", "hand": view.held.index(0), "object": self.target.entity}
