"""Photos from a photogrammetry mesh onto the charts of clean buildings, by casting rays inside a cage.

From each texel's centre a ray starts outside, a cage's breadth out along the normal, and looks inwards; what it meets
first, if it faces the same way and lies within the cage, gives the colour. Where that fails, or the thing stands off
the wall (a tree, a car), a second ray looks outwards from behind the wall. A coarse bake comes first: it tells which
pieces the photos cover at all, how far the photographed wall stands from the mapped one, and what colours it has.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter

from vico.errors import EmptyInputError, InputError
from vico.geo.tiles3d import TileMesh
from vico.io.compiled import compiled
from vico.threads import in_order
from vico.world.mesh import Surface
from vico.worldgen.facts.ray_casting import RayCaster
from vico.worldgen.photos.atlas import Atlas, coverage, unwrap

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
def _fetch(texture, chosen, hits, rights, ups, skin, out):
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


_BATCH = 1 << 17  # texels at a time: about 30 MB of temporaries a thread
_COARSE = 0.5  # metres
_AGREES = 0.4  # least cosine between the normals of wall and photographed surface
_MELTED = 0.75  # below this cosine it may be an edge that photogrammetry has rounded off,
_EDGE = 1.2  # metres: if it lies so near to what agrees better
_STANDS_OFF = 0.6  # metres out of the photographed wall from which a thing is no longer part of it
_BEHIND = 0.9  # metres behind the photographed wall from which the second ray starts
_LOW = 2.6  # metres above a wall's foot up to which what stands off it is a car or a person
_FOOT = 1.5  # metres above a wall's foot up to which photogrammetry rounds it off into the ground
_LEANS = 0.3  # how much more it looks up there than the wall does (z of the normals): it shows the ground's colours
_GREEN = 26.0  # excess green (2g - r - b) of leaves
_GREENER = 18.0  # how much more it is than the wall's own
_DARK = 14.0  # luminance of holes in the photographs
_DARKER = 0.15  # their share of the wall's own
_FRINGE = 2  # texels around leaves that they still colour

Progress = Callable[[int, int], None]
_Batch = tuple[int, NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]


@dataclass(frozen=True)
class BakeResult:
    """Result of a bake.

    Attributes
    ----------
    walls, roofs
        The layers; pieces that photos cover are on ``atlas_K`` materials, all others as they were.
    atlas
        Their charts; texels no photo reached are inside but not known.
    coverage
        Share of each entity's surface that photos cover, chosen or not.
    pieces
        Plane pieces there are; the atlas has charts of those covered well enough.
    rays
        Rays that were cast.
    """

    walls: list[Surface]
    roofs: list[Surface]
    atlas: Atlas
    coverage: dict[int, float]
    pieces: int
    rays: int


@dataclass(frozen=True)
class _Expected:
    """Estimates of the coarse bake for each chart: offset = a + b i + c j, its colours, and whether it is a wall."""

    offset: NDArray[np.float64]
    luminance: NDArray[np.float64]
    green: NDArray[np.float64]

    @classmethod
    def nothing(cls, count: int) -> _Expected:
        """No expectation: offsets about zero, no colour is odd."""
        return cls(np.zeros((count, 3)), np.zeros(count), np.full(count, np.inf))


def bake(
    walls: Sequence[Surface],
    roofs: Sequence[Surface],
    mesh: TileMesh,
    *,
    texel: float = 0.10,
    cage: float = 2.0,
    least: float = 0.35,
    page: int = 4096,
    progress: Progress | None = None,
) -> BakeResult:
    """Paint walls and roofs with the colours of a photogrammetry mesh.

    Parameters
    ----------
    walls, roofs
        The layers of clean buildings, ENU metres.
    mesh
        What was photographed, in the same frame.
    texel
        Side of a texel, metres.
    cage
        How far the photographed surface may stand from the mapped one, metres.
    least
        Share of a plane piece that photos must cover; pieces below keep their procedural facade.
    page
        Side of the atlas pages, pixels.
    progress
        Called with the texels done and the texels there are.

    Returns
    -------
    Baked
        Layers and atlas, with the texels that no photo reached left unknown; equal inputs give equal bytes.

    Raises
    ------
    EmptyInputError
        If the mesh has no triangles.
    InputError
        If `cage` or `least` can't be used.
    MissingExtraError
        If embreex is not installed.

    Notes
    -----
    Paper, appendix A.1 (texture transfer by caged baking).
    """
    if not 0.05 <= cage <= 20.0:
        raise InputError(f"baking: a cage of {cage:g} m; it must lie within 0.05..20 m")
    if not 0.0 <= least <= 1.0:
        raise InputError(f"baking: {least:g} as least coverage; it must lie within 0..1")
    if not len(mesh.triangles):
        raise EmptyInputError("baking: the tile mesh has no triangles; give one that covers the place")
    sight = RayCaster(mesh.positions, mesh.triangles)
    photos = PhotoColours(mesh)
    coarse = unwrap(walls, roofs, texel=max(_COARSE, texel), page=page)[2]
    offsets: list[NDArray[np.float32]] = [np.full(known.shape, np.nan, np.float32) for known in coarse.known]
    rays = _paint(coarse, _Expected.nothing(len(coarse.charts)), sight, photos, cage, offsets=offsets)
    shares = coverage(coarse)
    pieces = coarse.pieces
    expected = _expectations(coarse, offsets, cage)
    known: dict[int, int] = {}
    inside: dict[int, int] = {}
    for chart in coarse.charts:
        known[chart.entity] = known.get(chart.entity, 0) + int(np.count_nonzero(coarse.known[chart.page][chart.box]))
        inside[chart.entity] = inside.get(chart.entity, 0) + int(np.count_nonzero(coarse.inside[chart.page][chart.box]))
    by_entity = {entity: known[entity] / max(inside[entity], 1) for entity in sorted(known)}
    patches = np.array([chart.patch for chart in coarse.charts], np.int64)
    wanted = np.zeros(pieces, np.bool_)
    wanted[patches[(shares >= least) & (shares > 0)]] = True
    del offsets
    new_walls, new_roofs, atlas = unwrap(walls, roofs, texel=texel, page=page, wanted=wanted)
    chart_of = np.zeros(pieces, np.int64)
    chart_of[patches] = np.arange(len(patches))
    old = chart_of[[chart.patch for chart in atlas.charts]]
    # An offset's constant stays, its slopes change with the size of a texel.
    ratios = [
        np.linalg.norm(c.right) / np.linalg.norm(coarse.charts[o].right) for o, c in zip(old, atlas.charts, strict=True)
    ]
    scale = np.array([(1.0, float(ratio), float(ratio)) for ratio in ratios]).reshape(-1, 3)
    fine = _Expected(expected.offset[old] * scale, expected.luminance[old], expected.green[old])
    rays += _paint(atlas, fine, sight, photos, cage, progress=progress)
    return BakeResult(new_walls, new_roofs, atlas, by_entity, pieces, rays)


def _batches(atlas: Atlas) -> Iterator[_Batch]:
    """Texels inside faces, page by page: page, chart, column and row in the chart."""
    charts: list[NDArray[np.int64]] = []
    columns: list[NDArray[np.int64]] = []
    rows: list[NDArray[np.int64]] = []
    held = 0
    by_page = sorted(range(len(atlas.charts)), key=lambda k: (atlas.charts[k].page, k))
    for position, k in enumerate(by_page):
        chart = atlas.charts[k]
        band = max(_BATCH // chart.width, 1)
        inside = atlas.inside[chart.page][chart.box]
        for low in range(0, chart.height, band):
            row, column = np.nonzero(inside[low : low + band])
            charts.append(np.full(len(row), k, np.int64))
            columns.append(column)
            rows.append(row + low)
            held += len(row)
            if held >= _BATCH:
                yield chart.page, np.concatenate(charts), np.concatenate(columns), np.concatenate(rows)
                charts, columns, rows, held = [], [], [], 0
        last = position + 1 == len(by_page) or atlas.charts[by_page[position + 1]].page != chart.page
        if last and held:
            yield chart.page, np.concatenate(charts), np.concatenate(columns), np.concatenate(rows)
            charts, columns, rows, held = [], [], [], 0


def _paint(
    atlas: Atlas,
    expected: _Expected,
    sight: RayCaster,
    photos: PhotoColours,
    cage: float,
    *,
    offsets: list[NDArray[np.float32]] | None = None,
    progress: Progress | None = None,
) -> int:
    """Fill the pages and `known` of an atlas in place; returns the rays cast. `offsets` takes where surfaces were."""
    if not atlas.charts:
        return 0
    origin, right, up, normal = (
        np.array([getattr(chart, name) for chart in atlas.charts]) for name in ("origin", "right", "up", "normal")
    )
    corner = np.array([(chart.x, chart.y) for chart in atlas.charts])
    wall = np.abs(normal[:, 2]) < 0.5
    side = np.linalg.norm(up, axis=1)
    odd = [np.zeros(known.shape, np.bool_) for known in atlas.known]
    loose = [np.zeros(known.shape, np.bool_) for known in atlas.known]
    total = sum(int(np.count_nonzero(inside)) for inside in atlas.inside)

    def paint(batch: _Batch) -> tuple[int, int]:
        page, chart, column, row = batch
        x, y = corner[chart, 0] + column, corner[chart, 1] + row
        centre, out, stand = _texels(chart, column, row, origin, right, up, normal, expected.offset)
        hits = sight.first(centre + cage * out, -out, most=2 * cage)
        rays = len(chart)
        triangle, u, v = hits.triangle, hits.u, hits.v
        offset = cage - hits.distance
        agrees = _agreement(triangle, photos.normal, chart, normal)
        good = agrees >= _AGREES
        off = good & (offset - stand > _STANDS_OFF)
        again = np.flatnonzero(~good | off)
        if len(again):
            outward = out[again]
            start = np.maximum(stand[again] - _BEHIND, -cage)
            most = min(_BEHIND + _STANDS_OFF, 2 * cage)
            second = sight.first(centre[again] + start[:, None] * outward, outward, most=most)
            rays += len(again)
            better = _agreement(second.triangle, photos.normal, chart[again], normal)
            found = better >= _AGREES
            use = again[found]
            agrees[use] = better[found]
            triangle[use], u[use], v[use] = second.triangle[found], second.u[found], second.v[found]
            offset[use] = start[found] + second.distance[found]
            good[use], off[use] = True, False
        good &= np.abs(offset) <= cage
        take = np.flatnonzero(good)
        whose = chart[take]
        colour = photos(triangle[take], u[take], v[take], whose, right, up)
        height = row[take] * side[whose]
        reject, fringe = _oddities(
            colour,
            off[take],
            wall[whose],
            photos.normal[triangle[take], 2] - normal[whose, 2],
            height,
            expected.luminance[whose],
            expected.green[whose],
        )
        odd[page][y[take[fringe]], x[take[fringe]]] = True
        keep = take[~reject]
        atlas.pages[page][y[keep], x[keep]] = colour[~reject]
        atlas.known[page][y[keep], x[keep]] = True
        loose[page][y[keep], x[keep]] = agrees[keep] < _MELTED
        if offsets is not None:
            offsets[page][y[keep], x[keep]] = offset[keep]
        return rays, len(chart)

    # Every texel belongs to one batch, so the order they are painted in decides nothing.
    rays = done = 0
    for cast, painted in in_order(paint, _batches(atlas)):
        rays += cast
        done += painted
        if progress is not None:
            progress(done, total)
    for mask, known in zip(odd, atlas.known, strict=True):
        if mask.any():
            _forget_near(mask, known)
    _forget_leaning_texels(atlas, loose)
    return rays


def _forget_leaning_texels(atlas: Atlas, loose: Sequence[NDArray[np.bool_]]) -> None:
    """Forget what leans away from a chart near to what does not: edges that are melted into roof, ground or neighbour.

    A surface that leans all over (a roof where the map has a wall) stays: its colours are what is there.
    """
    size = 2 * round(_EDGE / atlas.texel) + 1
    for chart in atlas.charts:
        leans = loose[chart.page][chart.box]
        if leans.any():
            known = atlas.known[chart.page][chart.box]
            upright = known & ~leans
            if upright.any():
                known &= ~(leans & maximum_filter(upright, size=size))


@compiled(nogil=True)
def _texels(chart, column, row, origin, right, up, normal, expected):
    """Centres and normals of texels, and how far out of the plane the photographed surface is expected."""
    centre, out = np.empty((len(chart), 3)), np.empty((len(chart), 3))
    stand = np.empty(len(chart))
    for n in range(len(chart)):
        c, i, j = chart[n], column[n] + 0.5, row[n] + 0.5
        for k in range(3):
            centre[n, k] = origin[c, k] + i * right[c, k] + j * up[c, k]
            out[n, k] = normal[c, k]
        stand[n] = expected[c, 0] + expected[c, 1] * i + expected[c, 2] * j
    return centre, out, stand


@compiled(nogil=True)
def _agreement(triangle, normals, chart, normal):
    """Cosine between the normals of what was hit and of the chart; -1 where nothing was."""
    cosine = np.full(len(triangle), -1.0)
    for n in range(len(triangle)):
        t = triangle[n]
        if t >= 0:
            a, b = normals[t], normal[chart[n]]
            cosine[n] = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    return cosine


def _oddities(
    colour: NDArray[np.uint8],
    off: NDArray[np.bool_],
    wall: NDArray[np.bool_],
    lean: NDArray[np.float64],
    height: NDArray[np.float64],
    luminance: NDArray[np.float64],
    green: NDArray[np.float64],
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which colours are not the wall's own (leaves, cars, ground, holes), and which of these stain their neighbours."""
    r, g, b = (colour[:, k].astype(np.float32) for k in range(3))
    excess = 2 * g - r - b
    light = 0.299 * r + 0.587 * g + 0.114 * b
    leaves = wall & (excess > _GREEN) & (excess > green + _GREENER)
    hole = (light < _DARK) & (light < _DARKER * luminance)
    obstacle = wall & off & (height < _LOW) & (luminance > 0)  # the coarse bake doesn't know yet what stands off
    ground = wall & (height < _FOOT) & (lean > _LEANS)
    return leaves | hole | obstacle | ground, leaves | obstacle


