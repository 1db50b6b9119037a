"""How pedestrians walk, as those who draw them are told."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class StairGaits(NamedTuple):
    """How pedestrians walk on stairs; one number of each.

    Attributes
    ----------
    depth, depth_before
        Of the treads they walk on now, and before those changed, metres; 0 off stairs.
    time
        Seconds since they changed, counted up to `GAIT_TIME`.
    cycles
        Of the gait on treads since they set out.
    walked_then, cycles_then
        `PedestrianGaits.walked` and `cycles` when the treads changed.
    """

    depth: NDArray[np.float64]
    depth_before: NDArray[np.float64]
    time: NDArray[np.float64]
    cycles: NDArray[np.float64]
    walked_then: NDArray[np.float64]
    cycles_then: NDArray[np.float64]


class PedestrianGaits(NamedTuple):
    """How pedestrians walk; one number of each.

    Attributes
    ----------
    pace
        Speed that each prefers and that strides are those of, metres a second.
    walked
        Metres since it last set out, but for those on stairs.
    time
        Seconds since then, or since it stopped if negative; counted up to `GAIT_TIME`.
    standing
        Why it stands, or goes to stand: `WINDOW`, `TALK` and so on, 0 for who walks along.
    seated
        Whether it sits in a bus.
    cycling
        Whether it is a cyclist: it never stands for anything, and `walked` is what it has ridden.
    afoot
        Whether its feet are on the ground: it rides neither in a bus nor on a bicycle.
    treads
        On stairs; None where there are none.
    """

    pace: NDArray[np.float64]
    walked: NDArray[np.float64]
    time: NDArray[np.float64]
    standing: NDArray[np.uint8]
    seated: NDArray[np.bool_]
    cycling: NDArray[np.bool_]
    afoot: NDArray[np.bool_]
    treads: StairGaits | None = None
