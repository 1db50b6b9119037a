"""Where bodies, eyes and hands go: standing somebody indoors or outdoors, and moving along what they carry."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.sim.animation.seated import seat_height
from vico.sim.avatars import CLIP, free_ground
from vico.sim.carrying import carry_along
from vico.sim.indoor import BESIDE
from vico.sim.simulation_state import SimulationState
from vico.sim.state import LEVEL_GAZE, Posture

# Who gets up outdoors finds a place to stand within so many metres of the bench's front.
_STEP_ASIDE = 1.5


# Where the eyes are by stature, metres and shares of it.
_STATURES, _EYES = (1.1, 1.28, 1.45, 1.62), (0.905, 0.915, 0.923, 0.93)


def wrapped(angle: float) -> float:
    """Return the same direction within -pi..pi."""
    return (angle + math.pi) % (2 * math.pi) - math.pi


def eye_height(state: SimulationState) -> NDArray[np.float64]:
    """Height of everyone's eyes above the ground, metres, shape ``(n,)``."""
    p = state.people
    # Children's heads are large: their eyes are lower down.
    upright = np.interp(p.height, _STATURES, _EYES)
    share = np.select([p.posture == Posture.SITTING, p.posture == Posture.LYING], [0.68, 0.13], upright)
    return np.asarray(p.height * share)


#: Whoever is in a room when a run starts stands so far from others, where there is room, metres.
PERSONAL = 1.0


def place_in_room(i: int, room: int, state: SimulationState, *, near: NDArray[Any] | None = None) -> None:
    """Put someone into a room, a step in from its door (or near a point of it), looking into the room.

    Whoever comes in by a door to others there stands beside them; without a point, `PERSONAL` metres away.
    """
    p, indoor = state.people, state.indoor
    record = indoor.rooms[room]
    anchor = np.asarray(record.inside if near is None else near, np.float64)
    taken = state.taken_in(room, without=i)
    spot = indoor.free_spot(room, anchor, taken, apart=PERSONAL if near is None else BESIDE)
    assert spot is not None
    p.position[i] = spot
    p.door[i], p.passing[i] = -1, 0
    p.room[i] = room
    p.place[i] = indoor.place[room]
    # From the door into the room: that is where people look when they come in.
    door = next((d.position for d in indoor.doors[room] if d.inside is not None and _same(d.inside, anchor)), None)
    ahead = record.centre if door is None else (float(anchor[0]), float(anchor[1]))
    behind = record.door if door is None else door
    p.yaw[i] = math.atan2(ahead[1] - behind[1], ahead[0] - behind[0])
    p.pitch[i] = LEVEL_GAZE
    follow_hands(state)


def _same(point: tuple[float, float, float], other: NDArray[np.float64]) -> bool:
    return math.hypot(point[0] - float(other[0]), point[1] - float(other[1])) < 1e-6


def spot_outside(i: int, state: SimulationState) -> NDArray[np.float64] | None:
    """Free ground before the door of the place someone is in; None if it is crowded."""
    place = state.world.places[int(state.people.place[i])]
    if place.entrance is None:
        return None
    door = state.entrances[place.entrance]
    return free_ground(state.world.walkable, np.asarray(door.approach), state.obstacles(), within=3.0)


def put_outdoors(i: int, spot: NDArray[np.float64], yaw: float, state: SimulationState) -> None:
    """Stand someone on the ground outdoors."""
    p = state.people
    p.room[i] = p.place[i] = p.seat[i] = p.door[i] = -1
    p.passing[i] = 0
    p.posture[i] = Posture.STANDING
    p.moved[i] = 0.0
    p.position[i, :2] = spot
    p.yaw[i] = wrapped(yaw)
    p.pitch[i] = LEVEL_GAZE
    state.avatars.settle(np.array([i]))
    follow_hands(state)


def take_seat(i: int, seat: int, state: SimulationState) -> None:
    """Have someone sit down on a seat, or lie down on a bed, that is free."""
    p, seats = state.people, state.seats
    was = _frame(i, state)
    x, y, z = seats.position[seat]
    lies = bool(seats.lies[seat])
    p.seat[i] = seat
    p.posture[i] = Posture.LYING if lies else Posture.SITTING
    p.position[i] = x, y, z if lies else z - float(seat_height(p.height[i]))
    p.yaw[i] = wrapped(float(seats.yaw[seat]))
    p.pitch[i] = LEVEL_GAZE
    _note_move(i, was, state)


def spot_beside_seat(i: int, state: SimulationState) -> NDArray[np.float64] | None:
    """Where someone who sits or lies would stand who gets up, ENU metres, shape ``(3,)``; None if there is no room."""
    p, seats = state.people, state.seats
    seat, room = int(p.seat[i]), int(p.room[i])
    if seat < 0:
        return p.position[i].copy()
    if room < 0:
        free = free_ground(state.world.walkable, seats.before(seat), state.obstacles_to(i), within=_STEP_ASIDE)
        return None if free is None else np.array([*free, float(state.world.height(free))])
    spot = seats.spot_beside(seat, state.indoor, state.taken_in(room, without=i))
    if spot is None or math.hypot(*(spot - seats.position[seat])[:2]) > seats.farthest(seat):
        return None
    return spot


def get_up(i: int, spot: NDArray[np.float64], state: SimulationState) -> None:
    """Have someone get up and stand at a spot, as `spot_beside_seat` finds it."""
    p = state.people
    was = _frame(i, state)
    p.posture[i], p.seat[i] = Posture.STANDING, -1
    p.position[i], p.yaw[i] = spot, wrapped(was[3])
    _note_move(i, was, state)


def _frame(i: int, state: SimulationState) -> tuple[float, float, float, float]:
    """Return where a body is drawn: x, y, z and heading; who sits looks about without turning on the seat."""
    p = state.people
    x, y, z = p.position[i].tolist()
    return x, y, z, float(p.yaw[i]) if p.seat[i] < 0 else float(state.seats.yaw[p.seat[i]])


def _note_move(i: int, was: tuple[float, float, float, float], state: SimulationState) -> None:
    """Note where a body was, in the frame it is in now."""
    x, y, z, yaw = _frame(i, state)
    dx, dy = was[0] - x, was[1] - y
    c, s = math.cos(yaw), math.sin(yaw)
    state.people.moved[i] = c * dx + s * dy, c * dy - s * dx, was[2] - z, wrapped(was[3] - yaw)
    follow_hands(state)


def gesture(clip: str, i: int, state: SimulationState, *, hand: int = 1) -> None:
    """Show a motion while standing or sitting, made with the left (0) or the right hand."""
    state.people.action_clip[i] = CLIP[clip]
    state.people.gesture_hand[i] = hand


def follow_hands(state: SimulationState) -> None:
    """Move what is carried along: beside the hip, left or right, of people; in its place on whatever has a deck."""
    objects, p = state.objects, state.people
    carry_along(objects, state.carriers())
    for k in np.flatnonzero(objects.hand >= 0):
        i = int(np.flatnonzero(p.entity == objects.holder[k])[0])
        side = 0.3 if objects.hand[k] == 0 else -0.3
        c, s = math.cos(p.yaw[i]), math.sin(p.yaw[i])
        height = p.position[i, 2] + 0.45 * p.height[i] - objects.size[k, 2]
        objects.position[k] = (
            p.position[i, 0] + 0.12 * c - side * s,
            p.position[i, 1] + 0.12 * s + side * c,
            max(height, p.position[i, 2]),
        )
        objects.set_yaw(int(k), float(p.yaw[i]))
        objects.room[k] = p.room[i]
