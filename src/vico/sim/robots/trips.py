"""Trips of robots: paths outdoors, from door to door, and through doors into rooms.

A path outdoors is wide enough for the robot and clear of others. A trip to another room is gone leg by leg: to the next
door, through it, on from behind it. Whether a door can be gone through is for the simulation to say
(`vico.sim.people.doors`), which knows who stands behind it.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import MobileManipulator, SkidSteering
from vico.geometry import distance
from vico.sim.bodies.arrays import Bodies
from vico.sim.bodies.state_arrays import People
from vico.sim.physics.composite_engine import CompositeEngine
from vico.sim.robots.path_planning import DOORWAY, OUTDOORS, fits_doors, turning_radius
from vico.sim.robots.state import NONE, RobotRun
from vico.world.model import Entrance

_NOBODY = np.zeros((0, 3))


def outdoor_path(
    run: RobotRun,
    robot: int,
    goal: NDArray[np.float64],
    closed: NDArray[np.float64] = _NOBODY,
    *,
    start: NDArray[np.float64] | None = None,
) -> NDArray[np.float64] | None:
    """Return a way outdoors to a point that keeps clear of discs and of closed ground; None if there is none.

    Whoever stands on ground that is closed may take any way out of it.

    Parameters
    ----------
    goal
        ENU metres; its x and y count.
    closed
        Discs to keep out of: x, y, radius, metres, shape ``(m, 3)``.
    start
        Where it begins, ENU metres; None: where the robot is.

    Returns
    -------
    ndarray or None
        Points of a polyline that begins at the robot, ENU metres, shape ``(k, 2)``, ``k >= 2``.
    """
    scene, walkable = run.scene, run.scene.world.walkable
    blocked = scene.narrow(robot)
    here = run.position(robot)[:2] if start is None else start[:2]
    if run.closed_ground:
        if is_on_closed_ground(run, np.asarray(goal, np.float64)[None, :2]):
            return None
        if not is_on_closed_ground(run, here[None]):
            blocked = blocked | walkable.cells_within(run.closed_ground)
    if len(closed):
        blocked = blocked.copy()
        for x, y, radius in closed:
            (i0, j0), (i1, j1) = walkable.cell_of([[x - radius, y - radius], [x + radius, y + radius]])
            yy, xx = np.mgrid[j0 : j1 + 1, i0 : i1 + 1]
            centres = walkable.centre_of(np.stack([xx, yy], axis=-1))
            blocked[j0 : j1 + 1, i0 : i1 + 1] |= np.hypot(centres[..., 0] - x, centres[..., 1] - y) < radius
    path = scene.router.path(here, np.asarray(goal, np.float64)[:2], blocked=blocked)
    if path is None:
        return None
    # The search may begin in a cell beside the robot's own.
    return path if len(path) > 1 and np.allclose(path[0], here) else np.vstack([here, path])


def is_on_closed_ground(run: RobotRun, points: NDArray[np.float64]) -> bool:
    """Return whether events close the ground at any of some points, ENU metres, shape ``(k, 2)``."""
    x, y, radius = np.array(run.closed_ground).reshape(-1, 3).T
    return bool((np.hypot(points[:, :1] - x, points[:, 1:] - y) < radius).any())


def errand_path(run: RobotRun, robot: int) -> NDArray[np.float64] | None:
    """Draw another place for a robot, 40 to 250 m away, and return a way there; None if there is none."""
    run.arrays.errand[robot] += 1
    goals = run.scene.goals
    away = np.hypot(*(goals - run.position(robot)[:2]).T)
    order = run.errand_stream(robot).permutation(np.flatnonzero((away > 40.0) & (away < 250.0)))
    ways = (outdoor_path(run, robot, goals[index]) for index in order[:5])
    return next((way for way in ways if way is not None), None)


Array = NDArray[np.float64]

#: Metres from a point in a room within which a way to it may end, and from the middle of a robot to a door it goes
#: through, beside half its length: as near as people have to be.
_NEAR_GOAL, _NEAR_DOOR = 0.75, 1.0
#: Metres from an entrance within which a robot stands before it, and between points that are tried there.
_BEFORE_ENTRANCE, _TRIED = 4.0, 0.25
#: Slope from the ground before an entrance up to its door that wheels take.
_RAMP = 0.2
#: Metres from its door within which who comes into a room stands.
_BEHIND_DOOR = 2.5

# Whether a robot can get somewhere.


def trip_refusal(run: RobotRun, robot: int, space: int, goal: Array) -> str:
    """Why a robot can't go from where it is to a point of a room, or outdoors; "" if it can."""
    model, rooms = run.scene.models[robot], run.scene.rooms
    here, at = int(run.trips.room[robot]), run.position(robot)
    if space != here and not fits_doors(model):
        return f"it is {2 * model.half_width:.2f} m wide, too wide for doors of {DOORWAY:g} m"
    for _ in range(len(rooms.indoor.rooms) + 2):
        if here == space:
            return "" if _path_in_space(run, robot, here, at, goal, _NEAR_GOAL) is not None else _too_narrow(run, here)
        to = rooms.next_room(here, space)
        if to is None:
            return "no way leads there but stairs, and there is no lift"
        reason = _entrance_refusal(run, robot, max(here, to)) if OUTDOORS in (here, to) else ""
        if reason:
            return reason
        if path_to_door(run, robot, here, at, to) is None:
            return _too_narrow(run, here)
        spot = arrival_spot(run, robot, to, here, _NOBODY)
        if spot is None:
            return _too_narrow(run, to)
        here, at = to, spot
    return "no way leads there"


