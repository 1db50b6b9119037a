"""`vico warm-up`: compile the hot loops once; numba keeps them on disk for every later start."""

from __future__ import annotations

import io
import sys
import tempfile
import time
from contextlib import redirect_stdout
from pathlib import Path

from vico.cli import community, replay, run, world
from vico.worldgen.packaged import packaged_extract
from vico.worldgen.sources import Sources

_RADIUS = 150.0


def warm_up() -> int:
    """Build a small world, live in it for a few seconds, look at it: whatever a real run compiles is compiled."""
    began = time.perf_counter()
    place = packaged_extract()
    with tempfile.TemporaryDirectory(prefix="vico-") as folder, redirect_stdout(io.StringIO()):
        here = Path(folder)
        world.build(Sources(place.path), out=here / "world", lat=place.lat, lon=place.lon, half=_RADIUS)
        community.build(here / "world", out=here / "people", residents=3, seed=0, force=False, json=False)
        run.run(here / "world", here / "people", out=here / "run", steps=5, cars=5, pedestrians=5)
        replay.replay(here / "run", film=True)
    print(f"compiled and tried in {time.perf_counter() - began:.0f} s", file=sys.stderr)
    return 0
