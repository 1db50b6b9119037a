"""Street photos: what is shared by all sources, and folders of photos with poses."""

import io
import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from vico.errors import EmptyInputError, MissingFileError, SchemaError
from vico.geo.frame import LocalFrame
from vico.geo.street_image_folder import FolderImages
from vico.geo.street_images import (
    camera_rotation,
    decode_picture,
    heading_of,
    pinhole,
    rotation_from_axis_angle,
    select_spread,
    undistort,
)

HERE = LocalFrame(60.169, 24.9435)
ANGLES = st.floats(-3.1, 3.1)


def jpeg(width: int = 64, height: int = 48, colour: tuple[int, int, int] = (200, 100, 50)) -> bytes:
    packed = io.BytesIO()
    Image.new("RGB", (width, height), colour).save(packed, "JPEG")
    return packed.getvalue()


@settings(max_examples=30, deadline=None)
@given(ANGLES, ANGLES, ANGLES)
def test_an_angle_axis_vector_gives_a_rotation_about_it(x: float, y: float, z: float) -> None:
    rotation = rotation_from_axis_angle((x, y, z))
    assert np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-9)
    assert np.isclose(np.linalg.det(rotation), 1.0)
    assert np.allclose(rotation @ np.array([x, y, z]), [x, y, z], atol=1e-9)


@settings(max_examples=30, deadline=None)
@given(st.floats(0, 359.9), st.floats(-80, 80), st.floats(-170, 170))
def test_a_camera_looks_where_heading_and_pitch_say(heading: float, pitch: float, roll: float) -> None:
    rotation = camera_rotation(heading, pitch, roll)
    assert np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-9)
    assert np.isclose(np.linalg.det(rotation), 1.0)
    assert abs((heading_of(rotation) - heading + 180) % 360 - 180) < 1e-6
    assert np.isclose(rotation[2, 2], np.sin(np.radians(pitch)))


def test_a_level_camera_to_the_east_sees_south_to_its_right() -> None:
    right, down, forward = camera_rotation(90.0)
    assert np.allclose(forward, [1, 0, 0], atol=1e-12)
    assert np.allclose(right, [0, -1, 0], atol=1e-12)
    assert np.allclose(down, [0, 0, -1], atol=1e-12)


@settings(max_examples=30, deadline=None)
@given(st.floats(-0.25, 0.25), st.floats(-0.1, 0.1), st.floats(0.6, 1.2))
def test_undistortion_takes_each_pixel_from_where_the_lens_put_it(k1: float, k2: float, share: float) -> None:
    # The picture holds its own coordinates, so that every pixel tells where it was taken from.
    height, width = 60, 80
    focal = share * width
    row, column = np.mgrid[0:height, 0:width]
    picture = np.stack([column * 3, row * 4, np.zeros_like(row)], axis=-1).astype(np.uint8)
    made = undistort(picture, focal, k1, k2).astype(float)
    x, y = (column + 0.5 - width / 2) / focal, (row + 0.5 - height / 2) / focal
    square = x * x + y * y
    bend = 1 + k1 * square + k2 * square**2
    from_column, from_row = x * bend * focal + width / 2 - 0.5, y * bend * focal + height / 2 - 0.5
    inside = (from_column > 0) & (from_column < width - 1.01) & (from_row > 0) & (from_row < height - 1.01)
    assert np.abs(made[..., 0] / 3 - from_column)[inside].max() < 0.2
    assert np.abs(made[..., 1] / 4 - from_row)[inside].max() < 0.2


def test_a_large_photo_is_made_smaller() -> None:
    assert decode_picture(jpeg(900, 600), "photo", longest=300).shape == (200, 300, 3)


@settings(max_examples=30, deadline=None)
@given(st.binary(max_size=200), st.integers(0, 600))
def test_a_broken_photo_is_refused_in_one_sentence(junk: bytes, cut: int) -> None:
    for data in (junk, jpeg()[:cut] if cut < 500 else b"\xff\xd8" + junk):
        with pytest.raises(SchemaError, match=r"^photo 7: not a readable photo"):
            decode_picture(data, "photo 7")


def test_photos_are_spread_over_the_place() -> None:
    places = np.array([[0.0, 0], [1, 0], [50, 0], [50.5, 0], [0, 60]])
    assert select_spread(places, [0.0] * 5, 3) == [0, 4, 3]
    assert select_spread(places[:0], [], 3) == []
    # Two photos from one spot that look opposite ways are worth more than one a metre away.
    assert select_spread(np.array([[0.0, 0], [0, 0], [1, 0]]), [0.0, 180.0, 0.0], 2) == [0, 1]


def folder(path: Path, **changes: object) -> Path:
    photo = {"file": "a.jpg", "lat": 60.169, "lon": 24.9436, "heading": 90.0, "pitch": 5.0, "fov": 50.0} | changes
    (path / "a.jpg").write_bytes(jpeg())
    record = {"schema": "vico.photos", "version": 1, "attribution": "A. Person, CC BY", "photos": [photo]}
    (path / "photos.json").write_text(json.dumps(record))
    return path