def _too_narrow(run: RobotRun, space: int) -> str:
    where = "outdoors" if space == OUTDOORS else f"in room {run.scene.rooms.room(space).id}"
    return f"no way {where} is wide enough for this robot"


def _entrance_refusal(run: RobotRun, robot: int, room: int) -> str:
    """Why a robot can't go through the entrance to a room."""
    entrance, model = run.scene.rooms.entrances[room], run.scene.models[robot]
    spot = spot_before_entrance(run, robot, entrance)
    if spot is None:
        return "there is no room for this robot before the entrance"
    if isinstance(model.controller, SkidSteering | MobileManipulator):
        up = abs(float(run.scene.world.height(spot)) - entrance.position[2])
        away = float(np.hypot(*(spot - np.array(entrance.position[:2]))))
        if up > _RAMP * away:
            return f"the entrance is {up:.2f} m above or below the ground before it, and this robot has wheels"
    return ""


# Ways.


def path_to_door(run: RobotRun, robot: int, here: int, at: Array, to: int) -> Array | None:
    """Return the way from a point of a space to the door to the next one; None if there is none."""
    rooms, model = run.scene.rooms, run.scene.models[robot]
    if here == OUTDOORS:
        spot = spot_before_entrance(run, robot, rooms.entrances[to])
        return None if spot is None else _path_in_space(run, robot, here, at, spot, _NEAR_GOAL)
    return _path_in_space(run, robot, here, at, rooms.door(here, to), _NEAR_DOOR + model.half_length)


def _path_in_space(run: RobotRun, robot: int, here: int, at: Array, goal: Array, within: float) -> Array | None:
    if here != OUTDOORS:
        radius = turning_radius(run.scene.models[robot])
        return run.scene.rooms.path(here, at, goal, radius, within=within)
    path = outdoor_path(run, robot, goal, start=at[:2])
    if path is None or distance(path[-1], goal[:2]) > max(within, 1.0):
        return None
    return path


def path_around(run: RobotRun, robot: int, goal: Array, closed: Array) -> Array | None:
    """Return another way to a point of the space that a robot is in, clear of discs; None if there is none."""
    trips, model = run.trips, run.scene.models[robot]
    if trips.room[robot] == OUTDOORS:
        return outdoor_path(run, robot, goal, closed)
    within = _NEAR_GOAL if trips.leg[robot] == NONE else _NEAR_DOOR + model.half_length
    room, radius = int(trips.room[robot]), turning_radius(model)
    return run.scene.rooms.path(room, run.position(robot), goal, radius, within=within, closed=closed)


def begin_leg(run: RobotRun, robot: int, space: int, goal: Array) -> bool:
    """Set out for a point of a space: on a way to it, or to the next door; return False if there is none."""
    trips, here, at = run.trips, int(run.trips.room[robot]), run.position(robot)
    to = NONE
    if here == space:
        path = (
            outdoor_path(run, robot, goal)
            if here == OUTDOORS
            else _path_in_space(run, robot, here, at, goal, _NEAR_GOAL)
        )
    else:
        found = run.scene.rooms.next_room(here, space) if fits_doors(run.scene.models[robot]) else None
        path = None if found is None else path_to_door(run, robot, here, at, found)
        if path is not None and OUTDOORS in (here, found) and _entrance_refusal(run, robot, max(here, found or 0)):
            path = None
        to = NONE if found is None else found
    if path is None:
        return False
    run.followers[robot].begin(path)
    trips.goal_room[robot], trips.goal[robot, : len(goal)] = space, goal
    trips.leg[robot], trips.door[robot] = to, NONE
    return True


