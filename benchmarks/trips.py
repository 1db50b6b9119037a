"""How long trips across a city take to plan: residents from their first place of the day to their second, at 8:00.

    python benchmarks/trips.py CITY COMMUNITY [--trips 40 300] [--table benchmarks/results/trips.md]

Each number of trips begins with nothing known of ways, in a process of its own. The digest is of all legs: code that
plans the same trips prints the same one.
"""

from __future__ import annotations

import argparse
import hashlib
import multiprocessing
import time
from collections.abc import Iterator
from pathlib import Path

from reporting import machine, publish

from vico.community.folder import read_community
from vico.community.model import Community
from vico.seeds import rng
from vico.world.folder import read_world
from vico.world.model import Place
from vico.world.world import World

_EIGHT = 8 * 3600.0


def _errands(world: World, community: Community) -> Iterator[tuple[Place, Place]]:
    """Yield where each resident goes first in the day, from where."""
    places = {place.id: place for place in world.places}
    for resident in community.residents:
        stays = [places[item.place] for item in resident.schedule if item.place in places]
        onward = next((place for place in stays if place is not stays[0]), None)
        if onward is not None:
            yield stays[0], onward


def measured(city: Path, people: Path, count: int) -> str:
    """Plan so many trips; return the row of the table."""
    world = read_world(city)
    errands = list(_errands(world, read_community(people, world)))
    chosen = rng(0, "trips", "benchmark").permutation(len(errands))[:count].tolist()
    trips, digest = world.trips, hashlib.sha256()
    trips.plan((0.0, 0.0), (1.0, 1.0), _EIGHT)  # compiles, and opens the maps
    began, modes = time.process_time(), 0
    for start, end in (errands[k] for k in chosen):
        trip = trips.plan(start.position[:2], end.position[:2], _EIGHT)
        legs = () if trip is None else trip.legs
        digest.update(
            repr([(leg.mode, leg.start, leg.end, leg.depart, leg.arrive, leg.price) for leg in legs]).encode()
        )
        modes += any(leg.mode != "walk" for leg in legs)
    seconds = time.process_time() - began
    return f"| {len(chosen)} | {seconds:.1f} | {seconds / len(chosen):.2f} | {modes} | {digest.hexdigest()[:16]} |"


def main() -> int:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("city", type=Path)
    parser.add_argument("community", type=Path)
    parser.add_argument("--trips", type=int, nargs="+", default=[40, 300])
    parser.add_argument("--table", type=Path)
    given = parser.parse_args()
    lines = [
        "# Trips across a city", "", machine(),
        "Made by `python benchmarks/trips.py CITY COMMUNITY --table benchmarks/results/trips.md`.", "",
        "| trips | processor s | s a trip | not on foot alone | digest |", "|---|---|---|---|---|",
    ]  # fmt: skip
    with multiprocessing.get_context("spawn").Pool(1, maxtasksperchild=1) as pool:
        lines += pool.starmap(measured, [(given.city, given.community, count) for count in given.trips], chunksize=1)
    publish(lines, given.table)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
