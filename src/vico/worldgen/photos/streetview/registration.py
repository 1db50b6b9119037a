"""A photo on a wall, nudged to what the wall's texels show already.

A pose may be a few centimetres and a tenth of a degree off, and a wall may stand a little before or behind its place.
Both move a photo on the wall by tenths of a metre, more than a window's frame is wide.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vico.worldgen.photos.atlas import Chart
from vico.worldgen.photos.streetview.matching import opencv
from vico.worldgen.photos.streetview.pose import Pose

FARTHEST = 0.7
"""Metres that a photo is moved at most."""

_FINE, _COARSE = 0.12, 0.9  # metres: what is finer is noise or lost in one of the two, what is broader is light
_BLOCK = 5.0  # metres: parts of a wall that are compared each by itself
_LEAST_SIDE = 2.0  # metres of a part that tell something
_LEAST = 0.25  # correlation that two parts must have
_LEAST_CONTRAST = 2.5  # levels of luminance: a wall with less has nothing to be recognised by
_AROUND = 1.2  # metres around a place that photo and wall are compared in
_UNLIKE, _ALIKE = 0.05, 0.35  # agreement at which a photo counts nothing, and from which it counts fully
_PLAIN = 0.15  # spread of normalised detail that counts as none
_FAR_COLOUR = 16.0  # Lab: beyond twice this, something else stands before the wall, or the sky is seen over it
_SHIFT, _STAND = 0.3, 0.25  # metres expected, and what the wall's plane may be off
_NOISE = 0.06  # metres that a part's own shift may be wrong


@dataclass(frozen=True)
class Nudge:
    """Where a photo's colours of a chart are to be taken from.

    Attributes
    ----------
    offset
        Metres to add to the texels' places, ENU, shape ``(3,)``.
    before, after
        Correlation of the photo with the chart's texels, as it came and with the one shift; NaN where nothing could be
        compared.
    """

    offset: NDArray[np.float64]
    before: float
    after: float


NONE = Nudge(np.zeros(3), float("nan"), float("nan"))


def nudge_of(
    chart: Chart,
    photo: NDArray[np.float32],
    shown: NDArray[np.bool_],
    wall: NDArray[np.float32],
    known: NDArray[np.bool_],
    pose: Pose,
) -> Nudge:
    """Find how a photo must be moved to lie on a chart.

    Parameters
    ----------
    chart
        The wall's texels.
    photo, wall
        Luminance 0..255 of the photo as projected there, and of the chart's texels, shape ``(height, width)``.
    shown, known
        Where each of these is to be trusted, of the same shape.
    pose
        Of the photo's camera.

    Returns
    -------
    Nudge
        `NONE` where the two have too little in common to tell.

    Notes
    -----
    Parts of the wall are compared by normalised correlation of what is between 0.1 and 1 m large. Their shifts are
    explained by one shift on the wall and by a wall that stands before or behind its place: that moves what is far
    from the camera's foot more than what is near.
    """
    texel = float(np.linalg.norm(chart.right))
    reach = max(round(FARTHEST / texel), 1)
    a, b = _band(photo, shown, texel), _band(wall, known, texel)
    side = max(round(_BLOCK / texel), 8)
    rows, columns = (np.linspace(0, n, max(round(n / side), 1) + 1).astype(int) for n in a.shape)
    right, up = chart.right / texel, chart.up / float(np.linalg.norm(chart.up))
    foot = pose.position - chart.origin
    away = float(foot @ chart.normal)
    if away < 0.5 or min(a.shape) * texel < _LEAST_SIDE / 2:
        return NONE
    lines: list[tuple[float, float, float]] = []  # shift, what the plane's stand would do, weight
    axes: list[int] = []
    total = np.zeros((3, 2 * reach + 1, 2 * reach + 1))
    for top, bottom in zip(rows[:-1].tolist(), rows[1:].tolist(), strict=True):
        for left, end in zip(columns[:-1].tolist(), columns[1:].tolist(), strict=True):
            part = slice(top, bottom), slice(left, end)
            if (known[part] & shown[part]).sum() * texel**2 < _LEAST_SIDE**2:
                continue
            sums = _sums(a, shown, b[part], known[part], top, left, reach)
            if sums is None:
                continue
            total += sums
            found = _peak(_ratio(sums))
            if found is None or found[2] < _LEAST:
                continue
            middle = np.array([left + end, top + bottom]) / 2 * texel
            far = (middle - np.array([foot @ right, foot @ up])) / away
            weight = found[2] ** 2
            for axis in (0, 1):
                lines.append((found[axis] * texel, float(far[axis]), weight))
                axes.append(axis)
    if not lines:
        return NONE
    shift = _fitted(np.array(lines), np.array(axes))
    ratio = _ratio(total)
    centre = float(ratio[reach, reach])
    x, y = (int(np.clip(round(v / texel), -reach, reach)) for v in shift[:2])
    offset = shift[0] * right + shift[1] * up + shift[2] * chart.normal
    return Nudge(np.asarray(offset, np.float64), centre, float(ratio[reach + y, reach + x]))


def agreement(
    photo: NDArray[np.float32],
    shown: NDArray[np.bool_],
    wall: NDArray[np.float32],
    known: NDArray[np.bool_],
    texel: float,
) -> NDArray[np.float32]:
    """How far a photo shows what a wall's texels do, place by place.

    Parameters
    ----------
    photo, wall
        CIE L*a*b* of the photo as projected there, in the wall's colours, and of the wall's texels, shape
        ``(height, width, 3)``.
    shown, known
        Where each of these is to be trusted, shape ``(height, width)``.
    texel
        Metres.

    Returns
    -------
    ndarray
        0..1, shape ``(height, width)``: 0 where the photo has other detail than the wall (a tree, an awning, a wrong
        place) or another colour (the sky over the eaves); 1 where they agree, or nothing is known of the wall.
    """
    cv2 = opencv()

    def smooth(values: NDArray[np.float32], sigma: float) -> NDArray[np.float32]:
        return np.asarray(cv2.GaussianBlur(values, (0, 0), sigma / texel), np.float32)

    light = np.float32(2.55)
    a, b = _band(photo[..., 0] * light, shown, texel), _band(wall[..., 0] * light, known, texel)
    both = (shown & known).astype(np.float32)
    share = smooth(both, _AROUND)
    alike = (2 * smooth(a * b * both, _AROUND) + _PLAIN**2 * share) / np.maximum(
        smooth((a * a + b * b) * both, _AROUND) + _PLAIN**2 * share, 1e-6
    )
    alike = np.where(share > 0.02, alike, 1.0)
    # The wall's colour about a place, from as near as it is known.
    seen, own = shown.astype(np.float32), known.astype(np.float32)
    there = smooth(photo * seen[..., None], _COARSE / 3) / np.maximum(smooth(seen, _COARSE / 3), 1e-3)[..., None]
    reach = smooth(own, 2 * _AROUND)
    wanted = smooth(wall * own[..., None], 2 * _AROUND) / np.maximum(reach, 1e-3)[..., None]
    tints = np.array([0.5, 1.0, 1.0], np.float32)  # light and shade move on a wall, its tint does not
    far = np.linalg.norm((there - wanted) * tints, axis=2)
    # What the wall has there itself may differ from its surroundings: a shop front, a window.
    usual = smooth(np.linalg.norm((wall - wanted) * tints, axis=2) * own, _AROUND) / np.maximum(
        smooth(own, _AROUND), 1e-3
    )
    odd = np.where(reach > 1e-3, far - usual, 0.0)
    weight = np.clip((alike - _UNLIKE) / (_ALIKE - _UNLIKE), 0.0, 1.0)
    weight *= np.clip(2.0 - odd / _FAR_COLOUR, 0.0, 1.0)
    return np.asarray(weight, np.float32)


def _band(grey: NDArray[np.float32], where: NDArray[np.bool_], texel: float) -> NDArray[np.float32]:
    """Return what is as large as windows and their frames, in like contrast everywhere; 0 where nothing is known."""
    cv2 = opencv()
    weight = where.astype(np.float32)

    def smooth(values: NDArray[np.float32], sigma: float) -> NDArray[np.float32]:
        spread = sigma / texel
        share = cv2.GaussianBlur(weight, (0, 0), spread)
        return np.asarray(cv2.GaussianBlur(values * weight, (0, 0), spread) / np.maximum(share, 1e-3), np.float32)

    detail = smooth(grey, _FINE) - smooth(grey, _COARSE)
    contrast = np.sqrt(smooth(detail * detail, 2 * _COARSE)) + np.float32(_LEAST_CONTRAST)
    return np.asarray(detail / contrast * weight, np.float32)


def _sums(
    a: NDArray[np.float32],
    shown: NDArray[np.bool_],
    part: NDArray[np.float32],
    known: NDArray[np.bool_],
    top: int,
    left: int,
    reach: int,
) -> NDArray[np.float64] | None:
    """Products of a part of the wall with the photo at all shifts: both together, and each with itself."""
    cv2 = opencv()
    height, width = part.shape
    window = np.zeros((height + 2 * reach, width + 2 * reach), np.float32)
    mask = np.zeros_like(window)
    y0, x0 = max(top - reach, 0), max(left - reach, 0)
    y1, x1 = min(top + height + reach, a.shape[0]), min(left + width + reach, a.shape[1])
    inner = slice(y0 - top + reach, y1 - top + reach), slice(x0 - left + reach, x1 - left + reach)
    window[inner], mask[inner] = a[y0:y1, x0:x1], shown[y0:y1, x0:x1]
    own = known.astype(np.float32)
    if not (mask.any() and own.any()):
        return None
    pairs = ((window, part), (window * window, own), (mask, part * part))
    return np.stack([cv2.matchTemplate(x, y, cv2.TM_CCORR) for x, y in pairs]).astype(np.float64)


def _ratio(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Normalised correlation at all shifts; 0 where there is nothing to compare."""
    energy = np.sqrt(np.maximum(sums[1], 0.0) * np.maximum(sums[2], 0.0))
    return np.asarray(np.where(energy > 1.0, sums[0] / np.maximum(energy, 1e-9), 0.0))


