"""The rules that the shader applies to every pixel, one at a time."""

import numpy as np
import pytest

from vico.assets.shapes import box
from vico.render import Cameras, Lighting, Scene, render
from vico.render.shading.shade import sky_visibility
from vico.render.shadows.moving import _ball_shadow, _box_shadow, _contact_shadow
from vico.render.uniforms import ReliefMap, camera_uniforms, light_uniforms
from vico.render.visibility.rasteriser import (
    PictureSize,
    ScreenPoint,
    ScreenTriangle,
    fill,
    inverse_depth,
    triangle_number,
)
from vico.world.mesh import Material, Surface

ZERO, ONE = np.float32(0.0), np.float32(1.0)
UP = ZERO, ZERO, ONE
SOFT = ONE  # of the edges of shadows


def single(*values: float) -> tuple[np.float32, ...]:
    return tuple(np.float32(value) for value in values)


def test_a_triangle_fills_the_pixels_whose_centres_it_holds_with_its_depth() -> None:
    width, height = 16, 12
    keys = np.zeros(width * height + 8, np.uint64)
    corners = ScreenPoint(2.0, 1.0, 0.5), ScreenPoint(14.0, 1.0, 0.5), ScreenPoint(2.0, 11.0, 0.25)
    fill(keys, PictureSize(width, height), ScreenTriangle(*corners), 7)
    row, column = np.mgrid[0:height, 0:width] + 0.5
    # Right angle at (2, 1), legs of 12 columns and 10 rows; no centre lies on the long side.
    inside = (column > 2) & (row > 1) & ((column - 2) / 12 + (row - 1) / 10 < 1)
    picture = keys[: width * height].reshape(height, width)
    numbers = np.array([[triangle_number(key) for key in line] for line in picture])
    assert np.array_equal(numbers == 7, inside)
    depth = np.array([[inverse_depth(key) for key in line] for line in picture])
    np.testing.assert_allclose(depth[inside], (0.5 - 0.025 * (row - 1))[inside], rtol=1e-6)


def test_the_nearer_triangle_wins_whatever_the_order() -> None:
    size = PictureSize(8, 8)

    def triangle(w: float) -> ScreenTriangle:
        return ScreenTriangle(ScreenPoint(0.0, 0.0, w), ScreenPoint(8.0, 0.0, w), ScreenPoint(0.0, 8.0, w))

    for order in ((1, 2), (2, 1)):
        keys = np.zeros(72, np.uint64)
        for number in order:
            fill(keys, size, triangle(float(number)), number)
        assert triangle_number(keys[0]) == 2


@pytest.mark.parametrize(
    ("point", "expected"),
    [
        ((0.0, 0.0, -3.0), 1.0),  # the sun is right above a ball: its whole width is in the way
        ((0.0, 0.0, 3.0), 0.0),  # above it
        ((1.01, 0.0, -3.0), 0.0),  # beside it
    ],
)
def test_a_ball_darkens_what_lies_behind_it(point: tuple[float, float, float], expected: float) -> None:
    assert _ball_shadow(*single(*point), *UP, SOFT) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("point", "expected"), [((0.9, -0.9, -3.0), 1.0), ((0.9, -0.9, 1.5), 0.0), ((1.1, 0.0, -3.0), 0.0)]
)
def test_a_box_darkens_what_lies_behind_it(point: tuple[float, float, float], expected: float) -> None:
    assert _box_shadow(*single(*point), *UP, SOFT) == pytest.approx(expected)


def test_the_shadow_at_the_foot_fades_sideways_and_upwards() -> None:
    # The values follow from the rule: gain 1.5 (round) and 4 (box), edges at 2 and 1.25 half widths, 0.75 at most.
    assert _contact_shadow(*single(0.0, 0.0, 0.0), True) == pytest.approx(0.75)
    assert _contact_shadow(*single(1.0, 0.0, 0.25), True) == pytest.approx(1.5 * 0.5 * 0.5)
    assert _contact_shadow(*single(2.0, 0.0, 0.0), True) == 0.0
    assert _contact_shadow(*single(1.24, 1.0, 0.0), False) == pytest.approx(4 * 0.01 / 1.25, rel=1e-4)


def test_a_point_between_high_walls_sees_less_sky() -> None:
    relief = ReliefMap(np.full((4, 4), 10.0, np.float32), -8.0, -8.0, 0.25)
    assert sky_visibility(relief.height, relief, 0.0, 0.0, 12.0) == 1.0
    # 5 m below the blurred heights around it: half of the 62 % that can be lost.
    assert sky_visibility(relief.height, relief, 0.0, 0.0, 5.0) == pytest.approx(1 - 0.31)
    assert sky_visibility(relief.height, relief, 100.0, 0.0, 0.0) == 1.0


def test_uniforms_say_what_the_camera_and_the_light_are() -> None:
    cameras = Cameras(np.array([[1.0, 2, 3]]), np.array([[0.0, 2, 0]]), width=64, height=32, hidden_entity=9)
    camera = camera_uniforms(cameras, 0, 2, None)
    assert (camera["x"], camera["y"], camera["z"]) == (1, 2, 3)
    assert (camera["right_x"], camera["down_z"], camera["forward_y"]) == (1, -1, 1)
    assert (camera["width"], camera["height"], camera["centre_x"], camera["centre_y"]) == (128, 64, 64, 32)
    assert camera["focal"] == pytest.approx(32)  # half the picture's height at 90 degrees
    assert (camera["hidden_entity"], camera["indoors"]) == (9, 0)
    light = light_uniforms(Lighting(sun_direction=(0.0, 0, 5), fog=500.0, exposure=0.5, sun_colour=(2.0, 1, 0)))
    assert (light["sun_x"], light["sun_y"], light["sun_z"]) == (0, 0, 1)
    assert (light["sun_red"], light["sun_green"], light["sun_blue"]) == (1, 0.5, 0)
    assert light["haze_per_metre"] == pytest.approx(1 / 500)


def test_a_body_is_not_seen_by_the_camera_it_carries_alone() -> None:
    scene = Scene([box((60, 60, 0.2), (0, 0, -0.1)).of_entity(1)], {"post": [box((0.4, 0.4, 1.8), (0, 0, 0.9))]})
    pose = np.eye(4)
    pose[0, 3] = 4.0
    scene.set_rigid([0], pose[None], [50])
    cameras = Cameras(np.tile([0.0, 0, 1.6], (2, 1)), np.tile([1.0, 0, -0.1], (2, 1)), hidden_entity=[50, 0])
    seen = render(scene, cameras).segmentation
    assert 50 not in seen[0]
    assert 50 in seen[1]


def test_holes_of_a_texture_let_what_lies_behind_be_seen() -> None:
    texture = np.full((8, 8, 4), 200, np.uint8)
    texture[:, 4:, 3] = 0
    quad = np.array([[5.0, -4, -4], [5, 4, -4], [5, 4, 4], [5, -4, 4]])
    uv = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    leaf = Material("leaf", texture, cutout=True, double_sided=True)
    fence = Surface.from_triangles(quad, np.array([[0, 1, 2], [0, 2, 3]]), uv=uv, entity=3, material=leaf)
    scene = Scene([fence, box((0.2, 40, 40), (9, 0, 0)).of_entity(4)])
    middle = render(scene, Cameras(np.zeros((1, 3)), np.array([[1.0, 0, 0]])), rgb=False).segmentation[0, 128]
    # Looking east, left in the picture is north (y > 0), where u > 0.5 and the texture has its hole.
    assert (middle[30:125] == 4).all()
    assert (middle[131:225] == 3).all()
