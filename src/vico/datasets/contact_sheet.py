"""A contact sheet of an episode: frames in rows, what was asked for above, what was done below each."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from vico.datasets.actions import described
from vico.datasets.folder import Dataset
from vico.errors import InputError
from vico.io.files import new_file

#: Depth is drawn bright near and dark far, up to so many metres.
FARTHEST = 50.0
_SIDE, _GAP, _LINE, _COLUMNS = 192, 8, 15, 4
_PAPER, _INK, _FAINT = (255, 255, 255), (20, 20, 20), (110, 110, 110)
_CAPTION_LINES = 2


def write_contact_sheet(path: Path, dataset: Dataset, episode: int, *, frames: int = 12) -> list[dict[str, Any]]:
    """Draw frames of an episode, evenly over it; return their values.

    Parameters
    ----------
    path
        Picture to write, PNG.
    frames
        How many at most.

    Raises
    ------
    InputError
        If there is no such episode, or the number of frames is out of range.
    """
    if not 1 <= frames <= 200:
        raise InputError(f"dataset show: {frames} frames; give 1 to 200")
    if path.suffix.lower() != ".png":
        raise InputError(f"dataset show: {path.name}: pictures are written as .png; give such a name")
    length = _length(dataset, episode)
    wanted = set(np.unique(np.linspace(0, length - 1, min(frames, length)).round().astype(int)).tolist())
    chosen = [frame for k, frame in enumerate(dataset.frames(episode)) if k in wanted]
    sheet = _drawn(dataset, episode, chosen, length)
    with new_file(path) as temporary:
        sheet.save(temporary, "PNG")
    return [
        {key: value for key, value in frame.items() if key != "pictures"} | {"does": _done(dataset, frame)}
        for frame in chosen
    ]


def _length(dataset: Dataset, episode: int) -> int:
    rows = dataset.episodes()
    if not 0 <= episode < len(rows):
        raise InputError(f"{dataset.path}: no episode {episode}; there are 0 to {len(rows) - 1}")
    return int(rows[episode]["frames"])


def _drawn(dataset: Dataset, episode: int, chosen: Sequence[Mapping[str, Any]], length: int) -> Image.Image:
    row = dataset.episodes()[episode]
    outputs = dataset.about.outputs or ["none"]
    columns = min(_COLUMNS, len(chosen))
    cell_width = _SIDE + _GAP
    cell_height = len(outputs) * (_SIDE + 2) + _CAPTION_LINES * _LINE + _GAP
    width = max(columns * cell_width + _GAP, 640)
    heading = _heading(row, length, dataset.about.fps, width // 7)
    top = _GAP + _LINE * len(heading) + _GAP
    rows = -(-len(chosen) // columns)
    sheet = Image.new("RGB", (width, top + rows * cell_height), _PAPER)
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(12)
    for k, line in enumerate(heading):
        draw.text((_GAP, _GAP + k * _LINE), line, _INK, font)
    for k, frame in enumerate(chosen):
        x, y = _GAP + k % columns * cell_width, top + k // columns * cell_height
        for j, output in enumerate(outputs):
            picture = frame["pictures"].get(output)
            if picture is not None:
                sheet.paste(_picture(output, picture), (x, y + j * (_SIDE + 2)))
        below = y + len(outputs) * (_SIDE + 2)
        draw.text((x, below), f"frame {frame['frame_index']}, {frame['timestamp']:g} s", _FAINT, font)
        draw.text((x, below + _LINE), textwrap.shorten(_done(dataset, frame), 30, placeholder="..."), _INK, font)
    return sheet


def _heading(row: Mapping[str, Any], length: int, fps: int, letters: int) -> list[str]:
    verdict = {True: "done", False: "not done", None: "not judged"}[row["success"]]
    method = f", method {row['method']}" if row["method"] else ""
    about = (
        f"Episode {row['episode_index']} ({row['split']}): {row['agent']} in {row['world']}, seed {row['seed']}{method}"
        f"; {length} frames at {fps} a second; {verdict}"
    )
    lines = textwrap.wrap(about, letters)
    for instruction in row["instructions"][:3]:
        lines += textwrap.wrap(f"\u201c{instruction}\u201d", letters)
    return lines


def _done(dataset: Dataset, frame: Mapping[str, Any]) -> str:
    """Return what was done in a frame, in words; points as seen from the agent."""
    return described(dataset.form.decode(frame["action"], (0.0, 0.0, 0.0, 0.0), frame.get("action.text") or ""))


def _picture(output: str, picture: NDArray[Any]) -> Image.Image:
    if output == "depth":
        away = np.where(picture > 0.0, np.minimum(picture, FARTHEST), FARTHEST)  # 0: nothing is there
        near = 1.0 - np.log1p(away) / np.log1p(FARTHEST)
        picture = np.repeat((255.0 * near).astype(np.uint8)[..., None], 3, axis=2)
    elif output == "segmentation":
        picture = _colours(picture)
    method = Image.Resampling.BILINEAR if output == "rgb" else Image.Resampling.NEAREST
    return Image.fromarray(np.ascontiguousarray(picture, np.uint8)).resize((_SIDE, _SIDE), method)


def _colours(entities: NDArray[Any]) -> NDArray[np.uint8]:
    """Return a colour for each entity, the same in every picture; black where nothing is."""
    numbers = entities.astype(np.uint64)
    mixed = (numbers * np.uint64(2654435761)) & np.uint64(0xFFFFFFFF)
    channels = [(mixed >> np.uint64(shift)) & np.uint64(0xFF) for shift in (0, 8, 16)]
    coloured = np.stack(channels, axis=-1).astype(np.uint8) // 2 + 96
    coloured[entities == 0] = 0
    return np.asarray(coloured, np.uint8)
