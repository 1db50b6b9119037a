"""Buildings of city models and of Overture: a real sample of 3DBAG, and files that are written here."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import shapely
from pyproj import Transformer

from vico.errors import InputError, MissingFileError, SchemaError
from vico.geo.building_files import read_buildings, read_cityjson
from vico.geo.buildings import FoundBuilding, form_of
from vico.geo.frame import LocalFrame
from vico.io import json_stream

SAMPLE = Path(__file__).parent / "data" / "3dbag_ten.city.json"
RD = Transformer.from_crs("EPSG:28992", "EPSG:4326", always_xy=True)
BERLIN = LocalFrame(52.51, 13.39)
UTM = Transformer.from_crs("EPSG:4326", "EPSG:25833", always_xy=True).transform(13.39, 52.51)


def frame_of_sample() -> LocalFrame:
    lon, lat = RD.transform(153_200.8 + 100.0, 414_118.2 + 50.0)
    return LocalFrame(lat, lon)


def gabled(
    *, ground: float = 34.0, roof_share: float = 1.0, dtd: str = "", srs: str = "urn:ogc:def:crs:EPSG::25833"
) -> str:
    """Write CityGML of one house of 10 m by 8 m under a gable: eaves at 6 m, ridge, along its length, at 9 m."""
    x, y = UTM
    west, east, south, north, middle = x - 5, x + 5 * (2 * roof_share - 1), y - 4, y + 4, y
    full = x + 5

    def polygon(*points: tuple[float, float, float]) -> str:
        ring = " ".join(f"{a:.3f} {b:.3f} {ground + c:.3f}" for a, b, c in (*points, points[0]))
        return (
            f"<gml:surfaceMember><gml:Polygon><gml:exterior><gml:LinearRing><gml:posList>{ring}</gml:posList>"
            "</gml:LinearRing></gml:exterior></gml:Polygon></gml:surfaceMember>"
        )

    def surface(kind: str, content: str) -> str:
        inner = f"<bldg:lod2MultiSurface><gml:MultiSurface>{content}</gml:MultiSurface></bldg:lod2MultiSurface>"
        return f"<bldg:boundedBy><bldg:{kind}>{inner}</bldg:{kind}></bldg:boundedBy>"

    parts = [
        surface("GroundSurface", polygon((west, south, 0), (west, north, 0), (full, north, 0), (full, south, 0))),
        surface("WallSurface", polygon((west, south, 0), (full, south, 0), (full, south, 6), (west, south, 6))),
        surface("RoofSurface", polygon((west, south, 6), (east, south, 6), (east, middle, 9), (west, middle, 9))),
        surface("RoofSurface", polygon((west, middle, 9), (east, middle, 9), (east, north, 6), (west, north, 6))),
    ]
    return (
        f'<?xml version="1.0"?>{dtd}<CityModel xmlns="http://www.opengis.net/citygml/2.0" '
        'xmlns:gml="http://www.opengis.net/gml" xmlns:bldg="http://www.opengis.net/citygml/building/2.0">'
        f'<gml:boundedBy><gml:Envelope srsName="{srs}" srsDimension="3"/></gml:boundedBy><cityObjectMember>'
        '<bldg:Building gml:id="house"><bldg:function>31001_1000</bldg:function><bldg:roofType>3100</bldg:roofType>'
        f"<bldg:storeysAboveGround>2</bldg:storeysAboveGround>{''.join(parts)}</bldg:Building>"
        "</cityObjectMember></CityModel>"
    )


def only(path: Path, frame: LocalFrame = BERLIN, half: float = 100.0) -> FoundBuilding:
    (found,) = read_buildings([path], frame, half)
    assert len(found.buildings) == 1, found.refused
    return found.buildings[0]


def test_ten_houses_of_3dbag_have_roofs_and_the_heights_of_their_own_ground() -> None:
    (found,) = read_buildings([f"{SAMPLE}@EPSG:7415"], frame_of_sample(), 60_000.0)
    assert len(found.buildings) == 10
    assert found.refused == ()
    heights = [float(building.tags["height"]) for building in found.buildings]
    assert 2.0 < min(heights) < max(heights) < 15.0
    assert {building.tags["roof:shape"] for building in found.buildings} >= {"gabled", "flat"}
    for building in found.buildings:
        covered = shapely.union_all([facet.polygon for facet in building.facets]).area
        assert covered == pytest.approx(building.footprint.area, rel=0.02), building.id


def test_a_model_that_does_not_say_its_system_is_refused_with_what_to_type() -> None:
    with pytest.raises(SchemaError, match=r"no EPSG code.*3dbag_ten\.city\.json@EPSG:25833"):
        read_buildings([SAMPLE], frame_of_sample(), 100.0)


def test_a_model_a_line_is_read_like_one_object_and_far_buildings_are_left(tmp_path: Path) -> None:
    model: dict[str, Any] = json.loads(SAMPLE.read_text())
    lines = [{**model, "CityObjects": {}, "vertices": []}]
    for name, thing in model["CityObjects"].items():
        lines.append(
            {"type": "CityJSONFeature", "id": name, "CityObjects": {name: thing}, "vertices": model["vertices"]}
        )
    path = tmp_path / "ten.city.jsonl"
    path.write_text("\n".join(json.dumps(line) for line in lines))
    frame = frame_of_sample()
    one, two = (read_cityjson(file, frame, 60_000.0, "EPSG:7415").buildings for file in (SAMPLE, path))
    assert [b.id for b in one] == [b.id for b in two]
    assert [b.tags for b in one] == [b.tags for b in two]
    middle = one[3].footprint.centroid
    lat, lon = frame.to_geodetic(np.array([middle.x, middle.y]))
    near = read_cityjson(SAMPLE, LocalFrame(float(lat), float(lon)), 5.0, "EPSG:7415").buildings
    assert [b.id for b in near] == [one[3].id]


def test_a_stream_gives_what_a_whole_read_gives_whatever_its_blocks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    content = {"a": {"x": [1, 2.5, "é"], "y": None}, "empty": {}, "list": [[1, 2], [3, 4]], "number": 12345}
    path = tmp_path / "a.json"
    path.write_text(json.dumps(content))
    monkeypatch.setattr(json_stream, "_BLOCK", 3)
    rows = list(json_stream.JsonStream(path).members(within=frozenset({"a", "list", "empty"})))
    assert rows == [
        ("a", "x", [1, 2.5, "é"]),
        ("a", "y", None),
        ("list", "", [1, 2]),
        ("list", "", [3, 4]),
        ("number", "", 12345),
    ]
    path.write_text(json.dumps(content)[:-9])
    with pytest.raises(SchemaError, match=r"truncated|middle"):
        list(json_stream.JsonStream(path).members())


def test_a_gabled_house_of_citygml_stands_where_it_says_at_its_own_height(tmp_path: Path) -> None:
    path = tmp_path / "house.gml"
    path.write_text(gabled())
    house = only(path)
    assert house.footprint.area == pytest.approx(80.0, rel=0.002)
    assert np.hypot(*house.footprint.centroid.coords[0]) < 0.05
    assert house.tags["building"] == "residential"
    assert house.tags["building:levels"] == "2"
    form = form_of(house.facets)
    assert form.shape == "gabled"
    assert (form.eaves, form.top) == pytest.approx((6.0, 9.0), abs=0.01)


def test_a_roof_that_covers_half_a_house_is_fitted_and_said(tmp_path: Path) -> None:
    path = tmp_path / "half.gml"
    path.write_text(gabled(roof_share=0.5))
    (found,) = read_buildings([path], BERLIN, 100.0)
    house = found.buildings[0]
    assert house.facets == ()
    assert "cover 50 % of its footprint" in house.fault
    assert house.tags["roof:shape"] == "gabled"  # its code says so
    assert float(house.tags["height"]) == pytest.approx(9.0, abs=0.01)
    assert [reason for _, reason in found.refused] == [f"its roof is fitted instead of built: {house.fault}"]


@pytest.mark.parametrize(
    "dtd",
    [
        '<!DOCTYPE a [<!ENTITY x "ha"><!ENTITY y "&x;&x;&x;&x;">]>',
        '<!DOCTYPE a [<!ENTITY x SYSTEM "file:///etc/passwd">]>',
        '<!DOCTYPE a SYSTEM "http://127.0.0.1/a.dtd">',
    ],
)
def test_entities_and_document_types_are_refused(dtd: str, tmp_path: Path) -> None:
    path = tmp_path / "bomb.gml"
    path.write_text(gabled(dtd=dtd))
    with pytest.raises(SchemaError, match="has a document type or entities"):
        read_buildings([path], BERLIN, 100.0)


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("a.gml", "<html/>", "its root is <html>"),
        ("a.gml", gabled()[:900], "not readable XML"),
        ("a.gml", gabled(srs="local"), r"no EPSG code.*a\.gml@EPSG"),
        ("a.gml", gabled(srs="EPSG:99999"), "not a coordinate system known"),
        ("a.json", "[1, 2]", "not readable JSON"),
        ("a.json", '{"type": "FeatureCollection"}', "not CityJSON"),
        ("a.json", '{"type": "CityJSON", "version": "0.9"}', "upgrade it"),
        ("a.json", '{"type":"CityJSON","version":"2.0","CityObjects":{},"vertices":[[1,2', "truncated"),
        ("a.parquet", "PAR1 and nothing", "not readable GeoParquet"),
    ],
)
def test_files_that_are_none_say_so_in_a_sentence(name: str, content: str, says: str, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_text(content)
    with pytest.raises(SchemaError, match=says):
        read_buildings([path], BERLIN, 100.0)


def test_missing_unknown_and_doubled_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(MissingFileError, match="no such file"):
        read_buildings([tmp_path / "a.json"], BERLIN, 100.0)
    with pytest.raises(InputError, match=r"must end in \.json"):
        read_buildings([tmp_path / "a.shp"], BERLIN, 100.0)
    with pytest.raises(InputError, match="given twice"):
        read_buildings([tmp_path / "a.json", tmp_path / "b" / "a.json"], BERLIN, 100.0)


def overture(path: Path, rows: list[dict[str, Any]]) -> Path:
    """Write rows as Overture does: outlines in well-known binary of longitudes and latitudes, each with its box."""
    for row in rows:
        lat, lon = BERLIN.to_geodetic(np.asarray(row.pop("ring"), np.float64))
        shape = shapely.Polygon(np.column_stack([lon, lat]))
        row["geometry"] = shapely.to_wkb(shape)
        row["bbox"] = dict(zip(("xmin", "ymin", "xmax", "ymax"), shape.bounds, strict=True))
    pq.write_table(pa.Table.from_pylist(rows), path)
    return path


def square(x: float, y: float, side: float = 10.0) -> list[tuple[float, float]]:
    return [(x, y), (x + side, y), (x + side, y + side), (x, y + side)]


def test_overture_s_columns_become_the_map_s_words(tmp_path: Path) -> None:
    path = overture(
        tmp_path / "buildings.parquet",
        [
            {"id": "a", "ring": square(0, 0), "height": 12.5, "num_floors": 4, "roof_shape": "gabled", "class": "house",
             "names": {"primary": "Old Mill"}, "sources": [{"dataset": "OpenStreetMap"}], "is_underground": False,
             "building_id": None},
            {"id": "p", "ring": square(0, 0, 5), "height": 20.0, "num_floors": None, "roof_shape": None, "class": None,
             "names": None, "sources": None, "is_underground": False, "building_id": "a"},
            {"id": "u", "ring": square(30, 0), "height": None, "num_floors": None, "roof_shape": None, "class": None,
             "names": None, "sources": None, "is_underground": True, "building_id": None},
            {"id": "far", "ring": square(900, 0), "height": 3.0, "num_floors": None, "roof_shape": None, "class": None,
             "names": None, "sources": None, "is_underground": False, "building_id": None},
        ],
    )  # fmt: skip
    (found,) = read_buildings([path], BERLIN, 100.0)
    (mill,) = found.buildings
    assert mill.tags == {
        "height": "12.5",
        "building:levels": "4",
        "roof:shape": "gabled",
        "name": "Old Mill",
        "building": "house",
    }
    assert mill.footprint.area == pytest.approx(100.0, rel=1e-3)
    assert [tags["height"] for _, tags in mill.parts] == ["20"]
    assert found.refused == (("overture:u", "underground"),)
    assert "© OpenStreetMap contributors" in found.attributions


def test_tokyo_s_citygml_begins_with_latitude(tmp_path: Path, shared_data: Path) -> None:
    source = shared_data / "tiles3d" / "haneda_citygml" / "53392642_bldg_6697_op2.gml"
    # The publisher's test file leaves out one of its namespaces.
    text = source.read_text(encoding="utf-8").replace("xmlns:grp=", 'xmlns:energy="urn:energy" xmlns:grp=', 1)
    path = tmp_path / "haneda.gml"
    path.write_text(text, encoding="utf-8")
    (found,) = read_buildings([path], LocalFrame(35.540, 139.777), 400.0)
    assert len(found.buildings) == 8
    assert sum(bool(building.facets) for building in found.buildings) >= 6
