"""Results of an evaluation: ``results.json``, ``results.md``, ``timing.json``, and the rows that others published.

The page has a table a category, differences, causes, averages, and what went wrong. Published rows are data with a
strict loader. What was written is read again for the leaderboard.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from pydantic import Field, StrictBool, StrictFloat, StrictInt

from vico.challenges.episodes import Outcome, code_digest, label_of, record_of
from vico.challenges.records import Challenge, EpisodeRecord, Metric, Setting
from vico.challenges.tables.summary import Difference, Estimate, Row, Summary, summarise
from vico.errors import SchemaError
from vico.io.data_files import DataRecord, cached_data, data_files, read_record
from vico.io.files import FolderKind, read_json, write_bytes, write_json
from vico.version import __version__

_PREFIX = "published_"
_GUIDE = "docs/evaluation.md"
#: Instead of a category: whichever the challenge has.
_ANY = "*"


class _PublishedRow(DataRecord):
    challenge: str
    setting: dict[str, StrictBool | StrictInt | StrictFloat | str] = Field(default_factory=dict)
    method: str
    values: dict[str, dict[str, float]] = Field(min_length=1)
    average: float | None = None


class _PublishedFile(DataRecord):
    about: str
    rows: tuple[_PublishedRow, ...] = Field(min_length=1)


@dataclass(frozen=True)
class Published:
    """A row of somebody else's table.

    Attributes
    ----------
    source
        Name of the file it is from.
    about
        What was published.
    setting
        Of it; what it does not name fits every one.
    values
        By category and metric.
    average
        Of the first metric over all categories, where it was given.
    """

    source: str
    about: str
    challenge: str
    setting: Setting
    method: str
    values: Mapping[str, Mapping[str, float]]
    average: float | None

    @property
    def label(self) -> str:
        """How a table names it: whose it is, and the method."""
        return f"{self.source}: {self.method}"

    def of(self, category: str) -> Mapping[str, float]:
        """Return its values in a category, by metric."""
        return self.values.get(category) or self.values.get(_ANY, {})


@cached_data
def _all_published() -> list[Published]:
    rows = []
    for path in data_files("challenges", _PREFIX):
        found = read_record(path, _PublishedFile, guide=_GUIDE)
        source = path.stem.removeprefix(_PREFIX)
        rows += [
            Published(source, found.about, row.challenge, row.setting, row.method, row.values, row.average)
            for row in found.rows
        ]
    return rows


def published_rows(challenge: str, setting: Setting) -> list[Published]:
    """Return what was published of a challenge in a setting; what only one of the two names keeps none away.

    Raises
    ------
    SchemaError
        If a file is not as it should be.
    """
    return [
        row
        for row in _all_published()
        if row.challenge == challenge and all(setting.get(name, value) == value for name, value in row.setting.items())
    ]


_NOTHING = "-"
_ARROWS = {"higher": "↑", "lower": "↓"}
_BETTER = {"higher": "more is better", "lower": "less is better"}
# Columns of every challenge, in words.
_COUNTED = {
    "Done": "parts of episodes that were done, of all",
    "Tokens, Cost": "spent on language models",
    "Faults": "actions that could not be taken, or came too late; 0 is best",
}


def results_page(
    challenge: Challenge, summary: Summary, outcomes: Sequence[Outcome], *, published: Sequence[Published] = ()
) -> str:
    """Return the whole page.

    Parameters
    ----------
    published
        Rows of others, to stand above ours, labelled as theirs.
    """
    worlds = list(dict.fromkeys(outcome.job.world.name for outcome in outcomes))
    seeds = sorted({outcome.job.seed for outcome in outcomes})
    lines = [
        f"# {challenge.name}: {setting_words(summary.setting) or 'as it comes'}",
        "",
        f"vico {__version__}; worlds {', '.join(worlds)}; seeds {', '.join(map(str, seeds))}. "
        "Intervals are 95 % (Student's t, clustered by world).",
        "",
    ]
    for category in dict.fromkeys(row.category for row in summary.rows):
        lines += category_section(challenge, summary, category, published)
    lines += _average_section(challenge, summary, published)
    lines += _list("What agents did wrong, waiting instead", fault_lines(outcomes))
    lines += _list("Not played", not_played_lines(outcomes))
    if published:
        lines += [f"Rows `{row.source}: ...` are as published: {row.about}." for row in published[:1]]
        lines += ["They were measured on other worlds and tasks: docs/evaluation.md says what can be compared.", ""]
    return "\n".join(lines).rstrip() + "\n"


def category_section(
    challenge: Challenge, summary: Summary, category: str, published: Sequence[Published] = ()
) -> list[str]:
    """Return one category's tables, line by line: results, differences, causes."""
    metrics = challenge.metrics(category)
    rows = [row for row in summary.rows if row.category == category]
    theirs = [row for row in published if row.of(category)]
    lines = [f"## {category}", "", *_results(metrics, rows, theirs), "", *_legend(metrics), ""]
    differences = [one for one in summary.differences if one.category == category]
    if differences:
        lines += [
            f"Difference from `{summary.reference}` in the same tasks:",
            "",
            *_differences(metrics, differences),
            "",
        ]
    causes = [cause for cause in challenge.causes(category) if any(cause in row.causes for row in rows)]
    if causes:
        lines += ["Why parts failed:", "", *_causes(causes, rows), ""]
    return lines


