"""Stages from a map to what stands there and the ground around it; each stage is one call.

First come the plan (outlines of buildings, streets, graded ground) and what is built by it (bridges, stairs,
buildings), then cladding, yards, ground, wires over tracks and what lies beyond the window. All data files are read
before anything is built: a wrong entry is told at once.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from shapely import Polygon

from vico.assets.models.library import INDOOR, OUTDOOR, read_all
from vico.errors import EmptyInputError
from vico.geo.elevation import HeightSamples
from vico.geo.osm import OsmData
from vico.geo.tiles3d import TileMesh
from vico.io.data_files import own_files
from vico.world.heights import HeightField
from vico.world.mesh import Surface, merge_surfaces
from vico.worldgen.buildings.fitting import lower_onto_terrain, plans_on_tiles
from vico.worldgen.buildings.stage import BuildingsResult, Cladding, buildings_from_plans, clad
from vico.worldgen.evidence import Evidence
from vico.worldgen.facades import facade_styles as facades
from vico.worldgen.facts import named_places
from vico.worldgen.facts.building_outlines import building_plans
from vico.worldgen.facts.building_plans import BuildingPlans
from vico.worldgen.facts.conflation import conflate_buildings
from vico.worldgen.facts.site import SiteFacts, site_facts
from vico.worldgen.facts.streets import StreetPolygons
from vico.worldgen.ground.backdrop import backdrop_of
from vico.worldgen.ground.grade_separation import Bridges, bridges_of
from vico.worldgen.ground.grading import grade_ground
from vico.worldgen.ground.stage import GROUND_APRON, ground_from_osm
from vico.worldgen.ground.stairs import Flights, flights_of
from vico.worldgen.ground.terrain import APRON, flat_terrain, terrain_from_dem, terrain_from_tiles
from vico.worldgen.ground.wires import contact_wires
from vico.worldgen.ground.yards import Yards, yards_of
from vico.worldgen.indoor import catalogue as rooms
from vico.worldgen.objects import catalogue as objects
from vico.worldgen.objects.detections import detected_classes
from vico.worldgen.request import WorldRequest
from vico.worldgen.seams.joins import (
    BORES,
    JOINED,
    MAP,
    WATERS,
    TilePlace,
    crop_heights,
    join_neighbours,
    split_buildings,
)
from vico.worldgen.stages import Stages, load_product
from vico.worldgen.streets.polygons import road_polygons


def _read_data_tables() -> None:
    """Read every file of data, ours and the user's, and make the user's models.

    Raises
    ------
    InputError
        If `VICO_DATA` names no folder.
    SchemaError
        If a file can't be used; the message names file and entry.
    """
    for models in (read_all(own_files(OUTDOOR)), read_all(own_files(INDOOR))):
        for model in models.values():
            _ = model.surfaces
    for read in (
        facades.styles,
        named_places.categories,
        named_places.source_words,
        named_places.place_names,
        objects.kinds,
        objects.signs,
        objects.standing,
        objects.trees,
        objects.barriers,
        detected_classes,
        rooms.room_kinds,
        rooms.uses,
    ):
        read()


#: Products of a tile's plan in which its neighbours have a say.
SEAMS = ("streets", "grading")


def map_of(place: TilePlace) -> tuple[OsmData, str]:
    """Return what of the city's map lies in a tile and around it, and its digest."""
    found: tuple[OsmData, str] = load_product(place.own, MAP)
    return found


@dataclass(frozen=True)
class Plan:
    """Plan of a world before anything is built: outlines of buildings, streets, and the ground graded to them.

    Attributes
    ----------
    evidence
        The sources, the map with what others know of buildings.
    site, plans, streets, height
        Facts of the map, buildings, streets, ground.
    tiles
        The photogrammetry mesh, on that ground.
    """

    evidence: Evidence
    site: SiteFacts
    plans: BuildingPlans
    tiles: TileMesh | None
    streets: StreetPolygons
    height: HeightField


