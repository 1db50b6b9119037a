"""A server of chat completions, really listening, whose model says what a test has written down."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from http_server import Answer, Request, serve

KEY = "sk-test-0123456789"


def says(text: str, *, read: int = 100, written: int = 20, finish: str = "stop", **message: Any) -> Answer:
    """A completion."""
    content = {
        "id": "cmpl-1",
        "object": "chat.completion",
        "choices": [
            {"index": 0, "message": {"role": "assistant", "content": text, **message}, "finish_reason": finish}
        ],
        "usage": {"prompt_tokens": read, "completion_tokens": written, "total_tokens": read + written},
    }
    return Answer(200, json.dumps(content).encode(), {"Content-Type": "application/json"})


def refuses(status: int, message: str, **headers: str) -> Answer:
    """An error of the protocol."""
    body = {"error": {"message": message, "type": "invalid_request_error", "param": None, "code": None}}
    names = {name.replace("_", "-"): value for name, value in headers.items()}
    return Answer(status, json.dumps(body).encode(), {"Content-Type": "application/json", **names})


class Script:
    """What the model says, in order; the last is said for ever. `asked` keeps the bodies of all requests."""

    def __init__(self, *answers: Answer | str, formats: bool = True, key: str = "") -> None:
        self.answers = list(answers)
        self.formats, self.key = formats, key
        self.asked: list[dict[str, Any]] = []

    def __call__(self, request: Request) -> Answer:
        """Answer as such a server would."""
        assert (request.method, request.path) == ("POST", "/v1/chat/completions")
        assert request.headers["content-type"] == "application/json"
        if self.key and request.headers.get("authorization") != f"Bearer {self.key}":
            return refuses(401, f"Incorrect API key provided: {request.headers.get('authorization', '')}")
        body = json.loads(request.body)
        self.asked.append(body)
        if "response_format" in body and not self.formats:
            return refuses(400, "'response_format' of type 'json_schema' is not supported")
        answer = self.answers[0] if len(self.answers) == 1 else self.answers.pop(0)
        return says(answer) if isinstance(answer, str) else answer

    def last_words(self, number: int) -> str:
        """The text of the last message of a request."""
        content: str = self.asked[number]["messages"][-1]["content"]
        return content


@contextmanager
def model_server(*answers: Answer | str | Script) -> Iterator[tuple[str, Script]]:
    """Serve a script; gives the base address with ``/v1``, and the script."""
    script = answers[0] if isinstance(answers[0], Script) else Script(*_spoken(answers))
    with serve(script) as base:
        yield f"{base}/v1", script


def _spoken(answers: Sequence[Answer | str | Script]) -> list[Answer | str]:
    return [answer for answer in answers if not isinstance(answer, Script)]
