"""Backdrop beyond the edge of a world: plain houses where its edge is built up, trees where it is not.

Nobody knows what stands there, and nothing of it is a record of the world: it is like the painted cloth behind a stage,
so that streets do not end in a bare plain. Heights and colours are those of the buildings near by, water stays open.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.assets.models.plants import leaf_material
from vico.geo import overlay
from vico.geometry import distance
from vico.seeds import rng
from vico.world.heights import HeightField
from vico.world.mesh import Material, Surface, merge_surfaces, quad_triangles
from vico.world.model import ENTITY_BACKDROP, Building
from vico.worldgen.facts.fault_isolation import union_named
from vico.worldgen.facts.land_cover import mapped_areas
from vico.worldgen.facts.site import SiteFacts
from vico.worldgen.facts.streets import StreetPolygons
from vico.worldgen.texture_canvas import Canvas

_APRON = 40.0  # metres of ground beyond the square
_FRONT = 16.0  # metres from houses to the end of the ground
_BEHIND = 2.0  # and where a street runs out of it
_DEPTH = 13.0  # of a house, metres
_WIDTHS = (11.0, 24.0)
_TOWN = 60.0  # metres from the edge within which a building makes it built up
_LIKE = 120.0  # ... within which buildings are taken as a pattern
_STOREY = 3.1  # metres; the picture of a wall shows four storeys and four bays
_STEP = 3.2  # metres from tree to tree
_PITCHED = ("gabled", "hipped", "half-hipped", "mansard", "gambrel", "pyramidal")
_ROOF, _FLAT_ROOF = (112, 88, 78), (120, 118, 114)
_CORE = (44, 62, 36)
_GREEN = (104, 138, 72)


class _Slot(NamedTuple):
    """A stretch of the edge: its number, middle on the edge, unit vectors along it and outward, and its width."""

    number: int
    middle: NDArray[np.float64]
    along: NDArray[np.float64]
    out: NDArray[np.float64]
    width: float

    def strip(self, near: float, far: float) -> shapely.Polygon:
        """Ground from `near` to `far` metres beyond the edge."""
        a, b = self.along * self.width / 2, self.out
        m = self.middle
        return shapely.Polygon([m - a + b * near, m + a + b * near, m + a + b * far, m - a + b * far])


def backdrop_of(
    site: SiteFacts, terrain: HeightField, streets: StreetPolygons, buildings: Sequence[Building], *, seed: int = 0
) -> list[Surface]:
    """Make what is seen beyond the edge.

    Parameters
    ----------
    site
        The map and its facts.
    terrain
        Graded ground.
    streets
        `road_polygons` of the same map: where one leaves the world, what closes the view stands farther out.
    buildings
        Those of the world.
    seed
        Decides what stands where.

    Returns
    -------
    list of Surface
        One a material, of the entity `ENTITY_BACKDROP`, at most 52 m beyond the square.
    """
    half = site.osm.half
    reach = half + _APRON
    soft = mapped_areas(site, shapely.box(-reach, -reach, reach, reach))
    water = union_named(soft["water"], grid=0.01)
    green = union_named([one for name in ("woods", "grass", "garden", "farmland") for one in soft[name]], grid=0.01)
    for shape in (water, green, streets.carriageway):
        shapely.prepare(shape)
    shapes = np.array([shapely.Polygon(b.footprint[0]) for b in buildings], object)
    tree = shapely.STRtree(shapes)
    parts: list[Surface] = []
    for slot in _slots(half, seed):
        ground = slot.strip(0.0, _APRON)
        if water.intersects(ground):
            continue
        random = rng(seed, "backdrop", slot.number)
        around = overlay.buffer(shapely.Point(slot.middle), _LIKE)
        like = np.sort(tree.query(around, predicate="intersects"))
        leaves = bool(streets.carriageway.intersects(slot.strip(_FRONT, _APRON)))
        fronts = (_APRON - _BEHIND,) if leaves else (_APRON - _FRONT, _APRON - _BEHIND)
        near = next(
            (far for far in fronts if not _is_occupied(slot.strip(far - 1.5, far + _DEPTH), shapes[like])), None
        )
        if near is None:
            continue
        built = bool(len(tree.query(overlay.buffer(shapely.Point(slot.middle), _TOWN), predicate="intersects")))
        if built and not green.contains(shapely.Point(slot.middle + slot.out * _FRONT)):
            pattern = buildings[int(like[int(random.integers(len(like)))])]
            parts += _house(slot, near, pattern, terrain, random)
        else:
            parts += _trees(slot, near, terrain, random)
    return merge_surfaces([part.of_entity(ENTITY_BACKDROP) for part in parts])


def _is_occupied(ground: shapely.Polygon, shapes: NDArray[np.object_]) -> bool:
    return bool(shapely.intersects(shapes, ground).any())


def _slots(half: float, seed: int) -> Iterator[_Slot]:
    """Divide the four sides of the square, and a little beyond its corners, into stretches of chance widths."""
    number = 0
    for side in range(4):
        turn = side * np.pi / 2
        out = np.round(np.array([np.cos(turn), np.sin(turn)]), 6)
        along = np.array([-out[1], out[0]])
        random = rng(seed, "backdrop", "widths", side)
        place = -half - _APRON
        while place < half + _APRON - _WIDTHS[0]:
            width = float(random.uniform(*_WIDTHS))
            yield _Slot(number, out * half + along * (place + width / 2), along, out, width)
            place += width
            number += 1


def _ground(terrain: HeightField, points: NDArray[np.float64]) -> float:
    """Height that is below the ground at all points, metres."""
    return float(terrain.smooth(points).min()) - 0.5


def _house(
    slot: _Slot, near: float, pattern: Building, terrain: HeightField, random: np.random.Generator
) -> list[Surface]:
    """Make a house like another one: three walls, and a roof that is pitched where the other's is."""
    near -= float(random.uniform(0.0, 1.5))
    m, a, out = slot.middle, slot.along * slot.width / 2, slot.out
    corners = np.array(
        [m + a + out * (near + _DEPTH), m + a + out * near, m - a + out * near, m - a + out * (near + _DEPTH)]
    )
    low = _ground(terrain, corners)
    tall = float(np.clip(pattern.height, 3.5, 60.0) * random.uniform(0.85, 1.1))
    pitched = pattern.roof_shape in _PITCHED
    eaves = low + 0.5 + (max(0.7 * tall, tall - 6.0) if pitched else tall)
    foot, head = np.full((4, 1), low), np.full((4, 1), eaves)
    points, uv = [], []
    run = 0.0
    for k in range(3):
        p, q = corners[k], corners[k + 1]
        wide = distance(q, p)
        points += [np.r_[p, foot[k]], np.r_[q, foot[k + 1]], np.r_[q, head[k + 1]], np.r_[p, head[k]]]
        bays, storeys = round(wide / 3.0) / 4.0, max(round((eaves - low) / _STOREY), 1) / 4.0
        uv += [(run, 0.0), (run + bays, 0.0), (run + bays, storeys), (run, storeys)]
        run += bays
    walls = Surface.from_triangles(
        np.array(points),
        quad_triangles(4 * np.arange(3)),
        colour=_shade(pattern.colour, random),
        uv=np.array(uv),
        material=_walls(),
    )
    top = np.c_[corners, head]
    if not pitched:
        flat = Surface.from_triangles(top[[0, 3, 2, 1]], np.array([(0, 1, 2), (0, 2, 3)]), colour=_FLAT_ROOF)
        return [walls, flat]
    ridge = low + 0.5 + tall
    ends = np.array([np.r_[(corners[0] + corners[1]) / 2, ridge], np.r_[(corners[2] + corners[3]) / 2, ridge]])
    roof = np.concatenate([top, ends])  # 0 to 3 as the corners, 4 and 5 the ridge
    faces = np.array([(1, 4, 5), (1, 5, 2), (3, 5, 4), (3, 4, 0), (0, 4, 1), (2, 5, 3)])
    return [walls, Surface.from_triangles(roof, faces[:, ::-1], colour=_ROOF)]


