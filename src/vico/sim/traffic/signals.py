"""Traffic signals: what they show, which vehicles they stop, and where their heads stand.

Programs are fixed-time, each begins at its own second, and the time of day decides which one runs. Nothing of it is
state: what a signal shows follows from the second, the seed, and where the power is cut. Heads hang on the poles that
the map has at stop lines and crossings, else on posts at the kerb.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.assets.models.library import signal_prototypes
from vico.io.compiled import compiled
from vico.seeds import rng
from vico.sim.bodies.arrays import Drawn
from vico.sim.traffic.state import AMBER, DARK, GREEN, RED, LaneNetwork, WalkwayNetwork
from vico.world.heights import HeightField
from vico.world.lanes import LaneGraph, SignalProgram
from vico.world.mesh import Surface
from vico.world.objects import Objects
from vico.world.walkways import CROSSING, Walkways

_ALL_RED = 2  # s between one way's amber and another one's green
_LONGEST_CYCLE, _LEAST_GREEN = 120, 8  # s: programs of many phases have shorter ones, but not shorter than that
_CLEARING = 10  # s between the end of people's green and that of who crosses their way, in netconvert's programs
_CLEARING_PACE = 1.0  # m/s at which everybody is over by then
_LEAST_WALK = 5  # s of green that people have at least
_AMBER_BRAKING = 1.4  # times as hard as drivers like they brake when a signal turns amber
_LIGHTS = {"G": GREEN, "g": GREEN, "y": AMBER, "Y": AMBER, "o": DARK, "O": DARK}

#: Names of what a signal shows.
LIGHT_NAMES = {DARK: "dark", GREEN: "green", AMBER: "amber", RED: "red"}

Circles = tuple[tuple[float, float, float], ...]


class SignalsShown(NamedTuple):
    """What every signal shows at a moment.

    Attributes
    ----------
    position
        Of the stop line's middle, or of a crossing's, ENU metres, float64, shape ``(n, 2)``.
    light
        DARK, GREEN, AMBER or RED, uint8, shape ``(n,)``.
    crossing
        Of a crossing's signal its ends and width: x, y, x, y, metres, float64, shape ``(n, 5)``; NaN for others.
    """

    position: NDArray[np.float64]
    light: NDArray[np.uint8]
    crossing: NDArray[np.float64]

    def near(self, x: float, y: float, reach: float) -> list[dict[str, Any]]:
        """Return the signals within `reach` metres of a point, as an agent's info has them."""
        found = []
        for k in np.flatnonzero(np.hypot(self.position[:, 0] - x, self.position[:, 1] - y) <= reach).tolist():
            one: dict[str, Any] = {
                "for": "vehicles" if np.isnan(self.crossing[k, 0]) else "pedestrians",
                "light": LIGHT_NAMES[self.light.item(k)],
                "position": np.round(self.position[k], 3).tolist(),
            }
            if one["for"] == "pedestrians":
                *ends, width = np.round(self.crossing[k], 3).tolist()
                one |= {"crossing": [ends[:2], ends[2:]], "width": width}
            found.append(one)
        return found


class SignalDay(NamedTuple):
    """What one signal shows where the power is not cut.

    Attributes
    ----------
    light
        From midnight on, over and over: DARK, GREEN, AMBER or RED in each second of its cycle, uint8, shape ``(s,)``.
    position
        Of the junction whose power decides, ENU metres.
    """

    light: NDArray[np.uint8]
    position: tuple[float, float]


