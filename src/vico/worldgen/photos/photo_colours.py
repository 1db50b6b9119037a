"""Colours of a photographed mesh, looked up where rays met it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.geo.tiles3d import TileMesh
from vico.io.compiled import compiled

_AT_ONCE = 1 << 17  # triangles


class _Skin(NamedTuple):
    """The mesh that photos are looked up in: its points, triangles, texture coordinates and colours of points."""

    positions: NDArray[np.float64]
    triangles: NDArray[np.int32]
    uv: NDArray[np.float32]
    colour: NDArray[np.uint8]


class _Hits(NamedTuple):
    """Where rays met the mesh: the triangle, two barycentric weights, and the chart whose texel looked."""

    triangle: NDArray[np.int32]
    u: NDArray[np.float32]
    v: NDArray[np.float32]
    chart: NDArray[np.int64]


class PhotoColours:
    """The mesh's colours, ready to be looked up."""

    def __init__(self, mesh: TileMesh) -> None:
        self.positions = np.ascontiguousarray(mesh.positions, np.float64)
        self.triangles = np.ascontiguousarray(mesh.triangles, np.int32)
        self.uv = np.ascontiguousarray(mesh.uv, np.float32)
        self.colour = np.ascontiguousarray(mesh.colour, np.uint8)
        self.texture_of = np.asarray(mesh.texture_of, np.int32)
        self.textures = [np.ascontiguousarray(texture[..., :3], np.uint8) for texture in mesh.textures]
        self.normal = np.empty((len(self.triangles), 3))
        for first in range(0, len(self.triangles), _AT_ONCE):
            corners = self.positions[self.triangles[first : first + _AT_ONCE]]
            cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            length = np.linalg.norm(cross, axis=1, keepdims=True)
            self.normal[first : first + _AT_ONCE] = cross / np.maximum(length, 1e-12)

    def __call__(
        self,
        triangle: NDArray[np.int32],
        u: NDArray[np.float32],
        v: NDArray[np.float32],
        chart: NDArray[np.int64],
        right: NDArray[np.float64],
        up: NDArray[np.float64],
    ) -> NDArray[np.uint8]:
        """Colours at points of triangles, each averaged over a texel of its chart (sides by chart); ``(n, 3)``."""
        out = np.zeros((len(triangle), 3), np.uint8)
        hits, skin = _Hits(triangle, u, v, chart), _Skin(self.positions, self.triangles, self.uv, self.colour)
        which = self.texture_of[triangle]
        order = np.argsort(which, kind="stable")
        first = np.flatnonzero(np.diff(which[order], prepend=np.int32(-2)))
        white = np.full((1, 1, 3), 255, np.uint8)
        for start, stop in zip(first, [*first[1:], len(order)][: len(first)], strict=True):
            texture = self.textures[which[order[start]]] if which[order[start]] >= 0 else white
            _fetch(texture, order[start:stop], hits, right, up, skin, out)
        return out


@compiled(nogil=True)
def _fetch(texture, chosen, hits, rights, ups, skin, out):  # type: ignore[no-untyped-def]
    """Write the texture's colours at chosen hits, each averaged over a texel of its chart."""
    triangle, u, v, chart = hits.triangle, hits.u, hits.v, hits.chart
    positions, triangles, uv, colour = skin.positions, skin.triangles, skin.uv, skin.colour
    height, width = texture.shape[:2]
    total = np.zeros(3)
    for n in chosen:
        t = triangle[n]
        right, up = rights[chart[n]], ups[chart[n]]
        ia, ib, ic = triangles[t]
        a, b, c = positions[ia], positions[ib], positions[ic]
        wb, wc = u[n], v[n]
        wa = 1.0 - wb - wc
        # Barycentric weights change linearly over the texel: how far does it reach in the photo?
        rr = right[0] ** 2 + right[1] ** 2 + right[2] ** 2
        uu = up[0] ** 2 + up[1] ** 2 + up[2] ** 2
        bx = by = cx = cy = 0.0
        for k in range(3):
            bx += (b[k] - a[k]) * right[k] / rr
            by += (b[k] - a[k]) * up[k] / uu
            cx += (c[k] - a[k]) * right[k] / rr
            cy += (c[k] - a[k]) * up[k] / uu
        det = bx * cy - cx * by
        ua, va = uv[ia, 0] * width, uv[ia, 1] * height
        ub, vb = uv[ib, 0] * width - ua, uv[ib, 1] * height - va
        uc, vc = uv[ic, 0] * width - ua, uv[ic, 1] * height - va
        least = min(uv[ia, 0], uv[ia, 1], uv[ib, 0], uv[ib, 1], uv[ic, 0], uv[ic, 1])
        most = max(uv[ia, 0], uv[ia, 1], uv[ib, 0], uv[ib, 1], uv[ic, 0], uv[ic, 1])
        repeats = least < -0.01 or most > 1.01
        x, y = ua + wb * ub + wc * uc, va + wb * vb + wc * vc
        dxi = dyi = dxj = dyj = 0.0
        samples = 1
        if abs(det) > 1e-9:
            dxi, dyi = (cy * ub - by * uc) / det, (cy * vb - by * vc) / det
            dxj, dyj = (bx * uc - cx * ub) / det, (bx * vc - cx * vb) / det
            reach = max(np.sqrt(dxi * dxi + dyi * dyi), np.sqrt(dxj * dxj + dyj * dyj))
            samples = int(min(max(np.ceil(reach), 1.0), 4.0))
        total[:] = 0.0
        for j in range(samples):
            for i in range(samples):
                di, dj = (i + 0.5) / samples - 0.5, (j + 0.5) / samples - 0.5
                px, py = x + di * dxi + dj * dxj - 0.5, y + di * dyi + dj * dyj - 0.5
                if not repeats:
                    px, py = min(max(px, 0.0), width - 1.0), min(max(py, 0.0), height - 1.0)
                x0, y0 = int(np.floor(px)), int(np.floor(py))
                fx, fy = px - x0, py - y0
                if repeats:
                    x0, y0 = x0 % width, y0 % height
                    x1, y1 = (x0 + 1) % width, (y0 + 1) % height
                else:
                    x1, y1 = min(x0 + 1, width - 1), min(y0 + 1, height - 1)
                for k in range(3):
                    low = texture[y0, x0, k] * (1 - fx) + texture[y0, x1, k] * fx
                    high = texture[y1, x0, k] * (1 - fx) + texture[y1, x1, k] * fx
                    total[k] += low * (1 - fy) + high * fy
        for k in range(3):
            base = wa * colour[ia, k] + wb * colour[ib, k] + wc * colour[ic, k]
            value = total[k] / (samples * samples) * base / 255.0
            out[n, k] = np.uint8(min(max(value + 0.5, 0.0), 255.0))
