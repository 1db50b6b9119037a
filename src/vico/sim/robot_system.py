"""What the rules of a simulation ask of its robots."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import ActionSpace
from vico.sim.bodies import Bodies, Subsystem
from vico.sim.carrying import DeckPose

if TYPE_CHECKING:
    from vico.sim.robots.hardware import Reading


class RobotNote(Protocol):
    """Something that happened to a robot."""

    @property
    def robot(self) -> int:
        """Its index."""

    @property
    def kind(self) -> str:
        """arrived, blocked, fallen, ..."""

    @property
    def position(self) -> NDArray[np.float64]:
        """Where, ENU metres."""


class RobotSystem(Subsystem, Protocol):
    """What the rules ask of robots, beside what the loop does. Robots are addressed by their index.

    Attributes
    ----------
    names
        Agents' names, ``robot_0`` and on.
    action_status
        How each robot's last action went, as `vico.rules.ActionStatus`, int8, shape ``(n,)``.
    reason, reason_code
        Why, in words ("" if it was done), shape ``(n,)``, and as `vico.rules.ReasonCode`, int16, shape ``(n,)``.
    """

    names: list[str]

    @property
    def action_status(self) -> NDArray[np.int8]:
        """How each robot's last action went."""

    @property
    def reason(self) -> NDArray[np.str_]:
        """Why, in words."""

    @property
    def reason_code(self) -> NDArray[np.int16]:
        """Why, as a code."""

    def begin(self, who: NDArray[np.bool_] | None = None) -> None:
        """Forget how the last actions went of the robots that act now; None: all of them."""

    def advance(self, dt: float, obstacles: Bodies, *, since: float = 0.0, substep: float | None = None) -> None:
        """Move on by `dt` seconds, a multiple of 0.01.

        Parameters
        ----------
        obstacles
            Everybody else's bodies, where they are at the end of the sub-step that this slice of time is part of.
        since
            Seconds of that sub-step that have passed already.
        substep
            Length of that sub-step, seconds; None if the slice is all of it.
        """

    def set_grip(self, grip: float) -> None:
        """Have robots grip the ground with a share of what they do on dry ground, 0..1; told before every sub-step."""

    def set_closed_ground(self, circles: tuple[tuple[float, float, float], ...]) -> None:
        """Have robots go round ground that events close: x, y and radius of circles, ENU metres."""

    def set_wind(self, east: float, north: float) -> None:
        """Have the mean wind 10 m above ground blow with so many m/s towards east and north; told like the grip."""

    def control_period(self, robot: int) -> float:
        """How often the robot's model wants to be controlled, seconds."""

    def action_spaces(self, robot: int) -> Mapping[str, ActionSpace]:
        """Return what the robot can be commanded by, by name; the first is its own."""

    def command(self, robot: int, vector: NDArray[np.float64], space: str = "") -> None:
        """Have the robot follow a vector of an action space ("": its own) until another command comes."""

    def has_way(self, robot: int, xy: NDArray[np.float64]) -> bool:
        """Return whether there is a way to a point that is wide enough for the robot."""

    def go_to(self, robot: int, xy: NDArray[np.float64], room: int = -1) -> bool:
        """Have the robot go to a point of a room (-1: outdoors); False if there is no way."""

    @property
    def rooms(self) -> NDArray[np.int32]:
        """The room each robot is in, -1 outdoors, int32, shape ``(n,)``."""

    def outdoor_bodies(self) -> Bodies:
        """Bodies of the robots that are outdoors."""

    def room_at(self, point: NDArray[np.float64]) -> int:
        """Return the room that a point lies in, ENU metres, -1 for none."""

    def trip_refusal(self, robot: int, room: int, point: NDArray[np.float64]) -> str:
        """Why a robot can't go to a point of a room (-1: outdoors), in words; "" if it can."""

    def trip_room(self, robot: int) -> int:
        """Return the room that a robot is going to, -1 outdoors, -2 for no trip."""

    def at_doors(self) -> list[tuple[int, int]]:
        """Return the robots that wait at doors, and the rooms behind those (-1: outdoors)."""

    def ride(self, robot: int, dt: float) -> float:
        """Have a robot ride on in a lift; return the seconds that it has."""

    def room_needed(self, robot: int) -> float:
        """Return how much room a robot needs around its middle, metres."""

    def pass_door(self, robot: int, room: int, taken: NDArray[np.float64]) -> bool:
        """Have a robot come through a door into a room (-1: outdoors); False if no spot there is clear of discs."""

    def give_up(self, robot: int) -> None:
        """Have a robot end its way before it is there."""

    def is_empty(self, robot: int) -> bool:
        """Return whether a robot's battery is empty."""

    def flies(self, robot: int) -> bool:
        """Return whether the robot flies."""

    def flight_refusal(self, robot: int, target: NDArray[np.float64]) -> str:
        """Why a robot that flies can't fly to a point, ENU metres; "" if it can."""

    def can_land(self, robot: int, xy: NDArray[np.float64] | None = None) -> bool:
        """Return whether a robot that flies can land at a point, or where it is."""

    def fly_to(self, robot: int, target: NDArray[np.float64]) -> None:
        """Have a robot fly to a point and hover there."""

    def land(self, robot: int, xy: NDArray[np.float64] | None = None) -> None:
        """Have a robot that flies land at a point, or where it is."""

    def has_arm(self, robot: int) -> bool:
        """Return whether the robot has an arm."""

    def in_hand(self, robot: int) -> int:
        """Return the entity of what the robot's hand holds; 0 for nothing."""

    def held_by_oracle(self, robot: int) -> int:
        """Return the entity of what the robot's hand holds by oracle grasp; 0 for nothing, and in runs without that."""

    def can_grasp(self, robot: int, size: NDArray[np.float64]) -> bool:
        """Return whether the robot's jaw is wide enough for a thing of some extents, metres."""

    def reach(self, robot: int, target: NDArray[np.float64]) -> None:
        """Have the robot bring its hand to a point."""

    def pick(self, robot: int, entity: int) -> None:
        """Have the robot pick a thing up."""

    def place(self, robot: int, target: NDArray[np.float64] | int) -> None:
        """Have the robot put down what it holds, at a point or on a deck."""

    def offer(self, robot: int, person: NDArray[np.float64]) -> None:
        """Have the robot hold out what it holds to a person at a point, until it is taken."""

    def follow_body(self, robot: int, entity: int) -> None:
        """Have the robot keep near a body, wherever that goes."""

    def stop(self, robot: int) -> None:
        """Have the robot stand still."""

    def sees(self, robot: int) -> bool:
        """Return whether the robot has a camera."""

    def readings(self, robot: int) -> Mapping[str, Reading]:
        """Return shape and bounds of what the robot's sensors give, by name."""

    def observation(self, robot: int) -> dict[str, NDArray[Any]]:
        """Return what the robot's sensors give, by name."""

    def cameras(self) -> NDArray[np.float64]:
        """Where each robot's camera is, ENU metres, and the unit vector it looks along, shape ``(n, 6)``."""

    def camera_heights(self) -> NDArray[np.float64]:
        """Height of each robot's camera above the ground it stands on, metres."""

    def base_poses(self) -> NDArray[np.float64]:
        """Return where the robots' bases are: x, y, z, quaternion w, x, y, z, float64, shape ``(n, 7)``."""

    def joint_positions(self) -> list[NDArray[np.float64]]:
        """Return the angles of each robot's joints, rad; as many as it has."""

    def physics_record(self) -> dict[str, Any]:
        """Return the engine, how many frames of either length there were and why, and what found no room in it."""

    def events(self) -> Sequence[RobotNote]:
        """Return what happened to robots since this was last asked."""

    def deck(self, entity: int) -> DeckPose | None:
        """Return the deck of the robot with this entity; None if it has none."""
