"""Smooth heights along a network of lines: streets neither follow every wobble of an elevation model nor its steps."""

from __future__ import annotations

import heapq
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import spsolve

from vico.exact import apply_matrix

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

    def levelled(
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
