"""Walkways along streets: sidewalks, crossings and the corners that join them, as a graph of arrays.

`walkways_past` leads the walkways of a city past all that stands there, and keeps the result in the user's cache: in
27 km² that takes a minute and a half, and all runs of a city ask for the same.
"""

from __future__ import annotations

import hashlib
import logging
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property, lru_cache
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from vico.errors import OutputError
from vico.geo import overlay
from vico.io.arrays import npz_bytes, read_npz
from vico.io.cache import cache_folder
from vico.io.files import write_bytes
from vico.io.sources import source_digest
from vico.world.heights import HeightField
from vico.world.walk_clearance import BODY, ClearCourse, courses_past

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

SIDEWALK = 0
CROSSING = 1
CORNER = 2
_AT_END = 1e-6  # metres from an end of a line that are no way: lengths are sums of rounded numbers
SHORTEST = 6.0  # metres of sidewalk left between two obstacles that are worth keeping
_ON_GROUND = 0.5  # metres from the ground's height to what lies on it
_STEP_OFF = 1.2  # how far who is stuck steps off the kerb, metres


@dataclass(frozen=True, eq=False)
class Walkways:
    """Stretches that people walk both ways, and the points where they meet.

    Attributes
    ----------
    ids
        SUMO lane ids; empty for corners.
    kind
        SIDEWALK, CROSSING or CORNER, uint8, shape ``(n,)``.
    first, points, along
        Stretch ``i``'s centre line is ``points[first[i]:first[i + 1]]``; `along` the metres from its start.
    z
        How high the points lie, metres, shape ``(p,)``: on the ground, on a deck or in a tunnel.
    length, width
        Metres, shape ``(n,)``.
    room
        How far a walker's centre may be to the left and to the right of the centre line from each point to the next,
        metres, shape ``(p, 2)``.
    reach
        The same for who has to get past somebody and steps off the kerb: as far as buildings allow, shape ``(p, 2)``.
    junction
        Junction a crossing or corner belongs to, -1 for sidewalks.
    ends
        Meeting point at the start and the end, shape ``(n, 2)``.
    meeting_first, meeting
        Stretches at meeting point ``k``: ``meeting[meeting_first[k]:meeting_first[k + 1]]``.
    """

    ids: list[str]
    kind: NDArray[np.uint8]
    first: Ints
    points: Floats
    along: Floats
    z: Floats
    length: Floats
    width: Floats
    room: Floats
    reach: Floats
    junction: Ints
    ends: Ints
    meeting_first: Ints
    meeting: Ints

    def __len__(self) -> int:
        return len(self.ids)

    def line(self, stretch: int) -> Floats:
        """Centre line of a stretch, metres, shape ``(k, 2)``."""
        return self.points[self.first[stretch] : self.first[stretch + 1]]

    def room_at(self, stretch: int, offset: float) -> Floats:
        """Return the room to the left and to the right so many metres along a stretch, metres, shape ``(2,)``."""
        begin, end = int(self.first[stretch]), int(self.first[stretch + 1])
        segment = int(np.searchsorted(self.along[begin:end], offset, side="right")) - 1
        return self.room[begin + min(max(segment, 0), end - begin - 2)]

    def clear_of(self, solids: list[shapely.Polygon], ground: HeightField | None = None) -> Walkways:
        """Led past `solids` (buildings, things), in pieces where no way leads past, and with less room beside them.

        Sidewalks and corners stay above the edges of kerbs, too, where they can.

        Parameters
        ----------
        solids
            Footprints nobody can walk through, metres.
        ground
            The ground with its kerbs; None for none.
        """
        has_edges = ground is not None and ground.steps is not None
        if not len(self) or not (solids or has_edges):
            return self
        rows = self._rows()
        widest = np.array([row.room.max() for row in rows]), np.array([row.reach.max() for row in rows])
        kept_off = [ground if has_edges and _is_beside_kerbs(row, ground) else None for row in rows]
        courses = courses_past([row.line for row in rows], *widest, solids, kept_off)
        kept: list[_Row] = []
        spare = int(self.ends.max()) + 1  # where a sidewalk is cut short, its end meets nothing
        for i, row in enumerate(rows):
            if i not in courses:
                kept.append(row)
                continue
            for course in courses[i]:
                if not course.is_whole and row.kind != SIDEWALK:
                    continue
                piece = _piece(row, course, spare)
                spare += 2
                if course.is_whole or _along(piece.line)[-1] >= SHORTEST:
                    kept.append(piece)
        return _graph_arrays(kept)

    def without(self, dropped: NDArray[np.bool_]) -> Walkways:
        """Return a copy without some stretches."""
        return _graph_arrays([row for row, gone in zip(self._rows(), dropped.tolist(), strict=True) if not gone])

    def _rows(self) -> list[_Row]:
        """Return the stretches one by one."""
        parts = [slice(a, b) for a, b in zip(self.first[:-1].tolist(), self.first[1:].tolist(), strict=True)]
        return [
            _Row(
                self.ids[i],
                int(self.kind[i]),
                self.points[part],
                self.z[part],
                float(self.width[i]),
                self.room[part],
                self.reach[part],
                int(self.junction[i]),
                (int(self.ends[i, 0]), int(self.ends[i, 1])),
            )
            for i, part in enumerate(parts)
        ]


