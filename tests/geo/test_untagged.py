"""Voids that a file does not tag are left out, whatever their size; seas, lakes and stacks are kept."""

from pathlib import Path

import numpy as np
import pytest

from vico.errors import EmptyInputError
from vico.geo.elevation import read_elevation
from vico.geo.frame import LocalFrame
from vico.geo.raster_windows import without_voids
from vico.geo.rasters import read_raster

from .test_elevation import write_geotiff

ROW, COLUMN = np.mgrid[:64, :64]
GROUND = 605.0 + 0.3 * COLUMN + 0.2 * ROW
SHAPES = {
    "diagonal half": ROW > COLUMN + 3,
    "strip": COLUMN < 20,
    "block": (abs(ROW - 31) < 11) & (abs(COLUMN - 31) < 11),
    "frame": (ROW < 6) | (COLUMN < 6) | (ROW > 57) | (COLUMN > 57),
}


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("value", [0.0, 255.0, -999.0])
@pytest.mark.parametrize("spacing", [1.0, 10.0, 30.0])
def test_patches_of_a_value_far_from_the_ground_are_left_out(shape: str, value: float, spacing: float) -> None:
    void = SHAPES[shape]
    kept, voids, _ = without_voids(np.where(void, value, GROUND), spacing)
    assert (np.isnan(kept) == void).all()
    assert {patch.value for patch in voids} == {value}
    assert sum(patch.pixels for patch in voids) == void.sum()


def test_pixels_that_resampling_mixed_with_a_void_are_left_out_too() -> None:
    heights = np.where(SHAPES["strip"], 0.0, GROUND)
    heights[:, 20], heights[:, 21] = 200.0, 450.0
    kept, _, _ = without_voids(heights, 10.0)
    assert np.isnan(kept[:, :22]).all()
    assert (kept[:, 22:] == GROUND[:, 22:]).all()


@pytest.mark.parametrize("height", [60.0, 214.0])
def test_a_sea_below_cliffs_is_kept_and_told(height: float) -> None:
    heights = np.where(COLUMN < 25, 0.0, height + 0.4 * COLUMN)
    kept, voids, doubtful = without_voids(heights, 10.0)
    assert (kept == heights).all()
    assert voids == []
    assert [(patch.value, patch.pixels) for patch in doubtful] == [(0.0, 25 * 64)]


@pytest.mark.parametrize(
    "heights",
    [
        np.maximum((COLUMN - 25) * 8.0, 0.0),  # a beach
        np.where(COLUMN < 25, 0.0, np.where(ROW < 40, (COLUMN - 24) * 6.0, 400.0)),  # cliffs along a third of it
        np.where((ROW > 20) & (ROW < 40) & (COLUMN < 30), 272.35, 300.0),  # a lake in a quarry
        np.where((abs(ROW - 32) < 4) & (abs(COLUMN - 32) < 4), 137.0, 0.0),  # as high as the Old Man of Hoy
        np.zeros((64, 64)),
    ],
)
def test_seas_lakes_and_islands_are_kept(heights: np.ndarray) -> None:
    kept, voids, _ = without_voids(heights, 30.0)
    assert (kept == heights).all()
    assert voids == []


def test_a_void_without_a_tag_is_filled_counted_and_placed(tmp_path: Path) -> None:
    heights = np.where(SHAPES["strip"], 0.0, GROUND).astype(np.float32)
    path = write_geotiff(tmp_path / "a.tif", heights, west=7.9968, north=46.5032, step=0.0001)
    samples = read_elevation(path, LocalFrame(46.5, 8.0), 120.0)
    assert samples.points[:, 2].min() > 604.0
    assert samples.filled > 300
    [(name, _, lon, value, pixels, step)] = samples.voids
    assert (name, value) == ("a.tif", 0.0)
    assert lon < 7.9988
    assert pixels > 300
    assert 605.0 < step < 630.0


def test_a_window_that_is_mostly_such_a_void_is_refused_with_its_value(tmp_path: Path) -> None:
    heights = np.where(SHAPES["block"], 255.0, GROUND).astype(np.float32)
    path = write_geotiff(tmp_path / "a.tif", heights, west=7.9968, north=46.5032, step=0.0001)
    with pytest.raises(EmptyInputError, match="void, patches of exactly 255 m among it"):
        read_elevation(path, LocalFrame(46.5, 8.0), 60.0)


@pytest.mark.parametrize("name", ["monaco/N43E007.hgt.zip", "andorra/dem_srtm.tif", "portland/dem_ned13.tif"])
def test_true_ground_has_no_such_void(shared_data: Path, name: str) -> None:
    raster = read_raster(shared_data / "places" / name)
    heights = raster.pixels.read(0, raster.pixels.shape[0], 0, raster.pixels.shape[1])
    heights[heights < -1000.0] = np.nan
    spacing = abs(float(raster.affine[0, 0])) * 111_320.0
    assert without_voids(heights, spacing)[1:] == ([], [])
