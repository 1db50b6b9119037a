"""Tables of delimited text as spreadsheets, databases and people save them.

The separator (comma, semicolon, tab or bar), the encoding (UTF-8, UTF-16, UTF-32, Windows-1252) and how a column's name
is written are found out, not asked for. Rows come as a stream, so that a table may be larger than memory.
"""

from __future__ import annotations

import codecs
import csv
import io
import re
import unicodedata
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from vico.errors import SchemaError

_SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "bars"}
# Longer marks first: that of UTF-32 begins with that of UTF-16.
_MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig", "UTF-8"),
    (codecs.BOM_UTF32_LE, "utf-32", "UTF-32"),
    (codecs.BOM_UTF32_BE, "utf-32", "UTF-32"),
    (codecs.BOM_UTF16_LE, "utf-16", "UTF-16"),
    (codecs.BOM_UTF16_BE, "utf-16", "UTF-16"),
)
_MOST_LINE = 1 << 16  # characters
_MOST_BLANK = 1000  # lines before the header
_QUOTED = re.compile(r'"[^"]*"?')
_BRACKETS = re.compile(r"[(\[{（【][^()\[\]{}（）【】]*[)\]}）】]")
_NUMBER = re.compile(r"[+-]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][+-]?\d+)?")


class DelimitedText:
    """A table: a header, and rows below it.

    Parameters
    ----------
    stream
        Bytes of the table.
    what
        The table in messages, as in ``feed.zip: stops.txt``.
    columns
        Names of the columns that are looked for, with other spellings of each; all in lower case, as in
        ``{"lat": ("latitude", "y")}``.

    Attributes
    ----------
    header
        The columns: a known one by its name, another as it is written. Of several spellings of one column its own name
        counts, else the one that is listed first. What stands in brackets does not count where nothing else fits.
    written
        The columns as they are written.
    separator, encoding
        As found, in words.
    foreign
        Whether a line was no UTF-8, and was read as Windows-1252.

    Raises
    ------
    SchemaError
        If it is no text, or a line is longer than 65,536 characters.
    """

    def __init__(self, stream: BinaryIO, what: str, columns: Mapping[str, Sequence[str]]) -> None:
        self._what = what
        self.foreign = False
        codec, self.encoding, buffered = _encoding_of(stream)
        # Bytes that are no UTF-8 are kept, and their line is read anew.
        errors = "surrogateescape" if codec.startswith("utf-8") else "strict"
        self._text = io.TextIOWrapper(buffered, encoding=codec, errors=errors, newline=None)
        spelt = {_plain(spelling) for name, others in columns.items() for spelling in (name, *others)}
        self._skipped = 0
        first, delimiter = self._first_line(spelt)
        self.separator = _SEPARATORS[delimiter]
        self._rows = csv.reader(self._lines(first), delimiter=delimiter, skipinitialspace=delimiter != "\t")
        with self._csv_errors():
            cells = next(self._rows, [])
        self.written = [cell.strip() for cell in cells]
        self.header = _canonical_header(self.written, columns)

    @property
    def line(self) -> int:
        """Number of the line at which the row ends that was given last, from 1."""
        return self._skipped + self._rows.line_num

    def __iter__(self) -> Iterator[list[str]]:
        """Yield the cells of each row, without blanks around them, empty rows passed over.

        Raises
        ------
        SchemaError
            If a row can't be told from the next, or is not in the encoding that the table begins with.
        """
        with self._csv_errors():
            for row in self._rows:
                cells = [cell.strip() for cell in row]
                if any(cells):
                    yield cells

    @contextmanager
    def _csv_errors(self) -> Iterator[None]:
        try:
            yield
        except csv.Error as error:
            raise SchemaError(f"{self._what}, line {self.line}: {error}; mend the table") from None
        except UnicodeError:
            raise SchemaError(
                f"{self._what}, line {self.line + 1}: is no {self.encoding}, as the table begins; save it as UTF-8"
            ) from None

    def _first_line(self, spelt: Collection[str]) -> tuple[str, str]:
        """Return the header's line and its separator; spreadsheets may say that in a line of its own (``sep=;``)."""
        told = ""
        line = ""
        try:
            for line in self._lines(""):
                if found := re.fullmatch(r'"?sep=(.)"?\s*', line, re.IGNORECASE):
                    told = found[1] if found[1] in _SEPARATORS else ""
                elif line.strip(" \t\n;,|") or self._skipped >= _MOST_BLANK:
                    break
                self._skipped += 1
                line = ""
        except UnicodeError:
            raise SchemaError(f"{self._what}: is no {self.encoding} text; save it as UTF-8") from None
        bare = _QUOTED.sub("", line)

        def knows(separator: str) -> tuple[int, int]:
            cells = line.split(separator)
            return sum(_plain(c) in spelt or _plain(_BRACKETS.sub("", c)) in spelt for c in cells), bare.count(
                separator
            )

        return line, told or max(_SEPARATORS, key=knows)

    def _lines(self, first: str) -> Iterator[str]:
        if first:
            yield first
        while line := self._text.readline(_MOST_LINE):
            if len(line) >= _MOST_LINE:
                raise SchemaError(f"{self._what} has a line of more than {_MOST_LINE:,} characters; mend the table")
            if not line.isascii():
                line = self._redecode(line)
            yield line.replace("\0", "") if "\0" in line else line

    def _redecode(self, line: str) -> str:
        try:
            line.encode()
        except UnicodeEncodeError:
            raw = line.encode(errors="surrogateescape")
            self.foreign = True
            try:
                return raw.decode("cp1252")
            except UnicodeDecodeError:
                return raw.decode("latin-1")
        return line


