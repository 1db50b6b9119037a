"""The sun that photos of walls were made in, found by the shadows the buildings cast, and taken out of the photos.

A wall in the shade is dark in its photo, and a renderer would shade it once more. Which texels of clean buildings any
sun shines on is known from their geometry alone; the sun whose light and shadow explain most of the brightness within
each building is the one of the photos.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, map_coordinates

from vico.threads import for_each, in_order
from vico.worldgen.facts.ray_casting import RayCaster
from vico.worldgen.photos.atlas import Atlas, Chart

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


def sun_in(atlas: Atlas, sight: RayCaster) -> Sun | None:
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

    def explained(sun: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        shine = _shine(points, normals, sun, sight)
        centred = _within(shine, group)
        spread = float(centred @ centred)
        along = float(centred @ value)
        return (along * along / spread if spread > 1e-6 and along > 0.0 else 0.0), shine

    best: tuple[float, NDArray[np.float64], NDArray[np.float64]] | None = None
    for sun, (share, shine) in zip(suns, in_order(explained, suns), strict=True):
        if share > (0.0 if best is None else best[0]):
            best = share, sun, shine
    if best is None or not best[0] >= _LEAST_EXPLAINED * max(total, 1e-9):
        return None
    # How strong it is: the factor whose removal leaves least.
    strengths = np.linspace(0.05, _STRONGEST, 50)
    left = [float((_within(np.log(light / (1 + k * best[2])), group) ** 2).sum()) for k in strengths]
    return Sun(best[1], float(strengths[int(np.argmin(left))]), best[0] / total)


def without_sun(atlas: Atlas, sun: Sun, sight: RayCaster, *, over: bool = False) -> Atlas:
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
