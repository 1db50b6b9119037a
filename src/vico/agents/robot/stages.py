"""What an arm can be told to do, and the stages of doing it."""

from __future__ import annotations

from enum import StrEnum


class Stage(StrEnum):
    """What the arm is at."""

    IDLE = "idle"
    COME = "come"
    RAISE = "raise"
    ALIGN = "align"
    LOOK = "look"
    OVER = "over"
    THERE = "there"
    GRIP = "grip"
    AWAY = "away"
    BACK = "back"
    CARRY = "carry"
    INSPECT = "inspect"


class Work(StrEnum):
    """What it does."""

    NOTHING = "nothing"
    PICK = "picked"
    PLACE = "placed"
    OFFER = "handed_over"
    FOLD = "folded"
