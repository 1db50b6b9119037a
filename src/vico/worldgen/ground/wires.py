"""Contact wires over tram tracks, hung between the houses at both sides of a street."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay
from vico.geometry import distance, distances
from vico.world.heights import HeightField
from vico.world.mesh import Material, Surface, quad_triangles
from vico.world.model import ENTITY_WIRE
from vico.worldgen.facts.fault_isolation import drop_on_failure
from vico.worldgen.facts.site import SiteFacts, on_the_ground

CONTACT = 5.5
"""Metres above the rail: 4.2 to 6 over streets (EN 50119)."""

_ANCHOR = 7.0  # metres above the street where a span wire meets a wall
_SPAN_EVERY = 28.0  # metres along a track from span to span
_APART = 14.0  # metres from a span to that of the next track
_REACH = 19.0  # metres from a track within which a wall holds a span
_STEP = 14.0  # metres, longest piece of wire
_THICK = 0.035  # wider than it is: 12 mm would be between two pixels
_WITHOUT = ("no", "rail", "ground-level_power_supply", "4th_rail")
_COLOUR = (46, 48, 50)


def contact_wires(
    site: SiteFacts, terrain: HeightField, standing: Sequence[BaseGeometry], reach: float
) -> list[Surface]:
    """Hang wires over the tram tracks of a map, and span wires where walls stand at both sides.

    Parameters
    ----------
    site
        The map and its facts.
    terrain
        Graded ground.
    standing
        Footprints of buildings.
    reach
        Half side of the square to fill, metres.

    Returns
    -------
    list of Surface
        One, of the entity `ENTITY_WIRE`; none without trams.
    """
    window = shapely.box(-reach, -reach, reach, reach)
    walls = shapely.STRtree(np.array(list(standing), object))
    wires: list[NDArray[np.float64]] = []
    spans: list[NDArray[np.float64]] = []
    for way in site.osm.ways:
        tags = way.tags
        if tags.get("railway") != "tram" or tags.get("electrified") in _WITHOUT or not on_the_ground(tags):
            continue
        if tags.get("bridge", "no") != "no" or way.id in site.levels.above:
            continue
        with drop_on_failure(f"w{way.id}"):
            # Of the whole way, so that wires go on where the next tile of a city begins.
            track = overlay.simplify(shapely.LineString(way.line), 0.1)
            for piece in shapely.get_parts(overlay.intersection(track, window)):
                if piece.geom_type == "LineString" and piece.length > 2.0:
                    xy = np.asarray(shapely.segmentize(piece, _STEP).coords)
                    wires.append(np.c_[xy, terrain.lower(xy) + CONTACT])
                    # Wires across the street hold the contact wire of a track; shape ``(3, 3)`` each.
                    middles = np.array([span[1, :2] for span in spans]).reshape(-1, 2)
                    found: list[NDArray[np.float64]] = []
                    for place in np.arange(_SPAN_EVERY / 2, piece.length, _SPAN_EVERY):
                        a, b = (np.asarray(piece.interpolate(v).coords[0]) for v in (place - 0.5, place + 0.5))
                        here = (a + b) / 2
                        if len(middles) and distances(middles, here).min() < _APART:
                            continue
                        along = (b - a) / max(distance(b, a), 1e-9)
                        across = np.array([-along[1], along[0]])
                        left, right = (_wall(here, side * across, walls) for side in (1.0, -1.0))
                        if left is None or right is None:
                            continue
                        ground = float(terrain.lower(here[None])[0])
                        anchors = np.r_[left, ground + _ANCHOR], np.r_[right, ground + _ANCHOR]
                        found.append(np.array([anchors[0], np.r_[here, ground + CONTACT + 0.15], anchors[1]]))
                    spans += found
    lines = wires + spans
    return [_tubes(lines).of_entity(ENTITY_WIRE)] if lines else []


def _wall(here: NDArray[np.float64], out: NDArray[np.float64], walls: shapely.STRtree) -> NDArray[np.float64] | None:
    """Return where a ray first meets a wall."""
    ray = shapely.LineString([here, here + out * _REACH])
    point = shapely.Point(here)
    hit = walls.geometries[walls.query(ray, predicate="intersects")]
    away = [float(shapely.distance(point, overlay.intersection(shape, ray))) for shape in hit]
    return here + out * min(away) if away and min(away) > 1.5 else None


def _tubes(lines: Sequence[NDArray[np.float64]]) -> Surface:
    """Make thin upright and level strips along polylines, seen from all sides."""
    a = np.concatenate([line[:-1] for line in lines])
    b = np.concatenate([line[1:] for line in lines])
    along = (b - a) / np.maximum(np.linalg.norm(b - a, axis=1, keepdims=True), 1e-9)
    level = np.cross(along, np.array([0.0, 0.0, 1.0]))
    level /= np.maximum(np.linalg.norm(level, axis=1, keepdims=True), 1e-9)
    upright = np.cross(level, along)
    corners = [np.stack([a - s, b - s, b + s, a + s], axis=1) for s in (level * _THICK / 2, upright * _THICK / 2)]
    quads = np.concatenate(corners)
    return Surface.from_triangles(
        quads.reshape(-1, 3),
        quad_triangles(4 * np.arange(len(quads))),
        colour=_COLOUR,
        material=Material("wire", double_sided=True),
    )
