"""Accompany: a humanoid walks with a person to a door, and waits there.

Task
    Go to where somebody waits, call them, walk with them to the door of a place, stand there; they go in, and with some
    of the tasks come out again.
Randomizations
    Person, pace, where they wait, place, whether and after how long they come out, time of day, the robot's place.
Success
    The robot was within 4 m of them for 80 % of the way. 20 s after they went in at the latest it stands upright and
    still within 4 m of the door; if they come out again, it did so for 90 % of the time from then until they came out,
    and does when they do. It never fell.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from vico.agents.teaming.people import LETS_GO
from vico.challenges.assistant.evaluate import entrance_of
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
    DOOR_DISTANCE,
    DOOR_GRACE,
    DOOR_SHARE,
    LEAST_WALK,
    MOST_WALK,
    STANDS_FOR,
    STAYS,
    WAITS_WITHIN,
    WITH_DISTANCE,
    WITH_SHARE,
    TeamingTask,
    Walk,
)
from vico.world.world import World

#: Who accompanies.
ROBOT = "h1"
#: Why it fails, in the order in which a table lists them.
CAUSES = (
    "not met",  # the person was never called
    "fallen",  # the robot fell
    "person lost",  # they went in, and it was not with them on the way
    "not at the door",  # it did not stand at the door when it should have
    "person never came",  # they were on the way, or inside, to the end
)


def draw_task(draw: Draw, frame: dict[str, Any]) -> TeamingTask | None:
    """Draw a task; None where this start has no place to go to."""
    who, hood = draw_person(draw)
    world = draw.world
    at_home = world.place_by_id[who.home].building
    near = [p for p in hood.places_of(who) if p.entrance and LEAST_WALK <= hood.distance(p.position) <= MOST_WALK]
    targets = [place for place in near if place.building != at_home]
    waits = draw.spot(hood.start, *WAITS_WITHIN)
    if not targets or waits is None:
        return None
    target = targets[draw.pick("Where to?", [place.name for place in targets], who)]
    door = np.array(target.position[:2])
    if not has_routes(draw, ROBOT, hood.start, (waits, WAITS_WITHIN[0]), (door, DOOR_DISTANCE / 2)):
        return None
    comes_out = bool(draw.chance.integers(2))
    stay = round(float(draw.chance.uniform(*STAYS)), 1) if comes_out else None
    person, region = person_of(who), place_region(target)
    end = "until they come out again" if comes_out else "until they have gone in"
    text = (
        f"{who.name}, {person.looks}, waits near by: go there and call them, walk with them to the door of "
        f"{region.name}, and stand there {end}."
    )
    return walk_task(
        draw,
        frame,
        robot=ROBOT,
        start=hood.start,
        text=text,
        person=person,
        destination=region,
        walk=lambda: Walk(waits_at=draw.stands(waits, towards=hood.start), pace=draw_pace(draw), stay=stay),
    )


class Accompany:
    """Follows one episode, a look a second.

    Attributes
    ----------
    done_at
        Second at which it was done; None before.
    company
        How much of the way the robot was with the person.
    """

    causes = CAUSES

    def __init__(self, task: TeamingTask, world: World) -> None:
        assert task.walk is not None
        self._place, self._comes_out = task.destination.place, task.walk.stay is not None
        self._door = entrance_of(task.destination, world)
        self.done_at: float | None = None
        self.over = False
        self.company = Accompaniment()
        self._called = self._failed = False
        self._inside_since: float | None = None
        self._stood = 0.0
        self._waited = self._at_door = 0

    def look(self, look: JudgeSample) -> None:
        """Take in how things stand."""
        at_door = look.stands[0] and ground_distance(look.robots[0], self._door) <= DOOR_DISTANCE
        self._stood = self._stood + 1.0 if at_door else 0.0
        self._called = self._called or LETS_GO in look.said
        if not self._called or self.over:
            return
        if self._inside_since is None:
            self._walk(look)
            return
        inside = look.second - self._inside_since
        if not self._comes_out:
            self._end(look, good=self._stood >= STANDS_FOR, last=inside >= DOOR_GRACE)
        elif look.outdoors:
            enough = self._at_door >= DOOR_SHARE * self._waited
            self._end(look, good=at_door and enough, last=True)
        elif inside >= DOOR_GRACE:
            self._waited += 1
            self._at_door += at_door

    def _walk(self, look: JudgeSample) -> None:
        if look.place == self._place:
            self._inside_since = look.second
            self._failed = self.company.share() < 100.0 * WITH_SHARE
            self.over = self._failed
            return
        self.company.count(ground_distance(look.robots[0], look.person) <= WITH_DISTANCE)

    def _end(self, look: JudgeSample, *, good: bool, last: bool) -> None:
        if good:
            self.done_at = look.second
        self.over = good or last

    def cause(self) -> str:
        """Return why it failed; "" if it did not."""
        if self.done_at is not None:
            return ""
        if not self._called:
            return "not met"
        if self._failed:
            return "person lost"
        return "not at the door" if self.over else "person never came"
