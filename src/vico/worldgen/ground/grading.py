"""The ground as people made it: level streets, still water, flat pitches, kerbs and quays.

An elevation model knows hills, not streets. Carriageways are level across and smooth along; what lies beside them
follows within a few metres, further away the hill is as it was. Water lies lower than its banks.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import cKDTree
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay
from vico.geo.osm import OsmData
from vico.geometry import arc_lengths, distances, points_along
from vico.world.heights import HeightField
from vico.worldgen.facts.expendable import expendable
from vico.worldgen.facts.ground_kinds import water_pieces
from vico.worldgen.facts.levels import ON_FOOT, Passage
from vico.worldgen.facts.site import SiteFacts
from vico.worldgen.facts.streets import StreetPolygons, carriageway_width
from vico.worldgen.facts.tags import is_bridge, on_the_ground
from vico.worldgen.ground.kerbs import steps_field
from vico.worldgen.ground.profiles import Network
from vico.worldgen.ground.waters import open_water

Floats = NDArray[np.float64]

_CELL = 2.0
_SPACING = 5.0
_SMOOTH = 40.0  # metres: shorter bumps are not a street's
_SHOULDER = 3.5  # metres beside a carriageway that lie level with it
_TERRACE, _STEEPEST = 0.3, 0.15  # metres and slope that heights along one street differ by at most
_WALL_ROOM = 2.0  # metres between two streets for a wall that holds the upper one
_HIGH, _RAMP = 12.0, 4.0  # how much a deck's height over a street counts, and its ramps', where the ground counts 1
_BANK = 8.0  # metres over which the ground goes back to the elevation model's
_STEP_CELL, _STEP_CELL_LARGE, _LARGE = 0.5, 1.0, 700.0


def graded(height: HeightField, site: SiteFacts, streets: StreetPolygons) -> HeightField:
    """Grade the ground to the streets and waters of a map.

    Parameters
    ----------
    height
        The ground as an elevation model has it; its `steps` are not kept.
    site
        The map and its facts.
    streets
        `road_polygons` of it: kerbs come to lie at the borders of these.

    Returns
    -------
    HeightField
        Over the same square. Level ground stays level but for kerbs, banks and the ramps of bridges over streets.
    """
    base = _levelled(replace(height, steps=None), site)
    window = shapely.box(-height.half, -height.half, height.half, height.half)
    waters = open_water(site, base, water_pieces(site, streets, window))
    cell = _STEP_CELL if height.half < _LARGE else _STEP_CELL_LARGE
    return replace(base, steps=steps_field(base, streets, waters, cell=cell))


def is_level(height: HeightField) -> bool:
    """Whether the smooth ground has one height."""
    return height.heights.size == 4 or float(np.ptp(height.heights)) < 0.01


def _levelled(height: HeightField, site: SiteFacts) -> HeightField:
    """Return the smooth ground with its streets, stairs and pitches."""
    osm, above = site.osm, site.levels.above
    if is_level(height) and not above:
        return height
    lines, weights, widths, decks, slopes = _lines(osm, above)
    if not lines:
        return height
    network = Network.of(lines, spacing=_SPACING)
    n = len(network.points)
    wanted, weight, wide = height(network.points), np.zeros(n), np.zeros(n)
    covers = np.zeros(n, bool)
    for row, own, width, deck in zip(network.rows, weights, widths, decks, strict=True):
        weight[row] = np.maximum(weight[row], own)
        wide[row] = np.maximum(wide[row], width)
        if not deck:
            covers[row] = True
    for row, deck in zip(network.rows, decks, strict=True):
        if deck and len(row):
            weight[[row[0], row[-1]]] = np.maximum(weight[[row[0], row[-1]]], 1.0)
    streets_alone = [row for row, deck, width in zip(network.rows, decks, widths, strict=True) if not deck and width]
    beside = network.abreast(wide, streets_alone, _WALL_ROOM)
    found = network.levelled(wanted, weight, length=_SMOOTH, spacing=_SPACING, abreast=beside)
    needs = site.levels.passages
    if needs:
        rows = [row for row, deck in zip(network.rows, decks, strict=True) if deck]
        high, least = raised(network.points, np.unique(np.concatenate(rows)), found, needs, height)
        bound = network.ramps(high, least, slopes, found)
        weight[high], wanted[high] = _HIGH, least
        for _ in range(2):
            found = network.levelled(wanted, weight, length=_SMOOTH, spacing=_SPACING, abreast=beside)
            low = found < bound - 0.02
            wanted[low], weight[low] = bound[low], np.maximum(weight[low], _RAMP)
    if is_level(height) and float(np.abs(found - height(network.points))[covers].max(initial=0.0)) < 0.02:
        return height
    return _pitches(_blended(height, network, found, wide, covers), osm)


def raised(
    points: Floats, on_deck: NDArray[np.int64], found: Floats, needs: Sequence[Passage], ground: HeightField
) -> tuple[NDArray[np.int64], Floats]:
    """Points of decks that lie too low over a street, and the height each needs."""
    least: dict[int, float] = {}
    for need in needs:
        near = on_deck[distances(points[on_deck], need.place) < need.reach]
        if not len(near):
            near = on_deck[[int(distances(points[on_deck], need.place).argmin())]]
        height = float(ground.smooth(np.array(need.place))) + need.clearance
        for k in near.tolist():
            if found[k] < height:
                least[k] = max(height, least.get(k, height))
    return np.array(list(least), np.int64), np.array(list(least.values()), np.float64)


def ramp_slope(tags: Mapping[str, str]) -> float:
    """Return the steepest slope of a way where the ground does not ask for more: streets climb less than stairs."""
    kind = tags.get("highway")
    if kind is None:
        return 0.03
    return 0.6 if kind == "steps" else 0.08 if kind in ON_FOOT else 0.055


def _lines(
    osm: OsmData, above: frozenset[int]
) -> tuple[list[Floats], list[float], list[float], list[bool], list[float]]:
    """Lines of streets, stairs and decks.

    How much each trusts the ground, half its width, whether it is a deck, the steepest slope of its ramps.
    """
    slopes: list[float] = []
    lines: list[Floats] = []
    weights: list[float] = []
    widths: list[float] = []
    decks: list[bool] = []
    for way in osm.ways:
        tags, kind = way.tags, way.tags.get("highway")
        if way.id in above:
            own, width = 0.0, 0.0
        elif kind is None or not on_the_ground(tags) or (way.closed and tags.get("area") == "yes"):
            continue
        elif kind == "steps":
            own, width = 0.05, 1.6
        elif kind in ON_FOOT or kind in ("track", "platform", "proposed", "construction"):
            if not is_bridge(tags):
                continue
            own, width = 0.01, 1.6
        else:
            own, width = 1.0, carriageway_width(tags) / 2
            if is_bridge(tags):
                own = 0.01
            elif kind == "service":
                own = 0.6
        lines.append(way.line)
        weights.append(own)
        widths.append(width)
        decks.append(way.id in above)
        slopes.append(ramp_slope(tags))
    return lines, weights, widths, decks, slopes


def _blended(
    height: HeightField, network: Network, found: Floats, wide: Floats, covers: NDArray[np.bool_]
) -> HeightField:
    """Blend the network's heights into the field, in and beside its streets."""
    count = max(math.ceil(2 * height.half / _CELL), height.heights.shape[0] - 1)
    axis = np.linspace(-height.half, height.half, count + 1)
    at = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    ground = height(at)
    sample, level, half_width = _samples(network, found, wide, covers)
    reach = float(half_width.max(initial=0.0)) + _SHOULDER + _BANK
    near = min(14, len(sample))
    away, index = cKDTree(sample).query(at, k=near, distance_upper_bound=reach)
    away, index = away.reshape(len(at), near), index.reshape(len(at), near)
    beside = np.flatnonzero(np.isfinite(away[:, 0]))
    away, index = away[beside], np.minimum(index[beside], len(sample) - 1)
    # Of several streets the one whose kerb is nearest counts most; symmetric samples of one give its height abeam.
    outside = np.maximum(away - half_width[index], 0.0)
    share = (away / (half_width[index] + 1.5)) ** 2 + 4.0 * outside**2
    best = index[np.arange(len(index)), share.argmin(axis=1)][:, None]
    share = 1.0 / (share - share.min(axis=1, keepdims=True) + 0.06) ** 2
    # Streets above and below each other on a hillside keep their own heights, up to the walls between them.
    apart = np.hypot(*(sample[index] - sample[best]).transpose(2, 0, 1))
    share[~np.isfinite(away) | (np.abs(level[index] - level[best]) > _TERRACE + _STEEPEST * apart)] = 0.0
    street = (share * level[index]).sum(axis=1) / share.sum(axis=1)
    out = np.min(np.where(np.isfinite(away), away - half_width[index], np.inf), axis=1) - _SHOULDER
    part = np.clip(out / _BANK, 0.0, 1.0)
    part = part * part * (3.0 - 2.0 * part)
    ground[beside] += (1.0 - part) * (street - ground[beside])
    # Creases would cost triangles and show in the light, but a street stays as it is beside a terrace's wall.
    even = ndimage.gaussian_filter(ground.reshape(count + 1, count + 1), 0.8, mode="nearest")
    firm = np.clip(1.0 - (out + _SHOULDER - 0.5) / 1.5, 0.0, 1.0)
    even.reshape(-1)[beside] += firm * (ground[beside] - even.reshape(-1)[beside])
    return HeightField(even.astype(np.float32), height.half)


