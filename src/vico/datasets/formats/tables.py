"""Plain Parquet: a file a split and a hundred megabytes, a row a frame, pictures as encoded files in columns.

``rgb`` holds PNG, ``depth`` (float32, metres) and ``segmentation`` (int32, entities) hold ``.npy``.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from vico.datasets.formats.lerobot import frame_table
from vico.datasets.layout import Layout
from vico.datasets.pictures import array_of_blob
from vico.io.files import write_json

#: A file is closed once it is larger, MB.
FILE_MB = 100


def assemble(out: Path, layout: Layout) -> None:
    """Write a dataset into a folder."""
    writer: pq.ParquetWriter | None = None
    split, number, path = "", 0, out
    try:
        for columns, episode in zip(layout.columns(), layout.episodes, strict=True):
            table = frame_table(columns, texts=True)
            task = pa.array([layout.instructions[k] for k in columns.task.tolist()], pa.string())
            table = table.append_column("task", task)
            if layout.contents.outputs:
                pictures = pq.read_table(episode.pictures.blobs, memory_map=False)
                for output in layout.contents.outputs:
                    table = table.append_column(output, pictures[output])
            mine = layout.split_of(columns.index)
            if writer is None or mine != split or path.stat().st_size > FILE_MB * 1_000_000:
                if writer is not None:
                    writer.close()
                number = number + 1 if mine == split else 0
                split, path = mine, out / mine / f"{number:06d}.parquet"
                path.parent.mkdir(parents=True, exist_ok=True)
                writer = pq.ParquetWriter(path, table.schema, compression="zstd")
            writer.write_table(table)
    finally:
        if writer is not None:
            writer.close()
    write_json(out / "stats.json", layout.statistics())


def episode_frames(folder: Path, index: int, outputs: Sequence[str], fps: int) -> Iterator[dict[str, Any]]:
    """Yield an episode's frames: values by name, with ``pictures`` by output."""
    for path in sorted(folder.glob("*/*.parquet")):
        table = pq.read_table(path, filters=[("episode_index", "=", index)])
        for row in table.to_pylist():
            yield row | {"pictures": {output: array_of_blob(output, row.pop(output)) for output in outputs}}
