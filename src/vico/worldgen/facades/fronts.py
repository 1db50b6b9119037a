"""Fronts at the entrances: doors by use, shop fronts with the shop's name, canopies, awnings, projecting signs."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely

from vico.seeds import rng
from vico.world.check.buildings import overlapping_faces
from vico.world.mesh import Surface
from vico.world.model import FAILED, Building, Category, Entrance, Place
from vico.worldgen.facades.facade_styles import mix_colours
from vico.worldgen.facades.signs import Board, Boards, Lettering, colours_of, drawable_text, paint_boards
from vico.worldgen.facades.street_names import Streets, name_plates
from vico.worldgen.facades.walls import (
    Face,
    GroundFloors,
    Pieces,
    Rgb,
    Wall,
    cell_uv,
    cover_with_blank_wall,
    is_blank_wall,
)
from vico.worldgen.facts.fault_isolation import drop_on_failure, leave_out
from vico.worldgen.facts.street_habits import Plates

_WHITE: Rgb = (255, 255, 255)
_STONE: Rgb = (222, 218, 210)
_DOOR_COLOURS: tuple[Rgb, ...] = (
    (122, 78, 52),
    (92, 62, 46),
    (62, 84, 72),
    (58, 70, 92),
    (128, 56, 48),
    (150, 118, 82),
    (52, 52, 54),
    (104, 46, 52),
)
_GLAZED = {"retail", "commercial", "office", "civic", "transport", "health", "education"}
_SHELVES = {
    "books",
    "supermarket",
    "convenience",
    "pharmacy",
    "bakery",
    "alcohol",
    "stationery",
    "toys",
    "deli",
    "wine",
}
_DUMMIES = {"clothes", "shoes", "fashion", "boutique", "fabric", "bag", "second_hand", "charity", "department_store"}
_LONGEST_NUMBER = 7  # characters
_MOST_SHIFT = 0.6  # metres a door may stand beside its entrance: the threshold is wider than that
_TOUCH = 0.05  # metres within which the front of one house may come to lie in a face of another
_SHARED_MATERIALS = ("ground_shops", "ground_cafes", "ground_loft", "ground_lobby")


@dataclass(frozen=True)
class Fronts:
    """Pieces for the layer "buildings", and how many there are of each kind."""

    surfaces: list[Surface]
    counts: dict[str, int]


@dataclass(frozen=True)
class _Spot:
    """An entrance, its wall, and the stretch of wall that is its own."""

    entrance: Entrance
    building: Building
    wall: Wall | None
    kind: str
    names: tuple[Place, ...]
    s: float = 0.0
    a: float = 0.0
    b: float = 0.0


def street_fronts(
    places: Sequence[Place],
    entrances: Sequence[Entrance],
    buildings: Sequence[Building],
    walls: Sequence[Surface],
    *,
    seed: int,
    streets: Streets | None = None,
) -> Fronts:
    """Put doors, shop fronts, signs and numbers at the entrances, and the names of streets at corners.

    Parameters
    ----------
    places
        Whose names the signs carry; those without an entrance have none.
    entrances
        Where the doors are.
    buildings
        What they belong to.
    walls
        The dressed walls: they say where bays begin and end, so that no window is cut in half.
    seed
        Decides between styles.
    streets
        What plates with the names of streets are hung by; none: there are no such plates.

    Returns
    -------
    Fronts
        Surfaces of few materials; counts of doors, shop fronts, signs and plates, and of signs left without letters
        because the name's script can't be drawn.
    """
    known = {building.id: building for building in buildings}
    ground = GroundFloors(walls)
    at_door: dict[str, list[Place]] = {}
    for place in places:
        if place.entrance is not None:
            at_door.setdefault(place.entrance, []).append(place)
    spots = []
    for entrance in entrances:
        with drop_on_failure(entrance.id):
            building = known[entrance.building]
            names = tuple(at_door.get(entrance.id, ()))
            wall = ground.at(building.entity, entrance.position[0], entrance.position[1], entrance.facing)
            spots.append(_Spot(entrance, building, wall, _kind(building, names), names))
    spots = _assign_bays(spots)
    signed = [p for spot in spots for p in spot.names if _has_board(p)]
    plates = Plates() if streets is None else streets.plates
    hung = [] if streets is None else name_plates(streets, buildings, ground)
    numbered = {spot.building.id: spot.building for spot in spots if spot.kind in _NUMBERED}
    numbers = {name: number for name, house in numbered.items() if (number := _number(house, plates)) is not None}
    boards = paint_boards(signed, [*(plate.lettering for plate in hung), *numbers.values()])
    materials = {m.name: m for m in (*(s.material for s in walls), *boards.materials)}
    built: list[_Built] = []
    for spot in spots:
        with drop_on_failure(spot.entrance.id):
            one = _Built(spot, Pieces(materials), Counter())
            front = _Front(spot, one.pieces, boards, one.counts, rng(seed, "front", spot.entrance.id))
            front.build()
            front.number(numbers.get(spot.building.id))
            built.append(one)
    pieces = Pieces(materials)
    counts: Counter[str] = Counter(doors=0, shop_fronts=0, signs=0, awnings=0, projecting_signs=0, house_numbers=0)
    for one in _apart(built, buildings, walls):
        pieces.absorb(one.pieces)
        counts.update(one.counts)
    counts["street_names"] = sum(plate.hang(boards, pieces) for plate in hung)
    counts["signs_without_letters"] = len(boards.mute)
    counts["sign_pages"] = len(boards.materials)
    return Fronts(pieces.surfaces(), dict(sorted(counts.items())))


@dataclass(frozen=True)
class _Built:
    """A front by itself: its pieces, and how many there are of each kind."""

    spot: _Spot
    pieces: Pieces
    counts: Counter[str]


def _apart(built: Sequence[_Built], buildings: Sequence[Building], walls: Sequence[Surface]) -> list[_Built]:
    """Leave out fronts with faces that lie in one plane with those of another house, or of a front of one."""
    near, houses = _near_others(built, buildings)
    if not near:
        return list(built)
    mine = [built[k].pieces.triangles() for k in near]
    standing = [s.positions[s.triangles] for s in walls]
    entities = np.concatenate([s.entity[s.triangles[:, 0]].astype(np.int64) for s in walls] or [np.zeros(0, np.int64)])
    # Fronts by their number, walls by their house's after them.
    owner = np.concatenate([np.repeat(near, [len(corners) for corners in mine]), len(built) + entities])
    among = np.concatenate([np.ones(sum(map(len, mine)), bool), np.isin(entities, list(houses))])
    lost: set[int] = set()
    for pair in sorted(overlapping_faces(np.concatenate([*mine, *standing]), owner, among=among)):
        whose = {built[k].spot.building.entity if k < len(built) else k - len(built) for k in pair}
        fronts = [k for k in pair if k < len(built)]
        if len(whose) == 2 and fronts and not lost & set(fronts):
            lost.add(max(fronts))
            leave_out(built[max(fronts)].spot.entrance.id, f"{FAILED}: its front lies in one plane with a neighbour's")
    return [one for k, one in enumerate(built) if k not in lost]


def _near_others(built: Sequence[_Built], buildings: Sequence[Building]) -> tuple[list[int], set[int]]:
    """Return the fronts that reach another house, or the front of one, and the entities of all houses concerned."""
    outlines = [shapely.Polygon(b.footprint[0], b.footprint[1:]) for b in buildings]
    corners = [one.pieces.triangles().reshape(-1, 3)[:, :2] for one in built]
    boxes = [shapely.box(*points.min(axis=0), *points.max(axis=0)) for points in corners]
    shapes = np.array([*outlines, *boxes], object)
    owner = np.array([*(b.entity for b in buildings), *(one.spot.building.entity for one in built)], np.int64)
    front, other = shapely.STRtree(shapes).query(np.array(boxes, object), predicate="dwithin", distance=_TOUCH)
    foreign = owner[len(buildings) + front] != owner[other]
    near = sorted(set(front[foreign].tolist()))
    return near, set(owner[other[foreign]].tolist())


def _number(building: Building, plates: Plates) -> Lettering | None:
    """Return the plate with a house's number; None where the map names none, or one that no plate has room for."""
    text = drawable_text(building.tags.get("addr:housenumber", "").split(";")[0].split(",")[0])
    if text is None or len(text) > _LONGEST_NUMBER:
        return None
    return Lettering(text, plates.number_ground, plates.number_letters, shines=False)


