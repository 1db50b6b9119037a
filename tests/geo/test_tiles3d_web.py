"""Tilesets on servers, Google's protocol among them: keys, sessions, failures, and nothing kept."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from http_server import Answer, Request, serve
from tile_files import at_place, box, ecef, enu_axes, glb, square
from vico.errors import InputError, SchemaError, SourceError
from vico.geo.frame import LocalFrame
from vico.geo.tiles3d import read_tileset
from vico.geo.tiles3d_files import GOOGLE_KEY, tile_source
from vico.io.http import HttpClient

FRAME = LocalFrame(60.169, 24.9435)
KEY, SESSION = "AIza-not-a-key", "CJ2-not-a-session"


def google_tile(x: float, y: float, credit: str) -> bytes:
    """A tile as Google's are: earth-centred, the place in the node's matrix."""
    points, triangles = square(x, y, 5.0, 60.0)
    cx, cy, cz = ecef(60.169, 24.9435, 0.0)
    turned = points @ enu_axes(60.169, 24.9435).T
    return glb(turned, triangles, matrix=[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, cx, cz, -cy, 1], copyright=credit)


def around(size: float) -> dict[str, Any]:
    cx, cy, cz = ecef(60.169, 24.9435, 0.0)
    return {"box": [cx, cy, cz, size, 0, 0, 0, size, 0, 0, 0, size]}


class Google:
    """Google's side: what it checks and what it answers."""

    def __init__(self) -> None:
        self.asked: list[str] = []
        self.broken: dict[str, Answer] = {}

    def __call__(self, request: Request) -> Answer:
        self.asked.append(request.path)
        if request.query.get("key") != KEY:
            return Answer(403, b'{"error": {"message": "Permission denied"}}')
        if request.path != "/v1/3dtiles/root.json" and request.query.get("session") != SESSION:
            return Answer(400, b'{"error": {"message": "Invalid session"}}')
        if request.path in self.broken:
            return self.broken[request.path]
        files = "/v1/3dtiles/datasets/CgA/files/"
        answers: dict[str, Any] = {
            "/v1/3dtiles/root.json": {
                "asset": {"version": "1.0"},
                "geometricError": 1e6,
                "root": {
                    "boundingVolume": {"box": [0, 0, 0, 7e6, 0, 0, 0, 7e6, 0, 0, 0, 7e6]},
                    "geometricError": 1e6,
                    "refine": "REPLACE",
                    "children": [
                        {
                            "boundingVolume": around(500),
                            "geometricError": 1e3,
                            "content": {"uri": f"{files}UlRP.json?session={SESSION}"},
                        }
                    ],
                },
            },
            f"{files}UlRP.json": {
                "asset": {"version": "1.0"},
                "geometricError": 64,
                "root": {
                    "boundingVolume": around(500),
                    "geometricError": 64,
                    "refine": "REPLACE",
                    "content": {"uri": f"{files}coarse.glb"},
                    "children": [
                        {"boundingVolume": around(400), "geometricError": 2, "content": {"uri": f"{files}{k}.glb"}}
                        for k in range(3)
                    ],
                },
            },
        }
        if request.path in answers:
            return Answer(200, json.dumps(answers[request.path]).encode(), {"Cache-Control": "private"})
        tiles = {
            "coarse.glb": google_tile(0, 0, "Google"),
            "0.glb": google_tile(-60, 0, "Google;Maxar"),
            "1.glb": google_tile(0, 0, "Google;Airbus;Maxar"),
            "2.glb": google_tile(60, 0, "Google"),
        }
        return Answer(200, tiles[request.path.rpartition("/")[2]])


def test_key_and_session_are_repeated_and_credits_gathered(tmp_path: Path) -> None:
    google = Google()
    with serve(google) as base:
        web = HttpClient(cache=tmp_path / "cache", retries=0)
        mesh, report = read_tileset(
            tile_source(f"{base}/v1/3dtiles/root.json", web=web, key=KEY), FRAME, 200.0, error=4.0
        )
    assert report.read == 3
    assert report.left_out == ()
    assert len(mesh.triangles) == 6
    assert np.abs(mesh.positions[:, 2] - 5.0).max() < 1e-2
    assert mesh.attributions == ("Google", "Maxar", "Airbus")
    assert not any(path.endswith("coarse.glb") for path in google.asked)


def test_nothing_of_googles_is_kept(tmp_path: Path) -> None:
    with serve(Google()) as base:
        read_tileset(
            tile_source(f"{base}/v1/3dtiles/root.json", web=HttpClient(cache=tmp_path / "cache", retries=0), key=KEY),
            FRAME,
            200.0,
        )
    assert list(tmp_path.rglob("*")) == []


