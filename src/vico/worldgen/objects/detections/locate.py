"""Where things stand that photos show: rays of several photos that agree, else where one ray meets the ground.

Photos of one thing are found together with its place. Candidates are where rays of two photos cross, and where a ray
through the foot of a box meets the ground. The candidate that the surest photos agree with is taken, moved to where it
fits its rays best, and its rays are used up; then the next. A ray that agrees with nothing is an outlier.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from vico.geo.detections.model import Detections, Sighting
from vico.world.heights import HeightField
from vico.world.model import Dropped
from vico.worldgen.objects.detections.classes import Classes, DetectedClass, Rules

Floats = NDArray[np.float64]

_STEP = 0.25  # metres along a ray from look to look at the ground
_TILT = math.radians(1.0)  # error of a camera's pitch
_ROUGH = 0.3  # metres: the foot of a box is not drawn better
_CROSSING = math.radians(6.0)  # rays that cross at less say little
_NEAREST = 1.0  # metres
_SIGMAS = 3.0
_MOST_CANDIDATES, _MOST_RAYS = 20_000, 1_500  # of a class
_ROUNDS = 4


@dataclass(frozen=True)
class Spot:
    """A thing that photos show.

    Attributes
    ----------
    id
        Of the first of its detections.
    name
        Its class.
    xy
        Where it stands, ENU metres, shape ``(2,)``.
    photos
        Ids of the photos that show it, in order.
    score
        Mean of its detections.
    spread
        How far its rays pass it, root of the mean square, metres; None where one photo or another source placed it.
    how
        ``triangulated``, ``on the ground`` (one photo) or ``located`` (told by the file).
    """

    id: str
    name: str
    xy: Floats
    photos: tuple[str, ...]
    score: float
    spread: float | None
    how: str


@dataclass(frozen=True)
class _Rays:
    """Detections of one class: rays on the map, and distances to the ground and their errors (nan: none)."""

    origin: Floats
    bearing: Floats
    distance: Floats
    error: Floats
    score: Floats
    photo: NDArray[np.int64]

    def taken(self, which: NDArray[np.bool_]) -> _Rays:
        """Return some of them."""
        return _Rays(*(getattr(self, one.name)[which] for one in fields(self)))


def located(found: Detections, height: HeightField, classes: Classes) -> tuple[list[Spot], list[Dropped]]:
    """Return the things that a file of detections tells of, and what of it is left out, with the reason.

    Parameters
    ----------
    found
        The detections.
    height
        Ground heights.
    classes
        What classes stand for, and the rules.
    """
    dropped = [Dropped(id=key, reason=reason) for key, reason in found.refused]
    lots: dict[str, list[Sighting]] = {}
    keys: dict[str, DetectedClass] = {}
    spots: list[Spot] = []
    for one in (*found.sightings, *found.located):
        entry = classes.by_name.get(one.name.lower())
        if entry is None:
            dropped.append(Dropped(id=one.id, reason=f"class {one.name!r} stands for nothing; see docs/detections.md"))
        elif one.score < classes.rules.least_score:
            dropped.append(Dropped(id=one.id, reason=f"score under {classes.rules.least_score:g}"))
        elif isinstance(one, Sighting):
            lots.setdefault(entry.names[0], []).append(one)
            keys[entry.names[0]] = entry
        else:
            spots.append(Spot(one.id, entry.names[0], one.xy, one.photos, one.score, None, "located"))
    for name, sightings in lots.items():
        if len(sightings) > _MOST_RAYS:
            dropped += [
                Dropped(id=one.id, reason=f"more than {_MOST_RAYS} of {name!r}") for one in sightings[_MOST_RAYS:]
            ]
        found_here, out = _of_class(sightings[:_MOST_RAYS], name, keys[name].raised, height, classes.rules)
        spots += found_here
        dropped += out
    inside = [bool(np.abs(spot.xy).max() < height.half) for spot in spots]
    dropped += [
        Dropped(id=spot.id, reason="it lies outside the window")
        for spot, is_inside in zip(spots, inside, strict=True)
        if not is_inside
    ]
    return [spot for spot, is_inside in zip(spots, inside, strict=True) if is_inside], dropped


def _of_class(
    sightings: Sequence[Sighting], name: str, raised: bool, height: HeightField, rules: Rules
) -> tuple[list[Spot], list[Dropped]]:
    rays = _rays(sightings, raised, height, rules)
    spots: list[Spot] = []
    dropped: list[Dropped] = []
    if not raised:
        # What ends above the ground is no thing that stands on it, however well its ray fits others.
        floating = np.isnan(rays.distance)
        dropped += [
            Dropped(id=sightings[k].id, reason=f"its foot meets no ground within {rules.reach:g} m")
            for k in np.flatnonzero(floating).tolist()
        ]
        sightings = [sightings[k] for k in np.flatnonzero(~floating).tolist()]
        rays = rays.taken(~floating)
    alone: list[int] = []
    for xy, members in _agreeing(rays, rules):
        few = len(members) < (rules.raised_photos if raised else 2)
        if few:
            alone += members
            continue
        side = _beside(rays, members, xy)
        spread = round(float(np.sqrt((side**2).mean())), 3)
        spots.append(_spot(sightings, members, name, xy, spread, "triangulated"))
    for k in alone:
        spot, reason = _alone(sightings[k], rays, k, raised, name, rules)
        if spot is not None and any(math.dist(spot.xy, other.xy) < rules.apart for other in spots):
            spot, reason = None, "beside one that more photos or a surer one show"
        if spot is None:
            dropped.append(Dropped(id=sightings[k].id, reason=reason))
        else:
            spots.append(spot)
    return spots, dropped


def _spot(
    sightings: Sequence[Sighting], members: Sequence[int], name: str, xy: Floats, spread: float | None, how: str
) -> Spot:
    taken = [sightings[k] for k in sorted(members)]
    score = round(sum(one.score for one in taken) / len(taken), 3)
    return Spot(taken[0].id, name, np.round(xy, 3), tuple(one.photo for one in taken), score, spread, how)


def _alone(one: Sighting, rays: _Rays, k: int, raised: bool, name: str, rules: Rules) -> tuple[Spot | None, str]:
    """Return the thing that a single photo shows, or None and why it is not placed."""
    if raised:
        return None, f"seen in fewer than {rules.raised_photos} photos that agree, and not on the ground"
    distance = float(rays.distance[k])
    if distance > rules.alone_reach or one.score < rules.alone_score:
        return None, f"seen in one photo alone, {distance:.0f} m away, score {one.score:.2f}"
    return Spot(
        one.id, name, np.round(rays.origin[k] + rays.bearing[k] * distance, 3), (one.photo,), one.score, None,
        "on the ground",
    ), ""  # fmt: skip


def _rays(sightings: Sequence[Sighting], raised: bool, height: HeightField, rules: Rules) -> _Rays:
    origin = np.array([one.position[:2] for one in sightings])
    middle = np.array([one.middle[:2] for one in sightings])
    bearing = middle / np.maximum(np.linalg.norm(middle, axis=1, keepdims=True), 1e-9)
    photos = {photo: k for k, photo in enumerate(dict.fromkeys(one.photo for one in sightings))}
    distance, error = np.full(len(sightings), np.nan), np.full(len(sightings), np.nan)
    if not raised:
        for k, one in enumerate(sightings):
            distance[k], error[k] = _to_the_ground(one, height, rules.reach)
    return _Rays(
        origin, bearing, distance, error, np.array([one.score for one in sightings]),
        np.array([photos[one.photo] for one in sightings]),
    )  # fmt: skip


def _to_the_ground(one: Sighting, height: HeightField, reach: float) -> tuple[float, float]:
    """Return how far off a ray through the foot of a box meets the ground, level, and the error; nan where nowhere."""
    level = float(np.hypot(*one.foot[:2]))
    if level < 1e-3:
        return math.nan, math.nan
    along = np.arange(_NEAREST, reach + _STEP, _STEP)
    points = one.position[:2] + one.foot[:2] / level * along[:, None]
    eye = one.position[2] if one.eye is None else float(height(one.position[:2])) + one.eye
    above = eye + one.foot[2] / level * along - height(points)
    under = np.flatnonzero(above <= 0.0)
    if not len(under) or under[0] == 0:
        return math.nan, math.nan
    k = int(under[0])
    share = above[k - 1] / max(above[k - 1] - above[k], 1e-9)
    distance = float(along[k - 1] + share * _STEP)
    drop = max(eye - float(height(one.position[:2] + one.foot[:2] / level * distance)), 0.3)
    return distance, _ROUGH + (distance**2 + drop**2) / drop * _TILT


def _agreeing(rays: _Rays, rules: Rules) -> list[tuple[Floats, list[int]]]:
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


def _candidates(rays: _Rays, rules: Rules) -> Floats:
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
        good &= (along > _NEAREST) & (along < rules.reach)
        good &= ~(np.abs(along - rays.distance[which]) > _SIGMAS * rays.error[which])
    crossings = rays.origin[a[good]] + rays.bearing[a[good]] * along_a[good, None]
    return np.concatenate([crossings, hits])[:_MOST_CANDIDATES]


def _agreement(places: Floats, rays: _Rays, rules: Rules) -> NDArray[np.bool_]:
    """Which rays pass which places near enough, shape ``(places, rays)``."""
    delta = places[:, None, :] - rays.origin[None, :, :]
    along = (delta * rays.bearing).sum(axis=2)
    beside = np.abs(delta[..., 0] * rays.bearing[:, 1] - delta[..., 1] * rays.bearing[:, 0])
    near = (along > 0.0) & (along < rules.reach) & (beside <= _ROUGH + along * math.tan(math.radians(rules.bearing)))
    return near & ~(np.abs(along - rays.distance) > _SIGMAS * rays.error)


def _refined(place: Floats, rays: _Rays, free: NDArray[np.bool_], rules: Rules) -> tuple[Floats, list[int]]:
    """Move a place to where it fits its rays best (weighted least squares), and return them, one a photo."""
    members: list[int] = []
    for _ in range(_ROUNDS):
        agreeing = np.flatnonzero(_agreement(place[None], rays, rules)[0] & free)
        best: dict[int, int] = {}
        for k in agreeing.tolist():
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


def _off(rays: _Rays, k: int, place: Floats) -> float:
    return abs(float(_beside(rays, [k], place)[0]))


def _beside(rays: _Rays, members: Sequence[int], place: Floats) -> Floats:
    """How far rays pass a place, metres, to the left positive."""
    delta = place - rays.origin[list(members)]
    bearing = rays.bearing[list(members)]
    return np.asarray(bearing[:, 0] * delta[:, 1] - bearing[:, 1] * delta[:, 0], np.float64)


def _fitted(place: Floats, rays: _Rays, members: list[int], rules: Rules) -> Floats:
    """Return the place nearest to rays, and to the distances where they meet the ground, each by its error."""
    bearing = rays.bearing[members]
    normal = np.column_stack([-bearing[:, 1], bearing[:, 0]])
    along = ((place - rays.origin[members]) * bearing).sum(axis=1)
    sigma = _ROUGH + np.maximum(along, _NEAREST) * math.radians(rules.bearing) / 2
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


def merged(spots: Sequence[Spot], apart: float) -> tuple[list[Spot], list[Dropped]]:
    """Return things of which no two of a class are nearer than `apart`; the one that more photos show stays."""
    kept: list[Spot] = []
    dropped: list[Dropped] = []
    for spot in sorted(spots, key=lambda one: (-len(one.photos), -one.score, one.id)):
        twin = next((o for o in kept if o.name == spot.name and math.dist(o.xy, spot.xy) < apart), None)
        if twin is None:
            kept.append(spot)
        else:
            dropped.append(Dropped(id=spot.id, reason=f"the same as {twin.id}"))
    return kept, dropped
