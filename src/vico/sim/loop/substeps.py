"""All that moves, against each other's bodies: traffic, transit and avatars in sub-steps, robots in slices of them.

`Metrics` counts what a run did, and `StopWatch` the wall-clock seconds its phases take; they decide nothing.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field

import numpy as np

from vico.rules import ActionStatus, ReasonCode
from vico.sim.bodies.arrays import ROBOT, Bodies, HasBodies, Subsystem
from vico.sim.bodies.footprints import concatenate_records, records_of
from vico.sim.bodies.state_arrays import REASON_LENGTH
from vico.sim.people import doors, placement, rides
from vico.sim.state.simulation_state import SimulationState
from vico.sim.state.steps import ACTION_TICKS, SUBSTEP, SUBSTEP_TICKS, TICKS_PER_SECOND, ControlPeriods


@dataclass
class Metrics:
    """Counts and seconds of a run so far.

    Attributes
    ----------
    steps, collisions, refused
        Steps taken, motions stopped by something, actions refused.
    seconds
        Wall-clock seconds by phase of the loop.
    """

    steps: int = 0
    collisions: int = 0
    refused: int = 0
    seconds: dict[str, float] = field(default_factory=dict)


class StopWatch:
    """Adds up wall-clock seconds by phase.

    Parameters
    ----------
    into
        Seconds by phase; added to in place.
    """

    def __init__(self, into: dict[str, float]) -> None:
        self._into = into
        self._last = time.perf_counter()

    def lap(self, phase: str) -> None:
        """Add the time since the last lap to a phase."""
        now = time.perf_counter()
        self._into[phase] = self._into.get(phase, 0.0) + now - self._last
        self._last = now


#: Metres that people keep from robots: these move after them in the same sub-step, and in physics bodies give a little.
ROBOT_MARGIN = 0.03
# By number: looking an enumeration's member up, and comparing arrays with it, costs more than the comparison.
_COLLISION, _NO_REASON = int(ActionStatus.COLLISION), int(ReasonCode.NONE)


def advance_ticks(state: SimulationState, ticks: int, periods: ControlPeriods, watch: StopWatch) -> int:
    """Advance everything by some hundredths of a second; return how many motions were stopped by something.

    However the time is cut into calls, the same happens: traffic, transit and avatars advance on ticks that are
    multiples of `SUBSTEP_TICKS`, to where they are at the end of that sub-step, and robots slice by slice after them.
    """
    bodies = _AllBodies(state)
    end, stopped = state.tick + ticks, 0
    while state.tick < end:
        gone = state.tick % SUBSTEP_TICKS
        if gone == 0:
            stopped += _advance_substep(state, periods, bodies, watch)
        ticks_now = min(SUBSTEP_TICKS - gone, end - state.tick)
        if state.robots is not None:
            dt, since = ticks_now / TICKS_PER_SECOND, gone / TICKS_PER_SECOND
            state.robots.advance(dt, bodies.but(state.robots), since=since, substep=SUBSTEP)
            bodies.refresh(state.robots)
            bodies.refresh(state.objects)
            for note in state.robots.events():
                state.events.add("robot", state.robots.names[note.robot], note.kind, note.position)
            watch.lap("robots")
        state.tick += ticks_now
        if state.on_substep is not None and state.tick % SUBSTEP_TICKS == 0:
            state.on_substep()
    placement.move_held_objects(state)
    return stopped


def _advance_substep(state: SimulationState, periods: ControlPeriods, bodies: _AllBodies, watch: StopWatch) -> int:
    """Advance all but robots by a sub-step; return how many avatars were stopped."""
    if state.traffic is not None:
        state.traffic.set_conditions(state.environment.conditions)
        effects = state.environment.agenda.effects
        transit = state.transit
        walkways = effects.walkways if transit is None else transit.shut_walkways(effects.walkways)
        state.traffic.set_shut(effects.lanes, walkways)
    if state.robots is not None:
        state.robots.set_grip(state.environment.conditions.grip)
        state.robots.set_closed_ground(state.environment.agenda.effects.ground)
        state.robots.set_wind(*state.environment.weather.wind_vector)
    _advance_subsystem(state.traffic, "traffic", bodies, watch)
    _advance_subsystem(state.transit, "transit", bodies, watch)
    if state.traffic is not None and state.transit is not None:
        bodies.refresh(state.traffic)  # people have got into buses and off
    gone = periods.since_begun(state.tick)[: len(state.people)]
    share = SUBSTEP_TICKS / np.maximum(ACTION_TICKS - gone, SUBSTEP_TICKS)
    doors.walk_to_doors(state, share, SUBSTEP)
    # Avatars are kept off robots with some room to yield.
    others = bodies.but(state.avatars)
    obstacles, robots = records_of(others), (others.kind == ROBOT).nonzero()[0]
    if len(robots):
        for name in ("half_length", "half_width"):
            obstacles[name][robots] += ROBOT_MARGIN
        obstacles["radius"][robots] += 2 * ROBOT_MARGIN
    lying = state.objects.in_rooms()
    if len(lying):
        in_rooms = records_of(state.objects.bodies_of(lying), state.objects.room[lying])
        obstacles = concatenate_records([obstacles, in_rooms])
    if state.robots is not None and (state.robots.rooms >= 0).any():
        inside = np.flatnonzero(state.robots.rooms >= 0)
        at = records_of(state.robots.bodies().where(inside), state.robots.rooms[inside])
        obstacles = concatenate_records([obstacles, at])
    carried = doors.walk_through(state, obstacles, SUBSTEP)
    state.avatars.advance(SUBSTEP, obstacles, share=share, carried=carried)
    rides.carry_riders(state)
    doors.open_doors(state, SUBSTEP)
    doors.advance_lifts(state, SUBSTEP)
    doors.advance_robots_at_doors(state, SUBSTEP)
    state.leaves.advance(SUBSTEP)
    placement.advance_arms(state, SUBSTEP)
    bodies.refresh(state.avatars)
    stopped = _report_collisions(state)
    watch.lap("avatars")
    return stopped


def _report_collisions(state: SimulationState) -> int:
    """Say what has just stopped whom, as reasons and events; return how many were stopped."""
    p = state.people
    stopped = ((p.status == _COLLISION) & (p.reason_code == _NO_REASON)).nonzero()[0]
    for i in stopped:
        entity = int(p.contact[i])
        what = "something solid" if entity < 0 else state.entity(entity)["kind"]
        p.reason[i] = f"stopped by {what}"[:REASON_LENGTH]
        p.reason_code[i] = ReasonCode.HIT_SOLID if entity < 0 else ReasonCode.HIT_BODY
        state.events.add("collision", p.names[i], f"is stopped by {what}", p.position[i], entity=entity)
    return len(stopped)


def _advance_subsystem(system: Subsystem | None, phase: str, bodies: _AllBodies, watch: StopWatch) -> None:
    if system is not None:
        system.advance(SUBSTEP, bodies.but(system))
        bodies.refresh(system)
        watch.lap(phase)


class _AllBodies:
    """Everybody's bodies; an owner's are asked for again only when they have moved."""

    def __init__(self, state: SimulationState) -> None:
        self._robots = state.robots
        self._bodies = {id(owner): self._outdoors(owner) for owner in state.owners()}

    def refresh(self, owner: HasBodies) -> None:
        self._bodies[id(owner)] = self._outdoors(owner)

    def _outdoors(self, owner: HasBodies) -> Bodies:
        return owner.bodies() if self._robots is None or owner is not self._robots else self._robots.outdoor_bodies()

    def but(self, owner: HasBodies) -> Bodies:
        return Bodies.joined([bodies for key, bodies in self._bodies.items() if key != id(owner)])