# Doors.


def spot_before_entrance(run: RobotRun, robot: int, entrance: Entrance, closed: Array = _NOBODY) -> Array | None:
    """Return where a robot stands before an entrance, clear of discs (x, y, radius), shape ``(2,)``; None for none."""
    walkable, model = run.scene.world.walkable, run.scene.models[robot]
    steps = np.arange(-_BEFORE_ENTRANCE, _BEFORE_ENTRANCE + _TRIED / 2, _TRIED)
    grid = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2) + np.array(entrance.approach)
    away = np.hypot(*(grid - np.array(entrance.position[:2])).T)
    free = (walkable.clearance_at(grid) >= turning_radius(model)) & walkable.is_connected(grid)
    free &= away <= _BEFORE_ENTRANCE
    if len(closed):
        apart = np.hypot(grid[:, :1] - closed[:, 0], grid[:, 1:] - closed[:, 1])
        free &= (apart >= closed[:, 2]).all(axis=1)
    if not free.any():
        return None
    away[~free] = np.inf
    return np.asarray(grid[int(away.argmin())])


def arrival_spot(run: RobotRun, robot: int, space: int, origin: int, taken: Array) -> Array | None:
    """Return where a robot stands that comes through a door, ENU metres, shape ``(2,)``; None if there is no room.

    Parameters
    ----------
    space, origin
        Where it comes to and from: rooms, or `OUTDOORS`.
    taken
        Discs (x, y, radius) that others stand in.
    """
    rooms, radius = run.scene.rooms, turning_radius(run.scene.models[robot])
    if space == OUTDOORS:
        return spot_before_entrance(run, robot, rooms.entrances[origin], taken)
    near = rooms.indoor.arrival(space, origin)
    return rooms.spot(space, near, radius, taken, _BEHIND_DOOR)


def pass_door(run: RobotRun, robot: int, space: int, taken: Array) -> bool:
    """Have a robot come through a door; return False if no spot behind it is clear of discs. It goes on from there."""
    trips, rooms = run.trips, run.scene.rooms
    origin = int(trips.room[robot])
    spot = arrival_spot(run, robot, space, origin, taken)
    if spot is None:
        return False
    if space == OUTDOORS:
        yaw = rooms.entrances[origin].facing
    else:
        ahead = spot - rooms.door(space, origin)[:2]
        yaw = math.atan2(ahead[1], ahead[0])
    place, engine = np.array([*spot, yaw]), run.composite_engine()
    if space == OUTDOORS:
        engine.release(robot, place)
        run.unhouse()
    else:
        centre = np.array(rooms.room(space).centre)
        engine.house(robot, run.scene.room_physics(robot), centre, place)
    trips.room[robot], trips.door[robot], trips.leg[robot], trips.ride[robot] = space, NONE, NONE, 0.0
    run.forget(robot)
    return True


def set_room_obstacles(run: RobotRun, dt: float) -> None:
    """Tell physics in rooms who and what is around each robot there, and arrives in `dt` seconds."""
    engine = run.engine
    if isinstance(engine, CompositeEngine):
        for robot in engine.inside:
            solids = run.scene.rooms.solids(int(run.trips.room[robot]))
            engine.surround(robot, Bodies.joined([solids, others_in_room(run, robot)]), dt)


def others_in_room(run: RobotRun, robot: int) -> Bodies:
    """Bodies of people, things and other robots in the room that a robot is in."""
    room = int(run.trips.room[robot])
    robots = np.flatnonzero(run.trips.room == room)
    parts = [run.bodies().where(robots[robots != robot])]
    if run.people is not None:
        parts.append(run.people.bodies_of(np.flatnonzero(run.people.room == room)))
    lying = run.objects.in_rooms()
    parts.append(run.objects.bodies_of(lying[run.objects.room[lying] == room]))
    return Bodies.joined(parts)


def space_of_body(run: RobotRun, entity: int, outdoors: Bodies) -> tuple[int, Array] | None:
    """Return the space a body is in and where in it, ENU metres; None for one that is in none, or unknown."""
    mine = np.flatnonzero(run.entities == entity)
    if len(mine):
        return int(run.trips.room[mine[0]]), run.position(int(mine[0]))
    found = np.flatnonzero(outdoors.entity == entity)
    if len(found):
        return OUTDOORS, outdoors.position[found[0]]
    people: People | None = run.people
    if people is None:
        return None
    found = np.flatnonzero((people.entity == entity) & (people.room >= 0))
    return (int(people.room[found[0]]), people.position[found[0]]) if len(found) else None
