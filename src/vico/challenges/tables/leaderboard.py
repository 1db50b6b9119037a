"""A leaderboard: a public file of what methods came to, which anybody can add to, check and read.

Only methods that were given the same tasks are ranked against each other: same challenge, category, setting, worlds (by
digest) and seeds make a board.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, StrictBool, StrictFloat, StrictInt, ValidationError, model_validator

from vico.challenges.records import Challenge, EpisodeRecord, Metric
from vico.challenges.tables.results import read_results
from vico.errors import InputError, SchemaError
from vico.io.files import read_json, write_json

SCHEMA = "vico.leaderboard"
VERSION = 1

_HEX = r"^[0-9a-f]{64}$"
_DATE = r"^\d{4}-\d{2}-\d{2}$"


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


class BoardMetric(_Strict):
    """A mean with its 95 % interval, clustered by world; None where one episode gives none."""

    mean: float
    low: float | None
    high: float | None
    unit: str
    better: Literal["higher", "lower"]

    @model_validator(mode="after")
    def _check_interval(self) -> BoardMetric:
        if (self.low is None) != (self.high is None):
            raise ValueError("an interval has two ends, or none")
        if self.low is not None and self.high is not None and not self.low <= self.mean <= self.high:
            raise ValueError(f"the mean {self.mean} is not between {self.low} and {self.high}")
        return self


class Entry(_Strict):
    """What a method came to in one category and setting.

    Attributes
    ----------
    method
        Its name.
    version
        Of vico.
    rank_by
        Key of the metric that ranks.
    metrics
        By key.
    episodes, not_played
        How many were played, and how many could not be.
    worlds
        Digests by name.
    episodes_hash
        SHA-256 over the state hashes of all episodes: who plays them again comes to the same.
    date
        Of the entry, YYYY-MM-DD, as given by who added it.
    """

    challenge: str
    category: str
    setting: dict[str, StrictBool | StrictInt | StrictFloat | str]
    method: str = Field(min_length=1, max_length=200)
    version: str
    rank_by: str
    metrics: dict[str, BoardMetric] = Field(min_length=1)
    episodes: int = Field(ge=1)
    not_played: int = Field(ge=0)
    worlds: dict[str, str] = Field(min_length=1)
    seeds: list[int] = Field(min_length=1)
    episodes_hash: str = Field(pattern=_HEX)
    date: str | None = Field(default=None, pattern=_DATE)

    @model_validator(mode="after")
    def _check_rank_metric(self) -> Entry:
        if self.rank_by not in self.metrics:
            raise ValueError(f"rank_by names {self.rank_by!r}, which is none of its metrics")
        return self

    def board(self) -> str:
        """Return which board it belongs to: equal for those that were given the same tasks."""
        same = [self.challenge, self.category, self.setting, sorted(self.worlds.values()), sorted(self.seeds)]
        return json.dumps(same, sort_keys=True)


class Leaderboard(_Strict):
    """All entries."""

    schema_name: Literal["vico.leaderboard"] = "vico.leaderboard"
    version: Literal[1] = 1
    entries: list[Entry] = Field(default_factory=list)

    @model_validator(mode="after")
    def _once(self) -> Leaderboard:
        known: set[tuple[str, str, str]] = set()
        for entry in self.entries:
            which = (entry.board(), entry.method, entry.version)
            if which in known:
                raise ValueError(f"{entry.method} stands twice on one board")
            known.add(which)
        return self


def read_leaderboard(path: Path) -> Leaderboard:
    """Read a leaderboard.

    Raises
    ------
    MissingFileError
        If there is no such file.
    SchemaError
        If it is none, of another version, or a field is unknown, missing or impossible; the message names it.
    """
    content = read_json(path)
    found = (content.get("schema_name"), content.get("version")) if isinstance(content, dict) else None
    if found != (SCHEMA, VERSION):
        raise SchemaError(f"{path}: not a leaderboard of version {VERSION}")
    try:
        return Leaderboard.model_validate_json(json.dumps(content))
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "the whole file"
        raise SchemaError(f"{path}: {where}: {first['msg'].lower()}; see docs/evaluation.md") from None


def write_leaderboard(path: Path, board: Leaderboard) -> None:
    """Write a leaderboard, whole or not at all; its entries in a fixed order."""
    entries = sorted(board.entries, key=lambda entry: (entry.board(), entry.method, entry.version))
    write_json(path, board.model_copy(update={"entries": entries}).model_dump(mode="json"))


def entries_of(results: Path, challenge: Challenge, *, date: str | None = None) -> list[Entry]:
    """Make entries of a ``results.json``: one a method and category of which anything was played.

    Raises
    ------
    MissingFileError, SchemaError
        If it can't be read.
    InputError
        If the date is none, or the results are of another challenge.
    """
    content, episodes = read_results(results)
    if content["challenge"] != challenge.name:
        raise InputError(f"{results}: of the challenge {content['challenge']}, not {challenge.name}")
    entries = []
    for row in content["rows"]:
        mine = [(w, e) for w, e in episodes if (e.category, e.method) == (row["category"], row["method"])]
        if mine:
            entries.append(_entry(content, row, mine, challenge.metrics(row["category"]), date, results))
    return entries


def add_entries(board: Leaderboard, entries: Sequence[Entry], *, replace: bool = False) -> Leaderboard:
    """Return a leaderboard with further entries.

    Raises
    ------
    InputError
        If a method of that version stands on the board already with other episodes, and `replace` is not given.
    """
    kept = list(board.entries)
    for entry in entries:
        which = (entry.board(), entry.method, entry.version)
        before = next((old for old in kept if (old.board(), old.method, old.version) == which), None)
        if before is not None:
            if before.episodes_hash != entry.episodes_hash and not replace:
                raise InputError(
                    f"leaderboard: {entry.method} {entry.version} stands there with other episodes ({entry.category}); "
                    "the same version, tasks and seeds should come to the same: name the method anew, or --replace it"
                )
            kept.remove(before)
        kept.append(entry)
    return Leaderboard(entries=kept)


def boards(board: Leaderboard) -> list[list[Entry]]:
    """Return the entries of each board, best first."""
    groups: dict[str, list[Entry]] = {}
    for entry in board.entries:
        groups.setdefault(entry.board(), []).append(entry)
    return [sorted(groups[key], key=_rank) for key in sorted(groups)]


def _rank(entry: Entry) -> tuple[float, str]:
    first = entry.metrics[entry.rank_by]
    return (-first.mean if first.better == "higher" else first.mean), entry.method


def _entry(
    content: Mapping[str, Any],
    row: Mapping[str, Any],
    episodes: Sequence[tuple[str, EpisodeRecord]],
    metrics: Sequence[Metric],
    date: str | None,
    path: Path,
) -> Entry:
    worlds = {world: content["worlds"][world] for world, _ in episodes}
    lines = sorted(f"{worlds[world]} {e.seed} {e.state_hash}\n" for world, e in episodes)
    units = {metric.key: metric for metric in metrics}
    try:
        return Entry(
            challenge=content["challenge"],
            category=row["category"],
            setting=content["setting"],
            method=row["method"],
            version=content["vico"],
            rank_by=metrics[0].key,
            metrics={key: _metric(row["metrics"][key], units[key]) for key in units if key in row["metrics"]},
            episodes=len(episodes),
            not_played=row["not_played"],
            worlds=dict(sorted(worlds.items())),
            seeds=sorted({e.seed for _, e in episodes}),
            episodes_hash=hashlib.sha256("".join(lines).encode()).hexdigest(),
            date=date,
        )
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        if where == "date":
            raise InputError(f"leaderboard: the date {date!r} is not YYYY-MM-DD") from None
        raise SchemaError(f"{path}: {where}: {first['msg'].lower()}") from None


def _metric(found: Mapping[str, Any], metric: Metric) -> BoardMetric:
    values = [None if found[name] is None else round(float(found[name]), 6) for name in ("mean", "low", "high")]
    mean, low, high = values
    if mean is None or not math.isfinite(mean):
        raise InputError(f"leaderboard: no mean of {metric.key}")
    return BoardMetric(mean=mean, low=low, high=high, unit=metric.unit, better=metric.better)
