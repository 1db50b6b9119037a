"""Doors, shop fronts and signs: on the wall, in whole bays, facing out, readable."""

import math
from functools import cache

import numpy as np
import pytest

from vico.world.mesh import Surface
from vico.world.model import Building, Category, Entrance, Place
from vico.worldgen.facades.fronts import street_fronts
from vico.worldgen.facades.textures.materials import material
from vico.worldgen.facades.textures.walls import BAYS
from vico.worldgen.facades.walls import GroundFloors, cell_uv
from vico.worldgen.facts.fault_isolation import collect_losses

_FACING = math.radians(-60.0)
_OUT = np.array([math.cos(_FACING), math.sin(_FACING)])
_RIGHT = np.array([-_OUT[1], _OUT[0]])
_START = np.array([3.0, 7.0])


_stuff = cache(material)


def _wall(
    name: str, *, length: float = 18.0, bays: int = 6, first: float = 2.0, high: float = 4.0, before: float = 0.0
) -> Surface:
    """A wall of one building, in two stretches that meet, base at height 10."""
    parts = []
    for a, b in ((0.0, 0.4 * length), (0.4 * length, length)):
        ends = [_START + _RIGHT * a + _OUT * before, _START + _RIGHT * b + _OUT * before]
        corners = [(*ends[0], 10.0), (*ends[1], 10.0), (*ends[1], 10.0 + high), (*ends[0], 10.0 + high)]
        u0, u1 = (first + a / length * bays) / BAYS, (first + b / length * bays) / BAYS
        parts.append((corners, [(u0, 0.004), (u1, 0.004), (u1, 0.996), (u0, 0.996)]))
    return Surface.from_triangles(
        np.concatenate([np.array(c) for c, _ in parts]),
        np.array([(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)]),
        uv=np.concatenate([np.array(uv) for _, uv in parts]),
        colour=(240, 230, 220),
        entity=1000,
        material=_stuff(name),
    )


def _building(use: str = "retail", levels: int = 4) -> Building:
    corners = [_START, _START + _RIGHT * 18, _START + _RIGHT * 18 - _OUT * 12, _START - _OUT * 12]
    return Building(
        id="w1", entity=1000, name=None, use=use, footprint=[[(float(x), float(y)) for x, y in corners]], base=10.0,
        height=15.0, levels=levels, roof_shape="flat", colour="#ffffff", accessible=True,
    )  # fmt: skip


def _entrance(s: float, name: str = "e1") -> Entrance:
    at = _START + _RIGHT * s
    near = at + _OUT
    return Entrance(
        id=name, building="w1", position=(float(at[0]), float(at[1]), 10.0), facing=_FACING,
        approach=(float(near[0]), float(near[1])),
    )  # fmt: skip


def _shop(name: str = "Café Größe", entrance: str = "e1", key: str = "n1", kind: str = "cafe") -> Place:
    category = Category.FOOD if kind == "cafe" else Category.STORE
    return Place(
        id=key, name=name, category=category, kind=kind, building="w1", entrance=entrance, position=(0.0, 0.0, 10.0)
    )


def _along(surface: Surface) -> np.ndarray:
    return (surface.positions[:, :2] - _START) @ _RIGHT


def _away(surface: Surface) -> np.ndarray:
    return (surface.positions[:, :2] - _START) @ _OUT


def test_a_wall_and_its_bays_are_read_off_its_triangles() -> None:
    wall = GroundFloors([_wall("ground_plain")]).at(1000, *(_START + _RIGHT * 7.0), _FACING)
    assert wall is not None
    assert wall.length == pytest.approx(18.0, abs=1e-4)
    assert wall.bays == pytest.approx(6.0, abs=1e-3)
    assert wall.along(*(_START + _RIGHT * 7.0)) == pytest.approx(7.0, abs=1e-4)
    assert (wall.low, wall.high) == (pytest.approx(9.984, abs=0.002), pytest.approx(14.016, abs=0.002))
    assert wall.bay_edges(6.7, 7.9) == (pytest.approx(6.0, abs=1e-3), pytest.approx(9.0, abs=1e-3))
    assert wall.bay_edges(5.0, 7.0) == (pytest.approx(3.0, abs=1e-3), pytest.approx(9.0, abs=1e-3))
    assert GroundFloors([_wall("ground_plain")]).at(1000, *(_START + _RIGHT * 7.0), _FACING + 2.0) is None
    assert GroundFloors([_wall("ground_plain")]).at(1001, *(_START + _RIGHT * 7.0), _FACING) is None


