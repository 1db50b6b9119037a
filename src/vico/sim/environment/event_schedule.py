"""Events that come by themselves: a day's, drawn by the seed among the places and streets there are."""

from __future__ import annotations

from typing import Any

import numpy as np

from vico.clock import DAY
from vico.seeds import rng
from vico.sim.environment.city_event import CityEvent
from vico.sim.environment.event_kinds import EventKind, event_kinds
from vico.sim.environment.event_sites import TRADE, EventSites
from vico.world.model import Category

_HOUR, _MINUTE = 3600.0, 60.0


def events_of_day(sites: EventSites, seed: int, day: int) -> list[CityEvent]:
    """Return the events of a day, counted from 0, in the order in which they begin.

    Each kind has a stream of random numbers of its own: a kind more changes nothing about the others.
    """
    found: list[CityEvent] = []
    for name, kind in event_kinds().items():
        generator = rng(seed, "events", name, day)
        for _ in range(int(generator.poisson(kind.often))):
            where = _somewhere(kind, sites, generator)
            begin = day * DAY + float(np.floor(generator.uniform(*kind.hours) * 60) * _MINUTE)
            lasts = float(np.floor(generator.uniform(*kind.lasts))) * _MINUTE
            if where is not None:
                found.append(CityEvent(kind=name, begin=begin, end=begin + max(lasts, _MINUTE), **where))
    return sorted(found, key=lambda event: event.begin)


def _somewhere(kind: EventKind, sites: EventSites, generator: np.random.Generator) -> dict[str, Any] | None:
    """Return where an event of a kind is, as fields of `CityEvent`; None where the world has no such thing."""
    if "place" in kind.where:
        places = [place.id for place in sites.world.places if place.category in TRADE and place.rooms]
        return {"place": places[int(generator.integers(len(places)))]} if places else None
    if "street" in kind.where:
        streets = sites.streets
        return {"street": streets[int(generator.integers(len(streets)))]} if streets else None
    squares = [place.position for place in sites.world.places if place.category == Category.OPEN]
    if not squares:
        return None
    x, y, _ = squares[int(generator.integers(len(squares)))]
    return {"region": (float(x), float(y), kind.radius)}
