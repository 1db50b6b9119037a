"""How often people are at the places of their day, by kind of place and hour: what everybody knows of others' habits.

Shares are measured on communities of cities that no task of a table takes place in (``scripts/measure_habits.py``).
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from vico.errors import SchemaError
from vico.io.data_files import DataRecord, cached_data, data_files, read_record

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
    path = data_files("assistant", "habits")[-1]
    habits = read_record(path, Habits, guide=GUIDE)
    missing = {OTHER, OUTDOORS} - set(habits.places)
    if missing:
        raise SchemaError(f"{path}: places: {', '.join(sorted(missing))} must be there")
    return habits
