"""Houses from afar: walls of simplified outlines and plain roofs, in the mean colours of what their meshes show."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.exact import each
from vico.world.far_parts import FarPart, far_outline, parts_by_height
from vico.world.far_roofs import roof_over
from vico.world.far_windows import SHOWN, WINDOWS, has_windows, places_of
from vico.world.mean_colours import LINEAR, Looks, looks_from_afar, spread_points, srgb, sums_by
from vico.world.mesh import Material, Surface
from vico.world.model import Building
from vico.world.world import World

_SECTORS = 8  # of directions that a building's walls have colours of their own for
_GLAZED = 0.01  # share of its light that a wall with windows gives of its own by night, at least
_LOWEST = 0.2  # metres; lower walls, and the roof over them, are left out


def far_houses(world: World, material: Material) -> Iterator[Surface]:
    """Make the houses of a world.

    Parameters
    ----------
    world
        The world.
    material
        What they are of where they have no windows; it has no texture.

    Returns
    -------
    iterator of Surface
        One of all roofs and blind walls, one of all walls with windows (`vico.world.far_windows`), flat-shaded, in the
        world's frame; vertices have the entities of their buildings. None where there are no houses.
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
    facades, shines = _wall_colours(walls, number(walls.entity), own, buildings)
    tops = _roof_colours(roofs, number(roofs.entity), 0.6 * own)
    up = roofs.where(roofs.normals[:, 2] > 0.2 * np.linalg.norm(roofs.normals, axis=1))
    triangle, place, _ = spread_points(up.corners, up.normals[:, 2], 1.0)
    of = number(up.entity)[triangle]
    by_building = np.argsort(of, kind="stable")
    place, starts = place[by_building], np.searchsorted(of[by_building], np.arange(len(known) + 1))
    pieces, windows = _Pieces(), _Pieces()
    for k, building in enumerate(buildings):
        outline = far_outline(building)
        if not outline.is_empty:
            parts = parts_by_height(world, building, outline, place[starts[k] : starts[k + 1]])
            for part in parts:
                eaves, *roof = roof_over(building, part)
                if eaves - part.foot >= _LOWEST:
                    _add_walls((pieces, windows), building, part, eaves, (facades[k], shines[k]))
                    _add_roof(pieces, building, roof, facades[k], tops[k])
    yield from pieces.surfaces(material)
    yield from windows.surfaces(WINDOWS)


