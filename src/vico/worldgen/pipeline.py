"""The build of a world: stage after stage into a neighbour folder, which takes its final name when it is whole."""

from __future__ import annotations

import math
import os
import shutil
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import osmium
import shapely
from PIL import Image
from shapely.geometry.base import BaseGeometry

from vico import __version__
from vico.assets.furniture import furniture_models
from vico.assets.street import street_models
from vico.errors import InputError, OutputExistsError, SchemaError
from vico.geo.elevation import HeightSamples, read_elevation
from vico.geo.frame import LocalFrame
from vico.geo.osm import OsmData, checked_extract, read_osm
from vico.world.files import sha256_of, write_bytes
from vico.world.folder import World, seal, write_record, write_records, write_terrain
from vico.world.heights import HeightField
from vico.world.lanes import read_lanes
from vico.world.mesh import Surface, write_glb
from vico.world.model import Dropped, Manifest, Origin, Source, StageReport, Transit
from vico.world.objects import Objects, write_objects
from vico.world.walkable import WalkableMap, write_walkable
from vico.worldgen.buildings import BuildingsResult, buildings_from_osm
from vico.worldgen.facades import door_surfaces
from vico.worldgen.ground import ground_from_osm, mapped_areas
from vico.worldgen.indoor import Indoors, furnish
from vico.worldgen.netconvert import road_network
from vico.worldgen.objects import objects_from_osm
from vico.worldgen.places import places_from_osm
from vico.worldgen.previews import Photograph, map_picture, viewpoints
from vico.worldgen.roads import roads_from_osm
from vico.worldgen.streets import StreetPolygons, road_polygons
from vico.worldgen.terrain import flat_terrain, terrain_from_dem
from vico.worldgen.transit import transit_from_osm
from vico.worldgen.walkable import walkable_map

Progress = Callable[[str, int, int], None]

_BARRIER_KINDS = ("fence", "wall", "guard_rail", "hedge")
_LEAST_RADIUS, _MOST_RADIUS = 50.0, 2000.0


