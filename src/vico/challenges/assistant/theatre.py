"""Where a person plays an episode, and how what happens ten times a second is judged second by second."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from typing import Any, Protocol

from vico.agents.base import Agent
from vico.challenges.assistant.causes import Chronicle
from vico.challenges.assistant.judge import Judge
from vico.envs import Simulation
from vico.runner.gather import Gatherer
from vico.runner.loop import Director, Hook, Step
from vico.runner.recording import Recorder

#: The method that is a person.
HUMAN = "human"

# What is done all the time; everything else is told of at once.
_MOVING = ("move_forward", "turn_left", "turn_right", "look_at", "wait")


class Performance(Protocol):
    """An episode that a person plays, while it goes on."""

    @property
    def hooks(self) -> Sequence[Hook]:
        """Who follows it, after the recorder."""

    @property
    def director(self) -> Director:
        """Who holds it to the clock, and up while the person is away."""

    @property
    def over(self) -> bool:
        """Whether it is to end before its time."""

    def confirm(self) -> None:
        """Make sure that it was played to its end.

        Raises
        ------
        vico.errors.InputError
            If the person left and did not come back.
        """


class Theatre(Protocol):
    """Gives a person's agent, and a page to play it from."""

    @property
    def period(self) -> float:
        """Seconds between what the person does."""

    def agent(self, name: str) -> Agent:
        """Return who acts for the person."""

    def perform(
        self, recorder: Recorder, agents: Gatherer, task: Callable[[float], Mapping[str, Any]]
    ) -> AbstractContextManager[Performance]:
        """Open the page for an episode that is recorded.

        Parameters
        ----------
        task
            Returns what is asked, and what of it is done, at a second of the simulation.
        """


@dataclass(frozen=True)
class PlayedByHand:
    """A method one part of which is a person, and where they play.

    Attributes
    ----------
    method
        ``human``, or with another assistant's planner, joined by ``+``.
    """

    method: str
    theatre: Theatre


class Seconds(Hook):
    """Tells judge and chronicle of an episode each second, and at once of what assistants do beside moving.

    For those whose agents act oftener than once a second: what is counted are seconds, whoever plays.

    Parameters
    ----------
    start
        Second of the simulation at which the episode began.
    """

    def __init__(self, sim: Simulation, judge: Judge, chronicle: Chronicle, *, start: float) -> None:
        self._sim, self._judge, self._chronicle, self._start = sim, judge, chronicle, start

    def begin(self, observations: Mapping[str, dict[str, Any]]) -> None:
        """Let them take in how things stand."""
        self._judge.begin(observations)
        self._chronicle.begin(observations)

    def on_step(self, step: Step) -> None:
        """Tell them, if it is time."""
        passed = self._sim.state.second - self._start
        whole = abs(passed - round(passed)) < 1e-6
        # What is done within a second is done by its end.
        told = replace(step, number=round(passed) if whole else int(passed) + 1)
        acted = any(step.actions.get(name, {}).get("type", "wait") not in _MOVING for name in self._judge.assistants)
        if whole:
            self._judge.on_step(told)
        elif acted:
            self._judge.look(told.number)
            self._judge.take_reports(told)
        if whole or acted:
            self._chronicle.on_step(told)
