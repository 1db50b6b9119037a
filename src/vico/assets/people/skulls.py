"""Where the surface of a head is, for all that is worn on it."""

from __future__ import annotations

import math
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from vico.assets.people.lofts import BodyPart
from vico.io.compiled import compiled

_TURNS = np.linspace(0.0, 1.45, 30)


class Skull(Protocol):
    """Where the surface of a head is; `chin` is its height, `size` reaches to the crown, `axis` is its middle's x."""

    size: float
    chin: float
    axis: float

    def at(self, share: float, angle: float, lift: float = 0.0) -> NDArray[np.float64]:
        """Return a point at a height and an angle from straight ahead (to the left), lifted off the skin by a share."""


def face_depth(skull: Skull, share: float, aside: float) -> float:
    """Return how far ahead the face is at a height, at so many metres to either side."""
    line = np.array([skull.at(share, turn) for turn in _TURNS])
    return float(np.interp(abs(aside), np.maximum.accumulate(line[:, 1]), line[:, 0]))


class ScannedSkull:
    """The surface of a head, found by rays from its axis."""

    def __init__(self, head: BodyPart, eye: float) -> None:
        crown = float(head.vertices[:, 2].max())
        # Eyes are at 0.525 of the head's height, as on our own heads.
        self.size = (crown - eye) / 0.475
        self.chin = crown - self.size
        above = head.vertices[head.vertices[:, 2] > eye]
        self.axis = float(above[:, 0].min() + above[:, 0].max()) / 2
        self.shares, self.angles = np.linspace(0.12, 0.985, 44), np.linspace(-np.pi, np.pi, 73)
        heights = self.chin + self.shares * self.size
        self.radii = _leaving(head.vertices, head.triangles, self.axis, heights, self.angles)
        # Ears would make bumps in the hair: no radius beside them above that of the head over them.
        over = int(np.searchsorted(self.shares, 0.66))
        aside = (np.abs(self.angles) > 1.15) & (np.abs(self.angles) < 2.3)
        self.radii[:over, aside] = np.minimum(self.radii[:over, aside], self.radii[over, aside])

    def at(self, share: float, angle: float, lift: float = 0.0) -> NDArray[np.float64]:
        """Return a point at a height and an angle from straight ahead (to the left), lifted off the skin by a share."""
        turned = (angle + np.pi) % (2 * np.pi) - np.pi
        row = (share - self.shares[0]) / (self.shares[1] - self.shares[0])
        column = (turned + np.pi) / (self.angles[1] - self.angles[0])
        row, column = min(max(row, 0.0), len(self.shares) - 1.001), min(max(column, 0.0), len(self.angles) - 1.001)
        k, i = int(row), int(column)
        u, v = row - k, column - i
        radius = (self.radii[k, i] * (1 - v) + self.radii[k, i + 1] * v) * (1 - u)
        radius += (self.radii[k + 1, i] * (1 - v) + self.radii[k + 1, i + 1] * v) * u
        if share > self.shares[-1]:
            radius *= (1 - share) / (1 - self.shares[-1])
        up = min(max((share - 0.60) / 0.40, 0.0), 1.0)
        out = radius + lift * self.size * math.sqrt(1 - up * up)
        height = self.chin + (share + lift * up) * self.size
        return np.array([self.axis + out * math.cos(angle), out * math.sin(angle), height])


@compiled
def _leaving(
    points: NDArray[Any], triangles: NDArray[Any], axis: float, heights: NDArray[Any], angles: NDArray[Any]
) -> NDArray[Any]:
    """How far from the axis the surface is left for good, by level and angle (Moeller and Trumbore's ray test)."""
    radii = np.zeros((len(heights), len(angles)))
    for k in range(len(heights)):
        for i in range(len(angles)):
            wx, wy = np.cos(angles[i]), np.sin(angles[i])
            for f in range(len(triangles)):
                a, b, c = points[triangles[f, 0]], points[triangles[f, 1]], points[triangles[f, 2]]
                if min(a[2], b[2], c[2]) > heights[k] or max(a[2], b[2], c[2]) < heights[k]:
                    continue
                e1x, e1y, e1z = b[0] - a[0], b[1] - a[1], b[2] - a[2]
                e2x, e2y, e2z = c[0] - a[0], c[1] - a[1], c[2] - a[2]
                px, py, pz = wy * e2z, -wx * e2z, wx * e2y - wy * e2x
                det = e1x * px + e1y * py + e1z * pz
                if abs(det) < 1e-12:
                    continue
                tx, ty, tz = axis - a[0], -a[1], heights[k] - a[2]
                u = (tx * px + ty * py + tz * pz) / det
                qx, qy, qz = ty * e1z - tz * e1y, tz * e1x - tx * e1z, tx * e1y - ty * e1x
                v = (wx * qx + wy * qy) / det
                if u > -1e-6 and v > -1e-6 and u + v < 1 + 1e-6:
                    radii[k, i] = max(radii[k, i], (e2x * qx + e2y * qy + e2z * qz) / det)
        # A ray may slip through an eye: take the level's middle radius there.
        seen = np.median(radii[k])
        for i in range(len(angles)):
            if radii[k, i] <= 0:
                radii[k, i] = seen
    return radii
