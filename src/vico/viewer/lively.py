"""Where somebody starts who is to see the city: on a sidewalk with many doors in sight, looking along them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vico.errors import InputError
from vico.world.model import Place
from vico.world.walkable import BLOCKED, OPEN, SIDEWALK, WalkableMap
from vico.world.world import World

# Doors count from here to there, metres, the nearer the more, within so much of the way one looks, radians.
_NEAREST, _FARTHEST, _FADES, _SIDE = 6.0, 80.0, 40.0, 0.6
# Looks that are tried at a spot; spots lie this far apart, metres, and as far from walls at least as `clearance`.
_LOOKS, _APART = 16, 4.0
# Of the window's half side: beyond, the city ends in sight.
_WITHIN = 0.6
# The best of them are tried for what stands in the way, each some metres along a look.
_TRIED, _STEP, _WANTED = 60, 0.5, 60.0
# People go in and out of others than these all day.
_QUIET = ("apartments", "company", "office", "house")


def lively_spot(world: World, *, clearance: float = 0.6) -> tuple[float, float, float]:
    """Return a place from which much of a city's life is seen: x, y (ENU metres) and yaw (radians).

    Parameters
    ----------
    clearance
        Metres around it that have to be free.

    Raises
    ------
    InputError
        If there is no free ground.
    """
    spots = _spots(world.walkable, clearance)
    if not len(spots):
        raise InputError(f"{world.manifest.name}: no free ground to start on")
    looks = np.linspace(-np.pi, np.pi, _LOOKS, endpoint=False)
    seen = _doors_seen(spots, looks, np.array([place.position[:2] for place in world.places if _is_lively(place)]))
    # A window without doors: whatever has the longest view.
    best = np.argsort(-seen.reshape(-1), kind="stable")[:_TRIED]
    values = [seen.reshape(-1)[k] * _view(world.walkable, spots[k // _LOOKS], looks[k % _LOOKS]) for k in best.tolist()]
    chosen = int(best[int(np.argmax(values))])
    x, y = spots[chosen // _LOOKS].tolist()
    return x, y, float(looks[chosen % _LOOKS])


def _is_lively(place: Place) -> bool:
    return place.entrance is not None and place.kind not in _QUIET


def _spots(walkable: WalkableMap, clearance: float) -> NDArray[np.float64]:
    """Return sidewalks, or open ground where there are none, that one gets away from, shape ``(n, 2)``."""
    edge = walkable.half * _WITHIN
    axis = np.arange(-edge, edge, _APART)
    points = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    points = points[walkable.is_connected(points) & (walkable.clearance_at(points) >= clearance)]
    kinds = walkable.class_at(points)
    return next((points[kinds == kind] for kind in (SIDEWALK, OPEN) if (kinds == kind).any()), points[:0])


def _doors_seen(
    spots: NDArray[np.float64], looks: NDArray[np.float64], doors: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return how much is seen of doors at each spot in each look, shape ``(spots, looks)``; more than 0."""
    seen = np.full((len(spots), len(looks)), 1e-6)
    for door in doors:
        to = door - spots
        away = np.hypot(to[:, 0], to[:, 1])
        near = np.flatnonzero((away > _NEAREST) & (away < _FARTHEST))
        aside = np.arctan2(to[near, 1], to[near, 0])[:, None] - looks
        aside = np.abs((aside + np.pi) % (2 * np.pi) - np.pi)
        seen[near] += np.exp(-away[near] / _FADES)[:, None] * (aside < _SIDE)
    return seen


def _view(walkable: WalkableMap, spot: NDArray[np.float64], look: float) -> float:
    """Return how far one sees along a look, of what is wanted."""
    away = np.arange(_STEP, _WANTED, _STEP)
    points = spot + away[:, None] * np.array([np.cos(look), np.sin(look)])
    blocked = np.flatnonzero((walkable.class_at(points) == BLOCKED) | ~walkable.inside(points))
    return float(away[blocked[0]] if len(blocked) else _WANTED) / _WANTED
