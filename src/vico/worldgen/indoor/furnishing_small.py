"""Small things on furniture: chosen by room and surface, apart from each other and from the edges.

A surface gives a strip at one of its ends to small things; what is left of it stays a container, so that things put
down there never stand in a vase.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vico.assets.models.library import furniture_models
from vico.assets.models.model import Top
from vico.worldgen.indoor.catalogue import room_kinds
from vico.worldgen.indoor.furnishing import Furnishing

_GAP = 0.02
_STRIP = 0.24
_LEAST_LEFT = 0.45  # what a surface keeps for other things, metres

_USED = {"table", "desk"}


@dataclass(frozen=True)
class Dressed:
    """Small things of a room, in its frame, and what is left of the surfaces they stand on, by furniture index.

    A surface that is full maps to None.
    """

    things: tuple[Furnishing, ...]
    tops: dict[int, Top | None]


def dressed(kind: str, items: Sequence[Furnishing], chance: np.random.Generator) -> Dressed:
    """Lay small things on the tables, desks and counters of a room.

    Parameters
    ----------
    kind
        Of the room.
    items
        Its furniture.
    """
    models, known = furniture_models(), room_kinds()
    things: list[Furnishing] = []
    tops: dict[int, Top | None] = {}
    for k, item in enumerate(items):
        top = models[item.prototype].top
        if top is None or top.kind not in _USED or chance.random() < 0.15:
            continue
        wanted = known.on.get(item.prototype) or known.of(kind).entry.small
        if not wanted:
            continue
        order = [wanted[int(j)] for j in chance.permutation(len(wanted))]
        deep, wide = top.size
        small = deep * wide < 0.3
        strip = wide if small else max(_STRIP, min(0.42, wide * 0.34))
        if not small and wide - strip < _LEAST_LEFT:
            continue
        end = 1.0 if chance.random() < 0.5 else -1.0
        middle = top.centre[1] if small else top.centre[1] + end * (wide - strip) / 2
        laid = _along(order, deep, strip, 1 if small else 3)
        if not laid:
            continue
        c, s = math.cos(item.yaw), math.sin(item.yaw)
        for name, u, turn in laid:
            x, y = top.centre[0] + u, middle
            things.append(
                Furnishing(
                    name,
                    round(item.x + c * x - s * y, 3),
                    round(item.y + s * x + c * y, 3),
                    round(math.remainder(item.yaw + turn, 2 * math.pi), 5),
                    round(top.height + item.z, 3),
                )
            )
        rest = None
        if not small:
            rest = replace(top, size=(deep, wide - strip), centre=(top.centre[0], top.centre[1] - end * strip / 2))
        tops[k] = rest
    return Dressed(tuple(things), tops)


def _along(names: Sequence[str], deep: float, strip: float, most: int) -> list[tuple[str, float, float]]:
    """Things side by side across a strip: name, place along its depth from its middle, quarter turn."""
    models = furniture_models()
    row: list[tuple[str, float, float]] = []  # name, width taken, turn
    used = _GAP
    for name in names:
        if len(row) == most:
            break
        a, b, _ = models[name].size
        for along, across, turn in ((a, b, 0.0), (b, a, math.pi / 2)):
            if across <= strip - 0.01 and used + along + _GAP <= deep:
                row.append((name, along, turn))
                used += along + _GAP
                break
    spare = (deep - used) / (len(row) + 1) if row else 0.0
    found, at = [], -deep / 2 + _GAP
    for name, along, turn in row:
        at += spare
        found.append((name, at + along / 2, turn))
        at += along + _GAP
    return found
