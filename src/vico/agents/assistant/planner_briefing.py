"""What the language model's planner tells its model of a moment, as plain data: tasks, places, state, actions.

With distances there are positions, metres and seconds on foot; without, nothing of where anything is (the ablation of
the paper's appendix on distance modelling).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from vico.agents.assistant.errands import Book, Choice
from vico.agents.assistant.estimates import Estimates
from vico.agents.assistant.skills import AssistantSkills, ObservationView
from vico.agents.navigation.memory import SeenThing
from vico.clock import DAY, clock_of

Plain = dict[str, Any]


def clock(seconds: float) -> str:
    """Return ``HH:MM:SS`` of a second, of whichever day."""
    return clock_of(int(seconds % DAY))


class Briefing:
    """Puts a moment into plain data.

    Parameters
    ----------
    book, skills, estimates
        The planner's.
    """

    def __init__(self, book: Book, skills: AssistantSkills, estimates: Estimates) -> None:
        self._book, self._skills, self._estimates = book, skills, estimates

    def tasks(self) -> list[Plain]:
        """Return what is asked."""
        found = []
        for k, told in self._book.instructions.items():
            one: Plain = {"task": k, "kind": told["category"], "text": told["text"], "things": list(told["objects"])}
            one["look_in"] = [region["name"] for region in told["sources"]]
            if told["destination"] is not None:
                one["bring_to"] = told["destination"]["name"]
                surface = told["destination"].get("surface")
                if surface is not None:
                    one["bring_to_the"] = surface["kind"]
            found.append(one)
        return found

    def locations(self, view: ObservationView) -> list[Plain]:
        """Return every place and spot of the tasks, once."""
        found: dict[tuple[Any, ...], Plain] = {}
        for told in self._book.instructions.values():
            for region in (*told["sources"], *([told["destination"]] if told["destination"] else [])):
                key = (region["place"], *(round(float(x), 1) for x in region["centre"][:2]))
                if key not in found:
                    kind = "place, indoors" if region["kind"] == "place" else "spot outdoors"
                    found[key] = {"name": region["name"], "kind": kind} | self._way(view, region["centre"], where=True)
        return list(found.values())

    def state(self, view: ObservationView, *, left: float, held: Sequence[str]) -> Plain:
        """Return how things stand.

        Parameters
        ----------
        left
            Seconds to the end.
        held
            What the hands hold, by hand.
        """
        now = float(view.state["time"])
        one: Plain = {"time": clock(now), "seconds_left": round(left), "where": self._place_named(view.place)}
        if self._estimates.distance:
            one["position"] = _rounded(view.pose[:2])
        one["hands"] = list(held)
        one["seen"] = [self._seen(view, thing) for thing in self._of_interest()]
        return one

    def actions(self, view: ObservationView, choices: Sequence[Choice], seen: Mapping[int, SeenThing]) -> list[Plain]:
        """Return the available actions, numbered from 1."""
        return [
            {"action": number, "do": self.words(choice)} | self._way(view, self.goal(choice, seen))
            for number, choice in enumerate(choices, 1)
        ]

    def words(self, choice: Choice) -> str:
        """Return an action in words."""
        told, k = self._book.instructions[choice.subtask], choice.subtask
        category = self._book.category(k)
        if choice.kind == "deliver":
            held = " and the ".join(name for name in told["objects"] if name in self._book.picked)
            what = f"the {held}" if held else "what is in hand"
            return f"task {k}: bring {what} to {told['destination']['name']} and put it down there"
        what = told["person"]["name"] if category == "carry" else " and the ".join(self._book.wanted(k))
        what = what if category == "carry" else f"the {what}"
        then = {
            "carry": "offer help, take what they hand over, follow them home and put it down there",
            "delivery": "pick it up",
            "search": "report it",
        }[category]
        if choice.kind == "fetch":
            return f"task {k}: go to where {what} was seen, and {then}"
        return f"task {k}: look for {what} at {told['sources'][choice.region]['name']}, and once found {then}"

    def goal(self, choice: Choice, seen: Mapping[int, SeenThing]) -> Sequence[float]:
        """Return where an action begins, ENU metres."""
        told = self._book.instructions[choice.subtask]
        if choice.kind == "deliver":
            return [float(x) for x in told["destination"]["centre"]]
        if choice.kind == "fetch":
            return [float(x) for x in seen[choice.subtask].position]
        return [float(x) for x in told["sources"][max(choice.region, 0)]["centre"]]

    def _way(self, view: ObservationView, goal: Sequence[float], *, where: bool = False) -> Plain:
        if not self._estimates.distance:
            return {}
        here = [float(x) for x in view.pose[:2]]
        way: Plain = {"position": _rounded(goal[:2])} if where else {}
        way["metres"] = round(self._estimates.metres(here, goal))
        way["seconds_on_foot"] = round(self._estimates.travel(here, goal))
        return way

    def _of_interest(self) -> list[SeenThing]:
        """Return what was seen of what the tasks are about: their things, and who is to be found."""
        names: set[str] = set()
        for k, told in self._book.instructions.items():
            if self._book.is_open(k):
                names |= {told["person"]["name"]} if self._book.category(k) == "carry" else set(self._book.wanted(k))
        found = (self._skills.seen.last_seen(name) for name in sorted(names))
        return [thing for thing in found if thing is not None]

    def _seen(self, view: ObservationView, thing: SeenThing) -> Plain:
        ago = max(round(float(view.state["time"]) - thing.time), 0)
        place = self._skills.places.get(thing.room) if thing.room else None
        one: Plain = {"what": thing.name, "where": self._place_named(place), "seconds_ago": ago}
        if self._estimates.distance:
            one["position"] = _rounded(thing.position[:2])
        return one

    def _place_named(self, place: str | None) -> str:
        known = self._skills.map.place_by_id.get(place) if place else None
        return "outdoors" if known is None else f"in {known.name}"


def _rounded(point: Any) -> list[float]:
    return [round(float(x), 1) for x in point]
