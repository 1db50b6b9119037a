"""Street photos from services, against a real server that answers as they do, errors included."""

import io
import json
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from http_server import Answer, Request, serve
from vico.errors import InputError, SchemaError, SourceError
from vico.geo.frame import LocalFrame
from vico.geo.google_street_view import GoogleStreetView
from vico.geo.mapillary import FIELDS, Mapillary, images_in, split_box
from vico.geo.street_images import camera_rotation
from vico.io.http import HttpClient

HERE = LocalFrame(60.169, 24.9435)
TOKEN = "MLY|1234|secret-of-the-user"
KEY = "AIza-secret-of-the-user"


def jpeg(width: int = 80, height: int = 60) -> bytes:
    packed = io.BytesIO()
    Image.new("RGB", (width, height), (200, 100, 50)).save(packed, "JPEG")
    return packed.getvalue()


def entry(number: int, base: str, **changes: object) -> dict[str, object]:
    return {
        "id": str(number),
        "captured_at": 1690000000000,
        "camera_type": "perspective",
        "camera_parameters": [0.85, 0.05, -0.02],
        "width": 4000,
        "height": 3000,
        "geometry": {"type": "Point", "coordinates": [24.9435, 60.169]},
        "computed_geometry": {"type": "Point", "coordinates": [24.9435 + number * 1e-4, 60.169]},
        "computed_compass_angle": 90.0,
        "computed_rotation": [1.2, -1.2, 1.2],
        "thumb_2048_url": f"{base}/picture/{number}.jpg",
        **changes,
    }


def mapillary(
    list_images: Callable[[Request], Answer], pictures: Callable[[str], Answer]
) -> Callable[[Request], Answer]:
    def handler(request: Request) -> Answer:
        if request.path.startswith("/picture/"):
            # The picture's host is another one in real life: it must not learn the token.
            assert "authorization" not in request.headers
            return pictures(request.path)
        assert request.path == "/images"
        assert request.query["fields"] == FIELDS
        if request.headers.get("authorization") != f"OAuth {TOKEN}":
            fault = {"message": "Invalid OAuth 2.0 Access Token", "type": "OAuthException", "code": 190}
            return Answer(401, json.dumps({"error": fault}).encode())
        west, south, east, north = map(float, request.query["bbox"].split(","))
        assert max(east - west, north - south) <= 0.0101
        return list_images(request)

    return handler


def test_mapillary_photos_come_page_by_page_and_bad_ones_are_told() -> None:
    def listed(request: Request) -> Answer:
        if "after" not in request.query:
            rows = [
                entry(1, base),
                entry(2, base, camera_type="fisheye"),
                entry(3, base, camera_parameters=[]),
            ]
            paging = {"cursors": {"after": "PAGE2"}, "next": "https://example.invalid/with?access_token=x"}
        else:
            assert request.query["after"] == "PAGE2"
            rows = [
                entry(4, base),
                entry(5, base),
                entry(6, base, width="wide"),
                entry(7, base, computed_rotation=None),
            ]
            paging = {"cursors": {"after": "PAGE3"}}
        return Answer(200, json.dumps({"data": rows, "paging": paging}).encode())

    def picture(path: str) -> Answer:
        if path.endswith("/4.jpg"):
            return Answer(404, b"gone")
        return Answer(200, jpeg()[:300] if path.endswith("/5.jpg") else jpeg())

    with serve(mapillary(listed, picture)) as base:
        source = Mapillary(TOKEN, HttpClient(retries=0), address=base)
        photos = {p.id: p for p in source.near(HERE, 100.0, most=9)}
    assert sorted(photos) == ["1", "7"]
    reasons = dict(source.refused)
    assert "fisheye" in reasons["2"]
    assert "focal" in reasons["3"]
    assert "nothing there (404)" in reasons["4"]
    assert "not a readable photo" in reasons["5"]
    assert reasons["6"].startswith("width")
    assert photos["7"].rotation == pytest.approx(camera_rotation(90.0))
    assert photos["1"].position[:2] == pytest.approx(HERE.to_enu(60.169, 24.9436))
    assert photos["1"].intrinsics[0, 0] == pytest.approx(0.85 * 80)
    assert photos["1"].captured == "2023-07-22T04:26:40+00:00"
    assert photos["1"].picture.shape == (60, 80, 3)


