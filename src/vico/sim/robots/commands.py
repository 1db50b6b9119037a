"""Commands to robots, and what each robot does for the next sub-step.

A robot is told a vector in one of its action spaces, a place to go to, whom to follow, or to stop. From that, and from
the ground ahead (slopes and walls), follows the velocity for its controller.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.errors import InputError
from vico.sim.bodies.arrays import Bodies
from vico.sim.physics.records import Base
from vico.sim.robots import arm_tasks, flying
from vico.sim.robots.arm_tasks import decide_task, handled_object, object_in_hand
from vico.sim.robots.flying import LOW_BATTERY, decide_flight
from vico.sim.robots.path_following import SIGHT, NearbyBodies, RobotStatus, braking_on_slope, speed_to_stop
from vico.sim.robots.path_planning import OUTDOORS
from vico.sim.robots.state import NONE, Circles, RobotMode, RobotRun
from vico.sim.robots.trips import (
    begin_leg,
    errand_path,
    is_on_closed_ground,
    others_in_room,
    outdoor_path,
    path_around,
    space_of_body,
)
from vico.world.walkable import BLOCKED, CROSSING, ROADWAY


def command(run: RobotRun, robot: int, vector: ArrayLike, space: str = "") -> None:
    """Follow a vector until another command comes.

    Parameters
    ----------
    vector
        One number an entry of the space, in its units; clipped to its bounds.
    space
        Name of one of the model's action spaces; "" for its own.

    Raises
    ------
    InputError
        If there is no such space, or the vector is of another size or not finite.
    """
    model, values = run.scene.models[robot], np.asarray(vector, np.float64)
    name = space or model.default_space
    if name not in model.action_spaces:
        known = ", ".join(model.action_spaces)
        raise InputError(f"control: {model.title} has no action space {name!r}; choose among {known}")
    chosen = model.action_spaces[name]
    if values.shape != (len(chosen),) or not np.isfinite(values).all():
        raise InputError(f"control: {model.title} takes {len(chosen)} finite numbers, not {values.tolist()}")
    flying.hold_position(run, robot)
    arm_tasks.abandon_task(run, robot)
    run.arrays.command[robot] = 0.0
    run.arrays.command[robot, : len(values)] = np.clip(values, chosen.low, chosen.high)
    run.set_mode(robot, RobotMode.MOTORS if chosen.drives == "motors" else RobotMode.VELOCITY)


def stop(run: RobotRun, robot: int) -> None:
    """Stand still, or hover."""
    flying.hold_position(run, robot)
    arm_tasks.abandon_task(run, robot)
    run.set_mode(robot, RobotMode.IDLE)


def go_to(run: RobotRun, robot: int, goal: NDArray[np.float64], room: int = -1) -> bool:
    """Take a way to a point of a room (-1: outdoors); return False, and change nothing, without one."""
    if run.scene.models[robot].rotors is not None:
        target = flying.cruise_point(run, goal)
        if room >= 0 or run.scene.airspace.refusal(target):
            return False
        flying.fly_to(run, robot, target)
        return True
    if room >= 0 or run.trips.room[robot] >= 0:
        if not begin_leg(run, robot, room, goal):
            return False
        arm_tasks.abandon_task(run, robot)
        run.set_mode(robot, RobotMode.ROUTE)
        return True
    path = outdoor_path(run, robot, goal)
    if path is None:
        return False
    follow_path(run, robot, path)
    return True


def follow_path(run: RobotRun, robot: int, path: ArrayLike) -> None:
    """Follow a polyline, ENU metres, shape ``(k, 2)``, ``k >= 2``.

    Raises
    ------
    InputError
        If it is none, or the robot follows no velocities, or flies.
    """
    points = np.ascontiguousarray(path, np.float64)
    if points.ndim != 2 or points.shape[1] != 2 or len(points) < 2 or not np.isfinite(points).all():
        raise InputError(f"follow: a path is two or more finite points x, y, not {points.shape}")
    _need_velocities(run, robot, "follow")
    if run.scene.models[robot].rotors is not None:
        raise InputError(f"follow: {run.scene.models[robot].title} flies: send it to points")
    arm_tasks.abandon_task(run, robot)
    run.trips.end(robot)
    run.followers[robot].begin(points)
    run.set_mode(robot, RobotMode.ROUTE)


def follow_body(run: RobotRun, robot: int, entity: int) -> None:
    """Keep near a body, wherever it goes.

    Raises
    ------
    InputError
        If the robot follows no velocities.
    """
    _need_velocities(run, robot, "follow")
    flying.hold_position(run, robot)
    arm_tasks.abandon_task(run, robot)
    run.followers[robot].end()
    run.trips.end(robot)
    run.set_mode(robot, RobotMode.FOLLOW)
    run.arrays.leader[robot] = entity


def set_closed_ground(run: RobotRun, circles: Circles) -> None:
    """Say which ground events close from now on: ways across it are planned anew, or given up where there is no other.

    Parameters
    ----------
    circles
        x, y and radius, ENU metres.
    """
    if circles == run.closed_ground:
        return
    run.closed_ground = circles
    for robot, follower in enumerate(run.followers):
        if (
            run.trips.room[robot] >= 0
            or not len(follower.path)
            or not circles
            or not is_on_closed_ground(run, follower.ahead())
        ):
            continue
        path = outdoor_path(run, robot, follower.path[-1])
        if path is not None:
            follower.begin(path)
        elif run.arrays.mode[robot] == RobotMode.FOLLOW:
            follower.end()
        else:
            run.note(robot, "blocked")
            stop(run, robot)
            run.arrays.status[robot] = RobotStatus.BLOCKED


def _need_velocities(run: RobotRun, robot: int, what: str) -> None:
    model = run.scene.models[robot]
    if model.velocity_limit is None:
        raise InputError(f"{what}: {model.title} follows no velocities; command its motors")


#: Metres over which a slope counts: a robot brakes on the whole of it.
_REACH = 1.2
_STEP = 0.25  # m ahead between two points that are looked at for walls
_POINTS = 8  # how many of them
_TOUCH = 0.3  # m/s at which a robot may touch a wall


def slope_ahead(run: RobotRun, robot: int, base: Base) -> float:
    """Return by how much the ground falls for each metre ahead of a robot; floors of rooms are level."""
    if run.trips.room[robot] != OUTDOORS:
        return 0.0
    x, y = base.position[:2].tolist()
    ahead = x + _REACH * math.cos(base.yaw), y + _REACH * math.sin(base.yaw)
    here, there = run.scene.world.height(np.array([(x, y), ahead])).tolist()
    return float(here - there) / _REACH


def speed_at_walls(run: RobotRun, robot: int, base: Base, brake: float) -> float:
    """Return the fastest that a robot may go straight on to touch what stands there slowly, m/s; indoors any.

    `brake` is how hard it brakes, m/s2.
    """
    if run.trips.room[robot] != OUTDOORS:
        return math.inf
    along = run.scene.models[robot].half_length + _STEP * np.arange(_POINTS)
    points = base.position[:2] + along[:, None] * (math.cos(base.yaw), math.sin(base.yaw))
    walls = np.flatnonzero(run.scene.world.walkable.class_at(points) == BLOCKED)
    if not len(walls):
        return math.inf
    return max(_TOUCH, math.sqrt(2.0 * brake * _STEP * float(walls[0])))


# What the states' arrays hold: members of an enumeration are slow to look up in the control loop.
_IDLE, _VELOCITY, _MOTORS, _ROUTE, _FOLLOW, _TASK = (int(mode) for mode in RobotMode)
_FALLEN = int(RobotStatus.FALLEN)
#: Seconds a robot on errands rests between two.
_REST = 5.0
#: Metres a robot keeps from whom it follows, and how far that one has to go for another way to be found.
_FOLLOW_GAP, _FOLLOW_DRIFT = 1.2, 1.0


def decide(run: RobotRun, dt: float, obstacles: Bodies, mine: Bodies, *, errands: bool) -> None:
    """Set what every robot follows for the next `dt` seconds.

    Parameters
    ----------
    obstacles, mine
        Bodies of everybody else outdoors, and of the robots.
    errands
        Robots that nobody commands go from place to place.
    """
    arrays = run.arrays
    arrays.velocity[:] = 0.0
    flying: set[int] = set()
    everybody: Bodies | None = None
    for flight in run.flights:
        if flight is not None:
            everybody = everybody or Bodies.joined([obstacles, mine])
            decide_flight(run, flight, dt, everybody, errands=errands)
            flying.update(flight.robots.tolist())
    around: NearbyBodies | None = None
    for robot, mode in enumerate(arrays.mode.tolist()):
        if robot in flying or arrays.status[robot] == _FALLEN or mode == _MOTORS:
            continue
        if mode == _IDLE:
            if errands and arrays.charge[robot] > 0.0 and run.trips.room[robot] == OUTDOORS:
                _rest(run, robot, dt)
            continue
        around = around or NearbyBodies(obstacles, mine)
        own = handled_object(run, robot)
        if run.trips.room[robot] >= 0:
            inside = NearbyBodies(others_in_room(run, robot), mine.where(np.array([robot])))
            others = inside.near(0, SIGHT + 4)
        elif own:
            others = NearbyBodies(obstacles.where(obstacles.entity != own), mine).near(robot, SIGHT + 4)
        else:
            others = around.near(robot, SIGHT + 4)
        if mode == _VELOCITY:
            _hold_velocity(run, robot, others)
        elif mode == _ROUTE:
            _keep_to_way(run, robot, others, dt)
        elif mode == _FOLLOW:
            _keep_near(run, robot, others, dt, around.bodies)
        elif mode == _TASK and decide_task(run, robot, around.bodies, dt):
            # It is on its way to where the arm has something to do; where it can't be gone, that has to do.
            arrays.status[robot] = status = _steer(run, robot, others, dt)
            if status in (RobotStatus.ARRIVED, RobotStatus.BLOCKED):
                run.followers[robot].end()


def _rest(run: RobotRun, robot: int, dt: float) -> None:
    """Let time pass until the next errand; with a low battery there is none, but away from where vehicles are."""
    arrays = run.arrays
    is_low = run.scene.models[robot].battery is not None and arrays.charge[robot] <= LOW_BATTERY
    if run.scene.models[robot].velocity_limit is None or (is_low and not _stands_on_roadway(run, robot)):
        return
    arrays.rest[robot] += dt
    if arrays.rest[robot] > _REST or arrays.errand[robot] == 0:
        arrays.rest[robot] = 0.0
        path = errand_path(run, robot)
        if path is not None:
            follow_path(run, robot, path)


def _stands_on_roadway(run: RobotRun, robot: int) -> bool:
    """Return whether a robot stands where vehicles drive."""
    x, y = run.position(robot)[:2].tolist()
    return run.scene.world.walkable.class_of(x, y) in (ROADWAY, CROSSING)


def _hold_velocity(run: RobotRun, robot: int, others: NDArray[np.void]) -> None:
    """Follow the velocity asked for, but drive into nobody ahead, and touch walls slowly."""
    velocity, base = run.arrays.velocity[robot], run.engine.base(robot)
    velocity[:] = run.arrays.command[robot, :3]
    run.arrays.status[robot] = RobotStatus.MOVING
    if velocity[0] <= 0.0:
        return
    speed = max(float(velocity[0]), float(np.hypot(*base.velocity[:2])))
    brake = braking_on_slope(slope_ahead(run, robot, base))
    most = speed_to_stop(run.followers[robot].free(base, others, speed)[0], brake)
    velocity[0] = min(velocity[0], most, speed_at_walls(run, robot, base, brake))
    if most == 0.0:
        run.arrays.status[robot] = RobotStatus.WAITING


def _keep_to_way(run: RobotRun, robot: int, others: NDArray[np.void], dt: float) -> None:
    """Follow the way, and say when it ends or can't be gone."""
    status = _go_on(run, robot, others, dt)
    run.arrays.status[robot] = status
    if status in (RobotStatus.ARRIVED, RobotStatus.BLOCKED):
        run.note(robot, "arrived" if status == RobotStatus.ARRIVED else "blocked")
        run.arrays.mode[robot] = RobotMode.IDLE
        run.followers[robot].end()
        run.trips.end(robot)
        run.arrays.rest[robot] = 0.0


