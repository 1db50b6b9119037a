"""The ground as people made it: level streets, still water, flat pitches, kerbs and quays.

An elevation model knows hills, not streets. Carriageways are level across and smooth along, with smooth heights along
the whole network of lines: streets follow neither every wobble of an elevation model nor its steps. What lies beside
them follows within a few metres, further away the hill is as it was. Water lies lower than its banks.
"""

from __future__ import annotations

import heapq
import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy import ndimage, sparse
from scipy.sparse.linalg import spsolve
from scipy.spatial import cKDTree
from shapely.geometry.base import BaseGeometry

from vico.exact import apply_matrix
from vico.geo import overlay
from vico.geo.osm import OsmData
from vico.geometry import arc_lengths, distances, points_along
from vico.world.heights import HeightField
from vico.worldgen.facts.fault_isolation import drop_on_failure
from vico.worldgen.facts.land_cover import water_pieces
from vico.worldgen.facts.site import ON_FOOT, Passage, SiteFacts, is_bridge, on_the_ground
from vico.worldgen.facts.streets import StreetPolygons, carriageway_width
from vico.worldgen.ground.kerbs_and_banks import open_water, steps_field

Floats = NDArray[np.float64]

_TIE = 3.0  # how much streets side by side keep to each other's height, where the ground counts 1


@dataclass(frozen=True)
class Abreast:
    """Points that lie beside a piece of another line: the point, the piece's ends, and where along it, 0..1."""

    point: NDArray[np.int64]
    piece: NDArray[np.int64]
    share: Floats

    @classmethod
    def none(cls) -> Abreast:
        """No such points."""
        return cls(np.zeros(0, np.int64), np.zeros((0, 2), np.int64), np.zeros(0))

    def rows(self, n: int) -> sparse.csr_matrix:
        """Differences in height, as rows over `n` points."""
        k = np.arange(len(self.point))
        values = _TIE * np.concatenate([np.ones(len(k)), self.share - 1.0, -self.share])
        columns = np.concatenate([self.point, self.piece[:, 0], self.piece[:, 1]])
        return sparse.csr_matrix((values, (np.tile(k, 3), columns)), shape=(len(k), n))


