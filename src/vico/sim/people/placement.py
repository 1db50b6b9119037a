"""Free places of people to stand, sit and queue, objects in their hands, and free places to put objects.

Standing somebody indoors or outdoors moves along what they carry. Nobody sits down into whoever stands beside the
seat, and no thing lies in one place with another thing or with somebody.

An umbrella is up by rule: it rains more than its owner minds, outdoors, on foot, at a walk, with a hand free. Who has
one is a trait, drawn with the run's seed; whether it was taken along is decided at the door, by sky and forecast. Large
things are carried before the chest.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.assets.models.movable import movable_grip
from vico.geometry import wrap_angle
from vico.io.data_files import cached_data
from vico.rules import WALK_SPEED
from vico.seeds import rng
from vico.sim.animation import Hold
from vico.sim.animation.postures import seat_height
from vico.sim.bodies.arrays import OBJECT, Bodies
from vico.sim.bodies.avatars import CLIP, free_ground
from vico.sim.bodies.collisions import move_with_decks
from vico.sim.bodies.footprints import OUTDOORS, Rectangle, body_gap, can_touch, gaps, records_of
from vico.sim.bodies.rooms import BESIDE
from vico.sim.bodies.seats import AT_SPOT, LOST, PRICE, SPACING
from vico.sim.bodies.state_arrays import LEVEL_GAZE, Posture, Vehicle, body_radius
from vico.sim.state.simulation_state import SimulationState

# Who gets up outdoors finds a place to stand within so many metres of the bench's front.
_STEP_ASIDE = 1.5


# Where the eyes are by stature, metres and shares of it.
_STATURES, _EYES = (1.1, 1.28, 1.45, 1.62), (0.905, 0.915, 0.923, 0.93)


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
    x, y = float(anchor[0]), float(anchor[1])
    inner = [(d.position, d.inside) for d in indoor.doors[room] if d.inside is not None]
    door = next((position for position, inside in inner if math.hypot(inside[0] - x, inside[1] - y) < 1e-6), None)
    ahead = record.centre if door is None else (float(anchor[0]), float(anchor[1]))
    behind = record.door if door is None else door
    p.yaw[i] = math.atan2(ahead[1] - behind[1], ahead[0] - behind[0])
    p.pitch[i] = LEVEL_GAZE
    move_held_objects(state)


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
    p.yaw[i] = wrap_angle(yaw)
    p.pitch[i] = LEVEL_GAZE
    state.avatars.settle(np.array([i]))
    move_held_objects(state)


def take_seat(i: int, seat: int, state: SimulationState) -> None:
    """Have someone sit down on a seat, or lie down on a bed, that is free."""
    p, seats = state.people, state.seats
    was = _frame(i, state)
    x, y, z = seats.position[seat]
    lies = bool(seats.lies[seat])
    p.seat[i] = seat
    p.posture[i] = Posture.LYING if lies else Posture.SITTING
    p.position[i] = x, y, z if lies else z - float(seat_height(p.height[i]))
    p.yaw[i] = wrap_angle(float(seats.yaw[seat]))
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


def leave_seat(i: int, spot: NDArray[np.float64], state: SimulationState) -> None:
    """Have someone get up and stand at a spot, as `spot_beside_seat` finds it."""
    p = state.people
    was = _frame(i, state)
    p.posture[i], p.seat[i] = Posture.STANDING, -1
    p.position[i], p.yaw[i] = spot, wrap_angle(was[3])
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
    state.people.moved[i] = c * dx + s * dy, c * dy - s * dx, was[2] - z, wrap_angle(was[3] - yaw)
    move_held_objects(state)


def gesture(clip: str, i: int, state: SimulationState, *, hand: int = 1) -> None:
    """Show a motion while standing or sitting, made with the left (0) or the right hand."""
    state.people.action_clip[i] = CLIP[clip]
    state.people.gesture_hand[i] = hand


def move_held_objects(state: SimulationState) -> None:
    """Move what is carried along: beside the hip, left or right, of people; in its place on whatever has a deck."""
    objects, p = state.objects, state.people
    move_with_decks(objects, state.carriers())
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


# Bodies are looked at whose middle is nearer than this, metres: people, and vehicles as well; and so far up or down.
_REACH, _LEVEL = 8.0, 1.5


def has_room_to_sit(seat: int, i: int, state: SimulationState) -> bool:
    """Return whether person `i` would touch nobody on a seat or a bed, but others who sit or lie beside them."""
    p, seats = state.people, state.seats
    x, y, _ = seats.position[seat].tolist()
    bodies = _standing_in(int(seats.room[seat]), i, state)
    away = np.abs(bodies.position - (x, y, float(seats.floor[seat])))
    bodies = bodies.where((away[:, :2].max(axis=1, initial=0.0) < _REACH) & (away[:, 2] < _LEVEL))
    if not len(bodies):
        return True
    radius = float(body_radius(p.height[i : i + 1])[0])
    return bool((gaps(Rectangle(x, y, 1.0, 0.0, 0.0, 0.0), records_of(bodies)) >= radius).all())


def _standing_in(room: int, i: int, state: SimulationState) -> Bodies:
    """Return who is in a room, or outdoors (-1), without person `i` and those who sit or lie."""
    p = state.people
    if room < 0:
        everybody = state.obstacles_to(i)
        return everybody.where(~np.isin(everybody.entity, p.entity[p.seat >= 0]))
    standing = (p.room == room) & (p.seat < 0)
    standing[i] = False
    parts = [p.bodies_of(np.flatnonzero(standing))] if standing.any() else []
    if state.robots is not None and (state.robots.rooms == room).any():
        parts.append(state.robots.bodies().where(state.robots.rooms == room))
    return Bodies.joined(parts)


#: So deep may things be in each other, metres: rounding errors.
_TOLERANCE = 1e-3
# A free spot beside a taken one is looked for in rings this far apart, metres, in so many directions.
_RING, _DIRECTIONS = 0.1, 16
# What is let go so far below a top comes to lie on it, and so far above it, metres: rounding errors.
_LET_GO, _JUST_ABOVE = 0.03, 1e-4
_FALLS = 1.5  # what falls comes to rest within so many metres
# On one surface: floors and tops of furniture differ by more, metres.
_SAME_HEIGHT = 0.02


@dataclass(frozen=True)
class ObjectBox:
    """A thing that is to be put somewhere.

    Attributes
    ----------
    size
        Extents of its box, metres, shape ``(3,)``.
    yaw
        Counter-clockwise from east, radians.
    entity
        Its entity, 0 if it has none yet: it is not in its own way.
    """

    size: NDArray[np.float64]
    yaw: float
    entity: int = 0


def overlapping_entity(thing: ObjectBox, point: NDArray[np.float64], room: int, state: SimulationState) -> int:
    """Return the entity of the first body that a thing would be inside of at a point, 0 if there is none.

    Parameters
    ----------
    point
        Where the middle of its underside would be, ENU metres.
    room
        Index of the room, -1 outdoors.
    """
    one = np.ones(1)
    body = Bodies(
        np.array([thing.entity], np.int32), np.array([OBJECT], np.int8), np.asarray(point, np.float64)[None],
        thing.yaw * one, thing.size[0] / 2 * one, thing.size[1] / 2 * one, thing.size[2] * one, np.zeros((1, 2)),
    )  # fmt: skip
    mine = records_of(body, room)[0]
    for other in _bodies_in(room, state):
        if other["entity"] != thing.entity and can_touch(mine, other) and body_gap(mine, other) < -_TOLERANCE:
            return int(other["entity"])
    return 0


def free_spot_on_surface(
    thing: ObjectBox, point: NDArray[np.float64], room: int, state: SimulationState, *, within: float
) -> NDArray[np.float64] | None:
    """Return the spot on the same surface nearest to a point where a thing lies in nobody's place.

    Returns
    -------
    ndarray or None
        ENU metres, shape ``(3,)``: the point itself where it is free; None if there is no such spot.
    """
    x, y, z = (float(value) for value in point)
    if overlapping_entity(thing, point, room, state) == 0:
        return np.array([x, y, z])
    rise = z - float(state.world.height((x, y)))
    for ring in range(1, int(within / _RING) + 1):
        for k in range(_DIRECTIONS):
            angle = 2 * math.pi * k / _DIRECTIONS
            spot = np.array([x + _RING * ring * math.cos(angle), y + _RING * ring * math.sin(angle), z])
            if room >= 0:
                fits = _lies_in_room(thing, spot, room, state)
            else:
                fits = bool(state.world.walkable.class_at(spot) > 0)
                spot[2] = float(state.world.height(spot[:2])) + rise
            if fits and overlapping_entity(thing, spot, room, state) == 0:
                return spot
    return None


def object_top_below(
    thing: ObjectBox, point: tuple[float, float, float], room: int, state: SimulationState
) -> tuple[NDArray[np.float64], int] | None:
    """Return where a thing comes to rest on another one that is below a point, and that one's entity.

    Parameters
    ----------
    point
        Where the thing is let go, ENU metres: on the top of the other one, or above it.

    Returns
    -------
    tuple or None
        The middle of its underside, ENU metres, shape ``(3,)``, and an entity; None if no level top is below, if the
        thing would tip over its edge, or if something else is there.
    """
    x, y, z = point
    for top, k in reversed(state.objects.tops_under((x, y), room)):
        entity = int(state.objects.entity[k])
        if entity != thing.entity and top <= z + _LET_GO:
            spot = np.array([x, y, top + _JUST_ABOVE])
            return (spot, entity) if overlapping_entity(thing, spot, room, state) == 0 else None
    return None


def objects_on(k: int, state: SimulationState) -> list[int]:
    """Return the indices of all that lies on a thing, directly or on what lies there, the lowest first."""
    objects = state.objects
    on: list[int] = []
    loose = np.flatnonzero((objects.holder == 0) & (objects.room == objects.room[k]))
    for j in loose[np.argsort(objects.position[loose, 2], kind="stable")].tolist():
        if j != k and objects.support_of(j) in (k, *on):
            on.append(j)
    return on


def drop_objects(fallen: list[int], state: SimulationState) -> None:
    """Have things, the lowest first, come to rest on what is below them, or beside it where there is no room."""
    objects = state.objects
    for k in fallen:
        x, y, z = objects.position[k].tolist()
        room = int(objects.room[k])
        thing = ObjectBox(objects.size[k], float(objects.yaw[k]), int(objects.entity[k]))
        rests = object_top_below(thing, (x, y, z), room, state)
        if rests is not None:
            objects.position[k] = rests[0]
            continue
        ground = float(state.world.height((x, y)))
        if room >= 0:
            # Not up onto a table that it lay below.
            ground = state.indoor.support(room, (x, y))
            ground = ground if ground <= z + _LET_GO else state.indoor.floor_at(room, (x, y))
        spot = free_spot_on_surface(thing, np.array([x, y, ground]), room, state, within=_FALLS)
        if spot is not None:
            objects.position[k] = spot


def _lies_in_room(thing: ObjectBox, spot: NDArray[np.float64], room: int, state: SimulationState) -> bool:
    """Return whether a thing would lie on the surface at a spot's height, clear of the walls."""
    indoor, reach = state.indoor, float(min(thing.size[0], thing.size[1])) / 2
    if abs(indoor.support(room, spot.tolist()) - spot[2]) > _SAME_HEIGHT:
        return False
    is_on_floor = abs(indoor.floor_at(room, spot) - spot[2]) <= _SAME_HEIGHT
    return indoor.gap(room, spot) >= reach if is_on_floor else indoor.holds(room, tuple(spot))


