"""Continuous collision of upright avatars with the map, with rooms and furniture, and with each other's bodies.

A motion is walked in strides far shorter than a body is wide, each tested against the map's clearance and, exactly,
against the boxes and discs near it; the last one is halved: so nothing is tunnelled through, and a blocked motion
ends at the obstacle. Someone who already touches something may move if that makes the gap wider.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.io.compiled import compiled
from vico.sim.state import RADIUS

STRIDE = 0.05
WALL = -1
# The map promises 0.3 m of free room at the centre of a free cell. Clearance interpolated to 0.27 m means at most
# 0.05 m off such a centre towards something solid: the 0.25 m of a body.
MAP_ROOM = 0.27
#: Spaces that are no rooms: the street, and buses, whose riders take no room.
OUTDOORS, IN_BUS = -1, -2
#: Columns of boxes: centre (metres), heading (radians), half sides (metres).
BOX_X, BOX_Y, BOX_YAW, BOX_HALF_LENGTH, BOX_HALF_WIDTH = range(5)
_FAR = 1e9
_HALVINGS = 6  # of the last stride

Array = NDArray[Any]


class SolidMap(NamedTuple):
    """What never moves.

    Attributes
    ----------
    clearance, half
        Free room around each cell of the walkable map, metres, shape ``(cells, cells)``, and half the map's side.
    rooms
        Boxes, float64, shape ``(rooms, 5)``.
    furniture, furniture_start
        Boxes, room by room: those of room ``r`` are ``furniture[furniture_start[r]:furniture_start[r + 1]]``.
    """

    clearance: Array
    half: float
    rooms: Array
    furniture: Array
    furniture_start: Array


class AvatarBodies(NamedTuple):
    """The avatars, arrays of shape ``(n,)``.

    Attributes
    ----------
    position
        Metres, shape ``(n, 3)``.
    yaw
        Heading, radians.
    reach
        How far the body reaches fore and aft of its centre disc, metres: wheels, for riders.
    space
        Room each is in, `OUTDOORS` or `IN_BUS`: only those of one space can touch.
    entity
        Their entities.
    """

    position: Array
    yaw: Array
    reach: Array
    space: Array
    entity: Array


#: An avatar while it is moved: pose (metres, radians), see `AvatarBodies`, and its number.
AVATAR = np.dtype(
    [
        ("x", np.float64),
        ("y", np.float64),
        ("yaw", np.float64),
        ("reach", np.float64),
        ("space", np.int64),
        ("entity", np.int64),
        ("index", np.int64),
    ]
)
#: A body outdoors that is no avatar: pose, half sides (metres; the radius of a disc), whether it is a disc, entity.
OBSTACLE = np.dtype(
    [
        ("x", np.float64),
        ("y", np.float64),
        ("yaw", np.float64),
        ("half_length", np.float64),
        ("half_width", np.float64),
        ("entity", np.int64),
        ("disc", np.bool_),
    ],
    align=True,
)


@compiled
def map_gap(x: float, y: float, clearance: Array, half: float) -> float:
    """Free room around a point of the walkable map, metres: its clearance, bilinear between the cells' centres.

    At the map's edge it is the distance to the edge, where that is less.
    """
    n = clearance.shape[0]
    cell = 2.0 * half / n
    edge = min(half - abs(x), half - abs(y))
    if edge <= 0.0:
        return edge
    u = min(n - 1.0, max(0.0, (x + half) / cell - 0.5))
    v = min(n - 1.0, max(0.0, (y + half) / cell - 0.5))
    i, j = min(n - 2, int(u)), min(n - 2, int(v))
    fu, fv = u - i, v - j
    south = clearance[j, i] * (1 - fu) + clearance[j, i + 1] * fu
    north = clearance[j + 1, i] * (1 - fu) + clearance[j + 1, i + 1] * fu
    return min(edge, south * (1 - fv) + north * fv)


@compiled
def box_gap(x: float, y: float, bx: float, by: float, yaw: float, half_length: float, half_width: float) -> float:
    """Signed distance from a point to an oriented rectangle, metres; negative inside."""
    c, s = math.cos(yaw), math.sin(yaw)
    u = abs(c * (x - bx) + s * (y - by)) - half_length
    v = abs(-s * (x - bx) + c * (y - by)) - half_width
    if u > 0.0 and v > 0.0:
        return math.sqrt(u * u + v * v)
    return max(u, v)


@compiled
def gap_to(x: float, y: float, box: Array) -> float:
    """Signed distance from a point to a box, one row of columns `BOX_X` and on, metres; negative inside."""
    return box_gap(x, y, box[BOX_X], box[BOX_Y], box[BOX_YAW], box[BOX_HALF_LENGTH], box[BOX_HALF_WIDTH])


@compiled
def room_gap(x: float, y: float, room: Array) -> float:
    """Distance from a point to the nearest wall of a room, a box; negative outside."""
    return -gap_to(x, y, room)


@compiled
def _gap_between(x: float, y: float, yaw: float, reach: float, other: Any) -> float:
    """Smallest distance between the disc centres of two avatars (one disc, or three in a row for a rider)."""
    best = _FAR
    for a in range(-1, 2):
        if a != 0 and reach == 0.0:
            continue
        ax, ay = x + a * reach * math.cos(yaw), y + a * reach * math.sin(yaw)
        for b in range(-1, 2):
            if b != 0 and other.reach == 0.0:
                continue
            bx, by = other.x + b * other.reach * math.cos(other.yaw), other.y + b * other.reach * math.sin(other.yaw)
            best = min(best, math.hypot(ax - bx, ay - by))
    return best


@compiled
def _is_too_close(gap: float, was: float) -> bool:
    """Return whether a gap to an obstacle is too small, and no wider than it was."""
    return gap < RADIUS and gap <= was


@compiled
def _obstacle_gap(x: float, y: float, other: Any) -> float:
    """Return the distance from a point to a body outdoors, metres."""
    if other.disc:
        return math.hypot(other.x - x, other.y - y) - other.half_length
    return box_gap(x, y, other.x, other.y, other.yaw, other.half_length, other.half_width)


@compiled
def _blocker_outdoors(x: float, y: float, from_x: float, from_y: float, solids: SolidMap, others: Array) -> int:
    """Return the entity that keeps a disc from going from one point to another in the street; `WALL`, or 0 if free."""
    gap = map_gap(x, y, solids.clearance, solids.half)
    if gap < MAP_ROOM and gap <= map_gap(from_x, from_y, solids.clearance, solids.half):
        return WALL
    for other in others:
        dx, dy = other.x - x, other.y - y
        far = other.half_length + other.half_width + RADIUS
        if dx * dx + dy * dy > far * far:
            continue
        if other.disc:
            gap = math.sqrt(dx * dx + dy * dy) - other.half_length
        else:
            gap = _obstacle_gap(x, y, other)
        if _is_too_close(gap, _obstacle_gap(from_x, from_y, other)):
            return int(other.entity)
    return 0


@compiled
def _blocker_in_room(x: float, y: float, from_x: float, from_y: float, room: int, solids: SolidMap) -> int:
    """Return `WALL` if a wall or furniture keeps a disc from going from one point to another in a room, 0 if free."""
    gap = room_gap(x, y, solids.rooms[room])
    if _is_too_close(gap, room_gap(from_x, from_y, solids.rooms[room])):
        return WALL
    for f in range(solids.furniture_start[room], solids.furniture_start[room + 1]):
        gap = gap_to(x, y, solids.furniture[f])
        if _is_too_close(gap, gap_to(from_x, from_y, solids.furniture[f])):
            return WALL
    return 0


@compiled
def _blocking_avatar(me: Any, x: float, y: float, yaw: float, avatars: Array) -> int:
    """Return the entity of the avatar that keeps avatar `me` from standing at a pose, 0 if none does."""
    for other in avatars:
        if other.index == me.index or other.space != me.space or other.space == IN_BUS:
            continue
        near = 2.0 * RADIUS + me.reach + other.reach
        dx, dy = other.x - x, other.y - y
        if dx * dx + dy * dy > near * near:
            continue
        gap = _gap_between(x, y, yaw, me.reach, other)
        if gap < 2.0 * RADIUS and gap <= _gap_between(me.x, me.y, me.yaw, me.reach, other):
            return int(other.entity)
    return 0


@compiled
def blocker(me: Any, x: float, y: float, yaw: float, avatars: Array, solids: SolidMap, others: Array) -> int:
    """Entity that keeps avatar `me` from standing at a pose; `WALL` for walls, edges and furniture, 0 if free."""
    hit = 0
    for k in range(-1, 2):
        if k != 0 and me.reach == 0.0:
            continue
        px, py = x + k * me.reach * math.cos(yaw), y + k * me.reach * math.sin(yaw)
        qx, qy = me.x + k * me.reach * math.cos(me.yaw), me.y + k * me.reach * math.sin(me.yaw)
        if me.space == OUTDOORS:
            hit = _blocker_outdoors(px, py, qx, qy, solids, others)
        elif me.space >= 0:
            hit = _blocker_in_room(px, py, qx, qy, me.space, solids)
        if hit != 0:
            break
    return hit if hit != 0 else _blocking_avatar(me, x, y, yaw, avatars)


@compiled
def _turn(me: Any, angle: float, avatars: Array, solids: SolidMap, others: Array) -> int:
    """Turn an avatar if its body has room to; return the entity that is in the way, 0 for none."""
    yaw = me.yaw + angle
    yaw = yaw - 2.0 * math.pi * math.floor((yaw + math.pi) / (2.0 * math.pi))
    hit = 0
    if me.reach > 0.0:
        hit = blocker(me, me.x, me.y, yaw, avatars, solids, others)
    if hit == 0:
        me.yaw = yaw
    return hit


@compiled
def _walk_ahead(
    me: Any, distance: float, contact: int, avatars: Array, solids: SolidMap, others: Array
) -> tuple[float, int]:
    """Move an avatar ahead as far as the way is free.

    Parameters
    ----------
    contact
        Entity that its turn touched, 0 for none: then it goes a few strides at most.

    Returns
    -------
    tuple
        Metres, and the entity that was touched last, 0 for none.
    """
    cx, cy = math.cos(me.yaw), math.sin(me.yaw)
    free, step = 0.0, min(distance, STRIDE)
    halvings = 0
    # Whole strides while the way is free, then halves: `free` metres are known to be clear.
    while free < distance - 1e-12:
        x, y = me.x + cx * step, me.y + cy * step
        hit = blocker(me, x, y, me.yaw, avatars, solids, others)
        if hit == 0:
            me.x, me.y = x, y
            free += step
            step = min(step, distance - free)
        else:
            contact = hit
            step *= 0.5
        if contact != 0:
            halvings += 1
            if halvings > _HALVINGS:
                break
    return free, contact


@compiled
def _avatar_records(avatars: AvatarBodies) -> Array:
    records = np.empty(len(avatars.yaw), AVATAR)
    for i in range(len(records)):
        one = records[i]
        one.x, one.y, one.yaw = avatars.position[i, 0], avatars.position[i, 1], avatars.yaw[i]
        one.reach, one.space = avatars.reach[i], avatars.space[i]
        one.entity, one.index = avatars.entity[i], i
    return records


@compiled
def sweep(distance: Array, turn: Array, bodies: AvatarBodies, solids: SolidMap, others: Array) -> tuple[Array, Array]:
    """Turn, then move every avatar ahead as far as the way is free, one after the other.

    Parameters
    ----------
    distance, turn
        Metres and radians wanted, shape ``(n,)``.
    bodies
        The avatars; their positions and yaws are changed in place.
    others
        Bodies outdoors that are no avatars, dtype `OBSTACLE`.

    Returns
    -------
    tuple
        Metres moved, float64, and the entity that stopped each (0: nobody, `WALL`), int64; shape ``(n,)``.
    """
    moved = np.zeros(len(distance))
    contact = np.zeros(len(distance), np.int64)
    avatars = _avatar_records(bodies)
    for i in range(len(distance)):
        me = avatars[i]
        if turn[i] != 0.0:
            contact[i] = _turn(me, turn[i], avatars, solids, others)
        if distance[i] > 0.0 and me.space != IN_BUS:
            moved[i], contact[i] = _walk_ahead(me, distance[i], contact[i], avatars, solids, others)
        bodies.position[i, 0], bodies.position[i, 1], bodies.yaw[i] = me.x, me.y, me.yaw
    return moved, contact


def overlaps(centres: Array, radius: float) -> list[tuple[int, int]]:
    """Pairs of discs of one radius that overlap by more than a rounding error; for checks and tests."""
    gaps = np.hypot(*(centres[:, None, :2] - centres[None, :, :2]).transpose(2, 0, 1))
    first, second = np.nonzero(np.triu(gaps < 2 * radius - 1e-9, 1))
    return list(zip(first.tolist(), second.tolist(), strict=True))
