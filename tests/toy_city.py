"""A city small enough to reason about: a square with a house, a café of two rooms, a shop, and three residents."""

from __future__ import annotations

from datetime import date
from typing import Any

import numpy as np

from vico.community.model import (
    Community,
    ItemType,
    Personality,
    Relation,
    RelationKind,
    Resident,
    ScheduleItem,
    WorldIdentity,
)
from vico.world.heights import HeightField
from vico.world.mesh import Material, Surface
from vico.world.model import (
    ENTITY_GROUND,
    Building,
    Category,
    Container,
    Entrance,
    Manifest,
    Origin,
    Place,
    Roads,
    Room,
)
from vico.world.objects import Objects
from vico.world.transit import Transit
from vico.world.walkable import BLOCKED, OPEN, SIDEWALK, WalkableMap
from vico.world.world import World

HALF = 40.0
#: The house covers x -10..10, y 5..17; doors on its south side. Rooms lie 6 m below it.
HOUSE = (-10.0, 5.0, 10.0, 17.0)
FLOOR = -6.0
CAFE, SHOP, PARK = "place_cafe", "place_shop", "place_park"
SLOPE = 0.02


def walkable() -> WalkableMap:
    """Open ground with a sidewalk along the house; cells within 0.3 m of the house are blocked."""
    n = 160
    cls = np.full((n, n), OPEN, np.uint8)
    centre = (np.arange(n) + 0.5) * 0.5 - HALF
    x, y = np.meshgrid(centre, centre)
    cls[(np.abs(x) < 30) & (y > 0) & (y < 5)] = SIDEWALK
    west, south, east, north = HOUSE
    cls[(x > west - 0.3) & (x < east + 0.3) & (y > south - 0.3) & (y < north + 0.3)] = BLOCKED
    return WalkableMap(cls, HALF)


def room(name: str, place: str, x: float, *, entity: int, door: tuple[float, float], links: list[str]) -> Room:
    """A room of 6 x 6 x 2.6 m around (x, 11)."""
    inside = (door[0] + np.sign(x - door[0]) * 0.8, door[1] + (0.8 if door[1] < 9 else 0.0))
    top = Container(
        id=f"{name}_table",
        entity=entity + 100_000,
        kind="table",
        centre=(x, 13.0, FLOOR + 0.75),
        size=(1.6, 0.8),
        yaw=0.0,
        reach=(x, 11.8),
    )
    return Room(
        id=name,
        entity=entity,
        place=place,
        building="b1",
        kind="lobby",
        centre=(x, 11.0, FLOOR),
        size=(6.0, 6.0, 2.6),
        yaw=0.0,
        door=(*door, FLOOR),
        inside=(float(inside[0]), float(inside[1]), FLOOR),
        links=links,
        containers=[top],
    )


def quad(corners: list[list[float]], colour: tuple[int, int, int], entity: int, name: str) -> Surface:
    """A four-sided face."""
    return Surface.from_triangles(
        np.array(corners, np.float32),
        np.array([[0, 1, 2], [0, 2, 3]], np.int32),
        colour=colour,
        entity=entity,
        material=Material(name),
    )


