"""What agents answer, made plain: an action is a small dict of text and numbers, whatever came."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from vico.agents.base import Action

_MOST_FIELDS = 32
_LONGEST_NAME = 64
_LONGEST_TEXT = 2000  # what is too long to be said is refused by the rules; this much too long is not even kept
_LONGEST_LIST = 256


class MalformedError(ValueError):
    """An answer is no action; the message says why."""


def plain_action(answer: Any) -> Action:
    """Return an answer as a dict of plain values: nothing of what the agent holds is kept.

    Raises
    ------
    MalformedError
        If it is no dict, is too large, or holds anything but text, finite numbers and lists of them.
    """
    if not isinstance(answer, Mapping):
        raise MalformedError(f"an action is a dict with a 'type', not {type(answer).__name__}")
    if len(answer) > _MOST_FIELDS:
        raise MalformedError(f"an action of {len(answer)} fields; the longest has {_MOST_FIELDS}")
    action: Action = {}
    for name, value in answer.items():
        if not isinstance(name, str) or len(name) > _LONGEST_NAME:
            raise MalformedError("a field whose name is no text, or very long")
        action[str(name)] = _plain(value, str(name))
    return action


def _plain(value: Any, name: str) -> Any:
    if isinstance(value, np.ndarray):
        if value.dtype.kind not in "biuf" or value.ndim > 1:
            raise MalformedError(f"{name} is an array of {value.dtype} of {value.ndim} dimensions")
        value = value.tolist() if value.size <= _LONGEST_LIST else [0.0] * value.size
    if isinstance(value, (list, tuple)):
        if len(value) > _LONGEST_LIST:
            raise MalformedError(f"{name} is a list of {len(value)}; the longest has {_LONGEST_LIST}")
        return [_simple(part, name) for part in value]
    return _simple(value, name)


def _simple(value: Any, name: str) -> Any:
    if isinstance(value, np.generic):
        value = value.item()
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, str):
        if len(value) > _LONGEST_TEXT:
            raise MalformedError(f"{name} is a text of {len(value)} characters")
        return _unicode(value, name)
    if isinstance(value, int):
        if abs(value) >= 2**63:
            raise MalformedError(f"{name} is a number out of all range")
        return int(value)
    if isinstance(value, float):
        if not math.isfinite(value):
            raise MalformedError(f"{name} is {float(value)}; it has to be a finite number")
        return float(value)
    raise MalformedError(f"{name} is of type {type(value).__name__}; give text, numbers or a list of them")


def _unicode(value: str, name: str) -> str:
    try:
        return value.encode().decode()
    except UnicodeEncodeError:
        raise MalformedError(f"{name} is no Unicode text") from None
