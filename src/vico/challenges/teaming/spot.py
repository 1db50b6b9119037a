"""Spot: a drone finds a thing from above, and tells a robot on the ground where it lies.

Task
    Something was lost in an area of 15 m about a spot: find it; the robot on the ground, a Go2 or a Husky, is to stand
    beside it.
Randomizations
    Thing, colour, heading, where it lies, area, which robot is on the ground, time of day, the robots' places.
Success
    The robot on the ground stands still within 2 m of the thing. None of the two ever fell or crashed.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from vico.challenges.assistant.placement import region_text
from vico.challenges.robot_tasks import Draw, object_description, person_of
from vico.challenges.teaming.category import JudgeSample, draw_person, ground_distance, has_routes, visible_kinds
from vico.challenges.teaming.tasks import (
    AREA,
    AREA_WITHIN,
    BESIDE,
    BESIDE_THING,
    GROUND_ROBOTS,
    MOST_WALK,
    SEEN_PIXELS,
    STANDS_FOR,
    Member,
    TeamingTask,
)
from vico.world.world import World

#: Why it fails, in the order in which a table lists them.
CAUSES = (
    "fallen",  # a robot fell, or the drone crashed
    "not found",  # no robot ever had the thing in view
    "not reached",  # seen, and the robot on the ground never stood beside it
)
#: In the order of the team.
DRONE, GROUND = 0, 1


def draw_task(draw: Draw, frame: dict[str, Any]) -> TeamingTask | None:
    """Draw a task; None where this start has no area near by to look in."""
    who, hood = draw_person(draw)
    middle = draw.spot(hood.start, *AREA_WITHIN)
    beside = draw.spot(hood.start, *BESIDE)
    if middle is None or beside is None or hood.distance(middle) > MOST_WALK:
        return None
    lies = draw.spot(middle, 0.0, AREA)
    if lies is None:
        return None
    ground = GROUND_ROBOTS[int(draw.chance.integers(len(GROUND_ROBOTS)))]
    if not has_routes(draw, ground, np.asarray(hood.start), (lies, BESIDE_THING * 0.8)):
        return None
    region = hood.spot(middle, radius=AREA)
    thing = draw.thing("What is lost?", visible_kinds(), who, lies)
    text = (
        f"{who.name} has lost {object_description(thing)} {region_text(region)}: find it, one from above and one on "
        "the ground, which is to stand beside it."
    )
    return TeamingTask(
        **frame,
        start=draw.hour(),
        team=[
            Member(model="drone", start=draw.stands(np.asarray(beside))),
            Member(model=ground, start=draw.stands(hood.start)),
        ],
        text=text,
        person=person_of(who),
        walk=None,
        thing=thing,
        destination=region,
        candidates=dict(draw.candidates),
    )


class Spot:
    """Follows one episode, a look a second.

    Attributes
    ----------
    done_at
        Second at which it was done; None before.
    seen_at
        Second at which the thing was first in view of a robot; None before.
    """

    causes = CAUSES

    def __init__(self, task: TeamingTask, world: World) -> None:
        self.done_at: float | None = None
        self.seen_at: float | None = None
        self.over = False
        self._stood = 0.0

    def look(self, look: JudgeSample) -> None:
        """Take in how things stand."""
        if self.seen_at is None and max(look.shown, default=0) >= SEEN_PIXELS:
            self.seen_at = look.second
        near = look.thing is not None and ground_distance(look.robots[GROUND], look.thing) <= BESIDE_THING
        self._stood = self._stood + 1.0 if near and look.stands[GROUND] else 0.0
        if self._stood >= STANDS_FOR:
            self.done_at = look.second if self.done_at is None else self.done_at
            self.over = True

    def cause(self) -> str:
        """Return why it failed; "" if it did not."""
        if self.done_at is not None:
            return ""
        return "not found" if self.seen_at is None else "not reached"
