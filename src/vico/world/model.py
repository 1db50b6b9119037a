"""Records of a world: the shapes of every small file in a world folder, and the findings of a check.

Frame: local ENU metres, origin at the window's centre, z up, yaw counter-clockwise from east in radians.
Every record that can be seen has an `entity`: a positive integer, unique in its world, stable between builds of the
same input, and the value that segmentation images hold. The records of `transit.json` are in `vico.world.transit`.
"""

from __future__ import annotations

import math
from enum import StrEnum
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, SerializerFunctionWrapHandler, model_serializer

SCHEMA = "vico.world"
VERSION = 1

# Entity numbers by kind, so that a number alone tells what it is. Bodies of a simulation start above every world's.
ENTITY_GROUND = 1
ENTITY_ROAD = 2
ENTITY_WATER = 3
ENTITY_GREEN = 4
ENTITY_BACKDROP = 5
ENTITY_WIRE = 6
FIRST_BUILDING = 1_000
FIRST_OBJECT = 20_000
FIRST_STOP = 90_000
FIRST_ROOM = 100_000
FIRST_FURNITURE = 200_000
FIRST_BODY = 1_000_000

Point2 = tuple[float, float]
Point3 = tuple[float, float, float]
Ring = list[Point2]


class Record(BaseModel):
    """Base of the strict records: an unknown field is an error that names its path."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Origin(Record):
    """Centre of the frame's projection on Earth, degrees (WGS 84), and metres from there to its origin."""

    lat: Annotated[float, Field(ge=-90, le=90)]
    lon: Annotated[float, Field(ge=-180, le=180)]
    east: float = 0.0
    north: float = 0.0

    @model_serializer(mode="wrap")
    def _serialise(self, plain: SerializerFunctionWrapHandler) -> dict[str, float]:
        """Only the tiles of a city are shifted; other worlds say nothing of it."""
        return {key: value for key, value in plain(self).items() if value or key in ("lat", "lon")}


class Source(Record):
    """Something the world was made from, with what its licence asks for."""

    kind: str
    name: str
    licence: str
    attribution: str
    timestamp: str | None = None
    sha256: str | None = None


OPEN_KINDS = frozenset({"roof", "carport", "canopy", "bridge"})
"""Values of the tag `building` for what stands on posts and is open below, however low it is."""

FAILED = "can't be made"
"""Begin of the reason where an object's geometry is at fault."""
FAULT = "can't be made, by a fault of the program"
"""Begin of the reason where an object brought out a fault of the program."""
TRIED = "tried"
"""Among a stage's counts, where it left something out: of how many objects it was to make something."""


#: What a build says where no source told the heights of its ground.
FLAT_GROUND = "the ground is flat: no source tells its heights; give an elevation model (GeoTIFF, .hgt) with --dem"


class Dropped(Record):
    """Something the input had and the world has not, with the reason."""

    id: str
    reason: str


class StageReport(Record):
    """Counts of what a stage of the build made and left out; its seconds are in `build.json`, as they differ."""

    name: str
    counts: dict[str, int]
    dropped: list[Dropped] = []


class Manifest(Record):
    """`world.json`: written last, so a folder that has it is whole.

    Attributes
    ----------
    half
        Half the side of the square world, metres (the radius it was built with).
    bbox
        West, south, east, north of the square, degrees.
    files
        SHA-256 of every other file of the world, by path relative to the folder.
    """

    schema_name: str = SCHEMA
    version: int = VERSION
    producer: str
    name: str
    origin: Origin
    half: float
    bbox: tuple[float, float, float, float]
    seed: int
    sources: list[Source]
    stages: list[StageReport]
    counts: dict[str, int]
    places_by_type: dict[str, int]
    files: dict[str, str]

    @property
    def is_flat(self) -> bool:
        """Whether no source told the heights of the ground."""
        return any(stage.counts.get("flat", 0) > 0 for stage in self.stages if stage.name == "terrain")


class BuildingSources(Record):
    """Sources of a building's facts.

    Attributes
    ----------
    footprint, height, roof
        ``osm``, with the tag it was read from; kind and file of another source, such as ``citygml:berlin.gml``, for a
        roof with ``surfaces`` where it is built of the model's own; or ``rule`` and which one decided.
    """

    footprint: str
    height: str
    roof: str


