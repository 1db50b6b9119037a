"""Whether others leave somebody room to sit or lie down: nobody sits down into whoever stands beside the seat."""

from __future__ import annotations

import numpy as np

from vico.sim.bodies import Bodies
from vico.sim.footprints import Rectangle, gaps, records_of
from vico.sim.simulation_state import SimulationState
from vico.sim.state import body_radius

# Bodies are looked at whose middle is nearer than this, metres: people, and vehicles as well; and so far up or down.
_REACH, _LEVEL = 8.0, 1.5


def has_room(seat: int, i: int, state: SimulationState) -> bool:
    """Return whether person `i` would touch nobody on a seat or a bed, but others who sit or lie beside them."""
    p, seats = state.people, state.seats
    x, y, _ = seats.position[seat].tolist()
    bodies = _standing_in(int(seats.room[seat]), i, state)
    away = np.abs(bodies.position - (x, y, float(seats.floor[seat])))
    bodies = bodies.where((away[:, :2].max(axis=1, initial=0.0) < _REACH) & (away[:, 2] < _LEVEL))
    if not len(bodies):
        return True
    radius = float(body_radius(p.height[i : i + 1])[0])
    return bool((gaps(Rectangle(x, y, 1.0, 0.0, 0.0, 0.0), records_of(bodies)) >= radius).all())


def _standing_in(room: int, i: int, state: SimulationState) -> Bodies:
    """Return who is in a room, or outdoors (-1), without person `i` and those who sit or lie."""
    p = state.people
    if room < 0:
        everybody = state.obstacles_to(i)
        return everybody.where(~np.isin(everybody.entity, p.entity[p.seat >= 0]))
    standing = (p.room == room) & (p.seat < 0)
    standing[i] = False
    parts = [p.bodies_of(np.flatnonzero(standing))] if standing.any() else []
    if state.robots is not None and (state.robots.rooms == room).any():
        parts.append(state.robots.bodies().where(state.robots.rooms == room))
    return Bodies.joined(parts)
