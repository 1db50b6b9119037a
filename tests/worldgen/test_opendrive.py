"""OpenDRIVE files: what the rules find in broken ones, and that netconvert's keep the rules once mended."""

from dataclasses import replace
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
import pytest
import shapely
from defusedxml.ElementTree import fromstring

from road_city import PLACES, network_of, road_city
from vico.geo.frame import LocalFrame
from vico.geo.osm import OsmArea, OsmData, OsmWay
from vico.world.heights import HeightField
from vico.world.opendrive import Curve, elevation, lane_borders, offset_point, opendrive_findings, reference_line
from vico.worldgen.streets.opendrive import SHORTEST, repair_opendrive

_HOUSE = shapely.box(-5, 30, 5, 40)


def _junction(country: str = "FI") -> OsmData:
    """Four streets that meet at a right angle; one ends within the window."""
    ends = [(-60.0, 0.0), (60.0, 0.0), (0.0, -60.0), (3.0, 25.0)]
    tags = {"highway": "residential", "lanes": "2", "sidewalk": "both"}
    ways = [OsmWay(k + 1, [100, 101 + k], np.array([(0.0, 0.0), end]), False, dict(tags)) for k, end in enumerate(ends)]
    area = OsmArea("w900", _HOUSE, {"building": "yes", "addr:country": country})
    return OsmData(LocalFrame(60.169, 24.9435), 150.0, 60.0, [], ways, [area], [])


@pytest.fixture(scope="module")
def roads() -> bytes:
    """The roads of four streets that meet."""
    return network_of(_junction()).xodr or b""


def _rules(content: bytes, old: bytes = b"", new: bytes = b"") -> set[str]:
    assert old in content
    return {finding.id for finding in opendrive_findings(fromstring(content.replace(old, new, 1) if old else content))}


def _driving(root: Element, *, inside: bool) -> list[Element]:
    return [
        road
        for road in root.findall("road")
        if (road.get("junction") != "-1") == inside and any(lane.get("type") == "driving" for lane in road.iter("lane"))
    ]


@pytest.mark.parametrize("country", ["FI", "GB"])
def test_roads_of_a_junction_keep_the_rules_on_either_side(country: str) -> None:
    content = network_of(_junction(country)).xodr or b""
    assert _rules(content) == set()
    root = fromstring(content)
    # Each of four streets leads to the three others, and those that end turn back.
    assert len(_driving(root, inside=False)) == 8
    assert len(_driving(root, inside=True)) >= 12


def test_opendrive_of_central_helsinki_keeps_the_rules() -> None:
    content = road_city().network.xodr or b""
    assert _rules(content) == set()
    assert min(float(road.get("length", "0")) for road in fromstring(content).findall("road")) > 0.1


@pytest.mark.parametrize("place", PLACES)
def test_opendrive_of_other_cities_keeps_the_rules(place: str, shared_data: Path) -> None:
    city = road_city(shared_data / "places" / place / f"{place}.osm.pbf", *PLACES[place])
    assert _rules(city.network.xodr or b"") == set()


def test_where_traffic_keeps_left_roads_through_junctions_lie_where_their_lanes_do() -> None:
    network = network_of(_junction("GB"))
    lanes = [
        np.array([[float(v) for v in point.split(",")[:2]] for point in str(lane.get("shape")).split()])
        for edge in fromstring(network.net_xml).iter("edge")
        if edge.get("function") == "internal"
        for lane in edge.findall("lane")
    ]
    every = shapely.MultiLineString([line for line in lanes if len(line) > 1])
    for road in _driving(fromstring(network.xodr or b""), inside=True):
        borders = lane_borders(road, at_end=False)
        number = next(int(str(lane.get("id"))) for lane in road.iter("lane") if lane.get("type") == "driving")
        for curve in reference_line(road):
            point, heading = curve.end(0.0)
            middle = offset_point(point, heading, sum(borders[number]) / 2)
            assert every.distance(shapely.Point(middle)) < 0.5


