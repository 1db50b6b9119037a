"""Which robots are known, by name, and the packages that richer models of them come from."""

from __future__ import annotations

from collections.abc import Callable

from vico.assets.packages import Package
from vico.assets.robots.go2 import go2
from vico.assets.robots.husky import husky
from vico.assets.robots.model import RobotModel
from vico.assets.robots.packs import GO2_PACKAGE, HUSKY_PACKAGE
from vico.errors import InputError

_MAKERS: dict[str, Callable[[bool], RobotModel]] = {"go2": go2, "husky": husky}


def robot_names() -> tuple[str, ...]:
    """Names `robot_model` knows."""
    return tuple(_MAKERS)


def robot_model(name: str, *, packs: bool = True) -> RobotModel:
    """Return a kind of robot.

    Parameters
    ----------
    name
        One of `robot_names`.
    packs
        Use meshes and policies of installed packages; False: our own models even where those are.

    Raises
    ------
    InputError
        If there is no such robot.
    """
    if name not in _MAKERS:
        raise InputError(f"robot {name!r} is not known; choose among {', '.join(sorted(_MAKERS))}")
    return _MAKERS[name](packs)


def robot_packages() -> tuple[Package, ...]:
    """Return the packages that richer robots are read from."""
    return GO2_PACKAGE, HUSKY_PACKAGE
