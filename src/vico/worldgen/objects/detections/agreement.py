"""Which rays of several photos agree on a place, and the place that fits them best."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from vico.worldgen.objects.detections.classes import Rules

Floats = NDArray[np.float64]

ROUGH = 0.3  # metres: boxes are not drawn better
NEAREST = 1.0  # metres from a camera
_CROSSING = math.radians(6.0)  # rays that cross at less say little
_SIGMAS = 3.0
_MOST_CANDIDATES = 20_000  # of a class
_ROUNDS = 4


@dataclass(frozen=True)
class Rays:
    """Detections of one class, as rays on the map.

    Attributes
    ----------
    origin, bearing
        Cameras, ENU metres, and unit directions, shape ``(n, 2)``.
    distance, error
        Where the foot of each box meets the ground, and how well that is known, metres, shape ``(n,)``; nan: not known.
    score
        Of the detections, 0..1, shape ``(n,)``.
    photo
        Number of the photo that each is in, shape ``(n,)``.
    """

    origin: Floats
    bearing: Floats
    distance: Floats
    error: Floats
    score: Floats
    photo: NDArray[np.int64]

    def taken(self, which: NDArray[np.bool_]) -> Rays:
        """Return some of them."""
        return Rays(*(getattr(self, one.name)[which] for one in fields(self)))


def agreeing(rays: Rays, rules: Rules) -> list[tuple[Floats, list[int]]]:
    """Return places and the rays that agree on each, most agreed first; every ray is in one of them."""
    candidates = _candidates(rays, rules)
    agrees = _agreement(candidates, rays, rules)
    free = np.ones(len(rays.score), bool)
    order = np.argsort(rays.photo, kind="stable")
    starts = np.flatnonzero(np.r_[True, np.diff(rays.photo[order]) > 0])
    worth = np.where(agrees, rays.score, 0.0)[:, order]
    # One photo shows a thing once: of its rays the surest counts.
    weight = np.maximum.reduceat(worth, starts, axis=1).sum(axis=1) if len(candidates) else np.zeros(0)
    found: list[tuple[Floats, list[int]]] = []
    while len(weight) and weight.max() > 0.0:
        best = int(weight.argmax())
        xy, members = _refined(candidates[best], rays, free, rules)
        if not members:
            weight[best] = 0.0
            continue
        found.append((xy, members))
        free[members] = False
        touched = np.flatnonzero(agrees[:, members].any(axis=1))
        rest = np.where(agrees[touched] & free, rays.score, 0.0)[:, order]
        weight[touched] = np.maximum.reduceat(rest, starts, axis=1).sum(axis=1)
    return found + [(rays.origin[k], [k]) for k in np.flatnonzero(free).tolist()]


def _candidates(rays: Rays, rules: Rules) -> Floats:
    """Return where rays meet the ground, and where two of different photos cross."""
    known = np.flatnonzero(~np.isnan(rays.distance))
    hits = rays.origin[known] + rays.bearing[known] * rays.distance[known, None]
    a, b = np.triu_indices(len(rays.score), 1)
    other = rays.photo[a] != rays.photo[b]
    a, b = a[other], b[other]
    cross = rays.bearing[a, 0] * rays.bearing[b, 1] - rays.bearing[a, 1] * rays.bearing[b, 0]
    steep = np.abs(cross) > math.sin(_CROSSING)
    a, b, cross = a[steep], b[steep], cross[steep]
    apart = rays.origin[b] - rays.origin[a]
    along_a = (apart[:, 0] * rays.bearing[b, 1] - apart[:, 1] * rays.bearing[b, 0]) / cross
    along_b = (apart[:, 0] * rays.bearing[a, 1] - apart[:, 1] * rays.bearing[a, 0]) / cross
    good = np.ones(len(a), bool)
    for which, along in ((a, along_a), (b, along_b)):
        good &= (along > NEAREST) & (along < rules.reach)
        good &= ~(np.abs(along - rays.distance[which]) > _SIGMAS * rays.error[which])
    crossings = rays.origin[a[good]] + rays.bearing[a[good]] * along_a[good, None]
    return np.concatenate([crossings, hits])[:_MOST_CANDIDATES]


def _agreement(places: Floats, rays: Rays, rules: Rules) -> NDArray[np.bool_]:
    """Which rays pass which places near enough, shape ``(places, rays)``."""
    delta = places[:, None, :] - rays.origin[None, :, :]
    along = (delta * rays.bearing).sum(axis=2)
    off = np.abs(delta[..., 0] * rays.bearing[:, 1] - delta[..., 1] * rays.bearing[:, 0])
    near = (along > 0.0) & (along < rules.reach) & (off <= ROUGH + along * math.tan(math.radians(rules.bearing)))
    return near & ~(np.abs(along - rays.distance) > _SIGMAS * rays.error)


def _refined(place: Floats, rays: Rays, free: NDArray[np.bool_], rules: Rules) -> tuple[Floats, list[int]]:
    """Move a place to where it fits its rays best (weighted least squares), and return them, one a photo."""
    members: list[int] = []
    for _ in range(_ROUNDS):
        near = np.flatnonzero(_agreement(place[None], rays, rules)[0] & free)
        best: dict[int, int] = {}
        for k in near.tolist():
            held = best.get(int(rays.photo[k]))
            if held is None or _off(rays, k, place) < _off(rays, held, place):
                best[int(rays.photo[k])] = k
        if sorted(best.values()) == members:
            break
        members = sorted(best.values())
        if not members:
            break
        place = _fitted(place, rays, members, rules)
    return place, members


def _off(rays: Rays, k: int, place: Floats) -> float:
    return abs(float(beside(rays, [k], place)[0]))


def beside(rays: Rays, members: Sequence[int], place: Floats) -> Floats:
    """Return how far rays pass a place, metres, to the left positive."""
    delta = place - rays.origin[list(members)]
    bearing = rays.bearing[list(members)]
    return np.asarray(bearing[:, 0] * delta[:, 1] - bearing[:, 1] * delta[:, 0], np.float64)


def _fitted(place: Floats, rays: Rays, members: list[int], rules: Rules) -> Floats:
    """Return the place nearest to rays, and to the distances where they meet the ground, each by its error."""
    bearing = rays.bearing[members]
    normal = np.column_stack([-bearing[:, 1], bearing[:, 0]])
    along = ((place - rays.origin[members]) * bearing).sum(axis=1)
    sigma = ROUGH + np.maximum(along, NEAREST) * math.radians(rules.bearing) / 2
    rows, aims, weights = [normal], [(normal * rays.origin[members]).sum(axis=1)], [1 / sigma]
    known = ~np.isnan(rays.distance[members])
    if known.any():
        rows.append(bearing[known])
        aims.append((bearing[known] * rays.origin[members][known]).sum(axis=1) + rays.distance[members][known])
        weights.append(1 / rays.error[members][known])
    matrix, aim, weight = np.concatenate(rows), np.concatenate(aims), np.concatenate(weights)
    if len(matrix) < 2:
        return place
    solved, _, rank, _ = np.linalg.lstsq(matrix * weight[:, None], aim * weight, rcond=1e-6)
    return np.asarray(solved, np.float64) if rank == 2 else place
