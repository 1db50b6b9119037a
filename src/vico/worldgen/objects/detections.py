"""Things that photos show: where they stand, which of them the map knows already, and which source is right.

What the classes of detectors stand for, and the rules by which they are placed, are data, read once. Photos of one
thing are found together with its place. Candidates are where rays of two photos cross, and where a ray through the foot
of a box meets the ground. The candidate that the surest photos agree with is taken, moved to where it fits its rays
best, and its rays are used up; then the next. A ray that agrees with nothing is an outlier.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from vico.assets.models.library import street_models
from vico.errors import SchemaError
from vico.geo.detections import Detections, Located, Sighting
from vico.geo.osm import OsmData, OsmNode
from vico.geometry import distances
from vico.io.data_files import DataRecord, cached_data, data_files, read_record
from vico.world.heights import HeightField
from vico.world.model import Dropped
from vico.world.world import DetectedObject
from vico.worldgen.objects.mapped_objects import mapped_placements, thing_of
from vico.worldgen.objects.placement import Placement

GUIDE = "docs/detections.md"
_ROOM, _KIND = "worldgen/objects", "detections"

Length = Annotated[float, Field(gt=0.0, le=500.0)]
Share = Annotated[float, Field(ge=0.0, le=1.0)]
Count = Annotated[int, Field(ge=1, le=100)]


class Rules(DataRecord):
    """How detections are placed; the file says what each number means."""

    least_score: Share
    reach: Length
    bearing: Annotated[float, Field(gt=0.0, le=20.0)]
    raised_photos: Count
    alone_score: Share
    alone_reach: Length
    apart: Length
    same: Length
    map_wins: Length
    photos_to_move: Count


class DetectedClass(DataRecord):
    """Meaning of a class of detections.

    Attributes
    ----------
    names
        As detectors call it, in small letters.
    tags
        What a map would say of it.
    raised
        The lower side of its box is not on the ground.
    """

    names: tuple[str, ...] = Field(min_length=1)
    tags: dict[str, str] = Field(min_length=1)
    raised: bool = False


class _ClassesFile(DataRecord):
    rules: Rules | None = None
    classes: tuple[DetectedClass, ...] = Field(default=(), alias="class")


@dataclass(frozen=True)
class Classes:
    """Classes by name, and the rules."""

    rules: Rules
    by_name: Mapping[str, DetectedClass]


@cached_data
def detected_classes() -> Classes:
    """Return the classes; of two entries for a name, and of two sets of rules, the user's counts.

    Raises
    ------
    SchemaError
        If a file can't be used, or the tags of a class are nothing that stands in streets.
    """
    rules: Rules | None = None
    by_name: dict[str, DetectedClass] = {}
    for path in data_files(_ROOM, _KIND):
        file = read_record(path, _ClassesFile, guide=GUIDE)
        rules = file.rules or rules
        for k, entry in enumerate(file.classes):
            if entry.tags.get("natural") != "tree" and thing_of(entry.tags) is None:
                raise SchemaError(f"{path}: class.{k}.tags: no model stands for them; see docs/adding_an_object.md")
            by_name |= dict.fromkeys((name.lower() for name in entry.names), entry)
    if rules is None:
        raise SchemaError(f"{_ROOM}/{_KIND}: no file has [rules]; see {GUIDE}")
    return Classes(rules, by_name)


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

    def select(self, which: NDArray[np.bool_]) -> Rays:
        """Return some of them."""
        return Rays(*(getattr(self, one.name)[which] for one in fields(self)))


def _agreeing_places(rays: Rays, rules: Rules) -> list[tuple[Floats, list[int]]]:
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
        xy, members = _refine_place(candidates[best], rays, free, rules)
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


def _refine_place(place: Floats, rays: Rays, free: NDArray[np.bool_], rules: Rules) -> tuple[Floats, list[int]]:
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
        place = _fit_place(place, rays, members, rules)
    return place, members


def _off(rays: Rays, k: int, place: Floats) -> float:
    return abs(float(lateral_offsets(rays, [k], place)[0]))


def lateral_offsets(rays: Rays, members: Sequence[int], place: Floats) -> Floats:
    """Return how far rays pass a place, metres, to the left positive."""
    delta = place - rays.origin[list(members)]
    bearing = rays.bearing[list(members)]
    return np.asarray(bearing[:, 0] * delta[:, 1] - bearing[:, 1] * delta[:, 0], np.float64)


def _fit_place(place: Floats, rays: Rays, members: list[int], rules: Rules) -> Floats:
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


_STEP = 0.25  # metres along a ray from look to look at the ground
_TILT = math.radians(1.0)  # error of a camera's pitch
_MOST_RAYS = 1_500  # of a class


@dataclass(frozen=True)
class LocatedThing:
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


def _locate(found: Detections, height: HeightField, classes: Classes) -> tuple[list[LocatedThing], list[Dropped]]:
    """Return the things in a file of detections, and those that are left out, with the reason.

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
    spots: list[LocatedThing] = []
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
            spots.append(LocatedThing(one.id, entry.names[0], one.xy, one.photos, one.score, None, "located"))
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
) -> tuple[list[LocatedThing], list[Dropped]]:
    rays = _rays(sightings, raised, height, rules)
    spots: list[LocatedThing] = []
    dropped: list[Dropped] = []
    if not raised:
        # What ends above the ground is no thing that stands on it, however well its ray fits others.
        floating = np.isnan(rays.distance)
        dropped += [
            Dropped(id=sightings[k].id, reason=f"its foot meets no ground within {rules.reach:g} m")
            for k in np.flatnonzero(floating).tolist()
        ]
        sightings = [sightings[k] for k in np.flatnonzero(~floating).tolist()]
        rays = rays.select(~floating)
    alone: list[int] = []
    for xy, members in _agreeing_places(rays, rules):
        few = len(members) < (rules.raised_photos if raised else 2)
        if few:
            alone += members
            continue
        side = lateral_offsets(rays, members, xy)
        spread = round(float(np.sqrt((side**2).mean())), 3)
        taken = [sightings[k] for k in sorted(members)]
        score = round(sum(one.score for one in taken) / len(taken), 3)
        photos = tuple(one.photo for one in taken)
        spots.append(LocatedThing(taken[0].id, name, np.round(xy, 3), photos, score, spread, "triangulated"))
    for k in alone:
        spot, reason = _alone(sightings[k], rays, k, raised, name, rules)
        if spot is not None and any(math.dist(spot.xy, other.xy) < rules.apart for other in spots):
            spot, reason = None, "beside one that more photos or a surer one show"
        if spot is None:
            dropped.append(Dropped(id=sightings[k].id, reason=reason))
        else:
            spots.append(spot)
    return spots, dropped


