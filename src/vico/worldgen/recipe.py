"""The order of the stages: from a map to a world. Each is one call into a folder that knows no other stage."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from shapely import Polygon

from vico.assets.things.pack import read_things
from vico.errors import EmptyInputError
from vico.geo.elevation import HeightSamples
from vico.geo.osm import OsmData
from vico.geo.street_images.model import StreetImage
from vico.geo.tiles3d.mesh import TileMesh
from vico.io.files import sha256_of
from vico.world.detected import FILE
from vico.world.folder import World, write_records
from vico.world.heights import HeightField
from vico.world.mesh import Surface, joined
from vico.world.model import Building, Dropped, Entrance, Place
from vico.world.objects import Objects
from vico.worldgen.buildings.fitting.nudging import plans_on_tiles, settled
from vico.worldgen.buildings.stage import BuildingsResult, buildings_from_plans
from vico.worldgen.evidence import Evidence
from vico.worldgen.facades.fronts import street_fronts
from vico.worldgen.facts.outlines.buildings import building_plans
from vico.worldgen.facts.outlines.merging import merged_buildings
from vico.worldgen.facts.outlines.plans import BuildingPlans
from vico.worldgen.facts.site import SiteFacts, site_facts
from vico.worldgen.facts.streets import StreetPolygons
from vico.worldgen.ground.backdrop import backdrop_of
from vico.worldgen.ground.bridges.stage import bridges_of
from vico.worldgen.ground.grading import graded
from vico.worldgen.ground.stage import ground_from_osm
from vico.worldgen.ground.stairs import flights_of
from vico.worldgen.ground.terrain import APRON, flat_terrain, terrain_from_dem, terrain_from_tiles
from vico.worldgen.ground.walkable import walkable_from_site
from vico.worldgen.ground.wires import contact_wires
from vico.worldgen.indoor.layout_llm import furnish_drawn
from vico.worldgen.indoor.stage import Indoors, furnish
from vico.worldgen.objects.detections.matching import things_from_detections
from vico.worldgen.objects.models import models_of
from vico.worldgen.objects.parking import parking_from_osm
from vico.worldgen.objects.stage import objects_from_osm
from vico.worldgen.photos.streetview.renders import photographer_of
from vico.worldgen.photos.texturing import (
    Texturing,
    enhanced,
    kept_where_photographed,
    painted_as_built,
    painted_from_street,
    painted_from_tiles,
)
from vico.worldgen.places.stage import places_from_osm
from vico.worldgen.request import WorldRequest
from vico.worldgen.seams.heights import cropped
from vico.worldgen.seams.join import parted, seamless
from vico.worldgen.stages import Stages, kept_product
from vico.worldgen.streets.netconvert import road_network
from vico.worldgen.streets.polygons import road_polygons
from vico.worldgen.streets.roads import roads_from_osm, streets_from_osm
from vico.worldgen.streets.walk_lines import CarriagewayEdges
from vico.worldgen.tables import read_tables
from vico.worldgen.transit.stage import transit_from_osm
from vico.worldgen.transit.waiting import waiting_places
from vico.worldgen.writing import Layers, WorldParts, WorldWriter, faces, manifest_of

#: Products of a tile's plan in which its neighbours have a say.
SEAMS = ("streets", "grading")
# Faces that photos cover less than this share of keep their facade.
_LEAST_COVERED = 0.3


@dataclass(frozen=True)
class Plan:
    """What is decided before anything is built: outlines of buildings, streets, and the ground graded to them.

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


def planned(evidence: Evidence, request: WorldRequest, stages: Stages) -> Plan:
    """Run the stages that come before anything is built."""
    read_tables()
    run = stages.run
    evidence, known = _merged(evidence, stages)
    site = _left(_site(evidence.data, stages), stages)
    plans = run("plans", building_plans, site.osm, seed=request.seed, **known)
    bare, tiles = _terrain(evidence, plans, request, stages)
    # Kerbs lie at the borders of the streets, so both come from the same polygons, and before anything stands on them.
    streets = run("streets", road_polygons, site, plans.standing())
    site = _left(site, stages)
    height = run("grading", graded, bare, site, streets)
    return Plan(evidence, _left(site, stages), plans, tiles, streets, height)


