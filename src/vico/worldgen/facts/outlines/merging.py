"""Buildings of other sources merged into the map: matched by their outlines, fact by fact, in the order of precedence.

The map's building keeps its id, its function, its address and whatever else it is tagged with; of other sources come
outline, height, roof and name where they go first. What the map lacks is added. What comes out is a map again, which
all stages read as before, and beside it the surfaces of measured roofs and where every fact is from.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from hashlib import sha256

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon

from vico.geo import overlay
from vico.geo.buildings import FoundBuilding, FoundBuildings, RoofFacet
from vico.geo.osm import OsmArea, OsmData, Tags
from vico.world.model import Dropped
from vico.worldgen.facts.expendable import expendable
from vico.worldgen.facts.outlines.facts_of_sources import Claim, Decided, decided
from vico.worldgen.facts.outlines.plans import BuildingOrigin
from vico.worldgen.facts.precedence import Precedence, rank_of

_LEAST = 0.02  # share of either outline below which two only touch
_PART_WITHIN = 0.5  # share of a part that lies in a building whose roof is measured


@dataclass(frozen=True)
class MergedBuildings:
    """The map with what other sources know of its buildings.

    Attributes
    ----------
    osm
        The map.
    facets
        Surfaces of measured roofs by building, heights above its ground.
    origins
        Where outline, height and roof of a building are from, by its id; of those that no other source touched none.
    dropped
        What sources have that is not used, with reasons.
    counts
        How much came of it.
    """

    osm: OsmData
    facets: dict[str, tuple[RoofFacet, ...]]
    origins: dict[str, BuildingOrigin]
    dropped: list[Dropped] = field(default_factory=list)
    counts: dict[str, int] = field(default_factory=dict)


def merged_buildings(osm: OsmData, sources: Sequence[FoundBuildings], precedence: Precedence) -> MergedBuildings:
    """Merge the buildings of sources into a map.

    Parameters
    ----------
    osm
        The map.
    sources
        What files have in the window.
    precedence
        Whose word counts.
    """
    dropped: list[Dropped] = []
    shapes = [area for area in osm.areas if area.tags.get("building", "no") != "no"]
    claims: dict[str, list[Claim]] = {}
    lonely: list[FoundBuilding] = []
    for source in sources:
        matched, alone = _matched(shapes, source, precedence, dropped)
        for name, claim in matched.items():
            claims.setdefault(name, []).append(claim)
        lonely += alone
    added, parts, origins, facets = _added(shapes, lonely, precedence, dropped)
    areas: list[OsmArea] = []
    results: dict[str, Decided] = {}
    for area in osm.areas:
        mine = claims.get(area.id)
        made = area
        if mine is not None:
            with expendable(area.id, dropped):
                result = decided(area, mine, precedence)
                results[area.id], made = result, result.area
        areas.append(made)
    origins |= {name: result.origin for name, result in results.items()}
    facets |= {name: result.facets for name, result in results.items() if result.facets}
    areas = _without_parts(areas, facets, dropped)
    counts = {
        "buildings_found": sum(len(source.buildings) for source in sources),
        "buildings_matched": len(results),
        "buildings_added": len(added),
        "measured_roofs": len(facets),
    }
    return MergedBuildings(replace(osm, areas=[*areas, *added, *parts]), facets, origins, dropped, counts)


def _matched(
    areas: Sequence[OsmArea], source: FoundBuildings, precedence: Precedence, dropped: list[Dropped]
) -> tuple[dict[str, Claim], list[FoundBuilding]]:
    """Match a file's buildings with the map's: what each of the map's is claimed to be, and those of nobody."""
    tree = shapely.STRtree([area.polygon for area in areas])
    pairs: dict[int, list[tuple[FoundBuilding, float, float]]] = {}
    lonely: list[FoundBuilding] = []
    for found in source.buildings:
        with expendable(found.id, dropped):
            near = sorted(tree.query(found.footprint, predicate="intersects").tolist())
            shared = [float(overlay.common_area(areas[k].polygon, found.footprint)) for k in near]
            own = found.footprint.area
            best = 0.0
            for k, common in zip(near, shared, strict=True):
                of_found, of_area = common / own, common / areas[k].polygon.area
                if max(of_found, of_area) >= _LEAST:
                    best = max(best, of_found, of_area)
                    pairs.setdefault(k, []).append((found, of_found, of_area))
            if sum(shared) / own <= precedence.free and best < precedence.same:
                lonely.append(found)
            elif best < precedence.same:
                by = 100 * max(c / own for c in shared)
                name = areas[near[int(np.argmax(shared))]].id
                reason = f"{name} covers {by:.0f} % of it: too much to be another building, too little to be the same"
                dropped.append(Dropped(id=found.id, reason=reason))
    claims: dict[str, Claim] = {}
    same_as = {k: [row for row in rows if max(row[1:]) >= precedence.same] for k, rows in pairs.items()}
    # A model over several of the map's houses tells their roof and height, but not where one ends.
    times = Counter(row[0].id for rows in same_as.values() for row in rows)
    for k, same in same_as.items():
        covered = sum(row[2] for row in same)
        if not same:
            continue
        area = areas[k]
        if covered < precedence.same and not any(row[1] < precedence.same for row in same):
            reason = f"covers only {100 * covered:.0f} % of {area.id}, which stays as the map has it"
            dropped += [Dropped(id=row[0].id, reason=reason) for row in same]
            continue
        whole = all(row[1] >= precedence.same and times[row[0].id] == 1 for row in same)
        claims[area.id] = Claim(tuple(row[0] for row in same), whole)
    return claims, lonely


