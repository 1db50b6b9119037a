"""What robots can be told: a vector in one of their action spaces, a place to go to, whom to follow, to stop."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.errors import InputError
from vico.sim.robots import flying, tasks
from vico.sim.robots.path_follower import RobotStatus
from vico.sim.robots.state import Circles, RobotMode, RobotRun
from vico.sim.robots.trips import begin_leg
from vico.sim.robots.ways import is_closed, way_to


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
    flying.settle(run, robot)
    tasks.abandon(run, robot)
    run.arrays.command[robot] = 0.0
    run.arrays.command[robot, : len(values)] = np.clip(values, chosen.low, chosen.high)
    run.set_mode(robot, RobotMode.MOTORS if chosen.drives == "motors" else RobotMode.VELOCITY)


def drive(run: RobotRun, robot: int, velocity: ArrayLike) -> None:
    """Follow a velocity (vx, vy, wz): metres a second in the base's frame, radians a second to the left.

    Robots that fly take (vx, vy, vz, wz).

    Raises
    ------
    InputError
        If the robot follows no velocities, or these are not so many finite numbers.
    """
    model = run.scene.models[robot]
    spaces = [name for name, space in model.action_spaces.items() if space.drives == "velocity"]
    if not spaces:
        raise InputError(f"drive: {model.title} follows no velocities; command its motors")
    command(run, robot, velocity, spaces[0])


def stop(run: RobotRun, robot: int) -> None:
    """Stand still, or hover."""
    flying.settle(run, robot)
    tasks.abandon(run, robot)
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
        tasks.abandon(run, robot)
        run.set_mode(robot, RobotMode.ROUTE)
        return True
    path = way_to(run, robot, goal)
    if path is None:
        return False
    take(run, robot, path)
    return True


def take(run: RobotRun, robot: int, path: ArrayLike) -> None:
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
    tasks.abandon(run, robot)
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
    flying.settle(run, robot)
    tasks.abandon(run, robot)
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
        if run.trips.room[robot] >= 0 or not len(follower.path) or not circles or not is_closed(run, follower.ahead()):
            continue
        path = way_to(run, robot, follower.path[-1])
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
