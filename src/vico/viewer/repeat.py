"""A recorded run, simulated once more with what its agents did, and looked at between its steps."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Literal, TypeVar

from pydantic import TypeAdapter

from vico.community import Community, read_community
from vico.errors import InputError, MissingFileError, SchemaError
from vico.rules import ActionStatus
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.sim.recording import Run
from vico.sim.recording.interventions import intervene, read_interventions, repeat_drops, repeat_setup
from vico.sim.state.simulation_state import SimulationState
from vico.sim.state.steps import TICKS_PER_SECOND
from vico.world.folder import is_world, read_world
from vico.world.world import World

T = TypeVar("T")


class RepeatedRun:
    """Simulates a recorded run again: from a checkpoint, with the recorded actions, each step's hash compared.

    Parameters
    ----------
    run
        The recording.
    world, community
        That it was made with.
    setup
        What was done to the simulation before its first step, such as adding objects; what the recording says of it
        if None.

    Attributes
    ----------
    sim
        The simulation, at the step that was repeated last; nobody's views are rendered.

    Raises
    ------
    SchemaError
        If this version of vico, or another world or community, would make another run.
    """

    def __init__(
        self,
        run: Run,
        world: World,
        community: Community | None,
        *,
        setup: Callable[[Simulation], None] | None = None,
    ) -> None:
        self.run = run
        self._world, self._community, self._setup = world, community, setup
        self._lines = read_interventions(run.path)
        self._begin()

    def _begin(self) -> None:
        """Set the scene as it was before the first step."""
        manifest = self.run.manifest
        config = TypeAdapter(SimConfig).validate_python(manifest["config"])
        self.sim = Simulation(self._world, self._community, config)
        if self._setup is None:
            repeat_setup(self.run.path, self.sim.scenario)
        else:
            self._setup(self.sim)
        if self.sim.identity != manifest["identity"]:
            raise SchemaError(
                f"{self.run.path}: was made by {manifest['producer']} with another configuration, world or community "
                "than this vico would take; record it anew"
            )
        self.sim.seeing = []
        self._at = self._done = 0
        if self.sim.state_hash() != self.run.hashes[0]:
            raise self._differs(0)

    @classmethod
    def of_folders(cls, run: Run, *, world: Path | None = None, community: Path | None = None) -> RepeatedRun:
        """Read world and community where the recording says they are, unless told.

        Raises
        ------
        MissingFileError
            If they are not there.
        """
        place = read_world(_folder(run, world, "world"))
        people = None
        if run.manifest["community"] is not None:
            people = read_community(_folder(run, community, "community"), place)
        return cls(run, place, people)

    @property
    def step(self) -> int:
        """The step that was repeated last."""
        return self._at

    def go_to(self, step: int) -> None:
        """Go to a step, from the checkpoint before it."""
        kept = [k for k in self.run.checkpoints if k <= step]
        if kept and (self._at > step or kept[-1] > self._at):
            checkpoint = self.run.checkpoint(kept[-1])
            if checkpoint.interventions < self._done:
                self._begin()  # what was dropped since can't be taken away
            repeat_drops(self.sim, self._lines[self._done : checkpoint.interventions])
            self.sim.restore(checkpoint.arrays)
            self._at, self._done = kept[-1], checkpoint.interventions
        if self._at > step:
            raise InputError(f"{self.run.path}: step {step} is behind; repeat the run from its beginning")
        while self._at < step:
            self._step()

    def moments(self, last: int, look: Callable[[SimulationState], T]) -> Iterator[list[T]]:
        """Yield what `look` makes of each tenth of a second, a list a step, up to the step `last`."""
        while self._at < last:
            seen: list[T] = []
            self.sim.state.on_substep = lambda seen=seen: seen.append(look(self.sim.state))
            try:
                self._step()
            finally:
                self.sim.state.on_substep = None
            yield seen

    def _step(self) -> None:
        step = self._at + 1
        while self._done < len(self._lines) and self._lines[self._done].after <= self._at:
            # What agents were made to do is among the recorded actions.
            intervene(self.sim, self._lines[self._done].intervention)
            self._done += 1
        self._pass_unrecorded(step)
        actions: dict[str, Any] = {}
        faults: dict[str, tuple[ActionStatus, str]] = {}
        for name, record in self.run.at(step).agents.items():
            if record.action is not None:
                actions[name] = record.action
            if record.status in ("late", "failed"):
                faults[name] = ActionStatus[record.status.upper()], record.reason
        result = self.sim.step(actions, faults)
        self._at = step
        if result.hash != self.run.hashes[step]:
            raise self._differs(step)

    def _pass_unrecorded(self, step: int) -> None:
        """Let the time pass in which nobody was asked for anything before a step, such as during an appointment."""
        now, times = self.sim.state.tick, self.run.times
        ticks = round(float(times[step] - times[step - 1]) * TICKS_PER_SECOND)
        ticks -= self.sim.periods.next_due(now) - now
        if ticks <= 0:
            return
        watcher, self.sim.state.on_substep = self.sim.state.on_substep, None
        self.sim.act({})
        self.sim.advance(ticks / TICKS_PER_SECOND)
        self.sim.state.on_substep = watcher

    def _differs(self, step: int) -> SchemaError:
        return SchemaError(
            f"{self.run.path}: simulated again, step {step} is another one than recorded: the run was changed while it "
            f"went on, or made by another vico ({self.run.manifest['producer']}); record it anew"
        )


def _folder(run: Run, given: Path | None, what: Literal["world", "community"]) -> Path:
    folder = given or run.source(what)
    if not (is_world(folder) if what == "world" else (folder / "community.json").exists()):
        raise MissingFileError(f"{run.path}: its {what} is no longer at {folder}; say where it is with --{what}")
    return folder
