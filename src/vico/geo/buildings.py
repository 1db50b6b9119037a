"""Buildings that others than OpenStreetMap know: what a source tells of one, whatever its format.

City models draw a building with surfaces, in pieces: a building and parts of it. Its measured roof has a form in few
words: eaves, ridge, and the nearest of the shapes that have a name. `vico.geo.building_files` reads the files.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import mapbox_earcut
import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay
from vico.geo.outlines import repair_outline, union_closing_gaps
from vico.geo.overlay import OverlayError

#: Kinds of sources, and what each is called where the two of city models are meant.
KINDS = ("cityjson", "citygml", "overture")
CITY_MODELS = ("cityjson", "citygml")


@dataclass(frozen=True)
class RoofFacet:
    """A plane piece of a roof.

    Attributes
    ----------
    polygon
        Its outline seen from above, ENU metres.
    plane
        Height ``c + gx * x + gy * y`` at a point of it: metres above a level that the holder tells.
    """

    polygon: Polygon
    plane: tuple[float, float, float]

    def height(self, xy: NDArray[np.float64]) -> NDArray[np.float64]:
        """Height of the plane at points, shape ``(n, 2)``."""
        c, gx, gy = self.plane
        return np.asarray(c + xy[:, 0] * gx + xy[:, 1] * gy, np.float64)

    @property
    def steepness(self) -> float:
        """Rise per metre along the fall."""
        return float(np.hypot(*self.plane[1:]))

    def moved(self, *, east: float = 0.0, north: float = 0.0, up: float = 0.0) -> RoofFacet:
        """Return it somewhere else, metres."""
        c, gx, gy = self.plane
        shifted = shapely.transform(self.polygon, lambda xy: xy + np.array([east, north]))
        return RoofFacet(shifted, (c + up - gx * east - gy * north, gx, gy))


@dataclass(frozen=True)
class FoundBuilding:
    """A building of a source.

    Attributes
    ----------
    id
        Kind and the source's own id, such as ``citygml:DEBE_1``.
    kind
        One of `KINDS`.
    file
        Name of the file it was read from.
    footprint
        ENU metres.
    tags
        What is said of it, in OpenStreetMap's words: ``height`` (ground to the highest point, metres),
        ``building:levels``, ``roof:shape``, ``roof:height``, ``building``, ``name``, ...
    facets
        The surfaces of its roof, heights above its own ground; empty where the source has none that can be built.
    fault
        Why its roof can't be built as the source has it, if it has one at all.
    parts
        Parts of it, each with an outline and tags of its own.
    """

    id: str
    kind: str
    file: str
    footprint: Polygon | MultiPolygon
    tags: dict[str, str]
    facets: tuple[RoofFacet, ...] = ()
    fault: str = ""
    parts: tuple[tuple[Polygon | MultiPolygon, dict[str, str]], ...] = ()

    @property
    def source(self) -> str:
        """Kind and file, as the records of buildings name it."""
        return f"{self.kind}:{self.file}"


@dataclass(frozen=True)
class FoundBuildings:
    """Buildings of a file in a window.

    Attributes
    ----------
    kind, file, sha256
        Of the file.
    buildings
        Sorted by id.
    refused
        Id and reason of each that can't be used.
    attributions
        Whom to credit, as far as the file says.
    licence
        As far as the file or its kind says.
    """

    kind: str
    file: str
    sha256: str
    buildings: tuple[FoundBuilding, ...]
    refused: tuple[tuple[str, str], ...] = ()
    attributions: tuple[str, ...] = ()
    licence: str = "as its provider states"


_LEVEL = 0.05  # rise per metre of what drains, and counts as flat
_SMALL = 0.02  # share of the roof below which a piece does not decide its top


@dataclass(frozen=True)
class RoofForm:
    """A roof in few words.

    Attributes
    ----------
    shape
        flat, skillion, gabled, hipped, pyramidal; of what is none of them the nearest.
    eaves, top
        Metres above the level that the facets count from.
    """

    shape: str
    eaves: float
    top: float


def form_of(facets: Sequence[RoofFacet]) -> RoofForm:
    """Return the form of a roof.

    Parameters
    ----------
    facets
        Its surfaces; at least one.
    """
    areas = np.array([facet.polygon.area for facet in facets])
    heights = [facet.height(np.asarray(facet.polygon.exterior.coords)[:, :2]) for facet in facets]
    lows, highs = np.array([h.min() for h in heights]), np.array([h.max() for h in heights])
    steep = np.array([facet.steepness for facet in facets])
    total = float(areas.sum())
    top = float(highs[areas >= _SMALL * total].max(initial=float(lows.min())))
    eaves = min(_weighted_median(lows, areas), top)
    level = float(areas[steep < _LEVEL].sum()) / total
    if level > 0.8 or top - eaves < 0.4:
        return RoofForm("flat", min(_weighted_median((lows + highs) / 2, areas), top), top)
    return RoofForm(_shape(facets, areas, steep), eaves, top)


def _shape(facets: Sequence[RoofFacet], areas: NDArray[np.float64], steep: NDArray[np.float64]) -> str:
    """Return the shape by the directions in which the slopes fall."""
    falls = [math.atan2(-facet.plane[2], -facet.plane[1]) for facet in facets]
    directions: list[tuple[float, float]] = []  # yaw and area of slopes that fall alike
    for k in np.argsort(-areas, kind="stable").tolist():
        if steep[k] < _LEVEL:
            continue
        for n, (yaw, area) in enumerate(directions):
            if abs((falls[k] - yaw + math.pi) % (2 * math.pi) - math.pi) < 0.35:
                directions[n] = (yaw, area + float(areas[k]))
                break
        else:
            directions.append((falls[k], float(areas[k])))
    sloping = sum(area for _, area in directions)
    main = [yaw for yaw, area in directions if area > 0.08 * sloping]
    if len(main) == 1:
        return "skillion"
    if len(main) == 2:
        apart = abs((main[0] - main[1] + math.pi) % (2 * math.pi) - math.pi)
        return "gabled" if apart > 2.6 else "hipped"
    return "hipped"


def _weighted_median(values: NDArray[np.float64], weights: NDArray[np.float64]) -> float:
    order = np.argsort(values, kind="stable")
    total = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(total, 0.5 * total[-1])])


_UPRIGHT = 0.08  # of a unit normal's height: what is steeper is a wall, whatever it is called
_FLAT_WITHIN = 0.25  # metres that the corners of a plane surface may lie off it
_ABOVE_GROUND = 1.5  # metres above the ground from which on an unnamed level surface is a roof
_SPECK = 0.02  # square metres
_CLOSING = 0.03  # metres of gap between surfaces that are one
_COVERED = 0.85  # share of the footprint that a roof must cover
_LEAST_AREA = 2.0  # square metres that a building covers
_LOWEST, _HIGHEST = 1.0, 900.0  # metres above its ground that the top of a roof may lie


@dataclass(frozen=True)
class Surface3:
    """A surface of a city model: `kind` (roof, wall, ground, or empty where unsaid); rings, ENU x, y and height."""

    kind: str
    rings: tuple[NDArray[np.float64], ...]


def building_of_surfaces(
    surfaces: Sequence[Surface3], *, key: str, kind: str, file: str, facts: Mapping[str, str]
) -> FoundBuilding | str:
    """Return the building that surfaces enclose; or in a phrase why there is none.

    Parameters
    ----------
    surfaces
        All of one building, at one level of detail.
    key, kind, file
        Its id without the kind, and where it comes from.
    facts
        What its attributes say, in OpenStreetMap's words; a roof's height and shape are told from the surfaces.
    """
    if not surfaces:
        return "has no surfaces at a level of detail of 1 to 3"
    points = np.concatenate([surface.rings[0] for surface in surfaces])
    if not np.isfinite(points).all():
        return "has points that lie nowhere on Earth"
    floors = [surface for surface in surfaces if surface.kind == "ground"]
    low = np.concatenate([s.rings[0] for s in floors]) if floors else points
    ground = float(low[:, 2].min())
    named = any(surface.kind == "roof" for surface in surfaces)
    facets: list[RoofFacet] = []
    for surface in surfaces:
        if surface.kind == "roof" or (not named and surface.kind == ""):
            facets += _facets(surface, ground, floor=0.0 if named else _ABOVE_GROUND)
    # It covers its ground surfaces seen from above, or else its roof's.
    shapes = [shape for floor in floors if (shape := _outline(floor.rings)) is not None]
    shapes = shapes or [facet.polygon for facet in facets]
    footprint = union_closing_gaps(shapes, gap=_CLOSING, least=_LEAST_AREA) if shapes else Polygon()
    if footprint.area < _LEAST_AREA:
        return f"covers {footprint.area:.1f} m2 of ground"
    tags = dict(facts)
    fault = _fault(facets, footprint)
    if facets and not fault:
        form = form_of(facets)
        tags["height"] = f"{form.top:.2f}"
        tags["roof:shape"] = form.shape
        if form.shape != "flat":
            tags["roof:height"] = f"{form.top - form.eaves:.2f}"
    elif "height" not in tags and (top := float(points[:, 2].max()) - ground) > _LOWEST:
        tags["height"] = f"{top:.2f}"
    return FoundBuilding(
        f"{kind}:{key}", kind, file, footprint, tags, () if fault else tuple(facets), fault if facets else ""
    )


def _fault(facets: Sequence[RoofFacet], footprint: BaseGeometry) -> str:
    """Return why a roof can't be built of these surfaces; empty if it can."""
    if not facets:
        return "no roof surfaces"
    tops = np.concatenate([facet.height(np.asarray(facet.polygon.exterior.coords)[:, :2]) for facet in facets])
    if not (tops.min() > 0.0 and _LOWEST < tops.max() < _HIGHEST):
        return f"roof surfaces lie {tops.min():.1f} to {tops.max():.1f} m above its ground"
    roof = overlay.union_all([facet.polygon for facet in facets])
    covered = overlay.common_area(roof, footprint) / footprint.area
    if covered < _COVERED:
        return f"roof surfaces cover {100 * covered:.0f} % of its footprint"
    return ""


