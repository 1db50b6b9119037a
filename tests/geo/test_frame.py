"""The local frame against geodesics and against itself."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyproj import Geod

from vico.errors import InputError
from vico.geo.frame import LocalFrame

HELSINKI = LocalFrame(60.1690, 24.9435)


@given(st.floats(-84, 84), st.floats(-179, 179), st.floats(-800, 800), st.floats(-800, 800))
@settings(max_examples=50, deadline=None)
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


@pytest.mark.parametrize(("lat", "lon"), [(91, 0), (-86, 10), (24, 181), (float("nan"), 0)])
def test_a_point_off_the_earth_is_refused(lat: float, lon: float) -> None:
    with pytest.raises(InputError, match="coordinates"):
        LocalFrame(lat, lon)
