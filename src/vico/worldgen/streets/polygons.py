"""Where streets lie: carriageways, sidewalks, crossings and squares as polygons, from OpenStreetMap ways.

OpenStreetMap draws streets as lines. Their widths come from `width`, else from lanes, class and parking lanes. The
polygons are what the ground is painted by, what walkers may walk on, and where crossings lie, so that all agree.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay
from vico.geo.overlay import polygons_of
from vico.worldgen.facts.fault_isolation import NamedShape, overlay_named, union_named
from vico.worldgen.facts.site import SiteFacts
from vico.worldgen.facts.streets import StreetPolygons
from vico.worldgen.streets.crossings import crossings_of
from vico.worldgen.streets.strips import Strips, strips_of

_KERB_RADIUS = 2.0
#: Ground between paved surfaces that is narrower than this is paved, metres: lines that were drawn one by one leave it,
#: and it would end in knives' points.
_NARROW = 1.0
_LEAST_GAP, _LEAST_CORNER = 0.02, 0.05  # square metres
_BESIDE = 0.05  # metres from a strip within which an outline is its edge
#: How its outline is offset: right angles stay, what is more pointed is cut off.
_BLUNT = {"join_style": "mitre", "mitre_limit": 1.5}
_GRID = 0.001  # metres: overlays on a grid are robust where free ones fail on nearly coincident outlines


def road_polygons(site: SiteFacts, obstacles: Sequence[NamedShape] = ()) -> StreetPolygons:
    """Turn the streets of an OSM extract into polygons.

    Parameters
    ----------
    site
        The extract, local metres, and which of its ways pass above others.
    obstacles
        Footprints of buildings that stand on the ground, under their ids: no sidewalk or square runs under them, and
        carriageways only where a way leads through.

    Returns
    -------
    StreetPolygons
        Clipped to the extract's window and margin.
    """
    reach = site.osm.half + site.osm.margin
    window = shapely.box(-reach, -reach, reach, reach)
    solid = union_named(overlay_named(obstacles, overlay.make_valid), grid=_GRID) if len(obstacles) else MultiPolygon()
    strips = strips_of(site)
    driven = union_named(strips.drive, grid=_GRID)
    carriageway = _carriageway(driven, strips.through, solid, window)
    crossings = crossings_of(site.osm, carriageway, strips.streets, strips.crossings)
    left = _Unclaimed(overlay.union(carriageway, solid, grid=_GRID), window)
    steps = left.claim(strips.stairs)
    # A square that is mapped as an area wins over the sidewalks drawn across it.
    pedestrian = left.claim(strips.square)
    cycleway = left.claim(strips.cycle)
    sidewalk = left.claim(strips.walk)
    path = left.claim(strips.loose)
    parking = left.claim(strips.car_park)
    sidewalk = left.claim_gaps(sidewalk)
    return StreetPolygons(
        carriageway=_multi(carriageway),
        sidewalk=sidewalk,
        crossing=_multi(
            overlay.intersection(union_named([NamedShape(c.id, c.polygon) for c in crossings]), carriageway)
        ),
        pedestrian=pedestrian,
        path=path,
        cycleway=cycleway,
        steps=steps,
        parking=parking,
        streets=strips.streets,
        crossings=crossings,
        rails=strips.rails,
        sunken=_sunken(strips.kerbed, carriageway),
        paved={
            name: _multi(overlay.intersection(_multi(union_named(shapes, grid=_GRID)), window))
            for name, shapes in sorted(_with_corners(strips, driven, carriageway).items())
        },
    )


def _carriageway(driven: BaseGeometry, through: list[NamedShape], solid: BaseGeometry, window: Polygon) -> MultiPolygon:
    """Carriageways in one, without what lies under buildings except where a way leads `through`."""
    # Closing the outline rounds the inner corners of junctions the way kerbs do.
    carriageway = overlay.buffer(overlay.buffer(driven, _KERB_RADIUS, quad_segs=4), -_KERB_RADIUS, quad_segs=4)
    carriageway = overlay.on_grid(overlay.simplify(carriageway, 0.08), grid=_GRID)
    if not solid.is_empty:
        under = overlay.difference(solid, union_named(through, grid=_GRID), grid=_GRID)
        carriageway = overlay.difference(carriageway, under, grid=_GRID)
    return _multi(overlay.intersection(_multi(carriageway), window, grid=_GRID))


def _with_corners(strips: Strips, driven: BaseGeometry, carriageway: BaseGeometry) -> dict[str, list[NamedShape]]:
    """Return strips by paving; what of carriageways is of no street is paved as most of the streets around it are."""
    corners = polygons_of(overlay.difference(carriageway, driven, grid=_GRID), _LEAST_CORNER)
    if not strips.paved or not corners:
        return strips.paved
    said = {id(strip): name for name, shapes in strips.paved.items() for strip in shapes}
    pavings = ["", *sorted(strips.paved)]
    paving = np.array([pavings.index(said.get(id(strip), "")) for strip in strips.drive])
    # A point each half metre of outlines counts for each strip that it lies beside.
    points, owner = shapely.get_coordinates(shapely.segmentize(shapely.boundary(corners), 0.5), return_index=True)
    tree = shapely.STRtree([strip.shape for strip in strips.drive])
    at, beside = tree.query(shapely.points(points), predicate="dwithin", distance=_BESIDE)
    counts = np.zeros((len(corners), len(pavings)), np.int64)
    np.add.at(counts, (owner[at], paving[beside]), 1)
    found = {name: list(shapes) for name, shapes in strips.paved.items()}
    for corner, most in zip(corners, counts.argmax(axis=1).tolist(), strict=True):
        if most:
            found[pavings[most]].append(NamedShape("carriageway", corner))
    return found


class _Unclaimed:
    """Ground that no kind of surface has claimed yet."""

    def __init__(self, taken: BaseGeometry, window: Polygon) -> None:
        self._taken, self._window = taken, window

    def claim(self, shapes: list[NamedShape]) -> MultiPolygon:
        """Claim what is left of `shapes` beside what was claimed before."""
        shape = overlay.simplify(union_named(shapes, grid=_GRID), 0.08)
        shape = overlay.intersection(overlay.on_grid(shape, grid=_GRID), self._window, grid=_GRID)
        left = _multi(overlay.difference(_multi(shape), self._taken, grid=_GRID), 0.3)
        self._taken = overlay.union(self._taken, left, grid=_GRID)
        return left

    def claim_gaps(self, walk: MultiPolygon) -> MultiPolygon:
        """Claim what is narrow between all that was claimed and lies beside a walk; return the walk with it."""
        closed = overlay.buffer(overlay.buffer(self._taken, _NARROW / 2, **_BLUNT), -_NARROW / 2, **_BLUNT)
        inside = overlay.intersection(_multi(closed), self._window, grid=_GRID)
        gaps = np.array(polygons_of(overlay.difference(inside, self._taken, grid=_GRID), _LEAST_GAP), object)
        shapely.prepare(walk)
        beside = gaps[shapely.dwithin(walk, gaps, 2 * _GRID)] if len(gaps) else gaps
        if not len(beside):
            return walk
        self._taken = overlay.union_all([self._taken, *beside], grid=_GRID)
        return _multi(overlay.union_all([walk, *beside], grid=_GRID))


def _sunken(kerbed: list[NamedShape], carriageway: BaseGeometry) -> MultiPolygon:
    """Return the kerbed part of the carriageways, the rounded corners of their junctions with it."""
    if not kerbed:
        return MultiPolygon()
    shape = union_named(kerbed, grid=_GRID)
    shape = overlay.buffer(overlay.buffer(shape, 2 * _KERB_RADIUS, quad_segs=3), -2 * _KERB_RADIUS + 0.1, quad_segs=3)
    return _multi(overlay.intersection(_multi(overlay.on_grid(shape, grid=_GRID)), carriageway, grid=_GRID))


def _multi(shape: BaseGeometry, least: float = 0.05) -> MultiPolygon:
    return MultiPolygon(polygons_of(shape, least))
