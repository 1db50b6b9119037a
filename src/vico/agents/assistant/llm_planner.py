"""The LLM planner: a language model chooses what to do next (paper, section "Baselines": modules as in CoELA).

- **Perception**: what pictures showed of what the tasks are about (`SightingMemory`).
- **Memory**: previous actions with what came of them, the progress of each task as the book keeps it, what was said.
- **Planning**: the model is given all that as plain data (`Briefing`) and the numbered actions (`Book.choices`), and
  replies with a number. With distances there are positions, metres and seconds on foot; without, nothing of where
  anything is (the ablation of the paper's appendix on distance modelling).
- **Communication**: of two assistants who are near each other each may say a few lines before it decides. The one with
  the lower number begins. The speaker waits two steps for an answer, and says no more than three lines before it goes
  on with its work. What is heard is data for the model, whoever says it.
- **Execution**: the same errands as all planners have.

Prompts are data (``data/llm/prompts/assistant``). A reply can do nothing but choose one of the available actions, and a
line is only said. Where the model gives nothing of use the planner takes the nearest open choice, its own share of the
tasks first, and notes a fault of the kind ``model``.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict

from vico.agents.assistant.errands import EPISODE_SECONDS, Book, Choice, ChoicePlanner
from vico.agents.assistant.estimates import Estimates
from vico.agents.assistant.skills import Action, AssistantSkills, ObservationView
from vico.agents.base import AgentState, FieldState
from vico.agents.model_access import ModelAccess, episode_tokens, model_from_environment
from vico.agents.perception import RememberedSighting
from vico.clock import DAY, clock_of
from vico.llm import LanguageModel
from vico.llm.prompts import read_prompt
from vico.world.public import PublicMap

PlainData = dict[str, Any]


def clock_text(seconds: float) -> str:
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

    def tasks(self) -> list[PlainData]:
        """Return what is asked."""
        found = []
        for k, told in self._book.instructions.items():
            one: PlainData = {
                "task": k,
                "kind": told["category"],
                "text": told["text"],
                "things": list(told["objects"]),
            }
            one["look_in"] = [region["name"] for region in told["sources"]]
            if told["destination"] is not None:
                one["bring_to"] = told["destination"]["name"]
                surface = told["destination"].get("surface")
                if surface is not None:
                    one["bring_to_the"] = surface["kind"]
            found.append(one)
        return found

    def locations(self, view: ObservationView) -> list[PlainData]:
        """Return every place and spot of the tasks, once."""
        found: dict[tuple[Any, ...], PlainData] = {}
        for told in self._book.instructions.values():
            for region in (*told["sources"], *([told["destination"]] if told["destination"] else [])):
                key = (region["place"], *(round(float(x), 1) for x in region["centre"][:2]))
                if key not in found:
                    kind = "place, indoors" if region["kind"] == "place" else "spot outdoors"
                    found[key] = {"name": region["name"], "kind": kind} | self._way(view, region["centre"], where=True)
        return list(found.values())

    def state(self, view: ObservationView, *, left: float, held: Sequence[str]) -> PlainData:
        """Return how things stand.

        Parameters
        ----------
        left
            Seconds to the end.
        held
            What the hands hold, by hand.
        """
        now = float(view.state["time"])
        one: PlainData = {"time": clock_text(now), "seconds_left": round(left), "where": self._place_named(view.place)}
        if self._estimates.distance:
            one["position"] = _round_point(view.pose[:2])
        one["hands"] = list(held)
        one["seen"] = [self._sighting_fact(view, thing) for thing in self._of_interest()]
        return one

    def actions(
        self, view: ObservationView, choices: Sequence[Choice], seen: Mapping[int, RememberedSighting]
    ) -> list[PlainData]:
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
        what = told["person"]["name"] if category == "carry" else " and the ".join(self._book.missing_names(k))
        what = what if category == "carry" else f"the {what}"
        then = {
            "carry": "offer help, take what they hand over, follow them home and put it down there",
            "delivery": "pick it up",
            "search": "report it",
        }[category]
        if choice.kind == "fetch":
            return f"task {k}: go to where {what} was seen, and {then}"
        return f"task {k}: look for {what} at {told['sources'][choice.region]['name']}, and once found {then}"

    def goal(self, choice: Choice, seen: Mapping[int, RememberedSighting]) -> Sequence[float]:
        """Return where an action begins, ENU metres."""
        told = self._book.instructions[choice.subtask]
        if choice.kind == "deliver":
            return [float(x) for x in told["destination"]["centre"]]
        if choice.kind == "fetch":
            return [float(x) for x in seen[choice.subtask].position]
        return [float(x) for x in told["sources"][max(choice.region, 0)]["centre"]]

    def _way(self, view: ObservationView, goal: Sequence[float], *, where: bool = False) -> PlainData:
        if not self._estimates.distance:
            return {}
        here = [float(x) for x in view.pose[:2]]
        way: PlainData = {"position": _round_point(goal[:2])} if where else {}
        way["metres"] = round(self._estimates.metres(here, goal))
        way["seconds_on_foot"] = round(self._estimates.travel(here, goal))
        return way

    def _of_interest(self) -> list[RememberedSighting]:
        """Return what was seen of what the tasks are about: their things, and who is to be found."""
        names: set[str] = set()
        for k, told in self._book.instructions.items():
            if self._book.is_open(k):
                names |= (
                    {told["person"]["name"]} if self._book.category(k) == "carry" else set(self._book.missing_names(k))
                )
        found = (self._skills.seen.last_seen(name) for name in sorted(names))
        return [thing for thing in found if thing is not None]

    def _sighting_fact(self, view: ObservationView, thing: RememberedSighting) -> PlainData:
        ago = max(round(float(view.state["time"]) - thing.time), 0)
        place = self._skills.places.get(thing.room) if thing.room else None
        one: PlainData = {"what": thing.name, "where": self._place_named(place), "seconds_ago": ago}
        if self._estimates.distance:
            one["position"] = _round_point(thing.position[:2])
        return one

    def _place_named(self, place: str | None) -> str:
        known = self._skills.map.place_by_id.get(place) if place else None
        return "outdoors" if known is None else f"in {known.name}"


def _round_point(point: Any) -> list[float]:
    return [round(float(x), 1) for x in point]


#: So many actions and lines are told to the model, the latest; more are forgotten.
MOST_ACTIONS, MOST_LINES = 20, 12
#: Longer lines are cut, characters.
LONGEST_LINE = 300


class ActionMemory(FieldState):
    """Previous actions, each with the time it began, how long it took and its outcome."""

    entries: list[dict[str, Any]]
    _words: str = ""
    _since: float = 0.0
    _before: AgentState | None = None

    def __init__(self) -> None:
        self.entries = []

    def begin(self, words: str, now: float, book: Book) -> None:
        """Note an action that begins."""
        self._words, self._since, self._before = words, now, book.state()

    def end(self, choice: Choice, clock: str, now: float, book: Book) -> None:
        """Note what came of the action that is under way."""
        if self._before is None:
            return
        self.entries.append(
            {
                "began": clock,
                "seconds": round(now - self._since),
                "action": self._words,
                "outcome": outcome_of(self._before, book, choice),
            }
        )
        del self.entries[:-MOST_ACTIONS]
        self._before = None

    @property
    def since(self) -> float:
        """When the action under way began, seconds of the day."""
        return self._since


class Conversation:
    """Lines that were said and heard, the latest last."""

    def __init__(self) -> None:
        self.lines: list[dict[str, str]] = []

    def add(self, clock: str, speaker: str, text: str) -> None:
        """Note a line; what is no text of one line is made one."""
        shown = "".join(c if c.isprintable() else " " for c in text)
        self.lines.append({"time": clock, "speaker": speaker, "text": " ".join(shown.split())[:LONGEST_LINE]})
        del self.lines[:-MOST_LINES]


def outcome_of(before: Mapping[str, Any], book: Book, choice: Choice) -> str:
    """Say what an action changed in the book.

    Parameters
    ----------
    before
        The book's state when it began.
    """
    k = choice.subtask
    told, was = book.instructions[k], set(before["put"])
    names: list[str] = list(told["objects"])
    picked = [name for name in names if name in book.picked and name not in before["picked"]]
    put = [name for name in names if name in book.put and name not in was]
    refused = [name for name in names if book.refused.get(name, 0) > before["refused"].get(name, 0)]
    said = [f"picked up the {name}" for name in picked]
    said += [f"put down the {name} where it belongs" for name in put]
    said += [f"could not pick up the {name}" for name in refused]
    if k in book.closed and k not in before["closed"]:
        said.append(_DONE_TEXTS[book.category(k)])
    elif choice.kind == "look" and sum(book.looked[k].values()) > sum(before["looked"][str(k)].values()):
        said.append("looked through it and found nothing")
    return "; ".join(said) or _FAILED_TEXTS[choice.kind]


_DONE_TEXTS = {
    "carry": "took the things, followed them home and put the things down: done",
    "delivery": "reported as done",
    "search": "found it and reported it: done",
}
_FAILED_TEXTS = {
    "look": "broke off with nothing to show",
    "fetch": "it was not there any more, or out of reach",
    "deliver": "could not put it down there",
}


def progress_of(book: Book, held: Mapping[int, list[str]]) -> list[dict[str, Any]]:
    """Return how far each subtask has come.

    Parameters
    ----------
    held
        Names of what is in hand, by subtask.
    """
    found = []
    for k, told in book.instructions.items():
        regions, names = told["sources"], list(told["objects"])
        one: dict[str, Any] = {"task": k, "status": "open" if book.is_open(k) else "done"}
        if held.get(k):
            one["in_hand"] = held[k]
        if put := [name for name in names if name in book.put]:
            one["put_down_where_it_belongs"] = put
        if looked := {regions[r]["name"]: n for r, n in book.looked[k].items() if n}:
            one["searched_in_vain"] = looked
        if refused := [name for name in names if name in book.refused]:
            one["could_not_be_picked_up"] = refused
        found.append(one)
    return found


class _Reply(BaseModel):
    model_config = ConfigDict(extra="forbid")


class PlannedAction(_Reply):
    """The number of one of the available actions, and why that one."""

    action: int
    reason: str


class SpokenMessage(_Reply):
    """What is said to the other assistant; null ends the conversation."""

    message: str | None
    reason: str


#: A colleague as near as this can hear, metres.
TALK_DISTANCE = 10.0
_MOST_SAID = 3  # lines that one says before it goes on
_ANSWER_PATIENCE = 2  # steps one waits for an answer, or for the one who begins
_LOOK_AROUND = 4  # turns of the look around
# Where somebody was seen or heard so long ago they may still be, seconds; a line reaches so much farther, metres.
_FRESH_SIGHTING, _TALK_MARGIN = 3.0, 2.0

#: Returns what to say now; None for nothing.
Author = Callable[[], str | None]


class AssistantTalk(FieldState):
    """One assistant's side of the conversation.

    Parameters
    ----------
    name, colleague
        Agents' names; no colleague where empty.
    begins
        Whether it speaks first when they meet for the first time.
    also
        Agents' names of others whose words are remembered.
    """

    _place: list[float] | None = None  # where the colleague was last heard, and when
    _room: str = ""
    _heard_at: float = -np.inf
    _met: bool = False
    _turns: int = 0
    _over: bool = False
    _said: int = 0
    _waited: int = 0
    _answered: bool = True

    def __init__(self, name: str, colleague: str, *, begins: bool, also: Collection[str] = ()) -> None:
        self.name, self.colleague = name, colleague
        self.conversation = Conversation()
        self._begins, self._also = begins, frozenset(also)

    def state(self) -> AgentState:
        """Return what was said, and how far the conversation is."""
        return {"lines": [dict(line) for line in self.conversation.lines], **super().state()}

    def restore(self, state: AgentState) -> None:
        """Go on where `state` was returned."""
        self.conversation.lines = [dict(line) for line in state["lines"]]
        super().restore(state)

    def hear(self, view: ObservationView, clock: str) -> None:
        """Remember what the colleague, and those the tasks are about, said."""
        for message in view.observation["events"]:
            speaker = str(message["speaker"])
            if speaker == self.name or not (speaker == self.colleague or speaker in self._also):
                continue
            self.conversation.add(clock, speaker, str(message["text"]))
            if speaker == self.colleague:
                self._place, self._room = [float(x) for x in message["position"][:2]], view.room or ""
                self._heard_at, self._answered = float(view.state["time"]), True

    def next(self, view: ObservationView, skills: AssistantSkills, clock: str, author: Author) -> Action | None:
        """Return what to do for the conversation's sake before the next decision; None to go on.

        Parameters
        ----------
        author
            Asked for a line where one may speak.
        """
        if not self.colleague or self._over:
            return None
        away = self._away(view, skills)
        if away is None:
            return self._look_around()
        if self._waits():
            self._waited += 1
            return {"type": "wait"}
        text = author() if self._answered and self._said < _MOST_SAID else None
        self._met = True
        if not text:
            self._over = True
            return None
        self.conversation.add(clock, self.name, text)
        said = self.conversation.lines[-1]["text"]
        if not said:
            self._over = True
            return None
        self._said, self._waited, self._answered = self._said + 1, 0, False
        return {"type": "communicate", "text": said, "range": min(TALK_DISTANCE, away + _TALK_MARGIN)}

    def allow_talk(self) -> None:
        """Take note that a decision was made: at the next one they may talk again."""
        self._over = False
        self._said = self._waited = 0
        self._answered = True

    def nearby_colleague(self, view: ObservationView, skills: AssistantSkills) -> Mapping[str, Any] | None:
        """Return how near the colleague is, for the model; None where it is not known to be near."""
        away = self._away(view, skills) if self.colleague else None
        return None if away is None else {"name": self.colleague, "near": True}

    def _look_around(self) -> Action | None:
        """Turn round once at the start, to see who is there."""
        if not self._met and self._turns < _LOOK_AROUND:
            self._turns += 1
            return {"type": "turn_left", "degrees": 88.0}
        self._turns = _LOOK_AROUND
        self._over = True
        return None

    def _waits(self) -> bool:
        lets_begin = not self._met and not self._begins and np.isinf(self._heard_at)
        return (lets_begin or not self._answered) and self._waited < _ANSWER_PATIENCE

    def _away(self, view: ObservationView, skills: AssistantSkills) -> float | None:
        """Metres to the colleague, if it is near and in the same space."""
        now, room = float(view.state["time"]), view.room or ""
        found: list[tuple[float, float]] = []
        seen = skills.seen.last_seen(self.colleague)
        if seen is not None and seen.room == room and now - seen.time <= _FRESH_SIGHTING:
            found.append((seen.time, view.away(seen.position)))
        if self._place is not None and self._room == room and now - self._heard_at <= _FRESH_SIGHTING:
            found.append((self._heard_at, view.away(self._place)))
        if not found:
            return None
        _, away = max(found)
        return away if away <= TALK_DISTANCE else None


log = logging.getLogger(__name__)

#: What is done where the model gives nothing of use.
FALLBACK = "nearest open choice"


class LlmPlanner(ChoicePlanner):
    """Asks a language model at each decision.

    Parameters
    ----------
    model
        Whom to ask; None: the one that the environment names, shared by all planners of the process.

    Raises
    ------
    InputError
        If the environment names no model, or one that can't be used.
    """

    method = "llm"

    def __init__(
        self,
        instructions: list[dict[str, Any]],
        public_map: PublicMap,
        *,
        seed: int,
        number: int = 0,
        of: int = 1,
        distance: bool = True,
        model: LanguageModel | None = None,
    ) -> None:
        super().__init__(instructions, public_map, seed=seed, number=number, of=of, distance=distance)
        self.access = ModelAccess(model or model_from_environment(method=self.method), limit=episode_tokens())
        self.name = f"assistant_{number}"
        colleague = f"assistant_{1 - number}" if of > 1 else ""
        people = [told["person"]["agent"] for told in instructions if told["category"] == "carry"]
        self.talk = AssistantTalk(self.name, colleague, begins=number == 0, also=people)
        self.actions = ActionMemory()
        self._briefing = Briefing(self.book, self.skills, self.estimates)
        self._plan = read_prompt("assistant", "plan_two" if colleague else "plan", PlannedAction)
        self._message = read_prompt("assistant", "message", SpokenMessage)
        self._last: Choice | None = None
        self._instead: Action | None = None  # of a choice, in this step

    @property
    def tokens(self) -> int:
        """Tokens spent."""
        return self.access.tokens

    @property
    def cost(self) -> float:
        """US dollars spent."""
        return self.access.cost

    @property
    def model_faults(self) -> list[tuple[int, str]]:
        """Each time the model was of no use: the step, and why."""
        return self.access.faults

    def state(self) -> AgentState:
        """Return what is under way, and all that is known and was said."""
        last = self._last
        return super().state() | {
            "access": self.access.state(),
            "talk": self.talk.state(),
            "actions": self.actions.state(),
            "last": None if last is None else [last.kind, last.subtask, last.region],
        }

    def restore(self, state: AgentState) -> None:
        """Go on where `state` was returned."""
        super().restore(state)
        self.access.restore(state["access"])
        self.talk.restore(state["talk"])
        self.actions.restore(state["actions"])
        self._last = None
        if state["last"] is not None:
            kind, subtask, region = state["last"]
            self._last = Choice(kind, int(subtask), int(region))

    def notice(self, view: ObservationView) -> None:
        """Take in what is said."""
        self.talk.hear(view, clock_text(float(view.state["time"])))

    def decide(self, view: ObservationView) -> Choice | None:
        """Return what the model chooses; None where something is said first, or nothing is left to do."""
        now = float(view.state["time"])
        if self._last is not None:
            self.actions.end(self._last, clock_text(self.actions.since), now, self.book)
            self._last = None
        seen = self.last_sightings(view)
        choices = self.book.choices(view, seen)
        if not choices:
            return None
        self._instead = self.talk.next(view, self.skills, clock_text(now), lambda: self._line(view))
        if self._instead is not None:
            return None
        choice = self._ask_choice(view, choices, seen)
        self.talk.allow_talk()
        self.actions.begin(self._briefing.words(choice), now, self.book)
        self._last = choice
        return choice

    def idle(self, view: ObservationView) -> Action:
        """Return what the conversation asks for, else wait."""
        action, self._instead = self._instead, None
        return action or {"type": "wait"}

    def _step(self, view: ObservationView) -> int:
        assert self.began is not None
        return round(float(view.state["time"]) - self.began) + 1

    def _ask_choice(
        self, view: ObservationView, choices: list[Choice], seen: Mapping[int, RememberedSighting]
    ) -> Choice:
        """Return the choice of the model; where there is one alone it is not asked."""
        if len(choices) == 1:
            return choices[0]

        def check(reply: PlannedAction) -> list[str]:
            if 1 <= reply.action <= len(choices):
                return []
            return [f"action: {reply.action} is none of the available actions; give a number from 1 to {len(choices)}"]

        told = self._prompt_inputs(view) | {"actions": self._briefing.actions(view, choices, seen)}
        reply = self.access.ask(self._plan, PlannedAction, told, step=self._step(view), check=check)
        if reply is None:
            return self._nearest(view, choices, seen)
        log.debug("%s chooses action %d: %s", self.name, reply.action, reply.reason[:200])
        return choices[reply.action - 1]

    def _nearest(self, view: ObservationView, choices: list[Choice], seen: Mapping[int, RememberedSighting]) -> Choice:
        """Return the nearest choice, of this assistant's share if there is any; the first where all are as near."""
        here = [float(x) for x in view.pose[:2]]
        mine = [choice for choice in choices if choice.subtask in self.mine] or choices
        return min(mine, key=lambda choice: self.estimates.travel(here, self._briefing.goal(choice, seen)))

    def _line(self, view: ObservationView) -> str | None:
        """Return what the model has the assistant say."""
        reply = self.access.ask(self._message, SpokenMessage, self._prompt_inputs(view), step=self._step(view))
        return None if reply is None else reply.message

    def _prompt_inputs(self, view: ObservationView) -> dict[str, Any]:
        """Return the inputs that planning and speaking have in common."""
        assert self.began is not None
        held = self._names_in_hand(view)
        state = self._briefing.state(view, left=self.time_left(view), held=self._hands(view))
        told: dict[str, Any] = {
            "name": self.name,
            "end": clock_text(self.began + EPISODE_SECONDS),
            "tasks": self._briefing.tasks(),
            "locations": self._briefing.locations(view),
            "state": state,
            "progress": progress_of(self.book, held),
            "previous": self.actions.entries,
        }
        if self.talk.colleague:
            state["colleague"] = self.talk.nearby_colleague(view, self.skills) or {
                "name": self.talk.colleague,
                "near": False,
            }
            told |= {"colleague": self.talk.colleague, "conversation": self.talk.conversation.lines}
        return told

    def _names_in_hand(self, view: ObservationView) -> dict[int, list[str]]:
        """Return the names of what is in hand, by subtask."""
        entities = {entity for entity in view.hands if entity}
        return {
            k: names
            for k, told in self.book.instructions.items()
            if (names := [name for name in told["objects"] if self.book.picked.get(name) in entities])
        }

    def _hands(self, view: ObservationView) -> list[str]:
        """Return what each hand holds."""
        names = {entity: name for name, entity in self.book.picked.items()}
        return [names.get(entity, "a thing") if entity else "free" for entity in view.hands]
