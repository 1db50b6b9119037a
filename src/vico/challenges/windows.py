"""Lists of windows that tables are made of: which part of which map is a world, as data with a strict loader.

A list is a file ``worlds_NAME.toml`` in ``vico/data/challenges``, or in the folder ``challenges`` of ``$VICO_DATA``.
"""

from __future__ import annotations

import math
from pathlib import Path

from pydantic import Field, model_validator

from vico.errors import InputError, SchemaError
from vico.io.data_files import DataRecord, cached_data, data_files, read_record

#: Instead of a file: the extract that comes with the package.
PACKAGED_MAP = "packaged"
_PREFIX = "worlds_"
_GUIDE = "docs/evaluation.md"
_METRES_A_DEGREE = 111_320.0


class Window(DataRecord):
    """A square of a city that is built into a world.

    Attributes
    ----------
    name
        Of the world's folder.
    osm
        Map extract, relative to the folder with all extracts; ``packaged`` for the one that comes with the package.
    lat, lon
        The centre, degrees.
    radius
        Half the side, metres.
    dem
        Elevation models, relative to the same folder; flat ground without.
    seed
        Of the build.
    """

    name: str = Field(pattern=r"^[a-z0-9][a-z0-9_]{0,60}$")
    osm: str = Field(min_length=1)
    lat: float = Field(ge=-85.0, le=85.0)
    lon: float = Field(ge=-180.0, le=180.0)
    radius: float = Field(ge=50.0, le=5000.0)
    dem: tuple[str, ...] = ()
    seed: int = Field(default=1, ge=0)


class WindowList(DataRecord):
    """The windows of a table.

    Attributes
    ----------
    about
        What they are for, in a sentence.
    """

    about: str
    windows: tuple[Window, ...] = Field(min_length=1)

    @model_validator(mode="after")
    def _names_differ(self) -> WindowList:
        names = [window.name for window in self.windows]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"{', '.join(twice)} twice; every world needs a folder of its own")
        return self


@cached_data
def window_lists() -> dict[str, WindowList]:
    """Return every list by name.

    Raises
    ------
    SchemaError
        If a file is not as it should be, or two lists have different windows of one name.
    """
    lists: dict[str, WindowList] = {}
    known: dict[str, tuple[Window, Path]] = {}
    for path in data_files("challenges", _PREFIX):
        lists[path.stem.removeprefix(_PREFIX)] = found = read_record(path, WindowList, guide=_GUIDE)
        for window in found.windows:
            other, where = known.setdefault(window.name, (window, path))
            if other != window:
                raise SchemaError(f"{path}: {window.name} is another window than in {where}; give it another name")
    return lists


def window_list(name: str) -> WindowList:
    """Return one list.

    Raises
    ------
    InputError
        If there is none of that name.
    """
    lists = window_lists()
    if name not in lists:
        raise InputError(f"no list of worlds called {name!r}; there are {', '.join(sorted(lists))}")
    return lists[name]


def overlap(first: Window, second: Window) -> float:
    """Return the share of the smaller window that lies in the other one; 0 to 1."""
    if first.osm != second.osm:
        return 0.0
    east = (first.lon - second.lon) * _METRES_A_DEGREE * math.cos(math.radians(first.lat))
    north = (first.lat - second.lat) * _METRES_A_DEGREE
    smaller = 2.0 * min(first.radius, second.radius)
    shared = [
        max(0.0, min(first.radius + second.radius - abs(apart), smaller)) for apart in (east, north)
    ]  # fmt: skip
    return shared[0] * shared[1] / smaller**2


def overlaps(windows: WindowList) -> list[tuple[str, str, float]]:
    """Return the pairs of windows that overlap by more than a thousandth, with the share of the smaller one."""
    found = []
    for i, first in enumerate(windows.windows):
        for second in windows.windows[i + 1 :]:
            share = overlap(first, second)
            if share > 1e-3:
                found.append((first.name, second.name, share))
    return found
