"""Street lamps where nobody mapped them: along the streets of a town, but where the map says that none are lit."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay
from vico.geo.osm import OsmData, OsmWay
from vico.geometry import distance, distances
from vico.worldgen.facts.expendable import expendable
from vico.worldgen.facts.streets import carriageway_width
from vico.worldgen.objects.wishes import Wish

#: Metres from one lamp to the next along a street, and to the nearest lamp that is mapped.
SPACING = 28.0
_APART = 20.0
# Metres between the kerb and a lamp, and how far from a street's middle a kerb is looked for.
_BESIDE_KERB, _WIDEST = 0.6, 16.0
# Where nothing says whether a street is lit, it is where houses stand this near, metres.
_TOWN = 45.0
_REACH = 2.4
_ROADS = ("primary", "secondary", "tertiary", "unclassified", "residential", "living_street", "road")
_ON_FOOT = ("pedestrian",)
# Those for people on foot are lit only where the map says so.
_PATHS = ("footway", "path", "cycleway", "steps", "service")
_LIT = ("yes", "24/7", "automatic", "limited", "sunset-sunrise", "dusk-dawn", "interval")
_DARK = ("no", "disused")


def lamp_wishes(
    osm: OsmData,
    carriageway: BaseGeometry,
    solids: Sequence[BaseGeometry],
    known: NDArray[np.float64],
    *,
    lamp: str | None = None,
) -> list[Wish]:
    """Wish for lamps along lit streets, on alternate sides, where none stand yet.

    Parameters
    ----------
    carriageway
        Where vehicles drive.
    solids
        Footprints of buildings: where the map is silent, streets beside them are lit.
    known
        Where lamps are mapped, metres, shape ``(n, 2)``.
    lamp
        Model of those along streets; ``street_lamp`` without.
    """
    shapely.prepare(carriageway)
    houses, taken = shapely.STRtree(list(solids)), [known.reshape(-1, 2)]
    found: list[Wish] = []
    for way in osm.ways:
        if not _may_be_lit(way):
            continue
        with expendable(f"w{way.id}"):
            for k, (xy, out) in enumerate(_steps(way)):
                near = _distance(np.concatenate(taken), xy)
                if near < _APART or not (_is_lit(way) or _in_town(xy, houses)):
                    continue
                spot = _spot(xy, out if k % 2 else -out, way, carriageway)
                if spot is None or _distance(np.concatenate(taken), spot) < _APART:
                    continue
                taken.append(spot[None])
                name = lamp or "street_lamp" if way.tags["highway"] in _ROADS else "park_lamp"
                found.append(Wish(f"w{way.id}.lamp{k}", name, spot, reach=_REACH))
    return found


def _may_be_lit(way: OsmWay) -> bool:
    tags = way.tags
    kind = tags.get("highway", "").removesuffix("_link")
    if tags.get("lit") in _DARK or tags.get("tunnel", "no") != "no" or tags.get("bridge", "no") != "no":
        return False
    if tags.get("layer", "0") != "0" or tags.get("indoor", "no") != "no":
        return False
    return kind in _ROADS + _ON_FOOT or (kind in _PATHS and _is_lit(way) and tags.get("footway") is None)


def _is_lit(way: OsmWay) -> bool:
    return way.tags.get("lit") in _LIT


def _in_town(xy: NDArray[np.float64], houses: shapely.STRtree) -> bool:
    return bool(len(houses.query(shapely.Point(xy), predicate="dwithin", distance=_TOWN)))


def _distance(points: NDArray[np.float64], xy: NDArray[np.float64]) -> float:
    return float(distances(points, xy).min(initial=math.inf))


def _steps(way: OsmWay) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Return points along the middle of a way, evenly, and unit vectors to the left there; the ends are junctions."""
    line = shapely.LineString(way.line)
    count = round(line.length / SPACING)
    if count < 1:
        return []
    found = []
    for share in (np.arange(count) + 0.5) / count:
        a, b = (np.array(line.interpolate(share * line.length + d).coords[0]) for d in (-0.5, 0.5))
        along = (b - a) / max(distance(b, a), 1e-9)
        found.append(((a + b) / 2.0, np.array([-along[1], along[0]])))
    return found


def _spot(
    xy: NDArray[np.float64], out: NDArray[np.float64], way: OsmWay, carriageway: BaseGeometry
) -> NDArray[np.float64] | None:
    """Return where a lamp stands on one side of a way: beside the kerb, or beside the way where there is none."""
    if not shapely.intersects_xy(carriageway, *xy):
        width = carriageway_width(way.tags) if way.tags["highway"] in _ROADS else 3.0
        return xy + out * (width / 2 + _BESIDE_KERB)
    across = shapely.LineString([xy, xy + _WIDEST * out])
    drivable = overlay.intersection(across, carriageway)
    first = next(
        (part for part in shapely.get_parts(drivable) if shapely.distance(part, shapely.Point(xy)) < 0.1), None
    )
    if first is None or first.length > _WIDEST - 1.0:
        return None
    return xy + out * (first.length + _BESIDE_KERB)
