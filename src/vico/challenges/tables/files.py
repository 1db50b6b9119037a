"""``results.json``, ``results.md`` and ``timing.json``: written when an evaluation is over, read for the leaderboard.

Nothing of the first two depends on the machine: the same episodes come to the same bytes wherever they are played. How
long it took is in the third.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from vico.challenges.episodes import Outcome, code_digest, record_of
from vico.challenges.records import Challenge, EpisodeRecord
from vico.challenges.tables.markdown import results_page
from vico.challenges.tables.published import Published
from vico.challenges.tables.summary import Summary, summarise
from vico.errors import SchemaError
from vico.io.files import read_json, write_bytes, write_json
from vico.io.folders import FolderKind
from vico.version import __version__

SCHEMA = "vico.results"
VERSION = 5
_OLDER = 4  # had the seconds in it
TIMING, TIMING_VERSION = "vico.timing", 1
_SECONDS = "wall_seconds"


def results_content(challenge: Challenge, summary: Summary, outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """Return what ``results.json`` holds."""
    played = [outcome for outcome in outcomes if outcome.record is not None]
    return {
        "schema_name": SCHEMA,
        "version": VERSION,
        "vico": __version__,
        "code": code_digest(),
        "challenge": challenge.name,
        "setting": dict(summary.setting),
        "reference": summary.reference,
        "worlds": {outcome.job.world.name: outcome.world_digest for outcome in played},
        "rows": [_timeless(asdict(row)) for row in summary.rows],
        "differences": [asdict(one) for one in summary.differences],
        "averages": [asdict(one) for one in summary.averages],
        "episodes": [
            {"world_folder": o.job.world.name, **_timeless(asdict(o.record))} for o in played if o.record is not None
        ],
        "not_played": [
            {
                "category": o.job.category,
                "method": o.job.method,
                "world": o.job.world.name,
                "seed": o.job.seed,
                "reason": o.reason,
            }
            for o in outcomes
            if o.record is None
        ],
    }


def timing_content(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """Return what ``timing.json`` holds: the seconds of each episode, by the clock of the machine that played it."""
    return {
        "schema_name": TIMING,
        "version": TIMING_VERSION,
        "episodes": [
            {**dict(zip(_WHICH, _which(o.job.world.name, o.record), strict=True)), _SECONDS: o.record.wall_seconds}
            for o in outcomes
            if o.record is not None
        ],
    }


def _files_of(_: Path) -> list[str]:
    """Return the files of an evaluation; a day of influence may have a run an assignment, its talks beside it."""
    from vico.runner.recording import RUN_FOLDER  # simulations are slow to import

    in_runs = (RUN_FOLDER.manifest, *RUN_FOLDER.patterns(Path()), "talks.json")
    runs = [f"{run}/{name}" for run in ("runs/*", "runs/*/*") for name in in_runs]
    return ["results.md", "timing.json", "episodes/*.json", "tasks/*.json", *runs]


#: What an evaluation makes, in which its episodes lie.
EVALUATION_FOLDER = FolderKind("evaluation", "results.json", _files_of)


def write_results(
    folder: Path,
    challenge: Challenge,
    outcomes: Sequence[Outcome],
    *,
    reference: str = "",
    published: Sequence[Published] = (),
) -> Summary:
    """Write results and timing of the outcomes of one setting; return the summary."""
    summary = summarise(challenge, outcomes, reference=reference)
    write_json(folder / "timing.json", timing_content(outcomes))
    write_json(folder / "results.json", results_content(challenge, summary, outcomes))
    write_bytes(folder / "results.md", results_page(challenge, summary, outcomes, published=published).encode())
    return summary


def read_results(path: Path) -> tuple[dict[str, Any], list[tuple[str, EpisodeRecord]]]:
    """Read ``results.json``: all of it, and its episodes with the folder name of the world each was played in.

    How long episodes took is read from ``timing.json`` beside it; 0 where that is not there.

    Raises
    ------
    MissingFileError
        If there is no such file.
    SchemaError
        If it is none, of another version, or damaged.
    """
    content = read_json(path)
    found = (content.get("schema_name"), content.get("version")) if isinstance(content, dict) else None
    if found not in ((SCHEMA, VERSION), (SCHEMA, _OLDER)):
        raise SchemaError(f"{path}: not results of version {VERSION}; evaluate anew")
    timing = _read_timing(path.with_name("timing.json"))
    try:
        episodes = []
        for one in content["episodes"]:
            fields = {_SECONDS: 0.0, **one}
            world = str(fields.pop("world_folder"))
            record = record_of(fields)
            episodes.append(
                (world, replace(record, wall_seconds=timing.get(_which(world, record), record.wall_seconds)))
            )
        for world, _ in episodes:
            content["worlds"][world]
        content["rows"], content["setting"], content["challenge"], content["vico"]
    except (KeyError, TypeError, AttributeError) as error:
        raise SchemaError(f"{path}: damaged ({type(error).__name__}: {error}); evaluate anew") from None
    return content, episodes


#: What tells an evaluation's episodes apart.
_WHICH = ("world_folder", "category", "method", "seed")


def _which(world: str, record: EpisodeRecord) -> tuple[str, str, str, int]:
    return world, record.category, record.method, record.seed


def _timeless(content: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in content.items() if name != _SECONDS}


def _read_timing(path: Path) -> dict[tuple[Any, ...], float]:
    """Return the seconds of each episode; none if the file is not there."""
    if not path.exists():
        return {}
    content = read_json(path)
    found = (content.get("schema_name"), content.get("version")) if isinstance(content, dict) else None
    try:
        if found != (TIMING, TIMING_VERSION):
            raise KeyError("version")
        return {tuple(one[name] for name in _WHICH): float(one[_SECONDS]) for one in content["episodes"]}
    except (KeyError, TypeError, ValueError) as error:
        raise SchemaError(f"{path}: damaged ({type(error).__name__}: {error}); delete it, the results stay") from None
