"""Asking an Overpass server: a local one that answers what is asked, and one that fails in every way we know."""

import contextlib
import json
import re
from collections.abc import Callable
from importlib import resources
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs

import osmium
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from http_server import Answer, Request, serve
from vico.errors import EmptyInputError, InputError, SourceError
from vico.geo import overpass as module
from vico.geo.frame import LocalFrame
from vico.geo.osm import OsmData, read_osm
from vico.geo.overpass import Overpass, parse_answer, quarters, query, seconds_to_a_slot

PLACE = Path(str(resources.files("vico") / "data" / "helsinki.osm.pbf"))
LAT, LON, HALF = 60.1690, 24.9435, 70.0
STATUS = Answer(body=b"Connected as: 1\nRate limit: 2\n2 slots available now.\nCurrently running queries:\n")
QUERY = re.compile(
    r"\[out:json\]\[timeout:180\]\[maxsize:536870912\];\((?P<boxes>(node\([^)]*\);)+)\)->\.near;\((way\([^)]*\);)+\)"
    r'->\.crossing;\((rel\([^)]*\);)+\)->\.relations;rel\.relations\["type"="multipolygon"\]->\.areas;way\(r\.areas\)'
    r"->\.rings;\(\.crossing;\.rings;\)->\.ways;node\(w\.ways\)->\.corners;"
    r"\(\.near;\.corners;\.ways;\.relations;\);out body;"
)


class Server:
    """The part of Overpass that our query needs, over the elements of an extract.

    `trouble` sees each query's area (square degrees) and number first, and may answer in the server's place.
    """

    def __init__(self, elements: list[dict[str, Any]]) -> None:
        self.elements = elements
        self.nodes = {e["id"]: e for e in elements if e["type"] == "node"}
        self.ways = {e["id"]: e for e in elements if e["type"] == "way"}
        self.relations = [e for e in elements if e["type"] == "relation"]
        self.lines = {
            number: shapely.LineString([(self.nodes[n]["lon"], self.nodes[n]["lat"]) for n in way["nodes"]])
            for number, way in self.ways.items()
            if len(way["nodes"]) > 1 and all(n in self.nodes for n in way["nodes"])
        }
        self.trouble: Callable[[float, int], Answer | None] = lambda area, number: None
        self.status = STATUS
        self.queries = 0

    def __call__(self, request: Request) -> Answer:
        if request.path == "/api/status":
            return self.status
        assert (request.method, request.path) == ("POST", "/api/interpreter")
        assert request.headers["user-agent"].startswith("virtual-community/")
        (asked,) = parse_qs(request.body.decode())["data"]
        found = QUERY.fullmatch(asked)
        assert found is not None, asked
        boxes = [tuple(map(float, b.split(","))) for b in re.findall(r"node\(([^)]*)\)", found["boxes"])]
        self.queries += 1
        area = sum((n - s) * (e - w) for s, w, n, e in boxes)
        return self.trouble(area, self.queries) or answer(self.within(boxes))

    def within(self, boxes: list[tuple[float, ...]]) -> list[dict[str, Any]]:
        near = {
            number
            for number, node in self.nodes.items()
            if any(s <= node["lat"] <= n and w <= node["lon"] <= e for s, w, n, e in boxes)
        }
        square = shapely.union_all([shapely.box(w, s, e, n) for s, w, n, e in boxes])
        crossing = {number for number, line in self.lines.items() if square.intersects(line)}
        kept = {"node": near, "way": crossing}
        relations = [r for r in self.relations if any(m["ref"] in kept.get(m["type"], ()) for m in r["members"])]
        rings = {
            m["ref"]
            for r in relations
            if r.get("tags", {}).get("type") == "multipolygon"
            for m in r["members"]
            if m["type"] == "way" and m["ref"] in self.ways
        }
        ways = crossing | rings
        nodes = near | {n for number in ways for n in self.ways[number]["nodes"] if n in self.nodes}
        return [*(self.nodes[n] for n in sorted(nodes)), *(self.ways[n] for n in sorted(ways)), *relations]


def answer(elements: list[dict[str, Any]], stamp: str = "2019-04-21T10:00:00Z", **more: str) -> Answer:
    content = {"version": 0.6, "generator": "Overpass API", "osm3s": {"timestamp_osm_base": stamp}}
    return Answer(body=json.dumps({**content, "elements": elements, **more}).encode())


