"""Which windows shine at night: by who is at home and awake, and by opening hours."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from vico.clock import DAY
from vico.community.model import Resident
from vico.render import Scene
from vico.seeds import rng
from vico.sim.room_lamps import HOME, RoomLamps
from vico.sim.scene_part import ScenePart
from vico.sim.simulation_state import SimulationState
from vico.sim.state import Posture
from vico.world.model import Category, Place
from vico.world.world import World

# Share of the homes that nobody of the community lives in that are lit, by the hour.
_HOURS = (0.0, 1.5, 5.0, 7.0, 9.0, 15.0, 17.0, 21.0, 22.5, 24.0)
_LIT = (0.25, 0.06, 0.06, 0.45, 0.40, 0.40, 0.60, 0.70, 0.60, 0.25)
# With so many lit, a facade looks as it is painted: not every window of a home that is lit shines.
_USUAL = 0.6
_CLOSED_SHOP, _CLOSED_OFFICE, _STAIRS = 0.15, 0.10, 0.04
_LOOKED_UP_EVERY = 60.0


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
