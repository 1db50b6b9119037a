"""Car-following: the leader of a vehicle, the Intelligent Driver Model, and the parameters of cars, buses and cyclists.

The leader is the first body that a vehicle's swept outline touches, whatever that body is. The model gives the
acceleration behind it. Cyclists are slim, slow vehicles that ride beside the kerb of the lanes that cars drive.

Treiber, Hennecke, Helbing: Congested traffic states in empirical observations and microscopic simulations (2000).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.assets.vehicles import BICYCLE_PAINTS, CAR_KINDS, vehicle_size
from vico.errors import InputError
from vico.io.compiled import compiled, inlined
from vico.seeds import rng
from vico.sim.bodies.footprints import NeighbourGrid, Rectangle, point_gap, search, separation
from vico.sim.traffic.path import Outline, axles_at, footprint, footprint_between, point_on_path
from vico.sim.traffic.route import NEVER
from vico.sim.traffic.shapes import Shapes, is_within_reach, share_level
from vico.sim.traffic.state import NONE
from vico.world.lanes import LaneGraph

#: A body near a vehicle: centre, heading cosine and sine, half sides of its footprint's core, rounding of that, radius
#: of the circle around it (metres), and index into `Shapes`. Whoever is round is a person.
NEARBY_BODY = np.dtype(
    [
        ("x", np.float64),
        ("y", np.float64),
        ("cos", np.float64),
        ("sin", np.float64),
        ("half_length", np.float64),
        ("half_width", np.float64),
        ("rounding", np.float64),
        ("radius", np.float64),
        ("body", np.int64),
    ],
    align=True,
)
TOUCH = 0.04  # no move may leave less than this between bodies, m
NO_GAP = 1e9  # the gap to the leader where there is none
ANY_BODY = 2**31  # every body's index lies below

_VEHICLE_GAP = 0.1  # sideways distance kept from vehicles that are passed, m
_LONG = 2.5  # half the length of a section of a tram at least, m
_NOSE = 0.02  # a vehicle's outline is tested so much longer, m
_NEAR_PATH = 1.5  # more than a bus's corners leave its path in a bend, m
_FINE_STEP = 1.0  # m of a step of the sweep
_COARSE_STEP = 2.0  # m of a larger one
_COARSE_FROM = 8.0  # m ahead from which on it takes these


class Surroundings(NamedTuple):
    """All bodies, the grid to find them by, and memory to write finds into.

    Attributes
    ----------
    candidates, found
        As long as there are bodies, int64 and dtype `NEARBY_BODY`: what `bodies_around` found last.
    """

    shapes: Shapes
    grid: NeighbourGrid
    candidates: NDArray[np.int64]
    found: NDArray[np.void]


class VehicleView(NamedTuple):
    """What a vehicle sees in a step: its path, its outline on it, and the bodies near it.

    Attributes
    ----------
    nearby
        Structured array of `NEARBY_BODY`; positions in the world frame, metres.
    beyond
        For who has to know what is farther away.
    """

    path: NDArray[np.void]
    outline: Outline
    nearby: NDArray[np.void]
    beyond: Surroundings


@compiled
def bodies_around(v, x, y, reach, surroundings):
    """Return the bodies within `reach` metres of a point on body v's level, but v, dtype `NEARBY_BODY`.

    They are valid until this is called again with the same surroundings.
    """
    shapes, grid, candidates, found = surroundings
    return nearby_bodies(shapes, v, x, y, reach, search(grid, x, y, reach, candidates), found)


@inlined
def nearby_bodies(shapes, v, x, y, reach, candidates, buffer):
    """Write those of the candidates within `reach` metres of a point, on body v's level, into `buffer`; return them.

    `candidates` are indices of bodies, in ascending order, as from `vico.sim.bodies.footprints.search`; v is left out.
    """
    sx, sy, half = shapes.x, shapes.y, shapes.half_length
    n = 0
    for j in candidates:
        dx = sx[j] - x
        r = reach + half[j]
        if dx > r or dx < -r or j == v:
            continue
        dy = sy[j] - y
        if dx * dx + dy * dy < r * r and share_level(shapes, v, j):
            one, rounding = buffer[n], shapes.rounding[j]
            one.x, one.y = sx[j], sy[j]
            one.half_length, one.half_width = half[j] - rounding, shapes.half_width[j] - rounding
            one.rounding = rounding
            if one.half_length == 0.0 and one.half_width == 0.0:  # a disc has no heading
                one.cos, one.sin = 1.0, 0.0
            else:
                one.cos, one.sin = np.cos(shapes.yaw[j]), np.sin(shapes.yaw[j])
            one.radius = np.sqrt(one.half_length**2 + one.half_width**2) + rounding
            one.body = j
            n += 1
    return buffer[:n]


@compiled
def touches(rectangle, one):
    """Return whether a rectangle touches a nearby body."""
    if one.half_length == 0.0 and one.half_width == 0.0:
        return point_gap(one.x, one.y, rectangle) <= one.rounding
    other = Rectangle(one.x, one.y, one.cos, one.sin, one.half_length, one.half_width)
    if one.rounding == 0.0:
        return separation(rectangle, other) <= 0.0
    return is_within_reach(rectangle, other, one.rounding)


@compiled
def touched_at(path, outline, front, bodies, vehicle_gap, person_gap, below=ANY_BODY):
    """Return the row of the first of `bodies` that a vehicle with its front at s = `front` would touch, or `NONE`.

    Sideways it keeps the given gaps from vehicles and people, metres. Bodies from index `below` on do not count, but
    those as long as a tram's section.
    """
    return _touched_from(footprint(path, outline, front), outline, bodies, vehicle_gap, person_gap, below)


@compiled
def _touched_from(pose, outline, bodies, vehicle_gap, person_gap, below):
    """As `touched_at`, of a vehicle that is where `footprint` says."""
    cx, cy, c, s = pose
    length, width = outline.length / 2, outline.half_width
    reach = length + width + 0.5
    for k in range(len(bodies)):
        one = bodies[k]
        if one.body >= below and one.half_length < _LONG:
            continue
        dx, dy = one.x - cx, one.y - cy
        r = reach + one.radius
        if dx * dx + dy * dy > r * r:
            continue
        side = person_gap if one.rounding > 0.0 else vehicle_gap
        if touches(Rectangle(cx, cy, c, s, length + _NOSE, width + side), one):
            return k
    return NONE


@compiled
def _path_box(path, front, reach):
    """Return the least and greatest x and y of the path from the front to a little beyond `reach` metres ahead."""
    left, low, right, high = 1e18, 1e18, -1e18, -1e18
    for p in range(len(path)):
        point = path[p]
        is_passed = p + 1 < len(path) and path[p + 1].s < front - 2.0
        if is_passed or (p > 0 and path[p - 1].s > front + reach + 2.0):
            continue
        left, right = min(left, point.x), max(right, point.x)
        low, high = min(low, point.y), max(high, point.y)
    if path[len(path) - 1].s < front + reach + 2.0:
        x, y, _, _ = point_on_path(path, front + reach + 2.0)  # beyond its end it goes straight on
        left, right, low, high = min(left, x), max(right, x), min(low, y), max(high, y)
    return left, low, right, high


@compiled
def _near_path(path, outline, front, reach, one):
    """Return whether a body is near the path ahead, and the front's s from which on it may be met."""
    close = outline.half_width + one.radius + _NEAR_PATH
    for p in range(len(path) - 1):
        if path[p + 1].s < front - 2.0:
            continue
        if path[p].s > front + reach + 2.0:
            break
        ax, ay = path[p].x, path[p].y
        dx, dy = path[p + 1].x - ax, path[p + 1].y - ay
        wx, wy = one.x - ax, one.y - ay
        size2 = dx * dx + dy * dy
        is_last = p == len(path) - 2
        # Farther from the stretch's first point than its length and `close` together: (a + b)^2 <= 2 a^2 + 2 b^2.
        if not is_last and wx * wx + wy * wy > 2.0 * (size2 + close * close):
            continue
        t = (wx * dx + wy * dy) / size2
        # The last stretch goes straight on.
        t = max(t, 0.0) if is_last else min(max(t, 0.0), 1.0)
        ex, ey = wx - t * dx, wy - t * dy
        if ex * ex + ey * ey < close * close:
            return True, path[p].s + t * (path[p + 1].s - path[p].s) - close - one.radius - 2.0
    return False, 0.0


