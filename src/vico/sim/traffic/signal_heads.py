"""Where signals are seen: on the poles that the map has at stop lines and crossings, else on posts at the kerb."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.assets.signal_lights import signal_prototypes
from vico.sim.bodies import Drawn
from vico.sim.traffic.records import DARK, GREEN
from vico.sim.traffic.signals import LIGHT_NAMES
from vico.world.heights import HeightField
from vico.world.lanes import LaneGraph
from vico.world.mesh import Surface
from vico.world.objects import Objects
from vico.world.walkways import CROSSING, Walkways

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
        self._transforms = _transforms(
            np.concatenate([places[0], posts, places[1], posts]),
            np.concatenate([turns[driven], turn + np.pi, turns[seen], turn + np.pi]),
            np.concatenate([scales[driven], np.ones(len(own)), scales[seen], np.ones(len(own))]),
        )
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


def _transforms(
    place: NDArray[np.float64], yaw: NDArray[np.float64], scale: NDArray[np.float64]
) -> NDArray[np.float32]:
    found = np.zeros((len(place), 4, 4), np.float32)
    c, s = np.cos(yaw) * scale, np.sin(yaw) * scale
    found[:, 0, 0], found[:, 0, 1], found[:, 1, 0], found[:, 1, 1] = c, -s, s, c
    found[:, 2, 2], found[:, 3, 3] = scale, 1.0
    found[:, :3, 3] = place
    return found
