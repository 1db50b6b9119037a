"""State of the robots of a run, beside the physics: arrays, paths they follow, and where they are indoors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import MobileManipulator
from vico.errors import SchemaError
from vico.seeds import rng
from vico.sim.bodies.arrays import Bodies
from vico.sim.bodies.state_arrays import REASON_LENGTH, MovableObjects, People
from vico.sim.physics import PhysicsEngine
from vico.sim.physics.composite_engine import CompositeEngine
from vico.sim.robots.manipulator import ArmTasks, OracleGrasp
from vico.sim.robots.path_following import PathFollower, RobotStatus
from vico.sim.robots.path_planning import OUTDOORS
from vico.sim.robots.quadrotor import Flight, gusts_of
from vico.sim.robots.scene import RobotScene, bodies_of

Array = NDArray[np.float64]

#: No room, no door.
NONE = -2


@dataclass
class RobotTrips:
    """Where robots are indoors, and where they go; row = robot.

    Attributes
    ----------
    room
        Room it is in, `OUTDOORS` for none, int32, shape ``(n,)``.
    goal_room, goal
        Space it goes to, `NONE` without a trip, and the point there, ENU metres, shape ``(n, 3)``.
    leg
        Space behind the door that its path leads to, `NONE` where that leads to the goal, int32, shape ``(n,)``.
    door
        Space behind the door that it stands at and waits to go through, else `NONE`, int32, shape ``(n,)``.
    ride
        Seconds it has ridden in a lift, float64, shape ``(n,)``.
    """

    room: NDArray[np.int32]
    goal_room: NDArray[np.int32]
    goal: Array
    leg: NDArray[np.int32]
    door: NDArray[np.int32]
    ride: Array

    @classmethod
    def none(cls, robots: int) -> RobotTrips:
        """All robots are outdoors, and go nowhere."""
        nowhere = np.full(robots, NONE, np.int32)
        outdoors = np.full(robots, OUTDOORS, np.int32)
        return cls(outdoors, nowhere, np.zeros((robots, 3)), nowhere.copy(), nowhere.copy(), np.zeros(robots))

    def end(self, robot: int) -> None:
        """Forget where a robot was going."""
        self.goal_room[robot] = self.leg[robot] = self.door[robot] = NONE
        self.goal[robot], self.ride[robot] = 0.0, 0.0

    def state_arrays(self) -> dict[str, NDArray[Any]]:
        """Every number, copied."""
        return {f"trip_{name}": array.copy() for name, array in vars(self).items()}

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go back to what `state_arrays` returned."""
        for name, array in vars(self).items():
            array[...] = arrays[f"trip_{name}"]


#: Circles on the ground: x, y and radius, ENU metres.
Circles = tuple[tuple[float, float, float], ...]


class RobotMode(IntEnum):
    """Who decides what a robot does."""

    IDLE, VELOCITY, MOTORS, ROUTE, FOLLOW, TASK = range(6)


#: What can happen to a robot.
NOTES = (
    "arrived",
    "blocked",
    "fallen",
    "recovered",
    "lost",
    "landed",
    "battery_low",
    "reached",
    "picked",
    "placed",
    "handed_over",
    "failed",
    "battery_empty",
    "recharged",
)


@dataclass(frozen=True)
class RobotEvent:
    """Something that happened to a robot: `kind` is one of `NOTES`.

    Attributes
    ----------
    position
        Of the robot's base when it is asked, world frame, metres, float64, shape ``(3,)``.
    """

    robot: int
    kind: str
    position: NDArray[np.float64]


