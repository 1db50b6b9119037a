"""Errands: looking for something in a region, fetching, delivering; and planners that choose one after the other.

A `Choice` is one errand for one subtask; an `Errand` carries it out by options, one after the other, to its end. The
`Book` keeps what came of them: what was delivered, reported, looked through and refused. A `ChoicePlanner` decides
again and again what to do next.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from vico.agents.assistant.estimates import Estimates
from vico.agents.assistant.options import GoTo, Option, PickUp, PutDown, Search
from vico.agents.assistant.people import PERSON, AwaitPerson, Escort, Meet, Report, Show
from vico.agents.assistant.skills import Action, AssistantSkills, ObservationView
from vico.agents.base import AgentState, FieldState, Plan
from vico.agents.day_plan import plan_of_errand
from vico.agents.perception import RememberedSighting, Sighting
from vico.seeds import rng
from vico.world.public import PublicMap

Instruction = Mapping[str, Any]
Kind = Literal["look", "fetch", "deliver"]

#: Things that so many attempts did not reach are left.
REFUSALS = 2
#: Times that a region is looked through.
LOOKS = 3
#: Attempts to meet somebody.
MEETINGS = 12
# Who fetches what was seen outdoors walks up to it from so near, metres.
_NEAR_SEEN = 5.0
# How long one waits for somebody who was followed home, steps; how near a found thing is shown from, metres.
_PATIENCE, _SHOW_WITHIN = 5, 4.6


@dataclass(frozen=True)
class Choice:
    """One thing to do next.

    Attributes
    ----------
    kind
        ``look``: go to a region and look for what the subtask is about, and go on with it as far as it goes there.
        ``fetch``: go to where it was seen before. ``deliver``: bring what is in hand to the destination.
    subtask
        Its index.
    region
        Of its sources; -1 where none is meant.
    """

    kind: Kind
    subtask: int
    region: int = -1


class Book(FieldState):
    """What is known of all subtasks.

    Parameters
    ----------
    instructions
        As told.
    """

    closed: set[int]  # subtasks that are reported, or that a colleague does or has done
    looked: dict[int, dict[int, int]]
    refused: dict[str, int]
    picked: dict[str, int]
    put: set[str]

    def __init__(self, instructions: Sequence[Instruction]) -> None:
        self.instructions = {int(one["index"]): dict(one) | {"sources": list(one["sources"])} for one in instructions}
        self.closed, self.put = set(), set()
        self.looked = {k: {} for k in self.instructions}
        self.refused, self.picked = {}, {}

    def add_source(self, k: int, region: Mapping[str, Any]) -> None:
        """Look for a subtask's person in one more region, or once more in one that is known."""
        sources = self.instructions[k]["sources"]
        known = next((r for r, one in enumerate(sources) if one["place"] == region["place"]), None)
        if known is None:
            sources.append(region)
        else:
            self.looked[k].pop(known, None)

    def category(self, k: int) -> str:
        """Return what kind of subtask one is."""
        return str(self.instructions[k]["category"])

    def is_open(self, k: int) -> bool:
        """Whether a subtask is still to do."""
        return k not in self.closed

    def missing_names(self, k: int) -> list[str]:
        """Names of a subtask's things that are still to be found."""
        return [
            n
            for n in self.instructions[k]["objects"]
            if n not in self.picked and n not in self.put and self.refused.get(n, 0) < REFUSALS
        ]

    def in_hand(self, k: int, view: ObservationView) -> list[int]:
        """Entities of a subtask's things that one holds."""
        mine = [self.picked.get(name, 0) for name in self.instructions[k]["objects"]]
        return [entity for entity in view.hands if entity and entity in mine]

    def is_wanted(self, k: int, thing: Sighting | RememberedSighting) -> bool:
        """Whether something seen is what a subtask is about: one of its things, or with Carry its person."""
        if self.category(k) == "carry":
            mine = thing.kind == PERSON and thing.name == self.instructions[k]["person"]["name"]
            return mine and self.refused.get(thing.name, 0) < MEETINGS
        return thing.kind == "object" and thing.name in self.missing_names(k)

    def choices(self, view: ObservationView, seen: Mapping[int, RememberedSighting]) -> list[Choice]:
        """Return everything that makes sense now.

        Parameters
        ----------
        seen
            By subtask, where what it is about was seen.
        """
        found: list[Choice] = []
        for k, told in self.instructions.items():
            if not self.is_open(k):
                continue
            if self.in_hand(k, view):
                found.append(Choice("deliver", k))
            if all(view.hands) and self.category(k) != "search":
                continue
            if self.category(k) != "carry" and not self.missing_names(k):
                continue
            if k in seen:
                found.append(Choice("fetch", k))
            least = min(self.looked[k].get(r, 0) for r in range(len(told["sources"])))
            if least < LOOKS:
                looks = self.looked[k]
                found += [Choice("look", k, r) for r in range(len(told["sources"])) if looks.get(r, 0) == least]
        return found


