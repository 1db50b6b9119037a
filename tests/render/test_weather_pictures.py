"""What weather adds to pictures: mirrors on wet ground, snow on what looks up, drops and flakes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from vico.render import Cameras, Lighting, render
from vico.render.scene import Scene
from vico.world.mesh import Surface

SIDE = 128
OVERCAST = Lighting(clouds=1.0, sun_colour=(0.0, 0.0, 0.0))
GROUND, WALL, PERSON = 1, 2, 3


def quad(corners: list[tuple[float, float, float]], entity: int, colour: tuple[int, int, int]) -> Surface:
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    return Surface.from_triangles(np.array(corners), faces, entity=entity, colour=colour)


@pytest.fixture(scope="module")
def scene() -> Scene:
    """Grey ground, and a red wall 12 m before a camera at the origin; a person stands between, to the left."""
    ground = quad([(-40, -40, 0), (40, -40, 0), (40, 40, 0), (-40, 40, 0)], GROUND, (120, 120, 120))
    wall = quad([(12, 40, 0), (12, -40, 0), (12, -40, 9), (12, 40, 9)], WALL, (200, 40, 30))
    made = Scene([ground, wall])
    # A table of a person: what looks up of somebody is not snowed in.
    top = quad([(5, 1.0, 0.9), (6, 1.0, 0.9), (6, 2.0, 0.9), (5, 2.0, 0.9)], PERSON, (30, 60, 160))
    made.set_skinned(top.positions, top.normals, top.triangles, top.colour, top.entity)
    return made


def seen(scene: Scene, light: Lighting, moment: float = 0.0) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    scene.lighting, scene.moment = light, moment
    cameras = Cameras(np.array([[0.0, 0.0, 1.6]]), np.array([[1.0, 0.0, 0.0]]), width=SIDE, height=SIDE)
    frames = render(scene, cameras)
    return frames.rgb[0].astype(float), frames.segmentation[0]


def test_wet_ground_is_darker_and_mirrors_what_stands_behind_it(scene: Scene) -> None:
    dry, entity = seen(scene, OVERCAST)
    wet, _ = seen(scene, replace(OVERCAST, wet=1.0))
    ground = entity == GROUND
    near, far = ground.copy(), ground.copy()
    near[: SIDE - 12], far[SIDE // 2 + 14 :] = False, False
    assert wet[near].mean() < 0.85 * dry[near].mean()
    redness = (wet[..., 0] - wet[..., 2]) - (dry[..., 0] - dry[..., 2])
    assert redness[far].mean() > 12.0
    assert redness[far].mean() > 3.0 * redness[near].mean()
    # Walls mirror nothing, but for the row of pixels that touches the ground.
    wall = (entity == WALL) & (np.roll(entity, -2, axis=0) == WALL)
    assert (dry[wall] >= wet[wall]).all()


def test_wet_ground_mirrors_no_sky_where_an_umbrella_hides_the_wall_it_mirrors() -> None:
    ground = quad([(-40, -40, 0), (40, -40, 0), (40, 40, 0), (-40, 40, 0)], GROUND, (120, 120, 120))
    wall = quad([(39, 40, 0), (39, -40, 0), (39, -40, 20), (39, 40, 20)], WALL, (200, 40, 30))
    hung = quad([(4, 1, 1.5), (4, -1, 1.5), (4, -1, 2.3), (4, 1, 2.3)], PERSON, (30, 60, 160))
    open_view, entity = seen(Scene([ground, wall]), replace(OVERCAST, wet=1.0))
    hidden, _ = seen(Scene([ground, wall, hung]), replace(OVERCAST, wet=1.0))
    far = (entity == GROUND) & (np.arange(SIDE) < SIDE // 2 + 9)[:, None]
    assert np.abs(hidden - open_view)[far].max() < 30.0
    assert hidden[far].mean(axis=0) == pytest.approx(open_view[far].mean(axis=0), abs=6.0)


def test_snow_lies_on_the_ground_and_neither_on_walls_nor_on_people(scene: Scene) -> None:
    bare, entity = seen(scene, OVERCAST)
    snowy, _ = seen(scene, replace(OVERCAST, snow_cover=1.0))
    assert snowy[entity == GROUND].mean() > bare[entity == GROUND].mean() + 40.0
    half, _ = seen(scene, replace(OVERCAST, snow_cover=0.5))
    assert bare[entity == GROUND].mean() < half[entity == GROUND].mean() < snowy[entity == GROUND].mean()
    for other in (WALL, PERSON):
        np.testing.assert_array_equal(snowy[entity == other], bare[entity == other])


@pytest.mark.parametrize("falls", [{"rain": 10.0}, {"snowfall": 3.0}])
def test_what_falls_follows_the_moment_alone_and_only_lightens(scene: Scene, falls: dict[str, float]) -> None:
    dry, _ = seen(scene, OVERCAST)
    one, _ = seen(scene, replace(OVERCAST, **falls), 100.0)
    later, _ = seen(scene, replace(OVERCAST, **falls), 101.3)
    again, _ = seen(scene, replace(OVERCAST, **falls), 100.0)
    np.testing.assert_array_equal(one, again)
    assert (one >= dry).all()
    assert 0.002 < (one != dry).any(axis=2).mean() < 0.3
    assert not np.array_equal(one, later)


def test_depth_and_segmentation_know_nothing_of_weather(scene: Scene) -> None:
    _, dry = seen(scene, OVERCAST)
    _, wet = seen(scene, replace(OVERCAST, wet=1.0, rain=20.0, snow_cover=0.5))
    np.testing.assert_array_equal(dry, wet)
