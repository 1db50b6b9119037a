"""Enhancement of an atlas with photos on it: even light, filled holes, finer texels.

The sun that photos of walls were made in is found by the shadows the buildings cast, and taken out of the photos. A
wall in the shade is dark in its photo, and a renderer would shade it once more. Which texels of clean buildings any
sun shines on is known from their geometry alone; the sun whose light and shadow explain most of the brightness within
each building is the one of the photos.

Texels are made finer without weights: enlarge, then correct until the coarse picture comes out again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.ndimage import gaussian_filter, map_coordinates, uniform_filter

from vico.errors import InputError
from vico.threads import for_each, in_order
from vico.worldgen.facts.ray_casting import RayCaster
from vico.worldgen.photos.atlas import Atlas, Chart
from vico.worldgen.photos.exemplar_fill import exemplar_fill, pull_push


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
            fine = _resize(coarse, wide)
            for _ in range(self.rounds):
                seen = gaussian_filter(fine, self.blur * self.factor, mode="nearest", truncate=3.0)
                seen = seen.reshape(height, self.factor, width, self.factor).mean(axis=(1, 3))
                fine += _resize(coarse - seen, wide)
            # What overshoots is a halo: stay within the range of the neighbourhood.
            low, high = _range(coarse)
            low, high = (np.asarray(_resize(v, wide)) for v in (low, high))
            out[..., channel] = np.clip(np.clip(fine, low, high) + 0.5, 0, 255).astype(np.uint8)
        return out


def _resize(values: NDArray[np.float32], size: tuple[int, int]) -> NDArray[np.float32]:
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


_LARGEST_PAGE = 8192
_NEAR = 4  # texels around a shred of photo that are looked at
_TRUSTED = 0.5  # share of known ones among them below which it is filled too
_MOST_THREADS = 16  # that hold a chart and its coarser levels each
_MOST_PAGES = 4  # threads that hold a page each
_TILE = 1024  # pixels, side of what an upscaler sees at a time
_MARGIN = 16  # pixels by which these overlap


class Inpainter(Protocol):
    """Fills the missing texels of a picture."""

    def __call__(
        self, image: NDArray[np.uint8], missing: NDArray[np.bool_], *, usable: NDArray[np.bool_], upright: bool
    ) -> NDArray[np.uint8]:
        """Fill.

        Parameters
        ----------
        image
            uint8, shape ``(h, w, 3)``; row 0 is the top.
        missing
            What to fill, shape ``(h, w)``.
        usable
            What is known and may be copied, shape ``(h, w)``; the rest lies outside of the face.
        upright
            A wall, with level rows; a roof otherwise.

        Returns
        -------
        ndarray
            uint8, shape ``(h, w, 3)``; the caller keeps what was not missing.
        """
        ...


class Upscaler(Protocol):
    """Makes pictures larger."""

    @property
    def factor(self) -> int:
        """How many times larger."""
        ...

    def __call__(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Enlarge uint8 ``(h, w, 3)`` to ``(factor * h, factor * w, 3)``."""
        ...


class ExemplarFill:
    """The default `Inpainter`: copies of the picture's own texels, without weights (`exemplar_fill`)."""

    def __call__(
        self, image: NDArray[np.uint8], missing: NDArray[np.bool_], *, usable: NDArray[np.bool_], upright: bool
    ) -> NDArray[np.uint8]:
        """Fill one picture."""
        return exemplar_fill(image, missing, usable=usable, upright=upright)


