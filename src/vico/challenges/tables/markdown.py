"""Results as a page of markdown: a table a category, differences, causes, averages, and what went wrong."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from vico.challenges.episodes import Outcome, label_of
from vico.challenges.records import Challenge, Metric, Setting
from vico.challenges.tables.means import Estimate
from vico.challenges.tables.published import Published
from vico.challenges.tables.summary import Average, Difference, Row, Summary
from vico.version import __version__

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
        body.append(_average_row(average, metric, [row for row in summary.rows if row.method == average.method]))
    return ["## All categories", "", *table(head, body), ""]


def _average_row(average: Average, metric: Metric, rows: Sequence[Row]) -> list[str]:
    cells = [f"{row.metrics[metric.key].mean:.{metric.digits}f}" for row in rows]
    return [average.method, *cells, _mean(average.mean, metric), _change(average.difference, metric)]


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
