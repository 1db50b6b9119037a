"""Flight of drones in the next sub-step: along their paths, above people and vehicles, down to the ground.

They keep apart from whoever is below and from each other, inside the world, and not too high.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vico.errors import InputError
from vico.exact import dot
from vico.geometry import distance, distances
from vico.sim.bodies.arrays import Bodies
from vico.sim.robots.path_following import RobotStatus
from vico.sim.robots.path_planning import BESIDE, CEILING, HOVER
from vico.sim.robots.quadrotor import HEADING, POSITION, TURNING, VELOCITY, VELOCITY_UP, Flight, FlightPhase
from vico.sim.robots.state import RobotMode, RobotRun

Array = NDArray[np.float64]

#: Metres a second squared robots that fly speed up and brake with.
FLIGHT_BRAKING = 1.5

# Metres above and beside others that it keeps to.
_ABOVE, _ASIDE = 1.5, 1.5
# Of people and vehicles, and of others that fly, who come faster.
_FORESIGHT = 1.5  # s that their motion is foreseen
_FLIGHT_FORESIGHT = 2.5
_NEIGHBOUR_REACH = 20.0  # m within which they are looked for
_FLIGHT_NEAR = 45.0
# Metres that somebody's feet are above it from which on it is not they who are below.
_OVERHEAD = 1.0
# To let others pass it climbs and sinks.
_CLIMB = 2.0  # m/s
_GIVE_WAY = 1.0  # m/s
_LOW = 3.0  # m above everything below which it does not sink


@dataclass(frozen=True)
class FlightNeighbours:
    """Whom a robot that flies has to keep apart from.

    Attributes
    ----------
    others
        Everybody near it.
    flies
        Who of them flies, bool, shape ``(n,)``.
    lower
        Of whom it keeps above: of those that fly the lower ones, and of two at one height the one with the smaller
        entity number; bool, shape ``(n,)``.
    position, bottom
        Its own, ENU metres; `bottom` is where it would stand.
    """

    others: Bodies
    flies: NDArray[np.bool_]
    lower: NDArray[np.bool_]
    position: Array
    bottom: float

    def meets(self, velocity: Array) -> NDArray[np.bool_]:
        """Return who comes too near to one side of it, at a velocity of its own, within the time that is foreseen."""
        away = self.others.position[:, :2] - self.position[:2]
        moves = self.others.velocity - velocity[:2]
        square = np.maximum((moves * moves).sum(axis=1), 1e-9)
        longest = np.where(self.flies, _FLIGHT_FORESIGHT, _FORESIGHT)
        nearest = away + moves * np.clip(-(away * moves).sum(axis=1) / square, 0.0, longest)[:, None]
        found: NDArray[np.bool_] = np.hypot(nearest[:, 0], nearest[:, 1]) - self.others.half_length < _ASIDE
        return found

    def floor(self, velocity: Array) -> float:
        """How high it has to keep because of whoever is below it, or soon will be, ENU metres; -inf for nobody."""
        if not len(self.others):
            return -math.inf
        near = self.lower & self.meets(velocity)
        return float(self.others.top[near].max()) + _ABOVE if near.any() else -math.inf

    def roof(self, velocity: Array) -> float:
        """How high it may reach because of others that fly above it, or soon will; inf for nobody."""
        if not len(self.others):
            return math.inf
        near = self.flies & ~self.lower & self.meets(velocity)
        return float(self.others.position[near, 2].min()) - _ABOVE if near.any() else math.inf


def flight_neighbours(run: RobotRun, flight: Flight, row: int, everybody: Bodies) -> FlightNeighbours:
    """Return everybody else within some metres of a robot that flies."""
    robot = int(flight.robots[row])
    own, position = int(run.entities[robot]), run.position(robot)
    bottom = float(position[2]) - flight.model.stand
    fly = [run.entities[f.robots[f.arrays.phase != _LANDED]] for f in run.flights if f is not None]
    away = distances(everybody.position[:, :2], position[:2]) - everybody.half_length
    chosen = np.flatnonzero((away < max(_FLIGHT_NEAR, _NEIGHBOUR_REACH)) & (everybody.entity != own))
    flies = np.isin(everybody.entity[chosen], np.concatenate(fly))
    near = away[chosen] < np.where(flies, _FLIGHT_NEAR, _NEIGHBOUR_REACH)
    others, flies = everybody.where(chosen[near]), flies[near]
    z = others.position[:, 2]
    below = (z < bottom) | ((z == bottom) & (others.entity < own))
    lower = np.where(flies, below, z < bottom + flight.model.height + _OVERHEAD)
    return FlightNeighbours(others, flies, lower, position, bottom)


def keep_apart(run: RobotRun, flight: Flight, row: int, around: FlightNeighbours) -> None:
    """Climb, and come no nearer, while anybody is below or ahead; sink for who flies above; stay inside the world."""
    a, robot = flight.arrays, int(flight.robots[row])
    if a.phase[row] == _LANDED:
        return
    setpoint, bottom, commanded = a.setpoint[row], around.bottom, run.arrays.mode[robot] != _IDLE
    velocity = setpoint[VELOCITY].copy()
    floor, roof = around.floor(velocity), around.roof(velocity)
    if bottom - 0.5 < floor:
        setpoint[VELOCITY_UP] = max(setpoint[VELOCITY_UP], 0.0)
        setpoint[2] = max(setpoint[2], floor + flight.model.stand)
    if bottom < floor:
        setpoint[VELOCITY] = 0.0, 0.0, _CLIMB
        setpoint[POSITION] = around.position
        if commanded:
            run.arrays.status[robot] = RobotStatus.WAITING
    elif bottom + flight.model.height > roof - 0.5:
        is_free = bottom > run.scene.airspace.top(around.position) + _LOW
        sinks = commanded and is_free and bottom + flight.model.height > roof
        setpoint[VELOCITY_UP] = min(setpoint[VELOCITY_UP], -_GIVE_WAY if sinks else 0.0)
        setpoint[2] = min(setpoint[2], around.position[2])
    _keep_inside(run, setpoint, around.position)


def _keep_inside(run: RobotRun, setpoint: Array, position: Array) -> None:
    """Fly neither out of the world nor too high; come back from there."""
    half = run.scene.airspace.half - BESIDE
    ceiling = float(run.scene.world.height(position)) + CEILING
    for axis, (low, high) in enumerate(((-half, half), (-half, half), (-math.inf, ceiling))):
        outwards = setpoint[3 + axis]
        # As fast as it can stop at the edge: told only there, it would come metres too far, and swing to and fro.
        room = high - position[axis] if outwards > 0.0 else position[axis] - low
        setpoint[3 + axis] = math.copysign(
            min(abs(outwards), math.sqrt(2.0 * FLIGHT_BRAKING * max(room, 0.0))), outwards
        )
        if not low <= position[axis] <= high:
            setpoint[axis] = min(max(setpoint[axis], low), high)


_LANDED, _FLYING, _LANDING = (int(phase) for phase in FlightPhase)
_IDLE, _VELOCITY, _MOTORS, _ROUTE, _FOLLOW, _ = (int(mode) for mode in RobotMode)
_FALLEN = int(RobotStatus.FALLEN)
#: Metres above what is there at which `go_to` ends, and that a landing begins above.
CRUISE, APPROACH = 10.0, 4.0
#: A corner of its way counts as reached so near, metres.
_CORNER = 0.6
# Metres beside its way up to which it flies on as fast as it can, and from which on it only comes back: wind would blow
# it on into what its way leads round.
_ON_WAY, _OFF_WAY = 0.5, 2.0
_SINK = 1.5  # m/s it comes down with far above what is below
_TOUCH = 0.4  # m/s it comes down with near it
_NEAR = 3.0  # m above it that are near
# Seconds without sinking, slower than so many metres a second, after which it has landed.
_CALM, _STILL = 0.5, 0.08
_BEHIND = 4.0  # m behind whom it follows
_HIGHER = 5.0  # m above whom it follows
_DRIFT = 3.0  # m that one has to go for another way to be found
# Seconds without getting nearer after which a way counts as blocked; share of its battery at which it lands.
_PATIENCE, LOW_BATTERY = 30.0, 0.1
_ERRAND_REST, _ERRAND_HEIGHT = 5.0, 15.0
# Mean wind in which a robot on errands takes no more of them, but lands, m/s: what makers of such allow.
_TOO_WINDY = 10.0
# Metres beside the spot up to which it sinks onto it, near what it lands on.
_ON_SPOT = 0.5


def flight_of(run: RobotRun, robot: int) -> tuple[Flight, int] | None:
    """Return the flight a robot is part of, and its row in that; None if it does not fly."""
    for flight in run.flights:
        if flight is not None and robot in flight.robots:
            return flight, flight.row(robot)
    return None


def _flight(run: RobotRun, robot: int, what: str) -> tuple[Flight, int]:
    found = flight_of(run, robot)
    if found is None:
        raise InputError(f"{what}: {run.scene.models[robot].title} does not fly")
    return found


# Commands.


def cruise_point(run: RobotRun, xy: Array) -> Array:
    """Where `go_to` ends: above what stands at a point."""
    return np.array([*xy[:2], run.scene.airspace.top(xy) + CRUISE])


def fly_to(run: RobotRun, robot: int, target: Array, *, lands: bool = False) -> None:
    """Fly to a point, over or round what stands in between, and hover or land there.

    Raises
    ------
    InputError
        If it does not fly, or nobody can fly there.
    """
    flight, row = _flight(run, robot, "fly_to")
    refusal = run.scene.airspace.refusal(target)
    if refusal:
        raise InputError(f"fly_to: {refusal}")
    hold_position(run, robot)
    run.set_mode(robot, RobotMode.ROUTE)
    _begin(run, robot, flight, row, target)
    flight.arrays.lands[row] = lands


def land(run: RobotRun, robot: int, xy: Array | None = None) -> None:
    """Land where it is, or at a point; on what is even, ground or roof.

    Raises
    ------
    InputError
        If it does not fly, or what is there is not even.
    """
    flight, row = _flight(run, robot, "land")
    here = run.position(robot)
    spot = here[:2].copy() if xy is None else np.asarray(xy, np.float64)[:2]
    if flight.arrays.phase[row] == _LANDED and xy is None:
        return
    space = run.scene.airspace
    if not space.is_flat(spot):
        raise InputError("land: what is there is not even enough to land on")
    if distance(spot, here[:2]) < 1.0:
        run.set_mode(robot, RobotMode.ROUTE)
        flight.arrays.phase[row] = _LANDING
        flight.arrays.calm[row] = 0.0
        flight.ways[row] = np.array([[*spot, space.top(spot)]])
        flight.arrays.setpoint[row, VELOCITY] = 0.0
        flight.arrays.setpoint[row, POSITION] = [*spot, here[2]]
        return
    fly_to(run, robot, np.array([*spot, space.top(spot) + APPROACH]), lands=True)


def hold_position(run: RobotRun, robot: int) -> None:
    """Hover where it is, or stay on the ground; whoever begins something else for a robot asks for it first."""
    found = flight_of(run, robot)
    if found is None:
        return
    flight, row = found
    a = flight.arrays
    flight.ways[row] = np.zeros((0, 3))
    a.leg[row], a.lands[row], a.calm[row], a.held[row] = 0, False, 0.0, 0.0
    if a.phase[row] == _LANDING:
        a.phase[row] = _FLYING
    base = run.engine.base(robot)
    a.setpoint[row, POSITION] = base.position
    a.setpoint[row, VELOCITY] = 0.0
    a.setpoint[row, HEADING], a.setpoint[row, TURNING] = base.yaw, 0.0


def _begin(run: RobotRun, robot: int, flight: Flight, row: int, target: Array) -> None:
    flight.ways[row] = run.scene.airspace.route(run.position(robot), target)
    flight.arrays.leg[row] = 0
    flight.arrays.held[row] = [0.0, math.inf]
    flight.arrays.phase[row] = _FLYING


# Decisions.


def decide_flight(run: RobotRun, flight: Flight, dt: float, everybody: Bodies, *, errands: bool) -> None:
    """Set what the robots of a flight follow for the next `dt` seconds."""
    for row, robot in enumerate(flight.robots.tolist()):
        mode = int(run.arrays.mode[robot])
        if run.arrays.status[robot] == _FALLEN or mode == _MOTORS:
            flight.arrays.phase[row] = _FLYING if mode == _MOTORS else _LANDED
            continue
        _watch_battery(run, flight, row, robot)
        mode = int(run.arrays.mode[robot])
        if mode == _IDLE and errands:
            _rest(run, flight, row, robot, dt)
        others = flight_neighbours(run, flight, row, everybody)
        if mode == _IDLE:
            flight.arrays.setpoint[row, VELOCITY] = 0.0
        elif mode == _VELOCITY:
            _hold_velocity(run, flight, row, robot)
        elif mode == _FOLLOW:
            _keep_near(run, flight, row, robot, everybody)
        elif flight.arrays.phase[row] == _LANDING:
            _come_down(run, flight, row, robot, others, dt)
            continue
        else:
            _keep_to_way(run, flight, row, robot, dt)
        keep_apart(run, flight, row, others)


def _watch_battery(run: RobotRun, flight: Flight, row: int, robot: int) -> None:
    """Have it land near where it is when its battery is low; with an empty one it comes down as it is."""
    a = flight.arrays
    if a.phase[row] == _LANDED or a.charge[row] > LOW_BATTERY:
        return
    if a.charge[row] == 0.0:
        run.note(robot, "battery_empty")
        hold_position(run, robot)
        run.set_mode(robot, RobotMode.IDLE)
        a.phase[row] = _LANDED
        return
    if not a.warned[row]:
        run.note(robot, "battery_low")
    elif run.arrays.mode[robot] != _IDLE:
        return
    a.warned[row] = True
    _land_near(run, flight, row, robot)


def _land_near(run: RobotRun, flight: Flight, row: int, robot: int) -> None:
    """Have one that is in the air land on the nearest even spot."""
    spot = run.scene.airspace.flat_near(run.position(robot))
    if spot is not None and flight.arrays.phase[row] != _LANDED:
        land(run, robot, spot)


def _rest(run: RobotRun, flight: Flight, row: int, robot: int, dt: float) -> None:
    """Let time pass until the next errand; with a low battery there is none, nor in wind that is too strong."""
    arrays = run.arrays
    arrays.rest[robot] += dt
    if flight.arrays.warned[row] or not (arrays.rest[robot] > _ERRAND_REST or arrays.errand[robot] == 0):
        return
    arrays.rest[robot] = 0.0
    if float(np.hypot(*flight.arrays.wind)) > _TOO_WINDY:
        _land_near(run, flight, row, robot)
        return
    arrays.errand[robot] += 1
    goals, space = run.scene.goals, run.scene.airspace
    away = np.hypot(*(goals - run.position(robot)[:2]).T)
    order = run.errand_stream(robot).permutation(np.flatnonzero((away > 40.0) & (away < 250.0)))
    for index in order[:5]:
        target = np.array([*goals[index], space.top(goals[index]) + _ERRAND_HEIGHT])
        if not space.refusal(target):
            fly_to(run, robot, target)
            return


def _hold_velocity(run: RobotRun, flight: Flight, row: int, robot: int) -> None:
    """Follow the velocity asked for: along and across its heading, and up."""
    a, base = flight.arrays, run.engine.base(robot)
    vx, vy, vz, wz = run.arrays.command[robot, :4].tolist()
    if a.phase[row] == _LANDED and vz <= 0.0:
        return
    a.phase[row] = _FLYING
    c, s = math.cos(base.yaw), math.sin(base.yaw)
    a.setpoint[row, VELOCITY] = c * vx - s * vy, s * vx + c * vy, vz
    a.setpoint[row, TURNING] = wz
    run.arrays.status[robot] = RobotStatus.MOVING


def _keep_to_way(run: RobotRun, flight: Flight, row: int, robot: int, dt: float) -> None:
    """Follow the way, and say when it ends or can't be flown."""
    a, status = flight.arrays, _steer(run, flight, row, robot, dt)
    run.arrays.status[robot] = status
    if status == RobotStatus.ARRIVED and a.lands[row]:
        target = flight.ways[row][-1]
        a.phase[row], a.calm[row] = _LANDING, 0.0
        flight.ways[row] = target[None].copy()
        run.arrays.status[robot] = RobotStatus.MOVING
    elif status in (RobotStatus.ARRIVED, RobotStatus.BLOCKED):
        target = flight.ways[row][-1].copy()
        run.note(robot, "arrived" if status == RobotStatus.ARRIVED else "blocked")
        hold_position(run, robot)
        if status == RobotStatus.ARRIVED:
            a.setpoint[row, POSITION] = target
        run.arrays.mode[robot] = RobotMode.IDLE
        run.arrays.rest[robot] = 0.0


