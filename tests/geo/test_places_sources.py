"""Places of Google (against a server that answers as it does) and of Overture (files as it writes them)."""

import json
import struct
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from http_server import Answer, Request, serve
from vico.errors import InputError, MissingFileError, SchemaError, SourceError, VicoError
from vico.geo.frame import LocalFrame
from vico.geo.overture import OverturePlaces
from vico.geo.places import GooglePlaces, google_key
from vico.io.http import HttpClient

FRAME = LocalFrame(60.1678, 24.9424)
KEY = "AIza-test-key-4711"


def _google(base: str, tmp_path: Path, api: str, **options: Any) -> GooglePlaces:
    web = HttpClient(cache=tmp_path / "cache", sleep=lambda _: None)
    return GooglePlaces(KEY, web, api=api, address=f"{base}/places", sleep=lambda _: None, **options)


def _sample(shared_data: Path, name: str) -> dict[str, Any]:
    return dict(json.loads((shared_data / "samples" / name).read_text()))


def test_legacy_answers_are_read_page_by_page(shared_data: Path, tmp_path: Path) -> None:
    sample = _sample(shared_data, "google_places_nearby_legacy.json")

    def answer(request: Request) -> Answer:
        assert (request.method, request.path, request.query["key"]) == ("GET", "/places", KEY)
        page = dict(sample)
        if "pagetoken" in request.query:
            assert request.query["pagetoken"] == "PLACEHOLDER"
            page.pop("next_page_token")
            gone = dict(sample["results"][0], place_id="SHUT", business_status="CLOSED_PERMANENTLY")
            page["results"] = [gone, {"place_id": "NOWHERE"}]
        else:
            assert request.query["location"] == "60.1678000,24.9424000"
            assert float(request.query["radius"]) == pytest.approx(565.7)
        return Answer(body=json.dumps(page).encode())

    with serve(answer) as base:
        source = _google(base, tmp_path, "legacy")
        places = source.near(FRAME, 400.0)
    assert [(p.id, p.name, p.kind, p.open) for p in places] == [
        ("google:PLACEHOLDER_ID", "Example Cafe", "cafe", True),
        ("google:SHUT", "Example Cafe", "cafe", False),
    ]
    assert places[0].xy == pytest.approx((-122.1, 111.4), abs=0.5)
    assert not places[0].may_be_kept
    assert source.refused == [("google:NOWHERE", "has no name or no position")]
    assert list(tmp_path.iterdir()) == []  # nothing of Google's is on the disk


def test_the_new_api_is_asked_with_key_and_fields_in_headers(shared_data: Path, tmp_path: Path) -> None:
    sample = _sample(shared_data, "google_places_new_searchNearby.json")

    def answer(request: Request) -> Answer:
        assert request.method == "POST"
        assert request.headers["x-goog-api-key"] == KEY
        assert "places.displayName" in request.headers["x-goog-fieldmask"]
        body = json.loads(request.body)
        assert body.keys() <= sample["_request"].keys() | {"rankPreference"}
        assert body["locationRestriction"]["circle"]["center"] == {"latitude": 60.1678, "longitude": 24.9424}
        return Answer(body=json.dumps({"places": sample["places"]}).encode())

    with serve(answer) as base:
        places = _google(base, tmp_path, "new").near(FRAME, 400.0)
    assert [(p.id, p.name, p.kind, p.kinds[0]) for p in places] == [
        ("google:PLACEHOLDER_ID", "Example Cafe", "cafe", "restaurant")
    ]
    assert list(tmp_path.iterdir()) == []


def test_full_circles_are_parted_until_all_is_seen_or_the_calls_are_spent(tmp_path: Path) -> None:
    radii: list[float] = []

    def answer(request: Request) -> Answer:
        circle = json.loads(request.body)["locationRestriction"]["circle"]
        radii.append(circle["radius"])
        rows = 20 if circle["radius"] > 300 else 1
        spot = {"latitude": circle["center"]["latitude"], "longitude": circle["center"]["longitude"]}
        places = [{"id": f"{len(radii)}-{k}", "displayName": {"text": "Bar"}, "types": ["bar"], "location": spot}
                  for k in range(rows)]  # fmt: skip
        return Answer(body=json.dumps({"places": places}).encode())

    with serve(answer) as base:
        source = _google(base, tmp_path, "new")
        assert len(source.near(FRAME, 400.0)) == 24
        assert radii == [565.7, 282.8, 282.8, 282.8, 282.8]
        assert not source.partial
        few = _google(base, tmp_path, "new", calls=2)
        few.near(FRAME, 400.0)
        assert few.partial


def test_a_refusal_is_one_sentence_without_the_key(tmp_path: Path) -> None:
    refusal = {"status": "REQUEST_DENIED", "error_message": f"The key {KEY} is invalid.", "results": []}
    with serve(lambda _: Answer(body=json.dumps(refusal).encode())) as base:
        source = _google(base, tmp_path, "legacy")
        with pytest.raises(
            SourceError, match=r"REQUEST_DENIED \(The key \*\*\* is invalid.\); check the key"
        ) as caught:
            source.near(FRAME, 400.0)
    assert KEY not in str(caught.value)
    with serve(lambda _: Answer(body=b"[1]")) as base, pytest.raises(SchemaError, match="not the JSON object"):
        _google(base, tmp_path, "new").near(FRAME, 400.0)