class SignalClock:
    """Shows on lanes and crossings what their signals show.

    Parameters
    ----------
    lanes, walks
        What they are on.
    seed
        Decides how far each program is at midnight.
    """

    def __init__(self, lanes: LaneGraph, walks: Walkways, seed: int) -> None:
        lights, random = lanes.lights, rng(seed, "traffic", "signals")
        crossing = {name: i for i, name in enumerate(walks.ids) if name}
        there = [k for k, name in enumerate(lights.crossing) if name in crossing]
        self.lane, self._lane_link = lights.lane, lights.lane_link
        self.walkway = np.array([crossing[lights.crossing[k]] for k in there], np.int32)
        self._walk_link = lights.crossing_link[there]
        self._lane_program, self._walk_program = lights.lane_program, lights.crossing_program[there]
        tables = [_light_table(program) for program in lights.programs]
        for program, link, way in zip(
            self._walk_program.tolist(), self._walk_link.tolist(), self.walkway.tolist(), strict=True
        ):
            _let_clear(tables[program][:, link], float(walks.length[way]))
        self._cycle = np.array([len(table) for table in tables], np.int64)
        self._links = np.array([table.shape[1] for table in tables], np.int64)
        sizes = [table.size for table in tables]
        self._first = np.concatenate([[0], np.cumsum(sizes)[:-1]]).astype(np.int64)
        self._flat = np.concatenate([table.ravel() for table in tables]) if tables else np.zeros(0, np.uint8)
        self._offset = np.array([random.integers(len(table)) for table in tables], np.int64)
        start = lanes.points[lanes.first[self.lane]].reshape(-1, 2)
        ends = np.array([[*walks.line(int(i))[0], *walks.line(int(i))[-1], walks.width[i]] for i in self.walkway])
        ends = ends.reshape(-1, 5)
        self._place = np.concatenate([start, (ends[:, :2] + ends[:, 2:4]) / 2])
        self._ends = np.concatenate([np.full((len(start), 5), np.nan), ends])
        count = np.bincount(self._lane_program, minlength=len(tables))[:, None]
        total = np.column_stack([np.bincount(self._lane_program, start[:, k], len(tables)) for k in range(2)])
        self.position = total / np.maximum(count, 1)
        self._zone = lanes.zone[self.lane]
        self._shown: tuple[int, Circles] | None = None

    def show(self, second: int, dark: Circles, net: LaneNetwork, paths: WalkwayNetwork) -> NDArray[np.int32] | None:
        """Write what the signals show into lanes and walkways; the same again costs nothing.

        Parameters
        ----------
        second
            Since midnight.
        dark
            Where the power is cut: x, y and radius of circles, metres.

        Returns
        -------
        ndarray or None
            Junction clusters whose signals are dark, int32; None where nothing has changed.
        """
        if (second, dark) == self._shown:
            return None
        self._shown = second, dark
        row = self._first + (second + self._offset) % self._cycle * self._links if len(self._cycle) else self._first
        out = np.zeros(len(row), np.bool_)
        for x, y, radius in dark:
            out |= np.hypot(self.position[:, 0] - x, self.position[:, 1] - y) <= radius
        for records, rows, program, link in (
            (net.lanes, self.lane, self._lane_program, self._lane_link),
            (paths.walkways, self.walkway, self._walk_program, self._walk_link),
        ):
            lit = self._flat[row[program] + link] if len(rows) else np.zeros(0, np.uint8)
            records["light"][rows] = np.where(out[program], DARK, lit)
        return np.unique(self._zone[out[self._lane_program]]).astype(np.int32)

    def day_of_lane(self, lane: int) -> SignalDay:
        """Return what the signal on a lane shows, second by second."""
        (row,) = np.flatnonzero(self.lane == lane)[:1]
        return self._day(int(self._lane_program[row]), int(self._lane_link[row]))

    def day_of_walkway(self, walkway: int) -> SignalDay:
        """Return what the signal of a crossing shows, second by second."""
        (row,) = np.flatnonzero(self.walkway == walkway)[:1]
        return self._day(int(self._walk_program[row]), int(self._walk_link[row]))

    def _day(self, program: int, link: int) -> SignalDay:
        cycle, links, first = (int(a[program]) for a in (self._cycle, self._links, self._first))
        column = self._flat[first : first + cycle * links].reshape(cycle, links)[:, link]
        x, y = self.position[program].tolist()
        return SignalDay(np.roll(column, -int(self._offset[program])), (x, y))

    def signals_shown(self, net: LaneNetwork, paths: WalkwayNetwork) -> SignalsShown:
        """Return what all of them show now, as `show` has written it."""
        light = np.concatenate([net.lanes["light"][self.lane], paths.walkways["light"][self.walkway]])
        return SignalsShown(self._place, light, self._ends)


def _light_table(program: SignalProgram) -> NDArray[np.uint8]:
    """Return what a program's links show in each second, with all of them red for a while after amber, (s, links)."""
    phases = [np.array([_LIGHTS.get(letter, RED) for letter in state], np.uint8) for state in program.states]
    rows: list[NDArray[np.uint8]] = []
    for k, (phase, seconds) in enumerate(zip(phases, _shorten_phases(program.seconds), strict=True)):
        rows += [phase] * seconds
        following = phases[(k + 1) % len(phases)]
        if (phase == AMBER).any():
            rows += [np.where((phase == GREEN) & (following == GREEN), GREEN, RED).astype(np.uint8)] * _ALL_RED
    return np.array(rows)


def _shorten_phases(seconds: tuple[int, ...]) -> list[int]:
    """Return the lengths of phases, shorter where the whole takes too long: many joined junctions in turn."""
    long = [second for second in seconds if second > _LEAST_GREEN]
    too_many = max(sum(seconds) - _LONGEST_CYCLE, 0)
    share = max(1.0 - too_many / sum(long), 0.0) if long else 1.0
    return [second if second <= _LEAST_GREEN else max(round(second * share), _LEAST_GREEN) for second in seconds]


