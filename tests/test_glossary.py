"""The glossary names modules that are there, and nothing goes by a word that it retired."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src" / "vico"
PAGE = (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8")


def rows(heading: str) -> list[list[str]]:
    """Return the cells of the first table after a heading, without its own two lines."""
    lines = PAGE[PAGE.index(heading) :].splitlines()
    first = next(k for k, line in enumerate(lines) if line.startswith("|---"))
    found = []
    for line in lines[first + 1 :]:
        if not line.startswith("|"):
            break
        found.append([cell.strip() for cell in line.strip("|").split("|")])
    return found


WORDS, RETIRED = rows("# Glossary"), [row[0] for row in rows("## Retired words")]


def test_every_word_has_a_meaning_and_a_module() -> None:
    assert len(WORDS) >= 60
    for word, meaning, where in WORDS:
        assert word
        assert meaning
        assert (SOURCE / where.strip("`")).exists(), where


def test_words_are_listed_once_and_in_order() -> None:
    listed = [row[0].lower() for row in WORDS]
    assert listed == sorted(set(listed))


@pytest.mark.parametrize("word", RETIRED)
def test_nothing_goes_by_a_retired_word(word: str) -> None:
    called = re.compile(rf"_*{word}", re.IGNORECASE)
    found = []
    for path in SOURCE.rglob("*.py"):
        if called.fullmatch(path.stem):
            found.append(str(path))
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ClassDef | ast.FunctionDef) and called.fullmatch(node.name):
                found.append(f"{path}:{node.lineno}")
    assert found == []
