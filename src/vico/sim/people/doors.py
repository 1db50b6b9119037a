"""Doors and lifts: how people and robots pass the doors of houses and rooms, and ride in lifts.

A person who goes in walks up to the entrance and opens it from outside, one who goes out does so from within.
`People.door_time` counts the seconds from the hand on the door on, and is negative before. The leaf begins to move
when the hand is on it (`vico.sim.bodies.rooms.DoorLeaves`). Through the open door a person walks (`People.passing`):
in from where they stand to a step behind the wall, and is in the room then; out from such a step to free ground. That
leads through the wall's opening, which the map knows nothing of; others are kept clear of all the same. One who can't
get on goes back.

Robots wait at doors until these are open and there is room behind. Who rides in a lift stays in the car of the floor
that was left until the ride is over, and then stands in the other.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from vico.geometry import wrap_angle
from vico.rules import ActionStatus, ReasonCode
from vico.sim.bodies.avatars import CLIP, free_ground
from vico.sim.bodies.footprints import OUTDOORS, Rectangle, concatenate_records, gaps, records_of
from vico.sim.bodies.state_arrays import DOOR_OPENING, LEVEL_GAZE, RADIUS, body_radius
from vico.sim.people.placement import (
    free_hand,
    gesture,
    place_in_room,
    put_outdoors,
    spot_outside,
    take_umbrella,
)
from vico.sim.state.simulation_state import SimulationState
from vico.world.model import LIFT, Place
from vico.world.walk_lengths import lift_seconds

#: People turn at doors so fast, radians a second.
TURN_RATE = 2.0 * math.pi
#: Seconds for which a door stays open after somebody was in it.
DOOR_HOLD = 0.4
_NEAR_GOAL = 0.03  # metres within which nobody turns to where they go
_INSIDE = 0.75  # m behind the closed leaf from which on one is in the room
_FROM = 0.8  # m behind the closed leaf where one comes from who leaves the room
_CLEAR = 0.35  # m before the closed leaf where one who goes out turns to where they want to go
_STEP = 0.45  # m before the closed leaf where the step begins
_PACE = 1.25  # m/s at which people walk through doors
_PATIENCE = 2.0  # s for which one waits in a door for others
_IN_LINE = 20.0  # s for which one waits at an open door until nobody is in it
_BESIDE, _QUEUE_APART = 0.03, 0.75  # metres that one keeps from others, and two who go the same way through one door
# Bodies are looked at whose middle is nearer than this, metres: people, and vehicles as well.
_REACH, _LONGEST = 1.5, 12.0
_BACK = 3.0  # metres from an entrance within which one who could not go in stands then
_EARLY = 1e-6  # sums of sub-steps are a little more or less than their time, seconds


def entrance_of(i: int, state: SimulationState) -> int:
    """Return the row of the entrance that somebody goes through in ``world.entrances``."""
    entrance = state.world.places[int(state.people.door[i])].entrance
    assert entrance is not None
    return state.base.entrance_index[entrance]


def begin_passing(i: int, state: SimulationState) -> None:
    """Have somebody walk through the door that is open now, as soon as nobody else is in it."""
    p = state.people
    number, outwards = int(p.door[i]), p.room[i] >= 0
    spot = spot_outside(i, state) if outwards else None
    if outwards and spot is None:
        _refuse_passing(i, ReasonCode.BLOCKED, "exit: somebody stands in front of the door", state)
    elif not outwards and _room_for(i, number, state) is None:
        _refuse_passing(i, ReasonCode.FULL, "enter: it is full", state)
    elif p.door_time[i] >= DOOR_OPENING + _IN_LINE:
        _refuse_passing(i, ReasonCode.BLOCKED, f"{'exit' if outwards else 'enter'}: somebody is in the door", state)
    elif _is_door_free(i, -1 if outwards else 1, state):
        p.passing[i], p.door_time[i], p.action_clip[i] = (-1 if outwards else 1), 0.0, -1
        if outwards:
            assert spot is not None
            _stand_behind(i, number, spot, state)


def _stand_behind(i: int, number: int, spot: NDArray[np.float64], state: SimulationState) -> None:
    """Have somebody stand a step behind the door that they go out by, to a spot."""
    p, door = state.people, state.base.house_doors[entrance_of(i, state)]
    take_umbrella(i, state)
    if number == state.homes[i]:
        p.clothes[i] = state.weather_to_dress_for()
    p.room[i] = p.place[i] = -1
    p.door_spot[i] = spot
    p.position[i] = *_point_behind_door(door, _FROM), float(door["z"])
    p.yaw[i] = math.atan2(-float(door["inward_y"]), -float(door["inward_x"]))
    p.pitch[i] = LEVEL_GAZE


def _point_behind_door(door: NDArray[np.void], inside: float) -> tuple[float, float]:
    """Return the point in the middle of a door, so many metres behind its closed leaf."""
    return float(door["x"] + inside * door["inward_x"]), float(door["y"] + inside * door["inward_y"])


def _depth_behind_door(door: NDArray[np.void], position: NDArray[np.float64]) -> float:
    """Return how far behind the closed leaf of a door a position is, metres."""
    dx, dy = float(position[0] - door["x"]), float(position[1] - door["y"])
    return dx * float(door["inward_x"]) + dy * float(door["inward_y"])


def _is_door_free(i: int, way: int, state: SimulationState) -> bool:
    """Whether nobody is in the door that somebody wants to go through, but ahead on the same way.

    Nobody who has waited longer to go the other way, either: they stand in front of it, and those who come out one
    after another would keep them there, and one another in the door, for ever.
    """
    p, entrance = state.people, entrance_of(i, state)
    for j in np.flatnonzero((p.door >= 0) & (p.passing == 0) & (p.door_time > p.door_time[i])).tolist():
        if (p.room[j] < 0) != (way > 0) and entrance_of(j, state) == entrance:
            return False
    door = state.base.house_doors[entrance]
    start = _point_behind_door(door, _FROM) if way < 0 else (float(p.position[i, 0]), float(p.position[i, 1]))
    for j in np.flatnonzero(p.passing != 0).tolist():
        if entrance_of(j, state) != entrance:
            continue
        if p.passing[j] != way or math.dist(start, p.position[j, :2].tolist()) < _QUEUE_APART:
            return False
    return True


def _room_for(i: int, number: int, state: SimulationState) -> NDArray[np.float64] | None:
    """Return where in the first room of a place one comes in; None if it is full."""
    room = state.indoor.index[state.world.places[number].rooms[0]]
    near = state.indoor.arrival(room, -1)
    return None if state.indoor.free_spot(room, near, state.taken_in(room, without=i)) is None else near


def _refuse_passing(i: int, code: ReasonCode, words: str, state: SimulationState) -> None:
    state.people.door[i], state.people.door_time[i] = -1, 0.0
    state.set_outcome(i, ActionStatus.REFUSED, code, words)


def walk_through(
    state: SimulationState, others: NDArray[np.void], dt: float
) -> tuple[NDArray[np.int64], NDArray[np.float64]] | None:
    """Move those who are in open doors on by `dt` seconds.

    Parameters
    ----------
    others
        Bodies that are no avatars, dtype `vico.sim.bodies.footprints.BODY`.

    Returns
    -------
    tuple or None
        Who was moved and is outdoors or in a door now, and how fast, m/s; None if nobody was.
    """
    p = state.people
    passing = (p.passing != 0).nonzero()[0]
    if not len(passing):
        return None
    velocity = np.array([_pass_on(i, state, others, dt) for i in passing.tolist()])
    still = p.room[passing] < 0
    return passing[still], velocity[still]


def _pass_on(i: int, state: SimulationState, others: NDArray[np.void], dt: float) -> tuple[float, float]:
    """Move somebody in an open door on; return how fast, m/s."""
    p, entrance = state.people, entrance_of(i, state)
    door = state.base.house_doors[entrance]
    state.leaves.hold(entrance, DOOR_HOLD)
    inside, here = _depth_behind_door(door, p.position[i]), p.position[i, :2].copy()
    if p.passing[i] > 0:
        goal = _point_behind_door(door, 0.0 if inside < -_BESIDE else _INSIDE)
    else:
        # A spot beside the door may be nearer to the wall than where one turns to others.
        clear = min(_CLEAR, -_depth_behind_door(door, p.door_spot[i]))
        to_spot = clear <= 0.0 or inside <= _BESIDE - clear
        goal = (p.door_spot[i, 0], p.door_spot[i, 1]) if to_spot else _point_behind_door(door, -clear)
    dx, dy = float(goal[0] - here[0]), float(goal[1] - here[1])
    left = math.hypot(dx, dy)
    step = min(_PACE * dt, left)
    there = here + np.array([dx, dy]) * (step / left if left > 0.0 else 0.0)
    turn = wrap_angle(math.atan2(dy, dx) - float(p.yaw[i])) if left > _NEAR_GOAL else 0.0
    p.yaw[i] = wrap_angle(float(p.yaw[i]) + min(max(turn, -TURN_RATE * dt), TURN_RATE * dt))
    p.move_speed[i] = _PACE
    if _is_in_the_way(i, here, there, state, others):
        p.door_time[i] += dt
        if p.door_time[i] >= _PATIENCE:
            _go_back(i, state)
        return 0.0, 0.0
    p.position[i, :2] = there
    inside = _depth_behind_door(door, there)
    on_step = inside > -_STEP
    p.position[i, 2] = float(door["z"]) if on_step else float(state.world.height(there))
    if p.passing[i] > 0 and inside >= _INSIDE - _EARLY:
        _go_in(i, int(p.door[i]), state)
    elif p.passing[i] < 0 and math.dist(there.tolist(), p.door_spot[i].tolist()) < _EARLY:
        _go_out(i, int(p.door[i]), state)
    return float(there[0] - here[0]) / dt, float(there[1] - here[1]) / dt


def _is_in_the_way(
    i: int, here: NDArray[np.float64], there: NDArray[np.float64], state: SimulationState, others: NDArray[np.void]
) -> bool:
    """Whether a step would bring somebody nearer to another body outdoors than one keeps."""
    p = state.people
    away = np.abs(p.position[:, :2] - there)
    near = np.flatnonzero(p.outdoors() & (away[:, 0] < _REACH) & (away[:, 1] < _REACH))
    near = near[near != i]
    beside = (np.abs(others["x"] - there[0]) < _LONGEST) & (np.abs(others["y"] - there[1]) < _LONGEST)
    beside &= others["space"] == OUTDOORS
    if not len(near) and not beside.any():
        return False
    bodies = concatenate_records([records_of(p.bodies_of(near)), others[beside]])
    bodies = bodies[bodies["space"] == OUTDOORS]
    if not len(bodies):
        return False
    radius = float(body_radius(p.height[i : i + 1])[0])
    now, then = (gaps(Rectangle(float(xy[0]), float(xy[1]), 1.0, 0.0, 0.0, 0.0), bodies) for xy in (here, there))
    return bool(((then < radius + _BESIDE) & (then < now)).any())


def _go_back(i: int, state: SimulationState) -> None:
    """Have somebody who can't get on in a door go back to where they came from, if there is room."""
    p, number = state.people, int(state.people.door[i])
    inwards = p.passing[i] > 0
    if not inwards:
        near = _room_for(i, number, state)
        if near is not None:
            place_in_room(i, state.indoor.index[state.world.places[number].rooms[0]], state, near=near)
            _refuse_passing(i, ReasonCode.BLOCKED, "exit: somebody stands in front of the door", state)
        return
    entrance = state.entrances[state.world.places[number].entrance or ""]
    spot = free_ground(state.world.walkable, np.asarray(entrance.approach), state.obstacles_to(i), within=_BACK)
    if spot is not None:
        put_outdoors(i, spot, entrance.facing, state)
        _refuse_passing(i, ReasonCode.BLOCKED, "enter: somebody stands in the door", state)