def remark(text: str) -> Answer:
    return answer([], remark=f"runtime error: {text}")


@pytest.fixture(scope="module")
def packaged() -> list[dict[str, Any]]:
    elements: list[dict[str, Any]] = []
    word = {"n": "node", "w": "way", "r": "relation"}
    for thing in osmium.FileProcessor(str(PLACE)):
        element: dict[str, Any] = {"id": thing.id, "tags": dict(thing.tags)}
        if thing.is_node():
            element |= {"type": "node", "lat": thing.location.lat, "lon": thing.location.lon}
        elif thing.is_way():
            element |= {"type": "way", "nodes": [node.ref for node in thing.nodes]}
        else:
            members = [{"type": word[m.type], "ref": m.ref, "role": m.role} for m in thing.members]
            element |= {"type": "relation", "members": members}
        elements.append(element)
    return Server(elements).within([(s, w, n, e) for w, s, e, n in LocalFrame(LAT, LON).boxes(250.0)])


@pytest.fixture
def server(packaged: list[dict[str, Any]]) -> Server:
    return Server(packaged)


def overpass(base: str, cache: Path, waits: list[float] | None = None, *, refresh: bool = False) -> Overpass:
    sleep = (lambda _: None) if waits is None else waits.append
    return Overpass(f"{base}/api/interpreter", cache=cache, refresh=refresh, sleep=sleep)


def facts(data: OsmData) -> dict[str, list[Any]]:
    """What a world is made of, comparable; areas that merely lie around the whole window aside."""
    reach = data.half + data.margin
    edge = shapely.box(-reach, -reach, reach, reach)
    return {
        "nodes": [(n.id, n.xy.round(6).tolist(), n.tags) for n in data.nodes],
        "ways": [(w.id, w.nodes, w.line.round(6).tolist(), w.tags) for w in data.ways],
        "areas": [(a.id, a.polygon.wkb, a.tags) for a in data.areas if not a.polygon.contains(edge)],
        "relations": [(r.id, r.members, r.tags) for r in data.relations],
    }


@pytest.fixture(scope="module")
def extract() -> OsmData:
    return read_osm(PLACE, LocalFrame(LAT, LON), HALF)


def test_the_map_from_the_server_is_the_map_from_the_extract(server: Server, extract: OsmData, tmp_path: Path) -> None:
    with serve(server) as base:
        path = overpass(base, tmp_path).fetch(LAT, LON, HALF)
    data = read_osm(path, LocalFrame(LAT, LON), HALF)
    ours, theirs = facts(data), facts(extract)
    assert {kind: len(v) for kind, v in ours.items()} == {kind: len(v) for kind, v in theirs.items()}
    assert ours == theirs
    assert sum("building" in tags for _, _, tags in ours["areas"]) > 5
    assert data.timestamp == "2019-04-21T10:00:00Z"


def test_a_kept_extract_is_not_asked_for_again_and_is_the_same_to_the_byte(server: Server, tmp_path: Path) -> None:
    with serve(server) as base:
        first = overpass(base, tmp_path).fetch(LAT, LON, HALF)
        content = first.read_bytes()
        assert overpass(base, tmp_path).fetch(LAT, LON, HALF) == first
        assert server.queries == 1
        assert overpass(base, tmp_path, refresh=True).fetch(LAT, LON, HALF) == first
        assert server.queries == 2
    assert first.read_bytes() == content
    assert [p.name for p in tmp_path.iterdir()] == [first.name]


@pytest.mark.parametrize(
    "words", ['Query timed out in "query" at line 3 after 181 seconds.', "Query run out of memory"]
)
def test_too_large_an_area_is_asked_for_in_quarters(server: Server, tmp_path: Path, words: str) -> None:
    whole: list[float] = []

    def trouble(area: float, number: int) -> Answer | None:
        whole.append(area)
        return remark(words) if area > whole[0] / 3 else None

    with serve(server) as base:
        plain = overpass(base, tmp_path / "a").fetch(LAT, LON, HALF)
        server.trouble = trouble
        server.queries = 0
        pieces = overpass(base, tmp_path / "b").fetch(LAT, LON, HALF)
    assert server.queries == 5
    frame = LocalFrame(LAT, LON)
    assert facts(read_osm(pieces, frame, HALF)) == facts(read_osm(plain, frame, HALF))
    ids = [(type(e).__name__, e.id) for e in osmium.FileProcessor(str(pieces))]
    assert len(ids) == len(set(ids))


