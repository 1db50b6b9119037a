"""Parts of a dataset that is being built: what came of one episode, in a folder that appears whole or not at all."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from vico.datasets.demonstrations import Demonstration
from vico.datasets.formats.pictures import PictureFiles
from vico.errors import SchemaError
from vico.io.files import read_json, write_json
from vico.sim.recording.schema import written_folder

#: Counts up whenever a part would hold something else than before.
VERSION = 2
_PART = "part.json"


@dataclass(frozen=True)
class Contents:
    """What a dataset holds of every frame.

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
        """How many it has."""
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
    return hashlib.sha256(json.dumps({"part": VERSION, **content}, sort_keys=True).encode()).hexdigest()


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
        write_json(work / _PART, {"version": VERSION, "key": key, "episodes": [about for about, _ in episodes]})


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
    if not isinstance(content, dict) or (content.get("version"), content.get("key")) != (VERSION, key):
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
