"""Continuous collision of avatars with the map, rooms, furniture and other bodies; things that lie on decks.

A motion is walked in strides far shorter than a body is wide, each tested against the map's clearance and, exactly,
against the footprints near it; the last one is halved: so nothing is tunnelled through, and a blocked motion
ends at the obstacle. Someone who already touches something may move if that makes the gap wider.

A deck is a surface of something that moves, such as a robot; whatever has one says so by an entity number
(`HasDecks`). A thing on a deck lies along the deck's sides where there is room for it, and keeps its place in the
carrier's frame until somebody takes it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from vico.exact import apply_matrix
from vico.io.compiled import compiled
from vico.sim.bodies.footprints import (
    OUTDOORS,
    Rectangle,
    can_touch,
    core_of,
    neighbour_grid,
    point_gap,
    rectangle_gap,
    search,
)
from vico.sim.bodies.state_arrays import RADIUS

if TYPE_CHECKING:
    from vico.sim.bodies.state_arrays import MovableObjects
STRIDE = 0.05
WALL = -1
# The map promises 0.3 m of free room at the centre of a free cell. Clearance interpolated to 0.27 m means at most
# 0.05 m off such a centre towards something solid: the 0.25 m of a body.
MAP_ROOM = 0.27
#: Columns of boxes: centre (metres), heading (radians), half sides (metres).
BOX_X, BOX_Y, BOX_YAW, BOX_HALF_LENGTH, BOX_HALF_WIDTH = range(5)
_HALVINGS = 6  # of the last stride
# Along a cyclist's line the map is asked at points this far apart, metres: discs of MAP_ROOM around them cover all that
# is within a person's radius of the line.
_SPACING = 0.2
_CELL = 4.0  # of the grid of neighbours, metres

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
    return point_gap(x, y, Rectangle(bx, by, math.cos(yaw), math.sin(yaw), half_length, half_width))


@compiled
def gap_to(x: float, y: float, box: Array) -> float:
    """Signed distance from a point to a box, one row of columns `BOX_X` and on, metres; negative inside."""
    return box_gap(x, y, box[BOX_X], box[BOX_Y], box[BOX_YAW], box[BOX_HALF_LENGTH], box[BOX_HALF_WIDTH])


@compiled
def room_gap(x: float, y: float, room: Array) -> float:
    """Distance from a point to the nearest wall of a room, a box; negative outside."""
    return -gap_to(x, y, room)


@compiled
def _is_too_close(gap: float, was: float) -> bool:
    """Return whether a gap to an obstacle is too small, and no wider than it was."""
    return gap < RADIUS and gap <= was


@compiled
def _blocked_at(x: float, y: float, from_x: float, from_y: float, space: int, solids: SolidMap) -> bool:
    """Return whether something solid keeps a disc from going from one point to another, in the street or a room."""
    if space == OUTDOORS:
        gap = map_gap(x, y, solids.clearance, solids.half)
        return gap < MAP_ROOM and gap <= map_gap(from_x, from_y, solids.clearance, solids.half)
    gap = room_gap(x, y, solids.rooms[space])
    if _is_too_close(gap, room_gap(from_x, from_y, solids.rooms[space])):
        return True
    for f in range(solids.furniture_start[space], solids.furniture_start[space + 1]):
        gap = gap_to(x, y, solids.furniture[f])
        if _is_too_close(gap, gap_to(from_x, from_y, solids.furniture[f])):
            return True
    return False


@compiled
def _is_blocked(core: Rectangle, was: Rectangle, space: int, solids: SolidMap) -> bool:
    """Return whether something solid keeps a body from moving from one place of its core to another."""
    reach = core.half_length
    if reach == 0.0:
        return _blocked_at(core.x, core.y, was.x, was.y, space, solids)
    points = math.ceil(2.0 * reach / _SPACING) + 1
    for k in range(points):
        s = reach * (2.0 * k / (points - 1) - 1.0)
        if _blocked_at(
            core.x + s * core.cos, core.y + s * core.sin, was.x + s * was.cos, was.y + s * was.sin, space, solids
        ):
            return True
    return False


@compiled
def _body_in_way(me: Any, core: Rectangle, bodies: Array, near: Array) -> int:
    """Return the entity of the first of the bodies `near` that avatar `me` would touch at a place, 0 if none."""
    reach, was = core.half_length + me.rounding, core_of(me)
    for k in near:
        other = bodies[k]
        dx, dy = other.x - core.x, other.y - core.y
        far = reach + other.radius
        if dx * dx + dy * dy > far * far:
            continue
        theirs = core_of(other)
        gap = rectangle_gap(core, theirs) - other.rounding
        if gap < me.rounding and gap <= rectangle_gap(was, theirs) - other.rounding:
            return int(other.entity)
    return 0


@compiled
def _blocker(me: Any, core: Rectangle, around: Any) -> int:
    """Entity that keeps avatar `me` from moving its core to a place; `WALL` for walls, edges, furniture, 0 if free."""
    solids, bodies, near = around
    if _is_blocked(core, core_of(me), me.space, solids):
        return WALL
    return _body_in_way(me, core, bodies, near)


@compiled
def _turn(me: Any, yaw: float, around: Any) -> int:
    """Turn an avatar if its body has room to; return the entity that is in the way, 0 for none."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    reach = me.half_length - me.rounding
    hit = 0
    if reach > 0.0:
        hit = _blocker(me, Rectangle(me.x, me.y, cos, sin, reach, 0.0), around)
    if hit == 0:
        me.cos, me.sin = cos, sin
    return hit


