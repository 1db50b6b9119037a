"""What MuJoCo says while it steps."""

from __future__ import annotations

import mujoco


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


def heard() -> list[str]:
    """Return what MuJoCo has said since this was last asked."""
    said, _SAID[:] = _SAID[:], ()
    return said
