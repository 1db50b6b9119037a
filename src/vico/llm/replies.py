"""From what a model says to a record of ours: schema out, JSON in, and what is wrong with it in its own words.

A reply is untrusted input: it is parsed as JSON, checked strictly, and nothing in it is ever run.
"""

from __future__ import annotations

import difflib
import json
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Generic, TypeVar

from pydantic import BaseModel, ValidationError

from vico.llm.objects import is_one_object, objects_in
from vico.llm.thoughts import ends_in_an_object, is_thought, without_thoughts

T = TypeVar("T", bound=BaseModel)

#: Says what is wrong with a record that is well formed, one sentence each.
Check = Callable[[T], list[str]]

MOST_CHARACTERS = 1 << 20
_MOST_FINDINGS = 12
_MOST_MENDINGS = 3
_NUMERAL = re.compile(r"[-+]?\d{1,15}(?:\.\d{1,15})?")
# Fields of a call of a tool, in the forms that models write as text.
_ARGUMENTS = frozenset({"arguments", "parameters", "input"})
_CALL = _ARGUMENTS | {"name", "type", "id", "function", "tool_name"}
_ANSWER_NAME = re.compile(r"(?:final_?)?(?:answer|result|response|reply|output)|final|data|json", re.IGNORECASE)
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


def said_in(message: Mapping[str, Any], finish: str) -> str:
    """Return what a message of the protocol says, wherever its server puts that.

    Parameters
    ----------
    message
        Of a choice. Its content is text or parts; a server that was given a schema may answer by calling a tool, and
        one that parses thoughts may put the whole answer among them.
    finish
        Why the model stopped: what was cut off among the thoughts is no answer.
    """
    parts = _parts(message)
    said = "".join(part if isinstance(part, str) else str(part.get("text", "")) for part in parts if _is_said(part))
    if isinstance(message.get("content"), dict) and not parts:
        said = json.dumps(message["content"])
    called = "\n".join(_arguments(message, parts))
    if called.strip():
        # Words beside a call count if there is an object in them that fits: the later one of a text is tried first.
        beside = said if is_one_object(said.strip()) else without_thoughts(said)
        said = f"{called}\n{beside}" if "{" in beside else called
    if not said.strip() and finish != "length":
        thoughts = message.get("reasoning_content") or message.get("reasoning") or message.get("thinking")
        if isinstance(thoughts, str) and ends_in_an_object(thoughts):
            said = thoughts
    return said.encode("utf-8", "replace").decode()  # lone surrogates


def refused_in(message: Mapping[str, Any]) -> str:
    """Return the words in which a message refuses, of its own or among its parts; or ""."""
    own = [message.get("refusal"), *(part.get("refusal") for part in _parts(message) if isinstance(part, dict))]
    return " ".join(one for one in own if isinstance(one, str) and one)


def _parts(message: Mapping[str, Any]) -> list[Any]:
    """Return the parts of a message's content; Gemini's own protocol has them under a name of theirs."""
    content = message.get("content")
    if isinstance(content, dict) and content.keys() <= {"parts", "role"}:
        content = content.get("parts")
    if content is None:
        content = message.get("parts")
    return content if isinstance(content, list) else [content] if isinstance(content, str) else []


def _is_said(part: Any) -> bool:
    """Whether a part of a content is what is said: not a thought, a picture or a call."""
    if isinstance(part, str):
        return True
    return isinstance(part, dict) and part.get("type", "text") in ("text", "output_text") and not part.get("thought")


def _arguments(message: Mapping[str, Any], parts: Sequence[Any]) -> list[str]:
    """Return the arguments of all calls of tools in a message, in the forms of OpenAI, Anthropic and Gemini."""
    calls = message.get("tool_calls")
    calls = calls if isinstance(calls, list) else [calls]
    functions = [call.get("function") for call in calls if isinstance(call, dict)] + [message.get("function_call")]
    values = [function.get("arguments") for function in functions if isinstance(function, dict)]
    for part in parts:
        if isinstance(part, dict) and part.get("type") == "tool_use":
            values.append(part.get("input"))
        elif isinstance(part, dict) and isinstance(part.get("functionCall"), dict):
            values.append(part["functionCall"].get("args"))
    return [one if isinstance(one, str) else json.dumps(one) for one in values if isinstance(one, (str, dict))]


def read(text: str, reply: type[T], check: Check[T] | None) -> Read[T]:
    """Read a record out of a reply, whatever is said around it.

    What is marked as thought is cut. Numbers that are written as text, fields that the record does not have, and an
    envelope around it are taken where the meaning is plain; so are comments and needless commas in the JSON.

    Returns
    -------
    Read
        The last JSON object that is such a record, if `check` accepts it and no broken object comes after it; else
        what is wrong: at most twelve findings, each with the path of the field.
    """
    if len(text) > MOST_CHARACTERS:
        return Read(None, [f"the reply has {len(text):,} characters; at most {MOST_CHARACTERS:,} are read"])
    whole = text.strip()
    # A reply that is an object and nothing else has no thoughts around it, whatever words are in it.
    said = text if is_one_object(whole) else without_thoughts(text)
    findings: list[str] = []
    worst = -1
    for one in reversed(objects_in(said)):
        value, wrong = _called(one.closed, reply, one.fault) if one.fault else _record(one.content, reply)
        if value is not None:
            wrong = list(check(value)) if check is not None else []
            # An object that comes before the answer is a draft: it is not taken where the answer is refused.
            return Read(None, [plain(one) for one in wrong[:_MOST_FINDINGS]]) if wrong else Read(value, [])
        if one.end - one.start > worst:
            worst, findings = one.end - one.start, wrong
        if one.fault:
            break  # so are objects that come before a broken one
    nothing = "the reply holds no JSON object" if said.strip() or not whole else "the reply is thought and no answer"
    return Read(None, [plain(one) for one in findings[:_MOST_FINDINGS]] or [nothing])


