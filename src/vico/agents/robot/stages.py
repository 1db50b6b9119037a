"""What an arm can be told to do, the stages of doing it, and those of a robot that has a thing to bring."""

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


class ErrandStage(StrEnum):
    """What a robot that brings a thing is at."""

    GO = "go to the source"
    CALL = "call the person"
    SEARCH = "look for the thing"
    PICK = "pick it"
    PUSH = "push it"
    LOAD = "put it on the carrier"
    ALONG = "go along with the carrier"
    UNLOAD = "take it off the carrier"
    FOLLOW = "follow the person"
    BRING = "bring it"
    PLACE = "put it down"
    END = "end"


class PolicyStage(StrEnum):
    """What an arm is at whose policy was learned."""

    IDLE = "idle"
    COME = "come"
    READY = "ready"
    POLICY = "policy"
    FOLD = "fold"
