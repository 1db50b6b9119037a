"""Wind where robots fly: stronger further up, and in gusts that are the same for everybody who asks.

Gusts are frozen turbulence that the mean wind carries along: a sum of waves with lengths from a metre to hundreds, of
amplitudes after Dryden's spectrum, with phases by the seed. So they have no state, and two robots side by side
feel much the same.

References
----------
US Department of Defense: MIL-F-8785C (1980), Dryden's spectra. Intensities here are 0.2 of the mean wind along and
across it and 0.1 upwards, and lengths 60 m and 20 m, as usual a few tens of metres above a town; both are rounded.
Wind by height: power law with the exponent 0.25 of towns, from the 10 m above ground that weather is told for.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.io.compiled import compiled
from vico.seeds import rng

_EXPONENT, _REFERENCE, _LOWEST = 0.25, 10.0, 1.0
_INTENSITY, _LENGTH = (0.2, 0.2, 0.1), (60.0, 60.0, 20.0)
_WAVES = 12


class Gusts(NamedTuple):
    """Waves of frozen turbulence; along the mean wind, across it to the left, and up.

    Attributes
    ----------
    number
        Radians a metre, shape ``(waves,)``.
    amplitude
        Shares of the mean wind, shape ``(3, waves)``.
    phase
        Radians, shape ``(3, waves)``.
    slant
        How much of each wave's number is across the wind, shape ``(waves,)``.
    """

    number: NDArray[np.float64]
    amplitude: NDArray[np.float64]
    phase: NDArray[np.float64]
    slant: NDArray[np.float64]


def gusts_of(seed: int) -> Gusts:
    """Return the gusts of a run."""
    stream = rng(seed, "gusts")
    edges = np.geomspace(2 * math.pi / 600.0, 2 * math.pi / 1.5, _WAVES + 1)
    number, width = np.sqrt(edges[1:] * edges[:-1]), np.diff(edges)
    amplitude = np.zeros((3, _WAVES))
    for k in range(3):
        scaled = _LENGTH[k] * number
        # Power by wave number, of variance 1; along the wind, and across and up.
        along, aside = 1.0 / (1.0 + scaled**2), (1.0 + 3.0 * scaled**2) / (1.0 + scaled**2) ** 2
        power = 2.0 * _LENGTH[k] / math.pi * along if k == 0 else _LENGTH[k] / math.pi * aside
        amplitude[k] = _INTENSITY[k] * np.sqrt(2.0 * power * width)
    phase = stream.uniform(0.0, 2.0 * math.pi, (3, _WAVES))
    return Gusts(number, amplitude, phase, stream.uniform(-0.5, 0.5, _WAVES))


@compiled
def air_at(gusts, mean, position, above, seconds, out):  # type: ignore[no-untyped-def]
    """Write how the air moves, m/s, ENU.

    Parameters
    ----------
    mean
        Mean wind 10 m above ground, m/s towards east and north.
    position, above
        Where, ENU metres, and how far above ground.
    seconds
        Since the start of the run.
    """
    speed = math.hypot(mean[0], mean[1])
    out[0] = out[1] = out[2] = 0.0
    if speed < 1e-6:
        return
    grown = speed * (max(above, _LOWEST) / _REFERENCE) ** _EXPONENT
    e, n = mean[0] / speed, mean[1] / speed
    along = position[0] * e + position[1] * n - speed * seconds
    across = position[1] * e - position[0] * n
    felt = np.zeros(3)
    felt[0] = 1.0
    for w in range(len(gusts.number)):
        turn = gusts.number[w] * (along + gusts.slant[w] * across)
        for k in range(3):
            felt[k] += gusts.amplitude[k, w] * math.sin(turn + gusts.phase[k, w])
    out[0] = grown * (felt[0] * e - felt[1] * n)
    out[1] = grown * (felt[0] * n + felt[1] * e)
    out[2] = grown * felt[2]
