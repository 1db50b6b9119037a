"""Asking passers-by and whoever is about for the people that are looked for, and taking in what they answer."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vico.agents.assistant.people import PERSON, person_in_view
from vico.agents.assistant.skills import Action, ObservationView
from vico.agents.state import AgentState
from vico.agents.talk.understanding import place_named, whereabouts
from vico.world.public import PublicMap, PublicPlace

# Who is nearer than this is asked, metres; so many questions each, so many steps between two questions.
_NEAR, _QUESTIONS, _PAUSE = 4.5, 3, 2
_QUESTION = "Excuse me, have you seen {}?"


class Enquiries:
    """Whom one has asked for whom, and what was answered.

    Parameters
    ----------
    public_map
        Knows the places that answers name.
    """

    def __init__(self, public_map: PublicMap) -> None:
        self._map = public_map
        self._asked: dict[str, list[str]] = {}
        self._last = -_PAUSE
        self._step = 0
        #: By person's name, ids of the places where somebody said that they are, were or usually are.
        self.places: dict[str, list[str]] = {}

    def state(self) -> AgentState:
        """Return all of it."""
        return {
            "asked": {who: list(names) for who, names in self._asked.items()},
            "last": self._last,
            "step": self._step,
            "places": {who: list(places) for who, places in self.places.items()},
        }

    def restore(self, state: AgentState) -> None:
        """Know what `state` returned."""
        self._asked = {who: list(names) for who, names in state["asked"].items()}
        self._last, self._step = state["last"], state["step"]
        self.places = {who: list(places) for who, places in state["places"].items()}

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
        if self._step - self._last < _PAUSE:
            return None
        near = next((seen for seen in view.things if self._may_be_asked(seen, view)), None)
        if near is None:
            return None
        asked = self._asked.setdefault(near.name, [])
        name = next(
            (name for name in wanted.values() if name not in asked and person_in_view(view, name) is None), None
        )
        if name is None or len(asked) >= _QUESTIONS:
            return None
        asked.append(name)
        self._last = self._step
        return {"type": "communicate", "text": _QUESTION.format(name)}

    def _may_be_asked(self, seen: Any, view: ObservationView) -> bool:
        return seen.kind == PERSON and view.away(seen.position) <= _NEAR


def region_of(place: PublicPlace) -> dict[str, Any]:
    """Return the region that a place is, as instructions have it."""
    centre = [float(x) for x in place.position]
    return {"kind": "place", "name": place.name, "place": place.id, "centre": centre, "radius": 0.0, "surface": None}