def _samples(network: Network, found: Floats, wide: Floats, covers: NDArray[np.bool_]) -> tuple[Floats, Floats, Floats]:
    """Points every metre and a half along the streets: place, height, half the street's width."""
    places, levels, widths = [], [], []
    for row in network.rows:
        if len(row) < 2 or not covers[row].all():
            continue
        line = network.points[row]
        along = arc_lengths(line)
        steps = np.linspace(0.0, along[-1], max(math.ceil(along[-1] / 1.5), 1) + 1)
        own = float(np.median(wide[row]))
        places.append(points_along(line, steps, along))
        # Within the carriageway it comes from or leads to, a side street lies as that one does.
        first, last = (float(wide[k]) if wide[k] > own else 0.0 for k in (row[0], row[-1]))
        if first + last > 0.8 * along[-1]:
            first, last = (0.8 * along[-1] * v / (first + last) for v in (first, last))
        rise = np.clip((steps - first) / max(along[-1] - first - last, 1e-9), 0.0, 1.0) * along[-1]
        levels.append(np.interp(rise, along, found[row]))
        widths.append(np.full(len(steps), own))
    if not places:
        return np.zeros((0, 2)), np.zeros(0), np.zeros(0)
    return np.concatenate(places), np.concatenate(levels), np.concatenate(widths)


