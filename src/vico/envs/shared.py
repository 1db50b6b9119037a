"""Arrays of observations in memory that processes share: pictures need not go through a pipe.

Every Box of an observation, at whatever depth of its Dicts, has a row for each environment in one block of memory. A
worker writes its own row and sends the rest; the parent puts both together. Who copies is said where it is done.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from multiprocessing.shared_memory import SharedMemory
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector.utils import concatenate, create_empty_array
from numpy.typing import NDArray

#: Where an array of an observation is: keys of Dicts, one in the other.
Where = tuple[str, ...]
_ALIGNED = 64  # bytes at which arrays begin


def boxes_of(space: spaces.Space[Any], where: Where = ()) -> Iterator[tuple[Where, spaces.Box[Any]]]:
    """Yield the Boxes of a space and where they are."""
    if isinstance(space, spaces.Box):
        yield where, space
    elif isinstance(space, spaces.Dict):
        for name, one in space.spaces.items():
            yield from boxes_of(one, (*where, name))


@dataclass(frozen=True)
class Layout:
    """Where the arrays of several environments lie in a block of memory.

    Attributes
    ----------
    arrays
        By where they are in an observation: offset, bytes; shape of one; name of its type.
    count
        Environments.
    size
        Bytes of all.
    """

    arrays: Mapping[Where, tuple[int, tuple[int, ...], str]]
    count: int
    size: int

    @classmethod
    def of(cls, space: spaces.Space[Any], count: int) -> Layout:
        """Return a layout for so many environments."""
        arrays, offset = {}, 0
        for where, box in boxes_of(space):
            arrays[where] = offset, tuple(box.shape), np.dtype(box.dtype).str
            offset += -(-count * int(np.prod(box.shape, dtype=int)) * box.dtype.itemsize // _ALIGNED) * _ALIGNED
        return cls(arrays, count, max(offset, 1))

    def rows(self, memory: SharedMemory) -> dict[Where, NDArray[Any]]:
        """Return the arrays in a block, with a row for each environment."""
        return {
            where: np.ndarray((self.count, *shape), kind, memory.buf, offset)
            for where, (offset, shape, kind) in self.arrays.items()
        }


class SharedArrays:
    """The parent's side: makes the block, and takes it away when it is closed."""

    def __init__(self, space: spaces.Space[Any], count: int) -> None:
        self.space, self.layout = space, Layout.of(space, count)
        self._memory: SharedMemory | None = SharedMemory(create=True, size=self.layout.size)
        self._rows = self.layout.rows(self._memory)

    @property
    def name(self) -> str:
        """By which workers find the block."""
        assert self._memory is not None
        return self._memory.name

    def batched(self, rest: Sequence[Any]) -> Any:
        """Return the observations of all environments as one element of the batched space; arrays are copies.

        Parameters
        ----------
        rest
            What the workers sent: observations without their arrays.
        """
        return self._batched(self.space, (), rest)

    def single(self, k: int, rest: Any) -> Any:
        """Return one environment's observation; arrays are copies."""
        return _put_back(rest, (), {where: array[k : k + 1] for where, array in self._rows.items()})

    def close(self) -> None:
        """Take the block away."""
        self._rows = {}
        if self._memory is not None:
            self._memory.close()
            self._memory.unlink()
            self._memory = None

    def _batched(self, space: spaces.Space[Any], where: Where, rest: Sequence[Any]) -> Any:
        if where in self._rows:
            return self._rows[where].copy()
        if isinstance(space, spaces.Dict):
            return {
                name: self._batched(one, (*where, name), [None if part is None else part.get(name) for part in rest])
                for name, one in space.spaces.items()
            }
        empty: Any = create_empty_array(space, len(rest))
        return concatenate(space, rest, empty)


class Sharing:
    """The worker's side: an environment whose observations' arrays go to the block.

    Parameters
    ----------
    make
        Makes the environment: one of Gymnasium, or of PettingZoo.
    """

    def __init__(self, make: Callable[[], Any]) -> None:
        self.env = make()
        # In this order: the block cannot be closed while there are arrays in it.
        self._rows: dict[Where, NDArray[Any]] = {}
        self._memory: SharedMemory | None = None

    def attach(self, name: str, layout: Layout, k: int) -> None:
        """Write to row `k` of a block from now on."""
        self._memory = SharedMemory(name=name)
        # A slice, not an item: an item of numbers without axes would be no part of the block.
        self._rows = {where: rows[k : k + 1] for where, rows in layout.rows(self._memory).items()}

    def reset(self, *arguments: Any, **options: Any) -> tuple[Any, Any]:
        """Reset the environment; return what is not in the block."""
        observation, info = self.env.reset(*arguments, **options)
        return self._taken(observation), info

    def step(self, action: Any) -> tuple[Any, ...]:
        """Step the environment; return what is not in the block."""
        observation, *rest = self.env.step(action)
        return (self._taken(observation), *rest)

    def call(self, name: str, *arguments: Any) -> Any:
        """Return what a method of the environment returns, or an attribute."""
        found = getattr(self.env, name)
        return found(*arguments) if callable(found) else found

    def _taken(self, observation: Any) -> Any:
        return _take_out(observation, (), self._rows)


def _take_out(observation: Any, where: Where, rows: Mapping[Where, NDArray[Any]]) -> Any:
    """Write arrays to their rows, and return the observation without them."""
    if where in rows:
        rows[where][0] = observation
        return None
    if isinstance(observation, Mapping):
        return {name: _take_out(part, (*where, name), rows) for name, part in observation.items()}
    return observation


def _put_back(rest: Any, where: Where, rows: Mapping[Where, NDArray[Any]]) -> Any:
    if where in rows:
        return np.array(rows[where][0])
    if isinstance(rest, Mapping):
        return {name: _put_back(part, (*where, name), rows) for name, part in rest.items()}
    return rest