class Errand:
    """Carries a choice out, and notes in the book what comes of it.

    Attributes
    ----------
    over
        Whether it has come to its end.
    """

    def __init__(
        self, choice: Choice, book: Book, skills: AssistantSkills, seen: RememberedSighting | None = None
    ) -> None:
        self.choice = choice
        self.over = False
        self._book, self._skills, self._seen = book, skills, seen
        self._stage = "go"
        self._target: Sighting | None = None
        self._option: Option | None = None

    def state(self) -> AgentState:
        """Return how far it came; its choice and its book are its owner's to save."""
        seen = self._seen
        return {
            "stage": self._stage,
            "over": self.over,
            "target": None if self._target is None else self._target.state(),
            "option": None if self._option is None else self._option.state(),
            "seen": None
            if seen is None
            else {
                "entity": seen.entity,
                "kind": seen.kind,
                "name": seen.name,
                "position": seen.position.copy(),
                "room": seen.room,
                "time": seen.time,
                "pixels": seen.pixels,
            },
        }

    def restore(self, state: AgentState) -> None:
        """Go on."""
        self._seen = None if state["seen"] is None else RememberedSighting(**state["seen"])
        self._stage, self.over = state["stage"], state["over"]
        self._target = None if state["target"] is None else Sighting(**state["target"])
        self._option = None
        if state["option"] is not None:
            self._option = self._begin()
            self._option.restore(state["option"])

    @property
    def stage(self) -> str:
        """What is being done: go, look, pick, show, meet, follow, put, await or report."""
        return self._stage

    def take(self, thing: Sighting) -> None:
        """Turn to what was seen on the way: pick it up, show it, or meet them."""
        self._target = thing
        self._stage, self._option = {"carry": "meet", "search": "show"}.get(self._category, "pick"), None

    def act(self, view: ObservationView) -> Action | None:
        """Return the next action; None once it is over."""
        for _ in range(8):
            if self.over:
                return None
            if self._option is None:
                self._option = self._begin()
            action = self._option.act(view)
            if action is not None:
                return action
            option, self._option = self._option, None
            self._stage = self._after(option, view)
            self.over = self._stage == "over"
        return {"type": "wait"}

    @property
    def _instruction(self) -> Instruction:
        return self._book.instructions[self.choice.subtask]

    @property
    def _category(self) -> str:
        return self._book.category(self.choice.subtask)

    @property
    def _region(self) -> Mapping[str, Any]:
        """Where to go first."""
        if self.choice.kind == "deliver":
            region: Mapping[str, Any] = self._instruction["destination"]
            return region
        if self._seen is not None:
            place = self._skills.places.get(self._seen.room) or None
            centre = [float(x) for x in self._seen.position]
            kind = "outdoor" if place is None else "place"
            return {"kind": kind, "place": place, "centre": centre, "radius": 3.0, "surface": None}
        source: Mapping[str, Any] = self._instruction["sources"][max(self.choice.region, 0)]
        return source

    def _begin(self) -> Option:
        """Make the option of the stage."""
        told, person, target = self._instruction, str(self._instruction["person"]["name"]), self._target
        k = self.choice.subtask
        if self._stage in ("pick", "show"):
            assert target is not None
            return (
                PickUp(self._skills, target)
                if self._stage == "pick"
                else Show(self._skills, target, within=_SHOW_WITHIN)
            )
        if self._stage == "put":
            mine = frozenset(self._book.picked[n] for n in told["objects"] if n in self._book.picked)
            return PutDown(self._skills, told["destination"], mine if self._category == "delivery" else None)
        makers: dict[str, Callable[[], Option]] = {
            "go": lambda: GoTo(self._skills, self._region, near=_NEAR_SEEN if self._seen is not None else 1.0),
            "look": lambda: Search(
                self._skills, lambda seen: self._book.is_wanted(k, seen), self._region, large=self._category == "carry"
            ),
            "meet": lambda: Meet(
                self._skills, person, len(told["objects"]), None if target is None else target.position
            ),
            "follow": lambda: Escort(self._skills, person, told["destination"]),
            "await": lambda: AwaitPerson(person, _PATIENCE),
            "report": lambda: Report(k),
        }
        return makers[self._stage]()

    def _after(self, option: Option, view: ObservationView) -> str:
        """Return the stage that follows, ``over`` at the end; and write down what came of the last one."""
        if isinstance(option, GoTo):
            return self._after_way(view)
        if isinstance(option, Search):
            return self._after_search(option)
        if isinstance(option, PickUp):
            return self._after_pick(option, view)
        if isinstance(option, Show):
            self._target = option.target
            return "report" if option.outcome == "shown" else self._given_up(option.target.name)
        if isinstance(option, Meet):
            return self._after_meeting(option, view)
        if isinstance(option, Escort):
            return "put"
        if isinstance(option, PutDown):
            return self._after_put(option)
        if isinstance(option, AwaitPerson):
            return self._close_subtask("report" if option.outcome == "came" else "over")
        return self._close_subtask("over")

    def _after_way(self, view: ObservationView) -> str:
        if self.choice.kind == "deliver":
            return "put"
        seen = self._seen
        if seen is None or seen.room != (view.room or ""):
            return "look"
        self.take(Sighting(seen.entity, seen.kind, seen.name, seen.pixels, seen.position))
        return self._stage

    def _after_search(self, search: Search) -> str:
        if search.found is not None:
            self.take(search.found)
            return self._stage
        if self.choice.kind == "look":
            looks = self._book.looked[self.choice.subtask]
            looks[self.choice.region] = looks.get(self.choice.region, 0) + 1
        elif self._seen is not None:
            self._skills.seen.forget(self._seen.entity)
        return "over"

    def _after_pick(self, pick: PickUp, view: ObservationView) -> str:
        name = pick.target.name
        if pick.outcome == "picked":
            self._book.picked[name] = pick.target.entity
            more = self._book.missing_names(self.choice.subtask)
            return "look" if more and not all(view.hands) else "over"
        if pick.outcome == "refused":
            self._book.refused[name] = self._book.refused.get(name, 0) + 1
        return "over"

    def _after_meeting(self, meet: Meet, view: ObservationView) -> str:
        if meet.outcome != "handed":
            return self._given_up(str(self._instruction["person"]["name"]))
        mine = [entity for entity in view.hands if entity and entity not in self._book.picked.values()]
        self._book.picked.update(zip(self._instruction["objects"], mine, strict=False))
        return "follow"

    def _given_up(self, name: str) -> str:
        """Note an attempt in vain, and forget where it was thought to be: it is not to be tried for ever."""
        self._book.refused[name] = self._book.refused.get(name, 0) + 1
        known = self._skills.seen.last_seen(name)
        if known is not None:
            self._skills.seen.forget(known.entity)
        return "over"

    def _after_put(self, put: PutDown) -> str:
        if self._category == "carry":
            if put.outcome == "empty hands":
                for name in self._instruction["objects"]:
                    self._book.picked.pop(name, None)
            return "await"
        k = self.choice.subtask
        if put.outcome == "empty hands":
            for name in self._instruction["objects"]:
                if name in self._book.picked:
                    del self._book.picked[name]
                    self._book.put.add(name)
        return "over" if self._book.missing_names(k) or put.outcome != "empty hands" else "report"

    def _close_subtask(self, stage: str) -> str:
        if stage == "over":
            self._book.closed.add(self.choice.subtask)
        return stage


#: Steps of an episode that planners reckon with; tasks do not say when they end.
EPISODE_SECONDS = 1500
# People who were seen so long ago are somewhere else, seconds.
_FRESH_SIGHTING = 90.0


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
                seen = self.last_sightings(view).get(choice.subtask) if choice.kind == "fetch" else None
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

    def last_sightings(self, view: ObservationView) -> dict[int, RememberedSighting]:
        """Return, by subtask, where what it is about was seen last, if it may still be there."""
        now = float(view.state["time"])
        found: dict[int, RememberedSighting] = {}
        for k, told in self.book.instructions.items():
            if not self.book.is_open(k):
                continue
            names = [told["person"]["name"]] if self.book.category(k) == "carry" else self.book.missing_names(k)
            for name in names:
                thing = self.skills.seen.last_seen(name)
                if thing is None or not self.book.is_wanted(k, thing):
                    continue
                if self.book.category(k) != "carry" or now - thing.time <= _FRESH_SIGHTING:
                    found.setdefault(k, thing)
        return found

    def time_left(self, view: ObservationView) -> float:
        """Seconds to the end of the episode, as far as one knows."""
        assert self.began is not None
        return EPISODE_SECONDS - (float(view.state["time"]) - self.began)