def make_world(evidence: Evidence, request: WorldRequest, folder: Path, stages: Stages) -> World:
    """Run every stage between the sources and the pictures, and write the world's files into `folder`."""
    if request.sources.installed_things:
        read_things()  # refuses before anything is built if they are not installed
    seed, run, write = request.seed, stages.run, WorldWriter(folder, stages)

    plan, beyond = _among_neighbours(planned(evidence, request, stages), request, stages)
    evidence, site, plans, tiles, streets, height = (
        plan.evidence, plan.site, plan.plans, plan.tiles, plan.streets, plan.height,
    )  # fmt: skip
    bridges = run("bridges", bridges_of, site, height, streets)
    site = _left(site, stages)
    flights = run("stairs", flights_of, site, height, streets.steps)
    site = _left(site, stages)
    levels = stages.digested(replace(height, decks=bridges.levels(), stairs=flights.treads()))
    write.terrain(levels, flat=evidence.samples is None and tiles is None)

    if tiles is not None:
        plans, fits = run("fit", plans_on_tiles, plans, tiles, height)
        stages.report("fit", fits.counts())
    built = run("buildings", buildings_from_plans, plans, site.osm, height, seed=seed)
    solids = stages.digested([*built.standing(height), *bridges.feet, *beyond])

    ways = run("ways", streets_from_osm, site, solids, bridges.open_ways)
    roads = run("roads", roads_from_osm, site, ways)
    kerbs = CarriagewayEdges(streets.carriageway, solids)
    lanes = write.streets(roads, run("network", road_network, site, ways, levels, kerbs))
    feeds = list(evidence.feeds)
    mapped = run("transit", transit_from_osm, site, lanes, levels, solids=solids, seed=seed, feeds=feeds)
    with stages.timed("waiting"):
        transit = waiting_places(mapped, streets, lanes, height, solids)
    write.transit(transit)

    outdoors, dropped = run(
        "objects",
        objects_from_osm,
        _with_detections(site.osm, evidence, height, seed, folder, stages),
        solids=[*solids, *bridges.cuts],
        carriageway=streets.carriageway,
        openings=streets.footways(),
        height=height,
        transit=transit,
        lanes=lanes,
        seed=seed,
    )
    parking = run(
        "parking",
        parking_from_osm,
        site,
        streets=streets,
        lanes=lanes,
        objects=outdoors,
        solids=solids,
        height=height,
        transit=transit,
        seed=seed,
    )
    write.parking(parking)
    outdoors = stages.digested(Objects.joined([outdoors, parking.cars]))
    write.outdoors(outdoors, dropped)
    walkable = run("walkable", walkable_from_site, site, streets, [*solids, *bridges.low, *bridges.cuts], outdoors)
    write.walkable(walkable)

    places, entrances, dropped = run(
        "places",
        places_from_osm,
        site,
        buildings=built.records,
        walkable=walkable,
        height=height,
        roads=roads,
        transit=transit,
        found=list(evidence.found),
    )
    buildings = write.buildings(built, entrances)
    stages.report("places", {"places": len(places), "entrances": len(entrances)}, dropped)
    indoors, undrawn = _furnished(places, entrances, buildings, height, request, stages)
    write.indoors(indoors, undrawn)
    objects = write.objects(outdoors, indoors)

    trees = outdoors.position[outdoors.kind == "tree", :2]
    # A tile ends where the next one begins: nothing is drawn beyond it.
    apron = {} if request.place is None else {"apron": 0.0}
    ground = run(
        "ground", ground_from_osm, site, height, streets, bridges, flights, standing=solids, trees=trees, **apron
    )
    wires = run("wires", contact_wires, site, height, solids, reach=request.half)
    around = [] if apron else run("backdrop", backdrop_of, site, height, streets, built.records, seed=seed)
    ground = joined([*ground, *around, *wires])
    stages.report("ground", {"faces": faces(ground)})
    with stages.timed("fronts"):
        fronts = street_fronts(indoors.places, entrances, buildings, built.walls, seed=seed)
    stages.report("fronts", fronts.counts)

    models, credits = models_of(objects, installed=request.sources.installed_things)
    parts = WorldParts(
        height=levels,
        buildings=buildings,
        places=indoors.places,
        entrances=entrances,
        rooms=indoors.rooms,
        objects=objects,
        roads=roads,
        transit=transit,
        walkable=walkable,
        lanes=lanes,
        parking=parking.spots,
        models=models,
    )
    layers = Layers(ground, built.walls, fronts.surfaces, built.roofs, indoors.surfaces, built.collision)
    manifest = manifest_of(request, evidence, parts, stages, credits)
    if tiles is not None or evidence.images:
        seen = parts.world(manifest, folder, layers)
        walls, roofs = _painted(evidence.images, tiles, built, seen, request.texturing, stages)
        layers = replace(layers, walls=walls, roofs=roofs)
    write.meshes(layers, models)
    return parts.world(manifest, folder, layers)