def _has_board(place: Place) -> bool:
    return place.kind not in ("apartments", "place_of_worship", "church") and place.category not in (
        Category.OPEN,
        Category.TRANSIT,
    )


def _kind(building: Building, names: Sequence[Place]) -> str:
    """Return what kind of entrance this is: shop, hotel, hall, office, church, gate, house or stairs."""
    if building.use == "religious":
        return "church"
    categories = {place.category for place in names}
    if categories & {Category.STORE, Category.FOOD}:
        return "shop"
    if Category.ACCOMMODATION in categories and any(place.kind != "apartments" for place in names):
        return "hotel"
    if Category.ENTERTAINMENT in categories:
        return "hall"
    if building.use == "hotel":
        return "hotel"
    if building.use in ("garage", "industrial"):
        return "gate"
    if building.use in _GLAZED and not any(place.kind == "apartments" for place in names):
        return "office"
    return "house" if building.levels <= 3 and _ground_area(building) < 200.0 else "stairs"


def _ground_area(building: Building) -> float:
    ring = np.asarray(building.footprint[0], np.float64)
    x, y = ring[:, 0], ring[:, 1]
    return abs(float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum())) / 2


_NUMBERED = ("house", "stairs", "office", "hotel")  # doors that have the house's number beside them
_NUMBER = 0.2  # metres, height of the number's plate
_NUMBER_AT = 2.0  # metres above the ground
_BESIDE_DOOR = 0.34  # metres beside the door
_ASIDE = 0.13  # metres beside a shop front at which its projecting sign hangs
_HEADROOM = 2.2  # metres below it
_WIDTH = {
    "shop": 1.3,
    "hotel": 2.3,
    "hall": 2.3,
    "office": 1.9,
    "church": 2.3,
    "gate": 2.7,
    "house": 1.05,
    "stairs": 1.5,
}


