"""What a message tells its reader to type can be typed: verbs, options, packages and extras are there."""

from __future__ import annotations

import ast
import re
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
from tyro.extras import SubcommandApp

from command_line import vico
from vico.cli.main import app

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
FILES = sorted((ROOT / "src" / "vico").rglob("*.py"))
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]

# A command: the program, the words after it and their options, up to what ends it in a sentence.
COMMAND = re.compile(r"(?<![\w./-])vico((?: +(?:--)?[a-z][a-z-]*){1,2})([^\n`;:()\"]*)")
OPTION = re.compile(r"(?<=\s)--[a-z][a-z-]*")
PIP = re.compile(r"pip install ((?:--?[a-z-]+ |[a-z]+\.txt )*)('[^']+'|[\w.{}=>\[\]-]+)")
# Sentences about a verb, or about the program.
PROSE = {("eval", "has")}


def literals(file: Path) -> Iterator[tuple[str, str]]:
    """Yield the strings of a file with where they stand; a hole of an f-string is `{}`."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    parts_of_others: set[int] = set()
    for node in ast.walk(tree):
        where = f"{file.relative_to(ROOT)}:{getattr(node, 'lineno', 0)}"
        if isinstance(node, ast.JoinedStr):
            parts_of_others |= {id(part) for part in node.values}
            yield where, "".join(str(part.value) if isinstance(part, ast.Constant) else "{}" for part in node.values)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in parts_of_others:
            yield where, node.value


def texts() -> Iterator[tuple[str, str]]:
    """Yield all that we tell people to read: strings of the program, and its pages."""
    for file in sorted((ROOT / "src" / "vico").rglob("*.py")):
        yield from literals(file)
    for page in (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))):
        lines = page.read_text(encoding="utf-8").splitlines()
        yield from ((f"{page.relative_to(ROOT)}:{number}", line) for number, line in enumerate(lines, start=1))


def verbs_of(group: SubcommandApp, before: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Yield every verb of the command line, as the words to type."""
    for name, command in group._subcommands.items():
        if isinstance(command.target, SubcommandApp):
            yield from verbs_of(command.target, (*before, name))
        else:
            yield (*before, name)


VERBS = set(verbs_of(app))
GROUPS = {words[0] for words in VERBS if len(words) == 2}
TEXTS = list(texts())


def commands() -> Iterator[tuple[str, tuple[str, ...], list[str]]]:
    """Yield the commands that texts name: where, the words after `vico`, and the options."""
    for where, text in TEXTS:
        for found in COMMAND.finditer(text):
            words = tuple(word for word in found[1].split() if not word.startswith("--"))
            marked = text[: found.start()].rstrip().endswith(("`", "type", "type:", "Example:"))
            if words and words[:2] not in PROSE and (marked or words[0] in GROUPS or words[:1] in VERBS):
                yield where, words, OPTION.findall(re.split(r" (?=vico )", found[0])[0])


def test_every_verb_that_is_named_is_there() -> None:
    named = list(commands())
    assert len(named) > 300
    wrong = [
        (where, words)
        for where, words, _ in named
        if words[:2] not in VERBS and words[:1] not in VERBS and not (words[0] in GROUPS and len(words) == 1)
    ]
    assert wrong == []


def test_every_option_that_is_named_is_one_of_its_verb(capsys: pytest.CaptureFixture[str]) -> None:
    @cache
    def options_of(verb: tuple[str, ...]) -> set[str]:
        capsys.readouterr()
        assert vico(*verb, "--help") == 0
        return {*re.findall(r"--[a-z][a-z-]*", capsys.readouterr().out), "--verbose", "--quiet"}

    named = [
        (where, words[:2] if words[:2] in VERBS else words[:1], options)
        for where, words, options in commands()
        if options and (words[:2] in VERBS or words[:1] in VERBS)
    ]
    assert len(named) > 100
    wrong = [
        (where, verb, option) for where, verb, options in named for option in options if option not in options_of(verb)
    ]
    assert wrong == []


def test_every_package_that_is_named_is_one_of_ours_or_of_what_we_need() -> None:
    needed = [*PROJECT["dependencies"], *(one for extra in PROJECT["optional-dependencies"].values() for one in extra)]
    packages = {re.split(r"[\[<>=!~ ]", one)[0].lower() for one in needed}
    extras = set(PROJECT["optional-dependencies"])
    named = [(where, found) for where, text in TEXTS for found in PIP.finditer(text)]
    assert len(named) > 30
    wrong = []
    for where, found in named:
        package, _, rest = found[2].strip("'").partition("[")
        asked = {extra for extra in rest.partition("]")[0].split(",") if extra and extra != "{}"}
        ours = package in (PROJECT["name"], ".", "-e")
        # Our own package comes from a checkout: pip finds what is missing of it, but cannot fetch it anew.
        again = package == PROJECT["name"] and "--force-reinstall" in found[1]
        if (
            again
            or (ours and asked - extras)
            or not (ours or package == "{}" or re.split("[<>={]", package)[0] in {"", *packages})
        ):
            wrong.append((where, found[0]))
    assert wrong == []
