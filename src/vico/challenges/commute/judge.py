"""The judge of a commuter's day: when each commute began and ended, what it cost, and why it went wrong.

Travel time counts from leaving (the first second more than 5 m from where the agent stood when its stay ended, or in a
vehicle it was not in before) until arrival, the first second within 3 m of the appointment's point on foot or on a
bicycle; at the day's last one on foot, for the bicycle has to be back by then. Waiting before one leaves and waiting
for the start of an appointment do not count. An appointment whose end passes is missed: that commute counts until then,
and the next one begins where the agent is.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from vico.challenges.commute.model import Appointment, CommuteTask
from vico.challenges.commute.rules import ARRIVAL, LEFT
from vico.rules import BIKE_ASTRAY, BIKE_RATE, ride_price
from vico.runner.loop import Hook, Step

#: Who stands this near to where one waits for a bus or tram, metres, waits for one.
_AT_STOP = 5.0
_STILL = 0.05


class Purse(Protocol):
    """What the judge asks of the truth."""

    def money(self, name: str) -> float:
        """Return what an agent has, less what it owes."""

    def bicycle_price(self, name: str) -> float:
        """Return what it would pay if it left its bicycle here and now; 0 without one."""


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
class _Seen:
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
    purse: Purse
    stops: list[tuple[float, float]]
    logs: list[CommuteLog] = field(default_factory=list)
    stays: bool = False
    over: bool = False
    _seen: _Seen | None = None
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

    def _take(self, observation: Mapping[str, Any]) -> _Seen:
        x, y = observation["pose"][:2]
        self._seen = _Seen((float(x), float(y)), str(observation["state"]["vehicle"]), self.purse.money(self.name))
        return self._seen

    def _is_at_stop(self, point: tuple[float, float]) -> bool:
        return any(math.dist(point, stop) <= _AT_STOP for stop in self.stops)
