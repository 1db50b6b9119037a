"""A Chromium without a window, driven over its DevTools protocol: for stills, films and tests of the page."""

from __future__ import annotations

import base64
import json
import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import Any
from urllib.request import urlopen

from vico.errors import MissingExtraError, VicoError

_PROGRAMS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
# Software WebGL where there is no GPU: the same pictures everywhere.
_OPTIONS = (
    "--headless=new", "--no-first-run", "--disable-extensions", "--disable-background-networking", "--mute-audio",
    "--hide-scrollbars", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist", "--disable-dev-shm-usage", "--remote-debugging-port=0",
)  # fmt: skip
_START, _ANSWER = 60.0, 120.0


class BrowserError(VicoError, RuntimeError):
    """The browser did not start, or the page failed."""


def browser_program() -> Path:
    """Return the browser's program: ``$VICO_BROWSER``, else a Chromium or Chrome on the path.

    Raises
    ------
    MissingExtraError
        If there is none.
    """
    chosen = os.environ.get("VICO_BROWSER")
    for name in [chosen] if chosen else _PROGRAMS:
        found = shutil.which(name)
        if found:
            return Path(found)
    where = f"$VICO_BROWSER ({chosen}) is no program" if chosen else "there is none on the path"
    raise MissingExtraError(
        f"pictures of the page need Chromium or Chrome, and {where}: install it (Debian: apt-get install chromium), "
        "or name it in VICO_BROWSER"
    )


class BrowserPage:
    """One page of a headless browser; see `open_page`.

    Parameters
    ----------
    socket
        Connection to the page's DevTools.

    Attributes
    ----------
    faults
        What the page's programs complained of: errors that nobody caught, and errors written to the console.
    """

    def __init__(self, socket: Any) -> None:
        self._socket = socket
        self._next = 1
        self.faults: list[str] = []
        for domain in ("Page", "Runtime", "Network"):
            self.call(f"{domain}.enable")

    def call(self, method: str, **arguments: Any) -> dict[str, Any]:
        """Call a method of the DevTools protocol and return its result.

        Raises
        ------
        BrowserError
            If the browser refuses, or does not answer.
        """
        number, self._next = self._next, self._next + 1
        self._socket.send(json.dumps({"id": number, "method": method, "params": arguments}))
        end = time.monotonic() + _ANSWER
        while True:
            message = self._receive(end - time.monotonic(), method)
            if message.get("id") == number:
                break
            self._note(message)
        if "error" in message:
            raise BrowserError(f"browser: {method}: {message['error'].get('message')}")
        result: dict[str, Any] = message["result"]
        return result

    def _receive(self, seconds: float, what: str) -> dict[str, Any]:
        try:
            message: dict[str, Any] = json.loads(self._socket.recv(timeout=max(seconds, 0.01)))
        except TimeoutError:
            raise BrowserError(f"browser: no answer to {what} within {_ANSWER:.0f} s") from None
        return message

    def _note(self, message: dict[str, Any]) -> None:
        method, told = message.get("method"), message.get("params", {})
        if method == "Runtime.exceptionThrown":
            details = told["exceptionDetails"]
            self.faults.append(details.get("exception", {}).get("description") or details.get("text", ""))
        elif method == "Runtime.consoleAPICalled" and told.get("type") == "error":
            self.faults.append(" ".join(str(a.get("value", a.get("description", ""))) for a in told["args"]))

    def go_to(self, address: str) -> None:
        """Load an address."""
        told = self.call("Page.navigate", url=address)
        if told.get("errorText"):
            raise BrowserError(f"browser: {address}: {told['errorText']}")

    def evaluate(self, script: str) -> Any:
        """Return what a script gives, as JSON knows it; promises are waited for.

        Raises
        ------
        BrowserError
            If it throws.
        """
        told = self.call("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in told:
            details = told["exceptionDetails"]
            raise BrowserError(f"page: {details.get('exception', {}).get('description') or details.get('text')}")
        return told["result"].get("value")

    def wait_for(self, script: str, *, seconds: float = 30.0) -> Any:
        """Evaluate a script until what it gives is true, and return that.

        Raises
        ------
        BrowserError
            If it stays false.
        """
        end = time.monotonic() + seconds
        while True:
            with suppress(BrowserError):
                found = self.evaluate(script)
                if found:
                    return found
            if time.monotonic() > end:
                raise BrowserError(f"page: {script} is not so after {seconds:.0f} s; faults: {self.faults[-3:]}")
            time.sleep(0.1)

    def resize(self, width: int, height: int, *, dark: bool = False) -> None:
        """Make the window so large, in pixels, and the page light or dark."""
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.call("Emulation.setDeviceMetricsOverride", **size)
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.call("Emulation.setEmulatedMedia", features=[scheme])

    def click(self, x: float, y: float) -> None:
        """Click a point of the window."""
        for kind in ("mousePressed", "mouseReleased"):
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def press(self, key: str, code: str | None = None) -> None:
        """Press and release a key."""
        text = {"text": key} if len(key) == 1 else {}
        self.call("Input.dispatchKeyEvent", type="keyDown", key=key, code=code or "", **text)
        self.call("Input.dispatchKeyEvent", type="keyUp", key=key, code=code or "")

    def screenshot(self) -> bytes:
        """Return a picture of the window as PNG."""
        return base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])


class _Chromium:
    def __init__(self, folder: Path) -> None:
        command = [str(browser_program()), *_OPTIONS, f"--user-data-dir={folder}"]
        if hasattr(os, "geteuid") and os.geteuid() == 0:
            # Chromium refuses its sandbox to the superuser, as in containers.
            command.append("--no-sandbox")
        self._log = (folder / "browser.log").open("wb")
        self._process = subprocess.Popen([*command, "about:blank"], stdout=self._log, stderr=self._log)
        self._folder = folder

    def __enter__(self) -> _Chromium:
        return self

    def __exit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None:
        self._process.terminate()
        try:
            self._process.wait(10)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._log.close()

    def page_address(self) -> str:
        """Return the WebSocket of the first page's DevTools, once it is there."""
        end, told = time.monotonic() + _START, self._folder / "DevToolsActivePort"
        while time.monotonic() < end and self._process.poll() is None:
            with suppress(OSError, ValueError, IndexError, StopIteration):
                port = int(told.read_text().splitlines()[0])
                with urlopen(f"http://127.0.0.1:{port}/json/list", timeout=5) as answer:
                    pages = json.loads(answer.read())
                return str(next(page["webSocketDebuggerUrl"] for page in pages if page["type"] == "page"))
            time.sleep(0.1)
        last = (self._folder / "browser.log").read_text(errors="replace").strip().splitlines()[-1:]
        raise BrowserError(f"browser: it did not start within {_START:.0f} s: {' '.join(last)}")


@contextmanager
def open_page() -> Iterator[BrowserPage]:
    """Start a browser with an empty page, and end it afterwards.

    Raises
    ------
    MissingExtraError
        If there is no browser, or the package `websockets` is missing.
    BrowserError
        If it does not start.
    """
    try:
        from websockets.sync.client import connect
    except ImportError:
        raise MissingExtraError(
            "driving a browser needs websockets; type: pip install 'virtual-community[viewer]'"
        ) from None
    with (
        tempfile.TemporaryDirectory(prefix="vico-browser-", ignore_cleanup_errors=True) as name,
        _Chromium(Path(name)) as chromium,
        connect(chromium.page_address(), max_size=None, compression=None) as socket,
    ):
        yield BrowserPage(socket)
