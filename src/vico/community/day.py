"""One person's day on a time line: things to do at places, with the walks between them always fitting."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from vico.community.ground import Ground
from vico.community.hours import Span
from vico.community.model import ItemType, ScheduleItem, clock_of

MIDNIGHT = 24 * 60


@dataclass
class Block:
    """Something to do at a place, from `start` to `end`, minutes of the day.

    Attributes
    ----------
    tag
        What it is to the planner: sleep, work, lunch, group, outing, home, ...
    """

    start: int
    end: int
    type: ItemType
    activity: str
    place: str
    tag: str


class Day:
    """A time line of blocks that don't overlap, each reachable in time from the one before.

    Parameters
    ----------
    ground
        Gives the walks.
    home
        Place id.
    """

    def __init__(self, ground: Ground, home: str) -> None:
        self.ground = ground
        self.home = home
        self.blocks: list[Block] = []

    def walk(self, a: str, b: str) -> int | None:
        """Minutes to allow for the walk between two places; None if there is no way."""
        return self.ground.minutes(a, b)

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
        """Starts within `window` at which `minutes` at `place` should fit in the day and in its opening hours.

        Walks are estimated here; `add` asks for the routes.
        """
        found: list[int] = []
        for before, after in zip([None, *self.blocks], [*self.blocks, None], strict=True):
            low, high = window
            if before is not None:
                if before.end >= high:
                    break
                low = max(low, before.end + self.ground.estimate(before.place, place))
            if after is not None:
                if min(high, after.start) - low < minutes:
                    continue
                high = min(high, after.start - self.ground.estimate(place, after.place))
            first = -(-low // step) * step
            found += [
                s for s in range(first, high - minutes + 1, step) if any(a <= s and s + minutes <= b for a, b in spans)
            ]
        return found

    def items(self) -> list[ScheduleItem]:
        """The schedule, walks put in. The blocks must leave no time but for the walks."""
        items: list[ScheduleItem] = []
        for before, block in zip([None, *self.blocks], self.blocks, strict=False):
            place = self.ground.place_by_id[block.place]
            if before is not None and before.end < block.start:
                items.append(
                    ScheduleItem(
                        type=ItemType.COMMUTE,
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
                    start=clock_of(block.start * 60),
                    end=clock_of(block.end * 60),
                    activity=block.activity,
                    place=block.place,
                    building=place.building,
                )
            )
        return items
