"""When and where an episode begins, and who is there to ask: drawn so that six subtasks can be asked at all."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from vico.agents.requester import PACE_HOME
from vico.agents.talk.address import first_name
from vico.challenges.assistant.model import Region
from vico.challenges.assistant.regions import Neighbourhood
from vico.challenges.assistant.thresholds import APART, CARRY_REACH, REACH, SOURCE_RADIUS, STEPS, SUBTASKS
from vico.clock import clock_of, seconds_of_day
from vico.community.model import Community, Resident, ScheduleItem
from vico.errors import EmptyInputError
from vico.world.model import Place
from vico.world.routing import Router
from vico.world.world import World

# Hours at which errands are asked for, and half hours at which somebody may want help with carrying.
_HOURS = tuple(range(9, 18))
_HALF_HOURS = tuple(range(2 * 9, 2 * 19))
# Starts that are tried; with Carry until a subtask takes no longer walks than this on average, seconds, where one comes
# to somebody at the first pace, metres a second.
_TRIES, _CARRY_TRIES = 30, 12
_ENOUGH = 110.0
_COMES = 2.0
# Whoever asks for errands goes out alone, years; so many of them, where there are; each knows so many places near by.
_AGE = 10
_ASKERS, _KNOWN = 3, 3
# Who is to be helped with carrying is out for so long after the start, share of an episode.
_OUT_FOR = 0.5


@dataclass(frozen=True)
class Occasion:
    """A start, and who asks for something there.

    Attributes
    ----------
    time
        Of day, ``HH:MM``.
    people
        Who may ask.
    whereabouts
        Where each of those who are out is expected at the start, by id; empty where nobody is looked for.
    """

    hood: Neighbourhood
    time: str
    people: list[Resident]
    whereabouts: Mapping[str, Region] = field(default_factory=dict)

    def any_of(self, chance: np.random.Generator) -> Resident:
        """Return somebody."""
        return self.people[int(chance.integers(len(self.people)))]


def errand_occasion(world: World, community: Community, chance: np.random.Generator) -> Occasion:
    """Return a start around which people know places.

    Raises
    ------
    EmptyInputError
        If there is none.
    """
    people = [who for who in community.residents if who.age >= _AGE]
    best: Occasion | None = None
    hour = int(chance.choice(_HOURS))
    for start in _spots(world, people, chance):
        hood = Neighbourhood(world, _router(world), start, reach=REACH)
        askers = [who for who in people if len(hood.places_of(who)) >= _KNOWN]
        if best is None or len(askers) > len(best.people):
            best = Occasion(hood, f"{hour:02d}:00", askers)
        if len(best.people) >= _ASKERS:
            return best
    if best is None or not best.people:
        raise EmptyInputError(
            f"tasks: nobody knows {_KNOWN} places that can be entered within a walk of {REACH:.0f} m of any start; "
            "use a larger world or more residents"
        )
    return best


def carry_occasion(world: World, community: Community, chance: np.random.Generator) -> Occasion:
    """Return a start and a time of day at which six people are out, near by and not far from their homes.

    Six can be told apart when they are called, by their first names; there may be more people.

    Raises
    ------
    EmptyInputError
        If there never are.
    """
    people = [who for who in community.residents if who.age >= _AGE]
    starts = islice(_spots(world, people, chance), _CARRY_TRIES)
    hoods = [Neighbourhood(world, _router(world), start, reach=CARRY_REACH) for start in starts]
    ways = _WaysHome(world)
    best: tuple[float, Occasion] | None = None
    most = 0
    for half in chance.permutation(_HALF_HOURS):
        time = int(half) * 1800
        whereabouts = {who.id: place for who in people if (place := _out_at(who, time, world)) is not None}
        for hood in hoods:
            out = {
                who.id: whereabouts[who.id]
                for who in people
                if who.id in whereabouts and who.home in hood.places and hood.is_near(whereabouts[who.id].position)
            }
            apart = len({first_name(who.name) for who in people if who.id in out})
            most = max(most, apart)
            if apart < SUBTASKS:
                continue
            # Who is near and has not far to go home comes first: six of them can then be walked in time.
            seconds = {
                who.id: hood.distance(out[who.id].position) / _COMES + ways.metres(who, out[who.id]) / PACE_HOME
                for who in people
                if who.id in out
            }
            mine = sorted((who for who in people if who.id in out), key=lambda who: seconds[who.id])
            cost = sum(seconds[who.id] for who in mine[:SUBTASKS])
            if best is None or cost < best[0]:
                best = (
                    cost,
                    Occasion(
                        hood,
                        clock_of(time)[:5],
                        mine,
                        {who.id: hood.whereabouts(out[who.id], radius=SOURCE_RADIUS) for who in mine},
                    ),
                )
        if best is not None and best[0] <= _ENOUGH * SUBTASKS:
            break
    if best is not None:
        return best[1]
    raise EmptyInputError(
        f"carry: at no time of day are {SUBTASKS} people out within {CARRY_REACH:.0f} m who live there and have "
        f"different first names, {most} at most; use a larger world or more residents"
    )


class _WaysHome:
    """How far people have to go home."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._fields: dict[str, NDArray[np.float32]] = {}

    def metres(self, who: Resident, place: Place) -> float:
        """Walk from a place to somebody's home; infinite where there is none."""
        if who.home not in self._fields:
            self._fields[who.home] = _router(self._world).distance_field(_door(self._world.place_by_id[who.home]))
        walkable = self._world.walkable
        ix, iy = np.clip(walkable.cell_of(_door(place)), 0, walkable.n - 1)
        return float(self._fields[who.home][iy, ix])


def _door(place: Place) -> NDArray[np.float64]:
    return np.asarray(place.position[:2], np.float64)


def _out_at(who: Resident, time: int, world: World) -> Place | None:
    """Return where somebody is expected at a time who is out then and for a while; None if they are not."""
    home = world.place_by_id[who.home]
    during = [item for item in who.schedule if _overlaps(item, time, time + _OUT_FOR * STEPS)]
    if any(item.place == who.home for item in during):
        return None
    place = next((world.place_by_id[item.place] for item in during if item.place is not None), None)
    if place is None or place.building == home.building is not None:
        return None
    if float(np.hypot(*np.subtract(place.position[:2], home.position[:2]))) < APART:
        return None
    return place


def _overlaps(item: ScheduleItem, since: float, until: float) -> bool:
    return seconds_of_day(item.start) < until and seconds_of_day(item.end) > since


def _spots(world: World, people: list[Resident], chance: np.random.Generator) -> Iterator[NDArray[np.float64]]:
    """Yield free spots near places that people know, away from the map's edge where there are such."""
    known = sorted({place for who in people for place in (*who.known_places, who.home)})
    middles = [world.place_by_id[place].position[:2] for place in known]
    inner = [xy for xy in middles if max(abs(xy[0]), abs(xy[1])) <= 0.75 * world.half] or middles
    for _ in range(_TRIES if inner else 0):
        near = inner[int(chance.integers(len(inner)))]
        yield world.walkable.random_point(chance, near=near, radius=40.0, clearance=0.75)


def _router(world: World) -> Router:
    return world.router
