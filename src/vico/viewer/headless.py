"""Stills and films of what the page draws, by a Chromium without a window: for papers, and where there is no display.

The browser is driven over its DevTools protocol; tests of the page use it, too.
"""

from __future__ import annotations

import base64
import io
import json
import math
import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Literal
from urllib.request import urlopen

import numpy as np
from PIL import Image

from vico.errors import InputError, MissingExtraError, VicoError, some_of
from vico.io.files import write_bytes
from vico.render.film import FilmWriter

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


_OPENED = 120.0


@dataclass(frozen=True, kw_only=True)
class PageShot:
    """From where a picture is taken.

    Attributes
    ----------
    agent
        Who is followed: name of an agent or a person, or of something in traffic, such as ``car 3``; empty for nobody.
    mode
        ``orbit`` (round a point), ``follow`` (behind somebody), ``first`` (through their eyes) or ``bird``.
    target
        What is looked at where nobody is followed, ENU metres.
    yaw, pitch
        From where, radians: on which side of the target, and how far above the horizon; None: as the page has them.
    turn
        On which side of whoever is followed, radians to the left of where they face.
    distance
        Metres; None: as the page has it.
    width, height
        Pixels, even.
    """

    agent: str = ""
    mode: Literal["orbit", "follow", "first", "bird"] = "orbit"
    target: tuple[float, float, float] | None = None
    yaw: float | None = None
    turn: float | None = None
    pitch: float | None = None
    distance: float | None = None
    width: int = 1920
    height: int = 1080

    def __post_init__(self) -> None:
        if self.width % 2 or self.height % 2 or not (64 <= self.width <= 7680 and 64 <= self.height <= 4320):
            raise InputError(f"headless: {self.width}x{self.height}; sides have to be even, 64x64 to 7680x4320")


class PageRecorder:
    """A page of a run that is drawn picture by picture; see `open_recorder`."""

    def __init__(self, page: BrowserPage) -> None:
        self._page = page
        run = page.evaluate("vico.source.run")
        cast = page.evaluate("Array.from(vico.source.cast.values())")
        self._entities = {member["name"]: member["entity"] for member in cast}
        self._entities |= {agent["name"]: agent["entity"] for agent in run["agents"]}
        self.last = int(run["run"]["last"])

    def time_of(self, step: int) -> float:
        """Return when a step was, seconds since midnight of the first day.

        Raises
        ------
        InputError
            If it was not recorded.
        """
        if not 0 <= step <= self.last:
            raise InputError(f"headless: step {step}; the run has steps 0 to {self.last}")
        return float(self._page.evaluate(f"vico.source.timeOf({step})"))

    def picture(self, shot: PageShot, time: float, *, seconds: float | None = None, form: str = "image/png") -> bytes:
        """Return a picture of a moment, as PNG or JPEG.

        Parameters
        ----------
        time
            Seconds since midnight of the first day.
        seconds
            Since the picture before, of a film; None: it stands alone.
        """
        wish: dict[str, Any] = {"time": time, "mode": shot.mode, "type": form, "entity": self._entity(shot.agent)}
        if shot.target is not None:
            wish["target"] = dict(zip("xyz", shot.target, strict=True))
        given = {"yaw": shot.yaw, "turn": shot.turn, "pitch": shot.pitch, "distance": shot.distance, "seconds": seconds}
        wish |= {key: value for key, value in given.items() if value is not None}
        told = self._page.evaluate(f"vico.stills().then((s) => s.still(vico.page, {json.dumps(wish)}))")
        return base64.b64decode(str(told).partition(",")[2])

    def _entity(self, agent: str) -> int:
        if not agent:
            return 0
        if agent not in self._entities:
            raise InputError(f"headless: nobody is called {agent!r}; there are {some_of(list(self._entities))}")
        return int(self._entities[agent])


# Views of `vico.viewer.follow_camera.VIEWS`: mode, degrees to the left of the face, degrees up, metres.
_VIEWS: dict[str, tuple[Literal["follow", "first"], float, float, float]] = {
    "behind": ("follow", 180.0, 16.0, 5.0),
    "front": ("follow", 15.0, 8.0, 5.0),
    "side": ("follow", 100.0, 8.0, 4.5),
    "above": ("follow", 180.0, 62.0, 16.0),
    "orbit": ("follow", 150.0, 15.0, 6.0),
    "eyes": ("first", 0.0, 16.0, 5.0),
}


def page_shot_of(agent: str, view: str, *, width: int, height: int) -> PageShot:
    """Return the shot of somebody in one of `vico.viewer.follow_camera.VIEWS`.

    Raises
    ------
    InputError
        If there is no such view.
    """
    if view not in _VIEWS:
        raise InputError(f"view: {view!r}; it has to be one of {', '.join(_VIEWS)}")
    mode, turn, pitch, distance = _VIEWS[view]
    return PageShot(
        agent=agent,
        mode=mode,
        turn=math.radians(turn),
        pitch=math.radians(pitch),
        distance=distance,
        width=width,
        height=height,
    )


@contextmanager
def open_recorder(address: str, *, width: int, height: int) -> Iterator[PageRecorder]:
    """Open the page at an address (with its token) in a browser without a window, for pictures of that size.

    Raises
    ------
    MissingExtraError
        If there is no browser.
    BrowserError
        If the page does not open, or draws no 3D.
    """
    with open_page() as page:
        page.resize(width, height)
        page.go_to(address)
        page.wait_for("window.vico && vico.view && vico.state.before", seconds=_OPENED)
        page.evaluate("vico.stills().then((s) => s.begin(vico.page))")
        yield PageRecorder(page)


def write_still(address: str, path: Path, shot: PageShot, step: int) -> None:
    """Write a picture of a step as PNG or JPEG."""
    forms = {".png": "image/png", ".jpg": "image/jpeg"}
    if path.suffix not in forms:
        raise InputError(f"{path}: stills are .png or .jpg files")
    with open_recorder(address, width=shot.width, height=shot.height) as stage:
        write_bytes(path, stage.picture(shot, stage.time_of(step), form=forms[path.suffix]))


def write_film(
    address: str,
    path: Path,
    shot: PageShot,
    *,
    first: int,
    last: int,
    rate: int = 25,
    report: Callable[[int, int], None] = lambda done, all_of: None,
) -> int:
    """Film a run from step `first` to step `last`; return the number of frames."""
    if first >= last:
        raise InputError(f"headless: steps {first} to {last}; a film needs two of them")
    with (
        open_recorder(address, width=shot.width, height=shot.height) as stage,
        FilmWriter(path, rate=rate, crf=20) as film,
    ):
        begin, end = stage.time_of(first), stage.time_of(last)
        count = int((end - begin) * rate)
        # One picture for itself puts the camera where it comes to rest.
        stage.picture(shot, begin)
        for k in range(count):
            picture = stage.picture(shot, begin + k / rate, seconds=1 / rate, form="image/jpeg")
            film.add(np.asarray(Image.open(io.BytesIO(picture)).convert("RGB")))
            report(k + 1, count)
        return film.frames
