"""What of a model's text is thought, and what is its answer.

Models that reason say what they think before they answer, and servers leave it in the text in many forms: tags of many
names, raw channels, a heading. A thought is never the answer, so it is cut before a record is looked for. What is cut
too much is asked for again; what is cut too little could be a wrong record that nobody notices.
"""

from __future__ import annotations

import re

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
    text = _untagged(text)
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


def _untagged(text: str) -> str:
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


def ends_in_an_object(text: str) -> bool:
    """Whether a text ends with a JSON object: an answer, where a server put all of it among the thoughts."""
    return without_thoughts(text).rstrip().removesuffix("```").rstrip().endswith("}")
