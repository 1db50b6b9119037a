"""What episodes of several challenges have in common: things that are set up, agents from elsewhere, progress."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from vico.agents.base import Agent
from vico.assets.models.movable import movable_kinds, movable_prototype, movable_surfaces
from vico.challenges.assistant.model import TaskObject
from vico.challenges.records import Progress
from vico.envs import Simulation
from vico.errors import InputError
from vico.runner.foreign import AbsentAgent, Terms, foreign_agents
from vico.runner.gather import Gatherer
from vico.runner.loading import AgentSeat
from vico.runner.loop import Hook, Runner, Step
from vico.runner.recording import RecordedOnce, recorded_in
from vico.world.folder import World


def put_thing(simulation: Simulation, thing: TaskObject) -> None:
    """Put a thing of a task where it is at the start: into somebody's hand, or where it lies.

    Raises
    ------
    InputError
        If there is no room for it there.
    """
    kind = movable_kinds()[thing.kind]
    shape, prototype = movable_surfaces(kind.kind, thing.colour), movable_prototype(kind.kind, thing.colour)
    if thing.holder is not None:
        simulation.scenario.hand_object(thing.name, prototype, shape, thing.holder, size=kind.size)
        return
    simulation.scenario.add_object(
        thing.name, prototype, shape, thing.position, room=thing.room or "", size=kind.size, yaw=thing.yaw
    )


def robots_from_elsewhere(
    method: str, names: Sequence[str], told: Mapping[str, Any], world: World, terms: Terms, *, seed: int
) -> dict[str, Agent]:
    """Make the robots of an episode by ``my_module:MyRobot``; those that can't be made fail at each of its steps."""
    made: dict[str, Agent] = {}
    for i, name in enumerate(names):
        try:
            made |= foreign_agents(method, [AgentSeat(name, seed, [dict(told)], i, len(names))], world, terms)
        except InputError as error:
            made[name] = AbsentAgent(str(error))
    return made


class ReportedSeconds(Hook):
    """Tells how far an episode is whose steps are not seconds.

    Parameters
    ----------
    label
        Under which it is told.
    limit
        Seconds at most.
    """

    def __init__(self, progress: Progress, sim: Simulation, *, label: str, limit: int) -> None:
        self._progress, self._label = progress, label
        self._sim, self._limit, self._start = sim, limit, sim.state.second

    def stepped(self, step: Step) -> None:
        """Tell it."""
        self._progress(self._label, int(self._sim.state.second - self._start), self._limit)


def play_out(
    runner: Runner, agents: Gatherer, *, over: Callable[[], bool], seconds: int, period: float, recording: Path | None
) -> None:
    """Let an episode go on until it is over, or its time is; in the end its agents are let go.

    Parameters
    ----------
    over
        Says whether there is a verdict.
    period
        Seconds between two actions of a robot.
    recording
        Folder to which the run is recorded; None records nothing.
    """
    sim = runner.sim
    with ExitStack() as stack:
        stack.callback(agents.close)
        if recording is not None:
            recorded: RecordedOnce = stack.enter_context(
                recorded_in(recording, sim, runner.faults, wanted=round(seconds / period))
            )
            runner.hooks.append(recorded)
        end = sim.state.second + seconds
        runner.run(100 * seconds, until=lambda: over() or sim.state.second >= end)
