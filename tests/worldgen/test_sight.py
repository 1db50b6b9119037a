import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vico.errors import EmptyInputError, InputError, MissingExtraError
from vico.worldgen.facts.ray_casting import RayCaster

SQUARE = np.array([(0, 0, 2), (4, 0, 2), (4, 4, 2), (0, 4, 2)], np.float64), np.array([(0, 1, 2), (0, 2, 3)])


def test_a_missing_package_is_one_sentence_with_the_command(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "embreex", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'virtual-community\[photos\]'"):
        RayCaster(*SQUARE)


def test_meshes_that_cannot_be_seen_are_refused() -> None:
    pytest.importorskip("embreex", reason="rays need embreex")
    with pytest.raises(EmptyInputError, match="no triangles"):
        RayCaster(SQUARE[0], np.zeros((0, 3), int))
    with pytest.raises(InputError, match=r"outside 0\.\.3"):
        RayCaster(SQUARE[0], np.array([(0, 1, 4)]))
    with pytest.raises(InputError, match="triangle 1 "):
        RayCaster(np.where(np.arange(4)[:, None] == 3, np.nan, SQUARE[0]), SQUARE[1])


@settings(max_examples=40, deadline=None)
@given(st.floats(0.01, 3.99), st.floats(0.01, 3.99), st.floats(-50, 50), st.floats(0.5, 2.0), st.floats(-4e5, 4e5))
def test_a_ray_meets_the_square_where_geometry_says(x: float, y: float, z: float, speed: float, far: float) -> None:
    pytest.importorskip("embreex", reason="rays need embreex")
    away = np.array([far, -far, 0.0])  # far from the origin nothing is lost
    sight = RayCaster(SQUARE[0] + away, SQUARE[1])
    start = np.array([[x, y, z]]) + away
    hits = sight.first(start, np.array([0, 0, speed]))
    if z > 2 - 1e-3:
        return
    assert hits.distance[0] == pytest.approx((2 - z) / speed, abs=1e-4)
    a, b, c = (SQUARE[0] + away)[SQUARE[1][hits.triangle[0]]]
    u, v = float(hits.u[0]), float(hits.v[0])
    np.testing.assert_allclose((1 - u - v) * a + u * b + v * c, [x + far, y - far, 2], atol=1e-3)


def test_limits_directions_and_both_sides() -> None:
    pytest.importorskip("embreex", reason="rays need embreex")
    sight = RayCaster(*SQUARE)
    start = np.array([(1, 1, 0), (1, 1, 5), (1, 1, 0), (9, 1, 0)], np.float64)
    along = np.array([(0, 0, 1), (0, 0, -1), (0, 0, -1), (0, 0, 1)], np.float64)
    assert sight.first(start, along).distance.tolist() == pytest.approx([2, 3, np.inf, np.inf])
    assert sight.first(start, along, most=np.array([1.9, 3.1, 9, 9])).triangle[:2].tolist()[0] == -1
    assert sight.first(start, along, most=2.5).distance.tolist() == pytest.approx([2, np.inf, np.inf, np.inf])
    assert len(sight.first(np.zeros((0, 3)), along[0]).distance) == 0
