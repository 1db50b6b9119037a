"""What a run tells of itself beside its counts: who got stuck, who was taken away, what overlapped."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from vico.clock import DAY, clock_of
from vico.sim.traffic.jams import Jam

if TYPE_CHECKING:
    from vico.sim.overlaps import OverlapCheck
    from vico.sim.simulation_state import SimulationState


def reports(state: SimulationState, check: OverlapCheck | None) -> dict[str, Any]:
    """Return what goes beside a run's counts.

    Returns
    -------
    dict
        ``rescued``: how many vehicles were taken out of jams, and the first of them by name, place, time, how long
        they had stood and why; ``stuck``: the same of who gets nowhere now; ``reentered``: how often cars that had
        left the map came back in; ``junctions``: by which rule vehicles enter them;
        ``cyclists`` where some ride: how many, and how far all of them have;
        ``buses`` where there are buses or bicycles: how late, see `vico.sim.transit.TransitSystem.lateness`;
        ``physics`` where there are robots: engine and frames; ``overlaps``
        where they were checked, see `vico.sim.overlaps.OverlapCheck`.
    """
    traffic = state.traffic
    rescued, stuck = (traffic.jams.rescued(), traffic.stuck()) if traffic is not None else ([], [])
    now = float(traffic.jams.elapsed[0]) if traffic is not None else 0.0
    found: dict[str, Any] = {
        "rescued": {
            "count": traffic.jams.count if traffic is not None else 0,
            "who": [_told(jam, state.second - now, state) for jam in rescued],
        },
        "stuck": {"count": len(stuck), "who": [_told(jam, state.second - now, state) for jam in stuck]},
        "reentered": traffic.reentered if traffic is not None else 0,
    }
    if traffic is not None:
        found["junctions"] = str(traffic.junction_rule)
        if traffic.cyclists:
            found["cyclists"] = {"count": traffic.cyclists, "kilometres": round(float(traffic.ridden.sum()) / 1e3, 3)}
    if state.transit is not None:
        found["buses"] = state.transit.lateness()
        if len(state.transit.trams):
            found["trams"] = state.transit.tram_lateness()
    if state.robots is not None:
        found["physics"] = state.robots.physics_record()
    return found if check is None else found | {"overlaps": check.record()}


def _told(jam: Jam, began: float, state: SimulationState) -> dict[str, Any]:
    kind = state.entity(jam.entity)["kind"]
    why = f"behind {state.entity(jam.before)['name']}" if jam.before else ""
    return {
        "who": state.entity(jam.entity)["name"],
        "where": [round(value, 1) for value in jam.position],
        "since": clock_of(round(began + jam.at - jam.stood) % DAY),
        "seconds": round(jam.stood),
        "why": why or ("no way past" if kind == "pedestrian" else "waits for a junction or room on its way"),
    }
