"""The stays of a day: where to be by when, and when to set out."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Protocol

from vico.clock import seconds_of_day
from vico.world.public import PublicMap

#: Metres a second of who has time, and at most of who is late.
WALK, RUN = 1.0, 2.4
#: Time kept in hand for corners, crossings and doors: a share of the way, and seconds.
SLACK_SHARE, SLACK = 0.15, 20.0


class Item(Protocol):
    """A stretch of the day, as the community's schedules have it."""

    @property
    def type(self) -> str:
        """sleep, meal, main or commute."""

    @property
    def tag(self) -> str | None:
        """What it is about, as `vico.community.model.ActivityTag` has it; None if nobody said."""

    @property
    def start(self) -> str:
        """``HH:MM:SS``."""

    @property
    def end(self) -> str:
        """``HH:MM:SS``."""

    @property
    def activity(self) -> str:
        """What for, in words."""

    @property
    def place(self) -> str | None:
        """Id of the place; None on the way."""

    @property
    def mode(self) -> str | None:
        """On the way: walk, bus or bike; None is walk."""


@dataclass(frozen=True)
class Stay:
    """To be at a place by `due`, and to set out at `leave`, seconds of the day; `tag` says what for.

    `mode` is how one means to get there: walk, bus, tram or bike.
    """

    leave: float
    due: float
    type: str
    tag: str
    activity: str
    place: str
    mode: str = "walk"


def stays_of(schedule: Iterable[Item], known: Mapping[str, object]) -> list[Stay]:
    """Return the stays of a day, each with the time to set out; items without a place on the map are left out."""
    stays: list[Stay] = []
    leave: float | None = None
    mode = "walk"
    for item in schedule:
        if str(item.type) == "commute":
            leave = seconds_of_day(item.start) if leave is None else leave
            mode = str(item.mode or "walk")
            continue
        if item.place is None or item.place not in known:
            continue
        due = seconds_of_day(item.start)
        when = due if leave is None else leave
        stays.append(Stay(when, due, str(item.type), str(item.tag or ""), item.activity, item.place, mode))
        leave, mode = None, "walk"
    return stays


def with_ways(stays: Sequence[Stay], public_map: PublicMap, pace: float = WALK) -> list[Stay]:
    """Give those stays time for the way whose schedule has none: two doors of one building may lie streets apart.

    Parameters
    ----------
    pace
        How fast they walk, m/s.
    """
    found = list(stays[:1])
    for before, stay in pairwise(stays):
        if stay.leave == stay.due and before.place != stay.place:
            places = public_map.place_by_id
            way = public_map.router.seconds(places[before.place].position, places[stay.place].position, pace)
            if math.isfinite(way):
                stay = replace(stay, leave=max(before.due, stay.due - way * (1.0 + SLACK_SHARE) - SLACK))
        found.append(stay)
    return found
