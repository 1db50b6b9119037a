"""What the benchmarks share: naming the machine, running a child and weighing it, tables and pages in markdown."""

from __future__ import annotations

import argparse
import importlib.metadata
import os
import platform
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from vico.errors import VicoError
from vico.io.files import write_bytes

_VERSIONS = ("numpy", "numba", "mujoco", "shapely")


@dataclass(frozen=True)
class Child:
    """A process that ran to its end."""

    output: str
    seconds: float
    peak_mb: float


def machine() -> str:
    """Name the machine and the versions that decide the figures; no names of folders."""
    model = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        lines = [line for line in info.read_text().splitlines() if line.startswith("model name")]
        model = lines[0].split(":", 1)[1].strip() if lines else model
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9
    versions = ", ".join(f"{name} {importlib.metadata.version(name)}" for name in _VERSIONS)
    return (
        f"Machine: {platform.machine()}, {model}, {os.cpu_count()} processors, {memory:.0f} GB, load "
        f"{os.getloadavg()[0]:.1f} at the start; Python {platform.python_version()}, {versions}."
    )


def vico(*arguments: str, checkout: Path | None = None) -> Child:
    """Run `vico`, or that of another checkout, in a process of its own; its peak memory is that of the process."""
    environment = os.environ if checkout is None else {**os.environ, "PYTHONPATH": str(checkout / "src")}
    began = time.perf_counter()
    process = subprocess.Popen(
        [sys.executable, "-m", "vico.cli.main", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment,
    )
    # Both are small, and stderr is lines only: neither pipe fills before the other is read.
    assert process.stdout is not None
    assert process.stderr is not None
    output, errors = process.stdout.read(), process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        sys.exit(f"vico {' '.join(arguments)}: exit status {process.returncode}\n{errors}")
    peak = usage.ru_maxrss / (1024 if sys.platform != "darwin" else 1024 * 1024)
    return Child(output, time.perf_counter() - began, peak)


def split_options(usual: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return a script's own words, and those after ``--`` that it hands on; `usual` where there is no ``--``."""
    words = sys.argv[1:]
    if "--" not in words:
        return words, list(usual)
    cut = words.index("--")
    return words[:cut], words[cut + 1 :]


def row(name: str, values: Sequence[float], digits: int) -> str:
    """Format a line of a table: median, least and greatest of n measurements."""
    low, high, middle = min(values), max(values), statistics.median(values)
    return f"| {name} | {middle:.{digits}f} | {low:.{digits}f} | {high:.{digits}f} | {len(values)} |"


def publish(lines: Sequence[str], table: Path | None) -> None:
    """Print a report, and write it where it was asked for."""
    text = "\n".join(lines) + "\n"
    print(text)
    if table is not None:
        table.parent.mkdir(parents=True, exist_ok=True)
        table.write_text(text, encoding="utf-8")


def write_page(
    parser: argparse.ArgumentParser, make: Callable[[argparse.Namespace], str], words: Sequence[str] | None = None
) -> int:
    """Write or print a page of what benchmarks/tables.py wrote into a folder; 2 if that can't be read.

    Parameters
    ----------
    parser
        With the script's own options; the folder and ``--page`` are added.
    make
        Makes the page of the options.
    """
    parser.add_argument("out", type=Path, help="folder that benchmarks/tables.py wrote")
    parser.add_argument("--page", type=Path, help="file to write instead of printing it")
    arguments = parser.parse_args(words)
    try:
        text = make(arguments)
        if arguments.page is None:
            print(text)
        else:
            write_bytes(arguments.page, text.encode())
    except VicoError as error:
        print(error, file=sys.stderr)
        return 2
    return 0
