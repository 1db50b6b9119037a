"""Motions from BVH files, as motion capture and animation programs write them.

The format: Meredith and Maddock, Motion Capture File Formats Explained, University of Sheffield, CS-01-11 (2001).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vico.assets.motions.clip import MOST_FRAMES, MotionClip
from vico.assets.motions.retargeting import Skeleton, joints_by_name, retargeted
from vico.assets.motions.rotations import from_angles
from vico.errors import MissingFileError, SchemaError

_MOST_BYTES = 512 << 20
_MOST_JOINTS = 512
_CHANNELS = ("Xposition", "Yposition", "Zposition", "Xrotation", "Yrotation", "Zrotation")


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
        text = path.read_text(encoding="utf-8", errors="replace")
    except FileNotFoundError:
        raise MissingFileError(f"{path}: no such file") from None
    lines = iter(enumerate(text.splitlines(), start=1))
    hierarchy = _hierarchy(lines, path)
    values, rate = _frames(lines, sum(map(len, hierarchy.channels)), path)
    skeleton = _skeleton(hierarchy)
    turned, moved = _turned(hierarchy, values)
    pelvis = joints_by_name(skeleton, source=str(path))["pelvis"]
    return retargeted(skeleton, turned, moved[:, pelvis], rate, name=path.stem, source=str(path))


def _hierarchy(lines: Iterator[tuple[int, str]], path: Path) -> _Hierarchy:
    """Read up to the line MOTION."""
    found, open_joints = _Hierarchy(), [-1]
    for number, line in lines:
        words = line.split()
        if not words or words[0] in ("HIERARCHY", "{"):
            continue
        if words[0] == "MOTION":
            if not found.names or len(open_joints) > 1:
                break
            return found
        try:
            _read_line(words, line.strip(), found, open_joints)
        except (ValueError, IndexError):
            raise SchemaError(f"{path}: line {number}: {line.strip()[:60]!r} is no line of a BVH hierarchy") from None
    raise SchemaError(f"{path}: no whole BVH hierarchy before the line MOTION; export it anew")


def _read_line(words: list[str], line: str, found: _Hierarchy, open_joints: list[int]) -> None:
    """Take a line of the hierarchy in; -2 among the open joints is an end site."""
    kind = words[0]
    if kind in ("ROOT", "JOINT") and len(found.names) < _MOST_JOINTS:
        found.parents.append(open_joints[-1])
        found.names.append(line.split(None, 1)[1])
        found.offsets.append([0.0, 0.0, 0.0])
        found.channels.append([])
        open_joints.append(len(found.names) - 1)
    elif kind == "End":
        open_joints.append(-2)
    elif kind == "}" and len(open_joints) > 1:
        open_joints.pop()
    elif kind == "OFFSET" and len(words) == 4:
        if open_joints[-1] >= 0:
            found.offsets[open_joints[-1]] = [float(word) for word in words[1:]]
    elif kind == "CHANNELS" and open_joints[-1] >= 0 and int(words[1]) == len(words) - 2:
        if any(word not in _CHANNELS for word in words[2:]):
            raise ValueError(line)
        found.channels[open_joints[-1]] = words[2:]
    else:
        raise ValueError(line)


def _frames(lines: Iterator[tuple[int, str]], channels: int, path: Path) -> tuple[NDArray[np.float64], float]:
    """Return every frame's channels, shape ``(t, channels)``, and the frames a second."""
    wanted, seconds, rows = 0, 0.0, []
    for number, line in lines:
        words = line.replace(",", " ").split()
        if not words:
            continue
        try:
            if words[0] == "Frames:":
                wanted = int(words[1])
            elif words[:2] == ["Frame", "Time:"]:
                seconds = float(words[2])
            else:
                row = np.array(words, np.float64)
                if len(row) != channels or not np.isfinite(row).all():
                    raise ValueError(line)
                rows.append(row)
        except (ValueError, IndexError):
            raise SchemaError(f"{path}: line {number}: no frame of {channels} numbers; export it anew") from None
        if len(rows) > MOST_FRAMES:
            raise SchemaError(f"{path}: more than {MOST_FRAMES} frames; cut it into pieces")
    if not rows or len(rows) != wanted or not seconds > 0:
        raise SchemaError(f"{path}: {len(rows)} of {wanted} frames of {seconds} s are there; export it anew")
    return np.stack(rows), 1.0 / seconds


def _skeleton(hierarchy: _Hierarchy) -> Skeleton:
    """Return the joints at rest."""
    places = np.zeros((len(hierarchy.names), 3))
    for k, parent in enumerate(hierarchy.parents):
        places[k] = hierarchy.offsets[k]
        if parent >= 0:
            places[k] += places[parent]
    return Skeleton(tuple(hierarchy.names), np.array(hierarchy.parents, np.int64), places)


def _turned(hierarchy: _Hierarchy, values: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return how each joint is turned from rest, shape ``(t, n, 3, 3)``, and where it is, shape ``(t, n, 3)``."""
    t, n = len(values), len(hierarchy.names)
    turned, placed = np.empty((t, n, 3, 3)), np.empty((t, n, 3))
    at = 0
    for k, (parent, channels) in enumerate(zip(hierarchy.parents, hierarchy.channels, strict=True)):
        mine = values[:, at : at + len(channels)]
        at += len(channels)
        angles = [c for c, channel in enumerate(channels) if channel.endswith("rotation")]
        local = from_angles(mine[:, angles], [channels[c][0] for c in angles])
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