@dataclass(frozen=True)
class _Row:
    """One stretch while the graph is put together."""

    id: str
    kind: int
    line: Floats
    z: Floats
    width: float
    room: Floats
    reach: Floats
    junction: int
    ends: tuple[int, int]


def walkways_of(
    ways: list[tuple[str, bool, Floats, Floats, float, int]],
    corners: list[tuple[int, Floats, list[tuple[str, int]]]],
) -> Walkways:
    """Join sidewalks and crossings by the areas between them.

    Parameters
    ----------
    ways
        Lane id, whether it is a crossing, centre line and its heights, width, junction (-1 for sidewalks).
    corners
        Junction, outline of the area, and the lane ends at it (lane id, 0 = its start, 1 = its end).
    """
    number = {way[0]: i for i, way in enumerate(ways)}

    def sides(line: Floats, width: float) -> tuple[Floats, Floats]:
        room = np.full((len(line), 2), max(width / 2 - BODY, 0.05))
        return room, room + _STEP_OFF

    # Every lane end is a meeting point of its own; a corner's stretches join them in pairs.
    rows = [
        _Row(
            name,
            CROSSING if crossing else SIDEWALK,
            line,
            z,
            width,
            *sides(line, width),
            junction,
            (2 * i, 2 * i + 1),
        )
        for i, (name, crossing, line, z, width, junction) in enumerate(ways)
    ]
    for place, outline, touching in corners:
        area = _Corner(overlay.make_valid(shapely.Polygon(outline)) if len(outline) > 2 else shapely.Polygon())
        for k, (a, side_a) in enumerate(touching):
            for b, side_b in touching[k + 1 :]:
                i, j = number[a], number[b]
                if i == j:
                    continue
                start, end = rows[i].line[-side_a], rows[j].line[-side_b]
                if np.linalg.norm(end - start) < 0.05:
                    end = end + np.array([0.05, 0.0])
                width = min(rows[i].width, rows[j].width)
                ends = (2 * i + side_a, 2 * j + side_b)
                path = area.path(start, end)
                z = np.interp(_along(path), [0.0, _along(path)[-1]], [rows[i].z[-side_a], rows[j].z[-side_b]])
                rows.append(_Row("", CORNER, path, z, width, *sides(path, width), place, ends))
    return _graph_arrays(rows)


def _is_beside_kerbs(row: _Row, ground: HeightField | None) -> bool:
    """Return whether a stretch runs on the ground and is no crossing."""
    return ground is not None and row.kind != CROSSING and bool((np.abs(row.z - ground(row.line)) < _ON_GROUND).all())


