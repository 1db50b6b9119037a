"""Heights of buildings without tags: by kind, by neighbours of their use, by the area, by the town."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from shapely import Polygon

from vico.geo.osm import Tags
from vico.geo.quantities import quantity

STOREY = 3.2
"""Metres a storey, where only levels are known."""

_NEAR = 100.0  # metres within which neighbours of the same use decide
_REACH = 220.0  # metres within which the nearest of any use do
_HOUSE = 60.0  # square metres: less is a shed
_TOWN_HOUSE = 300.0  # square metres: median of houses up to which a dense place is a town
# Slabs of flats: storeys, metres from front to back, and the least length.
_SLAB_LEVELS, _SLAB_DEEP, _SLAB_LONG = 5, (9.0, 19.0), 40.0

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


def tagged_levels(tags: Mapping[str, str]) -> int | None:
    """Storeys that tags state, or that a tagged height comes to."""
    levels = quantity(tags, "building:levels")
    if levels is not None:
        return max(round(levels), 1)
    height = tagged_height(tags)
    return max(round((height - 1.0) / STOREY), 1) if height and height > 2 else None


def tagged_height(tags: Mapping[str, str]) -> float | None:
    """Metres that tags state, from the ground to the highest point."""
    height = quantity(tags, "height") or quantity(tags, "building:height") or quantity(tags, "est_height")
    return height if height is not None and height > 0.5 else None


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
    town = _Town(outlines, tallest, uses, lon)
    result = np.empty(len(outlines), np.int64)
    rules: list[str] = []
    for k, (_, _, tags) in enumerate(outlines):
        if town.said[k]:
            result[k], rule = town.said[k], "levels tag" if quantity(tags, "building:levels") else "height tag"
        elif typical[k]:
            result[k], rule = typical[k], "parts"
        elif (alike := town.by_kind(k)) is not None:
            result[k], rule = alike, "kind"
        else:
            result[k], rule = town.by_what_is_near(k)
        rules.append(rule)
    return result, rules


class _Town:
    """Facts about all outlines, for those without mapped storeys.

    Attributes
    ----------
    said
        Storeys that the tags of each state, 0 for none, shape ``(n,)``.
    """

    def __init__(
        self, outlines: Sequence[tuple[str, Polygon, Tags]], tallest: NDArray[np.int64], uses: Sequence[str], lon: float
    ) -> None:
        self._tags, self._uses = [row[2] for row in outlines], uses
        self._areas = np.array([row[1].area for row in outlines])
        self._centres = np.array([row[1].centroid.coords[0] for row in outlines])
        self.said = np.array([tagged_levels(tags) or 0 for tags in self._tags])
        self._example = np.maximum(self.said, tallest)
        self._known = np.flatnonzero((self._example > 0) & (self._areas > 45.0))
        self._large = np.flatnonzero((self._example > 0) & (self._areas > 120.0))
        self._near_tree = cKDTree(self._centres[self._known]) if len(self._known) else None
        self._far_tree = cKDTree(self._centres[self._large]) if len(self._large) else None
        self._use_code = np.unique(np.array(uses), return_inverse=True)[1].ravel()
        reach = shapely.box(*(f(self._centres[:, k]) for f in (np.min, np.max) for k in (0, 1)))
        dense = self._areas.sum() / max(reach.area, 1.0) > 0.22
        # Old towns are dense as well: what tells them from a city are the footprints of their houses.
        houses = self._areas[self._areas > _HOUSE]
        large = len(houses) > 0 and float(np.median(houses)) > _TOWN_HOUSE
        self._usual = (5 if lon > -30 else 4) if dense and large else 3 if dense else 2
        self._slabs = np.array([_is_slab(row[1], self._tags[k]) for k, row in enumerate(outlines)])

    def _kind(self, k: int) -> str:
        return self._tags[k].get("building", "yes")

    def by_kind(self, k: int) -> int | None:
        """Storeys of what looks alike everywhere; None where what stands beside it counts."""
        kind = self._kind(k)
        usual = _KIND_LEVELS.get(kind)
        if kind_eaves(self._tags[k], self._uses[k], float(self._areas[k])) is not None:
            return usual or 1
        return usual if kind not in _YIELDING else None

    def by_what_is_near(self, k: int) -> tuple[int, str]:
        """Storeys by neighbours of its use, by its kind, by the area around or by the town, and which of these."""
        usual = _KIND_LEVELS.get(self._kind(k))
        if self._areas[k] < 45.0:
            estimate, rule = usual or 1, "kind"
        elif (neighbours := self._of_neighbours(k)) is not None:
            estimate, rule = neighbours, "neighbours"
        elif usual:
            estimate, rule = usual, "kind"
        elif (around := self._of_area(k)) is not None:
            estimate, rule = around, "area"
        else:
            estimate, rule = max(self._usual, _SLAB_LEVELS if self._slabs[k] else 1), "town"
        most = 2 if self._areas[k] < 90.0 else 3 if self._areas[k] < 140.0 else 12
        return max(min(estimate, most), 1), rule

    def _of_neighbours(self, k: int) -> int | None:
        """Storeys of those of the same use within 100 m, if there are two."""
        if self._near_tree is None:
            return None
        index = np.array(sorted(self._near_tree.query_ball_point(self._centres[k], _NEAR)), np.int64)
        others = self._known[index]
        others = others[self._use_code[others] == self._use_code[k]]
        if len(others) < 2:
            return None
        distance = np.hypot(*(self._centres[others] - self._centres[k]).T)
        areas, area = self._areas[others], self._areas[k]
        likeness = np.minimum(areas, area) / np.maximum(areas, area)
        return weighted_median(self._example[others], np.sqrt(likeness) / (1.0 + distance / 25.0))

    def _of_area(self, k: int) -> int | None:
        """Storeys of the nearest large houses of any use, if there are two."""
        if self._far_tree is None:
            return None
        distances, nearest = self._far_tree.query(self._centres[k], k=min(7, len(self._large)))
        pairs = zip(np.atleast_1d(distances).tolist(), np.atleast_1d(nearest).tolist(), strict=True)
        near = [int(self._example[self._large[i]]) for d, i in pairs if d < _REACH]
        return round(float(np.median(near))) if len(near) >= 2 else None


def _is_slab(outline: Polygon, tags: Mapping[str, str]) -> bool:
    """Return whether a house has the shape of a slab of flats: long, straight, as deep as two flats."""
    if tags.get("building", "yes") not in ("yes", "residential", "apartments"):
        return False
    box = shapely.minimum_rotated_rectangle(outline)
    if box.geom_type != "Polygon" or outline.area < 0.85 * box.area:
        return False
    sides = np.hypot(*np.diff(np.asarray(box.exterior.coords)[:3], axis=0).T)
    deep, long = float(sides.min()), float(sides.max())
    return _SLAB_DEEP[0] <= deep <= _SLAB_DEEP[1] and long >= max(2.8 * deep, _SLAB_LONG)


def weighted_median(values: NDArray[np.int64], weights: NDArray[np.float64]) -> int:
    """Return the value with half the weight on either side."""
    order = np.argsort(values, kind="stable")
    total = np.cumsum(weights[order])
    return int(values[order][np.searchsorted(total, 0.5 * total[-1])])
