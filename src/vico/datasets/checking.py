"""Looking through a whole dataset for what is wrong with it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np

from vico.datasets.folder import Dataset
from vico.datasets.pictures import PICTURES
from vico.errors import InputError, VicoError

Report = Callable[[int, int], None]


def findings_of(dataset: Dataset, *, report: Report | None = None) -> list[str]:
    """Return what is wrong with a dataset, in words; empty if nothing is.

    Every file is hashed; every frame is read, its pictures decoded, its vectors looked at, its action decoded.
    """
    found = dataset.damaged_files()
    if found:
        return found  # whatever else is wrong follows from it
    rows = dataset.episodes()
    found += _counts(dataset, rows)
    for row in rows:
        found += _of_episode(dataset, row)
        if report is not None:
            report(row["episode_index"] + 1, len(rows))
    return found


def _counts(dataset: Dataset, rows: list[dict[str, Any]]) -> Iterable[str]:
    about = dataset.about
    if [row["episode_index"] for row in rows] != list(range(about.episodes)):
        yield f"episodes.parquet: lists {len(rows)} episodes; dataset.json says {about.episodes}"
    if (frames := sum(row["frames"] for row in rows)) != about.frames:
        yield f"episodes.parquet: {frames} frames; dataset.json says {about.frames}"
    covered = [k for first, end in about.splits.values() for k in range(first, end)]
    if sorted(covered) != list(range(about.episodes)):
        yield "dataset.json: the splits do not hold each episode once"


def _of_episode(dataset: Dataset, row: Mapping[str, Any]) -> list[str]:
    index = row["episode_index"]
    found: list[str] = []
    count = 0
    try:
        for frame in dataset.frames(index):
            if wrong := _of_frame(dataset, frame, count, last=count == row["frames"] - 1):
                found.append(f"episode {index}, frame {count}: {wrong}")
            count += 1
    except (VicoError, OSError, KeyError, ValueError) as error:
        return [f"episode {index}, frame {count}: cannot be read ({' '.join(str(error).split())[:200]})"]
    if count != row["frames"]:
        found.append(f"episode {index}: {count} frames; episodes.parquet says {row['frames']}")
    return found[:5]


def _of_frame(dataset: Dataset, frame: Mapping[str, Any], place: int, *, last: bool) -> str:
    """Say what is wrong with a frame; empty if nothing is."""
    about = dataset.about
    if frame["frame_index"] != place or abs(frame["timestamp"] - place / about.fps) > 1e-4:
        return f"has the index {frame['frame_index']} and the time {frame['timestamp']:g} s"
    if frame["next.done"] != last:
        return "says that the episode is over" if frame["next.done"] else "does not say that the episode is over"
    for name, names in about.features.items():
        values = np.asarray(frame[name], np.float64)
        if values.shape != (len(names),) or not np.isfinite(values).all():
            return f"{name} is not {len(names)} finite numbers"
    try:
        dataset.form.decode(frame["action"], (0.0, 0.0, 0.0, 0.0), frame.get("action.text") or "")
    except InputError as error:
        return str(error)
    return _of_pictures(dataset, frame["pictures"])


def _of_pictures(dataset: Dataset, pictures: Mapping[str, Any]) -> str:
    size = dataset.about.size
    for output in dataset.about.outputs:
        picture, (kind, colours) = pictures.get(output), PICTURES[output]
        shape = (size, size, colours) if colours > 1 else (size, size)
        if picture is None:
            return f"has no {output}"
        if picture.shape != shape:
            return f"{output} has the shape {picture.shape}, not {shape}"
        if kind is np.float32 and np.isnan(picture).any():
            return f"{output} is not a number at some pixels"
    return ""
