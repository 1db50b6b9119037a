"""Elevation files: written here to the byte, and the real ones where they are."""

import zipfile
from pathlib import Path

import numpy as np
import pytest
import tifffile

from vico.errors import EmptyInputError, InputError, MissingFileError, SchemaError
from vico.geo.elevation import read_elevation
from vico.geo.frame import LocalFrame

FRAME = LocalFrame(43.5, 7.5)


def write_geotiff(path: Path, heights: np.ndarray, *, west: float, north: float, step: float, code: int = 4326) -> Path:
    keys = (1, 1, 0, 3, 1024, 0, 1, 2, 1025, 0, 1, 2, 2048, 0, 1, code)
    tags = [
        (33550, "d", 3, (step, step, 0.0), False),
        (33922, "d", 6, (0.0, 0.0, 0.0, west, north, 0.0), False),
        (34735, "H", len(keys), keys, False),
        (42113, "s", 0, "-9999", False),
    ]
    tifffile.imwrite(path, heights, extratags=tags)
    return path


def slope(step: float = 0.0005, size: int = 60) -> np.ndarray:
    """Ten metres a pixel to the south: the row's number, times ten."""
    return np.repeat(np.arange(size, dtype=np.float32)[:, None] * 10, size, axis=1)


def test_a_geotiff_s_heights_lie_where_its_tags_say(tmp_path: Path) -> None:
    path = write_geotiff(tmp_path / "a.tif", slope(), west=7.485, north=43.515, step=0.0005)
    samples = read_elevation(path, FRAME, 300.0)
    lat, _ = FRAME.to_geodetic(samples.points[:, :2])
    # Pixel is point: row r lies at north - r * step, and is 10 r high.
    assert np.abs(samples.points[:, 2] - (43.515 - lat) / 0.0005 * 10).max() < 1e-3


def test_voids_are_left_out(tmp_path: Path) -> None:
    heights = slope()
    heights[25:28, 25:28] = -9999
    path = write_geotiff(tmp_path / "a.tif", heights, west=7.485, north=43.515, step=0.0005)
    samples = read_elevation(path, FRAME, 300.0)
    assert samples.points[:, 2].min() >= 0
    whole = read_elevation(
        write_geotiff(tmp_path / "b.tif", slope(), west=7.485, north=43.515, step=0.0005), FRAME, 300
    )
    assert len(whole.points) - len(samples.points) == 9


def hgt_bytes() -> bytes:
    """A 3 arc second tile that rises a metre a row to the south."""
    return np.repeat(np.arange(1201, dtype=">i2")[:, None], 1201, axis=1).tobytes()


def test_a_zipped_hgt_is_read_by_its_member_s_name(tmp_path: Path) -> None:
    path = tmp_path / "tile.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("N43E007.hgt", hgt_bytes())
    samples = read_elevation(path, FRAME, 300.0)
    lat, _ = FRAME.to_geodetic(samples.points[:, :2])
    assert np.abs(samples.points[:, 2] - (44.0 - lat) * 1200).max() < 1e-3


def test_a_zip_that_unpacks_to_no_tile_is_not_unpacked(tmp_path: Path) -> None:
    path = tmp_path / "bomb.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("N43E007.hgt", bytes(30_000_000))
    with pytest.raises(SchemaError, match="no HGT tile"):
        read_elevation(path, FRAME, 300.0)


@pytest.mark.parametrize("name", ["a.tif", "N43E007.hgt", "a.zip"])
def test_rubbish_is_refused_in_one_sentence(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.write_bytes(b"rubbish" * 100)
    with pytest.raises(SchemaError, match=name.split(".")[0]):
        read_elevation(path, FRAME, 300.0)


def test_a_geotiff_without_coordinates_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "plain.tif"
    tifffile.imwrite(path, slope())
    with pytest.raises(SchemaError, match="EPSG"):
        read_elevation(path, FRAME, 300.0)


def test_a_tile_of_another_place_is_refused(tmp_path: Path) -> None:
    path = write_geotiff(tmp_path / "a.tif", slope(), west=8.485, north=43.515, step=0.0005)
    with pytest.raises(EmptyInputError, match="does not cover"):
        read_elevation(path, FRAME, 300.0)


def test_other_files_and_no_file_are_told_apart(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(b"x")
    with pytest.raises(InputError, match="must end in"):
        read_elevation(tmp_path / "a.png", FRAME, 300.0)
    with pytest.raises(MissingFileError, match="no such"):
        read_elevation(tmp_path / "b.tif", FRAME, 300.0)


def test_monaco_s_geotiff_agrees_with_the_tile_it_was_cut_from(shared_data: Path) -> None:
    monaco = shared_data / "places" / "monaco"
    frame = LocalFrame(43.73384, 7.41813)
    clip = read_elevation(monaco / "dem_srtm.tif", frame, 400.0)
    tile = read_elevation(monaco / "N43E007.hgt.zip", frame, 400.0)
    assert np.allclose(clip.points, tile.points, atol=1e-5)
