"""Guide: a quadruped shows a person the way.

Task
    Go to where somebody waits who does not know the way, call them, lead them to a spot or the door of a place. They
    follow while the robot is within 7 m and in sight, and stop now and then; who has not seen it for a minute gives up.
Randomizations
    Person, pace, where they wait, destination, when and for how long they stop, time of day, the robot's place.
Success
    Robot and person are within 4 m of the destination, and of each other. It never fell.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from vico.agents.teaming.newcomer import GAVE_UP, I_FOLLOW
from vico.challenges.assistant.model import Region
from vico.challenges.assistant.regions import place_region
from vico.challenges.drawing import Draw, person_of
from vico.challenges.teaming.drawing import has_ways, pace, somebody, walk_task
from vico.challenges.teaming.looking import Company, Look, away
from vico.challenges.teaming.model import Pause, TeamingTask, Walk
from vico.challenges.teaming.thresholds import (
    ARRIVED,
    FOLLOWS_WITHIN,
    LEAST_WALK,
    MOST_PAUSES,
    MOST_WALK,
    PAUSES,
    TOGETHER,
    WAITS_WITHIN,
)
from vico.world.world import World

#: Who guides.
ROBOT = "go2"
#: Why it fails, in the order in which a table lists them.
CAUSES = (
    "not met",  # the person was never called
    "fallen",  # the robot fell
    "person lost",  # the person gave up
    "left behind",  # the robot was there, without the person
    "out of time",  # it was on the way to the end
)


def draw_task(draw: Draw, frame: dict[str, Any]) -> TeamingTask | None:
    """Draw a task; None where this start has nowhere to go to."""
    who, hood = somebody(draw)
    targets = [place_region(place) for place in hood.places_of(who)]
    targets += hood.spots_of(who, draw.chance, radius=ARRIVED)
    targets = [region for region in targets if LEAST_WALK <= hood.distance(region.centre) <= MOST_WALK]
    waits = draw.spot(hood.start, *WAITS_WITHIN)
    if not targets or waits is None:
        return None
    order = [targets[int(k)] for k in draw.chance.permutation(len(targets))]
    target = order[draw.pick("Where to?", [region.name for region in order], who)]
    goal = np.array(target.centre[:2])
    if not has_ways(draw, ROBOT, hood.start, (waits, WAITS_WITHIN[0]), (goal, ARRIVED / 3)):
        return None
    person = person_of(who)
    text = (
        f"{who.name}, {person.looks}, waits near by and does not know the way: go there and call them, lead them "
        f"{_to(target)}, and see that they come along."
    )
    return walk_task(
        draw,
        frame,
        robot=ROBOT,
        start=hood.start,
        text=text,
        person=person,
        destination=target,
        walk=lambda: Walk(
            waits_at=draw.stands(waits, towards=hood.start),
            pace=pace(draw),
            pauses=_pauses(draw, hood.distance(target.centre)),
        ),
    )


def _to(region: Region) -> str:
    return f"to the door of {region.name}" if region.place else f"to {region.name}"


def _pauses(draw: Draw, walk: float) -> tuple[Pause, ...]:
    count = int(draw.chance.integers(1, MOST_PAUSES + 1))
    after = sorted(draw.chance.uniform(3.0, max(walk - 5.0, 4.0), count).round(1).tolist())
    return tuple(Pause(after=at, seconds=round(float(draw.chance.uniform(*PAUSES)), 1)) for at in after)


class Guide:
    """Follows one episode, a look a second.

    Attributes
    ----------
    done_at
        Second at which it was done; None before.
    company
        How much of the way the robot was near enough to be followed.
    """

    causes = CAUSES

    def __init__(self, task: TeamingTask, world: World) -> None:
        self._goal = task.destination.centre
        self.done_at: float | None = None
        self.over = False
        self.company = Company()
        self._called = self._gave_up = self._was_there = False

    def look(self, look: Look) -> None:
        """Take in how things stand."""
        self._called = self._called or I_FOLLOW in look.said
        if not self._called or self.over:
            return
        robot, person = look.robots[0], look.person
        self.company.count(away(robot, person) <= FOLLOWS_WITHIN)
        there = away(robot, self._goal) <= ARRIVED
        self._was_there = self._was_there or there
        if there and away(person, self._goal) <= ARRIVED and away(robot, person) <= TOGETHER:
            self.done_at, self.over = look.second, True
        elif GAVE_UP in look.said:
            self._gave_up = self.over = True

    def cause(self) -> str:
        """Return why it failed; "" if it did not."""
        if self.done_at is not None:
            return ""
        if not self._called:
            return "not met"
        if self._was_there:
            return "left behind"
        return "person lost" if self._gave_up else "out of time"
