"""Random windows of maps, plain or damaged, built and checked: what a search over the world's cities is made of."""

from __future__ import annotations

import os
import tempfile
import time
import traceback
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import osmium

from damaged_maps import DAMAGES, read_map, write_map
from vico.errors import EmptyInputError, VicoError
from vico.geo.frame import LocalFrame
from vico.seeds import rng
from vico.world import glb, mesh
from vico.world.check import check_world
from vico.world.folder import read_world
from vico.worldgen.facades.textures import materials
from vico.worldgen.pipeline import build_world
from vico.worldgen.request import BuildOptions, Sources

PACKAGED = Path(__file__).parents[1] / "src" / "vico" / "data" / "helsinki.osm.pbf"
PLACES = Path(__file__).parents[2] / "shared" / "data" / "places"
_REACH = 100.0  # metres beyond a window that a damaged map keeps


@dataclass(frozen=True)
class Window:
    """A window of a map; equal windows give equal worlds.

    Attributes
    ----------
    extract
        Map file.
    lat, lon
        Its centre, degrees.
    half
        Half its side, metres.
    damage
        Names of `DAMAGES`, done in this order; none leaves the map as it is.
    seed
        Decides the damage and the world.
    """

    extract: Path
    lat: float
    lon: float
    half: float
    damage: tuple[str, ...] = ()
    seed: int = 0

    def __str__(self) -> str:
        how = "+".join(self.damage) or "plain"
        return f"{self.extract}:{self.lat:.6f},{self.lon:.6f},{self.half:g},{how},{self.seed}"

    @classmethod
    def parse(cls, text: str) -> Window:
        """From what `str` gives."""
        path, numbers = text.rsplit(":", 1)
        lat, lon, half, how, seed = numbers.split(",")
        damage = () if how == "plain" else tuple(how.split("+"))
        return cls(Path(path), float(lat), float(lon), float(half), damage, int(seed))


@dataclass(frozen=True)
class Trial:
    """What became of a window.

    Attributes
    ----------
    state
        ``fine``, ``empty`` (nothing to build there), ``refused`` (an error in one sentence), ``traceback`` or
        ``findings``.
    what
        The sentence, the exception with the line of ours it came from, or the findings, one a line.
    seconds
        Wall seconds of building and checking.
    """

    window: Window
    state: str
    what: tuple[str, ...] = ()
    seconds: float = 0.0
    dropped: dict[str, int] = field(default_factory=dict)
    detail: str = ""


def extracts() -> list[Path]:
    """The packaged extract, and those beside the checkout."""
    return [PACKAGED, *sorted(PLACES.glob("*/*.osm.pbf"))]


@cache
def _bounds(path: Path) -> tuple[float, float, float, float]:
    box = osmium.io.Reader(str(path)).header().box()
    if not box.valid():
        box = osmium.osm.Box()
        for node in osmium.FileProcessor(str(path), osmium.osm.NODE):
            box.extend(node.location)
    return box.bottom_left.lon, box.bottom_left.lat, box.top_right.lon, box.top_right.lat


def window_at(extract: Path, east: float, north: float, half: float, damage: Sequence[str], seed: int) -> Window:
    """A window whose centre lies `east` and `north` (shares, 0..1) of the way over the inner part of an extract."""
    west, south, right, top = _bounds(extract)
    lon = west + (right - west) * (0.15 + 0.7 * east)
    lat = south + (top - south) * (0.15 + 0.7 * north)
    return Window(extract, round(lat, 6), round(lon, 6), half, tuple(damage), seed)


def random_window(number: int, *, seed: int, damaged: bool, places: Sequence[Path], radius: tuple[int, int]) -> Window:
    """The window of this number of a search; extracts take turns."""
    random = rng(seed, "window", str(number))
    damage: list[str] = []
    if damaged:
        damage = random.choice(list(DAMAGES), int(random.integers(1, 4)), replace=False).tolist()
    half = float(random.integers(radius[0], radius[1] + 1))
    east, north = random.random(2).tolist()
    return window_at(places[number % len(places)], east, north, half, damage, number)


