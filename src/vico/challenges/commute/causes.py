"""Why a commute failed, from its log."""

from __future__ import annotations

from vico.challenges.commute.judge import CommuteLog
from vico.challenges.records import Part
from vico.world.public import PublicMap

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
