"""When buses go: departures day after day, how many buses a line has, and the times that those buses can keep."""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass
from typing import ClassVar

from vico.clock import DAY
from vico.rules import BUS_DWELL, BUS_LAYOVER
from vico.world.transit_model import Line, TramLine


def departure(line: Line, number: int) -> int:
    """When a line's departure of this number is, seconds from the midnight before the first; each day is alike."""
    days, of_the_day = divmod(number, len(line.departures))
    return line.departures[of_the_day] + DAY * days


def next_departure(line: Line, second: float) -> int:
    """Return the number of the first departure at a time or after it."""
    days, of_the_day = divmod(second, DAY)
    return bisect_left(line.departures, of_the_day) + len(line.departures) * int(days)


def buses_needed(line: Line) -> int:
    """Buses under way when most are: departures within the time of a round and its layover, but no more than stops."""
    n = len(line.departures)
    whole = line.travel[-1] + BUS_DWELL + BUS_LAYOVER
    ahead = 0
    most = 1
    for k in range(n):
        while departure(line, ahead + 1) < line.departures[k] + whole:
            ahead += 1
        most = max(most, ahead - k + 1)
    return min(most, len(line.stops))


@dataclass(frozen=True)
class LineTimes:
    """The times a line's buses keep, rounds by number from the first of the first day on.

    A line has `buses_needed` buses and no more. Where its timetable asks for more, a round begins when a bus is back.

    Attributes
    ----------
    line
        Whose times they are.
    buses
        How many there are; the bus of round ``k`` drives round ``k + buses`` next.
    departures
        When the rounds of a day leave the first stop, seconds of the day.
    """

    line: Line
    buses: int
    departures: tuple[float, ...]
    #: Whether who stays in comes round again.
    round: ClassVar[bool] = True

    @classmethod
    def of(cls, line: Line) -> LineTimes:
        """Work out the times of a line that has a departure and two stops at least."""
        buses, back = buses_needed(line), line.travel[-1] + BUS_DWELL
        kept: list[float] = []
        for k, due in enumerate(line.departures):
            kept.append(max(float(due), kept[k - buses] + back) if k >= buses else float(due))
        return cls(line, buses, tuple(kept))

    def begins(self, number: int) -> float:
        """When a round leaves the first stop, seconds from the midnight before the first."""
        days, of_the_day = divmod(number, len(self.departures))
        return self.departures[of_the_day] + DAY * days

    def arrives(self, number: int, stop: int) -> float:
        """When the bus of a round comes to a stop of its line; ``len(stops)`` is the first one again, at the end."""
        return self.begins(number) + self.line.travel[stop]

    def leaves(self, number: int, stop: int) -> float:
        """When the bus of a round leaves a stop of its line; from ``len(stops)`` it goes on with its next round."""
        if stop == len(self.line.stops):
            return max(self.begins(number + self.buses), self.arrives(number, stop) + BUS_DWELL)
        return self.begins(number) if stop == 0 else self.arrives(number, stop) + BUS_DWELL

    def next_round(self, stop: int, second: float) -> int:
        """Return the number of the first round that leaves a stop at a time or after it."""
        before = self.leaves(0, stop) - self.begins(0)
        days, of_the_day = divmod(second - before, DAY)
        return bisect_left(self.departures, of_the_day) + len(self.departures) * int(days)


@dataclass(frozen=True)
class TramTimes:
    """The times that a tram line keeps in one direction, trams by number from the first of the first day on.

    Attributes
    ----------
    line
        Whose times they are; it has a departure.
    """

    line: TramLine
    round: ClassVar[bool] = False

    def begins(self, number: int) -> float:
        """When a tram comes in where the track begins, seconds from the midnight before the first."""
        days, of_the_day = divmod(number, len(self.line.departures))
        return self.line.departures[of_the_day] + DAY * days

    def arrives(self, number: int, stop: int) -> float:
        """When a tram comes to a stop of its line."""
        return self.begins(number) + self.line.travel[stop]

    def leaves(self, number: int, stop: int) -> float:
        """When a tram leaves a stop of its line."""
        return self.arrives(number, stop) + BUS_DWELL

    def next_round(self, stop: int, second: float) -> int:
        """Return the number of the first tram that leaves a stop at a time or after it."""
        days, of_the_day = divmod(second - self.line.travel[stop] - BUS_DWELL, DAY)
        return bisect_left(self.line.departures, of_the_day) + len(self.line.departures) * int(days)
