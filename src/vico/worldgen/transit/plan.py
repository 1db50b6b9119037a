"""Bus stops and a round where the map and the timetables have none: k-means over the places people go to."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from vico.geo.osm import OsmData
from vico.geometry import distances
from vico.seeds import rng
from vico.worldgen.facts.fault_isolation import drop_on_failure
from vico.worldgen.facts.site import SiteFacts
from vico.worldgen.transit.drive import BUS_LENGTH, Berth, Drive, Kerbs

MIN_STOPS, MAX_STOPS = 4, 12
MAX_LOOP = 4500.0
_DISTRICT = 1200.0  # metres: the side of the largest window that these suit

_PLANNED = 8
_FEW = 12  # fewer named places than this say little about where people go: buildings count too
_APART = 60.0  # metres between two stops of a planned line


def times_as_wide(osm: OsmData) -> float:
    """Return how many times as wide as a district a place is, at least 1: so much longer may its lines be."""
    return max(1.0, max(osm.sides) / _DISTRICT)


def as_many(each: int, osm: OsmData) -> int:
    """Return how many lines a place may have, of so many in a district: by its area."""
    wide, high = osm.sides
    times = max(1.0, math.sqrt(wide * high) / _DISTRICT)
    return round(each * times * times)


def where_people_go(site: SiteFacts) -> NDArray[np.float64]:
    """Places that people go to, metres, shape ``(n, 2)``: the named ones; every building where these are few."""
    points = [named.xy for named in site.named]
    if len(points) < _FEW:
        for area in site.osm.areas:
            if area.tags.get("building", "no") != "no" and not area.polygon.is_empty:
                with drop_on_failure(area.id):
                    points.append(np.array(area.polygon.representative_point().coords[0]))
    xy = np.array(points).reshape(-1, 2)
    return xy[site.osm.holds(xy, edge=False)]


def k_means(xy: NDArray[np.float64], count: int, random: np.random.Generator) -> NDArray[np.float64]:
    """Centres of `count` clusters of points, spread out from the start (k-means++), shape ``(k, 2)``."""
    count = min(count, len(np.unique(xy, axis=0)))
    if not count:
        return np.zeros((0, 2))
    centres = [xy[int(random.integers(len(xy)))]]
    while len(centres) < count:
        away = np.min([((xy - c) ** 2).sum(axis=1) for c in centres], axis=0)
        centres.append(xy[int(random.choice(len(xy), p=away / away.sum()))])
    middles = np.array(centres)
    for _ in range(25):
        nearest = np.argmin(((xy[:, None] - middles[None]) ** 2).sum(axis=2), axis=1)
        middles = np.array([xy[nearest == k].mean(axis=0) if (nearest == k).any() else middles[k]
                            for k in range(count)])  # fmt: skip
    return middles


def planned_berths(site: SiteFacts, kerbs: Kerbs, seed: int) -> list[Berth]:
    """Eight stops: k-means over where people go, each at the nearest kerb that buses can reach."""
    lanes = kerbs.lanes
    spots = [
        (lane, float(offset))
        for lane in kerbs.numbers.tolist()
        for offset in np.arange(BUS_LENGTH + 2.0, lanes.length[lane] - 3.0, 10.0)
        if kerbs.has_room(lane, float(offset))
    ]
    if not spots:
        return []
    xy = lanes.at([lane for lane, _ in spots], [offset for _, offset in spots])[:, :2]
    wanted = where_people_go(site)
    if len(wanted) < _PLANNED:
        wanted = xy
    centres = k_means(wanted, _PLANNED, rng(seed, "transit", "stops"))
    chosen: list[int] = []
    for centre in centres:
        away = ((xy - centre) ** 2).sum(axis=1)
        for taken in chosen:
            away = np.where(distances(xy, xy[taken]) < _APART, np.inf, away)
        if np.isfinite(away).any():
            chosen.append(int(np.argmin(away)))
    return [Berth(f"planned{k}", f"Stop {k + 1}", *spots[i]) for k, i in enumerate(sorted(chosen))]


def planned_loop(drive: Drive, berths: Sequence[Berth], *, least: int = MIN_STOPS) -> list[Berth]:
    """One loop: the cheapest insertion of stops into a round, from the best pair of stops on; empty if none.

    Parameters
    ----------
    least
        How few stops it may have; below `MIN_STOPS` they may lie nearer to one another, too.
    """
    n = len(berths)
    if n < least:
        return []
    drive.prepare(berths)
    metres = np.array([[drive.metres(a, b) for b in berths] for a in berths])
    both = metres + metres.T
    np.fill_diagonal(both, np.inf)
    # A first pair some way apart: two poles across the street make no line.
    spots = drive.lanes.at([b.lane for b in berths], [b.offset for b in berths])[:, :2]
    apart = np.linalg.norm(spots[:, None] - spots[None], axis=2)
    for away in (150.0, 80.0) if least >= MIN_STOPS else (150.0, 80.0, 40.0):
        score = np.where(apart > away, both / np.maximum(apart, 1.0), np.inf)
        if np.isfinite(score).any():
            break
    else:
        return []
    loop = [int(v) for v in np.unravel_index(int(np.argmin(score)), score.shape)]

    def around() -> float:
        return float(sum(metres[a, b] for a, b in zip(loop, loop[1:] + loop[:1], strict=True)))

    while len(loop) < MAX_STOPS:
        best = (math.inf, -1, -1)
        for new in range(n):
            if new in loop or apart[new, loop].min() < _APART:
                continue
            for k in range(len(loop)):
                a, b = loop[k], loop[(k + 1) % len(loop)]
                best = min(best, (float(metres[a, new] + metres[new, b] - metres[a, b]), new, k))
        if best[1] < 0 or not math.isfinite(best[0]):
            break
        if len(loop) >= least and (best[0] > 350.0 or around() + best[0] > MAX_LOOP):
            break
        loop.insert(best[2] + 1, best[1])
    if len(loop) < least or not math.isfinite(around()):
        return []
    return [berths[i] for i in loop]