def _among_neighbours(plan: Plan, request: WorldRequest, stages: Stages) -> tuple[Plan, list[Polygon]]:
    """Return the plan of a tile as its neighbours see it, and what stands just beyond it; others as they are."""
    place = request.place
    if place is None:
        return plan, []
    around = place.grid.around(place.tile)
    found = {name: [kept_product(place.folder(one), name) for one in around] for name in SEAMS}
    known = {name: [stages.given(*one) for one in products] for name, products in found.items()}
    both = " ".join(digest for products in found.values() for _, digest in products)
    streets = stages.given(known["streets"], f"streets {both}")
    heights = stages.given(known["grading"], f"heights {both}")
    joined = stages.run("seams", seamless, place.grid, place.tile, streets, heights, apron=APRON)
    plans, beyond = parted(plan.plans, request.half)
    osm = plan.site.osm
    less = replace(osm, half=request.half, margin=osm.margin + osm.half - request.half)
    site = stages.given(site_facts(less), f"{stages.digest(plan.site)} within {request.half}")
    return replace(
        plan,
        site=site,
        plans=stages.given(plans, f"{stages.digest(plan.plans)} within {request.half}"),
        streets=stages.given(joined.streets, f"{stages.digest(joined)} streets"),
        height=stages.given(joined.height, f"{stages.digest(joined)} height"),
    ), beyond


def _merged(evidence: Evidence, stages: Stages) -> tuple[Evidence, dict[str, Any]]:
    """Merge what other sources know of buildings into the map; also what their plans need to know beside it."""
    if evidence.precedence is None:
        return evidence, {}
    merged = stages.run("sources", merged_buildings, evidence.data, evidence.buildings, evidence.precedence)
    stages.report("sources", merged.counts, merged.dropped)
    data = stages.given(merged.osm, f"map of {stages.digest(merged)}")
    return replace(evidence, data=data), {"measured": merged.facets, "origins": merged.origins}


def _with_detections(
    osm: OsmData, evidence: Evidence, height: HeightField, seed: int, folder: Path, stages: Stages
) -> OsmData:
    """Return the map with what detections show beside it, and write what became of each; the map itself without."""
    if evidence.detections is None:
        return osm
    things = stages.run("detections", things_from_detections, osm, evidence.detections, height, seed=seed)
    write_records(folder / FILE, things.records)
    stages.report("detections", things.counts(), things.dropped)
    return stages.given(things.on(osm), f"{stages.digest(osm)} {stages.digest(things)}")


