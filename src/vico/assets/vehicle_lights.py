"""Lamps of vehicles: headlights and rear lights that shine at night, brake lights and indicators."""

from __future__ import annotations

from functools import cache

from vico.assets.bus import bus_inside_lights
from vico.assets.shapes import Colour, box
from vico.assets.vehicle_parts import SHINING, both_sides, one_surface
from vico.assets.vehicles import CAR_KINDS, lamp_places
from vico.world.mesh import Surface

_WHITE: Colour = (255, 250, 228)
_DIM_RED: Colour = (150, 16, 14)
_RED: Colour = (255, 36, 22)
_AMBER: Colour = (255, 160, 20)
_PROUD = 0.006  # m that a lit lamp stands out of its face
_THICK = 0.012  # m


def _lamp(place: tuple[float, float, float], size: tuple[float, float], colour: Colour, out: float) -> Surface:
    """Make a lit rectangle (width, height) on a face of a lamp, `out` metres forward of it."""
    x, y, z = place
    return box((_THICK, *size), (x + out, y, z), colour=colour, material=SHINING)


@cache
def night_lamps(kind: str) -> Surface:
    """Return the headlights and rear lights of a kind of car, of the bus or a bicycle: they shine when it is dark.

    With the bus comes the light in it.
    """
    front, rear = lamp_places(kind)
    sizes = ((0.06, 0.06), (0.04, 0.05)) if kind == "bicycle" else ((0.24, 0.11), (0.18, 0.16))
    lamps = both_sides([_lamp(front, sizes[0], _WHITE, 0.0), _lamp(rear, sizes[1], _DIM_RED, 0.0)])
    return one_surface([*lamps, bus_inside_lights()] if kind == "bus" else lamps)


@cache
def lit_lamps() -> dict[str, list[Surface]]:
    """Return what is lit now and then: ``sedan:brake``, ``sedan:left`` and ``sedan:right``, and so on."""
    found: dict[str, list[Surface]] = {}
    for kind in (*CAR_KINDS, "bus"):
        front, rear = lamp_places(kind)
        upper, lower = (rear[0], rear[1], rear[2] + 0.04), (rear[0], rear[1], rear[2] - 0.055)
        outer = (front[0], front[1] + 0.11, front[2])
        left = [_lamp(lower, (0.2, 0.08), _AMBER, -2 * _PROUD), _lamp(outer, (0.09, 0.12), _AMBER, _PROUD)]
        found[f"{kind}:brake"] = [one_surface(both_sides([_lamp(upper, (0.2, 0.11), _RED, -_PROUD)]))]
        found[f"{kind}:left"] = [one_surface(left)]
        found[f"{kind}:right"] = [one_surface(both_sides(left)[len(left) :])]
    return found
