"""Estimates of planners: durations of paths, searches and hand-overs, chances of finds, and habits of people.

Times are guesses of ours from the public map and from what such things take on average; with `distance` off every way
takes the same (the ablation of the paper's appendix on distance modelling). Habits say how often people are at the
places of their day, by kind of place and hour. Their shares are measured on communities of cities that no task of a
table takes place in (``scripts/measure_habits.py``).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from vico.agents.assistant.skills import WALK
from vico.errors import SchemaError
from vico.io.data_files import DataRecord, cached_data, data_files, read_record
from vico.world.public import PublicMap

#: Seconds that a way takes where distances are not reckoned with.
UNIFORM = 60.0
# People, lights and corners: a way takes so many times what its length and the pace say.
_DETOUR = 1.25
#: Seconds to go in or out.
DOOR = 12.0
#: Seconds to pick something up.
PICK = 6.0
#: Seconds to put something down and report.
PUT = 6.0
#: Seconds to meet somebody and be handed things.
MEET = 25.0
# Looking through a place, and a spot outdoors: for a thing, and for a person, seconds.
_LOOK = {("place", False): 45.0, ("outdoor", False): 22.0, ("place", True): 25.0, ("outdoor", True): 6.0}
# How likely somebody is at a spot outdoors, where a place counts 1: most of a day is spent indoors.
_OUTDOORS = 0.35
# Hours of meals, and how many times as likely somebody is at a place for them then, and less so else.
_MEALS, _AT_MEALS = ((7.0, 9.0), (11.5, 13.75), (18.0, 20.0)), 2.0
# Chance that a look finds what is there.
FIND_CHANCE = 0.85


class Estimates:
    """Times and chances of one task.

    Parameters
    ----------
    distance
        Whether distances are reckoned with.
    """

    def __init__(
        self, public_map: PublicMap, instructions: Sequence[Mapping[str, Any]], *, distance: bool = True
    ) -> None:
        self.distance = distance
        #: Second of the day, as far as it is known.
        self.time = 12 * 3600.0
        self._map = public_map
        self._fields: dict[tuple[float, float], NDArray[np.float32]] = {}

    def travel(self, start: Sequence[float], goal: Sequence[float], *, pace: float = WALK) -> float:
        """Seconds from a point to another, which is one of the task's: its distance field is kept."""
        if not self.distance:
            return UNIFORM
        metres = self.metres(start, goal)
        return _DETOUR * metres / pace

    def look(self, region: Mapping[str, Any], *, person: bool) -> float:
        """Seconds that looking through a region takes, with going in and out."""
        doors = 2 * DOOR if region["kind"] == "place" else 0.0
        return _LOOK[str(region["kind"]), person] + doors

    def weight(self, region: Mapping[str, Any], *, person: bool) -> float:
        """Return how likely a region is beside others: people are where one eats at the hours for it."""
        if not person:
            return 1.0
        if region["place"] is None:
            return _OUTDOORS
        hour = self.time / 3600.0 % 24.0
        eats = any(since <= hour < until for since, until in _MEALS)
        food = self._map.place_by_id[str(region["place"])].category == "food"
        return _AT_MEALS if food and eats else 1.0 / _AT_MEALS if food else 1.0

    def metres(self, start: Sequence[float], goal: Sequence[float]) -> float:
        """Metres on foot between the same; where no way is known, a guess from the straight line."""
        key = (round(float(goal[0]), 2), round(float(goal[1]), 2))
        if key not in self._fields:
            self._fields[key] = self._map.router.distance_field(np.array(key))
        field = self._fields[key]
        ix, iy = np.clip(self._map.walkable.cell_of(np.asarray(start, np.float64)[:2]), 0, self._map.walkable.n - 1)
        value = float(field[iy, ix])
        if math.isfinite(value):
            metres = value
        else:
            around = field[max(iy - 8, 0) : iy + 9, max(ix - 8, 0) : ix + 9]
            finite = around[np.isfinite(around)]
            metres = float(finite.min()) if len(finite) else math.inf
        straight = math.dist((float(start[0]), float(start[1])), key)
        return metres if math.isfinite(metres) else 1.4 * straight


GUIDE = "docs/challenges.md"
#: How the file calls spots outdoors, and the category that stands for those that it does not name.
OUTDOORS, OTHER = "outdoors", "entertainment"
_HOURS = 24

Share = Annotated[float, Field(ge=0.0, le=1.0)]


class Habits(DataRecord):
    """Shares of people who are at a place of their day, by the place's category and the hour.

    Attributes
    ----------
    places
        24 shares for each category of places with rooms, and for ``outdoors``.
    """

    about: Annotated[str, Field(min_length=1)]
    places: dict[str, Annotated[list[Share], Field(min_length=_HOURS, max_length=_HOURS)]]

    def share(self, category: str, hour: float) -> float:
        """Return how likely somebody is at a place of their day, at an hour of the day."""
        return self.places[category if category in self.places else OTHER][int(hour) % _HOURS]


@cached_data
def read_habits() -> Habits:
    """Return what is known of habits.

    Raises
    ------
    SchemaError
        If the file is not as it should be.
    """
    path = data_files("agents/assistant", "habits")[-1]
    habits = read_record(path, Habits, guide=GUIDE)
    missing = {OTHER, OUTDOORS} - set(habits.places)
    if missing:
        raise SchemaError(f"{path}: places: {', '.join(sorted(missing))} must be there")
    return habits