def test_a_tile_that_fails_is_left_out_and_its_parent_shown_and_no_key_is_told() -> None:
    google = Google()
    google.broken["/v1/3dtiles/datasets/CgA/files/1.glb"] = Answer(404, f"gone: {KEY} {SESSION}".encode())
    with serve(google) as base:
        mesh, report = read_tileset(
            tile_source(f"{base}/v1/3dtiles/root.json?key={KEY}", web=HttpClient(retries=0)), FRAME, 200.0
        )
    assert len(mesh.triangles) == 2
    assert mesh.attributions == ("Google",)
    assert [name for name, _ in report.left_out] == ["/v1/3dtiles/datasets/CgA/files/1.glb"]
    assert "404" in report.left_out[0][1]
    assert KEY not in str(report)
    assert SESSION not in str(report)


def test_a_silent_tile_is_left_out() -> None:
    google = Google()
    path = "/v1/3dtiles/datasets/CgA/files/0.glb"
    google.broken[path] = Answer(200, b"x" * 64, {"Content-Length": "1000"}, cut=10)
    with serve(google) as base:
        _, report = read_tileset(
            tile_source(f"{base}/v1/3dtiles/root.json", web=HttpClient(retries=0, timeout=1.0), key=KEY), FRAME, 200.0
        )
    assert report.read == 1
    assert report.left_out[0][0] == path


def test_a_wrong_key_ends_in_a_sentence_without_it() -> None:
    with serve(Google()) as base, pytest.raises(SourceError, match="check the key") as caught:
        read_tileset(
            tile_source(f"{base}/v1/3dtiles/root.json", web=HttpClient(retries=0), key="AIza-another"), FRAME, 200.0
        )
    assert "AIza-another" not in str(caught.value)


def test_google_without_a_key_says_where_to_put_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(GOOGLE_KEY, raising=False)
    with pytest.raises(InputError, match=GOOGLE_KEY):
        tile_source("google")


def test_the_key_of_the_environment_goes_to_google_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(GOOGLE_KEY, KEY)
    seen: list[dict[str, str]] = []

    def other(request: Request) -> Answer:
        seen.append(request.query)
        return Answer(404)

    with serve(other) as base, pytest.raises(SourceError):
        read_tileset(tile_source(f"{base}/v1/3dtiles/root.json", web=HttpClient(retries=0)), FRAME, 200.0)
    assert seen == [{}]


def test_an_ordinary_server_is_asked_with_its_own_query_and_kept(tmp_path: Path) -> None:
    place = at_place(60.169, 24.9435)
    root = {
        "transform": place,
        "boundingVolume": box(0, 0, 300),
        "geometricError": 0,
        "content": {"uri": "t/a.glb?v=2"},
    }
    asked: list[tuple[str, dict[str, str]]] = []

    def answer(request: Request) -> Answer:
        asked.append((request.path, request.query))
        if request.path == "/city/tileset.json":
            return Answer(200, json.dumps({"asset": {"version": "1.0"}, "geometricError": 9, "root": root}).encode())
        return Answer(200, glb(*square(0, 0, 5, 40)))

    with serve(answer) as base:
        for _ in range(2):
            web = HttpClient(cache=tmp_path, retries=0)
            mesh, _ = read_tileset(tile_source(f"{base}/city/tileset.json?token=abc", web=web), FRAME, 200.0)
    assert len(mesh.triangles) == 2
    assert asked == [("/city/tileset.json", {"token": "abc"}), ("/city/t/a.glb", {"token": "abc", "v": "2"})]


@pytest.mark.parametrize("uri", ["http://127.0.0.1:9/x.glb", "//example.org/x.glb", "file:///etc/passwd"])
def test_a_tileset_can_not_send_us_to_another_host(uri: str) -> None:
    place = at_place(60.169, 24.9435)
    tiles = [{"boundingVolume": box(0, 0, 300), "geometricError": 0, "content": {"uri": u}} for u in (uri, "a.glb")]
    root = {"transform": place, "boundingVolume": box(0, 0, 300), "geometricError": 9, "children": tiles}

    def answer(request: Request) -> Answer:
        if request.path == "/tileset.json":
            return Answer(200, json.dumps({"asset": {"version": "1.0"}, "geometricError": 9, "root": root}).encode())
        return Answer(200, glb(*square(0, 0, 5, 40)))

    with serve(answer) as base:
        _, report = read_tileset(
            tile_source(f"{base}/tileset.json", web=HttpClient(retries=0)), FRAME, 200.0, error=1.0
        )
    assert report.read == 1
    assert "another host" in report.left_out[0][1]


def test_a_page_instead_of_a_tileset_says_so() -> None:
    with serve(lambda _: Answer(200, b"<html></html>")) as base, pytest.raises(SchemaError, match="no 3D tile"):
        read_tileset(tile_source(f"{base}/tileset.json", web=HttpClient(retries=0)), FRAME, 200.0)
