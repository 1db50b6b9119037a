"""What is seen where, and how far away: against rays cast by hand."""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from vico.assets.shapes import ball, box, pose_matrix
from vico.errors import InputError
from vico.render import Cameras, Frames, Lighting, Scene, ViewCache, render
from vico.render.frames import PendingView
from vico.render.records import OPENING
from vico.world.mesh import Material, Surface, merge_surfaces


def rays(cameras: Cameras) -> NDArray[np.float64]:
    """World directions of all pixels of the first camera, of depth 1; shape ``(h, w, 3)``."""
    k = cameras.intrinsics
    x = (np.arange(cameras.width) + 0.5 - k[0, 2]) / k[0, 0]
    y = (np.arange(cameras.height) + 0.5 - k[1, 2]) / k[1, 1]
    right, down, ahead = cameras.rotation[0]
    return ahead + x[None, :, None] * right + y[:, None, None] * down


def cast(
    cameras: Cameras, boxes: list[tuple[NDArray[np.float64], NDArray[np.float64], int]]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Depth and entity of axis-aligned boxes seen by the first camera, by the slab test."""
    directions, origin = rays(cameras), cameras.position[0]
    depth = np.full(directions.shape[:2], np.inf)
    entity = np.zeros(directions.shape[:2], np.int64)
    for low, high, number in boxes:
        with np.errstate(divide="ignore"):
            a, b = (low - origin) / directions, (high - origin) / directions
        near, far = np.minimum(a, b).max(axis=2), np.maximum(a, b).min(axis=2)
        hit = (near < far) & (near > cameras.near) & (near < depth)
        depth[hit], entity[hit] = near[hit], number
    depth[entity == 0] = 0
    return depth, entity


@pytest.fixture(scope="module")
def town() -> tuple[Scene, list[tuple[NDArray[np.float64], NDArray[np.float64], int]]]:
    generator = np.random.Generator(np.random.PCG64(5))
    surfaces, boxes = [], []
    for k in range(150):
        size = generator.uniform(1, 14, 3)
        centre = np.array([*generator.uniform(-120, 120, 2), generator.uniform(0, 12)])
        surfaces.append(box(size.tolist(), centre.tolist()).of_entity(1000 + k))
        boxes.append((centre - size / 2, centre + size / 2, 1000 + k))
    return Scene(merge_surfaces(surfaces)), boxes


@pytest.mark.parametrize("yaw", [0.0, 0.7, 2.5, 4.4])
def test_depth_and_segmentation_of_boxes_agree_with_ray_casting(
    town: tuple[Scene, list[tuple[NDArray[np.float64], NDArray[np.float64], int]]], yaw: float
) -> None:
    scene, boxes = town
    cameras = Cameras(np.array([[3.0, -2.0, 31.0]]), np.array([[np.cos(yaw), np.sin(yaw), -0.35]]))
    frames = render(scene, cameras, rgb=False)
    depth, entity = cast(cameras, boxes)
    same = frames.segmentation[0] == entity
    assert same.mean() > 0.9995  # centres that lie on an edge to the last bit may fall to either side
    assert np.abs(frames.depth[0] - depth)[same].max() < 1e-3  # grazing faces magnify the rounding of vertices
    assert (entity > 0).mean() > 0.1


def test_depth_of_a_wall_is_exact_to_a_tenth_of_a_millimetre() -> None:
    scene = Scene([box((0.2, 60, 60), (20.1, 0, 0))])
    frames = render(scene, Cameras(np.zeros((1, 3)), np.array([[1.0, 0, 0]])), rgb=False)
    assert np.abs(frames.depth - 20.0).max() < 1e-4


def test_a_watertight_ball_of_many_triangles_shows_no_cracks() -> None:
    shell = ball((5, 5, 5), sides=90, rings=60).of_entity(7)
    beyond = box((0.1, 80, 80), (20, 0, 0)).of_entity(9)
    scene = Scene([shell, beyond])
    for k in range(6):
        eye = np.array([[-9.0 + 0.37 * k, 0.013 * k, 0.07 * k]])
        seen = render(scene, Cameras(eye, np.array([[1.0, 0.01 * k, 0.003]])), rgb=False)
        yy, xx = np.mgrid[0:256, 0:256]
        inside = (yy - 128) ** 2 + (xx - 128) ** 2 < 40**2
        assert set(np.unique(seen.segmentation[0][inside])) == {7}


def test_terrain_under_the_camera_has_no_gaps_at_the_near_plane() -> None:
    steps = np.linspace(-60, 60, 41)
    x, y = np.meshgrid(steps, steps)
    z = 0.6 * np.sin(0.3 * x) * np.cos(0.4 * y)
    index = np.arange(41 * 41).reshape(41, 41)
    a, b, c, d = index[:-1, :-1].ravel(), index[:-1, 1:].ravel(), index[1:, 1:].ravel(), index[1:, :-1].ravel()
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    points = np.stack([x.ravel(), y.ravel(), z.ravel()], 1)
    scene = Scene([Surface.from_triangles(points, faces, entity=1)])
    for k in range(8):
        # ObservationRenderer just above the ground, looking steeply down: most triangles cross the near plane.
        eye = np.array([[0.31 * k, 0.17 * k, 0.6 * np.sin(0.3 * 0.31 * k) * np.cos(0.4 * 0.17 * k) + 0.12]])
        seen = render(scene, Cameras(eye, np.array([[0.6, 0.1 * k, -1.0]]), near=0.05), rgb=False)
        assert (seen.segmentation == 1).all()


def _room() -> Scene:
    walls = [
        box((8.4, 0.2, 3.4), (0, side * 3.1, -20), colour=(210, 200, 190)).of_entity(100_001) for side in (-1, 1)
    ] + [box((0.2, 6.4, 3.4), (side * 4.1, 0, -20)).of_entity(100_001) for side in (-1, 1)]
    walls += [box((8.4, 6.4, 0.2), (0, 0, -20 + side * 1.6)).of_entity(100_001) for side in (-1, 1)]
    street = [box((300, 300, 0.2), (0, 0, -0.1)).of_entity(1), box((20, 20, 30), (0, 0, 15)).of_entity(1000)]
    ball = box((0.5, 0.5, 1.0), (0, 0, 0.5))
    return Scene(street, {"ball": [ball]}, indoor=walls, rooms=[[0, 0, -21.5, 4, 3, 3.0, 0.0]])


def test_a_camera_in_a_closed_room_sees_only_the_room() -> None:
    scene = _room()
    yaw = np.arange(8) * np.pi / 4
    cameras = Cameras(np.tile([0.5, -0.5, -20.0], (8, 1)), np.stack([np.cos(yaw), np.sin(yaw), 0.4 * np.sin(yaw)], 1))
    frames = render(scene, cameras)
    assert set(np.unique(frames.segmentation)) == {100_001}
    assert frames.depth.max() < 8.0
    outside = render(scene, Cameras(np.array([[40.0, 0, 2]]), np.array([[-1.0, 0, 0]])))
    assert 100_001 not in outside.segmentation


def test_a_view_of_a_room_is_repeated_while_nothing_in_it_can_have_changed() -> None:
    scene, cache = _room(), ViewCache()
    cameras = Cameras(np.array([[-2.0, 0.5, -20.0], [40.0, 0, 2]]), np.array([[1.0, 0, -0.2], [-1.0, 0, 0]]))

    def look(x: float, y: float) -> Frames:
        pose = np.eye(4)
        pose[:3, 3] = x, y, -21.5
        scene.set_rigid([scene.names["ball"]], pose[None], [7])
        seen = render(scene, cameras, cache=cache)
        fresh = render(scene, cameras)
        for name in ("rgb", "depth", "segmentation"):
            assert np.array_equal(getattr(seen, name), getattr(fresh, name))
        return seen

    look(60.0, 0.0)
    assert cache.hits == 0
    look(61.0, 0.0)  # in the next room but five
    assert cache.hits == 1
    assert 7 in look(1.0, 0.5).segmentation[0]  # it comes in
    assert cache.hits == 1
    look(1.1, 0.5)
    assert cache.hits == 1
    assert 7 not in look(60.0, 0.0).segmentation[0]
    assert cache.hits == 2
    scene.place(
        ["ball"], np.array([[1.0, 0, 0, 1], [0, 1, 0, 0], [0, 0, 1, -21.5], [0, 0, 0, 1]])[None], [8], indoor=True
    )
    assert 8 in look(60.0, 0.0).segmentation[0]  # something is put there
    assert cache.hits == 2


def test_a_camera_that_stands_sees_what_moves_as_one_that_has_just_come() -> None:
    tiles = np.random.default_rng(3).integers(60, 250, (64, 64, 3), np.uint8)
    ground = box((90, 90, 1), (0, 0, -0.5)).of_entity(1)
    houses = [box((6, 6, 9), (x, y, 4.5)).of_entity(1000 + x) for x, y in [(14, 6), (22, -9), (30, 8)]]
    car = box((4, 2, 1.5), (0, 0, 0.75))
    textured = [replace(surface, material=Material("tiles", tiles)) for surface in merge_surfaces([ground, *houses])]
    scene = Scene(textured, {"car": [replace(car, material=Material("paint", tiles))]})
    cameras = Cameras(np.array([[-4.0, 0.3, 1.6], [0.0, -20, 9]]), np.array([[1.0, 0.1, -0.1], [0.4, 1, -0.5]]))
    body, cache = ball((0.3, 0.3, 0.8), (0, 0, 0.8)), ViewCache()
    for step in range(12):
        # One drives by behind the houses, one stops; somebody walks; the light changes.
        poses = np.stack([np.eye(4), np.eye(4)])
        poses[:, :3, 3] = (8.0 + 2 * step, -2.0 + 1.2 * step, 0), (6.0, min(step, 3) - 5.0, 0)
        scene.set_rigid([0, 0], poses, [7, 8])
        walker = body.positions + np.array([3.0, 0.5 * step - 2, 0], np.float32)
        owner = np.full(len(walker), 9, np.int32)
        scene.set_skinned(walker, body.normals, body.triangles, body.colour, owner)
        scene.lighting = Lighting(sun_direction=(-0.3, 0.6, 0.5 if step < 8 else 0.7))
        seen, fresh = render(scene, cameras, cache=cache), render(scene, cameras)
        assert {7, 8, 9} & set(np.unique(seen.segmentation[0]))
        for name in ("rgb", "depth", "segmentation"):
            assert np.array_equal(getattr(seen, name), getattr(fresh, name)), (step, name)
    assert cache.hits == 0


def test_deferred_pictures_are_the_same() -> None:
    scene, cache = _room(), ViewCache(deferred=True)
    pose = np.eye(4)
    pose[:3, 3] = 30.0, 1.0, 0.0
    scene.set_rigid([scene.names["ball"]], pose[None], [7])
    cameras = Cameras(np.array([[-2.0, 0.5, -20.0], [40.0, 0, 2]]), np.array([[1.0, 0, -0.2], [-1.0, 0, 0]]))
    at_once = render(scene, cameras)
    for k in range(3):
        later = render(scene, cameras, cache=cache)
        for view in range(2):
            later.wait_for(view)
            for name in ("rgb", "depth", "segmentation"):
                assert np.array_equal(getattr(later, name)[view], getattr(at_once, name)[view]), (k, view, name)
        later.wait()


def test_whoever_waits_for_a_picture_takes_it_or_hears_what_went_wrong() -> None:
    crew, begin = ThreadPoolExecutor(1), threading.Event()
    taken: list[int] = []

    def fail() -> None:
        raise InputError("no picture")

    with crew:
        crew.submit(begin.wait)  # the only thread is busy
        views = [PendingView(crew, lambda: taken.append(threading.get_ident())), PendingView(crew, fail)]
        views[0].wait()
        views[0].wait()
        assert taken == [threading.get_ident()]
        for _ in range(2):
            with pytest.raises(InputError, match="no picture"):
                views[1].wait()
        begin.set()
    assert len(taken) == 1


def test_a_thin_far_pole_is_seen_where_its_centre_line_crosses_pixel_centres() -> None:
    # 0.4 m at 100 m is half a pixel: the column whose centres lie inside must be unbroken.
    focal = 128.0
    middle = (0.5 / focal) * 100
    scene = Scene([box((0.4, 0.4, 300), (100, -middle, 0)).of_entity(5)])
    seen = render(scene, Cameras(np.zeros((1, 3)), np.array([[1.0, 0, 0]])), rgb=False).segmentation[0]
    assert (seen[:, 128] == 5).all()
    assert (np.delete(seen, 128, axis=1) == 0).all()


def test_nothing_beyond_far_is_hit() -> None:
    scene = Scene([box((0.2, 900, 900), (300, 0, 0))])
    ahead = np.array([[1.0, 0, 0]])
    assert render(scene, Cameras(np.zeros((1, 3)), ahead, far=299.0), rgb=False).depth.max() == 0
    assert render(scene, Cameras(np.zeros((1, 3)), ahead, far=301.0), rgb=False).depth.min() > 299


def test_a_face_is_seen_from_its_outer_side_only_unless_double_sided() -> None:
    quad = np.array([[5.0, -9, -9], [5, 9, -9], [5, 9, 9], [5, -9, 9]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])  # counter-clockwise seen from +x
    eyes, looks = np.array([[0.0, 0, 0], [10, 0, 0]]), np.array([[1.0, 0, 0], [-1, 0, 0]])
    single = Scene([Surface.from_triangles(quad, faces, entity=3)])
    hits = (render(single, Cameras(eyes, looks), rgb=False).segmentation == 3).all(axis=(1, 2))
    assert hits.tolist() == [False, True]
    sheet = Scene([Surface.from_triangles(quad, faces, entity=3, material=Material("sheet", double_sided=True))])
    assert (render(sheet, Cameras(eyes, looks), rgb=False).segmentation == 3).all()


def test_placed_moving_and_skinned_things_show_their_own_entities() -> None:
    scene = Scene([], {"crate": [box((1, 1, 1))]})
    scene.place(["crate"], pose_matrix(6, 2, 0)[None], [20_000])
    scene.set_rigid([scene.names["crate"]], pose_matrix(6, 0, 0)[None], [1_000_000])
    body = ball((0.4, 0.4, 0.9), (6, -2, 0))
    scene.set_skinned(
        body.positions, body.normals, body.triangles, body.colour, np.full(len(body.positions), 1_000_001, np.int32)
    )
    view = Cameras(np.zeros((1, 3)), np.array([[1.0, 0, 0]]))
    row = render(scene, view, rgb=False).segmentation[0, 128]
    order = [int(row[k]) for k in range(256) if row[k] and (k == 0 or row[k] != row[k - 1])]
    assert order == [20_000, 1_000_000, 1_000_001]
    scene.set_rigid([], np.zeros((0, 4, 4)), [])
    scene.set_skinned(body.positions[:0], body.normals[:0], body.triangles[:0], body.colour[:0], np.zeros(0, np.int32))
    assert set(np.unique(render(scene, view, rgb=False).segmentation)) == {0, 20_000}


def test_occlusion_culling_hides_nothing_that_can_be_seen(
    town: tuple[Scene, list[tuple[NDArray[np.float64], NDArray[np.float64], int]]],
) -> None:
    """Against the slab test from the ground, where most of the town is hidden."""
    scene, boxes = town
    cameras = Cameras(np.array([[-125.0, -125.0, 1.6]]), np.array([[1.0, 0.9, 0.02]]))
    entity = cast(cameras, boxes)[1]
    seen = render(scene, cameras, rgb=False).segmentation[0]
    assert set(np.unique(entity[1:-1, 1:-1])) - set(np.unique(seen)) == set()


def test_bad_arguments_are_refused_with_a_reason() -> None:
    with pytest.raises(InputError, match="no length"):
        Cameras(np.zeros((1, 3)), np.zeros((1, 3)))
    scene = Scene([])
    with pytest.raises(InputError, match="no prototype called tree"):
        scene.place(["tree"], np.eye(4)[None], [1])
    with pytest.raises(InputError, match="finite"):
        Scene([Surface.from_triangles(np.full((3, 3), np.nan), np.array([[0, 1, 2]]))])


def wall_with_door() -> Scene:
    """A wall at x = 5 with an open door in it, a hall behind that, and a leaf before its back."""
    wall = box((0.2, 8, 4), (5.1, 0, 2)).of_entity(3)
    scene = Scene([wall], {"hall": [box((0.2, 3, 4), (2.0, 0, 2))], "leaf": [box((0.2, 0.1, 1))]})
    scene.keep_detail(["hall"])
    scene.set_rigid([0, 1], np.array([pose_matrix(5, 0), pose_matrix(6, 0, 1.5)]), [4, 5], shadowless=2)
    opening = np.zeros(1, OPENING)
    sizes = {"x": 5.0, "inward_x": 1.0, "half_width": 0.5, "height": 2.0, "before": 0.1, "behind": 0.3}
    for name, value in sizes.items():
        opening[name] = value
    scene.set_openings(opening)
    return scene


def test_through_an_open_door_what_moves_behind_the_wall_is_seen_and_nothing_beside_it() -> None:
    scene = wall_with_door()
    view = Cameras(np.array([[0.0, 0, 1.0]]), np.array([[1.0, 0, 0]]), width=128, height=128)
    frames = render(scene, view, rgb=False)
    seen, middle = frames.segmentation[0], 64
    assert seen[middle, middle] == 4 or seen[middle, middle] == 5
    assert abs(frames.depth[0][middle, middle - 4] - 6.9) < 0.01
    focal = 64 / np.tan(view.fov_y / 2)
    row, column = np.nonzero((seen == 4) | (seen == 5))
    # The opening is a metre wide and ends 1 m above the eye, 5 m away; what is behind it stands 1 m below, 6.9 m away.
    assert np.ptp(column) + 1 == pytest.approx(focal / 5.0, abs=2)
    assert np.ptp(row) + 1 == pytest.approx(focal / 5.0 + focal / 6.9, abs=2)
    assert {3, 4, 5} <= set(np.unique(seen).tolist())
    scene.set_openings(np.zeros(0, OPENING))
    assert set(np.unique(render(scene, view, rgb=False).segmentation[0, 32:76, 48:80])) == {3}
