"""Products of stages, written into the world's folder and reported."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from vico.io.files import sha256_of, write_bytes
from vico.version import __version__
from vico.world.glb import write_glb
from vico.world.heights import HeightField
from vico.world.lanes import LaneGraph, read_lanes
from vico.world.mesh import Surface
from vico.world.model import (
    FLAT_GROUND,
    Building,
    Dropped,
    Entrance,
    Manifest,
    Origin,
    ParkingSpot,
    Place,
    Road,
    Roads,
    Room,
    Source,
)
from vico.world.objects import Objects, write_objects
from vico.world.transit import Transit
from vico.world.walkable import WalkableMap, write_walkable
from vico.world.world import World, write_record, write_records, write_terrain
from vico.worldgen.buildings.stage import BuildingsResult
from vico.worldgen.evidence import Evidence
from vico.worldgen.indoor.stage import Indoors
from vico.worldgen.objects.parking import CAR, Parking
from vico.worldgen.request import WorldRequest
from vico.worldgen.stages import Stages
from vico.worldgen.streets.netconvert import RoadNetwork
from vico.worldgen.streets.roads import closed_roads

_BARRIER_KINDS = ("fence", "wall", "guard_rail", "hedge")


@dataclass(frozen=True)
class Layers:
    """Surfaces of a world by layer.

    Attributes
    ----------
    ground
        Streets, squares, greens, waters.
    walls, fronts
        Of buildings, and what stands before them: doors, shop signs. Together they are the layer "buildings".
    roofs, rooms, collision
        Roofs, rooms below ground, and the convex bodies of buildings.
    """

    ground: list[Surface]
    walls: list[Surface]
    fronts: list[Surface]
    roofs: list[Surface]
    rooms: list[Surface]
    collision: list[Surface]

    def by_name(self) -> dict[str, list[Surface]]:
        """Return the surfaces by the names that `World.surfaces` knows."""
        return {
            "ground": self.ground,
            "buildings": [*self.walls, *self.fronts],
            "roofs": self.roofs,
            "rooms": self.rooms,
            "collision": self.collision,
        }


@dataclass(frozen=True)
class WorldParts:
    """Parts of a world beside its surfaces; fields are named as the attributes of `World`."""

    height: HeightField
    buildings: list[Building]
    places: list[Place]
    entrances: list[Entrance]
    rooms: list[Room]
    objects: Objects
    roads: Roads
    transit: Transit
    walkable: WalkableMap
    lanes: LaneGraph
    parking: list[ParkingSpot]
    models: dict[str, Sequence[Surface]]

    def world(self, manifest: Manifest, folder: Path, layers: Layers) -> World:
        """Put the world together."""
        parts = {field.name: getattr(self, field.name) for field in fields(self)}
        return World(manifest, folder, layers=layers.by_name(), **parts)


class WorldWriter:
    """Writes what a stage made into the world's folder, and reports it.

    Parameters
    ----------
    folder
        The folder of the world.
    stages
        Keeps the reports.
    """

    def __init__(self, folder: Path, stages: Stages) -> None:
        self.folder = folder
        self._stages = stages

    def terrain(self, height: HeightField, *, flat: bool) -> None:
        """Write the graded ground; `flat` says that its heights are unknown."""
        write_terrain(self.folder / "terrain.npz", height)
        told = [Dropped(id="terrain", reason=FLAT_GROUND)] if flat else []
        self._stages.report("terrain", {"cells": int(height.heights.shape[0] - 1) ** 2, "flat": int(flat)}, told)

    def streets(self, roads: Roads, network: RoadNetwork) -> LaneGraph:
        """Write the road database and the lane-level network, and return the network's lanes."""
        write_record(self.folder / "roads.json", roads)
        net = self.folder / "roads.net.xml"
        write_bytes(net, network.net_xml)
        if network.xodr is not None:
            write_bytes(self.folder / "roads.xodr", network.xodr)
        lanes = self._stages.register(read_lanes(net), sha256_of(net))
        self._stages.report(
            "roads",
            {
                "roads": len(roads.roads),
                "drivable_roads": len(_drivable(roads)),
                "junctions": len(roads.junctions),
                "crossings": len(roads.crossings),
                "lanes": len(lanes),
            },
            [
                *([] if len(lanes) else [Dropped(id="roads", reason="no street for traffic in the window")]),
                *closed_roads(roads),
            ],
        )
        return lanes

    def transit(self, transit: Transit) -> None:
        """Write stops, lines and bicycle stations."""
        write_record(self.folder / "transit.json", transit)
        self._stages.report(
            "transit",
            {"stops": len(transit.stops), "lines": len(transit.lines), "bike_stations": len(transit.bike_stations)},
            transit.left_out,
        )

    def parking(self, parking: Parking) -> None:
        """Write the parking spots; the cars in them are written with what else stands around."""
        write_records(self.folder / "parking.json", parking.spots)
        self._stages.report("parking", {"parking_spots": len(parking.spots), "parked_cars": len(parking.cars)})

    def outdoors(self, objects: Objects, dropped: Iterable[Dropped]) -> None:
        """Report what stands outdoors; it is written together with what stands indoors."""
        barrier = np.isin(objects.kind, _BARRIER_KINDS)
        amenity = (objects.group == "amenity") & ~barrier & (objects.kind != CAR)
        counts = {
            "amenity_objects": int(amenity.sum()),
            "natural_objects": int(((objects.group == "natural") & ~barrier).sum()),
            "barrier_pieces": int(barrier.sum()),
            "kinds": len(np.unique(objects.kind)),
        }
        self._stages.report("objects", counts, dropped)

    def walkable(self, walkable: WalkableMap) -> None:
        """Write where people can walk."""
        write_walkable(self.folder / "walkable.npz", walkable)
        counts = {"free_cells": int((walkable.cls > 0).sum()), "connected_cells": int(walkable.connected.sum())}
        self._stages.report("walkable", counts)

    def buildings(self, built: BuildingsResult, entrances: Sequence[Entrance]) -> list[Building]:
        """Write buildings and their doors; return the buildings, each with whether one can enter it."""
        enterable = {entrance.building for entrance in entrances}
        buildings = [b.model_copy(update={"accessible": b.id in enterable}) for b in built.records]
        write_records(self.folder / "buildings.json", buildings)
        write_records(self.folder / "entrances.json", entrances)
        self._stages.report(
            "buildings",
            {
                "buildings": len(buildings),
                "accessible_buildings": len(enterable),
                "watertight_buildings": built.watertight,
                "collision_faces": built.collision_faces,
            },
            built.dropped,
        )
        return buildings

    def indoors(self, indoors: Indoors, dropped: Iterable[Dropped]) -> None:
        """Write places and their rooms; `dropped` are floor plans that were not drawn."""
        write_records(self.folder / "places.json", indoors.places)
        write_records(self.folder / "rooms.json", indoors.rooms)
        counts = {"rooms": len(indoors.rooms), "indoor_objects": len(indoors.furniture)}
        self._stages.report("indoor", counts, dropped)

    def objects(self, outdoors: Objects, indoors: Indoors) -> Objects:
        """Write what stands outdoors and indoors, and return both."""
        objects = Objects.joined([outdoors, indoors.furniture])
        write_objects(self.folder / "objects.parquet", objects)
        return objects

    def meshes(self, layers: Layers, models: dict[str, Sequence[Surface]]) -> None:
        """Write surfaces and prototypes."""
        meshes = self.folder / "meshes"
        with self._stages.timer("write"):
            write_glb(meshes / "ground.glb", {"ground": layers.ground})
            write_glb(meshes / "buildings.glb", {"walls": layers.walls, "doors": layers.fronts})
            write_glb(meshes / "roofs.glb", {"roofs": layers.roofs})
            write_glb(meshes / "rooms.glb", {"rooms": layers.rooms})
            write_glb(meshes / "collision.glb", {f"part_{k}": [body] for k, body in enumerate(layers.collision)})
            write_glb(meshes / "prototypes.glb", models)
        self._stages.report("write", {name: faces(surfaces) for name, surfaces in layers.by_name().items()})


