"""Outlines and multipolygons as people draw them, made into valid areas in bounded time.

Areas of multipolygon relations follow the OSM wiki's rules: ways that meet at their ends make rings, in any order and
direction; outer rings are filled, inner ones are holes. What mappers get wrong is mended where the meaning is plain,
and told. `check_size` refuses compressed extracts that unpack to too much.
"""

from __future__ import annotations

import bz2
import difflib
import gzip
import zlib
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from shapely import LineString, MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from vico.errors import SchemaError
from vico.geo import overlay
from vico.geo.frame import LocalFrame
from vico.geo.overlay import OverlayError, polygons_of
from vico.geometry import distances

#: A building with more corners than this is simplified: OpenStreetMap allows 2,000 nodes a way.
MOST_CORNERS = 1000
# Mending takes time that grows with the third power of the crossings: 200 random corners take seconds, 2,000 days.
_MOST_CROSSINGS = 200
_FREE = 64 << 20  # bytes that any extract may unpack to
_MOST_RATIO = 60  # real extracts unpack to 3 (pbf) to 20 times (XML) their size


def is_scribble(lines: list[NDArray[np.float64]]) -> bool:
    """Whether lines cross each other so often that they outline nothing, and would take for ever to mend.

    Parameters
    ----------
    lines
        Metres, shape ``(n, 2)`` each.
    """
    pieces = [np.concatenate([line[:-1], line[1:]], axis=1) for line in lines if len(line) > 1]
    if not pieces:
        return False
    segments = np.concatenate(pieces)
    boxes = shapely.box(
        *np.minimum(segments[:, :2], segments[:, 2:]).T, *np.maximum(segments[:, :2], segments[:, 2:]).T
    )
    tree = shapely.STRtree(boxes)
    crossings = 0
    for start in range(0, len(segments), 500):
        one, two = tree.query(boxes[start : start + 500])
        later = two > one + start + 1  # each pair once, neighbours not
        a, b = segments[one[later] + start], segments[two[later]]
        crossings += int((_apart(a, b) & _apart(b, a)).sum())
        if crossings > _MOST_CROSSINGS + len(segments) // 20:
            return True
    return False