def _added(
    areas: Sequence[OsmArea], lonely: Sequence[FoundBuilding], precedence: Precedence, dropped: list[Dropped]
) -> tuple[list[OsmArea], list[OsmArea], dict[str, BuildingOrigin], dict[str, tuple[RoofFacet, ...]]]:
    """Return buildings that the map lacks, parts of them, where they are from, and their measured roofs."""
    ranked = [
        (rank, k) for k, found in enumerate(lonely)
        if (rank := rank_of(found.kind, found.file, precedence.added)) is not None
    ]  # fmt: skip
    standing: list[Polygon | MultiPolygon] = []
    added: list[OsmArea] = []
    parts: list[OsmArea] = []
    origins: dict[str, BuildingOrigin] = {}
    facets: dict[str, tuple[RoofFacet, ...]] = {}
    for _, k in sorted(ranked):
        found = lonely[k]
        with expendable(found.id, dropped):
            taken = sum(
                float(overlay.common_area(other, found.footprint))
                for other in standing
                if other.intersects(found.footprint)
            )
            if taken > precedence.free * found.footprint.area:
                continue  # another source, which goes first, has it
            standing.append(found.footprint)
            name = _id_of(found.id)
            tags: Tags = {"building": "yes", **found.tags, "source": found.source, "source:id": found.id}
            added.append(OsmArea(name, found.footprint, tags))
            measured = found.facets if rank_of(found.kind, found.file, precedence.roof) is not None else ()
            if measured:
                facets[name] = measured
            roof = f"{found.source} surfaces" if measured else found.source if "roof:shape" in tags else ""
            said = "height" in tags or "building:levels" in tags
            origins[name] = BuildingOrigin(found.source, found.source if said else "", roof)
            for n, (shape, said_of_part) in enumerate(found.parts):
                own = {**said_of_part, "building:part": said_of_part.get("building", "yes")}
                own.pop("building", None)
                parts.append(OsmArea(_id_of(f"{found.id} part {n}"), shape, own))
    return added, parts, origins, facets


def _id_of(name: str) -> str:
    """Return an id like the map's: a letter and a number."""
    return f"x{int(sha256(name.encode()).hexdigest()[:12], 16)}"


def _without_parts(areas: Sequence[OsmArea], facets: Iterable[str], dropped: list[Dropped]) -> list[OsmArea]:
    """Leave out parts that the map draws of buildings whose roofs are measured: the model has its own."""
    measured = set(facets)
    outlines = [area.polygon for area in areas if area.id in measured]
    names = [area.id for area in areas if area.id in measured]
    tree = shapely.STRtree(outlines)
    kept: list[OsmArea] = []
    for area in areas:
        tags = area.tags
        if tags.get("building:part", "no") != "no" and tags.get("building", "no") == "no":
            near = tree.query(area.polygon, predicate="intersects").tolist()
            inside = [
                k for k in near if overlay.common_area(outlines[k], area.polygon) > _PART_WITHIN * area.polygon.area
            ]
            if inside:
                dropped.append(Dropped(id=area.id, reason=f"part of {names[min(inside)]}, whose roof is measured"))
                continue
        kept.append(area)
    return kept
