"""Charts: flat rectangles of texels on square pages, one for each plane piece of the buildings' walls and roofs.

Each chart has a plane, on which right and up are fixed. Rectangles are packed on pages along a skyline.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.errors import InputError
from vico.io.compiled import compiled
from vico.world.mesh import Material, Surface


def _plane_axes(normal: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Right and up of planes as seen from outside: up is as near to the zenith as it gets."""
    up = np.array([0.0, 0.0, 1.0]) - normal * normal[:, 2:]
    level = np.linalg.norm(up, axis=1) < 1e-3
    up[level] = np.array([0.0, 1.0, 0.0]) - normal[level] * normal[level, 1:2]
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    return np.cross(up, normal), up


def plane_coordinates(
    points: NDArray[np.float64],
    patch: NDArray[np.int64],
    base: NDArray[np.float64],
    right: NDArray[np.float64],
    up: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Coordinates of triangles' corners along right and up of the plane of each's patch, shape ``(n, 3)`` each."""
    away = points - base[patch][:, None]
    return np.einsum("nkc,nc->nk", away, right[patch]), np.einsum("nkc,nc->nk", away, up[patch])


def _level_turns(
    x: NDArray[np.float64], y: NDArray[np.float64], patch: NDArray[np.int64], plane: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Angles that lay the charts of flat roofs along their longer sides; walls and slopes stand as they are."""
    turn = np.zeros(len(plane))
    level = plane[:, 2] > 0.995
    take = level[patch]
    if not take.any():
        return turn
    which = np.flatnonzero(level)
    compact = np.cumsum(level) - 1
    points = np.column_stack([x[take].ravel(), y[take].ravel()])
    hulls = shapely.oriented_envelope(shapely.multipoints(points, indices=np.repeat(compact[patch[take]], 3)))
    for k, hull in zip(which, hulls, strict=True):
        ring = shapely.get_coordinates(hull)
        if len(ring) == 5:
            sides = np.diff(ring, axis=0)[:2]
            along = sides[int(np.linalg.norm(sides[1]) > np.linalg.norm(sides[0]) + 1e-6)]
            angle = math.atan2(along[1], along[0])
            turn[k] = (angle + np.pi / 2) % np.pi - np.pi / 2
    return turn


def _pack_rectangles(cells: NDArray[np.int64], page: int) -> NDArray[np.int64]:
    """Place rectangles (width, height) on pages: page, x, y of each; the highest first, each as low as it goes."""
    order = np.lexsort((np.arange(len(cells)), -cells[:, 0], -cells[:, 1]))
    return _skyline(cells, order, page) if len(cells) else np.zeros((0, 3), np.int64)


@compiled(nogil=True)
def _skyline(cells, order, page):
    places = np.zeros((len(cells), 3), np.int64)
    tops = np.zeros((len(cells), page), np.int32)
    pages = 1
    queue = np.zeros(page, np.int64)
    for index in order:
        w, h = cells[index]
        k = 0
        while True:
            top = tops[k]
            best, best_x = page + 1, -1
            head, tail = 0, 0
            for x in range(page):
                while tail > head and top[queue[tail - 1]] <= top[x]:
                    tail -= 1
                queue[tail] = x
                tail += 1
                left = x - w + 1
                if left >= 0:
                    if queue[head] < left:
                        head += 1
                    if top[queue[head]] < best:
                        best, best_x = top[queue[head]], left
            if best + h <= page:
                places[index] = k, best_x, best
                top[best_x : best_x + w] = best + h
                break
            k += 1
            pages = max(pages, k + 1)
    return places


_GUTTER = 4  # pixels around a chart: two mip levels before neighbours mix
_BEND = np.cos(np.radians(14.0))  # neighbouring faces that turn less than this share a chart ...
_FLAT = 0.10  # ... if they stay this near its plane, metres
_LEAST_AREA = 1.0  # square metres; smaller pieces are not worth a chart
_THIN = 0.4  # metres of the shorter side up to which a face is a moulding or a rim
_SPARSE = 0.12  # and the share of its rectangle
_UNDERSIDE = -0.9  # normals with a smaller z look at the ground
_WELD = 1e-3  # metres


@dataclass(frozen=True)
class Chart:
    """A rectangle of texels in space.

    The centre of texel (i, j), pixel ``[y + j, x + i]`` of its page, lies at
    ``origin + (i + 0.5) * right + (j + 0.5) * up``.

    Attributes
    ----------
    entity
        Whose surface it is.
    page, x, y, width, height
        Where its texels lie, pixels; gutters are outside.
    origin
        Corner of texel (0, 0), ENU metres, float64, shape ``(3,)``.
    right, up
        Metres a texel along the rows and the columns, perpendicular, float64, shape ``(3,)``.
    normal
        Outward unit vector, float64, shape ``(3,)``; equals ``right x up`` in direction.
    patch
        Index among all the plane pieces of the surfaces that were unwrapped, those that got no chart included.
    """

    entity: int
    page: int
    x: int
    y: int
    width: int
    height: int
    origin: NDArray[np.float64]
    right: NDArray[np.float64]
    up: NDArray[np.float64]
    normal: NDArray[np.float64]
    patch: int = -1

    @property
    def box(self) -> tuple[slice, slice]:
        """Rows and columns of its page."""
        return slice(self.y, self.y + self.height), slice(self.x, self.x + self.width)


@dataclass(frozen=True)
class Atlas:
    """The pages of all charts.

    Attributes
    ----------
    pages
        sRGB, uint8, shape ``(h, w, 3)`` each, sides powers of two.
    inside
        Texels that belong to a face, bool, shape ``(h, w)`` each.
    known
        Texels that hold a photo's colour, bool, shape ``(h, w)`` each; always within `inside`.
    charts
        In the order of the surfaces they came from.
    texel
        Side of a texel, metres.
    pieces
        Plane pieces the surfaces have, those without a chart included: what `Chart.patch` counts.
    """

    pages: tuple[NDArray[np.uint8], ...]
    inside: tuple[NDArray[np.bool_], ...]
    known: tuple[NDArray[np.bool_], ...]
    charts: tuple[Chart, ...]
    texel: float
    pieces: int = 0


@dataclass(frozen=True)
class _Patches:
    """All plane pieces; faces are counted through the surfaces in their order."""

    face_patch: NDArray[np.int64]
    corners: NDArray[np.float64]
    entity: NDArray[np.int64]
    normal: NDArray[np.float64]
    right: NDArray[np.float64]
    up: NDArray[np.float64]
    origin: NDArray[np.float64]
    size: NDArray[np.float64]
    area: NDArray[np.float64]


def unwrap(
    walls: Sequence[Surface],
    roofs: Sequence[Surface],
    *,
    texel: float = 0.10,
    page: int = 4096,
    wanted: NDArray[np.bool_] | None = None,
) -> tuple[list[Surface], list[Surface], Atlas]:
    """Give every plane piece of walls and roofs a chart of its own.

    Parameters
    ----------
    walls, roofs
        The two layers. Surfaces with holes (cutout) or two sides stay as they are, and so do pieces under 1 m2,
        mouldings and undersides.
    texel
        Side of a texel, metres; a piece too large for a page gets coarser ones.
    page
        Side of a page, pixels, a power of two; the last page may be lower.
    wanted
        Which pieces get a chart, by `Chart.patch`; all where not given.

    Returns
    -------
    tuple
        Walls and roofs, with the charted triangles on surfaces of the materials ``atlas_0``, ``atlas_1``, ... (which
        `textured` fills), texture coordinates on the pages, entities and normals kept; and the empty atlas.

    Raises
    ------
    InputError
        If `texel` or `page` can't be used, or `wanted` is of other surfaces.
    """
    if not 0.005 <= texel <= 10.0:
        raise InputError(f"atlas: a texel of {texel:g} m; it must lie within 0.005..10 m")
    if page < 64 or page & (page - 1):
        raise InputError(f"atlas: a page of {page} pixels; its side must be a power of two, 64 at least")
    surfaces = [*walls, *roofs]
    patches = _patches(surfaces, len(walls))
    count = len(patches.entity)
    if wanted is not None and len(wanted) != count:
        raise InputError(f"atlas: {len(wanted)} pieces are chosen from, but the surfaces have {count}")
    chosen = (
        (patches.area >= np.maximum(_LEAST_AREA, _SPARSE * patches.size.prod(axis=1)))
        & (patches.size.min(axis=1, initial=np.inf) >= _THIN)
        & (patches.normal[:, 2] > _UNDERSIDE)
    )
    if wanted is not None:
        chosen &= wanted
    index = np.flatnonzero(chosen)
    room = page - 2 * _GUTTER
    step = np.maximum(texel, patches.size[index].max(axis=1, initial=0.0) / room)
    cells = np.maximum(np.ceil(patches.size[index] / step[:, None] - 1e-6), 1).astype(np.int64)
    cells = np.minimum(cells, room)
    # Walls and roofs are files of their own: on pages of their own, no page is written twice.
    roof = np.zeros(count + 1, np.bool_)
    roof[patches.face_patch] = np.repeat(np.arange(len(surfaces)) >= len(walls), [len(s.triangles) for s in surfaces])
    places, first = np.zeros((len(index), 3), np.int64), 0
    for layer in (False, True):
        mine = np.flatnonzero(roof[index] == layer)
        if len(mine):
            places[mine] = _pack_rectangles(cells[mine] + 2 * _GUTTER, page)
            places[mine, 0] += first
            first = int(places[mine, 0].max()) + 1
    charts = []
    for k, p in enumerate(index):
        # The spare part of the last texels is shared between both ends.
        spare = (cells[k] * step[k] - patches.size[p]) / 2
        origin = patches.origin[p] - spare[0] * patches.right[p] - spare[1] * patches.up[p]
        charts.append(
            Chart(
                int(patches.entity[p]),
                int(places[k, 0]),
                int(places[k, 1]) + _GUTTER,
                int(places[k, 2]) + _GUTTER,
                int(cells[k, 0]),
                int(cells[k, 1]),
                origin,
                patches.right[p] * step[k],
                patches.up[p] * step[k],
                patches.normal[p],
                int(p),
            )
        )
    sizes = _page_sizes(charts, page)
    inside = tuple(np.zeros(size, np.bool_) for size in sizes)
    chart_of = np.full(count + 1, -1, np.int64)
    chart_of[index] = np.arange(len(index))
    face_chart = chart_of[patches.face_patch]
    flat = _corner_pixels(charts, patches.corners, face_chart)
    for k in range(len(sizes)):
        faces = np.flatnonzero((face_chart >= 0) & (places[face_chart, 0] == k)) if len(charts) else np.zeros(0, int)
        boxes = np.array([(charts[c].x, charts[c].y, charts[c].width, charts[c].height) for c in face_chart[faces]])
        _rasterise(flat[faces], boxes.reshape(-1, 4), inside[k])
    atlas = Atlas(
        tuple(np.full((*size, 3), 128, np.uint8) for size in sizes),
        inside,
        tuple(np.zeros(size, np.bool_) for size in sizes),
        tuple(charts),
        texel,
        count,
    )
    made: tuple[list[Surface], list[Surface]] = ([], [])
    first = 0
    for k, surface in enumerate(surfaces):
        part = slice(first, first + len(surface.triangles))
        made[k >= len(walls)].extend(_split_by_page(surface, face_chart[part], flat[part], charts, sizes))
        first += len(surface.triangles)
    return made[0], made[1], atlas


def with_atlas_pages(surfaces: Sequence[Surface], atlas: Atlas) -> list[Surface]:
    """Put the pages into the materials of unwrapped surfaces; their vertices turn white, so that photos keep colour."""
    pages = {f"atlas_{k}": Material(f"atlas_{k}", page, photo=True) for k, page in enumerate(atlas.pages)}
    return [
        replace(surface, material=pages[surface.material.name], colour=np.full_like(surface.colour, 255))
        if surface.material.name in pages
        else surface
        for surface in surfaces
    ]


def coverage(atlas: Atlas) -> NDArray[np.float64]:
    """Share of each chart's texels that hold a photo's colour, shape ``(charts,)``."""
    shares = np.zeros(len(atlas.charts))
    for k, chart in enumerate(atlas.charts):
        inside = int(np.count_nonzero(atlas.inside[chart.page][chart.box]))
        shares[k] = int(np.count_nonzero(atlas.known[chart.page][chart.box])) / max(inside, 1)
    return shares


def repack(
    walls: Sequence[Surface], roofs: Sequence[Surface], atlas: Atlas, *, least: float = 0.3, page: int | None = None
) -> tuple[list[Surface], list[Surface], Atlas]:
    """Drop the charts that photos hardly cover, so that their faces wear their procedural facade again.

    Parameters
    ----------
    walls, roofs
        The layers as they were before `unwrap`.
    atlas
        Charts of these, painted.
    least
        Share of known texels a chart must have to stay.
    page
        Side of the new pages; as wide as they were where not given.

    Returns
    -------
    tuple
        Walls, roofs and atlas as from `unwrap`, with the texels of the charts that stay.
    """
    wanted = np.zeros(atlas.pieces, np.bool_)
    shares = coverage(atlas)
    for chart, share in zip(atlas.charts, shares, strict=True):
        wanted[chart.patch] = share >= least
    side = page or max((p.shape[1] for p in atlas.pages), default=4096)
    new_walls, new_roofs, new = unwrap(walls, roofs, texel=atlas.texel, page=side, wanted=wanted)
    old = {chart.patch: chart for chart in atlas.charts}
    for chart in new.charts:
        source = old[chart.patch]
        if (source.width, source.height) != (chart.width, chart.height):
            raise InputError("atlas: its charts are of other walls and roofs, or of another texel; unwrap these first")
        new.pages[chart.page][chart.box] = atlas.pages[source.page][source.box]
        new.known[chart.page][chart.box] = atlas.known[source.page][source.box]
    return new_walls, new_roofs, new


def texel_centres(chart: Chart, columns: NDArray[Any], rows: NDArray[Any]) -> NDArray[np.float64]:
    """Where the centres of a chart's texels lie, ENU metres, shape ``(n, 3)``."""
    return (
        chart.origin + (np.asarray(columns)[:, None] + 0.5) * chart.right + (np.asarray(rows)[:, None] + 0.5) * chart.up
    )


def _patches(surfaces: Sequence[Surface], layers: int) -> _Patches:
    """Find the plane pieces: faces that meet at edges, of one entity and layer, near one plane."""
    corners = [s.positions[s.triangles].astype(np.float64) for s in surfaces]
    points = np.concatenate(corners) if corners else np.zeros((0, 3, 3))
    owner = np.concatenate(
        [s.entity[s.triangles[:, 0]].astype(np.int64) * 2 + (k >= layers) for k, s in enumerate(surfaces)]
        or [np.zeros(0, np.int64)]
    )
    charted = np.concatenate(
        [np.full(len(s.triangles), not (s.material.cutout or s.material.double_sided)) for s in surfaces]
        or [np.zeros(0, np.bool_)]
    )
    cross = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    length = np.linalg.norm(cross, axis=1)
    normal = cross / np.maximum(length, 1e-12)[:, None]
    area = length / 2
    keys = np.round(points.reshape(-1, 3) / _WELD).astype(np.int64)
    _, welded = np.unique(np.column_stack([np.repeat(owner, 3), keys]), axis=0, return_inverse=True)
    start, neighbours = _neighbours(welded.reshape(-1, 3))
    # Seeds by size; equal ones in the order of the surfaces.
    order = np.argsort(-np.round(area, 4), kind="stable")
    order = order[charted[order] & (area[order] > 1e-8)]
    label, seeds = _grow(points, normal, order, start, neighbours, charted & (area > 1e-8))
    seeds = seeds[: int(label.max(initial=-1)) + 1]
    # Degenerate slivers join no patch; `-1` indexes the spare last entry of tables by patch.
    n = len(seeds)
    plane = normal[seeds].reshape(-1, 3)
    right, up = _plane_axes(plane)
    member = np.flatnonzero(label >= 0)
    patch = label[member]
    by_patch = np.argsort(patch, kind="stable")
    patch, member = patch[by_patch], member[by_patch]
    base = points[seeds, 0].reshape(-1, 3)
    flat_x, flat_y = plane_coordinates(points[member], patch, base, right, up)
    turn = _level_turns(flat_x, flat_y, patch, plane)
    right, up = (
        np.cos(turn)[:, None] * right + np.sin(turn)[:, None] * up,
        -np.sin(turn)[:, None] * right + np.cos(turn)[:, None] * up,
    )
    flat_x, flat_y = plane_coordinates(points[member], patch, base, right, up)
    first = np.searchsorted(patch, np.arange(n))
    low = np.zeros((n, 2))
    high = np.zeros((n, 2))
    if n:
        for k, values in enumerate((flat_x, flat_y)):
            low[:, k] = np.minimum.reduceat(values.min(axis=1), first)
            high[:, k] = np.maximum.reduceat(values.max(axis=1), first)
    origin = base + low[:, :1] * right + low[:, 1:] * up
    total = np.bincount(patch, weights=area[member], minlength=n)[:n].astype(np.float64)
    return _Patches(label, points, owner[seeds] // 2, plane, right, up, origin, high - low, total)


def _neighbours(faces: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Faces that share an edge, as offsets and a list."""
    n = len(faces)
    a, b = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    key = np.minimum(a, b) * (int(faces.max(initial=0)) + 1) + np.maximum(a, b)
    order = np.argsort(key, kind="stable")
    same = key[order][1:] == key[order][:-1]
    one, two = order[:-1][same] // 3, order[1:][same] // 3
    source, target = np.concatenate([one, two]), np.concatenate([two, one])
    by_source = np.lexsort((target, source))
    start = np.searchsorted(source[by_source], np.arange(n + 1))
    return start, target[by_source]


@compiled(nogil=True)
def _grow(points, normal, order, start, neighbours, charted):
    """Spread from each seed, the largest first, over faces near its plane."""
    label = np.full(len(points), -1, np.int64)
    seeds = np.zeros(len(points), np.int64)
    stack = np.zeros(len(points), np.int64)
    count = 0
    for seed in order:
        if label[seed] >= 0:
            continue
        seeds[count] = seed
        label[seed] = count
        stack[0] = seed
        top = 1
        n, base = normal[seed], points[seed, 0]
        while top > 0:
            top -= 1
            face = stack[top]
            for k in range(start[face], start[face + 1]):
                other = neighbours[k]
                if label[other] >= 0 or not charted[other]:
                    continue
                m = normal[other]
                if n[0] * m[0] + n[1] * m[1] + n[2] * m[2] < _BEND:
                    continue
                near = True
                for c in range(3):
                    p = points[other, c]
                    off = n[0] * (p[0] - base[0]) + n[1] * (p[1] - base[1]) + n[2] * (p[2] - base[2])
                    near &= abs(off) <= _FLAT
                if near:
                    label[other] = count
                    stack[top] = other
                    top += 1
        count += 1
    return label, seeds


def _page_sizes(charts: Sequence[Chart], page: int) -> list[tuple[int, int]]:
    if not charts:
        return []
    used = [0] * (max(chart.page for chart in charts) + 1)
    for chart in charts:
        used[chart.page] = max(used[chart.page], chart.y + chart.height + _GUTTER)
    return [(min(1 << (max(height, 64) - 1).bit_length(), page), page) for height in used]


def _corner_pixels(
    charts: Sequence[Chart], corners: NDArray[np.float64], face_chart: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Pixel coordinates of charted triangles' corners on their pages, shape ``(m, 3, 2)``."""
    flat = np.zeros((len(corners), 3, 2))
    if not charts:
        return flat
    faces = np.flatnonzero(face_chart >= 0)
    which = face_chart[faces]
    origin = np.array([chart.origin for chart in charts])[which]
    away = corners[faces] - origin[:, None]
    for k, name in enumerate(("right", "up")):
        axis = np.array([getattr(chart, name) for chart in charts])
        axis /= (axis**2).sum(axis=1, keepdims=True)
        corner = np.array([(chart.x, chart.y)[k] for chart in charts])
        flat[faces, :, k] = np.einsum("nkc,nc->nk", away, axis[which]) + corner[which][:, None]
    return flat


@compiled(nogil=True)
def _rasterise(triangles, boxes, inside):
    """Mark every texel that a triangle touches, within its chart."""
    for t in range(len(triangles)):
        p = triangles[t]
        x, y, w, h = boxes[t]
        double_area = (p[1, 0] - p[0, 0]) * (p[2, 1] - p[0, 1]) - (p[1, 1] - p[0, 1]) * (p[2, 0] - p[0, 0])
        sign = 1.0 if double_area >= 0 else -1.0
        left, right = max(int(np.floor(p[:, 0].min())), x), min(int(np.ceil(p[:, 0].max())), x + w)
        low, high = max(int(np.floor(p[:, 1].min())), y), min(int(np.ceil(p[:, 1].max())), y + h)
        for row in range(low, high):
            for column in range(left, right):
                touched = True
                for k in range(3):
                    a, b = p[k], p[(k + 1) % 3]
                    ex, ey = (b[0] - a[0]) * sign, (b[1] - a[1]) * sign
                    side = ex * (row + 0.5 - a[1]) - ey * (column + 0.5 - a[0])
                    # Half a texel of slack along the edge's normal: the texel's square touches the edge.
                    if side + 0.499 * (abs(ex) + abs(ey)) < 0:
                        touched = False
                        break
                if touched:
                    inside[row, column] = True


def _split_by_page(
    surface: Surface,
    face_chart: NDArray[np.int64],
    flat: NDArray[np.float64],
    charts: Sequence[Chart],
    sizes: Sequence[tuple[int, int]],
) -> list[Surface]:
    """Split a surface into what stays and what goes on each page."""
    if not (face_chart >= 0).any():
        return [surface]
    made = []
    stay = np.flatnonzero(face_chart < 0)
    if len(stay):
        used, triangles = np.unique(surface.triangles[stay], return_inverse=True)
        made.append(
            replace(
                surface,
                positions=surface.positions[used],
                normals=surface.normals[used],
                uv=surface.uv[used],
                colour=surface.colour[used],
                entity=surface.entity[used],
                triangles=triangles.reshape(-1, 3).astype(np.int32),
            )
        )
    page_of = np.array([chart.page for chart in charts] + [-1])[face_chart]
    for page, (height, width) in enumerate(sizes):
        faces = np.flatnonzero(page_of == page)
        if not len(faces):
            continue
        # A corner is one vertex in each chart it lies in.
        key = np.repeat(face_chart[faces], 3) * np.int64(len(surface.positions)) + surface.triangles[faces].ravel()
        _, first, triangles = np.unique(key, return_index=True, return_inverse=True)
        vertex = surface.triangles[faces].ravel()[first]
        uv = flat[faces].reshape(-1, 2)[first] / (width, height)
        made.append(
            replace(
                surface,
                positions=surface.positions[vertex],
                normals=surface.normals[vertex],
                uv=uv.astype(np.float32),
                colour=surface.colour[vertex],
                entity=surface.entity[vertex],
                triangles=triangles.reshape(-1, 3).astype(np.int32),
                material=Material(f"atlas_{page}"),
            )
        )
    return made
