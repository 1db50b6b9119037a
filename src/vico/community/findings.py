"""What the validator finds: where, what, and how to mend it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class CommunityFinding:
    """Something wrong.

    Attributes
    ----------
    where
        Path into the community: ``resident_3.schedule[5]``.
    what
        What is wrong, with the values.
    mend
        What to do about it.
    """

    where: str
    what: str
    mend: str
