"""Times of day as text and as seconds since midnight."""

from __future__ import annotations

import re

from vico.errors import InputError

#: Seconds of a day.
DAY = 86_400

_CLOCK = re.compile(r"(\d{1,2}):(\d{2})(?::(\d{2}))?")


def seconds_of_day(text: str) -> int:
    """Return the second of the day that ``HH:MM`` or ``HH:MM:SS`` names.

    Raises
    ------
    InputError
        If the text is no time of day.
    """
    match = _CLOCK.fullmatch(text)
    if match:
        hours, minutes, seconds = (int(part or 0) for part in match.groups())
        if hours < 24 and minutes < 60 and seconds < 60:
            return hours * 3600 + minutes * 60 + seconds
    raise InputError(f"{text!r} is no time of day; write HH:MM or HH:MM:SS, for example 08:00")


def clock_of(seconds: int) -> str:
    """Return ``HH:MM:SS`` of a second of the day; the day's end gives 23:59:59, the last second there is."""
    seconds = min(seconds, DAY - 1)
    return f"{seconds // 3600:02d}:{seconds // 60 % 60:02d}:{seconds % 60:02d}"
