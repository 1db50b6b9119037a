"""When a policy that acts at a rate of its own is asked, by a robot that acts at another."""

from __future__ import annotations

from typing import NamedTuple

from vico.errors import InputError

# Control periods are multiples of this, seconds.
_TICK = 0.01


class Due(NamedTuple):
    """What is to be done in a period.

    Attributes
    ----------
    asks
        How often the policy is to be asked: with a period longer than its own several times on end, from what is known
        now, as no newer observation comes.
    share
        How much of its last action's time will be over at the end of the period, 0 to 1: servos are to have come so
        far.
    """

    asks: int
    share: float


class PolicyClock:
    """Counts a policy's periods within a robot's.

    Parameters
    ----------
    period
        Seconds between two actions of the robot.
    own
        Seconds between two actions that the policy was trained with.

    Raises
    ------
    InputError
        If either is no multiple of 0.01 s.
    """

    def __init__(self, period: float, *, own: float) -> None:
        for seconds in (period, own):
            if seconds < _TICK / 2 or abs(seconds / _TICK - round(seconds / _TICK)) > 1e-6:
                raise InputError(f"policy: a period of {seconds:g} s; it has to be a multiple of {_TICK:g} s")
        self._period, self._own = round(period / _TICK), round(own / _TICK)
        self.ticks = 0

    def tick(self) -> Due:
        """Pass on to the next period; return what is due in the one that begins."""
        before, end = -(-self.ticks // self._own), self.ticks + self._period
        after = -(-end // self._own)
        self.ticks = end
        return Due(after - before, min(1.0, (end - self._own * (after - 1)) / self._own))
