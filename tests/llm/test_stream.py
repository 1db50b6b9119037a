"""Answers that come as event streams though none was asked for."""

from __future__ import annotations

import json
from typing import Any

import pytest
from pydantic import BaseModel

from http_server import Answer
from llm_server import Script, model_server, says
from vico.errors import SourceError
from vico.llm import Connection, Endpoint, LanguageModel, user


class Person(BaseModel):
    """What is asked for."""

    name: str
    age: int


GOOD = '{"name": "Anna\u2028", "age": 41}'
ANNA = Person(name="Anna\u2028", age=41)
STOP = {"choices": [{"index": 0, "delta": {}, "finish_reason": "stop"}]}


def chunk(**delta: Any) -> dict[str, Any]:
    return {"choices": [{"index": 0, "delta": delta}]}


def called(**function: str) -> dict[str, Any]:
    return chunk(tool_calls=[{"index": 0, "function": function}])


def stream(*chunks: dict[str, Any], end: str = "data: [DONE]\n\n", line: str = "\n") -> Answer:
    text = "".join(f"data: {json.dumps(one, ensure_ascii=False)}\n\n" for one in chunks) + end
    return Answer(200, text.replace("\n", line).encode(), {"Content-Type": "text/event-stream"})


def ask(base: str) -> Person:
    sent = Connection(timeout=5.0, retries=1, sleep=lambda seconds: None)
    return LanguageModel(Endpoint(base, "m"), connection=sent).ask([user("Who?")], Person).value


@pytest.mark.parametrize(
    "answer",
    [
        stream(chunk(role="assistant", content=""), chunk(content=GOOD[:9]), chunk(content=GOOD[9:]), STOP),
        stream(chunk(content=GOOD[:9]), chunk(content=GOOD[9:]), line="\r\n"),
        stream(chunk(content=GOOD), STOP, end=""),
        stream(chunk(reasoning_content="Bea? "), chunk(reasoning_content="No."), chunk(content=GOOD), STOP),
        stream(chunk(content=None, reasoning="So: "), chunk(reasoning=GOOD), STOP),
        stream(called(name="reply", arguments=""), called(arguments=GOOD[:9]), called(arguments=GOOD[9:]), STOP),
        stream(chunk(content=GOOD), STOP, {"choices": [], "usage": {"prompt_tokens": 5, "completion_tokens": 7}}),
    ],
)
def test_a_stream_that_was_not_asked_for_is_read(answer: Answer) -> None:
    with model_server(Script(answer)) as (base, script):
        assert ask(base) == ANNA
    assert len(script.asked) == 1


def test_comments_before_an_answer_are_skipped() -> None:
    commented = b": PROCESSING\n\n: PROCESSING\n\n" + says(GOOD).body
    with model_server(Script(Answer(200, commented, {}))) as (base, _):
        assert ask(base) == ANNA


def test_a_stream_that_breaks_off_is_asked_for_again() -> None:
    broken = stream(chunk(content='{"name": "Bea", "age": 30}'), end='data: {"cho')
    with model_server(Script(broken, stream(chunk(content=GOOD), STOP))) as (base, script):
        assert ask(base) == ANNA
    assert len(script.asked) == 2


def test_an_error_in_a_stream_is_told() -> None:
    failed = stream(chunk(content="{"), {"error": {"message": "upstream is gone", "code": 400}})
    with model_server(Script(failed)) as (base, _), pytest.raises(SourceError, match="upstream is gone"):
        ask(base)
