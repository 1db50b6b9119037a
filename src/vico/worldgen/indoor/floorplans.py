"""Floor plans by use: which rooms, how large, side by side how, which doors, on how many floors.

A sketch lies in its own frame: x from 0 to its width, y from 0 to its depth, the street at the south or west. Rooms
are rectangles that share walls; doors lie on shared walls. Furniture comes later.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from vico.assets.interior import RISE
from vico.worldgen.indoor.furnishing import Furnishing

CEILING = 2.7
OUTSIDE = -1
CORE = (2.6, 4.6)  # a stairs room with its walls, metres
_CAR = 1.8
_CORRIDOR = 1.8

Box = tuple[float, float, float, float]
Cell = tuple[str, float]  # kind of room and its share of the strip


@dataclass(frozen=True)
class SketchRoom:
    """A room: its rectangle ``x0, y0, x1, y1``, its floor, clear height; stairs climb along `facing` quarter turns.

    Attributes
    ----------
    items
        Its furniture, in the frame of its own middle; None: furnished by its kind.
    floor, walls, colour
        How it looks, if not as its kind does.
    """

    kind: str
    box: Box
    storey: int = 0
    height: float = CEILING
    rise: float = 0.0
    facing: int = 1
    items: tuple[Furnishing, ...] | None = None
    floor: str | None = None
    walls: str | None = None
    colour: tuple[int, int, int] | None = None


@dataclass(frozen=True)
class SketchDoor:
    """A doorway between two rooms (`b` may be `OUTSIDE`), its middle on their wall; or a ride between two lift cars."""

    a: int
    b: int
    at: tuple[float, float]
    storey: int = 0
    width: float = 1.0
    lift: bool = False


@dataclass(frozen=True)
class Sketch:
    """Rooms and doors of a place; the first room has the way out."""

    use: str
    size: tuple[float, float]
    rooms: tuple[SketchRoom, ...]
    doors: tuple[SketchDoor, ...]

    @property
    def height(self) -> float:
        """From the lowest floor to the highest ceiling, metres."""
        return max(room.storey * RISE + room.height for room in self.rooms)


@dataclass
class _Draft:
    rooms: list[SketchRoom] = field(default_factory=list)
    doors: list[SketchDoor] = field(default_factory=list)

    def room(
        self, kind: str, x0: float, y0: float, x1: float, y1: float, storey: int = 0, height: float = CEILING
    ) -> int:
        box = (round(x0, 2), round(y0, 2), round(x1, 2), round(y1, 2))
        self.rooms.append(SketchRoom(kind, box, storey, height))
        return len(self.rooms) - 1

    def door(self, a: int, b: int, x: float, y: float, storey: int = 0, width: float = 1.0) -> None:
        self.doors.append(SketchDoor(a, b, (round(x, 2), round(y, 2)), storey, width))

    def strip(
        self, x0: float, x1: float, wall: float, deep: float, cells: Sequence[Cell], host: int, storey: int = 0
    ) -> None:
        """Rooms side by side from x0 to x1, each with a door to `host` on the wall at y = `wall`; north if deep > 0."""
        total = sum(share for _, share in cells)
        x = x0
        for k, (kind, share) in enumerate(cells):
            end = x1 if k == len(cells) - 1 else round(x + (x1 - x0) * share / total, 1)
            y0, y1 = (wall, wall + deep) if deep > 0 else (wall + deep, wall)
            room = self.room(kind, x, y0, end, y1, storey)
            self.door(host, room, min(x + 1.0, (x + end) / 2) if k % 2 else max(end - 1.0, (x + end) / 2), wall, storey)
            x = end

    def cores(self, x: float, wall: float, hosts: Sequence[int], *, lift: bool) -> float:
        """Stairs (and a lift) north of a wall, from floor to floor; hosts are the rooms before them. New x."""
        storeys = len(hosts)
        for k in range(storeys - 1):
            left = x + CORE[0] * k
            middle = left + CORE[0] / 2
            self.rooms.append(
                SketchRoom("stairs", (left, wall, left + CORE[0], wall + CORE[1]), k, RISE + CEILING, RISE)
            )
            room = len(self.rooms) - 1
            self.door(hosts[k], room, middle + 0.62, wall, k, 0.95)
            self.door(hosts[k + 1], room, middle - 0.62, wall, k + 1, 0.95)
            for other in range(storeys):
                if other not in (k, k + 1):
                    spare = self.room("storage", left, wall, left + CORE[0], wall + CORE[1], other)
                    self.door(hosts[other], spare, middle, wall, other)
        x = round(x + CORE[0] * (storeys - 1), 2)
        if lift and storeys > 1:
            cars = [self.room("lift", x, wall, x + _CAR, wall + _CAR, k) for k in range(storeys)]
            for k, car in enumerate(cars):
                self.door(hosts[k], car, x + _CAR / 2, wall, k)
            for k, car in enumerate(cars):
                for other in range(k + 1, storeys):
                    self.doors.append(SketchDoor(car, cars[other], (x + _CAR / 2, wall + _CAR - 0.5), k, 1.0, True))
            x = round(x + _CAR, 2)
        return x

    def done(self, use: str, size: tuple[float, float]) -> Sketch:
        return Sketch(use, size, tuple(self.rooms), tuple(self.doors))


Composer = Callable[["_Draft", float, float, int], None]


def _front(main: str, backs: Sequence[Cell], deep: float, *, height: float = CEILING, lift: bool = False) -> Composer:
    """Return a large room at the street, rooms for the staff behind it."""

    def compose(d: _Draft, w: float, h: float, storeys: int) -> None:
        back = max(deep, CORE[1]) if storeys > 1 else deep
        hosts = [d.room(main, 0, 0, w, h - back, k, height) for k in range(storeys)]
        d.door(hosts[0], OUTSIDE, round(w * 0.35, 1), 0, 0, 1.2)
        x = d.cores(0.0, h - back, hosts, lift=lift) if storeys > 1 else 0.0
        for k, host in enumerate(hosts):
            if backs:
                d.strip(x, w, h - back, back, backs if not k else backs[:2], host, k)

    return compose


def _entry(
    hall: str, main: str, deep: float, *, height: float = CEILING, side: str | None = None, after: str | None = None
) -> Composer:
    """Return a hall at the street, the large room behind it; perhaps a side room, perhaps one more room beyond."""

    def compose(d: _Draft, w: float, h: float, storeys: int) -> None:
        beyond = 3.4 if after else 0.0
        edge = w - 2.6 if side else w
        first = d.room(hall, 0, 0, edge, deep)
        large = d.room(main, 0, deep, w, h - beyond, 0, height)
        d.door(first, OUTSIDE, round(edge / 2, 1), 0, 0, 1.2)
        d.door(first, large, round(min(w / 2, edge - 0.9), 1), deep, 0, 1.4)
        if side:
            room = d.room(side, edge, 0, w, deep)
            d.door(first, room, edge, deep / 2)
        if after:
            room = d.room(after, 0, h - beyond, min(w, 5.0), h)
            d.door(large, room, 1.1, h - beyond)

    return compose


def _spine(
    hall: str,
    north: Sequence[Cell],
    south: Sequence[Cell],
    *,
    upper: tuple[Sequence[Cell], Sequence[Cell]] | None = None,
    hall_width: float = 5.0,
    lift: bool = True,
) -> Composer:
    """Return a lobby, then a corridor with rooms on both sides; the same on every floor above."""

    def compose(d: _Draft, w: float, h: float, storeys: int) -> None:
        up = CORE[1] if storeys > 1 else round((h - _CORRIDOR) / 2, 1)
        ys = round(h - up - _CORRIDOR, 2)
        yn = round(ys + _CORRIDOR, 2)
        hosts: list[int] = []
        first = d.room(hall, 0, 0, hall_width, h)
        d.door(first, OUTSIDE, 0, round(h / 2, 1), 0, 1.2)
        hosts.append(d.room("corridor", hall_width, ys, w, yn))
        d.door(first, hosts[0], hall_width, ys + _CORRIDOR / 2, 0, 1.3)
        hosts += [d.room("corridor", 0, ys, w, yn, k) for k in range(1, storeys)]
        x = d.cores(hall_width, yn, hosts, lift=lift) if storeys > 1 else hall_width
        for k, host in enumerate(hosts):
            rooms_north, rooms_south = (north, south) if k == 0 or upper is None else upper
            d.strip(x, w, yn, h - yn, rooms_north, host, k)
            d.strip(hall_width if k == 0 else 0.0, w, ys, -ys, rooms_south, host, k)
            if k:
                d.strip(0.0, hall_width, yn, h - yn, rooms_north[:1], host, k)

    return compose


def _flat_small(d: _Draft, w: float, h: float, storeys: int) -> None:
    hall = d.room("hall", 0, 0, w / 2, 2.4)
    bath = d.room("bathroom", w / 2, 0, w, 2.4)
    main = d.room("studio", 0, 2.4, w, h)
    d.door(hall, OUTSIDE, 1.2, 0)
    d.door(hall, bath, w / 2, 1.2)
    d.door(hall, main, 1.2, 2.4)


def _flat_medium(d: _Draft, w: float, h: float, storeys: int) -> None:
    hall = d.room("hall", 3.2, 0, 5.6, 3.0)
    kitchen = d.room("kitchen", 0, 0, 3.2, 3.0)
    bath = d.room("bathroom", 5.6, 0, w, 3.0)
    living = d.room("living_room", 0, 3.0, 4.8, h)
    bedroom = d.room("bedroom", 4.8, 3.0, w, h)
    d.door(hall, OUTSIDE, 4.4, 0)
    d.door(hall, living, 4.1, 3.0)
    d.door(hall, bath, 5.6, 1.5)
    d.door(living, kitchen, 1.6, 3.0)
    d.door(living, bedroom, 4.8, 4.2)


def _flat_large(d: _Draft, w: float, h: float, storeys: int) -> None:
    hall = d.room("hall", 0, 4.0, 7.4, 5.5)
    living = d.room("living_room", 7.4, 3.6, w, h)
    kitchen = d.room("kitchen", 7.4, 0, w, 3.6)
    d.door(hall, OUTSIDE, 0, 4.75)
    d.door(hall, living, 7.4, 4.75)
    d.door(living, kitchen, 9.4, 3.6)
    d.strip(0, 7.4, 4.0, -4.0, (("bedroom", 3.9), ("bathroom", 2.4), ("storage", 1.7)), hall)
    d.strip(0, 7.4, 5.5, h - 5.5, (("bedroom", 1.0), ("kids_room", 1.0)), hall)


def _maisonette(d: _Draft, w: float, h: float, storeys: int) -> None:
    halls = [d.room("hall", 0, 4.0, w, 5.5, k) for k in range(2)]
    d.door(halls[0], OUTSIDE, 0, 4.75)
    x = d.cores(0.0, 5.5, halls, lift=False)
    d.strip(x, w, 5.5, h - 5.5, (("living_room", 1.0),), halls[0])
    d.strip(0, w, 4.0, -4.0, (("kitchen", 4.2), ("bathroom", 2.4), ("storage", 2.0)), halls[0])
    d.strip(x, w, 5.5, h - 5.5, (("bedroom", 1.0), ("kids_room", 0.9)), halls[1], 1)
    d.strip(0, w, 4.0, -4.0, (("bedroom", 4.2), ("bathroom", 2.4), ("storage", 2.0)), halls[1], 1)


def _galleries(d: _Draft, w: float, h: float, storeys: int) -> None:
    lobby = d.room("foyer", 0, 0, w, 5.0)
    left = d.room("gallery", 0, 5.0, w / 2, h)
    right = d.room("gallery", w / 2, 5.0, w, h)
    d.door(lobby, OUTSIDE, w / 2, 0, 0, 1.2)
    d.door(lobby, left, w / 4, 5.0, 0, 1.4)
    d.door(lobby, right, 3 * w / 4, 5.0, 0, 1.4)
    d.door(left, right, w / 2, (5.0 + h) / 2, 0, 1.4)


@dataclass(frozen=True)
class Use:
    """A use: how it is composed, its small, medium and large extent, and on how many floors at most."""

    compose: Composer
    sizes: tuple[tuple[float, float], ...]
    storeys: int = 1


_STAFF: tuple[Cell, ...] = (("storage", 3.0), ("washroom", 2.4))
_STOCK: tuple[Cell, ...] = (("storage", 1.0),)
_SHOP_SIZES = ((7.0, 8.6), (9.2, 10.4), (12.0, 12.0))


def _shop(main: str, sizes: tuple[tuple[float, float], ...] = _SHOP_SIZES, backs: Sequence[Cell] = _STAFF) -> Use:
    return Use(_front(main, backs, 2.6), sizes)


_FOOD_SIZES = ((8.4, 11.0), (11.0, 12.6), (14.0, 14.6))
_KITCHEN: tuple[Cell, ...] = (("restaurant_kitchen", 5.2), ("washroom", 2.4))
_GUEST = ("hotel_room", 3.6)
_WORK_UP = ((("open_office", 7.0), ("office", 3.2)), (("meeting_room", 4.4), ("open_office", 7.0), ("break_room", 3.4)))

USES: dict[str, Use] = {
    "flat_small": Use(_flat_small, ((5.4, 7.4),)),
    "flat_medium": Use(_flat_medium, ((8.6, 7.6),)),
    "flat_large": Use(_flat_large, ((11.6, 9.6),)),
    "maisonette": Use(_maisonette, ((8.8, 10.1),), 2),
    "hotel": Use(
        _spine("lobby", (_GUEST, _GUEST), (_GUEST, _GUEST, ("storage", 2.0)), hall_width=6.4),
        ((15.0, 11.0), (19.4, 11.0), (19.4, 11.0)),
        3,
    ),
    "hostel": Use(
        _spine(
            "lobby",
            (("dormitory", 4.6), ("shower_room", 3.4)),
            (("dormitory", 4.6), ("common_room", 4.6)),
            lift=False,
            hall_width=5.6,
        ),
        ((15.4, 11.0), (18.0, 11.0), (18.0, 11.0)),
        2,
    ),
    "office": Use(
        _spine(
            "reception",
            (("open_office", 7.0), ("meeting_room", 4.4)),
            (("office", 3.4), ("office", 3.4), ("break_room", 3.6), ("washroom", 2.4)),
            upper=_WORK_UP,
        ),
        ((15.0, 11.0), (19.0, 11.6), (22.0, 11.6)),
        3,
    ),
    "studio": Use(
        _front("open_office", (("meeting_room", 4.4), ("washroom", 2.4)), 4.2),
        ((8.0, 11.0), (10.0, 12.0), (13.0, 13.0)),
    ),
    "restaurant": Use(_front("dining_room", _KITCHEN, 3.8), _FOOD_SIZES),
    "cafe": Use(_front("cafe", (("storage", 3.0), ("washroom", 2.4)), 2.6), ((7.6, 9.4), (9.6, 11.0), (12.0, 12.4))),
    "bar": Use(_front("bar", (("storage", 3.0), ("washroom", 2.8)), 2.6), ((8.4, 10.4), (10.6, 12.0), (13.0, 14.0))),
    "fast_food": Use(_front("fast_food", _KITCHEN, 3.6), ((8.4, 11.0), (10.6, 12.4), (13.0, 13.6))),
    "bakery": Use(_front("bakery", (("restaurant_kitchen", 1.0),), 3.4), ((7.0, 9.6), (8.6, 11.0), (10.0, 12.0))),
    "club": Use(_front("club", _STAFF, 2.6), ((11.0, 12.0), (13.0, 14.0), (15.0, 16.0))),
    "shop": _shop("shop"),
    "supermarket": Use(
        _front("supermarket", (("storage", 4.0), ("washroom", 2.4)), 3.4, height=3.4),
        ((14.0, 15.4), (18.0, 18.0), (22.0, 20.0)),
    ),
    "clothes": _shop("clothes_shop"),
    "pharmacy": _shop("pharmacy"),
    "electronics": _shop("electronics_shop"),
    "books": _shop("bookshop"),
    "jewellery": _shop("jeweller", ((6.4, 8.0), (8.0, 9.4), (9.6, 10.4)), _STOCK),
    "florist": _shop("florist", ((6.4, 8.0), (8.0, 9.4), (9.6, 10.4)), _STOCK),
    "furniture_shop": _shop("furniture_shop", ((10.0, 11.4), (13.0, 13.6), (16.0, 16.0))),
    "toys": _shop("toy_shop"),
    "wine": _shop("wine_shop", ((6.4, 8.0), (8.0, 9.4), (9.6, 10.4)), _STOCK),
    "kiosk": _shop("kiosk", ((5.0, 6.8), (6.0, 7.4), (7.0, 8.0)), _STOCK),
    "salon": _shop("salon"),
    "repair": _shop("repair_shop", ((6.4, 8.0), (8.0, 9.4), (9.6, 10.4)), _STOCK),
    "laundry": _shop("laundry", ((7.0, 8.6), (9.0, 10.0), (11.0, 11.0)), _STOCK),
    "department_store": Use(
        _front("sales_floor", (("storage", 3.0), ("washroom", 2.6)), 4.6, lift=True),
        ((17.0, 16.0), (20.0, 18.0), (24.0, 20.0)),
        3,
    ),
    "bank": Use(
        _front("bank_hall", (("office", 3.4), ("storage", 2.4)), 3.6), ((8.4, 10.4), (11.0, 12.4), (13.0, 14.0))
    ),
    "bureau": Use(
        _spine(
            "reception", (("council_room", 6.0), ("office", 3.6)), (("office", 3.6), ("office", 3.6), ("washroom", 2.4))
        ),
        ((15.0, 11.0), (18.0, 12.0), (20.0, 12.6)),
        2,
    ),
    "police": Use(
        _spine(
            "waiting_room",
            (("open_office", 6.0), ("cell", 2.6)),
            (("office", 3.6), ("cell", 2.6), ("washroom", 2.4)),
            lift=False,
        ),
        ((15.0, 11.0), (17.0, 12.0), (17.0, 12.0)),
    ),
    "clinic": Use(
        _spine(
            "waiting_room",
            (("consulting_room", 3.6), ("consulting_room", 3.6)),
            (("consulting_room", 3.6), ("storage", 2.4), ("washroom", 2.4)),
        ),
        ((13.0, 10.4), (14.6, 11.0), (16.0, 11.0)),
    ),
    "hospital": Use(
        _spine(
            "waiting_room",
            (("ward", 6.4), ("ward", 6.4)),
            (("consulting_room", 4.0), ("consulting_room", 4.0), ("storage", 2.4), ("washroom", 3.0)),
            hall_width=7.0,
        ),
        ((21.0, 12.4), (23.0, 12.4), (25.0, 12.4)),
        2,
    ),
    "school": Use(
        _spine(
            "foyer",
            (("classroom", 7.4),),
            (("classroom", 7.4), ("office", 3.4), ("washroom", 2.6)),
            upper=((("classroom", 7.4),), (("laboratory", 7.4), ("classroom", 7.4))),
            hall_width=6.0,
        ),
        ((20.0, 13.6), (21.0, 14.0), (22.0, 14.0)),
        2,
    ),
    "kindergarten": Use(
        _front("common_room", (("kids_room", 4.0), ("washroom", 2.6)), 4.0), ((8.6, 10.6), (11.0, 12.0), (12.0, 13.0))
    ),
    "library": Use(_front("library", _STAFF, 3.0), ((11.0, 12.4), (14.0, 15.0), (17.0, 17.0))),
    "museum": Use(_galleries, ((12.0, 13.0), (15.0, 16.0), (18.0, 18.0))),
    "cinema": Use(
        _entry("foyer", "auditorium", 5.2, height=3.6, side="washroom"), ((10.6, 15.0), (13.0, 18.0), (15.4, 21.0))
    ),
    "theatre": Use(
        _entry("foyer", "theatre", 5.2, height=3.8, side="washroom"), ((10.6, 16.0), (13.0, 19.0), (15.4, 22.0))
    ),
    "church": Use(
        _entry("narthex", "nave", 3.2, height=6.2, after="sacristy"), ((9.0, 19.0), (12.0, 24.0), (14.6, 29.0))
    ),
    "hall": Use(_entry("foyer", "community_hall", 4.6, side="washroom"), ((9.4, 14.0), (12.0, 16.0), (14.0, 18.0))),
    "gym": Use(
        _front("gym", (("changing_room", 4.0), ("washroom", 2.6)), 4.0), ((9.6, 12.6), (12.6, 15.0), (16.0, 17.0))
    ),
    "sports": Use(
        _front("sports_hall", (("changing_room", 4.0), ("changing_room", 4.0)), 4.0, height=4.4),
        ((9.6, 13.0), (13.0, 17.0), (16.0, 20.0)),
    ),
    "games": Use(_front("games", _STAFF, 2.6), ((9.0, 10.6), (11.6, 13.0), (14.0, 15.0))),
    "lounge": Use(_front("lounge", _STAFF, 2.6), ((8.4, 10.0), (11.0, 12.0), (13.0, 14.0))),
    "station": Use(
        _front("station_hall", (("office", 3.4), ("washroom", 3.0)), 3.4, height=4.2),
        ((12.0, 12.0), (16.0, 15.0), (20.0, 17.0)),
    ),
    "workshop": Use(
        _front("workshop", (("office", 3.4), ("storage", 3.0), ("washroom", 2.4)), 3.6, height=3.6),
        ((10.6, 13.0), (14.0, 16.0), (18.0, 18.0)),
    ),
    "parking": Use(_front("parking", (), 0.0), ((17.0, 15.0), (22.0, 15.6), (28.0, 15.6))),
}

FLATS = ("flat_small", "flat_medium", "flat_large", "maisonette")


def area_of(use: str, size: int) -> float:
    """Floor area of a use's plan of a size, one floor, square metres."""
    w, h = _extent(use, size)
    return w * h