def _outline(rings: Sequence[NDArray[np.float64]]) -> Polygon | MultiPolygon | None:
    """Return the outline of a surface seen from above; None where it has no extent."""
    outer, *inner = [ring[:, :2] for ring in rings if len(ring) >= 3] or [np.zeros((0, 2))]
    if len(outer) < 3:
        return None
    shape = repair_outline(Polygon(outer, inner))[0]
    return shape if shape.area > _SPECK else None


def _facets(surface: Surface3, ground: float, *, floor: float) -> list[RoofFacet]:
    """Return the plane pieces of a roof surface, heights above the ground; none where it is upright."""
    made: list[RoofFacet] = []
    for rings in _plane_pieces(surface.rings):
        plane = _plane(rings[0])
        if plane is None:
            continue
        shape = _outline(rings)
        if shape is None or float(rings[0][:, 2].mean()) - ground < floor:
            continue
        c, gx, gy = plane
        made += [RoofFacet(piece, (c - ground, gx, gy)) for piece in overlay.polygons_of(shape, _SPECK)]
    return made


def _plane_pieces(rings: Sequence[NDArray[np.float64]]) -> list[tuple[NDArray[np.float64], ...]]:
    """Return a surface as it is if it is plane, else its triangles."""
    ring = rings[0]
    plane = _plane(ring)
    if len(ring) <= 3 or plane is None:
        return [tuple(rings)]
    c, gx, gy = plane
    off = np.abs(ring[:, 2] - (c + gx * ring[:, 0] + gy * ring[:, 1]))
    if off.max() <= _FLAT_WITHIN:
        return [tuple(rings)]
    corners = np.concatenate(rings)
    ends = np.cumsum([len(part) for part in rings]).astype(np.uint32)
    flat = np.ascontiguousarray(corners[:, :2] - corners[0, :2])
    triangles = mapbox_earcut.triangulate_float64(flat, ends).reshape(-1, 3).astype(int)
    return [(corners[triangle],) for triangle in triangles]


