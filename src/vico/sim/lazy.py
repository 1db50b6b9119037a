"""Observations that are made when somebody asks for them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, TypeVar

from vico.crowd import Crowd

T = TypeVar("T")


class LazyByName(Mapping[str, T]):
    """Values by name, each made when it is first asked for, and then kept.

    Parameters
    ----------
    names
        In their order.
    make
        Makes the value of the name with a number.
    """

    def __init__(self, names: Sequence[str], make: Callable[[str], T]) -> None:
        self._made: dict[str, T | None] = dict.fromkeys(names)
        self._make = make

    def __getitem__(self, name: str) -> T:
        value = self._made[name]
        if value is None:
            value = self._made[name] = self._make(name)
        return value

    def __iter__(self) -> Iterator[str]:
        return iter(self._made)

    def __len__(self) -> int:
        return len(self._made)

    def __contains__(self, name: object) -> bool:
        return name in self._made

    def __repr__(self) -> str:
        return f"{type(self).__name__}({list(self._made)})"


class ByAgent(LazyByName[dict[str, Any]]):
    """Observations or infos by agent's name; those that nobody asks for are never made.

    Parameters
    ----------
    make_plain
        Makes what needs no pictures.
    make_seen
        Makes the rest, once they are there.

    Attributes
    ----------
    without_pictures
        The same for those who do not look at pictures, and need not wait for them.
    """

    def __init__(
        self,
        names: Sequence[str],
        make_plain: Callable[[str], dict[str, Any]],
        make_seen: Callable[[str], dict[str, Any]],
    ) -> None:
        self.without_pictures = LazyByName(names, make_plain)
        super().__init__(names, lambda name: make_plain(name) | make_seen(name))


class Observations(ByAgent):
    """Observations by agent's name.

    Attributes
    ----------
    crowd
        The same as arrays, without pictures.
    """

    def __init__(
        self,
        names: Sequence[str],
        make_plain: Callable[[str], dict[str, Any]],
        make_seen: Callable[[str], dict[str, Any]],
        crowd: Crowd,
    ) -> None:
        super().__init__(names, make_plain, make_seen)
        self.crowd = crowd
