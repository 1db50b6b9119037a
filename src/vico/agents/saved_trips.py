"""Legs of trips as plain data, for what agents remember of a trip under way."""

from __future__ import annotations

from typing import Any

import numpy as np

from vico.world.trips import Leg

_FIELDS = ("mode", "depart", "arrive", "metres", "price", "line", "origin", "destination")


def leg_state(leg: Leg) -> dict[str, Any]:
    """Return a leg as plain data."""
    fields = {name: getattr(leg, name) for name in _FIELDS}
    return fields | {"start": list(leg.start), "end": list(leg.end), "polyline": leg.polyline.copy()}


def restored_leg(state: dict[str, Any]) -> Leg:
    """Return the leg that `leg_state` returned as data."""
    start, end = ((float(x), float(y)) for x, y in (state["start"], state["end"]))
    polyline = np.array(state["polyline"], np.float64).reshape(-1, 2)
    return Leg(start=start, end=end, polyline=polyline, **{name: state[name] for name in _FIELDS})
