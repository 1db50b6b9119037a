"""Lamps light what is around them: ground, walls and people, at night, while they have power."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from vico.assets.shapes import box, pose_matrix
from vico.assets.vehicles import night_lamps
from vico.render import Cameras, Lighting, Scene, render
from vico.render.view import ViewCache
from vico.render.world_scene import HEAD, placed_lamps, shop_lamps, with_lit_heads
from vico.world.mesh import Material, Surface

NIGHT, DAY = Lighting.at(23 * 3600), Lighting.at(12 * 3600)
POST = [
    box((0.1, 0.1, 6.0), (0, 0, 3.0), colour=(80, 80, 80)),
    box((0.6, 0.2, 0.03), (0.5, 0, 6.0), colour=(250, 240, 210)),
]
GROUND, HOUSE, SHOP = 2, 10, 11


def street() -> Scene:
    """A lamp 4 m before a house that is 10 m deep, and a shop's window 40 m up the street."""
    pane = box((0.2, 8, 3), (6, 40, 1.5)).of_entity(SHOP)
    shop = replace(pane, material=Material("ground_shops", emission=1.0), uv=pane.positions[:, 1:])
    static = [box((160, 160, 1), (0, 0, -0.5)).of_entity(GROUND), box((10, 14, 12), (11, 0, 6)).of_entity(HOUSE), shop]
    models = {"post": with_lit_heads(POST)}
    made = Scene(static, models, lighting=NIGHT)
    where = pose_matrix(2.0, 0.0, 0.0, 0.0)[None]
    made.place(["post"], where, [20])
    made.lamps = np.concatenate([placed_lamps(models, ["post"], where), shop_lamps(static, ("ground_shops",))])
    return made


@pytest.fixture(scope="module")
def scene() -> Scene:
    return street()


def bright(scene: Scene, x: float, y: float, toward: tuple[float, float, float] = (0.0, 0.0, -1.0)) -> float:
    """Brightness of what is seen from 2 m up at a point."""
    ahead, up = np.array([toward]), (1.0, 0.0, 0.0) if toward[2] else (0.0, 0.0, 1.0)
    camera = Cameras(np.array([[x, y, 2.0]]), ahead, up=up, width=16, height=16, fov_y=0.2)
    return float(render(scene, camera, threads=1).rgb.mean())


def test_ground_and_walls_are_lit_by_the_lamp_before_them(scene: Scene) -> None:
    below, far = bright(scene, 2.5, 0.3), bright(scene, 2.5, -40.0)
    assert below > 2.0 * far
    steps: NDArray[np.float64] = np.array([bright(scene, 2.5, -float(y)) for y in range(1, 24, 2)])
    assert (np.diff(steps) <= 1.0).all()  # a pool without rings
    front, back = bright(scene, 3.0, 1.0, (1.0, 0.0, 0.0)), bright(scene, 19.0, 1.0, (-1.0, 0.0, 0.0))
    assert front > 1.5 * back
    # No light comes through the house, though the lamp reaches that far.
    assert bright(scene, 19.0, 0.0) < far + 2.0


def test_by_day_lamps_change_no_byte(scene: Scene) -> None:
    camera = Cameras(np.array([[-8.0, -3.0, 1.6]]), np.array([[1.0, 0.2, 0.0]]), width=64, height=64)
    pictures = []
    for lamps in (scene.lamps, scene.lamps[:0]):
        bare = street()
        bare.lamps, bare.lighting = lamps, DAY
        pictures.append(render(bare, camera).rgb)
    np.testing.assert_array_equal(*pictures)


def test_lamps_go_out_with_the_power_and_shops_with_their_windows(scene: Scene) -> None:
    lit, shop = bright(scene, 2.5, 0.3), bright(scene, 4.5, 40.0)
    dark = bright(scene, -30.0, -30.0)
    assert shop > 1.3 * dark
    scene.lighting = replace(NIGHT, unlit=(0.0, 0.0, 15.0))
    assert bright(scene, 2.5, 0.3) < dark + 2.0
    assert bright(scene, 4.5, 40.0) == shop
    scene.lighting = NIGHT
    scene.light_windows([SHOP, HOUSE], [[1.0, 0.0], [1.0, 1.0]])
    assert bright(scene, 4.5, 40.0) < dark + 2.0
    assert bright(scene, 2.5, 0.3) == lit
    scene.light_windows(None)


def test_bright_parts_high_up_are_what_shines_in_a_lamp() -> None:
    heads = [surface for surface in with_lit_heads(POST) if surface.material is HEAD]
    assert sum(len(surface.triangles) for surface in heads) == 12
    glass = [Surface.from_triangles(np.eye(3), np.array([[0, 1, 2]]), material=Material("glass", emission=0.5))]
    assert with_lit_heads(glass) == glass
    lamp = placed_lamps({"post": heads}, ["post"], pose_matrix(3.0, 1.0, 5.0, np.pi / 2)[None])[0]
    assert [float(lamp[name]) for name in "xyz"] == pytest.approx([3.0, 1.5, 11.0])


def test_headlights_light_what_is_ahead_also_for_an_eye_that_stands_still() -> None:
    ground = box((160, 160, 1), (0, 0, -0.5)).of_entity(GROUND)
    made = Scene([ground], {"car": [night_lamps("sedan")]}, lighting=NIGHT)
    eye, cache = Cameras(np.array([[0.0, -12.0, 3.0]]), np.array([[0.0, 1.0, -0.2]]), width=64, height=64), ViewCache()
    for x in (-12.0, -8.0, -4.0):
        made.set_rigid([0], pose_matrix(x, 0.0, 0.0, 0.0)[None], [30])
        np.testing.assert_array_equal(render(made, eye, cache=cache).rgb, render(made, eye).rgb)
    ahead, behind = bright(made, 6.0, 0.0), bright(made, -14.0, 0.0)
    assert ahead > 1.2 * behind
    made.lighting = DAY
    assert bright(made, 6.0, 0.0) == pytest.approx(bright(made, -14.0, 0.0), abs=0.5)
