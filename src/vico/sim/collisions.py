"""Continuous collision of upright avatars with the map, with rooms and furniture, and with each other's bodies.

A motion is walked in strides far shorter than a body is wide, each tested against the map's clearance and, exactly,
against the boxes and discs near it; the last one is halved: so nothing is tunnelled through, and a blocked motion
ends at the obstacle. Someone who already touches something may move if that makes the gap wider.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

STRIDE = 0.05
WALL = -1
# The map promises 0.3 m of free room at the centre of a free cell. Clearance interpolated to 0.27 m means at most
# 0.05 m off such a centre towards something solid: the 0.25 m of a body.
MAP_ROOM = 0.27
_FAR = 1e9

Array = NDArray[Any]


@njit(cache=True)
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


@njit(cache=True)
def box_gap(x: float, y: float, bx: float, by: float, yaw: float, half_length: float, half_width: float) -> float:
    """Signed distance from a point to an oriented rectangle, metres; negative inside."""
    c, s = math.cos(yaw), math.sin(yaw)
    u = abs(c * (x - bx) + s * (y - by)) - half_length
    v = abs(-s * (x - bx) + c * (y - by)) - half_width
    if u > 0.0 and v > 0.0:
        return math.sqrt(u * u + v * v)
    return max(u, v)


@njit(cache=True)
def room_gap(x: float, y: float, room: Array) -> float:
    """Distance from a point to the nearest wall of a room ``(cx, cy, yaw, half_x, half_y)``; negative outside."""
    return -box_gap(x, y, room[0], room[1], room[2], room[3], room[4])


@njit(cache=True)
def _gap_between(
    x: float, y: float, yaw: float, reach: float, ox: float, oy: float, oyaw: float, oreach: float
) -> float:
    """Smallest distance between the disc centres of two avatars (one disc, or three in a row for a rider)."""
    best = _FAR
    for a in range(-1, 2):
        if a != 0 and reach == 0.0:
            continue
        ax, ay = x + a * reach * math.cos(yaw), y + a * reach * math.sin(yaw)
        for b in range(-1, 2):
            if b != 0 and oreach == 0.0:
                continue
            bx, by = ox + b * oreach * math.cos(oyaw), oy + b * oreach * math.sin(oyaw)
            best = min(best, math.hypot(ax - bx, ay - by))
    return best


@njit(cache=True)
def blocker(
    i: int,
    x: float,
    y: float,
    yaw: float,
    position: Array,
    yaws: Array,
    reach: Array,
    space: Array,
    entity: Array,
    radius: float,
    clearance: Array,
    half: float,
    rooms: Array,
    furniture: Array,
    furniture_start: Array,
    others: Array,
    other_disc: Array,
    other_entity: Array,
) -> int:
    """Entity that keeps avatar `i` from standing at a point; `WALL` for walls, edges and furniture, 0 if free.

    `space` is -2 for who takes no room (bus riders), -1 outdoors, else the room's index. `others` holds
    ``x, y, yaw, half_length, half_width`` of the outdoor bodies that are no avatars.
    """
    x0, y0, yaw0 = position[i, 0], position[i, 1], yaws[i]
    for k in range(-1, 2):
        if k != 0 and reach[i] == 0.0:
            continue
        px, py = x + k * reach[i] * math.cos(yaw), y + k * reach[i] * math.sin(yaw)
        qx, qy = x0 + k * reach[i] * math.cos(yaw0), y0 + k * reach[i] * math.sin(yaw0)
        if space[i] == -1:
            gap = map_gap(px, py, clearance, half)
            if gap < MAP_ROOM and gap <= map_gap(qx, qy, clearance, half):
                return WALL
            for j in range(others.shape[0]):
                dx, dy = others[j, 0] - px, others[j, 1] - py
                far = others[j, 3] + others[j, 4] + radius
                if dx * dx + dy * dy > far * far:
                    continue
                if other_disc[j]:
                    gap = math.sqrt(dx * dx + dy * dy) - others[j, 3]
                    was = math.hypot(others[j, 0] - qx, others[j, 1] - qy) - others[j, 3]
                else:
                    gap = box_gap(px, py, others[j, 0], others[j, 1], others[j, 2], others[j, 3], others[j, 4])
                    was = box_gap(qx, qy, others[j, 0], others[j, 1], others[j, 2], others[j, 3], others[j, 4])
                if gap < radius and gap <= was:
                    return int(other_entity[j])
        elif space[i] >= 0:
            room = space[i]
            gap = room_gap(px, py, rooms[room])
            if gap < radius and gap <= room_gap(qx, qy, rooms[room]):
                return WALL
            for f in range(furniture_start[room], furniture_start[room + 1]):
                b = furniture[f]
                gap = box_gap(px, py, b[0], b[1], b[2], b[3], b[4])
                if gap < radius and gap <= box_gap(qx, qy, b[0], b[1], b[2], b[3], b[4]):
                    return WALL
    for j in range(position.shape[0]):
        if j == i or space[j] != space[i] or space[j] == -2:
            continue
        near = 2.0 * radius + reach[i] + reach[j]
        dx, dy = position[j, 0] - x, position[j, 1] - y
        if dx * dx + dy * dy > near * near:
            continue
        gap = _gap_between(x, y, yaw, reach[i], position[j, 0], position[j, 1], yaws[j], reach[j])
        if gap < 2.0 * radius and gap <= _gap_between(
            x0, y0, yaw0, reach[i], position[j, 0], position[j, 1], yaws[j], reach[j]
        ):
            return int(entity[j])
    return 0


@njit(cache=True)
def sweep(
    distance: Array,
    turn: Array,
    position: Array,
    yaws: Array,
    reach: Array,
    space: Array,
    entity: Array,
    radius: float,
    clearance: Array,
    half: float,
    rooms: Array,
    furniture: Array,
    furniture_start: Array,
    others: Array,
    other_disc: Array,
    other_entity: Array,
) -> tuple[Array, Array]:
    """Turn, then move every avatar ahead as far as the way is free, one after the other.

    Parameters
    ----------
    distance, turn
        Metres and radians wanted, shape ``(n,)``. `position` (n, 3) and `yaws` (n,) are changed in place.

    Returns
    -------
    tuple
        Metres moved, float64, and the entity that stopped each (0: nobody, `WALL`), int64; shape ``(n,)``.
    """
    n = position.shape[0]
    moved = np.zeros(n)
    contact = np.zeros(n, np.int64)
    for i in range(n):
        if turn[i] != 0.0:
            yaw = yaws[i] + turn[i]
            yaw = yaw - 2.0 * math.pi * math.floor((yaw + math.pi) / (2.0 * math.pi))
            hit = 0
            if reach[i] > 0.0:
                hit = blocker(
                    i, position[i, 0], position[i, 1], yaw, position, yaws, reach, space, entity, radius,
                    clearance, half, rooms, furniture, furniture_start, others, other_disc, other_entity,
                )  # fmt: skip
            if hit != 0:
                contact[i] = hit
            else:
                yaws[i] = yaw
        if distance[i] <= 0.0 or space[i] == -2:
            continue
        cx, cy = math.cos(yaws[i]), math.sin(yaws[i])
        free, step = 0.0, min(distance[i], STRIDE)
        halvings = 0
        # Whole strides while the way is free, then halves: `free` metres are known to be clear.
        while free < distance[i] - 1e-12:
            x, y = position[i, 0] + cx * step, position[i, 1] + cy * step
            hit = blocker(
                i, x, y, yaws[i], position, yaws, reach, space, entity, radius,
                clearance, half, rooms, furniture, furniture_start, others, other_disc, other_entity,
            )  # fmt: skip
            if hit == 0:
                position[i, 0], position[i, 1] = x, y
                free += step
                step = min(step, distance[i] - free)
            else:
                contact[i] = hit
                step *= 0.5
            if contact[i] != 0:
                halvings += 1
                if halvings > 6:
                    break
        moved[i] = free
    return moved, contact


def overlaps(centres: Array, radius: float) -> list[tuple[int, int]]:
    """Pairs of discs of one radius that overlap by more than a rounding error; for checks and tests."""
    gaps = np.hypot(*(centres[:, None, :2] - centres[None, :, :2]).transpose(2, 0, 1))
    first, second = np.nonzero(np.triu(gaps < 2 * radius - 1e-9, 1))
    return list(zip(first.tolist(), second.tolist(), strict=True))
