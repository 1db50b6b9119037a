"""State of all avatars and movable objects, as arrays addressed by stable indices, and the ranges of entity numbers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from enum import IntEnum
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from vico.errors import SchemaError
from vico.exact import apply_matrix, each
from vico.geometry import quaternion_from_matrix, rotation_matrix, yaw_quaternion
from vico.sim.animation import LONGEST_BLEND
from vico.sim.bodies.arrays import OBJECT, Bodies

# Entity numbers of what lives in a run; a world's own numbers all lie below.
FIRST_RESIDENT = 1_000_000
FIRST_ASSISTANT = 1_010_000
FIRST_ROBOT = 1_020_000
FIRST_TRAFFIC = 1_100_000
FIRST_BIKE = 1_200_000
FIRST_TRAM = 1_250_000
# Umbrellas, one for each person: by the person's place among the agents, and among the pedestrians.
FIRST_UMBRELLA = 1_260_000
FIRST_PEDESTRIAN_UMBRELLA = 1_280_000
FIRST_THING = 1_300_000
FIRST_OBJECT = 1_900_000

RADIUS = 0.25
# Who is less tall is narrower, metres.
_NARROWER_BELOW = 1.5
# People look a little down while they walk, radians.
LEVEL_GAZE = -0.1
REASON_LENGTH = 240
#: Things stay on others with their middle so far inside the edge; heights that are one, metres.
ON_TOP = 0.01
#: Cosine of the tilt up to which the top of a thing is level.
UPRIGHT = 0.999
#: From the hand on a door until it is open, seconds.
DOOR_OPENING = 0.85


class Vehicle(IntEnum):
    """What an avatar rides on."""

    NONE = 0
    BUS = 1
    BIKE = 2


# By number: looking an enumeration's member up, and comparing arrays with it, costs more than the comparison.
_IN_BUS, _ON_BIKE = int(Vehicle.BUS), int(Vehicle.BIKE)


class Posture(IntEnum):
    """How an avatar holds itself while nothing else is going on."""

    STANDING = 0
    SITTING = 1
    LYING = 2


class ArrayState:
    """Arrays that are hashed, saved and restored together; subclasses are dataclasses of arrays."""

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Every array field by name, in the order of declaration."""
        found = {}
        for field in fields(self):  # type: ignore[arg-type]
            value = getattr(self, field.name)
            if isinstance(value, np.ndarray):
                found[field.name] = value
        return found

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Write saved arrays back; they must be the ones `arrays` names.

        Raises
        ------
        SchemaError
            If an array is missing or of another shape: the snapshot belongs to another configuration.
        """
        for name, mine in self.arrays().items():
            saved = arrays.get(name)
            if saved is None or saved.shape != mine.shape:
                raise SchemaError(
                    f"snapshot: {type(self).__name__}.{name} is "
                    f"{'missing' if saved is None else f'{saved.shape}, not {mine.shape}'}; "
                    "restore it into a simulation of the same world, community and configuration"
                )
            mine[...] = saved


def body_radius(height: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return half the width that people of these statures take beside others, metres: children less than `RADIUS`."""
    return np.asarray(RADIUS * np.minimum(height / _NARROWER_BELOW, 1.0))


