"""Records of a physics engine's input and output, the same for every engine; the length of a physics frame.

The specification asks for 100 frames a second. That is what robots get whose motors are commanded directly, that have
fallen, that hold or move things, or near which things fall or are pushed. Gaits and wheels that follow velocities,
among people and vehicles, need no more than 50, and cost half as much. Rotors act before each of a frame's steps.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from vico.errors import VicoError
from vico.world.heights import HeightField


class PhysicsError(VicoError, ArithmeticError):
    """The equations of motion have no finite solution any more."""


@dataclass(frozen=True)
class StaticScene:
    """Everything that never moves.

    Attributes
    ----------
    height
        The ground.
    hulls
        Corner points of convex solids, metres, each of shape ``(n, 3)``.
    boxes
        Upright boxes: x, y, z of the centre, yaw, half extents; float64, shape ``(n, 7)``.
    pillars
        Upright cylinders: x, y, z of the centre, radius, half height; float64, shape ``(n, 5)``.
    squares
        Where there is ground: x and y of the south-western corner of each square, shape ``(n, 2)``; None: everywhere.
    side
        Of those squares, metres.
    """

    height: HeightField
    hulls: tuple[NDArray[np.float64], ...] = ()
    boxes: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 7)))
    pillars: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 5)))
    squares: NDArray[np.float64] | None = None
    side: float = 0.0


#: Column and row of a chunk, from the south-west.
Chunk = tuple[int, int]


class StaticChunks(Protocol):
    """Everything that never moves where there is too much of it to be held at once: square by square.

    What a robot meets is the same whichever chunks a scene has, as long as those around the robot are among them.
    """

    @property
    def height(self) -> HeightField:
        """The ground of all of it."""

    @property
    def side(self) -> float:
        """Side of a chunk, metres; a whole number of them is as long as the ground."""

    def scene(self, chunks: Collection[Chunk]) -> StaticScene:
        """Return the ground of some chunks, and all solids of which some part is in one of them."""

    def whole(self) -> StaticScene:
        """Return all of it."""


@dataclass(frozen=True)
class Capacity:
    """How many moving things there can be near robots at once; of more, the nearest count.

    Attributes
    ----------
    people, vehicles
        Kinematic cylinders (people on foot) and boxes (vehicles, cyclists).
    objects
        Free rigid objects.
    """

    people: int = 32
    vehicles: int = 16
    objects: int = 24


@dataclass(frozen=True)
class Base:
    """Motion of a robot's base.

    Attributes
    ----------
    position
        Of its origin, ENU metres, shape ``(3,)``.
    rotation
        Base to world, shape ``(3, 3)``.
    velocity
        Metres a second in the world's frame, shape ``(3,)``.
    angular_velocity_body
        Radians a second in the base's own frame, shape ``(3,)``.
    quaternion
        The rotation as w, x, y, z.
    """

    position: NDArray[np.float64]
    rotation: NDArray[np.float64]
    velocity: NDArray[np.float64]
    angular_velocity_body: NDArray[np.float64]
    quaternion: NDArray[np.float64]

    @property
    def yaw(self) -> float:
        """Heading, radians."""
        return math.atan2(self.rotation[1, 0], self.rotation[0, 0])


@dataclass(frozen=True)
class Motion:
    """Motion of several robots of one kind; row = robot.

    Attributes
    ----------
    position, velocity
        Of the bases, ENU metres and metres a second, float64, shape ``(k, 3)``.
    rotation
        Base to world, shape ``(k, 3, 3)``.
    angular_velocity_body
        Radians a second in the base's frame, shape ``(k, 3)``.
    angles, speeds
        Of the model's joints in their order, rad and rad/s, shape ``(k, joints)``.
    """

    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    rotation: NDArray[np.float64]
    angular_velocity_body: NDArray[np.float64]
    angles: NDArray[np.float64]
    speeds: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.position)

    def where(self, rows: NDArray[np.int64]) -> Motion:
        """Return some of the rows."""
        return Motion(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))


@dataclass(frozen=True)
class Imu:
    """What an inertial measurement unit at the origin of a robot's base measures, in the base's frame.

    Attributes
    ----------
    angular_velocity
        Radians a second, shape ``(3,)``.
    specific_force
        Acceleration without gravity's, mean of the last frame, m/s2, shape ``(3,)``: 9.81 upwards at rest.
    """

    angular_velocity: NDArray[np.float64]
    specific_force: NDArray[np.float64]


#: Shapes that a free rigid object may be made of.
BOX, CYLINDER, BALL = "box", "cylinder", "ball"


class RigidPart(NamedTuple):
    """A convex part of a free rigid object.

    Attributes
    ----------
    shape
        `BOX`, `CYLINDER` (along its z) or `BALL`.
    half
        Half its extents along its own axes, metres, shape ``(3,)``.
    position, quaternion
        Of its middle in the object's frame, metres, shape ``(3,)``; its turn, w, x, y, z.
    """

    shape: str
    half: NDArray[np.float64]
    position: NDArray[np.float64]
    quaternion: NDArray[np.float64]


@dataclass(frozen=True)
class RigidObject:
    """A free rigid box, or several convex parts in one.

    Attributes
    ----------
    size
        Extents of its box, metres, shape ``(3,)``.
    mass
        Kilograms, spread evenly about the middle of the box.
    parts
        What it touches others with: of each shape as many as an engine has room for (`PARTS`); none for the box.
    position
        Middle, ENU metres, shape ``(3,)``.
    quaternion
        Orientation w, x, y, z.
    velocity, angular_velocity_body
        m/s in the world's frame and rad/s in its own, shape ``(3,)``.
    """

    size: NDArray[np.float64]
    mass: float
    position: NDArray[np.float64]
    quaternion: NDArray[np.float64]
    velocity: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    angular_velocity_body: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    parts: tuple[RigidPart, ...] = ()


#: Parts that an object has room for, in the order in which engines keep them.
PARTS = (BOX, BOX, BOX, CYLINDER, CYLINDER, BALL)


@dataclass(frozen=True)
class ObjectMotion:
    """Where the free rigid objects are; row = slot.

    Attributes
    ----------
    present
        Which slots are taken, bool, shape ``(n,)``; the rest of a free slot's row means nothing.
    position, quaternion
        Middle, ENU metres, shape ``(n, 3)``; w, x, y, z, shape ``(n, 4)``.
    velocity, angular_velocity_body
        m/s in the world's frame and rad/s in the object's, shape ``(n, 3)``.
    resting
        Which have come to rest, bool, shape ``(n,)``.
    """

    present: NDArray[np.bool_]
    position: NDArray[np.float64]
    quaternion: NDArray[np.float64]
    velocity: NDArray[np.float64]
    angular_velocity_body: NDArray[np.float64]
    resting: NDArray[np.bool_]


# Columns of an engine's own contacts, shape ``(n, 9)``: after the two shapes or links come ...
CONTACT_POSITION = slice(2, 5)  # ENU, m
CONTACT_NORMAL = slice(5, 8)  # from the first to the second
CONTACT_FORCE = 8  # along the normal, N


class Party(IntEnum):
    """What kind of thing takes part in a contact."""

    SCENE, ROBOT, BODY, OBJECT = range(4)


@dataclass(frozen=True)
class Contacts:
    """Who touches whom, as the engine solved it last; row = contact point.

    Attributes
    ----------
    party
        A `Party` for each of the two, int8, shape ``(n, 2)``.
    owner
        Index of the robot, entity of the person or vehicle, slot of the object; -1 for the scene; int32, shape
        ``(n, 2)``.
    link
        Index into `PhysicsScene.link_names` of that robot, -1 for others, int16, shape ``(n, 2)``.
    position
        ENU metres, shape ``(n, 3)``.
    normal
        Unit vector from the first to the second, shape ``(n, 3)``.
    force
        Along the normal, newtons, 0 or more, shape ``(n,)``.
    """

    party: NDArray[np.int8]
    owner: NDArray[np.int32]
    link: NDArray[np.int16]
    position: NDArray[np.float64]
    normal: NDArray[np.float64]
    force: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.force)

    def link_forces(self, robot: int, links: int) -> NDArray[np.float64]:
        """Sum of the normal forces on each link of a robot, newtons, float64, shape ``(links,)``."""
        found = np.zeros(links)
        for side in (0, 1):
            mine = (self.party[:, side] == Party.ROBOT) & (self.owner[:, side] == robot)
            np.add.at(found, self.link[mine, side], self.force[mine])
        return found

    def objects_at(self, robot: int, link: int) -> set[int]:
        """Return the slots of the objects that a link of a robot touches."""
        found: set[int] = set()
        for a, b in ((0, 1), (1, 0)):
            mine = (self.party[:, a] == Party.ROBOT) & (self.owner[:, a] == robot) & (self.link[:, a] == link)
            found.update(self.owner[mine & (self.party[:, b] == Party.OBJECT), b].tolist())
        return found

    def touching(self, robot: int, link: int, slot: int) -> bool:
        """Whether a link of a robot touches the object in a slot."""
        for a, b in ((0, 1), (1, 0)):
            mine = (self.party[:, a] == Party.ROBOT) & (self.owner[:, a] == robot) & (self.link[:, a] == link)
            if np.any(mine & (self.party[:, b] == Party.OBJECT) & (self.owner[:, b] == slot)):
                return True
        return False


#: Seconds a frame lasts: where forces matter, and where nothing but driving and walking goes on.
FINE, COARSE = 0.01, 0.02
#: Steps in which an engine solves a frame, at least: 1/200 s each in fine frames, 1/150 s in coarse ones.
SOLVER_STEPS = {FINE: 2, COARSE: 3}


@dataclass(frozen=True)
class FrameNeeds:
    """What goes on among the robots of a run.

    Attributes
    ----------
    motor_commands
        Somebody commands a robot's motors directly.
    fallen
        A robot lies on the ground, or gets up: limbs are thrown about.
    manipulation
        A robot's hand is at work, or holds a thing.
    loose_objects
        A free rigid object moves.
    """

    motor_commands: bool = False
    fallen: bool = False
    manipulation: bool = False
    loose_objects: bool = False

    @property
    def forces_matter(self) -> bool:
        """Whether anything asks for fine frames, with friction that holds things still."""
        return self.motor_commands or self.fallen or self.manipulation or self.loose_objects


def frame_length(needs: FrameNeeds, dt: float) -> float:
    """Return the seconds a frame lasts within the next `dt` seconds, a multiple of 0.01.

    Fine where anything needs it, and where coarse frames would not fit into `dt`.
    """
    return FINE if needs.forces_matter or round(dt / FINE) % round(COARSE / FINE) else COARSE


@dataclass
class FrameCount:
    """How many frames of either length a run has had; part of the state.

    Attributes
    ----------
    fine, coarse
        Frames of 0.01 and of 0.02 s.
    """

    fine: int = 0
    coarse: int = 0

    def add(self, frame: float, count: int = 1) -> None:
        """Count frames of a length."""
        if frame == FINE:
            self.fine += count
        else:
            self.coarse += count

    def record(self) -> dict[str, Any]:
        """Return what a run reports of its frames."""
        return {
            "fine": {"seconds": FINE, "frames": self.fine},
            "coarse": {"seconds": COARSE, "frames": self.coarse},
            "rule": "fine where motors are commanded, robots fell or hold things, or things fall or are pushed",
        }
