"""MuJoCo, imported so that the shell's choice of an OpenGL library changes nothing.

MuJoCo's package loads the OpenGL library that ``MUJOCO_GL`` names while it is imported, and fails to import where there
is none. We simulate with MuJoCo and draw by ourselves, so whatever of ours needs it imports it from here: without
OpenGL. A program that draws with MuJoCo beside us still can: its variable is as it was, and MuJoCo's own renderer is
loaded by it, when it is asked for.
"""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

_VARIABLE = "MUJOCO_GL"
_DRAWS = {"Renderer": "renderer", "GLContext": "gl_context"}  # what MuJoCo draws with, and the modules that have it


@contextmanager
def _without_gl() -> Iterator[None]:
    """Import MuJoCo without OpenGL, if it has not been imported before; the environment is as it was afterwards."""
    if "mujoco" in sys.modules:
        yield
        return
    chosen = os.environ.get(_VARIABLE)
    os.environ[_VARIABLE] = "disable"
    try:
        yield
    finally:
        if chosen is None:
            del os.environ[_VARIABLE]
        else:
            os.environ[_VARIABLE] = chosen
    _draw_when_asked()


def _draw_when_asked() -> None:
    """Forget MuJoCo's modules that draw, which know no OpenGL now; whoever asks for them gets them loaded anew."""
    package = sys.modules["mujoco"]
    for name in [name for name in sys.modules if name.startswith("mujoco.") and name.split(".")[-1] in _DRAWS.values()]:
        above, _, last = name.rpartition(".")
        del sys.modules[name]
        vars(sys.modules[above]).pop(last, None)
    for name in _DRAWS:
        vars(package).pop(name, None)
    otherwise = vars(package).get("__getattr__")

    def attribute(name: str) -> Any:
        if name in _DRAWS:
            value = getattr(importlib.import_module(f"mujoco.{_DRAWS[name]}"), name)
            setattr(package, name, value)
            return value
        if otherwise is not None:
            return otherwise(name)
        raise AttributeError(f"module 'mujoco' has no attribute {name!r}")

    vars(package)["__getattr__"] = attribute


with _without_gl():
    import mujoco
    from mujoco import rollout

__all__ = ["mujoco", "rollout"]
