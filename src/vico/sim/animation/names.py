"""The motions there are."""

from __future__ import annotations

from vico.errors import InputError

# The order is the recording format's: add at the end only.
CLIPS = (
    "idle",
    "walk",
    "run",
    "turn",
    "sit",
    "sleep",
    "talk",
    "wave",
    "pick",
    "put",
    "reach",
    "drink",
    "eat",
    "carry",
    "ride_bike",
    "ride_bus",
    "stand",
    "enter_vehicle",
    "exit_vehicle",
    "carry_left",
    "carry_right",
    "sit_talk",
    "sit_wave",
    "sit_drink",
    "sit_eat",
    "open_door",
    "phone",
)
_INDEX = {name: index for index, name in enumerate(CLIPS)}


def clip_index(name: str) -> int:
    """Return the number of a motion.

    Raises
    ------
    InputError
        If there is no motion of that name.
    """
    try:
        return _INDEX[name]
    except KeyError:
        raise InputError(f"animation: no motion {name!r}; known are {', '.join(CLIPS)}") from None


IDLE, WALK, RUN, TURN, SIT, SLEEP, TALK, WAVE, PICK, PUT, REACH, DRINK, EAT, CARRY = range(14)
RIDE_BIKE, RIDE_BUS, STAND, ENTER_VEHICLE, EXIT_VEHICLE, CARRY_LEFT, CARRY_RIGHT = range(14, 21)
SIT_TALK, SIT_WAVE, SIT_DRINK, SIT_EAT = range(21, 25)
OPEN_DOOR, PHONE = 25, 26