def _let_clear(column: NDArray[np.uint8], length: float) -> None:
    """End people's green early enough for those who set out last to be over a crossing of some length, metres."""
    early = int(np.ceil(length / _CLEARING_PACE)) - _CLEARING
    green = column == GREEN
    if early <= 0 or green.all():
        return
    for end in np.flatnonzero(green & ~np.roll(green, -1)).tolist():
        run = 0
        while green[end - run]:
            run += 1
        for k in range(min(early, run - _LEAST_WALK)):
            column[end - k] = RED


@compiled
def is_stopped_by_signal(net, vehicle, k):
    """Return whether the first signal in the junction of a vehicle's k-th planned lane stops it.

    Who is in that junction already clears it.
    """
    junction = net.lanes[vehicle.planned_lanes[k]].junction
    if net.lanes[vehicle.lane].junction == junction:
        return False
    for i in range(k, vehicle.planned_count):
        lane = net.lanes[vehicle.planned_lanes[i]]
        if lane.junction != junction:
            break
        if lane.light != DARK:
            return lane.light != GREEN
    return False


@compiled
def loses_its_green(net, vehicle):
    """Return whether a vehicle that was let into a junction has not reached it, has no green any more, and can stop."""
    distance = net.lanes[vehicle.lane].length - vehicle.offset
    for k in range(vehicle.granted_count):
        if net.lanes[vehicle.planned_lanes[k]].junction >= 0:
            needed = vehicle.speed * vehicle.speed / (2 * _AMBER_BRAKING * vehicle.braking)
            return distance > needed and is_stopped_by_signal(net, vehicle, k)
        distance += net.lanes[vehicle.planned_lanes[k]].length
    return False


_NEAR_STOP, _NEAR_CROSSING = 15.0, 6.0  # m that a pole may stand away from the stop line or the crossing's end
_AGAINST = 0.6  # cosine of the angle up to which a pole faces those who come
_BESIDE = 0.12  # m beside its lane that a post stands: on the kerb, where nobody walks or drives


class PlacedHeads(NamedTuple):
    """Lenses for vehicles, then those for people, then posts.

    Attributes
    ----------
    lane
        Of each of the first, the lane whose signal it shows, int32, shape ``(l,)``.
    walkway
        Of each of the second, the crossing whose signal it shows, int32, shape ``(w,)``.
    transforms
        Of all, model to world, float32, shape ``(l + w + posts, 4, 4)``.
    """

    lane: NDArray[np.int32]
    walkway: NDArray[np.int32]
    transforms: NDArray[np.float32]


