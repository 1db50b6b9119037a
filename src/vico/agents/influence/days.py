"""Members' days, as main agents know them: where somebody is to be found, and when they are on the way."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from vico.agents.stays import Item
from vico.clock import DAY, seconds_of_day


@dataclass(frozen=True)
class Stay:
    """A stretch of a day: at a place, or on the way where `place` is None; seconds of the day."""

    start: float
    end: float
    place: str | None
    type: str
    activity: str

    @property
    def can_talk(self) -> bool:
        """Whether one can be spoken to: somewhere, and awake."""
        return self.place is not None and self.type != "sleep"


@dataclass(frozen=True)
class DayPlan:
    """All stays of a day, in order."""

    stays: tuple[Stay, ...]

    def at(self, time: float) -> Stay:
        """Return what somebody does at a time, seconds."""
        of_day = time % DAY
        return next((stay for stay in reversed(self.stays) if stay.start <= of_day), self.stays[0])

    def chances(self, now: float, until: float) -> Iterable[Stay]:
        """Yield the stays between two times of the day in which one can be spoken to."""
        return (stay for stay in self.stays if stay.can_talk and stay.end > now and stay.start < until)


def day_plan(schedule: Iterable[Item]) -> DayPlan:
    """Return a schedule as a plan; the last item lasts until midnight."""
    items = list(schedule)
    stays = []
    for item in items:
        end = DAY if item is items[-1] else seconds_of_day(item.end)
        place = None if str(item.type) == "commute" else item.place
        stays.append(Stay(seconds_of_day(item.start), end, place, str(item.type), item.activity))
    return DayPlan(tuple(stays))
