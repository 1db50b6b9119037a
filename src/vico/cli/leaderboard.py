"""`vico leaderboard add` and `show`: results of several methods in one file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from tyro.conf import Positional
from tyro.extras import SubcommandApp

from vico.errors import EmptyInputError

if TYPE_CHECKING:
    from vico.challenges.tables.leaderboard import BoardMetric, Entry

leaderboard = SubcommandApp()


@leaderboard.command(name="add")
def leaderboard_add(
    results: Positional[Path], file: Path, date: str | None = None, replace: bool = False, json: bool = False
) -> int:
    """Add what an evaluation came to to a leaderboard file; it is made if it is not there.

    Example: vico leaderboard add results --file leaderboard.json --date 2026-11-30

    Args:
        results: Folder that vico eval has written, or its results.json.
        file: The leaderboard.
        date: Of the entries, YYYY-MM-DD; left out without.
        replace: Replace entries of the same method, version and tasks that came to something else.
        json: Print the entries as JSON.
    """
    add_to_leaderboard(results, file=file, date=date, replace=replace, json=json)
    return 0


@leaderboard.command(name="show")
def leaderboard_show(file: Positional[Path], json: bool = False) -> int:
    """Show a leaderboard, a table for each challenge, category, setting and set of tasks.

    Example: vico leaderboard show leaderboard.json

    Args:
        file: The leaderboard.
        json: Print it as JSON.
    """
    from rich.console import Console
    from rich.markdown import Markdown

    from vico.challenges.tables.leaderboard import boards, read_leaderboard
    from vico.cli.console import print_json

    board = read_leaderboard(file)
    if json:
        print_json(board.model_dump(mode="json"))
        return 0
    console = Console()
    for entries in boards(board):
        console.print(Markdown("\n".join(board_lines(entries))))
    return 0


def add_to_leaderboard(
    results: Path, *, file: Path, date: str | None, replace: bool, json: bool = False, quiet: bool = False
) -> None:
    """Add the entries of a results folder, or of its ``results.json``; say nothing of it if `quiet`."""
    from vico.challenges.records import load_challenge
    from vico.challenges.tables.leaderboard import (
        Leaderboard,
        add_entries,
        entries_of,
        read_leaderboard,
        write_leaderboard,
    )
    from vico.challenges.tables.results import read_results
    from vico.cli.console import print_json

    path = results / "results.json" if results.is_dir() else results
    content, _ = read_results(path)
    entries = entries_of(path, load_challenge(content["challenge"]), date=date)
    if not entries:
        raise EmptyInputError(f"{path}: no episode was played; there is nothing to add")
    board = read_leaderboard(file) if file.exists() else Leaderboard()
    write_leaderboard(file, add_entries(board, entries, replace=replace))
    if json:
        print_json([entry.model_dump(mode="json") for entry in entries])
    elif not quiet:
        for entry in entries:
            print(f"{file}: {entry.method}, {entry.category}: {_cell(entry.metrics[entry.rank_by])}")


def board_lines(entries: list[Entry]) -> list[str]:
    """Return the markdown of one board, best first."""
    from vico.challenges.tables.results import setting_words, table

    first = entries[0]
    keys = [first.rank_by, *(key for key in first.metrics if key != first.rank_by)]
    title = f"## {first.challenge}, {first.category}: {setting_words(first.setting) or 'as it comes'}"
    about = f"{len(first.worlds)} worlds ({', '.join(first.worlds)}), seeds {', '.join(map(str, first.seeds))}"
    rows = [
        [
            f"{place}", entry.method, *[_cell(entry.metrics.get(key)) for key in keys], f"{entry.episodes}",
            f"{entry.not_played}", entry.version, entry.date or "-", entry.episodes_hash[:12],
        ]
        for place, entry in enumerate(entries, 1)
    ]  # fmt: skip
    units = {key: entry.metrics[key].unit for entry in entries for key in entry.metrics}
    head = ["", "Method", *[f"{key} {units.get(key, '')}".strip() for key in keys]]
    return [title, "", about, "", *table([*head, "Episodes", "Not played", "vico", "Date", "Episodes' hash"], rows), ""]


def _cell(metric: BoardMetric | None) -> str:
    if metric is None:
        return "-"
    if metric.low is None or metric.high is None:
        return f"{metric.mean:.2f} (one episode)"
    return f"{metric.mean:.2f} ({metric.low:.2f} to {metric.high:.2f})"