def test_the_key_comes_from_the_environment_only() -> None:
    assert google_key({"GOOGLE_MAPS_API_KEY": " k "}) == "k"
    with pytest.raises(InputError, match="set GOOGLE_MAPS_API_KEY"):
        google_key({})


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(row=st.recursive(
    st.one_of(st.none(), st.floats(), st.text(max_size=5), st.integers()),
    lambda inner: st.dictionaries(st.sampled_from(["id", "location", "latitude", "longitude", "displayName", "text",
                                                   "types", "primaryType"]), inner, max_size=4),
    max_leaves=8,
))  # fmt: skip
def test_nonsense_from_google_is_left_out(row: Any, tmp_path: Path) -> None:
    source = GooglePlaces(KEY, HttpClient(), api="new")
    if isinstance(row, dict):
        place = source._place(row, FRAME, 400.0)
        assert place is None or (place.id.startswith("google:") and max(map(abs, place.xy)) <= 400.0)


# -- Overture ---------------------------------------------------------------------------------------------------------


def point(lon: float, lat: float) -> bytes:
    return struct.pack("<BIdd", 1, 1, lon, lat)


def overture_row(key: str, name: str, dx: float, **more: Any) -> dict[str, Any]:
    lon, lat = 24.9424 + dx, 60.1678
    return {
        "id": key,
        "geometry": point(lon, lat),
        "bbox": {"xmin": lon, "xmax": lon, "ymin": lat, "ymax": lat},
        "names": {"primary": name, "common": None},
        "categories": {"primary": "coffee_shop", "alternate": ["bakery"]},
        "confidence": 0.9,
        "operating_status": "open",
        **more,
    }


def overture_file(path: Path, rows: list[dict[str, Any]]) -> Path:
    pq.write_table(pa.Table.from_pylist(rows), path, row_group_size=2)
    return path


def test_overture_places_of_the_window_are_read(tmp_path: Path) -> None:
    rows = [
        overture_row("2", "Kahvila\nÄö", 0.001),
        overture_row("1", "Doubtful", 0.0, confidence=0.3),
        overture_row("3", "Far", 0.5),
        overture_row("4", "Far too", 0.6),
        overture_row("5", "", 0.0),
        overture_row("6", "Gone", 0.0, operating_status="permanently_closed"),
    ]
    source = OverturePlaces([overture_file(tmp_path / "places.parquet", rows)])
    places = source.near(FRAME, 400.0)
    assert [(p.id, p.name, p.kind, p.kinds, p.open) for p in places] == [
        ("overture:2", "Kahvila Äö", "coffee_shop", ("bakery",), True),
        ("overture:6", "Gone", "coffee_shop", ("bakery",), False),
    ]
    assert places[0].xy == pytest.approx((55.5, 0.0), abs=0.1)
    assert dict(source.refused) == {
        "overture:1": "'Doubtful': confidence 0.30 is below 0.5",
        "overture:5": "has no name",
    }


def test_the_newer_taxonomy_and_folders_are_read(tmp_path: Path) -> None:
    row = overture_row("1", "Museo", 0.0)
    del row["categories"]
    row["taxonomy"] = {"primary": "art_museum", "hierarchy": ["arts_and_entertainment", "museum", "art_museum"]}
    overture_file(tmp_path / "part-0.parquet", [row])
    (place,) = OverturePlaces([tmp_path]).near(FRAME, 400.0)
    assert (place.kind, place.kinds) == ("art_museum", ("museum", "arts_and_entertainment"))


def test_what_is_no_overture_file_is_refused_in_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(MissingFileError, match="no such file"):
        OverturePlaces([tmp_path / "no.parquet"])
    (tmp_path / "text.parquet").write_text("no parquet")
    with pytest.raises(SchemaError, match="not readable GeoParquet"):
        OverturePlaces([tmp_path / "text.parquet"]).near(FRAME, 400.0)
    pq.write_table(pa.table({"id": ["1"]}), tmp_path / "other.parquet")
    with pytest.raises(SchemaError, match="has no column geometry"):
        OverturePlaces([tmp_path / "other.parquet"]).near(FRAME, 400.0)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_damaged_file_gives_places_or_a_sentence(tmp_path: Path, data: st.DataObject) -> None:
    path = tmp_path / "good.parquet"
    if not path.exists():
        overture_file(path, [overture_row(str(k), f"Place {k}", 0.0001 * k) for k in range(6)])
    content = bytearray(path.read_bytes())
    for _ in range(data.draw(st.integers(1, 3))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    bad = tmp_path / "bad.parquet"
    bad.write_bytes(content[: data.draw(st.integers(1, len(content)))] if data.draw(st.booleans()) else content)
    try:
        places = OverturePlaces([bad]).near(FRAME, 400.0)
    except VicoError:
        places = []
    assert all(max(map(abs, place.xy)) <= 400.0 for place in places)


@given(st.binary(max_size=40))
def test_geometry_that_is_no_point_is_left_out(content: bytes) -> None:
    source = OverturePlaces([])
    place = source._place({"id": "x", "geometry": content, "names": {"primary": "X"}}, FRAME, 400.0)
    assert place is None
