"""Lenses of traffic signals, lit and unlit, in the frame of the model `traffic_signals`; posts for the others."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from vico.assets.shapes import Colour, box
from vico.assets.vehicle_parts import one_surface
from vico.world.mesh import Material, Surface

_LENS, _SIDES = 0.105, 10  # radius, m, as the model's
_FRONT, _HIGHEST, _STEP = 0.302, 3.26, 0.31  # of the lenses, m: just before the model's
_WALK_FRONT, _WALK_HIGHEST, _WALK_STEP, _WALK_HALF = 0.362, 2.37, 0.24, 0.08
_LIT: dict[str, Colour] = {"red": (255, 62, 48), "amber": (255, 190, 40), "green": (70, 250, 150)}
_UNLIT: dict[str, Colour] = {"red": (52, 16, 14), "amber": (48, 38, 12), "green": (12, 40, 26)}
_SHINING = Material("signal", emission=1.0)


def _lens(z: float, colour: Colour) -> Surface:
    """Make a disc that faces +x."""
    angles = np.linspace(0, 2 * np.pi, _SIDES, endpoint=False)
    ring = np.column_stack([np.full(_SIDES, _FRONT), np.cos(angles) * _LENS, z + np.sin(angles) * _LENS])
    return Surface.from_triangles(ring, np.array([(0, i, i + 1) for i in range(1, _SIDES - 1)]), colour=colour)


def _walk_lens(z: float, colour: Colour) -> Surface:
    """Make a square that faces +y."""
    h = _WALK_HALF
    corners = np.array([(h, z - h), (-h, z - h), (-h, z + h), (h, z + h)])
    points = np.column_stack([corners[:, 0], np.full(4, _WALK_FRONT), corners[:, 1]])
    return Surface.from_triangles(points, np.array([(0, 1, 2), (0, 2, 3)]), colour=colour)


def _shown(light: str, lenses: dict[str, Surface], unlit: dict[str, Surface]) -> list[Surface]:
    """Return lenses with one of them lit ("dark": none)."""
    parts = [one_surface([surface for name, surface in unlit.items() if name != light])]
    return parts + [replace(surface, material=_SHINING) for name, surface in lenses.items() if name == light]


@cache
def signal_prototypes() -> dict[str, list[Surface]]:
    """Lenses by prototype's name: ``signal_red`` and ``walk_red`` and the like, ``_dark`` for none lit; a post."""
    heights = {name: _HIGHEST - k * _STEP for k, name in enumerate(_LIT)}
    walks = {name: _WALK_HIGHEST - k * _WALK_STEP for k, name in enumerate(("red", "green"))}
    lit = {name: _lens(z, _LIT[name]) for name, z in heights.items()}
    unlit = {name: _lens(z, _UNLIT[name]) for name, z in heights.items()}
    walk_lit = {name: _walk_lens(z, _LIT[name]) for name, z in walks.items()}
    walk_unlit = {name: _walk_lens(z, _UNLIT[name]) for name, z in walks.items()}
    found = {f"signal_{light}": _shown(light, lit, unlit) for light in (*_LIT, "dark")}
    found |= {f"walk_{light}": _shown(light, walk_lit, walk_unlit) for light in ("red", "green", "dark")}
    post = [
        box((0.1, 0.1, 3.4), (0, 0, 1.7), colour=(58, 60, 60)),
        box((0.2, 0.32, 0.96), (0.18, 0, 2.95), colour=(24, 25, 26)),
        box((0.02, 0.44, 1.1), (0.08, 0, 2.95), colour=(36, 38, 40)),
    ]
    return found | {"signal_post": [one_surface(post)]}
