"""Smooth heights along a network of lines: streets neither follow every wobble of an elevation model nor its steps."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import spsolve

Floats = NDArray[np.float64]


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
            cosine = ways @ ways.T
            for a in range(len(others)):
                met += [(others[a], node, others[b]) for b in range(a + 1, len(others)) if cosine[a, b] < -0.7]
        return np.concatenate([*triples, np.array(met, np.int64).reshape(-1, 3), np.zeros((0, 3), np.int64)])

    def levelled(self, wanted: Floats, weight: Floats, *, length: float, spacing: float) -> Floats:
        """Heights near the wanted ones that change their slope slowly.

        Parameters
        ----------
        wanted, weight
            Metres and how much they count, shape ``(n,)``; weight 0 leaves a point to its neighbours.
        length
            Bumps much shorter than this are smoothed away, metres.
        spacing
            As the network was cut with.

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
        middle = float(wanted.mean())
        matrix = (bending.T @ bending + pulling.T @ pulling + sparse.diags(weight**2 + 1e-9)).tocsc()
        return np.asarray(spsolve(matrix, weight**2 * (wanted - middle))) + middle