@compiled
def _sort_by_contact(path, outline, front, bodies):
    """Put the bodies whose gap the vehicle keeps already before those it is beside; return the former's number."""
    cx, cy, c, s = footprint(path, outline, front)
    apart = 0
    for k in range(len(bodies)):
        side = outline.person_gap if bodies[k].rounding > 0.0 else _VEHICLE_GAP
        grown = Rectangle(cx, cy, c, s, outline.length / 2 + _NOSE, outline.half_width + side)
        if not touches(grown, bodies[k]):
            if k != apart:
                spare = bodies[apart : apart + 1].copy()
                bodies[apart] = bodies[k]
                bodies[k] = spare[0]
            apart += 1
    return apart


@compiled
def _gap_to(path, outline, front, low, high, one, person_gap, vehicle_gap):
    """Return the metres the front can go before it touches the one body, known to be between `low` and `high`."""
    for _ in range(4):
        middle = (low + high) / 2
        if touched_at(path, outline, front + middle, one, vehicle_gap, person_gap) >= 0:
            high = middle
        else:
            low = middle
    return low


@inlined
def find_leader(view, front, reach, buffer):
    """Return the gap to the first body on the path and its index; `NO_GAP` and `NONE` without one within `reach`."""
    path, outline, nearby = view.path, view.outline, view.nearby
    m = 0
    start = 1e18
    left, low, right, high = _path_box(path, front, reach)
    for k in range(len(nearby)):
        x, y, close = nearby[k].x, nearby[k].y, outline.half_width + nearby[k].radius + _NEAR_PATH
        if x < left - close or x > right + close or y < low - close or y > high + close:
            continue
        near, first_contact = _near_path(path, outline, front, reach, nearby[k])
        if near:
            buffer[m] = nearby[k]
            start = min(start, first_contact)
            m += 1
    if m == 0:
        return NO_GAP, NONE
    # Who is beside already is no reason to stand: towards them only touching counts.
    apart = _sort_by_contact(path, outline, front, buffer[:m])
    ahead, beside = buffer[:apart], buffer[apart:m]
    person_gap = outline.person_gap
    x = max(0.0, np.floor(start - front))
    at = 0, 0
    while x < reach:
        step = _COARSE_STEP if x >= _COARSE_FROM else _FINE_STEP
        x += step
        at = axles_at(path, outline, front + x, at)
        pose = footprint_between(path, outline, front + x, at)
        hit = _touched_from(pose, outline, ahead, _VEHICLE_GAP, person_gap, ANY_BODY)
        if hit >= 0:
            one = ahead[hit : hit + 1]
            return _gap_to(path, outline, front, x - step, x, one, person_gap, _VEHICLE_GAP), one[0].body
        hit = _touched_from(pose, outline, beside, TOUCH, TOUCH, ANY_BODY) if len(beside) > 0 else NONE
        if hit >= 0:
            one = beside[hit : hit + 1]
            return _gap_to(path, outline, front, x - step, x, one, TOUCH, TOUCH), one[0].body
    return NO_GAP, NONE


