"""Reading OpenStreetMap extracts: the packaged place, and files that are broken in every way we know."""

from importlib import resources
from pathlib import Path

import osmium
import pytest
import shapely

from vico.errors import EmptyInputError, InputError, MissingFileError, SchemaError
from vico.geo.frame import LocalFrame
from vico.geo.osm import OsmData, means_area, read_osm

PLACE = Path(str(resources.files("vico") / "data" / "helsinki.osm.pbf"))
FRAME = LocalFrame(60.1690, 24.9435)

SQUARE = """<?xml version='1.0' encoding='UTF-8'?>
<osm version="0.6" generator="test">
 <node id="1" lat="0.0000" lon="0.0000" version="1"/><node id="2" lat="0.0000" lon="0.0004" version="1"/>
 <node id="3" lat="0.0004" lon="0.0004" version="1"/><node id="4" lat="0.0004" lon="0.0000" version="1"/>
 <node id="5" lat="0.0001" lon="0.0001" version="1"/><node id="6" lat="0.0001" lon="0.0003" version="1"/>
 <node id="7" lat="0.0003" lon="0.0003" version="1"/><node id="8" lat="0.0003" lon="0.0001" version="1"/>
 <way id="10" version="1"><nd ref="1"/><nd ref="2"/><nd ref="3"/></way>
 <way id="11" version="1"><nd ref="1"/><nd ref="4"/><nd ref="3"/></way>
 <way id="12" version="1"><nd ref="5"/><nd ref="6"/><nd ref="7"/><nd ref="8"/><nd ref="5"/></way>
 <relation id="20" version="1"><member type="way" ref="10" role="outer"/><member type="way" ref="11" role="outer"/>
  <member type="way" ref="12" role="inner"/><tag k="type" v="multipolygon"/><tag k="building" v="yes"/></relation>
</osm>
"""


@pytest.fixture(scope="module")
def helsinki() -> OsmData:
    return read_osm(PLACE, FRAME, 400.0)


def test_the_packaged_place_covers_its_window(helsinki: OsmData) -> None:
    streets = shapely.MultiLineString([way.line for way in helsinki.ways if "highway" in way.tags])
    for x in (-350, 0, 350):
        for y in (-350, 0, 350):
            assert shapely.box(x - 50, y - 50, x + 50, y + 50).intersects(streets), (x, y)


def test_the_packaged_place_names_no_mappers() -> None:
    assert {thing.user for thing in osmium.FileProcessor(str(PLACE))} == {""}


def test_central_helsinki_has_its_buildings_and_shops(helsinki: OsmData) -> None:
    # facts: window A has 225 buildings by their centres and 970 named places.
    square = shapely.box(-400, -400, 400, 400)
    buildings = [
        area
        for area in helsinki.areas
        if area.tags.get("building", "no") != "no" and square.contains(area.polygon.centroid)
    ]
    assert 215 <= len(buildings) <= 235
    assert sum("name" in node.tags for node in helsinki.nodes) > 900


def test_courtyards_of_multipolygons_are_holes(helsinki: OsmData) -> None:
    holes = [
        sum(len(part.interiors) for part in shapely.get_parts(area.polygon))
        for area in helsinki.areas
        if area.id.startswith("r") and "building" in area.tags
    ]
    assert sum(count > 0 for count in holes) > 30


def test_a_multipolygon_is_assembled_from_split_ways(tmp_path: Path) -> None:
    path = tmp_path / "square.osm"
    path.write_text(SQUARE)
    (area,) = read_osm(path, LocalFrame(0.0002, 0.0002), 100.0).areas
    # 0.0004 by 0.0004 degrees less 0.0002 by 0.0002 at the equator: 110.574 and 111.320 km a degree.
    assert area.polygon.area == pytest.approx(12e-8 * 110574 * 111320, rel=1e-3)


def test_the_sum_is_that_of_the_bytes(helsinki: OsmData) -> None:
    import hashlib

    assert helsinki.sha256 == hashlib.sha256(PLACE.read_bytes()).hexdigest()
    assert helsinki.timestamp is not None
    assert helsinki.timestamp.startswith("2019-04-2")


@pytest.mark.parametrize(
    ("tags", "expected"),
    [
        ({"building": "yes"}, True),
        ({"highway": "residential", "junction": "roundabout"}, False),
        ({"highway": "pedestrian", "area": "yes"}, True),
        ({"leisure": "park", "area": "no"}, False),
        ({"natural": "coastline"}, False),
    ],
)
def test_what_a_closed_way_means(tags: dict[str, str], expected: bool) -> None:
    assert means_area(tags) is expected


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(MissingFileError, match=r"nowhere\.osm\.pbf"):
        read_osm(tmp_path / "nowhere.osm.pbf", FRAME, 400.0)


@pytest.mark.parametrize("keep", [0, 10, 5_000, 200_000])
def test_a_truncated_file_is_one_sentence(tmp_path: Path, keep: int) -> None:
    path = tmp_path / "cut.osm.pbf"
    path.write_bytes(PLACE.read_bytes()[:keep])
    with pytest.raises((SchemaError, EmptyInputError), match=r"cut\.osm\.pbf"):
        read_osm(path, FRAME, 400.0)


def test_noise_is_no_extract(tmp_path: Path) -> None:
    path = tmp_path / "noise.osm.pbf"
    path.write_bytes(bytes(range(256)) * 40)
    with pytest.raises(SchemaError, match="broken"):
        read_osm(path, FRAME, 400.0)


def test_another_kind_of_file_is_refused_by_its_name(tmp_path: Path) -> None:
    path = tmp_path / "map.geojson"
    path.write_text("{}")
    with pytest.raises(InputError, match=r"\.osm"):
        read_osm(path, FRAME, 400.0)


def test_entities_in_xml_are_not_expanded(tmp_path: Path) -> None:
    path = tmp_path / "laughs.osm"
    path.write_text(
        '<?xml version="1.0"?><!DOCTYPE osm [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;">]>'
        '<osm version="0.6"><node id="1" lat="0" lon="0" version="1"><tag k="name" v="&b;"/></node></osm>'
    )
    with pytest.raises(SchemaError):
        read_osm(path, LocalFrame(0, 0), 100.0)


def test_a_window_elsewhere_is_empty() -> None:
    with pytest.raises(EmptyInputError, match="nothing in"):
        read_osm(PLACE, LocalFrame(48.85, 2.35), 400.0)


def test_a_window_without_buildings_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "road.osm"
    path.write_text(
        '<osm version="0.6"><node id="1" lat="0" lon="0" version="1"/><node id="2" lat="0" lon="0.001" version="1"/>'
        '<way id="3" version="1"><nd ref="1"/><nd ref="2"/><tag k="highway" v="residential"/></way></osm>'
    )
    with pytest.raises(EmptyInputError, match="no building"):
        read_osm(path, LocalFrame(0, 0), 400.0)


def test_ways_before_their_nodes_are_pointed_out(tmp_path: Path) -> None:
    path = tmp_path / "backwards.osm"
    path.write_text(
        '<osm version="0.6"><way id="3" version="1"><nd ref="1"/><nd ref="2"/><tag k="building" v="yes"/></way>'
        '<node id="1" lat="0" lon="0" version="1"/><node id="2" lat="0" lon="0.001" version="1"/></osm>'
    )
    with pytest.raises(SchemaError, match="sort"):
        read_osm(path, LocalFrame(0, 0), 400.0)