@compiled(nogil=True)
def _forget_near(mask, known):
    height, width = mask.shape
    for y in range(height):
        for x in range(width):
            if mask[y, x]:
                for j in range(max(y - _FRINGE, 0), min(y + _FRINGE + 1, height)):
                    for i in range(max(x - _FRINGE, 0), min(x + _FRINGE + 1, width)):
                        known[j, i] = False


def _expectations(atlas: Atlas, offsets: Sequence[NDArray[np.float32]], cage: float) -> _Expected:
    """Learn from the coarse bake where each photographed wall stands and what colours it has."""
    count = len(atlas.charts)
    expected = replace(_Expected.nothing(count), luminance=np.zeros(count), green=np.full(count, np.inf))
    for k, chart in enumerate(atlas.charts):
        known = atlas.known[chart.page][chart.box]
        row, column = np.nonzero(known)
        if not len(row):
            continue
        offset = offsets[chart.page][chart.box][row, column].astype(np.float64)
        middle = float(np.median(offset))
        fit = np.array([middle, 0.0, 0.0])
        if len(row) >= 40:
            basis = np.column_stack([np.ones(len(row)), column + 0.5, row + 0.5])
            for _ in range(3):
                near = np.abs(offset - basis @ fit) < _STANDS_OFF
                if near.sum() < 20:
                    break
                fit = np.linalg.lstsq(basis[near], offset[near], rcond=None)[0]
            ends = fit[0] + np.array([0, fit[1] * chart.width]) + np.array([[0], [fit[2] * chart.height]])
            if np.abs(ends).max() > cage or np.abs(ends - middle).max() > 1.0:
                fit = np.array([middle, 0.0, 0.0])  # a wild slope is no wall's
        expected.offset[k] = fit
        r, g, b = (atlas.pages[chart.page][chart.box][row, column][:, c].astype(np.float64) for c in range(3))
        expected.luminance[k] = np.median(0.299 * r + 0.587 * g + 0.114 * b)
        expected.green[k] = np.median(2 * g - r - b)
    return expected
