"""Categories of teaming: how their tasks are drawn, and the judge's view once a second."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.assets.models.movable import MovableKind, movable_kinds
from vico.assets.robots import robot_model
from vico.challenges.assistant.placement import Neighbourhood
from vico.challenges.assistant.tasks import Person, Region
from vico.challenges.robot_tasks import Draw
from vico.challenges.teaming.tasks import LEAST_AREA, MOST_WALK, PACES, STILL, UPRIGHT, Member, TeamingTask, Walk
from vico.community.model import Resident
from vico.runner.truth import RobotPopulation

Array = NDArray[np.float64]

_AGE = 14  # of who asks at least, years
# Ways of robots may be so much longer than people's walks.
_DETOUR = 1.5


def draw_person(draw: Draw) -> tuple[Resident, Neighbourhood]:
    """Return somebody, and what lies about a start near a place that they know."""
    people = draw.people(_AGE)
    return draw.asker([people[int(k)] for k in draw.chance.permutation(len(people))], reach=MOST_WALK)


def has_routes(draw: Draw, model: str, start: Array, *points: tuple[Array, float]) -> bool:
    """Return whether a robot can stand somewhere, and go near points from there: each with how near, metres."""
    robot = robot_model(model)
    return draw.ways.stands(robot, start) and draw.ways.lead(robot, start, points, within=_DETOUR * MOST_WALK)


def visible_kinds() -> list[MovableKind]:
    """Return the kinds of things that are large enough to be seen from above."""
    return [kind for kind in movable_kinds().values() if kind.size[0] * kind.size[1] >= LEAST_AREA]


def draw_pace(draw: Draw) -> float:
    """Return how fast somebody walks, metres a second."""
    return round(float(draw.chance.uniform(*PACES)), 2)


def walk_task(
    draw: Draw,
    frame: dict[str, Any],
    *,
    robot: str,
    start: Array,
    text: str,
    person: Person,
    destination: Region,
    walk: Callable[[], Walk],
) -> TeamingTask:
    """Return the task of one robot that walks with a person.

    Parameters
    ----------
    start
        Where it begins, ENU metres.
    walk
        Draws what the person does, after everything else.
    """
    return TeamingTask(
        **frame,
        start=draw.hour(),
        team=[Member(model=robot, start=draw.stands(start))],
        text=text,
        person=person,
        walk=walk(),
        thing=None,
        destination=destination,
        candidates=dict(draw.candidates),
    )


@dataclass(frozen=True)
class JudgeSample:
    """How things stand.

    Attributes
    ----------
    second
        Of the episode.
    robots
        Where they are, ENU metres, shape ``(n, 3)``.
    stands
        Whether each is upright and still.
    person, place, outdoors
        Where the person is, id of the place they are in ("": none), and whether they are in no room; where nobody is
        walked with, the origin.
    said
        What the person has said since the last look.
    thing
        Where the thing is; None where there is none.
    shown
        Pixels of the thing in each robot's picture, where it is near enough; else 0.
    """

    second: float
    robots: Array
    stands: tuple[bool, ...]
    person: Array
    place: str
    outdoors: bool
    said: tuple[str, ...] = ()
    thing: Array | None = None
    shown: tuple[int, ...] = ()


def standing_robots(robots: RobotPopulation) -> tuple[bool, ...]:
    """Return which robots are upright and still."""
    return tuple(_stands(robots.observation(k)) for k in range(len(robots.names)))


def _stands(felt: dict[str, NDArray[Any]]) -> bool:
    upright = float(-felt["gravity"][2]) >= UPRIGHT
    return upright and not felt["fallen"][0] and float(np.hypot(*felt["base_velocity"][:2])) <= STILL


def ground_distance(a: Any, b: Any) -> float:
    """Metres between two points over the ground."""
    return float(np.hypot(*(np.asarray(a, np.float64)[:2] - np.asarray(b, np.float64)[:2])))


@dataclass
class Accompaniment:
    """How much of a person's way a robot was with them.

    Attributes
    ----------
    walked, beside
        Looks at the person on the way, and those at which the robot was near enough.
    """

    walked: int = 0
    beside: int = 0

    def count(self, near: bool) -> None:
        """Count a look."""
        self.walked += 1
        self.beside += near

    def share(self) -> float:
        """Return on which share of the way the robot was near enough, percent."""
        return 100.0 * self.beside / self.walked if self.walked else 0.0
