"""A region as large as one likes, made by laying copies of an extract side by side.

Nothing real is 5 km wide and at hand everywhere. Copies get ids of their own and lie on a square grid; streets end
where they meet.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import osmium
from numpy.typing import NDArray

from vico.geo.frame import LocalFrame

# Ids of a copy: those of the extract and so much more for each; OpenStreetMap's end far below.
_EACH = 10**11


def repeated(extract: Path, out: Path, *, lat: float, lon: float, half: float, copies: int) -> None:
    """Write an extract several times.

    Parameters
    ----------
    extract, out
        OpenStreetMap files, ``.osm.pbf``.
    lat, lon, half
        Middle of the square that is copied, degrees, and half its side, metres.
    copies
        So many a side; the middle of all is that of the extract.
    """
    frame = LocalFrame(lat, lon)
    shifts = [
        (2 * half * (i - (copies - 1) / 2), 2 * half * (j - (copies - 1) / 2))
        for j in range(copies)
        for i in range(copies)
    ]
    inside = _inside(extract, frame, half)
    out.unlink(missing_ok=True)
    with osmium.SimpleWriter(str(out)) as writer:
        for kind in (osmium.osm.NODE, osmium.osm.WAY, osmium.osm.RELATION):
            for k, shift in enumerate(shifts):
                _copy(extract, writer, kind, (k * _EACH, shift), frame, inside)


def _inside(extract: Path, frame: LocalFrame, half: float) -> set[int]:
    """Return the ids of the ways whose middle lies in the square: others would overlap."""
    kept: set[int] = set()
    for way in osmium.FileProcessor(str(extract), osmium.osm.NODE | osmium.osm.WAY).with_locations():
        if way.is_way():
            places = [node.location for node in way.nodes if node.location.valid()]
            if places:
                xy = frame.to_enu([p.lat for p in places], [p.lon for p in places])
                if np.abs(xy.mean(axis=0)).max() <= half:
                    kept.add(way.id)
    return kept


def _copy(
    extract: Path,
    writer: osmium.SimpleWriter,
    kind: osmium.osm.osm_entity_bits,
    move: tuple[int, NDArray[np.float64]],
    frame: LocalFrame,
    kept: set[int],
) -> None:
    """Write the things of one kind, their ids larger and their places shifted by `move`."""
    more, shift = move
    for thing in osmium.FileProcessor(str(extract), kind):
        if thing.is_node():
            xy = frame.to_enu(thing.location.lat, thing.location.lon) + shift
            lat, lon = frame.to_geodetic(xy)
            writer.add_node(thing.replace(id=thing.id + more, location=(float(lon), float(lat))))
        elif thing.is_way():
            if thing.id in kept:
                writer.add_way(thing.replace(id=thing.id + more, nodes=[node.ref + more for node in thing.nodes]))
        else:
            members = [(m.type, m.ref + more, m.role) for m in thing.members if m.type != "w" or m.ref in kept]
            if members:
                writer.add_relation(thing.replace(id=thing.id + more, members=members))
