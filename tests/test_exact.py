"""Products of small vectors: numpy's results, in one order, whatever the processor."""

import ast
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vico.exact import apply_matrix, dot, each, product

SOURCE = Path(__file__).parents[1] / "src" / "vico"

# Of numpy: what goes to BLAS, and what is other code where there is AVX-512.
NOT_EXACT = {
    f"np.{name}"
    for name in (
        *(
            "dot",
            "vdot",
            "inner",
            "matmul",
            "tensordot",
            "exp",
            "exp2",
            "expm1",
            "log",
            "log2",
            "log10",
            "log1p",
            "power",
        ),
        *("cbrt", "tan", "arcsin", "arccos", "arctan", "arctan2", "sinh", "cosh", "tanh"),
    )
} | {f"np.linalg.{name}" for name in ("solve", "inv", "pinv", "lstsq", "svd", "eig", "eigh", "det", "qr", "cholesky")}
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


def test_a_product_of_matrices_adds_in_the_order_of_the_inner_axis() -> None:
    stream = np.random.default_rng(1)
    a, b = stream.normal(size=(5, 3, 4)), stream.normal(size=(5, 4, 2))
    np.testing.assert_allclose(product(a, b), a @ b, rtol=1e-12)
    one, other = a[2].tolist(), b[2].tolist()
    for i in range(3):
        for j in range(2):
            total = one[i][0] * other[0][j]
            for k in range(1, 4):
                total += one[i][k] * other[k][j]
            assert product(a[2], b[2])[i, j] == total


def test_functions_of_each_number_are_those_of_the_c_library_and_broadcast() -> None:
    stream = np.random.default_rng(2)
    y, x = stream.normal(size=(3, 4)), stream.normal(size=4)
    turned = each(math.atan2, y, x)
    assert turned.tolist() == [[math.atan2(a, b) for a, b in zip(row, x.tolist(), strict=True)] for row in y.tolist()]
    assert each(math.pow, np.array([4.0, 9.0]), 0.5).tolist() == [2.0, 3.0]
    assert each(math.exp, np.zeros((0, 3))).shape == (0, 3)


def _deciding(room: str) -> Iterator[tuple[Path, ast.AST]]:
    """Yield what is written in a room outside of compiled functions, which call neither BLAS nor numpy."""
    for path in sorted((SOURCE / room).rglob("*.py")):
        if path.name.startswith("genesis_"):  # torch's, another on each machine
            continue
        waiting: list[ast.AST] = [ast.parse(path.read_text())]
        while waiting:
            node = waiting.pop()
            names = [ast.unparse(one) for one in node.decorator_list] if isinstance(node, ast.FunctionDef) else []
            if not any(word in name for name in names for word in ("compiled", "inlined", "fast")):
                yield path, node
                waiting += ast.iter_child_nodes(node)


@pytest.mark.parametrize("room", ["sim", "agents", "kinematics", "envs"])
def test_what_decides_a_state_asks_neither_blas_nor_functions_that_differ_by_processor(room: str) -> None:
    faults, looked_at = [], 0
    for path, node in _deciding(room):
        looked_at += 1
        is_product = isinstance(node, (ast.BinOp, ast.AugAssign)) and isinstance(node.op, ast.MatMult)
        called = ast.unparse(node.func) if isinstance(node, ast.Call) else ""
        if is_product or called in NOT_EXACT:
            faults.append(f"{path.relative_to(SOURCE)}:{node.lineno}: {ast.unparse(node)}; take vico.exact's")  # type: ignore[attr-defined]
    assert looked_at > 1000
    assert faults == []
