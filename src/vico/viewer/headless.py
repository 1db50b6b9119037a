"""Stills and films of what the page draws, without a window: for papers, and where there is no display."""

from __future__ import annotations

import base64
import io
import json
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from vico.errors import InputError, some_of
from vico.io.files import write_bytes
from vico.render.film import FilmWriter
from vico.viewer.browser import BrowserPage, open_page

_OPENED = 120.0


@dataclass(frozen=True, kw_only=True)
class Shot:
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


class Stage:
    """A page of a run that is drawn picture by picture; see `stage_of`."""

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

    def picture(self, shot: Shot, time: float, *, seconds: float | None = None, form: str = "image/png") -> bytes:
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


# Views of `vico.viewer.follow.VIEWS`: mode, degrees to the left of the face, degrees up, metres.
_VIEWS: dict[str, tuple[Literal["follow", "first"], float, float, float]] = {
    "behind": ("follow", 180.0, 16.0, 5.0),
    "front": ("follow", 15.0, 8.0, 5.0),
    "side": ("follow", 100.0, 8.0, 4.5),
    "above": ("follow", 180.0, 62.0, 16.0),
    "orbit": ("follow", 150.0, 15.0, 6.0),
    "eyes": ("first", 0.0, 16.0, 5.0),
}


def shot_of(agent: str, view: str, *, width: int, height: int) -> Shot:
    """Return the shot of somebody in one of `vico.viewer.follow.VIEWS`.

    Raises
    ------
    InputError
        If there is no such view.
    """
    if view not in _VIEWS:
        raise InputError(f"view: {view!r}; it has to be one of {', '.join(_VIEWS)}")
    mode, turn, pitch, distance = _VIEWS[view]
    return Shot(
        agent=agent,
        mode=mode,
        turn=math.radians(turn),
        pitch=math.radians(pitch),
        distance=distance,
        width=width,
        height=height,
    )


@contextmanager
def stage_of(address: str, *, width: int, height: int) -> Iterator[Stage]:
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
        yield Stage(page)


def write_still(address: str, path: Path, shot: Shot, step: int) -> None:
    """Write a picture of a step as PNG or JPEG."""
    forms = {".png": "image/png", ".jpg": "image/jpeg"}
    if path.suffix not in forms:
        raise InputError(f"{path}: stills are .png or .jpg files")
    with stage_of(address, width=shot.width, height=shot.height) as stage:
        write_bytes(path, stage.picture(shot, stage.time_of(step), form=forms[path.suffix]))


def write_film(
    address: str,
    path: Path,
    shot: Shot,
    *,
    first: int,
    last: int,
    rate: int = 25,
    report: Callable[[int, int], None] = lambda done, all_of: None,
) -> int:
    """Film a run from step `first` to step `last`; return the number of frames."""
    if first >= last:
        raise InputError(f"headless: steps {first} to {last}; a film needs two of them")
    with stage_of(address, width=shot.width, height=shot.height) as stage, FilmWriter(path, rate=rate, crf=20) as film:
        begin, end = stage.time_of(first), stage.time_of(last)
        count = int((end - begin) * rate)
        # One picture for itself puts the camera where it comes to rest.
        stage.picture(shot, begin)
        for k in range(count):
            film.add(_pixels(stage.picture(shot, begin + k / rate, seconds=1 / rate, form="image/jpeg")))
            report(k + 1, count)
        return film.frames


def _pixels(picture: bytes) -> NDArray[np.uint8]:
    return np.asarray(Image.open(io.BytesIO(picture)).convert("RGB"))
