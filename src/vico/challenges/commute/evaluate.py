"""Evaluating a commuter's day: when each commute began and ended, what it cost, and why it failed."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from vico.challenges.commute.tasks import ARRIVAL, LEFT, Appointment, CommuteTask
from vico.challenges.records import Part
from vico.rules import BIKE_ASTRAY, BIKE_RATE, ride_price
from vico.runner.loop import Hook, Step
from vico.runner.truth import GroundTruth
from vico.world.public import PublicMap

#: Who stands this near to where one waits for a bus or tram, metres, waits for one.
_AT_STOP = 5.0
_STILL = 0.05


@dataclass
class CommuteLog:
    """What happened on one commute.

    Attributes
    ----------
    item
        Where to.
    released
        When the stay before it ended.
    origin
        Where the agent was then, ENU metres.
    left, arrived
        When it left and when it arrived; None if it did not.
    ended
        When the commute was over, arrived or not; None before.
    walked
        Metres on foot.
    spent
        Money; what a bicycle costs counts where it is left.
    steps, collisions, failures, waits
        Steps of it, those that were stopped by something, those without an action of the agent, and those that the
        agent stood at a stop.
    astray
        Bicycles left away from stations.
    ended_at_step
        Number of the step it ended with.
    """

    item: Appointment
    released: float
    origin: tuple[float, float]
    left: float | None = None
    arrived: float | None = None
    ended: float | None = None
    walked: float = 0.0
    spent: float = 0.0
    steps: int = 0
    collisions: int = 0
    failures: int = 0
    waits: int = 0
    astray: int = 0
    ended_at_step: int = 0

    @property
    def travel(self) -> float:
        """Seconds from leaving until it was over; from the release on where an agent that never left did not arrive."""
        if self.ended is None:
            return 0.0
        begun = self.left if self.left is not None else (self.ended if self.arrived is not None else self.released)
        return self.ended - begun

    @property
    def late(self) -> bool:
        """Whether the agent was not there at the start of the appointment."""
        return self.arrived is None or self.arrived > self.item.start


@dataclass
class _PreviousState:
    """How things stood after the step before."""

    position: tuple[float, float]
    vehicle: str
    money: float


@dataclass
class DayJudge(Hook):
    """Follows an agent through its day.

    Attributes
    ----------
    task
        The day.
    name
        The agent's.
    purse
        Tells what it has and owes.
    stops
        Where one waits for buses and trams, ENU metres.
    logs
        Of the commutes so far, the one under way last.
    stays
        Whether the agent is at an appointment: it is not asked until that ends.
    over
        Whether the day is.
    """

    task: CommuteTask
    name: str
    purse: GroundTruth
    stops: list[tuple[float, float]]
    logs: list[CommuteLog] = field(default_factory=list)
    stays: bool = False
    over: bool = False
    _seen: _PreviousState | None = None
    _mounted: float = 0.0

    def begin(self, observations: Mapping[str, dict[str, Any]]) -> None:
        """Take in how things stand when the agent is asked again, at the start or after a stay."""
        self._take(observations[self.name])
        if not self.logs:
            self._open(float(observations[self.name]["state"]["time"]))

    def release(self, time: float) -> None:
        """End the stay: the next commute begins."""
        self.stays = False
        self._open(time)

    def on_step(self, step: Step) -> None:
        """Look at a step."""
        observation = step.result.observations.get(self.name)
        if observation is not None and not self.over:
            self._watch(observation, failed=self.name in step.failures, number=step.number)

    def _watch(self, observation: Mapping[str, Any], *, failed: bool, number: int) -> None:
        log, before, state = self.logs[-1], self._seen, observation["state"]
        assert before is not None
        now = self._take(observation)
        time, moved = float(state["time"]), math.dist(before.position, now.position)
        on_foot = not now.vehicle and not before.vehicle
        log.steps += 1
        log.failures += failed
        log.collisions += state["action_status"] == "collision"
        log.waits += on_foot and moved < _STILL and self._is_at_stop(now.position)
        log.walked += moved if on_foot else 0.0
        log.spent += before.money - now.money
        log.astray += self._is_astray(before.money - now.money, time)
        boarded = now.vehicle not in ("", before.vehicle)
        if boarded:
            self._mounted = time
        if log.left is None and (boarded or math.dist(now.position, log.origin) > LEFT):
            log.left = time
        last = len(self.logs) == self.task.commutes
        arrives_as = ("",) if last else ("", "bike")
        if now.vehicle in arrives_as and math.dist(now.position, log.item.position) <= ARRIVAL:
            log.arrived = time
            self._close(time, number)
        elif time >= log.item.end:
            self._close(time, number)

    def _close(self, time: float, number: int) -> None:
        log = self.logs[-1]
        log.ended, log.ended_at_step = time, number
        self.over = len(self.logs) == self.task.commutes
        if self.over:
            left = self.purse.bicycle_price(self.name)
            log.spent += left
            log.astray += self._is_astray(left, time)
        elif log.arrived is not None:
            self.stays = True
        else:
            self._open(time)

    def _is_astray(self, paid: float, time: float) -> bool:
        """Whether what was paid for a bicycle is more than its rent: that of a long ride may be as much."""
        rent = ride_price(time - self._mounted, returned=True)
        return paid >= BIKE_ASTRAY and paid - rent >= BIKE_ASTRAY - 2 * BIKE_RATE

    def _open(self, time: float) -> None:
        assert self._seen is not None
        item = self.task.appointments[len(self.logs) + 1]
        self.logs.append(CommuteLog(item, time, self._seen.position))

    def _take(self, observation: Mapping[str, Any]) -> _PreviousState:
        x, y = observation["pose"][:2]
        self._seen = _PreviousState(
            (float(x), float(y)), str(observation["state"]["vehicle"]), self.purse.money(self.name)
        )
        return self._seen

    def _is_at_stop(self, point: tuple[float, float]) -> bool:
        return any(math.dist(point, stop) <= _AT_STOP for stop in self.stops)


#: All causes, in the order in which they are looked for.
CAUSES = (
    "no_action",  # for most of the way, or for longer than it was late, the agent crashed or had no action
    "too_little_slack",  # late, and so would have been who takes the trip that arrives first by the timetable
    "blocked",  # something stood in the way for a quarter of the way, or for longer than the agent was late
    "left_late",  # late by no more than it stood at the start
    "missed_bus",  # late by no more than it stood at stops
    "slow_way",  # late otherwise: a way or a mode that takes too long
    "out_of_time",  # the day was over
    "never_arrived",  # the appointment was over
    "bike_astray",  # in time, but a bicycle was left away from stations, or ridden still when the day was over
)


def part_of(log: CommuteLog, number: int, public_map: PublicMap, *, last: bool) -> Part:
    """Return what a commute came to.

    Parameters
    ----------
    number
        Of the commute, from 1.
    public_map
        Its router tells whether there was a way in time.
    last
        Whether it was the day's last.
    """
    name = f"{number} to {log.item.name}"
    cause = _cause(log, public_map, last=last)
    return Part(name, not cause, cause, log.ended_at_step if not cause else None)


def _cause(log: CommuteLog, public_map: PublicMap, *, last: bool) -> str:
    if not log.late:
        return "bike_astray" if log.astray else ""
    by = log.arrived - log.item.start if log.arrived is not None else 0.5 * log.steps
    if log.failures and log.failures >= by:
        return "no_action"
    if not _could_be_in_time(log, public_map):
        return "too_little_slack"
    if log.collisions and log.collisions >= min(by, 0.25 * log.steps):
        return "blocked"
    if log.arrived is None:
        return "out_of_time" if last else "never_arrived"
    if (log.left if log.left is not None else log.arrived) - log.released >= by:
        return "left_late"
    return "missed_bus" if log.waits >= by else "slow_way"


def _could_be_in_time(log: CommuteLog, public_map: PublicMap) -> bool:
    trip = public_map.trips.plan(log.origin, log.item.position, log.released)
    return trip is not None and trip.arrive <= log.item.start
