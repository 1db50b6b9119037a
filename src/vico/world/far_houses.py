"""Houses from afar: walls of simplified outlines and plain roofs, in the mean colours of what their meshes show."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.world.far_parts import FarPart, far_outline, parts_by_height
from vico.world.far_roofs import roof_over
from vico.world.mean_colours import LINEAR, Looks, looks_from_afar, spread_points, srgb, sums_by
from vico.world.mesh import Material, Surface
from vico.world.model import Building
from vico.world.world import World

_SECTORS = 8  # of directions that a building's walls have colours of their own for


def far_houses(world: World, material: Material) -> Iterator[Surface]:
    """Make the houses of a world.

    Parameters
    ----------
    world
        The world.
    material
        What they are of; it has no texture.

    Returns
    -------
    iterator of Surface
        One of all houses, flat-shaded, in the world's frame; vertices have the entities of their buildings. None where
        there are no houses.
    """
    buildings = world.buildings
    if not buildings:
        return
    walls, roofs = looks_from_afar(world.surfaces("buildings")), looks_from_afar(world.surfaces("roofs"))
    known = np.array([b.entity for b in buildings])
    order = np.argsort(known)

    def number(entity: NDArray[np.int32]) -> NDArray[np.int64]:
        """Return which building each one is of; -1 for none."""
        at = np.minimum(np.searchsorted(known, entity, sorter=order), len(known) - 1)
        return np.where(known[order[at]] == entity, order[at], -1)

    own = LINEAR[np.array([_rgb(b.colour) for b in buildings])]
    facades = _wall_colours(walls, number(walls.entity), own, buildings)
    tops = _roof_colours(roofs, number(roofs.entity), 0.6 * own)
    up = roofs.where(roofs.normals[:, 2] > 0.2 * np.linalg.norm(roofs.normals, axis=1))
    triangle, place, _ = spread_points(up.corners, up.normals[:, 2], 1.0)
    of = number(up.entity)[triangle]
    by_building = np.argsort(of, kind="stable")
    place, starts = place[by_building], np.searchsorted(of[by_building], np.arange(len(known) + 1))
    pieces = _Pieces()
    for k, building in enumerate(buildings):
        outline = far_outline(building)
        if not outline.is_empty:
            parts = parts_by_height(world, building, outline, place[starts[k] : starts[k + 1]])
            for part in parts:
                _add_part(pieces, building, part, facades[k], tops[k])
    yield from pieces.surfaces(material)


class _Pieces:
    """Collects triangles: corners, colours in linear light, entities."""

    def __init__(self) -> None:
        self._corners: list[NDArray[np.float64]] = []
        self._colours: list[NDArray[np.float64]] = []
        self._entities: list[NDArray[np.int32]] = []

    def add(self, corners: NDArray[np.float64], colour: NDArray[np.float64], entity: int) -> None:
        """Add triangles ``(n, 3, 3)`` of an entity; colours are those of the corners, ``(n, 3, 3)`` or broadcast."""
        count = len(corners)
        self._corners.append(corners)
        self._colours.append(np.broadcast_to(colour, (count, 3, 3)))
        self._entities.append(np.full(count, entity, np.int32))

    def surfaces(self, material: Material) -> list[Surface]:
        """Return them as one surface, flat-shaded; none where there are none."""
        if not self._corners:
            return []
        corners = np.concatenate(self._corners)
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        length = np.linalg.norm(normals, axis=1)
        seen = length > 1e-6
        corners, normals = corners[seen], normals[seen] / length[seen, None]
        count = 3 * len(corners)
        return [
            Surface(
                corners.reshape(-1, 3).astype(np.float32),
                np.repeat(normals, 3, axis=0).astype(np.float32),
                np.zeros((count, 2), np.float32),
                srgb(np.concatenate(self._colours)[seen].reshape(-1, 3)),
                np.repeat(np.concatenate(self._entities)[seen], 3),
                np.arange(count, dtype=np.int32).reshape(-1, 3),
                material,
            )
        ]


def _rgb(colour: str) -> tuple[int, int, int]:
    text = colour.lstrip("#")
    try:
        return int(text[:2], 16), int(text[2:4], 16), int(text[4:6], 16)
    except ValueError:
        return 200, 196, 188


def _wall_colours(
    walls: Looks, of: NDArray[np.int64], own: NDArray[np.float64], buildings: Sequence[Building]
) -> NDArray[np.float64]:
    """Return colours of walls at their foot and at their head, by building and direction, ``(n, _SECTORS, 2, 3)``.

    A fire wall is not like a front, and shops below are darker than the storeys above: of each a straight line is
    fitted to the colours over the height.
    """
    area = np.linalg.norm(walls.normals, axis=1)
    upright = (np.abs(walls.normals[:, 2]) < 0.5 * area) & (of >= 0)
    walls, of, area = walls.where(upright), of[upright], area[upright] * walls.cover[upright]
    base, tall = np.array([(b.base, max(b.height, 1.0)) for b in buildings]).T
    rise = (walls.corners[..., 2] - base[of, None]) / tall[of, None]
    at = rise.mean(axis=1)
    # Over a triangle: the square of its middle's height and how far its corners lie from that.
    square = at**2 + ((rise - at[:, None]) ** 2).sum(axis=1) / 12.0
    values = np.column_stack([walls.colour, at[:, None] * walls.colour, at, square])
    sums = sums_by(_SECTORS * of + _sector(walls.normals), area, values, _SECTORS * len(own)).reshape(-1, _SECTORS, 9)
    total = sums.sum(axis=1, keepdims=True)
    weight = np.maximum(total[..., 8:], 1e-9)
    mean = np.where(total[..., 8:] > 0.0, total[..., :3] / weight, 0.7 * own[:, None])
    # What few square metres of reveals face is no wall.
    enough = sums[..., 8:] > np.maximum(0.04 * total[..., 8:], 1e-9)
    weight = np.where(enough, sums[..., 8:], 1.0)
    middle, centre = np.where(enough, sums[..., :3] / weight, mean), sums[..., 6:7] / weight
    spread = sums[..., 7:8] / weight - centre**2
    slope = (sums[..., 3:6] / weight - centre * middle) / np.maximum(spread, 0.02)
    slope = np.where(enough, slope, 0.0)
    foot, head = (middle + slope * (end - centre) for end in (0.0, 1.0))
    return np.clip(np.stack([foot, head], axis=2), 0.6 * middle[:, :, None], 1.3 * middle[:, :, None])


def _sector(normals: NDArray[np.float64]) -> NDArray[np.int64]:
    turn = np.arctan2(normals[..., 1], normals[..., 0]) / (2.0 * np.pi) * _SECTORS
    return np.round(turn).astype(np.int64) % _SECTORS


def _roof_colours(roofs: Looks, of: NDArray[np.int64], own: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return colours of what lies and of what slopes, ``(n, 2, 3)``: slates around gravel are not both grey."""
    count = len(own)
    upward = (roofs.normals[:, 2] > 0.0) & (of >= 0)
    roofs, of = roofs.where(upward), of[upward]
    slopes = roofs.normals[:, 2] < 0.99 * np.linalg.norm(roofs.normals, axis=1)
    sums = sums_by(2 * of + slopes, roofs.normals[:, 2] * roofs.cover, roofs.colour, 2 * count).reshape(count, 2, 4)
    total = sums.sum(axis=1, keepdims=True)
    mean = np.where(total[..., 3:] > 0.0, total[..., :3] / np.maximum(total[..., 3:], 1e-9), own[:, None])
    enough = sums[..., 3:] > 0.1 * total[..., 3:]
    return np.where(enough, sums[..., :3] / np.maximum(sums[..., 3:], 1e-9), mean)


