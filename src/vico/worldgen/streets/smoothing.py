"""Lanes without kinks: bends of streets rounded, and paths through junctions that begin and end as the lanes do.

netconvert takes the corners of the map as they are, and joins lanes by curves that meet them at an angle. A vehicle
that follows such a line jerks.
"""

from __future__ import annotations

import math
import re
from collections import defaultdict
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import shapely
from defusedxml.ElementTree import fromstring
from numpy.typing import NDArray

from vico.geo import overlay
from vico.geometry import arc_lengths, distance, points_along

Floats = NDArray[np.float64]

_RADIUS = 7.0  # of a rounded bend, metres, where there is room
_INWARD = 0.8  # metres that a rounded bend may lie within the corner: farther in is the kerb
_BEND = math.radians(6.0)  # less than this is no bend
_PIECE = math.radians(7.0)  # most that a rounded line turns at one point
_WOBBLE = 0.12  # metres off a line that are netconvert's, not the map's
_LEVEL = 0.03  # metres that a point may be off the straight line between those beside it
_JOINT = math.radians(8.0)  # at which a path through a junction is drawn anew
_TURNS_BACK, _WIDE = math.radians(110.0), 12.0  # who turns back over more metres than this does so in several bends
_SHORTEST = 0.3  # metres between the ends of a path that is worth a curve

_LANE = re.compile(rb'<lane id="([^"]*)"([^>]*?) length="[^"]*"([^>]*?) shape="[^"]*"')


@dataclass
class _Path:
    """A vehicle lane while it is smoothed: its line and, along it from 0 to 1, its heights if it has any."""

    line: Floats
    inside: bool
    heights: Floats | None
    changed: bool = False


def without_kinks(net: bytes) -> bytes:
    """Return a SUMO network whose lanes for vehicles bend smoothly; ends of street lanes stay where they are."""
    root = fromstring(net, forbid_dtd=True)
    paths = {
        str(lane.get("id")): _path(str(lane.get("shape")), inside=edge.get("function") == "internal")
        for edge in root.iter("edge")
        if edge.get("function", "normal") in ("normal", "internal")
        for lane in edge.findall("lane")
        if lane.get("allow", "") != "pedestrian"
    }
    for path in paths.values():
        if not path.inside:
            smooth = rounded(path.line)
            path.changed, path.line = not np.array_equal(smooth, path.line), smooth
    for chain in _chains(root, paths):
        _join(chain, paths)
    return _LANE.sub(lambda found: _written(found, paths), net)


def rounded(line: Floats, radius: float = _RADIUS) -> Floats:
    """Round the corners of a line, metres, shape ``(n, 2)``; its ends and their directions stay.

    A corner is cut at most as far as the middle of the stretches beside it, and never by much.
    """
    line = shapely.get_coordinates(overlay.simplify(shapely.LineString(line), _WOBBLE))
    if len(line) < 3:
        return line
    step = np.diff(line, axis=0)
    size = np.hypot(*step.T)
    heading = np.arctan2(step[:, 1], step[:, 0])
    found = [line[:1]]
    for k in range(1, len(line) - 1):
        turn = abs(_wrapped(float(heading[k] - heading[k - 1])))
        if turn < _BEND:
            found.append(line[k : k + 1])
            continue
        half = min(turn, 3.0) / 2
        cut = min(radius * math.tan(half), 2 * _INWARD / math.cos(half), 0.5 * float(size[k - 1]), 0.5 * float(size[k]))
        start = line[k] - step[k - 1] * (cut / size[k - 1])
        end = line[k] + step[k] * (cut / size[k])
        found.append(_arc(start, line[k], end, turn))
    found.append(line[-1:])
    joined = np.concatenate(found)
    keep = np.r_[True, np.hypot(*np.diff(joined, axis=0).T) > 0.01]
    keep[-1] = True
    return joined[keep]


def _arc(start: Floats, corner: Floats, end: Floats, turn: float) -> Floats:
    """Return points of the curve from `start` to `end` that touches both sides of a corner."""
    t = np.linspace(0.0, 1.0, max(math.ceil(turn / _PIECE), 2) + 1)[:, None]
    return (1 - t) ** 2 * start + 2 * t * (1 - t) * corner + t**2 * end


def _wrapped(angle: float) -> float:
    return (angle + math.pi) % (2 * math.pi) - math.pi


def _path(shape: str, *, inside: bool) -> _Path:
    parts = [point.split(",") for point in shape.split()]
    points = np.array([[*map(float, part), 0.0][:3] for part in parts])
    line = points[:, :2]
    # A height of nought is left out.
    return _Path(line, inside, np.c_[_shares(line), points[:, 2]] if any(len(part) > 2 for part in parts) else None)


def _shares(line: Floats) -> Floats:
    """Return how far along a line its points are, from 0 to 1."""
    along = arc_lengths(line)
    return along / max(float(along[-1]), 1e-9)


