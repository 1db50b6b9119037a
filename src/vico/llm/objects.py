"""The JSON objects in a text, whole or broken, in the order in which they begin.

Models write comments, commas after the last item and spaces of typography into JSON. Those are mended, as nothing is
lost by it. Anything else that is wrong makes an object a broken one, and it is reported: whatever stands before it in
the text is older than what was meant last.
"""

from __future__ import annotations

import json
import re
from collections import deque
from dataclasses import dataclass

_MOST_OBJECTS = 20
_MOST_MENDED = 12  # each may take a pass over the whole text

_STRING = r'"[^"\\]*+(?:\\.[^"\\]*+)*+"?'
_COMMENT = r"//[^\n]*+|\#[^\n]*+|/\*(?:.*?\*/|.*)"
_LITERALS = {"None": "null", "True": "true", "False": "false"}
_NO_JSON = re.compile(
    rf"(?P<string>{_STRING})|(?P<blank>{_COMMENT}|[^\S \t\r\n]|[\ufeff\u200b])|\b(?P<literal>None|True|False)\b",
    re.DOTALL,
)
_LAST_COMMA = re.compile(rf"(?P<string>{_STRING})|,(?=\s*[}}\]])", re.DOTALL)
# A string that is not closed ends with its line here: quotes may be what is broken.
_BRACE = re.compile(rf'"[^"\\\n]*+(?:\\.[^"\\\n]*+)*+"?|{_COMMENT}|(?P<brace>[{{}}])|(?P<fence>```)', re.DOTALL)
# An object, not braces in words: its end follows, a name in quotes, a bare one with a colon, or the end of the text.
_BEGUN = re.compile(rf"\{{(?:\s|[\ufeff\u200b]|{_COMMENT})*+(?:\}}|\\*[\"'“”‘’]|\w+\s*:|\Z)", re.DOTALL)


@dataclass(frozen=True)
class Found:
    """An object in a text.

    Attributes
    ----------
    start, end
        Where it stands; a broken object that is never closed lasts to the end of the text.
    content
        The object as JSON, mended; empty if it is broken.
    fault
        A sentence on where and how it is broken, or "".
    closed
        JSON of a broken object that lacks its last brace and nothing else, with that brace; or "".
    """

    start: int
    end: int
    content: str
    fault: str = ""
    closed: str = ""


def objects_in(text: str) -> list[Found]:
    """Return the last twenty objects in a text that lie in no other, in order."""
    found: deque[Found] = deque(maxlen=_MOST_OBJECTS)
    decoder = json.JSONDecoder()
    at = text.find("{")
    mended = 0
    while at >= 0:
        end = at + 1
        if _BEGUN.match(text, at):
            try:
                _, end = decoder.raw_decode(text, at)
                found.append(Found(at, end, text[at:end]))
            except (ValueError, RecursionError) as error:
                found.append(_mended(text, at) if mended < _MOST_MENDED else Found(at, len(text), "", _fault(error)))
                end = found[-1].end
                mended += 1
        at = text.find("{", end)
    return list(found)


def is_one_object(text: str) -> bool:
    """Whether a text is an object, mended if need be, and nothing else."""
    found = objects_in(text) if text.startswith("{") else []
    return bool(found) and not found[0].fault and (found[0].start, found[0].end) == (0, len(text))


def _mended(text: str, start: int) -> Found:
    """Return the object that begins in a text, mended; or as a broken one, with all that lies in it."""
    end, depth = _end(text, start)
    # Each mending keeps the length, so that places in the text stay what they are.
    part = _LAST_COMMA.sub(lambda one: one["string"] or " ", _NO_JSON.sub(_as_json, text[start:end]))
    decoder = json.JSONDecoder(strict=False)  # line breaks in strings are taken
    try:
        value, length = decoder.raw_decode(part)
        return Found(start, start + length, json.dumps(value))
    except (ValueError, RecursionError) as error:
        fault = _fault(error, start)
    closed = ""
    last = part.rfind("}") + 1
    if depth == 1 and last and not re.search(r'[",:\[{]', part[last:]):
        try:
            closed = json.dumps(decoder.decode(part[:last] + "}"))
        except (ValueError, RecursionError):
            closed = ""
    return Found(start, end, "", fault, closed)


def _as_json(one: re.Match[str]) -> str:
    if one["string"]:
        return one["string"]
    return _LITERALS[one["literal"]] if one["literal"] else " " * len(one[0])


def _end(text: str, start: int) -> tuple[int, int]:
    """Return where an object's braces are closed, or the text or its fence ends; and how many are open there."""
    depth = 0
    for token in _BRACE.finditer(text, start):
        if token["fence"]:
            return token.start(), depth
        if token["brace"]:
            depth += 1 if token["brace"] == "{" else -1
            if depth == 0:
                return token.end(), 0
    return len(text), depth


def _fault(error: Exception, start: int = 0) -> str:
    where = f"character {start + error.pos}: {error.msg}" if isinstance(error, json.JSONDecodeError) else str(error)
    return f"the JSON object is broken at {where}"[:200]