def _pitches(height: HeightField, osm: OsmData) -> HeightField:
    """Sports pitches as planes that hardly tilt."""
    heights = height.heights.astype(np.float64)
    for area in osm.areas:
        if area.tags.get("leisure") == "pitch" and 60.0 < area.polygon.area < 20_000.0:
            with expendable(area.id):
                _lay_pitch(heights, height, area.polygon)
    return replace(height, heights=heights.astype(np.float32))


def _lay_pitch(heights: Floats, height: HeightField, pitch: BaseGeometry) -> None:
    """Level `heights`, which lie as those of `height` do, within a pitch and a few metres about it."""
    n, cell = len(heights), height.cell
    west, south, east, north = overlay.buffer(pitch, 10.0).bounds
    i0, i1 = (min(max(round((v + height.half) / cell), 0), n - 1) for v in (west, east))
    j0, j1 = (min(max(round((v + height.half) / cell), 0), n - 1) for v in (south, north))
    if i1 - i0 < 2 or j1 - j0 < 2:
        return
    x, y = np.meshgrid(np.arange(i0, i1 + 1) * cell - height.half, np.arange(j0, j1 + 1) * cell - height.half)
    away = shapely.distance(pitch, shapely.points(x, y))
    view = heights[j0 : j1 + 1, i0 : i1 + 1]
    within = away <= cell
    design = np.stack([x[within] - x.mean(), y[within] - y.mean(), np.ones(int(within.sum()))], axis=1)
    if len(design) < 3:
        return
    plane = np.linalg.lstsq(design, view[within], rcond=None)[0]
    tilt = float(np.hypot(plane[0], plane[1]))
    plane[:2] *= min(1.0, 0.015 / max(tilt, 1e-9))
    part = np.clip((away - cell) / 6.0, 0.0, 1.0)
    part = part * part * (3.0 - 2.0 * part)
    target = plane[0] * (x - x.mean()) + plane[1] * (y - y.mean()) + plane[2]
    # To a tenth of a millimetre: the last bits of a solver differ from processor to processor.
    view[:] = np.round(view + (1.0 - part) * (target - view), 4)