@dataclass
class RobotArrays:
    """What is known of each robot; row = robot.

    Attributes
    ----------
    mode
        A `RobotMode`, int8, shape ``(n,)``.
    status
        A `RobotStatus`, int8, shape ``(n,)``.
    action_status, reason, reason_code
        How its last action went and why, as `vico.rules.ActionStatus`, in words, and as `vico.rules.ReasonCode`;
        int8, text and int16, shape ``(n,)``.
    command
        The vector it was commanded by: motor targets or a velocity, by its mode; float64, shape ``(n, widest)``.
    velocity
        What its controller follows until the next decision, vx, vy, wz, float64, shape ``(n, 3)``; those of robots that
        fly follow setpoints.
    leader
        Entity it follows, 0 for nobody, int32, shape ``(n,)``.
    lying
        Seconds it has been tilted, or has lain fallen, float64, shape ``(n,)``.
    errand
        How many errands it was sent on, int64, shape ``(n,)``.
    rest
        Seconds it has had nothing to do, float64, shape ``(n,)``.
    charge
        How full its battery is, 0..1, float64, shape ``(n,)``; those that fly have theirs in `FlightArrays`.
    uncharged
        Seconds it has waited for a full battery, float64, shape ``(n,)``.
    tick
        Hundredths of a second of physics since the start, int64, shape ``(1,)``.
    owed
        Hundredths of a second that have passed and are no whole frame yet, int64, shape ``(1,)``.
    frames
        How many frames of physics there have been, fine and coarse ones, int64, shape ``(2,)``.
    left_out
        How many people and vehicles, and how many things, found no room in physics at once at most, int64, shape
        ``(2,)``.
    """

    mode: NDArray[np.int8]
    status: NDArray[np.int8]
    action_status: NDArray[np.int8]
    reason: NDArray[np.str_]
    reason_code: NDArray[np.int16]
    command: NDArray[np.float64]
    velocity: NDArray[np.float64]
    leader: NDArray[np.int32]
    lying: NDArray[np.float64]
    errand: NDArray[np.int64]
    rest: NDArray[np.float64]
    charge: NDArray[np.float64]
    uncharged: NDArray[np.float64]
    tick: NDArray[np.int64]
    owed: NDArray[np.int64]
    frames: NDArray[np.int64]
    left_out: NDArray[np.int64]

    @classmethod
    def idle(cls, scene: RobotScene) -> RobotArrays:
        """Robots that nobody has commanded yet."""
        n = len(scene)
        sizes = [len(space) for model in scene.models for space in model.action_spaces.values()]
        return cls(
            mode=np.zeros(n, np.int8),
            status=np.zeros(n, np.int8),
            action_status=np.zeros(n, np.int8),
            reason=np.full(n, "", f"<U{REASON_LENGTH}"),
            reason_code=np.zeros(n, np.int16),
            command=np.zeros((n, max(sizes, default=0))),
            velocity=np.zeros((n, 3)),
            leader=np.zeros(n, np.int32),
            lying=np.zeros(n),
            errand=np.zeros(n, np.int64),
            rest=np.zeros(n),
            charge=np.ones(n),
            uncharged=np.zeros(n),
            tick=np.zeros(1, np.int64),
            owed=np.zeros(1, np.int64),
            frames=np.zeros(2, np.int64),
            left_out=np.zeros(2, np.int64),
        )