def faces(surfaces: Iterable[Surface]) -> int:
    """Count triangles."""
    return sum(len(surface.triangles) for surface in surfaces)


def manifest_of(
    request: WorldRequest, evidence: Evidence, parts: WorldParts, stages: Stages, credits: Sequence[Source]
) -> Manifest:
    """Return the manifest of a world, still without its files; `credits` are sources beside those of `evidence`."""
    drivable = _drivable(parts.roads)
    transit = parts.transit
    counts = {
        **stages.counts("buildings"),
        "places": len(parts.places),
        "entrances": len(parts.entrances),
        "rooms": len(parts.rooms),
        "roads": len(drivable),
        "walkways": len(parts.roads.roads) - len(drivable),
        "junctions": len(parts.roads.junctions),
        "crossings": len(parts.roads.crossings),
        **stages.counts("objects"),
        "indoor_objects": stages.counts("indoor")["indoor_objects"],
        "transit": len(transit.stops) + len(transit.lines) + len(transit.bike_stations),
    }
    frame = evidence.data.frame
    return Manifest(
        producer=f"vico {__version__}",
        name=request.sources.osm.name.removesuffix(".pbf").removesuffix(".osm"),
        origin=Origin(lat=frame.lat, lon=frame.lon, east=frame.east, north=frame.north),
        half=request.half,
        bbox=tuple(round(v, 7) for v in frame.bbox(request.half)),
        seed=request.seed,
        sources=[*evidence.credits, *credits],
        stages=[],
        counts=counts,
        places_by_type=dict(sorted(Counter(place.category.value for place in parts.places).items())),
        files={},
    )


def _drivable(roads: Roads) -> list[Road]:
    return [road for road in roads.roads if road.lanes > 0]