def plan_site(evidence: Evidence, request: WorldRequest, stages: Stages) -> Plan:
    """Run the stages that come before anything is built."""
    _read_data_tables()
    run = stages.run
    evidence, known = _merge_buildings(evidence, stages)
    site = _without_lost(_site(evidence.data, request.place, stages), stages)
    plans = run("plans", building_plans, site.osm, seed=request.seed, **known)
    bare, tiles = _terrain(evidence, plans, request, stages)
    # Kerbs lie at the borders of the streets, so both come from the same polygons, and before anything stands on them.
    streets = run("streets", road_polygons, site, plans.standing())
    site = _without_lost(site, stages)
    height = run("grading", grade_ground, bare, site, streets)
    return Plan(evidence, _without_lost(site, stages), plans, tiles, streets, height)


@dataclass(frozen=True)
class Shape:
    """Buildings and ground: the plan carried out, before there are lanes and objects.

    Attributes
    ----------
    plan
        What was planned; of a tile as its neighbours see it.
    bridges, flights, levels
        Bridges and tunnels, stairs outdoors, and the ground with the surfaces of both.
    built, solids
        The buildings, and the footprints of all that nobody walks through, what stands just beyond a tile among it.
    """

    plan: Plan
    bridges: Bridges
    flights: Flights
    levels: HeightField
    built: BuildingsResult
    solids: list[Polygon]


def build_shape(plan: Plan, request: WorldRequest, stages: Stages) -> Shape:
    """Run the stages from the plan to what stands there."""
    run = stages.run
    plan, beyond = plan_with_neighbours(plan, request, stages)
    site, plans, height = plan.site, plan.plans, plan.height
    bores = None if request.place is None else stages.register(*load_product(request.place.own, BORES))
    bridges = run("bridges", bridges_of, site, height, plan.streets, bores)
    site = _without_lost(site, stages)
    flights = run("stairs", flights_of, site, height, plan.streets.steps)
    site = _without_lost(site, stages)
    levels = stages.register_value(replace(height, decks=bridges.levels(), stairs=flights.treads()))
    if plan.tiles is not None:
        plans, fits = run("fit", plans_on_tiles, plans, plan.tiles, height)
        stages.report("fit", fits.counts())
    built = run("buildings", buildings_from_plans, plans, site.osm, height, seed=request.seed)
    solids = stages.register_value([*built.standing(height), *bridges.feet, *beyond])
    return Shape(replace(plan, site=site, plans=plans), bridges, flights, levels, built, solids)


def plan_with_neighbours(plan: Plan, request: WorldRequest, stages: Stages) -> tuple[Plan, list[Polygon]]:
    """Return the plan of a tile as its neighbours see it, and what stands just beyond it; others as they are."""
    place = request.place
    if place is None:
        return plan, []
    around = place.grid.around(place.tile)
    found = {name: [load_product(place.folder(one), name) for one in around] for name in SEAMS}
    known = {name: [stages.register(*one) for one in products] for name, products in found.items()}
    both = " ".join(digest for products in found.values() for _, digest in products)
    streets = stages.register(known["streets"], f"streets {both}")
    heights = stages.register(known["grading"], f"heights {both}")
    joined = stages.run(JOINED, join_neighbours, place.grid, place.tile, streets, heights, apron=APRON)
    plans, beyond = split_buildings(plan.plans, place.grid, place.tile)
    osm = plan.site.osm
    less = replace(osm, half=request.half, margin=osm.margin + osm.half - request.half)
    site = stages.register(site_facts(less, plan.site.waters), f"{stages.digest(plan.site)} within {request.half}")
    return replace(
        plan,
        site=site,
        plans=stages.register(plans, f"{stages.digest(plan.plans)} within {request.half}"),
        streets=stages.register(joined.streets, f"{stages.digest(joined)} streets"),
        height=stages.register(joined.height, f"{stages.digest(joined)} height"),
    ), beyond


def _merge_buildings(evidence: Evidence, stages: Stages) -> tuple[Evidence, dict[str, Any]]:
    """Merge what other sources know of buildings into the map; also what their plans need to know beside it."""
    if evidence.precedence is None:
        return evidence, {}
    merged = stages.run("sources", conflate_buildings, evidence.data, evidence.buildings, evidence.precedence)
    stages.report("sources", merged.counts, merged.dropped)
    data = stages.register(merged.osm, f"map of {stages.digest(merged)}")
    return replace(evidence, data=data), {"measured": merged.facets, "origins": merged.origins}


