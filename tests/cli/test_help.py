"""Every option of every verb is told in words."""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest

from command_line import vico

# An option or argument whose line goes on with its default at once, without words before it.
_BARE = re.compile(r"[│ ]*(--?[a-z][a-z-]*|[A-Z]+)( [^ ]+)?\s{2,}\((default|required|repeatable)")


def helps(words: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> Iterator[tuple[tuple[str, ...], str]]:
    """Give the help of each verb below some words."""
    assert vico(*words, "--help") == 0
    printed = capsys.readouterr().out
    verbs = re.search(r"\{([a-z0-9,-]+)\}", printed.split("\n\n")[0].replace("\n", ""))
    if "subcommands" in printed and verbs is not None:
        for verb in verbs[1].split(","):
            yield from helps((*words, verb), capsys)
    else:
        yield words, printed


def test_every_option_is_told_in_words(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setenv("COLUMNS", "120")
    found = dict(helps((), capsys))
    assert len(found) > 30
    assert [(words, line) for words, text in found.items() for line in text.splitlines() if _BARE.match(line)] == []
