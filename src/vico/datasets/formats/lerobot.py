"""LeRobot dataset v3.0, written with pyarrow and PyAV alone.

::

    meta/info.json                      features, counts, splits, where files are
    meta/stats.json                     min, max, mean, std, count, quantiles by feature
    meta/tasks.parquet                  instructions by number
    meta/episodes/chunk-*/file-*.parquet  where each episode is, and its statistics
    data/chunk-*/file-*.parquet         a row a frame
    videos/KEY/chunk-*/file-*.mp4       many episodes a file

Depth and entities are exact: arrays in the data files, of shape ``(size, size)``.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from vico.datasets.episodes import vector_statistics
from vico.datasets.layout import IMAGES, STATUSES, EpisodeColumns, Layout, PartEpisode, vectors
from vico.datasets.pictures import frames_of_video, joined_video
from vico.io.files import write_json

VERSION = "v3.0"
# Files are filled up as LeRobot does it.
DATA_MB = 100  # MB of a data file
VIDEO_MB = 200  # MB of a video
CHUNK = 1000  # files of a chunk
DATA = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
VIDEO = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
EPISODES = "meta/episodes/chunk-000/file-000.parquet"
TASKS = "meta/tasks.parquet"
_CODEC = {"video.codec": "h264", "video.pix_fmt": "yuv420p", "video.is_depth_map": False, "has_audio": False}
_EXACT = {"depth": "float32", "segmentation": "int32"}


def assemble(out: Path, layout: Layout) -> None:
    """Write a dataset into a folder."""
    texts = any(any(columns.text) for columns in layout.columns())
    features = _features(layout, texts=texts)
    places = _write_data(out, layout, texts=texts)
    videos = _write_videos(out, layout) if "rgb" in layout.contents.outputs else []
    _write_tasks(out / TASKS, layout.instructions)
    _write_episodes(out / EPISODES, layout, places, videos)
    write_json(out / "meta" / "stats.json", layout.statistics())
    write_json(
        out / "meta" / "info.json",
        {
            "codebase_version": VERSION,
            "robot_type": f"vico_{layout.body}",
            "total_episodes": len(layout.episodes),
            "total_frames": layout.frames,
            "total_tasks": len(layout.instructions),
            "chunks_size": CHUNK,
            "data_files_size_in_mb": DATA_MB,
            "video_files_size_in_mb": VIDEO_MB,
            "fps": layout.fps,
            "splits": {name: f"{first}:{end}" for name, (first, end) in layout.splits.items()},
            "data_path": DATA,
            "video_path": VIDEO if "rgb" in layout.contents.outputs else None,
            "features": features,
        },
    )


def _features(layout: Layout, *, texts: bool) -> dict[str, Any]:
    """Return what ``info.json`` says of each feature."""

    def vector(names: Sequence[str]) -> dict[str, Any]:
        return {"dtype": "float32", "shape": [len(names)], "names": list(names)}

    def single(dtype: str, names: Sequence[str] | None = None) -> dict[str, Any]:
        return {"dtype": dtype, "shape": [1], "names": None if names is None else list(names)}

    size = layout.contents.size
    found = {"observation.state": vector(layout.state_names)}
    if layout.goal_names:
        found["observation.environment_state"] = vector(layout.goal_names)
    if "rgb" in layout.contents.outputs:
        video = {"video.height": size, "video.width": size, "video.channels": 3, "video.fps": layout.fps}
        info = _CODEC | video
        names = ["height", "width", "channels"]
        found[IMAGES["rgb"]] = {"dtype": "video", "shape": [size, size, 3], "names": names, "info": info}
    for output, dtype in _EXACT.items():
        if output in layout.contents.outputs:
            found[IMAGES[output]] = {"dtype": dtype, "shape": [size, size], "names": ["height", "width"]}
    found["action"] = vector(layout.form.names)
    if texts:
        found["action.text"] = single("string")
    found["action.status"] = single("int64", [f"{value} {name}" for value, name in STATUSES.items()])
    found |= {"next.done": single("bool"), "next.success": single("bool"), "step": single("int64")}
    found["timestamp"] = single("float32")
    return found | {name: single("int64") for name in ("frame_index", "episode_index", "index", "task_index")}


def frame_table(columns: EpisodeColumns, *, texts: bool) -> pa.Table:
    """Return an episode's numbers as rows of a data file."""
    n = len(columns)
    found: dict[str, Any] = {name: vectors(values) for name, values in columns.vectors.items()}
    if texts:
        found["action.text"] = pa.array(columns.text, pa.string())
    found |= {
        "action.status": pa.array(columns.status, pa.int64()),
        "next.done": pa.array(columns.done, pa.bool_()),
        "next.success": pa.array(columns.success, pa.bool_()),
        "step": pa.array(columns.step, pa.int64()),
        "timestamp": pa.array(columns.timestamp, pa.float32()),
        "frame_index": pa.array(np.arange(n), pa.int64()),
        "episode_index": pa.array(np.full(n, columns.index), pa.int64()),
        "index": pa.array(columns.first + np.arange(n), pa.int64()),
        "task_index": pa.array(columns.task, pa.int64()),
    }
    return pa.table(found)


