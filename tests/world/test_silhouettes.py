"""Tiles from afar: few triangles, where the tile's own things are and of the colours that these have."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
import shapely

from vico.errors import InputError
from vico.world.far_colours import BAYS, LINEAR, STOREYS, WINDOWS, WINDOWS_MEAN, srgb
from vico.world.heights import HeightField
from vico.world.mesh import Material, Surface, merge_surfaces
from vico.world.model import ENTITY_GROUND, FIRST_BUILDING, FIRST_OBJECT, Building
from vico.world.objects import Objects
from vico.world.silhouettes import FAR, silhouette_of
from vico.world.world import World


@pytest.fixture(scope="module")
def far(helsinki: World) -> Surface:
    """The silhouette of 300 m x 300 m of Helsinki."""
    return _in_one(silhouette_of(helsinki))


def _in_one(surfaces: list[Surface]) -> Surface:
    """Return surfaces as one, whatever they are of; colours are those from afar."""
    seen = []
    for surface in surfaces:
        shown = WINDOWS_MEAN if surface.material is WINDOWS else 1.0
        seen.append(replace(surface, colour=srgb(LINEAR[surface.colour] * shown), material=Material(FAR)))
    (one,) = merge_surfaces(seen)
    return one


def _made(world: World, like: Building, walls: Surface, roofs: Surface) -> World:
    ground = Surface.from_triangles(
        [[-50, -50, 0], [50, -50, 0], [50, 50, 0], [-50, 50, 0]], [[0, 1, 2], [0, 2, 3]], entity=ENTITY_GROUND
    )
    manifest = world.manifest.model_copy(update={"half": 50.0})
    layers = {"ground": [ground], "buildings": [walls], "roofs": [roofs]}
    return World(
        manifest, height=HeightField.flat(50.0), buildings=[like], objects=Objects.none(), models={}, layers=layers
    )


def test_a_few_triangles_each(helsinki: World, far: Surface) -> None:
    assert [surface.material.name for surface in silhouette_of(helsinki)] == [FAR, WINDOWS.name]
    of = Counter(far.entity[far.triangles[:, 0]].tolist())
    houses = [of[b.entity] for b in helsinki.buildings]
    assert min(houses) > 0
    assert np.mean(houses) < 30
    trees = helsinki.objects.where((helsinki.objects.kind == "tree") & helsinki.objects.outdoors)
    assert len(trees)
    assert all(of[entity] == 8 for entity in trees.entity.tolist())
    assert set(of) <= set(helsinki.entities)
    assert not set(of) - {1, 2, 3, 4} - {b.entity for b in helsinki.buildings} - set(trees.entity.tolist())


def test_houses_stand_where_they_are_and_are_as_high(helsinki: World, far: Surface) -> None:
    for building in helsinki.buildings:
        own = far.positions[far.entity == building.entity].astype(np.float64)
        outline = shapely.Polygon(building.footprint[0])
        away = shapely.distance(outline, shapely.points(own[:, :2]))
        assert away.max() < 8.0
        top = building.base + building.height
        assert own[:, 2].max() <= top + 1e-3
        assert own[:, 2].max() > building.base + 0.7 * building.height
        assert own[:, 2].min() < building.base + 1e-3


def test_the_ground_meets_its_neighbours(helsinki: World, far: Surface) -> None:
    half = helsinki.half
    ground = far.positions[far.entity < FIRST_BUILDING].astype(np.float64)
    assert np.abs(ground[:, :2]).max() == half
    border = ground[(np.abs(ground[:, :2]) == half).any(axis=1)]
    corners = np.unique(border[:, :2], axis=0)
    assert len(corners) == 4 * round(2 * half / 12.5)
    heights = helsinki.height(corners)
    for corner, height in zip(corners, heights, strict=True):
        at = border[(border[:, :2] == corner).all(axis=1), 2]
        assert at.max() == pytest.approx(height, abs=1e-4)


def test_triangles_face_outward(helsinki: World, far: Surface) -> None:
    corners = far.positions[far.triangles].astype(np.float64)
    turn = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.linalg.norm(turn, axis=1) > 0.0).all()
    assert ((turn * far.normals[far.triangles[:, 0]]).sum(axis=1) > 0.0).all()
    assert np.allclose(np.linalg.norm(far.normals, axis=1), 1.0, atol=1e-4)
    # Of a closed thing without its underside everything slopes up or stands.
    houses = (far.entity >= FIRST_BUILDING) & (far.entity < FIRST_OBJECT)
    assert far.normals[houses, 2].min() > -1e-3


def test_windows_darken_a_wall_in_linear_light(helsinki: World) -> None:
    picture = np.zeros((64, 64, 3), np.uint8)
    picture[:, ::2] = 255  # half of the light
    foot = [(-10.0, -5.0), (10.0, -5.0), (10.0, 5.0), (-10.0, 5.0)]
    points = [(*foot[k % 4], z) for k in range(4) for z in (0.0, 9.0)]
    uv = np.array([(3.5 * k, 2.0 * z) for k in range(4) for z in (0, 1)])
    faces = [(2 * k, (2 * k + 2) % 8, (2 * k + 3) % 8) for k in range(3)]
    walls = Surface.from_triangles(
        points, faces, uv=uv, colour=(255, 255, 255), entity=1000, material=Material("wall", picture)
    )
    lid = [(*xy, 9.0) for xy in foot]
    roofs = Surface.from_triangles(lid, [(0, 1, 2), (0, 2, 3)], colour=(90, 30, 30), entity=1000)
    like = helsinki.buildings[0].model_copy(
        update={
            "entity": 1000, "footprint": [foot], "base": 0.0, "height": 9.0, "roof_shape": "flat", "tags": {},
        }
    )  # fmt: skip
    (far,) = silhouette_of(_made(helsinki, like, walls, roofs))
    own = far.entity == 1000
    upright = own & (np.abs(far.normals[:, 2]) < 0.5)
    assert np.unique(far.colour[upright], axis=0).tolist() == [[188, 188, 188]]
    assert np.unique(far.colour[own & (far.normals[:, 2] > 0.5)], axis=0).tolist() == [[90, 30, 30]]
    assert far.positions[own, 2].max() == 9.0
    assert own.sum() == 3 * 10
    ground = far.entity == ENTITY_GROUND
    assert np.unique(far.colour[ground], axis=0).tolist() == [[200, 200, 200]]


def test_colours_lie_between_those_of_the_tile(helsinki: World, far: Surface) -> None:
    houses = (far.entity >= FIRST_BUILDING) & (far.entity < FIRST_OBJECT)
    walls = far.colour[houses & (np.abs(far.normals[:, 2]) < 0.1)].mean(axis=0)
    lightest = np.array([[int(b.colour[k : k + 2], 16) for k in (1, 3, 5)] for b in helsinki.buildings]).mean(axis=0)
    assert (walls < lightest).all()
    assert (walls > 0.45 * lightest).all()


def test_it_is_the_same_every_time(helsinki: World, far: Surface) -> None:
    again = _in_one(silhouette_of(helsinki))
    for name in ("positions", "normals", "colour", "entity", "triangles"):
        assert np.array_equal(getattr(again, name), getattr(far, name))


def test_a_world_without_size_has_no_silhouette(helsinki: World) -> None:
    nowhere = World(helsinki.manifest.model_copy(update={"half": 0.0}))
    with pytest.raises(InputError, match="half side"):
        silhouette_of(nowhere)


def test_walls_whose_windows_shine_have_windows_from_afar(helsinki: World) -> None:
    picture = np.full((64, 64, 4), 255, np.uint8)
    picture[:32, :, 3] = 64
    picture[32:, :, 3] = 0
    foot = [(-10.0, -5.0), (10.0, -5.0), (10.0, 5.0), (-10.0, 5.0)]
    points = [(*foot[k % 4], z) for k in range(4) for z in (0.0, 9.0)]
    uv = np.array([(3.0 * k, z) for k in range(4) for z in (0, 1)])
    blind = Surface.from_triangles(
        points, [(0, 2, 3), (0, 3, 1)], uv=uv, entity=1000, material=Material("blind", picture[..., :3])
    )
    glazed = Surface.from_triangles(
        points, [(2, 4, 5), (2, 5, 3), (4, 6, 7), (4, 7, 5), (6, 0, 1), (6, 1, 7)], uv=uv, colour=(150, 150, 150),
        entity=1000, material=Material("glazed", picture, emission=1.0),
    )  # fmt: skip
    walls = merge_surfaces([blind, glazed])
    like = helsinki.buildings[0].model_copy(
        update={
            "entity": 1000, "footprint": [foot], "base": 0.0, "height": 9.0, "roof_shape": "flat", "tags": {},
        }
    )  # fmt: skip
    lid = Surface.from_triangles([(*xy, 9.0) for xy in foot], [(0, 1, 2), (0, 2, 3)], entity=1000)
    world = _made(helsinki, like, walls[0], lid)
    world = World(
        world.manifest, height=HeightField.flat(50.0), buildings=[like], objects=Objects.none(), models={},
        layers={"ground": world.surfaces("ground"), "buildings": walls, "roofs": [lid]},
    )  # fmt: skip
    plain, windows = silhouette_of(world)
    assert windows.material is WINDOWS
    # Not on the southern wall, which is blind.
    assert windows.normals[:, 1].min() > -0.5
    assert len(windows.triangles) == 6
    assert plain.normals[:, 1].min() < -0.5
    # Seen from afar the wall has the colour it had.
    seen = srgb(LINEAR[windows.colour] * WINDOWS_MEAN)
    assert np.abs(seen.astype(int) - 150).max() <= 1
    corners = windows.uv[windows.triangles].astype(np.float64) * (BAYS, STOREYS)
    ground, head = corners[..., 1].min(axis=1), corners[..., 1].max(axis=1)
    assert np.allclose(head % 1.0, 0.0, atol=1e-5)
    assert ((head - ground >= 3.0) & (head - ground < 3.5)).all()
    wide = corners[..., 0].max(axis=1) - corners[..., 0].min(axis=1)
    assert sorted(wide.round(4).tolist()) == [3.0] * 4 + [6.0] * 2
