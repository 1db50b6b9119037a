"""When a robot counts as fallen, as up again, and as lost.

In the air one that is thrown over turns upright again: its rotors go on. One that is tilted where it touches something,
leans on what it stands on, or has dropped out of the world, has fallen: its rotors stop. Somebody, who is not shown,
sets it upright on the nearest level ground.
"""

from __future__ import annotations

import math

import numpy as np

from vico.geometry import distances
from vico.sim.bodies.arrays import Bodies
from vico.sim.robots import flying
from vico.sim.robots.controller import MotorController
from vico.sim.robots.path_following import RobotStatus
from vico.sim.robots.quadrotor import Flight, FlightPhase
from vico.sim.robots.state import RobotMode, RobotRun
from vico.world.walkable import OPEN, SIDEWALK

#: Seconds a robot has to be tilted to count as fallen, and after which one that can't get up is left lying.
FALL_TIME, GIVE_UP = 0.3, 30.0
#: Seconds that one that flies lies until it is set upright, and metres to level ground that is free.
_PICKED_UP_AFTER, _CARRIED = 20.0, 60.0
#: Cosine of the tilt at which one that stands can't take off: as the real one that refuses to arm its motors.
_LEANS = 0.9
#: Metres above everything from which on one that is thrown over has room to turn upright.
_ROOM = 1.0
#: Metres below ground at which it has left the world.
_BELOW = 5.0
#: Metres kept to whoever is near where it is set upright.
_CLEAR = 0.5
_FALLEN, _LANDED, _MOTORS = int(RobotStatus.FALLEN), int(FlightPhase.LANDED), int(RobotMode.MOTORS)


def note_tilt(run: RobotRun, robot: int, tilted: float) -> None:
    """Note that a robot has been tilted for some seconds more, 0: it is not; and that it fell, if that is too long."""
    arrays = run.arrays
    lying = float(arrays.lying[robot]) + tilted if tilted else 0.0
    arrays.lying[robot] = lying
    if lying > FALL_TIME:
        arrays.status[robot] = RobotStatus.FALLEN
        arrays.lying[robot] = 0.0
        run.note(robot, "fallen")


def _is_down(run: RobotRun, flight: Flight, row: int) -> bool:
    """Return whether a robot can't right itself, or is none of this world any more."""
    robot, a = int(flight.robots[row]), flight.arrays
    base, limit = run.engine.base(robot), flight.model.fallen_below
    upright = float(base.rotation[2, 2])
    stands = a.phase[row] == _LANDED
    if upright >= max(_LEANS if stands else -1.0, -1.0 if limit is None else limit):
        return run.above_ground(robot) < -_BELOW
    if stands or a.charge[row] == 0.0 or run.arrays.mode[robot] == _MOTORS:
        return True
    return float(base.position[2]) - flight.model.stand < run.scene.airspace.top(base.position, 0.5) + _ROOM


def _watch_crashed(run: RobotRun, flight: Flight, row: int, dt: float, obstacles: Bodies) -> None:
    robot = int(flight.robots[row])
    lying = float(run.arrays.lying[robot])
    # Now and then: whoever stands there may go.
    is_time = lying >= _PICKED_UP_AFTER and math.floor(lying) != math.floor(lying - dt)
    if is_time and _set_upright(run, flight, row, Bodies.joined([obstacles, run.bodies()])):
        run.note(robot, "recovered")
    elif lying - dt <= GIVE_UP < lying:
        run.note(robot, "lost")


def _set_upright(run: RobotRun, flight: Flight, row: int, everybody: Bodies) -> bool:
    """Set a robot upright near where it lies, its rotors at rest; return whether there is a free place for that."""
    robot, model = int(flight.robots[row]), flight.model
    base = run.engine.base(robot)
    spots = run.scene.airspace.level_ground_near(base.position, _CARRIED)
    spots = spots[np.isin(run.scene.world.walkable.class_at(spots), (OPEN, SIDEWALK))]
    others = everybody.where(everybody.entity != run.entities[robot])
    for spot in spots:
        away = distances(others.position[:, :2], spot) - others.half_length
        if (away > model.half_length + _CLEAR).all():
            run.engine.stand(robot, np.array([*spot, base.yaw]))
            run.forget(robot)
            run.arrays.status[robot] = RobotStatus.IDLE
            run.arrays.lying[robot] = 0.0
            run.set_mode(robot, RobotMode.IDLE)
            flight.arrays.phase[row] = _LANDED
            flight.arrays.speed[row] = flight.arrays.wanted[row] = 0.0
            flying.hold_position(run, robot)
            return True
    return False


#: Cosine of the tilt at which a robot may be up again.
_UPRIGHT = 0.95
# What the arrays hold: members of an enumeration are slow to look up.


def watch_falls(run: RobotRun, dt: float, obstacles: Bodies) -> None:
    """Note who fell, who is up again and who is lost, `dt` seconds after this was last asked.

    `obstacles` are bodies of everybody else outdoors.
    """
    status = run.arrays.status.tolist()
    for group, flight in zip(run.scene.groups, run.flights, strict=True):
        if flight is not None:
            for row, robot in enumerate(flight.robots.tolist()):
                if run.arrays.status[robot] == _FALLEN:
                    _watch_crashed(run, flight, row, dt, obstacles)
                else:
                    note_tilt(run, robot, dt if _is_down(run, flight, row) else 0.0)
            continue
        limit = group.model.fallen_below
        for robot in group.robots.tolist():
            if status[robot] == _FALLEN:
                _watch_lying(run, robot, group.controller, dt)
            elif limit is not None:
                tilted = float(run.engine.base(robot).rotation[2, 2]) < limit
                note_tilt(run, robot, dt if tilted else 0.0)


def _watch_lying(run: RobotRun, robot: int, controller: MotorController, dt: float) -> None:
    arrays, base = run.arrays, run.engine.base(robot)
    lying = float(arrays.lying[robot])
    above = run.above_ground(robot)
    upright = float(base.rotation[2, 2]) > _UPRIGHT
    if upright and controller.stands(lying, base, run.engine.joints(robot)[0], above):
        arrays.status[robot] = RobotStatus.MOVING if arrays.mode[robot] != RobotMode.IDLE else RobotStatus.IDLE
        lift = controller.lift(0.0, base, above)
        if lift is not None:  # let go
            run.engine.thrust(robot, lift[:1], np.zeros((1, 3)))
        arrays.lying[robot] = 0.0
        run.note(robot, "recovered")
    elif lying - dt <= GIVE_UP < lying:
        run.note(robot, "lost")
