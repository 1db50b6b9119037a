"""Traffic signals of a run, as a browser shows them: what they show follows from the time of day."""

from __future__ import annotations

from typing import Any

import numpy as np

from vico.sim.base import SimulationBase
from vico.sim.environment.event_kinds import event_kinds
from vico.sim.traffic import JunctionRule
from vico.sim.traffic.signal_heads import SignalHeads
from vico.sim.traffic.signals import SignalClock, SignalDay
from vico.sim.traffic.state import AMBER, GREEN, RED
from vico.world.folder import World

_LETTERS = {GREEN: "g", AMBER: "a", RED: "r"}


def signals_of(world: World, junctions: str, seed: int) -> dict[str, Any]:
    """Return what ``/api/signals`` tells; no heads where the run's traffic obeys no signals.

    Parameters
    ----------
    junctions, seed
        As in the run's `vico.sim.config.SimConfig`.
    """
    told: dict[str, Any] = {
        "cycles": [],
        "heads": [],
        "dark_events": [k for k, kind in event_kinds().items() if kind.dark],
    }
    if not JunctionRule(junctions).has_signals or not len(world.lanes):
        return told
    streets = SimulationBase.of(world).streets
    clock = SignalClock(streets.lanes, streets.walks, seed)
    placed = SignalHeads(streets.lanes, streets.walks, streets.poles, world.height).placed
    days: list[tuple[str, SignalDay | None]] = [("signal", clock.day_of_lane(lane)) for lane in placed.lane.tolist()]
    days += [("walk", clock.day_of_walkway(way)) for way in placed.walkway.tolist()]
    days += [("signal_post", None)] * (len(placed.transforms) - len(days))
    cycles: dict[str, int] = {}
    for (kind, day), transform in zip(days, placed.transforms.astype(np.float64), strict=True):
        head: dict[str, Any] = {"kind": kind, "at": np.round(transform[:3, 3], 3).tolist()}
        head["yaw"] = round(float(np.arctan2(transform[1, 0], transform[0, 0])), 4)
        head["scale"] = round(float(transform[2, 2]), 4)
        if day is not None:
            text = "".join(_LETTERS.get(light, "-") for light in day.light.tolist())
            head["cycle"] = cycles.setdefault(text, len(cycles))
            head["junction"] = [round(value, 2) for value in day.position]
        told["heads"].append(head)
    return told | {"cycles": list(cycles)}
