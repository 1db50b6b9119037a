"""Street name signs: on walls of the houses at corners, or on posts that stand there."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from vico.geometry import distance
from vico.world.heights import HeightField
from vico.world.model import Building, Road, Roads
from vico.world.objects import Objects
from vico.worldgen.facades.signs import Boards, Lettering, drawable_text
from vico.worldgen.facades.walls import Face, GroundFloors, Pieces, Wall
from vico.worldgen.facts.street_habits import Plates

_TALL = 0.22  # metres, height of a plate
_LONGEST = 2.2  # metres, length of a plate; longer names have lower plates
_OFF = 0.09  # metres before the wall: before its mouldings
_END = 0.35  # metres between a plate and the end of its wall
_ABOVE = 0.02  # metres above the ground floor: over its band, below windows
_ALONG = 26.0  # metres along the street from a corner within which a wall begins
_ASIDE = 10.0  # metres beside the street that the wall stands at most
_PARALLEL = math.cos(math.radians(25.0))
_LEAST_WALL = 3.0  # metres
_BEFORE = 1.0  # metres before a wall at which the ground below a plate is looked up
# Metres of a plate above that ground: where houses stand on slopes, a storey may be below the street.
_LEAST_UP = 2.0
_MOST_UP = 7.0
_NEAR = 16.0  # metres from the corner to a post at most
_LOW = 3.2  # metres, the least height of a post that carries a name
_HIGH = 14.0  # and the greatest
_ON_LAMP = 3.1  # metres above the ground on a post
_GAP = 0.05  # metres
_THICK = 0.02  # metres
_POSTS = ("street_lamp", "traffic_signals")  # those that are taken first come first
_MOST_CHARACTERS = 36
_NO_STREETS = ("service", "_link")  # kinds of roads whose names are those of ramps and ways out


@dataclass(frozen=True)
class NamePlate:
    """A plate with the name of a street.

    Attributes
    ----------
    lettering
        What it says.
    entity
        Of the house or post that carries it.
    wall
        Where it hangs; None: on a post.
    at
        On a wall: along it, and its lower edge, metres. On a post: where the post stands, and the lower edge.
    along
        Level unit vector along the street.
    """

    lettering: Lettering
    entity: int
    wall: Wall | None
    at: tuple[float, ...]
    along: tuple[float, float]

    def hang(self, boards: Boards, pieces: Pieces) -> bool:
        """Add the plate to some pieces; return whether there was room to paint it."""
        board = boards.by_lettering.get(self.lettering)
        if board is None:
            return False
        stuff = boards.materials[board.page].name
        wide = min(_TALL * board.aspect, _LONGEST)
        tall = wide / board.aspect
        if self.wall is not None:
            s, z = self.at
            s = min(max(s, wide / 2 + _END), self.wall.length - wide / 2 - _END)
            face = Face.on(pieces, self.entity, self.wall)
            face.panel(s - wide / 2, s + wide / 2, z, z + tall, _OFF, uv=board.uv, colour=(255, 255, 255), stuff=stuff)
            return True
        x, y, z = self.at
        (c, s), (out_x, out_y) = self.along, (-self.along[1], self.along[0])
        for side in (1.0, -1.0):
            start = x + side * _THICK * out_x, y + side * _THICK * out_y
            right = (-side * c, -side * s)
            face = Face(pieces, self.entity, start, right, (side * out_x, side * out_y))
            # Away from the post, along the street: seen from one side it begins there, from the other it ends there.
            a, b = (-_GAP - wide, -_GAP) if side > 0 else (_GAP, _GAP + wide)
            face.panel(a, b, z, z + tall, 0.0, uv=board.uv, colour=(255, 255, 255), stuff=stuff)
        return True


@dataclass(frozen=True)
class Streets:
    """Facts that decide where plates hang.

    Attributes
    ----------
    roads
        Streets and footways.
    objects
        What stands in them.
    height
        Of the ground.
    plates
        What plates look like here.
    """

    roads: Roads
    objects: Objects
    height: HeightField
    plates: Plates


def name_plates(streets: Streets, buildings: Sequence[Building], ground: GroundFloors) -> list[NamePlate]:
    """Choose where the names of streets are read.

    Parameters
    ----------
    streets
        The streets, and what stands in them.
    buildings
        Those whose walls may carry plates.
    ground
        Their walls.

    Returns
    -------
    list of NamePlate
        One for each end of a street at a corner, where something carries it; none of names whose script can't be drawn.
    """
    match streets.plates.names_on:
        case "walls":
            return _on_walls(streets, buildings, ground)
        case "posts":
            return _on_posts(streets)
    return []


def _corners(roads: Roads) -> dict[tuple[float, float], list[tuple[Road, tuple[float, float]]]]:
    """Return where streets of different names meet: the roads there, and the way each leads from it."""
    ends: dict[tuple[float, float], list[tuple[Road, tuple[float, float]]]] = {}
    for road in roads.roads:
        is_street = road.kind == "pedestrian" or (road.lanes and not road.kind.endswith(_NO_STREETS))
        if road.name and road.layer == 0 and is_street:
            for line in (road.line, road.line[::-1]):
                way = _way(line)
                if way is not None:
                    ends.setdefault((round(line[0][0], 1), round(line[0][1], 1)), []).append((road, way))
    return {point: here for point, here in ends.items() if len({road.name for road, _ in here}) > 1}


def _way(line: Sequence[tuple[float, float]]) -> tuple[float, float] | None:
    """Direction in which a line leads away from its first point."""
    whole = shapely.LineString(line)
    if whole.length < 1.0:
        return None
    ahead = whole.interpolate(min(12.0, whole.length))
    dx, dy = ahead.x - line[0][0], ahead.y - line[0][1]
    size = math.hypot(dx, dy)
    return (dx / size, dy / size) if size > 0.5 else None


def _arms(streets: Streets) -> Iterator[tuple[tuple[float, float], Road, tuple[float, float], Lettering]]:
    """Yield the arms of all corners, of each name once a direction, in a fixed order."""
    plates = streets.plates
    for point, here in sorted(_corners(streets.roads).items(), key=lambda one: one[0]):
        for road, way in sorted(here, key=lambda one: (one[0].name or "", one[1])):
            text = drawable_text((road.name or "").split(";")[0])
            if text is not None and len(text) <= _MOST_CHARACTERS:
                yield point, road, way, Lettering(text, plates.ground, plates.letters, plates.rim, shines=False)


def _on_walls(streets: Streets, buildings: Sequence[Building], ground: GroundFloors) -> list[NamePlate]:
    edges, owner = _edges(buildings)
    if not len(edges):
        return []
    tree = shapely.STRtree(shapely.linestrings(edges))
    along = edges[:, 1] - edges[:, 0]
    length = np.hypot(*along.T)
    along /= np.maximum(length, 1e-9)[:, None]
    taken: dict[tuple[int, tuple[float, float]], list[float]] = {}
    found = []
    for point, road, way, lettering in _arms(streets):
        near = np.sort(tree.query(shapely.Point(point).buffer(_ALONG + _ASIDE)))
        near = near[length[near] >= _LEAST_WALL]
        # Outlines run counter-clockwise: outside is to the right of an edge.
        facing = along[near][:, 0] * way[0] + along[near][:, 1] * way[1]
        rel = edges[near] - np.array(point)
        ahead = rel @ np.array(way)
        aside = rel @ np.array([-way[1], way[0]])
        beside = np.abs(aside).min(axis=1)
        left = aside.mean(axis=1) > 0.0
        fits = np.where(left, facing, -facing) > _PARALLEL
        fits &= (beside <= road.width / 2 + _ASIDE) & (ahead.max(axis=1) > 2.0) & (ahead.min(axis=1) < _ALONG)
        fits &= beside > 1.0
        for k in near[fits][np.argsort(np.maximum(ahead[fits].min(axis=1), 0.0), kind="stable")].tolist():
            plate = _on_wall(buildings[owner[k]], edges[k], along[k], point, lettering, ground)
            if plate is None or plate.wall is None:
                continue
            if not _LEAST_UP < _up(plate.wall, plate.at[0], plate.at[1], streets.height) < _MOST_UP:
                continue
            key = plate.entity, (round(plate.wall.start[0], 1), round(plate.wall.start[1], 1))
            if all(abs(plate.at[0] - other) > _LONGEST for other in taken.get(key, ())):
                taken.setdefault(key, []).append(plate.at[0])
                found.append(plate)
            break
    return found


def _up(wall: Wall, s: float, z: float, height: HeightField) -> float:
    """Return how high a plate hangs above the ground before it, metres."""
    x, y = (wall.start[k] + wall.right[k] * s + wall.out[k] * _BEFORE for k in range(2))
    return z - float(height((x, y)))


def _edges(buildings: Sequence[Building]) -> tuple[np.ndarray, np.ndarray]:
    """Return the edges of all outlines, ``(n, 2, 2)``, and whose they are."""
    parts, owner = [], []
    for k, building in enumerate(buildings):
        ring = np.asarray(building.footprint[0], np.float64)
        parts.append(np.stack([ring, np.roll(ring, -1, axis=0)], axis=1))
        owner.append(np.full(len(ring), k))
    if not parts:
        return np.zeros((0, 2, 2)), np.zeros(0, np.int64)
    return np.concatenate(parts), np.concatenate(owner)


def _on_wall(
    building: Building,
    edge: np.ndarray,
    along: np.ndarray,
    corner: tuple[float, float],
    lettering: Lettering,
    ground: GroundFloors,
) -> NamePlate | None:
    """Hang a plate at the end of a wall that is nearer to the corner; None where it has no storey above the first."""
    if building.levels < 2:
        return None
    first = distance(edge[0], corner) <= distance(edge[1], corner)
    end = edge[0] + along * 0.6 if first else edge[1] - along * 0.6
    wall = ground.at(building.entity, float(end[0]), float(end[1]), math.atan2(-along[0], along[1]))
    if wall is None or wall.length < _LEAST_WALL or wall.high + 1.0 > building.base + building.height:
        return None
    at_start = abs(wall.along(*corner)) <= abs(wall.along(*corner) - wall.length)
    s = 0.0 if at_start else wall.length
    return NamePlate(lettering, building.entity, wall, (s, wall.high + _ABOVE), (float(along[0]), float(along[1])))


def _on_posts(streets: Streets) -> list[NamePlate]:
    """Hang the names of a corner's streets on one post each, one above the other."""
    objects = streets.objects
    tall = np.isin(objects.kind, _POSTS) & (objects.size_z >= _LOW) & (objects.size_z <= _HIGH)
    posts = np.flatnonzero(tall)
    rank = np.array([_POSTS.index(kind) for kind in objects.kind[posts].tolist()], np.int64)
    found, used = [], set()
    last: tuple[float, float] | None = None
    for point, road, way, lettering in _arms(streets):
        if not len(posts):
            break
        if point != last:
            far = np.hypot(objects.x[posts] - point[0], objects.y[posts] - point[1])
            order = np.lexsort((far, rank))
            order = order[(far[order] <= _NEAR)]
            last, hung = point, set[str]()
            post = next((int(k) for k in posts[order].tolist() if k not in used), None)
            if post is not None:
                used.add(post)
        if post is None or road.name in hung or len(hung) == 2:
            continue
        lamp = objects.kind[post] == "street_lamp"
        z = float(objects.z[post]) + (_ON_LAMP if lamp else float(objects.size_z[post]))
        z += (_TALL + 0.06) * len(hung)
        hung.add(road.name or "")
        at = float(objects.x[post]), float(objects.y[post]), z
        found.append(NamePlate(lettering, int(objects.entity[post]), None, at, way))
    return found
