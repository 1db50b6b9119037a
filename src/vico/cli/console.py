"""The terminal of all verbs: progress bars, results, and signals that ask a command to end.

Progress goes to stderr, results to stdout. The signals are Ctrl-C, a batch system's SIGTERM, and SIGHUP of a terminal
that is closed.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any

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

    console = Console(file=sys.stderr)
    if not console.is_terminal:
        yield _progress_lines()
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


def _progress_lines() -> Report:
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
    from rich.console import Console
    from rich.table import Table

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


# Those that end a program which does not listen to them; SIGINT raises KeyboardInterrupt already.
_ENDING = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))
# A second Ctrl-C sooner than this is the first one, passed on by a program between the terminal and this one.
_SAME = 1.0


class CommandInterrupted(KeyboardInterrupt):
    """A command was asked to end; it cleans up as after Ctrl-C.

    Attributes
    ----------
    number
        Of the signal.
    """

    def __init__(self, number: int, sentence: str = "") -> None:
        super().__init__(sentence)
        self.number = number


def signal_of(stop: KeyboardInterrupt) -> int:
    """Return the number of the signal that an interruption came of."""
    return stop.number if isinstance(stop, CommandInterrupted) else signal.SIGINT


def exit_code(stop: KeyboardInterrupt) -> int:
    """Return what a shell expects of a command that a signal ended: 130 after Ctrl-C, 143 after SIGTERM."""
    return 128 + signal_of(stop)


@contextmanager
def ended_by_signals() -> Iterator[None]:
    """Let SIGTERM and SIGHUP raise `Stopped` while the block lasts, where nothing else was made of them.

    Signals that whoever started the program had it ignore (``nohup``) stay ignored.
    """

    def stop(number: int, _: FrameType | None) -> None:
        raise CommandInterrupted(number)

    with _signal_handlers({number: stop for number in _ENDING if signal.getsignal(number) is signal.SIG_DFL}):
        yield


class StopRequest:
    """Whether a command was asked to end once it has finished what it is at.

    Attributes
    ----------
    number
        Of the signal; 0 as long as nobody asked.
    """

    def __init__(self) -> None:
        self.number = 0

    def __bool__(self) -> bool:
        return bool(self.number)


@contextmanager
def stopped_between_steps(wake: Callable[[], None] = lambda: None) -> Iterator[StopRequest]:
    """Note the first signal that asks to end, while the block lasts, in place of ending at once.

    A second Ctrl-C ends at once all the same. A second SIGTERM does not: batch systems send it to a process and to
    its group, and a SIGKILL after it.

    Parameters
    ----------
    wake
        Called then, in the main thread, wherever it was: has whoever waits there look at the request.
    """
    asked, when = StopRequest(), 0.0

    def stop(number: int, _: FrameType | None) -> None:
        nonlocal when
        now = time.monotonic()
        if not asked:
            asked.number, when = number, now
            # Not printed: the stream may be in the middle of a line.
            _print_notice("vico: this step is finished and the run kept; Ctrl-C once more ends it at once")
            wake()
        elif number == signal.SIGINT and now - when > _SAME:
            raise CommandInterrupted(number)

    numbers = [number for number in (signal.SIGINT, *_ENDING) if signal.getsignal(number) is not signal.SIG_IGN]
    with _signal_handlers(dict.fromkeys(numbers, stop)):
        yield asked


def _print_notice(sentence: str) -> None:
    try:
        os.write(2, f"\n{sentence}\n".encode())
    except OSError:
        return  # the terminal is gone; the run is kept all the same


@contextmanager
def _signal_handlers(handlers: dict[int, Callable[[int, FrameType | None], None]]) -> Iterator[None]:
    if threading.current_thread() is not threading.main_thread():
        yield  # Python lets nobody else listen to signals
        return
    before = {number: signal.signal(number, handler) for number, handler in handlers.items()}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