def _peak(ratio: NDArray[np.float64]) -> tuple[float, float, float] | None:
    """Shift along and up of the best correlation, between texels, and how good it is; None at the border."""
    row, column = np.unravel_index(int(ratio.argmax()), ratio.shape)
    size = len(ratio)
    if not (0 < row < size - 1 and 0 < column < size - 1):
        return None

    def between(low: float, here: float, high: float) -> float:
        bend = 2 * here - low - high
        return float(np.clip((high - low) / (2 * bend), -0.5, 0.5)) if bend > 1e-9 else 0.0

    here = float(ratio[row, column])
    x = column + between(ratio[row, column - 1], here, ratio[row, column + 1])
    y = row + between(ratio[row - 1, column], here, ratio[row + 1, column])
    return x - size // 2, y - size // 2, here


def _fitted(lines: NDArray[np.float64], axes: NDArray[np.int64]) -> NDArray[np.float64]:
    """Shift along, up, and stand of the wall, metres, that explain the parts' shifts; odd ones have no say."""
    basis = np.column_stack([axes == 0, axes == 1, lines[:, 1]]).astype(np.float64)
    prior = np.diag([_NOISE / _SHIFT, _NOISE / _SHIFT, _NOISE / _STAND]) ** 2
    weight = lines[:, 2]
    found = np.zeros(3)
    for _ in range(6):
        found = np.linalg.solve(basis.T @ (basis * weight[:, None]) + prior, basis.T @ (weight * lines[:, 0]))
        off = np.abs(basis @ found - lines[:, 0])
        limit = max(3 * 1.4826 * float(np.median(off)), 3 * _NOISE)
        weight = lines[:, 2] * np.where(off < limit, (1 - (off / limit) ** 2) ** 2, 0.0)
        if not weight.any():
            return np.zeros(3)
    return np.asarray(np.clip(found, -FARTHEST, FARTHEST))
