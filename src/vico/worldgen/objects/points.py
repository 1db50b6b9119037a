"""Things that the map has as points, and trees that it has as rows."""

from __future__ import annotations

from vico.geo.osm import OsmData, OsmNode
from vico.seeds import rng
from vico.world.heights import HeightField
from vico.worldgen.facts.expendable import expendable
from vico.worldgen.objects.barriers import gate_yaws
from vico.worldgen.objects.catalogue import standing
from vico.worldgen.objects.kinds import region, thing_of
from vico.worldgen.objects.trees import planting, row_wishes, tree_wish
from vico.worldgen.objects.wishes import Wish, direction


def mapped_wishes(osm: OsmData, height: HeightField, seed: int) -> list[Wish]:
    """Wish for everything that is mapped as a point or as a row of trees."""
    zone = planting(osm, height)
    return [*_point_wishes(osm, seed, zone, region(osm)), *row_wishes(osm, seed, zone)]


def _point_wishes(osm: OsmData, seed: int, zone: str, where: str) -> list[Wish]:
    """Wish for what is mapped as points."""
    found: list[Wish] = []
    gates = gate_yaws(osm)
    for node in osm.nodes:
        with expendable(f"n{node.id}"):
            wish = _point_wish(node, seed, zone, where, gates.get(node.id))
            if wish is not None:
                found.append(wish)
    return found


def _point_wish(node: OsmNode, seed: int, zone: str, where: str, gate: float | None) -> Wish | None:
    """Wish for what a point maps; None for nothing. `gate` is the yaw of a gate there."""
    key = f"n{node.id}"
    if node.tags.get("natural") == "tree":
        return tree_wish(key, node.tags, node.xy, seed, zone)
    if node.tags.get("shelter") == "yes" and (
        node.tags.get("highway") == "bus_stop" or node.tags.get("public_transport") == "platform"
    ):
        return Wish(f"{key}.shelter", "shelter", node.xy, reach=4.5)
    random = rng(seed, "thing", key)
    name = thing_of(node.tags, where=where, random=random)
    if name is None:
        return None
    wish = Wish(key, name, node.xy, direction(node.tags))
    if name.startswith(standing().of_any_size):
        wish.scale = float(random.uniform(0.8, 1.25))
    if gate is not None and wish.yaw is None:
        wish.yaw, wish.reach = gate, 0.0 if name == "gate" else 3.0
    return wish
