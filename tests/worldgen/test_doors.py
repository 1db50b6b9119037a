"""Doors hold to the rules of `check_world` where they are made."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
import shapely

from vico.geo.frame import LocalFrame
from vico.geo.osm import OsmData
from vico.world.check.outdoors import entrance_findings
from vico.world.heights import HeightField
from vico.world.model import Building
from vico.world.walkable import BLOCKED, OPEN, WalkableMap
from vico.worldgen.places.doors import DoorFinder

HALF = 40.0
EMPTY = OsmData(LocalFrame(48.0, 11.0), HALF, 60.0, [], [], [], [])


def finder_of(ring: Sequence[tuple[float, float]], walkable: WalkableMap) -> tuple[DoorFinder, Building]:
    house = Building(
        id="w1", entity=1000, name=None, use="residential", footprint=[list(ring)], base=0.0, height=9.0, levels=3,
        roof_shape="flat", colour="#808080", accessible=False, tags={},
    )  # fmt: skip
    return DoorFinder(EMPTY, [house], walkable, HeightField.flat(HALF)), house


def free_map() -> WalkableMap:
    return WalkableMap(np.full((160, 160), OPEN, np.uint8), HALF, 0.5)


@pytest.mark.parametrize("aim", [(0.0, 5.0), (0.05, 4.0), (-0.05, 6.0)])
def test_no_door_opens_into_a_slit_of_its_own_house(aim: tuple[float, float]) -> None:
    # Two walls face each other a hand's breadth apart, from the street to deep inside.
    ring = [(-12.0, 0.0), (12.0, 0.0), (12.0, 9.0), (0.05, 9.0), (0.05, 1.0), (-0.05, 1.0), (-0.05, 9.0), (-12.0, 9.0)]
    finder, house = finder_of(ring, free_map())
    door = finder._entrance(0, np.array(aim), 100.0)
    assert door is not None
    outline = shapely.Polygon(house.footprint[0])
    assert list(entrance_findings(door, outline, finder.walkable, finder.height)) == []


def test_the_spot_before_a_door_can_be_reached_as_it_is_written() -> None:
    # To the millimetre the nearest spot before the eastern wall lies on the edge of a cell that is closed.
    east = 9.7999997
    walkable = free_map()
    column = int((east + 0.7001 + HALF) / 0.5)
    walkable.cls[:, column] = BLOCKED
    finder, house = finder_of([(-12.0, 0.0), (east, 0.0), (east, 9.0), (-12.0, 9.0)], walkable)
    door = finder._entrance(0, np.array((east, 4.5)), 100.0)
    assert door is not None
    outline = shapely.Polygon(house.footprint[0])
    assert list(entrance_findings(door, outline, finder.walkable, finder.height)) == []
