"""Run a folder of cases, each with its README.md and run.sh, and print what came of them as a table.

    python scripts/run_cases.py CASES
    python scripts/run_cases.py CASES --slow --only 04,18 --out out/cases

A case that builds, simulates or exports takes minutes: it is marked and left out without --slow. A run.sh that reads
QUICK is run with QUICK=1 then. The verdict follows from the README's sentence "Right outcome: ..." where that can be
told by a rule (`verdict`); else it is "read it": somebody compares the log with the sentence. Exit 1 if one is wrong.
"""

from __future__ import annotations

import argparse
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
#: Exit status of a case that was ended at its limit, as of timeout(1).
ENDED = 124
#: What a run.sh does that takes minutes, or asks the network.
_LONG = re.compile(
    r"world build|city build|community build|small_world|pip install|"
    r"\"?\$\{?VICO\}?\"? (?:run|doctor|warm-up|export|play|live|view|film|still|eval|demo|bench)\b"
)
_OUTCOME = re.compile(r"Right outcome:\s*(.*?)(?:\*\*|\n\s*\n|\Z)", re.DOTALL)


@dataclass(frozen=True)
class Result:
    """What came of a case."""

    case: str
    exit: int | None
    seconds: float
    verdict: str
    log: Path | None


def is_slow(script: str) -> bool:
    """Whether a run.sh takes minutes."""
    return "QUICK" not in script and _LONG.search(script) is not None


def outcome_of(readme: str) -> str:
    """Return what a README says is right; nothing if it does not."""
    found = _OUTCOME.search(readme)
    return " ".join(found[1].split()) if found else ""


def verdict(outcome: str, log: str, code: int) -> str:
    """Say whether a log shows the right outcome, by what both say in words.

    Parameters
    ----------
    outcome
        The README's sentence. Told by a rule: "prints only WORD", "no line begins with WORD", "every line gives A, B",
        and a quoted text that it begins with. A traceback and a time-out are always wrong.
    log
        What the case printed.
    code
        Its exit status.
    """
    if code == ENDED:
        return "wrong: ended at its limit"
    if "Traceback (most recent call last)" in log:
        return "wrong: a traceback"
    lines = [line for line in log.splitlines() if line.strip()]
    if not lines:
        return "wrong: printed nothing"
    if found := re.search(r"prints only `?(\w+)", outcome):
        return _share(lines, [line.split()[0] == found[1] for line in lines], f"begin with {found[1]}")
    if found := re.search(r"no line begins with `?(\w+)", outcome, re.IGNORECASE):
        return _share(lines, [line.split()[0] != found[1] for line in lines], f"do not begin with {found[1]}")
    if found := re.match(r"every line gives (\w+), (\w+)", outcome, re.IGNORECASE):
        both = [found[1] in line and found[2] in line for line in lines]
        # The rest of the sentence may say which lines are right otherwise.
        return "right" if all(both) else f"read it: {both.count(False)} of {len(both)} lines lack {found[1]}"
    if found := re.match(r"'([^']+)'", outcome):
        return "right" if found[1] in log else f"read it: no {found[1]!r}"
    return "read it"


def _share(lines: Sequence[str], fine: Sequence[bool], what: str) -> str:
    if all(fine):
        return "right"
    return f"wrong: {fine.count(False)} of {len(lines)} lines do not: all should {what}"


def run_case(case: Path, out: Path, *, limit: float, quick: bool) -> Result:
    """Run a case; leave what it printed in `out`."""
    out.mkdir(parents=True, exist_ok=True)
    log = out / "log.txt"
    given = {
        "OUT": str(out),
        "PY": os.environ.get("PY", sys.executable),
        "VICO": os.environ.get("VICO", str(Path(sys.executable).with_name("vico"))),
    }
    began = time.perf_counter()
    with log.open("w", encoding="utf-8") as file:
        process = subprocess.Popen(
            ["bash", str(case / "run.sh")],
            cwd=ROOT, env={**os.environ, **given, **({"QUICK": "1"} if quick else {})},
            stdin=subprocess.DEVNULL, stdout=file, stderr=subprocess.STDOUT, start_new_session=True,
        )  # fmt: skip
        try:
            code = process.wait(limit)
        except subprocess.TimeoutExpired:
            code = ENDED
        finally:
            # Also what it started and left behind, such as a server.
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
    seconds = time.perf_counter() - began
    said = log.read_text(encoding="utf-8", errors="replace")
    outcome = outcome_of((case / "README.md").read_text(encoding="utf-8")) if (case / "README.md").exists() else ""
    return Result(case.name, code, seconds, verdict(outcome, said, code), log)


def table(results: Sequence[Result]) -> str:
    """Return results as columns of text."""
    rows = [("case", "exit", "seconds", "verdict", "log")]
    rows += [
        (
            r.case,
            "-" if r.exit is None else str(r.exit),
            f"{r.seconds:.1f}",
            r.verdict,
            "-" if r.log is None else str(r.log),
        )
        for r in results
    ]
    widths = [max(len(row[k]) for row in rows) for k in range(5)]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows
    )


def main(words: Sequence[str] | None = None) -> int:
    """Run the cases that are asked for; 1 if one is wrong."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", type=Path, help="folder with a folder for each case")
    parser.add_argument("--slow", action="store_true", help="also those that take minutes")
    parser.add_argument("--only", default="", help="beginnings of names, separated by commas; all without")
    parser.add_argument("--out", type=Path, default=Path("out/cases"), help="folder for logs and for what cases make")
    parser.add_argument("--limit", type=float, default=1800.0, help="seconds after which a case is ended")
    asked = parser.parse_args(words)
    wanted = tuple(name.strip() for name in asked.only.split(",") if name.strip())
    found = sorted(path.parent for path in asked.cases.glob("*/run.sh"))
    if not found:
        parser.error(f"{asked.cases}: holds no case; a case is a folder with a run.sh")
    found = [case for case in found if not wanted or case.name.startswith(wanted)]
    if not found:
        parser.error(f"--only {asked.only}: no case begins so")
    results = []
    for case in found:
        script = (case / "run.sh").read_text(encoding="utf-8")
        if is_slow(script) and not asked.slow:
            results.append(Result(case.name, None, 0.0, "not run: takes minutes, --slow runs it", None))
            continue
        sys.stderr.write(f"{case.name}\n")
        quick = "QUICK" in script and not asked.slow
        results.append(run_case(case.resolve(), (asked.out / case.name).resolve(), limit=asked.limit, quick=quick))
    sys.stdout.write(f"{table(results)}\n")
    return 1 if any(result.verdict.startswith("wrong") for result in results) else 0


if __name__ == "__main__":
    sys.exit(main())
