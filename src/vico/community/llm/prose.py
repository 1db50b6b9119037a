"""Words that go into a community: what a model wrote is untrusted, as is what maps call their places."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

# Marks of other formats have no business in a life's story, and are how text escapes into something else.
_MARKS = re.compile(r"[<>{}\[\]`\\|]|https?://|www\.", re.IGNORECASE)
_NAME = re.compile(r"[^\W\d_]+(?:[-'’ .]+[^\W\d_]+)*\.?")

#: The longest text of each kind, characters.
MOST = {
    "name": 60, "occupation": 60, "hobby": 60, "trait": 40, "lifestyle": 240, "biography": 1200, "group name": 60,
    "description": 300, "activity": 160, "note": 120,
}  # fmt: skip
_MOST_LABEL = 90


def fault_of(kind: str, text: str) -> str:
    """Say what is wrong with a text of a kind, or return an empty string."""
    if not text.strip():
        return "is empty: write something"
    if len(text) > MOST[kind]:
        return f"has {len(text)} characters: write {MOST[kind]} at most"
    if not text.isprintable():
        return "holds line breaks or control characters: write plain sentences on one line"
    if (mark := _MARKS.search(text)) is not None:
        return f"holds {mark[0]!r}: write plain sentences, without markup or addresses"
    return ""


def faults_of(where: str, kind: str, texts: Sequence[str]) -> list[str]:
    """Say what is wrong with some texts of a kind, a sentence each."""
    faults = [(k, fault_of(kind, text)) for k, text in enumerate(texts)]
    return [f"{where}: {kind} {k + 1 if len(texts) > 1 else ''}".rstrip() + f" {fault}" for k, fault in faults if fault]


def name_fault(name: str) -> str:
    """Say what is wrong with a person's name, or return an empty string."""
    if fault := fault_of("name", name):
        return fault
    if not _NAME.fullmatch(name) or len(name.split()) < 2 or len(name.split()[0]) < 2:
        return "is no first and last name in letters"
    return ""


def label_text(name: str) -> str:
    """Return a name off a map as one line, without control characters, of bounded length."""
    line = " ".join("".join(c if c.isprintable() else " " for c in name).split())
    return line if len(line) <= _MOST_LABEL else f"{line[: _MOST_LABEL - 3].rstrip()}..."


def renamer(names: Sequence[tuple[str, str]]) -> Callable[[str], str]:
    """Return a function that writes people's new first names for their old ones in a text."""
    changed = {old: new for old, new in names if old != new}
    if not changed:
        return lambda text: text
    pattern = re.compile(r"\b(" + "|".join(re.escape(old) for old in sorted(changed, key=len, reverse=True)) + r")\b")
    return lambda text: pattern.sub(lambda match: changed[match[1]], text)