def _exact_column(pictures: NDArray[Any], kind: pa.DataType) -> pa.Array:
    """Return pictures as nested lists, which is how trainers' readers want arrays of two dimensions."""
    n, height, width = pictures.shape
    flat = pa.array(np.ascontiguousarray(pictures).reshape(-1), kind)
    rows = pa.ListArray.from_arrays(pa.array(np.arange(0, n * height * width + 1, width), pa.int32()), flat)
    return pa.ListArray.from_arrays(pa.array(np.arange(0, n * height + 1, height), pa.int32()), rows)


def _write_data(out: Path, layout: Layout, *, texts: bool) -> list[int]:
    """Write the data files; return in which of them each episode is."""
    places: list[int] = []
    number, writer, path = -1, None, out
    try:
        for columns, episode in zip(layout.columns(), layout.episodes, strict=True):
            table = frame_table(columns, texts=texts)
            for output, dtype in _EXACT.items():
                if output in layout.contents.outputs:
                    pictures = np.load(episode.pictures.exact(output), mmap_mode="r")
                    kind = pa.float32() if dtype == "float32" else pa.int32()
                    table = table.append_column(IMAGES[output], _exact_column(pictures, kind))
            if writer is None or path.stat().st_size > DATA_MB * 1_000_000:
                if writer is not None:
                    writer.close()
                number += 1
                path = out / DATA.format(chunk_index=number // CHUNK, file_index=number % CHUNK)
                path.parent.mkdir(parents=True, exist_ok=True)
                writer = pq.ParquetWriter(path, table.schema, compression="zstd")
            writer.write_table(table)
            places.append(number)
    finally:
        if writer is not None:
            writer.close()
    return places


def _write_videos(out: Path, layout: Layout) -> list[tuple[int, int]]:
    """Write the films; return for each episode in which it is, and after how many frames of it it begins."""
    groups: list[list[PartEpisode]] = []
    size = 0
    for episode in layout.episodes:
        mine = episode.pictures.video.stat().st_size
        if not groups or size + mine > VIDEO_MB * 1_000_000:
            groups.append([])
            size = 0
        groups[-1].append(episode)
        size += mine
    places: list[tuple[int, int]] = []
    for number, group in enumerate(groups):
        names = {"chunk_index": number // CHUNK, "file_index": number % CHUNK}
        path = out / VIDEO.format(video_key=IMAGES["rgb"], **names)
        path.parent.mkdir(parents=True, exist_ok=True)
        lengths = [episode.frames for episode in group]
        joined_video(path, [episode.pictures.video for episode in group], lengths, fps=layout.fps)
        starts = np.cumsum([0, *lengths[:-1]])
        places += [(number, int(start)) for start in starts]
    return places


def _write_tasks(path: Path, instructions: Sequence[str]) -> None:
    """Write instructions by number; the text is the table's index, as pandas keeps one."""
    table = pa.table(
        {
            "task_index": pa.array(range(len(instructions)), pa.int64()),
            "__index_level_0__": pa.array(instructions, pa.string()),
        }
    )
    columns = [
        {"name": name, "field_name": field, "pandas_type": kind, "numpy_type": numpy, "metadata": None}
        for name, field, kind, numpy in (
            ("task_index", "task_index", "int64", "int64"),
            (None, "__index_level_0__", "unicode", "object"),
        )
    ]
    about = {
        "index_columns": ["__index_level_0__"],
        "column_indexes": [],
        "columns": columns,
        "creator": {"library": "pyarrow", "version": pa.__version__},
        "pandas_version": "2.2.0",
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(table.replace_schema_metadata({"pandas": json.dumps(about)}), path)


def _write_episodes(path: Path, layout: Layout, places: Sequence[int], videos: Sequence[tuple[int, int]]) -> None:
    rows: list[dict[str, Any]] = []
    for columns, episode in zip(layout.columns(), layout.episodes, strict=True):
        n, place = len(columns), places[columns.index]
        row: dict[str, Any] = {
            "episode_index": columns.index,
            "tasks": [layout.instructions[k] for k in dict.fromkeys(columns.task.tolist())],
            "length": n,
            "data/chunk_index": place // CHUNK,
            "data/file_index": place % CHUNK,
            "dataset_from_index": columns.first,
            "dataset_to_index": columns.first + n,
            "meta/episodes/chunk_index": 0,
            "meta/episodes/file_index": 0,
        }
        if videos:
            number, start = videos[columns.index]
            prefix = f"videos/{IMAGES['rgb']}"
            row |= {
                f"{prefix}/chunk_index": number // CHUNK,
                f"{prefix}/file_index": number % CHUNK,
                f"{prefix}/from_timestamp": start / layout.fps,
                f"{prefix}/to_timestamp": (start + n) / layout.fps,
            }
        statistics = {name: vector_statistics(values) for name, values in columns.numbers().items()}
        statistics |= layout.picture_statistics([episode])
        row |= {f"stats/{name}/{key}": value for name, one in statistics.items() for key, value in one.items()}
        rows.append(row)
    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(pa.Table.from_pylist(rows), path, compression="zstd")


def episode_frames(folder: Path, index: int, outputs: Sequence[str], fps: int) -> Iterator[dict[str, Any]]:
    """Yield an episode's frames: a data row as a dict, with ``pictures`` by output."""
    row = pq.read_table(folder / EPISODES, filters=[("episode_index", "=", index)]).to_pylist()[0]
    data = DATA.format(chunk_index=row["data/chunk_index"], file_index=row["data/file_index"])
    table = pq.read_table(folder / data, filters=[("episode_index", "=", index)])
    exact = {output: np.array(table[IMAGES[output]].to_pylist()) for output in outputs if output in _EXACT}
    table = table.drop_columns([IMAGES[output] for output in exact])
    films: Iterator[NDArray[np.uint8]] = iter(())
    if "rgb" in outputs:
        prefix = f"videos/{IMAGES['rgb']}"
        names = {"chunk_index": row[f"{prefix}/chunk_index"], "file_index": row[f"{prefix}/file_index"]}
        path = folder / VIDEO.format(video_key=IMAGES["rgb"], **names)
        films = frames_of_video(path, round(row[f"{prefix}/from_timestamp"] * fps), row["length"], fps=fps)
    for k, values in enumerate(table.to_pylist()):
        pictures: dict[str, Any] = {output: array[k] for output, array in exact.items()}
        if "rgb" in outputs:
            pictures["rgb"] = next(films, None)
        yield values | {"pictures": pictures}
