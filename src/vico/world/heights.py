"""The one height look-up used by everybody: a bilinear field on a regular grid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True)
class HeightField:
    """Ground heights over the square world.

    Attributes
    ----------
    heights
        Metres, float32, shape ``(n, n)``, indexed ``[iy, ix]``; corner ``[0, 0]`` is the south-west one.
    half
        Half the side of the square covered, metres; the square is centred on the origin.
    """

    heights: NDArray[np.float32]
    half: float

    @property
    def cell(self) -> float:
        """Grid spacing, metres."""
        return 2.0 * self.half / (self.heights.shape[0] - 1)

    @classmethod
    def flat(cls, half: float, height: float = 0.0) -> HeightField:
        """A level field."""
        return cls(np.full((2, 2), height, np.float32), half)

    def __call__(self, xy: ArrayLike) -> NDArray[np.float64]:
        """Heights at points, bilinear; points outside take the nearest edge's height.

        Parameters
        ----------
        xy
            ENU metres, shape ``(..., 2)`` (further columns are ignored).

        Returns
        -------
        ndarray
            Metres, shape ``(...)``.
        """
        points = np.asarray(xy, np.float64)
        n = self.heights.shape[0]
        u = np.clip((points[..., 0] + self.half) / self.cell, 0.0, n - 1)
        v = np.clip((points[..., 1] + self.half) / self.cell, 0.0, n - 1)
        i = np.minimum(u.astype(np.int64), n - 2)
        j = np.minimum(v.astype(np.int64), n - 2)
        fu, fv = u - i, v - j
        h = self.heights
        south = h[j, i] * (1 - fu) + h[j, i + 1] * fu
        north = h[j + 1, i] * (1 - fu) + h[j + 1, i + 1] * fu
        return np.asarray(south * (1 - fv) + north * fv, np.float64)
