"""The order of the stages: from a map to a world. Each is one call into a folder that knows no other stage."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from vico.assets.furniture_pack import read_things
from vico.geo.osm import OsmData
from vico.geo.street_images import StreetImage
from vico.geo.tiles3d import TileMesh
from vico.io.files import sha256_of
from vico.world.heights import HeightField
from vico.world.lanes import LaneGraph
from vico.world.mesh import Surface
from vico.world.model import Building, Dropped, Entrance, Place, Roads
from vico.world.objects import Objects
from vico.world.transit import Transit
from vico.world.world import FILE, World, write_records
from vico.worldgen.background_stages import BackgroundStages
from vico.worldgen.buildings.stage import Cladding
from vico.worldgen.construction import Shape, build_shape, find_yards, make_cladding, make_ground, plan_site
from vico.worldgen.evidence import Evidence, opening_hours_notes
from vico.worldgen.facades.fronts import street_fronts
from vico.worldgen.facades.street_names import Streets
from vico.worldgen.facts.street_habits import street_habits
from vico.worldgen.ground.walkable import walkable_from_site
from vico.worldgen.indoor.layout_llm import furnish_drawn
from vico.worldgen.indoor.stage import Indoors, furnish
from vico.worldgen.objects.detections import things_from_detections
from vico.worldgen.objects.parking import parking_from_osm
from vico.worldgen.objects.stage import Surroundings, models_of, objects_from_osm
from vico.worldgen.photos.streetview.reprojection import photographer_of
from vico.worldgen.photos.texturing import (
    Texturing,
    enhance,
    keep_photographed_faces,
    paint_as_built,
    paint_from_street,
    paint_from_tiles,
)
from vico.worldgen.places.stage import places_from_osm
from vico.worldgen.request import WorldRequest
from vico.worldgen.seams.joins import CUT, TilePlace
from vico.worldgen.stages import Stages, load_product
from vico.worldgen.streets.lane_shapes import CarriagewayEdges
from vico.worldgen.streets.netconvert import road_network
from vico.worldgen.streets.roads import roads_from_osm, streets_from_osm
from vico.worldgen.transit.stage import transit_from_osm
from vico.worldgen.transit.waiting import waiting_places
from vico.worldgen.world_writer import Layers, WorldParts, WorldWriter, faces, manifest_of

# Faces that photos cover less than this share of keep their facade.
_LEAST_COVERED = 0.3


def make_world(
    evidence: Evidence, request: WorldRequest, folder: Path, stages: Stages, ahead: BackgroundStages
) -> World:
    """Run every stage between the sources and the pictures, and write the world's files into `folder`."""
    if request.sources.installed_things:
        read_things()  # refuses before anything is built if they are not installed
    seed, run, write = request.seed, stages.run, WorldWriter(folder, stages)

    shape = build_shape(plan_site(evidence, request, stages), request, stages)
    evidence, site, tiles, streets, height = (
        shape.plan.evidence, shape.plan.site, shape.plan.tiles, shape.plan.streets, shape.plan.height,
    )  # fmt: skip
    bridges, levels, built, solids = shape.bridges, shape.levels, shape.built, shape.solids
    if not stages.kept:  # else much of what is to come is likely to be kept too
        ahead.start(len(built.records))
    ahead.make("cladding", stages)
    write.terrain(levels, flat=evidence.samples is None and tiles is None)
    roads, lanes, transit = (
        _make_streets(shape, request, stages, write)
        if request.place is None
        else _cut_streets(request.place, stages, write)
    )

    yards = find_yards(shape, request, stages)
    outdoors, dropped = run(
        "objects",
        objects_from_osm,
        _with_detections(site.osm, evidence, height, seed, folder, stages),
        Surroundings([*solids, *bridges.cuts], streets.carriageway, streets.footways(), yards.green(), yards.mapped),
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
    outdoors = stages.register_value(Objects.joined([outdoors, parking.cars]))
    write.outdoors(outdoors, dropped)
    walkable = run("walkable", walkable_from_site, site, streets, [*solids, *bridges.low, *bridges.cuts], outdoors)
    write.walkable(walkable)
    trees = outdoors.position[outdoors.kind == "tree", :2]
    ahead.make("ground", stages, trees=trees.tolist())

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
    if (typed := opening_hours_notes(places))[1]:
        stages.report("opening hours", *typed)
    indoors, undrawn = _furnish(places, entrances, buildings, height, request, stages)
    write.indoors(indoors, undrawn)
    objects = write.objects(outdoors, indoors)

    ground = make_ground(shape, yards, trees, request, stages)
    stages.report("ground", {"faces": faces(ground)})
    cladding = make_cladding(shape, request, stages)
    with stages.timer("fronts"):
        names = Streets(roads, outdoors, levels, street_habits(site.osm).plates)
        fronts = street_fronts(indoors.places, entrances, buildings, cladding.walls, seed=seed, streets=names)
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
    layers = Layers(ground, cladding.walls, fronts.surfaces, cladding.roofs, indoors.surfaces, built.collision)
    manifest = manifest_of(request, evidence, parts, stages, credits)
    if tiles is not None or evidence.images:
        seen = parts.world(manifest, folder, layers)
        walls, roofs = _paint_photos(evidence.images, tiles, cladding, seen, request.texturing, stages)
        layers = replace(layers, walls=walls, roofs=roofs)
    write.meshes(layers, models)
    return parts.world(manifest, folder, layers)


def _make_streets(
    shape: Shape, request: WorldRequest, stages: Stages, write: WorldWriter
) -> tuple[Roads, LaneGraph, Transit]:
    """Make the streets of a world by itself: what is driven and walked on, and public transport."""
    run, plan = stages.run, shape.plan
    ways = run("ways", streets_from_osm, plan.site, shape.solids, shape.bridges.open_ways)
    roads = run("roads", roads_from_osm, plan.site, ways)
    kerbs = CarriagewayEdges(plan.streets.carriageway, shape.solids)
    lanes = write.streets(roads, run("network", road_network, plan.site, ways, shape.levels, kerbs))
    feeds = list(plan.evidence.feeds)
    about = {"solids": shape.solids, "seed": request.seed, "feeds": feeds}
    mapped = run("transit", transit_from_osm, plan.site, lanes, shape.levels, **about)
    with stages.timer("waiting"):
        transit = waiting_places(mapped, plan.streets, lanes, plan.height, shape.solids)
    write.transit(transit)
    return roads, lanes, transit


def _cut_streets(place: TilePlace, stages: Stages, write: WorldWriter) -> tuple[Roads, LaneGraph, Transit]:
    """Take the streets of a tile from those of its city."""
    cut, digest = load_product(place.own, CUT)
    stages.register(cut.roads, f"roads {digest}")
    stages.register(cut.transit, f"transit {digest}")
    lanes = write.streets(cut.roads, cut.network)
    write.transit(cut.transit)
    return cut.roads, lanes, cut.transit


def _with_detections(
    osm: OsmData, evidence: Evidence, height: HeightField, seed: int, folder: Path, stages: Stages
) -> OsmData:
    """Return the map with what detections show beside it, and write what became of each; the map itself without."""
    if evidence.detections is None:
        return osm
    things = stages.run("detections", things_from_detections, osm, evidence.detections, height, seed=seed)
    write_records(folder / FILE, things.records)
    stages.report("detections", things.counts(), things.dropped)
    return stages.register(things.on(osm), f"{stages.digest(osm)} {stages.digest(things)}")


def _furnish(
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
        stages.register(library, " ".join(f"{path.name} {sha256_of(path)}" for path in files))
    inside = {
        "buildings": buildings,
        "height": height,
        "seed": request.seed,
        "entrances": entrances,
        "library": library,
    }
    if author is None:
        return stages.run("indoor", furnish, places, **inside), []
    stages.register(author, author.digest)
    return stages.run("indoor", furnish_drawn, places, author=author, **inside)


def _paint_photos(
    images: Sequence[StreetImage],
    tiles: TileMesh | None,
    cladding: Cladding,
    world: World,
    how: Texturing,
    stages: Stages,
) -> tuple[list[Surface], list[Surface]]:
    """Make walls and roofs that wear photos where there are any."""
    if tiles is not None:
        # Where street photos may still come, hardly covered faces wait for them.
        least = 0.0 if images else _LEAST_COVERED
        painted = stages.run(
            "bake", paint_from_tiles, cladding.walls, cladding.roofs, tiles, texel=how.texel, least=least
        )
    else:
        painted = stages.run("bake", paint_as_built, cladding.walls, cladding.roofs, texel=how.texel)
    if images:
        walls, roofs = painted.surfaces()
        layers = {"ground": world.surfaces("ground"), "buildings": walls, "roofs": roofs}
        seen = World(world.manifest, world.path, layers=layers, objects=world.objects, models=world.prototypes())
        painted, report = stages.run(
            "streetview",
            paint_from_street,
            painted,
            list(images),
            world.height,
            others=world.surfaces("ground"),
            photograph=photographer_of(seen),
            how=how,
        )
        stages.report("streetview", report.counts, report.dropped)
    painted = keep_photographed_faces(cladding.walls, cladding.roofs, painted, least=_LEAST_COVERED)
    painted = stages.run("enhance", enhance, painted, how)
    stages.report("texture", painted.counts)
    return painted.surfaces()