def _go_in(i: int, number: int, state: SimulationState) -> None:
    p, place = state.people, state.world.places[number]
    near = _room_for(i, number, state)
    if near is None:  # it has filled up since
        p.door_time[i] = _PATIENCE
        _go_back(i, state)
        return
    place_in_room(i, state.indoor.index[place.rooms[0]], state, near=near)
    p.door_time[i] = 0.0
    state.events.add("enter", p.names[i], f"enters {place.name}", p.position[i], place=place.id)


def _go_out(i: int, number: int, state: SimulationState) -> None:
    p, place = state.people, state.world.places[number]
    put_outdoors(i, p.door_spot[i].copy(), float(p.yaw[i]), state)
    p.door_time[i] = 0.0
    state.events.add("exit", p.names[i], f"leaves {place.name}", p.position[i], place=place.id)


_WAY_UP = 1.0  # s that one takes up to the door at most
_ARM = 0.5  # m from the door to where one stands before it
_SLOWEST = 0.6  # m/s up to the door at least
_FASTEST = 1.55  # m/s up to the door at most
# People walk to the door as soon as they nearly face it, radians.
_AHEAD, _FACING = 0.6, 0.05
_NEAR_DOOR = 0.03  # nearer to where one stands at the door nobody walks, metres
_THROUGH = 0.66  # in the cycle of the motion of a hand at a door: it is at the door behind
# The leaf moves from so long after the hand's way to it began, seconds.
_PUSHED = 0.25


