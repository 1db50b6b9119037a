"""Traffic signals of a run, as a browser shows them: what they show follows from the time of day."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from vico.sim.environment.city_events import event_kinds
from vico.sim.state.base import SimulationBase
from vico.sim.traffic import JunctionRule, TrafficNetwork
from vico.sim.traffic.signals import SignalClock, SignalDay, SignalHeads
from vico.sim.traffic.state import AMBER, GREEN, RED
from vico.world.heights import HeightField
from vico.world.world import World

_LETTERS = {GREEN: "g", AMBER: "a", RED: "r"}


def signals_of(world: World, junctions: str, seed: int) -> dict[str, Any]:
    """Return what ``/api/signals`` tells; no heads where the run's traffic obeys no signals.

    Parameters
    ----------
    junctions, seed
        As in the run's `vico.sim.config.SimConfig`.
    """
    dark = [name for name, kind in event_kinds().items() if kind.dark]
    found: dict[str, Any] = {"cycles": [], "heads": []}
    if JunctionRule(junctions).has_signals and len(world.lanes):
        found = heads_on(SimulationBase.of(world).streets, world.height, seed)
    return found | {"dark_events": dark}


def heads_on(streets: TrafficNetwork, height: HeightField, seed: int) -> dict[str, Any]:
    """Return the heads of all signals, and the cycles of what they show."""
    clock = SignalClock(streets.lanes, streets.walks, seed)
    placed = SignalHeads(streets.lanes, streets.walks, streets.poles, height).placed
    days: list[tuple[str, SignalDay | None]] = [("signal", clock.day_of_lane(lane)) for lane in placed.lane.tolist()]
    days += [("walk", clock.day_of_walkway(way)) for way in placed.walkway.tolist()]
    days += [("signal_post", None)] * (len(placed.transforms) - len(days))
    cycles: dict[str, int] = {}
    heads = []
    for (kind, day), transform in zip(days, placed.transforms.astype(np.float64), strict=True):
        head: dict[str, Any] = {"kind": kind, "at": np.round(transform[:3, 3], 3).tolist()}
        head["yaw"] = round(math.atan2(transform[1, 0], transform[0, 0]), 4)
        head["scale"] = round(float(transform[2, 2]), 4)
        if day is not None:
            text = "".join(_LETTERS.get(light, "-") for light in day.light.tolist())
            head["cycle"] = cycles.setdefault(text, len(cycles))
            head["junction"] = [round(value, 2) for value in day.position]
        heads.append(head)
    return {"cycles": list(cycles), "heads": heads}