@dataclass
class People(ArrayState):
    """Avatars: residents first, then assistants. Row ``i`` of every array is the agent ``names[i]``.

    Attributes
    ----------
    names
        Names of the agents, ``resident_0`` and on.
    entity
        Entity numbers, int32, shape ``(n,)``.
    kind
        Index into `vico.sim.bodies.arrays.KINDS`, int8, shape ``(n,)``.
    height
        Body height, metres, float64, shape ``(n,)``.
    position
        Centre of the feet, ENU metres, float64, shape ``(n, 3)``.
    yaw, pitch
        Direction of the gaze, radians: counter-clockwise from east, and up from the horizon; float64, shape ``(n,)``.
        The body turns with the yaw only.
    velocity
        Over the ground in the last sub-step, ENU metres a second, float64, shape ``(n, 2)``.
    move_left, move_speed
        Metres still to walk in this step, and metres a second, float64, shape ``(n,)``.
    turn_left
        Radians still to turn in this step, counter-clockwise positive, float64, shape ``(n,)``.
    clip, phase
        Index into `vico.sim.animation.CLIPS`, int16, and the position in that clip, cycles 0..1, float64; shape
        ``(n,)``.
    pace
        Speed that the strides of the clip are those of, metres a second, float64, shape ``(n,)``.
    clip_before, phase_before, pace_before
        The clip before the present one, where it ended and its pace, as those; shape ``(n,)``. Another pace of a gait
        counts as another clip.
    clip_time
        Seconds since the clip began, counted up to `vico.sim.animation.LONGEST_BLEND`, float64, shape ``(n,)``.
    action_clip
        Clip that the last action asked for, -1 for none, int16, shape ``(n,)``: it outlasts the motion until the next
        action.
    posture
        A `Posture`, int8, shape ``(n,)``.
    seat
        Index of the place one sits or lies on (`vico.sim.bodies.seats.Seats`), -1 for none, int32, shape ``(n,)``.
    moved
        Where the body was when it last sat down, lay down or got up, in its frame of now: x, y, z, metres, and yaw,
        radians, float64, shape ``(n, 4)``.
    room, place
        Index of the room and place the avatar is in, -1 outdoors, int32, shape ``(n,)``.
    lift_room, lift_left
        Room that the lift one rides goes to, int32, and seconds until it is there, 0 for who rides none, float64; shape
        ``(n,)``.
    door, door_time
        Index of the place whose door one goes through, -1 for none, int32, and the seconds since one laid a hand on it,
        negative on the way there, float64; shape ``(n,)``. See `vico.sim.people.doors`.
    passing, door_spot
        Which way one walks through an open door, 1 in, -1 out, else 0, int8, shape ``(n,)``, and where one who goes out
        is going to, ENU metres, float64, shape ``(n, 2)``.
    vehicle, vehicle_entity
        A `Vehicle`, int8, and the entity number of the one ridden (0 for none), int32; shape ``(n,)``.
    vehicle_yaw
        Heading of the bus at the last sub-step, radians, float64, shape ``(n,)``.
    gesture_hand
        Hand that the last action was made with, 0 left, 1 right, int8, shape ``(n,)``.
    hold, hold_share
        What the arms hold up beside the motion, a `vico.sim.animation.Hold`, int8, and how far they have come to it,
        0..1, float64; shape ``(n,)``.
    umbrella, umbrella_habit
        Whether one has an umbrella along, bool, and how little one minds rain, 0..1, float64; shape ``(n,)``.
    clothes
        Weather that one has dressed for: degrees Celsius, rain and snow in mm/h, float64, shape ``(n, 3)``.
    held
        Entities in the left and right hand, 0 for none, int32, shape ``(n, 2)``.
    cash
        Money left, float64, shape ``(n,)``; never negative.
    owed
        What rides cost beyond the money there was, float64, shape ``(n,)``.
    status
        A `vico.rules.ActionStatus`: how the last action went, int8, shape ``(n,)``.
    contact
        Entity that stopped the last motion; -1 for a wall, the map's edge or furniture, 0 for nothing; int32, shape
        ``(n,)``.
    reason, reason_code
        Why the last action was stopped, refused, late or failed: in words ("" if it was not), and as a
        `vico.rules.ReasonCode`, int16; shape ``(n,)``.
    """

    names: list[str]
    entity: NDArray[np.int32]
    kind: NDArray[np.int8]
    height: NDArray[np.float64]
    position: NDArray[np.float64]
    yaw: NDArray[np.float64]
    pitch: NDArray[np.float64]
    velocity: NDArray[np.float64]
    move_left: NDArray[np.float64]
    move_speed: NDArray[np.float64]
    turn_left: NDArray[np.float64]
    clip: NDArray[np.int16]
    phase: NDArray[np.float64]
    pace: NDArray[np.float64]
    clip_before: NDArray[np.int16]
    phase_before: NDArray[np.float64]
    pace_before: NDArray[np.float64]
    clip_time: NDArray[np.float64]
    action_clip: NDArray[np.int16]
    posture: NDArray[np.int8]
    seat: NDArray[np.int32]
    moved: NDArray[np.float64]
    room: NDArray[np.int32]
    place: NDArray[np.int32]
    lift_room: NDArray[np.int32]
    lift_left: NDArray[np.float64]
    door: NDArray[np.int32]
    door_time: NDArray[np.float64]
    passing: NDArray[np.int8]
    door_spot: NDArray[np.float64]
    vehicle: NDArray[np.int8]
    vehicle_entity: NDArray[np.int32]
    vehicle_yaw: NDArray[np.float64]
    gesture_hand: NDArray[np.int8]
    hold: NDArray[np.int8]
    hold_share: NDArray[np.float64]
    umbrella: NDArray[np.bool_]
    umbrella_habit: NDArray[np.float64]
    clothes: NDArray[np.float64]
    held: NDArray[np.int32]
    cash: NDArray[np.float64]
    owed: NDArray[np.float64]
    status: NDArray[np.int8]
    contact: NDArray[np.int32]
    reason: NDArray[np.str_]
    reason_code: NDArray[np.int16]

    @classmethod
    def standing(cls, names: list[str], kinds: list[int], entities: list[int]) -> Self:
        """Avatars at the origin, outdoors, with empty hands."""
        n = len(names)
        return cls(
            names=names,
            entity=np.array(entities, np.int32),
            kind=np.array(kinds, np.int8),
            height=np.full(n, 1.7),
            position=np.zeros((n, 3)),
            yaw=np.zeros(n),
            pitch=np.full(n, LEVEL_GAZE),
            velocity=np.zeros((n, 2)),
            move_left=np.zeros(n),
            move_speed=np.zeros(n),
            turn_left=np.zeros(n),
            clip=np.zeros(n, np.int16),
            phase=np.zeros(n),
            pace=np.zeros(n),
            clip_before=np.zeros(n, np.int16),
            phase_before=np.zeros(n),
            pace_before=np.zeros(n),
            clip_time=np.full(n, LONGEST_BLEND),
            action_clip=np.full(n, -1, np.int16),
            posture=np.zeros(n, np.int8),
            seat=np.full(n, -1, np.int32),
            moved=np.zeros((n, 4)),
            room=np.full(n, -1, np.int32),
            place=np.full(n, -1, np.int32),
            lift_room=np.full(n, -1, np.int32),
            lift_left=np.zeros(n),
            door=np.full(n, -1, np.int32),
            door_time=np.zeros(n),
            passing=np.zeros(n, np.int8),
            door_spot=np.zeros((n, 2)),
            vehicle=np.zeros(n, np.int8),
            vehicle_entity=np.zeros(n, np.int32),
            vehicle_yaw=np.zeros(n),
            gesture_hand=np.ones(n, np.int8),
            hold=np.zeros(n, np.int8),
            hold_share=np.zeros(n),
            umbrella=np.zeros(n, np.bool_),
            umbrella_habit=np.ones(n),
            clothes=np.zeros((n, 3)),
            held=np.zeros((n, 2), np.int32),
            cash=np.zeros(n),
            owed=np.zeros(n),
            status=np.zeros(n, np.int8),
            contact=np.zeros(n, np.int32),
            reason=np.full(n, "", f"<U{REASON_LENGTH}"),
            reason_code=np.zeros(n, np.int16),
        )

    def __len__(self) -> int:
        return len(self.names)

    def at_door(self) -> NDArray[np.bool_]:
        """Who is on the way through a door of a house, and not through it yet."""
        return np.asarray(self.door >= 0)

    def outdoors(self) -> NDArray[np.bool_]:
        """Who stands or rides in the street on their own feet or bicycle (not in a room, not in a bus)."""
        return np.asarray((self.room < 0) & (self.vehicle != _IN_BUS))

    def bodies(self) -> Bodies:
        """Those outdoors: what traffic, transit and robots have to keep clear of."""
        return self.bodies_of(self.outdoors().nonzero()[0])

    def bodies_of(self, who: NDArray[np.int64] | slice) -> Bodies:
        """Bodies of the avatars with the given indices; a cyclist's is as long as the bicycle, see `Bodies`."""
        riding = self.vehicle[who] == _ON_BIKE
        radius = body_radius(self.height[who])
        return Bodies(
            self.entity[who],
            self.kind[who],
            self.position[who],
            self.yaw[who],
            np.where(riding, RIDER_REACH + radius, radius),
            radius,
            self.height[who],
            self.velocity[who],
        )


