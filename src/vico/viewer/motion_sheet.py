"""A picture of a motion: the same body at moments of it, side by side."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.assets.motions import MotionClip
from vico.assets.people import Appearance, body_of
from vico.render import Cameras, Lighting, Scene, render
from vico.render.limbs import LIMBS
from vico.render.skinning import batch_bodies, skin
from vico.world.mesh import Material, Surface

_APART, _WIDE = 1.5, 1.9  # metres
_FIRST_ENTITY = 2_000_000


def motion_sheet(clip: MotionClip, *, moments: int = 8, height: int = 360) -> NDArray[np.uint8]:
    """Return a picture of a motion at moments that are evenly apart, from the side they begin to face.

    Parameters
    ----------
    moments
        How many bodies stand side by side, the first moment on the left.
    height
        Of the picture, pixels.

    Returns
    -------
    ndarray
        sRGB, uint8, shape ``(height, width, 3)``.
    """
    body = body_of(Appearance())
    frames = np.linspace(0, len(clip) - 1, moments).round().astype(int)
    batch = batch_bodies([body] * moments, [_FIRST_ENTITY + k for k in range(moments)])
    offsets = np.stack([clip.offset(frame, body.joints[0].astype(np.float64)) for frame in frames])
    offsets[:, :2] = 0.0  # each at its own place
    spots = np.zeros((moments, 3))
    spots[:, 1] = _APART * np.arange(moments)
    rotations = np.stack([clip.rotations(frame) for frame in frames])
    limbs = np.empty((moments, len(LIMBS), 7), np.float32)
    vertices, normals = skin(batch, rotations, offsets, spots, np.zeros(moments), limbs=limbs)
    half = 60.0
    corners = np.array([[-half, -half, 0], [half, -half, 0], [half, half, 0], [-half, half, 0]], np.float32)
    faces: Any = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    scene = Scene(
        [Surface.from_triangles(corners, faces, colour=(150, 150, 148), entity=1, material=Material("floor"))],
        lighting=Lighting(),
    )
    scene.set_skinned(vertices, normals, batch.triangles, batch.colour, batch.entity, limbs=limbs)
    middle, wide = float(spots[:, 1].mean()), _APART * (moments - 1) + _WIDE
    tall = 2.3
    # Cameras see 90 degrees from top to bottom: far enough away they would see mostly sky, so only the middle is kept.
    away = 6.0
    scale = height / tall
    full = round(2 * away * scale)
    cameras = Cameras(
        np.array([[away, middle, 0.95]]), np.array([[-1.0, 0.0, 0.0]]), width=round(wide * scale), height=full
    )
    picture = render(scene, cameras, depth=False, segmentation=False, samples=2).rgb[0]
    top = (full - height) // 2
    return np.ascontiguousarray(picture[top : top + height])
