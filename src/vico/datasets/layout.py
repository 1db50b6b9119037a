"""Layout that all formats have in common: the episodes in their order, the splits, the names of what vectors hold.

A part is what came of one episode, in a folder that appears whole or not at all; a layout puts parts together.
"""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from vico.datasets.demonstrations import Demonstration
from vico.datasets.episodes import Statistics, colour_statistics, depth_statistics, vector_statistics
from vico.datasets.pictures import PictureFiles
from vico.datasets.vectors import GOAL, VectorForm, action_form_of
from vico.errors import EmptyInputError, InputError, SchemaError
from vico.io.files import read_json, write_json
from vico.rules import ActionStatus
from vico.sim.recording.schema import written_folder

#: Counts up whenever a part would hold something else than before.
PART_VERSION = 2
_PART = "part.json"


@dataclass(frozen=True)
class Contents:
    """Contents of every frame of a dataset.

    Attributes
    ----------
    to
        Name of the format (`vico.datasets.formats.FORMATS`).
    outputs
        Pictures, some of `vico.datasets.pictures.PICTURES`; may be none.
    size
        Their side, pixels.
    agents
        Names of agents, or of kinds (``residents``, ``assistants``, ``robots``); empty: the assistants if there are
        any, else all whose pictures were recorded.
    instruction
        What to say where neither task nor schedule says what was asked for.
    drop_below
        Of increments: steps whose largest is smaller are left out, rad and metres.
    """

    to: str
    outputs: tuple[str, ...] = ("rgb",)
    size: int = 128
    agents: tuple[str, ...] = ()
    instruction: str = ""
    drop_below: float = 0.0

    def record(self) -> dict[str, Any]:
        """Return it as JSON; `of` makes the same of it."""
        return {name: list(value) if isinstance(value, tuple) else value for name, value in asdict(self).items()}

    @classmethod
    def of(cls, record: Mapping[str, Any]) -> Contents:
        """Return what `record` returned as JSON."""
        values: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in record.items()}
        return cls(**values)


@dataclass(frozen=True)
class PartEpisode:
    """One demonstration of a part.

    Attributes
    ----------
    folder, stem
        Where its files are, and what their names begin with.
    about
        What is said of it (JSON); see `episode_record`.
    """

    folder: Path
    stem: str
    about: Mapping[str, Any]

    @property
    def frames(self) -> int:
        """Number of frames."""
        return int(self.about["frames"])

    def table(self) -> pa.Table:
        """Return a row a frame: step, state, action, goal, text, status, instruction."""
        return pq.read_table(self.folder / f"{self.stem}.parquet", memory_map=False)

    @property
    def pictures(self) -> PictureFiles:
        """Its encoded pictures."""
        return PictureFiles(self.folder, self.stem)


def key_of(content: Mapping[str, Any]) -> str:
    """Return a digest of all that decides a part."""
    return hashlib.sha256(json.dumps({"part": PART_VERSION, **content}, sort_keys=True).encode()).hexdigest()


def write_part(
    folder: Path, key: str, episodes: Sequence[tuple[Mapping[str, Any], Demonstration]], staged: Path
) -> None:
    """Write what came of an episode; the folder appears when all of it is there.

    Parameters
    ----------
    episodes
        What is said of each demonstration, and the demonstration.
    staged
        Folder with its encoded pictures, which are moved.
    """
    with written_folder(folder) as work:
        for path in sorted(staged.iterdir()):
            shutil.move(path, work / path.name)
        for k, (_, demonstration) in enumerate(episodes):
            pq.write_table(table_of(demonstration), work / f"{k}.parquet", compression="zstd")
        write_json(work / _PART, {"version": PART_VERSION, "key": key, "episodes": [about for about, _ in episodes]})


def read_part(folder: Path, key: str) -> list[PartEpisode] | None:
    """Return the demonstrations of a part; None if there is none of that key.

    Raises
    ------
    SchemaError
        If it is damaged.
    """
    if not (folder / _PART).exists():
        return None
    content = read_json(folder / _PART)
    if not isinstance(content, dict) or (content.get("version"), content.get("key")) != (PART_VERSION, key):
        return None
    if not isinstance(content.get("episodes"), list):
        raise SchemaError(f"{folder / _PART}: lists no episodes; delete {folder} and give the same command again")
    return [PartEpisode(folder, str(k), about) for k, about in enumerate(content["episodes"])]


