"""Known robots by name, and the packages that richer models of them come from."""

from __future__ import annotations

from collections.abc import Callable
from difflib import get_close_matches

from vico.assets.packages import Package
from vico.assets.robots.drone import drone
from vico.assets.robots.go2 import go2
from vico.assets.robots.h1 import h1
from vico.assets.robots.husky import husky
from vico.assets.robots.manipulator import manipulator
from vico.assets.robots.model import RobotModel
from vico.assets.robots.packs import GO2_PACKAGE, H1_PACKAGE, HUSKY_PACKAGE
from vico.errors import InputError

# What a robot is described in elsewhere: URDF, MJCF and SDF (.xml too), USD.
_FILES = (".urdf", ".xacro", ".xml", ".mjcf", ".sdf", ".usd", ".usda", ".usdc", ".usdz")

_MAKERS: dict[str, Callable[[bool], RobotModel]] = {
    "drone": drone,
    "go2": go2,
    "h1": h1,
    "husky": husky,
    "manipulator": manipulator,
}


def robot_names() -> tuple[str, ...]:
    """Names `robot_model` knows."""
    return tuple(_MAKERS)


def register_robot(name: str, maker: Callable[[bool], RobotModel]) -> None:
    """Make a kind of robot known by name.

    Parameters
    ----------
    maker
        Called with whether installed packages may be used; returns the model, the same object for the same answer.

    Raises
    ------
    InputError
        If the name is taken, or has a character that names of robots are told apart by.
    """
    if name in _MAKERS:
        raise InputError(f"robot {name!r} is there already; give yours another name")
    if not name or set(name) & set(":, "):
        raise InputError(f"robot {name!r}: a name has one or more characters, and no colon, comma or space")
    _MAKERS[name] = maker


def robot_model(name: str, *, packs: bool = True) -> RobotModel:
    """Return a kind of robot.

    Parameters
    ----------
    name
        One of `robot_names`; ``go2:velocity`` is a robot commanded in another action space than its first.
    packs
        Use meshes and policies of installed packages; False: our own models even where those are.

    Raises
    ------
    InputError
        If there is no such robot, or it has no such action space.
    """
    kind = robot_kind(name)
    model = _MAKERS[kind](packs)
    return model.with_space(name.removeprefix(f"{kind}:")) if ":" in name else model


def robot_kind(name: str) -> str:
    """Return the kind of a robot, without its action space.

    Raises
    ------
    InputError
        If there is no such kind, or `name` is a file.
    """
    if name.lower().endswith(_FILES):
        raise InputError(
            f"robot {name!r}: files of robots are not taken yet; docs/robots.md#adding-a-robot says how to add one in "
            f"Python, and these are there: {', '.join(sorted(_MAKERS))}"
        )
    kind = name.partition(":")[0]
    if kind not in _MAKERS:
        near = get_close_matches(kind.lower(), _MAKERS, 1)
        hint = f", did you mean {near[0]!r}?" if near else ""
        raise InputError(f"robot {kind!r} is not known; choose among {', '.join(sorted(_MAKERS))}{hint}")
    return kind


def robot_packages() -> tuple[Package, ...]:
    """Return the packages that richer robots are read from."""
    return GO2_PACKAGE, H1_PACKAGE, HUSKY_PACKAGE
