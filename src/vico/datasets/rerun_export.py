"""A recorded run for Rerun (https://rerun.io): bodies as boxes, films, actions, events and counts on one timeline."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.datasets.actions import described
from vico.datasets.worker import world_of_run
from vico.errors import MissingExtraError
from vico.io.files import new_file
from vico.sim.recording import Run, read_run
from vico.world.world import World

Report = Callable[[int, int], None]

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
            _log_world(rerun, stream, place)
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


def _log_world(rerun: ModuleType, stream: Any, world: World) -> None:
    """Log what stands still: outlines of buildings, at the ground and at the top of the roof."""
    lines: list[NDArray[np.float64]] = []
    for building in world.buildings:
        for ring in building.footprint[:1]:
            outline = np.array([*ring, ring[0]], np.float64)[:, :2]
            for height in (building.base, building.base + building.height):
                lines.append(np.column_stack([outline, np.full(len(outline), height)]))
    stream.log("world", rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    stream.log("world/buildings", rerun.LineStrips3D(lines, colors=[(120, 120, 120)]), static=True)


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
            stream.log(
                f"world/bodies/{kind}",
                rerun.Boxes3D(
                    centers=tracks.position[k, mine] + half[mine] * (0.0, 0.0, 1.0),
                    half_sizes=half[mine],
                    quaternions=_turned(tracks.yaw[k, mine]),
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
                words.append((name, described(record.action) + outcome))
        yield step, words


def _turned(yaw: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return turns about the vertical as quaternions x, y, z, w."""
    zero = np.zeros(len(yaw))
    return np.column_stack([zero, zero, np.sin(yaw / 2), np.cos(yaw / 2)])
