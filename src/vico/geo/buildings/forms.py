"""What form a roof of measured surfaces has: eaves, ridge, and the nearest of the shapes that have a name."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vico.geo.buildings.model import RoofFacet

_LEVEL = 0.05  # rise per metre of what drains, and counts as flat
_SMALL = 0.02  # share of the roof below which a piece does not decide its top


@dataclass(frozen=True)
class RoofForm:
    """A roof in few words.

    Attributes
    ----------
    shape
        flat, skillion, gabled, hipped, pyramidal; of what is none of them the nearest.
    eaves, top
        Metres above the level that the facets count from.
    """

    shape: str
    eaves: float
    top: float


def form_of(facets: Sequence[RoofFacet]) -> RoofForm:
    """Return the form of a roof.

    Parameters
    ----------
    facets
        Its surfaces; at least one.
    """
    areas = np.array([facet.polygon.area for facet in facets])
    heights = [facet.height(np.asarray(facet.polygon.exterior.coords)[:, :2]) for facet in facets]
    lows, highs = np.array([h.min() for h in heights]), np.array([h.max() for h in heights])
    steep = np.array([facet.steepness for facet in facets])
    total = float(areas.sum())
    top = float(highs[areas >= _SMALL * total].max(initial=float(lows.min())))
    eaves = min(_weighted_median(lows, areas), top)
    level = float(areas[steep < _LEVEL].sum()) / total
    if level > 0.8 or top - eaves < 0.4:
        return RoofForm("flat", min(_weighted_median((lows + highs) / 2, areas), top), top)
    return RoofForm(_shape(facets, areas, steep), eaves, top)


def _shape(facets: Sequence[RoofFacet], areas: NDArray[np.float64], steep: NDArray[np.float64]) -> str:
    """Return the shape by the directions in which the slopes fall."""
    falls = [math.atan2(-facet.plane[2], -facet.plane[1]) for facet in facets]
    directions: list[tuple[float, float]] = []  # yaw and area of slopes that fall alike
    for k in np.argsort(-areas, kind="stable").tolist():
        if steep[k] < _LEVEL:
            continue
        for n, (yaw, area) in enumerate(directions):
            if abs((falls[k] - yaw + math.pi) % (2 * math.pi) - math.pi) < 0.35:
                directions[n] = (yaw, area + float(areas[k]))
                break
        else:
            directions.append((falls[k], float(areas[k])))
    sloping = sum(area for _, area in directions)
    main = [yaw for yaw, area in directions if area > 0.08 * sloping]
    if len(main) == 1:
        return "skillion"
    if len(main) == 2:
        apart = abs((main[0] - main[1] + math.pi) % (2 * math.pi) - math.pi)
        return "gabled" if apart > 2.6 else "hipped"
    return "hipped"


def _weighted_median(values: NDArray[np.float64], weights: NDArray[np.float64]) -> float:
    order = np.argsort(values, kind="stable")
    total = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(total, 0.5 * total[-1])])
