"""What weather and dark do to those who are outdoors: how far they see, how well they brake, how fast they go.

Each is one function of the conditions, so that whoever moves or looks asks for the same figure.

References
----------
Wallman and Astrom: Friction measurement methods and the correlation between road friction and traffic safety, VTI
meddelande 911A (2001): friction 0.8-1.0 on dry, 0.7-0.8 on wet roads, 0.2-0.3 on packed snow.
US Federal Highway Administration, Road Weather Management Program: average speeds fall by 3-13 % in light rain or snow,
3-16 % in heavy rain, 5-40 % in heavy snow, 10-12 % in low visibility.
"""

from __future__ import annotations

import math
from typing import NamedTuple

#: How far anybody is noticed by daylight in clear air, metres.
CLEAR_SIGHT = 40.0

_DRY, _WET, _SNOW = 0.9, 0.75, 0.25
_GRAVITY = 9.81
# Bodies are told from what is behind them as far as this share of meteorological visibility.
_NOTICED = 0.4
# In the dark, people are noticed this far off where no lamps are lit, metres.
_UNLIT_SIGHT = 15.0
_LAMPLIT = 0.75  # of the sight by day, where lamps are lit
_REACTION = 1.0  # s


class Conditions(NamedTuple):
    """What it is like outdoors, for whoever moves or looks there.

    Attributes
    ----------
    sight
        How far bodies are noticed, metres.
    friction
        Between tyres or soles and the ground.
    braking
        Factor on comfortable braking, 0..1.
    hard_braking
        The most a vehicle can brake, m/s^2.
    driving
        Factor on the speed people drive at, 0..1.
    safe_speed
        Speed from which a driver stops within what he sees, m/s.
    walking
        Factor on the speed people walk at, 0..1.
    """

    sight: float
    friction: float
    braking: float
    hard_braking: float
    driving: float
    safe_speed: float
    walking: float


def conditions(
    *, rain: float, snowfall: float, visibility: float, wet: float, cover: float, dark: float, lamps: float
) -> Conditions:
    """Return the conditions outdoors.

    Parameters
    ----------
    rain, snowfall
        Water that falls, mm/h.
    visibility
        Meteorological visibility, metres.
    wet, cover
        How wet the ground is and how far under snow, 0..1.
    dark
        0 by day, 1 at night.
    lamps
        Share of the street lamps that are lit when it is dark, 0..1.
    """
    friction = (_DRY + (_WET - _DRY) * wet) * (1 - cover) + _SNOW * cover
    by_night = _UNLIT_SIGHT / CLEAR_SIGHT + (_LAMPLIT - _UNLIT_SIGHT / CLEAR_SIGHT) * lamps
    sight = min(CLEAR_SIGHT, _NOTICED * visibility) * (1 + (by_night - 1) * dark)
    hard = min(8.0, friction * _GRAVITY)
    # Drivers see vehicles and their lamps as far as the air lets them; they keep what they need to stop.
    seen = visibility * (1.0 if dark < 0.5 else 0.8)
    safe = hard * (math.sqrt(_REACTION**2 + 2 * seen / hard) - _REACTION)
    slower = 0.12 * min(rain / 8.0, 1.0) + 0.12 * min(snowfall / 2.0, 1.0) + 0.20 * cover
    slower += 0.11 * min(max((400.0 - visibility) / 200.0, 0.0), 1.0)
    return Conditions(
        sight=sight,
        friction=friction,
        braking=min(friction / _DRY * 1.5, 1.0),
        hard_braking=hard,
        driving=1.0 - min(slower, 0.4),
        safe_speed=safe,
        walking=1.0 - 0.12 * cover,
    )
