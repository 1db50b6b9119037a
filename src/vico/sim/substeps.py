"""One second of all that moves: traffic, transit, avatars and robots in sub-steps, against each other's bodies."""

from __future__ import annotations

import numpy as np

from vico.rules import ActionStatus, ReasonCode
from vico.sim import moves, rides
from vico.sim.bodies import Bodies, HasBodies, Subsystem
from vico.sim.config import SUBSTEP, SUBSTEPS
from vico.sim.metrics import StopWatch
from vico.sim.simulation_state import SimulationState
from vico.sim.state import REASON_LENGTH


def advance_second(state: SimulationState, watch: StopWatch) -> None:
    """Advance everything by one second."""
    bodies = _AllBodies(state)
    for k in range(SUBSTEPS):
        _advance_subsystem(state.traffic, "traffic", bodies, watch)
        _advance_subsystem(state.transit, "transit", bodies, watch)
        state.avatars.advance(SUBSTEP, bodies.but(state.avatars), share=1.0 / (SUBSTEPS - k))
        rides.follow(state)
        bodies.refresh(state.avatars)
        watch.lap("avatars")
        _advance_subsystem(state.robots, "robots", bodies, watch)
    moves.follow_hands(state)
    state.second += 1.0


def report_collisions(state: SimulationState) -> int:
    """Say what stopped whom, as reasons and events; return how many were stopped."""
    p = state.people
    stopped = np.flatnonzero(p.status == ActionStatus.COLLISION)
    for i in stopped:
        entity = int(p.contact[i])
        what = "something solid" if entity < 0 else state.entity(entity)["kind"]
        p.reason[i] = f"stopped by {what}"[:REASON_LENGTH]
        p.reason_code[i] = ReasonCode.HIT_SOLID if entity < 0 else ReasonCode.HIT_BODY
        state.events.add("collision", p.names[i], f"is stopped by {what}", p.position[i], entity=entity)
    return len(stopped)


def report_robots(state: SimulationState) -> None:
    """Say what happened to robots, as events."""
    robots = state.robots
    for note in robots.events() if robots is not None else ():
        name = robots.names[note.robot] if robots is not None else ""
        state.events.add("robot", name, note.kind, note.position)


def _advance_subsystem(system: Subsystem | None, phase: str, bodies: _AllBodies, watch: StopWatch) -> None:
    if system is not None:
        system.advance(SUBSTEP, bodies.but(system))
        bodies.refresh(system)
        watch.lap(phase)


class _AllBodies:
    """Everybody's bodies during a step; an owner's are asked for again only when they have moved."""

    def __init__(self, state: SimulationState) -> None:
        self._bodies = {id(owner): owner.bodies() for owner in state.owners()}

    def refresh(self, owner: HasBodies) -> None:
        self._bodies[id(owner)] = owner.bodies()

    def but(self, owner: HasBodies) -> Bodies:
        return Bodies.joined([bodies for key, bodies in self._bodies.items() if key != id(owner)])
