"""Rooms seen from inside: floor, ceiling, walls with doorways, an entrance door, a lamp. Surfaces face inwards."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np

from vico.assets.shapes import Colour, box
from vico.world.mesh import Material, Surface
from vico.world.seeds import rng

DOOR_WIDTH = 1.0
DOOR_HEIGHT = 2.1
WALL_HEIGHT = 2.7
_TILE = {"planks": 2.0, "tiles": 1.2, "carpet": 2.0}


@cache
def floor_material(kind: str) -> Material:
    """A floor texture: ``planks``, ``tiles`` or ``carpet``; near white, to be tinted."""
    random = rng(0, "floor", kind)
    side = 128
    picture = np.full((side, side), 225.0)
    if kind == "planks":
        rows = 8
        for row in range(rows):
            cut = int(random.integers(side))
            band = slice(row * side // rows, (row + 1) * side // rows)
            picture[band] = random.uniform(195, 235)
            picture[band, cut : cut + side // 2] = random.uniform(195, 235)
            picture[band] += np.cumsum(random.normal(0, 1.4, side))[None] * 0.5
            picture[row * side // rows] = 140
            picture[band, cut] = 150
    elif kind == "tiles":
        picture += random.normal(0, 3, (side, side))
        for k in range(0, side, side // 4):
            picture[k : k + 2] = 165
            picture[:, k : k + 2] = 165
    else:
        picture += random.normal(0, 9, (side, side))
    grey = np.clip(picture, 90, 250).astype(np.uint8)
    return Material(f"floor_{kind}", np.repeat(grey[..., None], 3, axis=2))


def _quad(
    origin: Sequence[float],
    u: Sequence[float],
    v: Sequence[float],
    colour: Colour,
    material: Material,
    tile: float = 1.0,
) -> Surface:
    """A rectangle from `origin` along `u` and `v`; its front is where u x v points."""
    o, a, b = (np.asarray(w, np.float64) for w in (origin, u, v))
    corners = np.array([o, o + a, o + a + b, o + b])
    wide, high = float(np.linalg.norm(a)) / tile, float(np.linalg.norm(b)) / tile
    uv = np.array([[0, 0], [wide, 0], [wide, high], [0, high]])
    normal = np.cross(a, b)
    normals = np.tile(normal / np.linalg.norm(normal), (4, 1))
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    return Surface.from_triangles(corners, faces, colour=colour, uv=uv, normals=normals, material=material)


def room_shell(
    size: tuple[float, float],
    *,
    doorways: Sequence[tuple[str, float]],
    entrance: tuple[str, float] | None,
    floor: str,
    floor_colour: Colour,
    wall_colour: Colour,
) -> list[Surface]:
    """The inside of a room around the origin (middle of its floor).

    Parameters
    ----------
    size
        Extent along x and y, metres.
    doorways
        Openings to other rooms: the wall (``west`` or ``east``) and the place along y.
    entrance
        Where the closed door to the outside is.
    floor
        ``planks``, ``tiles`` or ``carpet``.
    """
    x, y = size[0] / 2, size[1] / 2
    z = WALL_HEIGHT
    plain = Material("room_wall")
    light = Material("room_light", emission=1.0)
    parts = [
        _quad((-x, -y, 0), (2 * x, 0, 0), (0, 2 * y, 0), floor_colour, floor_material(floor), _TILE[floor]),
        _quad((-x, y, z), (2 * x, 0, 0), (0, -2 * y, 0), (238, 236, 230), plain),
        _quad((-x, y, 0), (2 * x, 0, 0), (0, 0, z), wall_colour, plain),
        _quad((x, -y, 0), (-2 * x, 0, 0), (0, 0, z), wall_colour, plain),
        _quad((-0.5, 0.2, z - 0.02), (1.0, 0, 0), (0, -0.4, 0), (255, 250, 236), light),
    ]
    for wall, at, direction in (("west", -x, 1.0), ("east", x, -1.0)):
        holes = sorted(place for side, place in doorways if side == wall)
        parts += _wall_with_holes(at, y, direction, holes, wall_colour, plain)
    skirting = (int(wall_colour[0] * 0.72), int(wall_colour[1] * 0.72), int(wall_colour[2] * 0.72))
    parts.append(_quad((-x, y - 0.012, 0), (2 * x, 0, 0), (0, 0, 0.09), skirting, plain))
    parts.append(_quad((x, 0.012 - y, 0), (-2 * x, 0, 0), (0, 0, 0.09), skirting, plain))
    if entrance is not None:
        at = -x if entrance[0] == "west" else x
        parts.append(box((0.06, DOOR_WIDTH + 0.14, DOOR_HEIGHT + 0.07), (at, entrance[1], (DOOR_HEIGHT + 0.07) / 2),
                         colour=(226, 222, 212), material=plain))  # fmt: skip
        parts.append(box((0.09, DOOR_WIDTH, DOOR_HEIGHT), (at, entrance[1], DOOR_HEIGHT / 2), colour=(122, 78, 52),
                         material=plain))  # fmt: skip
        parts.append(box((0.16, 0.12, 0.03), (at, entrance[1] - 0.38, 1.02), colour=(196, 190, 170), material=plain))
    return parts


def _wall_with_holes(
    x: float, y: float, direction: float, holes: Sequence[float], colour: Colour, material: Material
) -> list[Surface]:
    """A wall across y at `x` that faces `direction`, open where the doorways are."""

    def piece(y0: float, y1: float, z0: float, z1: float) -> Surface:
        if direction < 0:
            return _quad((x, y1, z0), (0, y0 - y1, 0), (0, 0, z1 - z0), colour, material)
        return _quad((x, y0, z0), (0, y1 - y0, 0), (0, 0, z1 - z0), colour, material)

    parts = []
    edge = -y
    for place in holes:
        parts.append(piece(edge, place - DOOR_WIDTH / 2, 0, WALL_HEIGHT))
        parts.append(piece(place - DOOR_WIDTH / 2, place + DOOR_WIDTH / 2, DOOR_HEIGHT, WALL_HEIGHT))
        edge = place + DOOR_WIDTH / 2
    parts.append(piece(edge, y, 0, WALL_HEIGHT))
    return parts
