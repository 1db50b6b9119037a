"""From what a model says to a record of ours: schema out, JSON in, and what is wrong with it in its own words.

A reply is untrusted input: it is parsed as JSON, checked strictly, and nothing in it is ever run.

Models that reason say what they think before they answer, and servers leave it in the text in many forms: tags of many
names, raw channels, a heading. A thought is never the answer, so it is cut before a record is looked for. What is cut
too much is asked for again; what is cut too little could be a wrong record that nobody notices.

Models write comments, commas after the last item and spaces of typography into JSON. Those are mended, as nothing is
lost by it. Anything else that is wrong makes an object a broken one, and it is reported: whatever stands before it in
the text is older than what was meant last.
"""

from __future__ import annotations

import difflib
import json
import re
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from pydantic import BaseModel, ValidationError

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
class JsonObject:
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


def objects_in(text: str) -> list[JsonObject]:
    """Return the last twenty objects in a text that lie in no other, in order."""
    found: deque[JsonObject] = deque(maxlen=_MOST_OBJECTS)
    decoder = json.JSONDecoder()
    at = text.find("{")
    mended = 0
    while at >= 0:
        end = at + 1
        if _BEGUN.match(text, at):
            try:
                _, end = decoder.raw_decode(text, at)
                found.append(JsonObject(at, end, text[at:end]))
            except (ValueError, RecursionError) as error:
                found.append(
                    _mend_object(text, at) if mended < _MOST_MENDED else JsonObject(at, len(text), "", _fault(error))
                )
                end = found[-1].end
                mended += 1
        at = text.find("{", end)
    return list(found)


def is_one_object(text: str) -> bool:
    """Whether a text is an object, mended if need be, and nothing else."""
    found = objects_in(text) if text.startswith("{") else []
    return bool(found) and not found[0].fault and (found[0].start, found[0].end) == (0, len(text))


def _mend_object(text: str, start: int) -> JsonObject:
    """Return the object that begins in a text, mended; or as a broken one, with all that lies in it."""
    end, depth = _end(text, start)
    # Each mending keeps the length, so that places in the text stay what they are.
    part = _LAST_COMMA.sub(lambda one: one["string"] or " ", _NO_JSON.sub(_as_json, text[start:end]))
    decoder = json.JSONDecoder(strict=False)  # line breaks in strings are taken
    try:
        value, length = decoder.raw_decode(part)
        return JsonObject(start, start + length, json.dumps(value))
    except (ValueError, RecursionError) as error:
        fault = _fault(error, start)
    closed = ""
    last = part.rfind("}") + 1
    if depth == 1 and last and not re.search(r'[",:\[{]', part[last:]):
        try:
            closed = json.dumps(decoder.decode(part[:last] + "}"))
        except (ValueError, RecursionError):
            closed = ""
    return JsonObject(start, end, "", fault, closed)


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


_NAMES = (
    r"think(?:ing)?|thoughts?|thought_process|reason(?:ing)?|reasoning_content|reflect(?:ion)?|scratch_?pad|analysis|"
    r"inner_?monologue|(?:internal_?)?monologue|deliberation|chain_of_thought|cot|planning|begin_of_thought|start_thinking"
)
# <think>, </think>, <seed:think>, [THINK], <|START_THINKING|>, <|begin_of_thought|>, ◁think▷
_TAG = re.compile(
    rf"(?:<\|?|\[|◁)\s*(?P<close>/|end_of_|END_OF_|END_)?(?:[a-z]{{2,8}}:)?(?P<name>{_NAMES})(?:\s[^<>\[\]{{}}]{{0,80}})?"
    r"\s*(?:\|?>|\]|▷)",
    re.IGNORECASE,
)
_CHANNEL = re.compile(
    r"(?P<role><\|start\|>[^<]*)?<\|channel\|>\s*(?P<name>\w+)(?P<head>[^<]*)(?:<\|constrain\|>[^<]*)?<\|message\|>",
    re.IGNORECASE,
)
# Whom a message is for: a tool, where it is a call; what a tool says is for the assistant.
_TO_TOOL = re.compile(r"to=(?!assistant)", re.IGNORECASE)
_END_OF_MESSAGE = re.compile(r"<\|(?:end|return|call|start)\|>")
# gpt-oss where a server left out its special tokens.
_BARE_CHANNELS = re.compile(r"^\s*(?:assistant)?\s*analysis(?=[\sA-Z]).*?assistant\s*final", re.DOTALL)
# Granite's headings.
_HEADINGS = re.compile(r"here(?:'s| is) my thought process:.*?here(?:'s| is) my response:", re.DOTALL | re.IGNORECASE)
_ANSWER = re.compile(
    r"<\|?(?P<tag>answer|final_answer|final|response|output|solution|begin_of_solution)\|?>(?P<text>.*?)"
    r"(?:<\|?/?(?:(?P=tag)|end_of_solution)\|?>|\Z)",
    re.DOTALL | re.IGNORECASE,
)


