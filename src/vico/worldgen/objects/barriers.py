"""Fences, walls, hedges, chains, rows of bollards, and gates in them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from vico.assets.models.library import street_models
from vico.geo import overlay
from vico.geo.osm import OsmData, Tags
from vico.geo.quantities import metres, number, quantity
from vico.worldgen.facts.expendable import NamedShape, expendable, united
from vico.worldgen.objects import catalogue
from vico.worldgen.objects.wishes import Wish

_LONG = 2.0  # metres of line a model covers at scale 1
_GATES = ("gate", "lift_gate", "swing_gate", "entrance", "kissing_gate", "turnstile", "full-height_turnstile",
          "cycle_barrier", "hampshire_gate", "bump_gate", "motorcycle_barrier", "sally_port")  # fmt: skip
_GAP = 1.2  # metres between the middles of two obstacles in a row that people get through
_IN_ROWS = {"bollard": ("bollard", 1.7), "block": ("block", 2.4), "planter": ("planter", 2.2)}


def _model(tags: Tags) -> str | None:
    """Name the model of a line by kind, material and height."""
    name = catalogue.barriers().lines.get(tags.get("barrier", ""))
    tall = metres(tags.get("height"))
    if name == "fence":
        name = catalogue.barriers().fences.get(tags.get("fence_type", tags.get("material", "")), "fence")
        if name == "fence" and tall is not None and tall > 1.5:
            name = "fence_high"
    elif name == "wall":
        if tags.get("material", tags.get("wall", "")) == "brick":
            name = "wall_brick"
        elif tall is not None:
            name = "wall_low" if tall < 0.9 else "wall" if tall < 1.6 else "wall_high"
    elif name == "hedge" and tall is not None:
        name = "hedge_low" if tall < 0.9 else "hedge" if tall < 1.6 else "hedge_high"
    return name


def barrier_wishes(osm: OsmData, carriageway: BaseGeometry, openings: BaseGeometry, half: float) -> list[Wish]:
    """Pieces of some two metres, open where ways and gates lead through; their length decides their scale."""
    gates = [(n.id, n.xy) for n in osm.nodes if n.tags.get("barrier") in _GATES or "entrance" in n.tags]
    lines = [(f"w{way.id}", way.line, way.tags) for way in osm.ways if "area" not in way.tags]
    hedges = [area for area in osm.areas if area.tags.get("barrier") == "hedge" and area.tags.get("area") == "yes"]
    drawn = {area.id for area in hedges}
    gaps = [NamedShape("footways", overlay.buffer(openings, 0.3))]
    gaps.append(NamedShape("carriageways", overlay.buffer(carriageway, 0.3)))
    gaps += [NamedShape(f"n{number}", overlay.buffer(shapely.Point(xy), 1.3)) for number, xy in gates]
    through = united(gaps, grid=None)
    shapely.prepare(through)
    found: list[Wish] = []
    for key, line, tags in lines:
        kind = tags.get("barrier", "")
        if key in drawn or (quantity(tags, "layer") or 0) != 0 or np.abs(line).min(axis=0).max() > half:
            continue
        if tags.get("location") in ("underground", "indoor") or (number(tags.get("level")) or 0) != 0:
            continue
        if kind in _IN_ROWS:
            mapped = [n.xy for n in osm.nodes if n.tags.get("barrier") == kind]
            with expendable(key):
                found += _row(key, line, *_IN_ROWS[kind], through if kind == "planter" else None, mapped)
            continue
        name = _model(tags)
        if name is not None:
            with expendable(key):
                found += _line(key, line, name, metres(tags.get("height")), through, half)
    for area in hedges:
        with expendable(area.id):
            found += _blocks(area.id, area.polygon, metres(area.tags.get("height")))
    return found


def _line(
    key: str, line: NDArray[np.float64], name: str, tall: float | None, through: BaseGeometry, half: float
) -> list[Wish]:
    """Pieces of one barrier, as tall as it is said to be, open where something leads `through`."""
    height = 1.0 if tall is None else float(np.clip(tall / street_models()[name].size[2], 0.55, 1.5))
    found: list[Wish] = []
    for piece in shapely.get_parts(overlay.difference(shapely.LineString(line).simplify(0.15), through)):
        for a, b in zip(piece.coords[:-1], piece.coords[1:], strict=True):
            for wish in _pieces(key, name, np.array(a), np.array(b), height):
                if np.abs(wish.xy).max() < half - _LONG:
                    wish.id = f"{key}.{len(found)}"
                    found.append(wish)
    return found


def _pieces(key: str, name: str, a: NDArray[np.float64], b: NDArray[np.float64], height: float) -> list[Wish]:
    """One segment of a line from corner to corner, in equal pieces whose ends meet."""
    length = math.hypot(b[0] - a[0], b[1] - a[1])
    if length < 0.7:
        return []
    count = max(1, round(length / (_LONG * height)))
    scale = float(np.clip(length / count / _LONG, 0.4, 1.6))
    yaw = math.atan2(b[1] - a[1], b[0] - a[0])
    return [Wish(key, name, a + (b - a) * ((i + 0.5) / count), yaw, scale, reach=0.0, piece=True) for i in range(count)]


def _row(
    key: str,
    line: NDArray[np.float64],
    name: str,
    apart: float,
    through: BaseGeometry | None,
    mapped: Sequence[NDArray[np.float64]],
) -> list[Wish]:
    """Things that stand along a line one by one, but for those that are mapped one by one too."""
    whole = shapely.LineString(line)
    count = max(1, round(whole.length / apart))
    own = np.array(mapped).reshape(-1, 2)
    found = []
    for k, d in enumerate(np.linspace(0, whole.length, count + 1)):
        point = whole.interpolate(d)
        if (through is None or not through.contains(point)) and not (
            np.hypot(*(own - (point.x, point.y)).T) < _GAP
        ).any():
            found.append(Wish(f"{key}.{k}", name, np.array(point.coords[0]), reach=0.6))
    return found


def _blocks(key: str, shape: BaseGeometry, tall: float | None) -> list[Wish]:
    """Fill a hedge mapped as an area with blocks of a metre along its longer side."""
    box = shapely.oriented_envelope(shape)
    corners = np.array(box.exterior.coords[:3]) if box.geom_type == "Polygon" else np.zeros((3, 2))
    first, second = corners[1] - corners[0], corners[2] - corners[1]
    along = first if np.hypot(*first) >= np.hypot(*second) else second
    if np.hypot(*along) < 0.5:
        return []
    scale = 1.0 if tall is None else float(np.clip(tall / 1.2, 0.5, 1.6))
    yaw = math.atan2(along[1], along[0])
    u, v = np.array([math.cos(yaw), math.sin(yaw)]), np.array([-math.sin(yaw), math.cos(yaw)])
    middle = corners[0] + (corners[2] - corners[0]) / 2
    nu, nv = (max(1, round(float(np.hypot(*side)) / scale)) for side in sorted(
        (first, second), key=lambda s: -float(np.hypot(*s))))  # fmt: skip
    shapely.prepare(shape)
    found: list[Wish] = []
    for i in range(nu):
        for j in range(nv):
            xy = middle + u * (i + 0.5 - nu / 2) * scale + v * (j + 0.5 - nv / 2) * scale
            if len(found) < 200 and shape.dwithin(shapely.Point(xy), 0.15 * scale):
                found.append(Wish(f"{key}.{len(found)}", "hedge_block", xy, yaw, scale, reach=0.0, piece=True))
    return found


def gate_yaws(osm: OsmData) -> dict[int, float]:
    """Which way each gate leads through, by node id: across the barrier it hangs in, else along its way."""
    barriers: dict[int, float] = {}
    ways: dict[int, float] = {}
    wanted = {n.id for n in osm.nodes if n.tags.get("barrier") in _GATES}
    for way in osm.ways:
        fence = way.tags.get("barrier") in catalogue.barriers().lines or way.tags.get("barrier") == "retaining_wall"
        if not fence and "highway" not in way.tags:
            continue
        for k, node in enumerate(way.nodes):
            if node in wanted and len(way.line) == len(way.nodes):
                d = way.line[min(k + 1, len(way.line) - 1)] - way.line[max(k - 1, 0)]
                yaw = math.atan2(d[1], d[0])
                if fence:
                    barriers[node] = yaw + math.pi / 2
                else:
                    ways[node] = yaw
    return {**barriers, **ways}
