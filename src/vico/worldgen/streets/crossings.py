"""Where walkers cross carriageways: crossings that are drawn as ways, and those that are points."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import shapely
from shapely import LineString
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay
from vico.geo.osm import OsmData, OsmWay
from vico.geo.quantities import quantity
from vico.geometry import distances
from vico.worldgen.facts.fault_isolation import drop_on_failure
from vico.worldgen.facts.street_habits import street_habits
from vico.worldgen.facts.streets import Crossing, Street

_CROSSING_WIDTH = 3.6


def crossings_of(
    osm: OsmData, carriageway: BaseGeometry, streets: list[Street], marked: list[OsmWay]
) -> list[Crossing]:
    """Crossings drawn as ways, cut at the kerbs; then those that are points only, square to their street."""
    kinds = {node.id: node.tags for node in osm.nodes if node.tags.get("highway") == "crossing"}
    found: list[Crossing] = []
    with_signals = street_habits(osm).markings.signal_crossing
    shapely.prepare(carriageway)
    for way in marked:
        node_tags = next((kinds[n] for n in way.nodes if n in kinds), {})
        look = _marking({**node_tags, **way.tags}, "unmarked", with_signals)
        width = min(max(quantity(way.tags, "width") or _CROSSING_WIDTH, 2.0), 8.0)
        with drop_on_failure(f"w{way.id}"):
            for piece in shapely.get_parts(overlay.intersection(LineString(way.line), carriageway)):
                if isinstance(piece, LineString) and 2.0 < piece.length < 40.0:
                    (ax, ay), (bx, by) = piece.coords[0], piece.coords[-1]
                    found.append(Crossing((ax, ay), (bx, by), width, *look, id=f"w{way.id}"))
    middles = np.array([((c.start[0] + c.end[0]) / 2, (c.start[1] + c.end[1]) / 2) for c in found]).reshape(-1, 2)
    by_node: dict[int, Street] = {}
    lines = {street.way: street for street in streets}
    for way in osm.ways:
        if way.id in lines:
            for ref in way.nodes:
                by_node.setdefault(ref, lines[way.id])
    for node in osm.nodes:
        if node.id not in kinds or node.id not in by_node:
            continue
        if len(middles) and distances(middles, node.xy).min() < 6.0:
            continue
        street = by_node[node.id]
        k = int(distances(street.line, node.xy).argmin())
        along = street.line[min(k + 1, len(street.line) - 1)] - street.line[max(k - 1, 0)]
        along = along / max(float(np.hypot(*along)), 1e-9)
        across = np.array([-along[1], along[0]]) * (street.width / 2)
        a, b = node.xy - across, node.xy + across
        look = _marking(kinds[node.id], "zebra", with_signals)
        start, end = (float(a[0]), float(a[1])), (float(b[0]), float(b[1]))
        found.append(Crossing(start, end, _CROSSING_WIDTH, *look, id=f"n{node.id}"))
    return found


_MARKINGS = {
    **dict.fromkeys(("lines", "lines:paired", "lines:rainbow"), "lines"),
    **dict.fromkeys(("dashes", "dashes:paired"), "dashes"),
    **dict.fromkeys(("dots", "dots:paired", "pictograms"), "dots"),
    **dict.fromkeys(("ladder", "ladder:skewed", "ladder:paired"), "ladder"),
}


def _marking(tags: Mapping[str, str], usual: str, with_signals: str) -> tuple[bool, str, bool]:
    """Whether a crossing is painted, how (`with_signals` if it has some and the map is silent), and whether it has."""
    said, kind = tags.get("crossing:markings"), tags.get("crossing", usual)
    signals = kind == "traffic_signals" or tags.get("crossing:signals", "no") != "no"
    painted = said != "no" if said is not None else kind not in ("unmarked", "no", "informal")
    silent = said in (None, "yes") and tags.get("crossing_ref") != "zebra"
    return painted, with_signals if signals and silent else _MARKINGS.get(said or "", "zebra"), signals
