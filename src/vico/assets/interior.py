"""Rooms seen from inside: floors, ceilings, walls with openings, windows, doors, stairs, lamps. Faces look inwards."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from vico.assets.shapes import Colour
from vico.seeds import rng
from vico.world.mesh import Material, Surface, surface_of_quads
from vico.world.model import FLIGHT_STEPS, LANDING

#: Height from one floor of a place to the next, metres.
RISE = 3.2
DOOR_HEIGHT = 2.1
WALL_HEIGHT = 2.7
THICK = 0.1  # metres between the faces of a wall
# Of windows above the floor, metres.
SILL = 0.85
SHOP_SILL = 0.4
HEAD = 2.35
_TILE = {"planks": 2.0, "tiles": 1.2, "carpet": 2.0, "stone": 1.6, "concrete": 4.0, "parquet": 1.2, "chequer": 1.2}
_WALL_TILE = 2.4
_SKIRTING = 5  # rows of a wall's picture
FLOORS = tuple(_TILE)
WALLS = ("plaster", "wallpaper", "tiled", "brick", "panels")
#: Name of the windows' material.
WINDOW = "room_window"


@dataclass(frozen=True)
class WallOpening:
    """Something in a wall.

    Attributes
    ----------
    side
        0 east, 1 north, 2 west, 3 south.
    at
        Its middle along the wall, in the room's frame, metres.
    width, low, high
        Metres; heights above the room's floor.
    kind
        ``door`` (open, to another room), ``entrance`` (a closed door) or ``window``.
    reveal
        Whether this room draws the thickness of the wall.
    """

    side: int
    at: float
    width: float
    low: float
    high: float
    kind: str
    reveal: bool = False


@dataclass(frozen=True)
class Inside:
    """A room to be drawn: middle of its floor, extent, looks, what is in its walls; entity as the surfaces get it."""

    entity: int
    centre: tuple[float, float, float]
    size: tuple[float, float, float]
    floor: str
    floor_colour: Colour
    walls: str
    wall_colour: Colour
    openings: tuple[WallOpening, ...]
    rise: float = 0.0
    facing: int = 0


@cache
def floor_material(kind: str) -> Material:
    """Make a floor's texture, one of `FLOORS`; near white, to be tinted."""
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
    elif kind == "parquet":
        part = side // 4
        for i in range(4):
            for j in range(4):
                block = picture[i * part : (i + 1) * part, j * part : (j + 1) * part]
                for k in range(4):
                    lath = slice(k * part // 4, (k + 1) * part // 4)
                    value = random.uniform(190, 238)
                    if (i + j) % 2:
                        block[lath], block[k * part // 4] = value, 150
                    else:
                        block[:, lath], block[:, k * part // 4] = value, 150
    elif kind == "chequer":
        part = side // 2
        picture[:part, part:] = picture[part:, :part] = 84
        picture += random.normal(0, 4, (side, side))
    elif kind in ("tiles", "stone"):
        picture += random.normal(0, 3, (side, side))
        count = 4 if kind == "tiles" else 2
        if kind == "stone":
            for i in range(2):
                for j in range(2):
                    picture[i * 64 : (i + 1) * 64, j * 64 : (j + 1) * 64] += random.uniform(-22, 8)
        for k in range(0, side, side // count):
            picture[k : k + 2] = 165
            picture[:, k : k + 2] = 165
    else:
        picture += random.normal(0, 9 if kind == "carpet" else 5, (side, side))
    grey = np.clip(picture, 70, 250).astype(np.uint8)
    return Material(f"floor_{kind}", np.repeat(grey[..., None], 3, axis=2))


@cache
def wall_material(kind: str) -> Material:
    """Make a wall's texture, one of `WALLS`, from the floor (v = 0) to the ceiling (v = 1); near white."""
    random = rng(0, "wall", kind)
    side = 128
    picture = np.full((side, side, 3), 240.0)
    rows = np.arange(side)[:, None]
    columns = np.arange(side)[None, :]
    if kind == "wallpaper":
        stripe = ((columns // 8) % 2) * 12.0
        dots = (((columns + 8 * ((rows // 16) % 2)) % 16 < 3) & (rows % 16 < 3)) * 34.0
        picture -= (stripe + dots)[..., None]
    elif kind == "tiled":
        joint = (rows % 10 == 0) | ((columns + 8 * ((rows // 10) % 2)) % 16 == 0)
        picture[:90][joint[:90]] -= 42
        picture[90:94] = 120
    elif kind == "brick":
        joint = (rows % 8 == 0) | ((columns + 8 * ((rows // 8) % 2)) % 16 == 0)
        tone = random.normal(0, 9, (16, 8))
        picture += np.kron(tone, np.ones((8, 16)))[..., None] - 14
        picture[joint] = 214
    elif kind == "panels":
        picture[:52] = np.array([168, 122, 84]) + random.normal(0, 4, (52, side, 1))
        picture[50:54] = np.array([112, 76, 50])
        for k in range(0, side, 32):
            picture[8:46, k + 3 : k + 5] = picture[8:46, k + 27 : k + 29] = np.array([128, 88, 58])
            picture[8:10, k + 3 : k + 29] = picture[44:46, k + 3 : k + 29] = np.array([128, 88, 58])
    else:
        picture += random.normal(0, 2.5, (side, side, 1))
    picture[:_SKIRTING] = np.array([176, 170, 160]) if kind != "panels" else np.array([104, 70, 46])
    picture[_SKIRTING] = 120
    return Material(f"wall_{kind}", np.clip(picture, 40, 252).astype(np.uint8))


@cache
def window_material() -> Material:
    """Make a window in its frame: sky, and the houses across the street; it shines."""
    random = rng(0, "window")
    picture = np.zeros((128, 128, 3))
    up = np.linspace(0, 1, 128)[:, None, None]
    picture[:] = np.array([236, 240, 244]) * (1 - up) + np.array([150, 192, 236]) * up
    x = 0
    while x < 128:
        wide, high = int(random.integers(22, 44)), int(random.integers(36, 74))
        tone = random.uniform(0.8, 1.0) * np.array([222, 206, 184])
        picture[:high, x : x + wide] = tone
        for row in range(6, high - 8, 14):
            for column in range(x + 4, min(x + wide, 128) - 6, 10):
                picture[row : row + 8, column : column + 5] = np.array([120, 136, 150])
        picture[high : high + 3, x : x + wide] = np.array([140, 92, 76])
        x += wide
    picture[:10] = np.array([120, 150, 96])
    for part in (slice(0, 7), slice(121, 128), slice(61, 67)):
        picture[:, part] = 240
    for part in (slice(0, 8), slice(120, 128)):
        picture[part] = 240
    return Material(WINDOW, np.clip(picture, 0, 255).astype(np.uint8), emission=1.0)


@cache
def door_material() -> Material:
    """Make a panelled entrance door in its frame."""
    picture = np.full((128, 64, 3), (124, 80, 54), np.float64)
    picture[:, :5] = picture[:, 59:] = picture[123:] = (232, 228, 218)
    for low, high in ((8, 56), (68, 114)):
        picture[low:high, 12:52] = (104, 64, 42)
        picture[low + 3 : high - 3, 15:49] = (134, 90, 62)
    picture[56:66, 46:54] = (206, 196, 160)
    return Material("room_door", picture.astype(np.uint8))


_Vector = Sequence[float] | NDArray[np.float64]


class _Quads:
    """Rectangles by material, turned into surfaces at once."""

    def __init__(self) -> None:
        self._rows: dict[str, tuple[Material, list[tuple[float, ...]]]] = {}

    def add(
        self,
        material: Material,
        entity: int,
        colour: Colour,
        origin: _Vector,
        u: _Vector,
        v: _Vector,
        uv: tuple[float, float, float, float] = (0.0, 0.0, 1.0, 1.0),
    ) -> None:
        """Add a rectangle from `origin` along `u` and `v`; its front is where u x v points."""
        self._rows.setdefault(material.name, (material, []))[1].append((*origin, *u, *v, *uv, *colour, entity))

    def surfaces(self) -> list[Surface]:
        """One surface a material."""
        found = []
        for material, rows in self._rows.values():
            a = np.array(rows, np.float64)
            origin, u, v, box, colour, entity = np.split(a, np.cumsum([3, 3, 3, 4, 3]), axis=1)
            points = np.stack([origin, origin + u, origin + u + v, origin + v], axis=1)
            normal = np.cross(u, v)
            normal /= np.linalg.norm(normal, axis=1, keepdims=True)
            uv = np.stack([box[:, [0, 1]], box[:, [2, 1]], box[:, [2, 3]], box[:, [0, 3]]], axis=1)
            found.append(surface_of_quads(points, normal, uv, colour=colour, entity=entity.ravel(), material=material))
        return found


_FRAME: Colour = (226, 222, 212)
_LAMP: Colour = (255, 252, 242)


def shell(rooms: Sequence[Inside]) -> list[Surface]:
    """Return the rooms' surfaces, one a material, in the frame the rooms are given in."""
    quads = _Quads()
    for room in rooms:
        if room.rise:
            _stairs(quads, room)
        else:
            _floor(quads, room)
        _ceiling(quads, room)
        for side in range(4):
            _wall(quads, room, side)
    return quads.surfaces()


def _floor(quads: _Quads, room: Inside) -> None:
    (cx, cy, cz), (x, y, _) = room.centre, room.size
    tile = _TILE[room.floor]
    quads.add(
        floor_material(room.floor),
        room.entity,
        room.floor_colour,
        (cx - x / 2, cy - y / 2, cz),
        (x, 0, 0),
        (0, y, 0),
        (0, 0, x / tile, y / tile),
    )


def _ceiling(quads: _Quads, room: Inside) -> None:
    (cx, cy, cz), (x, y, z) = room.centre, room.size
    plain = Material("room_ceiling", emission=0.5)
    lamp = Material("room_light", emission=1.0)
    quads.add(plain, room.entity, (244, 242, 238), (cx - x / 2, cy + y / 2, cz + z), (x, 0, 0), (0, -y, 0))
    columns, rows = max(1, round(x / 3.6)), max(1, round(y / 3.6))
    wide, deep = (1.1, 0.3) if x >= y else (0.3, 1.1)
    wide, deep = min(wide, x * 0.6), min(deep, y * 0.6)
    for i in range(columns):
        for j in range(rows):
            lx, ly = cx + ((i + 0.5) / columns - 0.5) * x, cy + ((j + 0.5) / rows - 0.5) * y
            quads.add(
                lamp, room.entity, _LAMP, (lx - wide / 2, ly + deep / 2, cz + z - 0.02), (wide, 0, 0), (0, -deep, 0)
            )


def _axes(room: Inside, side: int) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], float]:
    """Middle of a wall's foot, the direction along it (so that along x up looks inwards), inwards, half its length."""
    (cx, cy, cz), (x, y, _) = room.centre, room.size
    inwards = np.array([(-1, 0, 0), (0, -1, 0), (1, 0, 0), (0, 1, 0)][side], np.float64)
    along = np.array([(0, -1, 0), (1, 0, 0), (0, 1, 0), (-1, 0, 0)][side], np.float64)
    half = (x if side in (0, 2) else y) / 2
    foot = np.array([cx, cy, cz]) - inwards * half
    return foot, -along, inwards, (y if side in (0, 2) else x) / 2


def _wall(quads: _Quads, room: Inside, side: int) -> None:
    foot, along, inwards, half = _axes(room, side)
    up = np.array([0.0, 0.0, 1.0])
    if float(np.cross(along, up) @ inwards) < 0:
        along = -along
    sign = 1.0 if float(along.sum()) > 0 else -1.0
    high = room.size[2]
    material = wall_material(room.walls)
    top = max(1.0, round(high / WALL_HEIGHT)) if high > 4.0 else 1.0

    def piece(s0: float, s1: float, z0: float, z1: float) -> None:
        if s1 - s0 > 1e-6 and z1 - z0 > 1e-6:
            quads.add(
                material,
                room.entity,
                room.wall_colour,
                foot + along * s0 + up * z0,
                along * (s1 - s0),
                up * (z1 - z0),
                (s0 / _WALL_TILE, z0 / high * top, s1 / _WALL_TILE, z1 / high * top),
            )

    holes = (
        sorted(
            (o.at * sign - o.width / 2, o.at * sign + o.width / 2, o)
            for o in room.openings
            if o.side == side and o.kind == "door"
        )
        if room.openings
        else []
    )
    edge = -half
    for s0, s1, opening in holes:
        piece(edge, s0, 0.0, high)
        piece(s0, s1, 0.0, opening.low)
        piece(s0, s1, opening.high, high)
        edge = s1
        if opening.reveal:
            _reveal(
                quads,
                room,
                foot + along * s0 + up * opening.low,
                along * (s1 - s0),
                up * (opening.high - opening.low),
                -inwards * THICK,
            )
    piece(edge, half, 0.0, high)
    for opening in room.openings:
        if opening.side == side and opening.kind != "door":
            s0 = opening.at * sign - opening.width / 2
            origin = foot + along * s0 + up * opening.low + inwards * 0.02
            chosen = window_material() if opening.kind == "window" else door_material()
            quads.add(
                chosen, room.entity, (255, 255, 255), origin, along * opening.width, up * (opening.high - opening.low)
            )


def _reveal(
    quads: _Quads,
    room: Inside,
    origin: NDArray[np.float64],
    wide: NDArray[np.float64],
    high: NDArray[np.float64],
    out: NDArray[np.float64],
) -> None:
    """Draw the thickness of a wall around a doorway."""
    plain = Material("room_frame")
    quads.add(plain, room.entity, _FRAME, origin + out, -out, high)
    quads.add(plain, room.entity, _FRAME, origin + wide, out, high)
    quads.add(plain, room.entity, _FRAME, origin + high, out, wide)
    quads.add(plain, room.entity, (150, 140, 126), origin, wide, out)


def _stairs(quads: _Quads, room: Inside) -> None:
    """Two flights and three landings; in own coordinates the lower flight lies at negative y and climbs along x."""
    turn = room.facing % 4
    c, s = (1, 0, -1, 0)[turn], (0, 1, 0, -1)[turn]
    length, wide = (room.size[0], room.size[1]) if turn % 2 == 0 else (room.size[1], room.size[0])
    plain, riser_tone = floor_material("stone"), (150, 146, 138)

    def at(u: float, v: float, z: float) -> tuple[float, float, float]:
        return room.centre[0] + c * u - s * v, room.centre[1] + s * u + c * v, room.centre[2] + z

    def direct(u: float, v: float) -> tuple[float, float, float]:
        return c * u - s * v, s * u + c * v, 0.0

    def level(u0: float, u1: float, v0: float, v1: float, z: float) -> None:
        quads.add(
            plain,
            room.entity,
            room.floor_colour,
            at(u0, v0, z),
            direct(u1 - u0, 0),
            direct(0, v1 - v0),
            (0, 0, u1 - u0, v1 - v0),
        )

    half, west = wide / 2, -length / 2
    run, rise = length - 2 * LANDING, room.rise / 2
    level(west, west + LANDING, -half, 0.0, 0.0)
    level(west, west + LANDING, 0.0, half, room.rise)
    level(west + LANDING + run, length / 2, -half, half, rise)
    tread, riser = run / FLIGHT_STEPS, rise / FLIGHT_STEPS
    for k in range(FLIGHT_STEPS):
        start = west + LANDING + k * tread
        level(start, start + tread, -half, 0.0, (k + 1) * riser)
        quads.add(
            plain, room.entity, riser_tone, at(start, 0.0, k * riser), direct(0, -half), (0, 0, riser), (0, 0, 1, 0.2)
        )
        back = west + LANDING + run - k * tread
        level(back - tread, back, 0.0, half, rise + (k + 1) * riser)
        quads.add(
            plain,
            room.entity,
            riser_tone,
            at(back, 0.0, rise + k * riser),
            direct(0, half),
            (0, 0, riser),
            (0, 0, 1, 0.2),
        )
