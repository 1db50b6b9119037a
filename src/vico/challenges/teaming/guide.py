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

from vico.agents.teaming.people import GAVE_UP, I_FOLLOW
from vico.challenges.assistant.placement import place_region
from vico.challenges.robot_tasks import Draw, person_of
from vico.challenges.teaming.category import (
    Accompaniment,
    JudgeSample,
    draw_pace,
    draw_person,
    ground_distance,
    has_routes,
    walk_task,
)
from vico.challenges.teaming.tasks import (
    ARRIVED,
    FOLLOWS_WITHIN,
    LEAST_WALK,
    MOST_PAUSES,
    MOST_WALK,
    PAUSES,
    TOGETHER,
    WAITS_WITHIN,
    Pause,
    TeamingTask,
    Walk,
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
    who, hood = draw_person(draw)
    targets = [place_region(place) for place in hood.places_of(who)]
    targets += hood.spots_of(who, draw.chance, radius=ARRIVED)
    targets = [region for region in targets if LEAST_WALK <= hood.distance(region.centre) <= MOST_WALK]
    waits = draw.spot(hood.start, *WAITS_WITHIN)
    if not targets or waits is None:
        return None
    order = [targets[int(k)] for k in draw.chance.permutation(len(targets))]
    target = order[draw.pick("Where to?", [region.name for region in order], who)]
    goal = np.array(target.centre[:2])
    if not has_routes(draw, ROBOT, hood.start, (waits, WAITS_WITHIN[0]), (goal, ARRIVED / 3)):
        return None
    person = person_of(who)
    where = f"the door of {target.name}" if target.place else target.name
    text = (
        f"{who.name}, {person.looks}, waits near by and does not know the way: go there and call them, lead them "
        f"to {where}, and see that they come along."
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
            pace=draw_pace(draw),
            pauses=_pauses(draw, hood.distance(target.centre)),
        ),
    )


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
        self.company = Accompaniment()
        self._called = self._gave_up = self._was_there = False

    def look(self, look: JudgeSample) -> None:
        """Take in how things stand."""
        self._called = self._called or I_FOLLOW in look.said
        if not self._called or self.over:
            return
        robot, person = look.robots[0], look.person
        self.company.count(ground_distance(robot, person) <= FOLLOWS_WITHIN)
        there = ground_distance(robot, self._goal) <= ARRIVED
        self._was_there = self._was_there or there
        if there and ground_distance(person, self._goal) <= ARRIVED and ground_distance(robot, person) <= TOGETHER:
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
