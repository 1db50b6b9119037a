"""How things look: textures, light and shadow, sizes, and the same bytes however many threads work."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from vico.assets.shapes import ball, box, pose_matrix
from vico.assets.transit_vehicles import bus, bus_cabin
from vico.assets.vehicle_parts import Cabin
from vico.render import Cameras, Lighting, Scene, render, render_top_down
from vico.render.limbs import LIMBS
from vico.world.mesh import Material, Surface, merge_surfaces

AHEAD = np.array([[1.0, 0, 0]])


def quad(material: Material, *, colour: tuple[int, int, int] = (255, 255, 255)) -> Surface:
    """A wall 10 m ahead that just fills a 90 degree view; u runs to the right, v up."""
    points = np.array([[10.0, 10, -10], [10, -10, -10], [10, -10, 10], [10, 10, 10]])
    uv = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    return Surface.from_triangles(
        points, np.array([[0, 1, 2], [0, 2, 3]]), uv=uv, entity=1, material=material, colour=colour
    )


def test_texture_row_0_is_at_v_0_and_column_0_at_u_0() -> None:
    texture = np.zeros((64, 64, 3), np.uint8)
    texture[:32, :32] = (255, 0, 0)  # low u, low v
    texture[32:, 32:] = (0, 0, 255)  # high u, high v
    seen = render(Scene([quad(Material("chart", texture))]), Cameras(np.zeros((1, 3)), AHEAD)).rgb[0].astype(int)
    lower_left, upper_right = seen[200, 50], seen[50, 200]
    assert lower_left[0] > 100
    assert lower_left[1:].max() < 90
    assert upper_right[2] > 100
    assert upper_right[:2].max() < 90


def test_a_slanted_texture_is_perspective_correct() -> None:
    # Stripes of 1 m on a floor: the stripe under a pixel follows from where its ray meets the floor.
    texture = np.zeros((2, 2, 3), np.uint8)
    texture[:, 1] = 255
    points = np.array([[0.5, -40, 0], [60, -40, 0], [60, 40, 0], [0.5, 40, 0]], np.float64)
    floor = Surface.from_triangles(
        points, np.array([[0, 1, 2], [0, 2, 3]]), uv=points[:, :2] / 2 + 0.25, entity=1, material=Material("s", texture)
    )
    seen = render(Scene([floor]), Cameras(np.array([[0.0, 0, 1.5]]), AHEAD)).rgb[0]
    checked = 0
    for row in range(150, 250):
        x = 1.5 / ((row + 0.5 - 128) / 128)
        phase = (x / 2 + 0.25) % 1.0
        if min(abs(phase - 0.5), phase, 1 - phase) < 0.22:
            continue
        checked += 1
        assert (seen[row, 128].mean() > 110) == (phase > 0.5), (row, x, phase)
    assert checked >= 12


def test_holes_of_a_cutout_texture_let_what_is_behind_through() -> None:
    texture = np.full((32, 32, 4), 255, np.uint8)
    texture[:, 16:, 3] = 0
    behind = box((0.1, 60, 60), (15, 0, 0)).of_entity(2)
    scene = Scene([quad(Material("leaf", texture, cutout=True)), behind])
    seen = render(scene, Cameras(np.zeros((1, 3)), AHEAD), rgb=False).segmentation[0]
    assert (seen[:, 4:124] == 1).all()
    assert (seen[:, 132:252] == 2).all()


@pytest.fixture(scope="module")
def square() -> Scene:
    ground = box((200, 200, 1), (0, 0, -0.5), colour=(160, 160, 160)).of_entity(1)
    houses = [
        box((12, 12, 20), (x, y, 10), colour=(200, 170, 150)).of_entity(1000 + k)
        for k, (x, y) in enumerate([(30, 0), (30, 25), (-30, -10), (0, 50)])
    ]
    scene = Scene(
        merge_surfaces([ground, *houses]),
        {"post": [box((0.3, 0.3, 3), (0, 0, 1.5))], "car": [box((4, 2, 1.5), (0, 0, 0.75))]},
    )
    scene.place(["post"] * 20, np.array([pose_matrix(x, -8) for x in range(20)]), np.arange(20) + 20_000)
    return scene


def street_views(count: int) -> Cameras:
    yaw = np.linspace(0, 2 * np.pi, count, endpoint=False)
    return Cameras(np.tile([0.0, 0.0, 1.6], (count, 1)), np.stack([np.cos(yaw), np.sin(yaw), 0 * yaw], 1))


def test_pictures_are_the_same_bytes_for_any_number_of_threads(square: Scene) -> None:
    square.set_rigid([square.names["car"]], pose_matrix(9, 3)[None], [1_000_000])
    one = render(square, street_views(7), threads=1)
    for threads in (2, 5):
        many = render(square, street_views(7), threads=threads)
        assert one.rgb.tobytes() == many.rgb.tobytes()
        assert one.depth.tobytes() == many.depth.tobytes()
        assert one.segmentation.tobytes() == many.segmentation.tobytes()


def test_a_picture_does_not_depend_on_its_batch(square: Scene) -> None:
    views = street_views(5)
    batch = render(square, views)
    alone = render(square, Cameras(views.position[3:4], views.forward[3:4]))
    assert batch.rgb[3].tobytes() == alone.rgb[0].tobytes()


def test_depth_and_segmentation_do_not_depend_on_samples_or_kinds(square: Scene) -> None:
    plain = render(square, street_views(2))
    fine = render(square, street_views(2), samples=2)
    bare = render(square, street_views(2), rgb=False)
    assert plain.depth.tobytes() == fine.depth.tobytes() == bare.depth.tobytes()
    assert plain.segmentation.tobytes() == fine.segmentation.tobytes() == bare.segmentation.tobytes()
    assert bare.rgb.size == 0


def test_houses_cast_shadows_away_from_the_sun(square: Scene) -> None:
    square.lighting = Lighting(sun_direction=(1.0, 0.0, 0.8))
    square.set_rigid([], np.zeros((0, 4, 4)), [])
    seen = render(square, Cameras(np.array([[0.0, 0, 60.0]]), np.array([[0.0, 0, -1]]), up=(0, 1, 0))).rgb[0]
    metres = 60.0 / 128  # a pixel on the ground

    def ground(x: float, y: float) -> float:
        return float(seen[int(128 - y / metres), int(128 + x / metres)].mean())

    # The house at (30, 0) is 20 m high: its shadow reaches 25 m to the west of its wall at x = 24.
    assert ground(12, 0) < 0.75 * ground(12, -30)
    assert ground(-6, 0) > 0.95 * ground(12, -30)
    square.lighting = Lighting()


def test_a_car_darkens_the_ground_beside_it(square: Scene) -> None:
    square.lighting = Lighting(sun_direction=(0.0, 1.0, 1.0))
    eye = Cameras(np.array([[0.0, -10, 5.0]]), np.array([[0.0, 1, -0.5]]))
    square.set_rigid([], np.zeros((0, 4, 4)), [])
    empty = render(square, eye)
    square.set_rigid([square.names["car"]], pose_matrix(0, 0)[None], [1_000_000])
    full = render(square, eye)
    darker = (full.rgb[0].astype(int).sum(axis=2) < empty.rgb[0].astype(int).sum(axis=2) - 60) & (
        full.segmentation[0] == 1
    )
    assert darker.sum() > 300
    square.lighting = Lighting()


def test_two_legs_throw_two_shadows() -> None:
    legs = merge_surfaces([box((0.2, 0.2, 1.0), (0, y, 0.5)) for y in (-0.4, 0.4)])[0].of_entity(9)
    scene = Scene([box((40, 40, 1), (0, 0, -0.5)).of_entity(2)], lighting=Lighting(sun_direction=(-1.0, 0.0, 0.5)))
    limbs = np.array([[[0, y, 0.1, 0, y, 0.9, 0.1] for y in (-0.4, 0.4)]], np.float32)
    limbs = np.concatenate([limbs, np.tile(limbs[:, :1], (1, len(LIMBS) - 2, 1))], axis=1)
    eye = Cameras(np.array([[1.0, 0, 4.0]]), np.array([[0.0, 0, -1]]), up=(1, 0, 0))

    def ground(x: float) -> list[float]:
        """How bright it is behind one leg, between them, behind the other one, and far to the side."""
        row = 128 - round((x - 1.0) * 32)
        return [float(render(scene, eye).rgb[0, row, 128 - round(y * 32)].mean()) for y in (-0.4, 0.0, 0.4, 2.0)]

    shape = legs.positions, legs.normals, legs.triangles, legs.colour, legs.entity
    scene.set_skinned(*shape, limbs=limbs)
    one, between, other, lit = ground(1.2)
    assert max(one, other) < 0.8 * lit
    assert between > 0.95 * lit
    scene.set_skinned(*shape)  # an ellipsoid around both
    assert ground(1.2)[1] < 0.8 * lit
    scene.set_skinned(*shape, limbs=limbs)
    scene.repose(legs.positions, legs.normals, limbs + np.array([0, 0.8, 0, 0, 0.8, 0, 0], np.float32))
    one, between, other, lit = ground(1.2)
    assert other < 0.8 * lit
    assert one > 0.95 * lit


def test_the_roof_of_a_bus_shades_its_inside_and_lamps_light_it_at_night() -> None:
    down = Cameras(np.array([[0.0, 0.0, 2.3]]), np.array([[0.05, 0.0, -1.0]]), width=96, height=96, fov_y=1.6)

    def picture(light: Lighting, **cabins: Cabin) -> NDArray[np.float64]:
        scene = Scene([box((40, 40, 1), (0, 0, -0.5))], {"bus": [bus()]}, cabins=cabins, lighting=light)
        scene.set_rigid([0], np.eye(4)[None], [1])
        return render(scene, down).rgb[0].mean(axis=2)

    noon = Lighting(sun_direction=(0.2, 0.75, 0.63))
    bare, shaded = picture(noon), picture(noon, bus=bus_cabin())
    assert 0.2 < (shaded < 0.8 * bare).mean() < 0.95  # the rest lies in light from the windows, or faces away
    assert (shaded > 0.9 * bare).mean() > 0.05
    night = Lighting.at(23 * 3600)
    assert picture(night, bus=bus_cabin()).mean() > 2.2 * picture(night).mean()


def test_the_shadow_of_a_car_behind_a_house_is_seen_beside_it(square: Scene) -> None:
    square.lighting = Lighting(sun_direction=(-1.0, 0.0, 0.3))
    eye = Cameras(np.array([[0.0, 5, 35.0]]), np.array([[0.0, 1, -0.55]]), width=512, height=512)

    def darkened(x: float) -> int:
        """How many pixels a car at (x, 58.5) darkens; the house before it reaches to x = 6."""
        square.set_rigid([], np.zeros((0, 4, 4)), [])
        empty = render(square, eye)
        square.set_rigid([square.names["car"]], pose_matrix(x, 58.5)[None], [1_000_000])
        full = render(square, eye)
        assert not (full.segmentation == 1_000_000).any()
        return int((full.rgb.astype(int).sum(axis=3) < empty.rgb.astype(int).sum(axis=3) - 60).sum())

    assert darkened(5.0) > 15  # the shadow reaches 5 m to the east
    assert darkened(-2.0) == 0
    square.lighting = Lighting()


def test_night_is_darker_than_noon_and_lit_windows_shine() -> None:
    wall = quad(Material("window", emission=1.0), colour=(255, 230, 180))
    dark = quad(Material("wall"), colour=(255, 230, 180))
    at = {}
    for name, surface in (("lit", wall), ("unlit", dark)):
        scene = Scene([surface])
        for hour in (12, 0):
            scene.lighting = Lighting.at(hour * 3600.0, 60.0)
            at[name, hour] = float(render(scene, Cameras(np.zeros((1, 3)), AHEAD)).rgb.mean())
    assert at["unlit", 0] < 0.45 * at["unlit", 12]
    assert at["lit", 0] > 2 * at["unlit", 0]


def test_extrinsics_and_intrinsics_take_world_points_to_the_pixels_that_show_them() -> None:
    point = np.array([14.0, 3.0, 5.0])
    scene = Scene([ball((0.3, 0.3, 0.3), point.tolist(), sides=24, rings=16).of_entity(42)])
    cameras = Cameras(np.array([[1.0, -2, 1.6]]), np.array([[0.9, 0.5, 0.1]]), width=320, height=240, fov_y=1.0)
    seen = render(scene, cameras, rgb=False)
    camera = cameras.extrinsics[0] @ [*point, 1.0]
    pixel = cameras.intrinsics @ (camera[:3] / camera[2])
    rows, columns = np.nonzero(seen.segmentation[0] == 42)
    assert abs(columns.mean() + 0.5 - pixel[0]) < 0.5
    assert abs(rows.mean() + 0.5 - pixel[1]) < 0.5
    assert abs(float(seen.depth[0, int(pixel[1]), int(pixel[0])]) - (camera[2] - 0.3)) < 0.03


def test_frames_have_the_promised_shapes_and_types(square: Scene) -> None:
    frames = render(square, street_views(3))
    assert frames.rgb.shape == (3, 256, 256, 3)
    assert frames.rgb.dtype == np.uint8
    assert frames.depth.shape == (3, 256, 256)
    assert frames.depth.dtype == np.float32
    assert frames.segmentation.shape == (3, 256, 256)
    assert frames.segmentation.dtype == np.int32


@pytest.mark.parametrize(("width", "height"), [(1, 1), (7, 13), (250, 131), (960, 540)])
def test_any_picture_size_works_and_agrees_with_the_256_one_in_the_middle(
    square: Scene, width: int, height: int
) -> None:
    eye, look = np.array([[0.0, 0, 1.6]]), np.array([[1.0, 0.02, 0.01]])
    seen = render(square, Cameras(eye, look, width=width, height=height))
    reference = render(square, Cameras(eye, look))
    assert seen.segmentation[0, height // 2, width // 2] == reference.segmentation[0, 128, 128]


def test_the_map_has_north_up_and_east_right() -> None:
    ground = box((100, 100, 1), (0, 0, -0.5), colour=(40, 40, 40))
    red, blue = box((10, 10, 1), (30, 0, 0.5), colour=(255, 0, 0)), box((10, 10, 1), (0, 30, 0.5), colour=(0, 0, 255))
    picture = render_top_down(Scene(merge_surfaces([ground, red, blue])), 50.0, 100).astype(int)
    assert picture[50, 80, 0] > 150 > picture[50, 80, 2]
    assert picture[20, 50, 2] > 120 > picture[20, 50, 0]