def test_of_walls_close_before_one_another_the_outermost_has_the_doors() -> None:
    walls = [_wall("ground_plain"), _wall("ground_cafes", before=0.05), _wall("ground_shops", before=0.5)]
    wall = GroundFloors(walls).at(1000, *(_START + _RIGHT * 7.0), _FACING)
    assert wall is not None
    assert wall.material == "ground_cafes"
    assert wall.length == pytest.approx(18.0, abs=1e-4)


@pytest.mark.parametrize("s", [0.4, 4.5, 6.1, 9.0, 17.7])
@pytest.mark.parametrize("use", ["retail", "residential", "hotel", "religious", "garage", "office"])
def test_fronts_stay_on_their_wall_and_before_it(s: float, use: str) -> None:
    places = [_shop()] if use == "retail" else []
    made = street_fronts(places, [_entrance(s)], [_building(use)], [_wall("ground_plain")], seed=0)
    for surface in made.surfaces:
        assert _along(surface).min() > -0.15
        assert _along(surface).max() < 18.15
        assert _away(surface).min() > -1e-4
        assert _away(surface).max() < 1.4
        assert (surface.entity == 1000).all()
        flat = np.cross(
            surface.positions[surface.triangles[:, 1]] - surface.positions[surface.triangles[:, 0]],
            surface.positions[surface.triangles[:, 2]] - surface.positions[surface.triangles[:, 0]],
        )
        assert ((flat * surface.normals[surface.triangles[:, 0]]).sum(axis=1) > 0).all()


@pytest.mark.parametrize("s", np.linspace(2.0, 16.0, 15).tolist())
def test_a_door_covers_whole_bays_or_none(s: float) -> None:
    made = street_fronts([], [_entrance(s)], [_building("residential")], [_wall("ground_plain")], seed=0)
    patches = [surface for surface in made.surfaces if surface.material.name == "ground_plain"]
    if not patches:  # the door stands between two windows as it is
        assert abs(s / 3.0 - round(s / 3.0)) * 3.0 < 1.0
        return
    ends = np.array([_along(patches[0]).min(), _along(patches[0]).max()]) / 3.0
    assert np.allclose(ends, np.round(ends), atol=0.01)
    # What covers the windows is the wall's own picture, from between its windows.
    u = patches[0].uv[:, 0] * BAYS
    assert (np.abs(u - np.round(u)) < 0.23).all()


@pytest.mark.parametrize("s", [0.5, 6.0, 17.6])
@pytest.mark.parametrize(("tagged", "numbers"), [("12a", 1), ("5;7", 1), ("", 0), ("a number of many words", 0)])
def test_the_number_of_a_house_is_beside_its_door(s: float, tagged: str, numbers: int) -> None:
    house = _building("residential").model_copy(update={"tags": {"addr:housenumber": tagged}})
    made = street_fronts([], [_entrance(s)], [house], [_wall("ground_plain")], seed=0)
    assert made.counts["house_numbers"] == numbers
    plates = [surface for surface in made.surfaces if surface.material.name == "signs_0"]
    assert len(plates) == numbers
    for plate in plates:
        assert _along(plate).min() >= 0.0
        assert _along(plate).max() <= 18.0
        assert np.abs(_along(plate) - s).min() < 2.2
        assert 10.0 + 1.8 < plate.positions[:, 2].min() < plate.positions[:, 2].max() < 10.0 + 2.4


