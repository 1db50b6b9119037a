"""From what a model says to a record of ours: schema out, JSON in, and what is wrong with it in its own words.

A reply is untrusted input: it is parsed as JSON, checked strictly, and nothing in it is ever run.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from typing import Any, Generic, TypeVar

from pydantic import BaseModel, ValidationError

T = TypeVar("T", bound=BaseModel)

#: Says what is wrong with a record that is well formed, one sentence each.
Check = Callable[[T], list[str]]

MOST_CHARACTERS = 1 << 20
_MOST_FINDINGS = 12
_MOST_OBJECTS = 20
_MOST_BRACES = 200
# Keywords that services with enforced schemas refuse, or that only describe; the records are checked in full anyway.
_LEFT_OUT = ("title", "default", "examples", "minLength", "maxLength", "uniqueItems", "discriminator")


class Read(Generic[T]):
    """What a reply came to: a record, or findings."""

    def __init__(self, value: T | None, findings: list[str]) -> None:
        self.value, self.findings = value, findings


def schema_of(reply: type[BaseModel]) -> dict[str, Any]:
    """JSON Schema of a record."""
    return reply.model_json_schema(by_alias=True)


def response_format(reply: type[BaseModel]) -> dict[str, Any]:
    """Return the request's ``response_format``; strict where the schema allows it: where all fields have names."""
    schema, strict = _tightened(schema_of(reply))
    name = re.sub(r"[^A-Za-z0-9_-]", "_", reply.__name__.strip("_"))[:60] or "reply"
    return {"type": "json_schema", "json_schema": {"name": name, "schema": schema, "strict": strict}}


def _tightened(schema: Any) -> tuple[Any, bool]:
    """Return a schema in the subset that servers enforce (all properties required, no others), and whether it is."""
    if isinstance(schema, list):
        made = [_tightened(item) for item in schema]
        return [item for item, _ in made], all(strict for _, strict in made)
    if not isinstance(schema, dict):
        return schema, True
    result: dict[str, Any] = {}
    strict = True
    for key, value in schema.items():
        if key in _LEFT_OUT or key.startswith("x-"):
            continue
        if key == "const":
            result["enum"] = [value]
        elif key in ("properties", "$defs"):
            inner = {name: _tightened(one) for name, one in value.items()}
            result[key] = {name: one for name, (one, _) in inner.items()}
            strict = strict and all(fine for _, fine in inner.values())
        else:
            result["anyOf" if key == "oneOf" else key], fine = _tightened(value)
            strict = strict and fine
    if result.get("type") == "object":
        if "properties" in result and result.get("additionalProperties", False) is False:
            result["required"] = list(result["properties"])
            result["additionalProperties"] = False
        else:
            strict = False
    return result, strict and result != {}


def instruction(reply: type[BaseModel]) -> str:
    """Words for a server that can't be given a schema."""
    schema = json.dumps(schema_of(reply), ensure_ascii=False, separators=(",", ":"))
    return f"Reply with one JSON object and nothing else. It has to keep to this JSON Schema:\n{schema}"


def read(text: str, reply: type[T], check: Check[T] | None) -> Read[T]:
    """Read a record out of a reply, whatever is said around it.

    Returns
    -------
    Read
        The first JSON object that is such a record; else what is wrong with the largest there is, at most twelve
        findings, each with the path of the field.
    """
    if len(text) > MOST_CHARACTERS:
        return Read(None, [f"the reply has {len(text):,} characters; at most {MOST_CHARACTERS:,} are read"])
    said = text.rpartition("</think>")[2]
    objects, broken = _objects(said)
    findings: list[str] = []
    worst = -1
    for content in objects:
        try:
            value = reply.model_validate_json(content, strict=True)
        except ValidationError as error:
            wrong = [_finding(one) for one in error.errors(include_url=False, include_input=False)]
        else:
            wrong = list(check(value)) if check is not None else []
            if not wrong:
                return Read(value, [])
        if len(content) > worst:
            worst, findings = len(content), wrong
    if broken is not None and 2 * worst < len(said):
        # What could be read are parts of the broken object, and their faults would lead astray.
        findings = [broken]
    return Read(None, [plain(one) for one in findings[:_MOST_FINDINGS]] or ["the reply holds no JSON object"])


def _finding(error: Any) -> str:
    path = ".".join(str(part) for part in error["loc"]) or "the whole object"
    return f"{path}: {error['msg'].removeprefix('Value error, ')}"


def plain(words: str) -> str:
    """Return a model's words as one line without control characters, fit for an error message."""
    return " ".join("".join(c if c.isprintable() else " " for c in words).split())[:400]


def _objects(text: str) -> tuple[list[str], str | None]:
    """Return the JSON objects in a text that lie in no other, in order; and where the first one breaks, if it does."""
    found: list[str] = []
    broken: str | None = None
    decoder = json.JSONDecoder()
    at = 0
    for _ in range(_MOST_BRACES):
        at = text.find("{", at)
        if at < 0 or len(found) == _MOST_OBJECTS:
            break
        try:
            _, end = decoder.raw_decode(text, at)
        except (ValueError, RecursionError) as error:
            if broken is None and not found:
                where = f"character {error.pos}: {error.msg}" if isinstance(error, json.JSONDecodeError) else str(error)
                broken = f"the JSON object is broken at {where}"[:200]
            at += 1
            continue
        found.append(text[at:end])
        at = end
    return found, broken