def _heading(line: Floats, end: int) -> float:
    """Heading of a line at its start (0) or its end (-1)."""
    a, b = (line[0], line[1]) if end == 0 else (line[-2], line[-1])
    return math.atan2(b[1] - a[1], b[0] - a[0])


def _chains(root: Any, paths: dict[str, _Path]) -> list[list[str]]:
    """Return the ways through junctions: a street lane, the lanes inside, a street lane."""
    after: dict[str, list[tuple[str, str]]] = defaultdict(list)
    for link in root.iter("connection"):
        start, end = f"{link.get('from')}_{link.get('fromLane')}", f"{link.get('to')}_{link.get('toLane')}"
        if start in paths and end in paths:
            after[start].append((link.get("via", ""), end))
    found = []
    for start in after:
        if paths[start].inside:
            continue
        for via, end in after[start]:
            chain = [start]
            while via in paths and via not in chain:
                chain.append(via)
                via = after[via][0][0] if via in after else ""
            found.append([*chain, end])
    return found


def _join(chain: list[str], paths: dict[str, _Path]) -> None:
    """Draw a way through a junction anew where it meets the streets' lanes at an angle, or has a kink."""
    before, *inner, after = (paths[name] for name in chain)
    if not inner or min(len(path.line) for path in (before, after, *inner)) < 2:
        return
    whole = np.concatenate([inner[0].line, *(path.line[1:] for path in inner[1:])])
    chord = distance(whole[-1], whole[0])
    start, end = _heading(before.line, -1), _heading(after.line, 0)
    turn = abs(_wrapped(end - start))
    if chord < _SHORTEST or (turn > _TURNS_BACK and chord > _WIDE):
        return
    headings = [start, *np.arctan2(*np.diff(whole, axis=0)[np.hypot(*np.diff(whole, axis=0).T) > 0.01].T[::-1]), end]
    if max(abs(_wrapped(b - a)) for a, b in pairwise(headings)) < _JOINT:
        return
    # So long are the handles of a curve that is nearly an arc.
    reach = chord * (2 / 3 * math.tan(turn / 4) / math.sin(turn / 2) if turn > 0.01 else 1 / 3)
    handles = whole[0] + reach * _unit(start), whole[-1] - reach * _unit(end)
    across = math.atan2(*(whole[-1] - whole[0])[::-1])
    bends = abs(_wrapped(across - start)) + abs(_wrapped(end - across))
    t = np.linspace(0.0, 1.0, math.ceil((1.7 * bends + 0.4) / _PIECE) + 2)[:, None]
    curve = (1 - t) ** 3 * whole[0] + 3 * t * (1 - t) ** 2 * handles[0]
    curve += 3 * t**2 * (1 - t) * handles[1] + t**3 * whole[-1]
    _share_out(curve, inner)


def _unit(heading: float) -> Floats:
    return np.array([math.cos(heading), math.sin(heading)])


def _share_out(curve: Floats, inner: list[_Path]) -> None:
    """Give the lanes of a way through a junction their parts of a curve, as long as they were."""
    sizes = np.array([np.hypot(*np.diff(path.line, axis=0).T).sum() for path in inner])
    along = arc_lengths(curve)
    marks = np.concatenate([[0.0], np.cumsum(sizes)]) / sizes.sum() * along[-1]
    for path, low, high in zip(inner, marks, marks[1:], strict=False):
        at = np.concatenate([[low], along[(along > low + 0.05) & (along < high - 0.05)], [high]])
        path.line = points_along(curve, at, along)
        path.changed = True


def _with_heights(line: Floats, heights: Floats) -> Floats:
    """Return a line with its heights, and with more points where they would not do to tell them."""
    size = float(np.hypot(*np.diff(line, axis=0).T).sum())
    profile = overlay.simplify(shapely.LineString(heights * [size, 1.0]), _LEVEL)
    own = _shares(line)
    at = np.union1d(own, shapely.get_coordinates(profile)[:, 0] / max(size, 1e-9))
    at = at[np.r_[True, np.diff(at) * size > 0.01]]
    return np.stack([*(np.interp(at, own, line[:, k]) for k in (0, 1)), np.interp(at, *heights.T)], axis=1)


def _written(found: re.Match[bytes], paths: dict[str, _Path]) -> bytes:
    """Return a lane's element with its new shape and length, or as it was."""
    path = paths.get(found.group(1).decode())
    if path is None or not path.changed:
        return found.group(0)
    points = path.line
    if path.heights is not None:
        points = _with_heights(points, path.heights)
    shape = " ".join(",".join(f"{value:.3f}" for value in point) for point in points.tolist())
    length = max(float(np.hypot(*np.diff(path.line, axis=0).T).sum()), 0.1)
    return b'<lane id="%s"%s length="%.3f"%s shape="%s"' % (
        found.group(1), found.group(2), length, found.group(3), shape.encode(),
    )  # fmt: skip
