"""The local frame against geodesics and against itself."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyproj import Geod

from vico.errors import InputError
from vico.geo.frame import LocalFrame

HELSINKI = LocalFrame(60.1690, 24.9435)


@given(st.floats(-90, 90), st.floats(-180, 180), st.floats(-2500, 2500), st.floats(-2500, 2500))
@settings(max_examples=25, deadline=None)
def test_there_and_back_is_the_same_point(lat: float, lon: float, x: float, y: float) -> None:
    frame = LocalFrame(lat, lon)
    back = frame.to_enu(*frame.to_geodetic((x, y)))
    assert np.abs(back - (x, y)).max() < 1e-6


def test_distances_are_true_within_a_kilometre() -> None:
    lat, lon = HELSINKI.to_geodetic([(600.0, 800.0)])
    bearing, _, length = Geod(ellps="WGS84").inv(24.9435, 60.1690, lon[0], lat[0])
    assert length == pytest.approx(1000.0, abs=1e-3)
    assert bearing == pytest.approx(np.degrees(np.arctan2(600, 800)), abs=1e-4)


def test_the_box_holds_the_square_and_little_more() -> None:
    west, south, east, north = HELSINKI.bbox(400.0)
    side = np.linspace(-400, 400, 41)
    lat, lon = HELSINKI.to_geodetic(np.array([(x, y) for x in side for y in side]))
    assert west <= lon.min() + 1e-12
    assert south <= lat.min() + 1e-12
    assert (east - west) / (lon.max() - lon.min()) < 1.001
    assert (north - south) / (lat.max() - lat.min()) < 1.001


@pytest.mark.parametrize(("lat", "lon"), [(91, 0), (-90.1, 10), (24, 181), (float("nan"), 0)])
def test_a_point_off_the_earth_is_refused(lat: float, lon: float) -> None:
    with pytest.raises(InputError, match="coordinates"):
        LocalFrame(lat, lon)


@given(st.sampled_from([-90, -89, 0, 60, 89, 89.99, 90]) | st.floats(-90, 90), st.floats(-180, 180))
@settings(max_examples=25, deadline=None)
def test_the_boxes_hold_the_square_anywhere_on_earth(lat: float, lon: float) -> None:
    frame = LocalFrame(lat, lon)
    boxes = frame.boxes(400.0)
    assert all(-180 <= west <= east <= 180 and -90 <= south <= north <= 90 for west, south, east, north in boxes)
    side = np.linspace(-400, 400, 9)
    lats, lons = frame.to_geodetic(np.array([(x, y) for x in side for y in side]))
    held = [
        (lons >= west - 1e-9) & (lons <= east + 1e-9) & (lats >= south - 1e-9) & (lats <= north + 1e-9)
        for west, south, east, north in boxes
    ]
    assert np.any(held, axis=0).all()


@pytest.mark.parametrize("lon", [180.0, -180.0, 179.9999])
def test_over_the_date_line_the_box_is_narrow_and_west_exceeds_east(lon: float) -> None:
    west, _, east, _ = LocalFrame(-16.8, lon).bbox(400.0)
    assert 179.99 < west <= 180.0
    assert -180.0 <= east < -179.99


def test_around_a_pole_the_box_goes_all_the_way_round() -> None:
    assert LocalFrame(89.999, 30).bbox(400.0)[2:] == (180.0, 90.0)
    assert LocalFrame(-90, 30).bbox(400.0)[:2] == (-180.0, -90.0)
    west, south, east, north = LocalFrame(89.0, 30).bbox(400.0)
    assert east - west < 1.0
    assert 88.99 < south < north < 89.01
