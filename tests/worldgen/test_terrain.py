"""The height field: true to its samples, blind to cars and trees."""

from pathlib import Path

import numpy as np

from vico.geo.elevation import HeightSamples, read_elevation
from vico.geo.frame import LocalFrame
from vico.seeds import rng
from vico.worldgen.ground.terrain import flat_terrain, is_outlier, terrain_from_dem


def grid(height: object, spacing: float = 30.0, reach: float = 560.0) -> np.ndarray:
    side = np.arange(-reach, reach + 1, spacing)
    x, y = (v.ravel() for v in np.meshgrid(side, side))
    return np.stack([x, y, height(x, y)], axis=1)  # type: ignore[operator]


def hill(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return 40 + 0.1 * x + 25 * np.exp(-(x**2 + y**2) / 250**2)


def test_a_smooth_hill_is_met_within_a_decimetre() -> None:
    field = terrain_from_dem(HeightSamples(grid(hill), 30.0, "hill", ""), half=400.0)
    points = rng(0, "points").uniform(-400, 400, (2000, 2))
    error = field(points) - hill(*points.T)
    assert np.abs(error).max() < 0.1


def test_cells_are_at_most_four_metres_and_reach_past_the_square() -> None:
    field = terrain_from_dem(HeightSamples(grid(hill), 30.0, "hill", ""), half=400.0)
    assert field.cell <= 4.0
    assert field.half >= 440.0


def test_spikes_are_found_and_slopes_are_not() -> None:
    points = grid(lambda x, y: 0.6 * x)
    spikes = rng(0, "spikes").choice(len(points), 40, replace=False)
    points[spikes, 2] += 25.0
    found = set(np.flatnonzero(is_outlier(points)).tolist())
    assert set(spikes.tolist()) <= found
    assert len(found) <= 1.1 * len(spikes)


def test_spikes_do_not_lift_the_ground() -> None:
    points = grid(hill)
    points[rng(0, "spikes").choice(len(points), 40, replace=False), 2] += 30.0
    field = terrain_from_dem(HeightSamples(points, 30.0, "hill", ""), half=400.0)
    places = rng(0, "points").uniform(-400, 400, (2000, 2))
    assert np.abs(field(places) - hill(*places.T)).max() < 2.0


def test_flat_ground_is_level_everywhere() -> None:
    field = flat_terrain(half=400.0)
    assert np.array_equal(field(rng(0, "p").uniform(-600, 600, (100, 2))), np.zeros(100))


def test_monaco_climbs_from_the_harbour_to_the_hill(shared_data: Path) -> None:
    samples = read_elevation(shared_data / "places" / "monaco" / "dem_srtm.tif", LocalFrame(43.73384, 7.41813), 400.0)
    field = terrain_from_dem(samples, half=400.0)
    assert field.heights.min() < 2.0
    assert field.heights.max() > 120.0
    near = np.abs(samples.points[:, :2]).max(axis=1) < 400
    residual = field(samples.points[near, :2]) - samples.points[near, 2]
    assert np.sqrt((residual**2).mean()) < 2.0