@pytest.mark.parametrize(
    ("old", "new", "rule"),
    [
        (b'elementType="junction" elementId="', b'elementType="junction" elementId="9', "link"),
        (b'connectingRoad="', b'connectingRoad="9', "link"),
        (b'<predecessor elementType="road" elementId="', b'<predecessor elementType="road" elementId="9', "link"),
        (b'laneLink from="-1"', b'laneLink from="-7"', "link"),
        (b'<road name="" length="', b'<road name="" length="9', "length"),
        (b'<geometry s="0.0', b'<geometry s="4.0', "length"),
        (b'lane id="-1"', b'lane id="-5"', "lanes"),
        (b'elevation s="0.0', b'elevation s="1.0', "heights"),
        (b'elevation s="0.00000000" a="0.00"', b'elevation s="0.00000000" a="nan"', "heights"),
        (b"+proj=", b"", "header"),
        (b'<header revMajor="1"', b"<header", "header"),
    ],
)
def test_a_broken_rule_is_found(roads: bytes, old: bytes, new: bytes, rule: str) -> None:
    assert f"opendrive {rule}" in _rules(roads, old, new)


def test_a_road_of_a_junction_that_misses_its_lane_is_found(roads: bytes) -> None:
    inside = roads.index(b'contactPoint="end"')
    x = roads.index(b' x="', inside) + len(b' x="')
    assert "opendrive link" in _rules(roads[:x] + b"1" + roads[x:])


def test_a_junction_that_is_not_there_is_no_longer_named(roads: bytes) -> None:
    root = fromstring(roads)
    kept = str(root.find("junction").get("id"))  # type: ignore[union-attr]
    broken = roads.replace(f'<successor elementType="junction" elementId="{kept}"'.encode(), b'<successor elementType='
                           b'"junction" elementId="77777"', 1)  # fmt: skip
    assert "opendrive link" in _rules(broken)
    assert _rules(repair_opendrive(broken)) == set()


def test_a_street_of_no_length_is_lengthened(roads: bytes) -> None:
    root = fromstring(roads)
    street = next(road for road in _driving(root, inside=False) if road.find("link/successor") is not None)
    old = street.find("planView/geometry").get("length")  # type: ignore[union-attr]
    broken = roads.replace(f'length="{old}"'.encode(), b'length="0.01000000"')
    mended = repair_opendrive(broken)
    assert _rules(mended) == set()
    found = {road.get("id"): road for road in fromstring(mended).findall("road")}[street.get("id")]
    assert float(found.get("length", "0")) == pytest.approx(SHORTEST, abs=0.3)


def test_streets_lie_on_the_ground() -> None:
    axis = np.linspace(-60, 60, 61)
    slope = HeightField(np.tile(0.05 * axis, (61, 1)).astype(np.float32), 60.0)
    content = repair_opendrive(network_of(_junction()).xodr or b"", slope)
    assert _rules(content) == set()
    for road in _driving(fromstring(content), inside=False):
        along = 0.0
        for curve in reference_line(road):
            (x, y), _ = curve.end(0.0)
            assert elevation(road, along) == pytest.approx(float(slope((x, y))), abs=0.04)
            along += curve.length


def test_a_curve_between_two_directions_of_an_arc_is_nearly_that_arc() -> None:
    curve = Curve.between(np.array([1.0, 0.0]), np.pi / 2, np.array([0.0, 1.0]), np.pi)
    assert curve.length == pytest.approx(np.pi / 2, abs=1e-3)
    assert np.hypot(*curve.points(np.linspace(0, 1, 9)).T) == pytest.approx(1.0, abs=1e-3)
    assert curve.part(0.2, 0.7).length == pytest.approx(
        curve.length - curve.part(0, 0.2).length - curve.part(0.7, 1).length
    )


def test_equal_roads_give_equal_bytes(roads: bytes) -> None:
    assert network_of(replace(_junction())).xodr == roads
