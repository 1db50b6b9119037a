"""Products of small vectors: numpy's results, in one order, whatever the processor."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from vico.exact import apply_matrix, dot

NUMBERS = st.floats(-1e6, 1e6, allow_subnormal=False)


@given(st.lists(st.tuples(NUMBERS, NUMBERS, NUMBERS), min_size=1, max_size=9), st.tuples(NUMBERS, NUMBERS, NUMBERS))
def test_products_add_in_the_order_of_the_axis(
    points: list[tuple[float, float, float]], row: tuple[float, float, float]
) -> None:
    a, b, c = row
    assert dot(points, row).tolist() == [x * a + y * b + z * c for x, y, z in points]


def test_many_axes_broadcast_and_a_matrix_turns() -> None:
    stream = np.random.default_rng(0)
    points, matrix = stream.normal(size=(4, 5, 3)), stream.normal(size=(2, 3))
    np.testing.assert_allclose(apply_matrix(points, matrix), points @ matrix.T, rtol=1e-12)
    np.testing.assert_allclose(dot(points, points[0, 0]), points @ points[0, 0], rtol=1e-12)
    assert float(dot([1.0, 2.0], [3.0, 4.0])) == 11.0