@dataclass(frozen=True)
class Network:
    """Lines cut into short pieces; points that lines share are one.

    Attributes
    ----------
    points
        Metres, shape ``(n, 2)``.
    rows
        Numbers of each line's points, in its order.
    """

    points: Floats
    rows: list[NDArray[np.int64]]

    @classmethod
    def of(cls, lines: Sequence[Floats], *, spacing: float) -> Network:
        """Cut lines; corners within a centimetre of each other are the same point."""
        place: dict[tuple[int, int], int] = {}
        points: list[tuple[float, float]] = []
        rows: list[NDArray[np.int64]] = []
        for line in lines:
            row: list[int] = []
            for k, (x, y) in enumerate(line.tolist()):
                key = (round(x * 100), round(y * 100))
                if key not in place:
                    place[key] = len(points)
                    points.append((x, y))
                number = place[key]
                if row and number == row[-1]:
                    continue
                if row:
                    x0, y0 = line[k - 1].tolist()
                    pieces = int(np.ceil(np.hypot(x - x0, y - y0) / spacing))
                    for piece in range(1, pieces):
                        row.append(len(points))
                        points.append((x0 + (x - x0) * piece / pieces, y0 + (y - y0) * piece / pieces))
                row.append(number)
            rows.append(np.array(row, np.int64))
        return cls(np.array(points, np.float64).reshape(-1, 2), rows)

    def _bends(self) -> NDArray[np.int64]:
        """Triples of points a smooth line leads through: along each line, and straight on where lines meet."""
        triples = [np.stack([row[:-2], row[1:-1], row[2:]], axis=1) for row in self.rows if len(row) > 2]
        arms: dict[int, list[int]] = defaultdict(list)
        for row in self.rows:
            if len(row) > 1:
                arms[int(row[0])].append(int(row[1]))
                arms[int(row[-1])].append(int(row[-2]))
        met: list[tuple[int, int, int]] = []
        for node, others in arms.items():
            ways = self.points[others] - self.points[node]
            ways = ways / np.maximum(np.linalg.norm(ways, axis=1, keepdims=True), 1e-9)
            cosine = apply_matrix(ways, ways)
            for a in range(len(others)):
                met += [(others[a], node, others[b]) for b in range(a + 1, len(others)) if cosine[a, b] < -0.7]
        return np.concatenate([*triples, np.array(met, np.int64).reshape(-1, 3), np.zeros((0, 3), np.int64)])

    def abreast(self, wide: Floats, chosen: Sequence[NDArray[np.int64]], gap: float) -> Abreast:
        """Find where lines run side by side, with no room for a wall between what lies along them.

        Parameters
        ----------
        wide
            Half the width of what lies along the lines, at each point, metres.
        chosen
            The lines (of `rows`) that count.
        gap
            Metres between the two for a wall.
        """
        pairs = [np.stack([row[:-1], row[1:]], axis=1) for row in chosen if len(row) > 1]
        if not pairs:
            return Abreast.none()
        owner = np.repeat(np.arange(len(pairs)), [len(own) for own in pairs])
        pair = np.concatenate(pairs)
        tree = shapely.STRtree(shapely.linestrings(self.points[pair]))
        point = np.concatenate([own[:, 0] for own in pairs])
        reach = wide[point] + float(wide.max(initial=0.0)) + gap
        row, other = tree.query(shapely.points(self.points[point]), predicate="dwithin", distance=reach)
        a, b, c = self.points[point[row]], self.points[pair[other, 0]], self.points[pair[other, 1]]
        along = c - b
        share = ((a - b) * along).sum(axis=1) / np.maximum((along**2).sum(axis=1), 1e-9)
        off = np.hypot(*(a - b - along * np.clip(share, 0.0, 1.0)[:, None]).T)
        mine = self.points[pair[row, 1]] - a
        cosine = np.abs((mine * along).sum(axis=1)) / np.maximum(np.hypot(*mine.T) * np.hypot(*along.T), 1e-9)
        kept = (owner[row] != owner[other]) & (share >= 0.0) & (share <= 1.0) & (cosine > 0.8)
        kept &= (off < wide[point[row]] + wide[pair[other, 0]] + gap) & (pair[other] != point[row][:, None]).all(axis=1)
        return Abreast(point[row[kept]], pair[other[kept]], share[kept])

    def ramps(self, high: NDArray[np.int64], least: Floats, slopes: Sequence[float], ground: Floats) -> Floats:
        """How high points must lie at least so that high ones can be reached on gentle slopes.

        Parameters
        ----------
        high, least
            Points that must be high, and their heights, metres.
        slopes
            Steepest slope of each line (of `rows`).
        ground
            Heights where ramps end, metres, shape ``(n,)``.

        Returns
        -------
        ndarray
            Metres, shape ``(n,)``; minus infinity where no ramp is needed.
        """
        beside: dict[int, list[tuple[int, float]]] = defaultdict(list)
        for row, slope in zip(self.rows, slopes, strict=True):
            drops = slope * np.hypot(*np.diff(self.points[row], axis=0).T) if len(row) > 1 else np.zeros(0)
            for a, b, drop in zip(row[:-1].tolist(), row[1:].tolist(), drops.tolist(), strict=True):
                beside[a].append((b, drop))
                beside[b].append((a, drop))
        found = np.full(len(self.points), -np.inf)
        heap = [(-height, k) for k, height in zip(high.tolist(), least.tolist(), strict=True)]
        heapq.heapify(heap)
        while heap:
            height, k = heapq.heappop(heap)
            if -height <= found[k]:
                continue
            found[k] = -height
            for other, drop in beside[k]:
                lower = -height - drop
                if lower > ground[other] and lower > found[other]:
                    heapq.heappush(heap, (-lower, other))
        return found

    def fit_heights(
        self, wanted: Floats, weight: Floats, *, length: float, spacing: float, abreast: Abreast | None = None
    ) -> Floats:
        """Heights near the wanted ones that change their slope slowly.

        Parameters
        ----------
        wanted, weight
            Metres and how much they count, shape ``(n,)``; weight 0 leaves a point to its neighbours.
        length
            Bumps much shorter than this are smoothed away, metres.
        spacing
            As the network was cut with.
        abreast
            Places that come to lie as high as each other.

        Returns
        -------
        ndarray
            Metres, shape ``(n,)``.

        Notes
        -----
        Least squares: the bending of a beam on springs, whose characteristic length is `length`.
        """
        n = len(self.points)
        if n == 0:
            return wanted
        bends = self._bends()
        stiff = (length / spacing) ** 2 * spacing
        before = np.maximum(np.linalg.norm(self.points[bends[:, 1]] - self.points[bends[:, 0]], axis=1), 0.3)
        after = np.maximum(np.linalg.norm(self.points[bends[:, 2]] - self.points[bends[:, 1]], axis=1), 0.3)
        m = len(bends)
        bending = sparse.csr_matrix(
            (
                stiff * np.concatenate([1 / before, -1 / before - 1 / after, 1 / after]),
                (np.tile(np.arange(m), 3), np.concatenate([bends[:, 0], bends[:, 1], bends[:, 2]])),
            ),
            shape=(m, n),
        )
        pairs = np.concatenate([np.stack([row[:-1], row[1:]], axis=1) for row in self.rows if len(row) > 1])
        apart = np.maximum(np.linalg.norm(self.points[pairs[:, 1]] - self.points[pairs[:, 0]], axis=1), 0.3)
        tension = 0.3 * spacing / apart
        k = len(pairs)
        pulling = sparse.csr_matrix(
            (
                np.concatenate([-tension, tension]),
                (np.tile(np.arange(k), 2), np.concatenate([pairs[:, 0], pairs[:, 1]])),
            ),
            shape=(k, n),
        )
        tied = (abreast or Abreast.none()).rows(n)
        middle = float(wanted.mean())
        matrix = (bending.T @ bending + pulling.T @ pulling + tied.T @ tied + sparse.diags(weight**2 + 1e-9)).tocsc()
        # To a tenth of a millimetre: the last bits of a solver differ from processor to processor.
        return np.round(np.asarray(spsolve(matrix, weight**2 * (wanted - middle))) + middle, 4)


