"""Reading OpenStreetMap extracts: the packaged place, and files that are broken in every way we know."""

import bz2
import contextlib
import gzip
import math
import random
import time
import zlib
from collections.abc import Callable
from importlib import resources
from pathlib import Path

import osmium
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from vico.errors import EmptyInputError, InputError, MissingFileError, SchemaError
from vico.geo.frame import LocalFrame
from vico.geo.osm import OsmData, means_area, read_osm
from vico.geo.overpass import write_extract

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


def write_building(path: Path, outline: list[tuple[float, float]], lat: float = 0.0, lon: float = 0.0) -> Path:
    """An extract with one closed way; `outline` in degrees around (lat, lon), as (east, north)."""
    nodes = [
        {"type": "node", "id": k, "lat": lat + y, "lon": (lon + x + 180) % 360 - 180}
        for k, (x, y) in enumerate(outline, 1)
    ]
    refs = [*range(1, len(outline) + 1), 1]
    way = {"type": "way", "id": 77, "nodes": refs, "tags": {"building": "yes"}}
    write_extract(path, [*nodes, way], boxes=[], timestamp="2026-01-01T00:00:00Z")
    return path


def test_a_footprint_that_crosses_itself_is_mended_and_named(tmp_path: Path) -> None:
    bow = [(0.0, 0.0), (0.0004, 0.0004), (0.0004, 0.0), (0.0, 0.0004)]
    data = read_osm(write_building(tmp_path / "a.osm.pbf", bow), LocalFrame(0, 0), 100.0)
    (area,) = data.areas
    assert area.polygon.is_valid
    # Two triangles of 0.0004 by 0.0002 degrees.
    assert area.polygon.area == pytest.approx(8e-8 * 110574 * 111320, rel=1e-3)
    assert data.broken == [("w77", "outline crosses or touches itself; kept as 2 parts")]


def test_a_scribble_is_left_out_at_once_and_named(tmp_path: Path) -> None:
    dice = random.Random(0)
    nodes = [
        {"type": "node", "id": k, "lat": dice.random() * 1e-3, "lon": dice.random() * 1e-3} for k in range(1, 1501)
    ]
    tags = {"building": "yes"}
    house = {"type": "way", "id": 76, "nodes": [1, 2, 3, 1], "tags": tags}
    scribble = {"type": "way", "id": 77, "nodes": [*range(1, 1501), 1], "tags": tags}
    write_extract(tmp_path / "a.osm.pbf", [*nodes, house, scribble], boxes=[], timestamp="")
    began = time.process_time()
    data = read_osm(tmp_path / "a.osm.pbf", LocalFrame(0, 0), 100.0)
    assert time.process_time() - began < 3.0
    assert [area.id for area in data.areas] == ["w76"]
    assert data.broken == [("w77", "outline crosses itself too often to mean an area; left out")]


def test_a_building_of_3000_corners_is_simplified_and_named(tmp_path: Path) -> None:
    ring = [
        ((1 + 0.01 * math.sin(50 * t)) * 4e-4 * math.cos(t), (1 + 0.01 * math.sin(50 * t)) * 4e-4 * math.sin(t))
        for t in (k * 2 * math.pi / 3000 for k in range(3000))
    ]
    data = read_osm(write_building(tmp_path / "a.osm.pbf", ring), LocalFrame(0, 0), 100.0)
    (area,) = data.areas
    assert len(area.polygon.exterior.coords) <= 1001
    # A circle of 4e-4 degrees; the ripples of 1 % add half of 1e-4 to its area.
    assert area.polygon.area == pytest.approx(math.pi * 16e-8 * 110574 * 111320, rel=0.01)
    ((name, what),) = data.broken
    assert name == "w77"
    assert "outline of 3,001 corners; simplified to" in what


def test_missing_members_and_nodes_are_named(tmp_path: Path) -> None:
    path = tmp_path / "square.osm"
    member, way = '<member type="way" ref="12"', '<way id="12" version="1">'
    ways = (
        '<way id="13" version="1"><nd ref="1"/><nd ref="2"/><nd ref="88"/><nd ref="3"/><nd ref="1"/>'
        '<tag k="building" v="shed"/></way><way id="14" version="1"><nd ref="1"/></way>'
    )
    relation = (
        '<relation id="21" version="1"><member type="way" ref="98" role="outer"/><member type="way" ref="10" '
        'role="outer"/><tag k="type" v="multipolygon"/><tag k="building" v="yes"/></relation>'
    )
    text = SQUARE.replace(member, f'<member type="way" ref="99" role="outer"/>{member}')
    path.write_text(text.replace(way, ways + way).replace("</osm>", f"{relation}</osm>"))
    data = read_osm(path, LocalFrame(0.0002, 0.0002), 100.0)
    assert data.broken == [
        ("w13", "1 of its nodes are not in the file"),
        ("r20", "1 of its member ways are not in the file; kept what closes"),
        ("r21", "1 of its 2 member ways are not in the file, so that no ring closes; left out"),
    ]
    assert [area.id for area in data.areas] == ["w13", "r20"]


