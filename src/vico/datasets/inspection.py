"""Inspecting datasets and runs: findings of a whole dataset, contact sheets of episodes, recorded runs for Rerun.

A contact sheet shows frames in rows, the instruction above, and the action below each. For Rerun (https://rerun.io) a
run becomes bodies as boxes, films, actions, events and counts on one timeline.
"""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from vico.datasets.folder import Dataset
from vico.datasets.pictures import PICTURES
from vico.datasets.vectors import action_caption
from vico.datasets.worker import world_of_run
from vico.errors import InputError, MissingExtraError, VicoError
from vico.io.files import new_file
from vico.sim.recording import Run, read_run

Report = Callable[[int, int], None]


def findings_of(dataset: Dataset, *, report: Report | None = None) -> list[str]:
    """Return what is wrong with a dataset, in words; empty if nothing is.

    Every file is hashed; every frame is read, its pictures decoded, its vectors looked at, its action decoded.
    """
    found = dataset.damaged_files()
    if found:
        return found  # whatever else is wrong follows from it
    rows = dataset.episodes()
    found += _check_totals(dataset, rows)
    for row in rows:
        found += _check_episode(dataset, row)
        if report is not None:
            report(row["episode_index"] + 1, len(rows))
    return found


def _check_totals(dataset: Dataset, rows: list[dict[str, Any]]) -> Iterable[str]:
    about = dataset.about
    if [row["episode_index"] for row in rows] != list(range(about.episodes)):
        yield f"episodes.parquet: lists {len(rows)} episodes; dataset.json says {about.episodes}"
    if (frames := sum(row["frames"] for row in rows)) != about.frames:
        yield f"episodes.parquet: {frames} frames; dataset.json says {about.frames}"
    covered = [k for first, end in about.splits.values() for k in range(first, end)]
    if sorted(covered) != list(range(about.episodes)):
        yield "dataset.json: the splits do not hold each episode once"


def _check_episode(dataset: Dataset, row: Mapping[str, Any]) -> list[str]:
    index = row["episode_index"]
    found: list[str] = []
    count = 0
    try:
        for frame in dataset.frames(index):
            if wrong := _check_frame(dataset, frame, count, last=count == row["frames"] - 1):
                found.append(f"episode {index}, frame {count}: {wrong}")
            count += 1
    except (VicoError, OSError, KeyError, ValueError) as error:
        return [f"episode {index}, frame {count}: cannot be read ({' '.join(str(error).split())[:200]})"]
    if count != row["frames"]:
        found.append(f"episode {index}: {count} frames; episodes.parquet says {row['frames']}")
    return found[:5]


def _check_frame(dataset: Dataset, frame: Mapping[str, Any], place: int, *, last: bool) -> str:
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
    for output in about.outputs:
        picture, (kind, colours) = frame["pictures"].get(output), PICTURES[output]
        shape = (about.size, about.size, colours) if colours > 1 else (about.size, about.size)
        if picture is None:
            return f"has no {output}"
        if picture.shape != shape:
            return f"{output} has the shape {picture.shape}, not {shape}"
        if kind is np.float32 and np.isnan(picture).any():
            return f"{output} is not a number at some pixels"
    return ""


#: Depth is drawn bright near and dark far, up to so many metres.
FARTHEST = 50.0
_SIDE = 192  # pixels of a picture's side
_GAP = 8  # pixels between pictures
_LINE = 15  # pixels of a line of text
_COLUMNS = 4  # frames beside each other
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
    rows = dataset.episodes()
    if not 0 <= episode < len(rows):
        raise InputError(f"{dataset.path}: no episode {episode}; there are 0 to {len(rows) - 1}")
    length = int(rows[episode]["frames"])
    wanted = set(np.unique(np.linspace(0, length - 1, min(frames, length)).round().astype(int)).tolist())
    chosen = [frame for k, frame in enumerate(dataset.frames(episode)) if k in wanted]
    sheet = _draw_sheet(dataset, episode, chosen, length)
    with new_file(path) as temporary:
        sheet.save(temporary, "PNG")
    return [
        {key: value for key, value in frame.items() if key != "pictures"} | {"does": _frame_caption(dataset, frame)}
        for frame in chosen
    ]


def _draw_sheet(dataset: Dataset, episode: int, chosen: Sequence[Mapping[str, Any]], length: int) -> Image.Image:
    row = dataset.episodes()[episode]
    outputs = dataset.about.outputs or ["none"]
    columns = min(_COLUMNS, len(chosen))
    cell_width = _SIDE + _GAP
    cell_height = len(outputs) * (_SIDE + 2) + _CAPTION_LINES * _LINE + _GAP
    width = max(columns * cell_width + _GAP, 640)
    fps = dataset.about.fps
    letters = width // 7
    verdict = {True: "done", False: "not done", None: "not judged"}[row["success"]]
    method = f", method {row['method']}" if row["method"] else ""
    about = (
        f"Episode {row['episode_index']} ({row['split']}): {row['agent']} in {row['world']}, seed {row['seed']}{method}"
        f"; {length} frames at {fps} a second; {verdict}"
    )
    heading = textwrap.wrap(about, letters)
    for instruction in row["instructions"][:3]:
        heading += textwrap.wrap(f"\u201c{instruction}\u201d", letters)
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
        draw.text(
            (x, below + _LINE), textwrap.shorten(_frame_caption(dataset, frame), 30, placeholder="..."), _INK, font
        )
    return sheet