def test_an_area_that_is_too_much_in_any_size_is_given_up(server: Server, tmp_path: Path) -> None:
    server.trouble = lambda area, number: remark("Query run out of memory using about 512 MB of RAM.")
    with serve(server) as base, pytest.raises(SourceError, match="smaller radius"):
        overpass(base, tmp_path).fetch(LAT, LON, HALF)
    assert server.queries == 4
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("status", [429, 504])
def test_a_busy_server_is_waited_for(server: Server, tmp_path: Path, status: int) -> None:
    waits: list[float] = []
    page = b"<html><head><title>OSM3S Response</title></head><body>Dispatcher: too busy</body></html>"
    server.trouble = lambda area, number: Answer(status, page) if number < 4 else None
    with serve(server) as base:
        overpass(base, tmp_path, waits).fetch(LAT, LON, HALF)
    assert server.queries == 4
    assert {1.0, 2.0, 4.0} <= set(waits)


@pytest.mark.parametrize(
    "bad",
    [
        Answer(body=b"<html><body>The server is probably too busy to handle your request.</body></html>"),
        remark("open64: 0 Success /osm3s_osm_base Dispatcher_Client::request_read_and_idx::timeout"),
        Answer(body=answer([{"type": "node", "id": 1, "lat": 0, "lon": 0}]).body[:-9]),
    ],
)
def test_an_answer_that_is_none_is_asked_for_again_and_never_kept(
    server: Server, extract: OsmData, tmp_path: Path, bad: Answer
) -> None:
    server.trouble = lambda area, number: bad if number < 3 else None
    with serve(server) as base:
        path = overpass(base, tmp_path / "a").fetch(LAT, LON, HALF)
        assert server.queries == 3
        server.trouble = lambda area, number: bad
        with pytest.raises(SourceError, match="4 times"):
            overpass(base, tmp_path / "b").fetch(LAT, LON, HALF)
    assert facts(read_osm(path, LocalFrame(LAT, LON), HALF)) == facts(extract)
    assert not (tmp_path / "b").exists()


@pytest.mark.parametrize(
    ("bad", "words"),
    [
        (Answer(400, b"<html><body><p>Error: line 1: parse error</p></body></html>"), "parse error"),
        (Answer(body=b"<html><body>Welcome to Apache</body></html>"), "Welcome to Apache"),
        (Answer(body=b"[1]"), "no map data"),
        (remark("Something else"), "Something else"),
        (answer([{"type": "node", "id": 1}]), "node 1 has no usable lat"),
        (answer([{"type": "way", "id": 5, "nodes": ["x"]}]), "way 5 has no list"),
        (answer([{"type": "node", "id": 1, "lat": 1, "lon": 1, "tags": {"a": "b" * 5000}}]), "can't be written"),
        (Answer(body=b'{"elements": [], "osm3s": {}}'), "timestamp_osm_base"),
        (Answer(404), "404"),
    ],
)
def test_other_answers_are_one_sentence(server: Server, tmp_path: Path, bad: Answer, words: str) -> None:
    server.trouble = lambda area, number: bad
    with serve(server) as base, pytest.raises(SourceError, match=re.escape(words)) as caught:
        overpass(base, tmp_path).fetch(LAT, LON, HALF)
    assert "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_the_sea_is_no_place(server: Server, tmp_path: Path) -> None:
    with serve(server) as base, pytest.raises(EmptyInputError, match="nothing is mapped"):
        overpass(base, tmp_path).fetch(0.0, -30.0, 100.0)


def test_a_taken_slot_is_waited_for_by_the_status_page(server: Server, tmp_path: Path) -> None:
    waits: list[float] = []
    page = b"Rate limit: 2\n" + b"".join(b"Slot available after: then, in %d seconds.\n" % n for n in (9, 4))
    asked: list[str] = []

    def handler(request: Request) -> Answer:
        asked.append(request.path)
        server.status = Answer(body=page) if len(asked) == 1 else STATUS
        return server(request)

    with serve(handler) as base:
        overpass(base, tmp_path, waits).fetch(LAT, LON, HALF)
    assert 5.0 in waits
    assert asked == ["/api/status", "/api/status", "/api/interpreter"]