def _site(data: OsmData, stages: Stages) -> SiteFacts:
    """Read the facts of the site off its map; they are known by the map's own digest."""
    with stages.timed("facts"):
        return stages.given(site_facts(data), f"facts {stages.digest(data)}")


def _left(site: SiteFacts, stages: Stages) -> SiteFacts:
    """Return what is left of the site: what a stage could not make, those that follow don't see."""
    if not stages.lost:
        return site
    less = site.without(stages.lost)
    return stages.given(less, f"{stages.digest(site)} without {' '.join(sorted(stages.lost))}")


def _terrain(
    evidence: Evidence, plans: BuildingPlans, request: WorldRequest, stages: Stages
) -> tuple[HeightField, TileMesh | None]:
    """Make the bare ground of whatever tells heights; the tile mesh, if there is one, is raised to stand on it."""
    tiles, half, place = evidence.tiles, request.reach, request.place
    if place is not None and evidence.samples is not None:
        # Of the whole city at once: a fit to fewer samples is another one.
        whole = stages.given(*kept_product(place.plans, "terrain"))
        east, north = place.grid.centre(place.tile)
        return stages.run("terrain", cropped, whole, half=half + APRON, east=east, north=north), None
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
    """Make the ground, and tell by how much the tile mesh has to be raised to stand on it.

    An elevation file that is given goes before the mesh's own ground; a mesh of buildings alone has none.
    """
    if samples is None:
        try:
            return terrain_from_tiles(mesh, data, half=half)[0], 0.0
        except EmptyInputError:
            height = flat_terrain(half=half)
    else:
        height = terrain_from_dem(samples, half=half)
    return height, settled(mesh, plans.plans, height)[1]


def _furnished(
    places: list[Place],
    entrances: list[Entrance],
    buildings: list[Building],
    height: HeightField,
    request: WorldRequest,
    stages: Stages,
) -> tuple[Indoors, list[Dropped]]:
    """Give places their rooms: from the library, drawn by the request's author, or by rules."""
    library, author = request.sources.layouts, request.author
    if library is not None:
        files = sorted(library.glob("*.json"))
        stages.given(library, " ".join(f"{path.name} {sha256_of(path)}" for path in files))
    inside = {
        "buildings": buildings,
        "height": height,
        "seed": request.seed,
        "entrances": entrances,
        "library": library,
    }
    if author is None:
        return stages.run("indoor", furnish, places, **inside), []
    stages.given(author, author.digest)
    return stages.run("indoor", furnish_drawn, places, author=author, **inside)


def _painted(
    images: Sequence[StreetImage],
    tiles: TileMesh | None,
    built: BuildingsResult,
    world: World,
    how: Texturing,
    stages: Stages,
) -> tuple[list[Surface], list[Surface]]:
    """Make walls and roofs that wear photos where there are any."""
    if tiles is not None:
        # Where street photos may still come, hardly covered faces wait for them.
        least = 0.0 if images else _LEAST_COVERED
        painted = stages.run("bake", painted_from_tiles, built.walls, built.roofs, tiles, texel=how.texel, least=least)
    else:
        painted = stages.run("bake", painted_as_built, built.walls, built.roofs, texel=how.texel)
    if images:
        walls, roofs = painted.surfaces()
        layers = {"ground": world.surfaces("ground"), "buildings": walls, "roofs": roofs}
        seen = World(world.manifest, world.path, layers=layers, objects=world.objects, models=world.prototypes())
        painted, report = stages.run(
            "streetview",
            painted_from_street,
            painted,
            list(images),
            world.height,
            others=world.surfaces("ground"),
            photograph=photographer_of(seen),
            how=how,
        )
        stages.report("streetview", report.counts, report.dropped)
    painted = kept_where_photographed(built.walls, built.roofs, painted, least=_LEAST_COVERED)
    painted = stages.run("enhance", enhanced, painted, how)
    stages.report("texture", painted.counts)
    return painted.surfaces()
