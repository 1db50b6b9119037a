"""How many people a place can employ: data of ``vico/data/community/staff.toml`` and of a user's own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from vico.community.place_index import PlaceIndex, kind_of
from vico.io.data_files import DataRecord, cached_data, data_files, read_record
from vico.world.model import Place

_GUIDE = "docs/adding_people.md"
# Who works alone cannot have a day off.
_LEAST = 2


class _Staff(DataRecord):
    square_metres: Annotated[float, Field(gt=0.0)]
    kinds: tuple[str, ...]


class _StaffFile(DataRecord):
    otherwise: Annotated[float, Field(gt=0.0)] | None = None
    unknown: Annotated[int, Field(ge=1)] | None = None
    open: Annotated[int, Field(ge=1)] | None = None
    staff: tuple[_Staff, ...] = ()


@dataclass(frozen=True)
class StaffRules:
    """Square metres for each member of staff by kind or category of place; how many in places without rooms."""

    by_kind: Mapping[str, float]
    otherwise: float
    unknown: int
    open: int


@cached_data
def staff_rules() -> StaffRules:
    """Return how many people places employ; a kind has the entry that named it last.

    Raises
    ------
    SchemaError
        If a file can't be used.
    """
    files = [read_record(path, _StaffFile, guide=_GUIDE) for path in data_files("community", "staff")]
    return StaffRules(
        by_kind={kind: entry.square_metres for file in files for entry in file.staff for kind in entry.kinds},
        otherwise=[file.otherwise for file in files if file.otherwise is not None][-1],
        unknown=[file.unknown for file in files if file.unknown is not None][-1],
        open=[file.open for file in files if file.open is not None][-1],
    )


def staff_capacity(index: PlaceIndex, place: Place) -> int:
    """Return how many people a place can employ, all shifts together."""
    rules = staff_rules()
    if not place.rooms:
        return rules.unknown if place.building is not None else rules.open
    metres = rules.by_kind.get(kind_of(place)) or rules.by_kind.get(place.category.value, rules.otherwise)
    return max(_LEAST, round(index.floor_area(place) / metres))
