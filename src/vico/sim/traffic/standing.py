"""Pedestrians who stand a while, or follow a point of their own: they leave their walkway for it and come back.

Who walks alone stops before a shop window or at a bus stop it passes, two who walk together stop to talk; at a bus stop
one waits until the bus is there, or gives up.
"""

from __future__ import annotations

import numpy as np

from vico.io.compiled import compiled
from vico.seeds import rng
from vico.sim.traffic.random_stream import next_random
from vico.sim.traffic.records import LED, NONE, STOP, TALK, Records
from vico.sim.traffic.shapes import Shapes, disc_touches
from vico.sim.traffic.state import WalkwayNetwork

#: Share of those who pass a free spot that take it, and how long they stand, s; by kind of spot.
_CHANCE = np.array([0.0, 0.1, 0.2, 0.25])
_SHORTEST = np.array([0.0, 10.0, 40.0, 420.0])
_LONGEST = np.array([0.0, 45.0, 180.0, 900.0])
#: Share of the spots at stops where somebody waits at the start, and of the pedestrians that do at the most.
_WAITING_AT_START, _MOST_AT_START = 0.5, 0.08
_ROOM = 0.3  # m: a body's radius and a little air
_TURN_RATE = 2.5  # rad/s
_MAKES_WAY = 3.0  # s that somebody goes on standing at most whom a vehicle waits for to go
_TOGETHER = 2.0  # m within which two stop together


@compiled
def _is_free(paths, pedestrians, k, shapes, i, first):  # type: ignore[no-untyped-def]
    """Return whether nobody stands at spot k or is on the way there, but pedestrian i."""
    for other in range(len(pedestrians)):
        if pedestrians[other].spot == k:
            return False
    spot = paths.spots[k]
    for j in range(len(shapes.x)):
        if j != first + i and abs(shapes.x[j] - spot.x) < 8.0 and disc_touches(spot.x, spot.y, _ROOM, shapes, j):
            return False
    return True


@compiled
def _take_spot(paths, walker, k, seconds):  # type: ignore[no-untyped-def]
    """Have somebody go to spot k, to stand there."""
    spot = paths.spots[k]
    walker.spot, walker.stand_kind, walker.stand_time = k, spot.kind, seconds
    walker.stand_xy[0], walker.stand_xy[1], walker.stand_yaw = spot.x, spot.y, spot.yaw


@compiled
def leave_spot(walker):  # type: ignore[no-untyped-def]
    """Have somebody walk on."""
    walker.spot, walker.stand_kind, walker.stand_time = NONE, 0, 0.0
    walker.jammed_time = walker.stuck_time = 0.0


@compiled
def _wants(paths, walker, k):  # type: ignore[no-untyped-def]
    """Return whether somebody who passes spot k stops there, if it is free: a matter of chance."""
    kind = paths.spots[k].kind
    if walker.group_size != (2 if kind == TALK else 1):
        return False
    return next_random(walker) < _CHANCE[kind]


@compiled
def stop_at_spot(paths, pedestrians, i, shapes, first, offset):  # type: ignore[no-untyped-def]
    """Have pedestrian i stop at one of the spots it has come past since its walkway's metre `offset`."""
    walker = pedestrians[i]
    way = walker.walkway
    if walker.leader != NONE or walker.goal != NONE or walker.leaving_crossing != NONE or paths.walkways[way].shut:
        return
    low, high = min(offset, walker.offset), max(offset, walker.offset)
    for k in range(paths.spot_first[way], paths.spot_first[way + 1]):
        passes = low < paths.spots[k].offset <= high
        if not passes or not _wants(paths, walker, k) or not _is_free(paths, pedestrians, k, shapes, i, first):
            continue
        kind = paths.spots[k].kind
        seconds = _SHORTEST[kind] + next_random(walker) * (_LONGEST[kind] - _SHORTEST[kind])
        if kind == TALK:
            other = pedestrians[i + 1]
            together = other.walkway == way and walker.apart < _TOGETHER and other.leaving_crossing == NONE
            partner = paths.spots[k].partner
            if not together or not _is_free(paths, pedestrians, partner, shapes, i + 1, first):
                continue
            _take_spot(paths, other, partner, seconds)
        _take_spot(paths, walker, k, seconds)
        return


@compiled
def note_standing(paths, pedestrians, walker, is_there, is_asked, dt):  # type: ignore[no-untyped-def]
    """Count the time somebody stands; who has stood long enough walks on, or can't get there, or may not be there.

    So does, before long, who is asked to go: a bus that leaves its stop swings out over the kerb.
    """
    if walker.stand_kind >= LED:
        return
    walker.stand_time -= dt
    if is_asked:
        walker.stand_time = min(walker.stand_time, _MAKES_WAY)
    deserted = walker.stand_kind == TALK and walker.leader != NONE and pedestrians[walker.leader].stand_kind != TALK
    is_over = walker.stand_time <= 0.0 or paths.walkways[walker.walkway].shut
    if is_over or deserted or (not is_there and walker.jammed_time > 6.0):
        leave_spot(walker)


@compiled
def turn_towards(shapes, b, yaw, dt):  # type: ignore[no-untyped-def]
    """Turn body b on the spot."""
    turn = (yaw - shapes.yaw[b] + np.pi) % (2 * np.pi) - np.pi
    shapes.yaw[b] += min(max(turn, -_TURN_RATE * dt), _TURN_RATE * dt)


def stand_at_start(paths: WalkwayNetwork, walkers: Records, shapes: Shapes, first: int, seed: int) -> None:
    """Have some of those who walk alone wait at bus stops when a run begins; their bodies begin at `first`."""
    random = rng(seed, "traffic", "standing")
    alone = np.flatnonzero((walkers["group_size"] == 1) & (walkers["goal"] == NONE))
    spots = np.flatnonzero(paths.spots["kind"] == STOP)
    spots = spots[random.random(len(spots)) < _WAITING_AT_START]
    count = min(len(spots), int(_MOST_AT_START * len(walkers)), len(alone))
    chosen = random.permutation(spots)[:count]
    for i, k in zip(random.permutation(alone)[:count].tolist(), chosen.tolist(), strict=True):
        spot, walker, b = paths.spots[k], walkers[i], first + i
        x, y = float(spot["x"]), float(spot["y"])
        if any(disc_touches(x, y, _ROOM, shapes, j) for j in range(len(shapes.x)) if j != b):
            continue
        shapes.x[b], shapes.y[b], shapes.yaw[b] = x, y, spot["yaw"]
        walker["walkway"], walker["offset"] = spot["walkway"], spot["offset"]
        walker["spot"], walker["stand_kind"], walker["stand_time"] = (
            k,
            STOP,
            random.uniform(_SHORTEST[STOP], _LONGEST[STOP]),
        )
        walker["stand_xy"], walker["stand_yaw"], walker["progress_xy"] = (x, y), spot["yaw"], (x, y)
