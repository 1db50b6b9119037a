"""What tasks of robots are drawn with: somebody, free ground, a thing, each choice out of nine."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from vico.assets.models.movable import MovableKind, movable_colours, movable_kinds
from vico.assets.people.words import looks_in_words
from vico.challenges.assistant.choose import Chooser, Question, choose
from vico.challenges.assistant.model import Person, Start, TaskObject
from vico.challenges.assistant.regions import Neighbourhood
from vico.challenges.ways import Ways
from vico.community.model import Community, Resident
from vico.errors import InputError
from vico.geometry import distance
from vico.world.walkable import OPEN, SIDEWALK
from vico.world.world import World

Array = NDArray[np.float64]

#: Free ground that robots and things need around them, metres.
ROOM = 1.0
# Points that are tried; so far off a place that somebody knows it begins, metres.
_TRIES, _ABOUT = 40, 40.0
# Share of the world in which tasks begin: nothing is known of what lies beyond it.
_INNER = 0.8
_HOURS = tuple(range(9, 18))


@dataclass
class Draw:
    """One episode as it is drawn."""

    world: World
    community: Community
    category: str
    chance: np.random.Generator
    chooser: Chooser
    candidates: dict[str, list[str]] = field(default_factory=dict)
    ways: Ways = field(init=False)

    def __post_init__(self) -> None:
        self.ways = Ways(self.world)

    def pick(self, question: str, names: list[str], who: Resident | None) -> int:
        """Have one of nine chosen, and note what it was chosen from."""
        choice = choose(Question(question, self.category, who), names, self.chooser)
        self.candidates[question] = choice.candidates
        return choice.chosen

    def people(self, age: int) -> list[Resident]:
        """Return those who are of an age at least, years."""
        return [who for who in self.community.residents if who.age >= age]

    def asker(self, people: Sequence[Resident], *, reach: float) -> tuple[Resident, Neighbourhood]:
        """Return one of some people, and what lies within a walk about a start near a place that they know."""
        who = people[self.pick("Who asks?", [one.name for one in people], None)]
        places = [self.world.place_by_id[place] for place in dict.fromkeys((who.home, *who.known_places))]
        inner = [xy for place in places if max(map(abs, xy := place.position[:2])) < _INNER * self.world.half]
        near = inner[int(self.chance.integers(len(inner)))] if inner else (0.0, 0.0)
        start = self.world.walkable.random_point(self.chance, near=near, radius=_ABOUT, clearance=ROOM)
        return who, Neighbourhood(self.world, self.world.router, start, reach=reach)

    def spot(
        self, near: Array, low: float, high: float, *, suits: Callable[[Array], bool] | None = None
    ) -> Array | None:
        """Return free ground so far from a point that suits; None if there is none."""
        for _ in range(_TRIES):
            try:
                found = self.world.walkable.random_point(
                    self.chance, classes=(OPEN, SIDEWALK), near=near, radius=high, clearance=ROOM
                )
            except InputError:
                return None
            if low <= distance(found, near) and (suits is None or suits(found)):
                return found
        return None

    def stands(self, at: Array, *, towards: Array | None = None) -> Start:
        """Return a start at a point that looks somewhere, or towards another point."""
        if towards is None:
            yaw = float(self.chance.uniform(-np.pi, np.pi))
        else:
            yaw = math.atan2(towards[1] - at[1], towards[0] - at[0])
        return Start(position=(float(at[0]), float(at[1])), yaw=yaw)

    def thing(
        self, question: str, kinds: Sequence[MovableKind], who: Resident, at: Array, *, holder: str | None = None
    ) -> TaskObject:
        """Return a thing of one of some kinds that lies at a point, or is held."""
        order = [kinds[int(k)] for k in self.chance.permutation(len(kinds))]
        kind = order[self.pick(question, [one.kind for one in order], who)]
        colours = list(movable_colours())
        colour = colours[int(self.chance.integers(len(colours)))]
        return TaskObject(
            id="object",
            kind=kind.kind,
            colour=colour,
            name=f"{colour} {kind.kind}",
            position=(float(at[0]), float(at[1]), float(self.world.height(at))),
            yaw=float(self.chance.uniform(-np.pi, np.pi)),
            room=None,
            holder=holder,
        )

    def hour(self) -> str:
        """Return the time of day at which it begins."""
        return f"{int(self.chance.choice(_HOURS)):02d}:00"


def described(thing: TaskObject) -> str:
    """Return what a thing is, in words."""
    return movable_kinds()[thing.kind].described(thing.colour)


def person_of(who: Resident) -> Person:
    """Return what robots are told of somebody."""
    return Person(agent=who.id, name=who.name, looks=looks_in_words(who.appearance))
