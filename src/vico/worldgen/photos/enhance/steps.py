"""Better photos on the charts: missing texels filled, finer texels, and nothing that bleeds at the edges."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter

from vico.errors import InputError
from vico.threads import for_each
from vico.worldgen.photos.atlas import Atlas, Chart
from vico.worldgen.photos.enhance.back_projection import BackProjection
from vico.worldgen.photos.enhance.exemplar import exemplar_fill, pull_push

_LARGEST_PAGE = 8192
_NEAR, _TRUSTED = 4, 0.5  # shreds of photo with fewer known texels than this share within a few texels are filled too
_MOST_THREADS, _MOST_PAGES = 16, 4  # threads that hold a chart and its coarser levels each, or a page
_TILE, _MARGIN = 1024, 16  # pixels an upscaler sees at a time, and how far they overlap


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


def inpainted(atlas: Atlas, *, inpainter: Inpainter | None = None, over: bool = False) -> Atlas:
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
    atlas = atlas if over else _copied(atlas)

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
        usable = inside & known & (_around(known) >= _TRUSTED * _around(inside))
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


def evened(atlas: Atlas, *, most: float = 2.5, over: bool = False) -> Atlas:
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
    atlas = atlas if over else _copied(atlas)
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


def upscaled(atlas: Atlas, *, upscaler: Upscaler | None = None) -> Atlas:
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
        pages=tuple(_enlarged(page, enlarge) for page in padded(atlas).pages),
        inside=_repeated(atlas.inside, factor),
        known=_repeated(atlas.known, factor),
        charts=charts,
        texel=atlas.texel / factor,
    )


def padded(atlas: Atlas, *, over: bool = False) -> Atlas:
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
    atlas = atlas if over else _copied(atlas)

    def spread(k: int) -> None:
        atlas.pages[k][:] = pull_push(atlas.pages[k], atlas.inside[k])

    for_each(spread, range(len(atlas.pages)), most=_MOST_PAGES)
    return atlas


def _copied(atlas: Atlas) -> Atlas:
    return replace(atlas, pages=tuple(page.copy() for page in atlas.pages))


def _around(mask: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Share of set texels in the square about each."""
    return uniform_filter(mask.astype(np.float32), 2 * _NEAR + 1, mode="constant") + np.float32(1e-6)


def _enlarged(page: NDArray[np.uint8], enlarge: Upscaler) -> NDArray[np.uint8]:
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


def _repeated(masks: Sequence[NDArray[np.bool_]], factor: int) -> tuple[NDArray[np.bool_], ...]:
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