def inpaint_atlas(atlas: Atlas, *, inpainter: Inpainter | None = None, over: bool = False) -> Atlas:
    """Fill the texels of all charts that no photo reached.

    Parameters
    ----------
    atlas
        With photos on it. Its `known` masks stay: they tell photos from guesses.
    inpainter
        Fills a picture; `ExemplarFill` where not given. A chart without any photo gets the mean colour of its
        building's others.
    over
        Write over the pages given instead of copies of them.

    Returns
    -------
    Atlas
        With new pages, every texel of a face coloured.
    """
    fill = inpainter or ExemplarFill()
    means = _means(atlas)
    atlas = atlas if over else _copy_pages(atlas)

    def mend(chart: Chart) -> None:
        inside, known = atlas.inside[chart.page][chart.box], atlas.known[chart.page][chart.box]
        missing = inside & ~known
        if not missing.any():
            return
        piece = atlas.pages[chart.page][chart.box]
        if not known.any():
            wall = abs(chart.normal[2]) < 0.5
            piece[missing] = means.get((chart.entity, wall), means.get((0, wall), (128, 128, 128)))
            return
        # Plug-ins see the picture as people do, top row first.
        upright = abs(float(chart.normal[2])) < 0.5
        usable = inside & known & (_share_around(known) >= _TRUSTED * _share_around(inside))
        hole = inside & ~usable if usable.any() else missing
        usable = inside & ~hole
        made = fill(piece[::-1].copy(), hole[::-1].copy(), usable=usable[::-1].copy(), upright=upright)
        if made.shape != piece.shape or made.dtype != np.uint8:
            raise InputError(
                f"in-painting: {type(fill).__name__} answered {made.dtype} {made.shape} for a picture of uint8 "
                f"{piece.shape}; it must keep size and type"
            )
        piece[hole] = made[::-1][hole]

    # Plug-ins may not be made for more than one thread.
    for_each(mend, atlas.charts, most=_MOST_THREADS if isinstance(fill, ExemplarFill) else 1)
    return atlas


def even_out_light(atlas: Atlas, *, most: float = 2.5, over: bool = False) -> Atlas:
    """Take the light of the day the photos were made out of them, so that walls in their shade are not shaded twice.

    Parameters
    ----------
    atlas
        With photos on it.
    most
        By what a chart may be brightened.
    over
        Write over the pages given instead of copies of them.

    Returns
    -------
    Atlas
        With every wall as bright as if it had faced the light: a first-order fit of the charts' luminance (log odds)
        to their normals is taken off. Fewer than eight charts with photos stay as they are.
    """
    charts, normals, light, weight = [], [], [], []
    for k, chart in enumerate(atlas.charts):
        colours = atlas.pages[chart.page][chart.box][atlas.known[chart.page][chart.box]]
        if len(colours) >= 50:
            charts.append(k)
            normals.append(chart.normal)
            share = np.clip(np.median(colours @ np.array([0.299, 0.587, 0.114])) / 255, 0.02, 0.98)
            light.append(np.log(share / (1 - share)))  # in the units in which the gain below is a factor
            weight.append(np.sqrt(len(colours)))
    if len(charts) < 8:
        return atlas
    wall = np.abs(np.array(normals)[:, 2]) < 0.5
    basis = np.column_stack([wall, ~wall, np.array(normals)[:, :2]]).astype(np.float64)
    scale = np.array(weight)[:, None]
    # A slight pull to zero: one bright or dark building is not the sun.
    rows = np.concatenate([basis * scale, np.diag([1e-6, 1e-6, 1.0, 1.0]) * float(np.mean(weight))])
    fit = np.linalg.lstsq(rows, np.concatenate([np.array(light) * scale[:, 0], np.zeros(4)]), rcond=None)[0]
    sun = fit[2:]
    atlas = atlas if over else _copy_pages(atlas)
    for chart in atlas.charts:
        away = np.linalg.norm(sun) - float(chart.normal[:2] @ sun)
        gain = min(float(np.exp(away)), most) if abs(chart.normal[2]) < 0.5 else 1.0
        piece = atlas.pages[chart.page][chart.box]
        # Bright texels must not burn out: the gain fades towards white.
        table = np.arange(256) / 255.0
        table = np.round(255 * gain * table / (1 + (gain - 1) * table)).astype(np.uint8)
        inside = atlas.inside[chart.page][chart.box]
        piece[inside] = table[piece[inside]]
    return atlas


def upscale_atlas(atlas: Atlas, *, upscaler: Upscaler | None = None) -> Atlas:
    """Make the texels finer; texture coordinates of the surfaces stay valid.

    Parameters
    ----------
    atlas
        In-painted before, so that no hole is enlarged.
    upscaler
        Enlarges a picture; twofold `BackProjection` where not given.

    Returns
    -------
    Atlas
        With pages, masks and charts `factor` times larger, and `texel` as much smaller.

    Raises
    ------
    InputError
        If a page would be larger than 8192 pixels: bake with smaller pages.
    """
    enlarge = upscaler or BackProjection()
    factor = enlarge.factor
    if factor & (factor - 1):
        raise InputError(f"super-resolution: a factor of {factor}; pages must stay powers of two")
    for page in atlas.pages:
        if max(page.shape[:2]) * factor > _LARGEST_PAGE:
            raise InputError(
                f"super-resolution: a page of {page.shape[1]} pixels times {factor} is over {_LARGEST_PAGE}; bake with "
                f"pages of {_LARGEST_PAGE // factor} at most"
            )
    charts = tuple(
        replace(
            chart,
            x=chart.x * factor,
            y=chart.y * factor,
            width=chart.width * factor,
            height=chart.height * factor,
            right=chart.right / factor,
            up=chart.up / factor,
        )
        for chart in atlas.charts
    )
    return replace(
        atlas,
        pages=tuple(_enlarge_page(page, enlarge) for page in pad_gutters(atlas).pages),
        inside=_repeat_masks(atlas.inside, factor),
        known=_repeat_masks(atlas.known, factor),
        charts=charts,
        texel=atlas.texel / factor,
    )


