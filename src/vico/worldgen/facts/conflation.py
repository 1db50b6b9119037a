"""Conflation: buildings of other sources merged into the map, fact by fact, in an order of precedence.

Buildings are matched by their outlines. The map's building keeps its id, its function, its address and whatever else it
is tagged with; of other sources come outline, height, roof and name where they go first. What the map lacks is added.
What comes out is a map again, which all stages read as before, and beside it the surfaces of measured roofs and where
every fact is from. The order is a small file that a person can read and change (data/worldgen/sources/precedence.toml).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from hashlib import sha256
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import shapely
from pydantic import Field
from shapely import MultiPolygon, Polygon

from vico.errors import InputError
from vico.geo import overlay
from vico.geo.buildings import CITY_MODELS, KINDS, FoundBuilding, FoundBuildings, RoofFacet, form_of
from vico.geo.osm import OsmArea, OsmData, Tags
from vico.geo.outlines import union_closing_gaps
from vico.io.data_files import PACKAGED, DataRecord, read_record
from vico.world.model import Dropped
from vico.worldgen.facts.building_heights import tagged_height, tagged_levels
from vico.worldgen.facts.building_plans import BuildingOrigin
from vico.worldgen.facts.fault_isolation import drop_on_failure
from vico.worldgen.facts.roofs import shape_named

_GUIDE = "docs/sources.md"
OSM = "osm"
_CITY_MODELS = "lod2"
_WORDS = (OSM, _CITY_MODELS, *KINDS)
Share = Annotated[float, Field(ge=0.0, le=1.0)]


class Precedence(DataRecord):
    """Order of sources by kind of fact; see data/worldgen/sources/precedence.toml.

    Attributes
    ----------
    footprint, height, roof, name
        Sources, the one that counts first first; one that is not named does not count.
    added
        Sources whose buildings are added where the map has none.
    terrain
        Which of overlapping elevation files counts.
    same, free
        Shares of area from which on two outlines are one building, and up to which they are two.
    """

    footprint: tuple[str, ...]
    height: tuple[str, ...]
    roof: tuple[str, ...]
    name: tuple[str, ...]
    added: tuple[str, ...]
    terrain: Literal["finest", "given"]
    same: Share
    free: Share


def read_precedence(path: Path | None, files: Sequence[str]) -> Precedence:
    """Read the file, or the package's own.

    Parameters
    ----------
    path
        The file; None for the package's.
    files
        Names of the files of buildings that are given.

    Raises
    ------
    MissingFileError, SchemaError
        If it is not there, or not as its schema says.
    InputError
        If it names a source that there is not.
    """
    where = path or PACKAGED / "worldgen" / "sources" / "precedence.toml"
    precedence = read_record(where, Precedence, guide=_GUIDE)
    for fact in ("footprint", "height", "roof", "name", "added"):
        order: tuple[str, ...] = getattr(precedence, fact)
        for name in order:
            if name not in _WORDS and name not in files:
                there = f" or a file that is given ({', '.join(files)})" if files else ""
                raise InputError(f"{where}: {fact}: no source {name!r}; write {', '.join(_WORDS)}{there}")
        if doubled := sorted({name for name in order if order.count(name) > 1}):
            raise InputError(f"{where}: {fact}: {', '.join(doubled)} twice; each source has one place")
    if precedence.free > precedence.same:
        raise InputError(f"{where}: free ({precedence.free:g}) is larger than same ({precedence.same:g})")
    return precedence


def rank_of(kind: str, file: str, order: Sequence[str]) -> int | None:
    """Return the place of a source in an order, by its file's name, its kind, or as a city model; None: it has none."""
    for name in (file, kind, _CITY_MODELS if kind in CITY_MODELS else kind):
        if name in order:
            return order.index(name)
    return None


_HEIGHTS = ("height", "building:height", "est_height", "building:levels")
_ROOFS = ("roof:shape", "roof:height", "roof:levels", "roof:angle", "roof:direction", "roof:orientation")
_CLOSING = 0.05  # metres between outlines of one building's pieces
_LEAST_AREA = 2.0  # square metres


@dataclass(frozen=True)
class Claim:
    """Facts in a file about a building of the map.

    Attributes
    ----------
    buildings
        The file's buildings that are it, or of which it is a part.
    whole
        Whether they lie within it; else they are larger, and their outline is not its.
    """

    buildings: tuple[FoundBuilding, ...]
    whole: bool

    @property
    def main(self) -> FoundBuilding:
        """The largest."""
        return max(self.buildings, key=lambda found: (found.footprint.area, found.id))

    @property
    def facets(self) -> tuple[RoofFacet, ...]:
        """Return the surfaces of all roofs; none if one of the buildings has none."""
        if not all(found.facets for found in self.buildings):
            return ()
        return tuple(facet for found in self.buildings for facet in found.facets)

    def footprint(self) -> Polygon | MultiPolygon:
        """Return the outline of all together."""
        return union_closing_gaps([found.footprint for found in self.buildings], gap=_CLOSING, least=_LEAST_AREA)


@dataclass(frozen=True)
class ResolvedBuilding:
    """A building with what is held to be true of it; `facets` are its measured roof, heights above its ground."""

    area: OsmArea
    origin: BuildingOrigin
    facets: tuple[RoofFacet, ...]