def _apart(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether the ends of segments `b` lie on different sides of the lines through `a`, or on them."""
    along = a[:, 2:] - a[:, :2]

    def side(point: NDArray[np.float64]) -> NDArray[np.float64]:
        off = point - a[:, :2]
        return along[:, 0] * off[:, 1] - along[:, 1] * off[:, 0]

    return np.asarray(side(b[:, :2]) * side(b[:, 2:]) <= 0.0)


def repair_outline(polygon: Polygon) -> tuple[Polygon | MultiPolygon, str | None]:
    """Return the polygonal part of a possibly self-crossing outline, and what was wrong with it."""
    if not np.isfinite(shapely.get_coordinates(polygon)).all():
        return Polygon(), "outline with points too far away"
    if polygon.is_valid:
        return _round_to_grid(polygon), None
    if is_scribble([np.asarray(polygon.exterior.coords)]):
        return Polygon(), "outline crosses itself too often to mean an area; left out"
    parts = polygons_of(_round_to_grid(overlay.make_valid(polygon)))
    if not parts:
        return Polygon(), "area without extent"
    what = f"outline crosses or touches itself; kept as {len(parts)} part{'s' * (len(parts) > 1)}"
    return (parts[0] if len(parts) == 1 else MultiPolygon(parts)), what


def _round_to_grid(shape: Polygon | MultiPolygon) -> Polygon | MultiPolygon:
    """Round a shape to the grid of all overlays, so that whatever is cut from it meets it exactly; else empty it."""
    try:
        return overlay.on_grid(shape)
    except OverlayError:
        return Polygon()


def union_closing_gaps(shapes: Sequence[BaseGeometry], *, gap: float, least: float) -> Polygon | MultiPolygon:
    """Return what outlines cover together, gaps between them closed.

    Parameters
    ----------
    shapes
        Areas, metres.
    gap
        Half the width of gaps that are closed, metres.
    least
        Square metres below which a piece is left out.
    """
    whole = overlay.union_all(shapes)
    closed = overlay.buffer(overlay.buffer(whole, gap, join_style="mitre"), -gap, join_style="mitre")
    # The engine may lose a turned box when it is shrunk by centimetres (GEOS 3.14).
    kept = closed if closed.area > 0.98 * whole.area else whole
    parts = polygons_of(overlay.on_grid(kept), least)
    return parts[0] if len(parts) == 1 else MultiPolygon(parts)


def simplify_outline(shape: Polygon | MultiPolygon) -> tuple[Polygon | MultiPolygon, str | None]:
    """Return a shape of at most `MOST_CORNERS` corners, as near to the given one as that allows, and what was done."""
    corners = shapely.get_num_coordinates(shape)
    tolerance = 0.05
    while shapely.get_num_coordinates(shape) > MOST_CORNERS and tolerance < 100.0:
        shape, tolerance = overlay.simplify(shape, tolerance), tolerance * 2
    left = shapely.get_num_coordinates(shape)
    return shape, f"outline of {corners:,} corners; simplified to {left:,}" if left < corners else None


def check_size(path: Path) -> None:
    """Refuse a compressed extract that unpacks to far more than any real one does.

    Raises
    ------
    SchemaError
        If it does, or can't be unpacked.
    """
    name = path.name.lower()
    most = _FREE + _MOST_RATIO * path.stat().st_size
    try:
        if name.endswith(".pbf"):
            with path.open("rb") as file:
                size = _pbf_size(file, most)
        elif name.endswith((".gz", ".bz2")):
            size = 0
            with gzip.open(path) if name.endswith(".gz") else bz2.open(path) as packed:
                while size <= most and (block := packed.read(1 << 20)):
                    size += len(block)
        else:
            return
    except (OSError, EOFError, zlib.error) as error:
        raise SchemaError(f"{path}: truncated or broken ({error}); download it again, or clip it anew") from None
    if size > most:
        raise SchemaError(
            f"{path}: unpacks to more than {most >> 20:,} MiB, {_MOST_RATIO} times its size, as no map does; download "
            "it again"
        )


def _pbf_size(file: BinaryIO, most: int) -> int:
    """Return what the blocks of a PBF file say they unpack to, bytes; what is broken is left for the reader to say."""
    size = 0
    while size <= most and len(length := file.read(4)) == 4:
        header = file.read(min(int.from_bytes(length, "big"), 1 << 16))
        block = dict(_fields(header)).get(3)
        if not isinstance(block, int):
            break
        start = file.tell()
        size += next((value for key, value in _fields(file.read(min(block, 64))) if key == 2), block)
        file.seek(start + block)
    return size


def _fields(content: bytes) -> list[tuple[int, int]]:
    """Numbers of the protocol buffer's fields, and their values (of blobs, their lengths), as far as they go."""
    found: list[tuple[int, int]] = []
    place = 0
    while place < len(content):
        numbers: list[int] = []
        kind = 0
        for _ in range(2):
            value = shift = 0
            while place < len(content) and shift < 64:
                byte = content[place]
                place, value, shift = place + 1, value | (byte & 127) << shift, shift + 7
                if byte < 128:
                    break
            numbers.append(value)
        kind = numbers[0] & 7
        if kind not in (0, 2):
            break
        found.append((numbers[0] >> 3, numbers[1]))
        place += numbers[1] if kind == 2 else 0
    return found


#: Metres between two ends that are taken for one: a slip of the hand.
GAP = 1.5
_MOST_ENDS = 400  # whose gaps are measured
_ALIKE = 0.7  # of a misspelt role and the one that is meant (difflib's ratio)
_SYNONYMS = {"hole": "inner", "enclave": "inner", "exclave": "outer", "exterior": "outer", "interior": "inner"}


@dataclass(frozen=True)
class MemberWay:
    """A way of a multipolygon; `line` metres, shape ``(n, 2)``; `cut` if some of its nodes are not in the file."""

    id: int
    role: str
    line: NDArray[np.float64]
    cut: bool = False


@dataclass
class _Rings:
    """Lines of one role, made into areas: each ring's, and all together."""

    rings: list[Polygon | MultiPolygon]
    shape: Polygon | MultiPolygon
    gaps: list[tuple[float, NDArray[np.float64]]] = field(default_factory=list)  # width and middle
    closed: list[tuple[float, NDArray[np.float64]]] = field(default_factory=list)
    ends: int = 0  # that meet no other


def area_of_members(
    members: Sequence[MemberWay], missing: int, frame: LocalFrame
) -> tuple[Polygon | MultiPolygon | None, list[str]]:
    """Return the area of a multipolygon's members, and what is wrong with them.

    Parameters
    ----------
    members
        Its ways that are in the file, in its order.
    missing
        How many of its ways are not.
    frame
        Frame of the lines, to say where a gap is.

    Returns
    -------
    tuple
        The area, None where there is none; and sentences on what was mended or is the reason.
    """
    told: list[str] = []
    once = {member.id: member for member in reversed(members)}
    if len(once) < len(members):
        twice = sorted(number for number, count in Counter(m.id for m in members).items() if count > 1)
        told.append(f"lists {', '.join(f'w{number}' for number in twice[:5])} twice; taken once")
        members = [member for k, member in enumerate(members) if member.id not in {m.id for m in members[:k]}]
    if not members:
        return None, [f"all of its member ways ({missing}) are not in the file; left out"]
    if not all(np.isfinite(member.line).all() for member in members):
        return None, ["multipolygon with points too far away"]
    if is_scribble([member.line for member in members]):
        return None, ["its rings cross too often to mean an area; left out"]
    try:
        outer, inner = _by_role(members, told)
        if not outer:
            cause = (
                f"{missing} of its member ways are not in the file, none of the others"
                if missing
                else "none of its members"
            )
            return None, [*told, f"{cause} is outer; left out"]
        outside, holes = _assemble_rings(outer), _assemble_rings(inner)
        shape = outside.shape if holes.shape.is_empty else _with_islands(outside, holes)
    except OverlayError as error:
        return None, [*told, f"its rings can't be made into an area ({error})"]
    for what, rings in (("outer ring", outside), ("hole", holes)):
        told += [f"a gap of {_at(gap, frame)} in its {what} is closed" for gap in rings.closed[:3]]
    parts = polygons_of(shape)
    cut = missing > 0 or any(member.cut for member in members)
    if not parts:
        return None, [*told, _reason(outside, missing, len(members), cut, frame)]
    if missing:
        told.append(f"{missing} of its member ways are not in the file; kept what closes")
    elif not cut:
        if outside.ends:
            told.append(f"a part of its outer ring stays open{_where(outside, frame)}; kept what closes")
        if holes.ends:
            told.append(f"a hole stays open{_where(holes, frame)}; filled")
    return (parts[0] if len(parts) == 1 else MultiPolygon(parts)), told


def _with_islands(outside: _Rings, holes: _Rings) -> Polygon | MultiPolygon:
    """Return outer rings less the holes in them, with the outer rings that lie within holes."""
    shape = overlay.difference(outside.shape, holes.shape)
    if shape.is_empty or len(outside.rings) == 1:
        return shape
    points = shapely.point_on_surface(np.array(outside.rings, object))
    for k in np.flatnonzero(shapely.covers(holes.shape, points)).tolist():
        island = outside.rings[k]
        around = [hole for hole in holes.rings if hole.area > island.area and shapely.covers(hole, points[k])]
        if around:
            within = [hole for hole in holes.rings if hole.area < island.area]
            shape = overlay.union(shape, overlay.difference(island, overlay.union_all(within)) if within else island)
    return shape


def _reason(outside: _Rings, missing: int, count: int, cut: bool, frame: LocalFrame) -> str:
    """Return why members make no area."""
    if not outside.shape.is_empty:
        return "its holes cover all of it; left out (are the roles outer and inner exchanged?)"
    if missing:
        return f"{missing} of its {missing + count} member ways are not in the file, so that no ring closes; left out"
    if cut:
        return "nodes of its member ways are not in the file, so that no ring closes; left out"
    if outside.ends:
        return f"its outer ring is not closed in the map{_where(outside, frame)}; left out"
    return "its rings have no extent; left out"


def _at(gap: tuple[float, NDArray[np.float64]], frame: LocalFrame) -> str:
    """Return a gap's width and its place."""
    lat, lon = frame.to_geodetic(gap[1])
    return f"{gap[0]:.1f} m at {float(lat):.6f}, {float(lon):.6f}"


def _where(rings: _Rings, frame: LocalFrame) -> str:
    if not rings.gaps:
        return f" ({rings.ends} loose ends)"
    more = f" and {len(rings.gaps) - 3} more" if len(rings.gaps) > 3 else ""
    return f": a gap of {', of '.join(_at(gap, frame) for gap in rings.gaps[:3])}{more}"


def _by_role(
    members: Sequence[MemberWay], told: list[str]
) -> tuple[list[NDArray[np.float64]], list[NDArray[np.float64]]]:
    """Return lines of outer and of inner rings; those whose role says neither by where they lie."""
    outer: list[NDArray[np.float64]] = []
    inner: list[NDArray[np.float64]] = []
    unsure: list[MemberWay] = []
    for member in members:
        role = role_meant(member.role)
        if role is None:
            unsure.append(member)
            continue
        (outer if role == "outer" else inner).append(member.line)
        if role != member.role:
            told.append(f"role {member.role[:40]!r} of w{member.id} is read as {role}")
    if not unsure:
        return outer, inner
    merged = shapely.line_merge(shapely.MultiLineString([LineString(m.line) for m in unsure if len(m.line) > 1]))
    pieces = shapely.get_parts(merged)
    closed = [piece for piece in pieces if piece.is_ring]
    # What is open belongs to a ring with others: of outer members, unless one says otherwise.
    outer += [shapely.get_coordinates(piece) for piece in pieces if not piece.is_ring]
    holes = _holes([Polygon(ring) for ring in closed], _assemble_rings(outer).shape)
    for ring, is_hole in zip(closed, holes, strict=True):
        (inner if is_hole else outer).append(shapely.get_coordinates(ring))
    named = sorted({member.role[:40] for member in unsure if member.role})
    if named or any(holes):
        what = f"role {', '.join(map(repr, named))} is none" if named else "members have no role"
        told.append(f"{what}: rings within others are holes ({sum(holes)} of {len(closed)})")
    return outer, inner


def role_meant(role: str) -> str | None:
    """Return ``outer`` or ``inner``, as a role says or, misspelt, plainly means; None where it says neither."""
    plain = role.strip().casefold()
    if plain in _SYNONYMS:
        return _SYNONYMS[plain]
    for whole in ("outer", "inner"):
        if plain.startswith(whole):
            return whole
    return next(iter(difflib.get_close_matches(plain, ("outer", "inner"), n=1, cutoff=_ALIKE)), None)


def _holes(rings: Sequence[Polygon], outside: Polygon | MultiPolygon) -> list[bool]:
    """Whether rings of no role lie within an odd number of others: outer ones, and rings of no role."""
    if not rings:
        return []
    points = shapely.point_on_surface(np.array(rings, object))
    depth = shapely.covers(outside, points).astype(int)
    area = shapely.area(np.array(rings, object))
    within, around = shapely.STRtree(rings).query(points, predicate="intersects")
    np.add.at(depth, within, (area[around] > area[within]).astype(int))
    return [bool(d % 2) for d in depth]


def _assemble_rings(lines: Iterable[NDArray[np.float64]]) -> _Rings:
    """Assemble rings from lines, in any order and direction."""
    pieces = [LineString(line) for line in lines if len(line) > 1]
    if not pieces:
        return _Rings([], Polygon())
    merged = shapely.line_merge(shapely.MultiLineString(pieces))
    parts = shapely.get_parts(merged)
    rings = [part for part in parts if part.is_ring]
    if len(rings) == len(parts):
        areas = [repair_outline(Polygon(ring))[0] for ring in rings]
        return _Rings(areas, overlay.union_all(areas))
    found = _gaps([part for part in parts if not part.is_ring])
    if found.closed:
        links = [LineString(ends) for _, ends in found.closed]
        found.closed = [(width, ends.mean(axis=0)) for width, ends in found.closed]
        merged = shapely.line_merge(shapely.MultiLineString([*parts, *links]))
    # Rings that touch in a node merge into nothing closed: polygonize finds them, at a higher price.
    found.rings = list(overlay.polygonize([merged]))
    found.shape = overlay.union_all(found.rings)
    return found


def _gaps(lines: Sequence[LineString]) -> _Rings:
    """Pair the ends that meet no other, the nearest first; narrow gaps are to be closed (with both their ends)."""
    tips = Counter(tip for line in lines for tip in (line.coords[0], line.coords[-1]))
    loose = np.array([tip for tip, count in tips.items() if count == 1]).reshape(-1, 2)
    rings = _Rings([], Polygon(), ends=len(loose))
    if len(loose) < 2:
        return rings
    reach = np.inf if len(loose) <= _MOST_ENDS else GAP
    tree = cKDTree(loose)
    pairs = tree.query_pairs(min(reach, 1e9), output_type="ndarray")
    widths = distances(loose[pairs[:, 0]], loose[pairs[:, 1]])
    paired: set[int] = set()
    for k in np.lexsort((pairs[:, 1], pairs[:, 0], widths)).tolist():
        ends = pairs[k].tolist()
        if paired.intersection(ends):
            continue
        paired.update(ends)
        width = float(widths[k])
        if width <= GAP:
            rings.closed.append((width, loose[ends]))
            rings.ends -= 2
        else:
            rings.gaps.append((width, loose[ends].mean(axis=0)))
    return rings
