"""Physics engines by name."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib import import_module
from importlib.util import find_spec

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import RobotModel
from vico.errors import InputError
from vico.sim.physics.engine import PhysicsEngine, PhysicsScene
from vico.sim.physics.records import Capacity, StaticChunks, StaticScene

#: By name: the package an engine needs, how to install it, and the class of its scenes. Engines are imported when they
#: are first asked for.
_ENGINES = {
    "mujoco": ("mujoco", "pip install mujoco", "vico.sim.physics.mujoco_physics", "MujocoScene"),
    "genesis": (
        "genesis",
        "pip install 'virtual-community[genesis]'",
        "vico.sim.physics.genesis_physics",
        "GenesisScene",
    ),
}
DEFAULT_ENGINE = "mujoco"


def known_engines() -> tuple[str, ...]:
    """Names of all engines, the default one first."""
    return tuple(_ENGINES)


def engine_names() -> tuple[str, ...]:
    """Names of the engines whose packages are installed."""
    return tuple(name for name, (package, *_) in _ENGINES.items() if find_spec(package) is not None)


def make_scene(
    name: str, static: StaticScene | StaticChunks, models: Sequence[RobotModel], capacity: Capacity | None = None
) -> PhysicsScene:
    """Build a scene: what engines of one world and its robots share.

    Parameters
    ----------
    name
        Of the engine, such as ``mujoco``.
    static
        What never moves; of chunks, those around robots are in physics.
    models
        The robots.
    capacity
        How many people, vehicles and objects there is room for near robots.

    Raises
    ------
    InputError
        If there is no such engine, or its package is not installed.
    """
    if name not in _ENGINES:
        raise InputError(f"physics: there is no engine {name!r}; choose among {', '.join(sorted(_ENGINES))}")
    package, install, module, kind = _ENGINES[name]
    if find_spec(package) is None:
        raise InputError(f"physics: engine {name!r} needs the package {package}, which is not installed: {install}")
    maker: Callable[..., PhysicsScene] = getattr(import_module(module), kind)
    return maker(static, tuple(models), capacity or Capacity())


def make_engine(
    name: str,
    static: StaticScene | StaticChunks,
    models: Sequence[RobotModel],
    places: NDArray[np.float64],
    capacity: Capacity | None = None,
) -> PhysicsEngine:
    """Build a scene and an engine in it; for more than one engine, build the scene once by `make_scene`.

    Parameters
    ----------
    places
        Where each robot stands at first: x, y, yaw, shape ``(n, 3)``; the rest is as for `make_scene`.
    """
    return make_scene(name, static, models, capacity).engine(np.asarray(places, np.float64))
