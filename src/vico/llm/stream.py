"""A completion out of an event stream: some servers stream whatever they are asked."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from typing import Any

_WORDS = ("content", "reasoning_content", "reasoning", "refusal")


def completion_from_stream(text: str) -> tuple[dict[str, Any] | None, bool]:
    """Put the chunks of a stream together.

    Parameters
    ----------
    text
        Server-sent events, each with a chunk of a completion as its data; comments between them are skipped.

    Returns
    -------
    dict, bool
        The completion, or the first chunk with an ``error``, or None if the text is no such stream; and whether the
        stream came to its end.
    """
    message: dict[str, Any] = {}
    calls: dict[Any, dict[str, Any]] = {}
    finish, usage, ended, found = None, None, False, False
    for data in _events(text):
        if data.strip() == "[DONE]":
            ended = True
            break
        try:
            chunk = json.loads(data)
        except (ValueError, RecursionError):
            break  # cut in the middle
        if not isinstance(chunk, dict):
            return None, False
        if chunk.get("error"):
            return chunk, True
        found = True
        usage = chunk.get("usage") or usage
        choices = chunk.get("choices")
        choice = choices[0] if isinstance(choices, list) and choices else None
        if isinstance(choice, dict) and choice.get("index") in (None, 0):
            finish = choice.get("finish_reason") or finish
            delta = choice.get("delta") or choice.get("message") or {"content": choice.get("text")}
            if isinstance(delta, dict):
                _add(message, calls, delta)
    if not found:
        return None, False
    if calls:
        message["tool_calls"] = list(calls.values())
    made = {"choices": [{"index": 0, "message": message, "finish_reason": finish}], "usage": usage}
    return made, ended or finish is not None


def _events(text: str) -> list[str]:
    """Return the data of each event."""
    found: list[str] = []
    for event in re.split(r"\r?\n\r?\n|\r\r", text):
        lines = [line.removeprefix("data:") for line in re.split(r"[\r\n]+", event) if line.startswith("data:")]
        # One chunk a line, as the protocol has it; servers that leave out the blank lines between are read, too.
        found += lines if all(_is_whole(line) for line in lines) else ["\n".join(lines)]
    return found


def _is_whole(data: str) -> bool:
    return data.strip() == "[DONE]" or (data.strip().startswith("{") and data.strip().endswith("}"))


def _add(message: dict[str, Any], calls: dict[Any, dict[str, Any]], delta: Mapping[str, Any]) -> None:
    """Add a chunk's words and calls to what came before."""
    for name in _WORDS:
        more = delta.get(name)
        if isinstance(more, str):
            message[name] = message[name] + more if isinstance(message.get(name), str) else more
        elif isinstance(more, list):
            message[name] = [*message[name], *more] if isinstance(message.get(name), list) else more
    parts = delta.get("tool_calls")
    named = [(part.get("index", 0), part.get("function")) for part in parts or () if isinstance(part, dict)]
    for index, function in [*named, (None, delta.get("function_call"))]:
        if isinstance(function, dict):
            call = calls.setdefault(index, {"function": {"name": "", "arguments": ""}})["function"]
            call["name"] = function.get("name") or call["name"]
            more = function.get("arguments")
            call["arguments"] += more if isinstance(more, str) else json.dumps(more) if isinstance(more, dict) else ""
