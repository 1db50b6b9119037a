"""A map as most cities have it: outlines a little off, and nothing said of how buildings look or how tall they are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import osmium
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from vico.seeds import rng

LOOKS = (
    "building:levels", "building:min_level", "building:levels:underground", "building:part", "building:colour",
    "building:material", "building:facade:colour", "building:facade:material", "building:architecture",
    "building:cladding", "height", "min_height", "est_height", "max_level", "min_level", "start_date", "architect",
)  # fmt: skip
"""Tags of buildings that are taken away; with these every ``roof:...``."""


def ordinary_map(path: Path, out: Path, *, off: float, seed: int) -> tuple[int, int]:
    """Write an extract again without what it says of its buildings' looks and heights, and with these moved.

    Parameters
    ----------
    path, out
        The extract, and the file to write.
    off
        Metres that buildings are moved by at most, east and north; those that share a wall move together.
    seed
        Decides how far each is moved.

    Returns
    -------
    tuple
        How many buildings lost tags, and how many blocks were moved.
    """
    ways: list[list[int]] = []
    inner = {
        member.ref
        for relation in osmium.FileProcessor(str(path), osmium.osm.RELATION)
        if "building" in relation.tags
        for member in relation.members
        if member.type == "w"
    }
    for way in osmium.FileProcessor(str(path), osmium.osm.WAY):
        if way.id in inner or "building" in way.tags or "building:part" in way.tags:
            ways.append([node.ref for node in way.nodes])
    numbers, place = np.unique(np.concatenate(ways), return_inverse=True)
    owner = np.repeat(np.arange(len(ways)), [len(way) for way in ways])
    # Ways and the nodes they share are one graph: its pieces are the blocks.
    graph = coo_matrix((np.ones(len(place)), (owner, len(ways) + place)), shape=(len(ways) + len(numbers),) * 2)
    blocks, block = connected_components(graph, directed=False)
    move = rng(seed, "map").uniform(-off, off, (blocks, 2))
    of_node = dict(zip(numbers.tolist(), move[block[len(ways) :]].tolist(), strict=True))
    stripped = 0
    out.unlink(missing_ok=True)
    with osmium.SimpleWriter(str(out)) as writer:
        for thing in osmium.FileProcessor(str(path)):
            if thing.is_node() and thing.id in of_node:
                east, north = of_node[thing.id]
                lat, lon = thing.location.lat, thing.location.lon
                new = lon + east / (111_320.0 * np.cos(np.radians(lat))), lat + north / 111_320.0
                writer.add(thing.replace(location=(float(new[0]), float(new[1]))))
            elif "building" in thing.tags or "building:part" in thing.tags:
                kept = {t.k: t.v for t in thing.tags if t.k not in LOOKS and not t.k.startswith("roof:")}
                stripped += len(kept) < len(thing.tags)
                writer.add(thing.replace(tags=kept))
            else:
                writer.add(thing)
    return stripped, len(np.unique(block[: len(ways)]))
