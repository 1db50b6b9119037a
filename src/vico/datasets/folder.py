"""Files of a dataset beside those of its format: ``dataset.json``, ``episodes.parquet``, ``entities.parquet``.

And its card in ``README.md``: what a person who finds the folder wants to know.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import pyarrow as pa
import pyarrow.parquet as pq
from pydantic import BaseModel, ConfigDict, ValidationError

from vico.datasets.formats.registry import FORMATS
from vico.datasets.layout import IMAGES, STATUSES, Layout
from vico.datasets.vectors import SPACE, VectorForm, action_form_of
from vico.errors import InputError, MissingFileError, SchemaError
from vico.io.files import FolderKind, files_of_manifest, read_json, sha256_of
from vico.version import __version__

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
    rows = []
    for name, (first, end) in layout.splits.items():
        frames = sum(episode.frames for episode in layout.episodes[first:end])
        rows.append(f"| {name} | {end - first} | {frames:,} |")
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


def _contents(layout: Layout, record: Mapping[str, Any]) -> str:
    lines = [
        "## Contents of a frame",
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
            "ENU metres, radians, seconds since midnight. `vico.datasets.vectors` makes actions of vectors, and back."
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
_PROGRAM_SOURCE = {"name": "none: drawn by the program", "licence": "that of the program", "attribution": "none"}


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
        for source in world["sources"] or [_PROGRAM_SOURCE]:
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


SCHEMA, VERSION = "vico.dataset", 1
#: What a build of a dataset makes.
DATASET_FOLDER = FolderKind("dataset", "dataset.json", files_of_manifest("dataset.json"))
RECORD, EPISODES, ENTITIES = "dataset.json", "episodes.parquet", "entities.parquet"
_EPISODE_FIELDS = {
    "frames": pa.int64(),
    "agent": pa.string(),
    "kind": pa.string(),
    "person": pa.string(),
    "challenge": pa.string(),
    "category": pa.string(),
    "method": pa.string(),
    "seed": pa.int64(),
    "success": pa.bool_(),
    "persons": pa.list_(pa.string()),
    "instructions": pa.list_(pa.string()),
    "run": pa.string(),
    "producer": pa.string(),
    "gaps": pa.int64(),
}


class _World(BaseModel):
    model_config = ConfigDict(extra="forbid")
    name: str
    digest: str
    episodes: int
    sources: list[dict[str, Any]]


class _Record(BaseModel):
    """``dataset.json``."""

    model_config = ConfigDict(extra="forbid")
    schema_name: Literal["vico.dataset"]
    version: Literal[1]
    producer: str
    format: str
    body: str
    fps: int
    size: int
    outputs: list[str]
    episodes: int
    frames: int
    successes: int
    judged: int
    splits: dict[str, tuple[int, int]]
    features: dict[str, list[str]]
    action: dict[str, Any]
    statuses: dict[str, str]
    worlds: list[_World]
    made: dict[str, Any]
    missing: list[str]
    files: dict[str, str]


class Dataset:
    """A dataset that was written, of any format.

    Parameters
    ----------
    path
        Its folder.

    Raises
    ------
    MissingFileError, SchemaError
        If it is none, damaged, or of another version.
    """

    def __init__(self, path: Path | str) -> None:
        path = Path(path)
        if not (path / RECORD).exists():
            raise MissingFileError(f"{path}: holds no {RECORD}; make a dataset with vico dataset build")
        content = read_json(path / RECORD)
        if not isinstance(content, dict) or content.get("schema_name") != SCHEMA:
            raise SchemaError(f"{path / RECORD}: not a {SCHEMA} file; give the folder of a dataset")
        try:
            self.about = _Record.model_validate(content)
        except ValidationError as error:
            first = error.errors()[0]
            where = ".".join(str(part) for part in first["loc"])
            raise SchemaError(f"{path / RECORD}: {where}: {first['msg']}; build it anew") from None
        if self.about.format not in FORMATS:
            raise SchemaError(f"{path / RECORD}: format {self.about.format!r}; there are {', '.join(FORMATS)}")
        self.path = path
        if self.about.features.get("action") != list(self.form.names):
            raise SchemaError(
                f"{path}: its actions are as {self.about.producer} had them, which has others than this; build it anew"
            )

    def __repr__(self) -> str:
        about = self.about
        return f"Dataset({about.format}: {about.episodes:,} episodes, {about.frames:,} frames; {self.path})"

    @property
    def form(self) -> VectorForm:
        """Form of its action vectors."""
        return action_form_of(**self.about.action)

    def episodes(self) -> list[dict[str, Any]]:
        """Return a record of each episode, in their order.

        Raises
        ------
        SchemaError
            If the table is damaged.
        """
        try:
            rows: list[dict[str, Any]] = pq.read_table(self.path / EPISODES, memory_map=False).to_pylist()
        except (pa.ArrowException, OSError) as error:
            raise SchemaError(
                f"{self.path / EPISODES}: not readable ({' '.join(str(error).split())[:200]}); build it anew"
            ) from None
        return rows

    def entities(self, episode: int) -> dict[int, tuple[str, str]]:
        """Return kind and name of what an episode's segmentation shows, by entity."""
        rows = pq.read_table(self.path / ENTITIES, filters=[("episode_index", "=", episode)]).to_pylist()
        return {row["entity"]: (row["kind"], row["name"]) for row in rows}

    def frames(self, episode: int) -> Iterator[dict[str, Any]]:
        """Yield an episode's frames: values by name (docs/datasets.md), with ``pictures`` by output.

        Raises
        ------
        InputError
            If there is no such episode.
        """
        if not 0 <= episode < self.about.episodes:
            raise InputError(f"{self.path}: no episode {episode}; there are 0 to {self.about.episodes - 1}")
        read = FORMATS[self.about.format].episode_frames
        yield from read(self.path, episode, self.about.outputs, self.about.fps)

    def damaged_files(self) -> list[str]:
        """Return the names of files that are gone, or are not what was written."""
        found: list[str] = []
        for name, digest in sorted(self.about.files.items()):
            path = self.path / name
            if not path.is_file():
                found.append(f"{name}: is gone")
            elif sha256_of(path) != digest:
                found.append(f"{name}: is not what was written")
        return found

    @staticmethod
    def record_of(layout: Layout, made: Mapping[str, Any], missing: Sequence[str]) -> dict[str, Any]:
        """Return what ``dataset.json`` says, but for the files."""
        judged = [one for one in layout.successes if one is not None]
        features = {"observation.state": layout.state_names, "action": list(layout.form.names)}
        if layout.goal_names:
            features["observation.environment_state"] = layout.goal_names
        form = layout.form
        worlds: dict[str, dict[str, Any]] = {}
        for episode in layout.episodes:
            about = episode.about["world"]
            sources = list(episode.about["sources"])
            known = worlds.setdefault(about["digest"], {**about, "episodes": 0, "sources": sources})
            known["episodes"] += 1
        return {
            "schema_name": SCHEMA,
            "version": VERSION,
            "producer": f"vico {__version__}",
            "format": layout.contents.to,
            "body": layout.body,
            "fps": layout.fps,
            "size": layout.contents.size,
            "outputs": list(layout.contents.outputs),
            "episodes": len(layout.episodes),
            "frames": layout.frames,
            "successes": sum(judged),
            "judged": len(judged),
            "splits": {name: list(bounds) for name, bounds in layout.splits.items()},
            "features": features,
            "action": {"robot": form.robot, "width": form.width, "space": form.space},
            "statuses": {str(value): name for value, name in STATUSES.items()},
            "worlds": sorted(worlds.values(), key=lambda world: (world["name"], world["digest"])),
            "made": dict(made),
            "missing": list(missing),
        }


def write_tables(folder: Path, layout: Layout) -> None:
    """Write ``episodes.parquet`` and ``entities.parquet``."""
    columns: dict[str, Any] = {
        "episode_index": pa.array(range(len(layout.episodes)), pa.int64()),
        "split": pa.array([layout.split_of(k) for k in range(len(layout.episodes))], pa.string()),
        "world": pa.array([episode.about["world"]["name"] for episode in layout.episodes], pa.string()),
        "world_digest": pa.array([episode.about["world"]["digest"] for episode in layout.episodes], pa.string()),
    }
    for name, kind in _EPISODE_FIELDS.items():
        columns[name] = pa.array([episode.about[name] for episode in layout.episodes], kind)
    pq.write_table(pa.table(columns), folder / EPISODES, compression="zstd")
    rows = [
        {"episode_index": k} | one for k, episode in enumerate(layout.episodes) for one in episode.about["entities"]
    ]
    schema = pa.schema({"episode_index": pa.int64(), "entity": pa.int64(), "kind": pa.string(), "name": pa.string()})
    pq.write_table(pa.Table.from_pylist(rows, schema), folder / ENTITIES, compression="zstd")
