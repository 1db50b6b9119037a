"""Placement of outdoor things: what should stand where, and the room for it beside all that is there already.

There are buildings, kerbs, lanes, and the things placed before. Tags say numbers and directions.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay
from vico.geo.osm import Tags
from vico.geo.quantities import Kind, read

_POINTS = ("N", "NNE", "NE", "ENE", "E", "ESE", "SE", "SSE", "S", "SSW", "SW", "WSW", "W", "WNW", "NW", "NNW")


@dataclass
class Placement:
    """A thing that should stand somewhere.

    Attributes
    ----------
    id
        OSM id, with a running number where one mapped thing becomes many.
    prototype
        Name of its model.
    xy
        Where, metres east and north.
    yaw
        Radians from east; None: as its surroundings suggest.
    scale
        Factor on the model.
    entity, group
        As the record of a stop or station says, or None.
    reach
        How far it may be moved to find room, metres; 0: it stands there or nowhere.
    piece
        A piece of a line: its ends may touch walls and other pieces.
    """

    id: str
    prototype: str
    xy: NDArray[np.float64]
    yaw: float | None = None
    scale: float = 1.0
    entity: int | None = None
    group: str | None = None
    reach: float = 3.0
    piece: bool = False


def yaw_from_tag(tags: Tags) -> float | None:
    """Yaw from a `direction` tag: degrees clockwise from north, or a compass point."""
    said = tags.get("direction", tags.get("camera:direction", ""))
    degrees = 22.5 * _POINTS.index(said) if said in _POINTS else read(said, Kind.ANGLE).value
    return None if degrees is None else math.remainder(math.pi / 2 - math.radians(degrees), 2 * math.pi)


WAY = 0.9  # metres that a person, a pram or a wheelchair needs to get past
_AROUND = 1.04  # the corners of buffers of so few sides lie no nearer than their radius
_RUN = 12  # segments of an outline that are looked at together
_CELL = 8.0


class PreparedArea:
    """A large area that many small things ask about.

    Parameters
    ----------
    shape
        The area, metres; may be empty.
    """

    def __init__(self, shape: BaseGeometry) -> None:
        self.shape = shape
        shapely.prepare(shape)
        runs: list[shapely.LineString] = []
        for line in shapely.get_parts(shapely.boundary(shape)):
            points = shapely.get_coordinates(line)
            runs += [shapely.LineString(points[k : k + _RUN + 1]) for k in range(0, len(points) - 1, _RUN)]
        self._runs = shapely.STRtree(runs)

    @property
    def is_empty(self) -> bool:
        """Whether there is nothing."""
        return bool(self.shape.is_empty)

    def to_edge(self, point: shapely.Point) -> shapely.LineString:
        """Return the shortest line from a point to the outline."""
        k = self._runs.query_nearest(point, all_matches=False)
        return shapely.shortest_line(point, self._runs.geometries[int(k[0])])

    def edges(self, around: BaseGeometry) -> list[BaseGeometry]:
        """Return the pieces of the outline within a small area, each in one piece."""
        found = self._runs.geometries[np.sort(self._runs.query(around, predicate="intersects"))]
        return list(shapely.get_parts(overlay.union_all(overlay.intersection(found, around)))) if len(found) else []


@dataclass(frozen=True)
class _Placed:
    kind: str
    foot: shapely.Polygon
    piece: bool


class FreeSpace:
    """Room for things, given out first come, first served.

    Parameters
    ----------
    solids
        Footprints that nothing may stand in.
    carriageway
        Where vehicles drive.
    lanes
        What vehicles sweep, which may leave `carriageway`.
    openings
        Where walkers walk.
    half
        Half the side of the world, metres.
    """

    def __init__(
        self,
        *,
        solids: Sequence[BaseGeometry],
        carriageway: BaseGeometry,
        lanes: Sequence[BaseGeometry],
        openings: BaseGeometry,
        half: float,
    ) -> None:
        self.shapes = list(solids)
        self.solids = shapely.STRtree(self.shapes)
        self.carriageway = PreparedArea(carriageway)
        self.openings = PreparedArea(openings)
        self.half = half
        self._lanes = shapely.STRtree(list(lanes))
        self._placed: dict[tuple[int, int], list[_Placed]] = {}

    def conflict(self, foot: shapely.Polygon, margin: float, *, core: shapely.Polygon | None = None) -> str | None:
        """Why a foot can't be there, or None.

        With a `core` it is a piece of a line, which may touch other pieces, and buildings off its core.
        """
        x0, y0, x1, y1 = foot.bounds
        if min(x0, y0) < -self.half or max(x1, y1) > self.half:
            return "beyond the edge of the world"
        if len(self.solids.query(core or foot, predicate="dwithin", distance=margin)):
            return "inside a building"
        if shapely.intersects(self.carriageway.shape, foot) or len(self._lanes.query(foot, predicate="intersects")):
            return "on a lane"
        piece = core is not None
        if any(not (piece and other.piece) and other.foot.intersects(foot) for other in self._near(foot)):
            return "overlaps another object"
        return None

    def free(self, feet: NDArray[np.object_], margin: float) -> NDArray[np.bool_]:
        """Which of some feet close to one another can be where they are, shape ``(n,)``."""
        box = shapely.bounds(feet)
        free = np.asarray(np.abs(box).max(axis=1) <= self.half)
        free[self.solids.query(feet, predicate="dwithin", distance=margin)[0]] = False
        free[self._lanes.query(feet, predicate="intersects")[0]] = False
        free[free] = ~shapely.intersects(self.carriageway.shape, feet[free])
        if free.any():
            others = [other.foot for other in self._near(shapely.box(*box[:, :2].min(axis=0), *box[:, 2:].max(axis=0)))]
            if others:
                free[free] = ~shapely.intersects(feet[free][:, None], np.array(others, object)).any(axis=1)
        return free

    def blocks_way(self, foot: shapely.Polygon, *, anywhere: bool = True) -> bool:
        """Whether a foot would close the last gap between two other things.

        What is nearer to it than `WAY` counts: walls, kerbs, things. Where all of that hangs together, with gaps nobody
        gets through, there is a way past on the other side. Two walls of one building are two things, as in an alley
        between its wings.

        Parameters
        ----------
        anywhere
            Also off the footways: people walk in yards, too. Plants grow there.
        """
        on_footway = bool(shapely.intersects(self.openings.shape, foot))
        if not anywhere and not on_footway:
            return False
        around = overlay.buffer(foot, _AROUND * WAY, quad_segs=3)
        near: list[BaseGeometry] = [
            part
            for k in np.sort(self.solids.query(around, predicate="intersects")).tolist()
            for part in shapely.get_parts(overlay.intersection(self.shapes[k], around))
        ]
        near += [other.foot for other in self._near(around) if other.foot.intersects(around)]
        # Where there is no footway one walks on the road as well.
        near += self.carriageway.edges(around) if on_footway else []
        return len(near) > 1 and not _hang_together(near)

    def twin(self, kind: str, foot: shapely.Polygon, gap: float) -> bool:
        """Whether a thing of this kind stands nearer than `gap` metres."""
        return any(
            other.kind == kind and other.foot.dwithin(foot, gap) for other in self._near(overlay.buffer(foot, gap))
        )

    def claim(self, kind: str, foot: shapely.Polygon, *, piece: bool = False) -> None:
        """Take the room."""
        placed = _Placed(kind, foot, piece)
        for cell in _cells(foot):
            self._placed.setdefault(cell, []).append(placed)

    def _near(self, shape: BaseGeometry) -> list[_Placed]:
        cells = list(_cells(shape))
        if len(cells) == 1:
            return self._placed.get(cells[0], [])
        found = {id(placed): placed for cell in cells for placed in self._placed.get(cell, ())}
        return list(found.values())


def _cells(shape: BaseGeometry) -> Iterator[tuple[int, int]]:
    x0, y0, x1, y1 = shape.bounds
    for i in range(math.floor(x0 / _CELL), math.floor(x1 / _CELL) + 1):
        for j in range(math.floor(y0 / _CELL), math.floor(y1 / _CELL) + 1):
            yield i, j


def _hang_together(shapes: Sequence[BaseGeometry]) -> bool:
    """Whether nobody gets through between any two groups of shapes."""
    reached, left = [shapes[0]], list(shapes[1:])
    while reached and left:
        here = reached.pop()
        close = [shape for shape in left if shape.dwithin(here, WAY)]
        left = [shape for shape in left if not shape.dwithin(here, WAY)]
        reached += close
    return not left
