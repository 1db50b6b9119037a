"""The runner: asks agents, steps the simulation, tells the hooks that follow it, and saves now and then."""

from __future__ import annotations

import gc
import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from vico.agents.base import Action, AgentState
from vico.envs.spaces import short_form
from vico.errors import InputError
from vico.runner.gather import Failure, FaultLog, Gatherer, is_malformed
from vico.sim.loop.simulation import Simulation, StepResult


@contextmanager
def freeze_heap() -> Iterator[None]:
    """Keep the garbage collector from what is there already: a world is millions of objects, all of which stay.

    Looking through them takes a quarter of a second, which some step in every hundred would pay for.
    """
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()


log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Step:
    """Record of a step.

    Attributes
    ----------
    number
        From 1.
    actions
        By agent, as plain data.
    failures
        Why others have none.
    result
        What it brought.
    """

    number: int
    actions: Mapping[str, Action]
    failures: Mapping[str, Failure]
    result: StepResult


class Hook:
    """Follows a run: a recorder, a judge, a viewer, a progress bar. Each method does nothing unless overridden."""

    def begin(self, observations: Mapping[str, dict[str, Any]]) -> None:
        """Take in how things stand before the first step of this run (or after the one it is resumed from)."""

    def on_step(self, step: Step) -> None:
        """Take in a step."""

    def checkpoint(self, states: Mapping[str, AgentState]) -> None:
        """Save what every agent remembers, together with the simulation as it stands now."""


#: Reaches into a run from outside, between two steps: holds it up, changes the simulation. Returns what agents do in
#: the next step in place of their own actions.
Director = Callable[["Runner"], Mapping[str, Action]]


class Runner:
    """Runs a simulation with agents.

    Parameters
    ----------
    sim
        Before the first step, or where a run is resumed.
    agents
        Who acts; everybody else waits.
    hooks
        Who follows the run, told in this order.
    states_every
        After every so many steps all agents' states are taken and handed to the hooks; 0 never.
    faults
        Where to note what agents do wrong; where a run is resumed, with what they did before.
    director
        Called before each step; nobody reaches into the run if None.
    """

    def __init__(
        self,
        sim: Simulation,
        agents: Gatherer,
        *,
        hooks: Sequence[Hook] = (),
        states_every: int = 0,
        faults: FaultLog | None = None,
        director: Director | None = None,
    ) -> None:
        self.sim = sim
        self.agents = agents
        self.hooks = list(hooks)
        self.states_every = states_every
        self.faults = FaultLog() if faults is None else faults
        self.director = director
        self._looked_at = bool(set(agents.others) & {sim.agents[i] for i in sim.seeing})

    def run(self, steps: int, *, until: Callable[[], bool] = lambda: False) -> None:
        """Go on until the simulation has made `steps` steps in all, or `until` says so.

        Raises
        ------
        InputError
            If states are to be saved, and an agent has none to give.
        """
        with freeze_heap():
            self._run(steps, until)

    def _run(self, steps: int, until: Callable[[], bool]) -> None:
        sim = self.sim
        places, people = [place.id for place in sim.world.places], sim.state.people.names
        names = set(sim.agents)
        if self.states_every:
            _, failures = self.agents.states()
            for name, failure in failures.items():
                raise InputError(f"{name}: {failure.reason}")
        sim.look_away = self.agents.look_away()
        observations, infos = sim.observe(sim.due)
        for hook in self.hooks:
            hook.begin(observations)
        while sim.metrics.steps < steps and not until():
            directed = {} if self.director is None else self.director(self)
            if until():
                break
            if sim.defer_pictures and self._looked_at:
                sim.picture_waiter()()
            gathered = self.agents.gather(observations, infos)
            actions: dict[str, Action] = {}
            for name, action in gathered.actions.items():
                short = short_form(action, places, people)
                if isinstance(other := short.get("agent"), str) and other not in names:
                    gathered.failures[name] = Failure("malformed", f"there is no agent {other[:40]!r}")
                else:
                    actions[name] = short
            for name, action in directed.items():
                actions[name] = short_form(action, places, people)
                gathered.failures.pop(name, None)
            sim.look_away = self.agents.look_away()
            result = sim.step(actions, gathered.agent_faults)
            observations, infos = result.observations, result.infos
            self._note(Step(sim.metrics.steps, actions, gathered.failures, result))

    def save(self) -> bool:
        """Have the hooks keep the state between two steps; return whether every agent said what it remembers."""
        return self._save(self.sim.metrics.steps)

    def _note(self, step: Step) -> None:
        """Count what agents did wrong, tell the hooks, and save if it is time."""
        for name, failure in step.failures.items():
            self._fault(step.number, name, failure)
        for name in self.agents.others:
            observation = step.result.observations.get(name)
            if observation is None or name in step.failures:
                continue
            if is_malformed(observation["state"]["action_code"]):
                self._fault(step.number, name, Failure("malformed", observation["state"]["action_reason"]))
        for hook in self.hooks:
            hook.on_step(step)
        if self.states_every and step.number % self.states_every == 0:
            self._save(step.number)

    def _save(self, number: int) -> bool:
        states, failures = self.agents.states()
        for name, failure in failures.items():
            # Without everybody's state the run could not go on from here; it can from the checkpoint before.
            self._fault(number, name, Failure("state", f"no checkpoint: {failure.reason}"))
        if not failures:
            for hook in self.hooks:
                hook.checkpoint(states)
        return not failures

    def _fault(self, number: int, name: str, failure: Failure) -> None:
        if not self.faults.counts[name, failure.kind]:
            log.warning("%s: %s at step %d, and waits: %s", name, failure.kind, number, failure.reason)
        self.faults.add(number, name, failure.kind, failure.reason)
