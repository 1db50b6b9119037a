"""Pages of others, in the same browser, with the cookie there: the server answers none of them."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

from vico.viewer.headless import BrowserPage, open_page
from viewer_client import address_of


class _Stranger(BaseHTTPRequestHandler):
    def do_GET(self) -> None:
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.end_headers()
        self.wfile.write(b"<!doctype html><title>stranger</title>")

    def log_message(self, format: str, *args: object) -> None:
        """Say nothing."""


@contextmanager
def _stranger() -> Iterator[str]:
    with ThreadingHTTPServer(("127.0.0.1", 0), _Stranger) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/"
        server.shutdown()


@pytest.fixture(scope="module")
def visited(address: str) -> Iterator[BrowserPage]:
    """A browser that has opened the page, and so has its cookie."""
    with open_page() as page:
        page.go_to(address)
        page.wait_for("window.vico && vico.source.connected", seconds=90)
        yield page


def _socket(port: int) -> str:
    return f"""new Promise((told) => {{ const s = new WebSocket("ws://127.0.0.1:{port}/stream");
      s.onopen = () => told("opened"); s.onmessage = () => told("opened"); s.onerror = () => told("refused"); }})"""


def test_a_foreign_origin_is_refused_although_it_has_the_cookie(visited: BrowserPage, address: str) -> None:
    port = address_of(address).port
    assert visited.evaluate(_socket(port)) == "opened"
    with _stranger() as stranger:
        visited.go_to(stranger)
        visited.wait_for("document.title === 'stranger'")
        # The browser sends the cookie: ports are of one site.
        assert visited.evaluate(_socket(port)) == "refused"
        read = f"""fetch("http://127.0.0.1:{port}/api/run", {{ credentials: "include" }})
          .then((a) => a.text(), () => "refused")"""
        assert visited.evaluate(read) == "refused"
        framed = f"""new Promise((told) => {{ const f = document.createElement("iframe");
          f.src = "http://127.0.0.1:{port}/"; f.onload = () => {{
            try {{ told(f.contentDocument?.body?.innerText ?? "hidden"); }} catch {{ told("hidden"); }} }};
          document.body.append(f); }})"""
        assert visited.evaluate(framed) == "hidden"


def test_a_foreign_host_is_refused_with_the_token_too(visited: BrowserPage, address: str) -> None:
    # Browsers know of themselves that names below localhost are this machine.
    visited.go_to(address.replace("127.0.0.1", "stranger.localhost"))
    assert visited.evaluate("location.hostname") == "stranger.localhost"
    assert visited.evaluate("Boolean(window.vico)") is False
    assert "answers to 127.0.0.1" in visited.evaluate("document.body.innerText")


def test_whoever_has_the_cookie_still_gets_in(visited: BrowserPage, address: str) -> None:
    visited.go_to(address.partition("?")[0])
    visited.wait_for("window.vico && vico.source.connected", seconds=60)
