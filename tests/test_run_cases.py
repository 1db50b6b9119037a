"""The script that runs a folder of cases: what it runs, and what it makes of it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[1] / "scripts" / "run_cases.py"


def told(folder: Path, *options: str) -> tuple[int, dict[str, str]]:
    """Run the cases of a folder; return the exit status and the table's rows by case."""
    done = subprocess.run(
        [sys.executable, str(SCRIPT), str(folder), "--out", str(folder.parent / "out"), *options],
        capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert "Traceback" not in done.stderr, done.stderr
    return done.returncode, {line.split()[0]: line for line in done.stdout.splitlines()[1:]}


def case(folder: Path, name: str, script: str, outcome: str) -> None:
    """Write a case."""
    (folder / name).mkdir(parents=True)
    (folder / name / "run.sh").write_text(script)
    (folder / name / "README.md").write_text(f"# {name}\n\n**Right outcome: {outcome}**\nSeen: something else\n")


@pytest.mark.parametrize(
    ("script", "outcome", "verdict"),
    [
        ("echo ok 1; echo ok 2", "`check.py` prints only ok.", "right"),
        ("echo ok 1; echo bad 2", "`check.py` prints only ok.", "wrong: 1 of 2 lines"),
        ("echo LACKS scene", "No line begins with LACKS (or a page says why).", "wrong: 1 of 1 lines"),
        ("echo has scene", "No line begins with LACKS (or a page says why).", "right"),
        ("echo one Anna 41", "Every line gives Anna, 41 (or one sentence).", "right"),
        ("echo one Bea", "Every line gives Anna, 41 (or one sentence).", "read it: 1 of 1 lines lack Anna"),
        ("echo no faults", "'no faults', or a list.", "right"),
        ("echo built", "All of it stands.", "read it"),
        ("echo 'Traceback (most recent call last):'", "'x'", "wrong: a traceback"),
        ("true", "All of it stands.", "wrong: printed nothing"),
        ("echo begun; sleep 30", "All of it stands.", "wrong: ended at its limit"),
    ],
)
def test_a_verdict_follows_from_what_is_said_to_be_right(
    script: str, outcome: str, verdict: str, tmp_path: Path
) -> None:
    case(tmp_path / "cases", "one", script, outcome)
    code, rows = told(tmp_path / "cases", "--limit", "3")
    assert verdict in rows["one"]
    assert code == verdict.startswith("wrong")


def test_cases_that_take_minutes_are_left_out_and_said_to_be(tmp_path: Path) -> None:
    case(tmp_path / "cases", "builds", 'VICO=echo; "$VICO" world build', "'build'")
    code, rows = told(tmp_path / "cases")
    assert code == 0
    assert "not run: takes minutes, --slow runs it" in rows["builds"]
    assert " right " in told(tmp_path / "cases", "--slow")[1]["builds"]


def test_a_quick_look_is_taken_where_there_is_one(tmp_path: Path) -> None:
    script = 'echo looked; [ -n "$QUICK" ] && exit; "$VICO" world build; echo built'
    case(tmp_path / "cases", "long", script, "'looked', and 'built'.")
    assert " right " in told(tmp_path / "cases")[1]["long"]
    assert (tmp_path / "out" / "long" / "log.txt").read_text() == "looked\n"


def test_a_case_is_told_where_to_write_and_what_to_call(tmp_path: Path) -> None:
    case(tmp_path / "cases", "one", 'echo "$OUT"; ls "$PY"; echo "$VICO"', "All of it stands.")
    told(tmp_path / "cases")
    out, python, program = (tmp_path / "out" / "one" / "log.txt").read_text().splitlines()
    assert out == str(tmp_path / "out" / "one")
    assert python == sys.executable
    assert program.endswith("/vico")


def test_only_those_that_are_asked_for_are_run(tmp_path: Path) -> None:
    for name in ("01_a", "02_b", "03_c"):
        case(tmp_path / "cases", name, "echo no faults", "'no faults'.")
    assert set(told(tmp_path / "cases", "--only", "01,03")[1]) == {"01_a", "03_c"}


@pytest.mark.parametrize("options", [[], ["--only", "99"]])
def test_a_folder_without_cases_is_refused(options: list[str], tmp_path: Path) -> None:
    if options:
        case(tmp_path, "01_a", "echo", "'x'")
    assert told(tmp_path, *options) == (2, {})
