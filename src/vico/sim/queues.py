"""People in line at tills: where each one stands, who is served, and who has left."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.sim.simulation_state import SimulationState
from vico.sim.tills import AT_SPOT, LOST, PRICE, SPACING


def place_in_line(
    i: int, state: SimulationState, line: Sequence[int] | None = None
) -> tuple[int, NDArray[np.float64]] | None:
    """Return how many are before a person at the till of its room, and where it stands, or would; None if nowhere.

    `line` is who waits there, if that is known already.
    """
    room = int(state.people.room[i])
    till = state.tills.get(room)
    if till is None:
        return None
    if line is None:
        line = state.lines.waiting(room)
    before = line.index(i) if i in line else len(line)
    return (before, till.spots[before]) if before < len(till.spots) else None


def advance_lines(state: SimulationState) -> None:
    """Serve whoever is first in each line for a second; who has walked away has left the line."""
    p, lines = state.people, state.lines
    for room in sorted(set(lines.room[lines.room >= 0].tolist())):
        spots = state.tills[room].spots
        for i in lines.waiting(room):
            place = lines.waiting(room).index(i)
            if int(p.room[i]) != room or _away(p.position[i], spots[place]) > LOST + SPACING * place:
                lines.leave(i)
                state.events.add("queue", p.names[i], "leaves the line", p.position[i])
        line = lines.waiting(room)
        if line and _away(p.position[line[0]], spots[0]) <= AT_SPOT:
            _serve(line[0], state)


def _serve(i: int, state: SimulationState) -> None:
    p, lines = state.people, state.lines
    lines.left[i] -= 1.0
    if lines.left[i] > 0.0:
        return
    paid = min(PRICE, float(p.cash[i]))
    p.cash[i] -= paid
    lines.leave(i)
    lines.served[i] += 1
    state.events.add("purchase", p.names[i], f"pays {paid:g} at the till", p.position[i], price=paid)


def _away(position: ArrayLike, spot: NDArray[np.float64]) -> float:
    return float(np.hypot(*(np.asarray(position, np.float64)[:2] - spot)))
