"""A camera that follows somebody: smoothly, and never from within a wall."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Annotated, Literal, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from vico.errors import InputError
from vico.geometry import distances
from vico.render.cameras import Cameras
from vico.render.frames import PictureRequest, take_pictures
from vico.render.scene import Scene
from vico.sim.bodies.state_arrays import Vehicle
from vico.viewer.targets import LEAP, Target
from vico.world.model import Record

View = Literal["behind", "front", "eyes", "above", "side", "orbit", "close"]
VIEWS: tuple[View, ...] = get_args(View)

# Where the camera is from what it looks at: metres back along the heading, degrees round it (0 is behind), degrees up,
# and so many in rooms: over clothes racks, counters and beds.
_PLACES = {
    "behind": (3.6, 0.0, 16.0, 40.0),
    "front": (4.0, 165.0, 5.0, 36.0),
    "side": (3.6, 80.0, 8.0, 40.0),
    "above": (15.0, 0.0, 62.0, 62.0),
    "orbit": (4.5, 0.0, 15.0, 38.0),
    "close": (2.6, 105.0, 18.0, 30.0),
}
_ORBIT = math.radians(14.0)  # a second
# How far back for those who ride, as a multiple.
_RIDING = {Vehicle.NONE: 1.0, Vehicle.BIKE: 1.3, Vehicle.BUS: 3.6}
_FOV, _EYES_FOV = math.radians(42.0), math.radians(60.0)
# Seconds in which the camera makes up for two thirds of a change.
_TURNS, _SHIFTS, _WIDENS, _NARROWS = 0.55, 0.12, 0.9, 0.12
_ASIDE = tuple(math.radians(k) for k in (0, 35, -35, 70, -70, 110, -110, 150, -150, 180))
_SWING = 1.0  # radians a second at most
_RIM = 0.25  # metres to whatever is behind the camera
# Who comes as near to the camera as the first makes it rise, metres; at the second it is so far above them.
_RISES, _RISEN, _ABOVE = 2.6, 1.2, 0.4
_LIFTS = 0.3  # seconds, as above
_NEAREST = 0.45


class Angle(Record):
    """From where something is looked at.

    Attributes
    ----------
    away
        Metres from it, whatever its size.
    around
        Degrees round it: 0 is behind, 90 to its right.
    up
        Degrees above the horizon.
    ahead_of
        Name of an agent: degrees round are counted as if what is followed looked away from it; else from where that
        looks. A thing in a hand is seen from beside the arm so, however it is turned.
    """

    away: Annotated[float, Field(ge=0.3, le=200.0)]
    around: float = 0.0
    up: Annotated[float, Field(ge=-20.0, le=89.0)] = 15.0
    ahead_of: str = ""


@dataclass
class FollowCamera:
    """Follows a target from frame to frame.

    Attributes
    ----------
    view
        One of `VIEWS`.
    width, height
        Of the pictures, pixels.
    angle
        From where it looks, if not as the view has it.
    """

    view: str
    width: int
    height: int
    angle: Angle | None = None
    _heading: float = 0.0
    _pitch: float = 0.0
    _focus: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    _distance: float = 0.0
    _angle: float = 0.0
    _aside: float = 0.0
    _lift: float = 0.0
    _place: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    _room: int = -2

    def __post_init__(self) -> None:
        if self.view not in VIEWS:
            raise InputError(f"view: {self.view!r}; it has to be one of {', '.join(VIEWS)}")

    def look(self, scene: Scene, target: Target, dt: float) -> Cameras:
        """Return the camera of the next frame, `dt` seconds after the last one."""
        focus = target.position + np.array([0.0, 0.0, target.eye if self.view == "eyes" else 0.82 * target.eye])
        # At first, and through a door, it is simply there.
        cut = self._room != target.room or float(np.linalg.norm(focus - self._focus)) > LEAP
        self._room = target.room
        if cut:
            self._heading, self._pitch, self._focus = target.yaw, target.pitch, focus
        else:
            turn = math.remainder(target.yaw - self._heading, 2 * math.pi)
            swing = _part(dt, 0.18 if self.view == "eyes" else _TURNS) * turn
            # From outside it swings round slowly: walls come near as fast as it turns towards them.
            self._heading += swing if self.view == "eyes" else float(np.clip(swing, -_SWING * dt, _SWING * dt))
            self._pitch += _part(dt, _TURNS) * (target.pitch - self._pitch)
            # On foot the eye is steady; aboard it goes with the vehicle.
            self._focus = self._focus + _part(dt, _SHIFTS if target.riding == Vehicle.NONE else 1e-6) * (
                focus - self._focus
            )
        if self.view == "eyes":
            across = math.cos(self._pitch)
            ahead = np.array(
                [math.cos(self._heading) * across, math.sin(self._heading) * across, math.sin(self._pitch)]
            )
            return self._cameras(self._focus, ahead, _EYES_FOV, target.entity)
        return self._from_outside(scene, target, dt, cut=cut)

    def _from_outside(self, scene: Scene, target: Target, dt: float, *, cut: bool) -> Cameras:
        wanted, around, up = self._place_from(target)
        if self.view == "orbit":
            self._angle += dt * _ORBIT
        turn = self._heading + math.pi + math.radians(around) + self._angle
        aside = self._roomiest(scene, turn, math.radians(up), wanted)
        self._aside = aside if cut else self._aside + _part(dt, _TURNS) * math.remainder(aside - self._aside, math.tau)
        back = _direction(turn + self._aside, math.radians(up))
        lift = self._over(target.others, self._focus + wanted * back if cut else self._place, wanted) - math.radians(up)
        self._lift = max(lift, 0.0) if cut else self._lift + _part(dt, _LIFTS) * (max(lift, 0.0) - self._lift)
        back = _direction(turn + self._aside, math.radians(up) + self._lift)
        free = max(min(wanted, self._free(scene, back, wanted)), _NEAREST)
        if cut:
            self._distance = free
        else:
            self._distance += _part(dt, _NARROWS if free < self._distance else _WIDENS) * (free - self._distance)
            self._distance = min(self._distance, max(free, _NEAREST))
        place = self._place = self._focus + self._distance * back
        # Near a wall, it looks over the shoulder.
        near = max(0.0, 1.0 - self._distance / 1.5)
        ahead = -back * (1.0 - near) + near * np.array([math.cos(self._heading), math.sin(self._heading), -0.1])
        hidden = target.entity if self._distance < min(0.7, target.size) else 0
        return self._cameras(place, ahead, _FOV, hidden)

    def _place_from(self, target: Target) -> tuple[float, float, float]:
        """Return how far away from what it follows the camera would like to be, metres, and where, degrees."""
        if self.angle is not None:
            return self.angle.away, self.angle.around, self.angle.up
        away, around, outdoors, indoors = _PLACES[self.view]
        size = _RIDING[Vehicle(target.riding)] * float(np.clip(target.size / 1.75, 0.5, 4.0))
        return away * size, around, indoors if target.room >= 0 else outdoors

    def _over(self, others: NDArray[np.float64] | None, place: NDArray[np.float64], wanted: float) -> float:
        """Return how steeply the camera has to look down, radians, to be above those who come near it."""
        if others is None or not len(others):
            return 0.0
        away = distances(others[:, :2], place[:2])
        share = np.clip((_RISES - away) / (_RISES - _RISEN), 0.0, 1.0)
        height = float((share * (others[:, 2] + _ABOVE - self._focus[2])).max())
        return math.asin(min(max(height / wanted, 0.0), 0.9))

    def _roomiest(self, scene: Scene, turn: float, rise: float, wanted: float) -> float:
        """Return how far to the side of where it would like to be the camera has some room: not at all, if it has."""
        enough = min(0.45 * wanted, 1.7)
        straight = self._free(scene, _direction(turn, rise), wanted)
        # It goes back only where there is plenty of room, and else stays where it is as long as that will do.
        if straight >= (enough if abs(self._aside) < 0.02 else 1.6 * enough):
            return 0.0
        if abs(self._aside) >= 0.02 and self._free(scene, _direction(turn + self._aside, rise), wanted) >= enough:
            return self._aside
        found = {s: self._free(scene, _direction(turn + s, rise), wanted) for s in _ASIDE}
        return max(_ASIDE, key=lambda s: min(found[s], 2.0 * enough) - 0.25 * enough * abs(s))

    def _free(self, scene: Scene, back: NDArray[np.float64], wanted: float) -> float:
        """Return how far one can go back from the focus before anything that never moves, metres."""
        cone = Cameras(self._focus[None], back[None], fov_y=math.radians(24.0), width=24, height=24, far=wanted + 5.0)
        request = PictureRequest(rgb=False, segmentation=False, moving=False)
        depth = take_pictures(scene, cone, request, threads=1).depth[0]
        seen = depth[depth > 0]
        return float(seen.min()) - _RIM if len(seen) else wanted

    def _cameras(self, place: NDArray[np.float64], ahead: NDArray[np.float64], fov: float, hidden: int) -> Cameras:
        return Cameras(
            place[None], ahead[None], fov_y=fov, width=self.width, height=self.height, near=0.1, hidden_entity=hidden
        )


def _direction(turn: float, rise: float) -> NDArray[np.float64]:
    return np.array([math.cos(turn) * math.cos(rise), math.sin(turn) * math.cos(rise), math.sin(rise)])


def _part(dt: float, constant: float) -> float:
    """Return the share of a change that is made up for in `dt` seconds."""
    return 1.0 - math.exp(-dt / constant)
