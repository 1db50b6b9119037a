"""Depth images become points where things really are."""

import numpy as np
import pytest

from vico.agents.perception import DepthGrid, points_from_depth, sightings
from vico.assets.shapes import box
from vico.render import Cameras, Scene, render


def view_of_a_box() -> dict:
    """A camera at 1.6 m, looking east at a box whose near face is 4 m away."""
    floor = box((30, 30, 0.1), (0, 0, -0.05)).of_entity(1)
    thing = box((0.4, 0.6, 1.0), (4.2, 1.0, 0.5)).of_entity(7)
    cameras = Cameras(np.array([[0.0, 0.0, 1.6]]), np.array([[1.0, 0.0, 0.0]]))
    frames = render(Scene([floor, thing], {}), cameras)
    return {
        "depth": frames.depth[0],
        "segmentation": frames.segmentation[0],
        "intrinsics": cameras.intrinsics,
        "extrinsics": cameras.extrinsics[0],
        "pose": np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0]),
    }


def test_points_of_a_face_lie_on_it() -> None:
    view = view_of_a_box()
    points, pixels = points_from_depth(view["depth"], view["intrinsics"], view["extrinsics"])
    mine = points[view["segmentation"].ravel()[pixels] == 7]
    face = mine[np.abs(mine[:, 0] - 4.0) < 0.02]
    assert len(face) > 500
    assert face[:, 1].min() == pytest.approx(0.7, abs=0.05)
    assert face[:, 1].max() == pytest.approx(1.3, abs=0.05)
    assert face[:, 2].max() == pytest.approx(1.0, abs=0.05)


def test_a_sighting_tells_name_and_place() -> None:
    found = sightings(view_of_a_box(), {7: {"kind": "object", "name": "red parcel"}, 1: {"kind": "ground", "name": ""}})
    assert [(thing.entity, thing.name) for thing in found] == [(7, "red parcel")]
    assert found[0].position == pytest.approx([4.1, 1.0, 0.6], abs=0.3)


def test_a_route_goes_around_what_was_seen() -> None:
    grid = DepthGrid((0.0, 0.0), side=20.0)
    grid.see(view_of_a_box(), floor=0.0)
    route = grid.route((0.0, 1.0), (7.0, 1.0), near=0.3)
    assert np.linalg.norm(route[-1] - [7.0, 1.0]) <= 0.4
    gap = np.maximum(np.abs(route - [4.2, 1.0]) - [0.2, 0.3], 0.0)
    assert np.hypot(*gap.T).min() >= 0.15
