"""What teaming tasks are drawn with beside what every task of robots is: ways, walks, things seen from above."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.assets.models.movable import MovableKind, movable_kinds
from vico.assets.robots import robot_model
from vico.challenges.assistant.model import Person, Region
from vico.challenges.assistant.regions import Neighbourhood
from vico.challenges.drawing import Draw
from vico.challenges.teaming.model import Member, TeamingTask, Walk
from vico.challenges.teaming.thresholds import LEAST_AREA, MOST_WALK, PACES
from vico.community.model import Resident

Array = NDArray[np.float64]

_AGE = 14  # of who asks at least, years
# Ways of robots may be so much longer than people's walks.
_DETOUR = 1.5


def somebody(draw: Draw) -> tuple[Resident, Neighbourhood]:
    """Return somebody, and what lies about a start near a place that they know."""
    people = draw.people(_AGE)
    return draw.asker([people[int(k)] for k in draw.chance.permutation(len(people))], reach=MOST_WALK)


def has_ways(draw: Draw, model: str, start: Array, *points: tuple[Array, float]) -> bool:
    """Return whether a robot can stand somewhere, and go near points from there: each with how near, metres."""
    robot = robot_model(model)
    return draw.ways.stands(robot, start) and draw.ways.lead(robot, start, points, within=_DETOUR * MOST_WALK)


def visible_kinds() -> list[MovableKind]:
    """Return the kinds of things that are large enough to be seen from above."""
    return [kind for kind in movable_kinds().values() if kind.size[0] * kind.size[1] >= LEAST_AREA]


def pace(draw: Draw) -> float:
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