def damaged_map(window: Window, folder: Path) -> Path:
    """The window's map: its extract, or a damaged copy of the surroundings."""
    if not window.damage:
        return window.extract
    drawn = read_map(window.extract, LocalFrame(window.lat, window.lon), window.half + _REACH)
    for k, name in enumerate(window.damage):
        DAMAGES[name](drawn, rng(window.seed, "damage", name, str(k)))
    return write_map(drawn, folder / "damaged.osm.pbf")


_PAINTED: dict[str, Any] = {}


@contextmanager
def painted_once() -> Iterator[None]:
    """Paint and pack each picture of a wall once a process: they take half of a small build, and no map spoils them."""

    def kept(key: str, make: Callable[[], Any]) -> Any:
        if key not in _PAINTED:
            _PAINTED[key] = make()
        return _PAINTED[key]

    def painter(name: str, paint: Callable[[Any], Any]) -> Callable[[Any], Any]:
        return lambda random: kept(name, lambda: paint(random))

    pack = glb._picture

    def packed(material: mesh.Material) -> Any:
        if material.texture is None:
            return None
        return kept(f"{material.name} {zlib.crc32(material.texture)}", lambda: pack(material))

    painters = {name: painter(name, paint) for name, paint in materials.PAINTERS.items()}
    with mock.patch.dict(materials.PAINTERS, painters), mock.patch.object(glb, "_picture", packed):
        yield


def try_window(window: Window, keep: Path | None = None) -> Trial:
    """Build the window's world and check it; nothing is kept but, in `keep`, what failed."""
    start = time.perf_counter()
    dem = tuple(window.extract.parent.glob("dem_*.tif")) if window.seed % 2 else ()
    if keep is not None:
        keep.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="window-") as folder:
        out = Path(keep or folder) / "world"
        state, what, detail = "fine", (), ""
        dropped: dict[str, int] = {}
        try:
            osm = damaged_map(window, Path(keep or folder))
            with painted_once():
                manifest = build_world(
                    Sources(osm, dem=dem), lat=window.lat, lon=window.lon, half=window.half, seed=window.seed, out=out,
                    force=True, options=BuildOptions(previews=False, keep_stages=keep is not None),
                )  # fmt: skip
            dropped = {stage.name: len(stage.dropped) for stage in manifest.stages if stage.dropped}
            if findings := check_world(read_world(out)):
                state, what = "findings", tuple(f"{f.id}: {f.where}: {f.what}" for f in findings)
        except EmptyInputError as error:
            state, what = "empty", (str(error),)
        except VicoError as error:
            state, what, detail = "refused", (f"{type(error).__name__}: {error}",), traceback.format_exc()
        except Exception as error:  # any: what is looked for
            state, what, detail = "traceback", (frame_of(error),), traceback.format_exc()
    return Trial(window, state, what, time.perf_counter() - start, dropped, detail)


def frame_of(error: Exception) -> str:
    """The exception, and the innermost line of the package that it came through."""
    ours = [f for f in traceback.extract_tb(error.__traceback__) if f"{os.sep}vico{os.sep}" in f.filename]
    where = "outside"
    if ours:
        path = ours[-1].filename.rsplit(f"{os.sep}vico{os.sep}", 1)[1]
        where = f"{path}:{ours[-1].lineno} in {ours[-1].name}"
    return f"{type(error).__name__}: {str(error)[:200]} at {where}"


def failures(trials: Sequence[Trial]) -> list[Trial]:
    """Those that must not be."""
    return [trial for trial in trials if trial.state not in ("fine", "empty")]


def kinds_of(trials: Sequence[Trial]) -> dict[str, int]:
    """How often each kind of failure was met: an exception with its line, or a rule of the check."""
    counts: dict[str, int] = {}
    for trial in failures(trials):
        for what in {w.split(": ", 1)[0] if trial.state == "findings" else w for w in trial.what}:
            key = f"{trial.state}: {what}"
            counts[key] = counts.get(key, 0) + 1
    return dict(sorted(counts.items(), key=lambda item: -item[1]))


def middle_of(seconds: Sequence[float]) -> float:
    """The median, 0 of nothing."""
    return float(np.median(seconds)) if len(seconds) else 0.0
