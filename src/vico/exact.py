"""Products of vectors and small matrices whose bits are the same on every processor.

``@`` and `numpy.dot` go to BLAS, which picks another kernel on another processor: the last bit differs, a wall is cut
elsewhere, and the same seed gives another world. These add in one order everywhere. So it is with numpy's exponentials,
logarithms, powers, tangents and arcs, which are other code where there is AVX-512 (sines and cosines are not); `each`
takes those of the C library.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray


def dot(a: ArrayLike, b: ArrayLike) -> NDArray[np.float64]:
    """Sum the products along the last axis; the other axes broadcast.

    Parameters
    ----------
    a, b
        (..., k).

    Returns
    -------
    (...)
        A scalar array for two vectors.
    """
    terms = np.asarray(a) * np.asarray(b)
    total: NDArray[np.float64] = terms[..., 0]
    for k in range(1, terms.shape[-1]):
        total = total + terms[..., k]
    return total


def apply_matrix(points: ArrayLike, matrix: ArrayLike) -> NDArray[np.float64]:
    """Return ``points @ matrix.T``: each point multiplied by the matrix.

    Parameters
    ----------
    points
        (..., k).
    matrix
        (n, k).

    Returns
    -------
    (..., n)
    """
    points, matrix = np.asarray(points), np.asarray(matrix)
    total: NDArray[np.float64] = points[..., 0, None] * matrix[:, 0]
    for k in range(1, matrix.shape[1]):
        total += points[..., k, None] * matrix[:, k]
    return total


def product(a: ArrayLike, b: ArrayLike) -> NDArray[np.float64]:
    """Return ``a @ b``, matrix by matrix.

    Parameters
    ----------
    a
        (..., n, k).
    b
        (..., k, m).

    Returns
    -------
    (..., n, m)
    """
    a, b = np.asarray(a), np.asarray(b)
    total: NDArray[np.float64] = a[..., :, 0, None] * b[..., 0, None, :]
    for k in range(1, b.shape[-2]):
        total = total + a[..., :, k, None] * b[..., k, None, :]
    return total


def each(function: Callable[..., float], *arguments: ArrayLike) -> NDArray[np.float64]:
    """Return a function of Python's `math` of each number; for arrays of some thousands at most.

    Parameters
    ----------
    function
        Of as many numbers as there are `arguments`.
    arguments
        Arrays that broadcast.
    """
    columns = np.broadcast_arrays(*arguments)
    values = map(function, *(column.ravel().tolist() for column in columns))
    return np.fromiter(values, np.float64, columns[0].size).reshape(columns[0].shape)
