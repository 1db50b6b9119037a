"""The rules of a body that everybody may know: speeds, reach, and the codes that tell how an action went."""

from __future__ import annotations

import math
from enum import IntEnum

#: Metres a second.
WALK_SPEED = 1.0
RUN_SPEED = 2.5
#: On stairs, up or down, seen from above.
STAIRS_SPEED = 0.5
BIKE_SPEED = 3.0

# Children of five keep up with a stroll; the old slow down (Bohannon and Williams Andrews, Physiotherapy 97, 2011).
_OLD, _OLD_PACE = (65.0, 75.0, 85.0, 95.0), (1.0, 0.92, 0.78, 0.70)

#: How far a hand reaches along the ground, and above the feet, metres.
REACH = 1.5
REACH_UP = 2.2
# ... of children, who are small: so many times their stature.
_REACH_OF_STATURE = 1.35

#: How near one has to be to go through an entrance, and through a door between rooms, metres.
DOOR_REACH = 2.0
INNER_DOOR_REACH = 1.0

#: Beds have a place to lie for every so many metres of their width.
BED_WIDTH = 0.7

#: Buses: seconds one stands at a stop, and how many more at its line's first one by the timetable; what boarding costs,
#: how near to one of its doors one boards, metres, and how many ride in it.
BUS_DWELL = 30.0
BUS_LAYOVER = 40.0
BUS_FARE = 2.0
BUS_DOOR_REACH = 3.0
#: Width of a bus, metres.
BUS_WIDTH = 2.55
#: How far behind its front the middle of its front door is, metres; and of each of its doors.
BUS_DOOR_BEHIND_FRONT = 1.35
BUS_DOORS_BEHIND_FRONT = (BUS_DOOR_BEHIND_FRONT, 6.05, 9.55)
BUS_CAPACITY = 60
#: Trams: sections coupled to one, their length, and their width, metres; doors and fares are as with buses.
TRAM_SECTIONS = 3
TRAM_SECTION = 8.4
TRAM_WIDTH = 2.4

#: Bicycles: how near one gets on, metres; the price of a started minute, and of leaving it farther from a station with
#: a free place than `STATION_REACH` metres.
BIKE_REACH = 2.0
BIKE_RATE = 0.2
BIKE_ASTRAY = 20.0
STATION_REACH = 5.0

#: How far a voice carries, metres, and how long a message may be, characters.
EARSHOT = 10.0
LONGEST_TEXT = 1000


def walking_factor(snow_cover: float, ice: float) -> float:
    """Return the share of the usual speed that people walk at, on ground so far covered by snow or ice, 0..1.

    By how much is an assumption of ours.
    """
    return 1.0 - max(0.12 * snow_cover, 0.25 * ice)


class ActionStatus(IntEnum):
    """Outcome of the last action. Observations give the name in lower case, as ``action_status``."""

    OK = 0
    COLLISION = 1
    REFUSED = 2
    LATE = 3
    FAILED = 4


class ReasonCode(IntEnum):
    """Why the last action went as it did. Observations give the name in lower case, as ``action_code``."""

    NONE = 0

    # The motion was stopped.
    HIT_SOLID = 1
    HIT_BODY = 2

    # The agent did not act.
    AGENT_LATE = 10
    AGENT_FAILED = 11

    # Refused: the form of the action.
    NOT_AN_ACTION = 20
    UNKNOWN_TYPE = 21
    UNKNOWN_FIELD = 22
    MISSING_FIELD = 23
    BAD_VALUE = 24
    OUT_OF_RANGE = 25
    WRONG_SIZE = 26
    FOR_ROBOTS_ONLY = 27
    FOR_PEOPLE_ONLY = 28
    NOT_ABLE = 29

    # Refused: the state of one's own body.
    ASLEEP = 40
    SEATED = 41
    IN_BUS = 42
    ON_BIKE = 43
    NOT_SEATED = 44
    NOT_ASLEEP = 45
    HAND_FULL = 46
    HAND_EMPTY = 47
    INDOORS = 48
    OUTDOORS = 49
    NOT_RIDING = 50
    RIDING_ALREADY = 51
    NO_MONEY = 52

    # Refused: what the action is about.
    SELF = 60
    UNKNOWN_AGENT = 61
    UNKNOWN_PLACE = 62
    UNKNOWN_TARGET = 63
    NOT_PORTABLE = 64
    HELD_ALREADY = 65
    ELSEWHERE = 66
    TOO_FAR = 67
    TOO_HIGH_OR_LOW = 68
    NO_DIRECTION = 69
    NO_DOOR = 70
    FULL = 71
    BLOCKED = 72
    NO_FREE_SPOT = 73
    NO_VEHICLE = 74
    NO_TRANSIT = 75
    MOVING = 76
    CLOSED = 77
    NO_SEAT = 78


_CODE_NAMES = {int(code): code.name.lower() if code else "" for code in ReasonCode}


def walk_speed(age: float) -> float:
    """Return how fast somebody of an age walks who has time, metres a second."""
    if age <= _OLD[0]:
        return WALK_SPEED
    k = next((k for k in range(1, len(_OLD) - 1) if age < _OLD[k]), len(_OLD) - 1)
    share = min(1.0, (age - _OLD[k - 1]) / (_OLD[k] - _OLD[k - 1]))
    return WALK_SPEED * (_OLD_PACE[k - 1] + share * (_OLD_PACE[k] - _OLD_PACE[k - 1]))


def reach_up(height: float) -> float:
    """Return how far above the feet the hands of somebody of a stature reach, metres."""
    return min(REACH_UP, _REACH_OF_STATURE * height)


def ride_price(seconds: float, *, returned: bool) -> float:
    """Price of a bicycle ride: 0.2 per started minute, 20 more if it was not brought to a station."""
    return BIKE_RATE * math.ceil(max(seconds, 1e-9) / 60.0) + (0.0 if returned else BIKE_ASTRAY)


def code_name(code: int) -> str:
    """Return the name of a reason code as observations give it; "" for none."""
    return _CODE_NAMES[code]
