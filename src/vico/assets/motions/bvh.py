"""Motions from BVH files, as motion capture and animation programs write them.

The format: Meredith and Maddock, Motion Capture File Formats Explained, University of Sheffield, CS-01-11 (2001).
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vico.assets.motions.clip import MOST_FRAMES, MOST_RATE, MotionClip, matrices_from_angles
from vico.assets.motions.retargeting import Skeleton, joints_by_name, retarget
from vico.errors import MissingFileError, SchemaError

_MOST_BYTES = 512 << 20
_MOST_JOINTS = 512
# Channels as programs write them; scales change no direction, and are left.
_CHANNEL = re.compile(r"([xyz])_?(position|pos|translation|rotation|rot|scale)", re.IGNORECASE)
_KINDS = {"pos": "position", "translation": "position", "rot": "rotation"}
# Braces, and what stands behind them or behind an offset, are read as lines of their own.
_STATEMENT = re.compile(r"\s*([{}])\s*|\s+(?=CHANNELS\b|OFFSET\b)")
# A time of a frame, seconds, that is none; and the fewest frames a second that make it milliseconds.
_SLOWEST, _FEWEST = 1.0, 10.0
_COUNT, _TIME = (
    re.compile(r"frames\s*:?\s*(.*)", re.IGNORECASE),
    re.compile(r"frame\s*time\s*:?\s*(.*?)\s*(?:s|sec|secs|seconds?)?", re.IGNORECASE),
)


@dataclass
class _Hierarchy:
    names: list[str] = field(default_factory=list)
    parents: list[int] = field(default_factory=list)
    offsets: list[list[float]] = field(default_factory=list)
    channels: list[list[str]] = field(default_factory=list)


def read_bvh(path: Path) -> MotionClip:
    """Read a motion from a BVH file; its skeleton is found by the joints' names.

    Raises
    ------
    MissingFileError
        If there is no such file.
    SchemaError
        If it is no BVH, or damaged; the message gives the line.
    InputError
        If its skeleton is no person's.
    """
    try:
        if path.stat().st_size > _MOST_BYTES:
            raise SchemaError(f"{path}: larger than {_MOST_BYTES >> 20} MiB; cut it into pieces")
        text = path.read_text(encoding="utf-8-sig", errors="replace")
    except FileNotFoundError:
        raise MissingFileError(f"{path}: no such file") from None
    lines = iter(enumerate(text.splitlines(), start=1))
    hierarchy = _hierarchy(lines, path)
    values, rate, note = _frames(lines, sum(map(len, hierarchy.channels)), path)
    places = np.zeros((len(hierarchy.names), 3))
    for k, parent in enumerate(hierarchy.parents):
        places[k] = hierarchy.offsets[k]
        if parent >= 0:
            places[k] += places[parent]
    skeleton = Skeleton(tuple(hierarchy.names), np.array(hierarchy.parents, np.int64), places)
    turned, moved = _joint_transforms(hierarchy, values)
    pelvis = joints_by_name(skeleton, source=str(path))["pelvis"]
    clip = retarget(skeleton, turned, moved[:, pelvis], rate, name=path.stem, source=str(path))
    return replace(clip, notes=(note,)) if note else clip


def _hierarchy(lines: Iterator[tuple[int, str]], path: Path) -> _Hierarchy:
    """Read up to the line MOTION."""
    found, open_joints = _Hierarchy(), [-1]
    for number, line in lines:
        if line.strip().upper() == "MOTION":
            if not found.names or len(open_joints) > 1:
                break
            return found
        for statement in filter(None, _STATEMENT.split(line.strip())):
            try:
                _read_statement(statement, found, open_joints)
            except (ValueError, IndexError):
                _refuse_comma(statement, path, number)
                shown = line.strip()[:60]
                raise SchemaError(f"{path}: line {number}: {shown!r} is no line of a BVH hierarchy") from None
    raise SchemaError(f"{path}: no whole BVH hierarchy before the line MOTION; export it anew")


def _read_statement(statement: str, found: _Hierarchy, open_joints: list[int]) -> None:
    """Take a statement of the hierarchy in; -2 among the open joints is an end site."""
    words = statement.split()
    kind = words[0].upper()
    if kind in ("ROOT", "JOINT") and len(found.names) < _MOST_JOINTS:
        found.parents.append(open_joints[-1])
        found.names.append(statement.split(None, 1)[1])
        found.offsets.append([0.0, 0.0, 0.0])
        found.channels.append([])
        open_joints.append(len(found.names) - 1)
    elif kind in ("END", "ENDSITE"):
        open_joints.append(-2)
    elif kind == "}" and len(open_joints) > 1:
        open_joints.pop()
    elif kind == "OFFSET" and len(words) == 4:
        if open_joints[-1] >= 0:
            found.offsets[open_joints[-1]] = [float(word) for word in words[1:]]
    elif kind == "CHANNELS" and int(words[1]) == len(words) - 2 and (open_joints[-1] >= 0 or len(words) == 2):
        found.channels[open_joints[-1]] = [_channel(word) for word in words[2:]]
    elif kind not in ("HIERARCHY", "{"):
        raise ValueError(statement)


def _channel(word: str) -> str:
    """Return a channel's name as the format has it, ``Xposition``."""
    match = _CHANNEL.fullmatch(word)
    if match is None:
        raise ValueError(word)
    kind = match[2].lower()
    return match[1].upper() + _KINDS.get(kind, kind)


