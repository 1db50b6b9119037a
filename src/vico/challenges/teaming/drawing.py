"""What the tasks of all categories are drawn with: somebody, free ground, a thing, each choice out of nine."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from vico.assets.models.movable import MovableKind, movable_colours, movable_kinds
from vico.assets.people.words import looks_in_words
from vico.assets.robots import robot_model
from vico.challenges.assistant.choose import Chooser, Question, choose
from vico.challenges.assistant.model import Person, Start, TaskObject
from vico.challenges.assistant.regions import Neighbourhood
from vico.challenges.robot.ways import Ways
from vico.challenges.teaming.model import Category
from vico.challenges.teaming.thresholds import LEAST_AREA, MOST_WALK, PACES
from vico.community.model import Community, Resident
from vico.errors import InputError
from vico.world.folder import World
from vico.world.walkable import OPEN, SIDEWALK

#: Free ground that robots and things need around them, metres.
ROOM = 1.0
# Points that are tried; who asks is of this age at least, years; so far off a place that they know it begins, metres.
_TRIES, _AGE, _ABOUT = 40, 14, 40.0
# Share of the world in which tasks begin: nothing is known of what lies beyond it.
_INNER = 0.8
# Ways of robots may be so much longer than people's walks.
_DETOUR = 1.5
_HOURS = tuple(range(9, 18))


@dataclass
class Draw:
    """One episode as it is drawn."""

    world: World
    community: Community
    category: Category
    chance: np.random.Generator
    chooser: Chooser
    candidates: dict[str, list[str]] = field(default_factory=dict)
    _ways: dict[str, Ways] = field(default_factory=dict)

    def pick(self, question: str, names: list[str], who: Resident | None) -> int:
        """Have one of nine chosen, and note what it was chosen from."""
        choice = choose(Question(question, self.category, who), names, self.chooser)
        self.candidates[question] = choice.candidates
        return choice.chosen

    def asker(self) -> tuple[Resident, Neighbourhood]:
        """Return somebody, and what lies about a start near a place that they know."""
        people = [who for who in self.community.residents if who.age >= _AGE]
        order = [people[int(k)] for k in self.chance.permutation(len(people))]
        who = order[self.pick("Who asks?", [one.name for one in order], None)]
        places = [self.world.place_by_id[place] for place in dict.fromkeys((who.home, *who.known_places))]
        inner = [xy for place in places if max(map(abs, xy := place.position[:2])) < _INNER * self.world.half]
        near = inner[int(self.chance.integers(len(inner)))] if inner else (0.0, 0.0)
        start = self.world.walkable.random_point(self.chance, near=near, radius=_ABOUT, clearance=ROOM)
        return who, Neighbourhood(self.world, self.world.router, start, reach=MOST_WALK)

    def spot(
        self, near: NDArray[np.float64], low: float, high: float, *, room: float = ROOM
    ) -> NDArray[np.float64] | None:
        """Return free ground so far from a point; None if there is none."""
        for _ in range(_TRIES):
            try:
                found = self.world.walkable.random_point(
                    self.chance, classes=(OPEN, SIDEWALK), near=near, radius=high, clearance=room
                )
            except InputError:
                return None
            if low <= float(np.hypot(*(found - near))):
                return found
        return None

    def has_ways(self, model: str, start: NDArray[np.float64], *points: tuple[NDArray[np.float64], float]) -> bool:
        """Return whether a robot can stand somewhere, and go near points from there: each with how near, metres."""
        if model not in self._ways:
            robot = robot_model(model)
            self._ways[model] = Ways(self.world, robot, robot)
        ways, robot = self._ways[model], self._ways[model].carrier
        return ways.stands(robot, start) and ways.lead(robot, start, points, within=_DETOUR * MOST_WALK)

    def stands(self, at: NDArray[np.float64], *, towards: NDArray[np.float64] | None = None) -> Start:
        """Return a start at a point that looks somewhere, or towards another point."""
        if towards is None:
            yaw = float(self.chance.uniform(-np.pi, np.pi))
        else:
            yaw = float(np.arctan2(towards[1] - at[1], towards[0] - at[0]))
        return Start(position=(float(at[0]), float(at[1])), yaw=yaw)

    def thing(self, who: Resident, at: NDArray[np.float64]) -> TaskObject:
        """Return a thing that lies at a point and is large enough to be seen from above."""
        kinds = visible_kinds()
        order = [kinds[int(k)] for k in self.chance.permutation(len(kinds))]
        kind = order[self.pick("What is lost?", [one.kind for one in order], who)]
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
        )

    def pace(self) -> float:
        """Return how fast somebody walks, metres a second."""
        return round(float(self.chance.uniform(*PACES)), 2)

    def hour(self) -> str:
        """Return the time of day at which it begins."""
        return f"{int(self.chance.choice(_HOURS)):02d}:00"


def visible_kinds() -> list[MovableKind]:
    """Return the kinds of things that are large enough to be seen from above."""
    return [kind for kind in movable_kinds().values() if kind.size[0] * kind.size[1] >= LEAST_AREA]


def described(thing: TaskObject) -> str:
    """Return what a thing is, in words."""
    return movable_kinds()[thing.kind].described(thing.colour)


def person_of(who: Resident) -> Person:
    """Return what robots are told of somebody."""
    return Person(agent=who.id, name=who.name, looks=looks_in_words(who.appearance))