def _add_part(
    pieces: _Pieces, building: Building, part: FarPart, facades: NDArray[np.float64], tops: NDArray[np.float64]
) -> None:
    """Add walls and roof of a part of a building."""
    eaves, roof, gables = roof_over(building, part)
    if eaves - part.foot < 0.2:
        return
    for ring in (part.outline.exterior, *part.outline.interiors):
        p = shapely.get_coordinates(ring)
        p, q = p[:-1], p[1:]
        along = q - p
        colour = facades[_sector(np.column_stack([along[:, 1], -along[:, 0]]))]
        low, high = np.full(len(p), part.foot), np.full(len(p), eaves)
        a, b, c, d = np.c_[p, low], np.c_[q, low], np.c_[q, high], np.c_[p, high]
        foot, head = colour[:, 0], colour[:, 1]
        for corners, colours in (((a, b, c), (foot, foot, head)), ((a, c, d), (foot, head, head))):
            pieces.add(np.stack(corners, axis=1), np.stack(colours, axis=1), building.entity)
    turn = np.cross(roof[:, 1] - roof[:, 0], roof[:, 2] - roof[:, 0])
    slopes = turn[:, 2] < 0.99 * np.linalg.norm(turn, axis=1)
    pieces.add(roof, tops[slopes.astype(np.int64)][:, None], building.entity)
    if len(gables):
        normals = np.cross(gables[:, 1] - gables[:, 0], gables[:, 2] - gables[:, 0])
        pieces.add(gables, facades[_sector(normals), 1][:, None], building.entity)
