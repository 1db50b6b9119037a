"""Houses as a scene draws them: which part of a city, rooms in sight, lamps, shining windows, open doors.

Of a city, a scene shows the tiles near a camera in full (`ScenePart`). Rooms lie below the ground (docs/formats.md),
and open only to rooms of the same place. A camera sees into those of the place that it is in, and through panes into
those of shops: bodies of those who are in other rooms need not be made.

Lamps are on, and windows shine at night, by who is at home and awake, by opening hours, and by the power. Doors that
are not closed are drawn with their leaves, and the halls behind them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from datetime import date as Date
from functools import cached_property
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.assets.house_doors import (
    BEHIND,
    DOOR_MATERIAL,
    HALLS,
    hall_name,
    hall_surface,
    leaf_names,
    leaf_poses,
    leaf_surfaces,
    opening_of,
)
from vico.clock import DAY
from vico.community.model import Resident
from vico.community.place_index import hours_on
from vico.exact import apply_matrix
from vico.render import Scene
from vico.render.materials import Palette
from vico.render.records import OPENING
from vico.render.world_scene import OPEN_TO_SIGHT
from vico.seeds import rng
from vico.sim.bodies.arrays import Drawn
from vico.sim.bodies.rooms import Indoor
from vico.sim.bodies.state_arrays import Posture
from vico.sim.state.base import SimulationBase
from vico.sim.state.simulation_state import SimulationState
from vico.world.city_world import CityPart
from vico.world.mesh import Surface
from vico.world.model import Building, Category, Place
from vico.world.opening_hours import MINUTES, is_within
from vico.world.world import World


@dataclass(frozen=True)
class ScenePart:
    """Some tiles of a city, and what is drawn with them.

    Attributes
    ----------
    world
        The tiles.
    low, high
        Corners of the ground they cover, ENU metres: what moves is drawn within them.
    far
        Returns what the other tiles look like from afar: asked for each scene that is made, which keeps its own form of
        it.
    palette
        Textures that parts of the city share.
    """

    world: CityPart
    low: tuple[float, float]
    high: tuple[float, float]
    far: Callable[[], Sequence[Surface]]
    palette: Palette

    def holds(self, points: NDArray[np.floating], margin: float = 0.0) -> NDArray[np.bool_]:
        """Return which points, shape ``(n, 2 or more)``, lie in the tiles, or so many metres beside them."""
        low, high = np.array(self.low) - margin, np.array(self.high) + margin
        return np.asarray(((points[:, :2] >= low) & (points[:, :2] <= high)).all(axis=1), np.bool_)

    def shapes_in_tiles(self, shapes: Drawn) -> Drawn:
        """Return those of some shapes that stand in the tiles."""
        here = self.holds(shapes.transforms[:, :2, 3])
        return Drawn(shapes.prototypes, shapes.index[here], shapes.transforms[here], shapes.entity[here])

    @cached_property
    def rooms(self) -> NDArray[np.int64]:
        """Row of each of the city's rooms among those of the tiles; -1 for all others."""
        return _rows(self.world.room_numbers, len(self.world.whole.rooms))

    @cached_property
    def places(self) -> NDArray[np.int64]:
        """Row of each of the city's places among those of the tiles; -1 for all others."""
        own = {place.id for place in self.world.places}
        numbers = [k for k, place in enumerate(self.world.whole.places) if place.id in own]
        return _rows(np.array(numbers, np.int64), len(self.world.whole.places))


