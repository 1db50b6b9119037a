"""A server whose model plans for assistants: it reads what it is told, and chooses by a rule that a test gives."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from http_server import Answer, Request, serve
from llm_server import says
from vico.llm import Budget, Connection, Endpoint, LanguageModel

_BLOCK = re.compile(r'<data name="(\w+)">\n(.*?)\n</data>', re.DOTALL)

#: Chooses one of the numbered actions, told all that the model is told.
Rule = Callable[[dict[str, Any]], int]


def nearest(told: dict[str, Any]) -> int:
    """The action whose beginning is the shortest walk away."""
    number: int = min(told["actions"], key=lambda one: one["metres"])["action"]
    return number


def last(told: dict[str, Any]) -> int:
    """The last action on the list."""
    return len(told["actions"])


class ScriptedPlanner:
    """Answers planning by a rule, and gives lines in order; null when there are none left.

    Attributes
    ----------
    told
        What each question held, by the names of its blocks; `texts` have the whole of it.
    """

    def __init__(self, rule: Rule = nearest, *, lines: tuple[str | None, ...] = ()) -> None:
        self.rule, self.lines = rule, list(lines)
        self.told: list[dict[str, Any]] = []
        self.texts: list[str] = []

    def __call__(self, request: Request) -> Answer:
        """Answer one question."""
        body = json.loads(request.body)
        text = "\n".join(message["content"] for message in body["messages"])
        told = {name: json.loads(block) for name, block in _BLOCK.findall(text)}
        self.texts.append(text)
        self.told.append(told)
        if "actions" in told:
            return says(json.dumps({"action": self.rule(told), "reason": "by the rule"}))
        line = self.lines.pop(0) if self.lines else None
        return says(json.dumps({"message": line, "reason": "as written"}))


@contextmanager
def planner_server(planner: ScriptedPlanner) -> Iterator[str]:
    """Serve it; gives the base address with ``/v1``."""
    with serve(planner) as base:
        yield f"{base}/v1"


def impatient(base: str, *, budget: Budget | None = None, **options: Any) -> LanguageModel:
    """Return a model at an address, whose failures take no time."""
    connection = Connection(timeout=5.0, retries=1, sleep=lambda seconds: None)
    return LanguageModel(Endpoint(base, "planner"), connection=connection, budget=budget, **options)