COMFORTABLE_BRAKING = 2.0  # m/s^2 on dry ground; what vehicles do now is `vehicle.braking`
TIME_GAP = 1.2  # s on dry ground; now: `vehicle.time_gap`
CLOSING_UP = 1.2  # m nearer to its leader than usual stands who would else stand in a junction

_JAM_GAP = 1.8  # m kept behind a leader that stands
_LEAST_GAP = 0.3  # no step leaves less to the leader, m
_BEYOND_STOP = 3.0  # m beyond the place where a vehicle stops, others do not count
_LEAST_SPEED = 0.02  # slower is standing, m/s


@compiled
def look_ahead(vehicle):
    """Return how far ahead a vehicle minds what is there: braking distance, time gap and a little more, metres."""
    return vehicle.speed * vehicle.speed / (2 * vehicle.braking) + vehicle.speed * vehicle.time_gap + 8.0


@compiled
def braking_distance(vehicle):
    """Return the metres a vehicle needs to stop comfortably, and a little more."""
    return vehicle.speed * vehicle.speed / (2 * vehicle.braking) + 8.0


@compiled
def leader_speed(shapes, leader, view, front):
    """Return how fast the leader moves along the path where the vehicle would meet it, m/s; at least 0."""
    if leader < 0:
        return 0.0
    _, _, c, s = footprint(view.path, view.outline, front)
    return max(shapes.vx[leader] * c + shapes.vy[leader] * s, 0.0)