def approach_door(i: int, place: int, state: SimulationState) -> None:
    """Have somebody set out for the door of a place: from the street to go in, from its room to go out."""
    p = state.people
    p.door[i] = place
    p.door_time[i] = -_WAY_UP
    turn, way = _way_to_door(i, state)
    if way <= _NEAR_DOOR and abs(turn) <= _FACING:
        p.door_time[i] = 0.0
        _reach_for_door(i, state)


def _way_to_door(i: int, state: SimulationState) -> tuple[float, float]:
    """Return how far somebody has to turn to the door, radians, and to walk up to it, metres."""
    p = state.people
    room = int(p.room[i])
    if room < 0:
        door = state.base.house_doors[entrance_of(i, state)]
        x, y = float(door["x"]), float(door["y"])
    else:
        x, y, _ = next(door.position for door in state.indoor.doors[room] if door.to < 0)
    dx, dy = x - float(p.position[i, 0]), y - float(p.position[i, 1])
    away = math.hypot(dx, dy)
    return (wrap_angle(math.atan2(dy, dx) - float(p.yaw[i])) if away > _NEAR_DOOR else 0.0), max(away - _ARM, 0.0)


def _reach_for_door(i: int, state: SimulationState) -> None:
    """Have a hand go to the door, if one is free; who has both full pushes it open with what they carry."""
    hand = free_hand(i, state)
    if hand is not None:
        gesture("open_door", i, state, hand=hand)