#: Half the line that a cyclist's body is drawn around, metres: from the saddle to either end of the bicycle's core.
RIDER_REACH = 0.6


@dataclass
class MovableObjects(ArrayState):
    """Movable objects: things that people carry. Row ``k`` of every array is the object ``names[k]``.

    Attributes
    ----------
    names
        What agents see them called.
    prototypes
        Name of the shape each is drawn with.
    entity
        Entity numbers, int32, shape ``(m,)``.
    position
        Centre of the bottom, ENU metres, float64, shape ``(m, 3)``; follows the hand while held.
    orientation
        Turn from how it stands at rest, quaternion w, x, y, z, float64, shape ``(m, 4)``.
    holder
        Entity of who or what carries it (an avatar, or whatever has a deck), 0 for nobody, int32, shape ``(m,)``.
    offset
        Where it lies in the frame of what carries it on a deck, metres, float64, shape ``(m, 3)``.
    hand
        0 left, 1 right, -1 if not in a hand, int8, shape ``(m,)``.
    room
        Index of the room it lies in, -1 outdoors, int32, shape ``(m,)``.
    size
        Extents of its box, metres, float64, shape ``(m, 3)``.
    """

    names: list[str]
    prototypes: list[str]
    entity: NDArray[np.int32]
    position: NDArray[np.float64]
    orientation: NDArray[np.float64]
    holder: NDArray[np.int32]
    offset: NDArray[np.float64]
    hand: NDArray[np.int8]
    room: NDArray[np.int32]
    size: NDArray[np.float64]

    @classmethod
    def none(cls) -> Self:
        """No objects."""
        return cls(
            [],
            [],
            np.zeros(0, np.int32),
            np.zeros((0, 3)),
            np.zeros((0, 4)),
            np.zeros(0, np.int32),
            np.zeros((0, 3)),
            np.zeros(0, np.int8),
            np.zeros(0, np.int32),
            np.zeros((0, 3)),
        )

    def __len__(self) -> int:
        return len(self.names)

    @property
    def yaw(self) -> NDArray[np.float64]:
        """Heading of each, counter-clockwise from east, radians, shape ``(m,)``; not to be written to."""
        w, x, y, z = self.orientation.T
        yaw = each(math.atan2, 2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        yaw.flags.writeable = False
        return yaw

    def set_yaw(self, k: int, yaw: float) -> None:
        """Stand an object upright, heading `yaw` radians counter-clockwise from east."""
        self.orientation[k] = yaw_quaternion(yaw)

    def rotation(self, k: int) -> NDArray[np.float64]:
        """Object to world, shape ``(3, 3)``."""
        return rotation_matrix(self.orientation[k])

    def set_rotation(self, k: int, rotation: NDArray[np.float64]) -> None:
        """Turn an object; `rotation` is object to world, shape ``(3, 3)``."""
        self.orientation[k] = quaternion_from_matrix(rotation)

    def bodies(self) -> Bodies:
        """Those that lie outdoors: what people carry, or what lies on a robot, is part of whoever carries it."""
        return self.bodies_of(((self.holder == 0) & (self.room < 0)).nonzero()[0])

    def bodies_of(self, which: NDArray[np.int64]) -> Bodies:
        """Bodies of the objects with the given indices: their boxes, or what is around them where they lie tilted."""
        if not len(which):
            return Bodies.none()
        n, half = len(which), self.size[which] / 2
        turn, yaw = rotation_matrix(self.orientation[which]), self.yaw[which]
        middle = self.position[which] + turn[:, :, 2] * half[:, 2:]
        c, s = np.cos(yaw)[:, None], np.sin(yaw)[:, None]
        along, across = c * turn[:, 0] + s * turn[:, 1], c * turn[:, 1] - s * turn[:, 0]
        length, width, height = ((np.abs(axis) * half).sum(axis=1) for axis in (along, across, turn[:, 2]))
        return Bodies(
            self.entity[which],
            np.full(n, OBJECT, np.int8),
            middle - np.column_stack([np.zeros((n, 2)), height]),
            yaw,
            length,
            width,
            2 * height,
            np.zeros((n, 2)),
        )

    def tops_under(self, xy: tuple[float, float], room: int) -> list[tuple[float, int]]:
        """Return heights of the tops of upright things below or above a point, and their indices, the lowest first."""
        found = []
        away = np.abs(self.position[:, :2] - xy).max(axis=1)
        near = away < np.hypot(self.size[:, 0], self.size[:, 1])
        for k in np.flatnonzero(near & (self.holder == 0) & (self.room == room)).tolist():
            turn = self.rotation(k)
            inside = np.abs(apply_matrix(xy - self.position[k, :2], turn[:2, :2].T)) <= self.size[k, :2] / 2 - ON_TOP
            if turn[2, 2] > UPRIGHT and inside.all():
                found.append((float(self.position[k, 2] + self.size[k, 2]), k))
        return sorted(found)

    def support_of(self, k: int) -> int:
        """Return the index of the thing that a thing lies on with its middle, -1 for none: ground, floor, furniture."""
        x, y, z = self.position[k].tolist()
        if not np.any(np.abs(self.position[:, 2] + self.size[:, 2] - z) < ON_TOP):
            return -1
        below = [j for top, j in self.tops_under((x, y), int(self.room[k])) if j != k and abs(top - z) < ON_TOP]
        return below[-1] if below else -1

    def in_rooms(self) -> NDArray[np.int64]:
        """Return the indices of those that lie in rooms, on the floor or on furniture."""
        return ((self.holder == 0) & (self.room >= 0)).nonzero()[0]

    def index(self, entity: int) -> int:
        """Index of an entity, -1 if it is none of the objects."""
        found = np.flatnonzero(self.entity == entity)
        return int(found[0]) if len(found) else -1

    def add(
        self, name: str, prototype: str, position: NDArray[np.float64], room: int, size: NDArray[np.float64], yaw: float
    ) -> int:
        """Add one object that lies somewhere; return its entity number."""
        entity = FIRST_OBJECT + len(self)
        self.names.append(name)
        self.prototypes.append(prototype)
        self.entity = np.append(self.entity, np.int32(entity))
        self.position = np.vstack([self.position, position])
        self.orientation = np.vstack([self.orientation, yaw_quaternion(yaw)])
        self.holder = np.append(self.holder, np.int32(0))
        self.offset = np.vstack([self.offset, np.zeros(3)])
        self.hand = np.append(self.hand, np.int8(-1))
        self.room = np.append(self.room, np.int32(room))
        self.size = np.vstack([self.size, size])
        return entity
