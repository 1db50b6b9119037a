"""What is left in robots' batteries: they drain by what motors do, and are exchanged when they are low or empty."""

from __future__ import annotations

from vico.assets.robots import BatteryModel, RobotModel
from vico.exact import dot
from vico.sim.robots import commands
from vico.sim.robots.flying import LOW_BATTERY, flight_of
from vico.sim.robots.rotors import FlightPhase
from vico.sim.robots.state import RobotMode, RobotRun

#: Seconds that a robot stands with a low or empty battery until somebody, who is not shown, has put in a full one.
EXCHANGE = 600.0
_IDLE, _LANDED = int(RobotMode.IDLE), int(FlightPhase.LANDED)


def charge_of(run: RobotRun, robot: int) -> float:
    """Return how full a robot's battery is, 0..1; 1 for robots whose battery nobody keeps account of."""
    flown = flight_of(run, robot)
    return float(run.arrays.charge[robot] if flown is None else flown[0].arrays.charge[flown[1]])


def watch_batteries(run: RobotRun, dt: float) -> None:
    """Let batteries drain for `dt` seconds by what the motors do now; stop who has an empty one, and exchange it."""
    arrays = run.arrays
    for robot, model in enumerate(run.scene.models):
        if model.battery is None:
            continue
        before = float(arrays.charge[robot])
        if before == 0.0:
            if arrays.mode[robot] != _IDLE:
                commands.stop(run, robot)
            _exchange(run, robot, dt)
            continue
        after = max(0.0, before - _power(run, robot, model, model.battery) * dt / model.battery.capacity)
        arrays.charge[robot] = after
        if before > LOW_BATTERY >= after:
            run.note(robot, "battery_low")
        if after == 0.0:
            run.note(robot, "battery_empty")
            commands.stop(run, robot)
        if after <= LOW_BATTERY and arrays.mode[robot] == _IDLE:
            _exchange(run, robot, dt)
        else:
            arrays.uncharged[robot] = 0.0
    for flight in run.flights:
        if flight is not None:
            a = flight.arrays
            for row, robot in enumerate(flight.robots.tolist()):
                if a.charge[row] <= LOW_BATTERY and a.phase[row] == _LANDED:
                    _exchange(run, robot, dt)
                else:
                    arrays.uncharged[robot] = 0.0


def _exchange(run: RobotRun, robot: int, dt: float) -> None:
    """Wait for a full battery, and put it in when the time has come."""
    arrays = run.arrays
    arrays.uncharged[robot] += dt
    if arrays.uncharged[robot] < EXCHANGE - 1e-6:
        return
    arrays.uncharged[robot] = 0.0
    flown = flight_of(run, robot)
    if flown is None:
        arrays.charge[robot] = 1.0
    else:
        flight, row = flown
        flight.arrays.charge[row], flight.arrays.warned[row] = 1.0, False
    run.note(robot, "recharged")


def _power(run: RobotRun, robot: int, model: RobotModel, battery: BatteryModel) -> float:
    """Return the watts that a robot takes out of its battery now."""
    forces = run.engine.motor_forces(robot).tolist()
    speeds = dict(zip(model.joints, run.engine.joints(robot)[1].tolist(), strict=True))
    work = heat = 0.0
    for motor, unit, force in zip(model.motors, model.motor_units, forces, strict=True):
        speed = speeds.get(motor)
        if speed is None:
            speed = _base_speed(run, robot, unit)
        else:
            heat += force * force
        # Motors that are pushed back feed nothing into the battery.
        work += max(force * speed, 0.0)
    return battery.idle_power + work / battery.efficiency + battery.holding * heat


def _base_speed(run: RobotRun, robot: int, unit: str) -> float:
    """Return how fast the base goes ahead, m/s, or turns, rad/s: what motors do that drive no joint of their own."""
    base = run.engine.base(robot)
    if unit == "rad/s":
        return float(base.angular_velocity_body[2])
    return float(dot(base.rotation[:, 0], base.velocity))