class SignalHeads:
    """The lenses of all signals, drawn as they are lit; no bodies of their own.

    Parameters
    ----------
    lanes, walks
        With signals.
    poles
        Objects of the world of the kind ``traffic_signals``.
    height
        Of the ground.
    """

    def __init__(self, lanes: LaneGraph, walks: Walkways, poles: Objects, height: HeightField) -> None:
        rows, before = _shown_lanes(lanes)
        stops = lanes.at(before, lanes.length[before]).reshape(-1, 3)
        crossing = {name: i for i, name in enumerate(walks.ids) if name}
        walked = np.array([crossing[name] for name in lanes.lights.crossing if name in crossing], np.int32)
        at = np.column_stack([poles.x, poles.y])
        stop_of = _nearest_stop(at, np.asarray(poles.yaw), stops)
        walk_of = _nearest_crossing(at, walks, walked)
        driven, seen = np.flatnonzero(stop_of >= 0), np.flatnonzero(walk_of >= 0)
        # Streets whose signal is on no pole get a post at their kerb.
        has_pole = np.isin(lanes.edge[before], lanes.edge[before[stop_of[driven]]])
        own = np.flatnonzero(~has_pole & (lanes.right[before] < 0))
        aside = (lanes.width[before[own]] / 2 + _BESIDE) * (1.0 if lanes.lefthand else -1.0)
        turn = stops[own, 2]
        posts = stops[own, :2] + aside[:, None] * np.column_stack([-np.sin(turn), np.cos(turn)])
        ends = lanes.z[lanes.first[before[own] + 1] - 1]
        posts = np.column_stack([posts, height.near(np.column_stack([posts, ends]))])
        # Lenses for vehicles on poles and posts, those for people; then the posts.
        self._lane = rows[np.concatenate([stop_of[driven], own])]
        self._walkway = walked[walk_of[seen]]
        places = [np.column_stack([at[k], poles.z[k]]) for k in (driven, seen)]
        turns, scales = np.asarray(poles.yaw), np.asarray(poles.scale)
        place = np.concatenate([places[0], posts, places[1], posts])
        yaw = np.concatenate([turns[driven], turn + np.pi, turns[seen], turn + np.pi])
        scale = np.concatenate([scales[driven], np.ones(len(own)), scales[seen], np.ones(len(own))])
        self._transforms = np.zeros((len(place), 4, 4), np.float32)
        c, s = np.cos(yaw) * scale, np.sin(yaw) * scale
        self._transforms[:, 0, 0], self._transforms[:, 0, 1] = c, -s
        self._transforms[:, 1, 0], self._transforms[:, 1, 1] = s, c
        self._transforms[:, 2, 2], self._transforms[:, 3, 3] = scale, 1.0
        self._transforms[:, :3, 3] = place
        entity = np.asarray(poles.entity, np.int32)
        nobody = np.zeros(len(own), np.int32)
        self._entity = np.concatenate([entity[driven], nobody, entity[seen], nobody])
        self._posts = len(own)
        self._names = list(signal_prototypes())
        number = {name: k for k, name in enumerate(self._names)}
        self._of_lane = np.array([number[f"signal_{LIGHT_NAMES[light]}"] for light in sorted(LIGHT_NAMES)], np.int32)
        on_foot = {DARK: "dark", GREEN: "green"}
        self._of_walk = np.array(
            [number[f"walk_{on_foot.get(light, 'red')}"] for light in sorted(LIGHT_NAMES)], np.int32
        )
        self._post = number["signal_post"]

    def draw(self, lane_light: NDArray[np.uint8], walk_light: NDArray[np.uint8]) -> Drawn:
        """Return the lenses as they are lit; given is what each lane's and walkway's signal shows."""
        index = np.concatenate(
            [
                self._of_lane[lane_light[self._lane]],
                self._of_walk[walk_light[self._walkway]],
                np.full(self._posts, self._post, np.int32),
            ]
        )
        return Drawn(self._names, index, self._transforms, self._entity)

    @property
    def placed(self) -> PlacedHeads:
        """Where the lenses and posts are, and whose signal each shows."""
        return PlacedHeads(self._lane, self._walkway, self._transforms)

    @staticmethod
    def prototypes() -> dict[str, list[Surface]]:
        """Models by the names that `draw` uses."""
        return signal_prototypes()


def _shown_lanes(lanes: LaneGraph) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Return, for each lane that ends at a signal, the straightest of the lanes behind it, whose signal is shown.

    Returns
    -------
    tuple
        These lanes, and those that end at the signals, int32, shape ``(k,)`` each.
    """
    found: dict[int, tuple[float, int]] = {}
    for lane in lanes.lights.lane.tolist():
        before = lanes.preceding(lane)
        if not len(before):
            continue
        turn = lanes.at(lane, lanes.length[lane])[2] - lanes.at(lane, 0.0)[2]
        straight = abs((float(turn) + np.pi) % (2 * np.pi) - np.pi)
        key = int(before[0])
        found[key] = min(found.get(key, (np.inf, lane)), (straight, lane))
    return np.array([lane for _, lane in found.values()], np.int32), np.array(list(found), np.int32)


def _nearest_stop(at: NDArray[np.float64], yaw: NDArray[np.float64], stops: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return for each pole the stop line, of those whose drivers it faces, that is nearest; -1 for none."""
    if not len(stops) or not len(at):
        return np.full(len(at), -1, np.int64)
    away = np.hypot(at[:, None, 0] - stops[None, :, 0], at[:, None, 1] - stops[None, :, 1])
    against = np.cos(yaw[:, None] - stops[None, :, 2]) < -_AGAINST
    away = np.where(against, away, np.inf)
    nearest = away.argmin(axis=1)
    return np.where(away[np.arange(len(at)), nearest] <= _NEAR_STOP, nearest, -1)


def _nearest_crossing(at: NDArray[np.float64], walks: Walkways, walked: NDArray[np.int32]) -> NDArray[np.int64]:
    """Return for each pole the crossing, of those with signals, one of whose ends is nearest; -1 for none."""
    walked = walked[walks.kind[walked] == CROSSING] if len(walked) else walked
    if not len(walked) or not len(at):
        return np.full(len(at), -1, np.int64)
    ends = np.stack([walks.points[walks.first[walked]], walks.points[walks.first[walked + 1] - 1]])
    away = np.linalg.norm(at[:, None, None, :] - ends[None], axis=3).min(axis=1)
    nearest = away.argmin(axis=1)
    return np.where(away[np.arange(len(at)), nearest] <= _NEAR_CROSSING, nearest, -1)