def is_thought(name: str) -> bool:
    """Whether a name is one for thoughts or drafts, not for an answer."""
    return (
        re.fullmatch(rf"(?:{_NAMES}|drafts?|examples?|first_\w+|explanation|rationale)", name, re.IGNORECASE)
        is not None
    )


def without_thoughts(text: str) -> str:
    """Return what a model answers, without what is marked as thought.

    A thought that is opened and never closed lasts to the end; one that is closed and never opened begins with the
    text. Where the answer has a tag of its own, only that is returned.

    Parameters
    ----------
    text
        As it came.

    Returns
    -------
    str
        Empty where all of it is thought.
    """
    if "<|channel|>" in text.lower():
        text = _final_channel(text)
    text = _HEADINGS.sub("", _BARE_CHANNELS.sub("", text))
    text = _strip_tags(text)
    answers = [found["text"] for found in _ANSWER.finditer(text)]
    return answers[-1] if answers and "{" in answers[-1] else text


def _final_channel(text: str) -> str:
    """Return what was said in the last final channel, or as the arguments of a call; empty if there is none."""
    answer = re.sub(r"<\|start\|>[^<]*\Z", "", text[: text.lower().index("<|channel|>")])
    found = list(_CHANNEL.finditer(text))
    for channel in found:
        name, head = channel["name"].lower(), channel["head"]
        if name == "final" or (name == "commentary" and _TO_TOOL.search(f"{channel['role'] or ''} {head}")):
            rest = text[channel.end() :]
            end = _END_OF_MESSAGE.search(rest)
            answer = rest[: end.start()] if end else rest
    return answer


def _strip_tags(text: str) -> str:
    kept: list[str] = []
    depth, at = 0, 0
    for tag in _TAG.finditer(text):
        if tag["close"]:
            if depth == 0:
                kept.clear()  # whatever was said before belongs to a thought whose opening was lost
            depth = max(depth - 1, 0)
        else:
            if depth == 0:
                kept.append(text[at : tag.start()])
            depth += 1
        at = tag.end()
    if depth == 0:
        kept.append(text[at:])
    return "".join(kept)


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


class ParsedReply(Generic[T]):
    """What a reply came to: a record, or findings."""

    def __init__(self, value: T | None, findings: list[str]) -> None:
        self.value, self.findings = value, findings


def schema_of(reply: type[BaseModel]) -> dict[str, Any]:
    """JSON Schema of a record."""
    return reply.model_json_schema(by_alias=True)


def response_format(reply: type[BaseModel]) -> dict[str, Any]:
    """Return the request's ``response_format``; strict where the schema allows it: where all fields have names."""
    schema, strict = _tighten_schema(schema_of(reply))
    name = re.sub(r"[^A-Za-z0-9_-]", "_", reply.__name__.strip("_"))[:60] or "reply"
    return {"type": "json_schema", "json_schema": {"name": name, "schema": schema, "strict": strict}}


