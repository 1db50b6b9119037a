"""What weather and dark do to those who are outdoors: how far they see, how well they brake, how fast they go.

Each is one function of the conditions, so that whoever moves or looks asks for the same figure.

References
----------
Bosch Automotive Handbook, tyre grip at 50 km/h, new to worn tyres: dry 0.85-1.0, wet 0.65-0.5, heavy rain 0.55-0.4, ice
0.1 and less.
Wallman and Astrom: Friction measurement methods and the correlation between road friction and traffic safety, VTI
meddelande 911A (2001): friction 0.8-1.0 on dry roads, 0.2-0.3 on packed snow, 0.1-0.2 on ice.
US Federal Highway Administration, Road Weather Management Program: average speeds fall by 3-13 % in light rain or snow,
3-16 % in heavy rain, 5-40 % in heavy snow, 10-12 % in low visibility.
How much wider drivers' gaps get, and how much slower people walk and ride on snow and ice, are assumptions of ours.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from vico.rules import walking_factor

#: How far anybody is noticed by daylight in clear air, metres.
CLEAR_SIGHT = 40.0

_DRY, _WET, _SNOW, _ICE = 0.9, 0.55, 0.25, 0.1
_GRAVITY = 9.81
# Bodies are told from what is behind them as far as this share of meteorological visibility.
_NOTICED = 0.4
# In the dark, people are noticed this far off where no lamps are lit, metres.
_UNLIT_SIGHT = 15.0
# ... and in rooms without a lamp, to which little of the night comes in.
_DARK_ROOM_SIGHT = 3.0
_LAMPLIT = 0.75  # of the sight by day, where lamps are lit
_REACTION = 1.0  # s
# Half of a car's weight is on its driven wheels, and drivers use this share of what these can do.
_DRIVEN, _USED = 0.5, 0.7
_SLOWEST = 0.5  # of the usual speed, in the worst weather


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
    traction
        The most a vehicle speeds up, m/s^2.
    time_gap
        Factor on the time that drivers keep behind another vehicle, 1 or more.
    driving
        Factor on the speed people drive at, 0..1.
    safe_speed
        Speed from which a driver stops within what he sees, m/s.
    walking
        Factor on the speed people walk at, 0..1.
    cycling
        Factor on the speed people ride a bicycle at, 0..1.
    """

    sight: float
    friction: float
    braking: float
    hard_braking: float
    traction: float
    time_gap: float
    driving: float
    safe_speed: float
    walking: float
    cycling: float

    @property
    def grip(self) -> float:
        """Friction as a share of that on dry ground."""
        return self.friction / _DRY


def sight_in_unlit_room(dark: float) -> float:
    """Return how far off anybody is noticed in a room whose lamps are out, metres; `dark`: 0 by day, 1 at night."""
    return CLEAR_SIGHT + (_DARK_ROOM_SIGHT - CLEAR_SIGHT) * dark


def conditions(
    *,
    rain: float,
    snowfall: float,
    visibility: float,
    wet: float,
    cover: float,
    ice: float,
    dark: float,
    lamps: float,
) -> Conditions:
    """Return the conditions outdoors.

    Parameters
    ----------
    rain, snowfall
        Water that falls, mm/h.
    visibility
        Meteorological visibility, metres.
    wet, cover, ice
        How wet the ground is, and how far under snow and ice, 0..1.
    dark
        0 by day, 1 at night.
    lamps
        Share of the street lamps that are lit when it is dark, 0..1.
    """
    friction = ((_DRY + (_WET - _DRY) * wet) * (1 - cover) + _SNOW * cover) * (1 - ice) + _ICE * ice
    by_night = _UNLIT_SIGHT / CLEAR_SIGHT + (_LAMPLIT - _UNLIT_SIGHT / CLEAR_SIGHT) * lamps
    sight = min(CLEAR_SIGHT, _NOTICED * visibility) * (1 + (by_night - 1) * dark)
    hard = min(8.0, friction * _GRAVITY)
    # Drivers see vehicles and their lamps as far as the air lets them; they keep what they need to stop.
    seen = visibility * (1.0 if dark < 0.5 else 0.8)
    safe = hard * (math.sqrt(_REACTION**2 + 2 * seen / hard) - _REACTION)
    slower = 0.12 * min(rain / 8.0, 1.0) + 0.12 * min(snowfall / 2.0, 1.0) + 0.20 * cover
    slower += 0.11 * min(max((400.0 - visibility) / 200.0, 0.0), 1.0) + 0.30 * ice
    braking = min(friction / _DRY * 1.5, 1.0)
    return Conditions(
        sight=sight,
        friction=friction,
        braking=braking,
        hard_braking=hard,
        traction=_DRIVEN * _USED * friction * _GRAVITY,
        time_gap=1.0 + 0.5 * (1.0 - braking),
        driving=max(1.0 - slower, _SLOWEST),
        safe_speed=safe,
        walking=walking_factor(cover, ice),
        cycling=1.0 - max(0.25 * cover, 0.40 * ice, 0.05 * min(rain / 8.0, 1.0)),
    )