def _steer(run: RobotRun, flight: Flight, row: int, robot: int, dt: float) -> RobotStatus:
    """Aim along the way; return how that goes."""
    a, base = flight.arrays, run.engine.base(robot)
    way, leg = flight.ways[row], int(a.leg[row])
    away = float(np.linalg.norm(way[leg] - base.position))
    last = leg == len(way) - 1
    speed = float(np.linalg.norm(base.velocity))
    if last and away < flight.model.arrival + 0.02 * float(np.hypot(*a.wind)) and speed < 0.7:
        return RobotStatus.ARRIVED
    if not last and away < _CORNER:
        a.leg[row] = leg = leg + 1
        a.held[row] = [0.0, math.inf]
        away = float(np.linalg.norm(way[leg] - base.position))
    if away < a.held[row, 1] - 0.5:
        a.held[row] = 0.0, away
    else:  # it has come no nearer
        a.held[row, 0] += dt
    _aim(flight, row, base.position, way, leg)
    return RobotStatus.BLOCKED if a.held[row, 0] > _PATIENCE else RobotStatus.MOVING


def _aim(flight: Flight, row: int, position: Array, way: Array, leg: int) -> None:
    """Follow a leg of a way: beside it back to it, along it as fast as it can stop at its end, nose ahead."""
    a, reach = flight.arrays, flight.model.velocity_limit
    assert reach is not None
    end = way[leg]
    start = way[leg - 1] if leg else position
    along = end - start
    length = float(np.linalg.norm(along))
    along = along / length if length > 1e-6 else np.zeros(3)
    done = min(max(float(dot(position - start, along)), 0.0), length)
    left = length - done
    speed = math.sqrt(2.0 * FLIGHT_BRAKING * max(left - 0.1, 0.0))
    level, rise = math.hypot(along[0], along[1]), float(along[2])
    for part, limit in ((level, float(reach[0])), (max(rise, 0.0), float(reach[2])), (max(-rise, 0.0), _SINK)):
        if part > 1e-6:
            speed = min(speed, limit / part)
    on_way = start + done * along
    beside = float(np.linalg.norm(position - on_way))
    speed *= min(max((_OFF_WAY - beside) / (_OFF_WAY - _ON_WAY), 0.0), 1.0)
    a.setpoint[row, VELOCITY] = speed * along
    a.setpoint[row, POSITION] = on_way
    if level * left > 2.0:
        _turn(a.setpoint[row], math.atan2(along[1], along[0]), float(reach[3]))
    else:
        a.setpoint[row, TURNING] = 0.0


