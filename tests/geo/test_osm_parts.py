"""A map that is read once and cut has in every part what reading that part gives."""

from importlib import resources
from pathlib import Path

import numpy as np
import pytest

from vico.geo.frame import LocalFrame
from vico.geo.osm import read_osm
from vico.geo.osm_parts import OsmParts

PLACE = Path(str(resources.files("vico") / "data" / "helsinki.osm.pbf"))


@pytest.fixture(scope="module")
def parts() -> OsmParts:
    return OsmParts(read_osm(PLACE, LocalFrame(60.1690, 24.9435), 400.0))


@pytest.mark.parametrize(("east", "north"), [(0.0, 0.0), (160.0, -240.0), (-260.0, 272.0)])
def test_a_part_is_what_is_read_there(parts: OsmParts, east: float, north: float) -> None:
    part = parts.within(half=120.0, margin=60.0, east=east, north=north)
    there = read_osm(PLACE, LocalFrame(60.1690, 24.9435, east, north), 120.0, need_buildings=False)
    assert part.frame == there.frame
    for name in ("nodes", "ways", "areas", "relations"):
        assert [one.id for one in getattr(part, name)] == [one.id for one in getattr(there, name)], name
    for a, b in zip(part.ways, there.ways, strict=True):
        assert a.nodes == b.nodes
        assert a.tags == b.tags
        assert np.allclose(a.line, b.line, atol=1e-9)
    for c, d in zip(part.areas, there.areas, strict=True):
        assert c.polygon.equals_exact(d.polygon, 1e-6)
    assert np.allclose([node.xy for node in part.nodes], [node.xy for node in there.nodes], atol=1e-9)


def test_parts_do_not_depend_on_what_was_cut_before(parts: OsmParts) -> None:
    first = parts.within(half=100.0, margin=60.0, east=80.0, north=0.0)
    parts.within(half=100.0, margin=60.0, east=0.0, north=0.0)
    again = parts.within(half=100.0, margin=60.0, east=80.0, north=0.0)
    assert [way.line.tobytes() for way in first.ways] == [way.line.tobytes() for way in again.ways]
