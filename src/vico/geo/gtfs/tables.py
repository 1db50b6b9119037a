"""Tables of a zipped feed, read in streams of bounded length: a hostile zip is refused in bounded time and space."""

from __future__ import annotations

import csv
import io
import zipfile
from collections.abc import Iterator, Sequence
from pathlib import Path

from vico.errors import SchemaError

_MOST_BYTES = 4 << 30  # unpacked, of one table
_MOST_RATIO = 400  # unpacked to packed; timetables pack 10 to 40 to 1
_MOST_LINE = 1 << 16


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


class FeedTables:
    """The tables of an open feed.

    Attributes
    ----------
    members
        What there is, by file name.
    """

    def __init__(self, path: Path, archive: zipfile.ZipFile) -> None:
        self.path, self._archive = path, archive
        self.members: dict[str, zipfile.ZipInfo] = {}
        for info in archive.infolist():
            parts = info.filename.replace("\\", "/").split("/")
            # Some feeds lie in a folder of their zip.
            if len(parts) <= 2 and parts[-1].endswith(".txt"):
                self.members.setdefault(parts[-1], info)

    def need(self, *names: str) -> None:
        """Refuse a feed that lacks a table.

        Raises
        ------
        SchemaError
            If it does.
        """
        for name in names:
            if name not in self.members:
                raise SchemaError(f"{self.path}: has no {name}, which every GTFS feed has; download it again")

    def _lines(self, text: io.TextIOWrapper, name: str) -> Iterator[str]:
        while line := text.readline(_MOST_LINE):
            if len(line) >= _MOST_LINE:
                raise SchemaError(f"{self.path}: {name} has a line of more than {_MOST_LINE:,} characters")
            yield line.replace("\0", "")

    def rows(self, name: str, needed: Sequence[str], wanted: Sequence[str] = ()) -> Iterator[list[str]]:
        """Yield the named columns of a table, row by row; empty texts for optional columns that it lacks.

        Raises
        ------
        SchemaError
            If it lacks a needed column, is no CSV in UTF-8, or unpacks to an absurd size.
        """
        if name not in self.members:
            return
        info = self.members[name]
        most = min(_MOST_BYTES, max(info.compress_size, 1 << 14) * _MOST_RATIO)
        if info.file_size > most:
            raise SchemaError(f"{self.path}: {name} unpacks to an absurd size; this is no timetable")
        with self._archive.open(info) as stream:
            raw = io.BufferedReader(_Bounded(stream, most, f"{self.path}: {name}"), 1 << 16)  # type: ignore[arg-type]
            text = io.TextIOWrapper(raw, encoding="utf-8-sig", newline="")
            table = csv.reader(self._lines(text, name))
            try:
                header = [column.strip() for column in next(table, [])]
                missing = [column for column in needed if column not in header]
                if missing:
                    raise SchemaError(f"{self.path}: {name} has no column {missing[0]}; the feed can't be used")
                at = [header.index(column) if column in header else -1 for column in (*needed, *wanted)]
                last = max(at)
                for row in table:
                    if len(row) > last:
                        yield [row[k] if k >= 0 else "" for k in at]
                    elif row:
                        row = row + [""] * (last + 1 - len(row))
                        yield [row[k] if k >= 0 else "" for k in at]
            except UnicodeDecodeError as error:
                raise SchemaError(f"{self.path}: {name} is not UTF-8 ({error.reason}); save it as UTF-8") from None
            except csv.Error as error:
                raise SchemaError(f"{self.path}: {name}, line {table.line_num}: {error}; mend the table") from None
