"""The rooms of a city, read one by one when they are asked for: there are hundreds of thousands."""

from __future__ import annotations

import mmap
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property, lru_cache
from pathlib import Path
from typing import overload

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError
from pydantic_core import from_json

from vico.errors import MissingFileError, SchemaError
from vico.io.arrays import drop_map
from vico.world.model import Room
from vico.world.moving import Shift
from vico.world.records import invalid

# Rooms that are kept: those that a community is in, and more.
_KEPT = 8192


class CityRooms(Sequence[Room]):
    """The rooms of all tiles, in the order of the tiles.

    Parameters
    ----------
    files
        Each tile's ``rooms.json``, one room a line, and how its things become the city's.

    Raises
    ------
    MissingFileError
        If one of the files is not there.
    """

    def __init__(self, files: Sequence[tuple[Path, Shift]]) -> None:
        self._files = list(files)
        self._maps = [_mapped(path) for path, _ in files]
        self._ends = [_line_ends(content) for content in self._maps]
        self._first = np.cumsum([0, *map(_rows, self._ends)])
        self._kept = lru_cache(maxsize=_KEPT)(self._read)

    def __len__(self) -> int:
        return int(self._first[-1])

    @overload
    def __getitem__(self, number: int) -> Room: ...

    @overload
    def __getitem__(self, number: slice) -> list[Room]: ...

    def __getitem__(self, number: int | slice) -> Room | list[Room]:
        if isinstance(number, slice):
            return [self[k] for k in range(*number.indices(len(self)))]
        k = int(number) + (len(self) if number < 0 else 0)
        if not 0 <= k < len(self):
            raise IndexError(f"room {number} of {len(self)}")
        return self._kept(k)

    def __iter__(self) -> Iterator[Room]:
        """Yield all rooms, without keeping them."""
        return map(self._read, range(len(self)))

    def numbers_in(self, files: Sequence[int]) -> NDArray[np.int64]:
        """Return the numbers of the rooms in some of the files, given by their places in the list."""
        ranges = [np.arange(*self._first[k : k + 2], dtype=np.int64) for k in files]
        return np.concatenate([np.zeros(0, np.int64), *ranges])

    def drop_pages(self) -> None:
        """Give back the memory that the files are read into; they are read again where somebody asks."""
        for content in self._maps:
            if isinstance(content, mmap.mmap):
                drop_map(content)

    @cached_property
    def numbers(self) -> dict[str, int]:
        """Number of each room by its id."""
        return {name: k for k, name in enumerate(self._ids())}

    def _ids(self) -> Iterator[str]:
        for number in range(len(self)):
            tile, line = self._line(number)
            try:
                # Not the whole room: what it holds takes ten times as long to read.
                yield from_json(line)["id"]
            except (ValueError, TypeError, KeyError) as error:
                raise SchemaError(f"{self._files[tile][0]}: room {number}: {error}; build the city anew") from None

    def _line(self, number: int) -> tuple[int, bytes]:
        """Return the tile that a room is in, and what its file says of it."""
        tile = int(np.searchsorted(self._first, number, side="right")) - 1
        row = number - int(self._first[tile])
        start, end = self._ends[tile][row : row + 2].tolist()
        return tile, self._maps[tile][start + 1 : end].rstrip(b",")

    def _read(self, number: int) -> Room:
        tile, line = self._line(number)
        path, shift = self._files[tile]
        try:
            return shift.room(Room.model_validate_json(line))
        except ValidationError as error:
            raise invalid(path, error) from None


def numbers_of(rooms: Sequence[Room]) -> Mapping[str, int]:
    """Return the number of each of some rooms by its id."""
    return rooms.numbers if isinstance(rooms, CityRooms) else {room.id: k for k, room in enumerate(rooms)}


class RoomsById(Mapping[str, Room]):
    """Rooms of a city by their ids.

    Parameters
    ----------
    rooms
        The rooms.
    """

    def __init__(self, rooms: CityRooms) -> None:
        self._rooms = rooms
        self._numbers = rooms.numbers

    def __getitem__(self, key: str) -> Room:
        return self._rooms[self._numbers[key]]

    def __contains__(self, key: object) -> bool:
        """Whether there is such a room; it is not read for that."""
        return key in self._numbers

    def __iter__(self) -> Iterator[str]:
        return iter(self._numbers)

    def __len__(self) -> int:
        return len(self._numbers)


def _mapped(path: Path) -> bytes | mmap.mmap:
    try:
        with path.open("rb") as file:
            return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    except FileNotFoundError:
        raise MissingFileError(f"{path}: no such file; build the city anew") from None


def _rows(ends: np.ndarray) -> int:
    """Return how many rooms a file has: a line each between its brackets, and an empty one where there is none."""
    return 0 if len(ends) < 3 or ends[1] - ends[0] == 1 else len(ends) - 2


def _line_ends(content: bytes | mmap.mmap) -> np.ndarray:
    """Return where lines end."""
    return np.flatnonzero(np.frombuffer(content, np.uint8) == ord("\n"))