def _go_on(run: RobotRun, robot: int, others: NDArray[np.void], dt: float) -> RobotStatus:
    """Steer along the way, from door to door; return how that goes."""
    trips = run.trips
    if trips.door[robot] != NONE:
        return RobotStatus.WAITING
    if not len(run.followers[robot].path):  # it has come through a door
        goes_on = begin_leg(run, robot, int(trips.goal_room[robot]), trips.goal[robot])
        return RobotStatus.MOVING if goes_on else RobotStatus.BLOCKED
    status = _steer(run, robot, others, dt)
    if status == RobotStatus.ARRIVED and trips.leg[robot] != NONE:
        trips.door[robot] = trips.leg[robot]
        run.followers[robot].end()
        return RobotStatus.WAITING
    return status


def _steer(run: RobotRun, robot: int, others: NDArray[np.void], dt: float) -> RobotStatus:
    """Steer along the way, and round who stands in it; return how that goes."""
    follower, base = run.followers[robot], run.engine.base(robot)
    run.arrays.velocity[robot] = follower.steer(base, others, dt, slope_ahead(run, robot, base))
    if follower.wants_detour:
        follower.take_detour(path_around(run, robot, follower.path[-1], follower.standing_discs(base, others)))
    return follower.status


def _keep_near(run: RobotRun, robot: int, others: NDArray[np.void], dt: float, everyone: Bodies) -> None:
    """Go where the leader is, through doors if need be; wait near it, and where it can't be found."""
    follower, arrays, trips = run.followers[robot], run.arrays, run.trips
    arrays.status[robot] = RobotStatus.WAITING
    found = space_of_body(run, int(arrays.leader[robot]), everyone)
    if found is None:
        _stay(run, robot)
        return
    space, at = found
    here = space == trips.room[robot]
    near = run.scene.models[robot].half_length + _FOLLOW_GAP
    is_near = here and np.hypot(*(at - run.position(robot))[:2]) < near
    # What a hand holds stays on its side of a door: so does the robot.
    if is_near or (not here and object_in_hand(run, robot)):
        _stay(run, robot)
        return
    if trips.door[robot] != NONE and trips.goal_room[robot] == space:
        return
    on_the_way = len(follower.path) > 0 and trips.goal_room[robot] == space
    if on_the_way and here:
        end = follower.path[-1] if space == OUTDOORS else trips.goal[robot, :2]
        on_the_way = bool(np.hypot(*(end - at[:2])) <= _FOLLOW_DRIFT)
    if not on_the_way and not begin_leg(run, robot, space, at):
        _stay(run, robot)
        return
    arrays.status[robot] = _go_on(run, robot, others, dt)
    if arrays.status[robot] in (RobotStatus.ARRIVED, RobotStatus.BLOCKED):
        _stay(run, robot)
        arrays.status[robot] = RobotStatus.WAITING


def _stay(run: RobotRun, robot: int) -> None:
    """Be on no way any more."""
    run.followers[robot].end()
    run.trips.end(robot)