class _Build:
    """Times the stages, reports them, and says how far the build is."""

    def __init__(self, progress: Progress | None) -> None:
        self.seconds: dict[str, float] = {}
        self.reports: list[StageReport] = []
        self._progress = progress

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Run a stage."""
        if self._progress is not None:
            self._progress(name, 0, 1)
        start = time.perf_counter()
        yield
        self.seconds[name] = time.perf_counter() - start
        if self._progress is not None:
            self._progress(name, 1, 1)

    def report(self, name: str, counts: dict[str, int], dropped: Iterable[Dropped] = ()) -> None:
        """Record what a stage made and left out."""
        self.reports.append(StageReport(name=name, counts=counts, dropped=list(dropped)))


def extract_centre(path: Path) -> tuple[float, float]:
    """Latitude and longitude of the middle of an OSM extract: of its stated bounds, else of its nodes.

    Raises
    ------
    MissingFileError, SchemaError
        If there is no such file, or it is broken or empty.
    """
    checked_extract(path)
    try:
        box = osmium.io.Reader(str(path)).header().box()
        if not box.valid():
            box = osmium.osm.Box()
            for node in osmium.FileProcessor(str(path), osmium.osm.NODE):
                box.extend(node.location)
    except RuntimeError as error:
        raise SchemaError(f"{path}: truncated or broken ({error}); download it again, or clip it anew") from None
    if not box.valid():
        raise SchemaError(f"{path}: holds no points; download it again, or clip it anew")
    return (
        (box.bottom_left.lat + box.top_right.lat) / 2,
        (box.bottom_left.lon + box.top_right.lon) / 2,
    )


def build_world(
    osm: Path,
    *,
    lat: float,
    lon: float,
    half: float = 400.0,
    dem: Path | None = None,
    seed: int = 0,
    out: Path,
    force: bool = False,
    progress: Progress | None = None,
    photograph: Photograph | None = None,
) -> Manifest:
    """Build a world folder from an OpenStreetMap extract.

    Parameters
    ----------
    osm
        The extract, ``.osm`` or ``.osm.pbf``.
    lat, lon
        The window's centre, degrees.
    half
        Half the window's side, metres.
    dem
        Elevation file; flat ground without.
    seed
        Decides what the map leaves open.
    out
        Folder to make. Until it is whole the files lie in ``<out>.partial``, which a new build replaces.
    force
        Replace what is at `out`.
    progress
        Called with a stage's name, how much of it is done, and how much there is.
    photograph
        Takes the street-level pictures; none are made without.

    Returns
    -------
    Manifest
        What was built.

    Raises
    ------
    OutputExistsError
        If `out` holds something and `force` is false.
    InputError, MissingFileError, SchemaError, EmptyInputError, MissingExtraError
        If the input can't be used; each says how to mend it.
    """
    out = Path(out)
    if not (math.isfinite(half) and _LEAST_RADIUS <= half <= _MOST_RADIUS):
        raise InputError(f"radius: {half:g} m; it must lie within {_LEAST_RADIUS:g}..{_MOST_RADIUS:g} m")
    if seed < 0:
        raise InputError(f"seed: {seed}; it must not be negative")
    if out.exists() and not force and (not out.is_dir() or any(out.iterdir())):
        raise OutputExistsError(f"{out}: exists already; choose another folder, or add --force to replace it")
    half = math.ceil(half * 2) / 2  # a whole number of cells
    frame = LocalFrame(lat, lon)
    build = _Build(progress)
    with build.stage("map"):
        data = read_osm(Path(osm), frame, half)
        samples = read_elevation(dem, frame, half) if dem is not None else None
    build.report(
        "map",
        {"nodes": len(data.nodes), "ways": len(data.ways), "areas": len(data.areas)},
        [Dropped(id=key, reason=reason) for key, reason in data.broken],
    )
    folder = out.with_name(f"{out.name}.partial")
    if folder.exists():
        shutil.rmtree(folder)
    folder.mkdir(parents=True)
    world = _stages(data, samples, half, seed, folder, build, Path(osm))
    with build.stage("previews"):
        counts = _pictures(world, folder, photograph)
    build.report("previews", counts)
    manifest = seal(folder, world.manifest.model_copy(update={"stages": build.reports}), seconds=build.seconds)
    _rename(folder, out)
    return manifest


def _rename(folder: Path, out: Path) -> None:
    """Put the finished folder in its place; what was there goes once the new one is whole."""
    old = None
    if out.exists():
        old = out.with_name(f".{out.name}.old-{os.getpid()}")
        os.replace(out, old)
    os.replace(folder, out)
    if old is not None:
        if old.is_dir():
            shutil.rmtree(old)
        else:
            old.unlink()


def _stages(
    data: OsmData,
    samples: HeightSamples | None,
    half: float,
    seed: int,
    folder: Path,
    build: _Build,
    osm: Path,
) -> World:
    with build.stage("terrain"):
        height = flat_terrain(half=half) if samples is None else terrain_from_dem(samples, half=half)
        write_terrain(folder / "terrain.npz", height)
    build.report("terrain", {"cells": int(height.heights.shape[0] - 1) ** 2, "flat": int(samples is None)})
    with build.stage("buildings"):
        built = buildings_from_osm(data, height, seed=seed)
        solids = _standing(built, height)
        streets = road_polygons(data, solids)
    with build.stage("roads"):
        roads = roads_from_osm(data, half)
        write_record(folder / "roads.json", roads)
        network = road_network(data, half)
        write_bytes(folder / "roads.net.xml", network.net_xml)
        write_bytes(folder / "roads.xodr", network.xodr)
        lanes = read_lanes(folder / "roads.net.xml")
    drivable = [road for road in roads.roads if road.lanes > 0]
    build.report(
        "roads",
        {
            "roads": len(roads.roads),
            "drivable_roads": len(drivable),
            "junctions": len(roads.junctions),
            "crossings": len(roads.crossings),
            "lanes": len(lanes),
        },
    )
    with build.stage("transit"):
        transit = transit_from_osm(data, lanes, height, half=half, solids=solids, seed=seed)
        transit = _off_the_road(transit, streets, height)
        write_record(folder / "transit.json", transit)
    build.report(
        "transit",
        {"stops": len(transit.stops), "lines": len(transit.lines), "bike_stations": len(transit.bike_stations)},
    )
    with build.stage("objects"):
        footways = _footways(streets)
        outdoors, dropped = objects_from_osm(
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
    build.report("objects", object_counts, dropped)
    with build.stage("walkable"):
        walkable = _walkable(data, half, solids, streets, footways, outdoors)
        write_walkable(folder / "walkable.npz", walkable)
    free = int((walkable.cls > 0).sum())
    build.report("walkable", {"free_cells": free, "connected_cells": int(walkable.connected.sum())})
    with build.stage("places"):
        places, entrances, dropped = places_from_osm(
            data, buildings=built.records, walkable=walkable, height=height, roads=roads, transit=transit
        )
        open_ids = {entrance.building for entrance in entrances}
        buildings = [b.model_copy(update={"accessible": b.id in open_ids}) for b in built.records]
        write_records(folder / "buildings.json", buildings)
        write_records(folder / "entrances.json", entrances)
    build.report(
        "buildings",
        {
            "buildings": len(buildings),
            "accessible_buildings": len(open_ids),
            "watertight_buildings": built.watertight,
            "collision_faces": built.collision_faces,
        },
        built.dropped,
    )
    build.report("places", {"places": len(places), "entrances": len(entrances)}, dropped)
    with build.stage("indoor"):
        indoors = furnish(places, buildings=buildings, height=height, seed=seed)
        write_records(folder / "places.json", indoors.places)
        write_records(folder / "rooms.json", indoors.rooms)
        objects = Objects.joined([outdoors, indoors.furniture])
        write_objects(folder / "objects.parquet", objects)
    build.report("indoor", {"rooms": len(indoors.rooms), "indoor_objects": len(indoors.furniture)})
    with build.stage("ground"):
        ground = ground_from_osm(data, height, half, streets)
    build.report("ground", {"faces": _faces(ground)})
    doors = door_surfaces(entrances, buildings)
    with build.stage("write"):
        layers, models = _write_meshes(folder, built, doors, ground, indoors, objects)
    build.report("write", {name: _faces(surfaces) for name, surfaces in layers.items()})
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
        name=osm.name.removesuffix(".pbf").removesuffix(".osm"),
        origin=Origin(lat=data.frame.lat, lon=data.frame.lon),
        half=half,
        bbox=tuple(round(v, 7) for v in data.frame.bbox(half)),
        seed=seed,
        sources=_sources(data, samples, osm),
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
        sources.append(
            Source(
                kind="elevation",
                name=samples.name,
                licence="as its provider states",
                attribution=samples.name,
                sha256=samples.sha256,
            )
        )
    return sources


def _pictures(world: World, folder: Path, photograph: Photograph | None) -> dict[str, int]:
    """The map, and street-level views if there is somebody to take them."""
    picture = map_picture(world)
    picture.save(folder / "map.png")
    if photograph is None:
        return {"maps": 1, "views": 0}
    views = viewpoints(world, count=8)
    (folder / "previews").mkdir(exist_ok=True)
    for k, frame in enumerate(photograph(world, views)):
        Image.fromarray(frame).save(folder / "previews" / f"view_{k}.png")
    return {"maps": 1, "views": len(views)}
