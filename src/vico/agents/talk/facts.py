"""What one resident can tell at a moment: from sight, from acquaintance, from what it heard, and of its own day."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from vico.agents.base import Info, Observation
from vico.agents.stays import Stay
from vico.agents.talk.acquaintance import Acquaintance, Habit
from vico.agents.talk.address import names_of
from vico.agents.talk.grammar import read_grammar
from vico.agents.talk.memory import HeardMessage, ResidentMemory, SeenPerson, Visit
from vico.agents.talk.understanding import Claim, claims_in, place_named
from vico.clock import DAY
from vico.world.public import PublicMap, PublicPlace

#: Places within so many metres are known to everybody who stands there, from the map; and what is beside a point.
NEAR, BESIDE = 300.0, 60.0
# Somebody is in view this far, metres.
_IN_VIEW = 60.0
# What others said of somebody is believed if it is one of these.
_HEARSAY = ("saw_in", "saw_near", "told", "since")


@dataclass(frozen=True)
class Person:
    """Who a resident is, as it knows itself.

    Attributes
    ----------
    places
        Ids of places it knows well.
    gender
        ``female`` or ``male``; empty if nobody said.
    household
        Id, the same for those who live together; empty if nobody said.
    """

    agent: str
    name: str
    age: int
    occupation: str
    hobbies: tuple[str, ...] = ()
    places: frozenset[str] = frozenset()
    gender: str = ""
    household: str = ""

    @property
    def names(self) -> tuple[str, ...]:
        """What others call it."""
        return names_of(self.name, self.gender)


@dataclass(frozen=True)
class Moment:
    """Where one is, what one sees and is about.

    Attributes
    ----------
    time
        Seconds since midnight of the first day.
    position, stands
        ENU metres: on the ground, before the door for those indoors; and where one really stands.
    place
        Id of where one is; empty outdoors.
    view
        What is in view (`vico.sim.perception.InView`); None if one isn't told.
    errand
        Says what one is about, to follow "I'm ".
    """

    time: float
    position: tuple[float, float]
    stands: tuple[float, float]
    place: str
    view: Any
    errand: Callable[[], str]


def person_of(resident: Any) -> Person:
    """Return who a resident (as `vico.community.model.Resident`) is, as it knows itself; what it lacks is left out."""
    places = {getattr(resident, "home", None), getattr(resident, "workplace", None)}
    places |= {*getattr(resident, "known_places", ()), *(item.place for item in resident.schedule)}
    known = frozenset(place for place in places if place)
    gender, household = (str(getattr(resident, field, None) or "") for field in ("gender", "household"))
    hobbies = tuple(resident.hobbies)
    return Person(resident.id, resident.name, resident.age, resident.occupation, hobbies, known, gender, household)


def moment_of(observation: Observation, info: Info, public_map: PublicMap, errand: Callable[[], str]) -> Moment:
    """Return the moment that a resident observes."""
    state = observation["state"]
    x, y = (float(value) for value in observation["pose"][:2])
    inside = public_map.place_by_id.get(state["place"]) if state["room"] else None
    ground = (x, y) if inside is None else (inside.position[0], inside.position[1])
    return Moment(float(state["time"]), ground, (x, y), str(state["place"] or ""), info.get("in_view"), errand)


@dataclass(frozen=True)
class Hearsay:
    """What somebody said of where a person was."""

    heard: HeardMessage
    claim: Claim
    place: PublicPlace


@dataclass
class Knowledge:
    """All that a resident knows and remembers.

    Attributes
    ----------
    me
        Itself.
    public_map
        Of the city.
    known
        Whom it knows, by agent.
    names
        What people are called whom one sees: name of the person by agent. Used for those one knows, saw or hears only.
    memory
        Of the day.
    stays
        Its plan of the day.
    """

    me: Person
    public_map: PublicMap
    known: Mapping[str, Acquaintance]
    names: Mapping[str, str]
    memory: ResidentMemory
    stays: Sequence[Stay]

    def people_called(self, what: str, moment: Moment) -> list[str]:
        """Return the agents of people one knows, has seen or sees who go by a name, by their whole name if any does."""
        wanted = what.lower()
        seen = () if moment.view is None else moment.view.agents_within(_IN_VIEW)
        about = dict.fromkeys([*self.known, *self.memory.people, *seen])
        called = {agent: self.name_of(agent) for agent in about if agent != self.me.agent}
        whole = [agent for agent, name in called.items() if wanted in (name.lower(), agent.lower())]
        return whole or [agent for agent, name in called.items() if wanted in self._names_of(agent, name)]

    def _names_of(self, agent: str, name: str) -> set[str]:
        person = self.known.get(agent)
        return {one.lower() for one in names_of(name, "" if person is None else person.gender)}

    def name_of(self, agent: str) -> str:
        """Return the name of somebody one knows or sees."""
        person = self.known.get(agent)
        return person.name if person is not None else self.names.get(agent, agent.replace("_", " "))

    def name_and_gender(self, agent: str) -> tuple[str, str | None] | None:
        """Return both of somebody one knows or sees; the gender is None for strangers. None for who has no name."""
        person = self.known.get(agent)
        if person is not None:
            return person.name, person.gender
        return (self.names[agent], None) if agent in self.names else None

    def is_me(self, what: str) -> bool:
        """Whether somebody asks for oneself."""
        return what.lower() in {name.lower() for name in (*self.me.names, self.me.agent)}

    def in_view(self, agent: str, moment: Moment) -> tuple[float, float] | None:
        """Return where somebody stands whom one sees right now, ENU metres."""
        if moment.view is None:
            return None
        seen = next((body for body in moment.view.within(_IN_VIEW) if body.agent == agent), None)
        return None if seen is None else (float(seen.position[0]), float(seen.position[1]))

    def seen(self, agent: str) -> SeenPerson | None:
        """Return when and where somebody was seen last."""
        return self.memory.seen(agent)

    def hearsay(self, name: str) -> Hearsay | None:
        """Return the last that one heard of where somebody was, at a place that the map has."""
        for heard in reversed(self.memory.heard):
            for claim in claims_in(heard.text):
                about = claim.person or self.name_of(heard.speaker)
                place = place_named(self.public_map, claim.place) if claim.kind in _HEARSAY else None
                if place is not None and about.lower() == name.lower():
                    return Hearsay(heard, claim, place)
        return None

    def usual(self, agent: str, time: float) -> Habit | None:
        """Return where somebody usually is at a time, if one knows them that well."""
        person = self.known.get(agent)
        habit = None if person is None else person.usual_at(time % DAY)
        return habit if habit is not None and habit.place in self.public_map.place_by_id else None

    def home_of(self, agent: str) -> PublicPlace | None:
        """Return where somebody lives, if one knows."""
        person = self.known.get(agent)
        return None if person is None else self.public_map.place_by_id.get(person.home)

    def place_called(self, what: str, position: tuple[float, float]) -> PublicPlace | None:
        """Return the nearest place of a name or kind that one knows: near by, or where one or one's friends go."""
        bare = read_grammar().bare
        wanted = bare(what).lower()
        ids = {place.id for place in self.public_map.places_near(position, NEAR)} | self._frequented_places
        known = [place for place in self.public_map.places if place.id in ids]
        found = [place for place in known if bare(place.name).lower() == wanted]
        found = found or [place for place in known if place.kind.replace("_", " ") == wanted]
        return min(found, key=lambda place: math.dist(place.position[:2], position), default=None)

    @cached_property
    def _frequented_places(self) -> set[str]:
        """Ids of places where one goes, or people whom one knows."""
        theirs = {habit.place for one in self.known.values() for habit in one.habits}
        return {*self.me.places, *theirs, *(one.home for one in self.known.values())}

    def beside(self, x: float, y: float) -> PublicPlace | None:
        """Return the nearest place that a point lies beside, of those with names of their own."""
        near = self.public_map.places_near((x, y), BESIDE)
        return next((place for place in near if place.name), None)

    def visits(self) -> list[tuple[Visit, Stay, PublicPlace]]:
        """Return where one has been, in order."""
        places = self.public_map.place_by_id
        return [
            (visit, self.stays[visit.stay], places[visit.place])
            for visit in self.memory.visits
            if visit.stay < len(self.stays) and visit.place in places
        ]

    def plans(self, time: float) -> list[tuple[Stay, float, PublicPlace]]:
        """Return the stays that are still to come today, each with its end, seconds of the day."""
        places = self.public_map.place_by_id
        ends = [*(stay.leave for stay in self.stays[1:]), DAY - 1.0]
        return [
            (stay, end, places[stay.place])
            for stay, end in zip(self.stays, ends, strict=True)
            if stay.due > time % DAY and stay.place in places
        ]


__all__ = ["BESIDE", "NEAR", "Hearsay", "Knowledge", "Moment", "Person", "moment_of", "person_of"]
