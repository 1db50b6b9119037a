"""`vico leaderboard`: add results to a leaderboard file, and show it."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console
from rich.markdown import Markdown

from vico.challenges.registry import load_challenge
from vico.challenges.tables.files import read_results
from vico.challenges.tables.leaderboard import (
    BoardMetric,
    Entry,
    Leaderboard,
    add_entries,
    boards,
    entries_of,
    read_leaderboard,
    write_leaderboard,
)
from vico.challenges.tables.markdown import setting_words, table
from vico.cli.output import print_json
from vico.errors import EmptyInputError


def add(results: Path, *, file: Path, date: str | None, replace: bool, json: bool = False, told: bool = True) -> int:
    """Add the entries of a results folder, or of its ``results.json``; say nothing of it if not `told`."""
    path = results / "results.json" if results.is_dir() else results
    content, _ = read_results(path)
    entries = entries_of(path, load_challenge(content["challenge"]), date=date)
    if not entries:
        raise EmptyInputError(f"{path}: no episode was played; there is nothing to add")
    board = read_leaderboard(file) if file.exists() else Leaderboard()
    write_leaderboard(file, add_entries(board, entries, replace=replace))
    if json:
        print_json([entry.model_dump(mode="json") for entry in entries])
    elif told:
        for entry in entries:
            print(f"{file}: {entry.method}, {entry.category}: {_cell(entry.metrics[entry.rank_by])}")
    return 0


def show(file: Path, *, json: bool = False) -> int:
    """Print a leaderboard."""
    board = read_leaderboard(file)
    if json:
        print_json(board.model_dump(mode="json"))
        return 0
    console = Console()
    for entries in boards(board):
        console.print(Markdown("\n".join(board_lines(entries))))
    return 0


def board_lines(entries: list[Entry]) -> list[str]:
    """Return the markdown of one board, best first."""
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
