"""A server in a thread of its own: it starts, says its address, and ends with whoever started it."""

from __future__ import annotations

import asyncio
import contextlib
import os
import secrets
import socket
import threading
from collections.abc import AsyncIterator, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import uvicorn
from pydantic import ValidationError
from starlette.applications import Starlette
from starlette.routing import WebSocketRoute
from starlette.types import ASGIApp

from vico.errors import OutputError
from vico.io.files import json_bytes, read_json
from vico.sim.recording.schema import VIEWER_ADDRESS
from vico.viewer.server.routes import LONGEST_MESSAGE, Stream, routes
from vico.viewer.server.state import Gate, Hub, ViewerState
from vico.viewer.sources.source import Source
from vico.world.model import Record

#: Where a run's folder keeps the server's port and token.
ADDRESS = VIEWER_ADDRESS

_STARTS_WITHIN, _ENDS_WITHIN = 20.0, 5.0


class Address(Record):
    """Where a server listens, and the token that opens it."""

    port: int
    token: str

    @property
    def url(self) -> str:
        """What to open in a browser."""
        return f"http://127.0.0.1:{self.port}/?token={self.token}"


class ViewerServer:
    """Shows a run to browsers on this machine while its block lasts.

    Parameters
    ----------
    state
        What to show.
    port
        To listen on; 0 takes the one that the run was shown on before, or a free one.
    keep
        Folder that keeps port and token, so that an open page finds the server again after a restart; None keeps
        nothing.
    hosts
        Names of hosts, beside this machine's own, under which a proxy or a forwarded port shows the page.

    Raises
    ------
    InputError
        If one of them is no name.
    OutputError
        If the port is taken.
    """

    def __init__(
        self, state: ViewerState, *, port: int = 0, keep: Path | None = None, hosts: Sequence[str] = ()
    ) -> None:
        self.state, self.hub = state, Hub(state)
        known = None if keep is None else known_address(keep)
        token = known.token if known is not None else secrets.token_urlsafe(24)
        self._socket = _listening_socket(port, 0 if known is None else known.port)
        self.address = Address(port=self._socket.getsockname()[1], token=token)
        if keep is not None:
            _store_address(keep, self.address)
        self._server = uvicorn.Server(
            uvicorn.Config(
                application(state, self.hub, self.address, hosts),
                ws="websockets-sansio",
                ws_max_size=LONGEST_MESSAGE,
                ws_per_message_deflate=False,
                log_config=None,
                access_log=False,
                lifespan="on",
                server_header=False,
                proxy_headers=False,
                limit_concurrency=512,
                timeout_graceful_shutdown=1,
            )
        )
        self._thread = threading.Thread(target=self._run, name="viewer", daemon=True)
        self._failure: BaseException | None = None

    @property
    def url(self) -> str:
        """What to open in a browser."""
        return self.address.url

    def notify(self) -> None:
        """Say that the run has gone on."""
        self.hub.notify()

    def change_source(self, source: Source) -> None:
        """Show another run from here on, and tell all clients so."""
        self.state.source = source
        self.hub.change()

    def __enter__(self) -> Self:
        self._thread.start()
        for _ in range(int(_STARTS_WITHIN / 0.01)):
            if self._server.started or not self._thread.is_alive():
                break
            self._thread.join(0.01)
        if not self._server.started:
            raise OutputError(f"the viewer's server did not start: {self._failure or 'it takes too long'}")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.hub.end()
        self._server.should_exit = True
        self._thread.join(_ENDS_WITHIN)
        self._socket.close()

    def _run(self) -> None:
        try:
            self._server.run(sockets=[self._socket])
        except BaseException as error:
            self._failure = error


def application(state: ViewerState, hub: Hub, address: Address, hosts: Sequence[str] = ()) -> ASGIApp:
    """Return the server as an ASGI application, behind its gate."""

    @contextlib.asynccontextmanager
    async def lifespan(app: Starlette) -> AsyncIterator[None]:
        looking = asyncio.create_task(hub.run())
        try:
            yield
        finally:
            looking.cancel()

    stream = WebSocketRoute("/stream", Stream(hub).serve)
    app: Any = Starlette(routes=[*routes(state), stream], lifespan=lifespan)
    gate: Any = Gate(app, port=address.port, token=address.token, hosts=hosts)
    return gate


def known_address(folder: Path) -> Address | None:
    """Return where a run was shown last; None if it never was."""
    path = folder / ADDRESS
    if not path.exists():
        return None
    try:
        return Address.model_validate(read_json(path))
    except (ValidationError, ValueError):
        return None  # it is made anew


def _store_address(folder: Path, address: Address) -> None:
    """Keep an address where its owner alone can read it; a folder that cannot be written keeps none."""
    path, work = folder / ADDRESS, folder / f".{ADDRESS}.partial"
    with contextlib.suppress(OSError):
        work.unlink(missing_ok=True)
        with os.fdopen(os.open(work, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
            file.write(json_bytes(address.model_dump()))
        os.replace(work, path)


def _listening_socket(asked: int, before: int) -> socket.socket:
    """Return a socket that listens on this machine alone: on the port asked for, the one before, or a free one."""
    for port in [asked] if asked else [before, 0] if before else [0]:
        sock = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            sock.bind(("127.0.0.1", port))
        except OSError:
            sock.close()
            continue
        sock.listen(128)
        return sock
    raise OutputError(f"port {asked} is taken; give another with --port, or leave it out")
