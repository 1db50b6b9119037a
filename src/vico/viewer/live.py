"""A run that goes on, with the viewer beside it: its steps are kept for the page, and the page's hands reach it."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from vico.agents.base import plan_record
from vico.errors import InputError
from vico.runner.control import Control, wait_for
from vico.runner.gather import Gatherer
from vico.runner.loop import Hook, Runner, Step
from vico.sim.recording.recorder import Recorder
from vico.viewer.play import PlayedAgent
from vico.viewer.server.serve import ViewerServer
from vico.viewer.server.state import ViewerState
from vico.viewer.sources.source import Source
from vico.viewer.sources.tables import LiveTables
from vico.viewer.sources.views import AgentView, NoPictureError, RecordedViews, picture_of, render_agent_view
from vico.world.world import World

# Seconds that pictures and plans are waited for: a first picture needs the scene to be made.
_PICTURE_WITHIN, _PLAN_WITHIN = 60.0, 5.0


class LiveViewer(Hook):
    """Follows a run and shows it; a hook after the one that records.

    Parameters
    ----------
    control
        Of the run.
    world
        Where it happens.
    city
        Folder of the world's static files; None where there are none.
    player
        Who is played by a person at the page; None for nobody.
    port
        To listen on; 0 takes the one that the run was shown on before, or a free one.
    hosts
        Names of hosts, beside this machine's own, under which the page is shown.
    idle
        Seconds without any page connected after which the run waits for one; 0 for never.
    """

    def __init__(
        self,
        control: Control,
        world: World,
        *,
        city: Path | None = None,
        player: PlayedAgent | None = None,
        port: int = 0,
        hosts: Sequence[str] = (),
        idle: float = 0.0,
    ) -> None:
        self.control = control
        self._world, self._city, self._player, self._port = world, city, player, port
        self._hosts, self._idle = hosts, idle
        # When the last page left, on a clock that never goes back; None while there is one.
        self._left: float | None = time.monotonic()
        self._server: ViewerServer | None = None
        self._recorder: Recorder | None = None
        self._tables = LiveTables(control.out)
        self._seen: tuple[str, int, AgentView] | None = None
        self._recorded: RecordedViews | None = None
        #: Told the address once the page is there.
        self.announce: Callable[[str], None] = lambda url: None
        #: Told the time of day, seconds, at which the run waits because no page is there.
        self.announce_idle: Callable[[float], None] = lambda second: None

    @property
    def url(self) -> str:
        """What to open in a browser."""
        assert self._server is not None
        return self._server.url

    @property
    def source(self) -> Source:
        """What the page is shown."""
        assert self._server is not None
        return self._server.state.source

    def show(self, recorder: Recorder, agents: Gatherer) -> None:
        """Show the run that a recorder begins or goes on with; begin to serve it, or tell the pages that it is another.

        Parameters
        ----------
        agents
            Who may be asked for their plans.
        """
        self._recorder, self._recorded, self._seen = recorder, None, None
        self._tables = LiveTables(recorder.out)
        self._tables.begin()
        source = Source(recorder.out, self._tables, self._world, live=True)
        source.plans = lambda names: self._plans(agents, names)
        if self._server is None:
            state = ViewerState(source, self.view, city=self._city, hands=self.control, player=self._player)
            state.visited = self._note_visitors
            self._server = ViewerServer(state, port=self._port, keep=recorder.out, hosts=self._hosts).__enter__()
            self.announce(self.url)
        else:
            self._server.change_source(source)

    def begin(self, observations: Mapping[str, dict[str, Any]]) -> None:
        """Take in how things stand before the first step."""
        assert self._recorder is not None
        if self._left is not None:
            self._left = time.monotonic()
        self._tables.begin()
        if self._recorder.latest:
            self._tables.add(0, self._recorder.latest, self._recorder.latest_cast)
        if self._player is not None:
            self._player.tell(self._recorder.sim)

    def on_step(self, step: Step) -> None:
        """Keep a step, and say that it is there."""
        assert self._recorder is not None
        self._tables.add(step.number, self._recorder.latest, self._recorder.latest_cast)
        if self._player is not None:
            self._player.tell(self._recorder.sim)
        if self._server is not None:
            self._server.notify()
        if self._idle and self._left is not None and time.monotonic() - self._left > self._idle:
            self.control.attend(False)
            self.announce_idle(self._recorder.sim.state.second)

    def _note_visitors(self, clients: int) -> None:
        """Note whether a page is there; asked by the server's thread."""
        self._left = None if clients else time.monotonic()
        if clients:
            self.control.attend(True)

    def view(self, agent: str, step: int, output: str) -> tuple[bytes | dict[str, Any], str]:
        """Return what an agent sees: now, rendered between two steps, or at an earlier step, from the recording."""
        seen = self._seen
        if seen is not None and seen[:2] == (agent, step):
            return picture_of(seen[2], output)
        if step < self._tables.last or self.control.told()["status"] == "ended":
            run = self._tables.run
            if run is None or run.last < step:
                raise NoPictureError(f"step {step} is not written yet: look at it again in a minute")
            self._recorded = self._recorded or RecordedViews(run)
            return self._recorded.view(agent, step, output)

        def render(runner: Runner) -> tuple[int, AgentView]:
            return runner.sim.metrics.steps, render_agent_view(runner.sim, agent)

        at, found = wait_for(self.control.ask(render), _PICTURE_WITHIN)
        self._seen = agent, at, found
        return picture_of(found, output)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.control.end()
        if self._server is not None:
            self._server.__exit__(kind, error, trace)

    def _plans(self, agents: Gatherer, names: Sequence[str]) -> Mapping[str, Any]:
        def ask(runner: Runner) -> dict[str, Any]:
            found = {
                name: plan_record(agents.agents[name], runner.sim.state.second)
                for name in names
                if name in agents.agents
            }
            return {name: plan for name, plan in found.items() if plan is not None}

        if self.control.told()["status"] == "ended":
            return {}
        try:
            return wait_for(self.control.ask(ask), _PLAN_WITHIN)
        except InputError:
            # The run makes a first picture, or ends: how somebody is can be told without their plans.
            return {}
