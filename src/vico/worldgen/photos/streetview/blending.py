"""The colours of several photos in one chart: each where it is best, with soft seams."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vico.worldgen.facts.ray_casting import RayCaster
from vico.worldgen.photos.atlas import Atlas
from vico.worldgen.photos.streetview.matching import opencv
from vico.worldgen.photos.streetview.painting import ColourCurve, lab_of, rgb_of
from vico.worldgen.photos.streetview.pose import projected
from vico.worldgen.photos.streetview.projection import PAINTED, Shot, seen_from, texel_centres
from vico.worldgen.photos.streetview.registration import NONE, Nudge, agreement, nudge_of

_BAND = 1 << 19  # texels at a time
_LEAST_FIT, _LEAST_SHARE = (
    0.4,
    0.7,
)  # correlation with the wall, and share of the best photo's, under which none is used
_LEAST_AGREED = 0.5  # what agrees less with the wall's own texels shows something else
_WORSE = 0.75  # a camera gives way where another of the chart is better by this


@dataclass(frozen=True)
class Layer:
    """A camera chosen for a chart.

    Attributes
    ----------
    shot
        The photo.
    curve
        Brings its colours in line with the world's.
    shade
        Added to its Lab colours on this chart: the chart's light and shade in the photo, taken away, shape ``(3,)``.
    """

    shot: Shot
    curve: ColourCurve
    shade: NDArray[np.float64]


@dataclass(frozen=True)
class Blending:
    """How photos come onto a chart.

    Attributes
    ----------
    farthest, steepest
        As of `seen_from`: metres and radians.
    feather
        Width of a seam, metres.
    unshade
        Where the chart's colours are known, those of patches this wide, metres, stay as they are, and the photo gives
        what is finer: its shadows, its vignette and what was painted over leave little trace. 0: the photo gives all.
    nudge
        Whether each photo is moved to lie on what the chart shows already (`nudge_of`).
    """

    farthest: float
    steepest: float
    feather: float
    unshade: float
    nudge: bool = True


def paint_chart(
    atlas: Atlas,
    number: int,
    layers: Sequence[Layer],
    sight: RayCaster | None,
    how: Blending,
) -> tuple[NDArray[np.uint8], NDArray[np.bool_], list[int], list[Nudge]]:
    """Paint a chart with its cameras, the first on top.

    Parameters
    ----------
    atlas, number
        The pages, and which chart of theirs.
    layers
        The cameras.
    sight
        The world's surfaces; without, the rendered depth says what is hidden.
    how
        How far, how steep and how softly.

    Returns
    -------
    tuple
        The chart's colours, uint8, shape ``(height, width, 3)``; which texels are of photos now, bool; how many
        texels each camera gave, and how each was moved.
    """
    cv2 = opencv()
    chart = atlas.charts[number]
    inside = atlas.inside[chart.page][chart.box]
    colour = atlas.pages[chart.page][chart.box].astype(np.float32)
    known = atlas.known[chart.page][chart.box].copy()
    before = atlas.pages[chart.page][chart.box], atlas.known[chart.page][chart.box]
    shape = chart.height, chart.width
    quality = np.zeros((len(layers), *shape), np.float32)
    found = np.zeros((len(layers), *shape, 3), np.uint8)
    nudges: list[Nudge] = []
    labs: list[NDArray[np.float32]] = []
    known_any = bool((before[1] & inside).any())
    own = lab_of(before[0]) if known_any else None
    grey = cv2.cvtColor(before[0], cv2.COLOR_RGB2GRAY).astype(np.float32) if how.nudge and known_any else None
    for k, layer in enumerate(layers):
        parts = _projected(atlas, number, layer.shot, sight, quality[k], found[k], how)
        moved = NONE
        if grey is not None:
            shown = cv2.cvtColor(found[k], cv2.COLOR_RGB2GRAY).astype(np.float32)
            moved = nudge_of(chart, shown, quality[k] > 0, grey, before[1] & inside, layer.shot.pose)
        nudges.append(moved)
        for points, place, pixels in parts:
            if moved.offset.any():
                xy = projected(points + moved.offset, layer.shot.pose, layer.shot.intrinsics)
                found[k].reshape(-1, 3)[place] = layer.shot.colours(xy, pixels)
                hidden = layer.shot.hidden(xy)
            else:
                hidden = layer.shot.hidden(projected(points, layer.shot.pose, layer.shot.intrinsics))
            # What was painted over is a guess: better than nothing, and worse than what is known.
            flat = quality[k].reshape(-1)
            flat[place] *= np.where(hidden, np.where(before[1].reshape(-1)[place], 0.0, PAINTED), 1.0)
        labs.append(layer.curve.applied(lab_of(found[k])) + layer.shade.astype(np.float32))
        if own is not None:
            agreed = agreement(labs[k], quality[k] > 0, own, before[1] & inside, atlas.texel)
            quality[k] *= np.where(agreed > _LEAST_AGREED, agreed, 0.0)
    fits = np.array([moved.after for moved in nudges])
    told = np.isfinite(fits)
    if told.any():
        quality[told & (fits < max(_LEAST_FIT, _LEAST_SHARE * float(fits[told].max())))] = 0.0
    best = quality.max(axis=0)
    given = [0] * len(layers)
    width = max(how.feather / atlas.texel, 1.0)
    for k in reversed(range(len(layers))):
        holds = (quality[k] > 0) & (quality[k] >= _WORSE * best)
        # Specks that occlusion leaves are no places to put a seam around.
        holds &= cv2.morphologyEx(holds.astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)) > 0
        if not holds.any():
            continue
        # Seams run where a photo ends on the chart, not along the chart's own outline.
        free = (holds | ~inside).astype(np.uint8)
        depth = cv2.distanceTransform(free, cv2.DIST_L2, 3) if not free.all() else np.full(shape, width, np.float32)
        alpha = np.clip(depth / width, 0.0, 1.0) * holds
        alpha = alpha * alpha * (3 - 2 * alpha)
        lines = np.flatnonzero(holds.any(axis=1))
        box = slice(int(lines[0]), int(lines[-1]) + 1)
        lab = labs[k][box]
        if how.unshade > 0:
            trusted = (holds & before[1])[box]
            lab = lab + _broad(lab_of(before[0][box]) - lab, trusted, how.unshade / atlas.texel)
        colour[box] += (rgb_of(lab) - colour[box]) * alpha[box, :, None]
        known |= (alpha > 0.5) & inside
        given[k] = int((alpha > 0.5).sum())
    return np.clip(np.round(colour), 0, 255).astype(np.uint8), known, given, nudges


def _projected(
    atlas: Atlas,
    number: int,
    shot: Shot,
    sight: RayCaster | None,
    quality: NDArray[np.float32],
    found: NDArray[np.uint8],
    how: Blending,
) -> list[tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]]]:
    """Write a photo's quality and colours on a chart, masked or not; the points, texels and pixels of what it shows."""
    chart = atlas.charts[number]
    inside = atlas.inside[chart.page][chart.box]
    band = max(_BAND // chart.width, 1)
    parts = []
    for start in range(0, chart.height, band):
        rows = slice(start, min(start + band, chart.height))
        here = np.flatnonzero(inside[rows].ravel())
        points = texel_centres(chart, rows, slice(None)).reshape(-1, 3)[here]
        seen = seen_from(
            shot, points, chart.normal, sight, texel=atlas.texel, farthest=how.farthest, steepest=how.steepest
        )
        place = here[seen.index] + start * chart.width
        quality.reshape(-1)[place] = seen.sharp
        found.reshape(-1, 3)[place] = shot.colours(seen.xy, seen.pixels)
        parts.append((points[seen.index], place, seen.pixels))
    return parts


def _broad(gap: NDArray[np.float32], trusted: NDArray[np.bool_], sigma: float) -> NDArray[np.float32]:
    """Return the smooth part of a difference known in some texels, shape ``(h, w, 3)``; 0 far from all of these."""
    cv2 = opencv()
    weight = trusted.astype(np.float32)
    share = cv2.GaussianBlur(weight, (0, 0), sigma)
    smooth = cv2.GaussianBlur(gap * weight[..., None], (0, 0), sigma)
    return np.asarray(smooth / np.maximum(share, 1e-2)[..., None], np.float32)