@pytest.mark.parametrize(
    ("lat", "lon"), [(-16.8, 180.0), (-16.8, -180.0), (65.0, 179.9999), (89.0, 30.0), (-89.0, -180.0)]
)
def test_a_building_at_the_ends_of_the_map_is_read(tmp_path: Path, lat: float, lon: float) -> None:
    frame = LocalFrame(lat, lon)
    lats, lons = frame.to_geodetic([(-30.0, -20.0), (30.0, -20.0), (30.0, 20.0), (-30.0, 20.0)])
    path = write_building(
        tmp_path / "a.osm.pbf", [(x - lon, y - lat) for x, y in zip(lons, lats, strict=True)], lat, lon
    )
    (area,) = read_osm(path, frame, 100.0).areas
    # OpenStreetMap's steps of 1e-7 degrees are up to 11 mm.
    assert area.polygon.area == pytest.approx(2400, abs=2.0)
    assert area.polygon.bounds == pytest.approx((-30, -20, 30, 20), abs=0.02)


@pytest.mark.parametrize(("ending", "pack"), [(".osm.gz", gzip.compress), (".osm.bz2", bz2.compress)])
def test_packed_xml_is_read_and_a_bomb_is_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ending: str, pack: Callable[[bytes], bytes]
) -> None:
    monkeypatch.setattr("vico.geo.outlines._FREE", 1 << 20)
    path = tmp_path / f"square{ending}"
    path.write_bytes(pack(SQUARE.encode()))
    assert len(read_osm(path, LocalFrame(0.0002, 0.0002), 100.0).areas) == 1
    path.write_bytes(pack(SQUARE.encode().replace(b"<way", b" " * 8_000_000 + b"<way", 1)))
    with pytest.raises(SchemaError, match="unpacks to more than"):
        read_osm(path, LocalFrame(0.0002, 0.0002), 100.0)
    path.write_bytes(pack(SQUARE.encode())[:-12])
    with pytest.raises(SchemaError, match="truncated or broken"):
        read_osm(path, LocalFrame(0.0002, 0.0002), 100.0)


def test_a_pbf_bomb_is_not_unpacked(tmp_path: Path) -> None:
    def number(value: int) -> bytes:
        low = bytes([value & 127 | 128 * (value > 127)])
        return low + (number(value >> 7) if value > 127 else b"")

    packed = zlib.compress(bytes(32 << 20))
    blob = b"\x10" + number(32 << 20) + b"\x1a" + number(len(packed)) + packed
    header = b"\x0a\x07OSMData\x18" + number(len(blob))
    path = tmp_path / "bomb.osm.pbf"
    path.write_bytes((len(header).to_bytes(4, "big") + header + blob) * 40)
    with pytest.raises(SchemaError, match="unpacks to more than"):
        read_osm(path, FRAME, 100.0)


@pytest.mark.parametrize(
    "start",
    [
        '<!DOCTYPE osm [<!ENTITY x SYSTEM "file:///etc/passwd">]>',
        '<!DOCTYPE osm [<!ENTITY % x SYSTEM "file:///etc/passwd"> %x;]>',
        "<!DOCTYPE osm [" + "".join(f'<!ENTITY l{k} "{f"&l{k - 1};" * 10 if k else "ha"}">' for k in range(12)) + "]>",
    ],
)
def test_hostile_xml_is_refused(tmp_path: Path, start: str) -> None:
    path = tmp_path / "a.osm"
    path.write_text(SQUARE.replace("<osm ", start + "<osm ", 1).replace('v="yes"', 'v="&l11;"'))
    with pytest.raises(SchemaError, match="broken"):
        read_osm(path, LocalFrame(0.0002, 0.0002), 100.0)


@pytest.fixture(scope="module")
def small_files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp("small")
    pbf = write_building(folder / "a.osm.pbf", [(0.0, 0.0), (0.0004, 0.0), (0.0004, 0.0004), (0.0, 0.0004)])
    return {"a.osm.pbf": pbf.read_bytes(), "a.osm": SQUARE.encode(), "a.osm.gz": gzip.compress(SQUARE.encode())}


@given(
    st.sampled_from(["a.osm.pbf", "a.osm", "a.osm.gz"]),
    st.lists(st.tuples(st.integers(0, 3000), st.binary(min_size=1, max_size=3)), min_size=1, max_size=5),
    st.integers(1, 3000),
)
@settings(max_examples=40, deadline=None)
def test_damaged_files_give_a_map_or_one_of_our_errors(
    small_files: dict[str, bytes],
    tmp_path_factory: pytest.TempPathFactory,
    name: str,
    damage: list[tuple[int, bytes]],
    length: int,
) -> None:
    content = bytearray(small_files[name])
    for place, noise in damage:
        at = place % len(content)
        content[at : at + len(noise)] = noise
    path = tmp_path_factory.getbasetemp() / name
    path.write_bytes(content[:length] if length % 5 == 0 else content)
    with contextlib.suppress(SchemaError, EmptyInputError):
        data = read_osm(path, LocalFrame(0.0002, 0.0002), 100.0)
        assert all(area.polygon.is_valid for area in data.areas)