class _Pieces:
    """Collects triangles: corners, colours in linear light, places in a picture, entities."""

    def __init__(self) -> None:
        self._corners: list[NDArray[np.float64]] = []
        self._colours: list[NDArray[np.float64]] = []
        self._places: list[NDArray[np.float64]] = []
        self._entities: list[NDArray[np.int32]] = []

    def add(
        self,
        corners: NDArray[np.float64],
        colour: NDArray[np.float64],
        entity: int,
        places: NDArray[np.float64] | None = None,
    ) -> None:
        """Add triangles ``(n, 3, 3)`` of an entity, of colours ``(n, 3, 3)`` or broadcast, at places ``(n, 3, 2)``."""
        count = len(corners)
        self._places.append(np.zeros((count, 3, 2)) if places is None else places)
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
                np.concatenate(self._places)[seen].reshape(-1, 2).astype(np.float32),
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
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return colours of walls at their foot and at their head, by building and direction, ``(n, _SECTORS, 2, 3)``.

    And how much of their light they give of their own by night, ``(n, _SECTORS)``. A fire wall is not like a front, and
    shops below are darker than the storeys above: of each a straight line is fitted to the colours over the height.
    """
    area = np.linalg.norm(walls.normals, axis=1)
    upright = (np.abs(walls.normals[:, 2]) < 0.5 * area) & (of >= 0)
    walls, of, area = walls.where(upright), of[upright], area[upright] * walls.cover[upright]
    base, tall = np.array([(b.base, max(b.height, 1.0)) for b in buildings]).T
    rise = (walls.corners[..., 2] - base[of, None]) / tall[of, None]
    at = rise.mean(axis=1)
    # Over a triangle: the square of its middle's height and how far its corners lie from that.
    square = at**2 + ((rise - at[:, None]) ** 2).sum(axis=1) / 12.0
    values = np.column_stack([walls.colour, at[:, None] * walls.colour, at, square, walls.shine])
    sums = sums_by(_SECTORS * of + _sector(walls.normals), area, values, _SECTORS * len(own)).reshape(-1, _SECTORS, 10)
    total = sums.sum(axis=1, keepdims=True)
    weight = np.maximum(total[..., 9:], 1e-9)
    mean = np.where(total[..., 9:] > 0.0, total[..., :3] / weight, 0.7 * own[:, None])
    # What few square metres of reveals face is no wall.
    enough = sums[..., 9:] > np.maximum(0.04 * total[..., 9:], 1e-9)
    weight = np.where(enough, sums[..., 9:], 1.0)
    middle, centre = np.where(enough, sums[..., :3] / weight, mean), sums[..., 6:7] / weight
    spread = sums[..., 7:8] / weight - centre**2
    slope = (sums[..., 3:6] / weight - centre * middle) / np.maximum(spread, 0.02)
    slope = np.where(enough, slope, 0.0)
    foot, head = (middle + slope * (end - centre) for end in (0.0, 1.0))
    colours = np.clip(np.stack([foot, head], axis=2), 0.6 * middle[:, :, None], 1.3 * middle[:, :, None])
    return colours, np.where(enough, sums[..., 8:9] / weight, 0.0)[..., 0]


def _sector(normals: NDArray[np.float64]) -> NDArray[np.int64]:
    turn = each(math.atan2, normals[..., 1], normals[..., 0]) / (2.0 * np.pi) * _SECTORS
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


def _add_walls(
    pieces: tuple[_Pieces, _Pieces],
    building: Building,
    part: FarPart,
    eaves: float,
    looks: tuple[NDArray[np.float64], NDArray[np.float64]],
) -> None:
    """Add the walls of a part of a building: blind ones to the first pieces, those with windows to the second."""
    facades, shines = looks
    for number, ring in enumerate((part.outline.exterior, *part.outline.interiors)):
        p = shapely.get_coordinates(ring)
        p, q = p[:-1], p[1:]
        along = q - p
        sector = _sector(np.column_stack([along[:, 1], -along[:, 0]]))
        low, high = np.full(len(p), part.foot), np.full(len(p), eaves)
        quads = np.stack([np.c_[p, low], np.c_[q, low], np.c_[q, high], np.c_[p, high]], axis=1)
        colours = facades[sector][:, [0, 0, 1, 1]]
        length, base = np.hypot(*along.T), max(part.foot, building.base)
        glazed = has_windows(length, eaves - base) & (shines[sector] > _GLAZED)
        places = places_of(length, part.foot, min(base, eaves - 0.1), eaves, building.entity + number)
        for chosen, into, shown in ((~glazed, pieces[0], 1.0), (glazed, pieces[1], SHOWN)):
            for corners in ([0, 1, 2], [0, 2, 3]):
                found = quads[chosen][:, corners], colours[chosen][:, corners] / shown
                into.add(*found, building.entity, places[chosen][:, corners] if into is pieces[1] else None)


def _add_roof(
    pieces: _Pieces,
    building: Building,
    roof_and_gables: Sequence[NDArray[np.float64]],
    facades: NDArray[np.float64],
    tops: NDArray[np.float64],
) -> None:
    """Add the roof of a part of a building, with its gables."""
    roof, gables = roof_and_gables
    turn = np.cross(roof[:, 1] - roof[:, 0], roof[:, 2] - roof[:, 0])
    slopes = turn[:, 2] < 0.99 * np.linalg.norm(turn, axis=1)
    pieces.add(roof, tops[slopes.astype(np.int64)][:, None], building.entity)
    if len(gables):
        normals = np.cross(gables[:, 1] - gables[:, 0], gables[:, 2] - gables[:, 0])
        pieces.add(gables, facades[_sector(normals), 1][:, None], building.entity)