def world() -> World:
    """The toy city, in memory; the ground rises eastwards by `SLOPE`."""
    heights = np.array([[-HALF * SLOPE, HALF * SLOPE]] * 2, np.float32)
    ground = HeightField(heights, HALF)
    entrances = [
        Entrance(id="e_cafe", building="b1", position=(-5.0, 5.0, -0.1), facing=-np.pi / 2, approach=(-5.0, 4.0)),
        Entrance(id="e_shop", building="b1", position=(5.0, 5.0, 0.1), facing=-np.pi / 2, approach=(5.0, 4.0)),
    ]
    rooms = [
        room("r_cafe", CAFE, -6.0, entity=100_001, door=(-6.0, 8.0), links=["r_back"]),
        room("r_back", CAFE, 0.0, entity=100_002, door=(-3.0, 11.0), links=["r_cafe"]),
        room("r_shop", SHOP, 7.0, entity=100_003, door=(7.0, 8.0), links=[]),
    ]
    places = [
        Place(
            id=CAFE,
            name="Corner Café",
            category=Category.FOOD,
            kind="cafe",
            building="b1",
            entrance="e_cafe",
            position=(-5.0, 4.0, -0.1),
            rooms=["r_cafe", "r_back"],
        ),
        Place(
            id=SHOP,
            name="Hat Shop",
            category=Category.STORE,
            kind="clothes",
            building="b1",
            entrance="e_shop",
            position=(5.0, 4.0, 0.1),
            rooms=["r_shop"],
        ),
        Place(
            id=PARK,
            name="South Green",
            category=Category.OPEN,
            kind="park",
            building=None,
            entrance=None,
            position=(0.0, -25.0, 0.0),
        ),
    ]
    tables = [
        {
            "id": f"{r.id}_table",
            "entity": r.containers[0].entity,
            "kind": "table",
            "group": "indoor",
            "prototype": "table",
            "x": r.centre[0],
            "y": 13.0,
            "z": FLOOR,
            "yaw": 0.0,
            "scale": 1.0,
            "size_x": 1.6,
            "size_y": 0.8,
            "size_z": 0.75,
            "solid": True,
            "room": r.id,
        }
        for r in rooms
    ]
    west, south, east, north = HOUSE
    building = Building(
        id="b1",
        entity=1000,
        name="The House",
        use="commercial",
        footprint=[[(west, south), (east, south), (east, north), (west, north)]],
        base=0.0,
        height=9.0,
        levels=3,
        roof_shape="flat",
        colour="#c0b090",
        accessible=True,
    )
    edge = HALF * SLOPE
    layers: dict[str, list[Surface]] = {
        "ground": [
            quad(
                [[-HALF, -HALF, -edge], [HALF, -HALF, edge], [HALF, HALF, edge], [-HALF, HALF, -edge]],
                (110, 130, 100),
                ENTITY_GROUND,
                "ground",
            )
        ],
        "buildings": [
            quad(
                [[west, south, -1], [east, south, -1], [east, south, 9], [west, south, 9]], (190, 170, 140), 1000, "w"
            ),
            quad(
                [[east, north, -1], [west, north, -1], [west, north, 9], [east, north, 9]], (190, 170, 140), 1000, "w"
            ),
            quad(
                [[west, north, -1], [west, south, -1], [west, south, 9], [west, north, 9]], (180, 160, 130), 1000, "w"
            ),
            quad(
                [[east, south, -1], [east, north, -1], [east, north, 9], [east, south, 9]], (180, 160, 130), 1000, "w"
            ),
        ],
        "roofs": [
            quad([[west, south, 9], [east, south, 9], [east, north, 9], [west, north, 9]], (90, 60, 50), 1000, "r")
        ],
        "rooms": [
            quad(
                [[x - 3, 8, FLOOR], [x + 3, 8, FLOOR], [x + 3, 14, FLOOR], [x - 3, 14, FLOOR]],
                (150, 120, 90),
                entity,
                "f",
            )
            for x, entity in ((-6.0, 100_001), (0.0, 100_002), (7.0, 100_003))
        ],
        "collision": [],
    }
    top = quad([[-0.8, -0.4, 0.75], [0.8, -0.4, 0.75], [0.8, 0.4, 0.75], [-0.8, 0.4, 0.75]], (120, 80, 40), 0, "wood")
    manifest = Manifest(
        producer="toy",
        name="toy",
        origin=Origin(lat=60.0, lon=25.0),
        half=HALF,
        bbox=(24.9, 59.9, 25.1, 60.1),
        seed=0,
        sources=[],
        stages=[],
        counts={},
        places_by_type={},
        files={},
    )
    return World(
        manifest,
        height=ground,
        buildings=[building],
        places=places,
        entrances=entrances,
        rooms=rooms,
        objects=Objects.from_rows(tables),
        roads=Roads(roads=[], junctions=[], crossings=[]),
        transit=Transit(stops=[], lines=[], bike_stations=[], origin={}),
        walkable=walkable(),
        layers=layers,
        models={"table": [top]},
    )


def item(kind: str, start: str, end: str, place: str | None) -> ScheduleItem:
    """A schedule item at a place of the toy city."""
    building = None if place in (None, PARK) else "b1"
    return ScheduleItem(type=ItemType(kind), start=start, end=end, activity=kind, place=place, building=building)


def resident(index: int, name: str, schedule: list[ScheduleItem], **more: Any) -> Resident:
    """Somebody who lives in the toy city."""
    fields: dict[str, Any] = {
        "id": f"resident_{index}",
        "name": name,
        "age": 30 + index,
        "gender": "female",
        "appearance": {
            "gender": 0.0,
            "age": 30.0 + index,
            "height": 1.7,
            "build": 0.4,
            "muscle": 0.5,
            "ancestry": (1.0, 0.0, 0.0),
            "skin": (200, 160, 130),
            "hair": "short",
            "hair_colour": (60, 40, 20),
            "eyes": (60, 90, 120),
            "beard": False,
            "glasses": False,
            "top": "shirt",
            "top_colour": (40, 80, 160),
            "under_colour": (230, 230, 230),
            "bottom": "trousers",
            "bottom_colour": (50, 50, 60),
            "shoes": "shoes",
            "shoes_colour": (30, 30, 30),
        },
        "occupation": "baker",
        "values": ["benevolence"],
        "personality": Personality(
            openness=0.5, conscientiousness=0.5, extraversion=0.8, agreeableness=0.5, neuroticism=0.2, traits=["calm"]
        ),
        "hobbies": ["chess"],
        "lifestyle": "early riser",
        "biography": "Bakes bread for the quarter.",
        "cash": 200,
        "home": CAFE,
        "workplace": SHOP,
        "known_places": [CAFE, SHOP, PARK],
        "spawn": (-5.0 + 3 * index, 3.0),
        "schedule": schedule,
    }
    return Resident(**(fields | more))


def community() -> Community:
    """Two who go from the café to the shop at 08:00, and one who is under way from the café to the park."""
    to_shop = [
        item("sleep", "00:00:00", "08:00:00", CAFE),
        item("commute", "08:00:00", "08:02:00", None),
        item("main", "08:02:00", "23:59:59", SHOP),
    ]
    to_park = [
        item("sleep", "00:00:00", "07:59:30", CAFE),
        item("commute", "07:59:30", "08:01:30", None),
        item("main", "08:01:30", "23:59:59", PARK),
    ]
    people = [
        resident(0, "Ada Berg", to_shop),
        resident(1, "Bo Dahl", to_shop),
        resident(2, "Cleo Ek", to_park),
    ]
    tie = Relation(
        between=("resident_0", "resident_1"), kind=RelationKind.FRIEND, note="chess", strength=0.8, since=2020
    )
    return Community(
        producer="toy",
        author="test",
        seed=0,
        date=date(2025, 6, 3),
        world=WorldIdentity(name="toy", digest=world().digest),
        residents=people,
        groups=[],
        relations=[tie],
    )