def table_of(demonstration: Demonstration) -> pa.Table:
    """Return a demonstration's numbers as a table, a row a frame."""
    columns: dict[str, Any] = {
        "step": pa.array(demonstration.steps, pa.int64()),
        "state": vectors(demonstration.state),
        "action": vectors(demonstration.action),
        "text": pa.array(demonstration.text, pa.string()),
        "status": pa.array(demonstration.status, pa.int64()),
        "instruction": pa.array(demonstration.instructions, pa.string()),
    }
    if demonstration.goal is not None:
        columns["goal"] = vectors(demonstration.goal)
    return pa.table(columns)


def vectors(values: NDArray[np.float32]) -> pa.FixedSizeListArray:
    """Return vectors as a column of lists of a fixed length."""
    flat = pa.array(np.ascontiguousarray(values, np.float32).reshape(-1), pa.float32())
    return pa.FixedSizeListArray.from_arrays(flat, values.shape[1])


def array_of(table: pa.Table, name: str) -> NDArray[np.float32]:
    """Undo `vectors`."""
    column = table[name].combine_chunks()
    return np.asarray(column.flatten().to_numpy(zero_copy_only=False), np.float32).reshape(len(table), -1)


#: What has to be the same in all episodes of a dataset, and what to do about it.
_SAME = {
    "body": "choose --agents of one kind",
    "fps": "choose --agents that act equally often",
    "state_names": "choose --agents of one kind",
    "width": "choose --agents of one kind",
    "goal": "choose runs that all have a task, or none",
}


@dataclass(frozen=True)
class Layout:
    """A dataset before it is written.

    Attributes
    ----------
    contents
        What every frame holds.
    episodes
        In their order: those of a split follow each other.
    splits
        First episode and the one after the last, by name.
    clip
        Share of the smallest and of the largest actions that are cut to the next one, each number by itself.
    """

    contents: Contents
    episodes: Sequence[PartEpisode]
    splits: Mapping[str, tuple[int, int]]
    clip: float = 0.0

    def __post_init__(self) -> None:
        if not self.episodes:
            raise EmptyInputError("dataset: there is no episode; nothing to write")
        first = self.episodes[0].about
        for name, advice in _SAME.items():
            for episode in self.episodes:
                if episode.about[name] != first[name]:
                    raise InputError(
                        f"dataset: {first['agent']} and {episode.about['agent']} differ in {name} "
                        f"({_short(first[name])} and {_short(episode.about[name])}); {advice}"
                    )

    @property
    def fps(self) -> int:
        """Frames a second of simulated time."""
        return int(self.episodes[0].about["fps"])

    @property
    def body(self) -> str:
        """Kind of body that acts: ``person``, or a robot's model."""
        return str(self.episodes[0].about["body"])

    @property
    def state_names(self) -> list[str]:
        """Names of the numbers of ``observation.state``."""
        return list(self.episodes[0].about["state_names"])

    @property
    def goal_names(self) -> list[str]:
        """Names of the numbers of ``observation.environment_state``; empty without tasks."""
        return list(GOAL) if self.episodes[0].about["goal"] else []

    @property
    def form(self) -> VectorForm:
        """Form that makes actions of vectors, and vectors of actions."""
        about = self.episodes[0].about
        return action_form_of(robot=self.body != "person", width=about["width"], space=about["space"])

    @property
    def frames(self) -> int:
        """How many there are."""
        return sum(episode.frames for episode in self.episodes)

    @cached_property
    def instructions(self) -> list[str]:
        """All that was asked for, in words, in the order of their first mention."""
        return list(dict.fromkeys(text for episode in self.episodes for text in episode.about["instructions"]))

    @property
    def successes(self) -> list[bool | None]:
        """Whether each episode came to what was asked for; None where nobody judged."""
        return [episode.about["success"] for episode in self.episodes]

    def split_of(self, index: int) -> str:
        """Return the split of an episode."""
        return next(name for name, (first, end) in self.splits.items() if first <= index < end)

    @cached_property
    def action_bounds(self) -> tuple[NDArray[np.float32], NDArray[np.float32]] | None:
        """Smallest and largest that actions are cut to, shape ``(d,)`` each; None where they are not."""
        if not self.clip:
            return None
        actions = np.concatenate([array_of(episode.table(), "action") for episode in self.episodes])
        low, high = np.quantile(actions, [self.clip, 1.0 - self.clip], axis=0).astype(np.float32)
        return low, high

    def columns(self) -> Iterator[EpisodeColumns]:
        """Yield each episode's numbers."""
        number = {text: k for k, text in enumerate(self.instructions)}
        before = 0
        for index, episode in enumerate(self.episodes):
            columns = EpisodeColumns.of(index, before, episode, number, goal=bool(self.goal_names))
            yield columns if self.action_bounds is None else columns.with_clipped_actions(*self.action_bounds)
            before += episode.frames

    def statistics(self) -> dict[str, Statistics]:
        """Return statistics over all episodes, by feature; vectors exactly, over all frames at once."""
        parts: dict[str, list[NDArray[Any]]] = {}
        for columns in self.columns():
            for name, values in columns.numbers().items():
                parts.setdefault(name, []).append(values)
        found = {name: vector_statistics(np.concatenate(values)) for name, values in parts.items()}
        return found | self.picture_statistics(self.episodes)

    def picture_statistics(self, episodes: Sequence[PartEpisode]) -> dict[str, Statistics]:
        """Return statistics of the pictures of some episodes, by feature."""
        tallies = [(episode.about["tally"], episode.frames) for episode in episodes]
        frames = sum(count for _, count in tallies)
        found: dict[str, Statistics] = {}
        if "rgb" in self.contents.outputs:
            counts = sum(np.array(tally["rgb"], np.int64) for tally, _ in tallies)
            found[IMAGES["rgb"]] = colour_statistics(np.asarray(counts), frames)
        if "depth" in self.contents.outputs:
            found[IMAGES["depth"]] = depth_statistics([tally["depth"] for tally, _ in tallies], frames)
        return found


