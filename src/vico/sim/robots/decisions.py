"""What each robot does for the next sub-step: the velocity that its controller is to follow."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vico.sim.bodies import Bodies
from vico.sim.robots import commands
from vico.sim.robots.flying import LOW_BATTERY, decide_flight
from vico.sim.robots.ground_ahead import slope_ahead, speed_at_walls
from vico.sim.robots.navigation import SIGHT, NearbyBodies, braking, speed_to_stop
from vico.sim.robots.path_follower import RobotStatus
from vico.sim.robots.rooms import OUTDOORS
from vico.sim.robots.state import RobotMode, RobotRun
from vico.sim.robots.tasks import decide_task, handled, in_hand
from vico.sim.robots.trip_state import NONE
from vico.sim.robots.trips import begin_leg, others_in_room, way_on, whereabouts
from vico.sim.robots.ways import next_errand
from vico.world.walkable import CROSSING, ROADWAY

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
        own = handled(run, robot)
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
            _drive_to_work(run, robot, others, dt)


def _rest(run: RobotRun, robot: int, dt: float) -> None:
    """Let time pass until the next errand; with a low battery there is none, but away from where vehicles are."""
    arrays = run.arrays
    is_low = run.scene.models[robot].battery is not None and arrays.charge[robot] <= LOW_BATTERY
    if run.scene.models[robot].velocity_limit is None or (is_low and not _stands_on_roadway(run, robot)):
        return
    arrays.rest[robot] += dt
    if arrays.rest[robot] > _REST or arrays.errand[robot] == 0:
        arrays.rest[robot] = 0.0
        path = next_errand(run, robot)
        if path is not None:
            commands.take(run, robot, path)


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
    brake = braking(slope_ahead(run, robot, base))
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
        follower.detoured(way_on(run, robot, follower.path[-1], follower.closed(base, others)))
    return follower.status


def _drive_to_work(run: RobotRun, robot: int, others: NDArray[np.void], dt: float) -> None:
    """Follow the way to where an arm has something to do; where it can't be gone, that has to do."""
    status = _steer(run, robot, others, dt)
    run.arrays.status[robot] = status
    if status in (RobotStatus.ARRIVED, RobotStatus.BLOCKED):
        run.followers[robot].end()


def _keep_near(run: RobotRun, robot: int, others: NDArray[np.void], dt: float, everyone: Bodies) -> None:
    """Go where the leader is, through doors if need be; wait near it, and where it can't be found."""
    follower, arrays, trips = run.followers[robot], run.arrays, run.trips
    arrays.status[robot] = RobotStatus.WAITING
    found = whereabouts(run, int(arrays.leader[robot]), everyone)
    if found is None:
        _stay(run, robot)
        return
    space, at = found
    here = space == trips.room[robot]
    near = run.scene.models[robot].half_length + _FOLLOW_GAP
    is_near = here and np.hypot(*(at - run.position(robot))[:2]) < near
    # What a hand holds stays on its side of a door: so does the robot.
    if is_near or (not here and in_hand(run, robot)):
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
