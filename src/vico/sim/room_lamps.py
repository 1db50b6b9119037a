"""In which rooms the lamps are on: by who is in and awake, by opening hours, and by the power."""

from __future__ import annotations

from datetime import date as Date

import numpy as np
from numpy.typing import NDArray

from vico.clock import DAY
from vico.community.hours import hours_on
from vico.sim.scene_part import ScenePart
from vico.sim.simulation_state import SimulationState
from vico.sim.state import Posture
from vico.world.model import Category, Place
from vico.world.opening_hours import MINUTES, Coordinates, Span, is_within
from vico.world.world import World

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
        self._hours = [(k, _hours_of(place, date, where)) for k, place in enumerate(world.places) if place.kind != HOME]
        self._private = np.array([room.kind in _PRIVATE for room in world.rooms], bool)
        self._looked_up = -1.0
        self._open = np.zeros(len(world.places), bool)

    def lit(self, state: SimulationState) -> NDArray[np.bool_]:
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


def _hours_of(place: Place, date: Date, coordinates: Coordinates) -> list[Span]:
    """Return when a place that is nobody's home is open on a day."""
    return [(0, MINUTES)] if place.category is Category.ACCOMMODATION else hours_on(place, date, coordinates)