def _plane(ring: NDArray[np.float64]) -> tuple[float, float, float] | None:
    """Return the plane through a ring (Newell's normal through its middle); None where it is upright or a line."""
    if len(ring) < 3:
        return None
    middle = ring.mean(axis=0)
    near = ring - middle
    after = np.roll(near, -1, axis=0)
    normal = np.cross(near, after).sum(axis=0)
    size = float(np.linalg.norm(normal))
    if size < 1e-6 or abs(normal[2]) < _UPRIGHT * size:
        return None
    gx, gy = -normal[0] / normal[2], -normal[1] / normal[2]
    return float(middle[2] - gx * middle[0] - gy * middle[1]), float(gx), float(gy)


_MARGIN = 20.0  # metres beyond the window within which buildings are kept: their middle may still lie in it
_MOST = 200_000


@dataclass
class Piece:
    """A building or a part of one.

    Attributes
    ----------
    id, parent
        Its own, and of what it is a part; empty for a whole building.
    tags
        What its attributes say, in OpenStreetMap's words.
    by_detail
        Its surfaces, by level of detail.
    """

    id: str
    parent: str
    tags: dict[str, str]
    by_detail: dict[float, list[Surface3]] = field(default_factory=dict)


class BuildingPieces:
    """Gathers the pieces in a window.

    Parameters
    ----------
    kind, file
        Of the source.
    half
        Half side of the window, metres.
    """

    def __init__(self, kind: str, file: str, half: float) -> None:
        self._kind, self._file = kind, file
        self._reach = half + _MARGIN
        self._pieces: dict[str, Piece] = {}
        self._tags: dict[str, dict[str, str]] = {}  # of buildings whose geometry is with their parts

    def add(self, piece: Piece) -> None:
        """Take a piece in, if anything of it lies in the window; of one without geometry only what it says."""
        if not any(piece.by_detail.values()):
            if piece.tags:
                self._tags[piece.id] = piece.tags
            return
        points = np.concatenate([s.rings[0] for row in piece.by_detail.values() for s in row])[:, :2]
        if not np.isfinite(points).all():
            return
        low, high = points.min(axis=0), points.max(axis=0)
        if (low < self._reach).all() and (high > -self._reach).all():
            self._pieces[piece.id] = piece
        if len(self._pieces) > _MOST:
            raise ValueError(f"more than {_MOST:,} buildings in the window, as in no real place")

    def buildings(self) -> tuple[tuple[FoundBuilding, ...], tuple[tuple[str, str], ...]]:
        """Return the buildings, sorted by id, and the id and reason of each that can't be used."""
        groups: dict[str, list[Piece]] = {}
        for piece in self._pieces.values():
            groups.setdefault(self._root(piece), []).append(piece)
        made: list[FoundBuilding] = []
        refused: list[tuple[str, str]] = []
        for root in sorted(groups):
            key = f"{self._kind}:{root}"
            try:
                found = self._building(root, groups[root])
            except OverlayError as error:
                found = f"its surfaces can't be put together ({error})"
            if isinstance(found, str):
                refused.append((key, found))
                continue
            if found.fault:
                refused.append((key, f"its roof is fitted instead of built: {found.fault}"))
            made.append(found)
        return tuple(made), tuple(refused)

    def _root(self, piece: Piece) -> str:
        seen = {piece.id}
        while piece.parent and piece.parent in self._pieces and piece.parent not in seen:
            piece = self._pieces[piece.parent]
            seen.add(piece.id)
        return piece.parent or piece.id

    def _building(self, root: str, pieces: list[Piece]) -> FoundBuilding | str:
        pieces = sorted(pieces, key=lambda piece: piece.id)
        tags: dict[str, str] = {}
        for piece in pieces:
            tags = {**piece.tags, **tags}
        tags = {**tags, **self._tags.get(root, {})}
        if root in self._pieces:
            tags |= self._pieces[root].tags
        details = {detail for piece in pieces for detail, row in piece.by_detail.items() if row}
        best = max(details, key=_worth)
        surfaces = [surface for piece in pieces for surface in piece.by_detail.get(best, ())]
        if best < 2.0:
            # Blocks and outlines say how high and how wide, not which roof.
            surfaces = [Surface3("wall" if best >= 1.0 else "ground", s.rings) for s in surfaces]
            if best >= 1.0:
                # The lowest level surfaces of a block are its ground.
                lowest = min(float(s.rings[0][:, 2].min()) for s in surfaces)
                surfaces = [
                    Surface3("ground" if float(s.rings[0][:, 2].max()) < lowest + 0.05 else s.kind, s.rings)
                    for s in surfaces
                ]
        return building_of_surfaces(surfaces, key=root, kind=self._kind, file=self._file, facts=tags)


def _worth(detail: float) -> float:
    """Return how good a level of detail is: 2 with its refinements, then 3, then blocks, then outlines."""
    return {2: 30.0, 3: 20.0, 1: 10.0}.get(int(detail), 0.0) + detail