def _resolve_building(area: OsmArea, claims: Sequence[Claim], precedence: Precedence) -> ResolvedBuilding:
    """Decide outline, height, roof and name of a building of the map.

    Parameters
    ----------
    area
        As the map has it.
    claims
        What files say of it, one a file.
    precedence
        Whose word counts.

    Raises
    ------
    OverlayError
        If outlines can't be put together.
    """

    def first(order: Sequence[str], of_map: bool, tells: Callable[[Claim], bool]) -> Claim | None:
        """Return the claim that goes first; None if the map does, or there is none."""
        ranked = [
            (rank, k) for k, claim in enumerate(claims)
            if tells(claim) and (rank := rank_of(claim.main.kind, claim.main.file, order)) is not None
        ]  # fmt: skip
        if not ranked or (of_map and OSM in order and order.index(OSM) < min(ranked)[0]):
            return None
        return claims[min(ranked)[1]]

    tags = dict(area.tags)
    outline = first(precedence.footprint, True, lambda claim: claim.whole)
    has_height = tagged_height(tags) is not None or tagged_levels(tags) is not None
    height = first(precedence.height, has_height, lambda claim: _heights(claim.main.tags) != {})
    has_roof = shape_named(tags.get("roof:shape")) is not None
    roof = first(precedence.roof, has_roof, lambda claim: bool(claim.facets) or "roof:shape" in claim.main.tags)
    name = first(precedence.name, "name" in tags, lambda claim: "name" in claim.main.tags)
    tags = _with_height(tags, height, OSM in precedence.height)
    tags = _with_roof(tags, roof, OSM in precedence.roof)
    if name is not None:
        tags["name"] = name.main.tags["name"]
    facets = roof.facets if roof is not None else ()
    if facets and roof is not height:
        # Another source says how high it is: the roof is as the model has it, and as high as is said.
        said = tagged_height(tags)
        facets = tuple(facet.moved(up=said - form_of(facets).top) for facet in facets) if said else facets
    shape = outline.footprint() if outline is not None else area.polygon
    origin = BuildingOrigin(
        OSM if outline is None else outline.main.source,
        "" if height is None else height.main.source,
        "" if roof is None else f"{roof.main.source} surfaces" if facets else roof.main.source,
    )
    if facets and roof is not None and height is None and tagged_height(tags) is None:
        origin = replace(origin, height=roof.main.source)  # the surfaces lie where they lie
    return ResolvedBuilding(replace(area, polygon=shape, tags=tags), origin, facets)


def _heights(tags: Tags) -> Tags:
    return {key: tags[key] for key in _HEIGHTS if key in tags}


def _with_height(tags: Tags, claim: Claim | None, of_map: bool) -> Tags:
    """Return tags with the height of a claim instead of the map's; storeys stay where the two agree."""
    if claim is None:
        return tags if of_map else {key: value for key, value in tags.items() if key not in _HEIGHTS}
    theirs = _heights(claim.main.tags)
    storeys, height = tagged_levels(_heights(tags)), tagged_height(theirs)
    rest = {key: value for key, value in tags.items() if key not in _HEIGHTS}
    told = "building:levels" in tags and "building:levels" not in theirs
    if told and storeys and height and 2.4 <= height / storeys <= 6.0:
        rest["building:levels"] = tags["building:levels"]
    return {**rest, **theirs}


def _with_roof(tags: Tags, claim: Claim | None, of_map: bool) -> Tags:
    """Return tags with the roof of a claim instead of the map's; colour and material stay where the map has them."""
    if claim is None:
        return tags if of_map else {key: value for key, value in tags.items() if key not in _ROOFS}
    rest = {key: value for key, value in tags.items() if key not in _ROOFS}
    theirs = claim.main.tags
    more: Tags = {key: theirs[key] for key in ("roof:colour", "roof:material") if key in theirs}
    return {**more, **rest, **{key: theirs[key] for key in _ROOFS if key in theirs}}


_LEAST = 0.02  # share of either outline below which two only touch
_PART_WITHIN = 0.5  # share of a part that lies in a building whose roof is measured


@dataclass(frozen=True)
class ConflatedMap:
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


def conflate_buildings(osm: OsmData, sources: Sequence[FoundBuildings], precedence: Precedence) -> ConflatedMap:
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
        matched, alone = _match_buildings(shapes, source, precedence, dropped)
        for name, claim in matched.items():
            claims.setdefault(name, []).append(claim)
        lonely += alone
    added, parts, origins, facets = _missing_buildings(shapes, lonely, precedence, dropped)
    areas: list[OsmArea] = []
    results: dict[str, ResolvedBuilding] = {}
    for area in osm.areas:
        mine = claims.get(area.id)
        made = area
        if mine is not None:
            with drop_on_failure(area.id, dropped):
                result = _resolve_building(area, mine, precedence)
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
    return ConflatedMap(replace(osm, areas=[*areas, *added, *parts]), facets, origins, dropped, counts)


def _match_buildings(
    areas: Sequence[OsmArea], source: FoundBuildings, precedence: Precedence, dropped: list[Dropped]
) -> tuple[dict[str, Claim], list[FoundBuilding]]:
    """Match a file's buildings with the map's: what each of the map's is claimed to be, and those of nobody."""
    tree = shapely.STRtree([area.polygon for area in areas])
    pairs: dict[int, list[tuple[FoundBuilding, float, float]]] = {}
    lonely: list[FoundBuilding] = []
    for found in source.buildings:
        with drop_on_failure(found.id, dropped):
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


def _missing_buildings(
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
        with drop_on_failure(found.id, dropped):
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
