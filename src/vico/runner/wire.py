"""Messages between the runner and an agent's process: plain data with its length before it, nothing pickled."""

from __future__ import annotations

import socket
from typing import Any

from vico.errors import SchemaError
from vico.io.plain_data import decode, encode

_HEAD = 8


class ClosedError(EOFError):
    """The other side is gone."""


def packed(message: Any) -> bytes:
    """Return a message as `send` takes it.

    Raises
    ------
    InputError
        If it is no plain data.
    """
    content = encode(message)
    return len(content).to_bytes(_HEAD, "little") + content


def send(channel: socket.socket, message: bytes) -> None:
    """Send what `packed` returned.

    Raises
    ------
    ClosedError
        If nobody receives it any more.
    """
    try:
        channel.sendall(message)
    except OSError as error:
        raise ClosedError(str(error)) from None


def receive(channel: socket.socket, *, limit: int) -> Any:
    """Wait for a message and return it.

    Parameters
    ----------
    limit
        Most bytes it may have.

    Raises
    ------
    SchemaError
        If it is longer, or no plain data.
    ClosedError
        If the other side is gone.
    """
    size = int.from_bytes(_exactly(channel, _HEAD), "little")
    if size > limit:
        raise SchemaError(f"an answer of {size} bytes; the longest may have {limit}")
    return decode(_exactly(channel, size))


def _exactly(channel: socket.socket, count: int) -> bytes:
    content = bytearray(count)
    view, filled = memoryview(content), 0
    while filled < count:
        try:
            got = channel.recv_into(view[filled:])
        except OSError as error:
            raise ClosedError(str(error)) from None
        if got == 0:
            raise ClosedError("closed")
        filled += got
    return bytes(content)
