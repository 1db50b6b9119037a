"""The card of a dataset: what a person who finds the folder wants to know, in ``README.md``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vico.datasets.increments import SPACE
from vico.datasets.layout import IMAGES, Layout

_UNITS = {
    "rgb": "8-bit colours; in LeRobot H.264 (crf 18), else PNG",
    "depth": "float32, metres along the optical axis, 0 where nothing is within 600 m; exact",
    "segmentation": "int32, entity of each pixel, 0 where nothing is; exact; names in `entities.parquet`",
}


def card_of(layout: Layout, record: Mapping[str, Any], size: int) -> str:
    """Return the card as markdown, with the front matter that hubs read.

    Parameters
    ----------
    record
        What ``dataset.json`` says.
    size
        Of all other files, bytes.
    """
    sections = [
        _front_matter(layout, record),
        _summary(layout, record, size),
        _contents(layout, record),
        _origin(record),
        _limits(layout, record),
    ]
    return "\n\n".join(sections) + "\n"


def _front_matter(layout: Layout, record: Mapping[str, Any]) -> str:
    tags = ["virtual-community", "simulation", "embodied-ai", *(["LeRobot"] if layout.contents.to == "lerobot" else [])]
    lines = ["---", "license: other", "task_categories:", "- robotics", "tags:", *(f"- {tag}" for tag in tags)]
    if layout.contents.to == "lerobot":
        lines += ["configs:", "- config_name: default", "  data_files: data/*/*.parquet"]
    return "\n".join([*lines, "---"])


def _summary(layout: Layout, record: Mapping[str, Any], size: int) -> str:
    made = record["made"]
    what = f"{made['category']} by the method `{made['method']}`" if "method" in made else "recorded runs"
    judged = record["judged"]
    success = f"{record['successes']} of {judged} judged ones did all that was asked for" if judged else "nobody judged"
    hours = layout.frames / layout.fps / 3600.0
    rows = [
        f"| {name} | {end - first} | {_frames(layout, first, end):,} |" for name, (first, end) in layout.splits.items()
    ]
    return "\n".join(
        [
            f"# Demonstrations of {what}",
            "",
            f"{record['episodes']} episodes, {layout.frames:,} frames ({hours:.1f} h of simulated time at {layout.fps} "
            f"frames a second), {size / 1e6:.1f} MB. Of the episodes, {success}.",
            "",
            f"Written by {record['producer']}; format `{record['format']}`.",
            "",
            "| split | episodes | frames |",
            "|---|---|---|",
            *rows,
            "",
            f"Split by {made['split_by']}: no {made['split_by']} is in two splits.",
        ]
    )


def _frames(layout: Layout, first: int, end: int) -> int:
    return sum(episode.frames for episode in layout.episodes[first:end])


def _contents(layout: Layout, record: Mapping[str, Any]) -> str:
    lines = [
        "## What a frame holds",
        "",
        "What an agent observed, and what it did next; one frame each time that it acted.",
        "",
        "| feature | holds |",
        "|---|---|",
    ]
    for output in layout.contents.outputs:
        lines.append(f"| `{IMAGES[output]}` | {layout.contents.size} x {layout.contents.size}; {_UNITS[output]} |")
    for name, names in sorted(record["features"].items()):
        lines.append(f"| `{name}` | float32: {', '.join(names)} |")
    lines += [
        "| `action.text` | what is said, or the id or name that the action is about; where there is any |",
        "| `action.status` | " + ", ".join(f"{value} {name}" for value, name in record["statuses"].items()) + " |",
        "| `next.done`, `next.success` | last frame of an episode; and whether all was done |",
        "",
        _of_actions(record),
    ]
    return "\n".join(lines)


def _of_actions(record: Mapping[str, Any]) -> str:
    """Return how the action vectors are to be read, and which of them were left out or changed."""
    if record["action"]["space"] != SPACE:
        return (
            "ENU metres, radians, seconds since midnight. `vico.datasets.actions` makes actions of vectors, and back."
        )
    setting = record["made"]["setting"]
    lines = [
        "Radians and metres. An action holds increments of its joints: from where each is, as the state of the same "
        "frame says, to where its servo is told to be; of the base how far it goes ahead and turns left in the period. "
        "`vico.agents.robot.increments` makes actions of the simulation of them.",
    ]
    if setting["drop_below"]:
        lines.append(
            f"Steps whose action is smaller than {setting['drop_below']:g} in all of its numbers are left out."
        )
    if setting["clip"]:
        low, high = setting["clip"], 1.0 - setting["clip"]
        lines.append(f"Actions are cut to their quantiles {low:g} and {high:g}, each number by itself.")
    return " ".join(lines)


# What a world of no map says of where it comes from: a level field is drawn by the program.
_DRAWN = {"name": "none: drawn by the program", "licence": "that of the program", "attribution": "none"}


def _origin(record: Mapping[str, Any]) -> str:
    lines = [
        "## Where it comes from, and its licences",
        "",
        "Everybody in it is invented. The cities are made from data whose licences hold for what is seen of them:",
        "",
        "| world | episodes | digest | source | licence | attribution |",
        "|---|---|---|---|---|---|",
    ]
    for world in record["worlds"]:
        for source in world["sources"] or [_DRAWN]:
            cells = [world["name"], str(world["episodes"]), f"`{world['digest'][:12]}`"]
            cells += [str(source.get(name, "unknown")) for name in ("name", "licence", "attribution")]
            lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _limits(layout: Layout, record: Mapping[str, Any]) -> str:
    lines = [
        "## Known limits",
        "",
        "- Simulated pictures: no sensor noise, no motion blur. Policies trained on them alone are for the simulation.",
        f"- One frame each {1 / layout.fps:g} s of simulated time; what happens in between is not in it.",
        "- Actions are those of the simulation's avatars or robots, not of a human body.",
    ]
    if "method" in record["made"]:
        lines.append("- All demonstrations are by one method: its habits and its mistakes are in them.")
    gaps = sum(int(episode.about["gaps"]) for episode in layout.episodes)
    if gaps:
        told = " (`observation.state`, `time`)" if "time" in record["features"]["observation.state"] else ""
        lines.append(f"- {gaps} times more time passed between two frames than timestamps say{told}.")
    if record["judged"] > record["successes"]:
        lines.append("- Failed episodes are in it: select by `success` in `episodes.parquet`.")
    if record["missing"]:
        lines.append(f"- {len(record['missing'])} episodes could not be made; `dataset.json` says why.")
    return "\n".join(lines)
