"""What a texture's alpha means at night: which texels shine."""

import numpy as np
import pytest

from vico.render.cameras import Cameras
from vico.render.frames import render
from vico.render.lighting import Lighting
from vico.render.scene import Scene
from vico.world.mesh import Material, Surface


def _picture(hour: float, *, alpha: tuple[int, int]) -> np.ndarray:
    texture = np.full((8, 8, 4), 160, np.uint8)
    texture[:, :4, 3], texture[:, 4:, 3] = alpha
    wall = Surface.from_triangles(
        np.array([(10.0, 4.0, -2.0), (10.0, -4.0, -2.0), (10.0, -4.0, 6.0), (10.0, 4.0, 6.0)]),
        np.array([(0, 1, 2), (0, 2, 3)]),
        uv=np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]),
        colour=(255, 255, 255),
        material=Material("windows", texture, emission=1.0),
    )
    camera = Cameras(np.array([(0.0, 0.0, 1.7)]), np.array([(1.0, 0.0, 0.0)]), fov_y=0.4, width=64, height=32)
    scene = Scene([wall], {}, lighting=Lighting.at(hour * 3600.0))
    return render(scene, camera, depth=False, segmentation=False).rgb[0].astype(float)


def test_at_night_lit_texels_shine_and_dark_ones_do_not() -> None:
    picture = _picture(23.0, alpha=(255, 0))
    lit, dark = picture[12:20, 20:28].mean(axis=(0, 1)), picture[12:20, 36:44].mean(axis=(0, 1))
    assert lit.mean() > 120.0
    assert dark.mean() < 60.0
    assert lit[0] > lit[2] + 20.0  # lamps are warmer than the wall


def test_by_day_alpha_changes_nothing() -> None:
    assert np.array_equal(_picture(12.0, alpha=(255, 0)), _picture(12.0, alpha=(255, 255)))


@pytest.mark.parametrize("share", [0, 128, 255])
def test_light_grows_with_alpha(share: int) -> None:
    picture = _picture(23.0, alpha=(share, 255))
    left, right = picture[12:20, 20:28].mean(), picture[12:20, 36:44].mean()
    assert left == pytest.approx(right, abs=1.0) if share == 255 else left < right - 5.0
