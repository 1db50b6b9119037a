"""The order of the stages: from a map to a world. Each line is one call into a module that knows no other stage."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from vico import __version__
from vico.assets.furniture import furniture_models
from vico.assets.street import street_models
from vico.geo.elevation import HeightSamples
from vico.geo.osm import OsmData
from vico.world.files import sha256_of, write_bytes
from vico.world.folder import World, write_record, write_records, write_terrain
from vico.world.heights import HeightField
from vico.world.lanes import read_lanes
from vico.world.mesh import Surface, write_glb
from vico.world.model import Manifest, Origin, Source, Transit
from vico.world.objects import Objects, write_objects
from vico.world.walkable import WalkableMap, write_walkable
from vico.worldgen.bridges import pier_feet, portal_feet, portals_of
from vico.worldgen.buildings import BuildingsResult, buildings_from_osm
from vico.worldgen.facade_fronts import street_fronts
from vico.worldgen.grading import graded, standing_outlines
from vico.worldgen.ground import ground_from_osm, mapped_areas
from vico.worldgen.indoor import Indoors, furnish
from vico.worldgen.netconvert import road_network
from vico.worldgen.objects import objects_from_osm
from vico.worldgen.places import places_from_osm
from vico.worldgen.roads import roads_from_osm
from vico.worldgen.sources import Sources
from vico.worldgen.stages import Stages
from vico.worldgen.streets import StreetPolygons, road_polygons
from vico.worldgen.terrain import flat_terrain, terrain_from_dem
from vico.worldgen.transit import transit_from_osm
from vico.worldgen.walkable import walkable_map

_BARRIER_KINDS = ("fence", "wall", "guard_rail", "hedge")


def make_world(
    data: OsmData,
    samples: HeightSamples | None,
    *,
    half: float,
    seed: int,
    folder: Path,
    sources: Sources,
    stages: Stages,
) -> World:
    """Run every stage between the map and the pictures, and write the world's files into `folder`."""
    if samples is None:
        height = stages.run("terrain", flat_terrain, half=half)
    else:
        height = stages.run("terrain", terrain_from_dem, samples, half=half)
    # Kerbs lie at the borders of the streets, so both come from the same polygons, and before anything stands on them.
    streets = stages.run("streets", _streets, data, seed=seed)
    height = stages.run("grading", graded, height, data, streets)
    write_terrain(folder / "terrain.npz", height)
    stages.report("terrain", {"cells": int(height.heights.shape[0] - 1) ** 2, "flat": int(samples is None)})

    built = stages.run("buildings", buildings_from_osm, data, height, seed=seed)
    solids = _standing(built, height)
    solids += [*pier_feet(data, height, streets), *portal_feet(portals_of(data, streets))]

    roads = stages.run("roads", roads_from_osm, data, half)
    write_record(folder / "roads.json", roads)
    network = stages.run("network", road_network, data, half)
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
    )

    transit = stages.run("transit", transit_from_osm, data, lanes, height, half=half, solids=solids, seed=seed)
    transit = _off_the_road(transit, streets, height)
    write_record(folder / "transit.json", transit)
    stages.report(
        "transit",
        {"stops": len(transit.stops), "lines": len(transit.lines), "bike_stations": len(transit.bike_stations)},
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

    indoors = stages.run("indoor", furnish, places, buildings=buildings, height=height, seed=seed)
    write_records(folder / "places.json", indoors.places)
    write_records(folder / "rooms.json", indoors.rooms)
    objects = Objects.joined([outdoors, indoors.furniture])
    write_objects(folder / "objects.parquet", objects)
    stages.report("indoor", {"rooms": len(indoors.rooms), "indoor_objects": len(indoors.furniture)})

    ground = stages.run("ground", ground_from_osm, data, height, half, streets)
    stages.report("ground", {"faces": _faces(ground)})
    fronts = street_fronts(indoors.places, entrances, buildings, built.walls, seed=seed)
    doors = fronts.surfaces
    stages.report("fronts", fronts.counts)
    with stages.timed("write"):
        layers, models = _write_meshes(folder, built, doors, ground, indoors, objects)
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
    manifest = Manifest(
        producer=f"vico {__version__}",
        name=sources.osm.name.removesuffix(".pbf").removesuffix(".osm"),
        origin=Origin(lat=data.frame.lat, lon=data.frame.lon),
        half=half,
        bbox=tuple(round(v, 7) for v in data.frame.bbox(half)),
        seed=seed,
        sources=_sources(data, samples, sources.osm),
        stages=[],
        counts=counts,
        places_by_type=by_type,
        files={},
    )
    return World(
        manifest,
        folder,
        height=height,
        buildings=buildings,
        places=indoors.places,
        entrances=entrances,
        rooms=indoors.rooms,
        objects=objects,
        roads=roads,
        transit=transit,
        walkable=walkable,
        lanes=lanes,
        layers=layers,
        models=models,
    )


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


def _write_meshes(
    folder: Path,
    built: BuildingsResult,
    doors: list[Surface],
    ground: list[Surface],
    indoors: Indoors,
    objects: Objects,
) -> tuple[dict[str, list[Surface]], dict[str, Sequence[Surface]]]:
    meshes = folder / "meshes"
    write_glb(meshes / "ground.glb", {"ground": ground})
    write_glb(meshes / "buildings.glb", {"walls": built.walls, "doors": doors})
    write_glb(meshes / "roofs.glb", {"roofs": built.roofs})
    write_glb(meshes / "rooms.glb", {"rooms": indoors.surfaces})
    write_glb(meshes / "collision.glb", {f"part_{k}": [body] for k, body in enumerate(built.collision)})
    used = set(objects.prototype.tolist())
    models: dict[str, Sequence[Surface]] = {
        name: list(model.surfaces) for name, model in {**street_models(), **furniture_models()}.items() if name in used
    }
    write_glb(meshes / "prototypes.glb", models)
    layers = {
        "ground": ground,
        "buildings": [*built.walls, *doors],
        "roofs": built.roofs,
        "rooms": indoors.surfaces,
        "collision": built.collision,
    }
    return layers, models


def _sources(data: OsmData, samples: HeightSamples | None, osm: Path) -> list[Source]:
    sources = [
        Source(
            kind="map",
            name=osm.name,
            licence="ODbL-1.0",
            attribution="© OpenStreetMap contributors",
            timestamp=data.timestamp,
            sha256=data.sha256 or sha256_of(osm),
        )
    ]
    if samples is not None:
        sources += [
            Source(kind="elevation", name=name, licence="as its provider states", attribution=name, sha256=digest)
            for name, digest, _ in samples.files
        ]
    return sources
