"""The loop: what agents ask for, time until the next agent is due, what agents see; seeded and repeatable."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from vico.clock import clock_of
from vico.errors import InputError, OutputError, some_of
from vico.io.cache import cache_folder
from vico.sim.actions import AgentFault, apply_actions
from vico.sim.config import SimConfig, find_by_name
from vico.sim.loop.checks import OverlapCheck, run_reports
from vico.sim.loop.punctuality import Punctuality
from vico.sim.loop.scenario import GroundTruth, Scenario
from vico.sim.loop.start import initial_state
from vico.sim.loop.substeps import Metrics, StopWatch, advance_ticks
from vico.sim.observations import ByAgent, ObservationRenderer, Observations, observe
from vico.sim.people.hearing import follow_city_events
from vico.sim.people.placement import advance_lines
from vico.sim.physics.records import PhysicsError
from vico.sim.state.base import SimulationBase
from vico.sim.state.simulation_state import SimulationState
from vico.sim.state.snapshot import arrays_of, identity, read_snapshot, state_hash, write_snapshot
from vico.sim.state.steps import TICKS_PER_SECOND, ControlPeriods, Event, ticks_of
from vico.world.mesh import Surface
from vico.world.world import World

if TYPE_CHECKING:
    from vico.assets.people import Appearance
    from vico.community.model import Community

__all__ = ["Simulation", "StepResult"]
# Seconds after which memory that files are read into is given back.
_PAGES_EVERY = 60


@dataclass(frozen=True)
class StepResult:
    """Result of a step.

    Attributes
    ----------
    observations, infos
        By agent, of those who act next; see `vico.sim.observations.observe`.
    events
        What happened in the step.
    told_hash
        Finds `hash`.
    """

    observations: Observations
    infos: ByAgent
    events: list[Event]
    told_hash: Callable[[], str]

    @cached_property
    def hash(self) -> str:
        """Hash of the state after the step, hex; found when it is asked for.

        Raises
        ------
        InputError
            If the simulation has gone on since.
        """
        return self.told_hash()


class Simulation:
    """A world, its people, and time.

    Parameters
    ----------
    world
        Where it happens.
    community
        Whose residents take part; None for nobody.
    config
        What the run is asked to be.
    base
        What never changes about the world; None takes the one that is kept with the world.
    renderer
        Renders what agents see; None makes the usual one the first time it is needed.
    defer_pictures
        Observations do not wait for their pictures, which must not be read before what `Simulation.picture_waiter`
        returns was called: for a recorder that looks at them later. Otherwise, pictures are worked on while the
        simulation goes on, and are there as soon as somebody asks for the observation that they are of.

    Attributes
    ----------
    state
        Everything that changes.
    look_away
        Agents whose observations have no pictures for now, though they see.
    scenario, ground_truth
        For a task's author: to change the state before the first step; for its evaluator: to ask about it.

    Raises
    ------
    InputError
        If the community belongs to another world, or a name is unknown.
    """

    def __init__(
        self,
        world: World,
        community: Community | None = None,
        config: SimConfig | None = None,
        *,
        base: SimulationBase | None = None,
        renderer: ObservationRenderer | None = None,
        defer_pictures: bool = False,
    ) -> None:
        if community is not None and community.world.digest != world.digest:
            raise InputError(
                f"simulation: the community was made for world {community.world.name!r}, not for this one "
                f"({world.manifest.name!r}); give that world, or build a community for this one"
            )
        self.base = base or SimulationBase.of(world)
        self.base.require(world)
        self.world = world
        self.defer_pictures = defer_pictures
        self.community = community
        day = None if community is None else community.date
        self.config = (config or SimConfig()).on_day(day)
        self.metrics = Metrics()
        self.residents = list(community.residents)[: self.config.residents] if community is not None else []
        days = self.base.days(community)[: len(self.residents)] if community is not None else []
        self.state = initial_state(self.base, self.residents, days, self.config, day)
        self._dressed_for = self.state.environment.weather
        robots = self.state.robots
        models = {} if robots is None else {name: robots.control_period(k) for k, name in enumerate(robots.names)}
        self.periods = ControlPeriods.of(self.state.people.names, models, self.config.periods, start=self.state.tick)
        self.punctuality = Punctuality.of(days, self.config.start)
        self.scenario, self.ground_truth = Scenario(self.state), GroundTruth(self.state)
        self.look_away: Collection[str] = ()
        self.seeing = _seeing(self.state, self.config.observe)
        self._renderer, self._attached = renderer, False
        #: Counts overlaps since `check_overlaps`; None where they are not looked for.
        self.overlap_check: OverlapCheck | None = None
        # Beginning reads all of a city; from then on people look at what is around them.
        if self.residents:
            self.base.know_things()
        world.forget()
        world.drop_pages()

    def __repr__(self) -> str:
        when = f"{self.config.date} {clock_of(int(self.state.second))}"
        names = self.agents
        first = ", ".join(names[:3]) + (", ..." if len(names) > 3 else "")
        return (
            f"Simulation(world {self.world.manifest.name!r}, {when}, step {self.metrics.steps}, "
            f"{len(names)} agents ({first}))"
        )

    # The loop.

    def step(self, actions: Mapping[str, Any], agent_faults: Mapping[str, AgentFault] | None = None) -> StepResult:
        """Advance until the next agent is due: by one second, where all agents' periods are that.

        Parameters
        ----------
        actions
            One dict by agent's name; who has none waits. Bad ones are refused with a reason; names nobody has, and
            agents that are not due, are ignored.
        agent_faults
            Agents that were late or failed, and why: they wait, and it is noted.
        """
        self.act(actions, agent_faults)
        self._advance(self.periods.next_due(self.state.tick) - self.state.tick)
        self.metrics.steps += 1
        observations, infos = self.observe(self.due)
        return StepResult(observations, infos, list(self.state.events.log), self._hash_after(self.metrics.steps))

    def _hash_after(self, step: int) -> Callable[[], str]:
        """Return what finds the hash of the state as it is now, after a step."""
        tick = self.state.tick

        def current_hash() -> str:
            if (self.metrics.steps, self.state.tick) != (step, tick):
                raise InputError(
                    f"hash: the simulation has gone on since step {step}; ask a result before the next step"
                )
            watch = StopWatch(self.metrics.seconds)
            digest = self.state_hash()
            watch.lap("hash")
            return digest

        return current_hash

    def act(self, actions: Mapping[str, Any], agent_faults: Mapping[str, AgentFault] | None = None) -> None:
        """Let the agents that are due begin what they ask for, without any time passing; see `step`."""
        state, metrics = self.state, self.metrics
        watch = StopWatch(metrics.seconds)
        due = self.periods.due(state.tick)
        names = self.due
        state.events.begin(metrics.steps, state.second, names)
        state.avatars.begin(due[: len(state.people)])
        if state.robots is not None:
            state.robots.begin(due[len(state.people) :])
        faults = agent_faults or {}
        if not due.all():
            actions = {name: actions[name] for name in names if name in actions}
            faults = {name: faults[name] for name in names if name in faults}
        metrics.refused += apply_actions(actions, faults, state)
        watch.lap("actions")

    def advance(self, seconds: float) -> None:
        """Let time pass, with all agents going on with what they do.

        However a time is cut into calls, the state after it is the same; robots' physics takes finer frames where a
        cut at an odd hundredth of a second asks for them (`vico.sim.physics.records`).

        Parameters
        ----------
        seconds
            A multiple of 0.01.

        Raises
        ------
        InputError
            If it is none.
        """
        self._advance(ticks_of(seconds, "advance: the time"))

    def _advance(self, ticks: int) -> None:
        """Let ticks pass; at every whole second it is noted who is where the schedule says."""
        state, watch = self.state, StopWatch(self.metrics.seconds)
        end = state.tick + ticks
        while state.tick < end:
            until = min(end, state.tick - state.tick % TICKS_PER_SECOND + TICKS_PER_SECOND)
            ticks_now = until - state.tick
            with self._keep_state_if_diverged(ticks_now / TICKS_PER_SECOND):
                self.metrics.collisions += advance_ticks(state, ticks_now, self.periods, watch)
            if state.tick % TICKS_PER_SECOND == 0:
                state.environment.advance(1.0)
                follow_city_events(state)
                advance_lines(state)
                state.show_signals()
                self.punctuality.watch(state)
                if state.second % _PAGES_EVERY == 0:
                    self.world.drop_pages()
            watch.lap("bookkeeping")

    @contextmanager
    def _keep_state_if_diverged(self, seconds: float) -> Iterator[None]:
        """Let a block of some seconds move robots; if their motion diverges, write the state before and restore it.

        Raises
        ------
        PhysicsError
            If it diverged, with the path of the snapshot and how to see it again.
        """
        if self.state.robots is None:
            yield
            return
        before = self.snapshot()
        try:
            yield
        except PhysicsError as error:
            self.restore(before)
            path = cache_folder() / "diverged" / f"{state_hash(before)}.npz"
            told = str(error).removesuffix("; report it with the snapshot")
            try:
                write_snapshot(path, before, owner=self.identity)
            except OutputError as failure:
                raise PhysicsError(f"{told}; the state before it could not be kept: {failure}") from error
            raise PhysicsError(
                f"{told}; the state before it is in {path}: report it with that file, the world, the community and the "
                f"configuration. Simulation.load({path.name!r}) and advance({seconds:g}) show it again"
            ) from error

    # What agents see.

    @cached_property
    def looks(self) -> list[Appearance]:
        """How people look, dressed for the weather at the start: residents, assistants, then pedestrians."""
        from vico.sim.pictures.people import looks_of  # needs the makers of bodies, which are slow to import

        walkers = len(self.state.traffic.walkers) if self.state.traffic is not None else 0
        strangers = len(self.state.people) - len(self.residents) + walkers
        return looks_of(self.residents, strangers, self.config.seed, self._dressed_for)

    @property
    def agents(self) -> list[str]:
        """Names of all agents: residents, assistants, robots."""
        return self.state.names

    @property
    def due(self) -> list[str]:
        """Names of the agents that observe and act now."""
        due = self.periods.due(self.state.tick)
        return [name for name, now in zip(self.agents, due.tolist(), strict=True) if now]

    def observe(self, who: Sequence[str] | None = None) -> tuple[Observations, ByAgent]:
        """Return observations and infos as things stand, of all agents or of some."""
        watch = StopWatch(self.metrics.seconds)
        names = self.agents
        asked = None if who is None or len(who) == len(names) else _indices(tuple(who), names)
        seeing = self.seeing if asked is None else [i for i in self.seeing if i in asked]
        if self.look_away:
            names = self.state.names
            seeing = [i for i in seeing if names[i] not in self.look_away]
        renderer = self.renderer if seeing else None
        result = observe(self.state, seeing, renderer, who=asked, waits=not self.defer_pictures)
        watch.lap("observations")
        return result

    @property
    def renderer(self) -> ObservationRenderer:
        """The renderer; made when it is first needed, for it takes seconds and much memory."""
        if self._renderer is None:
            from vico.sim.pictures.city import renderer_of

            self._renderer = renderer_of(self)
        elif not self._attached:
            self._renderer = self._renderer.rebind(self)
        self._attached = True
        return self._renderer

    def picture_waiter(self) -> Callable[[], None]:
        """Return what to call, from any thread, to wait for the pictures of the last observations."""
        return self._renderer.picture_waiter() if self._renderer is not None else lambda: None

    @property
    def existing_renderer(self) -> ObservationRenderer | None:
        """The renderer, if it was made: another simulation of the same world may use it."""
        return self._renderer

    @property
    def shapes(self) -> Mapping[str, Sequence[Surface]]:
        """Shapes of movable objects, by prototype."""
        return self.state.shapes

    def entity(self, entity: int) -> dict[str, str]:
        """Return kind and name of an entity of the world or of this run."""
        return self.state.entity(entity)

    # What a run tells of itself.

    def check_overlaps(self) -> None:
        """Look for overlaps after every sub-step from now on; `reports` tells what was found."""
        self.overlap_check = OverlapCheck(self.state)
        self.state.on_substep = self.overlap_check.look

    def reports(self) -> dict[str, Any]:
        """Return who was rescued from jams, who is stuck, and what overlapped; see `vico.sim.loop.checks`."""
        return run_reports(self.state, self.overlap_check)

    # State as a whole.

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return every array that decides the future, in a fixed order; not copied."""
        steps = {"steps": np.array([self.metrics.steps, self.metrics.collisions, self.metrics.refused])}
        punctuality = {f"punctuality.{name}": array for name, array in self.punctuality.arrays().items()}
        return steps | self.state.arrays() | punctuality

    def state_hash(self) -> str:
        """Return the hash of the whole state, hex."""
        return state_hash(self.arrays())

    def snapshot(self) -> dict[str, NDArray[Any]]:
        """Return a copy of the whole state; `restore` goes back to it."""
        return {name: np.array(array, copy=True) for name, array in self.arrays().items()}

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go back to a snapshot of a simulation made in the same way."""
        steps, collisions, refused = (int(value) for value in arrays["steps"])
        self.metrics.steps, self.metrics.collisions, self.metrics.refused = steps, collisions, refused
        self.state.restore(arrays)
        self.punctuality.restore(arrays_of(arrays, "punctuality"))

    @contextmanager
    def branch(self) -> Iterator[Simulation]:
        """Let a planner try what would happen: whatever is done in the block is undone after it.

        Only the state goes back; views rendered in the block, and wall-clock seconds, do not.
        """
        before, log = self.snapshot(), list(self.state.events.log)
        try:
            yield self
        finally:
            self.restore(before)
            self.state.events.log = log

    def save(self, path: Path) -> None:
        """Write a snapshot file (``.npz``, no pickle)."""
        write_snapshot(path, self.arrays(), owner=self.identity)

    def load(self, path: Path) -> None:
        """Go back to a snapshot file of a simulation made in the same way."""
        self.restore(read_snapshot(path, owner=self.identity))

    @property
    def identity(self) -> str:
        """Version, configuration, world, community and objects in one hash: equal ones run equally."""
        residents = [resident.id for resident in self.residents]
        return identity(self.config.record(), self.world.digest, residents, self.state.objects.names)


def _seeing(state: SimulationState, observe: Sequence[str] | None) -> list[int]:
    """Return the indices of the agents whose views are rendered: of all that have eyes or a camera, unless told."""
    names = state.names
    blind = (
        [] if state.robots is None else [name for k, name in enumerate(state.robots.names) if not state.robots.sees(k)]
    )
    if observe is None:
        return [i for i, name in enumerate(names) if name not in blind]
    people = state.people
    called = dict(zip(names, names, strict=True))
    called |= {name: state.entities[k]["name"] for k, name in zip(people.entity.tolist(), people.names, strict=True)}
    asked = [find_by_name(name, called, option="observe") for name in observe]
    for name in asked:
        if name in blind:
            raise InputError(f"observe: {name} has no camera; leave it out")
    return _indices(asked, names)


def _indices(observe: Sequence[str], names: list[str]) -> list[int]:
    """Return the indices of agents by their names."""
    unknown = [name for name in observe if name not in names]
    if unknown:
        raise InputError(f"observe: nobody is called {unknown[0]!r}; there are {some_of(names)}")
    return [names.index(name) for name in observe]