def walk_to_doors(state: SimulationState, share: NDArray[np.float64], dt: float) -> None:
    """Turn and set going who is on the way to a door; `share`, as `Avatars.advance` takes it, is theirs after it."""
    p = state.people
    for i in p.at_door().nonzero()[0].tolist():
        if p.passing[i]:
            p.turn_left[i] = p.move_left[i] = 0.0
            continue
        turn, way = _way_to_door(i, state)
        step = TURN_RATE * dt
        p.turn_left[i] = min(max(turn, -step), step) if abs(turn) > _FACING else 0.0
        share[i] = 1.0
        p.move_left[i] = p.move_speed[i] = 0.0
        if p.door_time[i] < 0.0 and abs(turn) < _AHEAD and way > _NEAR_DOOR:
            left = max(-float(p.door_time[i]), dt)
            p.move_left[i] = way
            p.move_speed[i] = min(max(way / left, _SLOWEST), _FASTEST)


def open_doors(state: SimulationState, dt: float) -> None:
    """Let doors be opened and gone through for `dt` seconds."""
    p = state.people
    for i in ((p.door >= 0) & (p.passing == 0)).nonzero()[0].tolist():
        # Whom something stops opens the door from there.
        stopped = p.status[i] == ActionStatus.COLLISION
        if stopped:
            p.status[i], p.contact[i] = ActionStatus.OK, 0
        before = float(p.door_time[i])
        turn, way = _way_to_door(i, state)
        if before >= 0.0 or abs(turn) < _AHEAD:
            p.door_time[i] += dt
        if before < 0.0:
            arrived = abs(turn) <= _FACING and (way <= _NEAR_DOOR or stopped)
            if arrived or p.door_time[i] >= -_EARLY:
                p.door_time[i] = 0.0
                _reach_for_door(i, state)
            continue
        if p.door_time[i] >= _PUSHED:
            state.leaves.hold(entrance_of(i, state), DOOR_HOLD)
        if p.door_time[i] >= DOOR_OPENING - _EARLY:
            begin_passing(i, state)


def release_door(i: int, state: SimulationState) -> None:
    """Show a hand that lets go of the door that somebody has just come through, if one is free."""
    hand = free_hand(i, state)
    if hand is None:
        return
    p = state.people
    gesture("open_door", i, state, hand=hand)
    p.clip_before[i], p.phase_before[i], p.pace_before[i] = p.clip[i], p.phase[i], p.pace[i]
    p.clip[i], p.phase[i], p.clip_time[i] = CLIP["open_door"], _THROUGH, 0.0


def is_lift_ride(origin: int, room: int, state: SimulationState) -> bool:
    """Return whether it is a ride from one room to another: both are cars of a lift."""
    rooms = state.indoor.rooms
    return origin >= 0 and rooms[origin].kind == rooms[room].kind == LIFT


def begin_lift_ride(i: int, room: int, state: SimulationState) -> None:
    """Have someone ride from the car they are in to the car of another floor."""
    p, rooms = state.people, state.indoor.rooms
    p.lift_room[i] = room
    p.lift_left[i] = lift_seconds(rooms[room].centre[2] - rooms[int(p.room[i])].centre[2])