def test_the_sign_reads_from_left_to_right_and_stands_upright() -> None:
    made = street_fronts([_shop()], [_entrance(7.5)], [_building()], [_wall("ground_shops")], seed=0)
    sign = next(surface for surface in made.surfaces if surface.material.name == "signs_0")
    front = np.flatnonzero(sign.normals[:, :2] @ _OUT > 0.99)[:4]
    s, z = _along(sign)[front], sign.positions[front, 2]
    assert np.argmin(s) in np.flatnonzero(sign.uv[front, 0] == sign.uv[front, 0].min())
    assert sign.uv[front[np.argmax(s)], 0] > sign.uv[front[np.argmin(s)], 0]
    assert sign.uv[front[np.argmax(z)], 1] > sign.uv[front[np.argmin(z)], 1]
    assert z.min() > 10.0 + 2.2
    assert z.max() < 14.0
    assert made.counts["signs"] == 1
    assert made.counts["shop_fronts"] == 1
    # The board keeps its shape: metres a texel are the same both ways.
    texture = sign.material.texture
    assert texture is not None
    wide = np.ptp(s) / (np.ptp(sign.uv[front, 0]) * texture.shape[1])
    tall = np.ptp(z) / (np.ptp(sign.uv[front, 1]) * texture.shape[0])
    assert wide == pytest.approx(tall, rel=0.03)


def test_neighbouring_shops_share_a_bay_without_overlapping() -> None:
    entrances = [_entrance(6.8, "e1"), _entrance(9.6, "e2")]
    places = [_shop(), _shop("Second Hand", "e2", "n2", "clothes")]
    made = street_fronts(places, entrances, [_building()], [_wall("ground_shops")], seed=0)
    doors = next(surface for surface in made.surfaces if surface.material.name == "doors")
    backing = np.flatnonzero(np.abs(_away(doors) - 0.03) < 1e-3)
    spans = sorted((_along(doors)[q].min(), _along(doors)[q].max()) for q in backing.reshape(-1, 4))
    assert len(spans) == 2
    assert spans[0][1] < spans[1][0]
    assert made.counts["signs"] >= 2


def test_an_entrance_without_a_wall_still_has_its_door() -> None:
    made = street_fronts([_shop()], [_entrance(5.0)], [_building()], [], seed=0)
    assert made.counts["doors"] == 1
    assert sum(len(surface.triangles) for surface in made.surfaces) > 10


def test_fronts_are_the_same_for_the_same_seed() -> None:
    def bytes_of(seed: int) -> list[bytes]:
        made = street_fronts([_shop()], [_entrance(7.5)], [_building()], [_wall("ground_cafes")], seed=seed)
        return [surface.positions.tobytes() + surface.uv.tobytes() for surface in made.surfaces]

    assert bytes_of(3) == bytes_of(3)


def test_of_two_houses_fronts_in_one_plane_the_later_one_is_left_out() -> None:
    other = _building("residential").model_copy(update={"id": "w2", "entity": 1001})
    doors = [_entrance(7.0), _entrance(7.5, "e2").model_copy(update={"building": "w2"})]
    with collect_losses() as losses:
        made = street_fronts([], doors, [_building("residential"), other], [_wall("ground_plain")], seed=0)
    assert losses.ids == {"e2"}
    assert made.counts["doors"] == 1
    assert {int(entity) for surface in made.surfaces for entity in surface.entity} == {1000}


@pytest.mark.parametrize("seed", range(6))
def test_a_pharmacy_s_cross_hangs_below_the_fascia_and_beside_the_front(seed: int) -> None:
    shop = _shop("Apteekki", kind="pharmacy")
    made = street_fronts([shop], [_entrance(9.0)], [_building()], [_wall("ground_rusticated")], seed=seed)
    doors = next(surface for surface in made.surfaces if surface.material.name == "doors")
    left, low, right, high = cell_uv("cross")
    of_cross = (doors.uv >= (left - 1e-4, low - 1e-4)).all(axis=1) & (doors.uv <= (right + 1e-4, high + 1e-4)).all(
        axis=1
    )
    cross = of_cross & (np.abs(doors.normals[:, :2] @ _RIGHT) > 0.99)
    assert cross.any()
    boards = [surface for surface in made.surfaces if surface.material.name.startswith("signs")]
    lowest_letter = min(float(surface.positions[:, 2].min()) for surface in boards)
    assert doors.positions[cross, 2].max() <= lowest_letter
    assert doors.positions[cross, 2].min() > 12.1
    assert _away(doors)[cross].max() < 1.0
