"""The viewer's server: who is let in, what it answers, and that slow clients hold nobody up."""

from __future__ import annotations

import asyncio
import contextlib
import json
import socket
import threading
import time
from collections.abc import Iterator, Mapping
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import pytest

from live_toy import LiveToy, live_toy
from viewer_client import Stream, address_of, answer, get, get_json, stream

pytest.importorskip("starlette", reason="the extra 'viewer' is not installed: pip install 'virtual-community[viewer]'")

from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from vico.errors import InputError
from vico.runner.control import Control
from vico.runner.loop import Runner
from vico.viewer.server.serve import ViewerServer
from vico.viewer.server.state import Gate, ViewerState
from vico.viewer.sources.frames import NEWEST, OF_RANGE
from vico.viewer.sources.source import Source
from vico.viewer.sources.views import RecordedViews


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recorded run of 70 steps."""
    out = tmp_path_factory.mktemp("runs") / "run"
    with live_toy(out, steps=70) as toy:
        toy.join()
    return out


@pytest.fixture(scope="module")
def url(run: Path) -> Iterator[str]:
    """Where it is shown."""
    with shown(run) as server:
        yield server.url


def shown(run: Path) -> ViewerServer:
    source = Source.of_run(run)
    tables = source.tables.run
    assert tables is not None
    return ViewerServer(ViewerState(source, RecordedViews(tables).view), keep=run)


class _SlowHands:
    """Hands whose replies the test gives."""

    def __init__(self) -> None:
        self.asked = Future[dict[str, Any]]()
        self.came = threading.Event()

    def told(self) -> dict[str, Any]:
        return {"status": "running", "step": 0, "factor": None}

    def command(self, name: str, arguments: Mapping[str, Any]) -> Future[dict[str, Any]]:
        self.came.set()
        return self.asked


def closed(client: Stream) -> bool:
    """Return whether the server closes a connection."""
    try:
        client.until(lambda s: False, 10.0)
    except ConnectionClosed:
        return True
    return False


# Who is let in.


def test_without_the_token_nothing_is_told(url: str) -> None:
    for path in ("/", "/api/run", "/page/main.js", "/three/index.js", "/city/manifest.json", "/stream", "/nothing"):
        status, body, _ = answer(url, path, headers={})
        assert status == 403, path
        assert b"token" in body


def test_a_wrong_token_is_refused_in_the_address_in_the_cookie_and_in_the_header(url: str) -> None:
    port = address_of(url).port
    for headers, path in (
        ({}, "/?token=wrong"),
        ({"Cookie": f"vico_{port}=wrong"}, "/api/run"),
        ({"Cookie": "vico_1=" + address_of(url).token}, "/api/run"),
        ({"Authorization": "Bearer wrong"}, "/api/run"),
        ({"Authorization": "Basic " + address_of(url).token}, "/api/run"),
    ):
        assert answer(url, path, headers=headers)[0] == 403


def test_the_address_gives_a_cookie_that_no_script_and_no_other_site_can_use(url: str) -> None:
    address = address_of(url)
    status, _, headers = answer(url, f"/?token={address.token}", headers={})
    assert status == 303
    assert headers["location"] == "./"
    cookie = headers["set-cookie"]
    assert cookie.startswith(f"vico_{address.port}={address.token};")
    assert "HttpOnly" in cookie
    assert "SameSite=Strict" in cookie
    assert answer(url, "/api/run", headers={"Cookie": cookie.split(";")[0]})[0] == 200


def test_a_foreign_host_or_origin_is_refused_with_the_token_too(url: str) -> None:
    token = {"Authorization": f"Bearer {address_of(url).token}"}
    for headers in ({"Host": "evil.example"}, {"Host": "localhost.evil.example:80"}, {"Host": "0.0.0.0:1"}):
        status, body, _ = answer(url, "/api/run", headers=token | headers)
        assert status == 403
        assert b"--allow-host" in body
    port = address_of(url).port
    for origin in ("http://evil.example", "null", f"https://localhost:{port}", "http://127.0.0.1:1"):
        assert answer(url, "/api/run", headers=token | {"Origin": origin})[0] == 403
    assert answer(url, "/api/run", headers=token | {"Origin": f"http://localhost:{port}"})[0] == 200


def test_the_page_is_reached_through_a_forwarded_port(url: str) -> None:
    token = {"Authorization": f"Bearer {address_of(url).token}"}
    for host in ("localhost:9000", "127.0.0.1", "LOCALHOST:8123", "[::1]:8123"):
        assert answer(url, "/api/run", headers={"Host": host})[0] == 403  # the token is asked for
        own = {"Host": host, "Origin": f"http://{host}"}
        assert answer(url, "/api/run", headers=token | own)[0] == 200
        assert answer(url, "/api/run", headers=token | own | {"Origin": "http://localhost:9001"})[0] == 403


def test_a_named_host_is_let_in_and_no_other() -> None:
    hub = Gate(nothing, port=8123, token="t", hosts=("Hub.Example.org", "name-8123.app.github.dev"))
    for host, origin, status in (
        ("hub.example.org", "https://hub.example.org", 200),
        ("localhost:8123", "https://name-8123.app.github.dev", 200),
        ("hub.example.org:8443", "https://evil.example", 403),
        ("evil.example", "https://evil.example", 403),
    ):
        headers = {"host": host, "origin": origin, "authorization": "Bearer t"}
        assert asyncio.run(first_message(hub, headers))["status"] == status
    answered = asyncio.run(first_message(hub, {"host": "hub.example.org", "authorization": "Bearer t"}))
    assert b"wss://hub.example.org" in dict(answered["headers"])[b"content-security-policy"]


@pytest.mark.parametrize("name", ["https://hub.example.org", "*", "*.example.org", "", "a b"])
def test_what_is_no_name_of_a_host_is_refused(name: str) -> None:
    with pytest.raises(InputError, match="--allow-host"):
        Gate(nothing, port=1, token="t", hosts=(name,))


async def nothing(scope: Any, receive: Any, send: Any) -> None:
    """An application that answers everything with nothing."""
    await send({"type": "http.response.start", "status": 200, "headers": []})
    await send({"type": "http.response.body", "body": b""})


async def first_message(gate: Gate, headers: dict[str, str]) -> dict[str, Any]:
    scope = {"type": "http", "method": "GET", "path": "/api/run", "query_string": b""}
    pairs = [(name.encode(), value.encode()) for name, value in headers.items()]
    sent: list[Any] = []

    async def send(message: Any) -> None:
        sent.append(message)

    await gate(scope | {"headers": pairs}, None, send)
    return dict(sent[0])


def test_a_websocket_of_another_site_is_refused_before_it_opens(url: str) -> None:
    address = address_of(url)
    place, cookie = f"ws://127.0.0.1:{address.port}/stream", {"Cookie": f"vico_{address.port}={address.token}"}
    for options in (
        {"origin": "http://evil.example", "additional_headers": cookie},
        {"additional_headers": cookie},
        {"origin": f"http://127.0.0.1:{address.port}"},
    ):
        with pytest.raises(InvalidStatus, match="403"):
            connect(place, **options)  # type: ignore[arg-type]
    with connect(place, origin=f"http://127.0.0.1:{address.port}", additional_headers=cookie) as socket:  # type: ignore[arg-type]
        assert json.loads(socket.recv(timeout=10))["type"] == "hello"


def test_nothing_can_be_sent_to_it_and_nothing_outside_its_folders_is_read(url: str) -> None:
    token = {"Authorization": f"Bearer {address_of(url).token}"}
    for method in ("POST", "PUT", "DELETE", "OPTIONS"):
        assert answer(url, "/api/run", headers=token, method=method)[0] == 403
    for path in ("/page/../../version.py", "/page/%2e%2e/%2e%2e/version.py", "/page//etc/passwd", "/city/../run.json"):
        assert answer(url, path, headers=token)[0] == 404


def test_every_answer_forbids_remote_sources(url: str) -> None:
    token = {"Authorization": f"Bearer {address_of(url).token}"}
    for headers, path in ((token, "/api/run"), ({}, "/api/run"), (token, "/nothing")):
        policy = answer(url, path, headers=headers)[2]["content-security-policy"]
        assert "default-src 'self'" in policy
        assert "frame-ancestors 'none'" in policy
        assert "https:" not in policy
        assert "*" not in policy


def test_it_listens_on_this_machine_alone(url: str) -> None:
    others = {info[4][0] for info in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)} - {"127.0.0.1"}
    for address in others:
        with socket.socket() as other:
            other.settimeout(2.0)
            assert other.connect_ex((address, address_of(url).port)) != 0


# What it answers.


def test_bad_questions_are_answered_with_a_sentence(url: str) -> None:
    token = {"Authorization": f"Bearer {address_of(url).token}"}
    for path, status in (
        ("/api/moment?step=999", 400),
        ("/api/moment?step=x", 400),
        ("/api/moment?step=1&agent=nobody", 400),
        ("/api/frames?first=9&last=3", 400),
        ("/api/events?limit=1000000", 400),
        ("/api/view?agent=nobody&step=3", 404),
        ("/api/view?agent=resident_0&step=3&output=thoughts", 404),
        ("/api/person/5.bin", 404),
    ):
        if "person" in path:
            continue
        code, body, _ = answer(url, path, headers=token)
        assert code == status, path
        assert json.loads(body)["error"]


def test_frames_come_over_http_each_after_its_length(url: str) -> None:
    content = get(url, "/api/frames?first=3&last=9&every=3")
    sizes = []
    while content:
        size = int.from_bytes(content[:4], "little")
        sizes.append(size)
        content = content[4 + size :]
    assert len(sizes) == 3


def test_a_range_comes_frame_by_frame_and_ends_with_a_word(url: str) -> None:
    with stream(url) as client:
        client.send(type="range", id=4, first=0, last=70, every=10)
        end = client.until(lambda s: s.last("range_end"))
        assert end == {"type": "range_end", "id": 4, "sent": 8}
        assert [frame.step for frame, _, _ in client.frames] == list(range(0, 71, 10))
        assert {(flags, number) for _, flags, number in client.frames} == {(OF_RANGE, 4)}
        client.send(type="range", id=5, first=60, last=600)
        assert "0 to 70" in client.until(lambda s: s.last("range_end") != end and s.last("range_end"))["error"]


def test_a_recording_takes_no_commands(url: str) -> None:
    with stream(url) as client:
        reply = client.command("pause")
        assert not reply["ok"]
        assert "recording" in reply["error"]


@pytest.mark.parametrize(
    "message",
    [
        "",
        "{",
        "[]",
        '{"type": "nonsense"}',
        '{"type": "range", "id": -1}',
        '{"type": "follow", "rate": "x"}',
        "x" * 20_000,
    ],
)
def test_nonsense_closes_the_connection(url: str, message: str) -> None:
    with stream(url) as client:
        client.socket.send(message)
        assert closed(client)


def test_a_flood_of_messages_closes_the_connection(url: str) -> None:
    with stream(url) as client:
        with contextlib.suppress(ConnectionClosed):
            for k in range(2000):
                client.send(type="ping", id=k)
        assert closed(client)


def test_after_a_restart_the_page_is_where_it_was(run: Path) -> None:
    with shown(run) as first:
        before = first.url
    with shown(run) as second:
        assert second.url == before
        assert get_json(second.url, "/api/run")["run"]["last"] == 70
    assert (run / "viewer.json").stat().st_mode & 0o077 == 0


# A run that goes on.


@pytest.fixture
def toy(tmp_path: Path) -> Iterator[LiveToy]:
    """A run that goes on as fast as it can."""
    with live_toy(tmp_path / "run", control=Control(tmp_path / "run", speed=50.0)) as toy:
        yield toy


def test_a_step_without_a_picture_is_no_fault_of_the_page(toy: LiveToy) -> None:
    with stream(toy.url) as client:
        client.send(type="follow", rate=10)
        client.until(lambda s: s.frames)
    told = json.loads(get(toy.url, "/api/view?agent=resident_0&step=0"))
    assert told["picture"] is None
    assert told["reason"]


def test_how_somebody_is_can_be_told_while_the_run_is_busy(toy: LiveToy) -> None:
    busy, done = threading.Event(), threading.Event()

    def wait(runner: Runner) -> None:
        busy.set()
        done.wait(20)

    toy.control.ask(wait)
    assert busy.wait(10)
    try:
        told = json.loads(get(toy.url, f"/api/moment?step={toy.viewer.source.last}&agent=resident_0"))
    finally:
        done.set()
    assert told["agents"]["resident_0"]["plan"] is None


def test_who_follows_gets_what_is_new_at_its_rate(toy: LiveToy) -> None:
    with stream(toy.url) as client:
        client.send(type="follow", rate=10)
        began = time.monotonic()
        client.until(lambda s: len(s.frames) >= 12)
        assert time.monotonic() - began > 0.8
        steps = [frame.step for frame, flags, _ in client.frames if flags == NEWEST]
        assert steps == sorted(set(steps))
        assert client.until(lambda s: s.last("metrics"))["step"] > 0
        assert client.until(lambda s: s.last("control"))["status"] == "running"


def test_steps_go_on_and_older_ones_are_there_while_it_goes_on(toy: LiveToy) -> None:
    with stream(toy.url) as client:
        client.send(type="follow")
        client.until(lambda s: s.frames and s.frames[-1][0].step > 200)
        client.send(type="range", id=1, first=0, last=200, every=20)
        assert client.until(lambda s: s.last("range_end"))["sent"] == 11


def test_a_run_waits_while_no_page_is_open_and_goes_on_when_one_is(tmp_path: Path) -> None:
    with live_toy(tmp_path / "run", control=Control(tmp_path / "run", speed=50.0), idle=0.3) as toy:
        deadline = time.monotonic() + 20.0
        while toy.control.told()["status"] != "paused" and time.monotonic() < deadline:
            time.sleep(0.05)
        held = toy.viewer.source.last
        time.sleep(0.3)
        assert toy.viewer.source.last == held
        with stream(toy.url) as client:
            client.send(type="follow")
            client.until(lambda s: s.frames and s.frames[-1][0].step > held + 20)
        assert not toy.control.paused


def test_a_hundred_clients_that_read_nothing_slow_nothing_down(toy: LiveToy) -> None:
    address = address_of(toy.url)

    async def crowd() -> list[float]:
        import websockets

        headers = {"Authorization": f"Bearer {address.token}"}
        place = f"ws://127.0.0.1:{address.port}/stream"
        options = {"additional_headers": headers, "max_queue": 1, "ping_interval": None}
        idle = [await websockets.connect(place, **options) for _ in range(100)]  # type: ignore[arg-type]
        for one in idle:
            await one.send(json.dumps({"type": "follow", "rate": 60}))
            one.transport.pause_reading()
            await one.send(json.dumps({"type": "range", "id": 1, "first": 0, "last": 20}))
        delays = []
        async with websockets.connect(place, additional_headers=headers) as lively:
            for k in range(10):
                began = time.monotonic()
                await lively.send(json.dumps({"type": "ping", "id": k}))
                while json.loads(await lively.recv())["type"] != "pong":
                    pass
                delays.append(time.monotonic() - began)
                await asyncio.sleep(0.2)
        for one in idle:
            one.transport.abort()
        return delays

    before = toy.sim.metrics.steps
    began = time.monotonic()
    delays = asyncio.run(crowd())
    steps, seconds = toy.sim.metrics.steps - before, time.monotonic() - began
    # At 50 steps a second; on a busy machine some of them. Without bounds it would stand still, or grow.
    assert steps > 5 * seconds
    assert sorted(delays)[len(delays) // 2] < 1.0


def test_when_the_run_is_over_the_page_still_shows_it(tmp_path: Path) -> None:
    with live_toy(tmp_path / "run", steps=10) as toy:
        toy.join()
        assert get_json(toy.url, "/api/run")["control"]["status"] == "ended"
        with stream(toy.url) as client:
            assert client.command("pause")["error"] == "the run has ended"


def test_a_reply_on_its_way_arrives_before_the_server_ends(run: Path) -> None:
    hands, server = _SlowHands(), shown(run)
    server.state.hands = hands
    with contextlib.ExitStack() as still, server:
        client = still.enter_context(stream(server.url))
        client.send(type="command", id=7, command="stop", arguments={})
        assert hands.came.wait(20.0)
        threading.Timer(0.4, hands.asked.set_result, [{"step": 3}]).start()
        server.__exit__(None, None, None)
        assert client.reply(7) == {"type": "reply", "id": 7, "ok": True, "step": 3}
        with pytest.raises(ConnectionClosed) as told:
            client.until(lambda s: False, 10.0)
        assert told.value.rcvd is not None
        assert told.value.rcvd.code == 1001