_CELL = 2.0
_SPACING = 5.0
_SMOOTH = 40.0  # metres: shorter bumps are not a street's
_SHOULDER = 3.5  # metres beside a carriageway that lie level with it
_TERRACE = 0.3  # metres that heights along one street differ by at most
_STEEPEST = 0.15  # slope that heights along one street differ by at most
_WALL_ROOM = 2.0  # metres between two streets for a wall that holds the upper one
_HIGH = 12.0  # weight of a deck's height over a street, where the ground's is 1
_RAMP = 4.0  # weight of its ramps' heights
_BANK = 8.0  # metres over which the ground goes back to the elevation model's
_STEP_CELL = 0.5  # metres, cells of the field of steps
_STEP_CELL_LARGE = 1.0  # and in large places
_LARGE = 700.0  # metres, half the side from which a place is large


def grade_ground(height: HeightField, site: SiteFacts, streets: StreetPolygons) -> HeightField:
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
    base = _ground_with_streets(replace(height, steps=None), site)
    window = shapely.box(-height.half, -height.half, height.half, height.half)
    waters = open_water(site, base, water_pieces(site, streets, window))
    cell = _STEP_CELL if height.half < _LARGE else _STEP_CELL_LARGE
    return replace(base, steps=steps_field(base, streets, waters, cell=cell))


def is_level(height: HeightField) -> bool:
    """Whether the smooth ground has one height."""
    return height.heights.size == 4 or float(np.ptp(height.heights)) < 0.01


def _ground_with_streets(height: HeightField, site: SiteFacts) -> HeightField:
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
    found = network.fit_heights(wanted, weight, length=_SMOOTH, spacing=_SPACING, abreast=beside)
    needs = site.levels.passages
    if needs:
        rows = [row for row, deck in zip(network.rows, decks, strict=True) if deck]
        high, least = deck_clearance_constraints(network.points, np.unique(np.concatenate(rows)), found, needs, height)
        bound = network.ramps(high, least, slopes, found)
        weight[high], wanted[high] = _HIGH, least
        for _ in range(2):
            found = network.fit_heights(wanted, weight, length=_SMOOTH, spacing=_SPACING, abreast=beside)
            low = found < bound - 0.02
            wanted[low], weight[low] = bound[low], np.maximum(weight[low], _RAMP)
    if is_level(height) and float(np.abs(found - height(network.points))[covers].max(initial=0.0)) < 0.02:
        return height
    return _pitches(_blend_network(height, network, found, wide, covers), osm)


def deck_clearance_constraints(
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


def _blend_network(
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
            with drop_on_failure(area.id):
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
