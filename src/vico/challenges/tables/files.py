"""``results.json`` and ``results.md``: written as an evaluation goes on, and read for the leaderboard."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from vico.challenges.episodes import Outcome, code_digest, record_of
from vico.challenges.records import Challenge, EpisodeRecord
from vico.challenges.tables.markdown import results_page
from vico.challenges.tables.published import Published
from vico.challenges.tables.summary import Summary, summarise
from vico.errors import SchemaError
from vico.io.files import read_json, write_bytes, write_json
from vico.version import __version__

SCHEMA = "vico.results"
VERSION = 4


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
        "rows": [asdict(row) for row in summary.rows],
        "differences": [asdict(one) for one in summary.differences],
        "averages": [asdict(one) for one in summary.averages],
        "episodes": [{"world_folder": o.job.world.name, **asdict(o.record)} for o in played if o.record is not None],
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


def write_results(
    folder: Path,
    challenge: Challenge,
    outcomes: Sequence[Outcome],
    *,
    reference: str = "",
    published: Sequence[Published] = (),
) -> Summary:
    """Write ``results.json`` and ``results.md`` of the outcomes of one setting; return the summary."""
    summary = summarise(challenge, outcomes, reference=reference)
    write_json(folder / "results.json", results_content(challenge, summary, outcomes))
    write_bytes(folder / "results.md", results_page(challenge, summary, outcomes, published=published).encode())
    return summary


def read_results(path: Path) -> tuple[dict[str, Any], list[tuple[str, EpisodeRecord]]]:
    """Read ``results.json``: all of it, and its episodes with the folder name of the world each was played in.

    Raises
    ------
    MissingFileError
        If there is no such file.
    SchemaError
        If it is none, of another version, or damaged.
    """
    content = read_json(path)
    found = (content.get("schema_name"), content.get("version")) if isinstance(content, dict) else None
    if found != (SCHEMA, VERSION):
        raise SchemaError(f"{path}: not results of version {VERSION}; evaluate anew")
    try:
        episodes = [
            (
                str(one["world_folder"]),
                record_of({name: value for name, value in one.items() if name != "world_folder"}),
            )
            for one in content["episodes"]
        ]
        for world, _ in episodes:
            content["worlds"][world]
        content["rows"], content["setting"], content["challenge"], content["vico"]
    except (KeyError, TypeError, AttributeError) as error:
        raise SchemaError(f"{path}: damaged ({type(error).__name__}: {error}); evaluate anew") from None
    return content, episodes