def _assign_bays(spots: Sequence[_Spot]) -> list[_Spot]:
    """Give every door the whole bays it touches; where two want the same, they meet halfway."""
    made: list[_Spot] = []
    by_wall: dict[tuple[int, float, float, float, float], list[_Spot]] = {}
    for spot in spots:
        wall = spot.wall
        if wall is None:
            half = _WIDTH[spot.kind] / 2 + 0.35
            made.append(_with(spot, 0.0, -half, half))
            continue
        key = (spot.building.entity, round(wall.start[0], 1), round(wall.start[1], 1), round(wall.right[0], 2),
               round(wall.length, 1))  # fmt: skip
        by_wall.setdefault(key, []).append(spot)
    for group in by_wall.values():
        rows = []
        for spot in group:
            wall = spot.wall
            assert wall is not None
            half = _WIDTH[spot.kind] / 2 + 0.3
            # Nothing of a doorway, its lintel and canopy included, hangs over the wall's end.
            clear = min(_WIDTH[spot.kind] / 2 + 0.46, wall.length / 2)
            s = min(max(wall.along(*spot.entrance.position[:2]), clear), wall.length - clear)
            s = _snap_to_bay(wall, s, half)
            a, b = wall.bay_edges(s - half, s + half)
            if spot.kind == "shop" and b - a < 3.4:  # a shop has a window beside its door
                a, b = wall.bay_edges(s - half - 0.9, s + half + 0.9)
            rows.append([s, a, b])
        order = sorted(range(len(rows)), key=lambda k: (rows[k][0], group[k].entrance.id))
        for left, right in pairwise(order):
            if rows[left][2] > rows[right][1]:
                rows[left][2] = rows[right][1] = (rows[left][0] + rows[right][0]) / 2
        made += [_with(spot, *rows[k]) for k, spot in enumerate(group)]
    rank = {spot.entrance.id: k for k, spot in enumerate(spots)}
    return sorted(made, key=lambda spot: rank[spot.entrance.id])


def _snap_to_bay(wall: Wall, s: float, half: float) -> float:
    """Move a door that would cost two bays their windows into one of them, if that is a small step away."""
    phase = wall.first - math.floor(wall.first)
    place = s / wall.bay + phase
    low, high = math.floor(place) + half / wall.bay, math.floor(place) + 1 - half / wall.bay
    if low > high or low <= place <= high or is_blank_wall(wall, s - half, s + half):
        return s
    moved = (min(max(place, low), high) - phase) * wall.bay
    on_wall = half <= moved <= wall.length - half
    return moved if on_wall and abs(moved - s) <= _MOST_SHIFT else s


def _with(spot: _Spot, s: float, a: float, b: float) -> _Spot:
    return _Spot(spot.entrance, spot.building, spot.wall, spot.kind, spot.names, s, a, b)


