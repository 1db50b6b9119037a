"""Flights of stairs outdoors, with treads, risers and strings, where the ground rises along them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay
from vico.geo.quantities import quantity
from vico.world.heights import HeightField, Stairs
from vico.world.mesh import Surface, surface_of_quads
from vico.worldgen.facts.fault_isolation import NamedShape, drop_on_failure, union_named
from vico.worldgen.facts.site import SiteFacts, on_the_ground
from vico.worldgen.ground.pavings import LOOKS, ground_material, vertex_colours

Floats = NDArray[np.float64]
Face = tuple[Floats, Floats, float]
"""Corners of a face, its normal, and how far it is from riser to riser on its flight."""

RISE = 0.16
"""Metres a step is high."""

_LEAST = 0.35  # metres of rise below which painted edges do
_STRING = 0.45  # depth of the sides
_WIDTH = 2.4


@dataclass(frozen=True)
class Flights:
    """Boxes that steps are made of.

    Attributes
    ----------
    area
        Where they lie.
    quads
        Corners of their faces, metres, shape ``(n, 4, 3)``, counter-clockwise from outside; `normals` ``(n, 3)``.
    going
        How far it is on average from riser to riser on the flight that each face is of, metres, shape ``(n,)``.
    """

    area: BaseGeometry
    quads: Floats
    normals: Floats
    going: Floats

    def treads(self) -> Stairs | None:
        """Return what feet stand on; None where there are no stairs."""
        level = self.normals[:, 2] > 0.5
        if not level.any():
            return None
        quads = self.quads[level]
        return Stairs(np.ascontiguousarray(quads[..., :2]), quads[:, 0, 2].copy(), self.going[level])

    def surfaces(self) -> list[Surface]:
        """Return the faces with their texture."""
        if not len(self.quads):
            return []
        look = LOOKS["steps"]
        plan, up = self.quads[..., :2], self.quads[..., 2]
        upright = np.abs(self.normals[:, 2]) < 0.5
        uv = np.where(upright[:, None, None], np.stack([plan[..., 0] + plan[..., 1], up], axis=2), plan)
        shade = np.repeat(np.where(upright, 0.86, 1.0), 4)[:, None]
        return [
            surface_of_quads(
                self.quads,
                self.normals,
                uv / look.tile,
                colour=np.clip(vertex_colours(look, plan.reshape(-1, 2)) * shade, 0, 255).astype(np.uint8),
                entity=look.entity,
                material=ground_material(look.material),
                by_halves=True,
            )
        ]


def flights_of(site: SiteFacts, terrain: HeightField, where: BaseGeometry) -> Flights:
    """Build the stairs of a map.

    Parameters
    ----------
    site
        The map: ways with ``highway=steps``.
    terrain
        The graded ground, which rises along them.
    where
        The ground that is drawn as stairs; flights elsewhere (in buildings) are left out.

    Returns
    -------
    Flights
        Treads lie within half a step of the ground.
    """
    above = site.levels.above
    shapely.prepare(where)
    faces: list[Face] = []
    areas: list[NamedShape] = []
    for way in site.osm.ways:
        tags = way.tags
        if tags.get("highway") != "steps" or not on_the_ground(tags) or way.id in above or way.closed:
            continue
        with drop_on_failure(f"w{way.id}"):
            width = min(max(quantity(way.tags, "width") or _WIDTH, 1.2), 12.0)
            flights: list[tuple[BaseGeometry, list[Face]]] = []
            for piece in shapely.get_parts(overlay.intersection(shapely.LineString(way.line), where)):
                if piece.geom_type != "LineString" or piece.length < 0.8:
                    continue
                if np.abs(piece.bounds).max() > terrain.half - 1.0:
                    continue
                run = _rising(np.asarray(piece.coords), terrain)
                steps = list(_flight(*run, width)) if run is not None else []
                if steps and run is not None:
                    flights.append((overlay.buffer(shapely.LineString(run[0]), width / 2, cap_style="flat"), steps))
            for area, own in flights:
                areas.append(NamedShape(f"w{way.id}", area))
                faces += own
    return Flights(
        union_named(areas) if areas else shapely.MultiPolygon(),
        np.array([quad for quad, _, _ in faces]).reshape(-1, 4, 3),
        np.array([normal for _, normal, _ in faces]).reshape(-1, 3),
        np.array([going for *_, going in faces], np.float64),
    )


def _rising(line: Floats, terrain: HeightField) -> tuple[Floats, Floats] | None:
    """Find the stretch of a line that rises all along, as points every decimetre, upwards, and their heights."""
    path = shapely.LineString(line)
    places = np.linspace(0.0, path.length, max(int(path.length / 0.1), 4) + 1)
    points = shapely.get_coordinates(shapely.line_interpolate_point(path, places))
    z = terrain.upper(points)
    if z[-1] < z[0]:
        points, z = points[::-1], z[::-1]
    first, last = int(z.argmin()), int(z.argmax())
    if last - first < 4 or z[last] - z[first] < _LEAST:
        return None
    points, z = points[first : last + 1], z[first : last + 1]
    even = np.maximum.accumulate(z)
    # Stairs over a hollow would float.
    return None if float((even - z).max()) > 0.1 else (points, even)


def _flight(points: Floats, z: Floats, width: float) -> Iterable[Face]:
    """Faces of the steps along a rising line: tread, riser, and the two sides."""
    # On ground steeper than stairs can be, steps are as high as their going lets them be.
    run = float(np.hypot(*np.diff(points, axis=0).T).sum())
    count = int(min(max(round((z[-1] - z[0]) / RISE), 1), max(run / 0.22, 1)))
    # All as deep, so that one climbs them in stride; where the ground is less steep, risers are lower.
    edge = np.linspace(0.0, len(points) - 1.0, count + 1)
    levels = np.interp(0.5 * (edge[:-1] + edge[1:]), np.arange(len(points)), z)
    along = np.gradient(points, axis=0)
    along /= np.maximum(np.hypot(*along.T)[:, None], 1e-9)
    points, along = (
        np.column_stack([np.interp(edge, np.arange(len(line)), line[:, axis]) for axis in (0, 1)])
        for line in (points, along)
    )
    left = np.stack([-along[:, 1], along[:, 0]], axis=1) * width / 2
    up = np.array([0.0, 0.0, 1.0])
    for a, top in enumerate(levels.tolist()):
        b, below = a + 1, levels[a - 1] if a else z[0] - 0.1
        r0, r1 = np.r_[points[a] - left[a], top], np.r_[points[b] - left[b], top]
        l0, l1 = np.r_[points[a] + left[a], top], np.r_[points[b] + left[b], top]
        yield np.stack([r0, r1, l1, l0]), up, run / count
        down = up * (top - below)
        yield np.stack([l0 - down, r0 - down, r0, l0]), np.r_[-along[a], 0.0], run / count
        deep = up * _STRING
        side = np.r_[left[a], 0.0] / (width / 2)
        yield np.stack([r0 - deep, r1 - deep, r1, r0]), -side, run / count
        yield np.stack([l1 - deep, l0 - deep, l0, l1]), side, run / count