def table_of(path: Path, columns: Mapping[str, Sequence[str]]) -> DelimitedText:
    """Open a table in memory, so that its file is closed.

    Parameters
    ----------
    path
        The file.
    columns
        As `DelimitedText` takes them.

    Raises
    ------
    SchemaError
        If it is no text.
    """
    return DelimitedText(io.BytesIO(path.read_bytes()), str(path), columns)


def decimal(text: str) -> float | None:
    """Return a number written with a decimal point or a decimal comma (``52.1``, ``52,1``); None if it is none."""
    stripped = text.strip().replace("\N{MINUS SIGN}", "-")
    return float(stripped.replace(",", ".")) if _NUMBER.fullmatch(stripped) else None


def _encoding_of(stream: BinaryIO) -> tuple[str, str, BinaryIO]:
    """Return a codec, the encoding in words, and the stream from its start."""
    head = stream.read(4096)
    whole = io.BufferedReader(_Rest(head, stream), 1 << 16)
    for mark, codec, name in _MARKS:
        if head.startswith(mark):
            return codec, name, whole
    # UTF-16 without a mark: of ASCII's letters every other byte is zero.
    evens, odds = head[0:256:2].count(0), head[1:256:2].count(0)
    if max(evens, odds) > len(head[:256]) // 4 and min(evens, odds) < max(evens, odds) // 4:
        return ("utf-16-be" if evens > odds else "utf-16-le"), "UTF-16", whole
    return "utf-8", "UTF-8", whole


class _Rest(io.RawIOBase):
    """A stream whose beginning was read."""

    def __init__(self, head: bytes, stream: BinaryIO) -> None:
        self._head, self._stream = head, stream

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override]
        data = self._head[: len(buffer)] or self._stream.read(len(buffer))
        self._head = self._head[len(buffer) :]
        buffer[: len(data)] = data
        return len(data)


def _canonical_header(header: list[str], columns: Mapping[str, Sequence[str]]) -> list[str]:
    """Return the header with columns that are known by another spelling under their own names."""
    as_written = [_plain(cell) for cell in header]
    without_remarks = [_plain(_BRACKETS.sub("", cell)) for cell in header]
    named = list(header)
    for name, others in columns.items():
        spellings = [_plain(spelling) for spelling in (name, *others)]
        both = ((plain, spelling) for plain in (as_written, without_remarks) for spelling in spellings)
        place = next((plain.index(spelling) for plain, spelling in both if spelling in plain), None)
        if place is not None:
            named[place] = name
    return named


def _plain(name: str) -> str:
    """Return a column's name in lower case, without accents, quotes and what separates its words."""
    letters = unicodedata.normalize("NFKD", name.casefold())
    return re.sub(r"[\W_]+", "", "".join(c for c in letters if not unicodedata.combining(c)))
