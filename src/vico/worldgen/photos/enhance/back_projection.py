"""Finer texels without weights: enlarge, then correct until the coarse picture comes out again."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.ndimage import gaussian_filter


@dataclass(frozen=True)
class BackProjection:
    """The default `Upscaler`: bicubic enlargement, corrected by iterated back-projection.

    Attributes
    ----------
    factor
        How many times larger.
    blur
        What the photos were blurred by beyond their texels, standard deviation in coarse texels.
    rounds
        Corrections.

    Notes
    -----
    Irani and Peleg, "Improving resolution by image registration" (1991): the difference between the coarse picture
    and the blurred, shrunk fine one is enlarged and added.
    """

    factor: int = 2
    blur: float = 0.45
    rounds: int = 3

    def __call__(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Enlarge one picture."""
        height, width = image.shape[:2]
        wide = (width * self.factor, height * self.factor)
        out = np.empty((height * self.factor, width * self.factor, 3), np.uint8)
        for channel in range(3):
            coarse = image[..., channel].astype(np.float32)
            fine = _resized(coarse, wide)
            for _ in range(self.rounds):
                seen = gaussian_filter(fine, self.blur * self.factor, mode="nearest", truncate=3.0)
                seen = seen.reshape(height, self.factor, width, self.factor).mean(axis=(1, 3))
                fine += _resized(coarse - seen, wide)
            # What overshoots is a halo: stay within the range of the neighbourhood.
            low, high = _range(coarse)
            low, high = (np.asarray(_resized(v, wide)) for v in (low, high))
            out[..., channel] = np.clip(np.clip(fine, low, high) + 0.5, 0, 255).astype(np.uint8)
        return out


def _resized(values: NDArray[np.float32], size: tuple[int, int]) -> NDArray[np.float32]:
    return np.array(Image.fromarray(values, "F").resize(size, Image.Resampling.BICUBIC), np.float32)


def _range(values: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Least and greatest of the three by three around each."""
    low, high = values.copy(), values.copy()
    for axis in (0, 1):
        edge = np.pad(low, [(1, 1) if k == axis else (0, 0) for k in (0, 1)], mode="edge")
        low = np.minimum(np.minimum(_cut(edge, axis, 0), _cut(edge, axis, 1)), _cut(edge, axis, 2))
        edge = np.pad(high, [(1, 1) if k == axis else (0, 0) for k in (0, 1)], mode="edge")
        high = np.maximum(np.maximum(_cut(edge, axis, 0), _cut(edge, axis, 1)), _cut(edge, axis, 2))
    return low, high


def _cut(values: NDArray[np.float32], axis: int, start: int) -> NDArray[np.float32]:
    stop = values.shape[axis] - 2 + start
    return values[start:stop] if axis == 0 else values[:, start:stop]
