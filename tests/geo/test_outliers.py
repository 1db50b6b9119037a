"""Heights that no ground has are left out; cliffs, peaks and stacks are kept."""

from pathlib import Path

import numpy as np
import pytest

from vico.geo.raster_windows import without_outliers
from vico.geo.rasters import read_raster


def hills(size: int = 60) -> np.ndarray:
    """Ground at 620 m, with hills of 40 m."""
    row, column = np.mgrid[:size, :size]
    return 620.0 + 20.0 * np.sin(row / 7.0) + 20.0 * np.cos(column / 9.0)


def places(heights: np.ndarray, spacing: float = 10.0) -> set[tuple[int, int]]:
    return {(row, column) for row, column, _ in without_outliers(heights, spacing)[1]}


@pytest.mark.parametrize("height", [8850.0, 6000.0, -500.0, -900.0, 0.0])
@pytest.mark.parametrize("spacing", [1.0, 10.0, 30.0, 90.0])
def test_one_bad_pixel_is_left_out(height: float, spacing: float) -> None:
    heights = hills()
    heights[30, 20] = height
    kept, found = without_outliers(heights, spacing)
    assert found == [(30, 20, height)]
    assert np.isnan(kept[30, 20])
    assert np.isfinite(kept).sum() == kept.size - 1


def test_a_bad_pixel_at_the_edge_and_in_the_corner_is_left_out() -> None:
    heights = hills()
    heights[0, 0] = heights[59, 30] = 8850.0
    assert places(heights) == {(0, 0), (59, 30)}


def test_groups_of_different_bad_heights_are_left_out() -> None:
    heights = hills()
    heights[30, 20:23] = [8850.0, 5000.0, -500.0]
    assert places(heights) == {(30, 20), (30, 21), (30, 22)}


def test_a_block_of_a_height_for_no_data_is_left_out() -> None:
    heights = hills()
    heights[20:35, 20:35] = -900.0
    assert len(places(heights)) == 225


def test_bad_pixels_on_both_sides_of_a_tile_of_a_large_grid_are_left_out() -> None:
    heights = hills(1300)
    bad = {(511, 640), (512, 512), (639, 639), (640, 300), (1299, 1299), (700, 1151)}
    for row, column in bad:
        heights[row, column] = 8850.0
    assert places(heights) == bad


def test_a_cliff_is_kept() -> None:
    heights = hills()
    heights[:, 30:] += 900.0
    assert places(heights, 1.0) == set()


def test_a_ledge_half_way_up_a_cliff_is_kept() -> None:
    heights = hills()
    heights[:, 30:] += 900.0
    heights[20:22, 30] -= 450.0
    assert places(heights) == set()


@pytest.mark.parametrize("spacing", [5.0, 10.0, 30.0])
def test_a_sea_stack_is_kept(spacing: float) -> None:
    heights = np.zeros((60, 60))
    wide = max(round(30.0 / spacing), 1)
    heights[30 : 30 + wide, 30 : 30 + wide] = 137.0  # the Old Man of Hoy
    assert places(heights, spacing) == set()


def test_a_steep_peak_of_one_pixel_is_kept() -> None:
    row, column = np.mgrid[:60, :60]
    heights = 4478.0 - 3.0 * 30.0 * np.hypot(row - 30, column - 30)  # 70 degrees on all sides, on a grid of 30 m
    assert places(np.maximum(heights, 2000.0), 30.0) == set()


def test_a_cliff_that_a_slope_leads_around_is_kept() -> None:
    heights = hills()
    heights[30, 20:30] = np.linspace(700.0, 1000.0, 10)  # a ramp
    assert places(heights) == set()


def test_nothing_known_around_leaves_a_height_as_it_is() -> None:
    heights = np.full((9, 9), np.nan)
    heights[4, 4] = 300.0
    assert places(heights) == set()


@pytest.mark.parametrize("name", ["monaco/N43E007.hgt.zip", "andorra/dem_srtm.tif", "portland/dem_ned13.tif"])
def test_true_ground_is_kept_whole(shared_data: Path, name: str) -> None:
    raster = read_raster(shared_data / "places" / name)
    heights = raster.pixels.read(0, raster.pixels.shape[0], 0, raster.pixels.shape[1])
    heights[heights < -1000.0] = np.nan
    spacing = abs(float(raster.affine[0, 0])) * 111_320.0
    assert places(heights, spacing) == set()