@compiled
def _walk_ahead(me: Any, distance: float, contact: int, around: Any) -> tuple[float, int]:
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
    free, step = 0.0, min(distance, STRIDE)
    halvings = 0
    reach = me.half_length - me.rounding
    # Whole strides while the way is free, then halves: `free` metres are known to be clear.
    while free < distance - 1e-12:
        x, y = me.x + me.cos * step, me.y + me.sin * step
        hit = _blocker(me, Rectangle(x, y, me.cos, me.sin, reach, 0.0), around)
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
def _grid_of(bodies: Array, drift: float) -> Any:
    """Return the grid of some bodies that move no farther than `drift` while it is used."""
    x, y, spread = np.empty(len(bodies)), np.empty(len(bodies)), 0.0
    for k in range(len(bodies)):
        x[k], y[k] = bodies[k].x, bodies[k].y
        spread = max(spread, bodies[k].radius)
    return neighbour_grid(x, y, _CELL, spread + drift)


@compiled
def _who_can_touch(me: Any, bodies: Array, found: Array) -> Array:
    """Leave those of the found bodies that avatar `me` can touch: others, in its space, on its level."""
    n = 0
    for k in found:
        if bodies[k].entity != me.entity and can_touch(me, bodies[k]):
            found[n] = k
            n += 1
    return found[:n]


@compiled
def sweep(distance: Array, turn: Array, yaw: Array, bodies: Array, solids: SolidMap) -> Any:
    """Turn and walk all avatars, in order; each sees where the ones before it have come to stand.

    Parameters
    ----------
    distance, turn
        Metres ahead and radians counter-clockwise, float64, shape ``(n,)``.
    yaw
        Headings, radians, shape ``(n,)``; changed in place.
    bodies
        The avatars, changed in place, and after them the bodies that stand still meanwhile; dtype
        `vico.sim.bodies.footprints.BODY`.

    Returns
    -------
    tuple
        Metres walked by each, and what it touched: an entity, `WALL`, or 0; shape ``(n,)``.
    """
    moved = np.zeros(len(distance))
    contact = np.zeros(len(distance), np.int64)
    drift = 0.0
    for d in distance:
        drift = max(drift, d)
    grid, found = _grid_of(bodies, drift), np.empty(len(bodies), np.int64)
    for i in range(len(distance)):
        me = bodies[i]
        if turn[i] == 0.0 and (distance[i] <= 0.0 or me.space < OUTDOORS):
            continue
        near = search(grid, me.x, me.y, me.half_length + distance[i], found)
        around = solids, bodies, _who_can_touch(me, bodies, near)
        if turn[i] != 0.0:
            heading = yaw[i] + turn[i]
            heading = heading - 2.0 * math.pi * math.floor((heading + math.pi) / (2.0 * math.pi))
            contact[i] = _turn(me, heading, around)
            if contact[i] == 0:
                yaw[i] = heading
        if distance[i] > 0.0 and me.space >= OUTDOORS:
            moved[i], contact[i] = _walk_ahead(me, distance[i], contact[i], around)
    return moved, contact