def test_at_most_as_many_photos_as_asked_for_are_fetched() -> None:
    fetched = []

    def picture(path: str) -> Answer:
        fetched.append(path)
        return Answer(200, jpeg())

    with serve(mapillary(lambda _: Answer(200, json.dumps({"data": [entry(k, base) for k in range(9)]}).encode()),
                         picture)) as base:  # fmt: skip
        assert len(list(Mapillary(TOKEN, HttpClient(retries=0), address=base).near(HERE, 100.0, most=3))) == 3
    assert len(fetched) == 3


def test_an_expired_token_is_told_with_its_cure_and_without_itself() -> None:
    with (
        serve(mapillary(lambda _: Answer(200, b"{}"), lambda _: Answer(404))) as base,
        pytest.raises(SourceError, match="MAPILLARY_TOKEN") as told,
    ):
        list(Mapillary("MLY|old-and-expired", HttpClient(retries=0), address=base).near(HERE, 100.0, most=3))
    assert "old-and-expired" not in str(told.value)


def test_an_answer_of_another_shape_is_refused() -> None:
    for body in (b"<html>", b"[]", b'{"data": 5}', b'{"error": {"message": "too busy"}}', b"{}", b'"x"', b"[" * 9999):
        with pytest.raises(SchemaError):
            images_in(body, "mapillary")


def test_a_full_page_without_a_next_one_is_asked_again_in_quarters() -> None:
    asked: list[tuple[float, ...]] = []

    def listed(request: Request) -> Answer:
        box = tuple(map(float, request.query["bbox"].split(",")))
        asked.append(box)
        count = 500 if len(asked) == 1 else 1
        rows = [entry(1000 * len(asked) + k, base, computed_geometry=None) for k in range(count)]
        return Answer(200, json.dumps({"data": rows}).encode())

    with serve(mapillary(listed, lambda _: Answer(200, jpeg()))) as base:
        list(Mapillary(TOKEN, HttpClient(retries=0), address=base).near(HERE, 100.0, most=1))
    assert len(asked) == 5
    whole = math.prod(np.subtract(asked[0][2:], asked[0][:2]))
    assert sum(math.prod(np.subtract(box[2:], box[:2])) for box in asked[1:]) == pytest.approx(whole, rel=1e-3)


def test_large_boxes_are_asked_for_in_pieces() -> None:
    pieces = list(split_box((24.93, 60.16, 24.955, 60.172)))
    assert len(pieces) == 6
    assert max(max(e - w, n - s) for w, s, e, n in pieces) <= 0.0101


def test_a_place_on_the_date_line_is_asked_for_on_both_sides() -> None:
    asked = []

    def handler(request: Request) -> Answer:
        asked.append([float(v) for v in request.query["bbox"].split(",")])
        return Answer(200, b'{"data": []}')

    with serve(handler) as base:
        assert (
            list(Mapillary(TOKEN, HttpClient(retries=0), address=base).near(LocalFrame(0.0, 180.0), 300.0, most=3))
            == []
        )
    assert [box[0] < box[2] for box in asked] == [True, True]
    assert {box[2] for box in asked} >= {180.0}
    with pytest.raises(InputError, match="pole"):
        list(Mapillary(TOKEN, HttpClient(retries=0)).near(LocalFrame(90.0, 0.0), 300.0, most=3))


