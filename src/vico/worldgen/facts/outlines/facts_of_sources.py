"""What is held to be true of one building that several sources know: fact by fact, the first source that tells it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from shapely import MultiPolygon, Polygon

from vico.geo.buildings import FoundBuilding, RoofFacet, form_of
from vico.geo.osm import OsmArea, Tags
from vico.geo.outlines import union_closing_gaps
from vico.worldgen.facts.outlines.heights import said_height, said_levels
from vico.worldgen.facts.outlines.plans import BuildingOrigin
from vico.worldgen.facts.outlines.roof_shapes import shape_named
from vico.worldgen.facts.precedence import OSM, Precedence, rank_of

_HEIGHTS = ("height", "building:height", "est_height", "building:levels")
_ROOFS = ("roof:shape", "roof:height", "roof:levels", "roof:angle", "roof:direction", "roof:orientation")
_CLOSING = 0.05  # metres between outlines of one building's pieces
_LEAST_AREA = 2.0  # square metres


@dataclass(frozen=True)
class Claim:
    """What a file says of a building of the map.

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
class Decided:
    """A building with what is held to be true of it; `facets` are its measured roof, heights above its ground."""

    area: OsmArea
    origin: BuildingOrigin
    facets: tuple[RoofFacet, ...]


def decided(area: OsmArea, claims: Sequence[Claim], precedence: Precedence) -> Decided:
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
        """Return the claim that goes first; None if the map does, or nobody tells."""
        ranked = [
            (rank, k) for k, claim in enumerate(claims)
            if tells(claim) and (rank := rank_of(claim.main.kind, claim.main.file, order)) is not None
        ]  # fmt: skip
        if not ranked or (of_map and OSM in order and order.index(OSM) < min(ranked)[0]):
            return None
        return claims[min(ranked)[1]]

    tags = dict(area.tags)
    outline = first(precedence.footprint, True, lambda claim: claim.whole)
    has_height = said_height(tags) is not None or said_levels(tags) is not None
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
        said = said_height(tags)
        facets = tuple(facet.moved(up=said - form_of(facets).top) for facet in facets) if said else facets
    shape = outline.footprint() if outline is not None else area.polygon
    origin = BuildingOrigin(
        OSM if outline is None else outline.main.source,
        "" if height is None else height.main.source,
        "" if roof is None else f"{roof.main.source} surfaces" if facets else roof.main.source,
    )
    if facets and roof is not None and height is None and said_height(tags) is None:
        origin = replace(origin, height=roof.main.source)  # the surfaces lie where they lie
    return Decided(replace(area, polygon=shape, tags=tags), origin, facets)


def _heights(tags: Tags) -> Tags:
    return {key: tags[key] for key in _HEIGHTS if key in tags}


def _with_height(tags: Tags, claim: Claim | None, of_map: bool) -> Tags:
    """Return tags with the height of a claim instead of the map's; storeys stay where the two agree."""
    if claim is None:
        return tags if of_map else {key: value for key, value in tags.items() if key not in _HEIGHTS}
    theirs = _heights(claim.main.tags)
    storeys, height = said_levels(_heights(tags)), said_height(theirs)
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