def _alone(one: Sighting, rays: Rays, k: int, raised: bool, name: str, rules: Rules) -> tuple[LocatedThing | None, str]:
    """Return the thing that a single photo shows, or None and why it is not placed."""
    if raised:
        return None, f"seen in fewer than {rules.raised_photos} photos that agree, and not on the ground"
    distance = float(rays.distance[k])
    if distance > rules.alone_reach or one.score < rules.alone_score:
        return None, f"seen in one photo alone, {distance:.0f} m away, score {one.score:.2f}"
    return LocatedThing(
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


def _merge_nearby(spots: Sequence[LocatedThing], apart: float) -> tuple[list[LocatedThing], list[Dropped]]:
    """Return things of which no two of a class are nearer than `apart`; the one that more photos show stays."""
    kept: list[LocatedThing] = []
    dropped: list[Dropped] = []
    for spot in sorted(spots, key=lambda one: (-len(one.photos), -one.score, one.id)):
        twin = next((o for o in kept if o.name == spot.name and math.dist(o.xy, spot.xy) < apart), None)
        if twin is None:
            kept.append(spot)
        else:
            dropped.append(Dropped(id=spot.id, reason=f"the same as {twin.id}"))
    return kept, dropped


@dataclass(frozen=True)
class DetectedThings:
    """Changes by detections to the map that outdoor objects are made of.

    Attributes
    ----------
    new
        Things that the map lacks, with the tags it would have; their ids are negative, as those of new things are.
    moved
        Where mapped points lie instead, ENU metres, by id.
    records
        What became of each.
    dropped
        What is left out, and why.
    """

    new: tuple[OsmNode, ...]
    moved: Mapping[int, Floats]
    records: tuple[DetectedObject, ...]
    dropped: tuple[Dropped, ...]

    def on(self, osm: OsmData) -> OsmData:
        """Return the map with these changes."""
        nodes = [replace(node, xy=self.moved.get(node.id, node.xy)) for node in osm.nodes]
        return replace(osm, nodes=[*nodes, *self.new])

    def counts(self) -> dict[str, int]:
        """How many of each decision."""
        made = [record.decision for record in self.records]
        return {
            "detected": len(made),
            "new": made.count("new"),
            "on_the_map": made.count("map wins"),
            "moved": made.count("moved"),
        }


def things_from_detections(osm: OsmData, found: Detections, height: HeightField, *, seed: int = 0) -> DetectedThings:
    """Place what detections show, and match it to the map.

    Parameters
    ----------
    osm
        The map, local metres.
    found
        The detections.
    height
        Ground heights.
    seed
        As for `objects_from_osm`: decides between models that suit equally well.
    """
    classes = detected_classes()
    spots, dropped = _locate(found, height, classes)
    spots, twins = _merge_nearby(spots, classes.rules.apart)
    nodes = [OsmNode(-k - 1, spot.xy, classes.by_name[spot.name.lower()].tags) for k, spot in enumerate(spots)]
    alone = replace(osm, nodes=nodes, ways=[], areas=[])
    wishes = {wish.id: wish for wish in mapped_placements(alone, height, seed)}
    seen = [
        _Sighting(spot, node, wishes[f"n{node.id}"])
        for spot, node in zip(spots, nodes, strict=True)
        if f"n{node.id}" in wishes
    ]
    known = mapped_placements(osm, height, seed)
    return _match_by_rules(
        seen, known, {f"n{node.id}": node.id for node in osm.nodes}, classes.rules, [*dropped, *twins]
    )


@dataclass(frozen=True)
class _Sighting:
    spot: LocatedThing
    node: OsmNode
    wish: Placement


def _match_by_rules(
    seen: Sequence[_Sighting],
    known: Sequence[Placement],
    points: Mapping[str, int],
    rules: Rules,
    dropped: list[Dropped],
) -> DetectedThings:
    """Decide by the rules which source is right about each; only mapped points can be moved."""
    partner = _partners(seen, known, rules.same)
    new: list[OsmNode] = []
    moved: dict[int, Floats] = {}
    records: list[DetectedObject] = []
    for k, one in enumerate(seen):
        if k not in partner:
            new.append(one.node)
            records.append(_record(one.spot, one.wish.id, one.wish.prototype, "new", None))
            continue
        mapped, off = partner[k]
        decision = "map wins"
        if off > rules.map_wins and len(one.spot.photos) >= rules.photos_to_move and mapped.id in points:
            moved[points[mapped.id]] = one.spot.xy
            decision = "moved"
        records.append(_record(one.spot, mapped.id, mapped.prototype, decision, off))
    return DetectedThings(tuple(new), moved, tuple(records), tuple(dropped))


def _partners(seen: Sequence[_Sighting], known: Sequence[Placement], same: float) -> dict[int, tuple[Placement, float]]:
    """Match things to mapped ones of their kind, one to one, the nearest first; with how far they are apart."""
    models = street_models()
    kinds = np.array([models[wish.prototype].kind for wish in known], np.str_)
    places = np.array([wish.xy for wish in known]).reshape(-1, 2)
    pairs: list[tuple[float, int, int]] = []
    for k, one in enumerate(seen):
        off = distances(places, one.spot.xy)
        near = np.flatnonzero((off <= same) & (kinds == models[one.wish.prototype].kind))
        pairs += [(float(off[j]), k, int(j)) for j in near]
    partner: dict[int, tuple[Placement, float]] = {}
    taken: set[int] = set()
    for off_map, k, j in sorted(pairs):
        if k not in partner and j not in taken:
            partner[k] = known[j], off_map
            taken.add(j)
    return partner


def _record(spot: LocatedThing, key: str, model: str, decision: str, off: float | None) -> DetectedObject:
    return DetectedObject.model_validate(
        {
            "object": key,
            "name": spot.name,
            "model": model,
            "seen_at": (float(spot.xy[0]), float(spot.xy[1])),
            "photos": spot.photos,
            "score": spot.score,
            "spread": spot.spread,
            "how": spot.how,
            "decision": decision,
            "off_map": None if off is None else round(off, 3),
        }
    )
