"""Motions, doors and postures: what allowed actions do to the body."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.sim.avatars import CLIP, free_ground
from vico.sim.stage import Stage
from vico.sim.state import LEVEL_GAZE, Posture

# Eyes turn up and down this far, radians.
_STEEPEST = math.radians(60.0)


def move_forward(values: Mapping[str, Any], i: int, stage: Stage) -> None:
    """Walk straight ahead over the coming second."""
    p = stage.people
    p.move_left[i] = values["distance"]
    p.move_speed[i] = values["distance"]
    p.pitch[i] = LEVEL_GAZE


def turn(degrees: float, i: int, stage: Stage) -> None:
    """Turn over the coming second; positive is to the left."""
    stage.people.turn_left[i] = math.radians(degrees)
    stage.people.pitch[i] = LEVEL_GAZE


def look_at(values: Mapping[str, Any], i: int, stage: Stage) -> None:
    """Turn towards a point, the shorter way, and look up or down at it."""
    p = stage.people
    x, y, z = values["target"]
    dx, dy = x - p.position[i, 0], y - p.position[i, 1]
    p.turn_left[i] = wrapped(math.atan2(dy, dx) - p.yaw[i])
    eyes = eye_height(stage)[i] + p.position[i, 2]
    p.pitch[i] = min(_STEEPEST, max(-_STEEPEST, math.atan2(z - eyes, math.hypot(dx, dy))))


def wrapped(angle: float) -> float:
    """The same direction within -pi..pi."""
    return (angle + math.pi) % (2 * math.pi) - math.pi


def eye_height(stage: Stage) -> NDArray[np.float64]:
    """Height of everyone's eyes above the ground, metres, shape ``(n,)``."""
    p = stage.people
    share = np.select([p.posture == Posture.SITTING, p.posture == Posture.LYING], [0.68, 0.35], 0.93)
    return np.asarray(p.height * share)


def enter(values: Mapping[str, Any], i: int, stage: Stage) -> None:
    """Go through an entrance, or through the door to the next room."""
    p, indoor = stage.people, stage.indoor
    outdoors = p.room[i] < 0
    if outdoors:
        place = stage.place(values["place"])
        assert place is not None
        room = indoor.index[place.rooms[0]]
        name = place.name
    else:
        room = indoor.index[values["place"]]
        name = indoor.rooms[room].kind
    place_in_room(i, room, stage, near=indoor.arrival(room, -1 if outdoors else int(p.room[i])))
    if outdoors:
        stage.events.add("enter", p.names[i], f"enters {name}", p.position[i], place=values["place"])


def place_in_room(i: int, room: int, stage: Stage, *, near: NDArray[Any] | None = None) -> None:
    """Put someone into a room, a step in from its door (or near a point of it), looking into the room."""
    p, indoor = stage.people, stage.indoor
    record = indoor.rooms[room]
    anchor = np.asarray(record.inside if near is None else near, np.float64)
    spot = indoor.free_spot(room, anchor, stage.people_in(room, without=i))
    assert spot is not None
    p.position[i] = spot
    p.room[i] = room
    p.place[i] = indoor.place[room]
    # From the door into the room: that is where people look when they come in.
    door = next((d.position for d in indoor.doors[room] if d.inside is not None and _same(d.inside, anchor)), None)
    ahead = record.centre if door is None else (float(anchor[0]), float(anchor[1]))
    behind = record.door if door is None else door
    p.yaw[i] = math.atan2(ahead[1] - behind[1], ahead[0] - behind[0])
    p.pitch[i] = LEVEL_GAZE
    follow_hands(stage)


def _same(point: tuple[float, float, float], other: NDArray[np.float64]) -> bool:
    return math.hypot(point[0] - float(other[0]), point[1] - float(other[1])) < 1e-6


def spot_outside(i: int, stage: Stage) -> NDArray[np.float64] | None:
    """Free ground before the door of the place someone is in; None if it is crowded."""
    place = stage.world.places[int(stage.people.place[i])]
    if place.entrance is None:
        return None
    door = stage.entrances[place.entrance]
    return free_ground(stage.world.walkable, np.asarray(door.approach), stage.obstacles(), within=3.0)


def leave(i: int, stage: Stage) -> None:
    """Go out of the building, and look away from it."""
    p = stage.people
    place = stage.world.places[int(p.place[i])]
    spot = spot_outside(i, stage)
    assert spot is not None
    assert place.entrance is not None
    put_outdoors(i, spot, stage.entrances[place.entrance].facing, stage)
    stage.events.add("exit", p.names[i], f"leaves {place.name}", p.position[i], place=place.id)


def put_outdoors(i: int, spot: NDArray[np.float64], yaw: float, stage: Stage) -> None:
    """Stand someone on the ground outdoors."""
    p = stage.people
    p.room[i] = p.place[i] = -1
    p.position[i, :2] = spot
    p.yaw[i] = wrapped(yaw)
    p.pitch[i] = LEVEL_GAZE
    stage.avatars.settle(np.array([i]))
    follow_hands(stage)


def settle_posture(posture: Posture, i: int, stage: Stage) -> None:
    """Sit, lie or stand."""
    stage.people.posture[i] = posture


def gesture(clip: str, i: int, stage: Stage) -> None:
    """Show a motion while standing or sitting."""
    stage.people.action_clip[i] = CLIP[clip]


def follow_hands(stage: Stage) -> None:
    """Move what people carry along with them: beside the hip, left or right."""
    goods, p = stage.goods, stage.people
    for k in np.flatnonzero(goods.hand >= 0):
        i = int(np.flatnonzero(p.entity == goods.holder[k])[0])
        side = 0.3 if goods.hand[k] == 0 else -0.3
        c, s = math.cos(p.yaw[i]), math.sin(p.yaw[i])
        height = p.position[i, 2] + 0.45 * p.height[i] - goods.size[k, 2]
        goods.position[k] = (
            p.position[i, 0] + 0.12 * c - side * s,
            p.position[i, 1] + 0.12 * s + side * c,
            max(height, p.position[i, 2]),
        )
        goods.yaw[k] = p.yaw[i]
        goods.room[k] = p.room[i]
