"""Where things stand that photos show: rays of several photos that agree, else where one ray meets the ground.

Photos of one thing are found together with its place. Candidates are where rays of two photos cross, and where a ray
through the foot of a box meets the ground. The candidate that the surest photos agree with is taken, moved to where it
fits its rays best, and its rays are used up; then the next. A ray that agrees with nothing is an outlier.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vico.geo.detections import Detections, Located, Sighting
from vico.world.heights import HeightField
from vico.world.model import Dropped
from vico.worldgen.objects.detections.agreement import NEAREST, ROUGH, Rays, agreeing, beside
from vico.worldgen.objects.detections.classes import Classes, DetectedClass, Rules

Floats = NDArray[np.float64]

_STEP = 0.25  # metres along a ray from look to look at the ground
_TILT = math.radians(1.0)  # error of a camera's pitch
_MOST_RAYS = 1_500  # of a class


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
    everything: list[Sighting | Located] = [*found.sightings, *found.located]
    for one in everything:
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
    for xy, members in agreeing(rays, rules):
        few = len(members) < (rules.raised_photos if raised else 2)
        if few:
            alone += members
            continue
        side = beside(rays, members, xy)
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


def _alone(one: Sighting, rays: Rays, k: int, raised: bool, name: str, rules: Rules) -> tuple[Spot | None, str]:
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


def _rays(sightings: Sequence[Sighting], raised: bool, height: HeightField, rules: Rules) -> Rays:
    origin = np.array([one.position[:2] for one in sightings])
    middle = np.array([one.middle[:2] for one in sightings])
    bearing = middle / np.maximum(np.linalg.norm(middle, axis=1, keepdims=True), 1e-9)
    photos = {photo: k for k, photo in enumerate(dict.fromkeys(one.photo for one in sightings))}
    distance, error = np.full(len(sightings), np.nan), np.full(len(sightings), np.nan)
    if not raised:
        for k, one in enumerate(sightings):
            distance[k], error[k] = _to_the_ground(one, height, rules.reach)
    return Rays(
        origin, bearing, distance, error, np.array([one.score for one in sightings]),
        np.array([photos[one.photo] for one in sightings]),
    )  # fmt: skip


def _to_the_ground(one: Sighting, height: HeightField, reach: float) -> tuple[float, float]:
    """Return how far off a ray through the foot of a box meets the ground, level, and the error; nan where nowhere."""
    level = float(np.hypot(*one.foot[:2]))
    if level < 1e-3:
        return math.nan, math.nan
    along = np.arange(NEAREST, reach + _STEP, _STEP)
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
    return distance, ROUGH + (distance**2 + drop**2) / drop * _TILT


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
