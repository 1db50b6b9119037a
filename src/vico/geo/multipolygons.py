"""Areas of multipolygon relations: rings out of member ways, and what is wrong with those that give none.

Follows the OSM wiki's rules for multipolygons: ways that meet at their ends make rings, in any order and direction;
outer rings are filled, inner ones are holes. What mappers get wrong is mended where the meaning is plain, and told.
"""

from __future__ import annotations

import difflib
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from shapely import LineString, MultiPolygon, Polygon

from vico.geo import overlay
from vico.geo.frame import LocalFrame
from vico.geo.outlines import is_scribble, mended
from vico.geo.overlay import OverlayError, polygons_of

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
        outside, holes = _filled(outer), _filled(inner)
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
    """Say why members make no area."""
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
    holes = _holes([Polygon(ring) for ring in closed], _filled(outer).shape)
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


def _filled(lines: Iterable[NDArray[np.float64]]) -> _Rings:
    """Assemble rings from lines, in any order and direction."""
    pieces = [LineString(line) for line in lines if len(line) > 1]
    if not pieces:
        return _Rings([], Polygon())
    merged = shapely.line_merge(shapely.MultiLineString(pieces))
    parts = shapely.get_parts(merged)
    rings = [part for part in parts if part.is_ring]
    if len(rings) == len(parts):
        areas = [mended(Polygon(ring))[0] for ring in rings]
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
    widths = np.hypot(*(loose[pairs[:, 0]] - loose[pairs[:, 1]]).T)
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
