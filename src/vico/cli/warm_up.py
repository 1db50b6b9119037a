"""`vico warm-up`: compile the hot loops once; they are kept in the cache folder for every later start."""

from __future__ import annotations

import io
import sys
import tempfile
import time
from contextlib import redirect_stdout
from pathlib import Path

import numpy as np

from vico.assets.people import PASSERS_BY, body_of, passer_by
from vico.cli import community, replay, run, world
from vico.cli.options import CommunityBuildOptions, RunOptions
from vico.sim.robots.path_following import NEIGHBOUR, room_to_turn
from vico.world.walkable import fill_polygon
from vico.worldgen.packaged import packaged_extract
from vico.worldgen.sources import Sources

_RADIUS = 150.0


def warm_up() -> int:
    """Build a small world, live in it for a few seconds, look at it: whatever a real run compiles is compiled.

    The bodies of passers-by are made, too.
    """
    began = time.perf_counter()
    place = packaged_extract()
    with tempfile.TemporaryDirectory(prefix="vico-") as folder, redirect_stdout(io.StringIO()):
        here = Path(folder)
        world.build(Sources(place.path), out=here / "world", centre=(place.lat, place.lon), half=_RADIUS)
        community.build(CommunityBuildOptions(here / "world", here / "people", residents=6))
        run.run(RunOptions(here / "world", here / "people", out=here / "run", steps=60, cars=5, pedestrians=5))
        replay.replay(here / "run", film=True)
    # What so small a place and so short a time may not need: ramps of bridges, a robot that turns on the spot.
    ring = np.array([0.5, 2.5, 1.5])
    fill_polygon(np.zeros((4, 4), np.float32), ring, ring[::-1].copy(), np.array([0, 3]), 2.0, 1.0, 0.5)
    room_to_turn(0.0, 0.0, 1.0, np.zeros(0, NEIGHBOUR))
    for look in range(PASSERS_BY):
        body_of(passer_by(look))  # kept in the cache
    print(f"compiled and tried in {time.perf_counter() - began:.0f} s", file=sys.stderr)
    return 0
