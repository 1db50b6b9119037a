"""Errands over spots in the open, with ways as the crow flies: what planners' tests are made of."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from vico.agents.assistant.skills import ObservationView

LOOK = 20.0


class Crow:
    """Ways as the crow flies, at 2 m/s; every look takes the same, and no region is likelier than another."""

    time = 0.0

    def travel(self, start: Sequence[float], goal: Sequence[float], *, pace: float = 2.0) -> float:
        return math.dist(start[:2], goal[:2]) / pace

    def look(self, region: dict[str, Any], *, person: bool) -> float:
        return LOOK

    def weight(self, region: dict[str, Any], *, person: bool) -> float:
        return 1.0


def view_from(x: float, y: float, held: Sequence[int] = (0, 0), *, room: str = "") -> ObservationView:
    state = {"room": room, "held": list(held), "time": 28800.0}
    return ObservationView({"pose": [x, y, 0.0, 1.0, 0.0, 0.0], "state": state}, {})


def spot(x: float, y: float) -> dict[str, Any]:
    return {"kind": "outdoor", "name": "a spot", "place": None, "centre": (x, y, 0.0), "radius": 8.0, "surface": None}


def told(
    index: int, category: str, sources: Sequence[tuple[float, float]], end: tuple[float, float], *, things: int = 1
) -> dict[str, Any]:
    return {
        "index": index, "category": category, "text": "", "person": {"agent": "r", "name": f"P{index} Q", "looks": ""},
        "objects": [f"thing {index}.{k}" for k in range(things)], "sources": [spot(*at) for at in sources],
        "destination": None if category == "search" else spot(*end),
    }  # fmt: skip
