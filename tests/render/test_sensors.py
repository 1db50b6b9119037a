"""Lenses, normals and flow: against rays and motions worked out by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from vico.assets.shapes import box, pose_matrix
from vico.errors import InputError
from vico.render import Cameras, Scene, render
from vico.render.cameras import Lens, directions
from vico.render.viewers import Viewers
from vico.world.mesh import merge_surfaces

EAST = np.array([[0.0, 0.0, 1.5, 1.0, 0.0, 0.0]])
OWN = np.array([7], np.int32)


@pytest.fixture
def scene() -> Scene:
    """Inside a closed box of 20 x 20 x 10 m, with a cube that moves."""
    low, high = np.array([-10.0, -10, -1]), np.array([10.0, 10, 9])
    walls = []
    for axis in range(3):
        for side, at in enumerate((low, high)):
            size, centre = high - low + 1.0, (low + high) / 2
            size[axis], centre[axis] = 0.5, at[axis] + (0.25 if side else -0.25)
            walls.append(box(size.tolist(), centre.tolist()).of_entity(100 + 2 * axis + side))
    return Scene(merge_surfaces(walls), {"cube": [box((1.0, 1.0, 1.0), (0, 0, 0), colour=(200, 30, 30))]})


def taken(scene: Scene, lens: Lens, *outputs: str, pose: NDArray[np.float64] = EAST) -> dict[str, NDArray[Any]]:
    views = Viewers(scene, outputs).take(pose, OWN, [lens])
    views.wait_for(0)
    return {name: arrays[0] for name, arrays in views.pictures.items()}


def walls_along(rays: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance of the walls from the middle of the room, by the slab test; rays in the world's axes."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.where(rays > 0, np.array([10.0, 10, 7.5]), np.array([-10.0, -10, -2.5])) / rays
    return np.asarray(np.nanmin(np.where(np.isfinite(ends), ends, np.inf), axis=-1))


@pytest.mark.parametrize(
    "lens",
    [Lens.of({"projection": "fisheye", "width": 96, "fov": 200.0}), Lens.of({"projection": "panorama", "height": 64})],
    ids=lambda lens: lens.projection,
)
def test_depth_of_curved_lenses_is_measured_along_the_ray(scene: Scene, lens: Lens) -> None:
    seen = taken(scene, lens, "depth", "segmentation", "normals", "rgb")
    rays = directions(lens)
    world = rays @ Cameras(EAST[:, :3], EAST[:, 3:]).rotation[0]
    sees = np.isfinite(rays[..., 0])
    assert (seen["depth"][~sees] == 0).all()
    wanted = walls_along(np.where(sees[..., None], world, 1.0))
    assert np.median(np.abs(seen["depth"] / wanted - 1)[sees]) < 0.01
    assert np.percentile(np.abs(seen["depth"] / wanted - 1)[sees], 99) < 0.08
    # What is seen on a pixel's ray is the wall that it hits, which faces the camera.
    ahead = (seen["normals"] * np.where(sees[..., None], rays, 0)).sum(-1)
    assert (ahead[sees] < 0).all()
    assert set(np.unique(seen["segmentation"][sees])) >= {101, 102, 103, 104, 105}
    assert seen["rgb"][sees].min() > 0


@pytest.mark.parametrize("projection", ["pinhole", "fisheye", "panorama"])
def test_projecting_a_pixels_direction_gives_the_pixel(projection: str) -> None:
    lens = Lens.of({"projection": projection, "width": 80, "height": 40})
    rays = directions(lens)
    sees = np.isfinite(rays[..., 0])
    column, row = np.meshgrid(np.arange(80) + 0.5, np.arange(40) + 0.5)
    assert np.abs(lens.project(7.0 * rays) - np.stack([column, row], -1))[sees].max() < 1e-9


def test_a_wide_picture_is_the_square_one_with_more_to_its_sides(scene: Scene) -> None:
    square = taken(scene, Lens.of({"width": 64, "height": 64}), "depth", "rgb")
    wide = taken(scene, Lens.of({"width": 160, "height": 64}), "depth", "rgb")
    assert wide["rgb"].shape == (64, 160, 3)
    assert np.array_equal(wide["depth"][:, 48:112], square["depth"])


def test_normals_of_walls_are_straight(scene: Scene) -> None:
    lens = Lens.of({"width": 64, "height": 64})
    seen = taken(scene, lens, "normals")["normals"]
    assert np.allclose(seen[32, 32], [0, 0, -1], atol=1e-5)
    assert np.allclose(seen[63, 32], [0, -1, 0], atol=1e-5)
    assert np.allclose(np.linalg.norm(seen, axis=-1), 1.0, atol=1e-5)


@pytest.mark.parametrize("lens", [Lens.of({"width": 64, "height": 48}), Lens.of({"projection": "panorama"}, side=64)])
def test_flow_leads_back_to_where_a_point_was_seen(scene: Scene, lens: Lens) -> None:
    """Camera and cube both move: the flow of each pixel is checked against the depth of the picture before."""
    viewers = Viewers(scene, ("depth", "flow", "segmentation"))
    before_pose, after_pose = EAST, np.array([[0.1, 0.05, 1.52, 1.0, 0.04, 0.02]])
    poses = pose_matrix(6.0, 0.0, 1.0, 0.2), pose_matrix(6.1, 0.3, 1.0, 0.35)
    index = [scene.names["cube"]]
    scene.set_rigid(index, poses[0][None], [5])
    first = viewers.take(before_pose, OWN, [lens], second=1.0)
    first.wait()
    assert not first.pictures["flow"][0].any()
    scene.set_rigid(index, poses[1][None], [5])
    second = viewers.take(after_pose, OWN, [lens], second=2.0)
    second.wait()
    seen = {name: arrays[0] for name, arrays in second.pictures.items()}
    rotation = [Cameras(pose[:, :3], pose[:, 3:]).rotation[0] for pose in (before_pose, after_pose)]
    rays = directions(lens)
    scale = seen["depth"] / (rays[..., 2] if lens.is_pinhole else 1.0)
    points = after_pose[0, :3] + (rays * scale[..., None]) @ rotation[1]
    cube = seen["segmentation"] == 5
    assert 10 < cube.sum() < cube.size / 4
    back = poses[0] @ np.linalg.inv(poses[1])
    points[cube] = points[cube] @ back[:3, :3].T + back[:3, 3]
    was = lens.project((points - before_pose[0, :3]) @ rotation[0].T)
    column, row = np.meshgrid(np.arange(lens.width) + 0.5, np.arange(lens.height) + 0.5)
    wanted = np.stack([column, row], -1) - was
    wanted[..., 0] = np.where(np.abs(wanted[..., 0]) > lens.width / 2, np.nan, wanted[..., 0])
    error = np.abs(seen["flow"] - wanted)
    rows = slice(0, 48) if lens.is_pinhole else slice(12, 52)  # a panorama's poles are everywhere
    assert np.nanpercentile(error[rows], 99) < (0.01 if lens.is_pinhole else 0.1)
    assert np.nanmedian(error[cube]) < (0.01 if lens.is_pinhole else 0.1)
    assert np.abs(seen["flow"][cube]).max() > 0.3


def test_flow_of_a_body_follows_its_vertices(scene: Scene) -> None:
    lens = Lens.of({"width": 64, "height": 64})
    figure = box((0.5, 0.5, 1.0), (4.0, 0.0, 1.5)).of_entity(9)
    viewers = Viewers(scene, ("flow", "segmentation"))
    flows = []
    for second, shift in enumerate((0.0, 0.2, 0.2)):
        vertices = (figure.positions + np.array([0.0, shift, 0.0])).astype(np.float32)
        scene.set_skinned(vertices, figure.normals, figure.triangles, figure.colour, figure.entity)
        views = viewers.take(EAST, OWN, [lens], second=float(second))
        views.wait()
        flows.append(views.pictures["flow"][0][views.pictures["segmentation"][0] == 9])
    # To the left (north) by 0.2 m at 3.75 m, focal length 32 pixels; then it stands.
    assert np.median(flows[1][:, 0]) == pytest.approx(-0.2 * 32 / 3.75, abs=0.02)
    assert np.abs(flows[2]).max() < 1e-3


def test_what_is_not_asked_for_changes_nothing(scene: Scene) -> None:
    lens = Lens.of({"width": 64, "height": 64})
    alone = render(scene, Cameras(EAST[:, :3], EAST[:, 3:], width=64, height=64))
    seen = taken(scene, lens, "rgb", "depth", "segmentation", "normals", "flow")
    for name in ("rgb", "depth", "segmentation"):
        assert np.array_equal(seen[name], getattr(alone, name)[0])


@pytest.mark.parametrize(
    ("record", "said"),
    [
        ({"projection": "cylinder"}, "projection 'cylinder'"),
        ({"width": 8}, "width is 8"),
        ({"height": 2.5}, "is 2.5; it has to be"),
        ({"fov": 400}, "fov is 400"),
        ({"zoom": 2}, "no setting 'zoom'"),
        ({"projection": "panorama", "fov": 90.0}, "leave fov out"),
        (3, "has to be a record"),
    ],
)
def test_nonsense_is_refused(record: Any, said: str) -> None:
    with pytest.raises(InputError, match=said):
        Lens.of(record)
