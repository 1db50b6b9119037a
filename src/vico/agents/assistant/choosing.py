"""Planners that decide again and again what to do next, and carry each choice out by the same errands."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any

from vico.agents.assistant.errands import Book, Choice, Errand
from vico.agents.assistant.estimates import Estimates
from vico.agents.assistant.skills import Action, AssistantSkills, ObservationView
from vico.agents.base import Plan
from vico.agents.navigation.memory import SeenThing
from vico.agents.plans import plan_of_errand
from vico.agents.state import AgentState
from vico.seeds import rng
from vico.world.public import PublicMap

#: Steps of an episode that planners reckon with; tasks do not say when they end.
EPISODE = 1500
# People who were seen so long ago are somewhere else, seconds.
_FRESH = 90.0


class ChoicePlanner(ABC):
    """Decides when nothing is under way.

    Parameters
    ----------
    instructions
        The subtasks, as told.
    number, of
        Which of how many assistants this one is.
    distance
        Whether it reckons with distances.
    """

    #: Names its streams of chance.
    method = ""

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
        self.seed, self.number, self.of = seed, number, of
        self.skills = AssistantSkills(public_map, rng(seed, self.method, "legs", number))
        self.book = Book(instructions)
        self.estimates = Estimates(public_map, instructions, distance=distance)
        self.errand: Errand | None = None
        self.began: float | None = None

    def plan(self, second: float) -> Plan:
        """Return what it is about."""
        choice = None if self.errand is None else self.errand.choice
        told = None if choice is None else self.book.instructions[choice.subtask]
        doing, source = ("", -1) if choice is None else (choice.kind, choice.region)
        return plan_of_errand(told, doing, self.skills.map, self.skills.navigator.walker.way, source=source)

    def state(self) -> AgentState:
        """Return what is under way, and all that is known."""
        errand = self.errand
        return {
            "skills": self.skills.state(),
            "book": self.book.state(),
            "choice": None if errand is None else [errand.choice.kind, errand.choice.subtask, errand.choice.region],
            "errand": None if errand is None else errand.state(),
            "began": self.began,
        }

    def restore(self, state: AgentState) -> None:
        """Go on where `state` was returned."""
        self.skills.restore(state["skills"])
        self.book.restore(state["book"])
        self.began = state["began"]
        self.errand = None
        if state["choice"] is not None:
            kind, subtask, region = state["choice"]
            self.errand = Errand(Choice(kind, int(subtask), int(region)), self.book, self.skills)
            self.errand.restore(state["errand"])

    def act(self, observation: Mapping[str, Any], info: Mapping[str, Any]) -> Action:
        """Return one action for one observation."""
        if info.get("coming_out"):  # of a door: nobody does anything else meanwhile
            return {"type": "wait"}
        view = ObservationView(observation, info)
        if self.began is None:
            self.began = float(view.state["time"])
        self.skills.notice(view)
        said = self.notice(view)
        if said is not None:
            return said
        for _ in range(4):
            if self.errand is None:
                choice = self.decide(view)
                if choice is None:
                    return self.idle(view)
                seen = self.seen(view).get(choice.subtask) if choice.kind == "fetch" else None
                self.errand = Errand(choice, self.book, self.skills, seen)
            action = self.errand.act(view)
            if action is not None:
                return action
            self.errand = None
        return {"type": "wait"}

    @abstractmethod
    def decide(self, view: ObservationView) -> Choice | None:
        """Return what to do next; None for nothing."""

    def notice(self, view: ObservationView) -> Action | None:
        """Take in an observation beside what the skills take in; return an action that comes before all else."""
        return None

    def idle(self, view: ObservationView) -> Action:
        """Return the action of somebody who has nothing to do."""
        return {"type": "wait"}

    @property
    def mine(self) -> list[int]:
        """Subtasks that are this assistant's: every `of`-th."""
        return list(self.book.instructions)[self.number :: self.of]

    def seen(self, view: ObservationView) -> dict[int, SeenThing]:
        """Return, by subtask, where what it is about was seen last, if it may still be there."""
        now = float(view.state["time"])
        found: dict[int, SeenThing] = {}
        for k, told in self.book.instructions.items():
            if not self.book.is_open(k):
                continue
            names = [told["person"]["name"]] if self.book.category(k) == "carry" else self.book.wanted(k)
            for name in names:
                thing = self.skills.seen.last_seen(name)
                if thing is None or not self.book.is_wanted(k, thing):
                    continue
                if self.book.category(k) != "carry" or now - thing.time <= _FRESH:
                    found.setdefault(k, thing)
        return found

    def time_left(self, view: ObservationView) -> float:
        """Seconds to the end of the episode, as far as one knows."""
        assert self.began is not None
        return EPISODE - (float(view.state["time"]) - self.began)
