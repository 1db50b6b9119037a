"""Where pictures of a world are taken from: spots on sidewalks that look along streets."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.geo import overlay
from vico.world.walkable import CROSSING, OPEN, SIDEWALK
from vico.world.world import World

_TILT = 0.02  # radians, a little up: more facades, less pavement


@dataclass(frozen=True)
class Viewpoint:
    """A camera at eye height: `position` and `forward`, ENU; `fov_y` radians."""

    position: tuple[float, float, float]
    forward: tuple[float, float, float]
    fov_y: float = math.radians(62.0)
    width: int = 960
    height: int = 540


@dataclass(frozen=True)
class Overhead:
    """The whole square of a world from straight above, north up; side in pixels."""

    side: int = 1200


def viewpoints(world: World, *, count: int = 8) -> list[Viewpoint]:
    """Choose spots on sidewalks that look along streets: open, varied, far from each other.

    Returns
    -------
    list of Viewpoint
        At most `count`, at 1.7 m; the same for the same world.
    """
    half = world.half
    shapes = [shapely.Polygon(b.footprint[0], b.footprint[1:]) for b in world.buildings]
    walls = shapely.STRtree(shapes)
    objects = world.objects.where(world.objects.outdoors)
    things = objects.position[:, :2] if len(objects) else np.zeros((0, 2))
    trees = things[objects.kind == "tree"] if len(objects) else things
    found: list[tuple[float, tuple[float, float], float]] = []
    ways = [road for road in world.roads.roads if road.layer == 0]
    streets = [road for road in ways if road.lanes or road.kind == "pedestrian"]
    # Where there is no street, footways are where people look from.
    for road in streets or ways:
        line = shapely.LineString(road.line)
        for d in np.arange(min(10.0, line.length / 2), line.length, 22.0):
            here, ahead = line.interpolate(d), line.interpolate(min(d + 2.0, line.length))
            back = line.interpolate(max(d - 2.0, 0.0))
            yaw = math.atan2(ahead.y - back.y, ahead.x - back.x)
            for turn in (0.0, math.pi):
                spot = _beside(world, (here.x, here.y), yaw + turn, road.width / 2 + 1.6 if road.lanes else 0.0)
                if spot is None or max(abs(spot[0]), abs(spot[1])) > 0.9 * half:
                    continue
                score = _openness(spot, yaw + turn, walls, shapes, things, trees, half)
                if score is not None:
                    found.append((score, spot, yaw + turn))
    found.sort(key=lambda row: (-row[0], row[1]))
    chosen: list[tuple[tuple[float, float], float]] = []
    for apart in (0.45 * half, 0.25 * half, 0.1 * half):
        for _, spot, yaw in found:
            if len(chosen) < count and all(math.dist(spot, other) > apart for other, _ in chosen):
                chosen.append((spot, yaw))
    views = []
    for (x, y), yaw in chosen:
        z = float(world.height((x, y))) + 1.7
        forward = (math.cos(yaw) * math.cos(_TILT), math.sin(yaw) * math.cos(_TILT), math.sin(_TILT))
        views.append(Viewpoint((x, y, z), forward))
    return views


def _beside(world: World, xy: tuple[float, float], yaw: float, aside: float) -> tuple[float, float] | None:
    """Find a free spot on the right-hand sidewalk."""
    for distance in (aside, aside + 0.7, aside + 1.4, aside - 0.5):
        spot = (xy[0] + math.sin(yaw) * distance, xy[1] - math.cos(yaw) * distance)
        if int(world.walkable.class_at(spot)) in (SIDEWALK, CROSSING, OPEN) and bool(world.walkable.is_connected(spot)):
            return round(spot[0], 2), round(spot[1], 2)
    return None


def _openness(
    spot: tuple[float, float],
    yaw: float,
    walls: shapely.STRtree,
    shapes: Sequence[shapely.Polygon],
    things: NDArray[np.float64],
    trees: NDArray[np.float64],
    half: float,
) -> float | None:
    """How good a view is: far, with facades to the sides and trees within, nothing before the lens; None: hidden."""
    ahead = np.array([math.cos(yaw), math.sin(yaw)])
    point = shapely.Point(spot)
    reach = 220.0
    for spread in (-0.14, 0.0, 0.14):
        far = (spot[0] + reach * math.cos(yaw + spread), spot[1] + reach * math.sin(yaw + spread))
        ray = shapely.LineString([spot, far])
        hits = walls.query(ray, predicate="intersects")
        free = min((point.distance(overlay.crossing(shapes[i], ray)) for i in hits.tolist()), default=reach)
        if free < 35.0:
            return None
        if spread == 0.0:
            depth = free
    beyond = np.array(spot) + ahead * 100.0
    if np.abs(beyond).max() > half:  # looks out of the world
        return None
    score = min(depth, 160.0)
    rel = things - np.array(spot)
    along, across = rel @ ahead, rel @ np.array([-ahead[1], ahead[0]])
    if ((along > -0.5) & (along < 7.0) & (np.abs(across) < 1.0 + 0.35 * np.maximum(along, 0.0))).any():
        return None
    score += 1.5 * min(int(((along > 0) & (along < 60) & (np.abs(across) < 20)).sum()), 30)
    rel = trees - np.array(spot)
    if (np.hypot(*rel.T) < 7.0).any():  # no leaves before the lens
        return None
    score += 4.0 * min(int((np.hypot(*rel.T) < 50).sum()), 8)
    near = walls.query(overlay.buffer(point, 25.0), predicate="intersects")
    return score + 6.0 * min(len(near), 6)
