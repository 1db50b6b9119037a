"""Further places than the map's: what a source of places gives, whoever it is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from vico.geo.frame import LocalFrame


@dataclass(frozen=True)
class FoundPlace:
    """Something with a name that a source says people go to.

    Attributes
    ----------
    id
        The source's id, with the source's name before it: ``overture:08f1...``, ``google:ChIJ...``.
    name
        As it is called there.
    kind
        The source's own word for it, ``cafe``; `kinds` are further, wider ones, the nearest first.
    xy
        East and north, metres.
    source, attribution
        Who says so, and what their licence asks to be shown.
    open
        False where the source says that it is closed, for good or for now.
    may_be_kept
        False where the source's terms forbid to store what it says (Google): then only `id`, and what is decided here
        from the rest, may go into a world's files.
    """

    id: str
    name: str
    kind: str
    xy: tuple[float, float]
    source: str
    attribution: str
    kinds: tuple[str, ...] = ()
    open: bool = True
    may_be_kept: bool = True


class PlaceSource(Protocol):
    """Something that knows places.

    Attributes
    ----------
    name
        What it is called in messages and reports.
    may_be_kept
        Whether its terms allow to store what it says.
    """

    name: str
    may_be_kept: bool

    def near(self, frame: LocalFrame, half: float) -> list[FoundPlace]:
        """Every place in the square of half side `half` metres around the frame's origin, sorted by id."""
        ...


def one_line(text: str, most: int = 120) -> str:
    """Return a name without line breaks, control characters and endless length."""
    return " ".join("".join(c if c.isprintable() else " " for c in text[: 4 * most]).split())[:most].strip()
