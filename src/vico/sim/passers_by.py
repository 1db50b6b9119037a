"""People nobody plays, and assistants without a community: how they look, and how pedestrians move."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.assets.people import PASSERS_BY, Appearance, passer_by
from vico.assets.people.weather_clothes import dressed
from vico.community.model import Resident
from vico.seeds import rng
from vico.sim.animation import Transition, clip_index, stride_length
from vico.sim.animation.gait import WALK_START
from vico.sim.animation.stride import pace_on
from vico.sim.environment.weather import Weather
from vico.sim.traffic.drawing import PedestrianGaits
from vico.sim.traffic.state import STOP, TALK

# Who talks goes on for so long, then the other does, s.
_TURN_TO_TALK = 6.0
# Who waits at a stop looks at a phone for the first of these times out of every second one, s.
_AT_PHONE, _EVERY = 28.0, 47.0


def looks_of_strangers(seed: int, count: int) -> list[Appearance]:
    """Return how the people of a run look who have no looks of their own: its assistants first, then its pedestrians.

    Which of the shared looks come, and in which order, is the run's; no two are alike before all have come.
    """
    order = rng(seed, "looks").permutation(PASSERS_BY)
    return [passer_by(int(order[k % PASSERS_BY])) for k in range(count)]


def looks_of(residents: Sequence[Resident], strangers: int, seed: int, weather: Weather) -> list[Appearance]:
    """Return how people look who have dressed for the weather: residents, then strangers."""
    looks = [Appearance.from_dict(resident.appearance) for resident in residents]
    looks += looks_of_strangers(seed, strangers)
    return [dressed(look, weather.temperature, weather.rain, weather.snow) for look in looks]


def manner_of_pedestrian(pedestrian: int) -> str:
    """Return the name of the random stream that decides how a pedestrian carries itself."""
    return f"pedestrian_{pedestrian}"


class PedestrianMotion(NamedTuple):
    """Motions of pedestrians, as `vico.sim.animation.pose` takes them; arrays of one number each."""

    clip: NDArray[np.int64]
    phase: NDArray[np.float64]
    pace: NDArray[np.float64]
    after: Transition


def pedestrian_motion(gaits: PedestrianGaits, height: NDArray[np.float64], second: float) -> PedestrianMotion:
    """Return motion and place in its cycle of each pedestrian: they walk, stand and breathe, talk, sit, ride.

    Who waits at a stop looks at a phone now and then.

    Parameters
    ----------
    gaits
        How they walk.
    height
        Stature, metres, shape ``(n,)``.
    second
        Seconds since midnight of the first day.
    """
    idle = clip_index("idle")
    walk = np.where(gaits.cycling, clip_index("ride_bike"), clip_index("walk"))
    walking = gaits.time > 0.0
    n = np.arange(len(walking))
    start, stride = np.where(gaits.cycling, 0.0, WALK_START), stride_length(walk, gaits.pace, height)
    on_treads = gaits.treads
    in_stride = (start + gaits.walked / stride + (0.0 if on_treads is None else on_treads.cycles)) % 1.0
    # People at rest breathe by the clock, each at their own time.
    at_rest = (second * 0.5 + n * 0.37 + 0.1) % 1.0
    # Of two who talk one does and the other listens, by turns; one comes right after the other.
    talks = (gaits.standing == TALK) & ((second // _TURN_TO_TALK + n) % 2 == 0)
    still = np.where(gaits.seated, clip_index("ride_bus"), np.where(talks, clip_index("talk"), idle))
    at_rest = np.where(talks, (second / _TURN_TO_TALK * 2.0) % 1.0, at_rest)
    # The phone comes up and goes down within the motion.
    waited = (second + 13.0 * n) % _EVERY
    phones = (gaits.standing == STOP) & ~gaits.seated & ~walking & (waited < _AT_PHONE) & (n % 4 != 0)
    still = np.where(phones, clip_index("phone"), still)
    at_rest = np.where(phones, waited / _AT_PHONE, at_rest)
    after = Transition(
        np.where(walking & ~gaits.cycling, idle, walk),
        np.where(walking & ~gaits.cycling, at_rest, in_stride),
        gaits.pace,
        np.abs(gaits.time),
    )
    pace = gaits.pace
    if on_treads is not None:
        pace, pace_before = (pace_on(depth, gaits.pace, height) for depth in (on_treads.depth, on_treads.depth_before))
        then = (start + on_treads.walked_then / stride + on_treads.cycles_then) % 1.0
        steps = walking & ~gaits.cycling & (on_treads.time < gaits.time)
        after = Transition(
            np.where(steps, walk, after.clip),
            np.where(steps, then, after.phase),
            np.where(steps, pace_before, after.speed),
            np.where(steps, on_treads.time, after.since),
        )
    return PedestrianMotion(np.where(walking, walk, still), np.where(walking, in_stride, at_rest), pace, after)
