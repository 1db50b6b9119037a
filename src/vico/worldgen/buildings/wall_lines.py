"""The lines that a building's walls stand on, and what each wall shows by what it faces."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.exact import apply_matrix
from vico.geo.osm import OsmData, OsmWay
from vico.worldgen.buildings.solids import Footing
from vico.worldgen.facades.catalogue import styles
from vico.worldgen.facts.outlines.plans import BuildingPlan, PartPlan
from vico.worldgen.facts.outlines.roof_shapes import rings_of
from vico.worldgen.facts.tags import on_the_ground

_FRONT_REACH = 17.0  # metres from a street's centre line within which a wall faces it


class WallSide(IntEnum):
    """What a wall shows, by what it faces."""

    BLANK = 0
    BACK = 1
    FRONT = 2
    SHOPFRONT = 3


@dataclass
class WallLines:
    """Wall lines of all parts.

    Attributes
    ----------
    start, end
        Of each line, ENU metres, shape ``(n, 2)``; the building lies on its left.
    style
        What the wall shows: a `WallSide`, shape ``(n,)``.
    first
        Where each part's lines begin, shape ``(parts + 1,)``.
    """

    start: NDArray[np.float64]
    end: NDArray[np.float64]
    style: NDArray[np.int64]
    first: NDArray[np.int64]


def wall_lines(plans: list[BuildingPlan], seats: list[Footing], osm: OsmData) -> WallLines:
    """Return every wall's line, and what it shows: nothing towards a neighbour, a front towards a street."""
    starts: list[NDArray[np.float64]] = []
    ends: list[NDArray[np.float64]] = []
    part_of: list[int] = []
    plan_of: list[int] = []
    parts: list[PartPlan] = []
    first = [0]
    for p, plan in enumerate(plans):
        for part in plan.solids:
            for ring in rings_of(part.polygon):
                starts.append(ring)
                ends.append(np.roll(ring, -1, axis=0))
            n = sum(len(s) for s in starts[-(1 + len(part.polygon.interiors)) :])
            part_of += [len(parts)] * n
            plan_of += [p] * n
            first.append(first[-1] + n)
            parts.append(part)
    if not parts:
        return WallLines(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0, np.int64), np.zeros(1, np.int64))
    start, end = np.concatenate(starts), np.concatenate(ends)
    along = end - start
    length = np.hypot(*along.T)
    outward = np.stack([along[:, 1], -along[:, 0]], axis=1) / np.maximum(length, 1e-9)[:, None]
    middle = (start + end) / 2
    style = np.full(len(start), WallSide.BACK, np.int64)
    streets = [shapely.LineString(way.line) for way in osm.ways if is_street(way)]
    if streets:
        near = shapely.STRtree(streets).query(
            shapely.points(middle + outward * 1.0), predicate="dwithin", distance=_FRONT_REACH
        )
        style[np.unique(near[0])] = WallSide.FRONT
    trading = np.array([plan.shops > 0 or plan.use in ("retail", "commercial") for plan in plans])[plan_of]
    style[(style == WallSide.FRONT) & trading & (length > 2.2)] = WallSide.SHOPFRONT
    # A wall against a neighbour's is a fire wall where it rises above it, and unseen where it does not.
    probes = shapely.points(middle + outward * 0.4)
    left, right = shapely.STRtree([part.polygon for part in parts]).query(probes, predicate="intersects")
    owner = np.array(plan_of)
    owner_of_part = np.array([p for p, plan in enumerate(plans) for _ in plan.solids])
    low = np.array([part.low for part in parts])
    top = np.array([seats[p].base for p in owner_of_part]) + np.array([part.eaves for part in parts])
    ground = np.array([seats[p].base for p in owner_of_part])
    mine = np.array(part_of)[left]
    # High above a low neighbour a wall has windows again; the few that are drawn below its roof are unseen.
    tall = top[right] - ground[mine] > 0.6 * (top[mine] - ground[mine])
    other = (owner[left] != owner_of_part[right]) & (low[right] <= 0.0) & tall
    style[left[other]] = WallSide.BLANK
    style[length < 1.3] = WallSide.BLANK
    for k, part in enumerate(parts):
        if part.finish:
            mine = style[first[k] : first[k + 1]]
            mine[:] = WallSide.BLANK
            finish = styles().finishes[part.finish]
            if finish.picture:
                mine[list(finish.shown) or slice(None)] = WallSide.FRONT
    return WallLines(start, end, style, np.array(first))


def fronts_of(plans: list[BuildingPlan], seats: list[Footing], osm: OsmData) -> list[list[NDArray[np.bool_]]]:
    """Return, of each plan's parts, which edges of the outline are fronts."""
    edges = wall_lines(plans, seats, osm)
    shown = (edges.style == WallSide.FRONT) | (edges.style == WallSide.SHOPFRONT)
    made, k = [], 0
    for plan in plans:
        row = []
        for _ in plan.solids:
            row.append(shown[edges.first[k] : edges.first[k + 1]])
            k += 1
        made.append(row)
    return made


def is_street(way: OsmWay) -> bool:
    """Return whether a way is a street that houses face."""
    return (
        way.tags.get("highway") not in (None, "steps", "corridor", "elevator", "platform", "service", "path")
        and "building" not in way.tags
        and on_the_ground(way.tags)
    )


def lines_of_faces(
    middle: NDArray[np.float64], normal: NDArray[np.float64], owner: NDArray[np.int64], edges: WallLines
) -> NDArray[np.int64]:
    """Return the wall line each upright triangle stands on; -1 for parapets' insides and all that is not upright."""
    result = np.full(len(middle), -1, np.int64)
    upright = np.flatnonzero(np.abs(normal[:, 2]) < 0.15)
    order = upright[np.argsort(owner[upright], kind="stable")]
    bounds = np.searchsorted(owner[order], np.arange(len(edges.first)))
    for part in range(len(edges.first) - 1):
        faces = order[bounds[part] : bounds[part + 1]]
        if not len(faces):
            continue
        a, b = (
            edges.start[edges.first[part] : edges.first[part + 1]],
            edges.end[edges.first[part] : edges.first[part + 1]],
        )
        along = b - a
        length = np.maximum(np.hypot(*along.T), 1e-9)
        along = along / length[:, None]
        outward = np.stack([along[:, 1], -along[:, 0]], axis=1)
        away = middle[faces][:, None, :2] - a[None]
        t = (away * along).sum(-1)
        off = np.abs((away * outward).sum(-1)) + np.maximum(np.maximum(-t, t - length), 0.0)
        off = np.where(apply_matrix(normal[faces][:, :2], outward) > 0.9, off, np.inf)
        best = off.argmin(axis=1)
        good = off[np.arange(len(faces)), best] < 0.06
        result[faces[good]] = edges.first[part] + best[good]
    return result
