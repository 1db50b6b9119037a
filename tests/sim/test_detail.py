"""People who are a few pixels tall are drawn in less detail, and nobody can tell."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest

import toy_city
from vico.assets.people import anny, body_of
from vico.render import Cameras, render
from vico.render.skinning import batch_bodies, skin
from vico.render.world_scene import scene_of
from vico.sim.animation import pose, style_of
from vico.sim.pictures.people import ViewingCameras, far_from_all, looks_of_strangers

SOURCES = [
    "procedural",
    pytest.param(
        "anny",
        marks=pytest.mark.skipif(not anny.available(), reason="no baked bodies: vico assets install people"),
    ),
]


def test_far_is_who_is_small_in_every_picture() -> None:
    position, height = np.array([[5.0, 0, 0], [30.0, 0, 0], [30.0, 0, 0]]), np.array([1.7, 1.7, 1.7])
    eye = np.zeros((1, 3))
    assert far_from_all(ViewingCameras(eye, np.array([128.0])), position, height).tolist() == [False, True, True]
    assert not far_from_all(ViewingCameras(eye, np.array([1000.0])), position, height).any()
    # Another who looks from near by: all see them as they are.
    eyes = np.array([[0.0, 0, 0], [29.0, 0, 0]])
    assert not far_from_all(ViewingCameras(eyes, np.array([128.0, 128.0])), position, height).any()
    assert not far_from_all(ViewingCameras(np.zeros((0, 3)), np.zeros(0)), position, height).any()


@pytest.mark.parametrize("source", SOURCES)
def test_coarse_bodies_look_the_same_where_they_are_used(source: Literal["procedural", "anny"]) -> None:
    looks = looks_of_strangers(0, 4)
    near, far = ([body_of(look, source=source, detail=detail) for look in looks] for detail in ("light", "far"))
    batch = batch_bodies([*near, *far], [7, 8, 9, 10] * 2)
    assert len(far[0].triangles) < len(near[0].triangles) / (3 if source == "anny" else 2)
    style = np.stack([style_of(body, np.random.default_rng(k), age=30) for k, body in enumerate(near)])
    posed = pose(np.ones(4, np.int64), np.array([0.0, 0.3, 0.6, 0.9]), np.full(4, 1.2), style)
    # 128 pixels of focal length: 12 pixels tall, as tall as coarse bodies ever are.
    away = 128.0 * 1.75 / 12.0
    # Above the roofs, before the sky.
    place = np.array([[away, 2.0 * k - 3.0, 50.0] for k in range(4)])
    scene = scene_of(toy_city.world())
    eye = Cameras(np.array([[0.0, 0.0, 51.6]]), np.array([[1.0, 0.0, 0.0]]))
    pictures = []
    for drawn in (np.arange(4), np.arange(4, 8)):
        vertices, normals = skin(batch, *posed, place, np.full(4, 1.0), drawn=drawn)
        scene.set_skinned(vertices, normals, batch.triangles, batch.colour, batch.entity, drawn=drawn)
        pictures.append(render(scene, eye))
    before, after = (picture.segmentation[0] for picture in pictures)
    people = np.isin(before, (7, 8, 9, 10))
    assert people.sum() > 60
    assert (before != after).sum() < 0.15 * people.sum()
    change = np.abs(pictures[0].rgb[0].astype(int) - pictures[1].rgb[0])[people & (before == after)]
    assert change.mean() < 10.0