@pytest.mark.parametrize(
    ("page", "seconds"),
    [
        ("Rate limit: 0\n", 0.0),
        ("1 slots available now.", 0.0),
        ("0 slots available now.\nSlot available after: x, in -3 seconds.", 1.0),
        ("<html>", 0.0),
    ],
)
def test_what_a_status_page_means(page: str, seconds: float) -> None:
    assert seconds_to_a_slot(page) == seconds


def test_the_server_is_chosen_by_the_environment(
    server: Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with serve(server) as base:
        monkeypatch.setenv("VICO_OVERPASS", f"{base}/api/")
        monkeypatch.setenv("VICO_CACHE", str(tmp_path))
        path = Overpass(sleep=lambda _: None).fetch(LAT, LON, HALF)
    assert path.parent == tmp_path / "maps"


def test_a_square_over_the_date_line_is_two_boxes(tmp_path: Path) -> None:
    home = [
        {"type": "node", "id": k, "lat": lat, "lon": lon}
        for k, (lat, lon) in enumerate([(-16.8, 179.9998), (-16.8, -179.9998), (-16.7999, -179.9998)], 1)
    ]
    home.append({"type": "way", "id": 9, "nodes": [1, 2, 3, 1], "tags": {"building": "yes"}})
    with serve(Server(home)) as base:
        path = overpass(base, tmp_path).fetch(-16.8, 180.0, 100.0)
    (area,) = read_osm(path, LocalFrame(-16.8, 180.0), 100.0).areas
    # 0.0004 degrees of longitude at 16.8 degrees south, times 0.0001 of latitude, halved.
    assert area.polygon.area == pytest.approx(0.5 * 0.0004 * 106606 * 0.0001 * 110665, rel=0.01)


def test_too_much_at_once_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="planet extract"):
        Overpass(cache=tmp_path).fetch(LAT, LON, 50_000.0)


def test_quarters_leave_no_gap() -> None:
    boxes = quarters((24.9, 60.1, 24.9000003, 60.2))
    assert shapely.union_all([shapely.box(*box) for box in boxes]).equals(shapely.box(24.9, 60.1, 24.9000003, 60.2))
    assert "(60.1,24.9," in query(boxes[:1])


@pytest.mark.parametrize("name", [pytest.param("helsinki", marks=pytest.mark.slow), "monaco"])
def test_the_derived_answers_are_the_extracts_they_were_made_from(name: str, shared_data: Path, tmp_path: Path) -> None:
    content = (shared_data / "samples" / f"overpass_{name}_800m_derived.json").read_bytes()
    lat, lon = {"helsinki": (60.1690, 24.9435), "monaco": (43.73384, 7.41813)}[name]
    with serve(lambda request: STATUS if "status" in request.path else Answer(body=content)) as base:
        path = overpass(base, tmp_path).fetch(lat, lon, 100.0)
    frame = LocalFrame(lat, lon)
    ours = read_osm(path, frame, 100.0)
    theirs = read_osm(shared_data / "places" / name / f"{name}.osm.pbf", frame, 100.0)
    assert [n.id for n in ours.nodes] == [n.id for n in theirs.nodes]
    assert [(w.id, w.tags, w.line.tolist()) for w in ours.ways] == [
        (w.id, w.tags, w.line.tolist()) for w in theirs.ways
    ]
    houses = [[(a.id, a.tags, a.polygon.wkb) for a in d.areas if "building" in a.tags] for d in (ours, theirs)]
    assert houses[0] == houses[1]
    assert len(houses[0]) > 20


@pytest.mark.parametrize("name", ["mapquery", "outgeom", "relation"])
def test_real_answers_are_read(name: str, shared_data: Path) -> None:
    found = parse_answer((shared_data / "samples" / f"overpass_{name}_real.json").read_bytes())
    assert len(found.elements) == {"mapquery": 435, "outgeom": 3, "relation": 1}[name]


GOOD = answer(
    [{"type": "node", "id": 1, "lat": 1.5, "lon": 2, "tags": {"a": "b"}}, {"type": "way", "id": 2, "nodes": [1]}]
)


@given(st.binary(max_size=60), st.integers(0, len(GOOD.body)), st.integers(0, 30))
@settings(max_examples=150, deadline=None)
def test_noise_in_an_answer_is_one_of_our_errors(noise: bytes, at: int, cut: int) -> None:
    refusals = (InputError, module._BusyError, module._TooMuchError)
    with contextlib.suppress(*refusals):
        assert all("id" in element for element in parse_answer(GOOD.body[:at] + noise + GOOD.body[at + cut :]).elements)