def _extent(use: str, size: int) -> tuple[float, float]:
    sizes = USES[use].sizes
    return sizes[min(size, len(sizes) - 1)]


def sketch_of(use: str, size: int = 0, storeys: int = 1, *, mirrored: bool = False) -> Sketch:
    """Return the bare plan of a use.

    Parameters
    ----------
    size
        0 small, 1 medium, 2 large.
    storeys
        Floors wanted; uses that have fewer get fewer.
    mirrored
        East and west swapped.
    """
    recipe = USES[use]
    w, h = _extent(use, size)
    draft = _Draft()
    recipe.compose(draft, w, h, max(1, min(storeys, recipe.storeys)) if use != "maisonette" else 2)
    sketch = draft.done(use, (w, h))
    return _mirrored(sketch) if mirrored else sketch


def _mirrored(sketch: Sketch) -> Sketch:
    w = sketch.size[0]
    rooms, doors = [], []
    for room in sketch.rooms:
        x0, y0, x1, y1 = room.box
        rooms.append(
            SketchRoom(
                room.kind,
                (round(w - x1, 2), y0, round(w - x0, 2), y1),
                room.storey,
                room.height,
                room.rise,
                room.facing,
            )
        )
    for door in sketch.doors:
        x = round(w - door.at[0], 2)
        other = sketch.rooms[door.b] if door.b != OUTSIDE else None
        if other is not None and other.rise:
            # Stairs keep their hand: their lower door lies where their lower flight is.
            x0, x1 = w - other.box[2], w - other.box[0]
            x = round(x0 + x1 - x, 2)
        doors.append(SketchDoor(door.a, door.b, (x, door.at[1]), door.storey, door.width, door.lift))
    return Sketch(sketch.use, sketch.size, tuple(rooms), tuple(doors))
