"""The hook that writes a run down."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vico.runner.loop import Hook, Step
from vico.sim.recorder import Recorder


class Recording(Hook):
    """Hands every step to a recorder.

    Parameters
    ----------
    recorder
        Of the same simulation.
    """

    def __init__(self, recorder: Recorder) -> None:
        self._recorder = recorder

    def begin(self, observations: Mapping[str, dict[str, Any]]) -> None:
        """Record how things stand before the first step."""
        self._recorder.begin(observations)

    def stepped(self, step: Step) -> None:
        """Record a step."""
        self._recorder.write(step.result, actions=step.actions)
