"""MuJoCo's steps, and what it says of them."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any

from vico.io.mujoco import mujoco
from vico.sim.physics.records import PhysicsError


class PhysicsWarning(RuntimeWarning):
    """MuJoCo says that something is about to go wrong."""


# MuJoCo calls back from C, where an exception would end the process: what it says is kept until the step is over.
_SAID: list[str] = []


def _take_note(message: str) -> None:
    if len(_SAID) < 10:
        _SAID.append(message)


def listen() -> None:
    """Have MuJoCo say here what it would append to a file in the folder people happen to be in."""
    if mujoco.get_mju_user_warning() is None:
        mujoco.set_mju_user_warning(_take_note)


def solve(model: Any, data: Any, steps: int) -> None:
    """Have MuJoCo take some steps.

    Raises
    ------
    PhysicsError
        If it runs out of its working memory.
    """
    try:
        mujoco.mj_step(model, data, steps)
    except mujoco.FatalError as error:
        raise PhysicsError(
            f"physics: MuJoCo gave up at {data.time:.2f} s ({error}); report it with the snapshot"
        ) from None


def heard() -> list[str]:
    """Return what MuJoCo has said since this was last asked."""
    said, _SAID[:] = _SAID[:], ()
    return said


def report(said: Sequence[str], seconds: float, *, finite: bool) -> None:
    """Warn of what MuJoCo has said.

    Raises
    ------
    PhysicsError
        If not all speeds are `finite`.
    """
    if not finite:
        why = f" ({said[0]})" if said else ""
        raise PhysicsError(f"physics: the robots' motion diverged at {seconds:.2f} s{why}; report it with the snapshot")
    for message in said:
        warnings.warn(f"physics: MuJoCo says: {message}", PhysicsWarning, stacklevel=4)
