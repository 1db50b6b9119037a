"""What people's hands are about beside the motion: umbrellas in the rain, large things carried before the chest.

An umbrella is up by rule: it rains more than its owner minds, outdoors, on foot, at a walk, with a hand free. Who has
one is a trait, drawn with the run's seed; whether it was taken along is decided at the door, by sky and forecast.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vico.assets.models.movable import movable_grip
from vico.io.data_files import cached_data
from vico.rules import WALK_SPEED
from vico.seeds import rng
from vico.sim.animation import Hold
from vico.sim.simulation_state import SimulationState
from vico.sim.state import Posture, Vehicle

#: Shares of people who take an umbrella along when rain is about, and when none is.
_TAKES, _TAKES_ALWAYS = 0.75, 0.12
#: How soon rain has to come for it, seconds.
_AHEAD = (0.0, 3600.0, 3 * 3600.0, 6 * 3600.0)
#: Rain that the first and the last open an umbrella for, mm/h.
_FIRST, _LAST = 0.2, 1.6
#: Arms take so long to come up and down, seconds.
ARMS_TIME = 0.6
# Faster ones run.
_RUNS = 1.6 * WALK_SPEED
_ON_FOOT, _LYING = int(Vehicle.NONE), int(Posture.LYING)
_LEFT, _RIGHT, _CHEST = int(Hold.UMBRELLA_LEFT), int(Hold.UMBRELLA_RIGHT), int(Hold.BEFORE_CHEST)


def habit_of(seed: int, name: str) -> float:
    """Return how careful somebody is about rain, 0..1: 0 never goes out without an umbrella, 1 always does."""
    return float(rng(seed, "umbrella", name).random())


def bearable_rain(habit: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rain up to which people leave their umbrellas closed, mm/h."""
    return _FIRST + (_LAST - _FIRST) * habit / _TAKES


def carries_umbrella(habit: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return who has an umbrella along when rain is about."""
    return np.asarray(habit < _TAKES)


def take_umbrella(who: int | slice, state: SimulationState) -> None:
    """Decide whether someone, or several, who go out take umbrellas along."""
    p = state.people
    wet = state.environment.rain_within(_AHEAD) > _FIRST
    p.umbrella[who] = p.umbrella_habit[who] < (_TAKES if wet else _TAKES_ALWAYS)


def advance(state: SimulationState, dt: float) -> None:
    """Have arms come up to what they are to hold, or down from it, for `dt` seconds."""
    p = state.people
    objects = state.objects
    carried = (objects.hand >= 0).nonzero()[0]
    rain = state.environment.weather.rain
    if rain <= _FIRST and not len(carried) and not p.hold.any():
        return
    wanted = np.zeros(len(p), np.int8)
    _put_umbrellas_up(wanted, rain, state)
    rows = {entity: i for i, entity in enumerate(p.entity.tolist())} if len(carried) else {}
    for k, holder in zip(carried.tolist(), objects.holder[carried].tolist(), strict=True):
        # Both arms where the other hand is free; under one arm else.
        left, right = p.held[i := rows[holder]].tolist()
        if (left != 0) + (right != 0) == 1 and _is_for_arms(objects.prototypes[k], tuple(objects.size[k].tolist())):
            wanted[i] = _CHEST if p.vehicle[i] == _ON_FOOT and p.posture[i] != _LYING else 0
    going = p.hold == wanted
    if not wanted.any() and going.all():
        return
    step = dt / ARMS_TIME
    p.hold_share[going] = np.minimum(p.hold_share[going] + step * (p.hold[going] > 0), 1.0)
    p.hold_share[~going] = np.maximum(p.hold_share[~going] - step, 0.0)
    turned = ~going & (p.hold_share <= 0.0)
    p.hold[turned] = wanted[turned]


@cached_data
def _is_for_arms(prototype: str, size: tuple[float, float, float]) -> bool:
    """Whether a thing is carried before the chest."""
    return movable_grip(prototype, size) == "arms"


def _put_umbrellas_up(wanted: NDArray[np.int8], rain: float, state: SimulationState) -> None:
    p = state.people
    if rain <= _FIRST:
        return  # nobody minds
    up = p.umbrella & (rain > bearable_rain(p.umbrella_habit)) & (p.room < 0) & (p.vehicle == _ON_FOOT)
    up &= (p.posture != _LYING) & (p.move_speed <= _RUNS) & ~p.held.all(axis=1)
    wanted[up] = np.where(p.held[up, 1] == 0, _RIGHT, _LEFT)


def free_hand(i: int, state: SimulationState) -> int | None:
    """Return a hand with nothing in it, the right one first; None if there is none."""
    p = state.people
    hold = int(p.hold[i])
    for hand, umbrella in ((1, _RIGHT), (0, _LEFT)):
        if not p.held[i, hand] and hold not in (umbrella, _CHEST):
            return hand
    return None