def _shade(colour: str, random: np.random.Generator) -> tuple[int, int, int]:
    """Read the colour of a building's record, darker by what its walls have and a plain picture lacks."""
    text = colour.lstrip("#")
    tone = float(random.uniform(0.8, 0.95))
    rgb = [int(text[k : k + 2], 16) for k in (0, 2, 4)] if len(text) == 6 else [200, 196, 188]
    return tuple(min(round(value * tone), 255) for value in rgb)  # type: ignore[return-value]


@cache
def _walls() -> Material:
    """Paint four storeys of four plain windows; a third of them are lit at night."""
    canvas = Canvas(128, 128, (246, 246, 246), rng(0, "backdrop", "walls"))
    for row in range(4):
        for column in range(4):
            x, y = 32 * column + 9, 32 * row + 10
            canvas.rect(x - 1, y - 1, x + 15, y + 18, (222, 222, 222))
            lit = 150.0 if canvas.random.random() < 0.33 else 0.0
            canvas.rect(x, y, x + 14, y + 17, (86, 94, 104), glow=lit)
    return Material("backdrop_walls", canvas.texture())


def _trees(slot: _Slot, near: float, terrain: HeightField, random: np.random.Generator) -> list[Surface]:
    """Make a row of trees that hides what is behind: leaves before a dark core."""
    count = max(round(slot.width / _STEP), 2)
    shares = (np.arange(count) + 0.5) / count - 0.5
    centres: list[NDArray[np.float64]] = []
    sizes: list[float] = []
    tops: list[float] = []
    base = slot.middle + slot.out * (near + 4.0)
    low = _ground(terrain, np.array([base - slot.along * slot.width / 2, base + slot.along * slot.width / 2]))
    for share in shares:
        tall = float(random.uniform(6.5, 11.5))
        tops.append(tall)
        for level in np.linspace(0.25, 0.86, 3):
            for deep in (-1.2, 1.0):
                spot = base + slot.along * (share * slot.width + random.uniform(-1.0, 1.0)) + slot.out * deep
                centres.append(np.r_[spot, low + 0.5 + tall * level + random.uniform(-0.5, 0.5)])
                sizes.append(float(random.uniform(1.9, 2.6)))
    middle, size = np.array(centres), np.array(sizes)[:, None]
    inward = np.r_[-slot.out, 0.25]
    facing = inward + random.normal(0.0, 0.35, middle.shape)
    facing /= np.linalg.norm(facing, axis=1, keepdims=True)
    right = np.cross(np.array([0.0, 0.0, 1.0]), facing)
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    up = np.cross(facing, right)
    corners = np.stack([middle - (right + up) * size, middle + (right - up) * size,
                        middle + (right + up) * size, middle - (right - up) * size], axis=1)  # fmt: skip
    light = np.clip(0.62 + 0.3 * (middle[:, 2] - low) / 11.0 + random.uniform(-0.1, 0.1, len(middle)), 0.3, 1.1)
    colours = np.clip(np.array(_GREEN) * light[:, None], 0, 255).astype(np.uint8)
    leaves = Surface.from_triangles(
        corners.reshape(-1, 3),
        quad_triangles(4 * np.arange(len(middle))),
        colour=np.repeat(colours, 4, axis=0),
        uv=np.tile(np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32), (len(middle), 1)),
        normals=np.repeat(facing, 4, axis=0),
        material=leaf_material("broad"),
    )
    a, b = base + slot.along * slot.width / 2 + slot.out * 1.5, base - slot.along * slot.width / 2 + slot.out * 1.5
    height = low + 0.5 + 0.72 * min(tops)
    core = np.array([np.r_[a, low], np.r_[b, low], np.r_[b, height], np.r_[a, height]])
    return [leaves, Surface.from_triangles(core, np.array([(0, 1, 2), (0, 2, 3)]), colour=_CORE)]