def _bodies_in(room: int, state: SimulationState) -> NDArray[np.void]:
    if room < 0:
        return records_of(state.obstacles(), OUTDOORS)
    objects, people = state.objects, state.people
    lying = objects.in_rooms()
    lying = lying[objects.room[lying] == room]
    inside = np.flatnonzero(people.room == room)
    return records_of(Bodies.joined([people.bodies_of(inside), objects.bodies_of(lying)]), room)


#: Shares of people who take an umbrella along when rain is about, and when none is.
_TAKES, _TAKES_ALWAYS = 0.75, 0.12
#: How soon rain has to come for it, seconds.
_AHEAD = (0.0, 3600.0, 3 * 3600.0, 6 * 3600.0)
#: Rain that the first and the last open an umbrella for, mm/h.
_FIRST, _LAST = 0.2, 1.6
#: Arms take so long to come up and down, seconds.
ARMS_TIME = 0.6
# Faster ones run.
_RUNS = 1.6 * WALK_SPEED
_ON_FOOT, _LYING = int(Vehicle.NONE), int(Posture.LYING)
_LEFT, _RIGHT, _CHEST = int(Hold.UMBRELLA_LEFT), int(Hold.UMBRELLA_RIGHT), int(Hold.BEFORE_CHEST)


def habit_of(seed: int, name: str) -> float:
    """Return how careful somebody is about rain, 0..1: 0 never goes out without an umbrella, 1 always does."""
    return float(rng(seed, "umbrella", name).random())


