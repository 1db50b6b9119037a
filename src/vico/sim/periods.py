"""Time in layers: ticks, sub-steps, and how often each agent acts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vico.errors import InputError

#: The state counts ticks of 0.01 s since the midnight before the run.
TICKS_PER_SECOND = 100
#: Traffic, transit and avatars advance by so many ticks at once, on ticks that are multiples of it.
SUBSTEP_TICKS = 10
#: The same, seconds.
SUBSTEP = SUBSTEP_TICKS / TICKS_PER_SECOND
#: What an avatar's action describes, ticks; whoever acts oftener cuts the motion short.
ACTION_TICKS = TICKS_PER_SECOND

_LONGEST = 3600 * TICKS_PER_SECOND


def ticks_of(seconds: float, what: str, *, multiple: int = 1) -> int:
    """Return a time as ticks.

    Parameters
    ----------
    what
        Names the time in errors.
    multiple
        It has to be a multiple of so many ticks.

    Raises
    ------
    InputError
        If it is not a positive multiple, or longer than an hour.
    """
    step = multiple / TICKS_PER_SECOND
    exact = float(seconds) * TICKS_PER_SECOND
    if not np.isfinite(exact) or not 0.0 < exact <= _LONGEST:
        raise InputError(f"{what} is {seconds} s; it has to be more than 0 and at most an hour")
    ticks = round(exact)
    if abs(ticks - exact) > 1e-6 or ticks % multiple:
        raise InputError(f"{what} is {seconds} s; it has to be a multiple of {step:g} s")
    return ticks


@dataclass(frozen=True)
class ControlPeriods:
    """How often each agent of a run acts and observes; never changes.

    Attributes
    ----------
    start
        Tick of the state at which the run began: everybody is due then.
    ticks
        Each agent's period, int64, shape ``(agents,)``, in the order of their names.
    """

    start: int
    ticks: NDArray[np.int64]

    @classmethod
    def of(
        cls, people: Sequence[str], robots: Mapping[str, float], asked: Mapping[str, float | str], *, start: int
    ) -> ControlPeriods:
        """Return the periods of a run's agents: 1 s each, unless others are asked for.

        Parameters
        ----------
        people
            Names of residents and assistants.
        robots
            Control period of each robot's model by the robot's name, seconds.
        asked
            Periods by agent's name, seconds; ``"model"`` is the period of a robot's model, ``"robots"`` stands for
            all robots.
        start
            Tick at which the run begins.

        Raises
        ------
        InputError
            If nobody has a name, or a period is none: people's are multiples of 0.1 s, robots' of 0.01 s.
        """
        given = dict(asked)
        if "robots" in given:
            everyone = given.pop("robots")
            given = dict.fromkeys(robots, everyone) | given
        names = [*people, *robots]
        unknown = [name for name in given if name not in names]
        if unknown:
            raise InputError(
                f"periods: nobody is called {unknown[0]!r}; there are {', '.join(names)}"
                + (", and 'robots' for all robots" if robots else "")
            )
        ticks = np.full(len(names), TICKS_PER_SECOND, np.int64)
        for k, name in enumerate(names):
            value = given.get(name, 1.0)
            if isinstance(value, str):
                if value != "model" or name not in robots:
                    raise InputError(
                        f"periods: {name} has the period {value!r}; give seconds"
                        + (', or "model" for its model\'s own' if name in robots else "")
                    )
                value = robots[name]
            ticks[k] = ticks_of(value, f"periods: {name}'s", multiple=1 if name in robots else SUBSTEP_TICKS)
        return cls(start, ticks)

    @property
    def equal(self) -> bool:
        """Whether all agents act at the same times."""
        return not len(self.ticks) or bool((self.ticks == self.ticks[0]).all())

    def due(self, tick: int) -> NDArray[np.bool_]:
        """Return who observes and acts at a tick, shape ``(agents,)``."""
        return np.asarray((tick - self.start) % self.ticks == 0)

    def next_due(self, tick: int) -> int:
        """Return the first tick after this one at which somebody acts; a second later where there is nobody."""
        if not len(self.ticks):
            return tick + TICKS_PER_SECOND
        return tick + int((self.ticks - (tick - self.start) % self.ticks).min())

    def since_begun(self, tick: int) -> NDArray[np.int64]:
        """Return how many ticks ago each agent acted last, shape ``(agents,)``; 0 for those who are due."""
        return np.asarray((tick - self.start) % self.ticks)
