"""Products of small vectors whose bits are the same on every processor.

``@`` and `numpy.dot` go to BLAS, which picks another kernel on another processor: the last bit differs, a wall is cut
elsewhere, and the same seed gives another world. These add in one order everywhere.
"""

from __future__ import annotations

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
    product = np.asarray(a) * np.asarray(b)
    total: NDArray[np.float64] = product[..., 0]
    for k in range(1, product.shape[-1]):
        total = total + product[..., k]
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
