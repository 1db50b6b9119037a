"""The server of the viewer: HTTP and a WebSocket on 127.0.0.1, for whoever has the token (docs/viewer_protocol.md)."""

from __future__ import annotations

import importlib.util

from vico.errors import MissingExtraError

_PARTS = ("starlette", "uvicorn", "websockets")


def require_server() -> None:
    """Refuse to go on without the packages that the server is made of.

    Raises
    ------
    MissingExtraError
        If one is not installed; the message holds the command to type.
    """
    missing = [name for name in _PARTS if importlib.util.find_spec(name) is None]
    if missing:
        raise MissingExtraError(
            f"the viewer: {missing[0]} is not installed; type: pip install 'virtual-community[viewer]'"
        )
