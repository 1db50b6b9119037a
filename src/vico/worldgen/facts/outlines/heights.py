"""How high buildings are that don't say: by kind, by neighbours of their use, by the area, by the town."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from shapely import Polygon

from vico.geo.osm import Tags
from vico.worldgen.facts.tags import number

STOREY = 3.2
"""Metres a storey, where only levels are known."""

_NEAR = 100.0  # metres within which neighbours of the same use decide
_REACH = 220.0  # metres within which the nearest of any use do

# Storeys of kinds that look alike everywhere, whatever stands beside them.
_STOREYS_OF_KINDS = {
    1: "garage garages carport shed hut kiosk service toilets greenhouse bungalow cabin houseboat static_caravan barn "
    "cowshed stable sty farm_auxiliary transformer_tower pavilion supermarket boathouse gatehouse container bunker",
    2: "house detached semidetached_house terrace farm villa fire_station kindergarten",
    3: "school civic public library museum community_centre parking courthouse",
    4: "university hospital dormitory government department_store",
    5: "hotel",
}
_KIND_LEVELS = {kind: storeys for storeys, kinds in _STOREYS_OF_KINDS.items() for kind in kinds.split()}
# Of these, neighbours know better where there are any.
_YIELDING = ("house", "detached", "semidetached_house", "terrace", "villa", "university", "hotel", "civic", "public",
             "dormitory", "government", "department_store", "museum", "school")  # fmt: skip

_KIND_EAVES = {
    "garage": 2.7,
    "garages": 2.7,
    "carport": 2.7,
    "shed": 2.4,
    "hut": 2.6,
    "kiosk": 3.0,
    "toilets": 2.9,
    "service": 3.2,
    "greenhouse": 3.0,
    "container": 2.6,
    "houseboat": 3.4,
    "static_caravan": 2.8,
    "supermarket": 5.5,
    "industrial": 7.5,
    "warehouse": 8.0,
    "factory": 8.5,
    "hangar": 10.0,
    "train_station": 9.0,
    "stadium": 18.0,
    "grandstand": 9.0,
    "sports_hall": 8.5,
    "riding_hall": 7.0,
    "barn": 5.0,
    "silo": 15.0,
    "storage_tank": 9.0,
    "water_tower": 28.0,
    "chimney": 35.0,
    "transformer_tower": 8.0,
    "bunker": 3.5,
}


def said_levels(tags: Mapping[str, str]) -> int | None:
    """Storeys that tags state, or that a tagged height comes to."""
    levels = number(tags.get("building:levels"))
    if levels is not None and 1 <= levels <= 150:
        return max(round(levels), 1)
    height = said_height(tags)
    return max(round((height - 1.0) / STOREY), 1) if height and height > 2 else None


def said_height(tags: Mapping[str, str]) -> float | None:
    """Metres that tags state, from the ground to the highest point."""
    height = number(tags.get("height")) or number(tags.get("building:height")) or number(tags.get("est_height"))
    return height if height is not None and 0.5 < height < 900.0 else None


def kind_eaves(tags: Mapping[str, str], use: str, area: float) -> float | None:
    """Height of the eaves of what is no stack of storeys, metres; None for what is."""
    kind = tags.get("building", tags.get("building:part", "yes"))
    side = float(np.sqrt(area))
    if kind in ("cathedral", "basilica"):
        return float(np.clip(0.45 * side + 6.0, 12.0, 26.0))
    if kind in ("tower", "bell_tower", "campanile", "minaret") or tags.get("man_made") == "tower":
        return float(np.clip(3.6 * side, 10.0, 60.0))
    if use == "religious" and kind not in ("monastery", "presbytery"):
        return float(np.clip(0.42 * side + 2.0, 4.0, 17.0))
    if kind in _KIND_EAVES:
        return _KIND_EAVES[kind]
    if use == "industrial":
        return 7.5 if area > 200.0 else 5.0
    return 9.0 if use == "transport" and area > 400.0 else None


def level_estimates(
    outlines: Sequence[tuple[str, Polygon, Tags]],
    tallest: NDArray[np.int64],
    typical: NDArray[np.int64],
    uses: Sequence[str],
    lon: float,
) -> tuple[NDArray[np.int64], list[str]]:
    """Storeys of every outline, and the rule that decided each.

    Parameters
    ----------
    outlines
        Id, polygon and tags of each.
    tallest
        The most storeys any part of each is said to have (0: none): an outline's own tag often means the lowest part.
    typical
        What most of its parts' area is said to have (0: none).
    uses
        What each is used for.
    lon
        Longitude of the place: towns of few facts are higher in the old world.

    Returns
    -------
    tuple
        Storeys, shape ``(n,)``; and names out of `RULES`.

    Notes
    -----
    Neighbours: the median of those of the same use within 100 m, weighted by nearness and likeness in area.
    """
    if not outlines:
        return np.zeros(0, np.int64), []
    areas = np.array([row[1].area for row in outlines])
    centres = np.array([row[1].centroid.coords[0] for row in outlines])
    said = np.array([said_levels(row[2]) or 0 for row in outlines])
    example = np.maximum(said, tallest)
    known = np.flatnonzero((example > 0) & (areas > 45.0))
    large = np.flatnonzero((example > 0) & (areas > 120.0))
    reach = shapely.box(*(f(centres[:, k]) for f in (np.min, np.max) for k in (0, 1)))
    dense = areas.sum() / max(reach.area, 1.0) > 0.22
    usual = (5 if lon > -30 else 4) if dense else 2
    use_code = np.unique(np.array(uses), return_inverse=True)[1].ravel()
    near_tree = cKDTree(centres[known]) if len(known) else None
    far_tree = cKDTree(centres[large]) if len(large) else None
    result = np.empty(len(outlines), np.int64)
    rules: list[str] = []
    for k, (_, _, tags) in enumerate(outlines):
        kind = tags.get("building", "yes")
        if said[k]:
            result[k] = said[k]
            rules.append("levels tag" if number(tags.get("building:levels")) else "height tag")
            continue
        if typical[k]:
            result[k] = typical[k]
            rules.append("parts")
            continue
        usual_kind = _KIND_LEVELS.get(kind)
        if kind_eaves(tags, uses[k], float(areas[k])) is not None or (usual_kind and kind not in _YIELDING):
            result[k] = usual_kind or 1
            rules.append("kind")
            continue
        estimate, rule = 0, ""
        if areas[k] < 45.0:
            estimate, rule = usual_kind or 1, "kind"
        if not rule and near_tree is not None:
            index = np.array(sorted(near_tree.query_ball_point(centres[k], _NEAR)), np.int64)
            index = index[use_code[known[index]] == use_code[k]] if len(index) else index
            if len(index) >= 2:
                others = known[index]
                distance = np.hypot(*(centres[others] - centres[k]).T)
                likeness = np.minimum(areas[others], areas[k]) / np.maximum(areas[others], areas[k])
                estimate = weighted_median(example[others], np.sqrt(likeness) / (1.0 + distance / 25.0))
                rule = "neighbours"
        if not rule and usual_kind:
            estimate, rule = usual_kind, "kind"
        if not rule and far_tree is not None:
            distances, nearest = far_tree.query(centres[k], k=min(7, len(large)))
            pairs = zip(np.atleast_1d(distances).tolist(), np.atleast_1d(nearest).tolist(), strict=True)
            near = [int(example[large[i]]) for d, i in pairs if d < _REACH]
            if len(near) >= 2:
                estimate, rule = round(float(np.median(near))), "area"
        if not rule:
            estimate, rule = usual, "town"
        result[k] = max(min(estimate, 2 if areas[k] < 90.0 else 3 if areas[k] < 140.0 else 12), 1)
        rules.append(rule)
    return result, rules


def weighted_median(values: NDArray[np.int64], weights: NDArray[np.float64]) -> int:
    """Return the value with half the weight on either side."""
    order = np.argsort(values, kind="stable")
    total = np.cumsum(weights[order])
    return int(values[order][np.searchsorted(total, 0.5 * total[-1])])
