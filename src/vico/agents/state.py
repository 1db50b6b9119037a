"""What agents remember, as plain data: nested dicts of JSON values and NumPy arrays, no objects."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from vico.errors import InputError

#: What an agent remembers: nested, keys are text, values are what JSON has, or NumPy arrays.
AgentState = dict[str, Any]


def generator_state(generator: np.random.Generator) -> AgentState:
    """Return where a random stream stands; `restore_generator` goes back there."""
    return dict(generator.bit_generator.state)


def restore_generator(generator: np.random.Generator, state: Mapping[str, Any]) -> None:
    """Put a random stream where another one of its kind stood.

    Raises
    ------
    InputError
        If the state is of another kind of stream.
    """
    try:
        generator.bit_generator.state = dict(state)
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"agent: not a state of this random stream ({error}); restore it with the same vico") from None
