"""The order of the stages: from a map to a world. Each line is one call into a module that knows no other stage."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from vico import __version__
from vico.assets.things import credits_of, our_models, read_things
from vico.errors import EmptyInputError, InputError
from vico.geo.elevation import HeightSamples
from vico.geo.osm import OsmData
from vico.geo.street_images import StreetImage
from vico.geo.tile_mesh import TileMesh
from vico.world.files import sha256_of, write_bytes
from vico.world.folder import World, write_record, write_records, write_terrain
from vico.world.heights import HeightField
from vico.world.lanes import read_lanes
from vico.world.mesh import Surface, write_glb
from vico.world.model import Dropped, Manifest, Origin, Source, Transit
from vico.world.objects import Objects, write_objects
from vico.world.walkable import WalkableMap, write_walkable
from vico.worldgen.buildings.fitting import buildings_on_tiles, settled
from vico.worldgen.buildings.outlines import building_plans
from vico.worldgen.buildings.stage import BuildingsResult, buildings_from_osm
from vico.worldgen.evidence import Evidence
from vico.worldgen.facades.fronts import street_fronts
from vico.worldgen.ground.bridges import pier_feet, portal_feet, portals_of
from vico.worldgen.ground.grading import graded, standing_outlines
from vico.worldgen.ground.stage import ground_from_osm, mapped_areas
from vico.worldgen.ground.terrain import flat_terrain, terrain_from_dem, terrain_from_tiles
from vico.worldgen.ground.walkable import walkable_map
from vico.worldgen.indoor.layout_llm import LlmLayoutAuthor, furnish_drawn
from vico.worldgen.indoor.stage import furnish
from vico.worldgen.objects.stage import objects_from_osm
from vico.worldgen.photos.texturing import (
    Studio,
    Texturing,
    enhanced,
    kept_where_photographed,
    painted_as_built,
    painted_from_street,
    painted_from_tiles,
)
from vico.worldgen.places.stage import places_from_osm
from vico.worldgen.sources import Sources
from vico.worldgen.stages import Stages
from vico.worldgen.streets.netconvert import road_network
from vico.worldgen.streets.roads import closed_roads, roads_from_osm
from vico.worldgen.streets.streets import StreetPolygons, road_polygons
from vico.worldgen.transit.stage import transit_from_osm

# Faces that photos cover less than this share of keep their facade.
_LEAST_COVERED = 0.3
_BARRIER_KINDS = ("fence", "wall", "guard_rail", "hedge")


def make_world(
    given: Evidence,
    *,
    half: float,
    seed: int,
    folder: Path,
    sources: Sources,
    stages: Stages,
    texturing: Texturing,
    studio: Studio | None,
    author: LlmLayoutAuthor | None,
) -> World:
    """Run every stage between the sources and the pictures, and write the world's files into `folder`."""
    stand_ins = read_things()[0] if sources.installed_things else {}
    data, tiles = given.data, given.tiles
    if tiles is not None:
        height, raised = stages.run("terrain", _ground_of_tiles, data, given.samples, tiles, half=half, seed=seed)
        if raised:
            tiles = replace(tiles, positions=tiles.positions + np.array([0.0, 0.0, raised]))
    elif given.samples is None:
        height = stages.run("terrain", flat_terrain, half=half)
    else:
        height = stages.run("terrain", terrain_from_dem, given.samples, half=half)
    # Kerbs lie at the borders of the streets, so both come from the same polygons, and before anything stands on them.
    streets = stages.run("streets", _streets, data, seed=seed)
    height = stages.run("grading", graded, height, data, streets)
    write_terrain(folder / "terrain.npz", height)
    flat = given.samples is None and tiles is None
    stages.report("terrain", {"cells": int(height.heights.shape[0] - 1) ** 2, "flat": int(flat)})

    if tiles is None:
        built = stages.run("buildings", buildings_from_osm, data, height, seed=seed)
    else:
        built, fits = stages.run("buildings", buildings_on_tiles, data, height, tiles, seed=seed)
        stages.report("fit", fits.counts())
    solids = _standing(built, height)
    solids += [*pier_feet(data, height, streets), *portal_feet(portals_of(data, streets))]

    roads = stages.run("roads", roads_from_osm, data, half, solids=solids)
    write_record(folder / "roads.json", roads)
    network = stages.run("network", road_network, data, half, solids=solids)
    write_bytes(folder / "roads.net.xml", network.net_xml)
    write_bytes(folder / "roads.xodr", network.xodr)
    lanes = stages.given(read_lanes(folder / "roads.net.xml"), sha256_of(folder / "roads.net.xml"))
    drivable = [road for road in roads.roads if road.lanes > 0]
    stages.report(
        "roads",
        {
            "roads": len(roads.roads),
            "drivable_roads": len(drivable),
            "junctions": len(roads.junctions),
            "crossings": len(roads.crossings),
            "lanes": len(lanes),
        },
        [
            *([] if len(lanes) else [Dropped(id="roads", reason="no street for traffic in the window")]),
            *closed_roads(roads),
        ],
    )

    transit = stages.run(
        "transit", transit_from_osm, data, lanes, height, half=half, solids=solids, seed=seed, feeds=list(given.feeds)
    )
    transit = _off_the_road(transit, streets, height)
    write_record(folder / "transit.json", transit)
    stages.report(
        "transit",
        {"stops": len(transit.stops), "lines": len(transit.lines), "bike_stations": len(transit.bike_stations)},
        transit.left_out,
    )

    footways = _footways(streets)
    outdoors, dropped = stages.run(
        "objects",
        objects_from_osm,
        data,
        solids=solids,
        carriageway=streets.carriageway,
        openings=footways,
        height=height,
        transit=transit,
        half=half,
        seed=seed,
        lanes=lanes,
    )
    barrier = np.isin(outdoors.kind, _BARRIER_KINDS)
    object_counts = {
        "amenity_objects": int(((outdoors.group == "amenity") & ~barrier).sum()),
        "natural_objects": int(((outdoors.group == "natural") & ~barrier).sum()),
        "barrier_pieces": int(barrier.sum()),
        "kinds": len(np.unique(outdoors.kind)),
    }
    stages.report("objects", object_counts, dropped)

    walkable = stages.run("walkable", _walkable, data, half, solids, streets, footways, outdoors)
    write_walkable(folder / "walkable.npz", walkable)
    free = int((walkable.cls > 0).sum())
    stages.report("walkable", {"free_cells": free, "connected_cells": int(walkable.connected.sum())})

    places, entrances, dropped = stages.run(
        "places",
        places_from_osm,
        data,
        buildings=built.records,
        walkable=walkable,
        height=height,
        roads=roads,
        transit=transit,
        found=list(given.found),
    )
    open_ids = {entrance.building for entrance in entrances}
    buildings = [b.model_copy(update={"accessible": b.id in open_ids}) for b in built.records]
    write_records(folder / "buildings.json", buildings)
    write_records(folder / "entrances.json", entrances)
    stages.report(
        "buildings",
        {
            "buildings": len(buildings),
            "accessible_buildings": len(open_ids),
            "watertight_buildings": built.watertight,
            "collision_faces": built.collision_faces,
        },
        built.dropped,
    )
    stages.report("places", {"places": len(places), "entrances": len(entrances)}, dropped)

    if sources.layouts is not None:
        files = sorted(sources.layouts.glob("*.json"))
        stages.given(sources.layouts, " ".join(f"{path.name} {sha256_of(path)}" for path in files))
    inside = {
        "buildings": buildings,
        "height": height,
        "seed": seed,
        "entrances": entrances,
        "library": sources.layouts,
    }
    undrawn: list[Dropped] = []
    if author is None:
        indoors = stages.run("indoor", furnish, places, **inside)
    else:
        stages.given(author, author.digest)
        indoors, undrawn = stages.run("indoor", furnish_drawn, places, author=author, **inside)
    write_records(folder / "places.json", indoors.places)
    write_records(folder / "rooms.json", indoors.rooms)
    objects = Objects.joined([outdoors, indoors.furniture])
    write_objects(folder / "objects.parquet", objects)
    counts = {"rooms": len(indoors.rooms), "indoor_objects": len(indoors.furniture)}
    stages.report("indoor", counts, undrawn)

    ground = stages.run("ground", ground_from_osm, data, height, half, streets, standing=solids)
    stages.report("ground", {"faces": _faces(ground)})
    fronts = street_fronts(indoors.places, entrances, buildings, built.walls, seed=seed)
    stages.report("fronts", fronts.counts)
    models, credits = _models(objects, stand_ins)
    parts: dict[str, Any] = {
        "height": height,
        "buildings": buildings,
        "places": indoors.places,
        "entrances": entrances,
        "rooms": indoors.rooms,
        "objects": objects,
        "roads": roads,
        "transit": transit,
        "walkable": walkable,
        "lanes": lanes,
        "models": models,
    }
    manifest = Manifest(
        producer=f"vico {__version__}",
        name=sources.osm.name.removesuffix(".pbf").removesuffix(".osm"),
        origin=Origin(lat=data.frame.lat, lon=data.frame.lon),
        half=half,
        bbox=tuple(round(v, 7) for v in data.frame.bbox(half)),
        seed=seed,
        sources=[*given.credits, *credits],
        stages=[],
        counts={},
        places_by_type={},
        files={},
    )
    layers = {
        "ground": ground,
        "buildings": [*built.walls, *fronts.surfaces],
        "roofs": built.roofs,
        "rooms": indoors.surfaces,
        "collision": built.collision,
    }
    if tiles is not None or given.images:
        seen = World(manifest, folder, layers=layers, **parts)
        walls, roofs = _painted(given.images, tiles, built, seen, texturing=texturing, stages=stages, studio=studio)
        layers |= {"buildings": [*walls, *fronts.surfaces], "roofs": roofs}
    with stages.timed("write"):
        _write_meshes(folder, layers, len(fronts.surfaces), models)
    stages.report("write", {name: _faces(surfaces) for name, surfaces in layers.items()})

    counts = {
        "buildings": len(buildings),
        "accessible_buildings": len(open_ids),
        "watertight_buildings": built.watertight,
        "collision_faces": built.collision_faces,
        "places": len(indoors.places),
        "entrances": len(entrances),
        "rooms": len(indoors.rooms),
        "roads": len(drivable),
        "walkways": len(roads.roads) - len(drivable),
        "junctions": len(roads.junctions),
        "crossings": len(roads.crossings),
        **object_counts,
        "indoor_objects": len(indoors.furniture),
        "transit": len(transit.stops) + len(transit.lines) + len(transit.bike_stations),
    }
    by_type = dict.fromkeys(sorted({p.category.value for p in indoors.places}), 0)
    for place in indoors.places:
        by_type[place.category.value] += 1
    manifest = manifest.model_copy(update={"counts": counts, "places_by_type": by_type})
    return World(manifest, folder, layers=layers, **parts)