class _Front:
    """One entrance under construction."""

    def __init__(
        self, spot: _Spot, pieces: Pieces, boards: Boards, counts: Counter[str], random: np.random.Generator
    ) -> None:
        self.spot, self.boards, self.counts, self.random = spot, boards, counts, random
        entity = spot.building.entity
        wall = spot.wall
        self.face = Face.on(pieces, entity, wall) if wall is not None else Face.before(pieces, entity, spot.entrance)
        self.z = spot.entrance.position[2]
        self.top = wall.high if wall is not None else self.z + 3.4
        self.width = min(_WIDTH[spot.kind], spot.b - spot.a - 0.2)

    def build(self) -> None:
        """Choose and set the pieces."""
        spot, wall = self.spot, self.spot.wall
        self.counts["doors"] += 1
        room = self.top - self.z
        shop = spot.kind == "shop" and wall is not None and room > 2.75 and spot.b - spot.a > 1.6
        if wall is not None:
            margin = self.width / 2 + 0.25
            whole = not shop or wall.material not in _SHARED_MATERIALS
            if whole and not is_blank_wall(wall, spot.s - margin, spot.s + margin):
                cover_with_blank_wall(self.face, wall, spot.a, spot.b)
        if shop:
            self._shop()
        elif spot.kind in ("hotel", "hall"):
            self._hotel()
        elif spot.kind == "church":
            self._church()
        elif spot.kind == "gate":
            self._gate()
        else:
            self._doorway()

    def _door(self, cell: str, height: float, d: float, colour: Rgb = _WHITE) -> None:
        s, half = self.spot.s, self.width / 2
        self.face.panel(s - half, s + half, self.z - 0.05, self.z + height, d, uv=cell_uv(cell), colour=colour)

    def _surround(self, height: float, colour: Rgb, *, wide: float = 0.26, deep: float = 0.16) -> None:
        """Add posts, a lintel and a step of stone."""
        s, half, z = self.spot.s, self.width / 2, self.z
        for left, right in ((s - half - wide, s - half), (s + half, s + half + wide)):
            self.face.slab(left, right, z - 0.3, z + height, deep, colour=colour, cell="stone", under=False)
        self.face.slab(
            s - half - wide - 0.06, s + half + wide + 0.06, z + height, z + height + 0.28, deep + 0.05, colour=colour
        )
        self.face.slab(
            s - half - 0.1, s + half + 0.1, z - 0.3, z + 0.07, deep + 0.22, colour=(188, 184, 178), under=False
        )

    def _doorway(self) -> None:
        """Doors of homes and offices."""
        kind = self.spot.kind
        height = min(2.5 if kind != "house" else 2.25, max(self.top - self.z - 0.35, 1.95))
        colour = _DOOR_COLOURS[int(self.random.integers(len(_DOOR_COLOURS)))]
        stone = mix_colours(_STONE, self._tint(), 0.6)
        if kind == "office" or (kind == "shop"):
            self._door("glass" if kind == "shop" else "office", height, 0.05)
            self._surround(height, (96, 98, 100), wide=0.12, deep=0.12)
        elif kind == "house":
            self._door("single", height, 0.05, colour)
            self._surround(height, stone, wide=0.14, deep=0.1)
            half = self.width / 2 + 0.3
            if self.random.random() < 0.4:
                self.face.slab(
                    self.spot.s - half, self.spot.s + half, self.z + height + 0.28, self.z + height + 0.36, 0.7,
                    colour=(120, 116, 112),
                )  # fmt: skip
        else:
            self._door("double" if self.random.random() < 0.5 else "panelled", height, 0.05, colour)
            self._surround(height, stone)
        self._plates(height)

    def number(self, number: Lettering | None) -> None:
        """Add the house's number beside a door, on the side away from names, or on the other where that has no room."""
        wall = self.spot.wall
        board = None if number is None else self.boards.by_lettering.get(number)
        if board is None or wall is None or self.spot.kind not in _NUMBERED:
            return
        tall, s = _NUMBER, self.spot.s
        wide = tall * board.aspect
        beside = self.width / 2 + _BESIDE_DOOR
        left = s - beside - wide
        if left < 0.05:
            left = s + beside
            if left + wide > wall.length - 0.05:
                return
        z = min(self.z + _NUMBER_AT, self.top - tall - 0.05)
        stuff = self._page(board)
        self.face.panel(left, left + wide, z, z + tall, 0.04, uv=board.uv, colour=_WHITE, stuff=stuff)
        self.counts["house_numbers"] += 1

    def _tint(self) -> Rgb:
        return self.spot.wall.colour if self.spot.wall is not None else _WHITE

    def _plates(self, height: float) -> None:
        """Names beside the door (offices, practices) or, for a lone one in a house of offices, above it."""
        spot = self.spot
        boards = self._boards_of(spot.names)
        if not boards:
            return
        if spot.kind in ("office", "shop") and self.top - (self.z + height) > 0.72:
            self._board(boards[0], spot.s, self.z + height + 0.32, min(spot.b - spot.a, 3.0), 0.3, 0.05)
            boards = boards[1:]
        side = spot.s + self.width / 2 + 0.34
        for k, board in enumerate(boards[:4]):
            high = min(0.24, 0.62 / board.aspect)
            z = self.z + 1.7 - 0.27 * k
            wide = board.aspect * high
            self.face.panel(side, side + wide, z, z + high, 0.035, uv=board.uv, colour=_WHITE, stuff=self._page(board))
            self.counts["signs"] += 1

    def _boards_of(self, names: Sequence[Place]) -> list[Board]:
        return [self.boards.by_place[place.id] for place in names if place.id in self.boards.by_place]

    def _page(self, board: Board) -> str:
        return self.boards.materials[board.page].name

    def _board(self, board: Board, s: float, z: float, most: float, high: float, d: float) -> None:
        """Add a board with its lower edge's middle at a point, made smaller where it is too long."""
        wide = board.aspect * high
        if wide > most:
            high *= most / wide
            wide = most
        self.face.panel(s - wide / 2, s + wide / 2, z, z + high, d, uv=board.uv, colour=_WHITE, stuff=self._page(board))
        self.counts["signs"] += 1

    def _hotel(self) -> None:
        """Add a wide glazed door under a canopy that carries the name."""
        s, z = self.spot.s, self.z
        height = min(2.5, max(self.top - z - 0.7, 2.05))
        self._door("hotel", height, 0.05)
        self._surround(height, (150, 132, 100), wide=0.14, deep=0.12)
        boards = self._boards_of(self.spot.names)
        half = self.width / 2 + 0.45
        low = z + height + 0.3
        colour: Rgb = boards[0].ground if boards else (60, 52, 48)
        if self.spot.kind == "hotel":
            self.face.slab(s - half, s + half, low, low + 0.34, 1.3, colour=colour)
            if boards:
                self._board(boards[0], s, low + 0.03, 2 * half - 0.1, 0.28, 1.305)
        elif boards:
            self.face.slab(s - half, s + half, low, low + 0.5, 0.16, colour=colour)
            self._board(boards[0], s, low + 0.06, 2 * half - 0.1, 0.38, 0.165)
        for side in (-half + 0.1, half - 0.22):
            self.face.slab(s + side, s + side + 0.12, z + 1.75, z + 2.05, 0.18, colour=_WHITE, cell="lamp")

    def _church(self) -> None:
        height = min(3.6, max(0.55 * self.spot.building.height, 2.2))
        self._door("portal", height, 0.06, self._tint())
        s, half = self.spot.s, self.width / 2
        self.face.slab(s - half - 0.2, s + half + 0.2, self.z - 0.3, self.z + 0.1, 0.5, colour=_STONE, under=False)

    def _gate(self) -> None:
        height = min(2.5, max(self.top - self.z - 0.2, 2.0))
        self._door("gate", height, 0.04, (206, 208, 210))
        self._plates(height)

    def _shop(self) -> None:
        """Add a shop front over whole bays: door, windows, risers, posts, and a fascia with the name."""
        spot, wall, random = self.spot, self.spot.wall, self.random
        assert wall is not None
        self.counts["shop_fronts"] += 1
        shops = [p for p in spot.names if p.category in (Category.STORE, Category.FOOD)]
        boards = self._boards_of(shops)
        lead = shops[0]
        scale = wall.high - wall.low
        low, high = (wall.low + 0.735 * scale, wall.low + 0.915 * scale) if 3.0 < scale < 4.8 else (
            self.z + 2.95, self.z + 3.6)  # fmt: skip
        low = max(low, self.z + 2.25)
        high = min(max(high, low + 0.5), self.top - 0.04)
        ground: Rgb = boards[0].ground if boards else colours_of(lead).ground
        dark = sum(ground) < 420
        paint: Rgb = ground if dark else (60, 60, 62)
        a, b, z, face = spot.a + 0.04, spot.b - 0.04, self.z, self.face
        if b - a > 2.6:  # not the whole pier: the wall shows between neighbours
            edge = min(0.22, (b - a) * 0.05)
            a, b = a + edge, b - edge
        face.panel(a, b, z - 0.6, low, 0.03, uv=cell_uv("paint"), colour=_dim(paint, 0.8))
        door = min(self.width, b - a - 0.1)
        left, right = max(spot.s - door / 2, a + 0.05), min(spot.s + door / 2, b - 0.05)
        height = min(2.4, low - z - 0.08)
        face.panel(left, right, z - 0.02, z + height, 0.06, uv=cell_uv("glass"), colour=_WHITE)
        kind = (
            2 if lead.category is Category.FOOD else 0 if lead.kind in _SHELVES else 1 if lead.kind in _DUMMIES else 3
        )
        kind += 4 * int(random.integers(2))
        riser = 0.5 if random.random() < 0.6 else 0.22
        for x0, x1 in ((a + 0.16, left - 0.1), (right + 0.1, b - 0.16)):
            if x1 - x0 < 0.35:
                continue
            count = max(1, round((x1 - x0) / 2.3))
            step = (x1 - x0) / count
            for k in range(count):
                uv = cell_uv(f"vitrine_{kind}", min(step / 2.3, 1.0))
                face.panel(x0 + k * step + 0.03, x0 + (k + 1) * step - 0.03, z + riser, low - 0.1, 0.05, uv=uv,
                            colour=_WHITE)  # fmt: skip
            face.panel(x0, x1, z - 0.6, z + riser - 0.04, 0.055, uv=cell_uv("paint"), colour=paint)
        for x in (a, b - 0.14):
            face.slab(x, x + 0.14, z - 0.6, low, 0.11, colour=paint, under=False)
        face.slab(a - 0.03, b + 0.03, low, high, 0.14, colour=ground)
        self._names(boards, a, b, low, high)
        awning = random.random() < (0.45 if lead.category is Category.FOOD else 0.12)
        if awning and low - 0.75 - z > 2.0 and b - a > 1.8:
            self._awning(a, b, low, ground)
        self._projecting(boards, shops, a, b, low)

    def _names(self, boards: Sequence[Board], a: float, b: float, low: float, high: float) -> None:
        """Add the names on the fascia, side by side."""
        count = min(len(boards), max(int((b - a) / 1.5), 1), 3)
        step = (b - a) / max(count, 1)
        for k in range(count):
            tall = (high - low) * 0.86
            wide = min(boards[k].aspect * tall, step * 0.96)
            tall = min(tall, wide / boards[k].aspect)
            self._board(boards[k], a + (k + 0.5) * step, (low + high - tall) / 2, step * 0.96, tall, 0.148)

    def _awning(self, a: float, b: float, low: float, ground: Rgb) -> None:
        self.counts["awnings"] += 1
        striped = self.random.random() < 0.5
        colour = _awning_colour(ground)
        uv = cell_uv("stripes" if striped else "paint")
        self.face.slope(a, b, (low - 0.5, 1.05), (low + 0.02, 0.14), uv=uv, colour=colour)
        self.face.slope(a, b, (low - 0.72, 1.06), (low - 0.5, 1.05), uv=uv, colour=colour)

    def _projecting(self, boards: Sequence[Board], shops: Sequence[Place], a: float, b: float, low: float) -> None:
        """Add a sign at a right angle to the wall, beside the front and below its fascia: a pharmacy's cross or a name.

        There it hides no letters, seen from the side, and hangs clear of the awning.
        """
        assert self.spot.wall is not None
        side = a - _ASIDE if self.random.random() < 0.5 else b + _ASIDE
        side = min(max(side, 0.05), self.spot.wall.length - 0.05)
        most = low - 0.04 - (self.z + _HEADROOM)
        if most < 0.3:
            return
        if any(shop.kind in ("pharmacy", "chemist") for shop in shops):
            tall = min(0.6, most)
            self.face.plate(side, low - 0.04 - tall, low - 0.04, 0.2, 0.2 + tall, uv=cell_uv("cross"), stuff="doors")
        else:
            short = [board for board in boards if board.aspect < 4.2]
            if not short or self.random.random() > 0.35:
                return
            tall = min(0.8 / short[0].aspect, most)
            top, wide = low - 0.04, tall * short[0].aspect
            self.face.plate(side, top - tall, top, 0.16, 0.16 + wide, uv=short[0].uv, stuff=self._page(short[0]))
        self.counts["projecting_signs"] += 1


def _dim(colour: Rgb, factor: float) -> Rgb:
    r, g, b = (min(round(c * factor), 255) for c in colour)
    return r, g, b


def _awning_colour(colour: Rgb) -> Rgb:
    """Return an awning's colour: a cloth is brighter than a painted board."""
    r, g, b = (min(round(c * 1.15 + 26), 255) for c in colour)
    return r, g, b
