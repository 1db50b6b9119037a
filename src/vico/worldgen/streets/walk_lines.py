"""Sidewalks of the lane network, moved out of what is carriageway: beyond parking lanes, which netconvert has not."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from defusedxml.ElementTree import fromstring
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay

_BESIDE = 0.75  # metres from the kerb to the line that walkers follow
_LEAST, _MOST = 0.2, 5.0  # metres that a line lies within the carriageway to be moved; beyond, something else is wrong
_STEP = 4.0
_WALL = 0.4  # metres from walls; where there is no room for a sidewalk beside the carriageway it stays where it is

_LANE = re.compile(rb'(<lane id="([^"]*)"[^>]*? shape=")([^"]*)(")')


@dataclass(frozen=True)
class CarriagewayEdges:
    """What says where sidewalks can be.

    Attributes
    ----------
    carriageway
        Kerb to kerb, metres.
    solids
        Footprints of buildings: no sidewalk is moved into them.
    """

    carriageway: BaseGeometry
    solids: Sequence[BaseGeometry]


def sidewalks_beside(net: bytes, kerbs: CarriagewayEdges, *, left_driving: bool) -> bytes:
    """Return a SUMO network whose sidewalks lie beside the carriageway as it is painted.

    netconvert puts them beside the outermost lanes. Where cars park there, people would walk in the parking lane.

    Parameters
    ----------
    net
        ``roads.net.xml``, still without heights.
    kerbs
        Where carriageways end and walls stand.
    left_driving
        Whether traffic keeps left, and sidewalks lie to the left of their lanes.
    """
    lanes = {
        str(lane.get("id")): str(lane.get("shape"))
        for edge in fromstring(net, forbid_dtd=True).iter("edge")
        if edge.get("function", "normal") == "normal" and len(edge.findall("lane")) > 1
        for lane in edge.findall("lane")
        if lane.get("allow", "") == "pedestrian"
    }
    shapely.prepare(kerbs.carriageway)
    walls = shapely.STRtree(list(kerbs.solids))
    out = 1.0 if left_driving else -1.0
    moved: dict[bytes, bytes] = {}
    for name, shape in lanes.items():
        split = [point.split(",") for point in shape.split()]
        high = any(len(point) > 2 for point in split)  # a height of nought is left out
        points = np.array([[*map(float, point), 0.0][: 3 if high else 2] for point in split])
        line = shapely.LineString(points[:, :2])
        shift = _shift(line, kerbs.carriageway, out)
        if shift is None:
            continue
        beside = overlay.offset_curve(line, out * shift)
        if beside.geom_type != "LineString" or beside.is_empty or beside.length < 0.5 * line.length:
            continue
        if len(walls.query(beside, predicate="dwithin", distance=_WALL)):
            continue
        moved[name.encode()] = _written(shapely.get_coordinates(beside), points)
    return _LANE.sub(lambda found: found.group(1) + moved.get(found.group(2), found.group(3)) + found.group(4), net)


def _written(line: NDArray[np.float64], before: NDArray[np.float64]) -> bytes:
    """Return a line as a shape, with heights where the line before had them."""
    if before.shape[1] > 2:
        z = np.interp(_shares(line), _shares(before[:, :2]), before[:, 2])
        return " ".join(f"{x:.3f},{y:.3f},{h:.3f}" for (x, y), h in zip(line, z, strict=True)).encode()
    return " ".join(f"{x:.3f},{y:.3f}" for x, y in line).encode()


def _shares(line: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far along a line its points are, from 0 to 1."""
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    return along / max(float(along[-1]), 1e-9)


def _shift(line: shapely.LineString, carriageway: BaseGeometry, out: float) -> float | None:
    """Metres to move a sidewalk outwards (`out`: to its left), or None where it lies well or has nowhere to go."""
    count = max(int(line.length / _STEP), 1)
    along = (np.arange(count) + 0.5) * (line.length / count)
    at = shapely.get_coordinates(shapely.line_interpolate_point(line, along))
    on = shapely.get_coordinates(shapely.line_interpolate_point(line, np.minimum(along + 0.1, line.length)))
    step = (on - at) / np.maximum(np.hypot(*(on - at).T), 1e-9)[:, None]
    normal = out * np.stack([-step[:, 1], step[:, 0]], axis=1)
    deep = _depths(at, normal, carriageway)
    typical = float(np.median(deep))
    return typical + _BESIDE if _LEAST < typical < _MOST else None


def _depths(at: NDArray[np.float64], normal: NDArray[np.float64], carriageway: BaseGeometry) -> NDArray[np.float64]:
    """How far points lie within an area, along their normals, metres; 0 outside of it."""
    reach = np.arange(0.0, _MOST + 0.26, 0.25)
    points = at[:, None, :] + reach[None, :, None] * normal[:, None, :]
    outside = ~shapely.contains_xy(carriageway, points[..., 0], points[..., 1])
    return reach[np.where(outside.any(axis=1), outside.argmax(axis=1), len(reach) - 1)]
