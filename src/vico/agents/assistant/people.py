"""Options about people: meet somebody, follow them home, show a thing to them, report, and ask passers-by.

`Enquiries` asks whoever is about for the people that are looked for, and takes in what they answer.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.agents.assistant.options import Pursuit
from vico.agents.assistant.skills import WALK, Action, AssistantSkills, ObservationView
from vico.agents.base import FieldState
from vico.agents.perception import Sighting
from vico.agents.requester import CALL_DISTANCE, HAND_OVER_DISTANCE, PACE_HOME
from vico.agents.talk.sentences import place_named, whereabouts
from vico.english import split_name
from vico.world.public import PublicMap, PublicPlace

Region = Mapping[str, Any]

PERSON = "resident"
_OFFER = "Hello {}! I am here to help you carry that home. May I take it?"
_SPEAK = CALL_DISTANCE - 3.0  # metres from which one speaks
_STAND = HAND_OVER_DISTANCE - 0.3  # metres at which one stands to be handed something
_ASK_AGAIN = 20  # steps until one asks again
_LOST = 25  # steps out of view after which somebody is given up
_LONGEST = 150  # steps after which one gives up, handed or not
# Who follows keeps behind by so much, runs where it is more than the second, metres, else walks as they do; no longer
# than for so many steps.
_BEHIND, _RUN_BEYOND = 1.7, 2.2
_ESCORT = 700
_STANDS = 0.15  # in a room, metres a step below which somebody stands
_LETS_PASS = 5  # steps that they stand until one lets them pass, and goes out
_ROOM_STEPS = 3  # steps for which one makes room then
_COMES_OUT = 40  # steps for which one waits for them to come out
# ... goes to where the person was last seen for so many steps, then home by the map.
_TO_LAST_SEEN = 8
# So many pixels are shown where 20 are asked for, from these distances, metres, of which the first is tried first.
_PIXELS, _SHOW_FROM = 26, (2.6, 1.6, 1.0)
_SHOWING = 40


def person_in_view(view: ObservationView, name: str) -> Sighting | None:
    """Return somebody by name, if they are in view."""
    return next((seen for seen in view.things if seen.name == name and seen.kind == PERSON), None)


class Meet(FieldState):
    """Go up to a person in view, offer help, and take what they hand over. Outcomes: ``handed``, ``lost``."""

    _pursuit: Pursuit
    _unseen: int = 0
    _steps: int = 0
    _spoke_at: int = -_ASK_AGAIN
    _before: int | None = None

    def __init__(self, skills: AssistantSkills, person: str, count: int, where: NDArray[np.float64] | None) -> None:
        self.outcome = ""
        self._skills, self._person, self._count = skills, person, count
        self._pursuit = Pursuit(skills, where)

    def act(self, view: ObservationView) -> Action | None:
        """Return the next action."""
        held = sum(entity > 0 for entity in view.hands)
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
            self._pursuit.see(view, seen.position)
        return self._go_up(view)

    def _go_up(self, view: ObservationView) -> Action:
        away = self._pursuit.away(view)
        if self._unseen == 0 and away <= _SPEAK and self._steps - self._spoke_at >= _ASK_AGAIN:
            self._spoke_at = self._steps
            return {"type": "communicate", "text": _OFFER.format(split_name(self._person)[1])}
        self._skills.pace = WALK if away > _SPEAK else PACE_HOME
        step = self._pursuit.step(view, near=_STAND)
        self._skills.pace = WALK
        if step is not None and self._unseen % 6 != 5:
            return step
        return {"type": "turn_left", "degrees": 88.0} if self._unseen else {"type": "wait"}


class Escort(FieldState):
    """Follow a person home, and go inside. Outcomes: ``home``, ``stuck``."""

    _pursuit: Pursuit
    _lost: int = 0
    _steps: int = 0
    _still: int = 0
    _ahead: bool = False

    def __init__(self, skills: AssistantSkills, person: str, home: Region) -> None:
        self.outcome = ""
        self._skills, self._person, self._home = skills, person, home
        self._pursuit = Pursuit(skills)

    def _await_outside(self, view: ObservationView, in_view: bool) -> Action:
        """Make room before the door, and look back until they come out."""
        self._still += 1
        if in_view or self._still > _COMES_OUT:
            self._ahead, self._still = False, 0
            return {"type": "wait"}
        if self._still <= _ROOM_STEPS:
            return {"type": "move_forward", "distance": 1.0}
        return {"type": "turn_left", "degrees": 88.0}

    def act(self, view: ObservationView) -> Action | None:
        """Return the next action on the way."""
        self._steps += 1
        if view.place == self._home["place"] or self._steps > _ESCORT:
            self.outcome = "home" if view.place == self._home["place"] else "stuck"
            return None
        seen = person_in_view(view, self._person)
        self._lost = 0 if seen is not None else self._lost + 1
        before = self._pursuit.position
        if seen is not None:
            self._pursuit.see(view, seen.position)
        away = self._pursuit.away(view)
        if view.room is not None:
            stands = seen is not None and before is not None and math.dist(before[:2], seen.position[:2]) < _STANDS
            self._still = self._still + 1 if stands else 0
            # In a room one may be in their way: going ahead opens it, and they come after.
            self._ahead = self._ahead or self._still > _LETS_PASS
            if self._ahead:
                return self._skills.go_inside(view, str(self._home["place"])) or {"type": "wait"}
        elif self._ahead:
            return self._await_outside(view, seen is not None)
        if seen is not None and away <= _BEHIND:
            return {"type": "look_at", "target": [float(x) for x in seen.position]}
        if self._pursuit.position is not None and self._lost <= _TO_LAST_SEEN:
            self._skills.pace = WALK if away > _RUN_BEYOND else PACE_HOME
            step = self._pursuit.step(view, near=_BEHIND)
            self._skills.pace = WALK
            if step is not None:
                return step
        return self._skills.go_inside(view, str(self._home["place"])) or {"type": "wait"}


class Show(FieldState):
    """Have a thing well in view from near by, as a report asks for. Outcomes: ``shown``, ``lost``.

    Parameters
    ----------
    within
        Farthest distance at which it counts, metres.
    """

    target: Sighting
    _try: int = 0
    _steps: int = 0
    _aimed: bool = False

    def __init__(self, skills: AssistantSkills, target: Sighting, *, within: float) -> None:
        self.outcome = ""
        self.target = target
        self._skills, self._within = skills, within

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


class Report(FieldState):
    """Report a subtask as done. Outcome: ``reported``."""

    _said: bool = False

    def __init__(self, index: int) -> None:
        self.outcome = ""
        self._index = index

    def act(self, view: ObservationView) -> Action | None:
        """Return the report; None after it."""
        if self._said:
            self.outcome = "reported"
            return None
        self._said = True
        return {"type": "task_complete", "index": self._index}


class AwaitPerson(FieldState):
    """Stay until somebody has come in, too. Outcomes: ``came``, ``did not come``."""

    _steps: int = 0

    def __init__(self, person: str, patience: int) -> None:
        self.outcome = ""
        self._person, self._patience = person, patience

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


_ASK_DISTANCE = 4.5  # metres within which somebody is asked
_MAX_QUESTIONS = 3  # questions to each, at most
_QUESTION_PAUSE = 2  # steps between two questions
_QUESTION = "Excuse me, have you seen {}?"


class Enquiries(FieldState):
    """Whom one has asked for whom, and what was answered.

    Parameters
    ----------
    public_map
        Knows the places that answers name.
    """

    _asked: dict[str, list[str]]
    _last: int = -_QUESTION_PAUSE
    _step: int = 0
    # By person's name, ids of the places where somebody said that they are, were or usually are.
    places: dict[str, list[str]]

    def __init__(self, public_map: PublicMap) -> None:
        self._map = public_map
        self._asked, self.places = {}, {}

    def listen(self, view: ObservationView, wanted: Mapping[int, str]) -> list[tuple[int, PublicPlace, str]]:
        """Take in what was said; return by subtask where people may be that nobody had said before, and what was said.

        Parameters
        ----------
        wanted
            Names of those who are looked for, by subtask.
        """
        self._step += 1
        found: list[tuple[int, PublicPlace, str]] = []
        for message in view.observation["events"]:
            for k, name in wanted.items():
                # Where somebody lives is known.
                claims = [one for one in whereabouts(str(message["text"]), name) if one.kind != "lives"]
                for claim in claims[:1]:
                    place = place_named(self._map, claim.place) if claim.place else None
                    if place is not None and place.id not in self.places.setdefault(name, []):
                        self.places[name].append(place.id)
                        found.append((k, place, claim.kind))
        return found

    def question(self, view: ObservationView, wanted: Mapping[int, str]) -> Action | None:
        """Return a question for whoever is near, for somebody they were not asked for; None if there is none."""
        if self._step - self._last < _QUESTION_PAUSE:
            return None
        near = next((seen for seen in view.things if self._may_be_asked(seen, view)), None)
        if near is None:
            return None
        asked = self._asked.setdefault(near.name, [])
        name = next(
            (name for name in wanted.values() if name not in asked and person_in_view(view, name) is None), None
        )
        if name is None or len(asked) >= _MAX_QUESTIONS:
            return None
        asked.append(name)
        self._last = self._step
        return {"type": "communicate", "text": _QUESTION.format(name)}

    def _may_be_asked(self, seen: Any, view: ObservationView) -> bool:
        return seen.kind == PERSON and view.away(seen.position) <= _ASK_DISTANCE


def region_of_place(place: PublicPlace) -> dict[str, Any]:
    """Return the region that a place is, as instructions have it."""
    centre = [float(x) for x in place.position]
    return {"kind": "place", "name": place.name, "place": place.id, "centre": centre, "radius": 0.0, "surface": None}