#: What trainers call each picture.
IMAGES = {
    "rgb": "observation.images.ego",
    "depth": "observation.depth",
    "segmentation": "observation.segmentation",
}


@dataclass(frozen=True)
class EpisodeColumns:
    """An episode's numbers, a row a frame, under the names that trainers know.

    Attributes
    ----------
    index
        Of the episode.
    first
        Index of its first frame in the dataset.
    vectors
        float32, shape ``(n, d)``, by name.
    text
        Of each action.
    task
        Number of each frame's instruction.
    step, status, done, success
        Recorded step; how the action went; whether the frame is the last; whether it ended with all done.
    fps
        Frames a second.
    """

    index: int
    first: int
    vectors: Mapping[str, NDArray[np.float32]]
    text: Sequence[str]
    task: NDArray[np.int64]
    step: NDArray[np.int64]
    status: NDArray[np.int64]
    done: NDArray[np.bool_]
    success: NDArray[np.bool_]
    fps: int

    @classmethod
    def of(
        cls, index: int, first: int, episode: PartEpisode, number: Mapping[str, int], *, goal: bool
    ) -> EpisodeColumns:
        """Read them from a part."""
        table = episode.table()
        names = {"observation.state": "state", "action": "action"}
        if goal:
            names["observation.environment_state"] = "goal"
        done = np.arange(len(table)) == len(table) - 1
        return cls(
            index,
            first,
            {name: array_of(table, column) for name, column in names.items()},
            table["text"].to_pylist(),
            np.array([number[text] for text in table["instruction"].to_pylist()], np.int64),
            table["step"].to_numpy(),
            table["status"].to_numpy(),
            done,
            done & (episode.about["success"] is True),
            int(episode.about["fps"]),
        )

    def __len__(self) -> int:
        return len(self.step)

    @property
    def timestamp(self) -> NDArray[np.float32]:
        """Seconds since the episode's first frame, by the frames."""
        return (np.arange(len(self)) / self.fps).astype(np.float32)

    def with_clipped_actions(self, low: NDArray[np.float32], high: NDArray[np.float32]) -> EpisodeColumns:
        """Return them with actions held within bounds."""
        return replace(self, vectors={**self.vectors, "action": np.clip(self.vectors["action"], low, high)})

    def numbers(self) -> dict[str, NDArray[Any]]:
        """Return what statistics are told of."""
        n = len(self)
        return {
            **self.vectors,
            "timestamp": self.timestamp,
            "frame_index": np.arange(n),
            "episode_index": np.full(n, self.index),
            "index": self.first + np.arange(n),
            "task_index": self.task,
            "next.done": self.done,
            "next.success": self.success,
            "action.status": self.status,
            "step": self.step,
        }


#: Names of the numbers of ``action.status``.
STATUSES = {status.value: status.name.lower() for status in ActionStatus}


def _short(value: Any) -> str:
    text = str(value)
    return text if len(text) <= 40 else f"{text[:37]}..."
