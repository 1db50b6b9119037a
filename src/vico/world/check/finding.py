"""What a check finds."""

from __future__ import annotations

from typing import NamedTuple


class WorldFinding(NamedTuple):
    """Something wrong.

    Attributes
    ----------
    id
        Which rule.
    where
        Id of the thing (a building, an object, a lane), or a file's name.
    what
        One sentence.
    at
        East and north of it, metres; None for files.
    """

    id: str
    where: str
    what: str
    at: tuple[float, float] | None = None
