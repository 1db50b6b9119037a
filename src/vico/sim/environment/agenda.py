"""The agenda: the events of a run, those asked for when it began and those called for since, and what they do.

Events that come by themselves are drawn by the seed among the places and streets there are, a day's at a time.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.clock import DAY
from vico.errors import InputError
from vico.seeds import rng
from vico.sim.environment.city_events import (
    CityEvent,
    EventKind,
    Occurrence,
    event_kinds,
    kind_of_event,
    planned_events,
)
from vico.sim.environment.event_sites import TRADE, EventSites, Gathering, gathering_of
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


#: The names of no events at all, and of events that come by themselves.
NO_EVENTS, CHANGING_EVENTS = "none", "changing"

_WAITS, _GOES_ON, _IS_OVER = range(3)


class EventEffects(NamedTuple):
    """What the events that go on do, together.

    Attributes
    ----------
    shut
        Ids of places that are closed, each with the event that closes it.
    lanes
        Which lanes of the world cars keep off, shape ``(lanes,)``; None for none.
    walkways
        Which walkways that traffic has are closed; None for none.
    ground
        Ground nobody is to walk on: x, y and radius of circles, ENU metres; as `Trips.plan` takes them.
    noises
        Events that can be heard, each with its dB at 10 m.
    dark
        Where lamps, windows and signs are out: x, y and radius of circles, ENU metres.
    """

    shut: Mapping[str, Occurrence]
    lanes: NDArray[np.bool_] | None = None
    walkways: NDArray[np.bool_] | None = None
    ground: tuple[tuple[float, float, float], ...] = ()
    noises: tuple[tuple[Occurrence, float], ...] = ()
    dark: tuple[tuple[float, float, float], ...] = ()


_NOTHING = EventEffects({})


class Agenda:
    """The events of a run; part of its state.

    Parameters
    ----------
    sites
        Of the world.
    wanted
        ``"none"``, ``"changing"``, or the content of a file of events.
    seed
        Decides events that come by themselves.
    second
        Seconds since midnight of the first day.

    Raises
    ------
    InputError
        If it is none of these, or names what the world has not.
    """

    def __init__(
        self, sites: EventSites, wanted: str | Mapping[str, Any] = NO_EVENTS, *, seed: int = 0, second: float = 0.0
    ) -> None:
        self.sites = sites
        self._seed, self._changing = seed, wanted == CHANGING_EVENTS
        self._events: list[CityEvent] = []
        # How far each was told of: whether that it began, and that it is over.
        self._told: list[int] = []
        self._known: dict[int, Occurrence] = {}
        self._now: tuple[int, ...] = ()
        self._going_on: list[Occurrence] = []
        self._effects = _NOTHING
        self._gatherings: tuple[Gathering, ...] | None = None
        self._crowds: dict[int, Gathering | None] = {}
        self._day = int(second // DAY)
        if isinstance(wanted, str):
            if wanted not in (NO_EVENTS, CHANGING_EVENTS):
                raise InputError(
                    f"events: {wanted!r} is not known; take {NO_EVENTS}, {CHANGING_EVENTS}, or a file of events"
                )
            found = events_of_day(sites, seed, self._day) if self._changing else []
        else:
            found = planned_events(wanted)
            for k, event in enumerate(found):
                try:
                    sites.check(event)
                except InputError as error:
                    raise InputError(f"events: events.{k}: {str(error).removeprefix('events: ')}") from None
        self._add(found)
        self._refresh(second)

    def _add(self, events: Sequence[CityEvent]) -> None:
        self._events += events
        self._told += [_WAITS] * len(events)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return the events as bytes; nothing as long as there are none."""
        if not self._events:
            return {}
        listed = [event.record() | {"told": told} for event, told in zip(self._events, self._told, strict=True)]
        text = json.dumps({"day": self._day, "events": listed}, sort_keys=True, ensure_ascii=False)
        return {"events": np.frombuffer(text.encode(), np.uint8)}

    def restore(self, arrays: Mapping[str, NDArray[Any]], second: float) -> None:
        """Go back to what `arrays` held, at a moment."""
        listed: list[dict[str, Any]] = []
        if "events" in arrays:
            content = json.loads(np.asarray(arrays["events"], np.uint8).tobytes().decode())
            listed, self._day = content["events"], content["day"]
        self._told = [event.pop("told") for event in listed]
        self._events = [CityEvent.of(event) for event in listed]
        self._known, self._now, self._going_on, self._effects = {}, (), [], _NOTHING
        self._gatherings, self._crowds = None, {}
        self._refresh(second)

    def advance(self, second: float) -> None:
        """Go on to a moment, seconds after the first midnight."""
        if self._changing and int(second // DAY) != self._day:
            self._day = int(second // DAY)
            self._add(events_of_day(self.sites, self._seed, self._day))
        if self._events:
            self._refresh(second)

    def news(self) -> list[tuple[Occurrence, str]]:
        """Return which events have begun or ended since this was last asked, each with ``"begins"`` or ``"ends"``."""
        found: list[tuple[Occurrence, str]] = []
        for k, told in enumerate(self._told):
            now = self._phase(k)
            # What was called off before it began is no news.
            if told == _WAITS and now == _GOES_ON:
                found.append((self._occurrence(k), "begins"))
            if told == _GOES_ON and now == _IS_OVER:
                found.append((self._occurrence(k), "ends"))
            self._told[k] = max(told, now)
        return found

    def _phase(self, k: int) -> int:
        event = self._events[k]
        return _WAITS if self._second < event.begin else _GOES_ON if self._second < event.end else _IS_OVER

    def _occurrence(self, k: int) -> Occurrence:
        if k not in self._known:
            event = self._events[k]
            kind, sites = kind_of_event(event.kind), self.sites
            closes = bool(event.street) and (kind.walkways if event.walkways is None else event.walkways)
            circles = tuple(sites.circles(event)) if closes else ()
            self._known[k] = Occurrence(k + 1, event, kind, sites.middle(event), circles)
        return self._known[k]

    def __len__(self) -> int:
        return len(self._events)

    @property
    def going_on(self) -> Sequence[Occurrence]:
        """The events that go on now, by id."""
        return self._going_on

    @property
    def announced_events(self) -> Sequence[Occurrence]:
        """The events that everybody knows of and that are not over, by id."""
        return [
            one
            for k in range(len(self._events))
            if self._phase(k) != _IS_OVER and (one := self._occurrence(k)).kind.announced
        ]

    @property
    def has_news(self) -> bool:
        """Whether an event has begun or ended within the last second."""
        return any(0 <= self._second - when <= 1 for event in self._events for when in (event.begin, event.end))

    @property
    def effects(self) -> EventEffects:
        """What the events that go on do."""
        return self._effects

    def gatherings(self, off: NDArray[np.bool_] | None) -> tuple[Gathering, ...]:
        """Return the crowds of the events that go on, by id; the same tuple as long as they are the same.

        Parameters
        ----------
        off
            Walkways of the world that nobody ever walks on; None for none. The same at every call.
        """
        if self._gatherings is None:
            for one in self._going_on:
                if one.id not in self._crowds:
                    self._crowds[one.id] = gathering_of(one, self.sites, off)
            found = (self._crowds[one.id] for one in self._going_on)
            self._gatherings = tuple(one for one in found if one is not None)
        return self._gatherings

    def start(self, event: CityEvent, second: float) -> int:
        """Let an event take place; return its id.

        Raises
        ------
        InputError
            If it names what the world has not.
        """
        self.sites.check(event)
        self._add([event])
        self._refresh(second)
        return len(self._events)

    def end(self, number: int, second: float) -> None:
        """Let an event be over now.

        Raises
        ------
        InputError
            If there is no such event, or it has ended.
        """
        if not 1 <= number <= len(self._events):
            raise InputError(f"events: there is no event {number}; there are {len(self._events)} so far")
        event = self._events[number - 1]
        if second >= event.end:
            raise InputError(f"events: event {number} ({event.title}) is over already")
        # One that was still to come never happens.
        self._events[number - 1] = replace(event, begin=min(event.begin, second), end=second)
        self._known.pop(number - 1, None)
        self._refresh(second)

    def _refresh(self, second: float) -> None:
        """Find which events go on, and what they do."""
        self._second = second
        now = tuple(k for k, event in enumerate(self._events) if event.goes_on(second))
        if now != self._now:
            self._now, self._gatherings = now, None
            self._going_on = [self._occurrence(k) for k in now]
            self._effects = effects_of(self._going_on, self.sites) if now else _NOTHING


def effects_of(going_on: Sequence[Occurrence], sites: EventSites) -> EventEffects:
    """Return what events do together."""
    shut = {place.id: one for one in reversed(going_on) for place in sites.places_of(one.event)}
    closing = [one for one in going_on if one.circles]
    loud = tuple((one, one.noise) for one in going_on if one.noise > 0)
    return EventEffects(
        shut,
        _union([sites.lanes_of(one.event) for one in going_on if one.event.street and one.kind.lanes]),
        _union([sites.walkways_of(one.event) for one in closing]),
        tuple(circle for one in closing for circle in one.circles),
        loud,
        tuple(one.event.region for one in going_on if one.kind.dark and one.event.region is not None),
    )


def _union(masks: Sequence[NDArray[np.bool_]]) -> NDArray[np.bool_] | None:
    """Return what is in any of some masks; None if nothing is."""
    found = np.any(masks, axis=0) if masks else None
    return found if found is not None and found.any() else None
