"""How warm a place usually is: a rough reckoning from latitude, day of the year and hour.

The mean of the year falls from 27 degrees in the tropics by 0.52 for every degree of latitude beyond 20, and to either
side of it the year swings by 0.2 for every degree of latitude beyond 5: Helsinki (60.2 N) has -5 in January and 17 in
July, Singapore 27 all year. Seas and mountains are left out.
"""

from __future__ import annotations

import math

_WARMEST_DAY = 201  # of the year, north of the equator; a month after the solstice
_WARMEST_HOUR = 15.0
_DAY_SWING = 4.0  # degrees to either side of the day's mean


def usual_temperature(lat: float, day: int, seconds_of_day: float) -> float:
    """Return the usual temperature of the air, degrees Celsius.

    Parameters
    ----------
    lat
        Latitude, degrees.
    day
        Day of the year, 1..366.
    seconds_of_day
        Since midnight.
    """
    mean = 27.0 - 0.52 * max(abs(lat) - 20.0, 0.0)
    swing = 0.2 * max(abs(lat) - 5.0, 0.0)
    season = math.cos(2 * math.pi * (day - _WARMEST_DAY) / 365.25) * (1 if lat >= 0 else -1)
    hour = math.cos(2 * math.pi * (seconds_of_day / 3600.0 - _WARMEST_HOUR) / 24.0)
    return mean + swing * season + _DAY_SWING * hour