class Building(Record):
    """A building, seated on the terrain.

    Attributes
    ----------
    use
        One of residential, commercial, retail, office, hotel, industrial, civic, religious, education, health,
        transport, garage, other.
    footprint
        Outer ring then holes, metres, not closed; the outer one counter-clockwise.
    base
        Height of the ground floor, metres: where its main entrance meets the ground.
    height
        Metres from `base` to the highest point of the roof.
    accessible
        True if people can enter: it has a reachable entrance.
    sources
        Where outline, height and roof are from; only in worlds built of more sources than a map.
    """

    id: str
    entity: int
    name: str | None
    use: str
    footprint: list[Ring]
    base: float
    height: float
    levels: int
    roof_shape: str
    colour: str
    accessible: bool
    tags: dict[str, str] = {}
    sources: BuildingSources | None = None

    @model_serializer(mode="wrap")
    def _without_empty_sources(self, rest: SerializerFunctionWrapHandler) -> dict[str, Any]:
        content: dict[str, Any] = rest(self)
        if self.sources is None:
            del content["sources"]
        return content


class Category(StrEnum):
    """Use of a place."""

    ACCOMMODATION = "accommodation"
    FOOD = "food"
    STORE = "store"
    OFFICE = "office"
    ENTERTAINMENT = "entertainment"
    OPEN = "open"
    TRANSIT = "transit"


class Entrance(Record):
    """A door on a building's outline.

    Attributes
    ----------
    position
        On the outline, at ground level.
    facing
        Yaw of the outward normal, radians.
    approach
        A walkable, reachable point outside the door, within 2 m of `position`.
    """

    id: str
    building: str
    position: Point3
    facing: float
    approach: Point2


class Place(Record):
    """A named place people go to.

    Attributes
    ----------
    kind
        The OSM value that made it a place, e.g. ``restaurant``; ``apartments`` for homes.
    building, entrance
        Ids; None for open places (a square, a park, a stop).
    position
        The entrance's approach, or a reachable point of an open place, on the ground.
    rooms
        Ids of its rooms, entrance room first; empty for open places.
    """

    id: str
    name: str
    category: Category
    kind: str
    building: str | None
    entrance: str | None
    position: Point3
    rooms: list[str] = []
    opening_hours: str | None = None


class Container(Record):
    """A surface things can lie on.

    Attributes
    ----------
    kind
        floor, sofa, table, chair, desk or bed.
    centre
        Centre of the top surface.
    size
        Extent along the container's own x and y, metres.
    reach
        A free point of the room from which the surface is within 1.5 m.
    """

    id: str
    entity: int
    kind: str
    centre: Point3
    size: Point2
    yaw: float
    reach: Point2


#: Level stretch at either end of the flights of a stairs room, metres along its own x.
LANDING = 1.1
#: Kind of rooms that are cars of a lift, one a floor.
LIFT = "lift"
#: Risers of each of its two flights.
FLIGHT_STEPS = 8


class Doorway(Record):
    """A way out of a room, as seen from that room.

    Attributes
    ----------
    to
        Id of the room it leads to; empty for the way outdoors.
    position
        Middle of the doorway on this room's wall, at floor level; in a lift, the floor before the panel.
    inside
        A free spot of this room a step in from it: where people stand who come in this way.
    """

    to: str
    position: Point3
    inside: Point3


