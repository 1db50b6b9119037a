"""What the language model's planner remembers beside the book: actions with what came of them, and what was said."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vico.agents.assistant.errands import Book, Choice
from vico.agents.state import AgentState

#: So many actions and lines are told to the model, the latest; more are forgotten.
MOST_ACTIONS, MOST_LINES = 20, 12
#: Longer lines are cut, characters.
LONGEST_LINE = 300


class ActionMemory:
    """Previous actions, each with the time it began, how long it took and its outcome."""

    def __init__(self) -> None:
        self.entries: list[dict[str, Any]] = []
        self._words = ""
        self._since = 0.0
        self._before: AgentState | None = None

    def state(self) -> AgentState:
        """Return all of it."""
        return {
            "entries": [dict(entry) for entry in self.entries],
            "words": self._words,
            "since": self._since,
            "before": self._before,
        }

    def restore(self, state: AgentState) -> None:
        """Remember what `state` returned."""
        self.entries = [dict(entry) for entry in state["entries"]]
        self._words, self._since, self._before = str(state["words"]), float(state["since"]), state["before"]

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
        said.append(_CLOSED[book.category(k)])
    elif choice.kind == "look" and sum(book.looked[k].values()) > sum(before["looked"][str(k)].values()):
        said.append("looked through it and found nothing")
    return "; ".join(said) or _IN_VAIN[choice.kind]


_CLOSED = {
    "carry": "took the things, followed them home and put the things down: done",
    "delivery": "reported as done",
    "search": "found it and reported it: done",
}
_IN_VAIN = {
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