def _rows(numbers: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    found = np.full(count, -1, np.int64)
    found[numbers] = np.arange(len(numbers))
    return found


_BESIDE = 1.0  # m that a camera may be outside the walls of its room: in a doorway
_BELOW = 1.0  # m that it may be below the floor
_ABOVE = 8.0  # m that it may be above the floor: on stairs


class RoomsInSight:
    """Says which of a city's rooms may be seen.

    Parameters
    ----------
    indoor
        All rooms of the city.
    part
        The part of it that is looked at.
    """

    def __init__(self, indoor: Indoor, part: ScenePart) -> None:
        self.part = part
        self._here = np.asarray(part.world.room_numbers, np.int64)
        self._boxes, self._floor, self._place = indoor.boxes[self._here], indoor.floor[self._here], indoor.place
        is_open = np.array([place.category in OPEN_TO_SIGHT for place in part.world.whole.places], np.bool_)
        # Of what belongs to no place nobody knows who sees it.
        self._always = np.append(is_open, True)[indoor.place]

    def seen_from(self, eyes: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which of the city's rooms may be seen by agents' cameras at some points, ENU metres, ``(k, 3)``."""
        x, y, yaw, along, across = self._boxes.T
        c, s = np.cos(yaw), np.sin(yaw)
        places: set[int] = set()
        for eye in eyes:
            dx, dy, up = eye[0] - x, eye[1] - y, eye[2] - self._floor
            around = (np.abs(c * dx + s * dy) <= along + _BESIDE) & (np.abs(c * dy - s * dx) <= across + _BESIDE)
            around &= (up > -_BELOW) & (up < _ABOVE)
            places |= set(self._place[self._here[around]].tolist())
        return self._always | np.isin(self._place, sorted(places))


# Rooms that nobody in particular switches the light of.
_SHARED = ("stairs", "lift", "corridor")
# Rooms of places that are open where nobody but who sleeps there switches it.
_PRIVATE = ("hotel_room",)
#: Kind of the places that people live in.
HOME = "apartments"
# From this on it is dark outdoors (0 by day, 1 at night); before, lamps are on everywhere, as by day.
_DUSK = 0.5
# Opening hours are looked up anew this often, seconds.
_LOOKED_UP_EVERY = 60.0


class RoomLamps:
    """Says which rooms of a world are lit.

    By day all are, as far as there is power. At night those are that somebody is in who does not lie down, those of
    places that are open (in their usual hours, where nobody says), and stairs, lifts and corridors.

    Parameters
    ----------
    world
        The world.
    date
        The first day.
    part
        Of a city, whose rooms are meant; none: all.
    """

    def __init__(self, world: World, date: Date, part: ScenePart | None = None) -> None:
        self._rows = None if part is None else part.rooms
        world = world if part is None else part.world
        number = {place.id: k for k, place in enumerate(world.places)}
        self._xy = np.array([room.centre[:2] for room in world.rooms], np.float64).reshape(-1, 2)
        self._place = np.array([number.get(room.place, -1) for room in world.rooms], np.int64)
        self._shared = np.array([room.kind in _SHARED for room in world.rooms], bool) | (self._place < 0)
        origin = world.manifest.origin
        where = (origin.lat, origin.lon)
        self._hours = [
            (k, [(0, MINUTES)] if place.category is Category.ACCOMMODATION else hours_on(place, date, where))
            for k, place in enumerate(world.places)
            if place.kind != HOME
        ]
        self._private = np.array([room.kind in _PRIVATE for room in world.rooms], bool)
        self._looked_up = -1.0
        self._open = np.zeros(len(world.places), bool)

    def lit_rooms(self, state: SimulationState) -> NDArray[np.bool_]:
        """Return whether each room is lit now, shape ``(rooms,)``."""
        environment = state.environment
        powered = environment.has_power(self._xy)
        if environment.dark < _DUSK:
            return powered
        are_open = np.append(self.are_open(state.second), False)  # the last one is for no place
        lit = self._shared | (are_open[self._place] & ~self._private)
        people = state.people
        used = people.room[(people.room >= 0) & (people.posture != Posture.LYING)]
        rows = used if self._rows is None else self._rows[used]
        lit[rows[rows >= 0]] = True
        return lit & powered

    def are_open(self, second: float) -> NDArray[np.bool_]:
        """Return whether each place is open at a second, shape ``(places,)``; homes never are."""
        moment = second // _LOOKED_UP_EVERY
        if moment != self._looked_up:
            self._looked_up = moment
            minute = moment * _LOOKED_UP_EVERY % DAY / 60.0
            self._open[:] = False
            for k, spans in self._hours:
                self._open[k] = is_within(spans, minute)
        return self._open


# Share of the homes that nobody of the community lives in that are lit, by the hour.
_HOURS = (0.0, 1.5, 5.0, 7.0, 9.0, 15.0, 17.0, 21.0, 22.5, 24.0)
_LIT = (0.25, 0.06, 0.06, 0.45, 0.40, 0.40, 0.60, 0.70, 0.60, 0.25)
# With so many lit, a facade looks as it is painted: not every window of a home that is lit shines.
_USUAL = 0.6
# Shares of windows that are lit.
_CLOSED_SHOP = 0.15
_CLOSED_OFFICE = 0.10
_STAIRS = 0.04


class WindowLights:
    """Says how many of the windows of each building shine, and tells the scene.

    Homes of residents shine while somebody is in who does not lie down; of other homes a share does, by the hour.
    Offices shine on upper floors and shops, cafés and the like on the ground floor while they are open.

    Parameters
    ----------
    world
        The world.
    residents
        Who takes part.
    lamps
        Of its rooms.
    part
        Of a city, whose buildings are meant; none: all.
    """

    def __init__(
        self, world: World, residents: Sequence[Resident], lamps: RoomLamps, part: ScenePart | None = None
    ) -> None:
        self._lamps = lamps
        self._rows = None if part is None else part.places
        world = world if part is None else part.world
        row = {building.id: k for k, building in enumerate(world.buildings)}
        self._entity = np.array([building.entity for building in world.buildings], np.int32)
        inside = [(k, place) for k, place in enumerate(world.places) if place.building in row]
        self._building = np.full(len(world.places), -1, np.int64)
        for k, place in inside:
            self._building[k] = row[place.building or ""]
        self._homes = _numbers(inside, lambda place: place.kind == HOME)
        self._offices = _numbers(inside, lambda place: place.category is Category.OFFICE)
        shops = Category.STORE, Category.FOOD, Category.ENTERTAINMENT
        self._shops = _numbers(inside, lambda place: place.category in shops)
        lived_in = {resident.home for resident in residents}
        self._lived_in = np.array([world.places[k].id in lived_in for k in self._homes], bool)
        # Homes that nobody of the community lives in, and buildings of which nothing is known, light up at their share.
        self._threshold = np.array([rng(0, "windows", world.places[k].id).random() for k in self._homes])
        self._unknown = np.array([rng(0, "windows", building.id).random() for building in world.buildings])
        self._known: tuple[float, bytes] = (-1.0, b"")
        self._now: NDArray[np.float64] | None = None

    def set(self, scene: Scene, state: SimulationState) -> None:
        """Switch on the windows of a scene as they are in a state; by day none is on."""
        if scene.lighting.lamps <= 0.0:
            scene.light_windows(None)
            return
        people, moment = state.people, state.second // _LOOKED_UP_EVERY
        awake = (people.place >= 0) & (people.posture != Posture.LYING)
        used = np.zeros(len(self._building), bool)
        places = people.place[awake] if self._rows is None else self._rows[people.place[awake]]
        used[places[places >= 0]] = True
        known = moment, used.tobytes()
        if known != self._known:
            self._known = known
            self._now = self.shares(moment * _LOOKED_UP_EVERY, used)
        scene.light_windows(self._entity, self._now)

    def shares(self, second: float, used: NDArray[np.bool_]) -> NDArray[np.float64]:
        """Return shares of the windows on upper floors and on the ground floor, shape ``(buildings, 2)``.

        `used` says in which places somebody is awake, shape ``(places,)``.
        """
        are_open = self._lamps.are_open(second)
        evening = float(np.interp(second % DAY / 3600.0, _HOURS, _LIT))
        homes = np.where(self._lived_in, used[self._homes], self._threshold < evening)
        offices = np.where((are_open | used)[self._offices], 1.0, _CLOSED_OFFICE)
        shops = np.where((are_open | used)[self._shops], 1.0, _CLOSED_SHOP)
        upper = self._mean(np.concatenate([self._homes, self._offices]), np.concatenate([homes, offices]))
        upper = np.where(np.isnan(upper), self._unknown < evening, upper)
        upper = np.clip(upper / _USUAL, _STAIRS, 1.0)
        ground = self._mean(self._shops, shops)
        return np.stack([upper, np.where(np.isnan(ground), upper, ground)], axis=1)

    def _mean(self, places: NDArray[np.int64], values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the mean value of the places in each building, NaN without any."""
        building, count = self._building[places], len(self._entity)
        total = np.bincount(building, values, count)
        number = np.bincount(building, minlength=count)
        return np.where(number > 0, total / np.maximum(number, 1), np.nan)


def _numbers(places: Iterable[tuple[int, Place]], wanted: Callable[[Place], bool]) -> NDArray[np.int64]:
    return np.array([k for k, place in places if wanted(place)], np.int64)


_CORNER = 0.1  # metres between a hall and the outside of its house


class OpenDoors(NamedTuple):
    """What is drawn of doors.

    Attributes
    ----------
    shapes
        Leaves and halls.
    openings
        Where the wall is not drawn, `OPENING`.
    """

    shapes: Drawn
    openings: NDArray[np.void]


class DrawnDoors:
    """Draws the doors of a world.

    Parameters
    ----------
    base
        The world, with its doors.
    part
        Of a city, outside of which no doors are drawn; none: all are.

    Attributes
    ----------
    prototypes
        Leaves and halls by name.
    """

    def __init__(self, base: SimulationBase, part: ScenePart | None = None) -> None:
        self._doors, self._world = base.house_doors, base.world
        self._drawn = self._doors["kind"] >= 0
        if part is not None:
            self._drawn &= part.holds(np.column_stack([self._doors["x"], self._doors["y"]]))
        self._sizes: dict[int, int] = {}
        self.prototypes = _shapes_of(self._doors[self._drawn], base.world if part is None else part.world)
        self._index = {name: k for k, name in enumerate(self.prototypes)}

    @classmethod
    def of(cls, base: SimulationBase) -> DrawnDoors:
        """Return those of a world; they are kept with it."""
        return base.world.shared(cls, lambda: cls(base))

    def draw(self, state: SimulationState) -> OpenDoors | None:
        """Return what is drawn of the doors that are not closed; None of none."""
        rows = [k for k, e in enumerate(state.leaves.entrance.tolist()) if self._drawn[e]]
        if not rows:
            return None
        names: list[str] = []
        poses, owners, openings = [], [], []
        for k in rows:
            number = int(state.leaves.entrance[k])
            door = self._doors[number]
            share = float(state.leaves.share[k])
            middle = np.array([[float(door["x"]), float(door["y"])]])
            lit = bool(state.environment.has_power(middle)[0])
            here = [*leaf_names(door), hall_name(door, self._size(number), lit=lit)]
            names += here
            poses += [*leaf_poses(door, share), _base(door)]
            owners += [self._building(number).entity] * len(here)
            openings.append(opening_of(door))
        index = np.array([self._index[name] for name in names], np.int32)
        shapes = Drawn(list(self.prototypes), index, np.array(poses, np.float32), np.array(owners, np.int32))
        return OpenDoors(shapes, np.array(openings, OPENING))

    def _size(self, number: int) -> int:
        if number not in self._sizes:
            self._sizes[number] = hall_size(self._doors[number], self._building(number).footprint)
        return self._sizes[number]

    def _building(self, number: int) -> Building:
        return self._world.building_by_id[self._world.entrances[number].building]


def hall_size(door: NDArray[np.void], footprint: Sequence[Sequence[tuple[float, float]]]) -> int:
    """Return how large a hall fits behind a door of a house with some outline and courtyards: a row of `HALLS`."""
    house = shapely.Polygon(footprint[0], footprint[1:]).buffer(-_CORNER)
    fitting = (k for k in range(len(HALLS)) if house.contains(_floor(door, k)))
    return next(fitting, len(HALLS) - 1)


def _floor(door: NDArray[np.void], size: int) -> shapely.Polygon:
    """Return the ground that a hall takes."""
    deep, beside = HALLS[size]
    half = float(door["half_width"]) + beside
    corners = np.array([(-half, BEHIND, 0, 1), (half, BEHIND, 0, 1), (half, deep, 0, 1), (-half, deep, 0, 1)])
    return shapely.Polygon(apply_matrix(corners, _base(door))[:, :2])


def _base(door: NDArray[np.void]) -> NDArray[np.float64]:
    """Return a door's frame: right as seen from outside, inwards, up; shape ``(4, 4)``."""
    ix, iy = float(door["inward_x"]), float(door["inward_y"])
    base = np.eye(4)
    base[:2, 0], base[:2, 1] = (iy, -ix), (ix, iy)
    base[:3, 3] = door["x"], door["y"], door["z"]
    return base


def _shapes_of(doors: NDArray[np.void], world: World) -> dict[str, Sequence[Surface]]:
    """Return every leaf and hall of some of a world's doors, equal ones once."""
    shapes: dict[str, Sequence[Surface]] = {}
    if not len(doors):
        return shapes
    material = next(s.material for s in world.surfaces("buildings") if s.material.name == DOOR_MATERIAL)
    for door in doors:
        names = leaf_names(door)
        if names[0] not in shapes:
            shapes |= dict(zip(names, leaf_surfaces(door, material), strict=True))
        for size in range(len(HALLS)):
            for lit in (False, True):
                name = hall_name(door, size, lit=lit)
                if name not in shapes:
                    shapes[name] = [hall_surface(door, size, lit=lit)]
    return shapes