def _ground_of_tiles(
    data: OsmData, samples: HeightSamples | None, mesh: TileMesh, *, half: float, seed: int
) -> tuple[HeightField, float]:
    """The ground, and by how much the tile mesh has to be raised to stand on it.

    An elevation file that is given goes before the mesh's own ground; a mesh of buildings alone has none.
    """
    if samples is None:
        try:
            return terrain_from_tiles(mesh, data, half=half)[0], 0.0
        except EmptyInputError:
            height = flat_terrain(half=half)
    else:
        height = terrain_from_dem(samples, half=half)
    plans, _ = building_plans(data, seed=seed)
    return height, settled(mesh, plans, height)[1]


def _painted(
    images: Sequence[StreetImage],
    tiles: TileMesh | None,
    built: BuildingsResult,
    world: World,
    *,
    texturing: Texturing,
    stages: Stages,
    studio: Studio | None,
) -> tuple[list[Surface], list[Surface]]:
    """Walls and roofs that wear photos where there are any."""
    if tiles is not None:
        # Where street photos may still come, hardly covered faces wait for them.
        least = 0.0 if images else _LEAST_COVERED
        painted = stages.run(
            "bake", painted_from_tiles, built.walls, built.roofs, tiles, texel=texturing.texel, least=least
        )
    else:
        painted = stages.run("bake", painted_as_built, built.walls, built.roofs, texel=texturing.texel)
    if images and studio is None:
        raise InputError("photos: nobody is here to render what they are matched with; pass a studio")
    if images and studio is not None:
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
            photograph=studio(seen),
        )
        stages.report("streetview", report.counts, report.dropped)
    painted = kept_where_photographed(built.walls, built.roofs, painted, least=_LEAST_COVERED)
    painted = stages.run("enhance", enhanced, painted, texturing)
    stages.report("texture", painted.counts)
    return painted.surfaces()


