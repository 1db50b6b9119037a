"""Where the sidewalks of a network lie, written by hand as netconvert writes them."""

import numpy as np
import shapely
from defusedxml.ElementTree import fromstring

from vico.worldgen.streets.lane_shapes import CarriagewayEdges, move_sidewalks

NO_WALKERS = 'disallow="pedestrian" speed="10" length="80" width="3.2"'
WALKERS = 'allow="pedestrian" speed="10" length="80" width="2.0"'


def network(*, between: float | None = None) -> bytes:
    """A street of two lanes one way, east, its left sidewalk on its middle line; perhaps a lane back, so far north."""
    back = "" if between is None else f'<lane id="other_0" {NO_WALKERS} shape="80,{between} 0,{between}"/>'
    return f"""<net>
    <edge id="way" from="a" to="b" type="highway.primary">
        <lane id="way_0" index="0" {WALKERS} shape="0,-4.2 80,-4.2"/>
        <lane id="way_1" index="1" {NO_WALKERS} shape="0,-1.6 80,-1.6"/>
        <lane id="way_2" index="2" {NO_WALKERS} shape="0,1.6 80,1.6"/>
    </edge>
    <edge id="-way" from="b" to="a" type="highway.primary">
        <lane id="-way_0" index="0" {WALKERS} shape="80,1.0 0,1.0"/>
    </edge>
    <edge id="other" from="c" to="d" type="highway.primary">{back}</edge>
</net>""".encode()


def lanes_of(net: bytes) -> dict[str, tuple[str, shapely.LineString]]:
    return {
        str(lane.get("id")): (
            lane.get("allow", "") or f"not {lane.get('disallow')}",
            shapely.LineString([[*map(float, p.split(","))] for p in str(lane.get("shape")).split()]),
        )
        for lane in fromstring(net).iter("lane")
    }


def placed(**how: float) -> dict[str, tuple[str, shapely.LineString]]:
    kerbs = CarriagewayEdges(shapely.box(0, -3.2, 80, 3.2), [])
    return lanes_of(move_sidewalks(network(**how), kerbs, left_driving=False))


def test_the_left_sidewalk_of_a_one_way_street_lies_beside_its_lanes() -> None:
    allowed, line = placed()["-way_0"]
    assert allowed == "pedestrian"
    assert np.allclose(shapely.get_coordinates(line)[:, 1], 4.2)
    assert placed()["way_0"] == lanes_of(network())["way_0"]


def test_nobody_walks_where_a_sidewalk_could_only_lie_in_a_lane() -> None:
    assert placed(between=4.9)["-way_0"][0] == "not all"
    assert placed(between=7.0)["-way_0"][0] == "pedestrian"