@dataclass
class RobotRun:
    """The robots of one run: what is fixed, their physics, and all that changes.

    Attributes
    ----------
    scene
        World, models and controllers; shared, never changes.
    engine
        Their physics.
    entities
        Entity of each, int32, shape ``(n,)``.
    seed
        Decides errands.
    arrays
        What is known of each robot.
    memory
        What each group's controller remembers, float64, shape ``(k, controller.memory)``.
    followers
        Take each robot along its way.
    flights
        What changes of each group besides if it flies, else None.
    work
        Tasks of each group's arms, None if it has none.
    objects
        Things that can be picked.
    people
        Avatars, some of whom are indoors.
    trips
        Where robots are indoors, and which doors they go through.
    oracle
        What hands hold by oracle; None where friction alone holds.
    closed_ground
        Ground that events close.
    pending
        Robot, and index into `NOTES`, of what happened since it was last asked.
    """

    scene: RobotScene
    engine: PhysicsEngine
    entities: NDArray[np.int32]
    seed: int
    arrays: RobotArrays
    memory: list[NDArray[np.float64]] = field(init=False)
    followers: list[PathFollower] = field(init=False)
    flights: list[Flight | None] = field(init=False)
    work: list[ArmTasks | None] = field(init=False)
    trips: RobotTrips = field(init=False)
    objects: MovableObjects = field(default_factory=MovableObjects.none)
    people: People | None = None
    oracle: OracleGrasp | None = None
    closed_ground: Circles = ()
    pending: list[tuple[int, int]] = field(default_factory=list)
    known_bodies: Bodies | None = None

    def __post_init__(self) -> None:
        self.memory = [np.zeros((len(group.robots), group.controller.memory)) for group in self.scene.groups]
        self.followers = [PathFollower(model) for model in self.scene.models]
        self.trips = RobotTrips.none(len(self.scene))
        self.flights = [
            None
            if group.model.rotors is None
            else Flight(group.model, group.robots, self.scene.world.height, gusts_of(self.seed))
            for group in self.scene.groups
        ]
        self.work = [
            ArmTasks(group.model, group.robots) if isinstance(group.model.controller, MobileManipulator) else None
            for group in self.scene.groups
        ]

    def position(self, robot: int) -> NDArray[np.float64]:
        """Origin of a robot's base, ENU metres, shape ``(3,)``."""
        return self.engine.base(robot).position

    def above_ground(self, robot: int) -> float:
        """Height of a robot's base above the ground, metres."""
        position, room = self.engine.base(robot).position, int(self.trips.room[robot])
        ground = self.scene.world.height(position) if room < 0 else self.scene.rooms.indoor.floor[room]
        return float(position[2]) - float(ground)

    def bodies(self) -> Bodies:
        """Oriented rectangles of the robots' outlines."""
        if self.known_bodies is None:
            self.known_bodies = bodies_of(self.scene, self.engine, self.entities, self.trips.room)
        return self.known_bodies

    # Robots in rooms have engines of their own.

    def composite_engine(self) -> CompositeEngine:
        """Return the engine as one in which robots can be indoors."""
        if not isinstance(self.engine, CompositeEngine):
            self.engine = CompositeEngine(self.engine)
        return self.engine

    def unhouse(self) -> None:
        """Go back to the engine outdoors alone, which is quicker, where nobody is indoors."""
        if isinstance(self.engine, CompositeEngine) and not self.engine.inside:
            self.engine = self.engine.outdoors

    def forget(self, robot: int) -> None:
        """Have a robot begin anew where it stands: its controller, and the way it was on."""
        for group, memory in zip(self.scene.groups, self.memory, strict=True):
            memory[group.robots == robot] = 0.0
        self.followers[robot].end()
        self.known_bodies = None

    def note(self, robot: int, kind: str) -> None:
        """Keep that something happened to a robot."""
        self.pending.append((robot, NOTES.index(kind)))

    def set_mode(self, robot: int, mode: RobotMode) -> None:
        """Have somebody else decide what a robot does; a fallen one stays fallen."""
        a = self.arrays
        a.mode[robot] = mode
        if a.status[robot] != RobotStatus.FALLEN:
            a.status[robot] = RobotStatus.IDLE if mode == RobotMode.IDLE else RobotStatus.MOVING
        if mode != RobotMode.FOLLOW:
            a.leader[robot] = 0
        if mode not in (RobotMode.ROUTE, RobotMode.FOLLOW, RobotMode.TASK):
            self.followers[robot].end()
            self.trips.end(robot)

    def errand_stream(self, robot: int) -> np.random.Generator:
        """Random stream of a robot's errand under way."""
        return rng(self.seed, "errand", robot, int(self.arrays.errand[robot]))

    # Saved and restored.

    def state_arrays(self) -> dict[str, NDArray[Any]]:
        """Every number that decides the future, copied."""
        paths = [follower.path for follower in self.followers]
        found = {f"engine_{key}": value for key, value in self.engine.arrays().items()}
        found |= {name: value.copy() for name, value in vars(self.arrays).items()}
        found |= self.trips.state_arrays()
        found |= {f"memory_{k}": memory.copy() for k, memory in enumerate(self.memory)}
        for k, flight in enumerate(self.flights):
            if flight is not None:
                found |= {f"flight_{k}_{name}": value for name, value in flight.state_arrays().items()}
        for k, work in enumerate(self.work):
            if work is not None:
                found |= {f"work_{k}_{name}": value for name, value in work.state_arrays().items()}
        found |= {} if self.oracle is None else self.oracle.arrays()
        numbers = [follower.numbers() for follower in self.followers]
        return found | {
            "closed_ground": np.array(self.closed_ground, np.float64).reshape(-1, 3),
            "pending": np.array(self.pending, np.int64).reshape(-1, 2),
            "followers": np.array(numbers).reshape(len(self.followers), -1),
            "path_ends": np.cumsum([len(path) for path in paths], dtype=np.int64),
            "paths": np.concatenate([np.zeros((0, 2)), *paths]),
        }

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go back to what `state_arrays` returned.

        Raises
        ------
        SchemaError
            If it belongs to other robots.
        """
        mine: dict[str, NDArray[Any]] = dict(vars(self.arrays))
        mine |= {f"memory_{k}": memory for k, memory in enumerate(self.memory)}
        for name, value in mine.items():
            if name not in arrays or arrays[name].shape != value.shape:
                raise SchemaError("robots: the saved state belongs to other robots; start with the same ones")
        self.trips.restore(arrays)
        self._house_again()
        self.engine.restore({key[7:]: value for key, value in arrays.items() if key.startswith("engine_")})
        for name, value in mine.items():
            value[...] = arrays[name]
        for k, flight in enumerate(self.flights):
            if flight is not None:
                start = f"flight_{k}_"
                flight.restore({key[len(start) :]: value for key, value in arrays.items() if key.startswith(start)})
        for k, work in enumerate(self.work):
            if work is not None:
                start = f"work_{k}_"
                work.restore({key[len(start) :]: value for key, value in arrays.items() if key.startswith(start)})
        if self.oracle is not None:
            self.oracle.restore(arrays)
        self.closed_ground = tuple((x, y, radius) for x, y, radius in arrays["closed_ground"].tolist())
        self.pending = [(int(a), int(b)) for a, b in arrays["pending"]]
        starts = np.concatenate([[0], arrays["path_ends"]]).astype(int)
        for i, follower in enumerate(self.followers):
            follower.restore(arrays["paths"][starts[i] : starts[i + 1]], arrays["followers"][i])
        self.known_bodies = None

    def _house_again(self) -> None:
        """Have the robots be indoors that are so by their trips; their engines' states come after."""
        inside = np.flatnonzero(self.trips.room >= 0).tolist()
        if isinstance(self.engine, CompositeEngine):
            self.engine.inside.clear()
        for robot in inside:
            centre = np.array(self.scene.rooms.room(int(self.trips.room[robot])).centre)
            self.composite_engine().house(robot, self.scene.room_physics(robot), centre, np.array([*centre[:2], 0.0]))
        self.unhouse()