def _turn(setpoint: Array, heading: float, fastest: float) -> None:
    """Turn towards a heading."""
    error = (heading - setpoint[HEADING] + math.pi) % (2.0 * math.pi) - math.pi
    setpoint[TURNING] = min(max(1.5 * error, -fastest), fastest)


def _come_down(run: RobotRun, flight: Flight, row: int, robot: int, others: FlightNeighbours, dt: float) -> None:
    """Sink onto the spot; wait above it while anybody is there."""
    a, base = flight.arrays, run.engine.base(robot)
    spot = flight.ways[row][-1]
    above = float(base.position[2]) - flight.model.stand - run.scene.airspace.top(spot, 0.5)
    if above < -_TOUCH:  # blown off a roof: from below its edge it tries again
        fly_to(run, robot, np.array([*spot[:2], run.scene.airspace.top(spot) + APPROACH]), lands=True)
        return
    a.setpoint[row, :2], a.setpoint[row, 3:5], a.setpoint[row, TURNING] = spot[:2], 0.0, 0.0
    floor = others.floor(np.zeros(3))
    if above > 0.3 and base.position[2] - flight.model.stand - 0.3 < floor:
        run.arrays.status[robot] = RobotStatus.WAITING
        a.setpoint[row, 2] = floor + flight.model.stand
        a.setpoint[row, VELOCITY_UP] = 0.0
        return
    run.arrays.status[robot] = RobotStatus.MOVING
    a.setpoint[row, VELOCITY_UP] = -_SINK if above > _NEAR else -_TOUCH
    if _TOUCH < above < _NEAR and float(np.hypot(*(base.position - spot)[:2])) > _ON_SPOT:
        a.setpoint[row, VELOCITY_UP] = 0.0
    still = above < 1.0 and abs(float(base.velocity[2])) < _STILL
    a.calm[row] = a.calm[row] + dt if still else 0.0
    if a.calm[row] > _CALM:
        hold_position(run, robot)
        a.phase[row] = _LANDED
        run.arrays.mode[robot] = RobotMode.IDLE
        run.arrays.status[robot] = RobotStatus.ARRIVED
        run.arrays.rest[robot] = 0.0
        run.note(robot, "landed")


