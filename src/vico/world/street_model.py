"""Streets, junctions and parking spots, as records of a world folder; see `vico.world.model` for frame and numbers."""

from __future__ import annotations

from vico.world.model import Point2, Point3, Record


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
    """Where three or more drivable roads meet."""

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
    """How one gets into a spot of a car park, and out of it again.

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