# Steps in which a deck is searched for a place, metres, and what things may stick out over its edges, share of it.
_PITCH = 0.02
_OVERHANG = 1.25


@dataclass(frozen=True)
class DeckPose:
    """A deck as it lies in the world.

    Attributes
    ----------
    position, rotation
        Origin of the carrier's frame, ENU metres, shape ``(3,)``, and that frame to world, shape ``(3, 3)``.
    centre
        Middle of the deck's surface in the carrier's frame, metres, shape ``(3,)``.
    length, width
        Extents along the carrier's x and y, metres.
    """

    position: NDArray[np.float64]
    rotation: NDArray[np.float64]
    centre: NDArray[np.float64]
    length: float
    width: float

    def world(self, point: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a point of the carrier's frame in the world."""
        return self.position + apply_matrix(point, self.rotation)

    def gap(self, point: NDArray[np.float64]) -> float:
        """Metres along the ground from a point of the world to the deck; 0 or less above it."""
        x, y, _ = self.world(self.centre)
        yaw = math.atan2(self.rotation[1, 0], self.rotation[0, 0])
        return float(box_gap(point[0], point[1], x, y, yaw, self.length / 2, self.width / 2))


class HasDecks(Protocol):
    """Who carries things on decks."""

    def deck(self, entity: int) -> DeckPose | None:
        """Return the deck of one of its bodies; None if that has none, or is none of its bodies."""


def free_place_on_deck(deck: DeckPose, entity: int, k: int, objects: MovableObjects) -> NDArray[np.float64] | str:
    """Find a place for one more thing on a deck.

    Parameters
    ----------
    entity
        Of the carrier.
    k
        Index of the thing.

    Returns
    -------
    array or str
        Middle of the thing's underside in the carrier's frame, shape ``(3,)``; or why there is none. Places are taken
        from the back and the right, so that what comes later finds room.
    """
    half = objects.size[k, :2] / 2
    deck_half = np.array([deck.length, deck.width]) / 2
    if np.any(half > deck_half * _OVERHANG):
        return f"{objects.names[k]} is larger than the deck"
    room = np.maximum(deck_half - half, 0.0)
    lying = np.flatnonzero((objects.holder == entity) & (objects.hand < 0))
    others = objects.offset[lying, :2] - deck.centre[:2]
    apart = objects.size[lying, :2] / 2 + half
    for u in _places_along(room[0]):
        for v in _places_along(room[1]):
            if np.all(np.any(np.abs(others - (u, v)) >= apart - 1e-9, axis=1)):
                return deck.centre + np.array([u, v, 0.0])
    return f"no room on the deck for {objects.names[k]}; {len(lying)} things lie there"


def _places_along(room: float) -> Iterable[float]:
    """Places along one side, from one end to the other, both ends among them."""
    count = max(1, math.ceil(2 * room / _PITCH) + 1)
    return np.linspace(-room, room, count).tolist() if count > 1 else (0.0,)


def lay_on_deck(deck: DeckPose, entity: int, k: int, place: NDArray[np.float64], objects: MovableObjects) -> None:
    """Lay a thing on a deck, along its sides."""
    objects.hand[k] = -1
    objects.holder[k] = entity
    objects.offset[k] = place
    objects.room[k] = -1
    _move_with_deck(deck, k, objects)


def move_with_decks(objects: MovableObjects, carriers: Iterable[HasDecks]) -> None:
    """Move what lies on decks to where those are now, turned and tilted as they are."""
    owners = list(carriers)
    decks: dict[int, DeckPose | None] = {}
    for k in np.flatnonzero((objects.holder != 0) & (objects.hand < 0)):
        entity = int(objects.holder[k])
        if entity not in decks:
            found = (owner.deck(entity) for owner in owners)
            decks[entity] = next((deck for deck in found if deck is not None), None)
        deck = decks[entity]
        if deck is not None:
            _move_with_deck(deck, int(k), objects)


def _move_with_deck(deck: DeckPose, k: int, objects: MovableObjects) -> None:
    objects.position[k] = deck.world(objects.offset[k])
    objects.set_rotation(k, deck.rotation)
