"""One demonstrated episode as policies are taught by it: what the robot saw and felt, and what it did next."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.agents.robot.increments import INCREMENTS, PERIOD, STATE
from vico.challenges.pick_place.demonstrator import Demonstrator
from vico.challenges.pick_place.episode import SIDE, Observation, Played, play
from vico.challenges.pick_place.task import PickPlaceTask, draw_task
from vico.world.world import World

#: Frames a second.
FPS = round(1.0 / PERIOD)


@dataclass(frozen=True)
class Demonstrated:
    """An episode that was shown.

    Attributes
    ----------
    task, played
        What was asked for, and what came of it.
    kept
        Numbers of the steps that are frames of it, int64, ascending, shape ``(m,)``.
    """

    task: PickPlaceTask
    played: Played
    kept: NDArray[np.int64]


def demonstrate(
    seed: int,
    world: World | None,
    *,
    seconds: int,
    side: int,
    drop_below: float = 0.0,
    seen: Callable[[int, dict[str, Any]], None] | None = None,
) -> Demonstrated:
    """Draw the task of a seed and show how it is done.

    Parameters
    ----------
    world
        Whose streets it is set in; None for a level field.
    seconds
        That it may last.
    side
        Of the pictures that are wanted, pixels; the robot sees no fewer than 224, for it plans by what it sees.
    drop_below
        Steps whose largest increment is smaller are left out, rad and metres, as in the paper (0.01).
    seen
        Told the number of each step and what the robot observed then.
    """
    task = draw_task(seed, world, seconds=seconds)
    count = 0

    def told(observation: Observation) -> None:
        nonlocal count
        if seen is not None:
            seen(count, observation)
        count += 1

    played = play(task, world, Demonstrator(period=PERIOD), side=max(side, SIDE), seen=told, to_the_end=True)
    largest = np.abs(played.actions).max(axis=1, initial=0.0)
    return Demonstrated(task, played, np.flatnonzero(largest >= drop_below))


__all__ = ["FPS", "INCREMENTS", "PERIOD", "STATE", "Demonstrated", "demonstrate"]
