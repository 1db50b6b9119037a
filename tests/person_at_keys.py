"""Somebody at the keys of the viewer's page, as tests play them; and commands that open a page."""

from __future__ import annotations

import math
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import pytest

from viewer_client import Stream


class Person:
    """Somebody at the keys, as the page would send them."""

    def __init__(self, client: Stream) -> None:
        self.client, self._seq, self._id = client, 0, 1000

    def hold(self, *keys: str, yaw: float | None = None) -> None:
        self._seq += 1
        self.client.send(type="keys", seq=self._seq, down=list(keys), yaw=yaw, pitch=None, axes={})

    def you(self) -> dict[str, Any]:
        """Wait for what is told of the next step."""
        count = len(self.client.messages)
        found: dict[str, Any] = self.client.until(
            lambda s: next((m for m in reversed(s.messages[count:]) if m["type"] == "you"), None)
        )
        return found

    def keep(self, *keys: str, steps: int) -> dict[str, Any]:
        """Hold keys down for some steps of the agent's."""
        self.hold(*keys)
        for _ in range(steps):
            you = self.you()
            self.hold(*keys)
        self.hold()
        return you

    def do(self, **action: Any) -> dict[str, Any]:
        self._id += 1
        self.client.send(type="do", id=self._id, action=action)
        return self.client.reply(self._id)

    def walk_to(self, x: float, y: float, *, within: float, seconds: float = 30.0) -> dict[str, Any]:
        """Hold the keys so that one gets there."""
        end = time.monotonic() + seconds
        self.hold()
        while True:
            you = self.you()
            dx, dy = x - you["position"][0], y - you["position"][1]
            if math.hypot(dx, dy) <= within:
                self.hold(yaw=math.atan2(dy, dx))
                return you
            assert time.monotonic() < end, you
            self.hold("forward", "run", yaw=math.atan2(dy, dx))


def stopped(client: Stream) -> None:
    """Stop the run, and wait until it has ended."""
    assert client.command("stop")["ok"]
    client.until(lambda s: (m := s.last("control")) and m["status"] == "ended")


@dataclass
class Shown:
    """A command that shows a page."""

    url: str
    process: subprocess.Popen[str]

    def ended(self, *, interrupt: bool = False) -> str:
        """Wait until it is over, with Ctrl+C if need be; return what else it printed."""
        if interrupt:
            self.process.send_signal(signal.SIGINT)
        printed, _ = self.process.communicate(timeout=120)
        return printed


def _hears_ctrl_c() -> None:
    # Where tests run in the background, a shell has them and all they start ignore it.
    signal.signal(signal.SIGINT, signal.default_int_handler)


@contextmanager
def shown(*words: object) -> Iterator[Shown]:
    """Start a command of ``vico`` that opens a page, and wait for its address; skip without the server's packages."""
    for package in ("websockets", "starlette", "uvicorn"):
        pytest.importorskip(package, reason="the page's server needs: pip install 'virtual-community[viewer]'")
    command = [sys.executable, "-m", "vico.cli.main", *map(str, words)]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, preexec_fn=_hears_ctrl_c
    ) as process:
        try:
            assert process.stdout is not None
            line = process.stdout.readline()
            assert "http://127.0.0.1:" in line, line
            yield Shown(line.split()[-1], process)
        finally:
            if process.poll() is None:
                process.kill()
