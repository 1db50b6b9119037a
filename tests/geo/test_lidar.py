"""Point clouds, written here: there is no real one of a clear licence that is small enough to keep."""

import sys
from pathlib import Path

import numpy as np
import pytest
from pyproj import CRS, Transformer

from vico.errors import EmptyInputError, MissingExtraError, SchemaError
from vico.geo.elevation import read_elevation
from vico.geo.frame import LocalFrame

laspy = pytest.importorskip("laspy", reason="point clouds need the extra lidar")

FRAME = LocalFrame(52.51, 13.39)
EAST, NORTH = Transformer.from_crs("EPSG:4326", "EPSG:25833", always_xy=True).transform(13.39, 52.51)


def cloud(path: Path, *, west: float = -100.0, east: float = 100.0, crs: int | None = 25833, ground: int = 2) -> Path:
    """Write a point a metre: ground that rises 1 m in 20 to the north, and a house of 20 m by 20 m on it."""
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(west, east) + 0.5, np.arange(-100.0, 100.0) + 0.5))
    house = (np.abs(x) < 10) & (np.abs(y) < 10)
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales = np.full(3, 0.001)
    header.offsets = np.array([EAST, NORTH, 0.0])
    if crs is not None:
        header.add_crs(CRS.from_epsg(crs))
    data = laspy.LasData(header)
    data.x, data.y, data.z = EAST + x, NORTH + y, 40.0 + y / 20 + np.where(house, 15.0, 0.0)
    data.classification = np.where(house, 6, ground).astype(np.uint8)
    data.write(path)
    return path


def slope_at(samples: np.ndarray) -> np.ndarray:
    lat, lon = FRAME.to_geodetic(samples[:, :2])
    _, north = Transformer.from_crs("EPSG:4326", "EPSG:25833", always_xy=True).transform(lon, lat)
    return np.asarray(40.0 + (north - NORTH) / 20)


@pytest.mark.parametrize("name", ["tile.laz", "tile.las"])
def test_the_ground_is_read_and_what_lies_under_the_house_is_filled_and_said(name: str, tmp_path: Path) -> None:
    samples = read_elevation(cloud(tmp_path / name), FRAME, 30.0)
    assert np.abs(samples.points[:, 2] - slope_at(samples.points)).max() < 0.15
    assert samples.filled == pytest.approx(100, abs=25)  # 20 m x 20 m in cells of 2 m
    assert samples.spacing == pytest.approx(2.0)
    assert samples.covered == 1.0
    assert samples.beyond == ""


def test_a_tile_that_covers_half_is_used_and_the_rest_flattens_out(tmp_path: Path) -> None:
    samples = read_elevation(cloud(tmp_path / "half.laz", east=0.0), FRAME, 30.0)
    assert samples.covered == pytest.approx(0.5, abs=0.05)
    assert "only 5" in samples.beyond
    assert "half.laz covers latitudes" in samples.beyond
    assert "add files of the rest" in samples.beyond
    west = samples.points[samples.points[:, 0] < -2.0]
    assert np.abs(west[:, 2] - slope_at(west)).max() < 0.15
    far = samples.points[samples.points[:, 0] > 75.0]
    assert np.ptp(far[:, 2]) < 2.5 < np.ptp(west[:, 2])


def test_the_rest_comes_from_another_file(tmp_path: Path) -> None:
    halves = [cloud(tmp_path / "w.laz", east=0.0), cloud(tmp_path / "e.laz", west=0.0)]
    samples = read_elevation(halves, FRAME, 30.0)
    assert samples.covered == 1.0
    assert [count > 500 for _, _, count in samples.files] == [True, True]
    assert np.abs(samples.points[:, 2] - slope_at(samples.points)).max() < 0.15


def test_the_system_is_said_after_the_name_where_the_file_does_not_say_it(tmp_path: Path) -> None:
    path = cloud(tmp_path / "bare.laz", crs=None)
    with pytest.raises(SchemaError, match=r"no EPSG code.*bare\.laz@EPSG"):
        read_elevation(path, FRAME, 30.0)
    assert read_elevation(f"{path}@EPSG:25833", FRAME, 30.0).covered == 1.0


def test_points_without_classes_other_places_and_rubbish_are_refused(tmp_path: Path) -> None:
    with pytest.raises(EmptyInputError, match=r"none of its .* points in the window is classed as ground"):
        read_elevation(cloud(tmp_path / "raw.laz", ground=1), FRAME, 30.0)
    with pytest.raises(EmptyInputError, match=r"nothing of the .* lies elsewhere"):
        read_elevation(cloud(tmp_path / "here.laz"), LocalFrame(48.1, 11.5), 30.0)
    rubbish = tmp_path / "rubbish.laz"
    rubbish.write_bytes(cloud(tmp_path / "whole.laz").read_bytes()[:3000])
    with pytest.raises(SchemaError, match="not a readable point cloud"):
        read_elevation(rubbish, FRAME, 30.0)


def test_a_missing_library_is_one_sentence_with_what_to_type(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = cloud(tmp_path / "tile.laz")
    monkeypatch.setitem(sys.modules, "laspy", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'virtual-community\[lidar\]'"):
        read_elevation(path, FRAME, 30.0)