def _along(line: Floats) -> Floats:
    """Metres from the start of a line at each of its points."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])


def _piece(row: _Row, course: ClearCourse, spare: int) -> _Row:
    """Return the part of a stretch that a course is; its new ends are `spare` and the next."""
    along = _along(row.line)
    z = np.interp(course.offsets, along, row.z)
    ends = (
        row.ends[0] if course.offsets[0] < _AT_END else spare,
        row.ends[1] if course.offsets[-1] > along[-1] - _AT_END else spare + 1,
    )
    return replace(row, line=course.points, z=z, room=course.room, reach=course.reach, ends=ends)


def _graph_arrays(rows: list[_Row]) -> Walkways:
    n = len(rows)
    first = np.zeros(n + 1, np.int32)
    first[1:] = np.cumsum([len(row.line) for row in rows])
    steps = [_along(row.line) for row in rows]
    used, renamed = np.unique(np.array([row.ends for row in rows], np.int64).reshape(-1), return_inverse=True)
    ends = renamed.reshape(-1, 2).astype(np.int32)
    meets: list[list[int]] = [[] for _ in range(len(used))]
    for i, (a, b) in enumerate(ends.tolist()):
        meets[a].append(i)
        meets[b].append(i)
    meeting_first = np.zeros(len(used) + 1, np.int32)
    meeting_first[1:] = np.cumsum([len(row) for row in meets])
    return Walkways(
        ids=[row.id for row in rows],
        kind=np.array([row.kind for row in rows], np.uint8),
        first=first,
        points=np.concatenate([row.line for row in rows]) if n else np.zeros((0, 2)),
        along=np.concatenate(steps) if n else np.zeros(0),
        z=np.concatenate([row.z for row in rows]) if n else np.zeros(0),
        length=np.array([s[-1] for s in steps]),
        width=np.array([row.width for row in rows]),
        room=np.concatenate([np.zeros((0, 2)), *(row.room for row in rows)]),
        reach=np.concatenate([np.zeros((0, 2)), *(row.reach for row in rows)]),
        junction=np.array([row.junction for row in rows], np.int32),
        ends=ends,
        meeting_first=meeting_first,
        meeting=np.array([i for row in meets for i in row], np.int32),
    )


class _Corner:
    """An area between the ends of walkways, and ways in it."""

    def __init__(self, area: shapely.Geometry) -> None:
        self._area = area
        self._grown = overlay.buffer(area, 0.15)
        shapely.prepare(self._grown)

    def path(self, start: Floats, end: Floats) -> Floats:
        """Return the shortest way between two points that stays in the area; straight where that is degenerate."""
        straight = np.array([start, end])
        if self._area.is_empty or self._grown.covers(shapely.LineString(straight)):
            return straight
        ring, ring_seen = self._ring
        if not len(ring):
            return straight
        points = np.concatenate([straight, ring])
        # The two ends come first, so what they see comes before what the ring's points see of each other.
        a, b = np.triu_indices(len(points), 1)
        first = len(a) - len(ring_seen)
        seen = np.concatenate([self._sees(points[a[:first]], points[b[:first]]), ring_seen])
        size = np.linalg.norm(points[a] - points[b], axis=1) + 1e-9
        graph = csr_matrix((size[seen], (a[seen], b[seen])), shape=(len(points), len(points)))
        _, before = dijkstra(graph, directed=False, indices=0, return_predecessors=True)
        if before[1] < 0:
            return straight
        chain = [1]
        while chain[-1] != 0:
            chain.append(int(before[chain[-1]]))
        return points[chain[::-1]]

    @cached_property
    def _ring(self) -> tuple[Floats, NDArray[np.bool_]]:
        """Points a body's width inside of the outline, and which pairs of them see each other."""
        inner = overlay.buffer(self._area, -BODY)
        rings = [np.asarray(p.exterior.coords)[:-1] for p in shapely.get_parts(inner) if isinstance(p, shapely.Polygon)]
        points = np.concatenate([np.zeros((0, 2)), *rings])
        a, b = np.triu_indices(len(points), 1)
        return points, self._sees(points[a], points[b])

    def _sees(self, one: Floats, other: Floats) -> NDArray[np.bool_]:
        """Return whether straight lines between points stay in the area, shape ``(n,)``."""
        return np.asarray(shapely.covers(self._grown, shapely.linestrings(np.stack([one, other], axis=1))))


_log = logging.getLogger(__name__)
_NAMES = tuple(field.name for field in fields(Walkways))


def walkways_past(
    walks: Walkways, solids: Sequence[shapely.Polygon], ground: HeightField | None, *, kept_as: str = ""
) -> Walkways:
    """Return walkways led past solids and kerbs, as `Walkways.clear_of` does.

    Parameters
    ----------
    walks, solids, ground
        As for `Walkways.clear_of`.
    kept_as
        Digest of the world that the ground is of: what was found is kept by it, and by the walkways and solids
        themselves. Nothing is kept without.
    """
    if not kept_as:
        return walks.clear_of(list(solids), ground)
    path = cache_folder() / "walkways" / f"{_key(walks, solids, kept_as)}.npz"
    known = _read(path)
    if known is None:
        known = walks.clear_of(list(solids), ground)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            write_bytes(path, npz_bytes({name: np.asarray(getattr(known, name)) for name in _NAMES}))
        except (OutputError, OSError) as error:  # a cache that can't be written costs time, nothing else
            _log.warning("walkways are not kept: %s", error)
    return known


def _key(walks: Walkways, solids: Sequence[shapely.Polygon], kept_as: str) -> str:
    total = hashlib.sha256(f"{kept_as} {_finder()} {np.__version__} {shapely.geos_version_string}".encode())
    for name in _NAMES:
        total.update(np.asarray(getattr(walks, name)).tobytes())
    for solid in shapely.to_wkb(np.array(solids, object)).tolist():
        total.update(solid)
    return total.hexdigest()[:32]


@lru_cache(maxsize=1)
def _finder() -> str:
    """Return a digest of the code that finds ways past things."""
    return source_digest(Path(__file__).with_name("walkways.py"), "vico.world.walkways")


def _read(path: Path) -> Walkways | None:
    """Return kept walkways; None where there are none, or the file is damaged: they are found anew."""
    try:
        arrays = read_npz(path.read_bytes(), _NAMES)
        return Walkways(**{**arrays, "ids": arrays["ids"].tolist()})
    except (OSError, ValueError, KeyError, EOFError, TypeError, BadZipFile, zlib.error):
        return None