def pad_gutters(atlas: Atlas, *, over: bool = False) -> Atlas:
    """Spread the colours of faces over their gutters and all that lies between, for mip levels that don't bleed.

    Parameters
    ----------
    atlas
        In-painted, or with holes that stay as they are.
    over
        Write over the pages given instead of copies of them.

    Returns
    -------
    Atlas
        With every texel of its pages coloured.
    """
    atlas = atlas if over else _copy_pages(atlas)

    def spread(k: int) -> None:
        atlas.pages[k][:] = pull_push(atlas.pages[k], atlas.inside[k])

    for_each(spread, range(len(atlas.pages)), most=_MOST_PAGES)
    return atlas


def _copy_pages(atlas: Atlas) -> Atlas:
    return replace(atlas, pages=tuple(page.copy() for page in atlas.pages))


def _share_around(mask: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Share of set texels in the square about each."""
    return uniform_filter(mask.astype(np.float32), 2 * _NEAR + 1, mode="constant") + np.float32(1e-6)


def _enlarge_page(page: NDArray[np.uint8], enlarge: Upscaler) -> NDArray[np.uint8]:
    """Enlarge in tiles that overlap; pictures are handed over top row first."""
    factor = enlarge.factor
    height, width = page.shape[:2]
    out = np.empty((height * factor, width * factor, 3), np.uint8)

    def tile(corner: tuple[int, int]) -> None:
        y, x = corner
        top, left = max(y - _MARGIN, 0), max(x - _MARGIN, 0)
        bottom, right = min(y + _TILE + _MARGIN, height), min(x + _TILE + _MARGIN, width)
        made = enlarge(page[top:bottom, left:right][::-1].copy())[::-1]
        wanted = ((bottom - top) * factor, (right - left) * factor, 3)
        if made.shape != wanted or made.dtype != np.uint8:
            raise InputError(
                f"super-resolution: {type(enlarge).__name__} answered {made.dtype} {made.shape}, not uint8 {wanted}"
            )
        high, wide = min(y + _TILE, height), min(x + _TILE, width)
        out[y * factor : high * factor, x * factor : wide * factor] = made[
            (y - top) * factor : (high - top) * factor, (x - left) * factor : (wide - left) * factor
        ]

    corners = [(y, x) for y in range(0, height, _TILE) for x in range(0, width, _TILE)]
    for_each(tile, corners, most=_MOST_THREADS if isinstance(enlarge, BackProjection) else 1)
    return out


def _repeat_masks(masks: Sequence[NDArray[np.bool_]], factor: int) -> tuple[NDArray[np.bool_], ...]:
    return tuple(mask.repeat(factor, axis=0).repeat(factor, axis=1) for mask in masks)


def _means(atlas: Atlas) -> dict[tuple[int, bool], tuple[int, int, int]]:
    """Mean known colour of each entity's walls (True) and roofs (False); entity 0 stands for all."""
    total: dict[tuple[int, bool], NDArray[np.float64]] = {}
    for chart in atlas.charts:
        colours = atlas.pages[chart.page][chart.box][atlas.known[chart.page][chart.box]]
        sums = np.array([*colours.sum(axis=0, dtype=np.float64), len(colours)])
        wall = abs(float(chart.normal[2])) < 0.5
        for entity in (chart.entity, 0):
            total[entity, wall] = total.get((entity, wall), np.zeros(4)) + sums
    means = {}
    for key, sums in total.items():
        if sums[3]:
            r, g, b = (int(v) for v in np.round(sums[:3] / sums[3]))
            means[key] = (r, g, b)
    return means


_SAMPLES = 6  # a side of the grid on each wall that the sun is sought with
_LEAST_SAMPLES = 200
_LEAST_EXPLAINED = 0.12  # share of the brightness' variance within buildings
_AZIMUTHS = np.arange(0.0, 360.0, 10.0)
_HEIGHTS = np.array([15.0, 25.0, 35.0, 45.0, 55.0, 65.0])
_STRONGEST = 2.5  # times the sky's light
_OFF = 0.3  # metres out of the wall from which rays start: photographed and mapped walls differ
_STEP = 0.4  # metres between the rays of a wall's shadows
_SOFT = 0.4  # metres over which shadows' edges run
_BAND = 1 << 18  # texels whose shadows are interpolated at a time
_BRIGHT = 190.0  # from here on a gain fades, so that nothing burns out
_LUMINANCE = np.array([0.299, 0.587, 0.114])


@dataclass(frozen=True)
class Sun:
    """The sun in photos.

    Attributes
    ----------
    direction
        To the sun, ENU, of unit length, shape ``(3,)``.
    strength
        A surface that faces the sun is ``1 + strength`` times as bright as one in the shade.
    explained
        Share of the brightness' variance within buildings that its light and shadow explain.
    """

    direction: NDArray[np.float64]
    strength: float
    explained: float

    @property
    def azimuth(self) -> float:
        """From north over east, degrees in 0..360."""
        return float(np.degrees(np.arctan2(self.direction[0], self.direction[1])) % 360.0)

    @property
    def height(self) -> float:
        """Over the horizon, degrees."""
        return float(np.degrees(np.arcsin(self.direction[2])))


def find_sun(atlas: Atlas, sight: RayCaster) -> Sun | None:
    """Find the sun in the photos of an atlas.

    Parameters
    ----------
    atlas
        With photos on it.
    sight
        The buildings.

    Returns
    -------
    Sun, optional
        None where no sun explains the brightness well: under clouds, or of too few walls.
    """
    points, normals, light, entity = _brightness(atlas)
    if len(points) < _LEAST_SAMPLES:
        return None
    group = np.unique(entity, return_inverse=True)[1]
    value = _within(np.log(light), group)
    total = float(value @ value)
    suns = [
        np.array([np.sin(azimuth) * np.cos(height), np.cos(azimuth) * np.cos(height), np.sin(height)])
        for height in np.radians(_HEIGHTS)
        for azimuth in np.radians(_AZIMUTHS)
    ]

    def fit_brightness(sun: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        shine = _shine(points, normals, sun, sight)
        centred = _within(shine, group)
        spread = float(centred @ centred)
        along = float(centred @ value)
        return (along * along / spread if spread > 1e-6 and along > 0.0 else 0.0), shine

    best: tuple[float, NDArray[np.float64], NDArray[np.float64]] | None = None
    for sun, (share, shine) in zip(suns, in_order(fit_brightness, suns), strict=True):
        if share > (0.0 if best is None else best[0]):
            best = share, sun, shine
    if best is None or not best[0] >= _LEAST_EXPLAINED * max(total, 1e-9):
        return None
    # How strong it is: the factor whose removal leaves least.
    strengths = np.linspace(0.05, _STRONGEST, 50)
    left = [float((_within(np.log(light / (1 + k * best[2])), group) ** 2).sum()) for k in strengths]
    return Sun(best[1], float(strengths[int(np.argmin(left))]), best[0] / total)


def remove_sunlight(atlas: Atlas, sun: Sun, sight: RayCaster, *, over: bool = False) -> Atlas:
    """Brighten walls that lie in the shade, or face the sun less than others, until all are as if in the sun.

    Roofs stay: nearly all of them are in the sun, and what stands on them is not known well enough to tell its shadow.

    Parameters
    ----------
    atlas
        With photos on it.
    sun
        The sun in them.
    sight
        The buildings.
    over
        Write over the pages given instead of copies of them.

    Returns
    -------
    Atlas
        With brighter pages.
    """
    if not over:
        atlas = replace(atlas, pages=tuple(page.copy() for page in atlas.pages))
    full = float(np.hypot(*sun.direction[:2]))

    def brighten(chart: Chart) -> None:
        known = atlas.known[chart.page][chart.box]
        if abs(float(chart.normal[2])) >= 0.5 or not known.any():
            return
        shine = _chart_shine(chart, sun, sight)
        gain = np.maximum((1 + sun.strength * full) / (1 + sun.strength * shine), 1.0)
        piece = atlas.pages[chart.page][chart.box]
        colour = piece[known].astype(np.float32) * gain[known, None].astype(np.float32)
        beyond = np.maximum(colour - _BRIGHT, 0.0)
        room = 255.0 - _BRIGHT
        colour = np.minimum(colour, _BRIGHT) + room * beyond / (beyond + room)
        # What was as bright before stays.
        piece[known] = np.round(np.maximum(colour, piece[known])).astype(np.uint8)

    for_each(brighten, atlas.charts)
    return atlas


def _brightness(atlas: Atlas) -> tuple[NDArray[np.float64], ...]:
    """Sample the walls' photos: places, normals, median luminance of the surroundings, and whose wall it is."""
    points, normals, light, entity = [], [], [], []
    for chart in atlas.charts:
        if abs(float(chart.normal[2])) >= 0.5:
            continue
        known = atlas.known[chart.page][chart.box]
        grey = atlas.pages[chart.page][chart.box] @ _LUMINANCE
        rows = np.linspace(0, chart.height, min(_SAMPLES, chart.height) + 1).astype(int)
        columns = np.linspace(0, chart.width, min(_SAMPLES, chart.width) + 1).astype(int)
        for low, high in pairwise(rows.tolist()):
            for left, right in pairwise(columns.tolist()):
                mask = known[low:high, left:right]
                if mask.sum() < 12 or mask.mean() < 0.5:
                    continue
                # Windows are darker than the wall about them, in sun and shade alike.
                light.append(max(float(np.quantile(grey[low:high, left:right][mask], 0.7)), 4.0))
                middle = (left + right) / 2 * chart.right + (low + high) / 2 * chart.up
                points.append(chart.origin + middle)
                normals.append(chart.normal)
                entity.append(chart.entity)
    return np.array(points).reshape(-1, 3), np.array(normals).reshape(-1, 3), np.array(light), np.array(entity)


def _within(values: NDArray[np.float64], group: NDArray[np.int64]) -> NDArray[np.float64]:
    """Values less the mean of their group."""
    mean = np.bincount(group, values) / np.bincount(group)
    return np.asarray(values - mean[group])


def _shine(
    points: NDArray[np.float64], normals: NDArray[np.float64], sun: NDArray[np.float64], sight: RayCaster
) -> NDArray[np.float64]:
    """How squarely the sun shines on points: the cosine, 0 in shadow."""
    cosine = np.maximum(normals @ sun, 0.0)
    facing = np.flatnonzero(cosine > 0.0)
    if len(facing):
        hits = sight.first(points[facing] + _OFF * normals[facing], np.broadcast_to(sun, (len(facing), 3)), most=300.0)
        cosine[facing[hits.triangle >= 0]] = 0.0
    return cosine


def _chart_shine(chart: Chart, sun: Sun, sight: RayCaster) -> NDArray[np.float32]:
    """Return the same for all texels of a chart, shape ``(height, width)``, with soft edges."""
    cosine = float(chart.normal @ sun.direction)
    if cosine <= 0.0:
        return np.zeros((chart.height, chart.width), np.float32)
    texel = float(np.linalg.norm(chart.right))
    down = max(round(chart.height * texel / _STEP), 1)
    across = max(round(chart.width * texel / _STEP), 1)
    row = (np.arange(down) + 0.5) / down * chart.height
    column = (np.arange(across) + 0.5) / across * chart.width
    points = chart.origin + row[:, None, None] * chart.up + column[None, :, None] * chart.right
    flat = points.reshape(-1, 3)
    shine = _shine(flat, np.broadcast_to(chart.normal, flat.shape), sun.direction, sight).reshape(down, across)
    shine = gaussian_filter(shine, _SOFT / _STEP, mode="nearest")
    rows = (np.arange(chart.height) + 0.5) / chart.height * down - 0.5
    columns = (np.arange(chart.width) + 0.5) / chart.width * across - 0.5
    full = np.empty((chart.height, chart.width), np.float32)
    band = max(_BAND // chart.width, 1)
    for low in range(0, chart.height, band):
        where = np.meshgrid(rows[low : low + band], columns, indexing="ij")
        full[low : low + band] = map_coordinates(shine, where, order=1, mode="nearest")
    return full
