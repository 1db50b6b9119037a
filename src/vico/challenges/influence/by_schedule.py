"""Playing a day without bodies: members are where their schedule says, walks take what the router says.

Everything else is the same: the same strategies, the same rules of who can be talked with, the same ledger. It leaves
out what bodies bring: members who are late, doors, looking for somebody in a house, noise.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from vico.agents.influence.courtship import Courtship
from vico.agents.influence.days import DayPlan, day_plan
from vico.challenges.influence.day import Day
from vico.clock import clock_of
from vico.rules import WALK_SPEED
from vico.world.world import World

# Seconds: one thinks again after so long where there is nobody to see; it takes so long to find somebody at a place,
# and so long to say something and be answered; who is to come is late by so much.
_THINK, _FIND, _ROUND, _LATE = 30.0, 30.0, 3.0, 30.0


@dataclass
class Mover:
    """A main agent without a body: where it is, and when it is next to decide."""

    courtship: Courtship
    place: str
    free_at: float


class Walks:
    """Tells how long the walks between places take; each is found once a world."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._known: dict[tuple[str, str], float] = {}

    def seconds(self, start: str, goal: str) -> float:
        """Return how long a walk takes, seconds; infinite where there is none."""
        if start == goal:
            return 0.0
        key = min((start, goal), (goal, start))
        if key not in self._known:
            places = self._world.place_by_id
            # In one direction always: the other one may come to a little more or less.
            one, other = (places[place].position for place in key)
            self._known[key] = self._world.router.seconds(one, other, WALK_SPEED)
        return self._known[key]

    def position(self, place: str) -> tuple[float, float]:
        """Return where a place is, ENU metres."""
        x, y, _ = self._world.place_by_id[place].position
        return x, y


def play_by_schedule(day: Day, walks: Walks) -> None:
    """Play a day through; what was said stands in its ledger."""
    plans = plans_of(day)
    movers = movers_of(day, plans)
    while (mover := min(movers, key=lambda one: (one.free_at, one.courtship.me.id))).free_at < day.task.ends:
        next_visit(day, mover, plans, walks)


def plans_of(day: Day) -> dict[str, DayPlan]:
    """Return everybody's day by id."""
    return {resident.id: day_plan(resident.schedule) for resident in day.community.residents}


def movers_of(day: Day, plans: Mapping[str, DayPlan]) -> list[Mover]:
    """Return the main agents where the day finds them."""
    homes = {resident.id: resident.home for resident in day.community.residents}
    return [
        Mover(courtship, plans[main].at(day.task.begins).place or homes[main], day.task.begins)
        for main, courtship in sorted(day.courtships.items())
    ]


def next_visit(day: Day, mover: Mover, plans: dict[str, DayPlan], walks: Walks) -> None:
    """Let a main agent see somebody, or wait."""
    time, courtship = mover.free_at, mover.courtship

    def seconds_to(place: str) -> float:
        return walks.seconds(mover.place, place)

    target = courtship.choose(time, walks.position(mover.place), seconds_to)
    stay = None if target is None else courtship.meeting(target, time, seconds_to)
    if target is None or stay is None or stay.place is None or not math.isfinite(seconds_to(stay.place)):
        mover.free_at = time + _THINK
        return
    courtship.set_out(target, stay.place, time)
    there = max(time + seconds_to(stay.place) + _FIND, stay.start + _LATE)
    mover.place = stay.place
    if there >= min(stay.end, day.task.ends):
        courtship.give_up(target, there, "not reached")
        mover.free_at = there
        return
    courtship.begin(target, there)
    mover.free_at = _talk(day, mover, target, there, plans, walks)


def _talk(day: Day, mover: Mover, target: str, time: float, plans: dict[str, DayPlan], walks: Walks) -> float:
    """Talk until one has nothing more to say, or is not answered; return when that was."""
    here = walks.position(mover.place)
    while True:
        text = mover.courtship.message(time, here, lambda place: walks.seconds(mover.place, place))
        if text is None:
            return time + _ROUND
        gone = not plans[target].at(time).can_talk
        member = next((m for m in day.task.members if day.ledger.is_meant(m, text)), None)
        answer = None
        if member is not None and (member == target or plans[member].at(time).place == mover.place):
            distance = 1.5
            answer = day.ledger.say(time, mover.courtship.me.id, member, text, distance=distance, on_the_way=gone)
        time += _ROUND
        if answer is None or gone:
            mover.courtship.break_off(time, "on the way" if gone else "no answer")
            return time
        mover.courtship.heard(answer)


def time_line(day: Day) -> list[str]:
    """Return what was said to whom, a line a message."""
    return [f"{clock_of(int(u.time))} {u.speaker} to {u.listener}: {u.text}" for u in day.ledger.utterances]
