"""What a manipulation task is made of; each stands in a file of its own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vico.challenges.learning.manipulation.draws import Episode
from vico.challenges.learning.manipulation.options import ManipulationOptions
from vico.challenges.learning.manipulation.readings import Bools, Readings
from vico.challenges.learning.manipulation.scene import Array


@dataclass(frozen=True)
class ManipulationTask:
    """A task for an arm.

    Attributes
    ----------
    name
        As in its id.
    begin
        Draws an episode.
    evaluate
        Says for each copy what holds, by name; ``"success"`` is one of the names.
    staged
        Returns the staged reward, per step about 1 at most, shape ``(n,)``.
    paper_terms
        Which terms of the paper's reward there are: ``"object"``, ``"goal"``, ``"grasp"``, ``"place"``.
    """

    name: str
    begin: Callable[[np.random.Generator, ManipulationOptions], Episode]
    evaluate: Callable[[Readings], dict[str, Bools]]
    staged: Callable[[Readings], Array]
    paper_terms: tuple[str, ...]
