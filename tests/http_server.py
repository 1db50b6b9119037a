"""A real HTTP server on the loop-back interface, which answers as a test says."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import parse_qsl, urlsplit


@dataclass(frozen=True)
class Request:
    """What was asked; header names are in lower case."""

    method: str
    path: str
    query: dict[str, str]
    headers: dict[str, str]
    body: bytes


@dataclass(frozen=True)
class Answer:
    """What is answered. Without a ``Content-Length`` of its own the true one is sent; `cut` breaks off after it."""

    status: int = 200
    body: bytes = b""
    headers: Mapping[str, str] = field(default_factory=dict)
    cut: int | None = None


@contextmanager
def serve(handler: Callable[[Request], Answer]) -> Iterator[str]:
    """Serve on a free port of 127.0.0.1; gives the base address, without a slash at its end.

    An exception in `handler` is answered as 599 and raised again when the server is left.
    """
    faults: list[BaseException] = []

    class Handler(BaseHTTPRequestHandler):
        timeout = 20

        def _serve(self) -> None:
            parts = urlsplit(self.path)
            length = int(self.headers.get("Content-Length") or 0)
            request = Request(
                self.command,
                parts.path,
                dict(parse_qsl(parts.query, keep_blank_values=True)),
                {name.lower(): value for name, value in self.headers.items()},
                self.rfile.read(length),
            )
            try:
                answer = handler(request)
            except BaseException as fault:
                faults.append(fault)
                answer = Answer(599, b"the test's handler failed")
            body = answer.body if answer.cut is None else answer.body[: answer.cut]
            try:
                names = {name.lower() for name in answer.headers}
                self.send_response_only(answer.status)
                if "date" not in names:
                    self.send_header("Date", self.date_time_string())
                for name, value in answer.headers.items():
                    self.send_header(name, value)
                if not names & {"content-length", "transfer-encoding"}:
                    self.send_header("Content-Length", str(len(answer.body)))
                self.send_header("Connection", "close")
                self.end_headers()
                self.wfile.write(body)
            except OSError:
                pass  # the client hung up, as some tests want it to
            self.close_connection = True

        do_GET = do_POST = do_HEAD = do_PUT = _serve

        def log_message(self, format: str, *args: object) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.daemon_threads = True
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_address[1]}"
    finally:
        server.shutdown()
        thread.join()
        server.server_close()
    if faults:
        raise faults[0]
