"""Every text that the package can write into a schedule as an activity: those of its data, and those of its code."""

from __future__ import annotations

import ast
import tomllib
from collections.abc import Iterator
from typing import Any

from vico.io.data_files import PACKAGED

COMMUNITY = PACKAGED / "community"
# Names of fields whose texts are activities, by file; a field that lies in another carries its name too.
FIELDS = {
    "at_home": {"brief", "morning", "breakfast", "lunch", "dinner", "wind_down", "text"},
    "children": {
        "morning", "afternoon", "club", "activity", "bring", "fetch", "bring_home", "at_home", "ready", "dress",
        "breakfast", "lunch", "at_school", "dinner", "wind_down", "text",
    },
    "errands": {"errands"},
    "inclinations": {"activity", "host"},
    "leisure": {"at_home", "out", "activity"},
    "trades": {"task"},
    "ways_of_life": {"at_desk", "at_cafe", "activity"},
}  # fmt: skip
# Modules whose capitalised texts are activities.
WRITERS = ("day", "mode_choice", "outings", "schedules", "schooling", "llm/lives")


def of_data() -> list[str]:
    """Return the activities of the data files, with names filled in."""
    found: dict[str, None] = {}
    for file, fields in FIELDS.items():
        for text in _texts(tomllib.loads((COMMUNITY / f"{file}.toml").read_text(encoding="utf-8")), fields):
            found[text.replace("{names}", "Mia and Ben").replace("{name}", "Bo")] = None
    return list(found)


def _texts(value: Any, fields: set[str], *, taken: bool = False) -> Iterator[str]:
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from _texts(inner, fields, taken=taken or name in fields)
    elif isinstance(value, list):
        for inner in value:
            yield from _texts(inner, fields, taken=taken)
    elif isinstance(value, str) and taken and value[:1].isupper():
        yield value


def of_code() -> list[str]:
    """Return the capitalised texts of the modules that write days, without docstrings; what they fill in is a name."""
    found: dict[str, None] = {}
    for name in WRITERS:
        tree = ast.parse((PACKAGED.parent / "community" / f"{name}.py").read_text(encoding="utf-8"))
        docs = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
        inner = {id(part) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in node.values}
        for node in ast.walk(tree):
            text = ""
            if isinstance(node, ast.JoinedStr):
                text = "".join(str(p.value) if isinstance(p, ast.Constant) else "history" for p in node.values)
            elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docs | inner:
                text = node.value
            if text[:1].isupper() and text[1:2].islower():
                found[text] = None
    return list(found)
