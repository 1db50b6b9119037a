"""Large JSON files read member by member, so that only one member is in memory at a time."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TextIO

from vico.errors import MissingFileError, SchemaError

_BLOCK = 1 << 18  # characters read at a time
_MOST_VALUE = 256 << 20  # characters of one member
_SPACE = " \t\r\n"
_DECODER = json.JSONDecoder()


class JsonStream:
    """The members of the object that a JSON file holds, one after another.

    Parameters
    ----------
    path
        The file; UTF-8, with or without a byte order mark.

    Raises
    ------
    MissingFileError
        If there is no such file.
    """

    def __init__(self, path: Path) -> None:
        if not path.is_file():
            raise MissingFileError(f"{path}: no such file")
        self._path = path
        self._file: TextIO
        self._text = ""
        self._at = 0
        self._done = False

    def members(self, *, within: frozenset[str] = frozenset()) -> Iterator[tuple[str, str, Any]]:
        """Every member of the object: its key, an empty string, and its value.

        Parameters
        ----------
        within
            Keys whose value is taken apart in turn: of an object each member is given with its own key in second
            place, of an array each element with an empty one.

        Raises
        ------
        SchemaError
            If the file is no JSON object, or is truncated.
        """
        try:
            with self._path.open(encoding="utf-8-sig") as self._file:
                self._text, self._at, self._done = "", 0, False
                self._expect("{")
                for key in self._keys():
                    if key in within and self._peek() in ("{", "["):
                        yield from ((key, *member) for member in self._inner())
                    else:
                        yield key, "", self._value()
        except (ValueError, RecursionError) as error:
            if isinstance(error, SchemaError):
                raise
            what = "not UTF-8" if isinstance(error, UnicodeDecodeError) else str(error)[:120] or type(error).__name__
            raise SchemaError(f"{self._path}: not readable JSON ({what}); download it again") from None

    def _inner(self) -> Iterator[tuple[str, Any]]:
        if self._next() == "{":
            for key in self._keys():
                yield key, self._value()
            return
        if self._peek() == "]":
            self._next()
            return
        while True:
            yield "", self._value()
            mark = self._next()
            if mark == "]":
                return
            if mark != ",":
                raise ValueError(f"{mark!r} where a comma should be")

    def _keys(self) -> Iterator[str]:
        """Keys of the object whose brace was just read; the caller takes each value before the next key."""
        if self._peek() == "}":
            self._next()
            return
        while True:
            key = self._value()
            if not isinstance(key, str):
                raise ValueError("a key that is no text")
            self._expect(":")
            yield key
            mark = self._next()
            if mark == "}":
                return
            if mark != ",":
                raise ValueError(f"{mark!r} where a comma should be")

    def _more(self) -> bool:
        """Read on; false at the end of the file. What was used is forgotten."""
        block = "" if self._done else self._file.read(max(_BLOCK, len(self._text) - self._at))
        self._done = not block
        self._text, self._at = self._text[self._at :] + block, 0
        if len(self._text) > _MOST_VALUE:
            raise ValueError(f"one member of more than {_MOST_VALUE >> 20} million characters")
        return bool(block)

    def _peek(self) -> str:
        while True:
            while self._at < len(self._text) and self._text[self._at] in _SPACE:
                self._at += 1
            if self._at < len(self._text):
                return self._text[self._at]
            if not self._more():
                raise ValueError("it ends in the middle")

    def _next(self) -> str:
        mark = self._peek()
        self._at += 1
        return mark

    def _expect(self, mark: str) -> None:
        if (found := self._next()) != mark:
            raise ValueError(f"{found!r} where {mark!r} should be")

    def _value(self) -> Any:
        self._peek()
        while True:
            try:
                value, end = _DECODER.raw_decode(self._text, self._at)
            except json.JSONDecodeError:
                if not self._more():
                    raise ValueError("it is truncated or broken") from None
                continue
            if end < len(self._text) or self._done:
                self._at = end
                return value
            self._more()  # a number may go on in the next block
