"""Switches of quality: each changes what it is for, and nothing else."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from vico.assets.shapes import box
from vico.errors import InputError
from vico.render import Cameras, Lighting, Scene, render
from vico.render.frames import FINE_QUALITY, PLAIN_QUALITY, PictureRequest, RenderQuality, take_pictures
from vico.world.mesh import Material, Surface, merge_surfaces

LOOK = Cameras(np.array([[-9.0, -3.0, 2.0]]), np.array([[1.0, 0.25, -0.12]]), width=160, height=120)


@pytest.fixture(scope="module")
def scene() -> Scene:
    """A block that throws a shadow on grey ground, and a pane that shines by night."""
    pane = Material("pane", np.full((8, 8, 4), 255, np.uint8), emission=1.0)
    corners = np.array([[2.0, 6, 0], [2.0, 2, 0], [2.0, 2, 4], [2.0, 6, 4]])
    uv = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    glass = Surface.from_triangles(
        corners, np.array([[0, 1, 2], [0, 2, 3]]), uv=uv, entity=4, material=pane, colour=(40, 40, 40)
    )
    parts = [
        box((60, 60, 1), (0, 0, -0.5), colour=(150, 150, 150)).of_entity(2),
        box((2, 2, 3), (0, 0, 1.5)).of_entity(3),
    ]
    return Scene([*merge_surfaces(parts), glass], lighting=Lighting.at(15 * 3600))


def colours(scene: Scene, quality: RenderQuality) -> NDArray[Any]:
    return take_pictures(scene, LOOK, PictureRequest(quality=quality)).rgb[0].astype(int)


def changed(scene: Scene, **switch: bool) -> tuple[NDArray[Any], NDArray[np.int32]]:
    """What a switch adds to each pixel's green, and the entities that the pixels show."""
    plain = render(scene, LOOK)
    return colours(scene, RenderQuality(**switch))[..., 1] - plain.rgb[0, ..., 1], plain.segmentation[0]


def test_plain_is_what_it_was(scene: Scene) -> None:
    assert np.array_equal(colours(scene, PLAIN_QUALITY), render(scene, LOOK).rgb[0])


def test_corners_get_darker_and_open_ground_does_not(scene: Scene) -> None:
    near = Cameras(np.array([[-4.0, -3.0, 1.6]]), np.array([[1.0, 0.8, -0.35]]))
    plain = render(scene, near)
    occluded = take_pictures(scene, near, PictureRequest(quality=RenderQuality(ambient_occlusion=True)))
    change, entity = occluded.rgb[0, ..., 1].astype(int) - plain.rgb[0, ..., 1], plain.segmentation[0]
    assert (change <= 0).all()
    foot = np.zeros_like(entity, bool)
    foot[1:] = (entity[1:] == 2) & (entity[:-1] == 3)  # the ground along the block's foot
    assert change[foot].mean() < -8
    assert (change[-12:] == 0).all()


def test_what_stands_off_a_wall_has_no_halo_and_what_touches_it_has() -> None:
    change = []
    for off in (0.4, 0.0):
        parts = [box((0.2, 8, 8), (0, 0, 0)).of_entity(2), box((0.2, 0.3, 0.3), (-0.2 - off, 0, 0)).of_entity(3)]
        one = Scene(merge_surfaces(parts), lighting=Lighting())
        before = Cameras(np.array([[-2.5, 0.0, 0.0]]), np.array([[1.0, 0.0, 0.0]]))
        dark = take_pictures(one, before, PictureRequest(quality=RenderQuality(ambient_occlusion=True)))
        plain = render(one, before)
        wall = plain.segmentation[0] == 2
        change.append(int((dark.rgb[0, ..., 1].astype(int) - plain.rgb[0, ..., 1])[wall].min()))
    assert change[0] >= -2
    assert change[1] < -8


def test_edges_are_smoothed_and_faces_are_not(scene: Scene) -> None:
    change, entity = changed(scene, smooth_edges=True)
    edge = np.zeros_like(entity, bool)
    edge[1:-1, 1:-1] = (entity[1:-1, 1:-1] != entity[1:-1, 2:]) | (entity[1:-1, 1:-1] != entity[2:, 1:-1])
    near = edge | np.roll(edge, 1, 0) | np.roll(edge, 1, 1) | np.roll(edge, (1, 1), (0, 1))
    assert np.abs(change[near]).max() > 20
    assert np.abs(change[~near]).sum() < 0.2 * np.abs(change).sum()


def test_shadows_get_soft_rims(scene: Scene) -> None:
    change, entity = changed(scene, soft_shadows=True)
    assert np.abs(change[entity == 2]).max() > 5
    assert (change != 0).mean() < 0.1


def test_glass_mirrors_and_walls_do_not(scene: Scene) -> None:
    change, entity = changed(scene, reflections=True)
    assert change[entity == 4].mean() > 4
    assert np.abs(change[entity == 3]).max() == 0


def test_everything_together_is_the_same_with_any_number_of_threads(scene: Scene) -> None:
    two = Cameras(np.repeat(LOOK.position, 2, 0), np.repeat(LOOK.forward, 2, 0), width=160, height=120)
    frames = take_pictures(scene, two, PictureRequest(quality=FINE_QUALITY), threads=2)
    assert np.array_equal(frames.rgb[0], frames.rgb[1])
    assert np.array_equal(frames.rgb[0], colours(scene, FINE_QUALITY))
    assert np.array_equal(frames.depth[0], render(scene, LOOK).depth[0])


@pytest.mark.parametrize("wanted", ["best", {"bloom": True}, {"reflections": 1}])
def test_nonsense_is_refused(wanted: Any) -> None:
    with pytest.raises(InputError, match="quality: "):
        RenderQuality.of(wanted)