def _tighten_schema(schema: Any) -> tuple[Any, bool]:
    """Return a schema in the subset that servers enforce (all properties required, no others), and whether it is."""
    if isinstance(schema, list):
        made = [_tighten_schema(item) for item in schema]
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
            inner = {name: _tighten_schema(one) for name, one in value.items()}
            result[key] = {name: one for name, (one, _) in inner.items()}
            strict = strict and all(fine for _, fine in inner.values())
        else:
            result["anyOf" if key == "oneOf" else key], fine = _tighten_schema(value)
            strict = strict and fine
    if result.get("type") == "object":
        if "properties" in result and result.get("additionalProperties", False) is False:
            result["required"] = list(result["properties"])
            result["additionalProperties"] = False
        else:
            strict = False
    return result, strict and result != {}


def schema_instruction(reply: type[BaseModel]) -> str:
    """Words for a server that can't be given a schema."""
    schema = json.dumps(schema_of(reply), ensure_ascii=False, separators=(",", ":"))
    return f"Reply with one JSON object and nothing else. It has to keep to this JSON Schema:\n{schema}"


def reply_text(message: Mapping[str, Any], finish: str) -> str:
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
        # Some servers put all of an answer among the thoughts: it counts if it ends with a JSON object.
        if isinstance(thoughts, str) and without_thoughts(thoughts).rstrip().removesuffix("```").rstrip().endswith("}"):
            said = thoughts
    return said.encode("utf-8", "replace").decode()  # lone surrogates


def refusal_text(message: Mapping[str, Any]) -> str:
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


def parse_reply(text: str, reply: type[T], check: Check[T] | None) -> ParsedReply[T]:
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
        return ParsedReply(None, [f"the reply has {len(text):,} characters; at most {MOST_CHARACTERS:,} are read"])
    whole = text.strip()
    # A reply that is an object and nothing else has no thoughts around it, whatever words are in it.
    said = text if is_one_object(whole) else without_thoughts(text)
    findings: list[str] = []
    worst = -1
    for one in reversed(objects_in(said)):
        value, wrong = _record_of_call(one.closed, reply, one.fault) if one.fault else _record(one.content, reply)
        if value is not None:
            wrong = list(check(value)) if check is not None else []
            # An object that comes before the answer is a draft: it is not taken where the answer is refused.
            return (
                ParsedReply(None, [one_line(one) for one in wrong[:_MOST_FINDINGS]])
                if wrong
                else ParsedReply(value, [])
            )
        if one.end - one.start > worst:
            worst, findings = one.end - one.start, wrong
        if one.fault:
            break  # so are objects that come before a broken one
    nothing = "the reply holds no JSON object" if said.strip() or not whole else "the reply is thought and no answer"
    return ParsedReply(None, [one_line(one) for one in findings[:_MOST_FINDINGS]] or [nothing])


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
    inner = _open_envelope(content_of) or _beside_thoughts(content_of, reply)
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
    held = [inner for key, one in (answers or others).items() if (inner := _open_envelope({key: one})) is not None]
    return held[0] if len(held) == 1 and (answers or len(others) == 1) else None


def _record_of_call(closed: str, reply: type[T], fault: str) -> tuple[T | None, list[str]]:
    """Return the record that a call holds whose last brace is missing: its arguments are whole."""
    call = json.loads(closed) if closed else {}
    inner = _open_envelope(call) if call.keys() <= _CALL and call.keys() & _ARGUMENTS else None
    return (_plainly(inner, reply)[0] if inner is not None else None), [fault]


def _open_envelope(content: dict[str, Any]) -> str | None:
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
        if missing or not all(_mend_field(changed, one, reply) for one in errors):
            break
        content = json.dumps(changed, ensure_ascii=False)
    return None, findings or []


def _mend_field(content: Any, error: Any, reply: type[BaseModel]) -> bool:
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


def one_line(words: str) -> str:
    """Return a model's words as one line without control characters, fit for an error message."""
    return " ".join("".join(c if c.isprintable() else " " for c in words).split())[:400]
