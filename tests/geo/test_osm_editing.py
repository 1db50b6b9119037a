"""Files that map editors save: what is deleted in them, and drafts with negative ids."""

import bz2
import gzip
from pathlib import Path

import pytest

from vico.errors import EmptyInputError, SchemaError
from vico.geo.frame import LocalFrame
from vico.geo.osm import OsmData, read_osm
from vico.worldgen.pipeline import extract_centre

FRAME = LocalFrame(0.0002, 0.0002)
# Two houses side by side, the second (way 12, relation 20) of two ways.
NODES = "".join(
    f'<node id="{k}" version="1" timestamp="2026-01-01T00:00:00Z" lat="{y * 1e-4:.4f}" lon="{x * 1e-4:.4f}"/>\n'
    for k, (x, y) in enumerate([(0, 0), (1, 0), (1, 1), (0, 1), (2, 0), (3, 0), (3, 1), (2, 1)], 1)
)


def way(number: int, refs: list[int], tags: str = "", more: str = "") -> str:
    members = "".join(f'<nd ref="{ref}"/>' for ref in refs)
    return f'<way id="{number}" version="1" {more}>{members}{tags}</way>\n'


HOUSE = '<tag k="building" v="house"/>'
MARKS = ["action='delete' visible='true'", 'action="delete"', 'visible="false"', 'visible="false" action="delete"']


def read(tmp_path: Path, content: str, name: str = "a.osm") -> OsmData:
    path = tmp_path / name
    text = f'<?xml version="1.0"?>\n<osm version="0.6" generator="JOSM">\n{content}</osm>'.encode()
    path.write_bytes(gzip.compress(text) if name.endswith(".gz") else text)
    return read_osm(path, FRAME, 100.0)


@pytest.mark.parametrize("mark", MARKS)
@pytest.mark.parametrize("name", ["a.osm", "a.osm.gz"])
def test_a_deleted_way_is_not_there_and_told(tmp_path: Path, mark: str, name: str) -> None:
    data = read(tmp_path, NODES + way(11, [1, 2, 3, 4, 1], HOUSE) + way(12, [5, 6, 7, 8, 5], HOUSE, mark), name)
    assert [area.id for area in data.areas] == ["w11"]
    assert [one.id for one in data.ways] == [11]
    assert ("w12", "deleted in the editor that saved the file") in data.broken


@pytest.mark.parametrize("mark", MARKS)
def test_a_deleted_point_is_not_there_nor_in_its_ways(tmp_path: Path, mark: str) -> None:
    shop = f'<node id="9" version="1" {mark} lat="0.0001" lon="0.0001"><tag k="shop" v="books"/></node>'
    corner = f'<node id="10" version="1" {mark} lat="0.0003" lon="0.0003"/>'
    data = read(tmp_path, NODES + shop + corner + way(11, [1, 2, 3, 10, 4, 1], HOUSE))
    assert data.nodes == []
    assert data.ways[0].nodes == [1, 2, 3, 4, 1]
    assert [told for told in data.broken if told[0].startswith("w")] == []


@pytest.mark.parametrize("mark", MARKS)
def test_a_deleted_relation_and_deleted_members_are_not_there(tmp_path: Path, mark: str) -> None:
    tags = '<tag k="type" v="multipolygon"/><tag k="building" v="yes"/>'
    ring = '<member type="way" ref="12" role="outer"/>'
    hole = '<member type="way" ref="13" role="inner"/>'
    inner = way(13, [1, 2, 3, 1], "", mark)
    content = NODES + way(11, [1, 2, 3, 4, 1], HOUSE) + way(12, [5, 6, 7, 8, 5]) + inner
    kept = f'<relation id="20" version="1">{ring}{hole}{tags}</relation>'
    gone = f'<relation id="21" version="1" {mark}>{ring}{tags}</relation>'
    data = read(tmp_path, content + kept + gone)
    assert [area.id for area in data.areas] == ["w11", "r20"]
    assert [relation.id for relation in data.relations] == [20] or data.relations == []
    assert {told[0] for told in data.broken} == {"w13", "r21"}


def test_a_file_in_which_all_is_deleted_is_empty(tmp_path: Path) -> None:
    with pytest.raises(EmptyInputError, match="nothing in"):
        read(tmp_path, NODES + way(11, [1, 2, 3, 4, 1], HOUSE, MARKS[0]))


def test_the_middle_of_a_file_is_that_of_what_is_not_deleted(tmp_path: Path) -> None:
    far = '<node id="9" version="1" action="delete" visible="true" lat="60" lon="60"/>'
    read(tmp_path, NODES + far + way(11, [1, 2, 3, 4, 1], HOUSE))
    assert extract_centre(tmp_path / "a.osm") == pytest.approx((0.00005, 0.00015))


