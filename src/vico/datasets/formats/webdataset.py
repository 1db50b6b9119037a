"""WebDataset: tar files with a handful of files for each frame, read in a row.

::

    train-000000.tar
        ep000000_00000.json              task, action's text, indices
        ep000000_00000.state.npy         float32; likewise action.npy, goal.npy
        ep000000_00000.rgb.png
        ep000000_00000.depth.npy         float32, metres
        ep000000_00000.segmentation.npy  int32, entities
"""

from __future__ import annotations

import io
import json
import tarfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq

from vico.datasets.layout import Layout
from vico.datasets.pictures import array_of_blob, npy_of
from vico.io.files import read_json, write_json

#: A shard is closed once it is larger, MB.
SHARD_MB = 256
INDEX = "shards.json"
_VECTORS = {"observation.state": "state", "action": "action", "observation.environment_state": "goal"}
_ENDINGS = {"rgb": "rgb.png", "depth": "depth.npy", "segmentation": "segmentation.npy"}


def assemble(out: Path, layout: Layout) -> None:
    """Write a dataset into a folder; ``shards.json`` tells in which shard each episode is."""
    shards: dict[str, list[int]] = {}
    tar: tarfile.TarFile | None = None
    split, number, path = "", 0, out
    try:
        for columns, episode in zip(layout.columns(), layout.episodes, strict=True):
            mine = layout.split_of(columns.index)
            if tar is None or mine != split or path.stat().st_size > SHARD_MB * 1_000_000:
                if tar is not None:
                    tar.close()
                number = number + 1 if mine == split else 0
                split, path = mine, out / f"{mine}-{number:06d}.tar"
                tar = tarfile.open(path, "w", format=tarfile.USTAR_FORMAT)  # noqa: SIM115
                shards[path.name] = []
            shards[path.name].append(columns.index)
            pictures = pq.read_table(episode.pictures.blobs, memory_map=False) if layout.contents.outputs else None
            for frame in range(len(columns)):
                blobs = {} if pictures is None else {n: pictures[n][frame].as_py() for n in layout.contents.outputs}
                key = f"ep{columns.index:06d}_{frame:05d}"
                about = {
                    "episode_index": columns.index,
                    "frame_index": frame,
                    "timestamp": float(columns.timestamp[frame]),
                    "step": int(columns.step[frame]),
                    "task": layout.instructions[int(columns.task[frame])],
                    "action.text": columns.text[frame],
                    "action.status": int(columns.status[frame]),
                    "next.done": bool(columns.done[frame]),
                    "next.success": bool(columns.success[frame]),
                }
                _add(tar, f"{key}.json", json.dumps(about, sort_keys=True, ensure_ascii=False).encode())
                for name, values in columns.vectors.items():
                    _add(tar, f"{key}.{_VECTORS[name]}.npy", npy_of(values[frame]))
                for output, blob in blobs.items():
                    _add(tar, f"{key}.{_ENDINGS[output]}", blob)
    finally:
        if tar is not None:
            tar.close()
    write_json(out / INDEX, shards)
    write_json(out / "stats.json", layout.statistics())


def _add(tar: tarfile.TarFile, name: str, content: bytes) -> None:
    about = tarfile.TarInfo(name)
    about.size = len(content)
    tar.addfile(about, io.BytesIO(content))


def samples(path: Path) -> Iterator[dict[str, bytes]]:
    """Yield the samples of a shard: content by ending, and ``__key__``; files of a sample follow each other."""
    found: dict[str, bytes] = {}
    with tarfile.open(path) as tar:
        for member in tar:
            key, _, ending = member.name.partition(".")
            if found and found["__key__"] != key.encode():
                yield found
                found = {}
            file = tar.extractfile(member)
            assert file is not None
            found |= {"__key__": key.encode(), ending: file.read()}
    if found:
        yield found


def episode_frames(folder: Path, index: int, outputs: Sequence[str], fps: int) -> Iterator[dict[str, Any]]:
    """Yield an episode's frames: values by name, with ``pictures`` by output."""
    shards: Mapping[str, Sequence[int]] = read_json(folder / INDEX)
    shard = next(name for name, episodes in shards.items() if index in episodes)
    key = f"ep{index:06d}_".encode()
    for sample in samples(folder / shard):
        if not sample["__key__"].startswith(key):
            continue
        about = json.loads(sample["json"])
        for name, ending in _VECTORS.items():
            if f"{ending}.npy" in sample:
                about[name] = np.load(io.BytesIO(sample[f"{ending}.npy"]), allow_pickle=False).tolist()
        yield about | {"pictures": {output: array_of_blob(output, sample[_ENDINGS[output]]) for output in outputs}}