def test_panoramas_are_cut_into_photos() -> None:
    def listed(request: Request) -> Answer:
        rows = [
            entry(1, base, camera_type="spherical", is_pano=True, camera_parameters=[]),
            entry(2, base, camera_type="equirectangular", camera_parameters=[]),
        ]
        return Answer(200, json.dumps({"data": rows}).encode())

    def picture(path: str) -> Answer:
        packed = io.BytesIO()
        Image.new("RGB", (160, 60 if path.endswith("/2.jpg") else 80), (200, 100, 50)).save(packed, "JPEG")
        return Answer(200, packed.getvalue())

    with serve(mapillary(listed, picture)) as base:
        source = Mapillary(TOKEN, HttpClient(retries=0), address=base)
        photos = list(source.near(HERE, 100.0, most=9))
    assert [photo.id for photo in photos] == ["1/0", "1/60", "1/120", "1/180", "1/240", "1/300"]
    assert all(photo.intrinsics[0, 0] == pytest.approx(160 / (2 * np.pi)) for photo in photos)
    assert [key for key, reason in source.refused if "no whole panorama" in reason] == ["2"]


def test_the_documented_shape_of_an_answer_is_read(shared_data: Path) -> None:
    answer = (shared_data / "samples" / "mapillary_images_bbox.json").read_bytes()
    images, broken, after = images_in(answer, "sample")
    assert [image.id for image in images] == ["100000000000001"]
    assert broken == []
    assert after is None
    assert images[0].whole
    assert images[0].unusable() is None


def test_a_source_needs_its_key() -> None:
    with pytest.raises(InputError, match="MAPILLARY_TOKEN"):
        Mapillary(" ", HttpClient())
    with pytest.raises(InputError, match="GOOGLE_MAPS_API_KEY"):
        GoogleStreetView("", HttpClient())


def google(request: Request) -> Answer:
    assert request.query["key"] == KEY
    if request.path == "/metadata":
        assert request.query["source"] == "outdoor"
        lat, lon = map(float, request.query["location"].split(","))
        if lon > 24.9437:
            return Answer(200, b'{"status": "ZERO_RESULTS"}')
        where = {"lat": lat, "lng": lon}
        body = {"copyright": "© Google", "date": "2023-06", "location": where, "pano_id": f"P{lat:.4f}", "status": "OK"}
        return Answer(200, json.dumps(body).encode())
    assert request.path == ""
    assert request.query["return_error_code"] == "true"
    return Answer(404) if request.query["heading"] == "180" else Answer(200, jpeg(640, 640))


def test_google_views_are_cut_at_headings_and_nothing_is_kept(tmp_path: Path) -> None:
    with serve(lambda r: google(Request(r.method, r.path.rstrip("/"), r.query, r.headers, r.body))) as base:
        points = np.array([[0.0, 0.0], [0.0, 40.0], [60.0, 0.0]])
        source = GoogleStreetView(KEY, HttpClient(cache=tmp_path / "cache", retries=0), points=points, address=base)
        photos = list(source.near(HERE, 100.0, most=9))
    assert [p.id.split("@")[1] for p in photos] == ["0", "90", "270"] * 2
    assert not (tmp_path / "cache").exists()
    assert not source.may_be_kept
    assert [name for name, _ in source.refused] == ["P60.1690@180", "P60.1694@180"]
    assert KEY not in str(source.refused)
    assert photos[1].rotation == pytest.approx(camera_rotation(90.0, 12.0))
    assert photos[0].intrinsics[0, 0] == pytest.approx(320.0)
    assert photos[0].attribution == "© Google"
    assert photos[0].eye == 2.5


def test_a_refused_google_key_ends_the_search_in_one_sentence() -> None:
    body = b'{"status": "REQUEST_DENIED", "error_message": "The provided API key is invalid."}'
    with serve(lambda _: Answer(200, body)) as base, pytest.raises(SourceError, match="API key is invalid") as told:
        list(GoogleStreetView(KEY, HttpClient(retries=0), address=base).near(HERE, 50.0, most=3))
    assert KEY not in str(told.value)


def test_google_metadata_of_another_shape_is_refused() -> None:
    for body in (b"<html>", b"[]", b"{}", b'{"status": "OK"}', b'{"status": "OK", "location": {"lat": NaN, "lng": 1}}'):
        with serve(lambda _, body=body: Answer(200, body)) as base, pytest.raises(SchemaError):
            list(GoogleStreetView(KEY, HttpClient(retries=0), address=base).near(HERE, 50.0, most=3))
