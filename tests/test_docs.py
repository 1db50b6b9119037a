"""What the documentation shows is true: its Python runs, its commands are taken, its paths are the demo's."""

from __future__ import annotations

import functools
import json
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import redirect_stderr
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from tyro.extras import SubcommandApp

import doc_snippets
from command_line import vico
from doc_snippets import PAGES, ROOT, WORLD_NAMES, commands, inline_commands, lay_out, lost_imports, snippets
from vico.cli.demo import PARTS
from vico.cli.main import app
from vico.cli.run import run

#: Verbs that look at what is there, in seconds: these are run as they are printed.
LOOKING = {("world", "info"), ("check", "world"), ("check", "community"), ("community", "day"), ("motion", "of-run")}
Call = tuple[tuple[str, ...], tuple[Any, ...], Callable[[], Any]]


def _leaves(branch: SubcommandApp, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    for name, spec in branch._subcommands.items():
        if isinstance(spec.target, SubcommandApp):
            yield from _leaves(spec.target, (*path, name))
        else:
            yield (*path, name), spec


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[Call]:
    """What the command line would have called, in order: it parses, and does nothing."""
    calls: list[Call] = []
    for path, spec in _leaves(app):
        monkeypatch.setattr(spec, "target", _noted(path, spec.target, calls))
    return calls


def _noted(path: tuple[str, ...], verb: Callable[..., int], calls: list[Call]) -> Callable[..., int]:
    @functools.wraps(verb)
    def note(*arguments: Any, **options: Any) -> int:
        calls.append((path, (*arguments, *options.values()), lambda: verb(*arguments, **options)))
        return 0

    return note


def _refused(words: list[str]) -> str:
    """Return what the command line says against a command; nothing if it takes it."""
    said = StringIO()
    with redirect_stderr(said):
        return said.getvalue() or "refused" if vico(*words) else ""


@pytest.fixture
def folders(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, helsinki_path: Path, helsinki_people: Path,
    helsinki_run: tuple[Path, dict[str, Any]],
) -> dict[str, Path]:  # fmt: skip
    """What the demo writes, small."""
    return {"world": helsinki_path, "community": helsinki_people, "run": helsinki_run[0]}


def test_the_python_of_the_pages_runs(folders: dict[str, Path], tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, doc_snippets.__file__, str(tmp_path), *map(str, folders.values())],
        capture_output=True, text=True, timeout=900, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == []


def test_what_the_pages_import_is_there_also_where_it_is_not_run() -> None:
    blocks = [block for page in PAGES for block in snippets(page) if block.language == "python"]
    assert {block.where: lost for block in blocks if (lost := lost_imports(block.code))} == {}


def test_few_snippets_are_left_out_and_each_says_why(capsys: pytest.CaptureFixture[str]) -> None:
    blocks = [block for page in PAGES for block in snippets(page) if block.language == "python"]
    left_out = [block for block in blocks if block.not_run]
    with capsys.disabled():
        print(f"\n{len(blocks) - len(left_out)} of {len(blocks)} Python snippets run; the others:")
        for block in left_out:
            print(f"  {block.where}: {block.not_run}")
    assert len(left_out) <= len(blocks) // 2
    assert all(len(block.not_run) > 8 for block in left_out)


def test_the_commands_of_the_pages_are_taken(asked: list[Call]) -> None:
    given = [command for page in PAGES for command in commands(page)]
    assert len(given) > 100
    assert [f"{where}: vico {' '.join(words)}: {said}" for where, words in given if (said := _refused(words))] == []
    assert len(asked) == len(given)


def test_commands_in_sentences_name_verbs_and_options_that_are_there(asked: list[Call]) -> None:
    wrong = []
    for where, words in (command for page in PAGES for command in inline_commands(page)):
        said = re.sub(r"[\s│╭╮╰╯─]+", " ", _refused(words))
        # A sentence may leave out what a command needs; what it says has to be there.
        if said and not re.search(r"[Rr]equired|[Mm]issing", said):
            wrong.append(f"{where}: vico {' '.join(words)}: {said}")
    assert "\n".join(wrong) == ""


def test_commands_that_look_at_the_demo_run_as_printed(
    asked: list[Call], folders: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    known = {*WORLD_NAMES, "out/demo/community", "out/demo/run"}
    ran = []
    monkeypatch.chdir(tmp_path)
    lay_out(tmp_path, **folders)
    for where, words in (command for page in PAGES for command in commands(page)):
        asked.clear()
        if tuple(words[:2]) not in LOOKING or known.isdisjoint(words):
            continue
        assert not _refused(words), where
        assert asked[0][2]() == 0, f"{where}: vico {' '.join(words)}"
        ran.append(where)
    assert len(ran) >= 3


def test_runs_of_the_pages_begin(
    asked: list[Call], folders: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for _, words in (command for page in PAGES for command in commands(page) if command[1][0] == "run"):
        vico(*words)
    begun = [options for _, (options,), _ in asked if options.resume is None]
    assert [options for options in begun if not (options.world and options.community and options.out)] == []
    # What files and agents of one's own, a server and a browser have to say is not here.
    alone = [o for o in begun if not (o.agent or o.live or o.interventions or o.wear or o.talk == "llm")]
    alone = [o for o in alone if not (o.weather + o.events + o.traffic).count(".json")]
    assert len(alone) >= 4
    monkeypatch.chdir(tmp_path)
    for number, options in enumerate(alone):
        small = {
            "world": folders["world"],
            "community": folders["community"],
            "cars": 5 if options.cars is None else min(options.cars, 5),
        }
        assert run(replace(options, **small, out=Path(f"{number}"), steps=1)) == 0


def test_paths_of_the_demo_are_those_that_it_writes() -> None:
    texts = [*PAGES, *sorted((ROOT / "examples").glob("*.py")), *sorted((ROOT / "scripts").glob("*.py"))]
    texts += [*sorted((ROOT / "src").rglob("*.py")), *sorted((ROOT / "benchmarks").glob("*.py"))]
    named = {
        (str(path.relative_to(ROOT)), name)
        for path in texts
        for name in re.findall(r"\bout/demo/(\w+)", path.read_text(encoding="utf-8"))
    }
    assert named
    assert {(path, name) for path, name in named if name not in PARTS} == set()


def test_scripts_that_the_pages_call_take_the_options_that_are_shown() -> None:
    lines = [
        line for page in PAGES for block in snippets(page) for line in block.code.replace("\\\n", " ").splitlines()
    ]
    lines += [
        line for path in sorted((ROOT / "examples").glob("*.py")) for line in path.read_text("utf-8").splitlines()[:12]
    ]
    wrong = []
    for line in lines:
        if called := re.match(
            r"\s*(?:\S*/)?python3? ((?:examples|scripts|benchmarks)/\w+\.py)(.*)", line.split(" # ")[0]
        ):
            # A script may leave an option to a module beside it.
            script = ROOT / called[1]
            source = script.read_text(encoding="utf-8")
            beside = re.findall(r"^from (\w+) import", source, re.MULTILINE)
            source += "".join(p.read_text("utf-8") for one in beside if (p := script.with_name(f"{one}.py")).exists())
            named = set(re.findall(r'"[\w-]+"', source))
            options = re.findall(r"(?<=[\s\[])--[\w-]+", called[2])
            wrong += [
                f"{line.strip()}: no {option}" for option in options if not {f'"{option}"', f'"{option[2:]}"'} & named
            ]
    assert "\n".join(wrong) == ""