def drafted(text: str) -> str:
    return text.replace('id="', 'id="-').replace('ref="', 'ref="-').replace('version="1"', "")


def test_a_draft_is_read_with_positive_ids_and_told(tmp_path: Path) -> None:
    tags = '<tag k="type" v="multipolygon"/><tag k="building" v="yes"/>'
    relation = f'<relation id="20" version="1"><member type="way" ref="12" role="outer"/>{tags}</relation>'
    data = read(tmp_path, drafted(NODES + way(11, [1, 2, 3, 4, 1], HOUSE) + way(12, [5, 6, 7, 8, 5]) + relation))
    assert [area.id for area in data.areas] == ["w1000000000011", "r1000000000020"]
    assert ("map", "3 objects are drafts of an editor (negative ids); -1 is read as 1000000000001") in data.broken


def test_new_objects_between_old_ones_are_read(tmp_path: Path) -> None:
    drafts = '<node id="-1" lat="0" lon="0.0002"/><node id="-2" lat="0.0001" lon="0.0002"/>'
    extended = way(12, [2, -1, -2, 3, 2], HOUSE)
    data = read(tmp_path, drafts + NODES + way(11, [1, 2, 3, 4, 1], HOUSE) + extended)
    assert [round(area.polygon.area) for area in data.areas] == [123, 123]
    assert data.ways[1].nodes == [2, 1000000000001, 1000000000002, 3, 2]


def test_a_history_of_objects_is_pointed_out(tmp_path: Path) -> None:
    import osmium

    path = tmp_path / "a.osh.pbf"
    header = osmium.io.Header()
    header.has_multiple_object_versions = True
    with osmium.SimpleWriter(str(path), header=header) as writer:
        for version in (1, 2):
            writer.add_node(osmium.osm.mutable.Node(id=1, version=version, location=(0.0, 0.0), visible=True))
    with pytest.raises(SchemaError, match="osmium time-filter"):
        read_osm(path, FRAME, 100.0)


@pytest.mark.parametrize("value", ["proposed", "planned", "demolished", "razed", "removed"])
def test_a_building_that_is_planned_or_gone_is_not_there(tmp_path: Path, value: str) -> None:
    gone = f'<tag k="building" v="{value}"/>'
    data = read(tmp_path, NODES + way(11, [1, 2, 3, 4, 1], HOUSE) + way(12, [5, 6, 7, 8, 5], gone))
    assert [area.id for area in data.areas if "building" in area.tags] == ["w11"]
    assert ("w12", f"building={value}: it is not there") in data.broken


REMARK = "<remark> runtime error: Query timed out in &quot;query&quot; at line 3 after 26 seconds. </remark>"


@pytest.mark.parametrize("name", ["a.osm", "a.osm.gz"])
def test_an_answer_of_overpass_that_is_not_whole_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(SchemaError, match=r"Overpass stopped before its answer was whole .runtime error: Query timed"):
        read(tmp_path, NODES + way(11, [1, 2, 3, 4, 1], HOUSE) + REMARK, name)
    text = f"<osm version='0.6'>{REMARK}</osm>".encode()
    (tmp_path / name).write_bytes(gzip.compress(text) if name.endswith(".gz") else text)
    with pytest.raises(SchemaError, match="Overpass stopped"):
        extract_centre(tmp_path / name)


def test_an_answer_of_overpass_without_nodes_is_said_to_be_one(tmp_path: Path) -> None:
    refs = "".join(f'<nd ref="{k}" lat="0.000{k}" lon="0.0001"/>' for k in (1, 2, 3, 1))
    with pytest.raises(SchemaError, match=r"its nodes are not in it .Overpass's out geom."):
        read(tmp_path, f'<way id="11">{refs}{HOUSE}</way>')


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b'{"version": 0.6, "elements": []}', "is JSON, which is not read"),
        (gzip.compress(b"<osm/>", mtime=0), "is packed with gzip; give it a name that ends in .osm.gz"),
        (bz2.compress(b"<osm/>"), "is packed with bzip2"),
        (b"PK\x03\x04rest", "is a ZIP archive; unpack it"),
        (b"<!DOCTYPE html><html>", "is a web page, not a map"),
    ],
)
def test_another_file_by_the_name_of_a_map_is_told_apart(tmp_path: Path, content: bytes, says: str) -> None:
    (tmp_path / "a.osm").write_bytes(content)
    with pytest.raises(SchemaError, match=says):
        read_osm(tmp_path / "a.osm", FRAME, 100.0)