def _refuse_comma(text: str, path: Path, number: int) -> None:
    """Raise `SchemaError` if a number has a comma for its decimals."""
    if re.search(r"\d,\d", text):
        raise SchemaError(
            f"{path}: line {number}: a number has a comma where its decimals begin; export it with decimal points, "
            "for example with the computer's language set to English"
        ) from None


def _frames(lines: Iterator[tuple[int, str]], channels: int, path: Path) -> tuple[NDArray[np.float64], float, str]:
    """Return every frame's channels, shape ``(t, channels)``, the frames a second, and a note on these."""
    wanted, seconds, rows = 0, 0.0, []
    count_line = time_line = 0
    for number, line in lines:
        text = line.strip()
        if not text:
            continue
        try:
            if time := _TIME.fullmatch(text):
                seconds, time_line = float(time[1]), number
            elif count := _COUNT.fullmatch(text):
                wanted, count_line = int(count[1]), number
            else:
                rows.append(_row(text, channels))
        except ValueError:
            _refuse_comma(text, path, number)
            what = f"no frame of {channels} numbers; export it anew"
            if _TIME.fullmatch(text):
                what = f"{text[:40]!r} gives no seconds; write for example Frame Time: 0.0333333"
            raise SchemaError(f"{path}: line {number}: {what}") from None
        if len(rows) > MOST_FRAMES:
            raise SchemaError(f"{path}: more than {MOST_FRAMES} frames; cut it into pieces")
    if not (count_line and time_line):
        raise SchemaError(f"{path}: no lines Frames: and Frame Time: after the line MOTION; export it anew")
    if not rows and not wanted:
        raise SchemaError(f"{path}: line {count_line}: the motion has no frame; export it with its animation")
    if len(rows) != wanted:
        raise SchemaError(
            f"{path}: line {count_line}: {len(rows)} of {wanted} frames are there; export it anew, or mend the number"
        )
    rate, note = _rate(seconds, path, time_line)
    return np.stack(rows), rate, note


def _rate(seconds: float, path: Path, line: int) -> tuple[float, str]:
    """Return the frames a second; and a sentence if the time of a frame can only be milliseconds."""
    if 1.0 / MOST_RATE <= seconds < _SLOWEST:
        return 1.0 / seconds, ""
    rate = 1000.0 / seconds if seconds > 0.0 else 0.0
    if seconds >= _SLOWEST and _FEWEST <= rate <= MOST_RATE:
        return rate, (
            f"line {line}: a frame time of {seconds:g} s is read as milliseconds, {rate:.4g} frames a second; write "
            f"{seconds / 1000.0:g}, or another time in seconds"
        )
    raise SchemaError(
        f"{path}: line {line}: a frame takes {seconds:g} s; write seconds from {1.0 / MOST_RATE:g} to below "
        f"{_SLOWEST:g}, for example 0.0333333 for 30 frames a second"
    )


def _row(text: str, channels: int) -> NDArray[np.float64]:
    """Return the numbers of a frame, apart by white space or commas."""
    # Numbers apart by white space alone are as many as the channels: commas within them begin decimals.
    words = text.split() if len(text.split()) == channels else text.replace(",", " ").split()
    row = np.array([word.removesuffix(",") for word in words], np.float64)
    if len(row) != channels or not np.isfinite(row).all():
        raise ValueError(text)
    return row


def _joint_transforms(
    hierarchy: _Hierarchy, values: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return how each joint is turned from rest, shape ``(t, n, 3, 3)``, and where it is, shape ``(t, n, 3)``."""
    t, n = len(values), len(hierarchy.names)
    turned, placed = np.empty((t, n, 3, 3)), np.empty((t, n, 3))
    at = 0
    for k, (parent, channels) in enumerate(zip(hierarchy.parents, hierarchy.channels, strict=True)):
        mine = values[:, at : at + len(channels)]
        at += len(channels)
        angles = [c for c, channel in enumerate(channels) if channel.endswith("rotation")]
        local = matrices_from_angles(mine[:, angles], [channels[c][0] for c in angles])
        # A joint's own position channels stand instead of its offset.
        offset = np.tile(np.array(hierarchy.offsets[k]), (t, 1))
        for c, channel in enumerate(channels):
            if channel.endswith("position"):
                offset[:, "XYZ".index(channel[0])] = mine[:, c]
        if parent < 0:
            turned[:, k], placed[:, k] = local, offset
        else:
            turned[:, k] = turned[:, parent] @ local
            placed[:, k] = placed[:, parent] + (turned[:, parent] @ offset[:, :, None])[:, :, 0]
    return turned, placed