def _is_json(text: str) -> bool:
    try:
        json.loads(text)
    except (ValueError, RecursionError):
        return False
    return True


def _record(content: str, reply: type[T]) -> tuple[T | None, list[str]]:
    """Return the record that an object is, or holds as its only matter; and what is wrong with the object itself."""
    value, wrong = _plainly(content, reply)
    if value is not None:
        return value, []
    content_of = json.loads(content)
    inner = _enveloped(content_of) or _beside_thoughts(content_of, reply)
    if inner is not None:
        value, _ = _plainly(inner, reply)
    return value, wrong


def _beside_thoughts(content: dict[str, Any], reply: type[BaseModel]) -> str | None:
    """Return the one object in an envelope that has more fields: ``{"reasoning": "...", "answer": {...}}``."""
    own = set(reply.model_fields) | {one.alias for one in reply.model_fields.values() if one.alias}
    if content.keys() & own:
        return None  # a record that is wrong, not one in an envelope
    others = {key: one for key, one in content.items() if not is_thought(key)}
    answers = {key: one for key, one in others.items() if _ANSWER_NAME.fullmatch(key) or key == reply.__name__}
    # A field with another name counts where all the rest are thoughts: a schema that is repeated has an object, too.
    held = [inner for key, one in (answers or others).items() if (inner := _enveloped({key: one})) is not None]
    return held[0] if len(held) == 1 and (answers or len(others) == 1) else None


def _called(closed: str, reply: type[T], fault: str) -> tuple[T | None, list[str]]:
    """Return the record that a call holds whose last brace is missing: its arguments are whole."""
    call = json.loads(closed) if closed else {}
    inner = _enveloped(call) if call.keys() <= _CALL and call.keys() & _ARGUMENTS else None
    return (_plainly(inner, reply)[0] if inner is not None else None), [fault]


def _enveloped(content: dict[str, Any]) -> str | None:
    """Return what an envelope holds: ``{"answer": {...}}``, or a call with its arguments; None if it is none."""
    if content.keys() <= _CALL and (content.keys() & _ARGUMENTS):
        inner = next(content[key] for key in ("arguments", "parameters", "input") if key in content)
    elif len(content) == 1:
        (inner,) = content.values()
    else:
        return None
    if isinstance(inner, list) and len(inner) == 1:
        (inner,) = inner
    if isinstance(inner, str):
        return inner if inner.lstrip().startswith("{") and _is_json(inner) else None
    return json.dumps(inner) if isinstance(inner, dict) else None


def _plainly(content: str, reply: type[T]) -> tuple[T | None, list[str]]:
    """Validate an object strictly, then with what is plainly meant instead of what is wrong."""
    findings: list[str] | None = None
    for _ in range(_MOST_MENDINGS):
        try:
            return reply.model_validate_json(content, strict=True), []
        except ValidationError as error:
            errors = error.errors(include_url=False)
        if findings is None:
            findings = [_finding(one) for one in errors]
        try:
            changed = json.loads(content)
        except (ValueError, RecursionError):
            break
        missing = {str(one["loc"][-1]) for one in errors if one["type"] == "missing" and one["loc"]}
        if missing or not all(_mended(changed, one, reply) for one in errors):
            break
        content = json.dumps(changed, ensure_ascii=False)
    return None, findings or []


def _mended(content: Any, error: Any, reply: type[BaseModel]) -> bool:
    """Put what is plainly meant in place of a field that is wrong; whether that could be done."""
    *way, last = error["loc"] or (None,)
    holder = content
    for step in way:
        try:
            holder = holder[step]
        except (KeyError, IndexError, TypeError):
            return False  # a name of a union's member, which is no part of the content
    try:
        value = holder[last]
    except (KeyError, IndexError, TypeError):
        return False
    if error["type"] == "extra_forbidden" and isinstance(holder, dict):
        # A name that is nearly a field's own may be meant as that: it is asked for again.
        known = [*reply.model_fields, *(name for name in _field_names(reply))]
        if difflib.get_close_matches(str(last), known, n=1, cutoff=0.75):
            return False
        del holder[last]
        return True
    number = _NUMERAL.fullmatch(value.strip()) if isinstance(value, str) else None
    if error["type"] in ("int_type", "float_type") and number is not None:
        holder[last] = float(value) if "." in value else int(value)
        return True
    if error["type"] in ("int_type", "int_from_float") and isinstance(value, float) and value.is_integer():
        holder[last] = int(value)
        return True
    if error["type"] == "bool_type" and isinstance(value, str) and value.strip().lower() in ("true", "false"):
        holder[last] = value.strip().lower() == "true"
        return True
    return False


def _field_names(reply: type[BaseModel]) -> list[str]:
    """Names of all fields in a record and the records in it, as its schema has them."""
    schema = schema_of(reply)
    parts = [schema, *schema.get("$defs", {}).values()]
    return [name for part in parts for name in part.get("properties", {})]


def _finding(error: Any) -> str:
    path = ".".join(str(part) for part in error["loc"]) or "the whole object"
    return f"{path}: {error['msg'].removeprefix('Value error, ')}"


def plain(words: str) -> str:
    """Return a model's words as one line without control characters, fit for an error message."""
    return " ".join("".join(c if c.isprintable() else " " for c in words).split())[:400]
