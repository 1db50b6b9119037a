"""What the verbs share: progress bars on stderr, results on stdout."""

from __future__ import annotations

import json
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    SpinnerColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Table

from vico.errors import InputError
from vico.io.files import FolderKind, check_replaceable

Report = Callable[[str, int, int], None]

# The longest time without a line of a stage that is going on, seconds.
_SILENCE = 30.0
# Letters of the longest value that stands in a table beside words.
_SHORT = 20


@contextmanager
def progress_bars() -> Iterator[Report]:
    """Give a function `(stage, done, total)` that keeps one bar a stage on stderr.

    Where stderr is no terminal, a line a stage is written when it is done, and one each tenth of a long one, or each
    half minute where a tenth takes longer. Both say how long the rest takes, at the pace so far. What fails takes its
    bars with it: the sentence that says why stands alone.
    """
    console = Console(file=sys.stderr)
    if not console.is_terminal:
        yield _lines()
        return
    columns = (
        SpinnerColumn(),
        TextColumn("{task.description:<22}"),
        BarColumn(bar_width=20),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        TextColumn("left"),
    )
    with Progress(*columns, console=console, refresh_per_second=4) as progress:
        tasks: dict[str, Any] = {}

        def report(stage: str, done: int, total: int) -> None:
            if stage not in tasks:
                tasks[stage] = progress.add_task(stage, total=max(total, 1))
            progress.update(tasks[stage], completed=done, total=max(total, 1))

        try:
            yield report
        except BaseException:
            progress.live.transient = True
            raise


def _lines() -> Report:
    began: dict[str, tuple[float, int]] = {}
    told: dict[str, tuple[int, float]] = {}

    def report(stage: str, done: int, total: int) -> None:
        now = time.perf_counter()
        # A run that goes on has done some of it before.
        start, first = began.setdefault(stage, (now, done))
        tenth = 10 * done // max(total, 1)
        before, when = told.setdefault(stage, (0, start))
        if (tenth == before or (total < 100 and done < total)) and (now - when < _SILENCE or done >= total):
            return
        told[stage] = tenth, now
        seconds = now - start
        rest = seconds * (total - done) / (done - first) if done > first else 0.0
        left = f", {duration(rest)} left" if rest else ""
        print(f"{stage:<22} {done}/{total}  {seconds:.1f} s{left}", file=sys.stderr, flush=True)

    return report


def duration(seconds: float) -> str:
    """Return a time in two units at most, as people say it: 45 s, 12 min, 2 h 5 min."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 60 else f"{minutes // 60} h {minutes % 60} min"


def check_output(out: Path, *inputs: Path, force: bool, kind: FolderKind | None = None) -> None:
    """Say before any work what would be wrong with an output folder after it.

    Parameters
    ----------
    inputs
        What the verb reads.
    force
        Whether what is there may be replaced.
    kind
        What is to be made: nothing else is replaced. None for files.

    Raises
    ------
    OutputExistsError
        If there is something, and `force` is not given, or if it is something else.
    OutputError
        If another process is writing it.
    InputError
        If nothing can be written there; or if `force` would delete an input, the current folder or the home folder.
    """
    check_replaceable(out, force=force)
    ground = out.absolute().parent
    while not ground.exists() and ground != ground.parent:
        ground = ground.parent
    if not ground.is_dir():
        raise InputError(f"--out {out}: {ground} is not a directory; choose another folder")
    try:  # rights alone don't tell: nobody writes into /proc, nor on a disk that was mounted to be read
        os.rmdir(tempfile.mkdtemp(prefix=".vico-", dir=ground))
    except OSError:
        raise InputError(f"--out {out}: {ground} cannot be written to; choose another folder") from None
    folder = out.resolve()
    for kept in (*inputs, Path.cwd(), Path(os.path.expanduser("~"))):  # "~" itself where there is no home
        if kept.resolve().is_relative_to(folder):
            raise InputError(f"--out {out}: holds {kept}, which --force would delete; choose another folder")
    check_replaceable(out, force=force, kind=kind)


def print_json(content: Any) -> None:
    """Print one JSON document on stdout; letters that it cannot show are escaped, so that names are whole."""
    text = json.dumps(content, indent=1, sort_keys=True, ensure_ascii=False, default=str)
    try:
        text.encode(getattr(sys.stdout, "encoding", None) or "utf-8")
    except UnicodeEncodeError:
        text = json.dumps(content, indent=1, sort_keys=True, default=str)
    print(text)


def print_table(title: str, rows: Mapping[str, Any], words: Mapping[str, str] | None = None) -> None:
    """Print names and values as a table on stdout.

    Parameters
    ----------
    words
        What they mean, by name: a third column. Long values, such as hashes, are told below then, and whole.
    """
    table = Table(title=title, title_justify="left", show_header=False)
    for _ in range(0 if words is None else 2):
        table.add_column(no_wrap=True)
    below = []
    for name, value in rows.items():
        shown = f"{value:,.2f}" if isinstance(value, float) else f"{value}"
        if words is None:
            table.add_row(name, shown)
        elif len(shown) <= _SHORT:
            table.add_row(name, shown, words.get(name, ""))
        else:
            below.append(f"{name}: {shown}" + (f" ({words[name]})" if name in words else ""))
    console = Console()
    console.print(table)
    for line in below:
        console.print(line, soft_wrap=True, markup=False, highlight=False)


def print_export(out: Path, to: str, counts: Mapping[str, int], *, json: bool) -> None:
    """Say what was written in another format."""
    if json:
        print_json({"format": to, "out": str(out), **counts})
    else:
        print(f"{out}: {to}, " + ", ".join(f"{number:,} {name}" for name, number in counts.items()))