def _keep_near(run: RobotRun, flight: Flight, row: int, robot: int, everybody: Bodies) -> None:
    """Fly behind and above the leader; hover where it can't be found."""
    a, arrays, position = flight.arrays, run.arrays, run.position(robot)
    found = np.flatnonzero(everybody.entity == arrays.leader[robot])
    arrays.status[robot] = RobotStatus.WAITING
    a.setpoint[row, VELOCITY] = 0.0
    a.setpoint[row, TURNING] = 0.0
    if not len(found):
        return
    leader, top = everybody.position[found[0]], float(everybody.top[found[0]])
    away = position[:2] - leader[:2]
    far = float(np.hypot(*away))
    goal = np.array([*(leader[:2] + away * (_BEHIND / far if far > 0.1 else 1.0)), top + _HIGHER])
    reach = flight.model.velocity_limit
    assert reach is not None
    if far > 0.5:
        _turn(a.setpoint[row], math.atan2(-away[1], -away[0]), float(reach[3]))
    space = run.scene.airspace
    goal[2] = max(goal[2], space.top(goal) + HOVER)
    if np.linalg.norm(goal - position) < 1.5 and not len(flight.ways[row]):
        a.phase[row] = _FLYING
        a.setpoint[row, POSITION] = position + np.clip(goal - position, -1.0, 1.0)
        return
    stale = not len(flight.ways[row]) or np.linalg.norm(flight.ways[row][-1] - goal) > _DRIFT
    if stale and not space.refusal(goal):
        _begin(run, robot, flight, row, goal)
    if len(flight.ways[row]):
        status = _steer(run, flight, row, robot, 0.0)
        arrays.status[robot] = status
        if status == RobotStatus.ARRIVED:
            flight.ways[row] = np.zeros((0, 3))
            arrays.status[robot] = RobotStatus.WAITING