@compiled
def idm_acceleration(vehicle, desired, gap, leading):
    """Return the Intelligent Driver Model's acceleration, m/s^2.

    Parameters
    ----------
    desired
        The speed the vehicle would like, m/s.
    gap, leading
        Metres to the leader (`NO_GAP` for none) and its speed, m/s.
    """
    speed, greatest = vehicle.speed, vehicle.acceleration
    rate = greatest * (1.0 - (speed / max(desired, 0.1)) ** 4)
    if gap < NO_GAP:
        wish = speed * vehicle.time_gap + speed * (speed - leading) / (2 * np.sqrt(greatest * vehicle.braking))
        rate -= greatest * ((_JAM_GAP + max(wish, 0.0)) / max(gap, 0.05)) ** 2
    return rate


@compiled
def next_speed(vehicle, rate, limit, gap, stop, dt):
    """Return the speed after `dt` seconds: the model's, within the limit, short of the leader and of the stop.

    The last two hold even where no tyre brakes so hard: vehicles never touch.
    """
    speed, hardest = vehicle.speed, vehicle.hard_braking
    new = max(speed + max(rate, -hardest) * dt, 0.0)
    if new > limit:
        new = max(limit, speed - hardest * dt)
    if gap < NO_GAP:
        new = min(new, max(gap - _LEAST_GAP, 0.0) / dt)
    if stop < NEVER:
        new = min(new, stop / dt)
    return new if new >= _LEAST_SPEED else 0.0


@compiled
def clip_leader_before_stop(stop, gap, leader):
    """Return gap and leader; none if it is well beyond where the vehicle stops anyway."""
    if gap > stop + _BEYOND_STOP:
        return NO_GAP, NONE
    return gap, leader


#: Models that vehicles can be, by name.
VEHICLE_MODELS = [f"{kind}_{colour}" for kind, colours in CAR_KINDS.items() for colour in colours] + ["bus"]
VEHICLE_MODELS += [f"bicycle_{colour}" for colour in BICYCLE_PAINTS]

#: Share of each kind of car.
_KIND_SHARES = {"hatchback": 0.3, "sedan": 0.27, "suv": 0.23, "van": 0.12, "taxi": 0.08}
_CAR_ACCELERATION = 1.6  # m/s^2, on dry ground
_BUS_ACCELERATION = 1.1  # m/s^2, on dry ground
_HARD_BRAKING = 8.0  # m/s^2, on dry ground
_CAR_SPEED_FACTORS, _BUS_SPEED_FACTOR = (0.85, 1.05), 0.95


