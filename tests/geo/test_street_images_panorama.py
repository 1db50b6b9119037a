"""Panoramas cut into photos."""

import io
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from vico.errors import SchemaError
from vico.geo.frame import LocalFrame
from vico.geo.street_image_folder import FolderImages
from vico.geo.street_images import VIEWS, StreetImage, camera_rotation, cut_panorama, pinhole

HERE = LocalFrame(60.169, 24.9435)


def colours(direction: np.ndarray) -> np.ndarray:
    """A smooth colour of every direction, east, north and up."""
    return np.round((direction + 1) * 127.5).astype(np.uint8)


def panorama(rotation: np.ndarray, width: int = 720) -> StreetImage:
    height = width // 2
    longitude = ((np.arange(width) + 0.5) / width - 0.5) * 2 * np.pi
    latitude = (0.5 - (np.arange(height) + 0.5) / height) * np.pi
    flat = np.cos(latitude)[:, None]
    ray = np.stack(
        np.broadcast_arrays(flat * np.sin(longitude), -np.sin(latitude)[:, None], flat * np.cos(longitude)), axis=-1
    )
    position = np.array([3.0, 4.0, 1.9])
    return StreetImage("p", colours(ray @ rotation), position, rotation, np.eye(3), None, "test", "me", eye=1.9)


@settings(max_examples=8, deadline=None)
@given(st.floats(0, 359.9), st.floats(-40, 40), st.floats(-60, 60))
def test_each_view_shows_what_lies_in_its_direction(heading: float, pitch: float, roll: float) -> None:
    whole = panorama(camera_rotation(heading, pitch, roll))
    views = cut_panorama(whole)
    assert [view.id for view in views] == ["p/0", "p/60", "p/120", "p/180", "p/240", "p/300"]
    for k, view in enumerate(views):
        h, w = view.picture.shape[:2]
        assert np.allclose(view.rotation, camera_rotation(heading + 60.0 * k, 12.0), atol=1e-6)
        assert np.allclose(view.intrinsics, pinhole(w, h, view.intrinsics[0, 0]))
        column, row = np.meshgrid(np.arange(w) + 0.5, np.arange(h) + 0.5)
        ray = np.stack([column, row, np.ones_like(row)], axis=-1) @ np.linalg.inv(view.intrinsics).T @ view.rotation
        true = colours(ray / np.linalg.norm(ray, axis=-1, keepdims=True)).astype(int)
        assert np.abs(view.picture - true).max() <= 2
        assert view.position is whole.position
        assert view.eye == 1.9


def test_views_overlap_all_around_and_are_as_fine_as_the_panorama() -> None:
    views = cut_panorama(panorama(camera_rotation(30.0)))
    for view in views:
        assert 2 * np.degrees(np.arctan(view.intrinsics[0, 2] / view.intrinsics[0, 0])) > 360.0 / VIEWS + 10.0
        assert view.intrinsics[0, 0] == pytest.approx(720 / (2 * np.pi))


def test_a_part_of_the_sphere_is_no_panorama() -> None:
    whole = panorama(camera_rotation(0.0))
    with pytest.raises(SchemaError, match=r"photo p: 720 x 200 pixels are no whole panorama"):
        cut_panorama(replace(whole, picture=whole.picture[80:280]))


def folder(tmp_path: Path, **changes: object) -> Path:
    packed = io.BytesIO()
    Image.fromarray(panorama(camera_rotation(75.0), 240).picture).save(packed, "PNG")
    (tmp_path / "a.png").write_bytes(packed.getvalue())
    record = {"file": "a.png", "lat": 60.169, "lon": 24.9435, "heading": 75.0, "projection": "equirectangular"}
    content = {"schema": "vico.photos", "version": 1, "attribution": "me", "photos": [{**record, **changes}]}
    (tmp_path / "photos.json").write_text(json.dumps(content))
    return tmp_path


def test_a_folder_gives_a_panorama_as_photos(tmp_path: Path) -> None:
    views = list(FolderImages(folder(tmp_path)).near(HERE, 50.0, most=9))
    assert [view.id for view in views] == [f"a.png/{turn}" for turn in (0, 60, 120, 180, 240, 300)]
    h, w = views[2].picture.shape[:2]
    assert views[2].picture[h // 2, w // 2] == pytest.approx(colours(camera_rotation(195.0, 12.0)[2]), abs=2)
    assert len(list(FolderImages(tmp_path).near(HERE, 50.0, most=4))) == 4


def test_a_panorama_with_a_lens_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SchemaError, match="an equirectangular panorama has no fov"):
        list(FolderImages(folder(tmp_path, fov=60.0)).near(HERE, 50.0, most=9))


def test_a_spherical_camera_of_opensfm_is_a_panorama(tmp_path: Path) -> None:
    (folder(tmp_path) / "photos.json").unlink()
    lenses = {"round": {"projection_type": "spherical"}, "fish": {"projection_type": "fisheye", "focal": 0.5}}
    shots = {
        name: {"rotation": [np.pi / 2, 0.0, 0.0], "translation": [0.0, 0.0, 0.0], "camera": camera}
        for name, camera in (("a.png", "round"), ("b.png", "fish"))
    }
    reference = {"latitude": 60.169, "longitude": 24.9435, "altitude": 0.0}
    parts = [{"cameras": lenses, "shots": shots, "reference_lla": reference}]
    (tmp_path / "reconstruction.json").write_text(json.dumps(parts))
    source = FolderImages(tmp_path)
    views = list(source.near(HERE, 50.0, most=9))
    assert len(views) == VIEWS
    assert views[0].rotation == pytest.approx(camera_rotation(0.0, 12.0))
    assert source.refused == [("b.png", "a fisheye camera; only perspective photos and panoramas are used")]
