"""The protocol of a physics engine, and engines by name.

A further engine is written against two protocols. A `PhysicsScene` is everything that is fixed once it is built:
ground, solids, robots, and a preallocated number of kinematic bodies and free rigid objects. It is built once a world
and its robots, never changes, and any number of engines share it. A `PhysicsEngine` is the state of one run in it.

Engines that cannot add entities to what they have built park the unused ones out of reach, as MuJoCo's does. Nothing
here says how contacts are solved: results of two engines agree loosely, those of one are the same bit for bit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from importlib.util import find_spec
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import RobotModel
from vico.errors import InputError
from vico.sim.bodies.arrays import Bodies
from vico.sim.physics.records import (
    COARSE,
    Base,
    Capacity,
    Contacts,
    Imu,
    Motion,
    ObjectMotion,
    Party,
    RigidObject,
    StaticChunks,
    StaticScene,
)

__all__ = [
    "DEFAULT_ENGINE",
    "Actuate",
    "Base",
    "Capacity",
    "Contacts",
    "Imu",
    "Motion",
    "ObjectMotion",
    "Party",
    "PhysicsBatch",
    "PhysicsEngine",
    "PhysicsScene",
    "RigidObject",
    "StaticScene",
    "engine_names",
    "known_engines",
    "make_engine",
    "make_scene",
]
#: Told the seconds that have passed since the frame began, and those that the solver's step takes.
Actuate = Callable[[float, float], None]


class PhysicsEngine(Protocol):
    """Robots, people, vehicles and loose things in a `PhysicsScene`. Robots are addressed by their index.

    Calls between two steps take effect at the next one. `arrays` and `restore` give exact snapshots: an engine of the
    same scene that is restored goes on bit for bit as the saved one, and answers every query of this protocol alike.
    """

    # Robots.

    def link_names(self, robot: int) -> tuple[str, ...]:
        """Names of a robot's links, base first, in the order that contacts count them."""

    def base(self, robot: int) -> Base:
        """Where a robot's base is and how it moves. Its arrays are shared until the next step: do not change them."""

    def joints(self, robot: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Positions and speeds of the joints, rad and rad/s (m, m/s), in the order of the model's `joints`."""

    def motion(self, robots: NDArray[np.int64]) -> Motion:
        """Motion of several robots of one kind, by their indices: what `base` and `joints` say of each."""

    def motor_forces(self, robot: int) -> NDArray[np.float64]:
        """Torques (Nm; N for sliding joints) of the motors in the last step, in the order of the control vector."""

    def imu(self, robot: int) -> Imu:
        """Return what an inertial measurement unit in the base measures."""

    def links(self, robot: int) -> NDArray[np.float64]:
        """Poses of the links, in the order of the model's `shapes`, shape ``(n, 4, 4)``."""

    def command(self, robot: int, targets: NDArray[np.float64], gains: tuple[float, float] | None = None) -> None:
        """Set what the servos follow from now on; those that follow angles also take a stiffness and a damping."""

    def command_all(
        self, robots: NDArray[np.int64], targets: NDArray[np.float64], gains: Sequence[tuple[float, float] | None]
    ) -> None:
        """Set what the servos of several robots of one kind follow, shape ``(k, motors)``; see `command`."""

    def thrust(
        self, robot: int, sites: Sequence[str], forces: NDArray[np.float64], torques: NDArray[np.float64] | None = None
    ) -> None:
        """Push a robot at named sites from now on, as rotors do: force and torque turn with the site.

        Parameters
        ----------
        sites
            Names out of `PhysicsScene.site_names`; the robot's other sites keep what they had.
        forces, torques
            In the frame of each site, N and Nm, shape ``(len(sites), 3)``; no torques: zeros.

        Raises
        ------
        InputError
            If the robot has no such site, or a number is not finite.
        """

    def thrust_all(self, robots: NDArray[np.int64], site: str, wrenches: NDArray[np.float64]) -> None:
        """Push several robots of one kind at the site of one name from now on; see `thrust`.

        Parameters
        ----------
        wrenches
            Force and torque in the frame of each site, N and Nm, shape ``(k, 6)``.
        """

    def park(self, robot: int) -> None:
        """Take a robot out of the scene until it is stood there again: it hangs where nobody comes."""

    def stand(self, robot: int, place: NDArray[np.float64]) -> None:
        """Stand a robot on the ground at rest: x, y (ENU metres) and yaw, shape ``(3,)``."""

    # Everybody else.

    def set_dynamic_obstacles(self, obstacles: Bodies, dt: float) -> None:
        """Say who is near: each arrives at its pose `dt` seconds from now.

        Until then it is moved at every frame, from where it was told to be last, or, if it is new here or has jumped,
        from where its velocity says that it comes from. Nearest ones count if there are more than `Capacity` allows.
        Bodies of kind ``object`` are left out: those are free rigid objects.
        """

    @property
    def left_out(self) -> int:
        """How many bodies near robots found no place in the last call of `set_dynamic_obstacles`."""

    def set_friction(self, share: float) -> None:
        """Have ground, tyres and feet grip with this share of their friction on dry ground from now on, 0..1."""

    # Free rigid objects.

    def place_object(self, slot: int, thing: RigidObject) -> None:
        """Put an object into a slot (0 up to `Capacity.objects`), awake; what was there is gone."""

    def remove_object(self, slot: int) -> None:
        """Take the object of a slot out of the scene; nothing happens if there is none."""

    def objects(self) -> ObjectMotion:
        """Where all objects are."""

    def clearance_below(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Metres from each point straight down to ground, solids, people, links of robots or objects.

        Parameters
        ----------
        points
            ENU metres, shape ``(n, 3)``.

        Returns
        -------
        ndarray
            float64, shape ``(n,)``: inf if there is nothing, -inf if the point lies inside of something.
        """

    # Time.

    def contacts(self) -> Contacts:
        """Who touched whom, where and how hard, in the last step of the solver."""

    def step(
        self,
        frames: int = 1,
        *,
        frame: float = COARSE,
        holding: bool | None = None,
        actuate: Actuate | None = None,
    ) -> None:
        """Move on by some frames of `FINE` or `COARSE` seconds (see `vico.sim.physics.records`).

        Parameters
        ----------
        holding
            Whether friction has to hold things still, which costs more; None: in fine frames.
        actuate
            Called before each of the solver's steps, for what cannot wait for the next frame: it reads the motion of
            robots as it is then, and commands or pushes them.

        Raises
        ------
        PhysicsError
            If the motion diverges.
        """

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Everything that decides the future, and what queries of the last step answer from."""

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go back to what `arrays` held, bit for bit.

        Raises
        ------
        SchemaError
            If it belongs to another scene.
        """


class PhysicsBatch(Protocol):
    """Many copies of one scene that are stepped together, for training and planning; row = copy.

    Copies never meet. Each goes on bit for bit as an engine of its own would that is stepped alone.
    """

    def __len__(self) -> int:
        """How many copies there are."""

    def restore(self, copies: NDArray[np.int64], arrays: Mapping[str, NDArray[Any]]) -> None:
        """Put some copies into a state saved by an engine of the same scene."""

    def arrays(self, copy: int) -> dict[str, NDArray[Any]]:
        """State of one copy, as an engine's `arrays`: an engine that restores it goes on alike."""

    def command(self, robot: int, targets: NDArray[np.float64]) -> None:
        """Set what the servos of a robot follow in each copy, shape ``(copies, motors)``."""

    def bases(self, robot: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Poses (x, y, z, quaternion) and motions (velocity, angular velocity in the base's frame) of a robot's base.

        Returns
        -------
        tuple of ndarray
            float64, shapes ``(copies, 7)`` and ``(copies, 6)``.
        """

    def joints(self, robot: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Positions and speeds of the joints, shape ``(copies, joints)`` each."""

    def objects(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Poses and motions of the free rigid objects, shapes ``(copies, slots, 7)`` and ``(copies, slots, 6)``."""

    def step(self, frames: int = 1, *, frame: float = COARSE) -> None:
        """Move all copies on by some frames."""


class PhysicsScene(Protocol):
    """What is fixed: ground, solids, robots' bodies, and room for people, vehicles and loose things."""

    @property
    def name(self) -> str:
        """Name of the engine, as `make_scene` takes it."""

    @property
    def models(self) -> tuple[RobotModel, ...]:
        """The robots."""

    @property
    def capacity(self) -> Capacity:
        """How many people, vehicles and objects there is room for."""

    def link_names(self, robot: int) -> tuple[str, ...]:
        """Names of a robot's links, base first, in the order that contacts count them."""

    def site_names(self, robot: int) -> tuple[str, ...]:
        """Names of the sites a robot can be pushed at."""

    def engine(self, places: NDArray[np.float64]) -> PhysicsEngine:
        """Return a new state: robots stand at `places` (x, y, yaw, shape ``(n, 3)``), nobody else is there."""

    def batch(self, copies: int, places: NDArray[np.float64], *, threads: int = 0) -> PhysicsBatch:
        """Return many copies of a new state, stepped on some threads (0: one a core)."""


#: By name: the package an engine needs, how to install it, and the class of its scenes. Engines are imported when they
#: are first asked for.
_ENGINES = {
    "mujoco": ("mujoco", "pip install mujoco", "vico.sim.physics.mujoco_physics", "MujocoScene"),
    "genesis": (
        "genesis",
        "pip install 'virtual-community[genesis]'",
        "vico.sim.physics.genesis_engine",
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
