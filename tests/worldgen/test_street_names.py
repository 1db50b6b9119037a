"""Names of streets are read at corners: on the walls that stand there, or on posts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vico.world.heights import HeightField
from vico.world.mesh import Surface
from vico.world.model import Building, Road, Roads
from vico.world.objects import Objects
from vico.worldgen.facades.signs import paint_boards
from vico.worldgen.facades.street_names import NamePlate, Streets, name_plates
from vico.worldgen.facades.textures.materials import material
from vico.worldgen.facades.textures.walls import BAYS
from vico.worldgen.facades.walls import GroundFloors, Pieces
from vico.worldgen.facts.street_habits import Plates

HALF, HIGH = 6.0, 3.6  # metres from a street's axis to a house, and a ground floor's height


def road(name: str | None, *line: tuple[float, float], key: str = "r", lanes: int = 2) -> Road:
    return Road(
        id=f"{key}{line}", osm_id=1, name=name, kind="residential", line=list(line), width=7.0, lanes=lanes,
        oneway=False, sidewalk="both", speed=8.0,
    )  # fmt: skip


#: Four arms of two streets that cross at the origin.
CROSS = Roads(
    roads=[
        road("High Street", (0.0, 0.0), (60.0, 0.0)),
        road("High Street", (-60.0, 0.0), (0.0, 0.0)),
        road("Mill Lane", (0.0, 0.0), (0.0, 60.0)),
        road("Mill Lane", (0.0, -60.0), (0.0, 0.0)),
        road(None, (0.0, 0.0), (40.0, 40.0), lanes=0),
    ],
    junctions=[],
    crossings=[],
)


def house(number: int, x: float, y: float, *, levels: int = 3) -> tuple[Building, Surface]:
    """A house with a corner near the origin in the quadrant of a point, and the walls of its ground floor."""
    xs, ys = sorted((np.sign(x) * HALF, np.sign(x) * 26.0)), sorted((np.sign(y) * HALF, np.sign(y) * 26.0))
    ring = [(xs[0], ys[0]), (xs[1], ys[0]), (xs[1], ys[1]), (xs[0], ys[1])]
    parts, uvs = [], []
    for a, b in zip(ring, ring[1:] + ring[:1], strict=True):
        parts.append([(*a, 0.0), (*b, 0.0), (*b, HIGH), (*a, HIGH)])
        uvs.append([(0.0, 0.004), (6.0 / BAYS, 0.004), (6.0 / BAYS, 0.996), (0.0, 0.996)])
    faces = [(4 * k, 4 * k + i, 4 * k + i + 1) for k in range(4) for i in (1, 2)]
    walls = Surface.from_triangles(
        np.array(parts).reshape(-1, 3), np.array(faces), uv=np.array(uvs).reshape(-1, 2), colour=(240, 230, 220),
        entity=1000 + number, material=material("ground_plain"),
    )  # fmt: skip
    building = Building(
        id=f"w{number}", entity=1000 + number, name=None, use="residential", footprint=[ring], base=0.0,
        height=3.2 * levels, levels=levels, roof_shape="flat", colour="#ffffff", accessible=True,
    )  # fmt: skip
    return building, walls


def hung(plates: list[NamePlate]) -> np.ndarray:
    """Corners of all plates, once they hang."""
    pieces = Pieces()
    boards = paint_boards([], [plate.lettering for plate in plates])
    pieces.materials |= {page.name: page for page in boards.materials}
    assert all(plate.hang(boards, pieces) for plate in plates)
    return pieces.triangles()


def test_a_plate_that_there_was_no_room_to_paint_does_not_hang() -> None:
    pieces = Pieces()
    assert not on_walls()[0].hang(paint_boards([]), pieces)
    assert not len(pieces.triangles())


def on_walls(levels: int = 3, roads: Roads = CROSS, low: float = 0.0) -> list[NamePlate]:
    built = [house(k, x, y, levels=levels) for k, (x, y) in enumerate([(1, 1), (-1, 1), (-1, -1), (1, -1)])]
    objects = Objects.from_rows([])
    streets = Streets(roads, objects, HeightField.flat(100.0, low), Plates())
    return name_plates(streets, [b for b, _ in built], GroundFloors([w for _, w in built]))


def test_each_arm_has_its_name_on_a_wall_along_it_above_the_ground_floor() -> None:
    plates = on_walls()
    assert sorted(plate.lettering.text for plate in plates) == ["High Street"] * 2 + ["Mill Lane"] * 2
    for plate in plates:
        assert plate.wall is not None
        east = plate.lettering.text == "High Street"
        assert abs(plate.wall.right[0 if east else 1]) == pytest.approx(1.0)
        corners = hung([plate]).reshape(-1, 3)
        # On the outside of its wall, at the end that is nearer to the corner.
        assert (np.abs(corners[:, 1 if east else 0]) > HALF - 0.2).all()
        assert (np.abs(corners[:, 1 if east else 0]) < HALF).all()
        assert (np.abs(corners[:, 0 if east else 1]) < HALF + 3.0).all()
        assert (np.abs(corners[:, 0 if east else 1]) > HALF).all()
        assert (corners[:, 2] >= HIGH).all()
        assert (corners[:, 2] < HIGH + 0.4).all()


def test_low_houses_and_streets_that_go_on_under_one_name_have_none() -> None:
    assert not on_walls(levels=1)
    same = [one.model_copy(update={"name": "High Street"}) for one in CROSS.roads]
    assert not on_walls(roads=Roads(roads=same, junctions=[], crossings=[]))
    unread = [one.model_copy(update={"name": "東京"}) for one in CROSS.roads[:2]] + CROSS.roads[2:4]
    assert {plate.lettering.text for plate in on_walls(roads=Roads(roads=unread, junctions=[], crossings=[]))} == {
        "Mill Lane"
    }


@pytest.mark.parametrize(("low", "hang"), [(1.0, True), (2.5, False), (-2.5, True), (-4.5, False)])
def test_a_plate_that_would_be_under_or_high_above_the_ground_before_it_does_not_hang(low: float, hang: bool) -> None:
    assert bool(on_walls(low=low)) == hang


@pytest.mark.parametrize("kind", ["service", "primary_link"])
def test_ramps_and_ways_out_have_no_plate(kind: str) -> None:
    ramps = [one.model_copy(update={"kind": kind}) for one in CROSS.roads[:2]] + CROSS.roads[2:]
    assert not on_walls(roads=Roads(roads=ramps, junctions=[], crossings=[]))


def lamps(*places: tuple[float, float], kind: str = "street_lamp", tall: float = 8.0) -> Objects:
    about = {
        "group": "amenity", "prototype": kind, "room": "", "z": 0.5, "yaw": 0.0, "scale": 1.0, "size_x": 0.3,
        "size_y": 0.3, "size_z": tall, "solid": True,
    }  # fmt: skip
    rows = [{"id": f"n{k}", "entity": 50 + k, "kind": kind, "x": x, "y": y} | about for k, (x, y) in enumerate(places)]
    return Objects.from_rows(rows)


def around(objects: Objects, *, names_on: str) -> Streets:
    return Streets(CROSS, objects, HeightField.flat(100.0), replace(Plates(), names_on=names_on))


@pytest.mark.parametrize(
    ("kind", "tall", "low"), [("street_lamp", 8.0, 3.0), ("traffic_signals", 3.5, 3.5), ("street_lamp", 1.0, None)]
)
def test_on_posts_both_names_hang_one_above_the_other_each_along_its_street(
    kind: str, tall: float, low: float | None
) -> None:
    posts = lamps((5.0, 5.0), (40.0, 5.0), kind=kind, tall=tall)
    plates = name_plates(around(posts, names_on="posts"), [], GroundFloors([]))
    if low is None:
        assert not plates
        return
    assert sorted(plate.lettering.text for plate in plates) == ["High Street", "Mill Lane"]
    assert {plate.entity for plate in plates} == {50}
    heights = []
    for plate in plates:
        corners = hung([plate]).reshape(-1, 3) - [5.0, 5.0, 0.5]
        along = 0 if plate.lettering.text == "High Street" else 1
        assert np.ptp(corners[:, along]) > 0.5
        assert np.ptp(corners[:, 1 - along]) < 0.1
        assert np.abs(corners[:, along]).min() > 0.01
        # Both sides of one blade: on the same side of the post.
        assert abs(np.sign(corners[:, along]).sum()) == len(corners)
        heights.append((corners[:, 2].min(), corners[:, 2].max()))
    (a, b), (c, d) = sorted(heights)
    assert low <= a < b < c < d < low + 0.8


def test_where_nothing_carries_names_there_are_none() -> None:
    assert not name_plates(around(lamps((5.0, 5.0)), names_on="nothing"), [], GroundFloors([]))