def setting_words(setting: Setting) -> str:
    """Say a setting in words: ``assistants 1, distance on``."""
    return ", ".join(
        f"{name.replace('_', ' ')} {('on' if value else 'off') if isinstance(value, bool) else value}"
        for name, value in setting.items()
    )


def fault_lines(outcomes: Sequence[Outcome]) -> list[str]:
    """Say which agents did something wrong, of which kinds, and why first: a line an episode, agent and kind."""
    lines = []
    for outcome in outcomes:
        faults = outcome.record.faults if outcome.record is not None else []
        for agent, kind in dict.fromkeys((fault.agent, fault.kind) for fault in faults):
            first = next(fault for fault in faults if (fault.agent, fault.kind) == (agent, kind))
            number = outcome.record.fault_counts[kind] if outcome.record is not None else 0
            lines.append(
                f"{label_of(outcome.job)}: {agent} {kind} at step {first.step} ({_plain(first.reason)}); "
                f"{number} times in the episode"
            )
    return lines


def time_lines(summary: Summary) -> list[str]:
    """Say how long a row's episodes took on average, by the clock: a line each. It is in no table: machines differ."""
    return [
        f"{row.category}, {row.method}: {row.wall_seconds / row.episodes:.1f} s an episode"
        for row in summary.rows
        if row.episodes
    ]


