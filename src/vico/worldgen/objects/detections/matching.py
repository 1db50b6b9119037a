"""Which of the things that photos show the map knows already, and who is right about where they stand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vico.assets.models.library import street_models
from vico.geo.detections import Detections
from vico.geo.osm import OsmData, OsmNode
from vico.geometry import distances
from vico.world.heights import HeightField
from vico.world.model import Dropped
from vico.world.world import DetectedObject
from vico.worldgen.objects.detections.classes import Rules, detected_classes
from vico.worldgen.objects.detections.locate import Spot, located, merged
from vico.worldgen.objects.points import mapped_wishes
from vico.worldgen.objects.wishes import Wish

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class DetectedThings:
    """What detections change about the map that outdoor objects are made of.

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
    spots, dropped = located(found, height, classes)
    spots, twins = merged(spots, classes.rules.apart)
    nodes = [OsmNode(-k - 1, spot.xy, classes.by_name[spot.name.lower()].tags) for k, spot in enumerate(spots)]
    alone = replace(osm, nodes=nodes, ways=[], areas=[])
    wishes = {wish.id: wish for wish in mapped_wishes(alone, height, seed)}
    seen = [
        _Seen(spot, node, wishes[f"n{node.id}"])
        for spot, node in zip(spots, nodes, strict=True)
        if f"n{node.id}" in wishes
    ]
    known = mapped_wishes(osm, height, seed)
    return _decided(seen, known, {f"n{node.id}": node.id for node in osm.nodes}, classes.rules, [*dropped, *twins])


@dataclass(frozen=True)
class _Seen:
    spot: Spot
    node: OsmNode
    wish: Wish


def _decided(
    seen: Sequence[_Seen], known: Sequence[Wish], points: Mapping[str, int], rules: Rules, dropped: list[Dropped]
) -> DetectedThings:
    """Decide by the rules who is right about each; only what the map has as a point can be moved."""
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


def _partners(seen: Sequence[_Seen], known: Sequence[Wish], same: float) -> dict[int, tuple[Wish, float]]:
    """Match things to mapped ones of their kind, one to one, the nearest first; with how far they are apart."""
    models = street_models()
    kinds = np.array([models[wish.prototype].kind for wish in known], np.str_)
    places = np.array([wish.xy for wish in known]).reshape(-1, 2)
    pairs: list[tuple[float, int, int]] = []
    for k, one in enumerate(seen):
        off = distances(places, one.spot.xy)
        near = np.flatnonzero((off <= same) & (kinds == models[one.wish.prototype].kind))
        pairs += [(float(off[j]), k, int(j)) for j in near]
    partner: dict[int, tuple[Wish, float]] = {}
    taken: set[int] = set()
    for off_map, k, j in sorted(pairs):
        if k not in partner and j not in taken:
            partner[k] = known[j], off_map
            taken.add(j)
    return partner


def _record(spot: Spot, key: str, model: str, decision: str, off: float | None) -> DetectedObject:
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
