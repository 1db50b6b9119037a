"""What became of a main agent's visits: talked, or why not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal

#: How a visit ends. All but ``talked`` say why no conversation came of it:
#: ``not reached``: there was no way, it took too long, or the place let nobody in;
#: ``not found``: the place was searched, or waited at, and they were not there;
#: ``on the way``: they said that they were on their way somewhere;
#: ``no answer``: they had walked off, or did not answer;
#: ``nothing to say``: the strategy had nothing to say to them;
#: ``day over``: the day of talk ended before.
Ending = Literal["talked", "not reached", "not found", "on the way", "no answer", "nothing to say", "day over"]
#: Those of a visit that was for nothing, in the order in which a visit goes.
FAILURES: tuple[Ending, ...] = ("not reached", "not found", "on the way", "no answer", "nothing to say", "day over")


@dataclass
class Visit:
    """Going to see somebody.

    Attributes
    ----------
    place
        Id of the place where they were to be met.
    began, ended
        Seconds of the day.
    ending
        What became of it; ``day over`` until something did.
    """

    target: str
    place: str
    began: float
    ended: float
    ending: Ending = "day over"

    def record(self) -> dict[str, Any]:
        """Return it as plain data."""
        return asdict(self)


def visit_of(record: Mapping[str, Any]) -> Visit:
    """Return a visit that `Visit.record` told."""
    return Visit(**record)
