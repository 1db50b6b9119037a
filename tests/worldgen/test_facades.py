"""Facades: whole bays, aligned storeys, cuts that keep meshes closed, doors where entrances are."""

import math

import numpy as np
import pytest

from vico.world.model import Building, Entrance
from vico.world.seeds import rng
from vico.worldgen.facades import (
    bay_coordinates,
    bays,
    colour_of,
    cut_at_heights,
    door_surfaces,
    look_of,
    storey_coordinates,
)
from vico.worldgen.roofs import Roof, building_solid
from vico.worldgen.textures import _PAINTERS, BAYS, STOREYS, material


def test_a_wall_holds_a_whole_number_of_bays() -> None:
    length = rng(0, "walls").uniform(1.5, 80, 200)
    count = bays(length, np.full(200, 3.0))
    end = bay_coordinates(length, length, count) * BAYS
    assert np.allclose(end, np.round(end))
    assert (np.abs(length / count - 3.0) < 1.5).all()


def test_storeys_begin_and_end_on_whole_texture_rows() -> None:
    low, high, count = np.array([4.0]), np.array([17.0]), np.array([4.0])
    z = np.array([4.0, 7.25, 10.5, 13.75, 17.0])
    assert np.allclose(storey_coordinates(z, low, high, count) * STOREYS, [0, 1, 2, 3, 4])


def test_a_cut_leaves_every_edge_with_its_counterpart() -> None:
    import shapely

    solid = building_solid(shapely.box(-8, -5, 8, 5), 0.0, 6.0, Roof("gabled", 3.0)).to_mesh64()
    points = np.asarray(solid.vert_properties)[:, :3]
    faces = np.asarray(solid.tri_verts, np.int64)
    owner = np.zeros(len(faces), np.int64)
    for height in (3.5, 6.0, 7.7):
        points, faces, owner = cut_at_heights(points, faces, owner, np.array([height]))
        z = points[faces][..., 2] - height
        assert not ((z.max(axis=1) > 1e-3) & (z.min(axis=1) < -1e-3)).any()
    edges = {(int(a), int(b)) for face in faces for a, b in zip(face, np.roll(face, -1), strict=True)}
    assert len(edges) == 3 * len(faces)
    assert all((b, a) in edges for a, b in edges)


@pytest.mark.parametrize("name", sorted(_PAINTERS))
def test_textures_have_sides_of_powers_of_two_and_something_to_see(name: str) -> None:
    texture = material(name).texture
    assert texture is not None
    assert all(math.log2(side).is_integer() for side in texture.shape[:2])
    assert texture.std() > 1.0


def test_textures_are_painted_alike_each_time() -> None:
    a, b = material("wall_classic", 5).texture, material("wall_classic", 5).texture
    c = material("wall_classic", 6).texture
    assert a is not None
    assert b is not None
    assert c is not None
    assert np.array_equal(a, b)
    assert not np.array_equal(a, c)


def test_there_are_few_materials() -> None:
    assert sum(name.startswith(("wall", "ground_", "blank", "roof", "door")) for name in _PAINTERS) <= 25


def test_a_tagged_colour_tints_the_wall() -> None:
    red = look_of(
        "residential", {"building:colour": "#ff0000"}, levels=4, area=300, region="northern", random=rng(0, "a")
    )
    assert red.tint[0] > 250
    assert red.tint[1] < 140


@pytest.mark.parametrize(
    ("text", "expected"),
    [("#abc", (170, 187, 204)), ("#102030", (16, 32, 48)), ("White", (250, 250, 248)), ("#12", None), (None, None)],
)
def test_colours_of_tags_are_read(text: str | None, expected: tuple[int, int, int] | None) -> None:
    assert colour_of(text) == expected


def test_material_tags_decide_the_wall() -> None:
    look = look_of("office", {"building:material": "brick"}, levels=4, area=300, region="northern", random=rng(0, "a"))
    assert look.wall == "wall_brick"


def test_doors_stand_proud_of_the_wall_at_their_entrance() -> None:
    building = Building(
        id="w1",
        entity=1000,
        name=None,
        use="retail",
        footprint=[[(0, 0), (10, 0), (10, 8), (0, 8)]],
        base=2.0,
        height=9.0,
        levels=2,
        roof_shape="flat",
        colour="#ffffff",
        accessible=True,
    )
    door = Entrance(id="e1", building="w1", position=(4.0, 0.0, 2.0), facing=-math.pi / 2, approach=(4.0, -1.0))
    surfaces = door_surfaces([door], [building])
    glazed = next(s for s in surfaces if s.material.name == "door_glass")
    assert glazed.positions[:, 1].max() < -0.02
    assert glazed.positions[:, 0].mean() == pytest.approx(4.0)
    assert glazed.positions[:, 2].min() == pytest.approx(2.06, abs=0.01)
    assert np.allclose(glazed.normals, (0, -1, 0), atol=1e-6)
    assert all((s.entity == 1000).all() for s in surfaces)
