"""The toy city as a run that goes on with the viewer beside it, in a thread of the test."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import toy_city
from vico.agents.base import Agent
from vico.agents.schedule import followers_of
from vico.runner.control import Control
from vico.runner.gather import FaultLog, Gatherer
from vico.runner.loop import Runner
from vico.runner.recording import RecordedRun
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.sim.recording.recorder import Recorder
from vico.viewer.live import LiveViewer
from vico.viewer.play import PlayedAgent
from vico.world.public import PublicMap


class LiveToy:
    """What a test reaches of it."""

    def __init__(self, sim: Simulation, control: Control, viewer: LiveViewer, thread: threading.Thread) -> None:
        self.sim, self.control, self.viewer, self._thread = sim, control, viewer, thread

    @property
    def url(self) -> str:
        """The page's address."""
        return self.viewer.url

    def join(self) -> None:
        """Wait for the end of the run."""
        self._thread.join(60.0)
        assert not self._thread.is_alive()


@contextmanager
def live_toy(
    out: Path,
    *,
    steps: int = 100_000,
    control: Control | None = None,
    player: PlayedAgent | None = None,
    idle: float = 0.0,
    **config: Any,
) -> Iterator[LiveToy]:
    """Run it until the block ends, or `steps` are made."""
    world, people = toy_city.world(), toy_city.community()
    sim = Simulation(world, people, SimConfig(observe=(), image=64, **config))
    followers = followers_of(people, PublicMap.from_world(world), seed=0)
    everybody: Mapping[str, Agent] = followers | ({} if player is None else {player.agent: player.human})
    agents = Gatherer(everybody, trusted=everybody)
    hands = control or Control(out)
    recorder = Recorder(out, sim, sources={}, wanted=steps)
    with LiveViewer(hands, world, player=player, idle=idle) as viewer:
        viewer.show(recorder, agents)

        def run() -> None:
            with recorder:
                faults = FaultLog()
                hooks = [RecordedRun(recorder, faults, notes=hands.notes), viewer]
                runner = Runner(sim, agents, hooks=hooks, faults=faults, director=hands.before_step)
                runner.run(steps, until=lambda: hands.over)
            hands.end()

        thread = threading.Thread(target=run)
        thread.start()
        toy = LiveToy(sim, hands, viewer, thread)
        try:
            yield toy
        finally:
            hands.command("stop", {})
            toy.join()