def choose_models(
    fleet: np.recarray, buses: Sequence[int], models: Sequence[str], seed: int
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Give every vehicle a model and the parameters that go with it.

    Parameters
    ----------
    fleet
        Cars, then buses, dtype `vico.sim.traffic.state.VEHICLE`; their parameters are set.
    buses
        Route of each bus.
    models
        Models of the first cars; empty where the seed decides.
    seed
        Decides models and paces.

    Returns
    -------
    tuple
        Model of each vehicle, an index into `VEHICLE_MODELS`, int32, and its height, metres.
    """
    random, cars = rng(seed, "traffic", "makes"), len(fleet) - len(buses)
    shares = np.array(
        [share for kind, colours in CAR_KINDS.items() for share in [_KIND_SHARES[kind] / len(colours)] * len(colours)]
    )
    chosen, bus_model = random.choice(len(shares), cars, p=shares / shares.sum()), VEHICLE_MODELS.index("bus")
    for v, model in enumerate(models):
        chosen[v] = VEHICLE_MODELS.index(model) if model else chosen[v]
    prototype = np.concatenate([chosen, np.full(len(buses), bus_model)]).astype(np.int32)
    sizes = np.array([vehicle_size(name) for name in VEHICLE_MODELS])[prototype].reshape(-1, 5)
    length, width, height, overhang, wheelbase = sizes.T.copy()
    car, bus = slice(0, cars), slice(cars, None)
    fleet.length, fleet.half_width, fleet.overhang, fleet.wheelbase = length, width / 2, overhang, wheelbase
    fleet.acceleration[car], fleet.acceleration[bus] = _CAR_ACCELERATION, _BUS_ACCELERATION
    fleet.braking, fleet.hard_braking, fleet.time_gap = COMFORTABLE_BRAKING, _HARD_BRAKING, TIME_GAP
    fleet.speed_factor[car] = random.uniform(*_CAR_SPEED_FACTORS, cars)
    fleet.speed_factor[bus] = _BUS_SPEED_FACTOR
    fleet.route[car], fleet.route[bus] = NONE, buses
    fleet.delivers = np.array([name.startswith("van_") for name in VEHICLE_MODELS])[prototype]
    return prototype, height


#: Half a cyclist's width, and how high one reaches, metres.
CYCLIST_HALF_WIDTH, CYCLIST_HEIGHT = 0.3, 1.75

_CYCLIST_SPEEDS = (3.6, 5.8)  # m/s that they like to ride
_CYCLIST_ACCELERATION, _CYCLIST_HARD_BRAKING = 0.9, 5.0  # m/s^2, on dry ground
_CYCLIST_FROM_EDGE = 0.65  # m from a lane's edge to a cyclist's middle
_STRAIGHT = 0.3  # share of a stretch of lane that is left of it at the kerb, at least: bends are not turned inside out
_SHARPEST = 0.5  # cosine of half the angle at a corner beyond which corners are cut


def kerb_points(lanes: LaneGraph) -> NDArray[np.float64]:
    """Return the points of the lines that cyclists follow: the lanes' own, moved towards the kerb.

    Returns
    -------
    ndarray
        ENU metres, shape ``(points, 2)``.
    """
    points, count = lanes.points, len(lanes.points)
    if not count:
        return points
    owner = np.repeat(np.arange(len(lanes)), np.diff(lanes.first))
    stretch = np.diff(points, axis=0)
    joined = owner[1:] == owner[:-1]
    size = np.hypot(stretch[:, 0], stretch[:, 1])
    unit = np.where(joined[:, None], stretch / np.maximum(size, 1e-9)[:, None], 0.0)
    total = np.zeros((count, 2))
    total[:-1] += unit
    total[1:] += unit
    # Of two stretches that meet half the sum is as long as the cosine of half the angle between them.
    both = np.zeros(count, np.bool_)
    both[1:-1] = joined[:-1] & joined[1:]
    length = np.hypot(total[:, 0], total[:, 1])
    half_angle = np.where(both, np.maximum(length / 2, _SHARPEST), 1.0)
    along = total / np.maximum(length, 1e-9)[:, None]
    right = np.column_stack([along[:, 1], -along[:, 0]]) * (-1.0 if lanes.lefthand else 1.0)
    aside = np.maximum(lanes.width[owner] / 2 - _CYCLIST_FROM_EDGE, 0.0) / half_angle
    for _ in range(12):
        moved = points + right * aside[:, None]
        left = (np.diff(moved, axis=0) * unit).sum(axis=1)
        folded = joined & (left < _STRAIGHT * size)
        if not folded.any():
            break
        aside[:-1][folded] *= 0.7
        aside[1:][folded] *= 0.7
    return np.asarray(points + right * aside[:, None], np.float64)


def equip_cyclists(fleet: np.recarray, seed: int) -> NDArray[np.int32]:
    """Give cyclists bicycles and the speeds they like.

    Parameters
    ----------
    fleet
        Their rows, dtype `vico.sim.traffic.state.VEHICLE`; their parameters are set.
    seed
        Decides paints and speeds.

    Returns
    -------
    ndarray
        Model of each one's bicycle, an index into `VEHICLE_MODELS`, int32.
    """
    random = rng(seed, "traffic", "cyclists")
    models = np.array([VEHICLE_MODELS.index(f"bicycle_{paint}") for paint in BICYCLE_PAINTS], np.int32)
    chosen = models[random.integers(len(models), size=len(fleet))]
    fleet.length, _, _, fleet.overhang, fleet.wheelbase = vehicle_size("bicycle")
    fleet.half_width, fleet.is_bicycle, fleet.route = CYCLIST_HALF_WIDTH, True, NONE
    fleet.acceleration, fleet.hard_braking = _CYCLIST_ACCELERATION, _CYCLIST_HARD_BRAKING
    fleet.braking, fleet.time_gap, fleet.speed_factor = COMFORTABLE_BRAKING, TIME_GAP, 1.0
    fleet.target_speed = random.uniform(*_CYCLIST_SPEEDS, len(fleet))
    return chosen


def starts_of_cyclists(
    lanes: LaneGraph, usable: NDArray[np.int64], count: int
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the lanes beside the kerb on which cyclists start, and how likely each is.

    Parameters
    ----------
    usable
        Lanes on which vehicles can start.
    count
        How many cyclists there are.

    Raises
    ------
    InputError
        If there are cyclists, but no lane for them.
    """
    kerb = usable[lanes.right[usable] < 0]
    if count and not len(kerb):
        raise InputError("traffic: the world has no street for cyclists; use --cyclists 0")
    return kerb, lanes.length[kerb] / max(float(lanes.length[kerb].sum()), 1e-9)