def _site(data: OsmData, place: TilePlace | None, stages: Stages) -> SiteFacts:
    """Read the facts of the site off its map; they are known by the digest of that and of what a city knows beside."""
    waters, known = (None, "") if place is None else load_product(place.own, WATERS)
    with stages.timer("facts"):
        return stages.register(site_facts(data, waters), f"facts {stages.digest(data)} {known}")


def _without_lost(site: SiteFacts, stages: Stages) -> SiteFacts:
    """Return what is left of the site: what a stage could not make, those that follow don't see."""
    if not stages.lost:
        return site
    less = site.without(stages.lost)
    return stages.register(less, f"{stages.digest(site)} without {' '.join(sorted(stages.lost))}")


def _terrain(
    evidence: Evidence, plans: BuildingPlans, request: WorldRequest, stages: Stages
) -> tuple[HeightField, TileMesh | None]:
    """Make the bare ground from the sources of heights; the tile mesh, if there is one, is raised to stand on it."""
    tiles, half, place = evidence.tiles, request.reach, request.place
    if place is not None and request.sources.dem:
        # Of the whole city at once: a fit to fewer samples is another one.
        whole = stages.register(*load_product(place.plans, "terrain"))
        east, north = place.grid.centre(place.tile)
        return stages.run("terrain", crop_heights, whole, half=half + APRON, east=east, north=north), None
    if tiles is None and evidence.samples is None:
        return stages.run("terrain", flat_terrain, half=half), None
    if tiles is None:
        return stages.run("terrain", terrain_from_dem, evidence.samples, half=half), None
    height, raised = stages.run("terrain", _ground_of_tiles, evidence.data, evidence.samples, tiles, plans, half=half)
    if raised:
        tiles = replace(tiles, positions=tiles.positions + np.array([0.0, 0.0, raised]))
    return height, tiles


def _ground_of_tiles(
    data: OsmData, samples: HeightSamples | None, mesh: TileMesh, plans: BuildingPlans, *, half: float
) -> tuple[HeightField, float]:
    """Return the ground, and by how much the tile mesh has to be raised to stand on it.

    An elevation file that is given goes before the mesh's own ground; a mesh of buildings alone has none.
    """
    if samples is None:
        try:
            return terrain_from_tiles(mesh, data, half=half)[0], 0.0
        except EmptyInputError:
            height = flat_terrain(half=half)
    else:
        height = terrain_from_dem(samples, half=half)
    return height, lower_onto_terrain(mesh, plans.plans, height)[1]


def make_cladding(shape: Shape, request: WorldRequest, stages: Stages) -> Cladding:
    """Cover the buildings."""
    # Known by what it is a part of: that has been digested.
    bare = stages.register(shape.built.bare, f"{stages.digest(shape.built)} bare")
    return stages.run("cladding", clad, bare, shape.plan.site.osm, seed=request.seed)


def find_yards(shape: Shape, request: WorldRequest, stages: Stages) -> Yards:
    """Decide which of the open ground is not paved."""
    plan = shape.plan
    reach = plan.site.osm.half + _apron(request)
    return stages.run("yards", yards_of, plan.site, plan.streets.carriageway, reach=reach)


def make_ground(
    shape: Shape, yards: Yards, trees: NDArray[np.float64], request: WorldRequest, stages: Stages
) -> list[Surface]:
    """Make the ground, wires over tracks, and what lies beyond the window.

    Parameters
    ----------
    trees
        Where trees stand, metres, shape ``(n, 2)``.
    """
    run, plan = stages.run, shape.plan
    site, height, streets = plan.site, plan.height, plan.streets
    ground = run(
        "ground",
        ground_from_osm,
        site,
        height,
        streets,
        shape.bridges,
        shape.flights,
        standing=shape.solids,
        trees=trees,
        yards=yards,
    )
    wires = run("wires", contact_wires, site, height, shape.solids, reach=request.half)
    if not _apron(request):
        return merge_surfaces([*ground, *wires])
    around = run("backdrop", backdrop_of, site, height, streets, shape.built.records, seed=request.seed)
    return merge_surfaces([*ground, *around, *wires])


def _apron(request: WorldRequest) -> float:
    # A tile ends where the next one begins: nothing is drawn beyond it.
    return GROUND_APRON if request.place is None else 0.0
