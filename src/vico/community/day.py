"""One person's day on a time line: things to do at places, with the walks between them always fitting."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from vico.clock import clock_of
from vico.community.hours import staffed
from vico.community.model import ActivityTag, ItemType, ScheduleItem
from vico.community.place_index import PlaceIndex
from vico.rules import WALK_SPEED
from vico.world.opening_hours import Span

MIDNIGHT = 24 * 60


def in_fives(minutes: float) -> int:
    """Return the nearest multiple of five minutes."""
    return round(float(minutes) / 5) * 5


@dataclass
class Block:
    """Something to do at a place, from `start` to `end`, minutes of the day.

    Attributes
    ----------
    role
        What it is to the planner: sleep, work, lunch, group, outing, home, ...
    tag
        What it is about, where the role does not say.
    """

    start: int
    end: int
    type: ItemType
    activity: str
    place: str
    role: str
    tag: ActivityTag | None = None


class Day:
    """A time line of blocks that don't overlap, each reachable in time from the one before.

    Parameters
    ----------
    index
        Gives the walks.
    home, workplace
        Place ids; `workplace` is None for those who have none.
    pace
        How fast they walk, m/s.

    Attributes
    ----------
    out_until
        Until when they go out alone, minutes.
    barred
        Kinds of places that are not for them.
    done
        Activities that they go out for: once a day is enough.
    """

    def __init__(self, index: PlaceIndex, home: str, workplace: str | None = None, *, pace: float = WALK_SPEED) -> None:
        self.index = index
        self.pace = pace
        self.out_until = MIDNIGHT
        self.barred: frozenset[str] = frozenset()
        self.home = home
        self.workplace = workplace
        self.blocks: list[Block] = []
        self.done: set[str] = set()

    def walk(self, a: str, b: str) -> int | None:
        """Return the minutes to allow for the walk between two places; None if there is no way."""
        return self.index.minutes(a, b, self.pace)

    def open_spans(self, place: str) -> list[Span]:
        """Return from when until when one may be at a place, minutes: at home always, at work as staff may."""
        if place == self.home:
            return [(0, MIDNIGHT)]
        hours = self.index.hours(self.index.place_by_id[place])
        return staffed(hours) if place == self.workplace else hours

    def fits(self, start: int, end: int, place: str) -> bool:
        """Whether something from `start` to `end` at `place` fits between what is there."""
        before = after = None
        for block in self.blocks:
            if block.end <= start:
                before = block
            elif block.start >= end:
                after = block
                break
            else:
                return False
        if before is not None:
            there = self.walk(before.place, place)
            if there is None or before.end + there > start:
                return False
        if after is not None:
            back = self.walk(place, after.place)
            if back is None or end + back > after.start:
                return False
        return 0 <= start < end <= MIDNIGHT

    def add(self, block: Block) -> bool:
        """Put a block in, if it fits."""
        if not self.fits(block.start, block.end, block.place):
            return False
        self.blocks.append(block)
        self.blocks.sort(key=lambda b: b.start)
        return True

    def starts(self, place: str, minutes: int, window: Span, spans: Sequence[Span], *, step: int = 5) -> list[int]:
        """Return the starts within `window` at which `minutes` at `place` fit in the day and its opening hours.

        Walks are estimated here; `add` asks for the routes.
        """
        found: list[int] = []
        for before, after in zip([None, *self.blocks], [*self.blocks, None], strict=True):
            low, high = window
            if before is not None:
                if before.end >= high:
                    break
                low = max(low, before.end + self.index.estimate(before.place, place, self.pace))
            if after is not None:
                if min(high, after.start) - low < minutes:
                    continue
                high = min(high, after.start - self.index.estimate(place, after.place, self.pace))
            first = -(-low // step) * step
            found += [
                s for s in range(first, high - minutes + 1, step) if any(a <= s and s + minutes <= b for a, b in spans)
            ]
        return found

    def items(self) -> list[ScheduleItem]:
        """Return the schedule, walks put in. The blocks must leave no time but for the walks."""
        items: list[ScheduleItem] = []
        for before, block in zip([None, *self.blocks], self.blocks, strict=False):
            place = self.index.place_by_id[block.place]
            if before is not None and before.end < block.start:
                items.append(
                    ScheduleItem(
                        type=ItemType.COMMUTE,
                        tag=ActivityTag.COMMUTE,
                        start=clock_of(before.end * 60),
                        end=clock_of(block.start * 60),
                        activity="Walk home" if block.place == self.home else f"Walk to {place.name}",
                        place=None,
                        building=None,
                    )
                )
            items.append(
                ScheduleItem(
                    type=block.type,
                    tag=block.tag or self._tag(block),
                    start=clock_of(block.start * 60),
                    end=clock_of(block.end * 60),
                    activity=block.activity,
                    place=block.place,
                    building=place.building,
                )
            )
        return items

    def _tag(self, block: Block) -> ActivityTag:
        """Return what a block is about by its role in the plan."""
        if block.type is ItemType.MEAL:
            return ActivityTag.MEAL_HOME if block.place == self.home else ActivityTag.MEAL_OUT
        tags = {"sleep": ActivityTag.SLEEP, "work": ActivityTag.WORK, "group": ActivityTag.GROUP}
        return tags.get(block.role, ActivityTag.LEISURE)