def _streets(data: OsmData, *, seed: int) -> StreetPolygons:
    return road_polygons(data, standing_outlines(data, seed=seed))


def _standing(built: BuildingsResult, height: HeightField) -> list[BaseGeometry]:
    """What of the buildings stands in people's way: convex pieces that begin lower than a person is tall."""
    solids: list[BaseGeometry] = []
    for body in built.collision:
        points = np.asarray(body.positions, np.float64)
        ring = points[: len(points) // 2]
        if float(ring[0, 2]) < float(height(ring[:, :2]).max()) + 2.2:
            solids.append(shapely.Polygon(ring[:, :2]))
    return solids


def _off_the_road(transit: Transit, streets: StreetPolygons, height: HeightField) -> Transit:
    """Move waiting places from the carriageway to the pavement within 5 m: streets may be wider than their lanes."""
    pavement = shapely.buffer(shapely.union_all([streets.sidewalk, streets.pedestrian]), -0.7)
    if pavement.is_empty:
        return transit
    shapely.prepare(streets.carriageway)
    stops = []
    for stop in transit.stops:
        here = shapely.Point(stop.wait[:2])
        if streets.carriageway.contains(here):
            x, y = shapely.shortest_line(here, pavement).coords[-1]
            if here.distance(shapely.Point(x, y)) <= 5.0:
                wait = (round(x, 3), round(y, 3), round(float(height((x, y))), 3))
                stop = stop.model_copy(update={"wait": wait})
        stops.append(stop)
    return transit.model_copy(update={"stops": stops})


def _footways(streets: StreetPolygons) -> BaseGeometry:
    """Where walkers walk."""
    return shapely.union_all(
        [streets.sidewalk, streets.pedestrian, streets.path, streets.steps, streets.cycleway, streets.crossing]
    )


def _walkable(
    data: OsmData,
    half: float,
    solids: list[BaseGeometry],
    streets: StreetPolygons,
    footways: BaseGeometry,
    objects: Objects,
) -> WalkableMap:
    ground = mapped_areas(data, shapely.box(-half, -half, half, half))
    return walkable_map(
        half=half,
        solids=solids,
        roadway=shapely.union_all([streets.carriageway, streets.parking, *ground["ballast"]]),
        sidewalk=footways,
        crossing=streets.crossing,
        water=shapely.union_all(ground["water"]),
        objects=objects,
    )


def _faces(surfaces: Iterable[Surface]) -> int:
    return sum(len(surface.triangles) for surface in surfaces)


def _models(
    objects: Objects, stand_ins: Mapping[str, Sequence[Surface]]
) -> tuple[dict[str, Sequence[Surface]], list[Source]]:
    """The models of what stands in the world, and whom to thank for those that are not ours."""
    used = set(objects.prototype.tolist())
    models: dict[str, Sequence[Surface]] = {
        name: list(stand_ins.get(name, model.surfaces)) for name, model in our_models().items() if name in used
    }
    foreign = [name for name in models if name in stand_ins]
    credits = [
        Source(kind="things", name=c.collection, licence=c.licence, attribution=c.words, sha256=read_things()[2])
        for c in (credits_of(foreign) if foreign else ())
    ]
    return models, credits


def _write_meshes(
    folder: Path, layers: dict[str, list[Surface]], fronts: int, models: dict[str, Sequence[Surface]]
) -> None:
    """Write the layers; the last `fronts` of the buildings' surfaces stand before their walls."""
    meshes = folder / "meshes"
    buildings = layers["buildings"]
    walls, doors = buildings[: len(buildings) - fronts], buildings[len(buildings) - fronts :]
    write_glb(meshes / "ground.glb", {"ground": layers["ground"]})
    write_glb(meshes / "buildings.glb", {"walls": walls, "doors": doors})
    write_glb(meshes / "roofs.glb", {"roofs": layers["roofs"]})
    write_glb(meshes / "rooms.glb", {"rooms": layers["rooms"]})
    write_glb(meshes / "collision.glb", {f"part_{k}": [body] for k, body in enumerate(layers["collision"])})
    write_glb(meshes / "prototypes.glb", models)