def _frame_caption(dataset: Dataset, frame: Mapping[str, Any]) -> str:
    """Return what was done in a frame, in words; points as seen from the agent."""
    return action_caption(dataset.form.decode(frame["action"], (0.0, 0.0, 0.0, 0.0), frame.get("action.text") or ""))


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


_COLOURS: dict[str, tuple[int, int, int]] = {
    "resident": (0, 114, 178),
    "assistant": (213, 94, 0),
    "robot": (0, 158, 115),
    "pedestrian": (86, 180, 233),
    "object": (240, 228, 66),
}
_OTHER_COLOUR = (150, 150, 150)
#: Read so many steps at a time.
_STEPS = 60


def write_rerun(out: Path, path: Path, *, world: Path | None = None, report: Report | None = None) -> int:
    """Write a run as a Rerun recording; return how many steps it has.

    Parameters
    ----------
    out
        File to write, ``.rrd``.
    path
        Run folder.
    world
        Where the run's world is now, if it is no longer where it was; outlines of buildings are left out without it.

    Raises
    ------
    MissingExtraError
        If Rerun is not installed.
    MissingFileError, SchemaError, EmptyInputError
        If it is no run, or damaged.
    """
    rerun = _rerun()
    run = read_run(path)
    place = world_of_run(run, None if world is None else str(world))
    with new_file(out) as temporary:
        stream = rerun.RecordingStream("vico", recording_id=run.manifest["state_hash"])
        stream.save(temporary)
        if place is not None:
            # What stands still: outlines of buildings, at the ground and at the top of the roof.
            lines: list[NDArray[np.float64]] = []
            for building in place.buildings:
                for ring in building.footprint[:1]:
                    outline = np.array([*ring, ring[0]], np.float64)[:, :2]
                    for height in (building.base, building.base + building.height):
                        lines.append(np.column_stack([outline, np.full(len(outline), height)]))
            stream.log("world", rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
            stream.log("world/buildings", rerun.LineStrips3D(lines, colors=[(120, 120, 120)]), static=True)
        for first in range(0, run.last + 1, _STEPS):
            last = min(first + _STEPS - 1, run.last)
            _log_steps(rerun, stream, run, first, last)
            if report is not None:
                report(last + 1, run.last + 1)
        for name, view in run.views.items():
            for step, picture in view.frames():
                _set_time(stream, step, float(run.times[step]))
                stream.log(f"views/{name}", rerun.Image(picture).compress(jpeg_quality=85))
        stream.flush()
        stream.disconnect()
    return run.last + 1


def _rerun() -> ModuleType:
    try:
        import rerun
    except ImportError:
        raise MissingExtraError("Rerun is not installed: pip install 'virtual-community[rerun]'") from None
    module: ModuleType = rerun
    return module


def _set_time(stream: Any, step: int, time: float) -> None:
    stream.set_time("step", sequence=step)
    stream.set_time("time", duration=time)


def _log_steps(rerun: ModuleType, stream: Any, run: Run, first: int, last: int) -> None:
    tracks = run.tracks(first, last)
    members = [run.cast[int(entity)] for entity in tracks.entity]
    kinds = np.array([member.kind for member in members])
    half = np.array([member.size for member in members], np.float64).reshape(-1, 3) / 2
    acted = dict(_actions(run, first, last))
    happened: dict[int, list[dict[str, Any]]] = {}
    for event in run.events_between(first, last):
        happened.setdefault(int(event["step"]), []).append(event)
    for k, step in enumerate(tracks.steps.tolist()):
        _set_time(stream, step, float(run.times[step]))
        there = np.isfinite(tracks.position[k, :, 0])
        for kind in dict.fromkeys(kinds.tolist()):
            mine = np.flatnonzero(there & (kinds == kind))
            yaw = tracks.yaw[k, mine]
            zero = np.zeros(len(yaw))
            stream.log(
                f"world/bodies/{kind}",
                rerun.Boxes3D(
                    centers=tracks.position[k, mine] + half[mine] * (0.0, 0.0, 1.0),
                    half_sizes=half[mine],
                    quaternions=np.column_stack([zero, zero, np.sin(yaw / 2), np.cos(yaw / 2)]),
                    labels=[members[i].agent or "" for i in mine],
                    show_labels=False,
                    colors=[_COLOURS.get(kind, _OTHER_COLOUR)],
                ),
            )
        for name, counts in run.counts.items():
            stream.log(f"counts/{name}", rerun.Scalars(float(counts[step])))
        for name, words in acted.get(step, ()):
            stream.log(f"agents/{name}/action", rerun.TextLog(words))
        for event in happened.get(step, ()):
            stream.log("events", rerun.TextLog(f"{event['kind']}: {event['agent']}: {event['text']}"))


def _actions(run: Run, first: int, last: int) -> Iterator[tuple[int, list[tuple[str, str]]]]:
    """Yield what agents asked for in each step, in words, and how it went where it did not go well."""
    for step in range(first, last + 1):
        words: list[tuple[str, str]] = []
        for name, record in run.at(step).agents.items():
            if isinstance(record.action, dict):
                outcome = "" if record.status == "ok" else f" ({record.status}: {record.reason})"
                words.append((name, action_caption(record.action) + outcome))
        yield step, words