class Room(Record):
    """A room: an oriented box in the same frame, below ground at its building, unseen from outside.

    Attributes
    ----------
    centre
        Middle of the floor.
    size
        Length along the room's own x, width along y, clear height, metres.
    door
        Middle of the doorway at floor level, on the wall; `inside` is the free spot a step in from it.
    links
        Ids of the rooms this one opens to. Cars of a lift (kind ``lift``), one a floor, link each other.
    rise
        Metres its floor climbs (kind ``stairs``), else 0: half of it where the room's own y is negative, going along
        own x; the other half on the way back. At either end `LANDING` metres are level. A wall parts the flights.
    doors
        Every way out with where it is, the one nearest to the street first; may be empty in worlds made by hand.
    """

    id: str
    entity: int
    place: str
    building: str
    kind: str
    centre: Point3
    size: Point3
    yaw: float
    door: Point3
    inside: Point3
    links: list[str] = []
    containers: list[Container] = []
    rise: float = 0.0
    doors: list[Doorway] = []

    def floor_at(self, x: float, y: float) -> float:
        """Height of the floor at a point of the room, ENU metres."""
        if not self.rise:
            return self.centre[2]
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        dx, dy = x - self.centre[0], y - self.centre[1]
        along, across = c * dx + s * dy, c * dy - s * dx
        run = self.size[0] - 2 * LANDING
        share = min(1.0, max(0.0, (along + self.size[0] / 2 - LANDING) / run))
        climbed = share / 2 if across < 0 else 1.0 - share / 2
        return self.centre[2] + self.rise * climbed

    def treads_at(self, xy: NDArray[np.float64]) -> NDArray[np.float64]:
        """Heights of what feet stand on at points ``(..., 2)``, ENU metres: of the treads on stairs, else the floor."""
        if not self.rise:
            return np.full(xy.shape[:-1], self.centre[2])
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        dx, dy = xy[..., 0] - self.centre[0], xy[..., 1] - self.centre[1]
        along, across = c * dx + s * dy, c * dy - s * dx
        run = self.size[0] - 2 * LANDING
        climbed = (along + self.size[0] / 2 - LANDING) / run * FLIGHT_STEPS
        lower = np.clip(np.floor(climbed) + 1, 0, FLIGHT_STEPS)
        upper = FLIGHT_STEPS + np.clip(np.floor(FLIGHT_STEPS - climbed) + 1, 0, FLIGHT_STEPS)
        level: NDArray[np.float64] = self.centre[2] + self.rise / (2 * FLIGHT_STEPS) * np.where(
            across < 0, lower, upper
        )
        return level


class Road(Record):
    """A stretch of a street between two junctions or ends.

    Attributes
    ----------
    line
        Centre line on the ground, metres.
    sidewalk
        none, left, right or both, seen along `line`.
    closed
        Why neither traffic nor walkers use it, though it is drawn; None for the rest.
    """

    id: str
    osm_id: int
    name: str | None
    kind: str
    line: list[Point2]
    width: float
    lanes: int
    oneway: bool
    sidewalk: str
    speed: float
    layer: int = 0
    closed: str | None = None


class Junction(Record):
    """A junction: three or more drivable roads meet."""

    id: str
    position: Point2
    roads: list[str]
    signals: bool


class Roads(Record):
    """`roads.json`: the road database. Crossings are points where walkers cross a carriageway."""

    roads: list[Road]
    junctions: list[Junction]
    crossings: list[Point2]


class WayIntoSpot(Record):
    """A way between a lane and a spot in a car park, which a car's axles follow.

    Attributes
    ----------
    lane, offset
        Where it begins or ends: metres along a lane.
    line
        ENU metres, in the direction one drives. Into a spot: from the lane to the spot's middle. Out of it: from where
        one stands in the aisle, having backed out of the spot, to the lane.
    """

    lane: str
    offset: float
    line: list[Point2]


class WaysOfSpot(Record):
    """Ways into a spot of a car park, and out of it again.

    Attributes
    ----------
    into
        Forwards.
    back
        Backwards out of the spot, as a line from where one stands in the aisle then to the spot's middle; it begins
        with the same straight piece as `out`.
    out
        Forwards out of the car park.
    """

    into: WayIntoSpot
    back: list[Point2]
    out: WayIntoSpot


class ParkingSpot(Record):
    """Room for one parked car.

    Attributes
    ----------
    position
        Its middle on the ground; `yaw` is where a car in it faces.
    length, width
        Metres.
    kind
        ``kerb``: along the kerb, in the direction of traffic; ``across``: at the kerb, across the street; ``lot``: in
        a car park.
    lane, offset, side
        Of spots along kerbs: the lane they are entered from, the metres along it at which the spot's middle lies, and
        how far that is to the left of the lane's middle (negative: to the right). None, 0 and 0 for the others.
    car
        Entity of the car that stands there for good; None where the spot is free.
    ways
        Of free spots in car parks that are reached from a lane: how.
    """

    id: str
    position: Point3
    yaw: float
    length: float
    width: float
    kind: str
    lane: str | None = None
    offset: float = 0.0
    side: float = 0.0
    car: int | None = None
    ways: WaysOfSpot | None = None


class WorldFinding(NamedTuple):
    """Something wrong.

    Attributes
    ----------
    id
        Which rule.
    where
        Id of the thing (a building, an object, a lane), or a file's name.
    what
        One sentence.
    at
        East and north of it, metres; None for files.
    """

    id: str
    where: str
    what: str
    at: tuple[float, float] | None = None