def test_our_own_pose_file_gives_cameras(tmp_path: Path) -> None:
    source = FolderImages(folder(tmp_path, eye=1.5))
    (photo,) = source.near(HERE, 50.0, most=5)
    assert photo.position[0] == pytest.approx(5.55, abs=0.1)
    assert photo.eye == photo.position[2] == 1.5
    assert photo.attribution == "A. Person, CC BY"
    assert photo.intrinsics == pytest.approx(pinhole(64, 48, 24 / np.tan(np.radians(25))))
    assert photo.rotation == pytest.approx(camera_rotation(90.0, 5.0))


def test_an_altitude_is_taken_as_it_is(tmp_path: Path) -> None:
    (photo,) = FolderImages(folder(tmp_path, altitude=12.5)).near(HERE, 50.0, most=5)
    assert photo.eye is None
    assert photo.position[2] == 12.5


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"heading": "north"}, "photos.0.heading"),
        ({"lat": 91.0}, "photos.0.lat"),
        ({"colour": 1}, "photos.0.colour"),
        ({"focal": 1.0}, "one of fov and focal"),
    ],
)
def test_a_wrong_entry_is_named(tmp_path: Path, change: dict[str, object], told: str) -> None:
    with pytest.raises(SchemaError, match=told):
        list(FolderImages(folder(tmp_path, **change)).near(HERE, 50.0, most=5))


def test_a_photo_outside_the_folder_is_not_read(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    (tmp_path / "secret.jpg").write_bytes(jpeg())
    source = FolderImages(folder(tmp_path / "in", file="../secret.jpg"))
    assert list(source.near(HERE, 50.0, most=5)) == []
    assert "outside the folder" in source.refused[0][1]


def test_a_missing_photo_is_left_out_and_told(tmp_path: Path) -> None:
    source = FolderImages(folder(tmp_path, file="b.jpg"))
    assert list(source.near(HERE, 50.0, most=5)) == []
    assert source.refused[0][0] == "b.jpg"


def test_a_folder_needs_poses(tmp_path: Path) -> None:
    with pytest.raises(MissingFileError, match="photos need poses"):
        FolderImages(tmp_path)
    with pytest.raises(MissingFileError, match="no such folder"):
        FolderImages(tmp_path / "x")


def test_photos_of_elsewhere_are_refused(tmp_path: Path) -> None:
    with pytest.raises(EmptyInputError, match="give photos of this place"):
        list(FolderImages(folder(tmp_path)).near(LocalFrame(48.0, 11.0), 50.0, most=5))


@settings(max_examples=30, deadline=None)
@given(st.binary(max_size=80))
def test_a_broken_reconstruction_is_refused(tmp_path_factory: pytest.TempPathFactory, junk: bytes) -> None:
    path = tmp_path_factory.mktemp("photos")
    (path / "reconstruction.json").write_bytes(junk)
    with pytest.raises((SchemaError, EmptyInputError)):
        list(FolderImages(path).near(HERE, 50.0, most=5))


def test_the_real_photos_of_berlin_stand_where_opensfm_put_them(shared_data: Path, tmp_path: Path) -> None:
    real = shared_data / "streetview" / "berlin"
    frame = LocalFrame(52.51896296296295, 13.400376851851851)
    listed = {p.id: p for p in FolderImages(real, longest=400).near(frame, 60.0, most=9)}
    assert sorted(listed) == ["01", "02", "03"]
    assert listed["01"].picture.shape == (300, 400, 3)
    assert listed["01"].captured == "2014-05-26T10:56:02+00:00"
    # The same photos by the reconstruction itself: the names in it are those of the upstream folder.
    for k in ("01", "02", "03"):
        (tmp_path / f"{k}.jpg").write_bytes((real / f"berlin_{k}.jpg").read_bytes())
    (tmp_path / "reconstruction.json").write_bytes((real / "reconstruction_opensfm.json").read_bytes())
    built = {p.id[:2]: p for p in FolderImages(tmp_path, longest=400).near(frame, 60.0, most=9)}
    for k, photo in listed.items():
        assert photo.rotation == pytest.approx(built[k].rotation, abs=1e-9)
        assert photo.position == pytest.approx(built[k].position, abs=0.02)
    # The reconstruction's points have in the pictures the colours that they are said to have.
    points = json.loads((real / "reconstruction_opensfm.json").read_text())[0]["points"]
    altitude = {"01": 31.040237715292637, "02": 31.166532355370606, "03": 31.76852220164348}
    cloud = np.array([p["coordinates"] for p in points.values()])
    grey = np.array([p["color"] for p in points.values()]).mean(axis=1)
    for k, photo in listed.items():
        seen = (cloud - [*photo.position[:2], altitude[k]]) @ photo.rotation.T
        xy = ((seen / seen[:, 2:]) @ photo.intrinsics.T)[:, :2]
        inside = (seen[:, 2] > 1) & ((xy > 0) & (xy < [400, 300])).all(axis=1)
        column, row = xy[inside].astype(int).T
        assert inside.mean() > 0.6
        assert np.corrcoef(photo.picture[row, column].mean(axis=1), grey[inside])[0, 1] > 0.7