def advance_lifts(state: SimulationState, dt: float) -> None:
    """Let lifts go on for `dt` seconds; who has arrived gets out when there is room in the car, and nobody before."""
    p = state.people
    if not p.lift_left.any():
        return
    for i in np.flatnonzero(p.lift_left > 0.0).tolist():
        room = int(p.lift_room[i])
        if not is_lift_ride(int(p.room[i]), room, state):  # somebody put them elsewhere
            p.lift_left[i] = 0.0
            continue
        p.lift_left[i] -= dt
        if p.lift_left[i] > 1e-6:
            continue
        near = state.indoor.arrival(room, int(p.room[i]))
        if state.indoor.free_spot(room, near, state.taken_in(room, without=i)) is None:
            p.lift_left[i] = dt
            continue
        p.lift_left[i] = 0.0
        place_in_room(i, room, state, near=near)


#: Metres between a robot that has come through a door and others.
_ROBOT_APART = 0.1
# Seconds for which doors stay open after robots.
_ROBOT_DOOR_HOLD = 0.8


def advance_robots_at_doors(state: SimulationState, dt: float) -> None:
    """Let robots that wait at doors go through, and ride in lifts; who finds a place shut gives up."""
    robots = state.robots
    if robots is None:
        return
    for robot, room in robots.at_doors():
        origin = int(robots.rooms[robot])
        place = None
        if origin < 0:  # it enters the place that it is going to, behind whichever door that is
            goal = robots.trip_room(robot)
            place = place_of_room(goal if goal >= 0 else room, state)
        if place is not None and closed_reason(place, state):
            robots.give_up(robot)
            continue
        if room >= 0 and is_lift_ride(origin, room, state):
            rooms = state.indoor.rooms
            if robots.ride(robot, dt) < lift_seconds(rooms[room].centre[2] - rooms[origin].centre[2]) - 1e-6:
                continue
        if -1 in (origin, room):
            inside = room if origin < 0 else origin
            entrance = state.world.places[int(state.indoor.place[inside])].entrance
            if entrance is not None:
                number = state.base.entrance_index[entrance]
                state.leaves.hold(number, _ROBOT_DOOR_HOLD)
                if state.leaves.share_of(number) < 1.0 - 1e-6:  # it opens
                    continue
        if robots.pass_door(robot, room, _occupied_discs(robot, room, state)):
            name, position = robots.names[robot], robots.bodies().position[robot]
            if origin < 0 and place is not None:
                state.events.add("enter", name, f"enters {place.name}", position, place=place.id)
            left = place_of_room(origin, state)
            if room < 0 and left is not None:
                state.events.add("exit", name, f"leaves {left.name}", position, place=left.id)
    # Things on decks are in the rooms that the robots are in.
    objects = state.objects
    carried = np.flatnonzero((objects.holder != 0) & (objects.hand < 0))
    if not len(carried):
        return
    room_of = dict(zip(robots.bodies().entity.tolist(), robots.rooms.tolist(), strict=True))
    for k in carried.tolist():
        objects.room[k] = room_of.get(int(objects.holder[k]), int(objects.room[k]))


def closed_reason(place: Place, state: SimulationState) -> str:
    """Why nobody without an appointment is let into a place now; "" if it is open."""
    closure = state.environment.agenda.effects.shut.get(place.id)
    if closure is not None:
        return f"{place.name} is closed ({closure.event.title})"
    if state.openings is None or state.openings.is_open(place.id, state.second):
        return ""
    return f"{place.name} is closed now; it is {state.openings.hours(place.id)}"


def place_of_room(room: int, state: SimulationState) -> Place | None:
    """Return the place a room belongs to."""
    index = int(state.indoor.place[room]) if room >= 0 else -1
    return state.world.places[index] if index >= 0 else None


def _occupied_discs(robot: int, room: int, state: SimulationState) -> NDArray[np.float64]:
    """Discs (x, y, radius) in which the middle of a robot that comes into a room (-1: outdoors) cannot be."""
    assert state.robots is not None
    own = state.robots.room_needed(robot) + _ROBOT_APART
    if room < 0:
        bodies = state.obstacles()
        reach = np.hypot(bodies.half_length, bodies.half_width)
        return np.column_stack([bodies.position[:, :2], reach + own])
    points = state.taken_in(room)
    return np.column_stack([points[:, :2], np.full(len(points), RADIUS + own)])
