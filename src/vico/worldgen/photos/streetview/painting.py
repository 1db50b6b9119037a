"""Photos made fit for walls: masked things painted over, colours brought in line."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.errors import MissingExtraError
from vico.worldgen.photos.streetview.matching import opencv

#: Fills the masked pixels of an RGB picture from what is around them.
Painter = Callable[[NDArray[np.uint8], NDArray[np.bool_]], NDArray[np.uint8]]

_KNOTS = 33
_STEEPEST = 1.8


@dataclass(frozen=True)
class FastMarching:
    """Fills by fast marching (Telea 2004): smooth, and at once.

    Attributes
    ----------
    radius
        Pixels around a filled one that count.
    """

    radius: float = 5.0

    def __call__(self, picture: NDArray[np.uint8], mask: NDArray[np.bool_]) -> NDArray[np.uint8]:
        """See `Painter`."""
        cv2 = opencv()
        if not mask.any():
            return picture
        return np.asarray(cv2.inpaint(picture, mask.astype(np.uint8), self.radius, cv2.INPAINT_TELEA))


@dataclass(frozen=True)
class Patches:
    """Fills with patches of the picture itself (Barnes et al. 2009), through PyPatchMatch.

    Attributes
    ----------
    side
        Of a patch, pixels.
    """

    side: int = 5

    def __call__(self, picture: NDArray[np.uint8], mask: NDArray[np.bool_]) -> NDArray[np.uint8]:
        """See `Painter`.

        Raises
        ------
        MissingExtraError
            If it is not installed.
        """
        try:
            import patchmatch
        except ImportError:
            raise MissingExtraError(
                "patches: PyPatchMatch is not installed; type: pip install 'virtual-community[patches]'"
            ) from None
        if not mask.any():
            return picture
        patchmatch.set_random_seed(1)
        filled: NDArray[Any] = patchmatch.inpaint(picture, mask.astype(np.uint8)[..., None], patch_size=self.side)
        return np.where(mask[..., None], filled, picture).astype(np.uint8)


@dataclass(frozen=True)
class ColourCurve:
    """Brings one photo's colours in line with others: a rising curve of lightness, a shift and gain of the tints.

    Attributes
    ----------
    source, target
        Lightnesses (CIE L*, 0..100) and what becomes of them, rising, shape ``(k,)``.
    gain, shift
        Of a* and b*: ``tint * gain + shift``, shape ``(2,)``.
    """

    source: NDArray[np.float64]
    target: NDArray[np.float64]
    gain: NDArray[np.float64]
    shift: NDArray[np.float64]

    def applied(self, lab: NDArray[np.float32]) -> NDArray[np.float32]:
        """Lab colours of shape ``(..., 3)`` brought in line."""
        light = np.interp(lab[..., 0], self.source, self.target)
        tints = lab[..., 1:] * self.gain + self.shift
        return np.concatenate([light[..., None], tints], axis=-1).astype(np.float32)


def colour_curve(
    photo: NDArray[np.float32], reference: NDArray[np.float32], weight: NDArray[Any] | None = None
) -> ColourCurve:
    """Return the curve that gives a photo's colours the histogram of a reference.

    Parameters
    ----------
    photo, reference
        Lab colours of the same places or of like ones, shapes ``(n, 3)`` and ``(m, 3)``.
    weight
        Of the photo's colours.

    Notes
    -----
    Histogram matching of lightness at 33 quantiles, its slope bounded so that noise in a flat wall is not blown up.
    """
    shares = np.linspace(0.01, 0.99, _KNOTS)
    source = _quantiles(photo[:, 0], shares, weight)
    target = _quantiles(reference[:, 0], shares, None)
    rise, run = np.diff(target), np.diff(source)
    steep = np.clip(rise / np.maximum(run, 1e-3), 0.25, _STEEPEST)
    curve = np.concatenate([[0.0], np.cumsum(steep * np.maximum(run, 1e-3))])
    knots = source[0] + np.concatenate([[0.0], np.cumsum(np.maximum(run, 1e-3))])
    curve += float(np.mean(target - curve))
    # Detail is darker and lighter than any patch's mean: the ends go on as steeply as the whole.
    slope = float(np.clip((target[-1] - target[0]) / max(source[-1] - source[0], 1.0), 0.5, _STEEPEST))
    knots = np.concatenate([[knots[0] - 40.0], knots, [knots[-1] + 40.0]])
    curve = np.clip(np.concatenate([[curve[0] - 40.0 * slope], curve, [curve[-1] + 40.0 * slope]]), 0.0, 100.0)
    spread = np.maximum(np.std(photo[:, 1:], axis=0), 0.5), np.maximum(np.std(reference[:, 1:], axis=0), 0.5)
    gain = np.clip(spread[1] / spread[0], 0.7, 1.4).astype(np.float64)
    shift = np.median(reference[:, 1:], axis=0) - np.median(photo[:, 1:], axis=0) * gain
    return ColourCurve(knots, curve, gain, np.asarray(shift, np.float64))


def lab_of(rgb: NDArray[np.uint8]) -> NDArray[np.float32]:
    """SRGB colours of shape ``(..., 3)`` as CIE L*a*b*, float32 of the same shape."""
    cv2 = opencv()
    flat = rgb.reshape(1, -1, 3).astype(np.float32) / 255
    if not rgb.size:
        return flat.reshape(rgb.shape).astype(np.float32)
    return np.asarray(cv2.cvtColor(flat, cv2.COLOR_RGB2LAB).reshape(rgb.shape), np.float32)


def rgb_of(lab: NDArray[np.float32]) -> NDArray[np.float32]:
    """CIE L*a*b* colours as sRGB in 0..255, not rounded."""
    cv2 = opencv()
    flat = np.ascontiguousarray(lab.reshape(1, -1, 3), np.float32)
    return np.asarray(cv2.cvtColor(flat, cv2.COLOR_LAB2RGB).reshape(lab.shape) * 255, np.float32)


def _quantiles(values: NDArray[Any], shares: NDArray[np.float64], weight: NDArray[Any] | None) -> NDArray[np.float64]:
    if weight is None:
        return np.asarray(np.quantile(values, shares), np.float64)
    order = np.argsort(values, kind="stable")
    total = np.cumsum(np.asarray(weight, np.float64)[order])
    return np.asarray(values[order][np.searchsorted(total, shares * total[-1])], np.float64)
