"""Photos on walls: which camera sees which chart best, and its colours in the chart's texels, with soft seams."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.worldgen.facts.ray_casting import RayCaster
from vico.worldgen.photos.atlas import Atlas, Chart
from vico.worldgen.photos.streetview.masking import ColourCurve, lab_of, rgb_of
from vico.worldgen.photos.streetview.matching import opencv
from vico.worldgen.photos.streetview.registration import NO_NUDGE, Nudge, Pose, agreement, nudge_of, project

PATCH = 0.8
"""Metres of wall whose mean colours are compared: the wall's texture is blurred, and would have the photo's detail
taken for too much contrast."""

_SAMPLE = 0.5  # metres between the samples that charts are judged by
_OFF_WALL = 0.03  # metres that rays end before the wall
_BORDER = 0.01  # share of a photo's sides that is not used: lenses are worst there
PAINTED = 0.15
"""What a pixel that was painted over counts."""


@dataclass(frozen=True)
class Shot:
    """A photo that is ready to be projected.

    Attributes
    ----------
    id
        Of the photo.
    picture
        sRGB, masked things painted over, uint8, shape ``(h, w, 3)``.
    masked
        Where something was painted over, bool, shape ``(h, w)``.
    pose, intrinsics
        Of the camera.
    depth
        Depth of the world from there, metres, 0 where nothing is; same view, perhaps fewer pixels.
    """

    id: str
    picture: NDArray[np.uint8]
    masked: NDArray[np.bool_]
    pose: Pose
    intrinsics: NDArray[np.float64]
    depth: NDArray[np.float32]

    @cached_property
    def pyramid(self) -> list[NDArray[np.uint8]]:
        """The picture at 1, 1/2, 1/4, ... of its size."""
        cv2 = opencv()
        levels = [self.picture]
        while min(levels[-1].shape[:2]) > 64 and len(levels) < 6:
            levels.append(cv2.pyrDown(levels[-1]))
        return levels

    def is_hidden(self, xy: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Where the photo was painted over, at pixels `xy`; shape ``(n,)``."""
        height, width = self.masked.shape
        column = np.clip(xy[:, 0].astype(np.int64), 0, width - 1)
        return self.masked[np.clip(xy[:, 1].astype(np.int64), 0, height - 1), column]

    def colours(self, xy: NDArray[np.float64], pixels: NDArray[np.float64]) -> NDArray[np.uint8]:
        """Colours at pixels `xy`, each the mean of a patch about `pixels` wide; shape ``(n, 3)``."""
        cv2 = opencv()
        level = np.clip(np.floor(np.log2(np.maximum(pixels, 1.0))), 0, len(self.pyramid) - 1).astype(np.int64)
        out = np.zeros((len(xy), 3), np.uint8)
        for k in np.unique(level).tolist():
            mine = np.flatnonzero(level == k)
            # OpenCV's limit of a side is 32,767.
            for part in np.array_split(mine, len(mine) // 30_000 + 1):
                at = ((xy[part] - 0.5) / 2.0**k).astype(np.float32)
                found = cv2.remap(
                    self.pyramid[k],
                    at[:, :1].copy(),
                    at[:, 1:].copy(),
                    cv2.INTER_LINEAR,
                    borderMode=cv2.BORDER_REPLICATE,
                )
                out[part] = found[:, 0]
        return out


@dataclass(frozen=True)
class VisiblePoints:
    """Points that a camera sees.

    Attributes
    ----------
    index
        Which points, shape ``(n,)``.
    xy
        Their pixels, shape ``(n, 2)``.
    pixels
        How many of the photo's pixels a texel there is wide, the shorter way, shape ``(n,)``.
    sharp
        0..1, shape ``(n,)``: 1 for sharp and seen from the front.
    painted
        Where the photo was painted over, bool, shape ``(n,)``.
    """

    index: NDArray[np.int64]
    xy: NDArray[np.float64]
    pixels: NDArray[np.float64]
    sharp: NDArray[np.float64]
    painted: NDArray[np.bool_]

    @property
    def quality(self) -> NDArray[np.float64]:
        """`sharp`, and less of it where the photo was painted over."""
        return np.asarray(np.where(self.painted, PAINTED * self.sharp, self.sharp))


def visible_points(
    shot: Shot,
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    sight: RayCaster | None,
    *,
    texel: float,
    farthest: float,
    steepest: float,
) -> VisiblePoints:
    """Find which points of walls a camera sees.

    Parameters
    ----------
    points, normals
        Metres and outward unit vectors, shapes ``(n, 3)`` (or one normal of shape ``(3,)``).
    sight
        The world's surfaces; without, the depth image alone decides.
    texel
        Metres.
    farthest
        Metres beyond which a photo is not used.
    steepest
        Angle between the view and the wall's normal beyond which it is not used, radians.
    """
    height, width = shot.picture.shape[:2]
    offset = shot.pose.position - points
    distance = np.linalg.norm(offset, axis=1)
    cosine = (offset * normals).sum(axis=1) / np.maximum(distance, 1e-9)
    xy = project(points, shot.pose, shot.intrinsics)
    low = np.array([width, height]) * _BORDER
    with np.errstate(invalid="ignore"):
        inside = ((xy > low) & (xy < np.array([width, height]) - low)).all(axis=1)
    index = np.flatnonzero(inside & (distance < farthest) & (distance > 0.5) & (cosine > np.cos(steepest)))
    xy, distance, cosine = xy[index], distance[index], cosine[index]
    z = shot.pose.to_camera(points[index])[:, 2]
    small_h, small_w = shot.depth.shape
    column = np.clip((xy[:, 0] * small_w / width).astype(np.int64), 0, small_w - 1)
    row = np.clip((xy[:, 1] * small_h / height).astype(np.int64), 0, small_h - 1)
    before = shot.depth[row, column]
    # A steep wall's depth changes much within one pixel of the depth image.
    slack = 0.15 + 0.01 * z + 1.5 * z * (width / small_w) / shot.intrinsics[0, 0] / np.maximum(cosine, 0.05)
    free = (before == 0) | (before > z - slack)
    index, xy, distance, cosine = index[free], xy[free], distance[free], cosine[free]
    if sight is not None and len(index):
        ends = points[index] + np.broadcast_to(normals, points.shape)[index] * _OFF_WALL
        ray = ends - shot.pose.position
        reach = np.linalg.norm(ray, axis=1)
        hits = sight.first(np.broadcast_to(shot.pose.position, ray.shape), ray / reach[:, None], most=reach - _OFF_WALL)
        open_ = ~np.isfinite(hits.distance)
        index, xy, distance, cosine = index[open_], xy[open_], distance[open_], cosine[open_]
    pixels = shot.intrinsics[0, 0] * texel / np.maximum(distance, 1e-9)
    sharp = np.minimum(pixels * cosine, 1.0) * np.sqrt(cosine)
    return VisiblePoints(index, xy, pixels * np.sqrt(cosine), sharp, shot.is_hidden(xy))


@dataclass(frozen=True)
class Samples:
    """Points that stand for the charts: about one a quarter of a square metre, at least a few each.

    Attributes
    ----------
    points, normals
        Metres, shape ``(n, 3)``.
    chart
        Rising, shape ``(n,)``; `bounds` are where each chart's begin and the last ends, shape ``(charts + 1,)``.
    lab
        The atlas's colours around there, the mean of a patch of `PATCH`, CIE L*a*b*, shape ``(n, 3)``.
    known
        Whether those are of a photo.
    centre, radius
        Of balls around the charts, shapes ``(charts, 3)`` and ``(charts,)``.
    """

    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    chart: NDArray[np.int64]
    bounds: NDArray[np.int64]
    lab: NDArray[np.float32]
    known: NDArray[np.bool_]
    centre: NDArray[np.float64]
    radius: NDArray[np.float64]


def texel_centres(chart: Chart, rows: slice | NDArray[Any], columns: slice | NDArray[Any]) -> NDArray[np.float64]:
    """Centres of a grid of a chart's texels, ENU metres, shape ``(rows, columns, 3)``."""
    j = np.arange(chart.height)[rows, None, None] + 0.5
    i = np.arange(chart.width)[None, columns, None] + 0.5
    return np.asarray(chart.origin + i * chart.right + j * chart.up)


def samples_of(atlas: Atlas) -> Samples:
    """Sample an atlas."""
    cv2 = opencv()
    wide = max(round(PATCH / atlas.texel), 1)
    points, normals, owner, rgb, known = [], [], [], [], []
    centre, radius = np.zeros((len(atlas.charts), 3)), np.zeros(len(atlas.charts))
    for k, chart in enumerate(atlas.charts):
        step = max(int(_SAMPLE / atlas.texel), 1)
        rows, columns = (
            np.arange(min(step // 2, n // 2), n, min(step, max(n // 3, 1))) for n in (chart.height, chart.width)
        )
        inside = atlas.inside[chart.page][chart.box][np.ix_(rows, columns)]
        where = texel_centres(chart, rows, columns)[inside]
        points.append(where)
        normals.append(np.broadcast_to(chart.normal, where.shape))
        owner.append(np.full(len(where), k))
        mean = cv2.blur(atlas.pages[chart.page][chart.box], (wide, wide), borderType=cv2.BORDER_REPLICATE)
        rgb.append(mean[np.ix_(rows, columns)][inside])
        known.append(atlas.known[chart.page][chart.box][np.ix_(rows, columns)][inside])
        across, up = chart.right * chart.width / 2, chart.up * chart.height / 2
        centre[k], radius[k] = chart.origin + across + up, np.linalg.norm(across + up)
    if not points:
        nothing = np.zeros((0, 3))
        return Samples(nothing, nothing, np.zeros(0, np.int64), np.zeros(1, np.int64), nothing.astype(np.float32),
                       np.zeros(0, np.bool_), centre, radius)  # fmt: skip
    chart_of = np.concatenate(owner)
    bounds = np.searchsorted(chart_of, np.arange(len(atlas.charts) + 1))
    return Samples(
        np.concatenate(points), np.concatenate(normals), chart_of, bounds,
        lab_of(np.concatenate(rgb)), np.concatenate(known), centre, radius,
    )  # fmt: skip


def in_frustum(samples: Samples, shot: Shot, farthest: float) -> NDArray[np.int64]:
    """Charts whose ball meets the camera's view."""
    height, width = shot.picture.shape[:2]
    corners = (
        np.array([[0, 0, 1], [width, 0, 1], [width, height, 1], [0, height, 1]]) @ np.linalg.inv(shot.intrinsics).T
    )
    sides = np.cross(corners, np.roll(corners, -1, axis=0))  # normals of the view's four planes, pointing inwards
    sides /= np.linalg.norm(sides, axis=1, keepdims=True)
    centre = shot.pose.to_camera(samples.centre)
    meets = (centre @ sides.T > -samples.radius[:, None]).all(axis=1)
    return np.flatnonzero(meets & (np.linalg.norm(centre, axis=1) - samples.radius < farthest))


def choose_cameras(
    qualities: Sequence[tuple[NDArray[np.int64], NDArray[np.float64]]], count: int, *, most: int, least: float
) -> list[int]:
    """Choose cameras for a chart greedily: the best first, then whichever adds most, while one adds enough.

    Parameters
    ----------
    qualities
        For each camera the chart's samples it sees and how well.
    count
        Samples of the chart.
    most
        Cameras at most.
    least
        Quality a camera must add, as a share of a chart that is seen perfectly.

    Returns
    -------
    list of int
        Cameras, in the order chosen.
    """
    best = np.zeros(count)
    order: list[int] = []
    while len(order) < most:
        gains = [
            0.0 if k in order else float(np.maximum(quality - best[index], 0.0).sum())
            for k, (index, quality) in enumerate(qualities)
        ]
        k = int(np.argmax(gains)) if gains else 0
        if not gains or gains[k] < least * count:
            break
        order.append(k)
        index, quality = qualities[k]
        best[index] = np.maximum(best[index], quality)
    return order


_BAND = 1 << 19  # texels at a time
_LEAST_FIT = 0.4  # correlation with the wall under which no photo is used
_LEAST_SHARE = 0.7  # share of the best photo's under which none is used
_LEAST_AGREED = 0.5  # what agrees less with the wall's own texels shows something else
_WORSE = 0.75  # a camera gives way where another of the chart is better by this


@dataclass(frozen=True)
class CameraLayer:
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
class BlendingConfig:
    """How photos come onto a chart.

    Attributes
    ----------
    farthest, steepest
        As of `visible_points`: metres and radians.
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
    layers: Sequence[CameraLayer],
    sight: RayCaster | None,
    how: BlendingConfig,
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
        parts = _project_photo(atlas, number, layer.shot, sight, quality[k], found[k], how)
        moved = NO_NUDGE
        if grey is not None:
            shown = cv2.cvtColor(found[k], cv2.COLOR_RGB2GRAY).astype(np.float32)
            moved = nudge_of(chart, shown, quality[k] > 0, grey, before[1] & inside, layer.shot.pose)
        nudges.append(moved)
        for points, place, pixels in parts:
            if moved.offset.any():
                xy = project(points + moved.offset, layer.shot.pose, layer.shot.intrinsics)
                found[k].reshape(-1, 3)[place] = layer.shot.colours(xy, pixels)
                hidden = layer.shot.is_hidden(xy)
            else:
                hidden = layer.shot.is_hidden(project(points, layer.shot.pose, layer.shot.intrinsics))
            # What was painted over is a guess: better than nothing, and worse than what is known.
            flat = quality[k].reshape(-1)
            flat[place] *= np.where(hidden, np.where(before[1].reshape(-1)[place], 0.0, PAINTED), 1.0)
        labs.append(layer.curve.apply(lab_of(found[k])) + layer.shade.astype(np.float32))
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


def _project_photo(
    atlas: Atlas,
    number: int,
    shot: Shot,
    sight: RayCaster | None,
    quality: NDArray[np.float32],
    found: NDArray[np.uint8],
    how: BlendingConfig,
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
        seen = visible_points(
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