def bearable_rain(habit: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rain up to which people leave their umbrellas closed, mm/h."""
    return _FIRST + (_LAST - _FIRST) * habit / _TAKES


def carries_umbrella(habit: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return who has an umbrella along when rain is about."""
    return np.asarray(habit < _TAKES)


def take_umbrella(who: int | slice, state: SimulationState) -> None:
    """Decide whether someone, or several, who go out take umbrellas along."""
    p = state.people
    wet = state.environment.rain_within(_AHEAD) > _FIRST
    p.umbrella[who] = p.umbrella_habit[who] < (_TAKES if wet else _TAKES_ALWAYS)


def advance_arms(state: SimulationState, dt: float) -> None:
    """Have arms come up to what they are to hold, or down from it, for `dt` seconds."""
    p = state.people
    objects = state.objects
    carried = (objects.hand >= 0).nonzero()[0]
    rain = state.environment.weather.rain
    if rain <= _FIRST and not len(carried) and not p.hold.any():
        return
    wanted = np.zeros(len(p), np.int8)
    _put_umbrellas_up(wanted, rain, state)
    rows = {entity: i for i, entity in enumerate(p.entity.tolist())} if len(carried) else {}
    for k, holder in zip(carried.tolist(), objects.holder[carried].tolist(), strict=True):
        # Both arms where the other hand is free; under one arm else.
        left, right = p.held[i := rows[holder]].tolist()
        if (left != 0) + (right != 0) == 1 and _is_for_arms(objects.prototypes[k], tuple(objects.size[k].tolist())):
            wanted[i] = _CHEST if p.vehicle[i] == _ON_FOOT and p.posture[i] != _LYING else 0
    going = p.hold == wanted
    if not wanted.any() and going.all():
        return
    step = dt / ARMS_TIME
    p.hold_share[going] = np.minimum(p.hold_share[going] + step * (p.hold[going] > 0), 1.0)
    p.hold_share[~going] = np.maximum(p.hold_share[~going] - step, 0.0)
    turned = ~going & (p.hold_share <= 0.0)
    p.hold[turned] = wanted[turned]


@cached_data
def _is_for_arms(prototype: str, size: tuple[float, float, float]) -> bool:
    """Whether a thing is carried before the chest."""
    return movable_grip(prototype, size) == "arms"


def _put_umbrellas_up(wanted: NDArray[np.int8], rain: float, state: SimulationState) -> None:
    p = state.people
    if rain <= _FIRST:
        return  # nobody minds
    up = p.umbrella & (rain > bearable_rain(p.umbrella_habit)) & (p.room < 0) & (p.vehicle == _ON_FOOT)
    up &= (p.posture != _LYING) & (p.move_speed <= _RUNS) & ~p.held.all(axis=1)
    wanted[up] = np.where(p.held[up, 1] == 0, _RIGHT, _LEFT)


def free_hand(i: int, state: SimulationState) -> int | None:
    """Return a hand with nothing in it, the right one first; None if there is none."""
    p = state.people
    hold = int(p.hold[i])
    for hand, umbrella in ((1, _RIGHT), (0, _LEFT)):
        if not p.held[i, hand] and hold not in (umbrella, _CHEST):
            return hand
    return None


def place_in_line(
    i: int, state: SimulationState, line: Sequence[int] | None = None
) -> tuple[int, NDArray[np.float64]] | None:
    """Return how many are before a person at the till of its room, and where it stands, or would; None if nowhere.

    `line` is who waits there, if that is known already.
    """
    room = int(state.people.room[i])
    till = state.tills.get(room)
    if till is None:
        return None
    if line is None:
        line = state.lines.waiting(room)
    before = line.index(i) if i in line else len(line)
    return (before, till.spots[before]) if before < len(till.spots) else None


def advance_lines(state: SimulationState) -> None:
    """Serve whoever is first in each line for a second; who has walked away has left the line."""
    p, lines = state.people, state.lines
    for room in sorted(set(lines.room[lines.room >= 0].tolist())):
        spots = state.tills[room].spots
        for i in lines.waiting(room):
            place = lines.waiting(room).index(i)
            if int(p.room[i]) != room or _distance(p.position[i], spots[place]) > LOST + SPACING * place:
                lines.leave(i)
                state.events.add("queue", p.names[i], "leaves the line", p.position[i])
        line = lines.waiting(room)
        if line and _distance(p.position[line[0]], spots[0]) <= AT_SPOT:
            _serve(line[0], state)


def _serve(i: int, state: SimulationState) -> None:
    p, lines = state.people, state.lines
    lines.left[i] -= 1.0
    if lines.left[i] > 0.0:
        return
    paid = min(PRICE, float(p.cash[i]))
    p.cash[i] -= paid
    lines.leave(i)
    lines.served[i] += 1
    state.events.add("purchase", p.names[i], f"pays {paid:g} at the till", p.position[i], price=paid)


def _distance(position: ArrayLike, spot: NDArray[np.float64]) -> float:
    return float(np.hypot(*(np.asarray(position, np.float64)[:2] - spot)))
