"""The height look-up: bilinear where it is smooth, sharp at kerbs, and the same after a round through a file."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vico.errors import SchemaError
from vico.world.heights import EDGE_RANGE, HeightField, Steps
from vico.world.world import read_terrain, write_terrain

HALF = 20.0


def kerbed(line: float, cell: float = 0.5) -> HeightField:
    """A slope with a carriageway to the west of x = `line`, 12 cm lower."""
    n = round(2 * HALF / cell) + 1
    x = np.broadcast_to(np.linspace(-HALF, HALF, n), (n, n))
    edge = np.round(np.clip(x - line, -EDGE_RANGE, EDGE_RANGE) * (127 / EDGE_RANGE)).astype(np.int8)
    low, high = np.full((n, n), -120, np.int16), np.zeros((n, n), np.int16)
    side = np.linspace(0.0, 4.0, 21)
    return HeightField(np.broadcast_to(side, (21, 21)).astype(np.float32), HALF, Steps(edge, low, high))


@settings(deadline=None)  # the first look-up compiles
@given(line=st.floats(-5.0, 5.0), x=st.floats(-10.0, 10.0), y=st.floats(-10.0, 10.0))
def test_a_kerb_is_where_it_is_drawn_to_six_centimetres(line: float, x: float, y: float) -> None:
    field = kerbed(line)
    if abs(x - line) < 0.06:
        return
    expected = 0.1 * (x + HALF) - (0.12 if x < line else 0.0)
    assert float(field((x, y))) == pytest.approx(expected, abs=2e-3)
    assert float(field.smooth((x, y))) == pytest.approx(0.1 * (x + HALF), abs=1e-6)


def test_both_sides_of_an_edge_can_be_asked_for_anywhere() -> None:
    field = kerbed(0.0)
    points = np.random.default_rng(0).uniform(-10, 10, (50, 2))
    assert field.upper(points) - field.lower(points) == pytest.approx(0.12)


def test_a_field_with_kerbs_comes_back_from_its_file(tmp_path: Path) -> None:
    field = kerbed(1.3)
    write_terrain(tmp_path / "terrain.npz", field)
    again = read_terrain(tmp_path / "terrain.npz")
    points = np.random.default_rng(1).uniform(-25, 25, (200, 2))
    assert np.array_equal(again(points), field(points))
    assert read_terrain(tmp_path / "terrain.npz").steps is not None


def test_a_field_whose_parts_do_not_fit_is_refused(tmp_path: Path) -> None:
    np.savez(
        tmp_path / "terrain.npz",
        heights=np.zeros((3, 3), np.float32),
        half=np.float64(5.0),
        edge=np.zeros((4, 4), np.int8),
        low=np.zeros((4, 4), np.int16),
        high=np.zeros((3, 3), np.int16),
    )
    with pytest.raises(SchemaError, match="not a readable height field"):
        read_terrain(tmp_path / "terrain.npz")
