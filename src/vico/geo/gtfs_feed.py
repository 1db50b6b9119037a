"""A GTFS feed: what it says about a window on one day of service, and the tables of the zipped file.

Tables are read in streams of bounded length: a hostile zip is refused in bounded time and space.
"""

from __future__ import annotations

import io
import zipfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path

from vico.errors import SchemaError
from vico.io.delimited import DelimitedText

DAY = 86_400
#: How a build's report begins where a feed gives nothing to drive.
NO_TIMETABLE = "gives no bus"


@dataclass(frozen=True)
class GtfsStop:
    """A stop in the window; `xy` metres, ENU."""

    id: str
    name: str
    xy: tuple[float, float]


@dataclass(frozen=True)
class GtfsRoute:
    """A route that stops in the window; `kind` is bus or tram, `colour` ``#rrggbb`` or empty."""

    id: str
    name: str
    title: str
    kind: str
    colour: str
    agency: str


@dataclass(frozen=True)
class Pattern:
    """Trips of a route that call at the same stops of the window in the same order.

    Attributes
    ----------
    route
        Id of the route.
    direction
        ``0`` or ``1`` as the feed says, else empty.
    stops
        Ids of the calls in the window: the longest run of a trip between two of its calls outside.
    departures
        Seconds of the service day at which a bus leaves the first of them, sorted; beyond 86,400 after midnight.
    travel
        Seconds from then to each of them, in the median of the trips; the first is 0.
    line
        The way driven in the window's surroundings, ENU metres, shape ``(n, 2)`` as tuples; empty where no shape says.
    """

    route: str
    direction: str
    stops: tuple[str, ...]
    departures: tuple[int, ...]
    travel: tuple[int, ...]
    line: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True)
class Feed:
    """Content of a GTFS feed for a window and one day of service.

    Attributes
    ----------
    name, sha256
        Of the file.
    day
        The day whose timetable it is, ISO 8601; empty where nothing runs in the window.
    stops, routes, patterns
        Those of buses and trams that stop in the window, sorted by id.
    attribution
        Who publishes it, as the feed says.
    broken
        Id and fault of rows that were left out (the first 200).
    nothing
        Why no bus or tram of it calls at two stops in the window; empty where one does.
    """

    name: str
    sha256: str
    day: str
    stops: tuple[GtfsStop, ...]
    routes: tuple[GtfsRoute, ...]
    patterns: tuple[Pattern, ...]
    attribution: str
    broken: tuple[tuple[str, str], ...] = ()
    nothing: str = ""


_MOST_BYTES = 4 << 30  # unpacked, of one table
_MOST_RATIO = 400  # unpacked to packed; timetables pack 10 to 40 to 1
_BLANKS = b"\xef\xbb\xbf \t\r\n"
_MOST_BLANK = 1 << 10  # bytes of a table that is looked at for having none but blanks
_DEEPEST = 3  # folders of the zip, and the table in them


class _Bounded(io.RawIOBase):
    """A member of a zip, unpacked no further than its bound."""

    def __init__(self, stream: io.BufferedIOBase, most: int, what: str) -> None:
        self._stream, self._left, self._what = stream, most, what

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override]
        data = self._stream.read(len(buffer))
        self._left -= len(data)
        if self._left < 0:
            raise SchemaError(f"{self._what} unpacks to an absurd size; this is no timetable")
        buffer[: len(data)] = data
        return len(data)


def _day_of(info: zipfile.ZipInfo) -> date:
    try:
        return date(*info.date_time[:3])
    except ValueError:
        return date.min  # some zips state no date


class FeedTables:
    """The tables of an open feed.

    Attributes
    ----------
    members
        What there is, by file name in lower case.
    packed
        When the newest table was written, as the zip says.
    empty
        Tables without even a header, in lower case: as if they were not there.
    told
        Table and how it is read, of those that are written otherwise than the format asks for.
    """

    def __init__(self, path: Path, archive: zipfile.ZipFile) -> None:
        self.path, self._archive = path, archive
        self.members: dict[str, zipfile.ZipInfo] = {}
        self.told: dict[str, str] = {}
        self.empty: list[str] = []
        named = [(info.filename.replace("\\", "/").split("/"), info) for info in archive.infolist()]
        # Some feeds lie in a folder of their zip; the tables nearest to its top count.
        for parts, info in sorted(named, key=lambda entry: len(entry[0])):
            name = parts[-1].lower()
            if len(parts) <= _DEEPEST and name.endswith(".txt") and not name.startswith("."):
                # Exporters write optional tables that they have no rows for with not even a header.
                if info.file_size <= _MOST_BLANK and not archive.read(info).strip(_BLANKS):
                    self.empty.append(name)
                else:
                    self.members.setdefault(name, info)
        self.packed = max(map(_day_of, self.members.values()), default=date.min)
        self._zips = [info.filename for _, info in named if info.filename.lower().endswith(".zip")]

    def need(self, *names: str) -> None:
        """Refuse a feed that lacks a table.

        Raises
        ------
        SchemaError
            If it does.
        """
        for name in names:
            if name not in self.members and name in self.empty:
                raise SchemaError(f"{self.path}: {name} is empty, and no feed can do without; download it again")
            if name not in self.members:
                if self._zips:
                    raise SchemaError(f"{self.path}: holds {self._zips[0]}; unpack it, and give that")
                raise SchemaError(f"{self.path}: has no {name}, which every GTFS feed has; download it again")

    def rows(self, name: str, needed: Sequence[str], wanted: Sequence[str] = ()) -> Iterator[list[str]]:
        """Yield the named columns of a table, row by row; empty texts for optional columns that it lacks.

        Raises
        ------
        SchemaError
            If it lacks a needed column, is no table, or unpacks to an absurd size.
        """
        if name not in self.members:
            return
        info = self.members[name]
        most = min(_MOST_BYTES, max(info.compress_size, 1 << 14) * _MOST_RATIO)
        if info.file_size > most:
            raise SchemaError(f"{self.path}: {name} unpacks to an absurd size; this is no timetable")
        what = f"{self.path}: {name}"
        with self._archive.open(info) as stream:
            raw = io.BufferedReader(_Bounded(stream, most, what), 1 << 16)  # type: ignore[arg-type]
            table = DelimitedText(raw, what, dict.fromkeys((*needed, *wanted), ()))
            header = table.header
            missing = [column for column in needed if column not in header]
            if missing:
                found = ", ".join(column[:40] for column in header[:12]) or "none"
                raise SchemaError(
                    f"{what} has no column {missing[0]} (separated by {table.separator}, its columns are {found}); the "
                    "feed can't be used"
                )
            at = [header.index(column) if column in header else -1 for column in (*needed, *wanted)]
            last = max(at)
            for row in table:
                if len(row) <= last:
                    row = row + [""] * (last + 1 - len(row))
                yield [row[k] if k >= 0 else "" for k in at]
            self._tell(name, table)

    def _tell(self, name: str, table: DelimitedText) -> None:
        """Note how a table is written that is not written as the format asks for."""
        encoding = "Windows-1252" if table.foreign else table.encoding
        said = [f"separated by {table.separator}"] if table.separator != "commas" else []
        said += [f"in {encoding}"] if encoding != "UTF-8" else []
        if said:
            self.told[name] = f"is {' and '.join(said)}, where the format asks for commas and UTF-8; read all the same"