def not_played_lines(outcomes: Sequence[Outcome]) -> list[str]:
    """Say which episodes were not played, and why: a line each."""
    return [f"{label_of(outcome.job)}: {_plain(outcome.reason)}" for outcome in outcomes if outcome.record is None]


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Return the lines of a table."""
    body = [" | ".join(cell.replace("|", "\\|") for cell in row) for row in rows]
    return [f"| {' | '.join(head)} |", "|" + "---|" * len(head), *(f"| {line} |" for line in body)]


def _results(metrics: Sequence[Metric], rows: Sequence[Row], published: Sequence[Published]) -> list[str]:
    head = [
        "Method",
        *map(_title, metrics),
        "Episodes",
        "Not played",
        "Done",
        "Tokens",
        "Cost $",
        "Faults",
    ]
    body = []
    for other in published:
        values = other.of(rows[0].category)
        cells = [f"{values[m.key]:.{m.digits}f}" if m.key in values else _NOTHING for m in metrics]
        body.append([other.label, *cells, *[_NOTHING] * 6])
    for row in rows:
        cells = [_mean(row.metrics.get(metric.key), metric) for metric in metrics]
        faults = ", ".join(f"{number} {kind}" for kind, number in row.faults.items()) or "0"
        body.append(
            [
                row.method, *cells, str(row.episodes), str(row.not_played), f"{row.done} of {row.parts}",
                str(row.tokens), f"{row.cost:.2f}", faults,
            ]
        )  # fmt: skip
    return table(head, body)


def _legend(metrics: Sequence[Metric]) -> list[str]:
    """Say what the columns are."""
    told = [f"- {metric.label}: {metric.about} ({_BETTER[metric.better]})" for metric in metrics]
    return [*told, *(f"- {name}: {about}" for name, about in _COUNTED.items())]


def _differences(metrics: Sequence[Metric], differences: Sequence[Difference]) -> list[str]:
    body = [
        [one.method, *[_change(one.metrics.get(metric.key), metric) for metric in metrics], str(one.pairs)]
        for one in differences
    ]
    return table(["Method", *map(_title, metrics), "Pairs"], body)


def _causes(causes: Sequence[str], rows: Sequence[Row]) -> list[str]:
    body = [
        [row.method, str(row.parts - row.done), *[str(row.causes.get(cause, 0)) for cause in causes]] for row in rows
    ]
    return table(["Method", "Failed", *causes], body)


def _average_section(challenge: Challenge, summary: Summary, published: Sequence[Published]) -> list[str]:
    if not summary.averages:
        return []
    categories = list(dict.fromkeys(row.category for row in summary.rows))
    metric = challenge.metrics(categories[0])[0]
    head = ["Method", *categories, f"Average {_title(metric)}", f"Difference from `{summary.reference}`"]
    body = []
    for other in published:
        values = [other.of(category).get(metric.key) for category in categories]
        if other.average is None or any(value is None for value in values):
            continue
        cells = [f"{value:.{metric.digits}f}" for value in values if value is not None]
        body.append([other.label, *cells, f"{other.average:.{metric.digits}f}", _NOTHING])
    for average in summary.averages:
        rows = [row for row in summary.rows if row.method == average.method]
        cells = [f"{row.metrics[metric.key].mean:.{metric.digits}f}" for row in rows]
        body.append([average.method, *cells, _mean(average.mean, metric), _change(average.difference, metric)])
    return ["## All categories", "", *table(head, body), ""]


def _title(metric: Metric) -> str:
    return f"{metric.label} {metric.unit} {_ARROWS[metric.better]}".replace("  ", " ")


def _mean(found: Estimate | None, metric: Metric) -> str:
    return _cell(found, lambda value: f"{value:.{metric.digits}f}")


def _change(found: Estimate | None, metric: Metric) -> str:
    """Say a difference; bold where its interval leaves 0 out."""
    words = _cell(found, lambda value: f"{value:+.{metric.digits}f}")
    return f"**{words}**" if found is not None and found.differs else words


def _cell(found: Estimate | None, said: Callable[[float], str]) -> str:
    if found is None:
        return _NOTHING
    if found.low is None or found.high is None:
        return f"{said(found.mean)} (one episode)"
    return f"{said(found.mean)} ({said(found.low)} to {said(found.high)})"


def _list(title: str, lines: Sequence[str]) -> list[str]:
    return [f"## {title}", "", *(f"- {line}" for line in lines), ""] if lines else []


def _plain(text: str) -> str:
    """Return text of anybody's making in one line."""
    return " ".join(text.split())


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
    write_json(
        folder / "timing.json",
        {
            "schema_name": TIMING,
            "version": TIMING_VERSION,
            "episodes": [
                {**dict(zip(_WHICH, _which(o.job.world.name, o.record), strict=True)), _SECONDS: o.record.wall_seconds}
                for o in outcomes
                if o.record is not None
            ],
        },
    )
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
