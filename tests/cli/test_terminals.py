"""Terminals and pipes as they are: of seven bits, closed, full."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from vico.community import read_community

NAME = "Łódź 東京 🏠"
# A container's bare locale, and a terminal that takes seven bits and nothing else.
SEVEN_BITS = {
    "LC_ALL": "C", "LANG": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "PYTHONIOENCODING": "ascii:strict",
    "TERM": "dumb", "NO_COLOR": "1",
}  # fmt: skip
VICO = f"{sys.executable} -m vico.cli.main"


def told(command: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["bash", "-c", command], capture_output=True, text=True, timeout=120, check=False,
        env={**os.environ, **environment},
    )  # fmt: skip


def printing(folder: Path, line: str) -> str:
    """Return the command of a program whose verb `doctor` does this instead."""
    script = folder / "program.py"
    script.write_text(
        "from vico.cli import main\nfrom vico.cli.console import print_json, print_table\n"
        f"main.app._subcommands['doctor'].target = lambda: {line} or 0\nmain.main(['doctor'])\n",
        encoding="utf-8",
    )
    return f"{sys.executable} {script}"


def test_letters_that_a_terminal_cannot_show_are_replaced(tmp_path: Path) -> None:
    done = told(printing(tmp_path, f"print_table('t', dict(name='{NAME}'))"), **SEVEN_BITS)
    assert (done.returncode, done.stderr) == (0, "")
    assert "??d? ?? ?" in done.stdout


def test_the_c_locale_shows_what_it_can(tmp_path: Path) -> None:
    plain = {key: value for key, value in SEVEN_BITS.items() if key != "PYTHONIOENCODING"}
    done = told(printing(tmp_path, f"print_table('t', dict(name='{NAME}'))"), **plain)
    assert (done.returncode, done.stderr) == (0, "")
    assert "??d? ?? ?" in done.stdout


def test_a_table_with_words_shows_a_long_value_whole_below_it(tmp_path: Path) -> None:
    rows, words = {"steps": 5, "hash": "0123456789abcdef" * 4}, {"steps": "that were made", "hash": "of the state"}
    done = told(printing(tmp_path, f"print_table('t', {rows}, {words})"), COLUMNS="60")
    assert f"hash: {rows['hash']} (of the state)" in done.stdout.splitlines()
    assert "│ steps │ 5 │ that were made │" in done.stdout


def test_json_in_seven_bits_has_whole_names(tmp_path: Path) -> None:
    done = told(printing(tmp_path, f"print_json(dict(name='{NAME}'))"), **SEVEN_BITS)
    assert done.stdout.isascii()
    assert json.loads(done.stdout) == {"name": NAME}


def test_json_where_all_letters_are_shown_is_not_escaped(tmp_path: Path) -> None:
    done = told(printing(tmp_path, f"print_json(dict(name='{NAME}'))"), PYTHONIOENCODING="utf-8")
    assert NAME in done.stdout


def test_help_is_shown_in_seven_bits() -> None:
    done = told(f"{VICO} eval --help", **SEVEN_BITS)
    assert (done.returncode, done.stderr) == (0, "")
    assert "leaderboard" not in done.stdout
    assert "assistant" in done.stdout


def test_a_name_that_is_refused_in_seven_bits_is_one_sentence() -> None:
    done = told(f"{VICO} world info 'w{NAME}'", **SEVEN_BITS)
    assert done.returncode == 2
    assert done.stderr.startswith("vico: w")
    assert done.stderr.endswith(": no such folder; make one with vico world build\n")


def test_people_built_in_seven_bits_have_whole_names(helsinki_path: Path, tmp_path: Path) -> None:
    people = tmp_path / "people"
    done = told(f"{VICO} community build {helsinki_path} --residents 3 --out {people}", **SEVEN_BITS)
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stdout + done.stderr
    text = "".join(path.read_text(encoding="utf-8") for path in people.glob("*.json"))
    assert "\ufffd" not in text
    assert len(read_community(people).residents) == 3


@pytest.mark.parametrize(
    "arguments", ["--version", "--help", "run --help", "world info {world}", "world info {world} --json"]
)
def test_a_closed_pipe_ends_a_command_silently(arguments: str, helsinki_path: Path) -> None:
    done = told(f"{VICO} {arguments.format(world=helsinki_path)} | true; exit ${{PIPESTATUS[0]}}")
    assert done.returncode in (0, 141)
    assert done.stderr == ""


def test_a_sentence_that_nobody_reads_keeps_its_exit_code(tmp_path: Path) -> None:
    assert told(f"{VICO} world info {tmp_path}/none 2>&1 | true; exit ${{PIPESTATUS[0]}}").returncode == 2


def test_a_full_disk_behind_stdout_is_one_sentence(helsinki_path: Path) -> None:
    if not Path("/dev/full").exists():
        pytest.skip("needs /dev/full")
    done = told(f"{VICO} world info {helsinki_path} > /dev/full")
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "the disk is full" in done.stderr


def test_closed_streams_are_no_error(helsinki_path: Path) -> None:
    assert told(f"{VICO} world info {helsinki_path} >&-").returncode == 0
    assert told(f"{VICO} world info {helsinki_path} 2>&- <&-").returncode == 0
